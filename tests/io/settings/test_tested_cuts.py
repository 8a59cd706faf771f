"""CUTS.csv."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.settings.tested_cuts import read_tested_cuts
from rcsa_ident.stability.labels.tested_cuts import Verdict

HEADER = "spindle_speed_rpm,axial_depth_mm,verdict\n"


def test_cuts_are_read_in_si(tmp_path):
    path = tmp_path / "CUTS.csv"
    path.write_text(
        "verdict;axial_depth_mm;note;spindle_speed_rpm\nstable;0,5;a;6000\nChatter;1;;9000\nmarginal;2;;12000\n", encoding="utf-8"
    )
    cuts = read_tested_cuts(path)
    np.testing.assert_allclose(cuts.spindle_speed, np.array([100.0, 150.0, 200.0]) * 2.0 * np.pi)
    np.testing.assert_allclose(cuts.axial_depth, [5e-4, 1e-3, 2e-3])
    assert cuts.verdict == (Verdict.STABLE, Verdict.CHATTER, Verdict.MARGINAL)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (HEADER, "at least one line"),
        ("spindle_speed_rpm,verdict\n1,stable\n", "column axial_depth_mm: found only"),
        (HEADER.replace("\n", ",verdict\n") + "1,1,stable,stable\n", "column verdict: found two columns"),
        (HEADER + "6000,1,stable\n6000,1,wobbly\n", "line 3: column verdict: found wobbly, allowed is one of stable, chatter, marginal"),
        (HEADER + "6000,1,\n", "line 2: column verdict: found nothing"),
        (HEADER + "0,1,stable\n", "line 2: column spindle_speed_rpm: found 0"),
        (HEADER + "6000,-1,stable\n", "line 2: column axial_depth_mm: found -1"),
        (HEADER + "6000,,stable\n", "line 2: column axial_depth_mm: found nan"),
        (HEADER + "6000,x,stable\n", "line 2: column axial_depth_mm: found x"),
    ],
)
def test_cuts_that_are_not_read(tmp_path, text, words):
    path = tmp_path / "CUTS.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_tested_cuts(path)
    assert words in str(caught.value)
