"""Each step of the warming is a small job that must run."""

from __future__ import annotations

import importlib

import pytest

from rcsa_ident.workflows.compile_kernels import STEPS


@pytest.mark.slow
@pytest.mark.parametrize("name", STEPS)
def test_a_step_runs(name):
    STEPS[name]()
    # the entry points that the commands call are compiled afterwards, where numba compiles at all
    called = {
        "tool-holder": ("dynamics", "pole_sum"),
        "recordings": ("signals", "order_sums"),
        "listening": ("signals", "sideband_scores"),
        "lobes": ("stability", "envelopes"),
    }
    if name in called:
        room, kernel = called[name]
        function = getattr(importlib.import_module(f"rcsa_ident.{room}._kernels"), kernel)
        assert getattr(function, "signatures", True)
