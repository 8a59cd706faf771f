"""What the package rests on: every requirement is bounded, locked for CI, and free of the GPL."""

from __future__ import annotations

import re
import tomllib
from importlib.metadata import Distribution, distribution
from itertools import chain
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

ROOT = Path(__file__).resolve().parents[2]
with (ROOT / "pyproject.toml").open("rb") as _file:
    PROJECT = tomllib.load(_file)
EXTRAS = PROJECT["project"]["optional-dependencies"]
_TEXTS = [*PROJECT["build-system"]["requires"], *PROJECT["project"]["dependencies"], *chain.from_iterable(EXTRAS.values())]
#: What is asked for by name, the package's own extras aside.
REQUIREMENTS = [requirement for requirement in map(Requirement, _TEXTS) if requirement.name != "rcsa-ident"]
#: Versions that are dates: a higher first number promises and breaks nothing.
CALENDAR = {"dask", "distributed", "packaging"}
LOCK = (ROOT / ".ci" / "constraints.txt").read_text(encoding="utf-8").splitlines()[1:]
#: Under the LGPL, which asks nothing of who imports them unchanged.
LESSER = {"moocore", "nptdms", "psycopg", "psycopg-binary"}
#: In the public domain but for single files: an editor's mode under the GPL is the only reason why the GPL is named, and is not installed.
PUBLIC_DOMAIN = {"docutils"}


def test_requirements_are_bounded_below_and_where_a_release_may_break_them():
    bounds = {str(each): {bound.operator for bound in each.specifier} for each in REQUIREMENTS}
    assert bounds == {str(each): {">="} if each.name in CALENDAR else {">=", "<"} for each in REQUIREMENTS}


def test_the_lock_names_versions_and_nothing_else():
    """No index, no path: whoever installs takes them from where he takes packages."""
    assert not [line for line in LOCK if not re.fullmatch(r"[a-z0-9.-]+==[0-9][0-9a-z.]*( ; [a-z_0-9. ()'<>=!-]+)?", line, re.IGNORECASE)]


def test_the_lock_keeps_every_requirement_within_its_bounds():
    locked = [line.partition(" ")[0].partition("==") for line in LOCK]
    versions = {each: [version for name, _, version in locked if name == canonicalize_name(each.name)] for each in REQUIREMENTS}
    left = [str(each) for each, found in versions.items() if not found or any(Version(one) not in each.specifier for one in found)]
    assert left == [], "run .ci/lock"


def test_the_image_installs_those_versions_by_their_hashes():
    lines = (ROOT / ".ci" / "image.txt").read_text(encoding="utf-8").replace(" \\\n   ", "").splitlines()[1:]
    pins = [line.partition(" --hash=sha256:")[0] for line in lines]
    assert all(re.fullmatch(r".+?( --hash=sha256:[0-9a-f]{64})+", line) for line in lines)
    assert set(pins) <= set(LOCK), "run .ci/lock"
    wanted = map(
        Requirement, [*PROJECT["build-system"]["requires"], *PROJECT["project"]["dependencies"], *EXTRAS["tdms"], *EXTRAS["parquet"]]
    )
    assert {canonicalize_name(each.name) for each in wanted} <= {pin.partition("==")[0] for pin in pins}


def installed() -> list[Distribution]:
    """Return everything that the package and its extras bring to this machine."""
    waiting = [("rcsa-ident", extra) for extra in ("", *EXTRAS)]
    found: dict[str, Distribution] = {}
    for name, extra in waiting:  # which grows
        found[name] = found.get(name) or distribution(name)
        for text in found[name].requires or ():
            requirement = Requirement(text)
            if requirement.marker is None or requirement.marker.evaluate({"extra": extra}):
                needed = canonicalize_name(requirement.name)
                waiting += [key for each in ("", *requirement.extras) if (key := (needed, each)) not in waiting]
    return list(found.values())


def licence(found: Distribution) -> str:
    """Return what a distribution says of its licence, the most exact first."""
    metadata = found.metadata
    classified = [line for line in metadata.get_all("Classifier") or () if line.startswith("License :: ")]
    text = metadata.get("License-Expression") or " ".join(classified) or metadata.get("License") or ""
    # some that name none carry its text alone
    files = [path for path in found.files or () if path.name.upper().startswith(("LICENSE", "LICENCE", "COPYING"))]
    return text or "\n".join(path.read_text() for path in files)


def test_every_licence_is_known_and_none_is_the_gpl():
    said = {canonicalize_name(found.name): licence(found) for found in installed()}
    assert len(said) > 80
    assert not [name for name, text in said.items() if not text]
    general = re.compile(r"\bA?GPL|(?<!Lesser )General Public License|Affero", re.IGNORECASE)
    assert {name for name, text in said.items() if general.search(text)} <= PUBLIC_DOMAIN
    assert all(not [path for path in distribution(name).files or () if path.suffix == ".el"] for name in PUBLIC_DOMAIN)
    assert {name for name, text in said.items() if re.search(r"LGPL|Lesser", text)} == LESSER
