"""Lobes and advice of a tip that was tapped: the service reads and computes as the commands do, and keeps nothing."""

from __future__ import annotations

import math

import numpy as np
import pytest

from api.client import Client
from api.stores.entities import Store
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.io.curves.frf_files import Source, read_frfs, read_tapped_tip
from rcsa_ident.machine.known_tip import KnownTip
from rcsa_ident.setup.cut import CutSpec
from rcsa_ident.setup.tooling import BareCutter
from rcsa_ident.workflows.advise import advise
from rcsa_ident.workflows.tool_change import ToolChange
from tests.api.identifying import carried
from tests.api.in_process import refused
from tests.api.test_listening import text_of_hits
from tests.fixtures import by_hand
from tests.signals.test_tap import receptance

FREQUENCY = np.arange(50.0, 4000.0, 1.0)
SPEEDS = {"from_rpm": 6000, "to_rpm": 9000, "step_rpm": 250}
RPM = np.arange(6000.0, 9001.0, 250.0) * math.pi / 30.0
CUT = {"immersion": 0.5, "ktc_mpa": 700.0, "krc": 0.3, "feed_per_tooth_mm": 0.1}
CUTTER = {"teeth": 2, "diameter_mm": 16.0, "helix_deg": 30.0}


def mode(natural_hz: float, damping: float, stiffness: float) -> np.ndarray:
    """Receptance of one mode [m/N]."""
    ratio = FREQUENCY / natural_hz
    return 1.0 / (stiffness * (1.0 - ratio**2 + 2j * damping * ratio))


ALONG = {"X": mode(900.0, 0.02, 4e6), "Y": mode(1100.0, 0.03, 6e6)}


def columns(values: np.ndarray, unit: str = "um/N") -> str:
    """Text columns as other systems write them [µm/N]."""
    rows = (f"{f:.9g} {h.real * 1e6:.12e} {h.imag * 1e6:.12e}" for f, h in zip(FREQUENCY, values, strict=True))
    return "\n".join([f"Frequency [Hz] Real [{unit}] Imaginary [{unit}]", *rows]) + "\n"


@pytest.fixture
def tip() -> dict[str, object]:
    return {"frf": [{"text": columns(values), "axes": axis} for axis, values in ALONG.items()]}


def by_library(tmp_path, cut: CutSpec) -> ToolChange:
    """The same question, asked of the library."""
    for axis, values in ALONG.items():
        (tmp_path / axis).write_text(columns(values))
    known = KnownTip(read_tapped_tip([Source(tmp_path / axis, (axis, axis)) for axis in ALONG]))
    cutter = Cutter(teeth=2, diameter=16e-3, helix=math.radians(30.0))
    return ToolChange(known, BareCutter("tip", cutter), cut, RPM, 0.01)


def test_a_conjugated_frf_is_turned_and_said(client: Client, tip):
    asked = {"speeds": SPEEDS, "cut": CUT}
    (right,) = client.lobes({**tip, "cutter": CUTTER}, **asked).toolings
    for turn, values in (("auto", np.conj(ALONG["X"])), ("reverse", -ALONG["X"])):
        first = {"text": columns(values), "axes": "X", "correction": turn}
        (found,) = client.lobes({"frf": [first, tip["frf"][1]], "cutter": CUTTER}, **asked).toolings
        assert found.limit_depth_mm == pytest.approx(right.limit_depth_mm, rel=1e-9)
        assert any("FRF X: Im > 0 at 900 Hz" in each for each in found.warnings) == (turn == "auto")
    problem = refused(422, client.lobes, {"frf": [{"text": columns(ALONG["X"]), "correction": "backwards"}], "cutter": CUTTER}, **asked)
    assert "correction" in problem.errors[0].field


def test_lobes_and_advice_are_those_of_the_library(client: Client, tip, tmp_path):
    spec = CutSpec(coefficients={"tangential": 7e8, "radial_ratio": 0.3}, feed_per_tooth=1e-4)
    change = by_library(tmp_path, spec)
    answer = client.lobes({**tip, "cutter": CUTTER}, speeds=SPEEDS, cut=CUT)
    (found,) = answer.toolings
    assert (answer.machine, found.tooling) == ("tip", "tip")
    limits = change.limits()
    np.testing.assert_allclose(np.array(found.limit_depth_mm), 1e3 * limits.limit_depth, rtol=1e-9)
    np.testing.assert_allclose(np.array(found.chatter_frequency_hz), limits.chatter_frequency / (2.0 * math.pi), rtol=1e-8)
    assert found.recommended_by == "full-discretisation"
    (advised,) = client.advice({**tip, "cutter": CUTTER}, speeds=SPEEDS, cut=CUT).toolings
    best, expected = advised.highest_removal[0], advise(change).recommended[0]
    assert best.spindle_speed_rpm == pytest.approx(expected.spindle_speed * 30.0 / math.pi, rel=1e-9)
    assert best.axial_depth_mm == pytest.approx(1e3 * expected.depth, rel=1e-9)


def test_hits_of_a_hammer_become_lobes(client: Client, tmp_path):
    """Of the tooling that was tapped, from the library; nearly those of the receptance that the hits were made of."""
    (tmp_path / "hits.csv").write_bytes(text_of_hits())
    client.write_tooling("T1", by_hand.TOOLING)
    text = client.tap_file(tmp_path / "hits.csv", axis="Y")
    found = client.lobes({"frf": [{"text": text}], "from_hz": 100.0}, "T1", speeds=SPEEDS, cut=CUT, recommend=False).toolings[0]
    frequency = np.arange(100.0, 6000.0, 1.0)
    true = receptance(2.0 * np.pi * frequency)
    rows = "\n".join(f"{f:.9g},{h.real:.12e},{h.imag:.12e}" for f, h in zip(frequency, true, strict=True))
    exact = {"frf": [{"text": f"frequency_hz,Y_re,Y_im\n{rows}\n"}]}
    known = client.lobes(exact, "T1", speeds=SPEEDS, cut=CUT, recommend=False).toolings[0]
    assert (found.tooling, known.tooling) == ("T1", "T1")
    np.testing.assert_allclose(np.array(found.limit_depth_mm, float), np.array(known.limit_depth_mm, float), rtol=0.05)
    assert known.absolute_limit_mm is not None


def test_units_records_and_lowest_lines_are_as_they_are_told(client: Client, tip, tmp_path):
    def limits(**told) -> np.ndarray:
        asked = {**tip, "cutter": CUTTER, **told}
        return np.array(client.lobes(asked, speeds=SPEEDS, cut=CUT, recommend=False).toolings[0].limit_depth_mm)

    plain = limits()
    # whatever the texts say
    wrong = [{**each, "text": each["text"].replace("um/N", "um/kN")} for each in tip["frf"]]
    np.testing.assert_allclose(limits(frf=wrong, units="um/N"), plain, rtol=1e-12)
    np.testing.assert_allclose(limits(from_hz=200.0), plain, rtol=1e-3)


def test_its_frf_is_as_it_was_measured(client: Client, tip, tmp_path):
    """Whichever format it came in, it goes as FRF.csv, and as the numbers of a picture."""
    asked = {**tip, "cutter": CUTTER, "from_hz": 100.0}
    found = client.tooltip(asked)
    np.testing.assert_allclose(found.frequency_hz, FREQUENCY[50:])
    for axis, values in ALONG.items():
        np.testing.assert_allclose(np.array(found.axes[axis].re) + 1j * np.array(found.axes[axis].im), values[50:], rtol=1e-9)
    (tmp_path / "FRF.csv").write_text(client.tooltip_file(asked), encoding="utf-8")
    for test in read_frfs(tmp_path / "FRF.csv"):
        np.testing.assert_allclose(test.values, ALONG[test.force][50:], rtol=1e-7)
    assert refused(422, client.tooltip, tip).errors[0].field == "tooling"
    for name, value in (("from_hz", 200.0), ("to_hz", 3000.0), ("step_hz", 1.0), ("spindle_speed_rpm", 6000.0)):
        assert refused(422, client.tooltip, asked, **{name: value}).errors[0].field == name


def test_as_a_job_they_are_the_same(client: Client, store: Store, tip, tmp_path):
    asked = {**tip, "cutter": CUTTER, "name": "end mill"}
    few = {"from_rpm": 7000, "to_rpm": 7400, "step_rpm": 200}
    at_once = client.lobes(asked, speeds=few, cut=CUT)
    job = client.lobes_later(asked, speeds=few, cut=CUT)
    carried(store, tmp_path)
    found = client.lobe_job(job.id)
    assert (found.job.state, found.job.machine) == ("done", "")
    assert found.answer == at_once
    assert at_once.toolings[0].tooling == "end mill"


BROKEN = columns(ALONG["Y"]).replace("\n1000 ", "\n1000 x ")


@pytest.mark.parametrize(
    ("change", "toolings", "field", "words"),
    [
        ({}, ["T1", "T1"], "toolings", "the one that was tapped"),
        ({}, [], "toolings", "the one that was tapped"),
        ({"cutter": CUTTER}, ["T1"], "toolings", "the one that was tapped"),
        ({"cutter": {**CUTTER, "teeth": 0}}, [], "cutter.teeth", "1"),
        ({"frf": []}, ["T1"], "tip.frf", "at least 1"),
        ({"frf": [{"text": columns(ALONG["Y"])}]}, ["T1"], "tip.frf[0]: frf", "axes of its response and force"),
        ({"frf": [{"text": columns(ALONG["Y"]), "axes": "Y"}] * 2}, ["T1"], "tip.frf[1]: tap tests", "each FRF once"),
        ({"frf": [{"text": BROKEN, "axes": "Y"}]}, ["T1"], "tip.frf[0] line 952: FRF", "three numbers"),
        ({"frf": [{"text": "\0", "axes": "Y"}]}, ["T1"], "tip.frf[0]: FRF", "universal file"),
        ({"frf": [{"text": columns(ALONG["Y"]), "axes": "YX"}]}, ["T1"], "tip.frf: tip receptances", "one flexible direction"),
        ({"frf": [{"text": columns(ALONG["Y"]), "axes": "Y", "record": 2}]}, ["T1"], "tip.frf[0]: frf", "counted from 1"),
        ({"frf": [{"text": columns(ALONG["Y"]), "axes": "N"}]}, ["T1"], "tip.frf.0.axes", "'X'"),
        ({"units": "N m"}, ["T1"], "tip.frf: frf_units", "motion over force"),
        ({"from_hz": 5000.0}, ["T1"], "tip.frf[0]: frf_from_hz", "3999 Hz"),
    ],
)
def test_what_is_wrong_is_named(client: Client, tip, change, toolings, field, words):
    client.write_tooling("T1", by_hand.TOOLING)
    problem = refused(422, client.lobes, {**tip, **change}, *toolings, speeds=SPEEDS, cut=CUT)
    assert field in problem.errors[0].field
    assert words in problem.errors[0].allowed
    assert "/tmp" not in problem.detail


def test_a_tip_stands_in_the_place_of_a_machine(client: Client, tip):
    for further, field in (({"machine": "m1"}, "machine"), ({"robot": {"robot": "tx200", "posture_deg": [0.0] * 6}}, "robot")):
        body = {"tip": {**tip, "cutter": CUTTER}, **further, "speeds": SPEEDS, "cut": CUT}
        problem = refused(422, client.send, "POST", "/lobes", json=body)
        assert (problem.errors[0].field, problem.errors[0].found) == (field, "given beside tip")
    assert refused(422, client.send, "POST", "/lobes", json={"tip": tip}).errors[0].field == "toolings"
