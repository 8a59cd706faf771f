"""What a campaign says it leaves open: one axis, one feed direction, times, repeats, feeds; nothing where cuts were made as planned."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime, timedelta

import numpy as np
import pytest

from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.setup.cut import Cut
from rcsa_ident.signals.measurement import CutMeasurement, Reading
from rcsa_ident.signals.verdict import Verdict
from rcsa_ident.workflows.coverage import IN_ORDER, NO_REPEAT, NO_THERMOMETER, NO_TIMES, NOTHING_JUDGES, ONE_FEED, left_open
from tests.fixtures import by_hand

#: In random order, the first one once more at the end.
SPEEDS = np.random.default_rng(5).permutation(np.linspace(850.0, 2000.0, 20))[[*range(20), 0]]
BEGAN = datetime(2026, 1, 5, 8)


def made(
    folder, feeds=(0.0,), axes=(Dof.X, Dof.Y), usable=True, strategies=("down",), judged=True, speeds=SPEEDS, chips=(1e-4, 5e-5), **told
):
    campaign, cuts, readings = by_hand.campaign(folder), [], []
    for k, speed in enumerate(speeds.tolist()):
        engagement = Engagement.from_immersion(0.5, strategies[k % len(strategies)])
        conditions = CuttingConditions(speed, 4e-4, chips[k % len(chips)], engagement, feeds[k % len(feeds)])
        moment = {"started": BEGAN + timedelta(seconds=90.0 * k), "temperature": 22.0 + 0.1 * k} | told
        cuts.append(Cut(f"{k}", "T1", conditions, folder / "none.h5", validation=judged and k == 1, **moment))
        measurement = CutMeasurement(f"{k}", "T1", speed, dict.fromkeys(axes), 0.0)
        readings.append(Reading(f"{k}", "T1", speed, Verdict(()), (measurement,) if usable else ()))
    return replace(campaign, cuts=tuple(cuts)), readings


@pytest.mark.parametrize("strategies", [("down",), ("up",), ("down", "up")])
def test_one_feed_direction_is_told_whatever_the_strategy(tmp_path, strategies):
    (found,) = left_open(*made(tmp_path, strategies=strategies))
    assert "cuts fed along Y beside those along X would about halve the uncertainty" in found


def test_feeds_along_both_axes_leave_nothing_open(tmp_path):
    assert left_open(*made(tmp_path, feeds=(0.0, 0.5 * np.pi))) == ()


@pytest.mark.parametrize(("axis", "other"), [(Dof.X, "Y"), (Dof.Y, "X")])
def test_one_axis_cannot_know_the_other(tmp_path, axis, other):
    (found,) = left_open(*made(tmp_path, axes=(axis,)))
    assert found.startswith(f"only {axis.upper()} was recorded: whether X and Y feel each other cannot be told")
    assert f"nothing is known of the tool's motion in {other}" in found


def test_a_cut_that_judges_is_asked_for(tmp_path):
    (found,) = left_open(*made(tmp_path, feeds=(0.0, 0.5 * np.pi), judged=False))
    assert found == NOTHING_JUDGES


def test_without_usable_cuts_nothing_is_said(tmp_path):
    assert left_open(*made(tmp_path, usable=False)) == ()


@pytest.mark.parametrize(
    ("lacking", "sentence"),
    [
        ({"started": None}, NO_TIMES),
        ({"temperature": None}, NO_THERMOMETER),
        ({"speeds": np.r_[np.sort(SPEEDS[:20]), 850.0]}, IN_ORDER),
        ({"speeds": np.r_[np.sort(SPEEDS[:20])[::-1], 2000.0]}, IN_ORDER),
        ({"speeds": SPEEDS[:20]}, NO_REPEAT),
        ({"chips": (1e-4,)}, ONE_FEED),
    ],
)
def test_what_a_campaign_lacks_is_said_by_itself(tmp_path, lacking, sentence):
    assert left_open(*made(tmp_path, feeds=(0.0, 0.5 * np.pi), **lacking)) == (sentence,)


def test_the_order_is_that_of_the_times(tmp_path):
    """The campaign lists its cuts by their speeds, which came at random."""
    campaign, readings = made(tmp_path, feeds=(0.0, 0.5 * np.pi))
    listed = sorted(campaign.cuts, key=lambda cut: cut.conditions.spindle_speed)
    assert left_open(replace(campaign, cuts=tuple(listed)), readings) == ()
    blind = replace(campaign, cuts=tuple(replace(cut, started=None) for cut in listed))
    assert left_open(blind, readings) == (NO_TIMES, IN_ORDER)
