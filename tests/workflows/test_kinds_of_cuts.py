"""Cuts of one kind, and what factors on their forces say of the law of the force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.cutting.force import force_lines
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.learned_changes import LearnedChanges, LearnedFactor
from rcsa_ident.io.settings.setups import read_campaign
from rcsa_ident.signals.measurement import Reading
from rcsa_ident.signals.verdict import Verdict
from rcsa_ident.workflows.kinds_of_cuts import kinds_of, with_law
from tests.fixtures.paths import SAMPLES

CAMPAIGN = read_campaign(SAMPLES)
READINGS = [Reading(cut.id, cut.tooling, 1000.0, Verdict(), (None,)) for cut in CAMPAIGN.cuts]  # type: ignore[arg-type]


def test_another_feed_is_another_kind():
    ids = [cut.id for cut in CAMPAIGN.cuts]
    assert set(kinds_of(CAMPAIGN, ids).tolist()) == {0}
    half = len(ids) // 2
    slow = [replace(cut, conditions=replace(cut.conditions, feed_per_tooth=3e-5)) for cut in CAMPAIGN.cuts[half:]]
    other = replace(CAMPAIGN, cuts=(*CAMPAIGN.cuts[:half], *slow))
    assert kinds_of(other, ids).tolist() == [0] * half + [1] * (len(ids) - half)
    # five of them are too few
    assert set(kinds_of(other, ids[: half + 5]).tolist()) == {0}


def test_edges_that_nobody_told_are_found_in_the_factors():
    told = CAMPAIGN.coefficients
    more = replace(told, tangential_edge=told.tangential_edge + 2e3, radial_edge=told.radial_edge + 1e3)
    orders = {}
    for tooling in CAMPAIGN.toolings.values():
        conditions = next(each.conditions for each in CAMPAIGN.cuts if each.tooling == tooling.name)
        own = np.arange(1, 9) * tooling.cutter.repeats
        other, known = (force_lines(tooling.cutter, conditions, each, own) for each in (more, told))
        for order, ratios in zip(own.tolist(), np.log(other / known).tolist(), strict=True):
            orders |= {(axis, 0, order): LearnedFactor(ratio, 2e-3) for axis, ratio in zip((Dof.X, Dof.Y), ratios, strict=True)}
    law = with_law(LearnedChanges(orders=orders), CAMPAIGN, READINGS).law
    assert law is not None
    assert law.tangential_edge[0] == pytest.approx(2e3, rel=0.1)
    assert law.radial_edge[0] == pytest.approx(1e3, rel=0.2)
    assert law.explained > 0.98


def test_without_factors_nothing_is_asked():
    assert with_law(LearnedChanges(), CAMPAIGN, READINGS).law is None
