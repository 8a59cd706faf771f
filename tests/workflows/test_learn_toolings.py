"""Toolings that are new to a machine: what is refused, and what is written of them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.hammer_lines import HammerLines
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.io.settings.toolings import write_tooling
from rcsa_ident.tool_holder.alteration import Alteration
from rcsa_ident.tool_holder.drawings import KnownToolings, RoughToolings, RoughUnknown, rough_toolings
from rcsa_ident.tool_holder.spread import EXACT, Spread
from rcsa_ident.workflows import learn_toolings as learning
from tests.fixtures import by_hand

USED = [SimpleNamespace(tooling="T1", verdict=SimpleNamespace(usable=True), measurements=())]


@pytest.fixture
def campaign(tmp_path):
    told = by_hand.campaign(tmp_path)
    return replace(told, toolings={"T1": replace(told.toolings["T1"], spread=Spread())})


def test_an_exact_drawing_has_nothing_to_learn(campaign):
    exact = replace(campaign, toolings={"T1": replace(campaign.toolings["T1"], spread=EXACT)})
    with pytest.raises(InputError, match=r"T1: a drawing that is exact, allowed is a table \[spread\] in its file"):
        learning.learn_toolings(by_hand.machine(), exact, USED)


def test_a_tooling_that_the_machine_was_identified_with_is_refused(campaign):
    unknown = (RoughUnknown("stickout", "T1", "tooling"),)
    known = KnownToolings(unknown, np.array([5e-5]), np.zeros(1), np.eye(1), ("T1",))
    with pytest.raises(InputError, match="T1, which the machine was identified with"):
        learning.learn_toolings(replace(by_hand.machine(), toolings=known), campaign, USED)


def test_a_machine_without_covariance_is_refused(campaign):
    with pytest.raises(InputError, match="no covariance"):
        learning.learn_toolings(by_hand.machine(known=False), campaign, USED)


@pytest.mark.parametrize(("pairs", "said"), [([("X", "Y")], "response X and force Y"), ([], "no FRF")])
def test_taps_are_along_one_axis_each(campaign, pairs, said):
    with pytest.raises(InputError, match=f"taps: found {said}"):
        learning.campaign_of_taps(campaign.toolings["T1"], pairs)


def test_the_mass_of_a_sensor_at_the_tip_is_taken_out():
    """Of an oscillator that carries it, what is left is the oscillator alone."""
    omega = 2.0 * np.pi * np.linspace(100.0, 3000.0, 60)
    k, c, m, sensor = 2e7, 30.0, 0.3, 2e-3
    carrying, bare = (1.0 / (k - omega**2 * mass + 1j * omega * c) for mass in (m + sensor, m))
    test = HammerLines("tap", "T1", Dof.X, omega, carrying, 1e-20 * np.ones(60), 0.0, 0.0, sensor)
    found = learning.tap_lines(test, (omega[4], omega[-5]))
    np.testing.assert_allclose(found.value, bare[4:-4], rtol=1e-12)
    # a small error of the curve is as much larger or smaller as the curve bends it: |dH/dH'| = |H/H'|^2
    np.testing.assert_allclose(found.variance, 1e-20 * np.abs(bare / carrying)[4:-4] ** 4, rtol=1e-9)
    assert found.sensor_mass == 0.0


@pytest.mark.parametrize(
    ("points", "band", "said"),
    [
        ({"response": 0.0, "force": 0.04}, (0.0, 1e5), "frfs.force: found tap: 40 mm from the tip"),
        ({"response": None, "force": 0.0}, (0.0, 1e5), "frfs.response: found tap: the flange"),
        ({"response": 0.0, "force": 0.0}, (1e3, 1.1e3), "frfs: found tap: 2 lines from 159 to 175 Hz"),
    ],
)
def test_hits_that_tell_nothing_of_the_tip_are_refused(points, band, said):
    omega = np.linspace(100.0, 6000.0, 60)
    test = HammerLines("tap", "T1", Dof.X, omega, 1e-7 * np.ones(60), 1e-20 * np.ones(60), **points)
    with pytest.raises(InputError, match=said):
        learning.tap_lines(test, band)


def test_a_learned_tooling_is_written_and_read_again(campaign, tmp_path):
    """In the drawing's terms; its models, whose learned values are in it now, would be counted twice."""
    drawn = replace(campaign.toolings["T1"], tool_model="EM12", holder_model="PG25")
    names = ("stickout", "youngs_modulus", "holder_diameter", "translational_stiffness", "rotational_stiffness", "translational_damping")
    weights = np.zeros((1, 9, len(names)))
    fields = list(Alteration.__dataclass_fields__)
    for k, name in enumerate(names):
        weights[0, fields.index(name), k] = 1.0
    spread = np.array([5e-5, 0.02, 0.005, 0.4, 0.4, 1.0])
    rough = RoughToolings((), spread, weights)
    fit = SimpleNamespace(
        data=SimpleNamespace(rough=rough, cuts=1, cut_tooling=np.zeros(1, dtype=int)),
        values=np.array([1.0, -0.5, 0.0, 1.0, -1.0, 0.0]),
        covariance=np.diag([0.9, 0.8, 1.0, 0.3, 0.5, 0.7]) ** 2,
        before=(np.zeros(6), np.eye(6)),
        misfit=SimpleNamespace(model_error=(0.01, 0.02)),
        surprise=lambda place: 1.0,
    )
    learnt = learning._learnt(drawn, fit, 0)
    assert learnt.contradiction == ""
    path = tmp_path / "learnt.toml"
    write_tooling(path, learnt.tooling)
    again = read_tooling(path)
    assert (again.tool_model, again.holder_model) == ("", "")
    assert again.assembly.stickout == pytest.approx(drawn.assembly.stickout + 5e-5)
    assert again.assembly.tool[0].material.youngs_modulus == pytest.approx(drawn.assembly.tool[0].material.youngs_modulus * np.exp(-0.01))
    assert again.assembly.contact.translational_stiffness == pytest.approx(2e10 * np.exp(0.4))
    assert again.assembly.contact.rotational_stiffness == pytest.approx(6e5 * np.exp(-0.4))
    # one number for both stiffnesses: the larger
    assert again.spread.contact_stiffness == pytest.approx(0.5 * 0.4)
    assert again.spread.stickout == pytest.approx(0.9 * 5e-5)
    assert again.spread.reclamping == drawn.spread.reclamping
    rows = {row.what: row for row in learning.told(learnt)}
    assert rows["stickout"].drawn == pytest.approx(60.0)
    assert (rows["stickout"].found, rows["stickout"].found_std) == pytest.approx((60.05, 0.045))
    stiff = rows["translational stiffness of the contact"]
    assert (stiff.drawn_std, stiff.found_std) == pytest.approx((0.4 * 2e10, 0.12 * stiff.found))
    assert "fluted diameter" not in rows


@pytest.mark.parametrize(("error", "moved", "said"), [(0.23, 1.0, "23 % of their lines are left over"), (0.01, 6.0, "6.0 standard")])
def test_cuts_that_contradict_are_named(error, moved, said):
    data = SimpleNamespace(cuts=1, cut_tooling=np.array([0, 1, 2]))
    fit = SimpleNamespace(data=data, misfit=SimpleNamespace(model_error=(0.01, error)), surprise=lambda place: moved)
    assert said in learning._contradiction(fit, 0)
    assert "its cuts" in learning._contradiction(fit, 0)
    assert "its taps" in learning._contradiction(fit, 2)


def test_another_clamping_in_a_known_holder_differs_by_both_clampings(campaign):
    """Its own scatter, and that of the clamping that told of the model's contact."""
    drawn = replace(campaign.toolings["T1"], holder_model="PG25")
    known = KnownToolings((RoughUnknown("rotational_stiffness", "PG25", "holder"),), np.array([0.4]), np.zeros(1), np.eye(1), ("T2",))
    spreads = {}
    for told in (None, known):
        found = rough_toolings({"T1": drawn.drawing}, told)
        spreads[told is None] = dict(zip(found.unknowns, found.spread.tolist(), strict=True))
    model, own = RoughUnknown("rotational_stiffness", "PG25", "holder"), RoughUnknown("rotational_stiffness", "T1", "tooling")
    assert spreads[True][model] == pytest.approx(np.hypot(0.4, 0.1))
    assert own not in spreads[True]
    assert spreads[False][model] == pytest.approx(0.4)
    assert spreads[False][own] == pytest.approx(np.sqrt(2.0) * 0.1)
