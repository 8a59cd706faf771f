"""Toolings whose drawings are only roughly right, in the data, in an identification and in what it predicts."""

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.identification.data import LEVER
from rcsa_ident.identification.evidence import EvidenceSelection
from rcsa_ident.identification.rough_data import with_rough_toolings
from rcsa_ident.identification.status import Status
from rcsa_ident.io.results.identifications import identification_to_json, machine_from_json
from rcsa_ident.setup.campaign import Campaign
from rcsa_ident.stability.tip_modes import TIP
from rcsa_ident.tool_holder.alteration import Alteration, altered
from rcsa_ident.tool_holder.drawings import Drawing, rough_toolings
from rcsa_ident.tool_holder.model import tool_holder_receptance
from rcsa_ident.tool_holder.rough import rough_tool_holder
from rcsa_ident.tool_holder.spread import EXACT, Spread
from tests.fixtures.kept import kept
from tests.fixtures.virtual_shop import TIP_OMEGA, open_shop

#: What is wrong with the drawings of both toolings, about one and a half of an honest drawing's spreads.
TRULY = (
    Alteration(fluted_diameter=0.04, youngs_modulus=-0.02, translational_stiffness=-0.5, rotational_stiffness=-0.3, holder_diameter=0.005),
    Alteration(fluted_diameter=-0.03, youngs_modulus=0.015, translational_stiffness=0.5, rotational_stiffness=0.6, rotational_damping=0.7),
)


def test_as_drawn_is_the_same_data_without_them(rough):
    drawn = rough.as_drawn()
    assert drawn.rough is None
    assert len(drawn.coefficient_spread) == len(rough.coefficient_spread) - len(rough.rough.unknowns)
    for axis, other in zip(drawn.axes, rough.axes, strict=True):
        assert axis.force_slope.shape[1] == len(drawn.coefficient_spread)
        np.testing.assert_array_equal(axis.force_slope, np.delete(other.force_slope, np.r_[rough.rough_place], axis=1))
    assert drawn.as_drawn() is drawn


def test_tool_holders_stand_where_they_are_put(rough, shop):
    values = np.random.default_rng(3).uniform(-1.5, 1.5, len(rough.rough.unknowns))
    for where in (0.0 * values, values):
        put = rough.with_toolings_at(where)
        np.testing.assert_array_equal(put.rough_start, where)
        for t, name in enumerate(rough.toolings):
            assembly = altered(shop.toolings[name].assembly, rough.rough.alteration(t, where))
            for axis in put.axes:
                own = rough.cut_tooling[axis.cut] == t
                response = tool_holder_receptance(assembly, axis.omega[own])
                a22, a21 = response["flange", "flange"], response["flange", "tip"]
                expected = np.stack(
                    [a22[:, 0, 0], LEVER * a22[:, 0, 1], LEVER**2 * a22[:, 1, 1], a21[:, 0, 0], LEVER * a21[:, 1, 0]], axis=1
                )
                found = np.hstack([axis.flange, axis.tip])[own]
                assert np.linalg.norm(found - expected) < 1e-3 * np.linalg.norm(expected)


@pytest.fixture(scope="module")
def roughly_drawn():
    """A campaign of toolings that are not as drawn, its answer, and that of who takes the drawings for exact."""
    return kept(_roughly_drawn)


def _roughly_drawn():
    names = iter(TRULY)
    truly = {}

    def true(tooling):
        truly[tooling.name] = altered(tooling.assembly, next(names))
        return truly[tooling.name]

    shop = open_shop(speeds=24, truly=true)
    cuts, _ = shop.measurements(np.random.default_rng(2), both_forces=True)
    told = {name: replace(each, spread=Spread()) for name, each in shop.toolings.items()}
    data = shop.prepare(cuts, spread=(0.05, 0.05, 0.0, 0.0))
    rough = rough_toolings({name: Drawing(each.assembly, each.spread) for name, each in told.items()})
    unsure = with_rough_toolings(data, rough, [rough_tool_holder(each.assembly, 4300.0) for each in told.values()])
    return shop, truly, told, EvidenceSelection().run(unsure, 1), EvidenceSelection().run(data, 1)


def tip_errors(shop, truly, machine, told):
    """Relative errors of the tips of the toolings that cut, and the share of their parts that lies in the 90 % band."""
    speed = float(np.mean([omega[0] / order[0] for order, omega, _ in shop.truth[next(iter(truly))]]))
    errors, inside = [], []
    for name, assembly in truly.items():
        true = shop.tips(assembly, speed)
        tip = machine.tip(told[name], TIP_OMEGA)
        deviation = tip.deviation()
        for i, row in enumerate(TIP):
            away = tip.between(str(row), str(row)) - true[:, i, i]
            errors.append(np.linalg.norm(away) / np.linalg.norm(true[:, i, i]))
            inside.append(np.abs(np.concatenate([away.real, away.imag])) <= 1.645 * np.concatenate(deviation[row, row]))
    return np.array(errors), float(np.mean(inside))


@pytest.mark.slow
def test_cuts_tell_what_the_drawings_do_not(roughly_drawn):
    shop, truly, told, found, _ = roughly_drawn
    errors, inside = tip_errors(shop, truly, found.machine, told)
    assert errors.max() < 0.05
    # neighbouring frequencies are right or wrong together: of one machine alone a band of 90 % may hold less
    assert inside > 0.6
    known = found.toolings
    place = {(unknown.field, unknown.owner): k for k, unknown in enumerate(known.unknowns)}
    for name, by in zip(told, TRULY, strict=True):
        # contact and fluted part are what the cuts tell best: within three of their deviations, and those are smaller than before
        k = place["fluted_diameter", name]
        assert abs(known.spread[k] * known.mean[k] - by.fluted_diameter) < 3.0 * known.spread[k] * known.deviation[k]
    assert np.min(known.deviation) < 0.7


@pytest.mark.slow
def test_who_takes_the_drawings_for_exact_is_far_off_and_says_so(roughly_drawn):
    shop, truly, told, found, drawn = roughly_drawn
    exact = {name: replace(each, spread=EXACT) for name, each in told.items()}
    errors, _ = tip_errors(shop, truly, drawn.machine, exact)
    rough, _ = tip_errors(shop, truly, found.machine, told)
    assert np.median(errors) > 3.0 * np.median(rough)
    assert drawn.status is Status.SUSPECT


@pytest.mark.slow
def test_the_answer_goes_through_its_file(roughly_drawn):
    shop, _, told, found, _ = roughly_drawn
    campaign = Campaign("", 25600.0, (), shop.machine.workpiece, told, ())
    machine = machine_from_json(identification_to_json(found, campaign, []), "")
    assert machine.toolings.unknowns == found.toolings.unknowns
    for name in told:
        one, other = (each.tip(told[name], TIP_OMEGA) for each in (found.machine, machine))
        np.testing.assert_allclose(other.values, one.values, rtol=1e-9)
        for key, deviation in one.deviation().items():
            np.testing.assert_allclose(other.deviation()[key], deviation, rtol=1e-6)
