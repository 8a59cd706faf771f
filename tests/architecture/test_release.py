"""What a release says of itself, in several places, is one thing."""

from __future__ import annotations

import re
import tomllib

import pytest

from rcsa_ident import __version__
from tests.fixtures.paths import ROOT

#: Requirements by their names on conda-forge, where these differ.
CONDA = {"soundfile": "pysoundfile", "matplotlib": "matplotlib-base", "prometheus-client": "prometheus_client"}


def listed(key: str) -> list[str]:
    """Return the requirements that the conda recipe has under a key."""
    found = re.search(rf"^  {key}:\n((?:    - .*\n)+)", (ROOT / ".conda" / "recipe.yaml").read_text(), re.MULTILINE)
    assert found is not None
    return [line.removeprefix("    - ") for line in found[1].splitlines()]


def conda(requirement: str) -> str:
    name, bounds = re.fullmatch(r"([\w.-]+)(.*)", requirement).groups()  # type: ignore[union-attr]
    return f"{CONDA.get(name, name)} {bounds}"


def test_the_conda_recipe_asks_for_what_pyproject_asks_for():
    with (ROOT / "pyproject.toml").open("rb") as file:
        told = tomllib.load(file)
    python = f"python {told['project']['requires-python']}"
    assert listed("run") == [python, *map(conda, told["project"]["dependencies"])]
    assert listed("host") == [python, "pip", *map(conda, told["build-system"]["requires"])]
    recipe = (ROOT / ".conda" / "recipe.yaml").read_text()
    assert [f"{name} = {where}" in recipe for name, where in told["project"]["scripts"].items()] == [True, True]


@pytest.mark.parametrize(
    ("name", "pattern"),
    [
        ("CITATION.cff", r"^version: ([\d.]+)$"),
        (".conda/recipe.yaml", r'^  version: "([\d.]+)"$'),
        ("CHANGELOG.md", r"^## \[(\d[\d.]+)\] - \d{4}-\d\d-\d\d$"),
    ],
)
def test_every_place_names_the_same_release(name, pattern):
    found = re.search(pattern, (ROOT / name).read_text(), re.MULTILINE)
    assert found is not None
    assert found[1] == __version__


def test_the_citation_has_the_day_of_the_release():
    day = re.search(r"^date-released: (\S+)$", (ROOT / "CITATION.cff").read_text(), re.MULTILINE)
    assert day is not None
    assert f"## [{__version__}] - {day[1]}" in (ROOT / "CHANGELOG.md").read_text()
