"""What is saved is what the command line reads, and the door's own readers read it back."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import rcsa_ident as ri
from rcsa_ident.io.curves.tips import read_lobes_csv
from rcsa_ident.tool_holder.geometry import Material


def test_result(nouns, tmp_path):
    path = nouns.result.save(tmp_path / "RESULT.json")
    again = ri.read_result(path)
    assert json.loads(path.read_text()) == json.loads(again.save(tmp_path / "again.json").read_text())
    assert str(again) == str(nouns.result)
    assert (again.status, again.reasons, again.notes) == (nouns.result.status, nouns.result.reasons, nouns.result.notes)
    omega = ri.hz(200.0, 400.0, 50.0)
    here, there = (each.machine.tip(nouns.tooling, omega).values for each in (nouns.result, again))
    np.testing.assert_allclose(there, here, rtol=1e-10)
    assert again.left_out == {}
    assert nouns.read.left_out == {"T1-2": "chatter: 3 µm at 1500 Hz"}


def test_report(nouns, tmp_path):
    assert "<html" in nouns.result.save(tmp_path / "report.html").read_text(encoding="utf-8")
    with pytest.raises(ri.InputError, match=r"one of \.json"):
        nouns.read.save(tmp_path / "report.html")


def test_machine_from_either_file(nouns, tmp_path):
    assert str(ri.read_machine(nouns.folder / "RESULT.json")) == str(nouns.machine)
    jointed = replace(nouns.flange, joint=nouns.machine.identified["x"].joint)
    flange = ri.read_machine(jointed.save(tmp_path / "FLANGE.csv"))
    omega = ri.hz(300.0, 2500.0, 10.0)
    found, expected = (each.tip(nouns.tooling, omega).between("tip.x", "tip.x") for each in (flange, jointed))
    np.testing.assert_allclose(found, expected, rtol=1e-4)


def test_tooling(nouns, tmp_path):
    cutter = ri.Cutter(3, 0.0123, np.radians(37.0), np.radians([110.0, 120.0, 130.0]))
    own = Material(211e9, 7810.0, 0.29, 0.001)
    tool = (ri.BeamSegment(0.03, 0.0098, own, area=6e-5, second_moment=3e-10), ri.BeamSegment(0.07, 0.0123, ri.MATERIALS["carbide"]))
    holder = (ri.BeamSegment(0.06, 0.04, ri.MATERIALS["steel"], 0.0123, 0.05),)
    made = ri.Tooling('own "tool"', cutter, ri.clamped(tool, holder, 0.061, 0.039, ri.Contact(2e10, 6e5, 1e4, 9.0)))
    for tooling in (made, nouns.tooling):
        again = ri.read_tooling(tooling.save(tmp_path / "TOOL.toml"))
        assert str(again) == str(tooling)
        tips = [nouns.machine.tip(each, spread=False).values for each in (tooling, again)]
        # a length that differs in its last digit may change the mesh
        np.testing.assert_allclose(tips[1], tips[0], rtol=1e-6)
        np.testing.assert_allclose(again.cutter.pitch, tooling.cutter.pitch, rtol=1e-12)
    assert made.save(tmp_path / "TOOL.svg").read_text().startswith("<svg")


def test_tip(nouns, tmp_path):
    again = ri.read_tip(nouns.tip.save(tmp_path / "FRF.csv"))
    np.testing.assert_allclose(again.omega, nouns.tip.omega, rtol=1e-12)
    assert np.array_equal(again.values, nouns.tip.values)


def test_tip_with_cross_terms(tmp_path):
    rows = (ri.Coordinate("tip", ri.Dof.X), ri.Coordinate("tip", ri.Dof.Y))
    values = np.random.default_rng(1).normal(size=(5, 2, 2)) * (1e-7 + 2e-8j)
    tip = ri.Receptance(ri.hz(100.0, 500.0, 100.0), values, rows, rows)
    assert np.array_equal(ri.read_tip(tip.save(tmp_path / "FRF.csv")).values, values)


def test_lobes(nouns, tmp_path):
    lobes = nouns.lobes
    again = ri.read_lobes(lobes.save(tmp_path / "LOBES.csv"), lobes.max_depth)
    for name in ("spindle_speed", "limit_depth", "chatter_frequency"):
        np.testing.assert_allclose(getattr(again, name), getattr(lobes, name), rtol=1e-12)
    assert np.array_equal(again.lobe, lobes.lobe)
    for here, there in zip(lobes.band, again.band, strict=True):
        np.testing.assert_allclose(there, here)
    # the band's edges in place of all machines: never more than what was recommended
    assert np.all(again.recommended_depth() <= lobes.recommended_depth() * (1.0 + 1e-9))
    assert ri.read_lobes(tmp_path / "LOBES.csv").max_depth == pytest.approx(lobes.limit_depth[np.isfinite(lobes.limit_depth)].max())


def test_lobes_that_are_stable_everywhere(nouns, tmp_path):
    free = replace(nouns.lobes, limit_depth=np.full(31, np.inf), drawn=None, chatter_frequency=np.full(31, np.nan), lobe=np.full(31, -1))
    again = ri.read_lobes(free.save(tmp_path / "LOBES.csv"), 5e-3)
    assert again.stable.all()
    assert again.band is None


def test_advice_and_map_are_tables(nouns, tmp_path):
    header = nouns.advice.save(tmp_path / "ADVICE.csv").read_text().splitlines()[0]
    assert header.startswith("spindle_speed_rpm,limit_depth_mm,")
    assert "removal_rate_cm3_per_min" in header
    assert "removal_rate_cm3_per_min" not in nouns.no_feed.save(tmp_path / "ADVICE.csv").read_text()
    assert len(nouns.chart.save(tmp_path / "MAP.csv").read_text().splitlines()) == 1 + nouns.chart.growth.size
    assert read_lobes_csv(nouns.lobes.save(tmp_path / "L.csv")).speed[0] == 6000.0


def test_recording(nouns, tmp_path):
    gained = replace(nouns.recording, sensors=(replace(nouns.recording.sensors[0], sensitivity=10e3), *nouns.recording.sensors[1:]))
    again = ri.read_recording(gained.save(tmp_path / "cut.h5"), gained.sensors)
    assert again.rate == gained.rate
    np.testing.assert_allclose(again.samples, gained.samples, rtol=1e-6, atol=1e-12)


def test_forces(nouns, tmp_path):
    again = ri.read_forces(nouns.forces.save(tmp_path / "FORCES.csv"))
    assert again.axes == nouns.estimate.axes
    assert again.step == pytest.approx(nouns.estimate.step)
    assert np.array_equal(again.force, nouns.estimate.force)
    assert np.array_equal(again.standard_deviation, nouns.estimate.standard_deviation)
    assert again.consistency is None


def test_forces_need_equal_steps(tmp_path):
    (tmp_path / "F.csv").write_text("time_s,Fx_n\n0.0,1.0\n0.1,2.0\n0.5,1.0\n")
    with pytest.raises(ri.InputError, match="equal steps"):
        ri.read_forces(tmp_path / "F.csv")


def test_modes_and_tap_tests_of_a_tip(nouns, tmp_path):
    (tmp_path / "MODES.toml").write_text("[[x]]\nnatural_frequency_hz = 922.0\ndamping_ratio = 0.011\nmodal_mass_kg = 0.03993\n")
    assert str(ri.read_modes(tmp_path / "MODES.toml")) == "tip: 1 mode at 922 Hz"
    path = nouns.tip.save(tmp_path / "FRF.csv")
    for tip in (ri.read_tap_tests(x=path, y=path), ri.read_tap_tests(y=path)):
        assert np.array_equal(tip.between("tip.y", "tip.y"), nouns.tip.between("tip.y", "tip.y"))
    advice = ri.advise(ri.KnownTip(tip), nouns.tooling, ri.CutSpec(material="EN AW-6082"), ri.rpm(6000, 9000, 500))
    assert advice.tooling == "T1"
