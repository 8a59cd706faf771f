"""calibrate and materials as a user meets them: a campaign folder with recordings of forces in, a workpiece out."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.io.recordings.hdf5 import write_hdf5
from rcsa_ident.io.settings.dynamometer import read_workpiece
from rcsa_ident.io.settings.setups import read_campaign
from tests.cli.measurements import run
from tests.fixtures import by_hand
from tests.fixtures.dynamometer import TRUE, plan, true_force

RATE = 25600.0


@pytest.fixture(scope="session")
def force_campaign(tmp_path_factory):
    """Five cuts with a dynamometer under the workpiece (the other sign), an air cut each, sensitivities in V/N."""
    folder = tmp_path_factory.mktemp("forces")
    (folder / "recordings").mkdir()
    (folder / "T1.toml").write_text(by_hand.TOOLING.replace("diameter_mm = 12.0\n[tool]", "diameter_mm = 12.0\nhelix_deg = 30.0\n[tool]"))
    rng = np.random.default_rng(1)
    lines = ['[campaign]\nname = "dynamometer"\nsampling_rate_hz = 25600']
    for axis in "xy":
        lines.append(f'[sensors.force_{axis}]\nquantity = "force"\naxis = "{axis.upper()}"\nsensitivity = -0.004')
    lines.append('[workpiece]\nname = "AlZn"\ntangential_coefficient_mpa = 1000\nradial_ratio = 0.1\n[toolings]\nT1 = "T1.toml"')
    for i, c in enumerate(plan()):
        turning = replace(c, spindle_speed=c.spindle_speed * (1.0 + 5e-4 * rng.normal()))
        force = true_force(turning, 0.5, RATE, 6.0 * rng.random(), 2e-6)
        for kind, signal in (("cut", force), ("air", 0.0 * force)):
            volts = -0.004 * (signal + rng.normal(size=force.shape) + [4.0, -2.0])
            write_hdf5(folder / f"recordings/{i}_{kind}.h5", RATE, {"force_x": volts[:, 0], "force_y": volts[:, 1]})
        lines.append(
            f'[[cuts]]\nid = "c{i}"\ntooling = "T1"\nspindle_speed_rpm = 6000\naxial_depth_mm = 0.4\n'
            f"feed_per_tooth_mm = {1e3 * c.feed_per_tooth:g}\nentry_angle_deg = 90\nexit_angle_deg = 180\n"
            f'feed_direction = "+X"\ncut = "recordings/{i}_cut.h5"\nair = "recordings/{i}_air.h5"'
        )
    (folder / "campaign.toml").write_text("\n".join(lines) + "\n")
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("method", ["mean", "signal"])
def test_coefficients_and_figure(force_campaign, tmp_path, method):
    out, plot = tmp_path / "W.toml", tmp_path / "means.png"
    text = run("calibrate", force_campaign, "--out", out, "--method", method, "--plot", plot).output
    assert "K_tc" in text
    assert "MPa" in text
    workpiece = read_workpiece(out)
    assert workpiece.name == "AlZn"
    c = workpiece.coefficients
    found = np.array([c.tangential, c.tangential * c.radial_ratio, c.tangential_edge, c.radial_edge])
    np.testing.assert_allclose(found, TRUE, rtol=0.01 if method == "signal" else 0.06)
    assert 0.0 < c.tangential_spread < 0.03
    assert plot.read_bytes().startswith(b"\x89PNG")
    # the file's table stands in a campaign as it is
    campaign = (force_campaign / "campaign.toml").read_text()
    head, rest = campaign.split("[workpiece]")
    folder = tmp_path / "next"
    shutil.copytree(force_campaign, folder)
    (folder / "campaign.toml").write_text(f"{head}{out.read_text()}[toolings]{rest.split('[toolings]')[1]}")
    assert read_campaign(folder).workpiece.coefficients == c


@pytest.mark.slow
def test_json(force_campaign, tmp_path):
    answer = json.loads(run("calibrate", force_campaign, "--out", tmp_path / "W.toml", "--method", "signal", "--json").output)
    k = answer["coefficients"]["K_tc"]
    assert k["unit"] == "MPa"
    assert abs(k["value"] - 800.0) < max(2.0 * k["half_width_95"], 5.0)
    assert answer["cuts_used"] == ["c0", "c1", "c2", "c3", "c4"]
    assert answer["axes"] == []
    assert answer["signal"]["dynamometer"] == [[], []]


@pytest.mark.slow
def test_a_wrong_sign_is_refused_with_the_reason(force_campaign, tmp_path):
    folder = tmp_path / "turned"
    shutil.copytree(force_campaign, folder)
    (folder / "campaign.toml").write_text((force_campaign / "campaign.toml").read_text().replace("-0.004", "0.004"))
    result = run("calibrate", folder, "--out", tmp_path / "W.toml", code=2)
    assert "sign or axes" in result.output
    assert not (tmp_path / "W.toml").exists()
    assert "--axes auto" in result.output.replace("\n", " ")
    for method in ("mean", "signal"):
        text = run("calibrate", folder, "--out", tmp_path / "W.toml", "--method", method, "--axes", "auto").output
        assert "force_x shows -X, force_y shows -Y" in text.replace("\n", " ")
        assert read_workpiece(tmp_path / "W.toml").coefficients.tangential == pytest.approx(TRUE[0], rel=0.06)
    answer = json.loads(run("calibrate", folder, "--out", tmp_path / "W.toml", "--axes", "auto", "--json").output)
    assert answer["axes"][0]["shows"] == ["-X", "-Y"]


def test_no_force_at_all(small_campaign, tmp_path):
    result = run("calibrate", small_campaign, "--out", tmp_path / "W.toml", code=2)
    assert "no force along" in result.output


def test_materials():
    text = run("materials").output
    assert "902" in text
    entries = json.loads(run("materials", "--json").output)
    assert {"name", "tangential_coefficient_mpa", "source", "condition", "tangential_coefficient_spread_percent"} <= set(entries[0])
    one = json.loads(run("materials", "en aw-6082", "--json").output)
    assert one[0]["tangential_coefficient_mpa"] == 902.0
    assert "did you mean" in run("materials", "7075", code=2).output
    assert "edge forces" in run("materials", "EN AW-6082").output.replace("\n", " ").lower()
