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
        "robot": ("machine.robot", "mass_matrix"),
        "milling in time": ("toolpath._march", "march"),
    }
    marched = [("stability._depth_kernels", kernel) for kernel in ("boundaries", "lowest", "first_of_ladder")]
    if name in called:
        room, kernel = called[name]
        for module, entry in ((f"{room}_kernels" if "._" in room else f"{room}._kernels", kernel), *(marched if name == "lobes" else ())):
            assert getattr(getattr(importlib.import_module(f"rcsa_ident.{module}"), entry), "signatures", True)
