"""What may stand behind residuals: lines of a model whose one ideal is taken away name it, and those of the model itself name nothing."""

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.identification.causes import BELIEVED, Cause, causes, further_unknowns
from rcsa_ident.identification.further_unknowns import Warming
from rcsa_ident.identification.levenberg_marquardt import refine
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.priors import Priors
from rcsa_ident.identification.rough_data import with_distances
from rcsa_ident.identification.unknowns import Layout, ModalBlock
from tests.identification.models import vector_of

LAYOUT = Layout((ModalBlock(3), ModalBlock(3)))
THETA = vector_of(LAYOUT, ((600.0, 1400.0, 2600.0), (700.0, 1500.0, 2500.0)))
NOISE = 2e-3


def made(data, theta_of, factor=None, seed=4, loud=None):
    """The same cuts with lines of a model that is another one in each cut, and a noise that the data know; less of it in loud cuts."""
    level = NOISE / (np.ones(len(data.cut_ids)) if loud is None else loud)
    rng = np.random.default_rng(seed)
    misfit = Misfit(data, Priors(), (0.0,) * len(data.axes))
    models = [np.zeros((axis.omega.size, axis.outputs), dtype=complex) for axis in data.axes]
    for k in range(len(data.cut_ids)):
        for axis, lines, own in zip(data.axes, models, misfit.models(theta_of(k), LAYOUT), strict=True):
            lines[axis.cut == k] = own[axis.cut == k]
    axes = []
    for i, (axis, model) in enumerate(zip(data.axes, models, strict=True)):
        if factor is not None:
            model = model * factor(i, axis)[:, None]
        noise = rng.standard_normal(model.shape) + 1j * rng.standard_normal(model.shape)
        deviation = level[axis.cut][:, None] / np.sqrt(2.0) * np.abs(model)
        lines, variance = model + deviation * noise, deviation**2
        axes.append(replace(axis, lines=np.stack([lines, np.zeros_like(lines)], axis=2), variance=variance))
    return replace(data, axes=tuple(axes))


def asked(data):
    """What the lines say of themselves once a machine was fitted."""
    misfit = Misfit(data, Priors(), (5e-4,) * len(data.axes))
    size = len(data.coefficient_spread)
    layout = replace(LAYOUT, coefficients=size)
    start = np.concatenate([THETA, np.zeros(size)])
    found = refine(misfit, start, layout, np.zeros((len(data.cut_ids), 2)), 100, grid=32, tolerance=1e-7)
    return found, misfit, causes(found, misfit)


def steady(_):
    return THETA


def test_lines_of_the_model_itself_name_nothing(few):
    found, _, told = asked(made(few, steady))
    assert told.believed == ()
    assert told.without > 0.5
    own = np.linalg.inv(found.evaluation.hessian)
    np.testing.assert_allclose(told.mixed(own), told.without * own + (1.0 - told.without) * told.covariance, rtol=1e-3, atol=1e-9)
    # whoever asks of more is never surer
    assert np.all(np.diag(told.covariance) >= np.diag(own) * (1.0 - 1e-9))


def drifting(count):
    def theta_of(k):
        moved = THETA.copy()
        moved[LAYOUT.axis(0)][:3] += 0.01 * np.array([1.0, 0.3, 0.5]) * k / count
        moved[LAYOUT.axis(1)][:3] += 0.01 * np.array([0.8, 0.4, 0.2]) * k / count
        return moved

    return theta_of


def clamped(data):
    def theta_of(k):
        moved = THETA.copy()
        moved[LAYOUT.joint][:2] += (0.06, -0.06)[data.cut_tooling[k]]
        return moved

    return theta_of


def by_order(i, axis):
    rng = np.random.default_rng(7 + i)
    factors = np.exp(0.04 * (rng.standard_normal(200) + 1j * rng.standard_normal(200)))
    return factors[np.rint(axis.order).astype(int)]


def by_cut(_, axis):
    return np.exp(0.03 * np.random.default_rng(9).standard_normal(200))[axis.cut]


@pytest.mark.parametrize("cause", [Cause.TIME, Cause.CLAMPING, Cause.ORDER, Cause.SCALE])
def test_the_cause_is_named_first(few, cause):
    theta_of = {Cause.TIME: drifting(len(few.cut_ids)), Cause.CLAMPING: clamped(few)}.get(cause, steady)
    factor = {Cause.ORDER: by_order, Cause.SCALE: by_cut}.get(cause)
    _, _, told = asked(made(few, theta_of, factor))
    assert told.found[0].cause is cause
    assert told.found[0].evidence > BELIEVED
    assert 0.0 < told.found[0].share < 1.0
    assert told.without < 1e-3


def heated(speeds, before=0.0):
    """Warmth of bearings whose housing warms up, too, as each cut begins; the heat is that of its speed, and some is there before."""
    step, warmth = 1.0, np.zeros(speeds.size)
    bearing, housing = before, 0.2 * before
    for k, speed in enumerate(speeds / speeds.max()):
        for _ in range(90):
            flow = bearing - housing
            bearing, housing = bearing + step / 900.0 * (speed**1.4 - flow), housing + step / 5400.0 * (flow - 4.0 * housing)
        warmth[k] = bearing
    return warmth


def moving(course):
    return lambda k: np.concatenate([THETA[:3] + 0.02 * course[k] * np.array([1.0, 0.5, 0.7]), THETA[3:]])


def shuffled(data):
    """The same cuts in random order."""
    order = np.random.default_rng(5).permutation(len(data.cut_ids))
    return replace(data, made=replace(data.made, started=90.0 * np.argsort(order).astype(float)))


def test_heat_of_friction_is_told_from_what_else_changes(few):
    """Speeds at random: the warmth follows them late, which neither time nor speed alone explains."""
    data = shuffled(few)
    order = np.argsort(data.made.started)
    course = np.empty(order.size)
    course[order] = heated(few.spindle_speed[order])
    told = asked(made(data, moving(course)))[2]
    assert told.found[0].cause is Cause.TIME
    assert told.found[0].evidence > BELIEVED


def test_a_spindle_may_have_turned_before(few):
    """A long pause in which nobody knows what the spindle did: the machine was hot at first, and nearly cold after it."""
    data = shuffled(few)
    order = np.argsort(data.made.started)
    halves, course = np.array_split(order, 2), np.empty(order.size)
    started = data.made.started + 1800.0 * np.isin(np.arange(order.size), halves[1])
    for half, before in zip(halves, (1.3, 0.2), strict=True):
        course[half] = heated(few.spindle_speed[half], before)
    told = asked(made(replace(data, made=replace(data.made, started=started)), moving(course)))[2]
    assert told.found[0].cause is Cause.TIME
    learned = further_unknowns(told.found[0], data)
    assert isinstance(learned, Warming)
    assert learned.warmed_up


def test_a_thermometer_is_asked(few):
    course = np.random.default_rng(6).uniform(-1.0, 1.0, len(few.cut_ids))
    warm = replace(few, made=replace(few.made, temperature=30.0 + 8.0 * course))
    told = asked(made(warm, moving(course)))[2]
    assert told.found[0].cause is Cause.TEMPERATURE
    assert told.found[0].evidence > BELIEVED
    assert Cause.TEMPERATURE not in {each.cause for each in asked(made(few, moving(course)))[2].found}


def test_a_joint_that_gives_way_in_loud_cuts(few):
    loud = np.exp(np.random.default_rng(8).uniform(-1.0, 1.0, len(few.cut_ids)))

    def softer(k):
        moved = THETA.copy()
        moved[LAYOUT.joint][:2] -= 0.06 * np.log(loud[k])
        return moved

    told = asked(made(few, softer, loud=loud))[2]
    assert told.found[0].cause is Cause.AMPLITUDE
    assert told.found[0].evidence > BELIEVED


def test_sensors_that_look_elsewhere_than_told(few):
    """Told exactly, 12 mm off: the lines speak against it where the modes are those of the machine."""
    data = with_distances(few, np.zeros(2), np.zeros(2))
    behind = replace(data, axes=tuple(replace(axis, behind=0.12) for axis in data.axes))
    lines = made(behind, steady)
    told = asked(replace(lines, axes=tuple(replace(axis, behind=0.0) for axis in lines.axes)))[2]
    assert Cause.DISTANCE in {each.cause for each in told.found}
    assert told.without < 1e-3
