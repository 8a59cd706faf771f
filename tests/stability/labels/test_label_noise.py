"""What a label tells, in its limits."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from rcsa_ident.base.errors import InputError
from rcsa_ident.stability.labels.label_noise import LabelNoise
from rcsa_ident.stability.labels.tested_cuts import OwnConditions, TestedCuts, Verdict

NOISE = LabelNoise(width=0.1, wrong=0.02)


def cuts(verdict, depth=1e-3, chatter=np.nan):
    return TestedCuts(np.array([800.0]), np.array([depth]), (Verdict(verdict),), np.array([chatter]))


def of(verdict, margin, noise=NOISE):
    """Log likelihood of one label whose limit lies that far (of the logarithm) above the cut."""
    return float(noise.log_likelihood(cuts(verdict), np.array([margin])))


def test_a_cut_far_inside_is_no_news():
    """Between limits that are two and five times the depth nothing is decided: the label has the same probability."""
    assert of("stable", np.log(5.0)) - of("stable", np.log(2.0)) == pytest.approx(0.0, abs=1e-9)
    assert of("chatter", np.log(0.2)) - of("chatter", np.log(0.5)) == pytest.approx(0.0, abs=1e-9)
    assert of("stable", np.log(2.0)) == pytest.approx(np.log(0.98))


def test_a_wrong_label_costs_its_rate_and_no_more():
    assert of("chatter", 3.0) == pytest.approx(np.log(0.02))
    assert of("stable", -30.0) == pytest.approx(np.log(0.02))


@pytest.mark.parametrize("margin", [-0.2, -0.03, 0.0, 0.1, 0.5])
def test_beside_the_boundary_it_is_a_normal_distribution(margin):
    assert np.exp(of("stable", margin)) == pytest.approx(0.02 + 0.96 * norm.cdf(margin / 0.1))
    assert np.exp(of("stable", margin)) + np.exp(of("chatter", margin)) == pytest.approx(1.0)


def test_a_marginal_cut_holds_the_limit_beside_it():
    assert of("marginal", 0.0) > of("marginal", 0.15) > of("marginal", 0.4)
    assert of("marginal", 0.15) == pytest.approx(of("marginal", -0.15))
    assert of("marginal", 5.0) == pytest.approx(np.log(0.02))


def test_all_labels_multiply():
    many = TestedCuts(np.full(3, 800.0), np.array([1e-3, 2e-3, 3e-3]), (Verdict.STABLE, Verdict.CHATTER, Verdict.MARGINAL))
    margins = np.log(np.array([[1.5e-3] * 3, [2.5e-3] * 3]) / many.axial_depth)
    for row, found in zip(margins, NOISE.log_likelihood(many, margins), strict=True):
        single = [of(str(v), row[k]) for k, v in enumerate(many.verdict)]
        assert found == pytest.approx(sum(single))


def test_verdicts_of_several_on_one_cut_are_several_readings():
    own = (OwnConditions(further=(Verdict.CHATTER,)),)
    two = TestedCuts(np.array([800.0]), np.array([1e-3]), (Verdict.STABLE,), own=own)
    assert NOISE.log_likelihood(two, np.array([0.1])) == pytest.approx(of("stable", 0.1) + of("chatter", 0.1))


def test_a_measured_chatter_frequency():
    heard = cuts("chatter", chatter=4000.0)
    near, off, none = NOISE.heard(heard, np.array([[4000.0], [4800.0], [np.nan]]))
    assert near == pytest.approx(0.0)
    # one that nobody expects may be another line of the spectrum
    assert off == none == pytest.approx(np.log(0.02))
    assert NOISE.heard(heard, np.array([4000.0 * 1.02])) == pytest.approx(np.log(0.02 + 0.98 * np.exp(-0.5)), abs=0.02)
    assert NOISE.heard(cuts("chatter"), np.array([4000.0])) == 0.0


@pytest.mark.parametrize("given", [{"width": 0.0}, {"wrong": 0.0}, {"wrong": 0.5}, {"marginal": -1.0}, {"frequency": np.nan}])
def test_what_no_noise_has(given):
    with pytest.raises(InputError, match=next(iter(given))):
        LabelNoise(**given)
