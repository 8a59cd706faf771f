"""The registry of stability methods: names, facts, and an import that costs nothing."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import is_dataclass

import numpy as np
import pytest

from rcsa_ident.errors import InputError
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.methods import METHODS, MethodName, method_named
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
    assert min(METHODS, key=lambda name: METHODS[name].seconds_per_speed) == "zero-order"


def test_an_unknown_name_is_refused_with_those_that_are_known():
    with pytest.raises(InputError) as error:
        method_named("zeroth-order", "--method")
    assert error.value.field == "--method"
    assert "zero-order, multi-frequency" in error.value.allowed
    assert "zeroth-order" not in METHODS


def test_the_names_cost_no_import():
    code = "import sys, rcsa_ident.stability.methods; print([m for m in ('numpy', 'numba', 'scipy') if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip() == "[]"
