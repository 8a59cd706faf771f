"""Shares of a band: against closed forms, against one group alone, and where what is known hangs together."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.modal import normal_modes
from rcsa_ident.dynamics.uncertain import Doubted, UncertainReceptance, Variation
from rcsa_ident.stability.band_shares import DOMINANT, WIDE, BandShares, band_shares, shares_of
from rcsa_ident.stability.lobes import drawn_limits
from tests.stability.test_lobes import DEEPEST, EXACT, OMEGA, PROCESS


def test_a_limit_that_two_groups_scale():
    """With G (1 + 0.06 z1) (1 + 0.12 z2) the limit's logarithm varies by 0.06 and 0.12: the shares are 1 to 4."""
    tip = tip_of(lambda values: [0.06 * values, 0.12 * values], {Doubted.CONTACT: np.array([[0.0, 1.0]])})
    found = band_shares(tip, PROCESS, 800.0, DEEPEST, 0.0)
    assert found.spindle_speed == pytest.approx(800.0)
    assert found.deviation == pytest.approx(np.hypot(0.06, 0.12), rel=2e-3)
    assert found.shares == pytest.approx({Doubted.CONTACT: 0.8, Doubted.MACHINE: 0.2}, abs=2e-3)
    assert found.words == (
        "80 % of the band of this limit (standard deviation 13 %) is the contact of tool and holder: tap it, ring it or cut once"
    )


def test_coefficients_have_a_share():
    """K_tc scales the limit alone: with 0.06 of the machine, 0.08 of it, and nothing of k_rc it holds 64 %."""
    process = replace(PROCESS, coefficients=replace(EXACT, tangential_spread=0.08))
    found = band_shares(tip_of(lambda values: [0.06 * values], {}), process, 800.0, DEEPEST, 0.0)
    assert found.deviation == pytest.approx(0.1, rel=2e-3)
    assert found.shares == pytest.approx({Doubted.COEFFICIENTS: 0.64, Doubted.MACHINE: 0.36}, abs=2e-3)
    assert found.words.endswith(
        "is the cutting coefficients: calibrate them on a dynamometer. "
        "The depth depends most on the tangential cutting coefficient, whose standard deviation is 8 %"
    )
    assert found.leading.share == pytest.approx(0.64, abs=2e-3)
    # along X alone, half immersion, the ratio moves the limit, too
    both = replace(process, coefficients=replace(EXACT, tangential_spread=0.08, ratio_spread=0.05))
    assert band_shares(tip_of(lambda values: [0.06 * values], {}), both, 800.0, DEEPEST, 0.0).deviation > found.deviation


def test_the_parameter_that_the_limit_depends_on_most_is_named():
    """Two parameters of one group and the machine, 0.06, 0.12 and 0.03: the second holds 76 % alone, whatever its group is called."""
    names = {"rotational_damping": np.eye(3)[:1], "translational_stiffness": np.eye(3)[1:2]}
    tip = tip_of(lambda values: [0.06 * values, 0.12 * values, 0.03 * values], {Doubted.CONTACT: np.eye(3)[:2]}, names)
    found = band_shares(tip, PROCESS, 800.0, DEEPEST, 0.0, lambda name: f"{name}, which is assumed (70 %)")
    assert found.leading == (
        "translational_stiffness",
        pytest.approx(0.144 / 0.189, rel=5e-3),
        "translational_stiffness, which is assumed (70 %)",
    )
    assert found.words.endswith("or cut once. The depth depends most on the translational_stiffness, which is assumed (70 %)")
    # beside a machine that is known worse it is the one of single values, and a parameter of no account is not named
    loose = replace(found, shares={Doubted.CONTACT: 0.2, Doubted.MACHINE: 0.8})
    assert "Of single values, the depth depends most on the translational_stiffness" in loose.words
    assert "depends most" not in replace(found, leading=found.leading._replace(share=0.05)).words
    assert replace(found, deviation=0.99 * WIDE).words == ""


def test_shares_are_the_variances_of_machines_that_differ_in_one_group_alone():
    """Zero-order limits drawn along the directions of one group, at the speed whose limit is the lowest within the tolerance."""
    groups = {Doubted.CONTACT: np.eye(3)[:1], Doubted.TOOL: np.eye(3)[1:2]}
    found = band_shares(tip_of(shifted, groups), PROCESS, 800.0, DEEPEST, 0.01)
    assert 790.0 <= found.spindle_speed <= 810.0
    alone, speeds = [], np.array([found.spindle_speed])
    for k in range(3):
        limits = drawn_limits(tip_of(lambda values, k=k: shifted(values)[k : k + 1], {}), PROCESS, speeds, 1.0, 400, 5)
        alone.append(np.var(np.log(limits)))
    shares = np.array(alone) / np.sum(alone)
    assert sum(found.shares.values()) == pytest.approx(1.0)
    names = (Doubted.CONTACT, Doubted.TOOL, Doubted.MACHINE)
    np.testing.assert_allclose([found.shares[name] for name in names], shares, atol=0.08)
    assert found.deviation == pytest.approx(np.sqrt(np.sum(alone)), rel=0.15)


def test_what_hangs_together_is_told_by_what_its_knowledge_would_take_away():
    """Contact c, modulus m correlated by rho, slopes g: knowing the contact takes (g_c + rho g_m)^2, the modulus then (1 - rho^2) g_m^2."""
    rho, slope = 0.6, np.array([0.3, -0.2])
    root = np.linalg.cholesky([[1.0, rho], [rho, 1.0]])
    # a rotation of the directions is the same spread, and a third direction is the machine's
    turn, _ = np.linalg.qr(np.random.default_rng(4).standard_normal((3, 3)))
    moves = np.column_stack([root, np.zeros(2)]) @ turn
    slopes = slope @ moves + 0.1 * turn[2]
    found = shares_of(slopes, {Doubted.TOOL: moves[1:], Doubted.CONTACT: moves[:1]}, 800.0)
    parts = np.array([(slope[0] + rho * slope[1]) ** 2, (1.0 - rho**2) * slope[1] ** 2, 0.1**2])
    assert found.deviation == pytest.approx(np.sqrt(parts.sum()))
    assert list(found.shares) == [Doubted.CONTACT, Doubted.TOOL, Doubted.MACHINE]
    np.testing.assert_allclose(list(found.shares.values()), parts / parts.sum())


@pytest.mark.parametrize(
    ("deviation", "share", "words"),
    [(0.99 * WIDE, 0.9, ""), (0.3, 0.99 * DOMINANT, ""), (0.3, 0.63, "63 % of the band of this limit (standard deviation 30 %) is ")],
)
def test_a_narrow_band_and_one_of_many_parts_have_no_sentence(deviation, share, words):
    rest = (1.0 - share) / 2.0
    shares = {Doubted.CONTACT: rest, Doubted.TOOL: share, Doubted.MACHINE: rest}
    found = BandShares(800.0, deviation, shares).words
    assert found == words + "the tool's fluted diameter and modulus: ring the bare tool, or cut once" * bool(words)


def test_every_part_of_a_band_has_something_that_helps():
    sentences = [BandShares(800.0, 0.3, {each: 1.0}).words for each in Doubted]
    assert all(": " in sentence for sentence in sentences)
    assert sentences[-1].endswith("is the machine: more cuts narrow it")


def test_nothing_is_told_of_what_is_known():
    tip = tip_of(lambda values: [0.0 * values], {})
    assert band_shares(tip, PROCESS, 800.0, DEEPEST, 0.01) is None
    bare = UncertainReceptance(tip.omega, tip.values, tip.rows, tip.cols)
    assert band_shares(bare, PROCESS, 800.0, DEEPEST, 0.01) is None


@dataclass
class Told:
    """A spread along X that is written down, and what its directions belong to."""

    change: np.ndarray
    moves: dict
    parameters: dict
    covers = frozenset((0,))

    def at(self, places):
        return (Variation((0,), self.change[:, places], 0, self.moves, self.parameters),)

    def guides(self):
        return np.zeros((0, OMEGA.size), dtype=complex)


def mode(hertz=900.0, damping=0.03):
    row = (Coordinate("tip", Dof.X),)
    return normal_modes(np.array([2.0 * np.pi * hertz]), np.array([damping]), np.array([[4.0]]), row).receptance(OMEGA)


def tip_of(changes, moves, parameters=()):
    here = mode()
    return UncertainReceptance(OMEGA, here.values, here.rows, here.rows, Told(np.array(changes(here.values)), moves, dict(parameters)))


def shifted(values):
    """By half a percent of the frequency, by a tenth of the damping, by a scale of 3 %."""
    return [mode(904.5).values - values, mode(damping=0.033).values - values, 0.03 * values]
