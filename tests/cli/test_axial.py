"""axial: one hammer test along the axis in, the machine that knows it out; every further tool is then known along its axis."""

from __future__ import annotations

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from rcsa_ident.base.errors import InputError
from rcsa_ident.cli import app
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.io.curves.tips import read_frf_csv, read_lobes_csv, write_frf_csv
from rcsa_ident.io.results.axial_flanges import axial_of, axial_to_json
from rcsa_ident.io.results.identifications import machine_from_json
from rcsa_ident.io.results.parts import read_result
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.io.validated_table import Table
from rcsa_ident.tool_holder.rods import rod_poles
from tests.fixtures import by_hand

FREQUENCY = np.arange(100.0, 4000.0, 2.0)
OMEGA = 2.0 * np.pi * FREQUENCY
CUT = ("--ktc-mpa", 2000, "--krc", 0.4, "--kac", 0.2, "--stock", "block", "--y-from-mm", -5, "--y-to-mm", 5, "--no-bands")
SPEEDS = ("--speed-from", 3000, "--speed-to", 6000, "--speed-step", 500)


def run(*arguments, code=0):
    result = CliRunner().invoke(app, [str(a) for a in arguments])
    assert result.exit_code == code, result.output + repr(result.exception)
    return result


def spindle(omega):
    """The machine along its axis: soft, near where the tools chatter."""
    x = omega / (2.0 * np.pi * 900.0)
    return 1.0 / (3e7 * (1.0 - x**2 + 0.08j * x)) + 5e-10


def tip(path, omega=OMEGA):
    """A tooling's tip on it."""
    free = rod_poles(read_tooling(path).assembly, 8e4).receptance(omega).values
    return free[:, 0, 0] - free[:, 0, 1] * free[:, 1, 0] / (free[:, 1, 1] + spindle(omega))


@pytest.fixture
def shop(tmp_path, result_file):
    """RESULT.json, T1.toml that was tapped, and a high-feed cutter on another stickout."""
    high_feed = by_hand.TOOLING.replace('name = "T1"', 'name = "HF"')
    shape = 'shape = "high-feed"\ncutting_edge_angle_deg = 15.0\ncutting_depth_mm = 1.0\n'
    high_feed = high_feed.replace("\ndiameter_mm = 12.0", f"\n{shape}diameter_mm = 12.0")
    (tmp_path / "HF.toml").write_text(high_feed.replace("stickout_mm = 60.0", "stickout_mm = 50.0"), encoding="utf-8")
    rng = np.random.default_rng(1)
    values = tip(tmp_path / "T1.toml")
    noise = 0.01 * np.abs(values) * (rng.standard_normal(FREQUENCY.size) + 1j * rng.standard_normal(FREQUENCY.size)) / np.sqrt(2.0)
    write_frf_csv(tmp_path / "Z.csv", FREQUENCY, {"Z": values + noise})
    return tmp_path


def test_one_tap_serves_every_tool(shop):
    told = run("axial", shop / "RESULT.json", shop / "T1.toml", shop / "Z.csv", "--out", shop / "TAPPED.json")
    assert "tapped with T1" in told.stdout
    run("tooltip", shop / "TAPPED.json", shop / "HF.toml", "--out", shop / "F.csv", "--from", 300, "--to", 3000)
    found = read_frf_csv(shop / "F.csv")
    truth = tip(shop / "HF.toml", 2.0 * np.pi * found.frequency)
    assert np.linalg.norm(found.values["Z"] - truth) < 0.01 * np.linalg.norm(truth)
    assert set(found.values) == {"X", "Y", "Z"}
    # the machine across its axis is the one that it was
    run("tooltip", shop / "RESULT.json", shop / "HF.toml", "--out", shop / "B.csv", "--from", 300, "--to", 3000)
    before = read_frf_csv(shop / "B.csv")
    assert set(before.values) == {"X", "Y"}
    np.testing.assert_allclose(found.values["X"], before.values["X"], rtol=1e-9)


@pytest.mark.slow
def test_limits_take_it(shop):
    """A cutter that pushes along its axis; without the tap a sentence says that Z is taken as rigid."""
    run("axial", shop / "RESULT.json", shop / "T1.toml", shop / "Z.csv", "--out", shop / "TAPPED.json")
    limits, words = {}, {}
    for name in ("RESULT", "TAPPED"):
        words[name] = run("lobes", shop / f"{name}.json", shop / "HF.toml", *CUT, *SPEEDS, "--out", shop / "L.csv").stderr
        limits[name] = read_lobes_csv(shop / "L.csv").limit
    assert "is taken as rigid" in words["RESULT"]
    assert "is taken as rigid" not in words["TAPPED"]
    both = np.isfinite(limits["RESULT"]) & np.isfinite(limits["TAPPED"])
    assert np.any(np.abs(limits["TAPPED"][both] / limits["RESULT"][both] - 1.0) > 0.1)


def test_a_measured_flange_keeps_it_in_columns(shop):
    flange = by_hand.flange_file(shop / "FLANGE.csv")
    run("axial", flange, shop / "T1.toml", f"Z={shop / 'Z.csv'}", "--to", 3500, "--out", shop / "BOTH.csv")
    assert (shop / "BOTH.csv").read_text(encoding="utf-8").splitlines()[0].endswith("Z_tF_re,Z_tF_im")
    run("tooltip", shop / "BOTH.csv", shop / "HF.toml", "--out", shop / "F.csv")
    found = read_frf_csv(shop / "F.csv")
    truth = tip(shop / "HF.toml", 2.0 * np.pi * found.frequency)
    assert np.linalg.norm(found.values["Z"] - truth) < 0.01 * np.linalg.norm(truth)
    lines = (shop / "BOTH.csv").read_text(encoding="utf-8").replace("Z_tF_im", "other", 1)
    (shop / "HALF.csv").write_text(lines, encoding="utf-8")
    assert "column Z_tF_im" in run("tooltip", shop / "HALF.csv", shop / "HF.toml", "--out", shop / "F.csv", code=2).stderr


def test_what_does_not_fit(shop):
    base = ("axial", shop / "RESULT.json", shop / "T1.toml")
    assert "as the machine is one" in run(*base, shop / "Z.csv", "--out", shop / "F.csv", code=2).stderr
    assert "a test along Z" in run(*base, f"X={shop / 'Z.csv'}", "--out", shop / "T.json", code=2).stderr
    assert "at least 8 that rise" in run(*base, shop / "Z.csv", "--from", 3990, "--out", shop / "T.json", code=2).stderr
    write_frf_csv(shop / "W.csv", FREQUENCY, {"Z": -tip(shop / "T1.toml")})
    turned = run(*base, shop / "W.csv", "--out", shop / "T.json")
    assert "a reversed sensor or hammer explains it, and the FRF was turned" in turned.stderr
    assert "would feed energy in" not in turned.stderr
    # so few lines do not tell why
    few = slice(None, None, FREQUENCY.size // 15)
    write_frf_csv(shop / "W.csv", FREQUENCY[few], {"Z": -tip(shop / "T1.toml")[few]})
    assert "would feed energy in" in run(*base, shop / "W.csv", "--out", shop / "T.json").stderr
    assert "would feed energy in" in run("tooltip", shop / "T.json", shop / "HF.toml", "--out", shop / "F.csv").stderr


def test_the_file_says_what_the_machine_knows(shop):
    told = json.loads(run("axial", shop / "RESULT.json", shop / "T1.toml", shop / "Z.csv", "--out", shop / "T.json", "--json").stdout)
    data = read_result(shop / "T.json")
    assert told["axial"] == data["axial"]
    known = machine_from_json(data, "T.json").axial
    assert json.loads(json.dumps(axial_to_json(known))) == data["axial"]
    assert known.receptance(OMEGA).rows == (Coordinate("flange", Dof.Z),)
    np.testing.assert_allclose(told["stiffness_n_per_m"], 1.0 / np.abs(spindle(OMEGA[0])), rtol=0.02)
    for key, value, allowed in (
        ("band_hz", [300.0, 200.0], "a lowest and a highest"),
        ("poles", [{"pole_per_s": [1.0, 2.0], "residue_m_per_n_s": [0.0, 1.0]}], "damped poles"),
        ("poles", [{"pole_per_s": [1.0], "residue_m_per_n_s": [0.0, 1.0]}], "2 finite numbers"),
        ("modes", [], "tooling, band_hz, poles"),
    ):
        with pytest.raises(InputError, match=allowed):
            axial_of(Table({"axial": data["axial"] | {key: value}}, "T.json"))
