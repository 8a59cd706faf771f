"""Plans for a machine whose planes feel each other: both planes at once, with feeds that push the tools in further directions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.force import force_and_slope
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.coupled.design import coupled_information, directions_of
from rcsa_ident.identification.cut_data import prepare
from rcsa_ident.identification.experiment_design import LEAST_MODEL_ERROR, expected_cut, harmonics
from rcsa_ident.tool_holder.model import tool_holder_receptance
from rcsa_ident.tool_holder.turning import turning_pair
from rcsa_ident.workflows.plan import CutConstraints, alternating, plan_cuts
from tests.fixtures import by_hand, coupled_by_hand

COEFFICIENTS = CuttingCoefficients(902e6, 0.26, tangential_spread=0.02, ratio_spread=0.02)
DOWN = Engagement.from_immersion(0.5, "down")
ALLOWED = CutConstraints(600.0, 1400.0, (0.2e-3,), 1e-4, DOWN, margin=1.0)
NOISE = 1e-9
ERRORS = {Dof.X: 1e-3, Dof.Y: 1e-3}
BAND = (400.0, 2500.0)


def expected(speeds, feed=0.0, spread=(0.02, 0.02, 0.0, 0.0)):
    """Cuts that were not made yet, with turning tool-holders."""
    tooling, cuts = by_hand.tooling(), []
    for k, speed in enumerate(speeds):
        conditions = CuttingConditions(speed, 4e-4, 1e-4, DOWN, feed)
        force = force_and_slope(tooling.cutter, conditions, COEFFICIENTS, harmonics(4, min(speeds)))
        cuts.append(expected_cut(f"{k}", "T1", speed, 4, *force, NOISE, [Dof.X, Dof.Y]))
    turning = {"T1": lambda omega, ratio: turning_pair(tooling.assembly, omega, ratio)}
    return prepare(cuts, {"T1": lambda omega: tool_holder_receptance(tooling.assembly, omega)}, {"T1": 4}, spread, turning), cuts


@pytest.mark.parametrize("turning", [0, 1, -1])
def test_information_is_that_of_the_machines_own_lines(turning):
    """Another route: the flange's motion under both forces by the general coupling, its slopes by differences, the delay projected out."""
    posterior = replace(coupled_by_hand.posterior(turning, softening=True))
    machine = replace(coupled_by_hand.machine(turning, softening=True), whole=posterior)
    speeds = [700.0, 1100.0, 1390.0]
    data, cuts = expected(speeds, feed=0.3)
    rows = coupled_information(data, posterior, ERRORS)
    tooling = by_hand.tooling()

    def motion(whole, cut):
        """Flange's displacement in X and Y under the cut's forces, shape (lines, 2) [m]."""
        lines = cut.axes[Dof.X]
        standing = replace(machine, whole=whole, kept_sides=()).at(cut.spindle_speed)
        coupled = standing.coupled(tooling, lines.omega)
        h = np.array([[coupled.between(f"spindle.{a}", f"tip.{b}") for b in "xy"] for a in "xy"])
        # the flange itself moves behind the joint
        return np.einsum("abn,nb->na", h, np.stack([lines.force, lines.across], axis=1))

    s, step = directions_of(posterior), 1e-3
    for k, cut in enumerate(cuts):
        here = motion(posterior, cut)
        at = lambda theta, cut=cut: motion(replace(posterior, best=replace(posterior.best, theta=theta), rivals=()), cut)  # noqa: E731
        columns = [(at(posterior.best.theta + step * d) - at(posterior.best.theta - step * d)) / (2.0 * step) for d in s.T]
        columns += [motion(replace(posterior, best=rival), cut) - here for rival in posterior.rivals]
        forces = np.stack([cut.axes[Dof.X].force, cut.axes[Dof.X].across], axis=1)
        slopes = np.stack([cut.axes[Dof.X].force_slope, cut.axes[Dof.X].across_slope], axis=1)
        lines = cut.axes[Dof.X]
        coupled = machine.at(cut.spindle_speed).coupled(tooling, lines.omega)
        h = np.array([[coupled.between(f"spindle.{a}", f"tip.{b}") for b in "xy"] for a in "xy"])
        for c, spread in ((0, 0.02), (1, 0.02), (-1, data.coefficient_spread[2])):
            columns.append(spread * np.einsum("abn,nb->na", h, forces * slopes[:, :, c]))
        columns.append(1j * lines.omega[:, None] * here)
        change = np.array(columns)
        # noise and model errors: of the own line, and of the other one's share
        variance = NOISE**2 + 0.5 * 1e-3**2 * (np.abs(here) ** 2 + 0.03**2 * np.abs(here[:, ::-1]) ** 2)
        white = change / np.sqrt(variance)
        dense = np.concatenate([white[:, :, 0].real, white[:, :, 0].imag, white[:, :, 1].real, white[:, :, 1].imag], axis=1).T
        delay = dense[:, -1]
        dense = dense[:, :-1] - np.outer(delay, delay @ dense[:, :-1]) / (delay @ delay)
        np.testing.assert_allclose(rows[k].T @ rows[k], dense.T @ dense, rtol=2e-3, atol=2e-3 * np.max(np.abs(dense.T @ dense)))
    assert min(ERRORS.values()) > LEAST_MODEL_ERROR


def planned(machine, allowed, count=6):
    tooling = by_hand.tooling()
    return plan_cuts(machine, [tooling], [tooling], allowed, COEFFICIENTS, NOISE, ERRORS, BAND, count)


@pytest.mark.parametrize("turning", [0, 1], ids=["oblique", "gyroscopic"])
def test_feeds_along_both_axes_are_proposed_and_tell_more(turning):
    machine = coupled_by_hand.machine(turning)
    both = alternating(ALLOWED, [by_hand.tooling()], COEFFICIENTS)
    assert both.second_feed == pytest.approx(0.5 * np.pi)
    one, two = planned(machine, ALLOWED), planned(machine, both)
    assert {cut.conditions.feed_angle for cut in one.cuts} == {0.0}
    assert {cut.conditions.feed_angle for cut in two.cuts} == {0.0, both.second_feed}
    assert two.band[-1, 0] < one.band[-1, 0] < one.band[0, 0]
    speeds = [cut.conditions.spindle_speed for cut in two.cuts]
    assert len(set(speeds)) == len(speeds)


def test_planes_that_nothing_is_known_across_take_turns():
    machine = by_hand.machine(softening=True)
    two = planned(machine, alternating(ALLOWED, [by_hand.tooling()], COEFFICIENTS), 8)
    assert len({cut.conditions.feed_angle for cut in two.cuts}) == 2


def test_what_pushes_in_no_further_direction_is_not_proposed():
    """A slot's force with four teeth is constant: it has no lines in any direction."""
    slot = replace(ALLOWED, engagement=Engagement.from_immersion(1.0, "down"))
    assert alternating(slot, [by_hand.tooling()], COEFFICIENTS) is slot
