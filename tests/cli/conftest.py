"""A result file and a campaign that the commands can read."""

from __future__ import annotations

from pathlib import Path

import pytest

from rcsa_ident.io.results.identifications import identification_to_json
from rcsa_ident.io.results.parts import write_result
from tests.fixtures import by_hand
from tests.fixtures.campaign import part_of_the_sample_runs


@pytest.fixture
def result_file(tmp_path: Path) -> Path:
    """Of a machine that stays what it is at all speeds; T1.toml lies beside it."""
    return written(tmp_path / "RESULT.json", False)


@pytest.fixture
def softening_file(tmp_path: Path) -> Path:
    """Of one that changes with speed."""
    return written(tmp_path / "SOFT.json", True)


@pytest.fixture
def certain_file(tmp_path: Path) -> Path:
    """Of a machine whose number of modes nobody doubts: its bands are those of one Gaussian."""
    return written(tmp_path / "CERTAIN.json", False, rivals=0)


def written(path: Path, softening: bool, rivals: int = 1) -> Path:
    found = by_hand.identification(softening, rivals)
    write_result(path, identification_to_json(found, by_hand.campaign(path.parent), by_hand.LEFT_OUT))
    return path


@pytest.fixture
def tooling_file(tmp_path: Path) -> Path:
    """T1 alone."""
    path = tmp_path / "T1.toml"
    path.write_text(by_hand.TOOLING, encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def small_campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Every fourth cut of the sample runs."""
    return part_of_the_sample_runs(tmp_path_factory.mktemp("small"), 4)
