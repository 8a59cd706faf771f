"""Modes and coefficients that vary."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.modal import normal_modes
from rcsa_ident.dynamics.uncertain import UncertainReceptance, Variation
from rcsa_ident.stability.labels.uncertain_tip import TipLimits, UncertainTip, altered
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.tip_modes import TIP, TipModes
from rcsa_ident.stability.zero_order import ZeroOrder

PROCESS = MillingProcess(Cutter(2, 0.012), CuttingCoefficients(9e8, 0.3), Engagement.from_immersion(0.5, "down"))


def modes(values=((700.0, 0.03, 8e6), (800.0, 0.035, 6e6))):
    models = {}
    for axis, (hertz, zeta, stiffness) in zip((Dof.X, Dof.Y), values, strict=True):
        omega = 2.0 * np.pi * hertz
        psi = np.array([[omega / np.sqrt(stiffness)]])
        models[axis] = normal_modes(np.array([omega]), np.array([zeta]), psi, (Coordinate("tip", axis),))
    return TipModes.of(models)


def test_altered_modes_are_the_modes_of_the_altered_numbers():
    found = altered(modes(), np.array([1.1, 0.9]), np.array([2.0, 0.5]), np.array([0.7, 1.4]))
    expected = modes(((770.0, 0.06, 5.6e6), (720.0, 0.0175, 8.4e6)))
    omega = np.linspace(1.0, 8000.0, 300)
    assert np.allclose(found.response(omega), expected.response(omega), rtol=1e-10, atol=0.0)
    # at rest, one over the stiffness
    assert found.response(np.zeros(1))[0].real == pytest.approx(np.diag([1 / 5.6e6, 1 / 8.4e6]))


def test_draws_have_the_means_and_spreads_that_were_told():
    tip = UncertainTip.independent(modes(), np.array([[0.1, 0.05], [0.4, 0.3], [0.3, 0.0]]), (0.14, 0.28))
    assert tip.size == 7
    drawn = tip.factors(np.random.default_rng(1).standard_normal((200_000, tip.size)))
    assert drawn.mean(axis=0) == pytest.approx(np.ones(8), abs=5e-3)
    assert drawn.std(axis=0) == pytest.approx([0.1, 0.05, 0.4, 0.3, 0.3, 0.0, 0.14, 0.28], abs=5e-3)
    assert np.all(drawn > 0.0)
    process = tip.process(np.array([0, 0, 0, 0, 0, 1.0, -1.0]), PROCESS)
    tangential, radial = tip.factors(np.array([0, 0, 0, 0, 0, 1.0, -1.0]))[-2:]
    assert process.coefficients.tangential == pytest.approx(9e8 * tangential)
    assert process.coefficients.tangential * process.coefficients.radial_ratio == pytest.approx(2.7e8 * radial)


def test_stiffness_that_changes_with_speed():
    tip = UncertainTip.independent(modes(), np.zeros((3, 2)), (0.0, 0.0), 1e-4)
    z = np.array([0.0, 0.0, -1.5])
    rest, turning = tip.at(z), tip.at(z, 1000.0)
    assert np.abs(rest.pole) == pytest.approx(np.abs(modes().pole))
    assert np.abs(turning.pole) == pytest.approx(np.sqrt(0.85) * np.abs(rest.pole))
    assert turning.response(np.zeros(1)).real[0, 0, 0] == pytest.approx(1.0 / (0.85 * 8e6))


def test_limits_are_those_of_the_draw():
    tip = UncertainTip.independent(modes(), np.full((3, 2), 0.1), (0.1, 0.1))
    speeds, z = np.array([800.0, 1000.0, 1300.0]), np.random.default_rng(2).standard_normal((3, tip.size))
    found = TipLimits(tip, PROCESS, ZeroOrder(), 4e-3)(z, speeds)
    for k, each in enumerate(z):
        expected = stability_lobes(tip.at(each), tip.process(each, PROCESS), speeds, 4e-3)
        assert found.log_limit[k] == pytest.approx(np.log(expected.nominal))
        assert found.chatter[k] == pytest.approx(expected.chatter_frequency, nan_ok=True)
    soft = UncertainTip.independent(modes(), np.full((3, 2), 0.1), (0.1, 0.1), 1e-12)
    same = TipLimits(soft, PROCESS, ZeroOrder(), 4e-3)(np.column_stack([z, np.ones(3)]), speeds)
    assert same.log_limit == pytest.approx(found.log_limit, abs=1e-6)


class Changes:
    """A spread along given changes."""

    covers = frozenset({0, 1})

    def __init__(self, change):
        self.change = change

    def at(self, places):
        return (Variation((0, 1), self.change[:, places]),)

    def guides(self):
        return self.change.reshape(len(self.change), self.change.shape[1], 4).transpose(0, 2, 1).reshape(-1, self.change.shape[1])


def test_the_spread_of_a_receptance_told_as_that_of_its_modes():
    """Directions that mix frequency, damping and stiffness of both modes come back with their covariance."""
    omega, centre = 2.0 * np.pi * np.arange(100.0, 2500.0, 1.0), modes()
    root = np.random.default_rng(3).standard_normal((6, 4)) * np.array([[0.003, 0.003, 0.05, 0.05, 0.02, 0.02]]).T
    change = []
    for column in root.T:
        ahead, behind = (altered(centre, *np.exp(0.01 * sign * column).reshape(3, 2)).response(omega) for sign in (1.0, -1.0))
        change.append((ahead - behind) / 0.02)
    tip = UncertainReceptance(omega, centre.response(omega), TIP, TIP, Changes(np.array(change)), lambda: centre)
    found, missed = UncertainTip.of_receptance(tip, np.diag([0.05, 0.05]))
    assert missed < 0.02
    assert found.root.shape[1] <= 4
    order = np.argsort(np.abs(found.modes.pole))
    rows = np.concatenate([2 * k + order for k in range(3)])
    assert (found.root @ found.root.T)[np.ix_(rows, rows)] == pytest.approx(root @ root.T, abs=0.03 * np.max(np.diag(root @ root.T)))
    drawn = found.factors(np.random.default_rng(4).standard_normal((50_000, found.size)))
    assert np.log(drawn).std(axis=0)[rows] == pytest.approx(np.linalg.norm(root, axis=1), rel=0.15)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"root": np.zeros((5, 2))}, "6 rows"),
        ({"root": np.full((6, 2), np.nan)}, "finite"),
        ({"coefficients": np.zeros((2, 3))}, "shape"),
        ({"softening": -1.0}, "0 or more"),
    ],
)
def test_what_no_tip_has(given, words):
    with pytest.raises(InputError, match=words):
        UncertainTip(**({"modes": modes(), "root": np.zeros((6, 0)), "coefficients": np.zeros((2, 2))} | given))
