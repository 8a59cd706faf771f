"""The map whose boundary is followed against the map in which every point is looked at, and against the lobes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.process import ProcessDamping
from rcsa_ident.stability.discretisation import FullDiscretisation, SemiDiscretisation
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.multiplier_limits import Growth, longest_step
from rcsa_ident.stability.stability_map import stability_map
from tests.stability.mills import ONE, RPM, SKEWED, TWO, mill, tip

SPEEDS = np.linspace(5000.0, 25_000.0, 161) * RPM
CASES = {
    "slot": (ONE, mill(2, 1.0), 5e-3),
    "flips, a/D 0.05": (ONE, mill(2, 0.05), 10e-3),
    "flips, a/D 0.1 up": (ONE, mill(2, 0.1, "up"), 10e-3),
    "islands": (ONE, mill(2, 0.05, "up", np.radians(30.0)), 20e-3),
    "two directions": (TWO, mill(2, 0.5, "up"), 3e-3),
    "modes, rubbing": (SKEWED, mill(3, 0.3, helix=0.5, feed_angle=0.4, damping=ProcessDamping(1e13, 6e-5)), 6e-3),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_followed_boundary_is_the_full_map(name):
    modes, process, depth = CASES[name]
    depths = np.linspace(depth / 80.0, depth, 80)
    full = stability_map(tip(modes), process, SPEEDS, depths, full=True)
    followed = stability_map(tip(modes), process, SPEEDS, depths)
    np.testing.assert_array_equal(followed.stable, full.stable)
    assert full.computed.all()
    assert full.stable.any()
    assert not full.stable.all()
    # counted, and far fewer
    assert full.evaluations >= full.growth.size
    assert followed.evaluations < 0.5 * full.evaluations
    assert followed.computed.sum() < followed.evaluations
    np.testing.assert_allclose(followed.growth[followed.computed], full.growth[followed.computed], rtol=0, atol=2e-3)
    # the same boundary: as many crossings as changes of sign, at the same depths
    assert followed.crossing_depth.size == np.sum(np.diff(full.stable.astype(int), axis=1) != 0)
    np.testing.assert_allclose(followed.crossing_depth, full.crossing_depth, rtol=5e-3)
    np.testing.assert_array_equal(followed.crossing_speed, full.crossing_speed)
    assert max(full.error, followed.error) < 5e-3


@pytest.mark.slow
def test_islands_are_found():
    modes, process, depth = CASES["islands"]
    found = stability_map(tip(modes), process, SPEEDS, np.linspace(depth / 80.0, depth, 80))
    again = [i for i in range(SPEEDS.size) if np.any(np.diff(found.stable[i].astype(int)) == 1)]
    assert len(again) > 3, "stable again above an unstable depth"
    for i in again:
        assert np.sum(found.crossing_speed == SPEEDS[i]) >= 2


@pytest.mark.parametrize("name", CASES)
def test_crossings_are_where_growth_is_nought(name):
    modes, process, depth = CASES[name]
    found = stability_map(tip(modes), process, SPEEDS[::16], np.linspace(depth / 40.0, depth, 40), tolerance=1e-3)
    cut = FullDiscretisation().monodromy(tip(modes), process)
    step = longest_step(cut)
    for speed, crossing in zip(found.crossing_speed, found.crossing_depth, strict=True):
        growth = Growth(cut, float(speed), step)
        assert growth((1.0 - 3e-3) * crossing) * growth((1.0 + 3e-3) * crossing) < 0.0


def test_limits_are_those_of_the_lobes():
    modes, process, depth = CASES["islands"]
    found = stability_map(tip(modes), process, SPEEDS[::12], np.linspace(depth / 100.0, depth, 100))
    limit = stability_lobes(tip(modes), process, SPEEDS[::12], depth, FullDiscretisation()).limit_depth
    np.testing.assert_allclose(found.limit_depth, limit, rtol=1e-2)
    assert found.method == "full-discretisation"


def test_a_coarse_step_is_told():
    """Semi-discretisation has one step for the whole map: how far its boundary moves with a finer one stands on the map."""
    modes, process, depth = CASES["slot"]
    depths = np.linspace(depth / 50.0, depth, 50)
    fine = stability_map(tip(modes), process, SPEEDS[::12], depths)
    coarse = stability_map(tip(modes), process, SPEEDS[::12], depths, SemiDiscretisation())
    assert coarse.method == "semi-discretisation"
    off = np.nanmax(np.abs(coarse.limit_depth / fine.limit_depth - 1.0))
    assert 3e-3 < off < 4.0 * coarse.error
    assert fine.error < 1e-3


def test_limits_at_the_edges_of_the_map():
    modes, process, _ = CASES["slot"]
    deep = stability_map(tip(modes), process, SPEEDS[:2], np.array([4e-3, 5e-3]))
    np.testing.assert_array_equal(deep.limit_depth, 4e-3)
    shallow = stability_map(tip(modes), process, SPEEDS[:2], np.array([1e-6, 1e-5]))
    assert np.all(np.isinf(shallow.limit_depth))
    assert shallow.error == 0.0
    assert shallow.stable.all()


@settings(max_examples=12, deadline=None)
@given(rows=st.integers(1, 21), columns=st.integers(1, 21), immersion=st.sampled_from([0.05, 0.3]))
def test_any_size(rows, columns, immersion):
    """Also one speed, or one depth; blocks need not fit."""
    speeds, depths = np.linspace(9000.0, 21_000.0, rows) * RPM, np.linspace(0.3e-3, 8e-3, columns)
    process = mill(2, immersion)
    one, two = (stability_map(tip(ONE), process, speeds, depths, full=f) for f in (False, True))
    assert one.growth.shape == (rows, columns)
    assert np.all(np.isfinite(one.growth))
    # a coarse map's blocks may hide what a fine one finds: points that were computed agree
    np.testing.assert_array_equal(one.stable[one.computed], two.stable[one.computed])


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"speeds": np.array([2.0, 1.0])}, "speeds"),
        ({"speeds": np.array([])}, "speeds"),
        ({"speeds": np.array([np.nan])}, "speeds"),
        ({"depths": np.array([0.0, 1.0])}, "depths"),
        ({"depths": np.array([[1.0], [2.0]])}, "depths"),
    ],
)
def test_bad_input(change, field):
    with pytest.raises(InputError, match="ascending") as error:
        stability_map(**{"tip": tip(ONE), "process": mill(), "speeds": SPEEDS, "depths": np.array([1e-3, 2e-3]), **change})
    assert error.value.field == field


def test_a_receptance_is_not_marched_with():
    with pytest.raises(InputError, match="rational fit"):
        stability_map(tip(ONE).receptance(), mill(), SPEEDS, np.array([1e-3, 2e-3]))
