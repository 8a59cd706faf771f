"""Figures that others published of their own files."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks import real_files


def test_the_face_mill_has_its_published_minimum():
    if not all(path.exists() for path in real_files.FACE_MILL):
        pytest.skip("the face mill's FRFs are not beside the project")
    found = real_files.face_mill()
    assert found.absolute_limit == pytest.approx(1.015e-3, rel=1e-3)
    assert found.absolute_frequency / (2.0 * np.pi) == pytest.approx(1441.0, abs=0.6)


@pytest.mark.parametrize("name", ["multi-frequency", "full-discretisation"])
def test_accurate_lobes_tell_the_published_share_of_the_labelled_cuts_right(name):
    """73.7 % of 118 are 87 cuts."""
    if not real_files.CUTS.exists():
        pytest.skip("the labelled cuts are not beside the project")
    found = real_files.labelled(real_files.METHODS[name])
    assert found.decided == 118
    assert found.stable_stable + found.chatter_chatter == 87


def test_the_rows_are_those_of_the_files_that_are_there(monkeypatch, tmp_path):
    monkeypatch.setattr(real_files, "FACE_MILL", (tmp_path / "x.frf",))
    monkeypatch.setattr(real_files, "CUTS", tmp_path / "none.csv")
    assert real_files.run() == []
