"""The registry of stability methods: names, facts, and an import that costs nothing."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import is_dataclass, replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.stability.lobes import METHODS, method_named, stability_lobes
from rcsa_ident.stability.methods import MethodName, Watched, coarse_to_fine
from rcsa_ident.stability.time_domain import TimeDomain
from tests.stability.mills import ONE, RPM, mill, tip


def test_every_method_is_found_by_its_name_and_answers_with_it():
    assert list(METHODS) == [name.value for name in MethodName]
    for name, kind in METHODS.items():
        method = TimeDomain(periods=20) if name == "time-domain" else method_named(name)
        assert is_dataclass(kind)
        assert isinstance(method, kind)
        assert kind.name == name
        found = stability_lobes(tip(ONE), mill(), np.array([12_000.0]) * RPM, 1e-5, method)
        assert found.method == name
        # texts, not members of an enumeration: answers are written to files
        assert type(found.method) is str


def test_what_is_said_of_a_method():
    assert {name for name, kind in METHODS.items() if kind.needs == "receptance"} == {"zero-order", "multi-frequency"}
    assert {name for name, kind in METHODS.items() if kind.gives_maps} == {"semi-discretisation", "full-discretisation"}
    assert all(hasattr(kind, "monodromy") == kind.gives_maps for kind in METHODS.values())
    speeds = np.array([4000.0]) * RPM
    seconds = {name: kind.seconds_per_operation * kind().operations(mill(), speeds, 4e4, 0.01)[0] for name, kind in METHODS.items()}
    assert sorted(seconds, key=lambda name: seconds[name])[0] == "zero-order"
    assert max(seconds, key=lambda name: seconds[name]) == "time-domain"


def test_an_unknown_name_is_refused_with_those_that_are_known():
    with pytest.raises(InputError) as error:
        method_named("zeroth-order", "--method")
    assert error.value.field == "--method"
    assert "zero-order, multi-frequency" in error.value.allowed
    assert "zeroth-order" not in METHODS


def test_the_names_cost_no_import():
    code = "import sys, rcsa_ident.stability.methods; print([m for m in ('numpy', 'numba', 'scipy') if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip() == "[]"


@pytest.mark.parametrize("count", [0, 1, 2, 3, 7, 64, 161])
def test_from_coarse_to_fine_every_place_comes_once(count):
    order = coarse_to_fine(count)
    assert sorted(order) == list(range(count))
    # after so many the widest gap is that of equal steps, or twice as wide
    for known in (n for n in (5, 9, 17, 33) if n < count):
        assert np.max(np.diff(np.sort(order[:known]))) <= 2 * -(-count // (known - 2))


SPEEDS = np.linspace(9000.0, 15_000.0, 6) * RPM


@pytest.mark.parametrize("name", [name for name in METHODS if name != "zero-order"])
def test_limits_are_told_as_they_come_and_are_the_same(name):
    """Told once each, from coarse to fine; those of the whole answer, and those of each speed by itself, to the last bit."""
    method = TimeDomain(periods=20) if name == "time-domain" else method_named(name)
    told = []
    watched = replace(method, watch=lambda *row: told.append(row))
    assert isinstance(watched, Watched)
    found, plain = (stability_lobes(tip(ONE), mill(), SPEEDS, 1e-3, each) for each in (watched, method))
    assert [row[0] for row in told] == [SPEEDS[k] for k in coarse_to_fine(SPEEDS.size)]
    order = np.argsort([row[0] for row in told])
    np.testing.assert_array_equal(np.array(told)[order, 1:], np.stack([found.limit_depth, found.chatter_frequency], axis=1))
    # some speeds are stable up to that depth
    assert 0 < np.sum(found.stable) < SPEEDS.size
    assert found.warnings == plain.warnings
    for name in ("limit_depth", "chatter_frequency", "lobe", "flip"):
        np.testing.assert_array_equal(getattr(found, name), getattr(plain, name))
    for k, speed in enumerate(SPEEDS):
        alone = stability_lobes(tip(ONE), mill(), np.array([speed]), 1e-3, method)
        np.testing.assert_array_equal(alone.limit_depth, found.limit_depth[k : k + 1])


def test_zero_order_asks_all_speeds_at_once():
    assert not isinstance(method_named("zero-order"), Watched)
