"""Files that travel with the package: where they lie, installed or in a checkout."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from rcsa_ident.base.errors import InputError


def sample_data() -> Path:
    """Return the folder of the virtual machines: inside an installed package, or the repository's ``data/machines``."""
    return _carried("sample_data", "machines", "hpm.toml")


def sample_robots() -> dict[str, Path]:
    """Return the files of the published arms by their names."""
    return {path.stem: path for path in sorted(_carried("sample_robots", "robots", "tx200.toml").glob("*.toml"))}


def _carried(packed: str, folder: str, member: str) -> Path:
    """Return where the package has a folder of the repository's data, known by one of its files."""
    package = Path(str(files("rcsa_ident")))
    for found in (package / packed, package.parent / "data" / folder):
        if (found / member).is_file():
            return found
    raise InputError("sample data", "none beside the package", "an installed package, or a checkout of its repository", str(package))
