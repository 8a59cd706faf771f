"""decouple: hammer tests of three toolings on the virtual machine in, the spindle's flange out; it serves a fourth tooling."""

from __future__ import annotations

import json
from dataclasses import asdict
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.dynamics.coordinates import Dof, plane
from rcsa_ident.dynamics.modal import normal_modes
from rcsa_ident.io.curves.flanges import read_flange_csv, read_flange_machine
from rcsa_ident.io.curves.tips import write_frf_csv
from rcsa_ident.io.results.parts import spindle_to_json, write_result
from rcsa_ident.io.settings.machines import read_machine
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.tool_holder.model import tool_holder_receptance
from rcsa_ident.virtual.rotor import frequency_response, rotor
from rcsa_ident.workflows.compare import Place
from rcsa_ident.workflows.decouple import FlangeTap, flange_from_taps
from tests.cli.measurements import run
from tests.fixtures import by_hand

MACHINES = Path(__file__).resolve().parents[2] / "data" / "machines"
FREQUENCY = np.arange(400.0, 3000.0, 10.0)
OMEGA = 2.0 * np.pi * FREQUENCY
ARTEFACT = """\
name = "A{length}"
[cutter]
teeth = 2
diameter_mm = 40.0
[tool]
stickout_mm = {length}
segments = [ {{ length_mm = {length}, outer_diameter_mm = 40.0, material = "steel" }} ]
[holder]
insertion_mm = 0.0
segments = [
  {{ length_mm = 30.0, outer_diameter_mm = 50.0, material = "steel" }},
  {{ length_mm = 26.0, outer_diameter_mm = 63.0, inner_diameter_mm = 20.0, material = "steel" }},
]
"""
LENGTHS = (20.0, 60.0, 100.0)


@cache
def spindle():
    return read_machine(MACHINES / "stiff.toml").spindle


@pytest.fixture(scope="module")
def taps(tmp_path_factory):
    """Tip, spindle and across with each artefact, both axes, 1 % noise; no speed, as a hammer finds it."""
    folder = tmp_path_factory.mktemp("decouple")
    rng = np.random.default_rng(1)
    ports = ("tip.x", "flange.x", "tip.y", "flange.y")
    for length in LENGTHS:
        (folder / f"A{length:g}.toml").write_text(ARTEFACT.format(length=length))
        whole = frequency_response(
            rotor(spindle(), read_tooling(folder / f"A{length:g}.toml").assembly), OMEGA, 0.0, inputs=ports, outputs=ports
        )
        for place, i, j in (("tip", 0, 0), ("cross", 1, 0), ("spindle", 1, 1)):
            h = {axis: whole[:, k + i, k + j] for axis, k in (("X", 0), ("Y", 2))}
            noisy = {a: v + 0.01 * np.abs(v) * (rng.normal(size=v.size) + 1j * rng.normal(size=v.size)) for a, v in h.items()}
            write_frf_csv(folder / f"{place}{length:g}.csv", FREQUENCY, noisy)
    return folder


def options(folder, places=("tip", "cross", "spindle")):
    texts = []
    for length in LENGTHS:
        for place in places:
            label = f"{folder / f'A{length:g}.toml'}"
            texts += ["--tap", f"{label if place == 'tip' else f'{place}:{label}'}={folder / f'{place}{length:g}.csv'}"]
    return texts


@pytest.mark.slow
def test_the_flange_carries_another_tooling(taps):
    """The joint stays in the flange; with it the tip of a tooling that was never measured comes within a few percent of the machine's."""
    out, plot = taps / "FLANGE.csv", taps / "flange.png"
    text = run("decouple", *options(taps), "--out", out, "--plot", plot).output
    assert "condition number" in text
    assert plot.read_bytes().startswith(b"\x89PNG")
    flanges = read_flange_csv(out)
    assert set(flanges) == {Dof.X, Dof.Y}
    assembly = read_tooling(MACHINES / "toolings" / "S1-ER32.toml").assembly
    holder = tool_holder_receptance(assembly, OMEGA)
    tip = couple(holder, flanges[Dof.X].receptance(OMEGA), LumpedJoint(1e18, 1e18))["tip", "tip"][:, 0, 0]
    true = frequency_response(rotor(spindle(), assembly), OMEGA, 0.0, inputs=("tip.x",), outputs=("tip.x",))[:, 0, 0]
    assert np.linalg.norm(tip - true) < 0.05 * np.linalg.norm(true)
    answer = json.loads(run("decouple", *options(taps), "--out", out, "--json").output)
    assert answer["axes"]["X"]["condition_median"] < 20.0
    assert answer["axes"]["Y"]["frequencies"] == FREQUENCY.size


@pytest.mark.slow
def test_with_its_joint_known_the_bare_flange_comes_out_and_the_joint_with_it(taps):
    """Every reader then couples through the joint: the tip is right, and so is the spindle's own motion, which forces need."""
    assembly, joint = read_tooling(MACHINES / "toolings" / "S1-ER32.toml").assembly, LumpedJoint(**asdict(spindle().joint))
    modes = normal_modes([6000.0], [0.05], [[0.2, 0.1]], plane("flange"))
    made = by_hand.result_text(taps)
    data = json.loads(made) | {"status": "converged", "reasons": [], "axes": {axis: spindle_to_json(modes, joint) for axis in "XY"}}
    write_result(taps / "RESULT.json", data)
    out = taps / "BARE.csv"
    run("decouple", *options(taps), "--beside", taps / "RESULT.json", "--out", out)
    machine = read_flange_machine(out)
    assert [part.believed.joint for part in machine.parts] == [joint, joint]
    machine.check_behind_joint()
    ports = ("tip.x", "flange.x")
    true = frequency_response(rotor(spindle(), assembly), OMEGA, 0.0, inputs=("tip.x",), outputs=ports)[:, :, 0]
    coupled = machine.coupled(assembly, OMEGA)
    for row, expected in zip(("tip.x", "spindle.x"), true.T, strict=True):
        found = coupled.between(row, "tip.x")
        assert np.linalg.norm(found - expected) < 0.05 * np.linalg.norm(expected)


@pytest.mark.slow
def test_tips_alone_are_called_doubtful(taps):
    """Three tips leave two flanges at many frequencies: written, and the exit code says that it is not settled."""
    result = run("decouple", *options(taps, ("tip",)), "--out", taps / "TIPS.csv", code=3)
    assert "a fourth tooling would decide" in result.output
    assert (taps / "TIPS.csv").exists()


@pytest.mark.slow
def test_what_is_refused(taps):
    out = taps / "NONE.csv"
    one = options(taps)[:2]
    assert "at least three" in run("decouple", *one, "--out", out, code=2).output
    assert "TOOLING.toml=FRF" in run("decouple", "--tap", "a.csv", "--out", out, code=2).output
    assembly = read_tooling(taps / "A20.toml").assembly
    flat = np.ones(OMEGA.size, dtype=complex)
    with pytest.raises(InputError, match="nothing is left to decouple"):
        flange_from_taps([FlangeTap("a", assembly, Place.FLANGE, OMEGA, flat)], Dof.X)
    with pytest.raises(InputError, match="the 260 frequencies of a"):
        flange_from_taps(
            [FlangeTap("a", assembly, Place.TIP, OMEGA, flat), FlangeTap("b", assembly, Place.TIP, OMEGA[1:], flat[1:])], Dof.X
        )
    with pytest.raises(InputError, match="at least three toolings"):
        flange_from_taps([], Dof.X)
