"""Toolings and campaigns in the machinist's units."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.shape import CutterShape
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.io.settings.setups import read_campaign, read_tooling
from rcsa_ident.io.settings.toolings import write_tooling
from rcsa_ident.io.toml_text import toml_of
from rcsa_ident.signals.recording import Quantity, Recording, Role
from rcsa_ident.tool_holder.geometry import MATERIALS
from tests.fixtures.cutters import keys_of


def tooling_file(folder: Path, text: str, old: str = "", new: str = "") -> Path:
    assert old in text
    path = folder / "tooling.toml"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    return path


def test_a_tooling_in_si(tmp_path, tooling_text):
    tooling = read_tooling(tooling_file(tmp_path, tooling_text))
    assert tooling.name == "S1-ER32"
    assert tooling.cutter.teeth == 4
    assert tooling.cutter.diameter == pytest.approx(0.012)
    assert tooling.cutter.helix == pytest.approx(np.pi / 6)
    np.testing.assert_allclose(tooling.cutter.pitch, np.pi / 2)
    assembly = tooling.assembly
    assert [s.length for s in assembly.tool] == pytest.approx([0.026, 0.0845])
    assert assembly.tool[0].diameter == pytest.approx(0.0096)
    assert assembly.tool[0].material.youngs_modulus == pytest.approx(600e9)
    assert assembly.insertion == pytest.approx(0.04)
    assert assembly.stickout == pytest.approx(0.0705)
    assert assembly.holder[0].inner_diameter == pytest.approx(0.012)
    assert assembly.contact is not None
    assert assembly.contact.rotational_stiffness == 6.0e5
    assert assembly.contact.rotational_damping == 9.0


def test_defaults(tmp_path):
    path = tmp_path / "M7.toml"
    path.write_text("""
        cutter = { teeth = 3, diameter_mm = 10 }
        tool = { stickout_mm = 50, segments = [ { length_mm = 200, outer_diameter_mm = 10, material = "steel" } ] }
        holder = { insertion_mm = 30, segments = [ { length_mm = 60, outer_diameter_mm = 40, material = "steel" } ] }
    """)
    tooling = read_tooling(path)
    assert tooling.name == "M7"
    assert tooling.cutter.helix == 0.0
    assert tooling.cutter.equally_spaced
    assert tooling.assembly.contact is None
    assert tooling.assembly.tool_length == pytest.approx(0.08)  # a longer tool is cut
    assert tooling.assembly.tool[0].inner_diameter == 0.0
    assert tooling.assembly.tool[0].material == MATERIALS["steel"]


@pytest.mark.parametrize("shape", CutterShape)
def test_shapes_go_out_and_come_back(tmp_path, tooling_text, shape):
    own = toml_of(keys_of(shape) | {"helix_deg": 30.0, "pitch_deg": [90.0] * 4})
    read = read_tooling(tooling_file(tmp_path, tooling_text, tooling_text[tooling_text.index("teeth") : tooling_text.index("[tool]")], own))
    write_tooling(tmp_path / "again.toml", read)
    again = read_tooling(tmp_path / "again.toml").cutter
    assert (again.shape, again.corner_radius, again.teeth) == (shape, pytest.approx(read.cutter.corner_radius), 4)
    half = 0.5 * read.cutter.profile.height
    assert again.profile.radius_at(half) == pytest.approx(read.cutter.profile.radius_at(half), abs=1e-12)


def test_a_tooling_without_a_shape_is_flat_and_stays_so(tmp_path, tooling_text):
    read = read_tooling(tooling_file(tmp_path, tooling_text))
    assert (read.cutter.shape, read.cutter.corner_radius) == (CutterShape.FLAT, 0.0)
    write_tooling(tmp_path / "again.toml", read)
    assert not any(key in (tmp_path / "again.toml").read_text() for key in ("shape", "corner"))


def test_taper_and_fluted_section(tmp_path, tooling_text):
    old = "length_mm = 26.0, outer_diameter_mm = 9.6,"
    new = "length_mm = 26.0, outer_diameter_mm = 12.0, end_diameter_mm = 10.0, area_mm2 = 60.0, second_moment_mm4 = 300.0,"
    segment = read_tooling(tooling_file(tmp_path, tooling_text, old, new)).assembly.tool[0]
    assert segment.end == pytest.approx(0.010)
    assert segment.area == pytest.approx(60e-6)
    assert segment.second_moment == pytest.approx(300e-12)


def test_materials_are_added_and_changed(tmp_path, tooling_text):
    text = tooling_text.replace('material = "steel"', 'material = "tungsten"')
    text += "[materials.steel]\nloss_factor = 0.01\n[materials.tungsten]\nyoungs_modulus_gpa = 340\ndensity = 17000\npoisson = 0.28\n"
    assembly = read_tooling(tooling_file(tmp_path, text)).assembly
    assert assembly.holder[0].material.density == 17000.0
    assert assembly.holder[0].material.loss_factor == 0.0
    text = text.replace('material = "tungsten"', 'material = "steel"')
    steel = read_tooling(tooling_file(tmp_path, text)).assembly.holder[0].material
    assert steel.loss_factor == 0.01
    assert steel.youngs_modulus == pytest.approx(MATERIALS["steel"].youngs_modulus, rel=1e-15)


@settings(max_examples=30, deadline=None)
@given(angles=st.lists(st.floats(20.0, 120.0), min_size=1, max_size=8), decimals=st.integers(2, 6))
def test_rounded_pitch_is_a_full_turn(tmp_path_factory, angles, decimals):
    pitch = np.round(np.array(angles) * 360.0 / sum(angles), decimals)
    path = tmp_path_factory.mktemp("pitch") / "t.toml"
    path.write_text(f"""
        cutter = {{ teeth = {pitch.size}, diameter_mm = 10, pitch_deg = {pitch.tolist()} }}
        tool = {{ stickout_mm = 50, segments = [ {{ length_mm = 90, outer_diameter_mm = 10, material = "steel" }} ] }}
        holder = {{ insertion_mm = 30, segments = [ {{ length_mm = 60, outer_diameter_mm = 40, material = "steel" }} ] }}
    """)
    found = read_tooling(path).cutter.pitch
    assert found.sum() == pytest.approx(2.0 * np.pi, rel=1e-12)
    np.testing.assert_allclose(np.degrees(found), pitch, atol=0.05)


CARBIDE = '12.0, material = "carbide"'
BROKEN_TOOLINGS = [
    ("teeth = 4", "teeth = = 4", ["line 3", "tooling", "a TOML error (extra `=`, expected nothing)"]),
    ("teeth = 4", "teeth = 4\nteeth = 4", ["line 4", "duplicate key"]),
    ("teeth = 4", "", ["cutter.teeth", "found nothing", "a whole number at least 1 and at most 100"]),
    ("teeth = 4", "teeth = 4.5", ["cutter.teeth", "found 4.5", "a whole number"]),
    ("teeth = 4", "teeth = true", ["cutter.teeth", "found true"]),
    ("teeth = 4", "theeth = 4", ["cutter.theeth", "an unknown key", "did you mean teeth?"]),
    ("diameter_mm = 12.0", "diameter_mm = nan", ["cutter.diameter_mm", "found nan", "a finite number"]),
    ("diameter_mm = 12.0", "diameter_mm = inf", ["cutter.diameter_mm", "found inf"]),
    ("diameter_mm = 12.0", f"diameter_mm = 1{'0' * 400}", ["line 4, column 15", "integer number overflowed"]),
    ("diameter_mm = 12.0", 'diameter_mm = "12"', ["cutter.diameter_mm", 'the text "12"', "a finite number"]),
    ("diameter_mm = 12.0", "diameter_mm = 2026-11-01", ["cutter.diameter_mm", "date 2026-11-01"]),
    ("[90, 90, 90, 90]", "[90, 90, 90]", ["cutter.pitch_deg", "a list of 3", "a list of 4 finite numbers"]),
    ("[90, 90, 90, 90]", "[90, 90, 90, 80]", ["cutter.pitch_deg", "sum 350", "add up to 360"]),
    ("[90, 90, 90, 90]", '[90, 90, 90, "90"]', ["cutter.pitch_deg", 'the text "90" in the list']),
    ("teeth = 4", 'teeth = 4\nshape = "bal"', ["cutter.shape", '"bal"', "one of flat, bull-nose, ball", "did you mean ball?"]),
    ("teeth = 4", "teeth = 4\nshape = 3", ["cutter.shape", "found 3", "one of flat"]),
    ("[cutter]", "[cutters]", ["cutters", "an unknown key", "did you mean cutter?"]),
    ("stickout_mm = 70.5", "stickout = 70.5", ["tool.stickout", "did you mean stickout_mm?"]),
    ("stickout_mm = 70.5", "stickout_mm = 80", ["tool.stickout_mm + holder.insertion_mm", "120 mm", "the tool's length, 110.5 mm"]),
    ("insertion_mm = 40.0", "insertion_mm = 41\n", ["tool.stickout_mm + holder.insertion_mm", "111.5 mm"]),
    ("{ length_mm = 40.0", "{ length_mm = 39.0", ["holder.insertion_mm", "found 40 mm", "the holder's length, 39 mm"]),
    ("outer_diameter_mm = 9.6, ", "", ["tool.segments[0].outer_diameter_mm", "found nothing"]),
    ("inner_diameter_mm = 0.0", "inner_diameter_mm = 9.6", ["tool.segments[0].inner_diameter_mm", "below the outer diameter, 9.6"]),
    (CARBIDE, '12.0, material = "carbid"', ["tool.segments[1].material", '"carbid"', "did you mean carbide?"]),
    (CARBIDE, "12.0", ["tool.segments[1].material", "found nothing", "one of carbide, steel, aluminium"]),
    (CARBIDE, CARBIDE + ", area_mm2 = 100", ["tool.segments[1].second_moment_mm4", "found nothing", "or neither"]),
    (CARBIDE, CARBIDE + ", area_mm2 = 114", ["tool.segments[1].area_mm2", "found 114", "at most 113"]),
    (
        '"steel" } ]', '"steel" } ]\n[holder.segment]', ["holder.segment", "an unknown key", "did you mean segments?"],
    ),
    ("translational_stiffness = 2.0e10", "", ["contact.translational_stiffness", "found nothing", "N/m per m"]),
    ("[materials.carbide]", "[materials]\ncarbide = 600\n[extra]", ["extra", "an unknown key"]),
    ('name = "S1-ER32"', "name = 1", ["name", "found 1", "a text"]),
    ('name = "S1-ER32"', 'name = " "', ["name", "an empty text"]),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "words"), BROKEN_TOOLINGS, ids=[f"{i}-{w[0]}" for i, (_, _, w) in enumerate(BROKEN_TOOLINGS)])
def test_a_bad_tooling_is_answered_with_one_sentence(tmp_path, tooling_text, old, new, words):
    path = tooling_file(tmp_path, tooling_text, old, new)
    with pytest.raises(InputError) as error:
        read_tooling(path)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)
    for word in words:
        assert word in str(error.value)


HEAD = b"holder = {}\ncutter = { teeth = 1, diameter_mm = 1 }\n"


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", ["an empty file"]),
        (b'name = "\xff"', ["line 1", "not UTF-8"]),
        (b"a = " + b"[" * 20000, ["lists nested too deeply"]),
        (b"a = 1" + b"0" * 5000, ["a TOML error"]),
        (b"[cutter]\nteeth = 4", ["tool", "found nothing", "a table [tool]"]),
        (b"tool = 4", ["tool", "found 4", "a table of keys"]),
        (HEAD + b"tool = { stickout_mm = 1, segments = [] }", ["tool.segments", "an empty list"]),
        (HEAD + b"tool = { stickout_mm = 1, segments = [3] }", ["tool.segments[0]", "found 3"]),
        (b'"a\\nb" = 3', ["'a\\nb'", "an unknown key"]),
    ],
)  # fmt: skip
def test_a_file_that_is_no_tooling(tmp_path, content, words):
    path = tmp_path / "t.toml"
    path.write_bytes(content)
    with pytest.raises(InputError) as error:
        read_tooling(path)
    for word in [str(path), *words]:
        assert word in str(error.value)


def test_a_campaign_in_si(campaign):
    read = read_campaign(campaign)
    assert read.name == "HPM 800U, 2026-11"
    assert read.sampling_rate == 51200.0
    gap, fixture, trigger = read.sensors
    assert (gap.name, gap.quantity, gap.axis, gap.sensitivity) == ("flange_x", Quantity.DISPLACEMENT, Dof.X, 1e4)
    assert (fixture.delay, fixture.bandwidth) == (1e-5, 1e4)
    assert trigger.axis is None
    assert trigger.tooth_angle == pytest.approx(np.pi / 2)
    assert read.workpiece.name == "EN AW-6082"
    assert read.workpiece.coefficients.tangential == pytest.approx(902e6)
    assert read.workpiece.coefficients.radial_edge == pytest.approx(5e3)
    assert list(read.toolings) == ["S1-ER32"]
    first, second = read.cuts
    assert first.conditions.spindle_speed == pytest.approx(8000 * 2 * np.pi / 60)
    assert first.conditions.axial_depth == pytest.approx(0.4e-3)
    assert first.conditions.feed_per_tooth == pytest.approx(0.1e-3)
    assert first.conditions.engagement.entry == pytest.approx(np.pi / 2)
    assert first.recording == campaign / "recordings" / "S1-ER32_00_cut.h5"
    assert first.air == campaign / "recordings" / "S1-ER32_00_air.h5"
    assert second.air is None
    assert second.conditions.feed_angle == pytest.approx(np.radians(30.0))


@pytest.mark.parametrize(("text", "degrees"), [('"+X"', 0), ('"-X"', 180), ('"+Y"', 90), ('"-Y"', -90), ("-45.5", -45.5)])
def test_feed_directions(campaign, campaign_text, text, degrees):
    (campaign / "campaign.toml").write_text(campaign_text.replace('feed_direction = "+X"', f"feed_direction = {text}"))
    assert np.degrees(read_campaign(campaign).cuts[0].conditions.feed_angle) == pytest.approx(degrees)


def test_campaign_without_head(campaign, campaign_text):
    (campaign / "campaign.toml").write_text("\n".join(campaign_text.splitlines()[3:]))
    read = read_campaign(campaign)
    assert read.name == "campaign"
    assert read.sampling_rate is None


BROKEN_CAMPAIGNS = [
    ("[campaign]", "[campaign", ["line 1", "a TOML error"]),
    ("[campaign]", "[campagne]", ["campagne", "an unknown key", "did you mean campaign?"]),
    ("sampling_rate_hz", "sample_rate_hz", ["campaign.sample_rate_hz", "did you mean sampling_rate_hz?"]),
    ('"displacement"', '"displacment"', ["sensors.flange_x.quantity", '"displacment"', "did you mean displacement?"]),
    ('"displacement"\naxis = "X"', '"displacement"', ["sensors.flange_x.axis", "found nothing", "one of X, Y"]),
    ('axis = "X"', 'axis = "Z"', ["sensors.flange_x.axis", '"Z"', "one of X, Y"]),
    ('"displacement"\naxis = "X"', '"force"\naxis = "W"', ["sensors.flange_x.axis", '"W"', "one of X, Y, Z"]),
    ("sensitivity = 10.0e3", "sensitivity = 0", ["sensors.flange_x.sensitivity", "found 0", "other than 0"]),
    ("sensitivity = 10.0e3", "", ["sensors.flange_x.sensitivity", "found nothing"]),
    ("sensitivity = 10.0e3", "sensitivity = 1e4\ntooth_angle_deg = 0", ["sensors.flange_x.tooth_angle_deg", "an unknown key"]),
    ("delay_s = 1.0e-5", "delay_us = 10", ["sensors.fixture_x.delay_us", "did you mean delay_s?"]),
    ('[workpiece]\nname = "EN AW-6082"', "[workpiece]", ["workpiece.name", "found nothing"]),
    ('"toolings/S1-ER32.toml"', '"toolings/S2.toml"', ["toolings.S1-ER32", '"toolings/S2.toml"', "which does not exist"]),
    ('"toolings/S1-ER32.toml"', '"../S1.toml"', ["toolings.S1-ER32", "'../S1.toml'", "inside the campaign's folder"]),
    ('"toolings/S1-ER32.toml"', "3", ["toolings.S1-ER32", "found 3", "a path"]),
    ("S1-ER32_00_cut.h5", "S1-ER32_99_cut.h5", ["cuts[0].cut", "which does not exist", "an existing file"]),
    ('"recordings/S1-ER32_00_cut.h5"', '"/etc/passwd"', ["cuts[0].cut", "'/etc/passwd'", "relative to it"]),
    ('"recordings/S1-ER32_00_cut.h5"', '"recordings"', ["cuts[0].cut", "no file"]),
    ('"recordings/S1-ER32_00_cut.h5"', "'recordings\\a.h5'", ["cuts[0].cut", "with / and without .."]),
    ('"recordings/S1-ER32_00_cut.h5"', '"."', ["cuts[0].cut", "'.'"]),
    ('"recordings/S1-ER32_00_cut.h5"', '"a\\u0000b"', ["cuts[0].cut"]),
    ('"recordings/S1-ER32_00_cut.h5"', f'"{"a" * 5000}"', ["cuts[0].cut", "..."]),
    ('"recordings/S1-ER32_00_air.h5"', '"recordings/../../x.h5"', ["cuts[0].air", "without .."]),
    ('id = "S1-ER32-01"', 'id = "S1-ER32-00"', ["cuts[1].id", "the id of cuts[0]", "an id of its own"]),
    ('tooling = "S1-ER32"', 'tooling = "S1-ER23"', ["cuts[0].tooling", '"S1-ER23"', "did you mean S1-ER32?"]),
    ("axial_depth_mm = 0.4", "axial_depth = 0.4", ["cuts[0].axial_depth", "did you mean axial_depth_mm?"]),
    ("exit_angle_deg = 180.0", "exit_angle_deg = 90", ["cuts[0].exit_angle_deg", "found 90", "above entry_angle_deg, 90"]),
    ('feed_direction = "+X"', 'feed_direction = "X"', ["cuts[0].feed_direction", '"X"', "one of +X, -X, +Y, -Y"]),
    ('feed_direction = "+X"', "", ["cuts[0].feed_direction", "found nothing"]),
    ("[[cuts]]", "[[cut]]", ["cut", "an unknown key", "did you mean cuts?"]),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "words"), BROKEN_CAMPAIGNS, ids=[f"{i}-{w[0]}" for i, (_, _, w) in enumerate(BROKEN_CAMPAIGNS)])
def test_a_bad_campaign_is_answered_with_one_sentence(campaign, campaign_text, old, new, words):
    assert old in campaign_text
    (campaign / "campaign.toml").write_text(campaign_text.replace(old, new, 1))
    with pytest.raises(InputError) as error:
        read_campaign(campaign)
    assert str(campaign / "campaign.toml") in str(error.value)
    assert "\n" not in str(error.value)
    for word in words:
        assert word in str(error.value)


def test_a_campaign_without_sensors_or_cuts(campaign, campaign_text):
    start, end = campaign_text.index("[sensors.flange_x]"), campaign_text.index("[workpiece]")
    (campaign / "campaign.toml").write_text(campaign_text[:start] + "[sensors]\n" + campaign_text[end:])
    with pytest.raises(InputError, match="sensors: found none, allowed is at least one table"):
        read_campaign(campaign)
    (campaign / "campaign.toml").write_text(campaign_text[: campaign_text.index("[[cuts]]")])
    with pytest.raises(InputError, match="cuts: found nothing, allowed is tables"):
        read_campaign(campaign)


def test_an_error_in_a_tooling_names_the_tooling(campaign, tooling_text):
    (campaign / "toolings" / "S1-ER32.toml").write_text(tooling_text.replace("teeth = 4", "teeth = 0"))
    with pytest.raises(InputError, match=r"S1-ER32\.toml: cutter\.teeth: found 0"):
        read_campaign(campaign)


def test_links_lead_nowhere_outside(campaign, tmp_path):
    recording = campaign / "recordings" / "S1-ER32_00_cut.h5"
    recording.rename(tmp_path / "outside.h5")
    recording.symlink_to(tmp_path / "outside.h5")
    with pytest.raises(InputError, match=r"cuts\[0\]\.cut: .*a link that leads out of the folder"):
        read_campaign(campaign)
    recording.unlink()
    recording.symlink_to(recording)
    with pytest.raises(InputError, match=r"cuts\[0\]\.cut"):
        read_campaign(campaign)
    recording.unlink()
    recording.symlink_to("S1-ER32_00_air.h5")
    assert read_campaign(campaign).cuts[0].recording == recording


@pytest.mark.parametrize(("name", "words"), [("nowhere", "no such folder"), ("campaign/campaign.toml", "a file"), ("", "no such file")])
def test_a_folder_is_needed(campaign, tmp_path, name, words):
    with pytest.raises(InputError, match=words):
        read_campaign(tmp_path / name)


def test_reading_does_not_depend_on_the_working_directory(campaign, monkeypatch):
    monkeypatch.chdir(campaign.parent)
    assert read_campaign(Path("campaign")).cuts[0].recording.is_file()
    assert os.getcwd() == str(campaign.parent)


def test_a_dynamometer_also_feels_along_the_spindle(campaign):
    path = campaign / "campaign.toml"
    path.write_text(path.read_text().replace('"displacement"\naxis = "X"', '"force"\naxis = "Z"', 1))
    assert Dof.Z in {sensor.axis for sensor in read_campaign(campaign).sensors if sensor.quantity is Quantity.FORCE}


def test_a_sensor_that_is_turned_needs_its_neighbour(campaign, campaign_text):
    path = campaign / "campaign.toml"
    alone = campaign_text.replace("[sensors.flange_x]\n", "[sensors.flange_x]\nrotation_deg = -1.5\n")
    other = '[sensors.flange_y]\nquantity = "displacement"\naxis = "Y"\nsensitivity = 1.0\n[sensors.trigger]'
    told = alone.replace("[sensors.trigger]", other)
    path.write_text(told)
    found = {sensor.name: sensor.rotation for sensor in read_campaign(campaign).sensors}
    assert found.pop("flange_x") == pytest.approx(np.radians(-1.5))
    assert set(found.values()) == {0.0}
    path.write_text(alone)
    with pytest.raises(InputError, match=r"flange_x.rotation_deg: found -1.5, allowed is 0, or as many sensors along the other axis"):
        read_campaign(campaign)


def test_how_far_behind_the_flange_a_sensor_looks(campaign, campaign_text):
    path = campaign / "campaign.toml"

    def gap(*lines):
        path.write_text(campaign_text.replace("[sensors.flange_x]\n", "\n".join(["[sensors.flange_x]", *lines, ""])))
        (found,) = (each for each in read_campaign(campaign).sensors if each.quantity is Quantity.DISPLACEMENT)
        return found.distance, found.distance_spread

    assert gap() == (None, 1e-3)
    assert gap("distance_behind_flange_mm = 12.5") == pytest.approx((0.0125, 1e-3))
    assert gap("distance_behind_flange_mm = -8.0", "distance_spread_mm = 0.2") == pytest.approx((-0.008, 2e-4))
    assert gap("distance_behind_flange_mm = 0.0", "distance_spread_mm = 0.0") == (0.0, 0.0)


@pytest.mark.parametrize("key", ["distance_behind_flange_mm", "distance_spread_mm"])
def test_only_a_displacement_sensor_looks_somewhere(campaign, campaign_text, key):
    path = campaign / "campaign.toml"
    for name in ("fixture_x", "trigger"):
        path.write_text(campaign_text.replace(f"[sensors.{name}]\n", f"[sensors.{name}]\n{key} = 1.0\n"))
        with pytest.raises(InputError, match=rf"{name}.*{key}|{key}.*{name}"):
            read_campaign(campaign)


def test_what_an_accelerometer_is_fixed_to(campaign, campaign_text):
    text = campaign_text.replace(
        "[sensors.trigger]", '[sensors.other_x]\nquantity = "acceleration"\naxis = "X"\nsensitivity = 1.0\n[sensors.trigger]'
    )
    (campaign / "campaign.toml").write_text(text)
    with pytest.raises(InputError, match="role: found nothing, allowed is one of spindle, fixture, table, workpiece"):
        read_campaign(campaign)
    told = text.replace("[sensors.other_x]\n", '[sensors.other_x]\nrole = "spindle"\nmount_resonance_hz = 9000.0\n')
    told = told.replace("[sensors.fixture_x]\n", '[sensors.fixture_x]\nrole = "fixture"\n')
    (campaign / "campaign.toml").write_text(told)
    found = {sensor.name: sensor for sensor in read_campaign(campaign).sensors}
    assert (found["other_x"].role, found["other_x"].mount_resonance) == (Role.SPINDLE, 9000.0)
    assert found["fixture_x"].role is Role.FIXTURE
    (campaign / "campaign.toml").write_text(told.replace('role = "spindle"', 'role = "ceiling"'))
    with pytest.raises(InputError, match="role"):
        read_campaign(campaign)
    (campaign / "campaign.toml").write_text(campaign_text.replace("[sensors.flange_x]\n", '[sensors.flange_x]\nrole = "spindle"\n'))
    with pytest.raises(InputError, match="has one place"):
        read_campaign(campaign)


def test_two_accelerometers_on_the_workpieces_side_of_one_axis_are_refused(campaign, campaign_text):
    more = "".join(
        f'[sensors.{name}]\nquantity = "acceleration"\naxis = "X"\nsensitivity = 1.0\nrole = "{role}"\n'
        for name, role in (("on_table", "table"), ("on_part", "workpiece"))
    )
    told = campaign_text.replace("[sensors.fixture_x]\n", '[sensors.fixture_x]\nrole = "fixture"\n')
    (campaign / "campaign.toml").write_text(told.replace("[sensors.trigger]", f"{more}[sensors.trigger]"))
    words = r'sensors.on_table.role: found "table", as well as on_part on the workpiece along X, allowed is one accelerometer on table or'
    with pytest.raises(InputError, match=words) as error:
        read_campaign(campaign)
    assert "campaign.toml" in str(error.value)


def test_a_clock_that_is_off(campaign, campaign_text):
    assert read_campaign(campaign).clock_error == 0.0
    (campaign / "campaign.toml").write_text(campaign_text.replace("[campaign]\n", "[campaign]\nclock_error_percent = 0.1\n"))
    read = read_campaign(campaign)
    assert read.clock_error == pytest.approx(1e-3)
    recording = Recording(51200.0, np.zeros((10, 1)), read.sensors[:1])
    # it takes more samples in a second than it says
    assert read.clocked(recording).rate == pytest.approx(51251.2)
    (campaign / "campaign.toml").write_text(campaign_text.replace("[campaign]\n", "[campaign]\nclock_error_percent = 5.0\n"))
    with pytest.raises(InputError, match="clock_error_percent"):
        read_campaign(campaign)
