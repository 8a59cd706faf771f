"""The JSON Schemas of the TOML files, as `rcsa-ident schema` writes them, for reference/schemas.md to hand out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from _ext.pages import write
from sphinx.application import Sphinx


def write_schemas(app: Sphinx) -> None:
    from rcsa_ident.io.settings.schemas import SCHEMAS, schema_text

    write(Path(app.srcdir) / "reference" / "schemas", {f"{name}.json": schema_text(name) for name in SCHEMAS})


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("builder-inited", write_schemas)
    return {"parallel_read_safe": True}
