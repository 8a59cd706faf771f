"""Every file that the pages of formats offer is read by the program, and says what it should."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import rcsa_ident as ri
from rcsa_ident.base.units import to_hz, to_rpm
from rcsa_ident.io.curves.exports import TAP_SUFFIXES
from rcsa_ident.io.curves.flanges import read_flange_machine
from rcsa_ident.io.curves.forces import read_forces_csv
from rcsa_ident.io.curves.frf_files import read_frfs
from rcsa_ident.io.curves.tips import read_frf_csv, read_lobes_csv
from rcsa_ident.io.paths.meshes import MESHES, read_mesh
from rcsa_ident.io.paths.path_forces import read_path_forces
from rcsa_ident.io.paths.tool_paths import PROGRAMS, read_tool_path
from rcsa_ident.io.recordings.open_recording import TEXT, open_recording
from rcsa_ident.io.recordings.readers import READERS, SOUND, read_cut, read_signals
from rcsa_ident.io.recordings.robot_records import read_joint_record
from rcsa_ident.io.results.learnt_tips import read_learnt_tip
from rcsa_ident.io.results.parts import read_result
from rcsa_ident.io.settings.cases import read_cases
from rcsa_ident.io.settings.engagements import read_engagement_map
from rcsa_ident.io.settings.machines import read_machine
from rcsa_ident.io.settings.modes import read_modes_file
from rcsa_ident.io.settings.postures import read_postures
from rcsa_ident.io.settings.robot_static import read_static_tests
from rcsa_ident.io.settings.spindle_drives import read_spindle_drive
from rcsa_ident.io.settings.tested_cuts import read_tested_cuts
from rcsa_ident.io.settings.tool_libraries import read_tool_library
from rcsa_ident.io.settings.urdf import read_urdf
from rcsa_ident.io.text_columns import read_table
from tests.fixtures.paths import ROOT

FORMATS = ROOT / "docs" / "formats"
EXAMPLES = FORMATS / "examples"
FILES = sorted(path for path in EXAMPLES.rglob("*") if path.is_file())
CHANNELS = ("flange_x", "fixture_x")
#: Standard deviations of both channels [V], rate [Hz], and sensitivities [V/m, V/(m/s^2)].
DEVIATIONS, RATE, SENSITIVITIES = (1.41795e-2, 6.42864e-4), 25_600.0, (10e3, 1.1094e-3)
#: Largest compliance of the tip [m/N] and where it stands [Hz]; a line on 10 Hz has it to 0.2 %.
PEAK, PEAK_HZ = 1.1926e-6, 820.0


def names(pattern: str) -> list[Path]:
    found = sorted(EXAMPLES.glob(pattern))
    assert found, pattern
    return found


def test_examples_are_small_and_each_is_offered_by_a_page():
    assert max(path.stat().st_size for path in FILES) <= 60_000
    pages = "".join(path.read_text("utf-8") for path in FORMATS.glob("*.md"))
    offered = set(re.findall(r"\{download\}`[^`<]*<?examples/([^`>]+)>?`", pages))
    assert offered == {str(path.relative_to(EXAMPLES)) for path in FILES}


def test_every_suffix_that_is_read_has_an_example():
    suffixes = {path.suffix for path in FILES}
    assert {*READERS, *TEXT, *MESHES, *PROGRAMS, *TAP_SUFFIXES} <= suffixes


@pytest.mark.parametrize("path", names("cut*.*"), ids=lambda path: path.name)
def test_recordings_are_the_same_in_every_format(path):
    rate, signals = read_signals(path, CHANNELS)
    assert rate == RATE
    assert [len(values) for values in signals] == [1024, 1024]
    np.testing.assert_allclose([np.std(values[:]) for values in signals], DEVIATIONS, rtol=1e-5)


@pytest.mark.parametrize("path", names("logger.*"), ids=lambda path: path.name)
def test_tables_tell_their_units(path):
    opened = open_recording(path)
    assert opened.rate == RATE
    assert [(each.name, each.unit) for each in opened.channels] == [("flange_x", "um"), ("fixture_x", "m/s^2")]
    si = np.array(DEVIATIONS) / SENSITIVITIES
    np.testing.assert_allclose([np.std(each.samples) for each in opened.channels], si, rtol=1e-4)


@pytest.mark.parametrize("path", names("sound.*"), ids=lambda path: path.name)
def test_sound_has_its_two_tones(path):
    assert path.suffix in SOUND
    rate, (values,) = read_signals(path, ["ch1"])
    line = np.abs(np.fft.rfft(values[:])) / (0.5 * len(values))
    frequency = np.fft.rfftfreq(len(values), 1.0 / rate)
    assert (rate, len(values)) == (48_000.0, 4800)
    assert frequency[line.argmax()] == 530.0
    assert line[frequency == 1280.0].item() == pytest.approx(0.1, rel=0.06)


def test_the_wave_file_names_its_track():
    assert read_signals(EXAMPLES / "sound.wav", ["microphone"])[0] == 48_000.0


@pytest.mark.parametrize(("name", "axes"), [("FRF.csv", "XY"), ("tap.uff", "XY"), ("tap.unv", "XY"), ("tap_x.frf", "")])
def test_receptances_have_their_peak(name, axes):
    tests = read_frfs(EXAMPLES / name)
    assert "".join(test.response for test in tests) == axes
    size = np.abs(tests[0].values)
    assert tests[0].frequency[size.argmax()] == PEAK_HZ
    assert size.max() == pytest.approx(PEAK, rel=2e-3)


def test_hits_give_the_same_receptance():
    found = ri.tap(EXAMPLES / "hits.csv")
    assert str(found).startswith("receptance X from 2 of 2 hits")
    assert np.abs(found.receptance).max() == pytest.approx(PEAK, rel=0.01)
    assert to_hz(found.omega[np.abs(found.receptance).argmax()]) == pytest.approx(PEAK_HZ, abs=5.0)


@pytest.mark.parametrize("path", names("stock.*"), ids=lambda path: path.name)
def test_bodies_are_a_block(path):
    points, faces, _ = read_mesh(path)
    assert points.shape == (8, 3)
    assert faces.shape == (12, 3)
    np.testing.assert_allclose([points.min(axis=0), points.max(axis=0)], [[0, 0, -0.01], [0.04, 0.02, 0.0]], atol=1e-9)


@pytest.mark.parametrize("path", names("program.*"), ids=lambda path: path.name)
def test_programs_go_the_same_way(path):
    found = read_tool_path(path)
    feeding = found.feed[1:] < np.inf
    length = np.linalg.norm(found.moves, axis=1)[feeding].sum()
    assert length == pytest.approx(0.120 + 0.004 * np.pi, rel=1e-4)
    assert to_rpm(float(found.speed[-2])) == pytest.approx(8000.0)


def test_paths_and_forces_along_them():
    path = read_tool_path(EXAMPLES / "PATH.csv")
    assert path.places[-1].tolist() == [-0.01, 0.014, -0.001]
    assert np.isinf(path.feed[1])
    assert path.feed[2] == pytest.approx(0.02)
    forces = read_path_forces(EXAMPLES / "FORCES_along_path.csv", path)
    assert forces.force[0].tolist() == [-58.0, -130.0, 35.0]


def test_toolings_modes_machines_and_cases():
    tooling = ri.read_tooling(EXAMPLES / "TOOLING.toml")
    assert tooling.assembly.stickout == pytest.approx(70.5e-3)
    assert tooling.spread.stickout == pytest.approx(0.3e-3)
    assert np.abs(read_modes_file(EXAMPLES / "MODES.toml").modes.pole) == pytest.approx(
        2 * np.pi * np.array([820.0, 1580.0, 779.0, 1501.0])
    )
    assert read_machine(EXAMPLES / "MACHINE.toml").name == "HPM sample machine"
    (case,) = read_cases(EXAMPLES / "CASES.toml")
    assert [str(verdict) for verdict in case.cuts.verdict] == ["stable", "chatter", "marginal", "stable"]


def test_the_campaign_reads_whole():
    campaign = ri.read_campaign(EXAMPLES / "campaign")
    assert [str(sensor.quantity) for sensor in campaign.sensors] == ["displacement", "acceleration"]
    (cut,) = campaign.cuts
    recording, air = read_cut(campaign.sensors, campaign.sampling_rate, cut)
    assert recording.samples.shape == air.samples.shape == (7168, 2)
    assert to_rpm(cut.conditions.spindle_speed) == pytest.approx(8000.0)
    assert campaign.tests[0].id == "EM12, tip"


def test_tables():
    assert np.nanmax(to_hz(read_tested_cuts(EXAMPLES / "CUTS.csv").chatter_frequency)) == pytest.approx(871.0)
    assert read_spindle_drive(EXAMPLES / "SPINDLE.csv").power.max() == 10_000.0
    assert np.degrees(read_engagement_map(EXAMPLES / "MAP.csv").start).round(9).tolist() == [120.0, 100.0, 90.0]
    flange = read_flange_machine(EXAMPLES / "FLANGE.csv")
    assert [str(part.coordinates[0].dof) for part in flange.parts] == ["x", "y"]
    assert read_result(EXAMPLES / "RESULT.json")["status"] in ("converged", "suspect")


def test_what_labels_have_taught():
    learnt = read_learnt_tip(EXAMPLES / "LEARNT.json")
    assert learnt.prior.modes.pole.size == 2
    assert [str(verdict) for verdict in learnt.cuts.verdict] == ["stable", "chatter", "marginal", "stable"]
    assert learnt.posterior.z.shape == (300, 8)


def test_what_commands_write():
    lobes = read_lobes_csv(EXAMPLES / "LOBES.csv")
    assert lobes.speed[[0, -1]].tolist() == [4000.0, 16_000.0]
    assert {"recommended_depth_mm", "flip"} <= set(lobes.extra)
    tip = read_frf_csv(EXAMPLES / "TIP.csv")
    assert set(tip.values) == {"X", "Y"}
    assert {"X_re_std", "Y_im_std"} <= set(tip.bands)
    time, force, deviation = read_forces_csv(EXAMPLES / "FORCES.csv")
    assert time.size == 200
    assert set(force) == set(deviation) == {"X", "Y"}
    removed = read_table(EXAMPLES / "ENGAGEMENT.csv", "engagement")
    (volume,) = removed.columns(["removed_volume_mm3"])
    # two lines beside each other, 1 mm deep, all of the block's width and the arc behind it in the air
    assert volume.sum() == pytest.approx(40.0 * 20.0, rel=0.01)
    margin, depth = read_table(EXAMPLES / "STABILITY.csv", "stability").columns(["margin", "depth_mm"])
    # the first line is a slot, and chatters
    assert np.nanmin(margin) == pytest.approx(0.6016, abs=2e-4)
    assert np.nanmax(margin) == 4.0
    assert set(depth[np.isfinite(depth)]) == {1.0}


def test_robots():
    robot = ri.read_robot(EXAMPLES / "ROBOT.toml")
    assert len(robot.joints) == 6
    stiffness = [joint.stiffness for joint in robot.joints]
    arm, _ = read_urdf(EXAMPLES / "ARM.urdf", stiffness, [0.0] * 6)
    np.testing.assert_allclose([joint.axis for joint in arm.joints], [joint.axis for joint in robot.joints], atol=1e-9)
    assert read_postures(EXAMPLES / "POSTURES.csv", robot).shape == (2, 6)
    assert read_static_tests(EXAMPLES / "ARM.csv", 6).name == "ARM.csv"
    record = read_joint_record(EXAMPLES / "MOTION.csv")
    np.testing.assert_allclose(record.torque[0], 4.6e6 * (record.motor - record.joint)[0], rtol=1e-3, atol=20.0)


@pytest.mark.parametrize("name", ["LIBRARY.json", "LIBRARY.tools", "ISO13399.json"])
def test_tool_libraries(name):
    (entry,) = read_tool_library(EXAMPLES / name)
    assert entry.tooling.cutter.teeth == (5 if name == "ISO13399.json" else 4)
