"""contact: tap tests in, a calibrated tooling out."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.dynamics.coordinates import Dof, plane
from rcsa_ident.dynamics.modal import normal_modes
from rcsa_ident.io.curves.flanges import write_flange_csv
from rcsa_ident.io.curves.tips import write_frf_csv
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.tool_holder.geometry import Contact
from rcsa_ident.tool_holder.model import tool_holder_receptance
from tests.cli.measurements import run
from tests.fixtures import by_hand
from tests.oracles import analytic

pytestmark = pytest.mark.slow

TRUE = Contact(1.2e10, 1.5e6, 6e4, 25.0)


@pytest.fixture
def taps(tmp_path):
    """Two stickouts of one tool, tapped at the tip, free: exact beams with noise."""
    rng = np.random.default_rng(1)
    frequency = np.arange(100.0, 6000.0, 40.0)
    for name, stickout in (("T1", 60.0), ("LONG", 85.0)):
        text = by_hand.TOOLING.replace("stickout_mm = 60.0", f"stickout_mm = {stickout}").replace("length_mm = 100.0", "length_mm = 130.0")
        (tmp_path / f"{name}.toml").write_text(text)
        a = read_tooling(tmp_path / f"{name}.toml").assembly
        tool, holder = (
            [
                analytic.Beam(
                    s.length, s.diameter, s.inner_diameter, s.material.youngs_modulus, s.material.density, s.material.poisson, 0.003
                )
                for s in part
            ]
            for part in (a.tool, a.holder)
        )
        contact = (TRUE.translational_stiffness, TRUE.rotational_stiffness, TRUE.translational_damping, TRUE.rotational_damping)
        h = analytic.assembly_receptance(tool, holder, a.insertion, contact, 2.0 * np.pi * frequency)[:, 0, 0]
        h = h + 0.01 * np.abs(h) * (rng.normal(size=h.size) + 1j * rng.normal(size=h.size))
        write_frf_csv(tmp_path / f"{name}.csv", frequency, {"X": h})
    return tmp_path


def test_calibrated_tooling_and_figure(taps):
    out, plot = taps / "C.toml", taps / "contact.png"
    arguments = ("contact", taps / "T1.toml", "--tap", taps / "T1.csv", "--tap", f"{taps / 'LONG.toml'}={taps / 'LONG.csv'}")
    text = run(*arguments, "--out", out, "--plot", plot).output
    assert "translational stiffness" in text
    read = read_tooling(out).assembly
    assert read.contact.translational_stiffness == pytest.approx(TRUE.translational_stiffness, rel=0.03)
    assert read.contact.rotational_stiffness == pytest.approx(TRUE.rotational_stiffness, rel=0.03)
    assert read.contact.rotational_damping == pytest.approx(TRUE.rotational_damping, rel=0.1)
    assert read.tool == read_tooling(taps / "T1.toml").assembly.tool
    assert plot.read_bytes().startswith(b"\x89PNG")
    assert "# from 2 tap tests, stickouts 60, 85 mm" in out.read_text()
    answer = json.loads(run(*arguments, "--out", out, "--json").output)
    assert answer["contact"]["translational_stiffness"]["told"]
    assert set(answer["misfit"]) == {"T1.csv", "LONG.csv"}


def test_a_band_that_does_not_tell_it(taps):
    result = run("contact", taps / "T1.toml", "--tap", taps / "T1.csv", "--out", taps / "C.toml", "--to", 1200, code=3)
    assert "hardly determined" in result.output.replace("\n", " ")
    assert (taps / "C.toml").exists()


@pytest.mark.parametrize("joint", [None, LumpedJoint(2e10, 5e7, 2000.0, 10.0)], ids=["joint included", "joint beside it"])
def test_clamped_in_a_measured_flange(taps, joint):
    """The same tool on a flange that FLANGE.csv describes, with its joint: what was put in comes out."""
    omega = 2.0 * np.pi * np.arange(150.0, 6100.0, 10.0)
    psi = np.array([[0.3, 3.0], [-0.25, 2.0], [0.2, -4.0]])
    modes = normal_modes(2.0 * np.pi * np.array([700.0, 1300.0, 2500.0]), np.array([0.05, 0.04, 0.06]), psi, plane("flange"))
    values, joints = modes.receptance(omega).values, None
    if joint is not None:
        values = values - np.eye(2) * joint.compliance_along(omega, [c.dof for c in modes.coordinates])[:, None, :]
        joints = {Dof.X: joint}
    write_flange_csv(taps / "FLANGE.csv", omega / (2.0 * np.pi), {Dof.X: values}, joints=joints)
    kept = omega[20:-20:2]
    for name in ("T1", "LONG"):
        a = replace(read_tooling(taps / f"{name}.toml").assembly, contact=TRUE)
        h = couple(tool_holder_receptance(a, kept), modes.receptance(kept), LumpedJoint(1e18, 1e18))["tip", "tip"][:, 0, 0]
        write_frf_csv(taps / f"on_{name}.csv", kept / (2.0 * np.pi), {"X": h})
    arguments = ("--tap", taps / "on_T1.csv", "--tap", f"{taps / 'LONG.toml'}={taps / 'on_LONG.csv'}", "--on", taps / "FLANGE.csv")
    run("contact", taps / "T1.toml", *arguments, "--out", taps / "C.toml")
    found = read_tooling(taps / "C.toml").assembly.contact
    assert found.translational_stiffness == pytest.approx(TRUE.translational_stiffness, rel=0.02)
    assert found.rotational_stiffness == pytest.approx(TRUE.rotational_stiffness, rel=0.02)
    wrong = run("contact", taps / "T1.toml", "--tap", taps / "y.csv", "--on", taps / "FLANGE.csv", "--out", taps / "C.toml", code=2)
    assert "no such file" in wrong.output
    write_frf_csv(taps / "y.csv", kept / (2.0 * np.pi), {"Y": h})
    wrong = run("contact", taps / "T1.toml", "--tap", taps / "y.csv", "--on", taps / "FLANGE.csv", "--out", taps / "C.toml", code=2)
    assert "an axis of" in wrong.output


def test_what_is_refused(taps):
    assert (
        "0 to 50"
        in run("contact", taps / "T1.toml", "--tap", taps / "T1.csv", "--out", taps / "C.toml", "--gain-spread", 90, code=2).output
    )
    assert "no such file" in run("contact", taps / "T1.toml", "--tap", taps / "none.csv", "--out", taps / "C.toml", code=2).output
