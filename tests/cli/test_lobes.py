"""lobes, advise and export as a user meets them."""

from __future__ import annotations

import csv
import hashlib
import json
import re
from base64 import b64decode
from html import unescape

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from rcsa_ident.base.errors import InputError
from rcsa_ident.cli import advice, cases, export, lobes
from rcsa_ident.cli.conditions import immersion_of
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.io.curves.frf_files import Source, read_tap_tests
from rcsa_ident.io.curves.tips import read_lobes_csv, write_frf_csv
from rcsa_ident.io.results.identifications import machine_from_json
from rcsa_ident.io.results.parts import read_result
from tests.fixtures import by_hand
from tests.fixtures.paths import SHARED

APP = typer.Typer(pretty_exceptions_enable=False)
APP.command("lobes")(lobes.lobes)
APP.command("advise")(advice.advise)
APP.command("export")(export.export)
APP.command("cases")(cases.cases)
KNOWN = ("--ktc-mpa", 900, "--krc", 0.3)
FEED = ("--feed-per-tooth-mm", 0.1)


def run(*arguments, code=0):
    result = CliRunner().invoke(APP, [str(a) for a in arguments])
    assert result.exit_code == code, result.output + repr(result.exception)
    return result


def answer_of(*arguments):
    return json.loads(run(*arguments, "--json").stdout.splitlines()[-1])


@pytest.fixture
def shop(tmp_path):
    """MODES.toml of a symmetric two-tooth mill, its tooling, and the same dynamics as tap tests."""
    mode = "natural_frequency_hz = {}\ndamping_ratio = {}\nstiffness_n_per_m = {}\n"
    (tmp_path / "M.toml").write_text(f"[[x]]\n{mode.format(700, 0.03, 8e6)}[[y]]\n{mode.format(800, 0.035, 6e6)}", encoding="utf-8")
    (tmp_path / "T.toml").write_text(by_hand.TOOLING.replace("teeth = 4", "teeth = 2"), encoding="utf-8")
    frequency = np.arange(0.0, 4000.0, 1.0)
    for axis, f, z, k in (("x", 700.0, 0.03, 8e6), ("y", 800.0, 0.035, 6e6)):
        r = frequency / f
        h = 1.0 / k / (1.0 - r**2 + 2j * z * r)
        rows = "".join(f"{a:.3f}\t{1e6 * v.real:.12e}\t{1e6 * v.imag:.12e}\n" for a, v in zip(frequency, h, strict=True))
        (tmp_path / f"{axis}.frf").write_text("Freq [Hz]\tReal [um/N]\tImag\n" + rows, encoding="utf-8")
    return tmp_path


SPEEDS = ("--speed-from", 6000, "--speed-to", 16000, "--speed-step", 1000)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["zero-order", "multi-frequency", "semi-discretisation", "full-discretisation", "time-domain"])
def test_every_method_from_modes_and_from_tap_tests(shop, method):
    """Modes that a method fits to the receptance give the lobes of the modes that were given."""
    common = (shop / "T.toml", *KNOWN, "--speed-from", 9000, "--speed-to", 13000, "--speed-step", 2000, "--method", method)
    one = answer_of("lobes", "--modes", shop / "M.toml", *common, "--out", shop / "a.csv")
    two = answer_of("lobes", "--frf", f"X={shop}/x.frf", "--frf", f"Y={shop}/y.frf", *common, "--out", shop / "b.csv")
    assert one["method"] == two["method"] == method
    a, b = read_lobes_csv(shop / "a.csv"), read_lobes_csv(shop / "b.csv")
    np.testing.assert_allclose(a.limit, b.limit, rtol=1e-3 if method == "zero-order" else 1e-2)
    assert any("replaced by a fit with" in w for w in two["warnings"]) == (method not in ("zero-order", "multi-frequency"))
    assert (shop / "a.csv").read_text(encoding="utf-8").splitlines()[0].endswith(",lobe,recommended_depth_mm,flip")


@pytest.mark.slow
def test_a_map_knows_islands_that_the_first_limit_does_not(tmp_path):
    """The helical mill at low immersion: closed islands of period doubling under and above the lobes."""
    (tmp_path / "M.toml").write_text(
        "[[x]]\nnatural_frequency_hz = 922.0\ndamping_ratio = 0.011\nmodal_mass_kg = 0.03993\n", encoding="utf-8"
    )
    text = by_hand.TOOLING.replace("teeth = 4", "teeth = 2\nhelix_deg = 30.0")
    (tmp_path / "T.toml").write_text(text, encoding="utf-8")
    told = answer_of(
        *("lobes", "--modes", tmp_path / "M.toml", tmp_path / "T.toml", "--ktc-mpa", 600, "--krc", 1 / 3, "--immersion", 0.05),
        *("--strategy", "up", "--method", "full-discretisation", "--speed-from", 11500, "--speed-to", 13500, "--speed-step", 50),
        *("--max-depth-mm", 16, "--out", tmp_path / "L.csv", "--map", tmp_path / "M.csv", "--plot", tmp_path / "L.png"),
    )
    rows = np.loadtxt(tmp_path / "M.csv", delimiter=",", skiprows=1)
    assert rows.shape == (41 * 100, 4)
    assert told["map"]["multipliers"] < 2000
    at = rows[rows[:, 0] == 12150.0]
    np.testing.assert_array_equal(at[:, 3], at[:, 2] < 0.0)
    # stable, an island, stable again, then the lobe
    assert np.count_nonzero(np.diff(at[:, 3])) == 3
    limit = read_lobes_csv(tmp_path / "L.csv").limit[read_lobes_csv(tmp_path / "L.csv").speed == 12150.0]
    assert at[at[:, 3] == 0.0, 1].min() - 0.16 <= limit[0] <= at[at[:, 3] == 0.0, 1].min()
    assert (tmp_path / "L.png").stat().st_size > 10_000


@pytest.mark.slow
def test_tested_cuts_are_counted_at_their_own_speeds(shop):
    speed = 10013.0
    run("lobes", "--modes", shop / "M.toml", shop / "T.toml", *KNOWN, "--speed-from", speed, "--speed-to", speed, "--out", shop / "one.csv")
    limit = read_lobes_csv(shop / "one.csv").limit[0]
    rows = [(0.9, "stable"), (0.99, "chatter"), (1.01, "chatter"), (1.2, "stable"), (1.3, "marginal"), (20.0 / limit, "chatter")]
    text = "spindle_speed_rpm,axial_depth_mm,verdict\n" + "".join(f"{speed},{share * limit},{verdict}\n" for share, verdict in rows)
    (shop / "CUTS.csv").write_text(text, encoding="utf-8")
    out = ("--out", shop / "L.csv", "--tests", shop / "CUTS.csv", "--plot", shop / "L.svg")
    answer = answer_of("lobes", "--modes", shop / "M.toml", shop / "T.toml", *KNOWN, *SPEEDS, *out)
    assert answer["tested"] == {
        "stable_stable": 1, "stable_chatter": 1, "chatter_stable": 1, "chatter_chatter": 2, "stable_marginal": 0, "chatter_marginal": 1,
        "share_right": 0.6,
    }  # fmt: skip
    drawing = (shop / "L.svg").read_text(encoding="utf-8")
    for words in (
        "tested: chatter",
        "tested: marginal",
        "3 of 5 tested cuts classified correctly (1 unexpected chatter, 1 stable above the limit)",
    ):
        assert words in drawing
    table = run("lobes", "--modes", shop / "M.toml", shop / "T.toml", *KNOWN, *SPEEDS, *out).stdout
    assert "classified correctly: 3 of 5, 60.0 %" in table


def test_surface_error_stands_beside_the_lobes(shop):
    common = ("lobes", "--modes", shop / "M.toml", shop / "T.toml", *KNOWN, *SPEEDS, "--out", shop / "L.csv", "--surface-depth-mm", 0.5)
    assert "--feed-per-tooth-mm" in run(*common, code=2).stderr
    run(*common, *FEED)
    once = read_lobes_csv(shop / "L.csv").extra
    run(*common, "--feed-per-tooth-mm", 0.2)
    twice = read_lobes_csv(shop / "L.csv").extra
    assert np.all(np.abs(once["surface_error_um"]) > 0.0)
    np.testing.assert_allclose(twice["surface_error_mean_um"], 2.0 * once["surface_error_mean_um"], rtol=1e-9)


@pytest.mark.slow
def test_process_options_reach_the_method(shop):
    """A worn flank raises limits at low speed, run-out and a swinging speed change them."""
    common = ("lobes", "--modes", shop / "M.toml", shop / "T.toml", *KNOWN, "--method", "full-discretisation", "--max-depth-mm", 50)
    slow = ("--speed-from", 1500, "--speed-to", 2100, "--speed-step", 300)
    limits = {}
    for name, more in {
        "plain": (),
        "worn": ("--wear-land-um", 80, "--indentation", 1e14),
        "swing": ("--speed-variation", "0.1:0.2"),
        "runout": ("--runout-um", "40,-40", "--feed-per-tooth-mm", 0.02),
    }.items():
        run(*common, *slow, "--out", shop / "L.csv", *more)
        limits[name] = np.nan_to_num(read_lobes_csv(shop / "L.csv").limit, nan=50.0)
    assert np.all(limits["worn"] > 1.2 * limits["plain"])
    assert np.max(np.abs(limits["swing"] / limits["plain"] - 1.0)) > 0.05
    assert np.max(np.abs(limits["runout"] / limits["plain"] - 1.0)) > 0.05


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("--wear-land-um", 80), "--indentation: found nothing"),
        (("--indentation", 1e14), "--wear-land-um: found nothing"),
        (("--speed-variation", "0.1"), "AMPLITUDE:RATIO"),
        (("--speed-variation", "a:b"), "--speed-variation"),
        (("--speed-variation", "2:1"), "amplitude"),
        (("--runout-um", "1,2,3"), "found 3 numbers, allowed is 2"),
        (("--plot", "{}/a.pdf"), "found suffix '.pdf'"),
        (("--plot", "{}/none/a.png"), "existing folder"),
        (("--tests", "{}/none.csv"), "found no such file"),
        (("--method", "full-discretisation", "--material", "butter"), "material: found butter"),
        (("--frf", "x.frf"), "--modes and --frf"),
        (("--frf-units", "um/N"), "given together with --frf"),
        (("--frf-from-hz", "50"), "given together with --frf"),
        (("--frf-correction", "reverse"), "given together with --frf"),
        (("--feed-per-tooth-mm", 0), "--feed-per-tooth-mm"),
        (("--kac", 30), "--kac: found 30"),
        (("--stock", "block"), "--y-from-mm and --y-to-mm: found nothing"),
        (("--y-from-mm", 1), "--y-from-mm and --y-to-mm: found one of them"),
        (("--y-from-mm", 2, "--y-to-mm", 1), "--y-to-mm: found 1"),
        (("--y-from-mm", 7, "--y-to-mm", 9), "--y-from-mm: found block from y 7 to 9 mm"),
        (("--y-from-mm", 1, "--y-to-mm", 2, "--entry-deg", 90, "--exit-deg", 180), "--entry-deg: found given beside --y-from-mm"),
        (("--stock", "stepover", "--y-from-mm", 1, "--y-to-mm", 2), "--y-from-mm: found given beside --stock stepover"),
        (("--engagement", "{}/none.csv"), "found no such file"),
        (("--lead-deg", 5), "given together with --engagement"),
    ],
)
def test_bad_options_are_one_sentence(shop, more, words):
    base = ("lobes", "--modes", shop / "M.toml", shop / "T.toml", *KNOWN, *SPEEDS, "--out", shop / "L.csv")
    result = run(*base, *(str(m).format(shop) for m in more), code=2)
    assert words in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
    assert not (shop / "L.csv").exists()


def test_what_stands_around_a_cylinder_is_its_engagement(shop):
    """Half-immersion down-milling by immersion, by a block's sides and by a stepover; an axial ratio does not move a tip without Z."""
    base = ("lobes", "--modes", shop / "M.toml", shop / "T.toml", *KNOWN, *SPEEDS, "--out", shop / "L.csv")
    run(*base)
    plain = read_lobes_csv(shop / "L.csv").limit
    for more in (("--stock", "block", "--y-from-mm", -6, "--y-to-mm", 0), ("--y-from-mm", -20, "--y-to-mm", 0), ("--stock", "stepover")):
        run(*base, *more)
        np.testing.assert_allclose(read_lobes_csv(shop / "L.csv").limit, plain, rtol=1e-9)


def test_without_coefficients_nothing_is_known(shop):
    base = ("lobes", "--modes", shop / "M.toml", shop / "T.toml", *SPEEDS, "--out", shop / "L.csv")
    assert "--ktc-mpa" in run(*base, code=2).stderr
    assert "--krc" in run(*base, "--ktc-mpa", 900, code=2).stderr
    run(*base, "--material", "EN AW-6082", "--krc", 0.3)
    named = read_lobes_csv(shop / "L.csv").limit
    run(*base, "--ktc-mpa", 902, "--krc", 0.3)
    np.testing.assert_allclose(named, read_lobes_csv(shop / "L.csv").limit)


def test_units_and_records_of_tap_tests(shop):
    base = ("lobes", shop / "T.toml", *KNOWN, *SPEEDS, "--out", shop / "L.csv")
    run(*base, "--frf", f"X={shop}/x.frf", "--frf", f"Y={shop}/y.frf")
    named = read_lobes_csv(shop / "L.csv").limit
    run(*base, "--frf", f"X={shop}/x.frf", "--frf", f"Y={shop}/y.frf", "--frf-units", "nm/N")
    softer = read_lobes_csv(shop / "L.csv").limit
    assert np.all(np.isnan(softer))
    assert "names no axis" in run(*base, "--frf", shop / "x.frf", code=2).stderr
    assert "--frf-from-hz" in run(*base, "--frf", f"X={shop}/x.frf", "--frf-from-hz", 1e6, code=2).stderr
    tests = read_tap_tests([Source(shop / f"{a}.frf", (a.upper(), a.upper())) for a in "xy"])
    curves = {axis: values for (axis, _), (_, values) in tests.items()}
    write_frf_csv(shop / "F.csv", tests["X", "X"][0], curves)
    run(*base, "--frf", shop / "F.csv")
    np.testing.assert_allclose(read_lobes_csv(shop / "L.csv").limit, named)
    assert "record 4" in run(*base, "--frf", f"X={shop}/F.csv#4", code=2).stderr


@pytest.mark.slow
def test_advice_from_modes(shop):
    tip = ("--modes", shop / "M.toml", shop / "T.toml")
    common = ("advise", *tip, *KNOWN, *FEED, "--speed-from", 6000, "--speed-to", 24000, "--max-depth-mm", 15)
    more = ("--depth-mm", 2, "--cut", "20000:2", "--cut", "9000:4", "--out", shop / "A.csv", "--plot", shop / "A.png")
    (tooling,) = answer_of(*common, *more)["toolings"]
    with (shop / "A.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    speed, usable, rate = (
        np.array([float(r[n]) for r in rows]) for n in ("spindle_speed_rpm", "usable_depth_mm", "removal_rate_cm3_per_min")
    )
    best = tooling["highest_removal"][0]
    # computed anew by a method that fits the cut
    assert tooling["recommended_by"] == "full-discretisation"
    assert best["removal_rate_cm3_per_min"] == pytest.approx(rate.max(), rel=0.2)
    # half immersion: a_e 6 mm, two teeth, 0.1 mm
    np.testing.assert_allclose(rate, usable * 6.0 * 0.2 * speed / 1000.0, rtol=1e-9)
    assert best["power_kw"] == pytest.approx(900e6 * best["removal_rate_cm3_per_min"] / 6e7 / 1e3)
    for window in tooling["windows"]:
        inside = (speed > window["from_rpm"]) & (speed < window["to_rpm"])
        assert np.all(usable[inside] >= 2.0)
    fast, slow = tooling["planned"]
    assert slow["stable"] == (slow["limit_depth_mm"] >= 4.0)
    assert fast["probability"] is None
    assert (shop / "A.png").stat().st_size > 10_000
    # what the spindle lacks, and a reserve, only ever take away
    (weak,) = answer_of(*common, "--max-power-kw", 0.5, "--max-speed-rpm", 20000, "--out", shop / "B.csv")["toolings"]
    assert weak["highest_removal"][0]["power_kw"] <= 0.5 * (1.0 + 1e-9)
    assert weak["highest_removal"][0]["spindle_speed_rpm"] <= 20000.0
    assert weak["highest_removal"][0]["bound"] == "power"
    assert "highest removal rate" in run(*common, "--depth-mm", 40, "--max-depth-mm", 50).stdout


@pytest.mark.slow
def test_a_card_says_what_the_answer_says(result_file, tmp_path):
    """The recommended cuts of every tooling, with drawing, conditions, warnings and what they were computed from."""
    tool = tmp_path / "A & B.toml"
    tool.write_text((result_file.parent / "T1.toml").read_text(encoding="utf-8"), encoding="utf-8")
    asked = ("advise", result_file, tool, *FEED, "--immersion", "20%", "--speed-from", 8000, "--speed-to", 12000, "--reserve", 15)
    answer = answer_of(*asked, "--stickout-mm", "60,70", "--card", tmp_path / "C.html")
    assert answer["card"] == str(tmp_path / "C.html")
    text = unescape((tmp_path / "C.html").read_text(encoding="utf-8")).replace("\u202f", "")
    cards = text.split("<article>")[1:]
    assert len(cards) == len(answer["toolings"]) == 2
    for card, told, stickout in zip(cards, answer["toolings"], ("60 mm", "70 mm"), strict=True):
        rows = [re.findall(r"<td>(.*?)</td>", row) for row in re.findall(r"<tr><td>.*?</tr>", card, flags=re.DOTALL)]
        assert [[float(cell) for cell in row[:2]] for row in rows] == [
            [round(cut["spindle_speed_rpm"]), round(cut["recommended_depth_mm"], 2)] for cut in told["highest_removal"]
        ]
        # four teeth
        assert float(rows[0][3]) == round(0.4 * told["highest_removal"][0]["spindle_speed_rpm"])
        svg = b64decode(re.search(r"data:image/svg\+xml;base64,([^\"]+)", card)[1]).decode()
        assert told["tooling"] in unescape(svg)
        assert all(warning in card for warning in answer["warnings"])
        digest = hashlib.sha256(tool.read_bytes()).hexdigest()[:12]
        for words in ("stays 15 % below", "20 %, 2.4 mm wide", "down milling", f"A & B.toml {digest}", stickout, "8000 to 12000 rev/min"):
            assert words in card
    assert "<script" not in text
    assert "written" in run(*asked, "--card", tmp_path / "C.html").stdout
    assert "no/C.html" in run(*asked, "--card", tmp_path / "no" / "C.html", code=2).stderr


@pytest.mark.slow
def test_advice_compares_stickouts_and_toolings(result_file, tmp_path):
    tool = result_file.parent / "T1.toml"
    base = (*FEED, "--speed-from", 8000, "--speed-to", 16000, "--speed-step", 100)
    answer = answer_of(
        "advise", result_file, tool, *base, "--stickout-mm", "50,60,75", "--plot", tmp_path / "S.png", "--out", tmp_path / "S.csv"
    )
    assert [t["stickout_mm"] for t in answer["toolings"]] == pytest.approx([50.0, 60.0, 75.0])
    same = answer_of("advise", result_file, tool, *base)["toolings"][0]
    assert same["lowest_limit_mm"] == pytest.approx(answer["toolings"][1]["lowest_limit_mm"])
    assert same["common_stable_depth_mm"] <= same["lowest_limit_mm"]
    header = (tmp_path / "S.csv").read_text(encoding="utf-8").splitlines()[0]
    assert "usable_depth_mm_3" in header
    assert "common_depth_mm_1" in header
    other = tmp_path / "T2.toml"
    other.write_text(tool.read_text(encoding="utf-8").replace('name = "T1"', 'name = "T2"'), encoding="utf-8")
    two = answer_of("advise", result_file, tool, other, *base)
    assert [t["tooling"] for t in two["toolings"]] == ["T1", "T2"]
    assert "comparison" in run("advise", result_file, tool, other, *base).stdout


@pytest.mark.slow
def test_probability_counts_the_machines_of_the_posterior(result_file):
    tool = result_file.parent / "T1.toml"
    base = (*FEED, "--speed-from", 11000, "--speed-to", 12000, "--speed-step", 100, "--tolerance", 0, "--reserve", 0)
    (likely,) = answer_of("advise", result_file, tool, *base, "--probability", 50)["toolings"]
    (sure,) = answer_of("advise", result_file, tool, *base, "--probability", 100)["toolings"]
    assert sure["highest_removal"][0]["axial_depth_mm"] < likely["highest_removal"][0]["axial_depth_mm"]
    depth = likely["lowest_limit_mm"]
    cuts = [
        answer_of("advise", result_file, tool, *base, "--cut", f"11500:{share * depth}")["toolings"][0]["planned"][0]
        for share in (0.05, 6.0)
    ]
    assert cuts[0]["probability"] == 1.0
    assert cuts[1]["probability"] == 0.0


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ((), "--feed-per-tooth-mm: found nothing"),
        ((*FEED, "--cut", "12000"), "RPM:MM"),
        ((*FEED, "--cut", "12000:-1"), "RPM:MM"),
        ((*FEED, "--cut", "12000:99"), "--max-depth-mm"),
        ((*FEED, "--tolerance", 30), "--tolerance"),
        ((*FEED, "--probability", 0), "--probability"),
        ((*FEED, "--reserve", 95), "--reserve"),
        ((*FEED, "--max-power-kw", 0), "--max-power-kw"),
        ((*FEED, "--spindle", "{}/none.csv"), "none.csv: spindle: found no such file"),
        ((*FEED, "--stickout-mm", "50,60"), "--stickout-mm"),
    ],
)
def test_bad_questions_are_one_sentence(shop, more, words):
    result = run("advise", "--modes", shop / "M.toml", shop / "T.toml", *KNOWN, *SPEEDS, *(str(m).format(shop) for m in more), code=2)
    assert words in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1


def test_a_stickout_that_nothing_holds(result_file):
    assert "at most 88 mm" in run("advise", result_file, result_file.parent / "T1.toml", *FEED, "--stickout-mm", "95", code=2).stderr


@pytest.mark.slow
@pytest.mark.parametrize("form", ["uff", "uff-binary", "csv"])
def test_an_exported_tip_gives_the_lobes_of_the_result(result_file, tmp_path, form):
    tool, file = result_file.parent / "T1.toml", tmp_path / f"tip.{'csv' if form == 'csv' else 'uff'}"
    run("export", result_file, "--to", form, "--tooling", tool, "--out", file, "--from-hz", 100)
    speeds = ("--speed-from", 6000, "--speed-to", 12000, "--speed-step", 500)
    run("lobes", result_file, tool, "--out", tmp_path / "a.csv", *speeds, "--no-bands")
    run("lobes", "--frf", file, tool, "--out", tmp_path / "b.csv", *speeds, "--ktc-mpa", 902, "--krc", 0.26)
    a, b = (read_lobes_csv(tmp_path / f"{n}.csv") for n in "ab")
    np.testing.assert_allclose(a.limit, b.limit, rtol=1e-6)


def test_export_of_flange_and_modes(result_file, tmp_path):
    for form, name in (("json", "f.json"), ("hdf5", "f.h5"), ("uff", "f.uff")):
        run("export", result_file, "--to", form, "--out", tmp_path / name)
    data = json.loads((tmp_path / "f.json").read_text(encoding="utf-8"))
    assert {"X", "X_tM", "X_rF", "X_rM", "Y"} <= set(data["receptances"])
    run("export", result_file, "--to", "csv", "--what", "modes", "--out", tmp_path / "m.csv")
    rows = list(csv.DictReader((tmp_path / "m.csv").read_text(encoding="utf-8").splitlines()))
    machine = machine_from_json(read_result(result_file), "").identified
    assert float(rows[0]["natural_frequency_hz"]) == pytest.approx(machine[Dof.X].spindle.modes.omega_n[0] / (2.0 * np.pi))
    for more, words in (
        (("--to", "uff", "--what", "modes"), "csv or json for modes"),
        (("--what", "tip"), "--tooling: found nothing"),
        (("--what", "flange", "--tooling", result_file.parent / "T1.toml"), "--tooling"),
        (("--to-hz", 100), "--to-hz"),
    ):
        assert words in run("export", result_file, "--out", tmp_path / "n.uff", *more, code=2).stderr
        assert not (tmp_path / "n.uff").exists()


def test_the_face_mill_of_the_shared_files(tmp_path):
    if not (SHARED / "facemill_x.frf").exists():
        pytest.skip("the face mill's FRFs are not beside the project")
    tooling = tmp_path / "T.toml"
    tooling.write_text(by_hand.TOOLING.replace("teeth = 4", "teeth = 2").replace("12.0", "31.75"), encoding="utf-8")
    frf = ("--frf", f"X={SHARED}/facemill_x.frf", "--frf", f"Y={SHARED}/facemill_y.frf")
    answer = answer_of("lobes", *frf, tooling, "--out", tmp_path / "L.csv", "--ktc-mpa", 1319.4, "--krc", 788.8 / 1319.4)
    assert answer["absolute_limit_mm"] == pytest.approx(1.015, abs=1e-3)
    assert answer["absolute_frequency_hz"] == pytest.approx(1441.0, abs=1.0)


@pytest.mark.slow
def test_cases_in_process_and_at_standstill(result_file, tmp_path):
    """Cuts at 0.9 and 1.1 of the machine's own limit are classified correctly by it, and not by tap tests of a machine twice as soft."""
    folder, speeds = result_file.parent, ("--speed-from", 9000, "--speed-to", 15000, "--speed-step", 500)
    run(
        "lobes", result_file, folder / "T1.toml", *speeds, "--no-bands", "--immersion", 0.7, "--strategy", "up", "--out", tmp_path / "L.csv"
    )
    known = read_lobes_csv(tmp_path / "L.csv")
    rows = [
        (s, share * d, v) for s, d in zip(known.speed[:4], known.limit[:4], strict=True) for share, v in ((0.9, "stable"), (1.1, "chatter"))
    ]
    lines = "".join(f"{s},{d},{v},Bo\n" for s, d, v in rows)
    (folder / "CUTS.csv").write_text("spindle_speed_rpm,axial_depth_mm,verdict,operator\n" + lines, encoding="utf-8")
    run("export", result_file, "--to", "csv", "--tooling", folder / "T1.toml", "--out", tmp_path / "tip.csv", "--from-hz", 100)
    found = read_tap_tests([Source(tmp_path / "tip.csv")])
    write_frf_csv(folder / "idle.csv", found["X", "X"][0], {axis: 2.0 * values for (axis, _), (_, values) in found.items()})
    case = 'tooling = "T1.toml"\nradial_depth_mm = 8.4\nstrategy = "up"\ntests = "CUTS.csv"\n'
    (folder / "CASES.toml").write_text(f'[[cases]]\n{case}[[cases]]\nname = "idle, too"\n{case}idle = ["idle.csv"]\n', encoding="utf-8")
    common = ("cases", result_file, folder / "CASES.toml", *speeds, "--plot", tmp_path / "C.svg")
    answer = answer_of(*common)
    plain, both = answer["cases"]
    # nothing is dropped in silence
    assert sum(warning.endswith("CUTS.csv: the column operator is left aside") for warning in answer["warnings"]) == 1
    tested = ("--tests", folder / "CUTS.csv", "--immersion", 0.7, "--strategy", "up", "--no-bands")
    answer = answer_of("lobes", result_file, folder / "T1.toml", *speeds, *tested, "--out", tmp_path / "L.csv")
    assert sum("the column operator is left aside" in warning for warning in answer["warnings"]) == 1
    assert plain["tested"]["share_right"] == both["tested"]["share_right"] == 1.0
    assert "tested_idle" not in plain
    assert both["tested_idle"]["chatter_stable"] == 4
    assert "from tap tests" in (tmp_path / "C.svg").read_text(encoding="utf-8")
    assert "8 of 8" in run(*common).stdout


def test_a_face_mill_of_unequal_pitch_is_told_as_both(shop):
    """Zero-order limits recommend nothing, the cuts come from the method that they name; the shape is said by every command."""
    keys = 'teeth = 2\npitch_deg = [170, 190]\nshape = "face"'
    (shop / "B.toml").write_text(by_hand.TOOLING.replace("teeth = 4", keys), encoding="utf-8")
    tip, said = ("--modes", shop / "M.toml", shop / "B.toml", *KNOWN, *SPEEDS), "full-discretisation takes unlike teeth"
    shape = "computed as a cylinder: the cutter's shape is face; cutting_edge_angle_deg and cutting_depth_mm are not told"
    found = answer_of("lobes", *tip, "--out", shop / "L.csv")
    assert [sum(words in warning for warning in found["warnings"]) for words in (said, shape)] == [1, 1]
    assert said in found["withheld"]
    assert found["recommended_by"] == "full-discretisation"
    assert 0.0 < found["recommended"][0]["recommended_depth_mm"] < found["recommended"][0]["limit_depth_mm"]
    assert np.isnan(read_lobes_csv(shop / "L.csv").extra["recommended_depth_mm"]).all()
    (told,) = answer_of("advise", *tip, *FEED, "--depth-mm", 0.1, "--plot", shop / "A.png", "--out", shop / "A.csv")["toolings"]
    assert [told["windows"], said in told["withheld"], told["recommended_by"]] == [[], True, "full-discretisation"]
    text = " ".join(run("lobes", *tip, "--plot", shop / "L.png", "--out", shop / "L.csv").output.split())
    assert said in text
    assert shape in text
    right = answer_of("lobes", *tip, "--method", "full-discretisation", "--out", shop / "L.csv")
    assert right["withheld"] is None
    assert right["recommended"][0]["recommended_depth_mm"] > 0.0
    assert any(warning.startswith(shape) for warning in right["warnings"])


@pytest.mark.parametrize(("text", "share"), [("50%", 0.5), ("0.5", 0.5), (" 25 % ", 0.25), ("1", 1.0), ("100%", 1.0)])
def test_immersion_is_a_share_or_percent(text, share):
    assert immersion_of(text) == share


@pytest.mark.parametrize("text", ["50", "0", "0%", "101%", "half", "-1%", "nan", "%"])
def test_an_immersion_that_is_none_is_refused(text):
    with pytest.raises(InputError, match=r"--immersion.*0\.5 or 50%"):
        immersion_of(text)


def test_half_a_percent_is_asked_about(shop):
    """Both spellings of the same slip; the sentence is that of the service."""
    for immersion in ("0.5%", "0.005"):
        found = answer_of(
            "lobes", "--modes", shop / "M.toml", shop / "T.toml", *KNOWN, *SPEEDS, "--immersion", immersion, "--out", shop / "L.csv"
        )
        assert "radial immersion is 0.5 %, but usual are 1.5 to 100 %: was 50 % meant?" in found["warnings"]
    found = answer_of("lobes", "--modes", shop / "M.toml", shop / "T.toml", *KNOWN, *SPEEDS, "--immersion", "50%", "--out", shop / "L.csv")
    assert not [warning for warning in found["warnings"] if "usual" in warning]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--ktc-mpa", 2.1, "--krc", 0.3), "--ktc-mpa: found 2.1 MPa, allowed is a number at least 30"),
        (("--ktc-mpa", 900, "--krc", 26), "--krc: found 26, allowed is"),
        ((*KNOWN, "--feed-per-tooth-mm", 100), "--feed-per-tooth-mm: found 100 mm"),
        ((*KNOWN, "--kre-n-per-mm", 12000), "--kre-n-per-mm: found 12000 N/mm"),
    ],
)
def test_a_cut_that_is_impossible_is_refused(shop, options, words):
    found = run("lobes", "--modes", shop / "M.toml", shop / "T.toml", *options, *SPEEDS, "--out", shop / "L.csv", code=2)
    assert words in found.stderr
    assert "usual are" in found.stderr


def test_an_unusual_tooling_is_warned_of(shop):
    odd = (shop / "T.toml").read_text(encoding="utf-8").replace("inner_diameter_mm = 12.0", "inner_diameter_mm = 20.0")
    (shop / "T.toml").write_text(odd, encoding="utf-8")
    found = run("lobes", "--modes", shop / "M.toml", shop / "T.toml", *KNOWN, *SPEEDS, "--out", shop / "L.csv")
    assert "warning: holder.segments[0].inner_diameter_mm is 20 mm around a tool that is 12 mm thick there" in found.stderr
