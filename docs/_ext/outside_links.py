"""Links from a page to a file outside docs/: GitHub shows that file, the site has none.

Where pyproject.toml names a repository (`[project.urls] Repository`), the link leads there; otherwise its text stays, as plain words.
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform

ROOT = Path(__file__).resolve().parents[2]


class OutsideLinks(SphinxTransform):
    """Take links that leave docs/ before somebody looks for their pages."""

    default_priority = 5

    def apply(self, **_: Any) -> None:
        page = Path(self.env.doc2path(self.env.docname)).parent
        for node in [*self.document.findall(addnodes.pending_xref), *self.document.findall(addnodes.download_reference)]:
            target = (page / node.get("reftarget", "").partition("#")[0]).resolve()
            if not target.is_relative_to(self.env.srcdir) and target.is_relative_to(ROOT) and target.exists():
                node.replace_self(self._elsewhere(node, target))

    def _elsewhere(self, node: nodes.Element, target: Path) -> list[nodes.Node]:
        repository = self.config.repository.rstrip("/")
        if not repository:
            return node.children
        kind = "tree" if target.is_dir() else "blob"
        address = f"{repository}/{kind}/main/{target.relative_to(ROOT).as_posix()}"
        return [nodes.reference("", "", *node.children, refuri=address, internal=False)]


def setup(app: Sphinx) -> dict[str, Any]:
    with (ROOT / "pyproject.toml").open("rb") as file:
        urls = tomllib.load(file)["project"].get("urls", {})
    app.add_config_value("repository", urls.get("Repository", ""), "env")
    app.add_transform(OutsideLinks)
    return {"parallel_read_safe": True}
