"""Standard deviations of modes, against closed forms and against draws."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.remarks import Remark, says
from rcsa_ident.cutting.shape import CutterCode
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.passivity import FrfCode
from rcsa_ident.identification.hammer_lines import HammerLines
from rcsa_ident.identification.modal_parameters import flange_of
from rcsa_ident.identification.posterior import Posterior
from rcsa_ident.identification.unknowns import ModalBlock, pack
from rcsa_ident.signals.measurement import Reading
from rcsa_ident.signals.verdict import RecordCode, Verdict
from rcsa_ident.workflows.identify import data_of, mode_deviations, of_campaign
from tests.fixtures import by_hand
from tests.fixtures.virtual_shop import open_shop


def identification_of(posterior):
    found = by_hand.identification()
    return replace(found, axes={Dof.X: replace(found.axes[Dof.X], posterior=posterior)})


@pytest.mark.slow
def test_an_uncoupled_mode_in_closed_form():
    natural, zeta = np.array([5000.0, 12000.0]), np.array([0.03, 0.06])
    axis = flange_of(natural, np.ones((2, 2)), np.diag(np.sqrt(2.0 * zeta * natural)), np.eye(2) * 1e-5)
    theta = np.concatenate([pack(axis), by_hand.JOINT_LOGS])
    covariance = np.zeros((theta.size,) * 2)
    # log omega_n of both, and log L_00, log L_11 behind the frequencies and shapes
    s_omega, s_factor, correlation = 0.01, 0.05, 0.4
    for n, place in ((0, 6), (1, 8)):
        covariance[n, n], covariance[place, place] = s_omega**2, s_factor**2
        covariance[n, place] = covariance[place, n] = correlation * s_omega * s_factor
    known = Posterior(theta, covariance, ModalBlock(2))
    omega_std, zeta_std = mode_deviations(identification_of(known))[Dof.X]
    np.testing.assert_allclose(omega_std, s_omega * natural, rtol=1e-7)
    # zeta = L^2 / (2 omega_n)
    relative = np.sqrt(4.0 * s_factor**2 + s_omega**2 - 4.0 * correlation * s_factor * s_omega)
    np.testing.assert_allclose(zeta_std, relative * zeta, rtol=1e-6)


@pytest.mark.slow
def test_coupled_modes_scatter_as_drawn_machines_do():
    known = by_hand.posterior(softening=True)
    known = replace(known, covariance=known.covariance * 0.01)
    omega_std, zeta_std = mode_deviations(identification_of(known))[Dof.X]
    rng = np.random.default_rng(5)
    draws = [known.machine(Dof.X, theta)[0] for theta in rng.multivariate_normal(known.theta, known.covariance, 4000)]
    # a standard deviation of 4000 draws is good to 1.1 %
    np.testing.assert_allclose(np.std([d.omega_n for d in draws], axis=0), omega_std, rtol=0.05)
    np.testing.assert_allclose(np.std([d.zeta for d in draws], axis=0), zeta_std, rtol=0.05)


def test_an_overdamped_mode_has_its_two_real_poles():
    natural = np.array([5000.0, 9000.0])
    axis = flange_of(natural, np.ones((2, 2)), np.diag(np.sqrt(2.0 * np.array([0.05, 1.5]) * natural)), np.eye(2) * 1e-5)
    theta = np.concatenate([pack(axis), by_hand.JOINT_LOGS])
    known = Posterior(theta, 1e-6 * np.eye(theta.size), ModalBlock(2))
    omega_std, zeta_std = mode_deviations(identification_of(known))[Dof.X]
    modes = known.machine(Dof.X)[0]
    assert omega_std.size == modes.omega_n.size == 3
    assert np.all(np.isfinite(omega_std) & (omega_std > 0.0))
    np.testing.assert_allclose(zeta_std[modes.zeta == 1.0], 0.0, atol=1e-9)


def test_no_posterior_no_deviation():
    found = by_hand.identification()
    axes = {Dof.X: replace(found.axes[Dof.X], posterior=None), Dof.Y: found.axes[Dof.Y]}
    assert list(mode_deviations(replace(found, axes=axes))) == [Dof.Y]


@pytest.mark.parametrize("axis", [Dof.X, Dof.Y])
def test_they_stand_in_the_modes_order(axis):
    found = by_hand.identification()
    part = found.axes[axis]
    # as if only the second natural frequency were unknown
    covariance = np.zeros_like(part.posterior.covariance)
    covariance[1, 1] = 1e-4
    only = replace(found, axes={axis: replace(part, posterior=replace(part.posterior, covariance=covariance))})
    omega_std, _ = mode_deviations(only)[axis]
    assert omega_std[1] == pytest.approx(0.01 * part.modes.omega_n[1], rel=0.02)
    assert omega_std[0] < 0.1 * omega_std[1]


@pytest.mark.parametrize(
    ("cutter", "told"),
    [
        ({}, ""),
        ({"corner_radius": 0.03e-3}, ""),
        ({"corner_radius": 0.5e-3}, "T1: computed as a cylinder: the corner radius is more than a tenth of the depth"),
        ({"shape": "bull-nose", "corner_radius": 2e-3}, "T1: computed as a cylinder: the cutter's shape is bull-nose"),
    ],
)
def test_cutters_that_are_no_cylinders_are_noted(tmp_path, cutter, told):
    """Cuts are 0.4 mm deep; what was noted before stays, and nothing becomes suspect for it."""
    campaign, found = by_hand.campaign(tmp_path), by_hand.identification()
    tooling = campaign.toolings["T1"]
    campaign = replace(campaign, toolings={"T1": replace(tooling, cutter=replace(tooling.cutter, **cutter))})
    again = of_campaign(found, campaign)
    assert again.notes[: len(found.notes)] == found.notes
    assert again.reasons == found.reasons
    further = again.notes[len(found.notes) :]
    assert says(further, CutterCode.AS_CYLINDER) == bool(told)
    assert [note.startswith(told) and "forces of shallow cuts are 6 to 50 % off" in note for note in further] == [True] * bool(told)


@pytest.mark.parametrize("fast", [0.0, 1e-3])
def test_a_clock_and_what_tests_assume_are_noted_behind_all_else(tmp_path, fast):
    """All speeds lie beside the programmed ones by as much: the spindle is slow or the recorder's clock fast."""
    shop = open_shop(speeds=3)
    cuts, _ = shop.measurements(np.random.default_rng(1))
    readings = [Reading(each.cut_id, each.tooling, each.spindle_speed * (1.0 + fast), Verdict(()), (each,)) for each in cuts]
    assumed = Remark(FrfCode.TURNED, "read as m/N")
    omega = np.arange(1.0, 9.0)
    hit = HammerLines("1", "T1", Dof.X, omega, np.ones(8), np.ones(8), 0.0, 0.0, remarks=(assumed,))
    campaign, found = by_hand.campaign(tmp_path), by_hand.identification()
    notes = of_campaign(found, campaign, readings, [hit, replace(hit, id="2")]).notes
    plain = of_campaign(found, campaign).notes
    assert notes[: len(plain) + 1] == (*plain, assumed)
    assert len(notes) == len(plain) + 1 + (fast > 0.0)
    if fast:
        assert notes[-1].code is RecordCode.CLOCK
        assert "clock_error_percent = 0.1 in [campaign]" in notes[-1]


def test_cuts_at_several_postures_are_data_of_robots_alone(tmp_path):
    campaign = by_hand.campaign(tmp_path)
    first, *others = campaign.cuts
    campaign = replace(campaign, cuts=(replace(first, posture=(0.1,) * 6), *others))
    with pytest.raises(InputError, match=r"posture_deg: found cuts at 2 postures"):
        data_of(campaign, [])
    with pytest.raises(InputError, match=r"cuts: found none of 0 usable"):
        data_of(campaign, [], robot=True)
