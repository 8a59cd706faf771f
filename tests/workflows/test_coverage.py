"""What a campaign says it leaves open: one axis, one feed direction; nothing where cuts were fed along both."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.setup.cut import Cut
from rcsa_ident.signals.measurement import CutMeasurement, Reading
from rcsa_ident.signals.verdict import Verdict
from rcsa_ident.workflows.coverage import NOTHING_JUDGES, left_open
from tests.fixtures import by_hand

SPEEDS = np.linspace(850.0, 2000.0, 20)


def made(folder, feeds=(0.0,), axes=(Dof.X, Dof.Y), usable=True, strategies=("down",), judged=True):
    campaign, cuts, readings = by_hand.campaign(folder), [], []
    for k, speed in enumerate(SPEEDS.tolist()):
        engagement = Engagement.from_immersion(0.5, strategies[k % len(strategies)])
        conditions = CuttingConditions(speed, 4e-4, 1e-4, engagement, feeds[k % len(feeds)])
        cuts.append(Cut(f"{k}", "T1", conditions, folder / "none.h5", validation=judged and k == 0))
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
