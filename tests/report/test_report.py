"""The page: one file, no scripts, everything said, nothing injected."""

from __future__ import annotations

import re
from html.parser import HTMLParser

import numpy as np
import pytest

from rcsa_ident.base.remarks import Remark
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import ForceCoefficient, ForceTerm
from rcsa_ident.cutting.power import SpindleDrive
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.coordinates import Dof, plane
from rcsa_ident.dynamics.modal import ModalModel
from rcsa_ident.identification.posterior import Posterior
from rcsa_ident.identification.progress import BOTH, Stage, Step
from rcsa_ident.identification.result import AxisResult, Identification, IdentificationCode
from rcsa_ident.identification.status import Status
from rcsa_ident.identification.unknowns import ModalBlock, parameter_names
from rcsa_ident.report.figures import tooltip_frf
from rcsa_ident.report.html import ToolingPage, report_html
from rcsa_ident.report.style import svg
from rcsa_ident.report.summaries import coefficient_rows, lobes_curves, lobes_summary, mode_rows, recording_rows, two_digits
from rcsa_ident.setup.campaign import Campaign
from rcsa_ident.setup.cut import Cut, Workpiece
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.signals.frf import AxisLines
from rcsa_ident.signals.measurement import CutMeasurement, Reading
from rcsa_ident.signals.verdict import RecordCode, Verdict
from rcsa_ident.stability.advice import Advice, highest_removal, usable_depths
from rcsa_ident.stability.result import StabilityLobes
from rcsa_ident.tool_holder.geometry import MATERIALS, BeamSegment, ToolAssembly

STEEL = MATERIALS["steel"]
PROCESS = MillingProcess(Cutter(4, 0.012), CuttingCoefficients(902e6, 0.26), Engagement(0.5 * np.pi, np.pi))
# neither HTML nor a formula
NAME = "<b>T1</b> & $co_"


@pytest.fixture
def campaign(tmp_path):
    assembly = ToolAssembly((BeamSegment(0.08, 0.012, STEEL),), (BeamSegment(0.05, 0.05, STEEL, 0.012),), 0.03, None)
    conditions = CuttingConditions(1000.0, 4e-4, 1e-4, Engagement(0.5 * np.pi, np.pi))
    cuts = tuple(Cut(f"cut-{i}", NAME, conditions, tmp_path / "none.h5") for i in range(3))
    workpiece = Workpiece("EN AW-6082", CuttingCoefficients(902e6, 0.26))
    return Campaign("<script>alert(1)</script>", None, (), workpiece, {NAME: Tooling(NAME, Cutter(4, 0.012), assembly)}, cuts)


@pytest.fixture
def readings(campaign):
    # gap and fixture: the flange's motion and its noise are their sums
    value = np.array([[0.7e-8 + 1e-8j, 0.3e-8], [3e-8, -1e-8]])
    variance = np.array([[0.75e-20, 0.25e-20], [0.5e-20, 0.5e-20]])
    force = np.ones(2, dtype=complex)
    slope = np.zeros((2, 5), dtype=complex)
    lines = AxisLines(np.array([4, 8]), np.array([4e3, 8e3]), value, 0.0 * value, variance, np.ones(2), force, slope)
    measurement = CutMeasurement("cut-0", NAME, 1001.0, {Dof.X: lines}, 0.0)
    good = [
        Reading(cut.id, NAME, 1000.0, Verdict((), (Remark(RecordCode.NO_AIR_CUT, "no air cut"),)), (measurement,))
        for cut in campaign.cuts[:2]
    ]
    return [*good, Reading(campaign.cuts[2].id, NAME, 1000.0, Verdict((Remark(RecordCode.CHATTER, "chatter: 3 µm at 1500 Hz"),)))]


@pytest.fixture
def found():
    modes = ModalModel(
        np.array([5e3, 1e4]), np.array([0.05, 0.04]), np.full((2, 2), 1e-3 - 1e-3j), np.zeros((2, 2)), plane("flange", Dof.X)
    )
    omega = np.linspace(4e3, 2e4, 12)
    value = 1e-4 / omega * np.exp(-1j * omega / 3e3)
    measured = {"omega": omega, "value": value, "model": value, "cut": np.arange(12) % 2, "coherence": np.ones(12)}
    joint = LumpedJoint(2e9, 5e6, 1e4, 10.0)
    layout = ModalBlock(1)
    covariance = np.diag([1.0] * layout.size + [1e-4, 1.0, 1e-4, 1e-4])
    posterior = Posterior(np.zeros(layout.size + 4), covariance, layout)
    part = AxisResult(modes, joint, 1.23, {NAME: 1.23}, 0.004, parameter_names(layout), posterior, measured)
    told = ((Stage.SEARCH, 30.0, 3), (Stage.SEARCH, 20.0, 3), (Stage.MODES, -5.0, 3), (Stage.MODES, -9.0, 2))
    trace = (*(Step("x", *each) for each in told), Step(BOTH, Stage.POLISH, 4.0, 2))
    cuts = ("cut-0", "cut-1")
    reasons = (Remark(IdentificationCode.FEW_CUTS, "few cuts: 2"),)
    notes = (Remark(IdentificationCode.COEFFICIENT_UNKNOWN, "run-out of <T1>: the cuts say little about it"),)
    scales = {ForceCoefficient(ForceTerm.TANGENTIAL): (np.log(1.1), 0.01), ForceCoefficient(ForceTerm.RUNOUT, NAME): (-0.6, 0.02)}
    return Identification(
        Status.SUSPECT, reasons, 1, "default", {Dof.X: part}, cuts, np.zeros(2), np.ones(2), np.ones(2), trace, notes, scales
    )


def page_of(name=NAME, **more):
    frequency = np.linspace(200.0, 3000.0, 50)
    tip = {"X": 1e-6 / (1.0 - (frequency / 900.0) ** 2 + 0.1j)}
    speed = np.linspace(400.0, 2000.0, 30)
    limit = np.where(speed > 1800.0, np.inf, 1e-3 * (1.2 + np.sin(speed / 100.0)))
    stable = np.isinf(limit)
    lobes = StabilityLobes(speed, limit, np.where(stable, np.nan, 5e3), np.where(stable, -1, 2), 4e-3, "zero-order", 2e-4, 5e3)
    usable = usable_depths(lobes, PROCESS, SpindleDrive.flat())
    points = tuple(highest_removal(usable, PROCESS))
    deviation = {"X": (np.full(50, 1e-8), np.full(50, 1e-8))}
    advice = Advice(name, 0.06, lobes, usable, points, (), (), None, ())
    return ToolingPage(name, True, frequency, tip, deviation, advice=advice, **more)


class Tags(HTMLParser):
    """Every tag is closed by its own name; names and ids are collected."""

    VOID = ("meta", "br", "link", "img")

    def __init__(self):
        super().__init__()
        self.open, self.names, self.ids, self.text = [], set(), [], []

    def handle_starttag(self, tag, attrs):
        self.names.add(tag)
        self.ids += [value for key, value in attrs if key == "id"]
        assert not any(key.startswith("on") for key, _ in attrs)
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.names.add(tag)
        self.ids += [value for key, value in attrs if key == "id"]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


def parsed(text):
    tags = Tags()
    tags.feed(text)
    assert tags.open == []
    return tags


@pytest.mark.slow
def test_the_page_is_whole_and_self_contained(found, campaign, readings):
    text = report_html(found, campaign, readings, [page_of(), page_of("T2")], {"recordings": 1.5})
    tags = parsed(text)
    assert "script" not in tags.names
    assert len(tags.ids) == len(set(tags.ids))
    assert not re.search(r"(src|href)=\"(https?:)?//", text)
    assert len(text) < 1_000_000
    words = " ".join(tags.text)
    for said in (
        "<script>alert(1)</script>",
        NAME,
        "suspect",
        "few cuts: 2",
        "chatter: 3 µm at 1500 Hz",
        "no air cut",
        "1.23",
        "2 of 3 cuts",
    ):
        assert said in words
    for unit in ("[Hz]", "[µm/N]", "[mm]", "[rev/min]", "N m/rad"):
        assert unit in words


@pytest.mark.slow
def test_what_the_records_do_not_tell_is_marked(found, campaign, readings):
    text = report_html(found, campaign, readings)
    rows = {
        row.split("</td>")[0]: "hardly determined" in row
        for row in re.findall(r"<tr><td>((?:translational|rotational).*?)</tr>", text, re.DOTALL)
    }
    assert rows == {
        "translational stiffness k_t": False,
        "rotational stiffness k_r": True,
        "translational damping c_t": False,
        "rotational damping c_r": False,
    }


@pytest.mark.slow
def test_the_truth_appears_only_where_it_is_known(found, campaign, readings):
    without = report_html(found, campaign, readings, [page_of()])
    truth = page_of().tip
    known = report_html(found, campaign, readings, [page_of(truth=truth, error={"X": 0.0123})])
    assert "true FRF" not in without
    assert "1.2 %" in known


@pytest.mark.slow
def test_the_same_figure_gives_the_same_text():
    page = page_of()
    one, two = (svg(tooltip_frf(page.frequency, page.tip, page.deviation), "a") for _ in range(2))
    assert one == two
    assert one.startswith("<svg")
    assert "<metadata" not in one


@pytest.mark.slow
def test_a_recommendation_stands_beside_its_limit_and_an_infinite_one_is_none(found, campaign, readings):
    advice = page_of().advice
    summary, curves = lobes_summary(advice), lobes_curves(advice)
    assert len(summary["recommended"]) == len(advice.recommended) > 1
    best = summary["recommended"][0]
    # stable up to the depth that was asked for: no limit is known there
    assert best["limit_depth_mm"] is None
    assert best["recommended_depth_mm"] is None
    assert curves["limit_depth_mm"][-1] is None
    # a preview recommends nothing, and has no band
    assert set(curves["recommended_depth_mm"]) == {None}
    assert curves["limit_depth_low_mm"] is None
    text = " ".join(parsed(report_html(found, campaign, readings, [page_of()])).text)
    for point in advice.recommended:
        assert f"{point.spindle_speed * 30.0 / np.pi:.0f}" in text
        assert (f"{1e3 * point.depth:.2f}" if np.isfinite(point.depth) else "no depth recommended") in text


def test_rows_say_what_a_recording_is_worth(readings):
    rows = recording_rows(readings)
    assert [row.usable for row in rows] == [True, True, False]
    assert rows[0].lines == 2
    assert rows[0].found_rpm == pytest.approx(1001.0 * 30.0 / np.pi)
    # |h|^2 / (2 var) is 1e4 and 2e4, their median 1.5e4
    assert rows[0].signal_to_noise_db == {"X": pytest.approx(10.0 * np.log10(1.5e4))}
    assert rows[2].found_rpm is None
    assert rows[2].signal_to_noise_db == {}


@pytest.mark.slow
def test_the_page_says_what_was_found_beside_the_machine(found, campaign, readings):
    text = report_html(found, campaign, readings, deviations={Dof.X: (2.0 * np.pi * np.array([1.234, 56.78]), np.array([1e-4, 0.02]))})
    words = " ".join(" ".join(parsed(text).text).split())
    assert "run-out of <T1>: the cuts say little about it" in words
    # 1.1 +- 0.011, and -0.6 x 2 um with 0.02 x 2 um
    for row in ("tangential coefficient 1.100 0.011 times the campaign's", f"run-out of {NAME} -1.200 0.040 µm"):
        assert row in words
    # 5000 rad/s with 5 %, 10000 rad/s with 4 %
    assert "795.8 1.2 5.00 0.010 1.000 − 1.000 i" in words
    assert "1591.5 57 4.00 2.0 1.000 − 1.000 i" in words


@pytest.mark.slow
def test_without_deviations_there_are_no_columns_for_them(found, campaign, readings):
    words = " ".join(" ".join(parsed(report_html(found, campaign, readings)).text).split())
    assert "795.8 5.00 1.000 − 1.000 i" in words
    assert "one standard deviation" not in words


def test_rows_of_coefficients_are_factors_and_micrometres():
    scale, runout = coefficient_rows(
        {ForceCoefficient(ForceTerm.RATIO): (np.log(0.8), 0.05), ForceCoefficient(ForceTerm.RUNOUT, "T"): (1.5, 0.5)}
    )
    assert (scale.value, scale.std) == (pytest.approx(0.8), pytest.approx(0.04))
    assert (runout.value, runout.std, runout.unit) == (pytest.approx(3.0), pytest.approx(1.0), "µm")


def test_deviations_follow_their_modes_when_sorted():
    modes = ModalModel(np.array([2e4, 1e4]) * np.pi, np.array([0.02, 0.01]), np.ones((2, 2)) * 1j, np.zeros((2, 2)), plane("flange", Dof.X))
    rows = mode_rows(modes, (2.0 * np.pi * np.array([7.0, 3.0]), np.array([0.002, 0.001])))
    assert [(r.frequency_hz, r.frequency_std_hz, r.damping_std_percent) for r in rows] == [
        (pytest.approx(5e3), pytest.approx(3.0), pytest.approx(0.1)),
        (pytest.approx(1e4), pytest.approx(7.0), pytest.approx(0.2)),
    ]
    assert mode_rows(modes)[0].frequency_std_hz is None


@pytest.mark.parametrize(
    ("std", "text"), [(0.0, "0"), (1e-9, "0"), (0.0456, "0.046"), (1.26, "1.3"), (9.99, "10.0"), (57.4, "57"), (1234.5, "1234")]
)  # fmt: skip
def test_two_digits(std, text):
    assert two_digits(std) == text
    value = float(two_digits(std, 3.14159265))
    assert abs(value - 3.14159265) <= 0.06 * max(std, 1e-5) or std > 1.0
