"""Labels of a limit that is known in closed form, beside brute force over a grid."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.stability.labels.cut_margins import DrawnMargins
from rcsa_ident.stability.labels.label_noise import LabelNoise
from rcsa_ident.stability.labels.label_posterior import Effort, LabelModel, LabelPosterior, elliptical_slices, learn_labels
from rcsa_ident.stability.labels.limit_discrepancy import LimitDiscrepancy
from rcsa_ident.stability.labels.tested_cuts import TestedCuts, Verdict
from tests.stability.labels.test_limit_discrepancy import points

MODEL = LabelModel(LabelNoise(width=0.15), LimitDiscrepancy(0.2, 0.1))
EFFORT = Effort(2000, 1000, 2, 1500)
S, C = Verdict.STABLE, Verdict.CHATTER


def learnt(cuts, seed=1):
    """From a limit of 1 mm, its logarithm 0.3 z0 everywhere and 0.3 z1 more above 700 rad/s; chatter at 5000 rad/s times e^(0.1 z1)."""

    def margins(z):
        high = (cuts.spindle_speed > 700.0).astype(float)
        log = np.log(1e-3) + 0.3 * z[:, :1] + 0.3 * z[:, 1:2] * high
        return DrawnMargins(log - np.log(cuts.axial_depth), np.tile(5000.0 * np.exp(0.1 * z[:, 1:2]), cuts.axial_depth.size))

    return learn_labels(margins, 2, cuts, points(cuts.spindle_speed), MODEL, np.random.default_rng(seed), EFFORT)


def brute(cuts, model):
    """Means of z0, z1 and of the errors at both speeds: the sum over a grid of all four."""
    t = np.linspace(-4.5, 4.5, 41)
    z0, z1, u0, u1 = np.meshgrid(t, t, t, t, indexing="ij", sparse=True)
    speeds = np.unique(cuts.spindle_speed)
    root = model.discrepancy.root(points(speeds))
    error = root[0, 0] * u0, root[1, 0] * u0 + root[1, 1] * u1
    log_p = -0.5 * (z0**2 + z1**2 + u0**2 + u1**2)
    for k, verdict in enumerate(cuts.verdict):
        at = int(np.searchsorted(speeds, cuts.spindle_speed[k]))
        margin = np.log(1e-3) + 0.3 * z0 + 0.3 * z1 * (speeds[at] > 700.0) + error[at] - np.log(cuts.axial_depth[k])
        log_p = log_p + np.log(model.noise.stable(margin if verdict is S else -margin))
        if np.isfinite(cuts.chatter_frequency[k]):
            off = (np.log(5000.0 / cuts.chatter_frequency[k]) + 0.1 * z1) / model.noise.frequency
            log_p = log_p + np.log(model.noise.wrong + (1 - model.noise.wrong) * np.exp(-0.5 * off**2))
    prior = np.exp(-0.5 * (z0**2 + z1**2 + u0**2 + u1**2))
    p = np.exp(log_p)
    means = [float(np.sum(p * each) / p.sum()) for each in (z0, z1, *error)]
    return means, float(np.log(p.sum() / prior.sum()))


@pytest.mark.parametrize("heard", [np.nan, 5600.0])
def test_beside_the_sum_over_a_grid(heard):
    speed, depth = np.array([600.0, 600.0, 800.0, 800.0, 800.0]), np.array([0.8, 1.3, 1.5, 2.0, 1.2]) * 1e-3
    cuts = TestedCuts(speed, depth, (S, S, C, C, C), np.array([np.nan, np.nan, heard, np.nan, np.nan]))
    found = learnt(cuts)
    means, evidence = brute(cuts, MODEL)
    assert [*found.z.mean(axis=0), *found.error.mean(axis=0)] == pytest.approx(means, abs=0.06)
    assert found.log_evidence == pytest.approx(evidence, abs=0.06)
    assert found.points[:, 0].tolist() == [600.0, 800.0]


def test_a_frequency_tells_what_a_verdict_does_not():
    speed, depth = np.array([800.0]), np.array([3e-3])
    """Beside a normal likelihood of width 0.02 / 0.1 with a floor: a share of the draws believes in another line of the spectrum."""
    spread = [learnt(TestedCuts(speed, depth, (C,), np.array([hertz]))).z.std(axis=0)[1] for hertz in (np.nan, 5000.0)]
    assert spread[0] > 0.8
    narrow = 0.2 / np.sqrt(1.04)
    other = 0.02 / (0.02 + 0.98 * narrow)
    assert spread[1] == pytest.approx(np.sqrt(other + (1.0 - other) * narrow**2), rel=0.08)


def test_cuts_far_inside_teach_nothing():
    cuts = TestedCuts(np.array([600.0, 800.0]), np.array([0.02e-3, 60e-3]), (S, C))
    found = learnt(cuts, 2)
    assert found.z.mean(axis=0) == pytest.approx([0.0, 0.0], abs=0.06)
    assert found.z.std(axis=0) == pytest.approx([1.0, 1.0], abs=0.06)
    assert found.log_evidence == pytest.approx(2.0 * np.log(0.98), abs=0.01)


def test_before_the_first_label_it_is_the_prior():
    found = learnt(TestedCuts.none())
    assert found.error.shape == (1500, 0)
    assert found.z.std(axis=0) == pytest.approx([1.0, 1.0], abs=0.06)
    assert found.errors(MODEL.discrepancy, points([600.0, 900.0])).std(axis=0) == pytest.approx([0.2, 0.2], rel=0.08)


def test_the_order_of_labels_and_the_seed():
    speed, depth = np.array([600.0, 800.0, 800.0]), np.array([1.0, 1.5, 2.0]) * 1e-3
    one, two = (learnt(TestedCuts(speed, depth, (S, C, C)).at_places(np.array(order))) for order in ((0, 1, 2), (2, 0, 1)))
    assert np.allclose(one.z, two.z)
    assert np.allclose(one.error, two.error)


def test_elliptical_slices_leave_a_posterior_as_it_is():
    """A Gaussian likelihood: from anywhere to the closed form."""

    def log_likelihood(u):
        return -0.5 * np.sum((u - 2.0) ** 2, axis=1) / 0.25

    moved = elliptical_slices(np.random.default_rng(1).standard_normal((4000, 3)), log_likelihood, np.random.default_rng(2), 40)
    assert moved.mean(axis=0) == pytest.approx(1.6, abs=0.03)
    assert moved.std(axis=0) == pytest.approx(np.sqrt(0.2), rel=0.05)


def test_what_no_posterior_has():
    with pytest.raises(InputError, match="draws"):
        LabelPosterior(np.zeros((3, 2)), points([600.0]), np.zeros((3, 2)), 0.0, 3.0)
