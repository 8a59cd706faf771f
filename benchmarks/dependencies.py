"""What the package rests on: version, licence, size and company of every requirement, as installed here.

``python -m benchmarks dependencies [--releases TABLE] [--out docs/dependencies.md]``. Sizes are what the wheels' own records say. No
network is needed; ``--releases`` names a table with the columns name, version and month of each package's newest release.
"""

from __future__ import annotations

import argparse
import csv
import tomllib
from collections.abc import Iterable
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

ROOT = Path(__file__).resolve().parents[1]
#: Requirements of the base before rtoml, tomli-w, tomlkit, psutil, filelock and threadpoolctl were taken in (November 2026).
BEFORE = [
    "numpy",
    "scipy",
    "pymoo",
    "numba",
    "filterpy",
    "control",
    "fastapi",
    "pydantic",
    "uvicorn",
    "h5py",
    "typer",
    "rich",
    "matplotlib",
    "jinja2",
    "sqlalchemy",
    "prometheus-client",
    "dbos",
    "python-multipart",
    "websockets",
]
#: Requirements that only `rcsa-ident-serve` has, fastapi and pydantic with what they need left out: these two are asked for.
SERVICE = {"pydantic-settings", "uvicorn", "sqlalchemy", "alembic", "prometheus-client", "dbos", "multipart", "websockets"}
_HEAD = """# What the package rests on

Written by `python -m benchmarks dependencies --out docs/dependencies.md`, from what is installed. "Brings" counts the packages that a
requirement needs, itself left out; many share them. "Alone" is what an installation without the requirement would lack: what no other one
needs. Newest
releases are those of the table that `--releases` names; a dash where it has none, or one older than what is installed.

| requirement | installed | licence | MB | brings | with them, MB | alone, MB | newest release |
|---|---|---|---|---|---|---|---|
"""


def main(arguments: list[str]) -> None:
    """Print the table, or write it."""
    parser = argparse.ArgumentParser(prog="benchmarks dependencies", description=__doc__)
    parser.add_argument("--releases", type=Path, help="tab-separated, with a head of name, version, month")
    parser.add_argument("--out", type=Path)
    given = parser.parse_args(arguments)
    text = table({} if given.releases is None else _releases(given.releases))
    if given.out is None:
        print(text, end="")
    else:
        given.out.write_text(text, encoding="utf-8")


def table(releases: dict[str, str]) -> str:
    """Return the page, with the newest release of those packages that it is told of."""
    names = required()
    alone = {name: _size(needed(names).values()) - _size(needed(each for each in names if each != name).values()) for name in names}
    rows = [_row(name, alone[name], releases.get(name, "0")) for name in names]
    now, before = needed(names), needed(name for name in BEFORE if _installed(name))
    ends = [
        f"\nThe base install: {len(now)} packages, {_size(now.values()):.0f} MB; what was required before comes to {len(before)} packages, "
        f"{_size(before.values()):.0f} MB, in the versions of now.",
        "What came: " + ", ".join(sorted(set(now) - set(before))) + ".",
        "The largest packages [MB]: " + ", ".join(f"{_size([each]):.0f} {each.name}" for each in _largest(now.values(), 10)) + ".",
        f"What nothing but the service needs: {_size(now.values()) - _size(needed(set(names) - SERVICE).values()):.0f} MB.",
    ]
    return _HEAD + "\n".join([*rows, *ends]) + "\n"


def required() -> list[str]:
    """Return the names of the package's own requirements, extras left out."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        return [canonicalize_name(Requirement(text).name) for text in tomllib.load(file)["project"]["dependencies"]]


def needed(names: Iterable[str]) -> dict[str, Distribution]:
    """Return what these packages need on this machine, themselves included."""
    waiting = [(canonicalize_name(name), "") for name in names]
    found: dict[str, Distribution] = {}
    for name, extra in waiting:  # which grows
        found[name] = found.get(name) or distribution(name)
        for text in found[name].requires or ():
            requirement = Requirement(text)
            if requirement.marker is None or requirement.marker.evaluate({"extra": extra}):
                other = canonicalize_name(requirement.name)
                waiting += [key for each in ("", *requirement.extras) if (key := (other, each)) not in waiting]
    return found


def _largest(packages: Iterable[Distribution], count: int) -> list[Distribution]:
    return sorted(packages, key=lambda each: -_size([each]))[:count]


def _row(name: str, alone: float, release: str) -> str:
    own, whole = distribution(name), needed([name])
    sizes = f"{_size([own]):.1f} | {len(whole) - 1} | {_size(whole.values()):.0f} | {alone:.1f}"
    # a list may be older than what is installed
    newest = release if Version(release.partition(",")[0]) >= Version(own.version) else "–"
    return f"| {name} | {own.version} | {_licence(own)} | {sizes} | {newest} |"


def _installed(name: str) -> bool:
    try:
        return bool(distribution(name))
    except PackageNotFoundError:
        return False


def _size(packages: Iterable[Distribution]) -> float:
    """What their records list, compiled Python aside [MB]."""
    return sum(file.size or 0 for package in packages for file in package.files or ()) / 1e6


def _licence(found: Distribution) -> str:
    classified = [line.rpartition(" :: ")[2] for line in found.metadata.get_all("Classifier") or () if line.startswith("License :: ")]
    text = found.metadata.get("License-Expression") or " ".join(classified) or found.metadata.get("License") or ""
    if not text:  # some that name none carry its text alone, whose first line is its name
        files = [path for path in found.files or () if path.name.upper().startswith(("LICENSE", "LICENCE", "COPYING"))]
        text = next((line for path in files for line in path.read_text().splitlines() if line.strip()), "–")
    return text.strip().splitlines()[0].strip()[:60]


def _releases(path: Path) -> dict[str, str]:
    with path.open(encoding="utf-8", newline="") as file:
        rows = csv.DictReader(file, delimiter="\t", quoting=csv.QUOTE_NONE)
        return {canonicalize_name(row["name"]): f"{row['version']}, {row['month']}" for row in rows}
