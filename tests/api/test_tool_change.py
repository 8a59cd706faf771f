"""Queries after a tool change, beside what the workflows say."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
import tomli_w
from typer.testing import CliRunner

from api.work import tasks
from api.work.machine_cache import MachineCache
from rcsa_ident.cli import app
from rcsa_ident.cutting.materials import materials
from rcsa_ident.identification import machine as identified
from rcsa_ident.io.curves.tips import read_frf_csv
from rcsa_ident.io.results.identifications import machine_from_json
from rcsa_ident.io.settings.setups import tooling_of
from rcsa_ident.setup.cut import CutSpec
from rcsa_ident.tool_holder.catalogue import holder
from rcsa_ident.workflows import tool_change
from rcsa_ident.workflows.advise import advise
from rcsa_ident.workflows.tool_change import ToolChange, tooltip
from tests.api.in_process import refused
from tests.fixtures import by_hand
from tests.fixtures.service import example

CUT = {"feed_per_tooth_mm": 0.1}
SPEEDS = {"from_rpm": 6000, "to_rpm": 9000, "step_rpm": 500}
RPM = math.pi / 30.0


def by_workflow(result, tooling, speeds):
    return advise(ToolChange(machine_from_json(json.loads(result), ""), tooling, CutSpec(), speeds, 0.01))


@pytest.fixture
def tooling(tmp_path):
    return by_hand.campaign(tmp_path).toolings["T1"]


@pytest.mark.slow
@pytest.mark.parametrize("softening", [False, True])
def test_lobes_are_those_of_the_command(client, tmp_path, tooling, softening):
    """With bands, for a machine that stays the same at all speeds and for one that changes."""
    result = by_hand.result_text(tmp_path, softening)
    id = client.make_machine("m").id
    client.identify(id, result)
    client.write_tooling("T1", by_hand.TOOLING)
    (found,) = client.lobes(id, "T1", speeds=SPEEDS).toolings
    advice = by_workflow(result, tooling, np.arange(6000.0, 9001.0, 500.0) * RPM)
    expected = advice.lobes
    assert found.spindle_speed_rpm == [6000.0, 6500.0, 7000.0, 7500.0, 8000.0, 8500.0, 9000.0]
    np.testing.assert_allclose(found.limit_depth_mm, expected.limit_depth * 1e3, rtol=1e-9)
    np.testing.assert_allclose(found.chatter_frequency_hz, expected.chatter_frequency / (2.0 * np.pi), rtol=1e-8)
    # a preview has no band; the limits around the recommended cuts have their own
    assert (found.limit_depth_low_mm, found.limit_depth_high_mm) == (None, None)
    assert [cut.recommended_depth_mm for cut in found.recommended] == [
        pytest.approx(1e3 * point.depth, rel=1e-9) if np.isfinite(point.depth) else None for point in advice.recommended
    ]
    for own, known in zip(found.around, advice.around, strict=True):
        np.testing.assert_allclose(own.limit_depth_mm, 1e3 * known.limit_depth, rtol=1e-9)
        np.testing.assert_allclose([own.limit_depth_low_mm, own.limit_depth_high_mm], 1e3 * np.array(known.band), rtol=1e-6)
    assert found.lobe == expected.lobe.tolist()
    assert found.tooling == "T1"
    assert found.warnings[0].startswith("the identification is suspect")
    assert any(w.startswith("interrupted cut") for w in found.warnings) == (tooling.cutter.teeth * 90 < 360)
    assert len(found.best_speeds) >= 1


def test_several_toolings_are_compared(shop):
    client, id = shop
    long = example()
    long["tool"]["stickout_mm"] = 60.0
    found = client.lobes(id, "T1", example(), long, speeds=SPEEDS, bands=False, recommend=False).toolings
    assert [f.tooling for f in found] == ["T1", "S1-ER32", "S1-ER32"]
    assert found[1].limit_depth_mm != found[2].limit_depth_mm
    assert found[0].limit_depth_low_mm is None


@pytest.mark.slow
def test_stable_speeds_are_null(shop):
    client, id = shop
    (found,) = client.lobes(id, "T1", speeds=SPEEDS, max_depth_mm=1e-3, recommend=False).toolings
    assert found.limit_depth_mm == found.chatter_frequency_hz == found.lobe == [None] * 7
    assert found.best_speeds[0].limit_depth_mm is None


@pytest.mark.slow
def test_a_preview_is_there_without_recommended_cuts(shop):
    client, id = shop
    (preview,) = client.lobes(id, "T1", speeds=SPEEDS, recommend=False).toolings
    (found,) = client.lobes(id, "T1", speeds=SPEEDS).toolings
    assert (preview.recommended, preview.recommended_by) == ([], None)
    assert preview.best_speeds[0].recommended_depth_mm is None
    assert preview.limit_depth_mm == found.limit_depth_mm
    assert found.recommended_by == "full-discretisation"
    assert 0.0 < found.recommended[0].recommended_depth_mm < found.recommended[0].limit_depth_mm


def test_the_cut_counts(shop):
    """Twice the coefficient, half the depth; a material of the library in the workpiece's place; a feed of two axes alike."""
    client, id = shop

    def limits(**cut):
        return np.array(client.lobes(id, "T1", speeds=SPEEDS, bands=False, recommend=False, cut=cut).toolings[0].limit_depth_mm)

    plain = limits(ktc_mpa=902.0, krc=0.26)
    np.testing.assert_allclose(limits(), plain, rtol=1e-12)
    np.testing.assert_allclose(limits(ktc_mpa=1804.0, krc=0.26), 0.5 * plain, rtol=1e-9)
    np.testing.assert_allclose(limits(material="EN AW-6082"), limits(material="en aw-6082"), rtol=0)
    np.testing.assert_allclose(limits(entry_deg=90, exit_deg=180), plain, rtol=1e-9)
    np.testing.assert_allclose(limits(stock="block", y_from_mm=-6.0, y_to_mm=0.0), plain, rtol=1e-9)
    np.testing.assert_allclose(limits(stock="stepover"), plain, rtol=1e-9)
    np.testing.assert_allclose(limits(feed_direction=-180.0), plain, rtol=1e-9)
    assert not np.allclose(limits(feed_direction="+Y"), plain, rtol=1e-2)
    assert not np.allclose(limits(strategy="up"), plain, rtol=1e-2)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["zero-order", "full-discretisation"])
def test_tested_cuts_are_counted(shop, method):
    """Each at its own speed and to its own depth, whatever speeds and depth the lobes are asked for; in any order."""
    client, id = shop
    speeds = {"from_rpm": 7000, "to_rpm": 9000, "step_rpm": 1000}
    first, _, last = client.lobes(id, "T1", speeds=speeds, method=method, bands=False, recommend=False).toolings[0].limit_depth_mm
    seen = [
        (9000, 0.95 * last, "stable"),
        (9000, 1.05 * last, "marginal"),
        (7000, 0.95 * first, "chatter"),
        (7000, 1.05 * first, "chatter"),
    ]
    seen += [(7000, 1.05 * first, "stable"), (9000, 1.05 * last, "chatter"), (7000, 0.95 * first, "marginal")]
    tested = [dict(zip(("spindle_speed_rpm", "axial_depth_mm", "verdict"), each, strict=True)) for each in seen]
    asked = {
        "speeds": {"from_rpm": 8000, "to_rpm": 8000},
        "max_depth_mm": 0.2,
        "method": method,
        "bands": False,
        "recommend": False,
        "tested": tested,
    }
    (found,) = client.lobes(id, "T1", **asked).toolings
    assert found.tested.model_dump() == {
        "stable_stable": 1, "stable_chatter": 1, "chatter_stable": 1, "chatter_chatter": 2, "stable_marginal": 1, "chatter_marginal": 1,
        "share_right": 0.6,
    }  # fmt: skip
    undecided = client.lobes(id, "T1", **asked | {"tested": tested[1:2]}).toolings[0].tested
    assert (undecided.chatter_marginal, undecided.share_right) == (1, None)
    assert client.lobes(id, "T1", **asked | {"tested": []}).toolings[0].tested is None
    problem = refused(422, client.lobes, id, "T1", **asked | {"tested": [tested[0] | {"verdict": "loud"}]})
    assert problem.errors[0].field == "tested.0.verdict"


def test_materials_are_those_of_the_library(shop):
    client, id = shop
    listed = client.materials()
    assert [each.name for each in listed] == [each.name for each in materials()]
    steel = next(each for each in listed if each.name.startswith("Steel"))
    given = {"ktc_mpa": steel.ktc_mpa, "krc": steel.krc, "kte_n_per_mm": steel.kte_n_per_mm, "kre_n_per_mm": steel.kre_n_per_mm}
    by_name, by_number = (
        client.lobes(id, "T1", speeds=SPEEDS, cut=cut, recommend=False).toolings[0] for cut in ({"material": steel.name}, given)
    )
    np.testing.assert_allclose(by_name.limit_depth_mm, by_number.limit_depth_mm, rtol=1e-12)
    spreads = [each.coefficients.tangential_spread for each in materials()]
    np.testing.assert_allclose([each.ktc_spread_percent for each in listed], 100.0 * np.array(spreads), rtol=1e-12)
    assert all(each.source for each in listed)


def test_a_holder_of_the_catalogue_makes_a_tooling(shop):
    client, id = shop
    listed = client.holders()
    assert "HSK-A63" in listed.tapers
    assert {"ER32", "shrink", "power"} <= {each.name for each in listed.chucks}
    found = client.holder("HSK-A63", "ER32", 12.0)
    assert found.holder.insertion_mm == 40.0
    assert sum(s.length_mm for s in found.holder.segments) == pytest.approx(100.0, rel=1e-12)
    assert "ISO 12164-1" in found.sources[0]
    assert client.holder("BT40", "ER32", 12.0, 70.0).mass_kg < found.mass_kg
    contact = found.contact.keys
    assert contact.translational_stiffness == 2e10
    assert "not measured" in found.contact.source
    assert found.spread.model_dump(exclude_none=True) == {"contact_stiffness_percent": 70.0, "contact_damping_percent": 100.0}
    assert set(client.holder("HSK-A63", "hydraulic", 12.0).spread.model_dump().values()) == {None}
    assert client.holder("HSK-A63", "hydraulic", 12.0).contact is None
    tooling = example(holder=found.holder.model_dump(exclude_none=True), contact=contact.model_dump())
    (answer,) = client.lobes(id, tooling, speeds=SPEEDS, recommend=False).toolings
    assert any("catalogue's assumed values of a collet" in each for each in answer.warnings)
    assert refused(422, client.holder, "HSK-A63", "ER32", 25.0).errors[0].field == "bore_mm"
    assert refused(422, client.holder, "HSK-A32", "ER32", 12.0).errors[0].field == "taper"


def run(*arguments):
    answer = CliRunner().invoke(app, [str(each) for each in arguments])
    assert answer.exit_code == 0, answer.output
    return answer


@pytest.mark.slow
def test_a_holder_of_the_catalogue_gives_one_depth_by_all_doors(shop, result, tmp_path):
    """Command line, service and Python: what `holders` hands out is as uncertain as it says, and the depth names what it depends on."""
    client, id = shop
    found, made = client.holder("HSK-A63", "ER32", 12.0), holder("HSK-A63", "ER32", 0.012)
    parts = {key: getattr(found, key).model_dump(exclude_none=True) for key in ("holder", "spread")}
    sent = example(contact=found.contact.keys.model_dump(), **parts)
    (advice,) = client.advice(id, sent, speeds=SPEEDS, cut=CUT).toolings
    tool = tooling_of(sent, "", "")
    tool = replace(tool, assembly=replace(tool.assembly, holder=made.segments, contact=made.contact.contact), spread=made.spread)
    change = ToolChange(
        machine_from_json(json.loads(result), ""), tool, CutSpec(feed_per_tooth=1e-4), np.arange(6000, 9001, 500) * RPM, 0.01
    )
    by_python = advise(change).recommended[0]
    assert advice.highest_removal[0].axial_depth_mm == pytest.approx(1e3 * by_python.depth, rel=1e-9)
    (tmp_path / "m.json").write_text(result)
    text = tomli_w.dumps({key: sent[key] for key in ("name", "cutter", "tool")})
    (tmp_path / "t.toml").write_text(text + run("holders", "HSK-A63", "ER32", "--bore-mm", 12).output)
    asked = ("--feed-per-tooth-mm", 0.1, "--speed-from", 6000, "--speed-to", 9000, "--speed-step", 500)
    (said,) = json.loads(run("advise", tmp_path / "m.json", tmp_path / "t.toml", *asked, "--json").stdout)["toolings"]
    assert said["highest_removal"][0]["axial_depth_mm"] == pytest.approx(1e3 * by_python.depth, rel=1e-9)
    most = advice.band.depends_most_on
    assert said["band"]["depends_most_on"] == most.model_dump()
    assert most.in_words.endswith(
        ("of the holder–tool joint, which is assumed (70 %)", "of the holder–tool joint, which is assumed (100 %)")
    )
    assert advice.band.in_words.endswith(f"Of single values, the depth depends most on the {most.in_words}")
    # without a word on how well it is known its band is narrower than it is, and a remark says so
    (silent,) = client.advice(id, {k: v for k, v in sent.items() if k != "spread"}, speeds=SPEEDS, cut=CUT).toolings
    assert silent.band.deviation_percent < 0.9 * advice.band.deviation_percent


@pytest.mark.parametrize("method", ["multi-frequency", "full-discretisation"])
def test_slower_methods_answer_for_few_speeds(shop, method):
    client, id = shop
    (found,) = client.lobes(id, "T1", method=method, bands=False, speeds={"from_rpm": 8000, "to_rpm": 8000}).toolings
    assert found.method == method
    assert found.limit_depth_mm[0] > 0.0


def test_advice_has_its_limit_of_work(shop):
    client, id = shop
    wide = {"from_rpm": 100, "to_rpm": 5000, "step_rpm": 1}
    problem = refused(422, client.advice, id, *["T1"] * 12, speeds=wide, cut={"feed_per_tooth_mm": 0.1})
    assert problem.errors[0].field == "speeds"
    assert "of work" in problem.detail


@pytest.mark.slow
def test_tooltip_is_that_of_the_command(shop, result, tooling, tmp_path):
    client, id = shop
    machine = machine_from_json(json.loads(result), "")
    kept = client.tooltip(id, "T1")
    own = client.tooltip(id, "T1", from_hz=500, to_hz=900, step_hz=2.5)
    assert own.frequency_hz == [500.0 + 2.5 * k for k in range(161)]
    for found in (kept, own):
        omega = 2.0 * np.pi * np.array(found.frequency_hz)
        expected = tooltip(machine, tooling, omega).tip
        deviation = {str(row): each for (row, col), each in expected.deviation().items() if row == col}
        for axis, curve in found.axes.items():
            tip = f"tip.{axis.lower()}"
            np.testing.assert_allclose(np.array(curve.re) + 1j * np.array(curve.im), expected.between(tip, tip), rtol=1e-8)
            np.testing.assert_allclose([curve.re_std, curve.im_std], deviation[tip], rtol=1e-5)
    path = tmp_path / "FRF.csv"
    path.write_text(client.tooltip_file(id, "T1"), encoding="utf-8")
    file = read_frf_csv(path)
    np.testing.assert_array_equal(file.values["X"].real, kept.axes["X"].re)
    np.testing.assert_array_equal(file.bands["Y_im_std"], kept.axes["Y"].im_std)
    assert client.tooltip(id, "T1", bands=False).axes["X"].re_std is None
    assert any("extrapolated" in w for w in client.tooltip(id, "T1", to_hz=5000).warnings)


def test_a_machine_that_was_tapped_along_its_axis_knows_z(client, result):
    """A result with what `rcsa-ident axial` wrote into it, as it is uploaded."""
    along = {"pole_per_s": [-250.0, 5650.0], "residue_m_per_n_s": [0.0, -1e-4]}
    axial = {"tooling": "T1", "band_hz": [100.0, 4000.0], "poles": [along], "constant_m_per_n": 5e-10}
    id = client.make_machine("m").id
    client.identify(id, json.dumps(json.loads(result) | {"axial": axial}))
    client.write_tooling("T1", by_hand.TOOLING)
    found = client.tooltip(id, "T1", step_hz=10)
    machine = machine_from_json(json.loads(result) | {"axial": axial}, "")
    tip = machine.tip(by_hand.tooling(), 2.0 * np.pi * np.array(found.frequency_hz), directions=machine.translations, spread=False)
    assert list(found.axes) == ["X", "Y", "Z"]
    np.testing.assert_allclose(np.array(found.axes["Z"].re) + 1j * np.array(found.axes["Z"].im), tip.between("tip.z", "tip.z"), rtol=1e-8)
    many = json.dumps(json.loads(result) | {"axial": axial | {"poles": [along] * 1000}})
    assert refused(422, client.identify, id, many).errors[0].field == "axial.poles"
    none = json.dumps(json.loads(result) | {"axial": axial | {"band_hz": [0.0, 1.0]}})
    assert refused(422, client.identify, id, none).errors[0].field == "axial.band_hz"


def test_a_speed_that_the_machine_was_not_cut_at(client, tmp_path):
    id = client.make_machine("m").id
    client.identify(id, by_hand.result_text(tmp_path, True))
    inside, outside = (client.tooltip(id, example(), spindle_speed_rpm=n, step_hz=10) for n in (9000, 30000))
    assert not any("identified from" in w for w in inside.warnings)
    assert any("identified from 5730 to 13369 rev/min" in w for w in outside.warnings)
    assert inside.axes["X"].re != outside.axes["X"].re


def test_unequal_pitch_and_a_shape_are_told_with_every_answer(shop):
    client, id = shop
    odd = example(cutter={"teeth": 4, "diameter_mm": 12.0, "pitch_deg": [84, 96, 84, 96], "shape": "high-feed"})
    ask = {"speeds": {"from_rpm": 8000, "to_rpm": 9000, "step_rpm": 500}, "bands": False}
    lobes, advice = client.lobes(id, odd, **ask).toolings[0], client.advice(id, odd, cut={"feed_per_tooth_mm": 0.1}, **ask).toolings[0]
    for answer in (lobes, advice):
        assert answer.withheld in answer.warnings
        assert answer.withheld.endswith("full-discretisation takes unlike teeth")
        told = "the cutter's shape is high-feed; cutting_edge_angle_deg and cutting_depth_mm are not told; its stability"
        assert any(told in w for w in answer.warnings)
    # the limits recommend nothing, and the cuts come from the method that they name
    assert lobes.recommended_depth_mm == [None] * 3
    assert [lobes.recommended_by, advice.recommended_by] == ["full-discretisation"] * 2
    assert lobes.recommended[0].recommended_depth_mm == advice.highest_removal[0].recommended_depth_mm > 0.0
    right = client.lobes(id, odd, method="full-discretisation", **ask).toolings[0]
    assert right.withheld is None
    assert all(depth > 0.0 for depth in right.recommended_depth_mm)
    assert any("high-feed" in warning for warning in client.tooltip(id, odd, step_hz=10).warnings)
    assert not any("cylinder" in warning for warning in client.tooltip(id, "T1", step_hz=10).warnings)


@pytest.mark.slow
def test_advice_stands_by_the_lobes(shop):
    client, id = shop
    cut = {"feed_per_tooth_mm": 0.1}
    planned = [{"spindle_speed_rpm": 7000, "axial_depth_mm": 0.5}]
    (told,) = client.advice(id, "T1", cut=cut, speeds=SPEEDS, planned=planned, depth_mm=0.02, max_power_kw=15).toolings
    only = {"from_rpm": 7000, "to_rpm": 7000, "step_rpm": 500}
    (lobes,) = client.lobes(id, "T1", speeds=only, method="full-discretisation", recommend=False, bands=False).toolings
    (limit,) = lobes.limit_depth_mm
    (one,) = told.planned
    assert one.method == "full-discretisation"
    assert one.limit_depth_mm == pytest.approx(limit, rel=5e-3)
    assert one.margin == pytest.approx(one.limit_depth_mm / 0.5 - 1.0, rel=1e-9)
    assert one.stable == (limit >= 0.5)
    best = told.highest_removal[0]
    # a_p a_e v_f, half immersion of 12 mm, four teeth
    assert best.removal_rate_cm3_per_min == pytest.approx(best.axial_depth_mm * 6.0 * 0.1 * 4 * best.spindle_speed_rpm * 1e-3, rel=1e-9)
    assert told.stickout_mm == pytest.approx(60.0)
    assert refused(422, client.advice, id, "T1").errors[0].field == "cut.feed_per_tooth_mm"
    deep = [{"spindle_speed_rpm": 7000, "axial_depth_mm": 50}]
    assert refused(422, client.advice, id, "T1", cut=cut, planned=deep).errors[0].field == "planned.0.axial_depth_mm"


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"cut": {"entry_deg": 90}}, "cut.exit_deg"),
        ({"cut": {"entry_deg": 90, "exit_deg": 90}}, "cut.exit_deg"),
        ({"cut": {"stock": "block"}}, "cut.y_from_mm"),
        ({"cut": {"y_from_mm": 7.0, "y_to_mm": 9.0}}, "cut.y_from_mm"),
        ({"cut": {"y_from_mm": 1.0, "y_to_mm": 2.0, "entry_deg": 10, "exit_deg": 90}}, "cut.entry_deg"),
        ({"cut": {"stock": "stepover", "engagement": [[0.0, 10.0, 20.0]]}}, "cut.engagement"),
        ({"cut": {"engagement": [[0.0, 30.0, 20.0]]}}, "cut.engagement"),
        ({"cut": {"lead_deg": 5.0}}, "cut.lead_deg"),
        ({"cut": {"kac": 50.0}}, "cut.kac"),
        ({"cut": {"material": "cheese"}}, "material"),
        ({"cut": {"runout_um": [1, 2]}}, "cut.runout_um"),
        ({"cut": {"wear_land_um": 80}}, "cut.indentation"),
        ({"cut": {"feed_direction": "up"}}, "cut.feed_direction"),
        ({"speeds": {"from_rpm": 9000, "to_rpm": 4000}}, "speeds.to_rpm"),
        ({"speeds": {"from_rpm": 100, "to_rpm": 200000, "step_rpm": 1}}, "speeds.to_rpm"),
        ({"method": "magic"}, "method"),
        ({"max_depth_mm": 0}, "max_depth_mm"),
        ({"depth": 1}, "depth"),
        ({"bands": "yes"}, "bands"),
        ({"stiffness_spread_percent": 51}, "stiffness_spread_percent"),
    ],
)
def test_the_field_at_fault_is_named(shop, change, field):
    client, id = shop
    assert refused(422, client.lobes, id, "T1", **change).errors[0].field.startswith(field)


def test_what_is_not_there(shop):
    client, id = shop
    refused(404, client.lobes, "nobody", "T1")
    refused(404, client.lobes, id, "T9")
    refused(422, client.lobes, id)
    refused(422, client.lobes, id, *["T1"] * 13)
    bare = client.make_machine("bare").id
    assert "identification" in refused(404, client.lobes, bare, "T1").detail


def test_numbers_that_lead_nowhere_are_told_not_thrown(shop):
    client, id = shop
    contact = {"translational_stiffness": 1e300, "rotational_stiffness": 1e300, "translational_damping": 1e308, "rotational_damping": 1e308}
    refused(422, client.lobes, id, example(contact=contact))
    refused(422, client.tooltip, id, example(contact=contact))


@pytest.mark.slow
def test_a_posterior_that_is_too_large_to_keep_is_weighed(shop, monkeypatch):
    """The plain road gives the same limits; where it would take too long it is refused, and so are too many frequencies."""
    client, id = shop
    quick, answers = client.lobes(id, "T1", speeds=SPEEDS).toolings[0], client.http.app.state.components.answers
    answers.kept.clear()
    monkeypatch.setattr(tasks, "_machines", MachineCache(4))
    monkeypatch.setattr(identified, "MOST_KEPT", 10)
    slow = client.lobes(id, "T1", speeds=SPEEDS).toolings[0]
    for one, other in zip(slow.around, quick.around, strict=True):
        np.testing.assert_allclose(one.limit_depth_low_mm, other.limit_depth_low_mm, rtol=1e-3)
    np.testing.assert_allclose(slow.limit_depth_mm, quick.limit_depth_mm, rtol=1e-9)
    answers.kept.clear()
    monkeypatch.setattr(tool_change, "_SPREAD_SECONDS", 1.0)
    assert refused(422, client.lobes, id, "T1", speeds=SPEEDS).errors[0].field == "speeds"
    assert refused(422, client.tooltip, id, "T1").errors[0].field == "step_hz"
    assert refused(422, client.frf, id).errors[0].field == "step_hz"
    assert client.tooltip(id, "T1", bands=False).axes["X"].re_std is None


@pytest.mark.parametrize(
    ("part", "value", "field", "words"),
    [
        ("contact", {"translational_stiffness": 2e4}, "contact.translational_stiffness", "N/µm per m (2e+10"),
        ("tool", {"stickout_mm": 0.06}, "tool.stickout_mm", "metres (60 mm)"),
        ("cutter", {"diameter_mm": 0.012}, "cutter.diameter_mm", "metres (12 mm)"),
        ("cutter", {"diameter_mm": 200.0}, "cutter.diameter_mm", "times that diameter"),
        ("holder", {"inner_diameter_mm": 40.0}, "holder.segments[0].inner_diameter_mm", "the tool's own diameter"),
        ("tool", {"inner_diameter_mm": 11.9}, "tool.segments[0].inner_diameter_mm", "0.6 times the outer diameter"),
    ],
)
def test_a_tooling_that_is_impossible_is_refused_with_the_likely_slip(shop, part, value, field, words):
    client, id = shop
    tooling = example()
    (tooling[part]["segments"][0] if "inner_diameter_mm" in value else tooling[part]).update(value)
    (error,) = refused(422, client.lobes, id, tooling, speeds=SPEEDS).errors
    assert error.field == field
    assert words in error.allowed


def test_unusual_values_are_warned_of_in_every_answer(shop):
    client, id = shop
    tooling = example()
    tooling["holder"]["segments"][0]["inner_diameter_mm"] = 0.0
    cut = {"immersion": 0.005, "ktc_mpa": 30.0, "krc": 0.3, "feed_per_tooth_mm": 0.1}
    told = (
        "holder.segments[0].inner_diameter_mm is 0, but",
        "tangential coefficient is 30 MPa, but usual are",
        "radial immersion is 0.5 %, but usual are 1.5 to 100 %: was 50 % meant?",
    )
    for found in (
        client.lobes(id, tooling, speeds=SPEEDS, cut=cut, recommend=False).toolings[0],
        client.advice(id, tooling, speeds=SPEEDS, cut=cut).toolings[0],
    ):
        assert [any(warning.startswith(words) for warning in found.warnings) for words in told] == [True] * 3
    assert any(warning.startswith(told[0]) for warning in client.tooltip(id, tooling).warnings)
    usual = client.lobes(id, example(), speeds=SPEEDS, recommend=False).toolings[0]
    assert not [warning for warning in usual.warnings if "usual" in warning]


@pytest.mark.parametrize(
    ("cut", "field", "words"),
    [
        ({"ktc_mpa": 2.1, "krc": 0.3}, "cut.ktc_mpa", "GPa (2100 MPa)"),
        ({"ktc_mpa": 900, "krc": 26.0}, "cut.krc", "percent (0.26)"),
        ({"kte_n_per_mm": 12e3}, "cut.kte_n_per_mm", "N/m (12 N/mm)"),
        ({"feed_per_tooth_mm": 100.0}, "cut.feed_per_tooth_mm", "µm (0.1 mm)"),
    ],
)
def test_a_cut_that_is_impossible_is_refused_with_the_likely_slip(shop, cut, field, words):
    client, id = shop
    (error,) = refused(422, client.lobes, id, "T1", speeds=SPEEDS, cut=cut).errors
    assert error.field == field
    assert words in error.allowed
