"""Lobes of a cut whose tool it bends: the reference figures of the published case, and methods beside each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.deflection import ToolDeflection, deflected_process
from rcsa_ident.cutting.process import ProcessDamping
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.modal import normal_modes
from rcsa_ident.stability.discretisation import FullDiscretisation, SemiDiscretisation
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.multi_frequency import MultiFrequency
from rcsa_ident.stability.surface_error import surface_location_error
from rcsa_ident.stability.time_domain import TimeDomain
from rcsa_ident.stability.tip_modes import TipModes
from rcsa_ident.stability.zero_order import ZeroOrder
from tests.cutting.test_deflection import BARE, TOOL, WORN, T
from tests.oracles.literature import DEFORMED_LIMIT_MM, DEFORMED_LIMIT_WITH_SHAPES_MM
from tests.stability.mills import RPM, SKEWED, mill, tip


def modes(shapes: bool) -> TipModes:
    models = {}
    for axis, name in ((Dof.X, "x"), (Dof.Y, "y")):
        frequency, zeta, shape = T[name]
        models[axis] = normal_modes(np.array([2.0 * np.pi * frequency]), np.array([zeta]), shape[:1, None], (Coordinate("tip", axis),))
    found = TipModes.of(models)
    if not shapes:
        return found
    along = np.stack([T[name][2] / T[name][2][0] for name in ("x", "y")], axis=1)
    return TipModes(found.pole, found.outputs, found.inputs, found.constant, T["heights"], along)


def limits(tip_modes, rpm):
    speeds = np.asarray(rpm) * RPM
    columns = []
    for process in (BARE, WORN):
        for cut in (process, deflected_process(process, TOOL)):
            columns.append(stability_lobes(tip_modes, cut, speeds, 20e-3, FullDiscretisation()).limit_depth)
    return np.array(columns).T * 1e3


@pytest.mark.slow
def test_published_limits():
    """Without anything, deformation, damping, both; deformation and damping lift the limit by a quarter at 8200 rev/min."""
    found = limits(modes(shapes=False), list(DEFORMED_LIMIT_MM))
    np.testing.assert_allclose(found, list(DEFORMED_LIMIT_MM.values()), rtol=1e-2)
    gain = found[list(DEFORMED_LIMIT_MM).index(8200.0)]
    assert gain[3] / gain[0] - 1.0 == pytest.approx(0.25, abs=0.03)


@pytest.mark.slow
def test_published_limits_with_measured_shapes():
    found = limits(modes(shapes=True), list(DEFORMED_LIMIT_WITH_SHAPES_MM))
    np.testing.assert_allclose(found, list(DEFORMED_LIMIT_WITH_SHAPES_MM.values()), rtol=1e-2)


def test_no_deflection_is_the_plain_cut():
    """Slices of a tool that does not bend are the whole edge: with helix, damping and rotated feed."""
    process = mill(3, 0.3, helix=0.6, feed_angle=0.4, damping=ProcessDamping(2e13, 6e-5), feed_per_tooth=5e-5)
    stiff = ToolDeflection(0.06, 1e12)
    speeds = np.array([6000.0, 11_000.0]) * RPM
    method = FullDiscretisation(tolerance=1e-5)
    plain, sliced = (
        stability_lobes(tip(SKEWED), cut, speeds, 20e-3, method).limit_depth for cut in (process, deflected_process(process, stiff))
    )
    np.testing.assert_allclose(sliced, plain, rtol=3e-5)


@pytest.mark.slow
def test_other_methods_that_march_agree():
    """At 8200 rev/min, where deflection and damping lift the limit by a quarter; the time domain knows nothing of windows."""
    cut, speeds = deflected_process(WORN, TOOL), np.array([8200.0]) * RPM
    methods = FullDiscretisation(), SemiDiscretisation(), TimeDomain(contact_loss=False)
    full, semi, time = (stability_lobes(modes(False), cut, speeds, 20e-3, method).limit_depth for method in methods)
    np.testing.assert_allclose(semi, full, rtol=3e-3)
    np.testing.assert_allclose(time, full, rtol=1.2e-2)


@pytest.mark.slow
def test_a_profile_may_be_anything():
    """The lower half of the edge in the cut and the upper not: a cut of half the depth."""
    half = mill(2, 0.5, helix=0.4)
    engagement = half.engagement

    def lower(speed, depth):
        return np.array([[0.0, 0.5, engagement.entry, engagement.exit]])

    speeds = np.array([9000.0]) * RPM
    for method, tolerance in ((FullDiscretisation(tolerance=1e-5), 1e-4), (TimeDomain(contact_loss=False), 1e-2)):
        whole = stability_lobes(tip(SKEWED), half, speeds, 10e-3, method).limit_depth
        found = stability_lobes(tip(SKEWED), replace(half, engagement_profile=lower), speeds, 20e-3, method).limit_depth
        np.testing.assert_allclose(found, 2.0 * whole, rtol=tolerance)


@pytest.mark.slow
@pytest.mark.parametrize(
    "call",
    [
        lambda cut: stability_lobes(modes(False), cut, [900.0], 20e-3, ZeroOrder()),
        lambda cut: stability_lobes(modes(False), cut, [900.0], 20e-3, MultiFrequency()),
        lambda cut: surface_location_error(modes(False).receptance(), replace(cut, feed_per_tooth=1e-4), [900.0], 1e-3),
        lambda cut: cut.conditions(900.0, 1e-3),
    ],
)
def test_who_does_not_take_it_says_so(call):
    with pytest.raises(InputError, match="one engagement for the whole edge") as error:
        call(deflected_process(BARE, TOOL))
    assert error.value.field == "engagement_profile"
