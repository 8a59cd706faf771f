"""The whole method on lines of the virtual machine, whose spindle is not of the form that is fitted."""

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.receptance import dissipation
from rcsa_ident.identification.default import DefaultMethod, parameter_names
from rcsa_ident.identification.posterior import MachineAxis
from rcsa_ident.identification.result import Status
from rcsa_ident.identification.search import SearchSettings
from rcsa_ident.machine.spindle import Spindle
from rcsa_ident.workflows.tip import tooltip

SMALL = DefaultMethod(search=SearchSettings(modes=8, population=6, generations=2, steps=6))
#: For what must not crash, whatever comes out.
TINY = DefaultMethod(search=SearchSettings(modes=4, population=4, generations=1, steps=2), candidates=2)
AXES = (Dof.X, Dof.Y)


def tip_errors(shop, found):
    machine = {axis: MachineAxis(Spindle(r.modes), r.joint) for axis, r in found.axes.items()}
    response = tooltip(machine, shop.held_out.assembly, shop.tip_omega, bands=False)
    return {
        a: np.linalg.norm(response.tip(a) - shop.tip[:, i]) / np.linalg.norm(shop.tip[:, i]) for i, a in enumerate(AXES) if a in machine
    }


def trimmed(cut, axis, count):
    lines = cut.axes[axis]
    fields = {name: getattr(lines, name)[:count] for name in ("order", "omega", "cut", "air", "variance", "coherence", "force")}
    return replace(cut, axes={**cut.axes, axis: replace(lines, **fields)})


@pytest.fixture(scope="module")
def campaign(shop):
    cuts, delays = shop.measurements(np.random.default_rng(0))
    return shop.prepare(cuts), delays, cuts


@pytest.fixture(scope="module")
def found(campaign):
    return SMALL.run(campaign[0], 102)


def test_tooltip_of_a_tooling_that_never_cut(shop, found):
    assert found.status is Status.CONVERGED, found.reasons
    assert max(tip_errors(shop, found).values()) < 0.03


def test_delays_without_a_trigger(campaign, found):
    data, delays, _ = campaign
    period = data.cut_prior[:, 3]
    miss = found.delay - delays
    miss = np.abs(miss - period * np.round(miss / period)) * data.spindle_speed
    assert np.degrees(miss).max() < 1.0
    assert np.all(found.delay_std > 0.0)
    assert np.degrees(found.delay_std * data.spindle_speed).max() < 1.0


def test_the_result_tells_its_story(campaign, found):
    data = campaign[0]
    assert found.method == "default"
    assert (found.seed, found.reasons, found.cut_ids) == (102, (), data.cut_ids)
    assert {stage for _, stage, _ in found.trace} >= {"search", "refine", "learn noise", "polish"}
    for axis, result in found.axes.items():
        assert 0.3 < result.chi2_per_point < 1.2
        assert set(result.per_tooling) == set(data.toolings)
        assert result.model_error < 0.01
        assert result.parameters == parameter_names(result.modes.omega_n.size)
        assert result.theta.size == len(result.parameters) == result.covariance.shape[0]
        assert np.linalg.eigvalsh(result.covariance).min() > 0.0
        omega = 2.0 * np.pi * np.geomspace(10.0, 10000.0, 200)
        assert dissipation(omega, result.modes.receptance(omega).values).min() > -1e-9
        assert str(result.modes.coordinates[0]) == f"flange.{axis}"
        error = np.abs(result.measured["value"] - result.measured["model"])
        assert np.median(error / np.abs(result.measured["value"])) < 0.03


def test_same_seed_same_answer_in_any_order(campaign, found):
    def backwards(function, jobs):
        return [function(job) for job in reversed(list(jobs))][::-1]

    again = SMALL.run(campaign[0], 102, backwards)
    np.testing.assert_array_equal(again.delay, found.delay)
    assert again.trace == found.trace
    for axis in AXES:
        np.testing.assert_array_equal(again.axes[axis].theta, found.axes[axis].theta)
        np.testing.assert_array_equal(again.axes[axis].covariance, found.axes[axis].covariance)


def test_one_tooling_is_not_enough(shop):
    cuts, _ = shop.measurements(np.random.default_rng(0), names=list(shop.truth)[:1], axes=(Dof.X,))
    found = TINY.run(shop.prepare(cuts), 1)
    assert found.status is Status.SUSPECT
    assert any("one tooling" in reason for reason in found.reasons)
    assert list(found.axes) == [Dof.X]


def test_few_cuts_are_named(shop, campaign):
    found = TINY.run(shop.prepare([*campaign[2][:20], *campaign[2][20:25]]), 1)
    assert any("few cuts: 5" in reason for reason in found.reasons)


def test_a_sensor_of_the_wrong_sign(shop):
    cuts, _ = shop.measurements(np.random.default_rng(0), change=lambda values, force, axis: -values if axis is Dof.X else values)
    found = TINY.run(shop.prepare(cuts[::2]), 1)
    assert found.status is Status.SUSPECT
    assert found.axes[Dof.X].model_error > 0.05
    assert found.axes[Dof.X].model_error > 3.0 * found.axes[Dof.Y].model_error
    assert any(reason.startswith("X:") and "unexplained" in reason for reason in found.reasons)


def test_forces_that_are_not_those_of_the_cut(shop):
    rng = np.random.default_rng(1)

    def wrong(values, force, axis):
        return values * (1.0 + 0.15 * (rng.standard_normal(values.size) + 1j * rng.standard_normal(values.size)))

    found = TINY.run(shop.prepare(shop.measurements(np.random.default_rng(0), axes=(Dof.X,), change=wrong)[0]), 1)
    assert found.status is Status.SUSPECT
    assert any("unexplained" in reason for reason in found.reasons)


def test_noise_alone_is_not_a_machine(shop):
    cuts, _ = shop.measurements(np.random.default_rng(0), change=lambda values, force, axis: 0.0 * values)
    found = TINY.run(shop.prepare(cuts), 1)
    assert found.status is Status.SUSPECT
    assert any("noise" in reason for reason in found.reasons)


ODD = {
    "an axis that a cut did not see": lambda cuts: [
        replace(c, axes={a: v for a, v in c.axes.items() if (a is Dof.X) == (i % 2 == 0)}) for i, c in enumerate(cuts)
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
}


@pytest.mark.parametrize("name", ODD)
def test_odd_data_end_in_a_status(shop, campaign, name):
    data = shop.prepare(ODD[name](campaign[2][::4]))
    found = TINY.run(data, 3)
    assert found.status is Status.SUSPECT
    assert found.reasons
    assert np.all(np.isfinite(found.delay_std))
    for result in found.axes.values():
        assert np.all(np.isfinite(result.covariance))
        assert np.isfinite(result.chi2_per_point)
