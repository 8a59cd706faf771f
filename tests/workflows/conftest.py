"""What the commands read, made by hand, and toolings of the sample machine."""

from __future__ import annotations

from pathlib import Path

import pytest

from rcsa_ident.identification.result import Identification
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.setup.tooling import Tooling
from tests.fixtures import by_hand
from tests.fixtures.paths import TOOLINGS


@pytest.fixture
def tooling_file(tmp_path: Path) -> Path:
    path = tmp_path / "T1.toml"
    path.write_text(by_hand.TOOLING, encoding="utf-8")
    return path


@pytest.fixture
def identification() -> Identification:
    return by_hand.identification()


@pytest.fixture(scope="package")
def toolings() -> list[Tooling]:
    """Those of the sample campaign, with which plans cut."""
    return [read_tooling(TOOLINGS / f"{name}.toml") for name in ("S1-ER32", "S2-PG25")]


@pytest.fixture(scope="package")
def targets() -> list[Tooling]:
    """Those that plans are for."""
    return [read_tooling(TOOLINGS / f"{name}.toml") for name in ("S3-PG25-long", "S4-shrink")]
