"""What the front door promises: its names, and that asking for the package costs nothing."""

from __future__ import annotations

import ast
import inspect
import subprocess
import sys

import pytest

import rcsa_ident as ri
from tests.fixtures.paths import ROOT

#: Promised: a name that is taken away here is taken away from every script.
NAMES = [
    "MATERIALS", "BeamSegment", "Contact", "Coordinate", "CutSpec", "Cutter", "CuttingCoefficients", "Dof", "Engagement",
    "FlexibleRobot", "FullDiscretisation", "InputError", "KnownTip", "MillingProcess", "MultiFrequency", "PosedRobot",
    "ProcessDamping", "Quantity",
    "Receptance", "SemiDiscretisation", "Sensor", "SpeedVariation", "SpindleDrive", "TimeDomain", "TipModes", "Tooling",
    "ZeroOrder", "advise", "clamped", "connect", "estimate_forces", "hz", "identify", "listen", "material", "normal_modes", "plot_lobes",
    "read_campaign", "read_forces", "read_lobes", "read_machine", "read_modes", "read_recording", "read_result", "read_robot",
    "read_robot_result",
    "read_tap_tests",
    "read_tip", "read_tooling", "ring", "rpm", "sample_campaign", "sample_robot", "sample_tooling", "stability_lobes", "stability_map",
    "surface_location_error", "tap",
]  # fmt: skip


def run(code: str, folder=None) -> str:
    done = subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=True)
    return done.stdout.strip()


def test_the_names_are_those_that_are_promised():
    assert sorted(ri.__all__) == sorted(NAMES)
    assert set(dir(ri)) == {*NAMES, "__version__"}


def test_editors_and_python_find_the_same():
    """The block for type checkers names what the table of rooms finds."""
    tree = ast.parse((ROOT / "rcsa_ident" / "__init__.py").read_text())
    block = next(node for node in tree.body if isinstance(node, ast.If))
    seen = {alias.name: node.module for node in block.body if isinstance(node, ast.ImportFrom) for alias in node.names}
    assert seen == ri._HOME
    assert set(seen) == set(ri.__all__)


def test_each_name_is_there_and_documented():
    found = {name: getattr(ri, name) for name in NAMES if name != "MATERIALS"}
    assert {name for name, each in found.items() if not inspect.getdoc(each) or each.__name__ != name} == set()


def test_a_name_that_is_not_there():
    with pytest.raises(AttributeError, match="no attribute 'hammer'"):
        ri.hammer  # noqa: B018


def test_asking_is_light():
    """Neither the package nor a campaign's reader needs compiled kernels, figures or the service; most of a second is left."""
    heavy = "[m for m in ('numba', 'matplotlib', 'pymoo', 'scipy', 'api', 'typer') if m in sys.modules]"
    code = f"import sys, time, rcsa_ident as ri; light = time.process_time(); ri.read_campaign; print(light, {heavy})"
    seconds, modules = run(code).split(" ", 1)
    assert modules == "[]"
    assert float(seconds) < 0.5


@pytest.mark.slow
def test_everything_at_once():
    assert run("from rcsa_ident import *; print(rpm(60.0) == 6.283185307179586, ZeroOrder().name)") == "True zero-order"
