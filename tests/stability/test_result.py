"""Limits over speed and those of drawn machines: what they have in common, what is recommended, parts of them and blocks as one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.stability.pockets import least_within_tolerance
from rcsa_ident.stability.result import PROBABILITY, RESERVE, TOLERANCE, StabilityLobes
from tests.stability.written import lobes


def pockets(found):
    return [(pocket.spindle_speed, pocket.limit_depth) for pocket in found]


def test_best_speeds_are_one_a_pocket():
    # 3.0 and 2.9 share a pocket: the limit between them hardly falls
    here = lobes([1.0, 3.0, 2.8, 2.9, 1.0, 2.0, 1.0, 1.5], deepest=10.0)
    assert pockets(here.best_speeds()) == [(600.0, 3.0), (1000.0, 2.0), (1200.0, 1.5)]
    assert pockets(here.best_speeds(count=1)) == [(600.0, 3.0)]


def test_the_middle_of_a_stable_range_comes_first_the_widest_before_others():
    found = lobes([1.0, np.inf, 1.0, np.inf, np.inf, np.inf, 1.0, 3.0, 2.0], deepest=10.0).best_speeds()
    assert pockets(found) == [(900.0, np.inf), (600.0, np.inf), (1200.0, 3.0)]
    # how deep the search went says nothing of how deep one may cut
    assert [pocket.recommended_depth for pocket in found[:2]] == [np.inf, pytest.approx((1.0 - RESERVE) * (10.0 - 9.0 * 0.06))]
    assert "10.0" not in str(found[0])
    assert "no depth recommended" in str(found[0])


@pytest.mark.parametrize(("deepest", "recommended"), [(3.0, [np.inf, 1.8, np.inf]), (10.0, [5.4, 1.8, 6.3])])
def test_the_largest_depth_recommends_nothing(deepest, recommended):
    here = lobes([6.0, 2.0, 7.0], [500.0, 1000.0, 1500.0], deepest=10.0)
    found = replace(here, limit_depth=np.where(here.limit_depth > deepest, np.inf, here.limit_depth), max_depth=deepest)
    np.testing.assert_allclose(found.recommended_depth(0.0), recommended)


def test_order_of_the_speeds_does_not_matter():
    one = lobes([1.0, 3.0, 1.0, 2.0, 1.0], deepest=10.0)
    back = one.at_places(np.arange(5)[::-1])
    assert back.spindle_speed[0] == 900.0
    assert one.best_speeds() == back.best_speeds()
    np.testing.assert_array_equal(back.ordered().limit_depth, one.limit_depth)


def test_a_pocket_carries_what_is_recommended_at_its_speed():
    drawn = np.array([[0.8, 2.7, 0.9], [1.2, 3.5, 1.1]])
    here = lobes([1.0, 3.0, 1.0], [500.0, 1000.0, 1500.0], drawn, deepest=10.0)
    (best,) = here.best_speeds(1)
    # the deeper draw counts at 95 % of two draws no more than the shallower; 10 rad/s beside it is a fiftieth of the way down
    assert best.recommended_depth == pytest.approx((1.0 - RESERVE) * (2.7 - (2.7 - 0.8) / 50.0))
    assert best.recommended_depth == here.recommended_depth()[1]


def test_what_is_held_back_of_a_limit():
    here = lobes([4e-3, 2e-3, 6e-3], [100.0, 110.0, 120.0])
    np.testing.assert_allclose(here.recommended_depth(0.05, 0.9, 0.2), 0.8 * np.array([3.0, 2.0, 3.6]) * 1e-3)
    expected = (1.0 - RESERVE) * least_within_tolerance(here.spindle_speed, here.limit_quantile(PROBABILITY), TOLERANCE)
    np.testing.assert_array_equal(here.recommended_depth(), expected)
    np.testing.assert_array_equal(here.recommended_depth(0.0, 1.0, 0.0), here.limit_depth)
    for reserve in (-0.1, 1.0):
        with pytest.raises(InputError, match="reserve"):
            here.recommended_depth(reserve=reserve)
    with pytest.raises(InputError, match="speeds that rise"):
        here.at_places(np.array([2, 0, 1])).recommended_depth()


def test_what_all_machines_have_in_common():
    drawn = np.array([[1.0, 9.0], [2.0, 8.0], [3.0, 7.0], [4.0, np.inf]]) * 1e-3
    here = lobes([2.5e-3, 8e-3], drawn=drawn)
    np.testing.assert_allclose(here.limit_quantile(1.0), [1e-3, 7e-3])
    np.testing.assert_allclose(here.limit_quantile(0.75), [2e-3, 8e-3])
    np.testing.assert_allclose(here.limit_quantile(0.25), [4e-3, 10e-3])
    assert here.probability(0, 2e-3) == 0.75
    assert lobes([1e-3, 2e-3]).probability(0, 2e-3) is None
    np.testing.assert_allclose(lobes([1e-3, np.inf]).limit_quantile(0.9), [1e-3, 10e-3])
    with pytest.raises(InputError, match="probability"):
        lobes([1e-3, 2e-3]).limit_quantile(0.0)


@settings(max_examples=40, deadline=None)
@given(st.floats(0.01, 1.0), st.integers(1, 40))
def test_trusted_depths_keep_their_promise(probability, draws):
    drawn = np.random.default_rng(draws).uniform(1e-3, 9e-3, (draws, 3))
    trusted = lobes([5e-3] * 3, drawn=drawn).limit_quantile(probability)
    share = np.mean(drawn >= trusted, axis=0)
    assert np.all(share >= probability - 1e-9)
    # a deeper cut that every draw tells apart would break it
    assert np.all(np.mean(drawn > trusted, axis=0) < probability + 1e-9)


@pytest.mark.parametrize("depth", [0.0, 11e-3, np.nan])
def test_beyond_what_was_looked_at_nothing_is_probable(depth):
    """A draw that is stable up to the largest depth is not known to be stable beyond it."""
    drawn = np.array([[2e-3, np.inf], [3e-3, np.inf]])
    with pytest.raises(InputError, match="depth"):
        lobes([2e-3, np.inf], drawn=drawn).probability(1, depth)
    assert lobes([2e-3, np.inf], drawn=drawn).probability(1, 10e-3) == 1.0


def test_the_band_holds_all_but_a_fortieth_at_each_end():
    drawn = np.sort(np.random.default_rng(1).uniform(1e-3, 12e-3, (41, 2)), axis=0)
    low, high = lobes([5e-3, 6e-3], drawn=drawn).band
    np.testing.assert_array_equal(low, drawn[1])
    # beyond the largest depth no limit is known
    assert np.all(drawn[39] > 10e-3)
    np.testing.assert_array_equal(high, np.inf)
    assert lobes([5e-3, 6e-3]).band is None


def whole():
    rng = np.random.default_rng(3)
    depth = rng.uniform(1e-3, 9e-3, 12)
    depth[4:6] = np.inf
    return replace(
        lobes(depth, drawn=rng.uniform(1e-3, 9e-3, (5, 12)), chatter=rng.uniform(4e3, 6e3, 12)),
        flip=rng.random(12) > 0.5,
        lobe=np.where(np.isinf(depth), -1, rng.integers(0, 9, 12)),
        warnings=("first", "second"),
    )


def same(one: StabilityLobes, other: StabilityLobes):
    for name in ("spindle_speed", "limit_depth", "chatter_frequency", "lobe", "flip", "drawn"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    for name in ("max_depth", "method", "absolute_limit", "absolute_frequency", "warnings"):
        assert getattr(one, name) == getattr(other, name)


@settings(max_examples=30, deadline=None)
@given(st.permutations(range(12)), st.lists(st.integers(1, 11), max_size=4, unique=True))
def test_blocks_are_joined_with_each_speed_back_in_its_place(order, cuts):
    places = np.split(np.array(order), sorted(cuts))
    same(StabilityLobes.joined([whole().at_places(block) for block in places], places), whole())


def test_joined_blocks_have_the_lowest_absolute_limit_and_all_warnings_once():
    places = [np.array([0, 1]), np.array([2])]
    one = replace(lobes([2e-3, 3e-3]), absolute_limit=1.5e-3, absolute_frequency=4e3, warnings=("a", "b"))
    other = replace(lobes([1e-3], [700.0]), absolute_limit=0.9e-3, absolute_frequency=6e3, warnings=("b", "c"))
    found = StabilityLobes.joined([one, other], places)
    assert (found.absolute_limit, found.absolute_frequency, found.warnings) == (0.9e-3, 6e3, ("a", "b", "c"))
    none = {"absolute_limit": None, "absolute_frequency": None}
    assert StabilityLobes.joined([replace(one, **none), replace(other, **none)], places).absolute_limit is None
    # a band of some of the speeds is none
    drawn = replace(one, drawn=np.ones((3, 2)))
    assert StabilityLobes.joined([drawn, other], places).drawn is None


def test_a_range_keeps_its_ends_in_spite_of_their_last_digits():
    here = whole()
    part = here.between(700.0 * (1.0 + 1e-12), 1100.0 * (1.0 - 1e-12))
    np.testing.assert_array_equal(part.spindle_speed, [700.0, 800.0, 900.0, 1000.0, 1100.0])
    same(part, here.at_places(np.arange(2, 7)))
    assert here.between(1.0, 2.0).spindle_speed.size == 0


def test_stable_is_up_to_the_depth_that_was_asked_for():
    here = lobes([1e-3, np.inf, 12e-3])
    assert here.stable.tolist() == [False, True, False]
    np.testing.assert_array_equal(here.nominal, [1e-3, 10e-3, 10e-3])
    assert not np.any(here.flip)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"limit_depth": np.ones(3)}, "limit_depth"),
        ({"chatter_frequency": np.ones(3)}, "chatter_frequency"),
        ({"lobe": np.ones(3, dtype=int)}, "lobe"),
        ({"flip": np.ones(3, dtype=bool)}, "flip"),
        ({"drawn": np.ones((3, 4))}, "drawn"),
        ({"drawn": np.ones((0, 2))}, "drawn"),
        ({"drawn": np.ones(2)}, "drawn"),
    ],
)
def test_arrays_have_the_speeds_shape(change, field):
    with pytest.raises(InputError) as error:
        replace(lobes([1e-3, 2e-3]), **change)
    assert error.value.field == field
