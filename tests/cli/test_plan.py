"""The command as a user meets it: files, figures, sentences."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from rcsa_ident.cli.plan import plan
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.modal_parameters import ModalParameters
from rcsa_ident.identification.posterior import Posterior
from rcsa_ident.identification.unknowns import ModalBlock, pack, parameter_names
from rcsa_ident.io.results.parts import spindle_to_json, write_result
from rcsa_ident.io.settings.setups import read_campaign

DATA = Path(__file__).parents[2] / "data"
TOOLINGS = DATA / "machines" / "toolings"
NAMES = [f"{key}={TOOLINGS / name}" for key, name in (("--toolings", "S1-ER32.toml"), ("--toolings", "S2-PG25.toml"))]
RPM = np.pi / 30.0

app = typer.Typer()
app.command()(plan)


def run(*arguments, code=0):
    result = CliRunner().invoke(app, [str(a) for a in arguments])
    assert result.exit_code == code, result.output + repr(result.exception)
    return result


def axis_of(axis, shift, speed_range):
    natural = 2.0 * np.pi * shift * np.array([950.0, 1750.0, 3300.0])
    shapes = np.array([[0.14, 0.12], [0.18, -0.2], [0.15, 0.4]])
    factor = np.diag(np.sqrt(2.0 * 0.05 * natural))
    physics = ModalParameters(natural, shapes, factor, np.diag([2e-5, 3e-5]), np.zeros((3, 0)), np.zeros((0, 2)), np.zeros((0, 0)))
    theta = np.concatenate([pack(physics), np.log([3e9, 6e6, 2e3, 10.0])])
    layout = ModalBlock(3)
    data = spindle_to_json(*Posterior(theta, 4e-4 * np.eye(theta.size), layout).machine(axis))
    data |= {"layout": {"modes": 3, "softening": False}, "unknowns": theta, "model_error": 2e-3}
    data |= {"covariance": {"parameters": list(parameter_names(layout)), "matrix": 4e-4 * np.eye(theta.size)}}
    return data | ({"speed_range_rpm": list(speed_range)} if speed_range else {})


def result_in(folder, speed_range=(8000.0, 16000.0), **more):
    data = {
        "schema_version": 1, "status": "converged", "reasons": [], "seed": 1, "method": "default", "software": "rcsa-ident",
        "campaign": {"name": "by hand", "cuts_used": 20, "cuts_left_out": []}, "sensors": {},
        "workpiece": {"name": "EN AW-6082", "tangential_coefficient_mpa": 902.0, "radial_ratio": 0.26},
        "band_hz": [600.0, 4000.0],
        "axes": {"X": axis_of(Dof.X, 1.0, speed_range), "Y": axis_of(Dof.Y, 0.93, speed_range)},
    }  # fmt: skip
    path = folder / "RESULT.json"
    write_result(path, data | more)
    return path


def options(folder, *more):
    toolings = [word for pair in NAMES for word in pair.split("=", 1)]
    return [*toolings, "--target", TOOLINGS / "S4-shrink.toml", "--out", folder / "PLAN.toml", "--depths-mm", "0.1,0.2", *more]


def test_the_plan_is_a_piece_of_a_campaign_file(tmp_path):
    campaign = tmp_path / "campaign"
    (campaign / "toolings").mkdir(parents=True)
    (campaign / "recordings").mkdir()
    shown = run(result_in(tmp_path), *options(tmp_path, "--cuts", 3, "--feed-direction", "-Y", "--entry-deg", 90, "--exit-deg", 150))
    assert "at even distances" in shown.stdout
    head = (DATA / "sample_runs" / "campaign.toml").read_text(encoding="utf-8").split("[[cuts]]")[0]
    text = (tmp_path / "PLAN.toml").read_text(encoding="utf-8")
    (campaign / "campaign.toml").write_text(head + text, encoding="utf-8")
    for name in ("S1-ER32", "S2-PG25"):
        (campaign / "toolings" / f"{name}.toml").write_bytes((TOOLINGS / f"{name}.toml").read_bytes())
    for cut in tomllib.loads(text)["cuts"]:
        for key in ("cut", "air"):
            (campaign / cut[key]).touch()
    cuts = read_campaign(campaign).cuts
    # three of the plan, the same at half the feed, and the first of each tooling that has more than one once more
    present = {c.tooling for c in cuts}
    assert len({c.id for c in cuts}) == len(cuts) == 6 + len(present)
    assert [c.id.rsplit("-", 1)[-1] for c in cuts].count("repeat") == len(present)
    assert {c.conditions.feed_per_tooth for c in cuts} == {1e-4, 5e-5}
    for name in present:
        assert f"# {name}: let the spindle turn at 11314 rev/min for 30 minutes, then cut in this order." in text
        assert f"{name}: half an hour of warm-up at 11314 rev/min, then" in shown.stdout
    for cut in cuts:
        conditions = cut.conditions
        assert 8000.0 - 1e-6 <= conditions.spindle_speed / RPM <= 16000.0 + 1e-6
        assert conditions.axial_depth in (1e-4, 2e-4)
        if conditions.feed_per_tooth == 1e-4:
            assert conditions.feed_angle == pytest.approx(-0.5 * np.pi)
        assert np.degrees([conditions.engagement.entry, conditions.engagement.exit]) == pytest.approx([90.0, 150.0])
    # a cut with the tooling that is wanted judges the answer
    assert "to judge the answer: S4-shrink at" in shown.stdout
    (judge,) = tomllib.loads(text[text.index("# To judge") :].replace("\n# ", "\n"))["cuts"]
    assert (judge["tooling"], judge["validation"]) == ("S4-shrink", True)


@pytest.mark.slow
def test_figures_for_machines(tmp_path):
    arguments = [result_in(tmp_path), *options(tmp_path, "--cuts", 4, "--json")]
    first = json.loads(run(*arguments).stdout)
    bands = [first["band_percent"]["S4-shrink"], *(c["band_percent"]["S4-shrink"] for c in first["cuts"])]
    assert np.all(np.diff(bands) < 0.0)
    assert bands[-1] < first["even_band_percent"]["S4-shrink"] < bands[0]
    assert [c["spindle_speed_rpm"] for c in first["cuts"]] == [c["spindle_speed_rpm"] for c in json.loads(run(*arguments).stdout)["cuts"]]
    wanted = json.loads(run(*arguments, "--band", bands[2]).stdout)
    assert wanted["fewest"]["reached"]
    assert len(wanted["cuts"]) == wanted["fewest"]["cuts"] <= 2


def test_a_band_out_of_reach_is_a_warning(tmp_path):
    shown = run(result_in(tmp_path), *options(tmp_path, "--cuts", 2, "--band", 1e-4))
    assert "a standard deviation of 0.0001 % is not reached: 2 cuts give" in shown.stderr
    # a row each
    assert shown.stdout.count("│ S1-ER32") + shown.stdout.count("│ S2-PG25") == 2


@pytest.mark.slow
def test_better_known_forces_narrow_the_band(tmp_path):
    """Along one feed: with more to choose from, cuts that are chosen one by one need not be the better pair."""
    found = []
    for std in (0.05, 1e-4):
        known = {name: {"scale": 1.0, "std": std} for name in ("tangential coefficient", "radial ratio")}
        asked = options(tmp_path, "--cuts", 2, "--feed-direction", "+X", "--json")
        summary = json.loads(run(result_in(tmp_path, coefficients=known), *asked).stdout)
        found.append(summary["cuts"][-1]["band_percent"]["S4-shrink"])
    assert found[1] < found[0]


@pytest.mark.slow
def test_noise_of_a_campaign(tmp_path):
    summary = json.loads(run(result_in(tmp_path), *options(tmp_path, "--cuts", 1, "--campaign", DATA / "sample_runs", "--json")).stdout)
    # 2 nm rms over 7168 samples in the gap's cut and air cut: 2 nm sqrt(2 / 7168) sqrt(2), and the fixture's share
    assert summary["noise_nm"] == pytest.approx(0.05, rel=0.3)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--depths-mm", "deep"], "--depths-mm"),
        (["--depths-mm", "0.1,-1"], "--depths-mm"),
        (["--depths-mm", "50"], "none of"),
        (["--speed-to", "7000"], "--speed-to"),
        (["--margin", "0.5"], "margin"),
        (["--chip-thickness-mm", "0"], "--chip-thickness-mm"),
        (["--immersion", "2"], "immersion"),
        (["--noise-nm", "0"], "--noise-nm"),
        (["--band", "0"], "--band"),
        (["--from", "5000"], "band"),
        (["--campaign", "nowhere"], "no such folder"),
    ],
)
def test_bad_input_is_one_sentence_and_exit_code_2(tmp_path, more, words):
    result = run(result_in(tmp_path), *options(tmp_path, *more), code=2)
    assert words in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "PLAN.toml").exists()


def test_the_feed_of_a_chip(tmp_path):
    """A wall's chip is thickest where it is cut nearest to the feed's normal: between 120 and 150 degrees, sin 120."""
    asked = ("--cuts", 2, "--entry-deg", 120, "--exit-deg", 150, "--feed-direction", "+X", "--chip-thickness-mm", 0.05)
    run(result_in(tmp_path), *options(tmp_path, *asked))
    feeds = {cut["feed_per_tooth_mm"] for cut in tomllib.loads((tmp_path / "PLAN.toml").read_text(encoding="utf-8"))["cuts"]}
    whole = 0.05 / np.sin(np.deg2rad(120.0))
    assert sorted(feeds) == pytest.approx([0.5 * whole, whole], rel=1e-3)


def test_speeds_that_nobody_knows_are_asked_for(tmp_path):
    path = result_in(tmp_path, speed_range=None)
    assert "--speed-from" in run(path, *options(tmp_path), code=2).stderr
    run(path, *options(tmp_path, "--cuts", 1, "--speed-from", 8000, "--speed-to", 10000))


def test_passes_are_a_piece_of_a_campaign_file(tmp_path):
    result, out = result_in(tmp_path), tmp_path / "PASSES.toml"
    arguments = (result, *[part for name in NAMES for part in name.split("=", 1)], "--target", TOOLINGS / "S3-PG25-long.toml", "--out", out)
    told = json.loads(run(*arguments, "--passes", 3, "--pass-seconds", 2.5, "--depths-mm", "0.05,0.1", "--json").stdout)
    cuts = tomllib.loads(out.read_text(encoding="utf-8"))["cuts"]
    assert len(cuts) == len(told["passes"]) == 6
    assert [(cut["spindle_speed_rpm"], cut["spindle_speed_to_rpm"]) for cut in cuts[:3]] == [
        (8000.0, 10667.0),
        (10667.0, 13333.0),
        (13333.0, 16000.0),
    ]
    first = told["passes"][0]
    # 4 teeth of 0.1 mm, 2.5 s at 9333.5 rev/min in the mean
    assert first["path_mm"] == pytest.approx(0.1 * 4 * 2.5 * 9333.5 / 60.0, rel=1e-6)
    assert first["axial_depth_mm"] in (0.05, 0.1)
    assert all(first["band_percent"][name] < told["band_percent"][name] for name in told["band_percent"])
    words = run(*arguments, "--passes", 3, "--depths-mm", "0.05,0.1").output
    assert "passes of 4 s" in words
    assert "6 passes, 24 s of cutting" in words
    close = run(*arguments, "--passes", 100, "--depths-mm", "0.05", "--speed-from", 8000, "--speed-to", 8100, code=2)
    assert "passes that change the speed by 0.5 to 200 %" in str(close.exception or close.output) + close.output
