"""What the commands read, made by hand."""

from __future__ import annotations

from pathlib import Path

import pytest

from rcsa_ident.identification.result import Identification
from tests.fixtures import by_hand


@pytest.fixture
def tooling_file(tmp_path: Path) -> Path:
    path = tmp_path / "T1.toml"
    path.write_text(by_hand.TOOLING, encoding="utf-8")
    return path


@pytest.fixture
def identification() -> Identification:
    return by_hand.identification()
