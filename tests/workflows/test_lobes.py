"""What stands between a tip and a recommendation."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.stats

from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.modal import normal_modes
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.errors import InputError
from rcsa_ident.stability.lobes import uncoupled_planes
from rcsa_ident.stability.multi_frequency import MultiFrequency
from rcsa_ident.stability.result import StabilityLobes
from rcsa_ident.stability.zero_order import ZeroOrder
from rcsa_ident.workflows.lobes import (
    LobeConditions,
    band_warning,
    best_speeds,
    lobe_bands,
    measured_tip,
    modal_tip,
    stability_probability,
    tooling_lobes,
)
from rcsa_ident.workflows.tip import TooltipResponse


def lobes(limit, chatter=None):
    limit = np.array(limit, dtype=float)
    speed = 100.0 * np.arange(1, limit.size + 1)
    chatter = np.full(limit.size, 5000.0) if chatter is None else np.array(chatter)
    return StabilityLobes(
        speed, limit, np.where(np.isinf(limit), np.nan, chatter), np.where(np.isinf(limit), -1, 3), 1.0, 5000.0, "by hand"
    )


def test_best_speeds_are_one_a_pocket():
    # 3.0 and 2.9 share a pocket: the limit between them hardly falls
    assert best_speeds(lobes([1.0, 3.0, 2.8, 2.9, 1.0, 2.0, 1.0, 1.5])) == [(200.0, 3.0), (600.0, 2.0), (800.0, 1.5)]
    assert best_speeds(lobes([1.0, 3.0, 2.8, 2.9, 1.0, 2.0, 1.0, 1.5]), count=1) == [(200.0, 3.0)]


def test_the_middle_of_a_stable_range_comes_first_the_widest_before_others():
    found = best_speeds(lobes([1.0, np.inf, 1.0, np.inf, np.inf, np.inf, 1.0, 3.0, 2.0]))
    assert found == [(500.0, np.inf), (200.0, np.inf), (800.0, 3.0)]


def test_order_of_the_speeds_does_not_matter():
    one = lobes([1.0, 3.0, 1.0, 2.0, 1.0])
    back = StabilityLobes(*(a[::-1] for a in (one.spindle_speed, one.limit_depth, one.chatter_frequency, one.lobe)), 1.0, 1.0, "")
    assert best_speeds(one) == best_speeds(back)


def test_chatter_outside_the_band_is_said():
    inside = lobes([1.0, 2.0, np.inf])
    assert band_warning(inside, (500.0, 4000.0)) is None
    text = band_warning(lobes([1.0, 2.0, np.inf], [2.0 * np.pi * 300.0, 5000.0, 1.0]), (500.0, 4000.0))
    assert text is not None
    assert "1 of 3 speeds" in text
    assert "300 Hz" in text


def test_modal_tip_resolves_the_sharpest_mode():
    tip = modal_tip({Dof.Y: normal_modes(np.array([5000.0]), np.array([0.01]), np.ones((1, 1)), (Coordinate("tip", Dof.Y),))})
    np.testing.assert_array_equal(tip.between("tip.x", "tip.x"), 0.0)
    step = np.diff(tip.omega).max()
    assert step <= 2.0 * 0.01 * 5000.0 / 10.0
    peak = tip.omega[np.argmax(np.abs(tip.between("tip.y", "tip.y")))]
    assert peak == pytest.approx(5000.0, rel=2e-3)


def test_a_mode_too_sharp_to_resolve_is_refused():
    model = normal_modes(np.array([5000.0]), np.array([1e-7]), np.ones((1, 1)), (Coordinate("tip", Dof.X),))
    with pytest.raises(InputError, match="damping_ratio"):
        modal_tip({Dof.X: model})


OMEGA = 2.0 * np.pi * np.arange(100.0, 3000.0, 2.0)


def posterior_of_scale(deviation):
    """A tip whose receptances are known but for one factor: the limit is then known but for its inverse."""

    def plane(axis, frequency):
        tip = (Coordinate("tip", axis),)
        mode = normal_modes(np.array([2.0 * np.pi * frequency]), np.array([0.03]), np.array([[4.0]]), tip)
        return Receptance(OMEGA, mode.receptance(OMEGA).values, tip, tip)

    coupled = plane(Dof.X, 900.0)
    return TooltipResponse({Dof.X: coupled}, {Dof.X: deviation * coupled.values[:, 0, 0][None]})


def asked(method, speeds=(600.0, 800.0, 1100.0)):
    return LobeConditions(
        MillingProcess(Cutter(2, 0.012), CuttingCoefficients(9e8, 0.3), Engagement.from_immersion(0.5, "down"), 0.3),
        np.array(speeds),
        0.1,
        method,
    )


@pytest.mark.parametrize(("method", "draws"), [(ZeroOrder(), 400), (MultiFrequency(), 40)])
def test_probability_of_stability_of_a_scale(method, draws):
    """With G (1 + 0.1 z) the limit is a / (1 + 0.1 z): a cut of depth d is stable where z < 10 (a / d - 1)."""
    response, conditions = posterior_of_scale(0.1), asked(method)
    limit = tooling_lobes(response, conditions).limit_depth
    ratio = np.array([0.8, 0.95, 1.0, 1.05, 1.3])
    found = stability_probability(response, conditions, ratio[:, None] * limit, draws=draws, seed=3)
    # the very draws that were made
    z = np.random.default_rng(3).standard_normal(draws)
    expected = np.mean(z < 10.0 * (1.0 / ratio[:, None] - 1.0), axis=1)
    np.testing.assert_allclose(found, np.repeat(expected[:, None], 3, axis=1), atol=1.0 / draws)
    exact = scipy.stats.norm.cdf(10.0 * (1.0 / ratio - 1.0))
    np.testing.assert_allclose(found, np.repeat(exact[:, None], 3, axis=1), atol=3.0 * 0.5 / np.sqrt(draws))


def test_probability_and_bands_tell_the_same():
    response, conditions = posterior_of_scale(0.1), asked(ZeroOrder())
    low, high = lobe_bands(response, conditions, draws=200)
    inside = stability_probability(response, conditions, np.stack([low * 0.999, high * 1.001]), draws=200)
    np.testing.assert_allclose(inside[0], 0.975, atol=0.011)
    np.testing.assert_allclose(inside[1], 0.025, atol=0.011)
    even = stability_probability(response, conditions, np.linspace(0.5, 1.5, 9) * low.min())
    assert even.shape == (9, 3)
    assert np.all(np.diff(even, axis=0) <= 0.0)


def test_without_a_posterior_nothing_is_probable():
    response = posterior_of_scale(0.1)
    assert stability_probability(TooltipResponse(response.coupled), asked(ZeroOrder()), np.array([1e-3])) is None
    assert lobe_bands(TooltipResponse(response.coupled), asked(ZeroOrder())) is None
    certain = stability_probability(posterior_of_scale(0.0), asked(ZeroOrder()), np.array([1e-6, 0.1]))
    np.testing.assert_array_equal(certain, [[1.0] * 3, [0.0] * 3])


@pytest.mark.parametrize("depths", [[0.0], [0.2], [np.nan]])
def test_depths_that_can_not_be_asked_for(depths):
    with pytest.raises(InputError, match="depths"):
        stability_probability(posterior_of_scale(0.1), asked(ZeroOrder()), np.array(depths))


def test_cross_receptances_of_a_tap_test():
    """A machine whose planes are turned by 30 degrees, measured along X and Y with its cross term, is that machine."""
    frequency = np.arange(200.0, 2000.0, 2.0)
    omega = 2.0 * np.pi * frequency
    planes = [
        (2 * np.pi * f) ** 2 / k / ((2 * np.pi * f) ** 2 - omega**2 + 0.06j * 2 * np.pi * f * omega)
        for f, k in ((700.0, 8e6), (800.0, 4e6))
    ]
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    turn = np.array([[c, -s], [s, c]])
    full = np.einsum("ip,pn,jp->nij", turn, np.array(planes), turn)
    curves = {Dof.X: (frequency, full[:, 0, 0]), Dof.Y: (frequency, full[:, 1, 1])}
    cross = {(Dof.X, Dof.Y): (frequency, full[:, 0, 1])}
    tip = measured_tip(curves, cross)
    np.testing.assert_allclose(tip.values, full, rtol=1e-12)
    # the same cut with its feed turned along with the machine
    straight = uncoupled_planes(
        *(Receptance(omega, h[:, None, None], *[(Coordinate("tip", d),)] * 2) for d, h in zip((Dof.X, Dof.Y), planes, strict=True))
    )
    here = asked(ZeroOrder())
    process = here.process
    turned = MillingProcess(process.cutter, process.coefficients, process.engagement, process.feed_angle + np.pi / 6)
    np.testing.assert_allclose(LobeConditions(turned, here.speeds, 0.1).lobes(tip).limit_depth, here.lobes(straight).limit_depth, rtol=1e-9)
    both = measured_tip(curves, {**cross, (Dof.Y, Dof.X): (frequency, 2.0 * full[:, 1, 0])})
    np.testing.assert_allclose(both.values[:, 1, 0], 2.0 * full[:, 1, 0])
    with pytest.raises(InputError, match="cross FRF: found one without an FRF in Y"):
        measured_tip({Dof.X: curves[Dof.X]}, cross)
    with pytest.raises(InputError, match="cross FRF: found 5 frequencies"):
        measured_tip(curves, {(Dof.X, Dof.Y): (frequency[:5], full[:5, 0, 1])})
