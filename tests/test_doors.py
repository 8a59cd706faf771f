"""Command line, service and report say the same of the same question: one machine, one tooling, one cut."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from typer.testing import CliRunner

from api.client import Client
from rcsa_ident.cli import app
from rcsa_ident.cli.demo import _page
from rcsa_ident.io.curves.tips import read_lobes_csv
from rcsa_ident.io.results.identifications import machine_from_json
from rcsa_ident.io.results.parts import read_result
from rcsa_ident.report.html import report_html
from rcsa_ident.report.summaries import lobes_summary
from tests.api.in_process import embedded, service
from tests.fixtures import by_hand

#: Half-immersion down-milling, 4000 to 20 000 rev/min in steps of 50, 10 mm at most: what every door asks of itself.
FEED = 0.1
CURVES = {
    "limit": "limit_depth_mm",
    "recommended_depth_mm": "recommended_depth_mm",
    "chatter_frequency": "chatter_frequency_hz",
    "lobe": "lobe",
    "flip": "flip",
}

pytestmark = pytest.mark.slow


def run(*arguments):
    result = CliRunner().invoke(app, [str(a) for a in arguments])
    assert result.exit_code == 0, result.output + repr(result.exception)
    return result.stdout


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """RESULT.json, T1.toml, and what the commands wrote of them."""
    folder = tmp_path_factory.mktemp("doors")
    (folder / "RESULT.json").write_text(by_hand.result_text(folder), encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def command(folder):
    """Answers of `lobes` and `advise`."""
    files = (folder / "RESULT.json", folder / "T1.toml")
    lobes = run("lobes", *files, "--out", folder / "LOBES.csv", "--json")
    advice = run("advise", *files, "--feed-per-tooth-mm", FEED, "--cut", "9000:0.3", "--depth-mm", 0.1, "--max-power-kw", 15, "--json")
    return json.loads(lobes), json.loads(advice)


@pytest.fixture(scope="module")
def rest(folder):
    """Answers of `/v1/lobes` and `/v1/advice`, as JSON."""
    store = embedded(folder)
    with service(store, folder) as http:
        client = Client(http=http)
        id = client.make_machine("m").id
        client.identify(id, (folder / "RESULT.json").read_text(encoding="utf-8"))
        client.write_tooling("T1", by_hand.TOOLING)
        question = {"machine": id, "toolings": ["T1"]}
        lobes = http.post("/v1/lobes", json=question).json()
        planned = [{"spindle_speed_rpm": 9000, "axial_depth_mm": 0.3}]
        asked = question | {"cut": {"feed_per_tooth_mm": FEED}, "planned": planned, "depth_mm": 0.1, "max_power_kw": 15}
        advice = http.post("/v1/advice", json=asked).json()
    store.close()
    return lobes["toolings"][0], advice["toolings"][0]


@pytest.fixture(scope="module")
def page(folder):
    """The page of the tooling in the report that `demo` writes."""
    out = folder / "report"
    out.mkdir()
    machine = machine_from_json(read_result(folder / "RESULT.json"), "")
    return _page(machine, frozenset(), folder / "none", out, ("T1", by_hand.tooling()))


def same(one, other, rel=1e-6):
    """Key by key, number by number."""
    if isinstance(one, dict):
        assert set(one) == set(other)
        for key, value in one.items():
            same(value, other[key], rel)
    elif isinstance(one, list):
        assert len(one) == len(other)
        for a, b in zip(one, other, strict=True):
            same(a, b, rel)
    elif isinstance(one, float) and isinstance(other, float):
        assert one == pytest.approx(other, rel=rel)
    else:
        assert one == other


@pytest.mark.witness
def test_limit_recommendation_and_speeds_are_the_same_at_every_door(command, rest, page):
    by_command, by_rest = command[0], rest[0]
    keys = set(lobes_summary(page.advice))
    assert {"best_speeds", "recommended", "absolute_limit_mm"} <= keys
    assert len(by_command["recommended"]) == 3
    for key in keys:
        same(by_command[key], by_rest[key])
        same(lobes_summary(page.advice)[key], by_rest[key])
    assert list(page.warnings) == by_rest["warnings"] == by_command["warnings"]


def test_curves_are_the_same_at_every_door(folder, command, rest, page):
    # a preview, so without a band
    assert rest[0]["limit_depth_low_mm"] is None
    files = [read_lobes_csv(folder / name) for name in ("LOBES.csv", "report/LOBES_T1.csv")]
    for curves in files:
        assert curves.speed.tolist() == rest[0]["spindle_speed_rpm"]
        for own, name in CURVES.items():
            found = getattr(curves, own) if hasattr(curves, own) else curves.extra[own]
            known = np.array(rest[0][name], dtype=float)
            # whether a cut that is stable at any depth would double its period is nobody's question
            known = np.where(np.isnan(found) & (known == 0.0), np.nan, known) if name == "flip" else known
            np.testing.assert_allclose(np.where(np.isinf(found), np.nan, found), known, rtol=1e-6, err_msg=name)


def test_advice_is_the_same_at_every_door(command, rest):
    (by_command,), by_rest = command[1]["toolings"], dict(rest[1])
    assert by_rest.pop("warnings") == command[1]["warnings"]
    same(by_command, by_rest)


def test_advice_and_lobes_recommend_the_same_where_the_spindle_has_enough(command):
    lobes, (advice,) = command[0], command[1]["toolings"]
    names = ("spindle_speed_rpm", "recommended_depth_mm", "limit_depth_mm", "bound", "why", "held_back")
    same(*([{name: point[name] for name in names} for point in cuts] for cuts in (advice["highest_removal"], lobes["recommended"])))
    same(advice["around"], lobes["around"])
    assert {point["bound"] for point in advice["highest_removal"]} == {"chatter"}
    for point in advice["highest_removal"]:
        assert point["axial_depth_mm"] == point["recommended_depth_mm"] < point["limit_depth_mm"]


def test_console_and_report_show_these_numbers(folder, command, page):
    found = by_hand.identification()
    html = re.sub(r"\s+", " ", report_html(found, by_hand.campaign(folder), [], [page], {}, {}))
    table = run("lobes", folder / "RESULT.json", folder / "T1.toml", "--out", folder / "L.csv")
    for words in (html, table):
        assert "recommended" in words
        assert "stability limit" in re.sub(r"\s+", " ", words)
    for cut in command[0]["recommended"]:
        speed, depth, limit = cut["spindle_speed_rpm"], cut["recommended_depth_mm"], cut["limit_depth_mm"]
        assert f"{speed:.0f} rev/min, {depth:.2f} mm ({limit:.2f})" in html
        assert re.search(rf"{speed:.0f}\D+{depth:.2f}\D+{limit:.2f}", table)
