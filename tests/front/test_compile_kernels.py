"""Each step of the warming is a small job that must run."""

from __future__ import annotations

import importlib
import json
import subprocess
import sys
from itertools import combinations

import pytest

from rcsa_ident.front.compile_kernels import FIRST, STEPS, TOGETHER

#: Prints the kernels that steps call, by file, with what they were compiled for.
CALLED = """
import json, sys
from rcsa_ident.front.compile_kernels import compile_steps
compile_steps(sys.argv[1:])
kernels = {}
for name, module in list(sys.modules.items()):
    if name.startswith("rcsa_ident.") and "._kernels" in name:
        for each, kernel in vars(module).items():
            if getattr(kernel, "signatures", None):
                kernels[f"{name}:{each}"] = sorted(map(str, kernel.signatures))
print(json.dumps(kernels))
"""


@pytest.mark.slow
@pytest.mark.parametrize("name", STEPS)
def test_a_step_runs(name):
    STEPS[name]()
    # the entry points that the commands call are compiled afterwards, where numba compiles at all
    called = {
        "tool-holder": {"dynamics._kernels": ["pole_sum"]},
        "recordings": {"signals._kernels": ["order_sums"]},
        "listening": {"signals._kernels": ["sideband_scores"]},
        "lobes": {
            "stability._kernels.depth_at_speed": ["envelopes"],
            "stability._kernels.depth": ["boundaries", "lowest", "first_of_ladder"],
        },
        "robot": {"machine.robot._kernels": ["mass_matrix"]},
        "milling in time": {"toolpath._kernels.march": ["march"]},
    }
    for module, entries in called.get(name, {}).items():
        for entry in entries:
            assert getattr(getattr(importlib.import_module(f"rcsa_ident.{module}"), entry), "signatures", True)


def called(names):
    done = subprocess.run([sys.executable, "-c", CALLED, *names], capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def test_every_step_is_done_once():
    assert sorted(name for names in (FIRST, *TOGETHER) for name in names) == sorted(STEPS)


@pytest.mark.slow
def test_what_is_done_at_once_compiles_no_file_of_kernels_twice():
    """Two processes that compile one kernel for different types may spoil its cache; those of `FIRST` are compiled when the rest begins."""
    first, rest = called(FIRST), [called(names) for names in TOGETHER]
    assert first
    ready = {kernel.partition(":")[0] for kernel in first}
    for kernels in rest:
        late = {
            kernel: signatures
            for kernel, signatures in kernels.items()
            if kernel.partition(":")[0] in ready and not set(signatures) <= set(first.get(kernel, ()))
        }
        assert not late
    files = [{kernel.partition(":")[0] for kernel in kernels} - ready for kernels in rest]
    assert all(files)
    assert not [one & two for one, two in combinations(files, 2) if one & two]
