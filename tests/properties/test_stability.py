"""Laws of stability limits, whichever method finds them: material, stiffness, time, turns, and what methods share."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.dynamics.coordinates import Coordinate
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.stability.discretisation import FullDiscretisation, SemiDiscretisation
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.multi_frequency import MultiFrequency
from rcsa_ident.stability.tip_modes import TipModes
from rcsa_ident.stability.zero_order import ZeroOrder
from tests.stability.mills import COEFFICIENTS, ONE, RPM, SKEWED, Table, mill, tip

BAND = 2.0 * np.pi * np.arange(300.0, 2400.0, 0.5)
METHODS: dict[str, Any] = {
    "zero order": ZeroOrder(),
    "multi-frequency": MultiFrequency(),
    "semi-discretisation": SemiDiscretisation(),
    "full discretisation": FullDiscretisation(tolerance=1e-5),
}


def scaled(table: Table, fast: float = 1.0, stiff: float = 1.0) -> Table:
    """All frequencies and all stiffnesses times a factor."""
    return tuple((axis, fast * f, zeta, stiff * m / fast**2) for axis, f, zeta, m in table)


def modes_at(modes: TipModes, omega: np.ndarray) -> Receptance:
    terms = 1.0 / (1j * omega[:, None] - modes.pole), 1.0 / (1j * omega[:, None] - modes.pole.conj())
    values = np.einsum("im,nm,mj->nij", modes.outputs, terms[0], modes.inputs)
    values = values + np.einsum("im,nm,mj->nij", modes.outputs.conj(), terms[1], modes.inputs.conj()) + modes.constant
    where = tuple(Coordinate.parse(f"tip.{axis}") for axis in ("x", "y"))
    return Receptance(omega, values, where, where)


def limits(name: str, modes: TipModes, process: Any, rpm: Any, fast: float = 1.0) -> np.ndarray:
    """Limits of some speeds [m]; the zero order takes the receptance over a band that goes with the modes."""
    source = modes_at(modes, fast * BAND) if name == "zero order" else modes
    return stability_lobes(source, process, np.asarray(rpm) * RPM, 0.1, METHODS[name]).limit_depth


@pytest.mark.parametrize("name", METHODS)
@settings(max_examples=4, deadline=None)
@given(factor=st.floats(0.2, 5.0), immersion=st.floats(0.1, 1.0), strategy=st.sampled_from(["up", "down"]))
def test_a_harder_material_and_a_softer_machine_are_the_same(name, factor, immersion, strategy):
    """Limits go with stiffness over tangential coefficient: lobes scale with 1 / Ktc, and fall with softer modes."""
    rpm = [7000.0, 15_000.0]
    base = limits(name, tip(SKEWED), mill(2, immersion, strategy), rpm)
    hard = CuttingCoefficients(factor * COEFFICIENTS.tangential, COEFFICIENTS.radial_ratio)
    np.testing.assert_allclose(limits(name, tip(SKEWED), mill(2, immersion, strategy, coefficients=hard), rpm), base / factor, rtol=2e-4)
    np.testing.assert_allclose(
        limits(name, tip(scaled(SKEWED, stiff=1.0 / factor)), mill(2, immersion, strategy), rpm), base / factor, rtol=2e-4
    )


@pytest.mark.parametrize("name", METHODS)
@settings(max_examples=4, deadline=None)
@given(fast=st.floats(0.3, 3.0), immersion=st.floats(0.1, 1.0), helix=st.floats(0.0, 0.7))
def test_the_unit_of_time_does_not_matter(name, fast, immersion, helix):
    """Frequencies and speeds times a factor, stiffnesses as they were: the same limits."""
    rpm = np.array([7000.0, 15_000.0])
    base = limits(name, tip(SKEWED), mill(2, immersion, helix=helix), rpm)
    np.testing.assert_allclose(limits(name, tip(scaled(SKEWED, fast)), mill(2, immersion, helix=helix), fast * rpm, fast), base, rtol=2e-4)


@pytest.mark.parametrize("name", METHODS)
@settings(max_examples=4, deadline=None)
@given(turn=st.floats(-3.0, 3.0), feed=st.floats(-3.0, 3.0), immersion=st.floats(0.1, 1.0))
def test_axes_do_not_matter(name, turn, feed, immersion):
    """A machine that is turned together with its feed."""
    rpm = [7000.0, 15_000.0]
    base = limits(name, tip(SKEWED), mill(2, immersion, feed_angle=feed), rpm)
    np.testing.assert_allclose(limits(name, tip(SKEWED, turn=turn), mill(2, immersion, feed_angle=feed + turn), rpm), base, rtol=2e-4)


@settings(max_examples=10, deadline=None)
@given(soft=st.floats(0.2, 0.95), undamped=st.floats(0.3, 0.95), immersion=st.floats(0.1, 1.0), feed=st.floats(-3.0, 3.0))
def test_less_stiffness_and_less_damping_lower_the_lowest_limit(soft, undamped, immersion, feed):
    """Of one mode, whose lowest limit is 2 k zeta (1 + zeta) over what the cut makes of it."""

    def lowest(table: Table) -> float:
        found = stability_lobes(modes_at(tip(table), BAND), mill(2, immersion, feed_angle=feed), np.array([9000.0]) * RPM, 1.0)
        assert found.absolute_limit is not None
        return found.absolute_limit

    ((axis, f, zeta, m),) = ONE
    base = lowest(ONE)
    softer, livelier = lowest(((axis, f, zeta, soft * m),)), lowest(((axis, f, undamped * zeta, m),))
    # what cuts so that this mode's own direction does not push it has no limit at all
    if np.isfinite(base):
        assert softer == pytest.approx(soft * base, rel=1e-9)
        assert livelier < base


@settings(max_examples=4, deadline=None)
@given(immersion=st.floats(0.05, 1.0), teeth=st.integers(2, 5), rpm=st.floats(5000.0, 25_000.0), strategy=st.sampled_from(["up", "down"]))
def test_without_harmonics_many_frequencies_are_the_zero_order(immersion, teeth, rpm, strategy):
    process, source = mill(teeth, immersion, strategy), modes_at(tip(SKEWED), BAND)
    speeds = np.array([rpm]) * RPM
    zero = stability_lobes(source, process, speeds, 0.1, ZeroOrder()).limit_depth
    np.testing.assert_allclose(stability_lobes(source, process, speeds, 0.1, MultiFrequency(harmonics=0)).limit_depth, zero, rtol=1e-3)


@settings(max_examples=4, deadline=None)
@given(immersion=st.floats(0.05, 1.0), rpm=st.floats(7000.0, 20_000.0), helix=st.floats(0.0, 0.7), feed=st.floats(-3.0, 3.0))
def test_with_all_harmonics_they_are_the_discretisation(immersion, rpm, helix, feed):
    process = mill(3, immersion, helix=helix, feed_angle=feed)
    found = {name: limits(name, tip(SKEWED), process, [rpm])[0] for name in METHODS if name != "zero order"}
    assert found["multi-frequency"] == pytest.approx(found["full discretisation"], rel=2e-3)
    assert found["semi-discretisation"] == pytest.approx(found["full discretisation"], rel=5e-3)


@settings(max_examples=8, deadline=None)
@given(teeth=st.integers(2, 6), factor=st.floats(0.3, 3.0))
def test_teeth_count_as_material_does_in_the_zero_order(teeth, factor):
    """The mean directional coefficients go with the number of teeth: so does the lowest limit, with its inverse."""
    source, speeds = modes_at(tip(SKEWED), BAND), np.array([9000.0]) * RPM
    one, many = (stability_lobes(source, mill(n, 0.5), speeds, 1.0).absolute_limit for n in (1, teeth))
    assert one == pytest.approx(teeth * many, rel=1e-9)
