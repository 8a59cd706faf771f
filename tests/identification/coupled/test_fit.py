"""Whole identifications of virtual machines whose planes feel each other, or nothing of each other; no model that is fitted made them."""

import pickle
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from rcsa_ident.base.remarks import says
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.receptance import dissipation
from rcsa_ident.identification import evidence as method_module
from rcsa_ident.identification.coupled import fit
from rcsa_ident.identification.coupled.score import STRIKES
from rcsa_ident.identification.evidence import EvidenceSelection
from rcsa_ident.identification.levenberg_marquardt import Solution
from rcsa_ident.identification.result import IdentificationCode
from rcsa_ident.identification.search import SearchSettings
from rcsa_ident.identification.status import Status
from rcsa_ident.identification.task import Phase
from rcsa_ident.identification.unknowns import CoupledLayout, unpack
from tests.fixtures.kept import kept
from tests.fixtures.virtual_shop import AXES, TIP_OMEGA, oblique, open_shop
from tests.identification.coupled.models import coupled_vector

slow = pytest.mark.slow
METHOD = EvidenceSelection(search=SearchSettings(modes=8, population=4, generations=2, steps=6), candidates=2)
RPM = np.pi / 30.0
SKEWED = partial(oblique, degrees=10.0, softer=0.6)


def gyroscopic(spindle):
    return replace(spindle, gyroscopic=True)


class Campaign:
    """A virtual machine, the data of its cuts, their answer and what the score test said on the way."""

    def __init__(self, speeds, change, sense=1.0, start=None, other_sense=None, noise=0):
        self.shop, self.sense = open_shop(speeds, change, sense), sense
        self.cuts, self.delays = self.shop.measurements(np.random.default_rng(noise), fixture=False, both_forces=True)
        self.data = self.shop.prepare(self.cuts, turning=True)
        self.method = replace(METHOD, start=start)
        self.scores = []
        ask = method_module.coupling

        def told(*given):
            self.scores.append(ask(*given))
            return self.scores[-1]

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(method_module, "coupling", told)
            if other_sense is not None:
                patch.setattr(fit, "OTHER_SENSE", other_sense)
            self.found = self.method.run(self.data, 102)

    def tip(self, tooling, rpm, spread=False):
        """What the answer's machine says of a tip at a speed, and the truth, shape (n, 2, 2)."""
        tip = self.found.machine.at(rpm * RPM).tip(tooling, TIP_OMEGA, spread=spread)
        return tip, self.shop.tips(tooling.assembly, self.sense * rpm * RPM)

    def errors(self, tooling, rpm):
        """Of the four receptances over the norm of the direct one of the moved axis; and how large the cross terms are, in the same."""
        tip, true = self.tip(tooling, rpm)
        size = np.linalg.norm(np.einsum("nii->ni", true), axis=0)[:, None]
        return np.linalg.norm(values(tip) - true, axis=0) / size, np.linalg.norm(true, axis=0) / size


def values(tip):
    return np.array([[tip.between(f"tip.{a}", f"tip.{b}") for b in AXES] for a in AXES]).transpose(2, 0, 1)


def _straight():
    return Campaign(20, lambda spindle: spindle)


def _start():
    """Planes apart that searches of other machines begin from, to come to an end sooner."""
    return {axis: part.posterior for axis, part in kept(_straight).found.axes.items()}


def _skewed():
    # with the noise of seeds 0 and 2 rounding decides whether moments are taken for directions: tips stay right, the words do not
    return Campaign(12, SKEWED, start=_start(), noise=1)


def _turning():
    return Campaign(12, gyroscopic, start=_start())


@pytest.fixture(scope="module")
def straight():
    return kept(_straight)


@pytest.fixture(scope="module")
def start():
    return _start()


@pytest.fixture(scope="module")
def skewed():
    return kept(_skewed)


@pytest.fixture(scope="module")
def turning():
    return kept(_turning)


@pytest.mark.slow
def test_planes_that_feel_nothing_stay_apart(straight):
    assert straight.found.whole is None
    assert straight.found.machine.whole is None
    assert straight.found.status is Status.CONVERGED, straight.found.reasons
    assert [s.found for s in straight.scores] == [False] * len(straight.scores)
    last = straight.scores[-1]
    assert max(abs(last.score), abs(last.oblique), abs(last.gyroscopic)) < 3.0
    assert IdentificationCode.PLANES_COUPLED not in {note.code for note in straight.found.notes}


@pytest.mark.slow
def test_and_answer_as_if_nobody_had_asked(straight, start):
    """To the last bit what the fit of planes apart gives: from the same cuts that do not tell the other force."""
    untold = [
        replace(cut, axes={a: replace(lines, across=None, across_slope=None) for a, lines in cut.axes.items()}) for cut in straight.cuts
    ]
    method = replace(METHOD, start=start)
    one, other = method.run(straight.data, 3), method.run(straight.shop.prepare(untold), 3)
    assert one.whole is other.whole is None
    assert (one.status, one.reasons, one.notes, one.trace) == (other.status, other.reasons, other.notes, other.trace)
    np.testing.assert_array_equal(one.delay, other.delay)
    for axis in AXES:
        np.testing.assert_array_equal(one.axes[axis].posterior.theta, other.axes[axis].posterior.theta)
        np.testing.assert_array_equal(one.axes[axis].posterior.covariance, other.axes[axis].posterior.covariance)


@slow
@pytest.mark.parametrize("axis", AXES)
def test_one_axis_alone_is_never_both(skewed, start, axis):
    """Half of what is felt is not there: the answer is that of planes apart, which says how badly it explains the lines."""
    cuts = [replace(cut, axes={axis: cut.axes[axis]}) for cut in skewed.cuts]
    found = replace(METHOD, start=start).run(skewed.shop.prepare(cuts, turning=True), 3)
    assert found.whole is None
    assert set(found.axes) == {axis}
    assert found.axes[axis].posterior is not None


@slow
@pytest.mark.parametrize("kept_causes", [False, True])
def test_coupling_that_a_cause_puts_off_is_asked_in_the_end(skewed, start, monkeypatch, kept_causes):
    """Where the cause is refused, of the lines as they were; else of those that are freed of it."""
    monkeypatch.setattr(method_module, "_has_a_cause", lambda *_: True)
    if not kept_causes:
        monkeypatch.setattr(method_module, "further_unknowns", lambda *_: None)
    found = replace(METHOD, start=start).run(skewed.data, 102)
    assert found.whole is not None
    assert kept_causes or not found.changes
    assert says(found.notes, IdentificationCode.FORCE_ORDERS) is bool(found.changes.orders)
    for tooling in skewed.shop.toolings.values():
        tip = values(found.machine.at(12_000.0 * RPM).tip(tooling, TIP_OMEGA, spread=False))
        true = skewed.shop.tips(tooling.assembly, 12_000.0 * RPM)
        error = np.linalg.norm(tip - true, axis=0) / np.linalg.norm(np.einsum("nii->ni", true), axis=0)[:, None]
        assert error.max() < 0.05


@slow
def test_axes_of_different_outputs_are_planes_apart(straight, start):
    """As before: the fixture's accelerometer of one axis only."""
    cuts, _ = straight.shop.measurements(np.random.default_rng(0), both_forces=True)
    cuts = [replace(cut, axes={Dof.X: cut.axes[Dof.X], Dof.Y: cut.axes[Dof.Y].summed()}) for cut in cuts[::2]]
    data = straight.shop.prepare(cuts, turning=True)
    assert [axis.outputs for axis in data.axes] == [2, 1]
    found = replace(METHOD, start=start).run(data, 3)
    assert found.whole is None
    assert set(found.axes) == set(AXES)
    assert found.status is not Status.FAILED


@slow
def test_stiffness_that_changes_with_speed_is_not_taken_for_coupling(start):
    """Lines that no speed explains look like something felt across: asked before the stiffness may change, the score is 38 here."""

    def softening(spindle):
        return replace(spindle, bearings=tuple(replace(b, softening=4e-6 / RPM) for b in spindle.bearings))

    campaign = Campaign(20, softening, start=start)
    assert campaign.found.whole is None
    assert campaign.scores[-1].score < STRIKES
    assert all(part.posterior.layout.softening for part in campaign.found.axes.values())


def apart(campaign):
    """Score, and both kinds, where the planes' fit ended."""
    last = campaign.scores[-1]
    return last.score, last.oblique, last.gyroscopic


@pytest.mark.witness
@pytest.mark.slow
def test_kinds_of_coupling_are_told_apart(skewed, turning):
    score, out_of_axes, moments = apart(skewed)
    assert score > 2.0 * STRIKES
    assert out_of_axes > 1.5 * moments
    score, out_of_axes, moments = apart(turning)
    assert score > STRIKES
    assert moments > 1.5 * out_of_axes
    assert 0.2 < turning.scores[-1].explained < 1.0


@slow
def test_oblique_machine(skewed):
    """What was cut, and a holder that never cut, at the slowest and the fastest speed; its cross terms are 8 to 17 % of the direct ones."""
    found = skewed.found
    allowed = {IdentificationCode.WIDE_POSTERIOR}
    assert found.status is Status.CONVERGED or {reason.code for reason in found.reasons} <= allowed, found.reasons
    assert found.whole.best.layout.turning == found.whole.best.layout.skew == 0
    for rpm in (8000.0, 20000.0):
        for tooling, direct, cross in (*((t, 0.03, 0.01) for t in skewed.shop.toolings.values()), (skewed.shop.held_out, 0.06, 0.02)):
            error, size = skewed.errors(tooling, rpm)
            assert np.diag(error).max() < direct
            assert max(error[0, 1], error[1, 0]) < cross
            assert min(size[0, 1], size[1, 0]) > 4.0 * max(error[0, 1], error[1, 0])
    note = next(str(note) for note in found.notes if note.code is IdentificationCode.PLANES_COUPLED)
    assert "principal directions lie out of X and Y" in note
    told = next(part for part in found.notes if part.code is IdentificationCode.PLANES_COUPLED)
    assert told is found.notes[0]
    # each plane at standstill without the other stands beside it, without unknowns of its own
    for part in found.axes.values():
        assert part.posterior is None
        assert part.parameters == ()
        assert np.median(np.abs(part.measured["value"] - part.measured["model"]) / np.abs(part.measured["value"])) < 0.03


@slow
def test_gyroscopic_machine(turning):
    found = turning.found
    allowed = {IdentificationCode.WIDE_POSTERIOR}
    assert found.status is Status.CONVERGED or {reason.code for reason in found.reasons} <= allowed, found.reasons
    assert found.whole.turns
    assert found.whole.best.layout.turning == 1
    for rpm in (8000.0, 20000.0):
        for tooling, direct, cross in (*((t, 0.03, 0.015) for t in turning.shop.toolings.values()), (turning.shop.held_out, 0.06, 0.025)):
            error, size = turning.errors(tooling, rpm)
            assert np.diag(error).max() < direct
            assert max(error[0, 1], error[1, 0]) < cross
            if rpm == 20000.0:
                assert min(size[0, 1], size[1, 0]) > 2.5 * max(error[0, 1], error[1, 0])
    note = next(str(note) for note in found.notes if note.code is IdentificationCode.PLANES_COUPLED)
    assert "the faster it turns" in note
    assert "the other way" not in note


@slow
@pytest.mark.parametrize("kind", ["skewed", "turning"])
def test_bands_hold_the_truth(kind, request):
    """The cross terms' too: neighbouring frequencies are wrong together, so that the mean square alone is asked."""
    campaign = request.getfixturevalue(kind)
    tip, true = campaign.tip(campaign.shop.held_out, 14000.0, spread=True)
    deviation = tip.deviation()
    coordinates = {str(row): row for row, _ in deviation}
    for i, a in enumerate(AXES):
        for j, b in enumerate(AXES):
            real, imaginary = deviation[coordinates[f"tip.{a}"], coordinates[f"tip.{b}"]]
            error = values(tip)[:, i, j] - true[:, i, j]
            z = np.concatenate([error.real / real, error.imag / imaginary])
            assert 0.1 < np.sqrt(np.mean(z**2)) < 3.0, (a, b)
            # and they are not wide because they say nothing
            assert np.linalg.norm(np.hypot(real, imaginary)) < 0.1 * np.linalg.norm(true[:, i, i])


@slow
@pytest.mark.parametrize("kind", ["skewed", "turning"])
def test_it_takes_energy_at_every_speed(kind, request):
    """Standing, in the campaign, and at twice its highest speed; turned round the machine's own modes are transposed."""
    whole = request.getfixturevalue(kind).found.whole
    omega = 2.0 * np.pi * np.geomspace(10.0, 10000.0, 200)
    for speed in (0.0, 1000.0, 2094.0, 4188.0):
        flange = whole.candidate(whole.best, speed).flange
        one = flange.receptance(omega).values
        assert dissipation(omega, one).min() > -1e-9
        back = flange.at(-flange.speed).receptance(omega).values
        np.testing.assert_allclose(back.transpose(0, 2, 1), one, atol=1e-9 * np.abs(one).max())


@pytest.mark.slow
def test_a_spindle_that_turns_the_other_way_is_told(start):
    """A left-hand cutter, or X and Y exchanged. So few cuts gain less than `OTHER_SENSE`: here any gain counts.

    With 24 cuts it hung on the last bit.
    """
    mirrored = Campaign(20, gyroscopic, -1.0, start, other_sense=20.0)
    found = mirrored.found
    assert found.whole.best.layout.turning == -1
    note = next(str(note) for note in found.notes if note.code is IdentificationCode.PLANES_COUPLED)
    assert "seems to turn the other way: a left-hand cutter, or X and Y exchanged" in note
    # tool-holders on it are told the other speed
    assert found.machine.at(1000.0).turning == pytest.approx(-1000.0)
    for tooling in mirrored.shop.toolings.values():
        error, size = mirrored.errors(tooling, 20000.0)
        assert np.diag(error).max() < 0.08
        assert max(error[0, 1], error[1, 0]) < 0.6 * max(size[0, 1], size[1, 0])


def test_turned_round_it_is_the_same_vector_again():
    layout = CoupledLayout(4, softening=True, skew=2, turning=1, coefficients=2)
    theta = coupled_vector(layout)

    class Evaluated:
        nuisance = np.ones((3, 2))

    found = Solution(theta, layout, Evaluated(), True, 1)
    turned, other, nuisance = fit.turned_round(found)
    assert other == replace(layout, turning=-1)
    np.testing.assert_array_equal(unpack(turned, other.block).skew, -unpack(theta, layout.block).skew)
    rest = np.ones(theta.size, dtype=bool)
    rest[layout.block.parts["skew"]] = False
    np.testing.assert_array_equal(turned[rest], theta[rest])
    assert nuisance is Evaluated.nuisance
    back, again, _ = fit.turned_round(replace(found, theta=turned, layout=other))
    assert again == layout
    np.testing.assert_array_equal(back, theta)


@pytest.mark.slow
def test_same_seed_same_answer_in_any_process(start):
    """To the last bit, and of one phase each call: tasks travel as text, last one first."""
    small = Campaign(6, SKEWED, start=start)
    assert small.found.whole is not None
    phases = []

    def elsewhere(function, tasks):
        tasks = list(tasks)
        phases.append({task.phase for task in tasks})
        return [pickle.loads(pickle.dumps(function(pickle.loads(pickle.dumps(task))))) for task in reversed(tasks)][::-1]

    again = small.method.run(small.data, 102, elsewhere)
    assert all(len(each) == 1 for each in phases)
    assert {Phase.COUPLED} in phases
    one = small.found
    assert (again.trace, again.reasons, again.notes, again.status) == (one.trace, one.reasons, one.notes, one.status)
    np.testing.assert_array_equal(again.delay, one.delay)
    np.testing.assert_array_equal(again.delay_std, one.delay_std)
    np.testing.assert_array_equal(again.whole.covariance, one.whole.covariance)
    for mine, yours in zip((again.whole.best, *again.whole.rivals), (one.whole.best, *one.whole.rivals), strict=True):
        assert mine.layout == yours.layout
        np.testing.assert_array_equal(mine.theta, yours.theta)
