"""CUTS.csv."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.settings.tested_cuts import read_tested_cuts, write_tests
from rcsa_ident.stability.labels.coverage import Covered, TestedAnswers
from rcsa_ident.stability.labels.tested_cuts import OwnConditions, Verdict

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


OWN = HEADER.replace("\n", ",verdict_2,radial_width_mm,strategy,feed_per_tooth_mm,edge_state,session\n")


def test_what_cuts_tell_of_themselves_is_read_and_written(tmp_path):
    path = tmp_path / "CUTS.csv"
    path.write_text(OWN + "6000,1,0,2,0.5,Up,0.1,worn,monday\n6000,2,chatter,,,,,,\n", encoding="utf-8")
    cuts = read_tested_cuts(path)
    assert cuts.own[0] == OwnConditions(0.5e-3, None, "up", 0.1e-3, "worn", "monday", (Verdict.CHATTER,))
    assert cuts.own[1] == OwnConditions()
    assert cuts.verdict == (Verdict.STABLE, Verdict.CHATTER)
    write_tests(path, cuts, TestedAnswers(np.array([0.25, 0.75]), (Covered.YES, Covered.NO)))
    rows = path.read_text(encoding="utf-8").splitlines()
    assert rows[0].endswith("probability_stable,covered")
    assert rows[1] == "6000,1,stable,0.5,0.1,up,worn,monday,chatter,0.25,yes"
    assert read_tested_cuts(path).own == cuts.own


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (HEADER, "at least one line"),
        ("spindle_speed_rpm,verdict\n1,stable\n", "column axial_depth_mm: found only"),
        (HEADER.replace("\n", ",verdict\n") + "1,1,stable,stable\n", "column verdict: found two columns"),
        (
            HEADER + "6000,1,stable\n6000,1,wobbly\n",
            "line 3: column verdict: found wobbly, allowed is one of stable, chatter, marginal, or 0, 1, 2",
        ),
        (HEADER + "6000,1,\n", "line 2: column verdict: found nothing"),
        (HEADER + "0,1,stable\n", "line 2: column spindle_speed_rpm: found 0"),
        (HEADER + "6000,-1,stable\n", "line 2: column axial_depth_mm: found -1"),
        (HEADER + "6000,,stable\n", "line 2: column axial_depth_mm: found nan"),
        (OWN + "6000,1,0,3,,,,,\n", "line 2: column verdict_2: found 3"),
        (OWN + "6000,1,0,,-1,,,,\n", "line 2: column radial_width_mm: found -1, allowed is a finite number above 0 [mm], or nothing"),
        (OWN + "6000,1,0,,x,,,,\n", "line 2: column radial_width_mm: found x"),
        (OWN + "6000,1,0,,,left,,,\n", "line 2: column strategy: found left, allowed is one of up, down, or nothing"),
        (HEADER.replace("\n", ",tooling\n") + "6000,1,0,a\n6000,1,0,b\n", "column tooling: found 2 toolings: a, b"),
        (HEADER + "6000,x,stable\n", "line 2: column axial_depth_mm: found x"),
    ],
)
def test_cuts_that_are_not_read(tmp_path, text, words):
    path = tmp_path / "CUTS.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_tested_cuts(path)
    assert words in str(caught.value)
