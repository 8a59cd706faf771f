"""Labels without physics beside closed forms and brute force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ndtr

from rcsa_ident.base.errors import InputError
from rcsa_ident.stability.labels import label_process
from rcsa_ident.stability.labels.label_process import CutFeatures, LabelProcess, among, variance
from rcsa_ident.stability.labels.tested_cuts import OwnConditions, TestedCuts, Verdict
from tests.stability.labels.test_tested_cuts import CUT

S, M, C = Verdict.STABLE, Verdict.MARGINAL, Verdict.CHATTER
MEDIANS = np.log(label_process._MEDIANS)


def cuts(count=40, seed=1):
    """Deep cuts milled up chatter, the others do not."""
    rng = np.random.default_rng(seed)
    depth, up = rng.uniform(0.5e-3, 4e-3, count), rng.random(count) < 0.5
    loud = np.log(depth / 1.5e-3) * 3.0 * up - 1.0 * ~up
    verdict = tuple(C if v > 0.45 else S if v < -0.45 else M for v in loud + 0.1 * rng.standard_normal(count))
    own = tuple(OwnConditions(strategy="up" if each else "down", session=f"day {k % 4}") for k, each in enumerate(up))
    return TestedCuts(rng.uniform(500.0, 900.0, count), depth, verdict, own=own)


def test_covariances_are_those_of_a_process():
    """Positive on 40 cuts, and the variances of new ones are those of a cut beside itself, its own share and its session's in it."""
    some = cuts()
    process = LabelProcess.learnt(some.at_places(np.arange(6)), CUT, np.random.default_rng(1))
    features = process.features_of(some, CUT)
    k = among(MEDIANS, features)
    assert np.linalg.eigvalsh(k).min() > 0.0
    told = features.session >= 0.0
    assert told.any()
    assert np.diag(k)[told] == pytest.approx(variance(MEDIANS, features)[told])


def test_the_approximation_beside_a_sum_over_a_grid():
    """Two cuts: evidence and probability of a third from three numbers on a grid."""
    three = cuts(3)
    own = tuple(replace(each, session="") for each in three.own)
    three = TestedCuts(three.spindle_speed, three.axial_depth, (S, C, M), own=own)
    two, counts = three.at_places(np.array([0, 1])), three.counts[:2]
    process = LabelProcess.learnt(two, CUT, np.random.default_rng(1))
    process = replace(process, drawn=MEDIANS[None])
    every = process.features_of(three, CUT)
    k = among(MEDIANS, every) + 1e-9 * np.eye(3)
    t = np.linspace(-6.0, 6.0, 81)
    u = np.stack(np.meshgrid(t, t, t, indexing="ij"), axis=-1) @ np.linalg.cholesky(k).T
    prior = np.exp(-0.5 * np.sum(np.stack(np.meshgrid(t, t, t, indexing="ij"), axis=-1) ** 2, axis=-1))
    keep = 1.0 - 3.0 * 0.02
    seen = (0.02 + keep * ndtr(-0.45 - u[..., 0])) * (0.02 + keep * ndtr(u[..., 1] - 0.45))
    evidence = np.log(np.sum(prior * seen) / np.sum(prior))
    value = label_process._laplace(among(MEDIANS, process.features), counts)[0]
    assert value == pytest.approx(evidence, abs=0.25)
    expected = 0.02 + 0.96 * np.sum(prior * seen * ndtr(-u[..., 2])) / np.sum(prior * seen)
    found, _ = process.told(process.features_of(three.at_places(np.array([2])), CUT))
    assert found[0] == pytest.approx(expected, abs=0.03)


def test_the_gradient_and_the_curvature_are_those_of_the_verdicts():
    f, step = np.linspace(-3.0, 3.0, 13), 1e-5
    counts = np.tile([2.0, 1.0, 1.0], (13, 1))
    at = [label_process._verdicts(f + s * step, counts) for s in (-1.0, 0.0, 1.0)]
    each = [[label_process._verdicts(f[k : k + 1] + s * step, counts[:1])[0] for k in range(13)] for s in (-1.0, 1.0)]
    assert at[1][1] == pytest.approx(np.subtract(each[1], each[0]) / (2.0 * step), abs=1e-6)
    slope = (at[2][1] - at[0][1]) / (2.0 * step)
    assert at[1][2] == pytest.approx(np.maximum(-slope, 1e-6), abs=1e-6)


def test_it_learns_what_depth_and_direction_do():
    process = LabelProcess.learnt(cuts(), CUT, np.random.default_rng(1))
    asked = cuts(60, seed=2)
    found, known = process.told(process.features_of(asked, CUT))
    clear = asked.counts[:, 1] == 0.0
    assert np.mean((found > 0.5) == asked.seen(S), where=clear) > 0.9
    assert np.all((known > 0.3) & (known <= 1.0))
    # a depth that nobody has tried is far away
    far = TestedCuts(np.array([700.0]), np.array([1.0]), (M,), own=(OwnConditions(strategy="up"),))
    assert process.told(process.features_of(far, CUT))[1][0] < 0.3


def test_a_feed_that_is_told_nowhere_is_no_matter():
    features = CutFeatures.of(cuts(5), CUT, np.full(4, np.nan), ())
    assert np.all(features.numbers[:, 3] == 0.0)


def test_what_no_process_has():
    process = LabelProcess.learnt(cuts(3), CUT, np.random.default_rng(1))
    for wrong in ({"drawn": np.zeros((2, 14))}, {"counts": -process.counts}, {"drawn": np.full((1, 15), 1e4)}):
        with pytest.raises(InputError, match="no count below 0"):
            replace(process, **wrong)
