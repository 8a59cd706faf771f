"""What a writer writes, its reader gives back, whatever it is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from rcsa_ident.base.units import from_rpm, to_rpm
from rcsa_ident.cutting.conditions import EngagementMap
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.dynamics.coordinates import Coordinate
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.io.curves.exports import write_receptances_csv, write_receptances_uff
from rcsa_ident.io.curves.forces import read_forces_csv, write_forces_csv
from rcsa_ident.io.curves.frf_files import Source, read_tap_tests
from rcsa_ident.io.paths.meshes import read_mesh, write_mesh
from rcsa_ident.io.paths.path_forces import write_joints
from rcsa_ident.io.paths.tool_paths import read_tool_path, write_tool_path
from rcsa_ident.io.settings.cutters import CUTTER_KEYS, cutter_keys, cutter_of
from rcsa_ident.io.settings.engagements import engagement_map_of, rows_of_map
from rcsa_ident.io.settings.postures import read_postures, write_postures
from rcsa_ident.io.settings.robots import robot_keys, robot_of
from rcsa_ident.io.settings.tested_cuts import read_tested_cuts, write_tests
from rcsa_ident.io.text_columns import read_table
from rcsa_ident.io.toml_text import keys_of_toml, toml_of
from rcsa_ident.io.validated_table import Table
from rcsa_ident.stability.labels.coverage import Covered, TestedAnswers
from rcsa_ident.stability.labels.tested_cuts import TestedCuts, Verdict
from rcsa_ident.toolpath.path import RAPID, ToolPath
from tests.fixtures.robots import robot
from tests.toolpath.test_surface_kernels import box

BRIEF = settings(max_examples=15, deadline=None)
finite = st.floats(-1e12, 1e12)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("trips")


def rows(width: int, values: st.SearchStrategy, least: int = 1, most: int = 8) -> st.SearchStrategy[np.ndarray]:
    return st.integers(least, most).flatmap(lambda count: arrays(float, (count, width), elements=values))


@BRIEF
@given(rows(4, st.floats(allow_nan=False, allow_infinity=False)))
def test_forces(folder, values):
    time = np.arange(float(len(values)))
    write_forces_csv(folder / "F.csv", time, {"X": values[:, 0], "Y": values[:, 1]}, {"X": values[:, 2], "Y": values[:, 3]})
    found, force, deviation = read_forces_csv(folder / "F.csv")
    np.testing.assert_array_equal(found, time)
    np.testing.assert_array_equal(np.stack([force["X"], force["Y"], deviation["X"], deviation["Y"]], axis=1), values)


@BRIEF
@given(rows(3, st.floats(0.01, 100.0)), st.lists(st.sampled_from(list(Verdict)), min_size=8, max_size=8))
def test_tested_cuts(folder, values, verdicts):
    cuts = TestedCuts(100.0 * values[:, 0], 1e-3 * values[:, 1], tuple(verdicts[: len(values)]), np.full(len(values), np.nan))
    stable = np.clip(0.01 * values[:, 2], 0.0, 1.0)
    write_tests(folder / "T.csv", cuts, TestedAnswers(stable, (Covered.PARTLY,) * stable.size))
    found = read_tested_cuts(folder / "T.csv")
    np.testing.assert_allclose(found.spindle_speed, cuts.spindle_speed, rtol=1e-9)
    np.testing.assert_allclose(found.axial_depth, cuts.axial_depth, rtol=1e-9)
    assert found.verdict == cuts.verdict


moves = st.tuples(*(st.floats(-5.0, 5.0),) * 3, st.sampled_from([RAPID, 0.05, 1e-3, np.nan]), st.sampled_from([0.0, 900.0, np.nan]))


@BRIEF
@given(st.lists(moves, min_size=2, max_size=6, unique_by=lambda row: row[:3]), st.booleans(), st.integers(0, 10**6))
def test_a_path_as_a_table(folder, told, leans, seed):
    values = np.array(told)
    axes = np.random.default_rng(seed).normal(size=(len(values), 3)) if leans else None
    path = ToolPath(values[:, :3], axes, feed=values[:, 3], speed=values[:, 4])
    write_tool_path(folder / "P.csv", path)
    found = read_tool_path(folder / "P.csv")
    np.testing.assert_allclose(found.places, path.places, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(found.axes, path.axes, rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(found.feed, path.feed, rtol=1e-6)
    np.testing.assert_allclose(found.speed, path.speed, rtol=1e-9)
    if not leans:
        # and once more nothing changes at all; of axes the last digits do, since they are made unit vectors
        write_tool_path(folder / "Q.csv", found)
        assert (folder / "Q.csv").read_bytes() == (folder / "P.csv").read_bytes()


@BRIEF
@given(rows(6, st.floats(-1.5, 1.5)))
def test_postures(folder, postures):
    arm = robot("tx200")
    low, high = np.array([joint.limits for joint in arm.joints]).T
    postures = 0.5 * (low + high) + 0.3 * (high - low) * postures
    write_postures(folder / "Q.csv", postures, arm)
    np.testing.assert_allclose(read_postures(folder / "Q.csv", arm), postures, rtol=0.0, atol=1e-6)


@BRIEF
@given(rows(6, st.floats(-1.5, 1.5)))
def test_joints_over_time(folder, postures):
    times = 0.25 * np.arange(len(postures))
    write_joints(folder / "J.csv", times, postures)
    table = read_table(folder / "J.csv", "joints")
    found = np.stack(table.columns(table.header), axis=1)
    np.testing.assert_array_equal(found[:, 0], times)
    np.testing.assert_allclose(np.radians(found[:, 1:]), postures, rtol=0.0, atol=1e-11)


@pytest.mark.parametrize("name", ["tx200", "kr210", "kr500"])
@BRIEF
@given(factor=st.floats(0.1, 10.0))
def test_robots(name, factor):
    """An arm whose springs are others, through TOML."""
    keys = robot_keys(robot(name))
    for joint in keys["joints"]:
        joint["stiffness_nm_per_rad"] = factor * joint["stiffness_nm_per_rad"]
    once = robot_keys(robot_of(keys_of_toml(toml_of(keys), "robot"), "R.toml"))
    again = robot_keys(robot_of(keys_of_toml(toml_of(once), "robot"), "R.toml"))
    assert toml_of(again, digits=9) == toml_of(once, digits=9) == toml_of(keys, digits=9)


@pytest.mark.parametrize("kind", ["stl", "obj", "ply"])
@BRIEF
@given(low=arrays(float, 3, elements=st.floats(-0.5, 0.5)), size=arrays(float, 3, elements=st.floats(1e-3, 0.5)))
def test_surfaces(folder, kind, low, size):
    points, faces = box(low, low + size)
    write_mesh(folder / f"m.{kind}", points, faces)
    found, corners, _ = read_mesh(folder / f"m.{kind}")
    assert len(corners) == len(faces)
    # single precision, in millimetres
    np.testing.assert_allclose([found.min(axis=0), found.max(axis=0)], [low, low + size], rtol=0.0, atol=2e-7)


@BRIEF
@given(
    teeth=st.integers(1, 8),
    diameter=st.floats(1.0, 100.0),
    helix=st.floats(0.0, 60.0),
    runout=st.floats(0.0, 20.0),
    seed=st.integers(0, 10**6),
)
def test_cutters(teeth, diameter, helix, runout, seed):
    rng = np.random.default_rng(seed)
    pitch = rng.uniform(0.8, 1.2, teeth)
    cutter = Cutter(
        teeth,
        1e-3 * diameter,
        np.radians(helix),
        pitch=2.0 * np.pi * pitch / pitch.sum(),
        runout=1e-6 * runout * rng.uniform(-1.0, 1.0, teeth),
    )
    keys = keys_of_toml(toml_of({"cutter": cutter_keys(cutter)}), "tooling")["cutter"]
    found = cutter_of(Table(keys, "T.toml", "cutter", CUTTER_KEYS))
    assert (found.teeth, found.diameter) == (teeth, pytest.approx(cutter.diameter, rel=1e-9))
    np.testing.assert_allclose(found.helix, cutter.helix, rtol=1e-9)
    np.testing.assert_allclose(found.pitch, cutter.pitch, rtol=1e-9)
    np.testing.assert_allclose(found.runout, cutter.runout, rtol=0.0, atol=1e-12)


@BRIEF
@given(rows(2, st.floats(0.0, 1.0)))
def test_engagement_maps(values):
    entry = 170.0 * values[:, 0]
    told = engagement_map_of(0.5 * np.arange(float(len(values))), entry, entry + 1.0 + (179.0 - entry) * values[:, 1])
    again = rows_of_map(told)
    found = engagement_map_of(again[:, 0], again[:, 1], again[:, 2])
    assert isinstance(found, EngagementMap)
    np.testing.assert_allclose(rows_of_map(found), again, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("suffix", ["csv", "uff", "uff-binary"])
@BRIEF
@given(values=rows(4, st.floats(-1e-3, 1e-3), least=2))
def test_receptances(folder, suffix, values):
    omega = 2.0 * np.pi * np.linspace(500.0, 900.0, len(values))
    planes = {}
    for axis, re, im in (("X", values[:, 0], values[:, 1]), ("Y", values[:, 2], values[:, 3])):
        where = (Coordinate.parse(f"tip.{axis.lower()}"),)
        planes[axis] = Receptance(omega, (re + 1j * im)[:, None, None], where, where)
    path = folder / f"r.{suffix[:3]}"
    if suffix == "csv":
        write_receptances_csv(path, planes)
    else:
        write_receptances_uff(path, planes, "found", suffix.endswith("binary"))
    found = read_tap_tests([Source(path)])
    for axis, plane in planes.items():
        frequency, value = found[axis, axis]
        # an even abscissa has six digits in a universal file
        np.testing.assert_allclose(2.0 * np.pi * frequency, omega, rtol=1e-9 if suffix == "csv" else 2e-6)
        np.testing.assert_allclose(value, plane.values[:, 0, 0], rtol=1e-9, atol=1e-15)


@BRIEF
@given(st.floats(1.0, 1e5))
def test_speeds(rpm):
    assert float(to_rpm(from_rpm(rpm))) == pytest.approx(rpm, rel=1e-14)
