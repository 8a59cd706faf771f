"""Toolings that are left out are predicted as well as promised, and not where one of them was told wrongly."""

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.validation import Prediction, judged, predictions, validated, widening
from tests.identification.test_causes import asked, made, steady


def test_the_models_own_lines_are_predicted_as_promised(few):
    found, misfit, _ = asked(made(few, steady))
    told = predictions(found, misfit)
    assert {(each.tooling, each.axis) for each in told} == {(name, axis) for name in few.toolings for axis in (Dof.X, Dof.Y)}
    assert all(each.holds for each in told)
    assert validated(told)
    assert widening(told) == 1.0
    # noise alone is the least that can be promised
    assert all(each.promised > 1.5e-3 for each in told)


def test_one_tooling_is_compared_with_nothing(few):
    alone = few.of_cuts(np.flatnonzero(few.cut_tooling == 0))
    found, misfit, _ = asked(made(alone, steady))
    assert predictions(found, misfit) == ()
    assert not validated(())


def test_cuts_that_judge_take_no_part(few):
    data = made(few, steady)
    aside = (few.cut_tooling == 1) & (np.arange(len(few.cut_ids)) % 2 == 1)
    whole = replace(data, made=replace(data.made, judged=aside))
    learned = whole.learned_from()
    assert len(learned.cut_ids) == np.sum(~aside)
    found, misfit, _ = asked(learned)
    told = judged(found, misfit, whole)
    assert {(each.tooling, each.axis) for each in told} == {(few.toolings[1], axis) for axis in (Dof.X, Dof.Y)}
    assert all(each.holds for each in told)
    wrong = [np.where(aside[axis.cut][:, None, None], 1.1, 1.0) * axis.lines for axis in whole.axes]
    off = replace(whole, axes=tuple(replace(axis, lines=lines) for axis, lines in zip(whole.axes, wrong, strict=True)))
    for each in judged(found, misfit, off):
        assert each.error == pytest.approx(0.1, rel=0.3)
        assert not each.holds
    assert judged(found, misfit, learned) == ()


@pytest.mark.parametrize(("error", "factor"), [(0.019, 1.0), (0.05, 5.0)])
def test_bands_are_widened_to_what_was_seen(error, factor):
    seen = (Prediction("A", Dof.X, error, 0.01, 0.02), Prediction("B", Dof.X, 0.005, 0.01, 0.02))
    assert widening(seen) == pytest.approx(factor)


def test_every_axis_needs_a_promise_that_says_something():
    seen = Prediction("A", Dof.X, 0.01, 0.01, 0.02)
    assert validated((seen,))
    assert not validated((seen, replace(seen, axis=Dof.Y, typical=0.6)))
