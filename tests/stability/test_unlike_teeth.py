"""Unequal pitch and run-out in zero-order limits: said, and no source of a recommended depth."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.power import SpindleDrive
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.io.curves.lobes import read_lobes, write_lobes
from rcsa_ident.report.summaries import lobes_summary
from rcsa_ident.stability.advice import Advice, highest_removal, speed_windows, usable_depths
from rcsa_ident.stability.discretisation import FullDiscretisation
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.operating_point import Bound
from rcsa_ident.stability.result import StabilityLobes
from rcsa_ident.stability.zero_order import ZeroOrder
from tests.stability.mills import HALF, RPM, tip

#: 910 Hz in X and 980 Hz in Y, 16 and 14 N/um: axis, natural frequency [Hz], damping ratio, mass [kg].
TWO_PLANES = ((0, 910.0, 0.028, 1.6e7 / (2.0 * np.pi * 910.0) ** 2), (1, 980.0, 0.031, 1.4e7 / (2.0 * np.pi * 980.0) ** 2))
COEFFICIENTS = CuttingCoefficients(800e6, 0.35)
UNEQUAL = np.radians([84.0, 96.0, 84.0, 96.0])
RUNOUT = np.array([0.0, 5e-6, 0.0, -5e-6])
METHOD = "no depth is recommended from zero-order limits: full-discretisation takes unlike teeth"


def limits(method=None, **teeth) -> StabilityLobes:
    cutter = Cutter(4, 0.016, np.radians(39.5), **teeth)
    return stability_lobes(
        tip(TWO_PLANES), process(cutter), RPM * np.array([3000.0, 4200.0]), 30e-3, ZeroOrder() if method is None else method
    )


def process(cutter: Cutter) -> MillingProcess:
    return MillingProcess(cutter, COEFFICIENTS, HALF, feed_per_tooth=1e-4)


def test_two_alternating_pitches():
    """Zero order is twice too high and says so; full discretisation has the limits that two independent codes agree upon."""
    wrong, right = limits(pitch=UNEQUAL), limits(FullDiscretisation(), pitch=UNEQUAL)
    assert 1e3 * wrong.limit_depth == pytest.approx([7.22, 9.62], abs=0.005)
    assert 1e3 * right.limit_depth == pytest.approx([3.4761, 4.9347], rel=1e-3)
    # the closed form's depth that is stable at any speed, 3.668 mm, is not: 3.4761 mm is less
    assert (wrong.absolute_limit, wrong.absolute_frequency) == (None, None)
    assert wrong.withheld in wrong.warnings
    assert "unequal pitch (84/96/84/96 degrees)" in wrong.withheld
    assert wrong.withheld.endswith(METHOD)
    assert np.isnan(wrong.recommended_depth()).all()
    assert right.withheld == ""
    assert 1e3 * right.recommended_depth(0.0) == pytest.approx([0.9 * 3.4761, 0.9 * 4.9347], rel=1e-3)


def test_run_out_is_withheld_too_and_equal_teeth_are_not():
    assert limits(runout=RUNOUT).withheld == f"run-out is left out: the limit is that of equal teeth; {METHOD}"
    both = limits(pitch=UNEQUAL, runout=RUNOUT).withheld
    assert "unequal pitch" in both
    assert "run-out is left out" in both
    alike = limits()
    assert alike.withheld == ""
    assert 1e3 * alike.absolute_limit == pytest.approx(3.668, abs=1e-3)
    assert np.isfinite(alike.recommended_depth()).all()


def test_nothing_is_recommended_from_them(tmp_path):
    lobes = limits(pitch=UNEQUAL)
    usable = usable_depths(lobes, process(Cutter(4, 0.016, pitch=UNEQUAL)), SpindleDrive.flat(2e4, None, None))
    points = highest_removal(usable, process(Cutter(4, 0.016, pitch=UNEQUAL)))
    assert points == []
    assert speed_windows(usable, 0.1e-3) == []
    assert usable.bound == (Bound.CHATTER, Bound.CHATTER)
    assert str(usable).endswith("no depth is recommended")
    assert str(lobes.best_speeds()[0]) == "4200 rev/min: stability limit 9.62 mm, no depth recommended"
    advice = Advice("T", None, lobes, usable, tuple(points), (), (), None, lobes.warnings)
    assert str(advice) == f"T: {lobes.withheld}"
    found = lobes_summary(advice)
    assert found["withheld"] == lobes.withheld
    assert found["recommended"] == []
    write_lobes(tmp_path / "LOBES.csv", lobes)
    again = read_lobes(tmp_path / "LOBES.csv")
    assert again.limit_depth == pytest.approx(lobes.limit_depth)
    assert np.isnan(again.recommended_depth()).all()


def test_parts_of_a_machine_that_changes_with_speed_keep_it():
    lobes = limits(pitch=UNEQUAL)
    parts = [lobes.at_places(np.array([k])) for k in (0, 1)]
    assert StabilityLobes.joined(parts, [np.array([0]), np.array([1])]).withheld == lobes.withheld
