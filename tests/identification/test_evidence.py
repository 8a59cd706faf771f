"""The whole method on lines of the virtual machine, whose spindle is not of the form that is fitted."""

import pickle
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rcsa_ident.base.remarks import says
from rcsa_ident.cutting.force import ForceCoefficient, ForceTerm
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.receptance import dissipation
from rcsa_ident.identification.diagnostics import EXACT_DRAWINGS
from rcsa_ident.identification.evidence import EvidenceSelection
from rcsa_ident.identification.genetic_algorithm import PaperGeneticAlgorithm
from rcsa_ident.identification.preview import Preview
from rcsa_ident.identification.progress import BOTH, Stage
from rcsa_ident.identification.result import IdentificationCode
from rcsa_ident.identification.search import SearchSettings
from rcsa_ident.identification.status import Status
from rcsa_ident.identification.task import Phase
from rcsa_ident.identification.unknowns import Layout, ModalBlock, parameter_names
from tests.fixtures import by_hand
from tests.fixtures.virtual_shop import AXES, TIP_OMEGA, open_shop
from tests.identification.models import vector_of

pytestmark = pytest.mark.slow

SMALL = EvidenceSelection(search=SearchSettings(modes=8, population=4, generations=2, steps=6), candidates=2)
#: For what must not crash, whatever comes out.
TINY = EvidenceSelection(search=SearchSettings(modes=3, population=2, generations=1, steps=1), candidates=1)
RPM = np.pi / 30.0


def tip_errors(shop, found, speed=None, told=None):
    """Relative error of the tooltip FRF of a tooling that never cut, each axis, at a speed; `told` is the speed the model is asked for."""
    machine = found.machine.at(speed if told is None else told)
    tip = machine.tip(shop.held_out, TIP_OMEGA, spread=False)
    true = shop.tip(14000.0 * RPM if speed is None else speed)
    return {a: np.linalg.norm(own(tip, a) - true[:, i]) / np.linalg.norm(true[:, i]) for i, a in enumerate(AXES) if a in machine.axes}


def own(tip, axis):
    """The direct receptance along an axis."""
    return tip.between(f"tip.{axis}", f"tip.{axis}")


def off(found, data, delays):
    """Errors of the delays, in the tooth-passing period that is nearest [s]."""
    period = data.cut_prior.tooth_period
    miss = found.delay - delays
    return miss - period * np.round(miss / period)


def trimmed(cut, axis, count):
    lines = cut.axes[axis]
    return replace(cut, axes={**cut.axes, axis: lines.of(np.arange(count))})


@pytest.fixture(scope="module")
def campaign(shop):
    cuts, delays = shop.measurements(np.random.default_rng(0))
    return shop.prepare(cuts), delays, cuts


@pytest.fixture(scope="module")
def told():
    return []


@pytest.fixture(scope="module")
def found(campaign, told):
    return SMALL.run(campaign[0], 102, progress=told.append)


def test_tooltip_of_a_tooling_that_never_cut(shop, found):
    assert found.status is Status.CONVERGED, found.reasons
    assert max(tip_errors(shop, found).values()) < 0.03


def test_bands_hold_the_truth(shop, found):
    tip = found.machine.tip(shop.held_out, TIP_OMEGA)
    true, deviation = shop.tip(14000.0 * RPM), tip.deviation()
    for i, axis in enumerate(AXES):
        error, (real, imaginary) = own(tip, axis) - true[:, i], deviation[(Coordinate("tip", axis),) * 2]
        z = np.concatenate([error.real / real, error.imag / imaginary])
        # neighbouring frequencies are wrong together: one draw of a few unknowns
        assert 0.2 < np.sqrt(np.mean(z**2)) < 2.5
        # and they are not wide because they say nothing
        width = np.hypot(real, imaginary)
        assert np.median(width / np.abs(true[:, i])) < 0.05


def test_delays_without_a_trigger(campaign, found):
    data, delays, _ = campaign
    assert np.degrees(np.abs(off(found, data, delays)) * data.spindle_speed).max() < 1.0
    assert np.all(found.delay_std > 0.0)
    assert np.degrees(found.delay_std * data.spindle_speed).max() < 1.0


def test_the_result_tells_its_story(campaign, found):
    data = campaign[0]
    assert found.method == "default"
    assert (found.seed, found.reasons, found.cut_ids) == (102, (), data.cut_ids)
    stages = {Stage.SEARCH, Stage.REFINE, Stage.NOISE, Stage.MODES, Stage.EXCHANGE, Stage.GROW, Stage.POLISH}
    assert {step.stage for step in found.trace} >= stages
    assert found.coefficients == {}
    for axis, result in found.axes.items():
        assert 0.3 < result.chi2_per_point < 1.2
        assert set(result.per_tooling) == set(data.toolings)
        assert result.model_error < 0.01
        posterior = result.posterior
        assert posterior.layout == ModalBlock(result.modes.omega_n.size)
        assert result.parameters == parameter_names(posterior.layout)
        assert posterior.theta.size == len(result.parameters) == posterior.covariance.shape[0]
        assert np.linalg.eigvalsh(posterior.covariance).min() > 0.0
        assert posterior.speed_range == data.speed_range
        modes, joint = posterior.machine(axis)
        np.testing.assert_array_equal(modes.phi, result.modes.phi)
        assert joint == result.joint
        # the one that the evidence alone would have chosen has fewer modes
        assert len(posterior.rivals) == 1
        assert posterior.machine(axis, posterior.rivals[0])[0].omega_n.size < modes.omega_n.size
        omega = 2.0 * np.pi * np.geomspace(10.0, 10000.0, 200)
        assert dissipation(omega, result.modes.receptance(omega).values).min() > -1e-9
        assert str(result.modes.coordinates[0]) == f"flange.{axis}"
        error = np.abs(result.measured["value"] - result.measured["model"])
        assert np.median(error / np.abs(result.measured["value"])) < 0.03
        assert {each.shape for each in result.measured.values()} == {(data.axes[0].omega.size,)}


def test_progress_is_told_of_every_step_of_the_trace(found, told):
    for axis in ("x", "y", BOTH):
        assert [step for step in told if step.axis == axis] == [step for step in found.trace if step.axis == axis]
    assert all(step.candidate is None for step in found.trace)
    for step in told:
        candidate = step.candidate
        assert np.isfinite(step.cost)
        assert candidate.theta.size == candidate.layout.size == candidate.information.shape[0]
        assert len(candidate.layout.axes) == (2 if step.axis == BOTH else 1)
        assert sum(a.modes for a in candidate.layout.axes) == step.modes
        assert step.label == (f"{step.modes} modes" if step.stage is Stage.MODES else step.stage.value)


def test_a_preview_shows_what_a_step_has_come_to(campaign, found, told):
    preview = Preview(campaign[0])
    last = told[-1]
    assert preview.axes(last) == AXES
    for axis in AXES:
        result, lines = found.axes[axis], preview.lines(last, axis)
        order = np.argsort(result.measured["omega"], kind="stable")
        np.testing.assert_array_equal(lines.omega, result.measured["omega"][order])
        np.testing.assert_allclose(np.abs(lines.measured), np.abs(result.measured["value"])[order], rtol=1e-9)
        np.testing.assert_allclose(lines.model, result.measured["model"][order], rtol=1e-9)
    first = next(step for step in told if step.axis == "x")
    assert preview.axes(first) == (Dof.X,)
    assert preview.axes(replace(first, candidate=None)) == ()


def test_same_seed_same_answer_in_any_order(shop, campaign):
    data = shop.prepare(campaign[2][::8], spread=(0.05, 0.05, 0.0, 0.0))

    phases = []

    def elsewhere(function, tasks):
        """Last task first, each as if in a process of its own."""
        tasks = list(tasks)
        phases.append({task.phase for task in tasks})
        return [pickle.loads(pickle.dumps(function(pickle.loads(pickle.dumps(task))))) for task in reversed(tasks)][::-1]

    one, again, other = TINY.run(data, 5), TINY.run(data, 5, elsewhere), TINY.run(data, 6)
    # tasks of one call are of one phase, which they say
    assert phases[:2] == [{Phase.SEARCH}, {Phase.OTHER_AXIS}]
    assert phases[-1] == {Phase.BOTH_AXES}
    np.testing.assert_array_equal(again.delay, one.delay)
    np.testing.assert_array_equal(again.delay_std, one.delay_std)
    assert (again.trace, again.reasons, again.notes) == (one.trace, one.reasons, one.notes)
    assert other.trace != one.trace
    for axis in AXES:
        np.testing.assert_array_equal(again.axes[axis].posterior.theta, one.axes[axis].posterior.theta)
        np.testing.assert_array_equal(again.axes[axis].posterior.covariance, one.axes[axis].posterior.covariance)


def test_warm_start_comes_to_the_same_machine_sooner(shop, campaign, found, told):
    warm = replace(SMALL, start={axis: result.posterior for axis, result in found.axes.items()})
    steps = []
    again = warm.run(campaign[0], 7, progress=steps.append)
    assert again.status is Status.CONVERGED
    assert len(steps) < 0.75 * len(told)
    assert Stage.SEARCH not in {step.stage for step in steps}
    assert max(tip_errors(shop, again).values()) < 0.03
    one, two = (each.machine.tip(shop.held_out, TIP_OMEGA) for each in (found, again))
    for axis in AXES:
        width = np.hypot(*one.deviation()[(Coordinate("tip", axis),) * 2])
        assert np.sqrt(np.mean((np.abs(own(one, axis) - own(two, axis)) / width) ** 2)) < 2.0


@pytest.fixture(scope="module")
def believed(shop):
    """The cutting force is simulated with a K_tc that is 10 % too high."""
    known = shop.machine.workpiece.coefficients
    return replace(known, tangential=1.1 * known.tangential)


@pytest.fixture(scope="module")
def clamped_cuts(shop, believed):
    """Triggers whose tooth angle nobody knows, and the wrong K_tc with a prior of 7 %."""
    first, second = shop.truth
    cuts, delays = shop.measurements(np.random.default_rng(0), trigger={first: (0.7, False), second: (-0.4, False)}, believed=believed)
    return shop.prepare(cuts, spread=(0.07, 0.05, 0.0, 0.0)), delays


@pytest.fixture(scope="module")
def clamped(clamped_cuts):
    return SMALL.run(clamped_cuts[0], 102)


def test_a_wrong_cutting_coefficient_is_found(shop, clamped_cuts, clamped):
    assert clamped.status is Status.CONVERGED, clamped.reasons
    scale, std = clamped.coefficients[ForceCoefficient(ForceTerm.TANGENTIAL)]
    # searches as small as this one end in one of several valleys, which one as the processor rounds: seeds 102 and 1 to 4 gave
    # -0.053 to -0.087 on one, so that what they say of themselves is too narrow
    assert scale == pytest.approx(-np.log(1.1), abs=0.05)
    assert std < 0.02
    ratio, std = clamped.coefficients[ForceCoefficient(ForceTerm.RATIO)]
    assert ratio == pytest.approx(0.0, abs=3.0 * std)
    # bands count what may act beside the model in so far as the lines speak for it
    assert std < 0.02
    # the smooth errors behind them have no name
    assert tuple(clamped.coefficients) == clamped_cuts[0].coefficients
    assert max(tip_errors(shop, clamped).values()) < 0.03


def test_what_a_wrong_coefficient_costs_where_nobody_asks(shop, clamped_cuts, clamped):
    """The same lines with forces taken for exact."""
    named = len(clamped_cuts[0].coefficients)
    axes = tuple(replace(a, force_slope=a.force_slope[:, named:]) for a in clamped_cuts[0].axes)
    data = replace(clamped_cuts[0], axes=axes, coefficients=(), coefficient_spread=())
    warm = replace(SMALL, start={axis: result.posterior for axis, result in clamped.axes.items()})
    deaf = warm.run(data.only(Dof.Y), 1)
    assert tip_errors(shop, deaf)[Dof.Y] > 2.0 * tip_errors(shop, clamped)[Dof.Y]


def test_delays_by_what_is_known_of_the_tooth_angle(shop, campaign, found, clamped_cuts, clamped, believed):
    """No trigger, a trigger of unknown tooth angle, one of known: each knows more."""
    first, second = shop.truth
    cuts, delays = shop.measurements(np.random.default_rng(0), trigger={first: (0.7, True), second: (-0.4, True)}, believed=believed)
    data = shop.prepare(cuts, spread=(0.07, 0.05, 0.0, 0.0))
    warm = replace(SMALL, start={axis: result.posterior for axis, result in clamped.axes.items()})
    known = warm.run(data, 1)
    assert known.status is Status.CONVERGED, known.reasons
    assert max(tip_errors(shop, known).values()) < 0.03
    std, error = [], []
    for each, of, true in ((found, campaign[0], campaign[1]), (clamped, *clamped_cuts), (known, data, delays)):
        std.append(np.median(each.delay_std * of.spindle_speed))
        error.append(np.sqrt(np.mean((off(each, of, true) * of.spindle_speed) ** 2)))
        assert error[-1] < 3.0 * std[-1]
    assert std[2] < 0.7 * std[1] < 0.7 * 0.9 * std[0]
    # errors are draws: between an unknown angle and no trigger a tenth of the deviation does not decide
    assert error[2] < min(error[:2])
    # a known tooth angle tells the very turn
    np.testing.assert_allclose(known.delay, delays, atol=2e-6)


def softer(spindle):
    """A fifth of the bearings' stiffness is lost on the way to the highest speed."""
    return replace(spindle, bearings=tuple(replace(b, softening=0.2 / (20000.0 * RPM)) for b in spindle.bearings))


def test_a_machine_that_softens_with_speed():
    shop = open_shop(14, softer)
    found = SMALL.run(shop.prepare(shop.measurements(np.random.default_rng(0), axes=(Dof.X,))[0]), 102)
    assert found.status is Status.CONVERGED, found.reasons
    assert found.axes[Dof.X].posterior.layout.softening
    assert found.axes[Dof.X].model_error < 0.005
    for rpm in (8000.0, 14000.0, 20000.0):
        assert tip_errors(shop, found, rpm * RPM)[Dof.X] < 0.03, rpm
    # a machine that is taken to be the same at all speeds is off by far more
    for rpm in (8000.0, 20000.0):
        assert tip_errors(shop, found, rpm * RPM, told=14000.0 * RPM)[Dof.X] > 0.08


def test_a_machine_that_does_not_change_is_not_said_to(found):
    assert not any(result.posterior.layout.softening for result in found.axes.values())


def test_a_cut_that_contradicts_the_others_is_named_and_counts_less(shop, campaign):
    """One of twenty was made with another cutter: its lines are a third too large and turned."""
    bad = [replace(c, axes={Dof.X: c.axes[Dof.X]}) for c in campaign[2][::2]]
    lines = bad[7].axes[Dof.X]
    bad[7] = replace(bad[7], axes={Dof.X: replace(lines, cut=(1.3 + 0.4j) * lines.cut)})
    without = SMALL.run(shop.prepare([*bad[:7], *bad[8:]]), 102)
    spoilt = SMALL.run(shop.prepare(bad), 102)
    assert spoilt.status is Status.CONVERGED, spoilt.reasons
    named = [note for note in spoilt.notes if note.code is IdentificationCode.CUTS_WEIGHTED_DOWN]
    assert len(named) == 1
    assert [c.cut_id for c in bad if f" {c.cut_id} (" in named[0]] == [bad[7].cut_id]
    # the others are believed as if it were not there
    assert spoilt.axes[Dof.X].model_error < 1.5 * without.axes[Dof.X].model_error
    assert tip_errors(shop, spoilt)[Dof.X] < 0.03


def test_one_tooling_is_not_enough(shop):
    cuts, _ = shop.measurements(np.random.default_rng(0), names=list(shop.truth)[:1], axes=(Dof.X,))
    found = TINY.run(shop.prepare(cuts), 1)
    assert found.status is Status.SUSPECT
    assert says(found.reasons, IdentificationCode.ONE_TOOLING)
    assert list(found.axes) == [Dof.X]
    assert says(found.notes, IdentificationCode.ONE_AXIS)


def test_few_cuts_are_named(shop, campaign):
    cuts = [replace(c, axes={Dof.X: c.axes[Dof.X]}) for c in (*campaign[2][:8], *campaign[2][20:25])]
    found = TINY.run(shop.prepare(cuts), 1)
    assert not any("few cuts: 8" in reason for reason in found.reasons)
    assert any("few cuts: 5" in reason for reason in found.reasons)


def test_a_sensor_of_the_wrong_sign(shop):
    cuts, _ = shop.measurements(np.random.default_rng(0), change=lambda values, force, axis: -values if axis is Dof.X else values)
    found = TINY.run(shop.prepare(cuts[::4]), 1)
    assert found.status is Status.SUSPECT
    assert found.axes[Dof.X].model_error > 0.05
    assert any(reason.code is IdentificationCode.UNEXPLAINED and reason.startswith("X:") for reason in found.reasons)
    assert sum(EXACT_DRAWINGS in reason for reason in found.reasons) == 1


def test_forces_that_are_not_those_of_the_cut(shop):
    rng = np.random.default_rng(1)

    def wrong(values, force, axis):
        share = rng.standard_normal((values.shape[0], 1)) + 1j * rng.standard_normal((values.shape[0], 1))
        return values * (1.0 + 0.15 * share)

    found = TINY.run(shop.prepare(shop.measurements(np.random.default_rng(0), axes=(Dof.X,), change=wrong)[0][::2]), 1)
    assert found.status is Status.SUSPECT
    assert says(found.reasons, IdentificationCode.UNEXPLAINED)


def test_noise_alone_is_not_a_machine(shop):
    cuts, _ = shop.measurements(np.random.default_rng(0), change=lambda values, force, axis: 0.0 * values)
    found = TINY.run(shop.prepare(cuts[::2]), 1)
    assert found.status is Status.SUSPECT
    assert says(found.reasons, IdentificationCode.WEAK_SIGNAL)


ODD = {
    "an axis that a cut did not see": lambda cuts: [
        replace(c, axes={a: v for a, v in c.axes.items() if (a is Dof.X) == (i % 2 == 0)}) for i, c in enumerate(cuts)
    ],
    "a fixture that one cut did not see": lambda cuts: [
        replace(cuts[0], axes={Dof.X: cuts[0].axes[Dof.X], Dof.Y: cuts[0].axes[Dof.Y].summed()}),
        *cuts[1:],
    ],
    "a cut without lines": lambda cuts: [replace(cuts[0], axes={}), *cuts[1:]],
    "a cut with a single line": lambda cuts: [trimmed(trimmed(cuts[0], Dof.X, 1), Dof.Y, 0), *cuts[1:]],
    "one line in all": lambda cuts: [replace(trimmed(cuts[0], Dof.X, 1), axes={Dof.X: trimmed(cuts[0], Dof.X, 1).axes[Dof.X]})],
    "one cut": lambda cuts: cuts[:1],
    "lines of nothing": lambda cuts: [
        replace(c, axes={a: replace(v, cut=0.0 * v.cut, air=0.0 * v.air, variance=0.0 * v.variance) for a, v in c.axes.items()})
        for c in cuts
    ],
    "a million times too large": lambda cuts: [replace(c, axes={a: replace(v, cut=1e6 * v.cut) for a, v in c.axes.items()}) for c in cuts],
    "a million times too small": lambda cuts: [
        replace(c, axes={a: replace(v, cut=1e-6 * v.cut, variance=1e-12 * v.variance) for a, v in c.axes.items()}) for c in cuts
    ],
    "a trigger on one cut": lambda cuts: [replace(cuts[0], delay=1e-3, delay_std=1e-6), *cuts[1:]],
    "an edge of unknown tooth angle on one cut": lambda cuts: [
        replace(cuts[0], delay=1e-3, delay_std=1e-6, tooth_angle_known=False),
        *cuts[1:],
    ],
}


@pytest.mark.parametrize("name", ODD)
def test_odd_data_end_in_a_status(shop, campaign, name):
    data = shop.prepare(ODD[name](campaign[2][::8]), spread=(0.05, 0.05, 0.0, 0.0))
    found = TINY.run(data, 3)
    assert found.status is Status.SUSPECT
    assert found.reasons
    assert np.all(np.isfinite(found.delay_std))
    for result in found.axes.values():
        assert np.all(np.isfinite(result.posterior.covariance))
        assert np.isfinite(result.chi2_per_point)
    assert all(np.isfinite(value) and np.isfinite(std) for value, std in found.coefficients.values())


HOPELESS = {
    "a line that is no number": ("lines", lambda x: np.where(np.arange(x.shape[0])[:, None, None] == 3, np.nan, x)),
    "a variance that is no number": ("variance", lambda v: np.where(np.arange(v.shape[0])[:, None] == 3, np.nan, v)),
    "a tool-holder without a receptance": ("flange", lambda a: np.nan * a),
    "forces without slopes": ("force_slope", lambda s: np.inf * (1.0 + s)),
    "lines of another universe": ("lines", lambda x: 1e150 * x),
    "lines of which nothing is known": ("variance", lambda v: np.inf * v),
}


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("name", HOPELESS)
def test_data_without_a_finite_fit_end_as_failed(shop, campaign, name):
    """No traceback and no machine: a status, a reason and its code."""
    field, spoil = HOPELESS[name]
    data = shop.prepare(campaign[2][::8], spread=(0.05, 0.05, 0.0, 0.0))
    spoilt = replace(data, axes=(replace(data.axes[0], **{field: spoil(getattr(data.axes[0], field))}), *data.axes[1:]))
    # the published method weighs no variances, and does not mind what unit the lines have
    methods = [TINY] if "of" in name.split() else [TINY, PaperGeneticAlgorithm(generations=2)]
    for method in methods:
        found = method.run(spoilt, 3)
        assert found.status is Status.FAILED
        assert not found.at_minimum
        assert (found.axes, found.cut_ids, found.seed, found.method) == ({}, (), 3, method.name)
        assert {reason.code for reason in found.reasons} == {IdentificationCode.NO_FINITE_FIT}
        if "no number" in name:
            assert found.reasons[0].startswith("X: not all ")


def test_a_task_without_a_finite_answer_ends_the_search_wherever_it_ran(shop, campaign):
    """As a service keeps it: the answer None of a task stands for it."""
    data = shop.prepare(campaign[2][::8])
    for lost in (Phase.SEARCH, Phase.OTHER_AXIS, Phase.BOTH_AXES):

        def forgetful(function, tasks, lost=lost):
            return [None if task.phase is lost else function(task) for task in tasks]

        assert TINY.run(data, 3, forgetful).status is Status.FAILED


@pytest.mark.parametrize(
    ("evidences", "searches", "chosen"),
    [((5.0, 3.0, 90.0, 1.0), 2, 3.0), ((500.0, 300.0, 400.0, 200.0), 4, 200.0), ((500.0, 900.0, 100.0, 110.0), 4, 100.0)],
)
def test_passes_are_searched_until_two_searches_agree_and_the_likeliest_answer_counts(shop, monkeypatch, evidences, searches, chosen):
    cuts, _ = shop.measurements(np.random.default_rng(1), fixture=False)
    data = shop.prepare([replace(cut, acceleration=200.0, length=0.28) for cut in cuts[::4]])
    layout = Layout((ModalBlock(3), ModalBlock(3)), len(data.coefficient_spread))
    solution = SimpleNamespace(theta=vector_of(layout, ((600.0, 1400.0, 2500.0),) * 2), layout=layout)
    asked, sequences = [], set()

    def found(method, data, freed, sequence, *rest):
        asked.append(freed)
        sequences.add(id(sequence))
        evidence = evidences[len(asked) - 1]
        answer = replace(by_hand.identification(), method=str(evidence))
        return SimpleNamespace(evidence=evidence, solution=solution, answer=lambda seed, name: answer)

    coupled = []

    def felt(method, data, fit, *rest):
        coupled.append(fit)
        return fit

    monkeypatch.setattr(EvidenceSelection, "_found", found)
    monkeypatch.setattr(EvidenceSelection, "_asked", felt)
    assert EvidenceSelection().run(data, 1).method == str(chosen)
    assert len(asked) == searches
    # the first one takes the lines as they are, each later one those that an answer has freed, from starts of its own
    assert asked[0] is data
    assert all(np.any(freed.axes[0].lines != data.axes[0].lines) for freed in asked[1:])
    assert len(sequences) == 1
    # whether planes feel each other is asked once, of the answer that counts
    assert [fit.evidence for fit in coupled] == [chosen]
