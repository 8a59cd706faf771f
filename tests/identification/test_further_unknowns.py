"""Unknowns beyond the machine's own: lines change with them as differences say, and courses of warmth are those of their equation."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.assemble_result import _told
from rcsa_ident.identification.further_unknowns import (
    FRICTION,
    LONG_PAUSE,
    LONGEST_TURNING,
    CutScales,
    GivingWay,
    Grips,
    Warming,
    further_places,
    order_factors,
    still_felt,
    warmth,
)
from rcsa_ident.identification.levenberg_marquardt import Solution
from rcsa_ident.identification.made_cuts import USUAL_PAUSE
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.posterior import Posterior
from rcsa_ident.identification.priors import Priors
from rcsa_ident.identification.sweep_correction import start_without_further, without_further
from rcsa_ident.identification.unknowns import JOINT, Layout, ModalBlock, pack, unpack
from tests.identification.models import vector_of

PLAIN = Layout((ModalBlock(3), ModalBlock(3)))
THETA = vector_of(PLAIN, ((600.0, 1400.0, 2600.0), (700.0, 1500.0, 2500.0)))


def all_of(data, constant=900.0):
    data = replace(data, made=replace(data.made, temperature=20.0 + np.cos(np.arange(len(data.cut_ids)))))
    for each in (order_factors(data), CutScales(data.cut_ids[1:]), Grips(data.toolings), GivingWay(), Warming(data.cut_ids, constant)):
        data = each.on(data)
    return data


def changing(data, size=0.05, seed=3):
    """A vector of machines that change with speed and warmth, and its layout."""
    rng = np.random.default_rng(seed)
    axes = tuple(ModalBlock(3, axis.places, softening=True, warming=True) for axis in data.axes)
    layout = Layout(axes, len(data.coefficient_spread), data.clampings)
    parts = []
    for i, block in enumerate(axes):
        part = pack(unpack(THETA[PLAIN.axis(i)], PLAIN.axes[i]), block)
        for name in ("softening", "warming", "places"):
            part[block.parts[name]] = 0.05 * rng.standard_normal(part[block.parts[name]].size)
        parts.append(part)
    further = size * rng.standard_normal(layout.coefficients + layout.clampings)
    return np.concatenate([*parts, THETA[PLAIN.joint], further]), layout


@pytest.mark.parametrize(("constant", "size"), [(900.0, 0.05), (None, 0.05), (None, 0.0)])
def test_lines_change_with_further_unknowns_as_differences_say(rich, constant, size):
    """Also where the warmth of a cut is exactly that of the answer."""
    data = all_of(rich, constant)
    theta, layout = changing(data, size)
    misfit = Misfit(data, Priors(), (1e-2, 1e-2))
    there = misfit.evaluate(theta, layout, np.zeros((len(data.cut_ids), 2)), normal=True)
    for i in range(2):
        root, own = misfit.root_weight(i), layout.axis(i)
        behind = own.stop - own.start
        places = np.concatenate([np.arange(own.start, own.stop), np.arange(layout.tail, layout.force.stop)])
        rows = there.linear.jacobians[i]
        for k in [*range(behind - 12, behind + JOINT), *range(behind + JOINT, rows.shape[0], 3), rows.shape[0] - 1]:
            step = np.zeros(theta.size)
            step[places[k]] = 1e-5
            ahead, back = (misfit.models(theta + sign * step, layout)[i].ravel() for sign in (1.0, -1.0))
            moved = -(ahead - back) * root / 2e-5
            expected = np.concatenate([moved.real, moved.imag])
            np.testing.assert_allclose(rows[k], expected, atol=2e-6 * max(np.abs(expected).max(), 1e-3))


def test_each_has_its_places(rich):
    data = all_of(rich)
    size = len(rich.coefficient_spread)
    for (each, place), first in zip(further_places(data), data.further, strict=True):
        assert each is first
        assert place.start == size
        size = place.stop
    assert size == len(data.coefficient_spread)
    assert data.course_place == further_places(data)[-1][1]
    # a cut without a scale of its own, and one that nobody knew of, move with nothing
    other = replace(rich, cut_ids=("another", *rich.cut_ids[1:]))
    for each in data.further:
        other = each.on(other)
    assert len(other.coefficient_spread) == len(data.coefficient_spread)
    assert not np.any(other.course[0, 2:])


def after(warm, heat, time):
    """Warmth some time later, by steps of an integrator."""
    return float(solve_ivp(lambda _, now: (heat - now) / 700.0, (0.0, time), [warm], rtol=1e-9, atol=1e-12).y[0, -1])


@pytest.mark.parametrize("warmed_up", [False, True])
def test_warmth_follows_its_equation(few, warmed_up):
    rng = np.random.default_rng(8)
    count = len(few.cut_ids)
    pauses = rng.uniform(30.0, LONGEST_TURNING, count)
    # the machine stands for the rest of it
    pauses[count // 2], pauses[-1] = 2000.0, USUAL_PAUSE
    course = rng.permutation(count)
    started = np.empty(count)
    started[course] = np.concatenate([[0.0], np.cumsum(pauses[:-1])])
    data = replace(few, made=replace(few.made, started=started))
    heat = (few.spindle_speed / few.spindle_speed.max()) ** 1.4
    now, expected, long = 0.0, np.empty(count), True
    for k, pause in zip(course, pauses, strict=True):
        if warmed_up and long:
            now = heat.mean()
        long, turning = pause > LONG_PAUSE, min(pause, LONGEST_TURNING)
        expected[k] = after(now, heat[k], 0.5 * turning)
        now = after(expected[k], heat[k], 0.5 * turning)
        if pause > turning:
            now = after(now, 0.0, pause - turning)
    found = warmth(data, 700.0, 1.4, warmed_up)
    np.testing.assert_allclose(found, expected, rtol=1e-6)
    # whatever the warmth before the first cut and the long pause was: the course differs by what is left of it
    left = still_felt(data, 700.0)
    assert left.shape == (count, 2)
    other = found - warmth(data, 700.0, 1.4, not warmed_up)
    np.testing.assert_allclose(left @ np.linalg.lstsq(left, other, rcond=None)[0], other, atol=1e-12)
    assert np.abs(other).max() > 0.3


def test_cuts_of_many_days_have_one_beginning(few):
    data = replace(few, made=replace(few.made, started=86400.0 * np.arange(len(few.cut_ids))))
    assert still_felt(data, 900.0).shape == (len(few.cut_ids), 1)
    # each found the machine cold
    assert warmth(data, 900.0).max() < 0.1
    assert warmth(data, 900.0, warmed_up=True)[0] > 0.5


def test_a_course_is_a_straight_line_near_another(few):
    first = Warming(few.cut_ids, 900.0)
    told = first.on(few)
    values = np.zeros(told.course.shape[1])
    assert first.moved(values) is None
    values[:2] = 0.4, -0.5
    moved = first.moved(values)
    assert moved.time_constant == pytest.approx(900.0 * 2.0**0.4)
    bent = moved.on(few).warmth - told.warmth
    np.testing.assert_allclose(told.course @ values, bent, atol=0.25 * np.abs(bent).max())
    values[2:] = 1.0
    np.testing.assert_allclose((told.course @ values)[: told.cuts], told.course[:, :2] @ values[:2] + 0.04, atol=1e-12)


def test_after_a_warm_up_the_answer_is_the_machine_of_the_cuts(few):
    judged = np.arange(len(few.cut_ids)) == len(few.cut_ids) - 1
    data = replace(few, made=replace(few.made, judged=judged))
    told = Warming(few.cut_ids, 900.0, warmed_up=True).on(data)
    common = np.column_stack([told.warmth, told.course[:, :3]])[~judged]
    np.testing.assert_allclose(common.mean(axis=0), 0.0, atol=1e-12)
    # the first cut feels most of what was before, the later ones less and less
    assert np.all(np.diff(told.course[np.argsort(data.made.started), 2]) < 0.0)


def test_a_thermometer_tells_the_warmest_cut(few):
    temperature = np.linspace(20.0, 45.0, len(few.cut_ids))
    judged = np.arange(temperature.size) == temperature.size - 1
    data = replace(few, made=replace(few.made, temperature=temperature, judged=judged))
    warm = Warming(few.cut_ids, None)
    told = warm.on(data).warmth
    np.testing.assert_allclose([told[0], told[-2]], [-1.0, 0.0], atol=1e-12)
    assert told[-1] > 0.0
    assert warm.moved(np.ones(told.size)) is None


@pytest.mark.parametrize("softens", [False, True])
def test_the_answer_is_as_warm_as_each_speed_makes_it(few, softens):
    data = Warming(few.cut_ids, 900.0).on(few)
    theta, layout = changing(data)
    if not softens:
        kept = np.concatenate(
            [np.delete(np.arange(b.size), b.parts["softening"]) + p.start for b, p in zip(layout.axes, layout.places, strict=True)]
        )
        theta = np.concatenate([theta[kept], theta[layout.tail :]])
        layout = replace(layout, axes=tuple(replace(block, softening=False) for block in layout.axes))
    matrix, own = _told(layout, 0, data.steady)
    found = Posterior(matrix @ theta, np.eye(own.size + JOINT), own, data.speed_range)
    middle, half = data.speed_range
    # d n^p / dx by differences
    rise = ((middle + 1e-3 * half) ** FRICTION - (middle - 1e-3 * half) ** FRICTION) / (2e-3 * (middle + half) ** FRICTION)
    machine = unpack(theta[layout.axis(0)], layout.axes[0])
    for x in (-1.0, 0.0, 0.5):
        change = rise * x * machine.warming + (x * machine.softening if softens else 0.0)
        stiffness = np.outer(machine.omega_n, machine.omega_n) * (np.eye(3) + change)
        expected = np.sqrt(np.linalg.eigvalsh(stiffness))
        modes = found.machine(Dof.X, speed=middle + x * half)[0]
        np.testing.assert_allclose(np.sort(modes.omega_n), expected, rtol=0.02)
        at = unpack(found.theta[:-JOINT], own).at(x)
        np.testing.assert_allclose(np.sort(at.omega_n), expected, rtol=1e-6)


def test_like_cuts_share_their_factors(few):
    kinds = np.arange(len(few.cut_ids)) % 2
    one, two = (order_factors(replace(few, made=replace(few.made, kind=each))) for each in (0 * kinds, kinds))
    assert len(one.keys) < len(two.keys) <= 2 * len(one.keys)
    data = one.on(few)
    axis, (_, place) = data.axes[0], further_places(data)[0]
    slope = axis.force_slope[:, place]
    assert np.all(np.sum(slope != 0.0, axis=1) == 2)
    np.testing.assert_array_equal(np.sum(slope, axis=1), 1.0 + 1.0j)


@pytest.mark.parametrize("constant", [900.0, None])
def test_lines_freed_of_what_was_learned_are_those_of_the_warm_machine(few, constant):
    data = all_of(few, constant)
    theta, layout = changing(data)
    models = Misfit(data, Priors(), (1e-2, 1e-2)).models(theta, layout)
    axes = []
    for axis, model in zip(data.axes, models, strict=True):
        pushed = {"force": np.ones(axis.omega.size), "across": np.full(axis.omega.size, 2.0 + 1.0j)}
        axes.append(replace(axis, lines=np.stack([model, np.zeros_like(model)], axis=2), **pushed))
    made = replace(data, axes=tuple(axes))
    nuisance = np.zeros((len(data.cut_ids), 2))
    found = Solution(theta, layout, Misfit(made, Priors(), (1e-2, 1e-2)).evaluate(theta, layout, nuisance), True, 0)
    freed = without_further(made, Priors(), found)
    assert freed.further == ()
    assert freed.coefficient_spread == few.coefficient_spread
    start, known, _ = start_without_further(made, found, freed)
    for axis, model in zip(freed.axes, Misfit(freed, Priors(), (1e-2, 1e-2)).models(start, known), strict=True):
        # a warmth of exactly nothing counts as 1e-9
        np.testing.assert_allclose(axis.lines[:, :, 0], model, rtol=1e-8)
    # what pushed across in the same lines is corrected as what pushed along in those of the other axis
    x, y = freed.axes
    beside = dict(zip(zip(y.cut.tolist(), y.order.tolist(), strict=True), y.force, strict=True))
    expected = [(2.0 + 1.0j) * beside[key] for key in zip(x.cut.tolist(), x.order.tolist(), strict=True)]
    np.testing.assert_allclose(x.across, expected, rtol=1e-12)
    assert np.ptp(np.abs(x.across)) > 0.01
