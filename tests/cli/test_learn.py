"""learn --tests, and what goes on from LEARNT.json: lobes, advise, further labels."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from rcsa_ident.base.units import to_rpm
from rcsa_ident.cli import advice, learn, lobes
from rcsa_ident.io.results.learnt_tips import learnt_tip_of, learnt_tip_to_json, read_learnt_tip, write_learnt_tip
from rcsa_ident.stability.labels.tested_cuts import Verdict

APP = typer.Typer(pretty_exceptions_enable=False)
APP.command("learn")(learn.learn)
APP.command("lobes")(lobes.lobes)
APP.command("advise")(advice.advise)

MODES = """\
[[x]]
natural_frequency_hz = 700
natural_frequency_sd_hz = 50
damping_ratio = 0.03
damping_ratio_sd = 0.01
stiffness_n_per_m = 8e6
stiffness_sd_n_per_m = 2e6
[[y]]
natural_frequency_hz = 800
natural_frequency_sd_hz = 50
damping_ratio = 0.035
damping_ratio_sd = 0.01
stiffness_n_per_m = 6e6
stiffness_sd_n_per_m = 2e6
[coefficients]
tangential_mpa = 900
tangential_sd_mpa = 100
radial_mpa = 270
radial_sd_mpa = 50
"""
CUTTER = "[cutter]\nteeth = 2\ndiameter_mm = 12\n"
HEADER = "spindle_speed_rpm,axial_depth_mm,verdict\n"
CUTS = HEADER + "8000,0.4,stable\n8000,0.9,chatter\n11000,0.9,stable\n11000,1.6,stable\n"
FAST = ("--method", "zero-order", "--processes", 1)
SPEEDS = ("--speed-from", 8000, "--speed-to", 12000, "--speed-step", 500, "--max-depth-mm", 4)


def run(*arguments, code=0):
    result = CliRunner().invoke(APP, [str(a) for a in arguments])
    assert result.exit_code == code, result.output + repr(result.exception)
    return result


def answer_of(*arguments, code=0):
    return json.loads(run(*arguments, "--json", code=code).stdout.splitlines()[-1])


@pytest.fixture
def shop(tmp_path):
    for name, text in (("M.toml", MODES), ("T.toml", CUTTER), ("C.csv", CUTS)):
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


@pytest.fixture(scope="module")
def once(tmp_path_factory):
    """The command's answer, and the file that it wrote."""
    folder = tmp_path_factory.mktemp("once")
    for name, text in (("M.toml", MODES), ("T.toml", CUTTER), ("C.csv", CUTS)):
        (folder / name).write_text(text, encoding="utf-8")
    answer = answer_of("learn", folder / "M.toml", folder / "T.toml", "--tests", folder / "C.csv", "--out", folder / "L.json", *FAST)
    return answer, (folder / "L.json").read_text(encoding="utf-8")


@pytest.fixture
def learnt(shop, once):
    """What the command tells; L.json lies beside the other files."""
    (shop / "L.json").write_text(once[1], encoding="utf-8")
    return once[0]


def rows_of(path):
    return list(csv.DictReader(path.read_text(encoding="utf-8").splitlines()))


def told(path):
    return {(float(r["spindle_speed_rpm"]), float(r["axial_depth_mm"])): float(r["probability_stable"]) for r in rows_of(path)}


@pytest.mark.slow
def test_labels_move_probabilities_their_way(shop, learnt):
    assert learnt["status"] == "converged"
    assert learnt["labels"] == 4
    assert learnt["effective_draws"] > 100
    before, after = (learnt["believed"]["modes"][0]["natural_frequency_hz"][key] for key in ("before", "after"))
    assert before == [700.0, 50.0]
    assert after[1] < 50.0
    (shop / "ALL.csv").write_text(CUTS + "11000,2.5,marginal\n8000,0.05,stable\n8000,9,chatter\n", encoding="utf-8")
    tests = ("--tests", shop / "ALL.csv", "--out", shop / "LOBES.csv", *SPEEDS, "--max-depth-mm", 12)
    found = answer_of("lobes", shop / "L.json", shop / "T.toml", *tests, "--tests-out", shop / "after.csv")
    (shop / "LOBES.csv").rename(shop / "L2.csv")
    run("lobes", "--modes", shop / "M.toml", shop / "T.toml", *tests, "--tests-out", shop / "plain.csv")
    after, plain = told(shop / "after.csv"), told(shop / "plain.csv")
    assert list(after) == [(8000, 0.4), (8000, 0.9), (11000, 0.9), (11000, 1.6), (11000, 2.5), (8000, 0.05), (8000, 9.0)]
    assert (shop / "after.csv").read_text().splitlines()[:2][1].startswith("8000,0.4,stable,0.")
    assert found["method"] == "zero-order"
    # the limit is that up to which half of the draws are stable: the tally says what the probabilities say
    stable = [p > 0.5 for p in list(after.values())[:4]] + [p > 0.5 for p in list(after.values())[5:]]
    seen = [True, False, True, True, True, False]
    assert found["tested"]["share_right"] == pytest.approx(np.mean(np.equal(stable, seen)))
    # physics has no doubt here; four labels by themselves, a tenth of the weight, have
    assert 0.94 < after[8000, 0.05] < 0.98
    # a pocket of a few draws lies here, and the same doubt
    assert 0.02 <= after[8000, 9.0] < 0.12
    assert after[11000, 1.6] > 0.5
    assert after[8000, 0.9] < plain[8000, 0.9]
    assert after[11000, 0.9] > after[11000, 1.6] > after[11000, 2.5]
    assert all(0.02 <= p <= 0.98 for p in plain.values())
    assert all(float(r["limit_depth_low_mm"]) <= float(r["limit_depth_mm"]) for r in rows_of(shop / "L2.csv") if r["limit_depth_mm"])


@pytest.mark.slow
def test_a_file_comes_back_as_it_was(shop, learnt):
    path = shop / "L.json"
    found = read_learnt_tip(path)
    write_learnt_tip(shop / "again.json", found)
    assert json.loads(path.read_text()) == json.loads((shop / "again.json").read_text())
    assert str(found).startswith("of one tooling, learnt from 4 labelled cuts: tip: 2 modes")
    assert to_rpm(found.cuts.spindle_speed) == pytest.approx([8000, 8000, 11000, 11000])
    assert found.cuts.verdict == (Verdict.STABLE, Verdict.CHATTER, Verdict.STABLE, Verdict.STABLE)
    assert found.prior.size == 8
    data = learnt_tip_to_json(found)
    ragged = [data["prior"]["modes"][0], {**data["prior"]["modes"][1], "outputs": [[1.0, 0.0]]}]
    for change, words in (
        ({"schema_version": 7}, "schema_version: found 7"),
        ({"kind": "result"}, "kind"),
        ({"method": "guess"}, "method"),
        ({"posterior": {**data["posterior"], "draws": [[1.0, 2.0]]}}, r"posterior.draws: found shape \(1, 2\)"),
        ({"posterior": {**data["posterior"], "errors": [[1.0], [2.0, 3.0]]}}, "posterior.errors: found rows that differ"),
        ({"labels": {**data["labels"], "noise": {**data["labels"]["noise"], "width": -1.0}}}, "labels.noise.width: found -1"),
        ({"prior": {**data["prior"], "root": [[1.0]]}}, "prior.root"),
        ({"prior": {**data["prior"], "root": [[10**400]]}}, "prior.root: found rows that differ, or no numbers"),
        ({"prior": {**data["prior"], "modes": ragged}}, r"prior.modes\[1\].outputs: found 1 rows, allowed is as many as of the first"),
    ):
        with pytest.raises(ValueError, match=words):
            learnt_tip_of(data | change, "L.json")


@pytest.mark.slow
def test_further_labels_are_learnt_with_the_earlier_ones(shop, learnt):
    """In two steps it is the same as at once, and what is there already counts once."""
    (shop / "MORE.csv").write_text(CUTS + "12000,2.2,chatter\n", encoding="utf-8")
    common = ("--tests", shop / "MORE.csv", *FAST)
    two = answer_of("learn", shop / "L.json", shop / "T.toml", *common, "--out", shop / "two.json")
    one = answer_of("learn", "--modes", shop / "M.toml", shop / "T.toml", *common, "--out", shop / "one.json")
    assert two["labels"] == one["labels"] == 5
    assert any("4 of the labels are in" in w for w in two["warnings"])
    assert two["log_evidence"] == pytest.approx(one["log_evidence"], rel=1e-6)
    assert two["believed"] == one["believed"]


@pytest.mark.slow
def test_next_tests_after_labels(shop, learnt):
    (shop / "AMONG.csv").write_text("spindle_speed_rpm,axial_depth_mm\n8000,0.02\n8000,20\n9000,0.8\n11000,2\n", encoding="utf-8")
    common = (shop / "T.toml", "--next-test", 2, "--among", shop / "AMONG.csv")
    after = answer_of("advise", shop / "L.json", *common)["next_tests"]
    # cuts far inside tell nothing
    assert sorted(t["spindle_speed_rpm"] for t in after) == [9000, 11000]
    assert all(0.02 < t["probability_stable"] < 0.98 for t in after)
    free = answer_of("advise", shop / "L.json", shop / "T.toml", "--next-test", 3, *SPEEDS)["next_tests"]
    assert len({(t["spindle_speed_rpm"], t["axial_depth_mm"]) for t in free}) == 3
    assert all(8000 <= t["spindle_speed_rpm"] <= 12000 and t["axial_depth_mm"] <= 4 for t in free)
    assert "next tests" in run("advise", shop / "L.json", *common).stdout


@pytest.mark.slow
def test_advice_on_a_learnt_tip(shop, learnt):
    found = answer_of("advise", shop / "L.json", shop / "T.toml", "--feed-per-tooth-mm", 0.1, *SPEEDS, "--cut", "11000:1")
    (told_,) = found["toolings"]
    assert told_["stickout_mm"] is None
    best = told_["highest_removal"][0]
    assert 0.0 < best["axial_depth_mm"] < 4.0
    assert 0.3 < told_["planned"][0]["probability"] <= 1.0


def test_an_identification_that_hardly_knows_the_tip_is_refused(shop, result_file):
    """The machine made by hand is known to more than its own size."""
    common = ("--tests", shop / "C.csv", "--out", shop / "R.json", *FAST)
    found = run("learn", result_file, result_file.parent / "T1.toml", *common, code=2)
    assert "result: found a tip that is known to" in found.stderr


@pytest.mark.slow
def test_from_tap_tests(shop):
    """With the spreads that the remark names."""
    frequency = np.arange(200.0, 2000.0, 2.0)
    for axis, f, z, k in (("x", 700.0, 0.03, 8e6), ("y", 800.0, 0.035, 6e6)):
        r = frequency / f
        h = 1.0 / k / (1.0 - r**2 + 2j * z * r)
        lines = "".join(f"{a:.3f}\t{1e6 * v.real:.9e}\t{1e6 * v.imag:.9e}\n" for a, v in zip(frequency, h, strict=True))
        (shop / f"{axis}.frf").write_text("Freq [Hz]\tReal [um/N]\tImag\n" + lines, encoding="utf-8")
    tap = ("--frf", f"X={shop}/x.frf", "--frf", f"Y={shop}/y.frf", shop / "T.toml", "--ktc-mpa", 900, "--krc", 0.3)
    tapped = answer_of("learn", *tap, "--tests", shop / "C.csv", "--out", shop / "F.json", *FAST)
    assert any("natural frequencies are taken to be known to 2 %" in w for w in tapped["warnings"])
    assert sorted(round(m["natural_frequency_hz"]["before"][0]) for m in tapped["believed"]["modes"]) == [700, 800]
    assert tapped["believed"]["modes"][0]["damping_ratio"]["before"][1] == pytest.approx(
        0.2 * tapped["believed"]["modes"][0]["damping_ratio"]["before"][0], rel=1e-3
    )


@pytest.mark.slow
def test_contradicting_labels_are_named_and_learnt_all_the_same(shop):
    (shop / "C.csv").write_text(HEADER + "8000,0.9,stable\n8000,0.6,chatter\n", encoding="utf-8")
    found = answer_of("learn", shop / "M.toml", shop / "T.toml", "--tests", shop / "C.csv", "--out", shop / "L.json", *FAST, code=3)
    assert found["status"] == json.loads((shop / "L.json").read_text(encoding="utf-8"))["status"] == "suspect"
    beside = "the labels contradict each other, or that depth is an island"
    assert f"at 8000 rev/min a cut of 0.9 mm was stable and one of 0.6 mm chattered: {beside}" in found["warnings"]


@pytest.mark.parametrize(
    ("name", "old", "new", "words"),
    [
        (
            "M.toml",
            "natural_frequency_sd_hz = 50\n",
            "",
            "x[0].natural_frequency_sd_hz: found nothing, allowed is the value's standard deviation",
        ),
        ("M.toml", "radial_sd_mpa = 50\n", "", "coefficients.radial_sd_mpa: found nothing"),
        (
            "M.toml",
            "stiffness_sd_n_per_m",
            "modal_mass_sd_kg",
            "x[0].modal_mass_sd_kg: found the standard deviation of a value that is not given",
        ),
        ("M.toml", "damping_ratio_sd = 0.01", "damping_ratio_sd = -0.01", "x[0].damping_ratio_sd: found -0.01"),
        ("M.toml", MODES[MODES.index("[coefficients]") :], "", "--ktc-mpa: found nothing"),
        ("C.csv", "8000,0.4", "8000,-0.4", "line 2: column axial_depth_mm: found -0.4, allowed is a finite number above 0 [mm]"),
        ("C.csv", "0.4,stable", "0.4,fine", "column verdict: found fine"),
        ("T.toml", "teeth = 2", "", "cutter.teeth"),
    ],
)
def test_bad_input_is_one_sentence(shop, name, old, new, words):
    text = (shop / name).read_text(encoding="utf-8")
    assert old in text
    (shop / name).write_text(text.replace(old, new, 1), encoding="utf-8")
    found = run("learn", shop / "M.toml", shop / "T.toml", "--tests", shop / "C.csv", "--out", shop / "L.json", *FAST, code=2)
    assert words in found.stderr
    assert not (shop / "L.json").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            ("learn", "T.toml", "--tests", "C.csv", "--out", "L.json"),
            "files: found 1 file, allowed is RESULT.json, MODES.toml or LEARNT.json",
        ),
        (("lobes", "--modes", "M.toml", "T.toml", "--out", "L.csv", "--tests-out", "P.csv"), "--tests-out: found"),
        (("advise", "--modes", "M.toml", "T.toml", "--among", "C.csv"), "--among: found"),
    ],
)
def test_options_that_belong_together(shop, arguments, words):
    placed = [shop / a if a.endswith((".toml", ".csv", ".json")) else a for a in arguments]
    assert words in run(*placed, code=2).stderr


def test_a_tooling_of_its_cutter_alone(shop):
    """Lobes of modes that tell their coefficients, and a sentence where a machine is asked."""
    found = answer_of("lobes", "--modes", shop / "M.toml", shop / "T.toml", "--out", shop / "L.csv", *SPEEDS)
    whole = answer_of(
        "lobes", "--modes", shop / "M.toml", shop / "T.toml", "--ktc-mpa", 900, "--krc", 0.3, "--out", shop / "L.csv", *SPEEDS
    )
    assert found["best_speeds"] == whole["best_speeds"]
    card = run(
        "advise", "--modes", shop / "M.toml", shop / "T.toml", "--feed-per-tooth-mm", 0.1, *SPEEDS, "--card", shop / "C.html", code=2
    )
    assert "tables [tool] and [holder], too" in card.stderr
    bad = CUTTER.replace("12", "0.001")
    (shop / "T.toml").write_text(bad, encoding="utf-8")
    assert "diameter_mm" in run("lobes", "--modes", shop / "M.toml", shop / "T.toml", "--out", shop / "L.csv", code=2).stderr


def test_a_machine_takes_no_cutter_alone(shop, result_file):
    found = run("lobes", result_file, shop / "T.toml", "--out", shop / "L.csv", code=2)
    assert "tool: found nothing" in found.stderr
