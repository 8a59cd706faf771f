"""A tool along a path over REST: as jobs what the commands write, bounded before they begin, and cancelled."""

from __future__ import annotations

import csv
import io
import json
from functools import partial

import numpy as np
import pytest

from api.jobs import job_context, paths
from api.jobs.worker import carry
from api.schemas.paths import PathMillingQuery, PathStabilityQuery, RemovalQuery
from api.work import path_answers
from api.work import paths as work
from rcsa_ident.base.errors import InputError
from rcsa_ident.io.paths.meshes import write_mesh
from rcsa_ident.io.settings.robots import robot_keys
from tests.api.identifying import Steps, carried, carriers
from tests.api.in_process import refused
from tests.fixtures import by_hand
from tests.fixtures.robots import TABLE_7, robot
from tests.fixtures.service import example

#: A slot, and beside it a step with a wall.
PROGRAM = """\
G21 G90 S8000 M3
G0 X-10 Y10 Z5
G0 Z-2
G1 X40 F960
G0 Z5
G0 X-10 Y17
G0 Z-3
G1 X40 F960
"""
BLOCK = [0.0, 0.0, -8.0, 30.0, 24.0, 0.0]
COARSE = {"block_mm": BLOCK, "cell_mm": 0.5, "step_mm": 2.0}
MATERIAL = {"cut": {"ktc_mpa": 700.0, "krc": 0.4}}
QUICK = COARSE | MATERIAL | {"method": "zero-order", "bands": False}


@pytest.fixture
def program(tmp_path):
    file = tmp_path / "PART.nc"
    file.write_text(PROGRAM)
    return file


def header(text):
    return next(csv.reader(io.StringIO(text)))


@pytest.mark.parametrize("model", [RemovalQuery, PathStabilityQuery, PathMillingQuery])
def test_examples_are_what_they_show(model):
    for shown in model.model_json_schema()["examples"]:
        model.model_validate_json(json.dumps(shown)).request("PATH.nc", PROGRAM, "")


def test_a_path_is_told_before_it_is_cut(client, program, tmp_path):
    told = client.path_told(program)
    assert (told.places, told.spindle_speed_told, told.warnings) == (7, True, [])
    assert told.length_mm == pytest.approx(7.0 + 50.0 + 7.0 + np.hypot(50.0, 7.0) + 8.0 + 50.0)
    assert (told.cutting_length_mm, told.time_s) == (pytest.approx(100.0), pytest.approx(100.0 / 16.0))
    assert (told.low_mm, told.high_mm) == ([-10.0, 10.0, -3.0], [40.0, 17.0, -2.0])
    assert told.path.places_mm[-1] == [40.0, 17.0, -3.0]
    assert told.path.line[-1] == 8
    assert told.path.rapid == [False, True, False, True, True, True, False]
    table = tmp_path / "PATH.csv"
    table.write_text("x_mm,y_mm,z_mm\n0,0,0\n10,0,0\n")
    bare = client.path_told(table)
    assert bare.time_s is None
    assert bare.warnings == ["1 moves have no feed", "1 moves have no spindle speed: give one"]
    program.write_text("G21 G90\nG41 X10\n")
    assert refused(422, client.path_told, program).errors[0].found.startswith("line 2")
    program.write_text("X" * (work.LARGEST_PATH + 1))
    refused(413, client.path_told, program)


def test_what_is_taken_out_is_told_and_drawn(client, store, tmp_path, program):
    client.write_tooling("T1", by_hand.TOOLING)
    job = client.cut_path("removal", program, "T1", **COARSE)
    assert (job.kind, job.machine, job.state) == ("path", "", "queued")
    carried(store, tmp_path)
    found = client.path_job(job.id)
    assert found.job.state == "done"
    answer = found.answer
    # a slot 12 mm wide, 2 mm deep, and a strip of 7 mm more, from the wall of the slot down to 3 mm, whose own floor is 1 mm lower
    slot, second = 30.0 * 12.0 * 2.0, 30.0 * (7.0 * 3.0 + 5.0 * 1.0)
    assert answer.removed_volume_mm3 == pytest.approx(slot + second, rel=1e-3)
    assert answer.left_volume_mm3 == pytest.approx(30.0 * 24.0 * 8.0 - slot - second, rel=1e-3)
    assert sum(answer.columns["removed_volume_mm3"]) == pytest.approx(answer.removed_volume_mm3, rel=1e-3)
    assert set(answer.columns["line"]) == {4.0, 8.0}
    way = np.array(answer.columns["way_mm"])
    assert np.all(np.diff(way) > 0.0)
    assert answer.path.way_mm[-1] == pytest.approx(client.path_told(program).length_mm, abs=1e-3)
    # each triangle of a floor belongs to the move that made it
    points, faces = (np.array(each).reshape(-1, 3) for each in (answer.part.points_mm, answer.part.triangles))
    assert 0 < len(faces) == len(answer.part.rows) <= path_answers.MOST_TRIANGLES
    middle, rows = points[faces].mean(axis=1), np.array(answer.part.rows)
    lines = np.where(rows >= 0, np.array(answer.columns["line"])[rows], 0.0)
    inside = (middle[:, 0] > 2.0) & (middle[:, 0] < 28.0)
    for low, high, z, line in ((5.0, 10.0, -2.0, 4.0), (12.0, 22.0, -3.0, 8.0)):
        floor = inside & (middle[:, 1] > low) & (middle[:, 1] < high) & (np.abs(middle[:, 2] - z) < 0.1)
        assert np.count_nonzero(floor) > 10
        assert set(lines[floor]) == {line}
    under = middle[:, 2] < -7.9
    assert set(rows[under]) == {-1}
    assert answer.tool_outline_mm[0][1] == 0.0
    assert answer.tool_outline_mm[-1] == [6.0, 60.0]
    assert header(client.path_table(job.id)) == [
        "x_mm", "y_mm", "z_mm", "slice_mm", "entry_angle_deg", "exit_angle_deg", "removed_volume_mm3",
    ]  # fmt: skip


def test_stability_is_what_the_command_writes(shop, store, tmp_path, program):
    client, id = shop
    job = client.cut_path("stability", program, "T1", id, **QUICK)
    carried(store, tmp_path)
    found = client.path_job(job.id)
    assert found.job.state == "done", found.job.problem
    answer, table = found.answer, client.path_table(job.id)
    rows = list(csv.DictReader(io.StringIO(table)))
    names = header(table)
    assert answer.rows == len(rows) == len(answer.columns["margin"])
    assert list(answer.columns) == [*names, "removed_volume_mm3", "way_mm", "length_mm"]
    for name in names:
        written = [float(row[name]) if row[name] else None for row in rows]
        for told, there in zip(answer.columns[name], written, strict=True):
            assert told == (there if there is None else pytest.approx(there, rel=1e-5))
    slot = np.array(answer.columns["line"]) == 4
    np.testing.assert_allclose(np.array(answer.columns["depth_mm"], dtype=float)[slot], 2.0, atol=0.02)
    assert answer.sentences[0].endswith(".")
    assert answer.status == ("chatter" if min(answer.columns["margin_low"]) < 1.0 else "stable")
    stages = [data["progress"]["stage"] for kind, data in client.events(job.id, "paths") if data.get("progress")]
    assert stages[-1] == "stability"


def test_on_a_robot_it_is_cut_too(client, store, tmp_path, program):
    client.write_robot("arm", robot_keys(robot("tx200")))
    client.write_tooling("T1", by_hand.TOOLING)
    # where that posture has the tip
    posture = np.degrees(TABLE_7).tolist()
    program.write_text("G21 G90 S8000 M3\nG0 X900 Y0 Z500\nG1 X910 F960\n")
    block = [890.0, -20.0, 480.0, 930.0, 20.0, 502.0]
    arm = {"robot": "arm", "posture_deg": posture}
    job = client.cut_path("stability", program, "T1", arm, **(QUICK | {"block_mm": block}))
    carried(store, tmp_path)
    found = client.path_job(job.id)
    assert found.job.state == "done", found.job.problem
    assert (found.answer.machine, found.job.machine) == ("arm", "")
    assert found.answer.rows > 0


def test_milling_is_told_turn_by_turn(shop, store, tmp_path, program):
    client, id = shop
    program.write_text("G21 G90 S8000 M3\nG0 X-7 Y20 Z-1\nG1 X8 F1920\n")
    job = client.cut_path("milling", program, "T1", id, block_mm=[0.0, 0.0, -4.0, 12.0, 24.0, 0.0], cell_mm=0.5, turn_steps=720, **MATERIAL)
    carried(store, tmp_path)
    found = client.path_job(job.id)
    assert found.job.state == "done", found.job.problem
    answer, table = found.answer, client.path_table(job.id)
    names = header(table)
    assert list(answer.columns) == [*names, "way_mm", "length_mm", "form_error_um"]
    assert answer.rows == len(table.splitlines()) - 1
    way, x = (np.array(answer.columns[name]) for name in ("way_mm", "x_mm"))
    np.testing.assert_allclose(way, x + 7.0, atol=1e-3)
    assert max(answer.part.rows) >= 0
    assert max(answer.columns["peak_force_n"]) > 50.0
    assert answer.status in ("stable", "chatter")
    # each turn begins where the one before it has ended
    np.testing.assert_allclose(np.array(answer.columns["length_mm"])[1:], np.diff(way), atol=1e-3)
    assert answer.columns["length_mm"][0] == 0.0


def test_the_weight_of_an_arm_may_be_left_out(monkeypatch, shop, store, tmp_path, program):
    client, id = shop
    told = []

    def milled(change, path, field, steps, play, weight, *further, **named):
        told.append((play, weight))
        raise InputError("path", "one", "another")

    monkeypatch.setattr(work, "mill_path", milled)
    for further in ({}, {"weight": False}, {"play": False}):
        client.cut_path("milling", program, "T1", id, **COARSE, **MATERIAL, **further)
    carried(store, tmp_path)
    assert told == [(True, True), (True, False), (False, True)]


def test_a_stock_may_be_a_surface(client, store, tmp_path, program):
    client.write_tooling("T1", by_hand.TOOLING)
    corners = 1e-3 * np.array([[x, y, z] for x in (0.0, 30.0) for y in (0.0, 24.0) for z in (-8.0, 0.0)])
    faces = np.array(
        [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
    )
    write_mesh(tmp_path / "BLOCK.stl", corners, faces)
    query = {"cell_mm": 0.5, "step_mm": 2.0}
    jobs = [
        client.cut_path("removal", program, "T1", stock=tmp_path / "BLOCK.stl", **query),
        client.cut_path("removal", program, "T1", **COARSE),
    ]
    carried(store, tmp_path)
    drawn, block = (client.path_job(each.id).answer for each in jobs)
    assert drawn.removed_volume_mm3 == pytest.approx(block.removed_volume_mm3, rel=1e-6)
    # one that is open
    write_mesh(tmp_path / "OPEN.stl", corners, faces[1:])
    problem = refused(422, client.cut_path, "removal", program, "T1", stock=tmp_path / "OPEN.stl")
    assert problem.errors[0].field == "stock"


@pytest.mark.parametrize(
    ("kind", "changed", "field"),
    [
        ("removal", {"block_mm": [0.0, 0.0, 0.0, 30.0, 24.0, -8.0]}, "block_mm"),
        ("removal", {"block_mm": [0.0] * 5}, "block_mm"),
        ("removal", {"block_mm": None}, "block_mm"),
        ("removal", {"cell_mm": 0.0}, "cell_mm"),
        ("removal", {"cell_mm": 0.001}, "cell_mm"),
        ("removal", {"cell_mm": 1e-200}, "cell_mm"),
        ("removal", {"cell_mm": 0.008, "step_mm": 0.01}, "cell_mm"),
        ("removal", {"step_mm": 0.0005}, "step_mm"),
        ("removal", {"further": 1}, "further"),
        ("removal", {"tooling": "T9"}, None),
        ("stability", {"spindle_speed_rpm": 1.0}, "spindle_speed_rpm"),
        ("stability", {"method": "guess"}, "method"),
        ("stability", {"cut": {"material": "cheese"}}, "material"),
        ("stability", {"cut": {"krc": 0.4, "ktc_mpa": -1.0}}, "cut.ktc_mpa"),
        ("stability", {"machine": None}, "machine"),
        ("milling", {"turn_steps": 20}, "turn_steps"),
        ("milling", {"cutoff_mm": 0.0}, "cutoff_mm"),
    ],
)
def test_what_cannot_be_cut_is_refused_by_its_field(shop, program, kind, changed, field):
    client, id = shop
    query = COARSE | ({"machine": id} if kind != "removal" else {}) | {"tooling": "T1"} | changed
    tooling = query.pop("tooling")
    problem = refused(404 if field is None else 422, client.cut_path, kind, program, tooling, **query)
    assert field is None or problem.errors[0].field == field, problem


@pytest.mark.slow
def test_files_that_are_none_are_refused(shop, program, tmp_path):
    client, id = shop
    for name, text, told in (
        ("PART.dxf", PROGRAM, "PART.dxf"),
        ("PART.nc", "G21\nG02 X1", "line 2"),
        ("PART.nc", "G21 G90\nG0 X1", ""),
        ("PART.csv", "x_mm,y_mm\n1,2\n", "z_mm"),
    ):
        (tmp_path / name).write_text(text)
        (fault,) = refused(422, client.cut_path, "removal", tmp_path / name, "T1", **COARSE).errors
        assert fault.field == "path"
        assert told in fault.found + fault.allowed
    # milled in time, each move needs a speed and what it takes is bounded
    program.write_text(PROGRAM.replace("S8000 M3", ""))
    assert refused(422, client.cut_path, "milling", program, "T1", id, **COARSE, **MATERIAL).errors[0].field == "spindle_speed_rpm"
    program.write_text(PROGRAM.replace("F960", "F1"))
    long = {"turn_steps": 20_000}
    assert refused(422, client.cut_path, "milling", program, "T1", id, **COARSE, **MATERIAL, **long).errors[0].field == "path"
    program.write_text("G21 G90 S8000 F96000\n" + "G1 X1\nG1 X0\n" * (work.MOST_PLACES // 2 + 1))
    assert "places" in refused(422, client.cut_path, "milling", program, "T1", id, **COARSE, **MATERIAL).errors[0].found
    program.write_text("X" * (work.LARGEST_PATH + 1))
    refused(413, client.cut_path, "removal", program, "T1", **COARSE)
    form = {"query": (None, json.dumps({"tooling": "T1", **COARSE}), "application/json")}
    assert refused(422, client.send, "POST", "/paths/removal", files=form).errors[0].field == "path"


def test_many_rows_are_thinned_to_the_worst(monkeypatch, shop, store, tmp_path, program):
    client, id = shop
    jobs = [client.cut_path("stability", program, "T1", id, **QUICK) for _ in range(2)]
    first, second = store.jobs.open()
    carry(store.jobs, carriers(store, tmp_path), "here", 3, first.id, lambda name, compute: compute())
    monkeypatch.setattr(path_answers, "MOST_ROWS", 7)
    carry(store.jobs, carriers(store, tmp_path), "here", 3, second.id, lambda name, compute: compute())
    whole, thin = (client.path_job(each.id).answer for each in jobs)
    assert len(whole.columns["margin"]) == whole.rows == thin.rows > 7
    assert len(thin.columns["margin"]) == 7
    assert min(thin.columns["margin_low"]) == min(whole.columns["margin_low"])
    assert max(thin.part.rows) <= 6
    # what neighbours made is told by the row that is left of them
    assert [each >= 0 for each in thin.part.rows] == [each >= 0 for each in whole.part.rows]


def test_a_repeated_request_begins_one_job(client, program):
    def send(key):
        files = {"query": (None, json.dumps({"tooling": example(), **COARSE}), "application/json"), "path": ("P.nc", program.read_bytes())}
        return client.http.post("/v1/paths/removal", files=files, headers={"Idempotency-Key": key})

    first, again = send("k"), send("k")
    assert first.status_code == again.status_code == 202
    assert first.json()["id"] == again.json()["id"]
    assert first.headers["Location"] == f"/v1/paths/{first.json()['id']}"
    program.write_text(PROGRAM.replace("X40", "X41"))
    assert send("k").status_code == 409


def test_there_is_an_end_to_long_work(client, store, tmp_path, program):
    client.write_tooling("T1", by_hand.TOOLING)
    job = client.cut_path("removal", program, "T1", **COARSE).id
    short = carriers(store, tmp_path) | {"path": partial(paths.carry, most=0.0)}
    carry(store.jobs, short, "here", 3, job, lambda name, compute: compute())
    found = client.path_job(job)
    assert (found.job.state, found.answer) == ("failed", None)
    (fault,) = found.job.problem.errors
    assert fault.field == "path"
    assert "(removal)" in fault.found
    assert "larger cells" in fault.allowed
    assert "bands" not in fault.allowed


def test_it_is_cancelled_while_it_waits_and_while_it_cuts(monkeypatch, client, store, tmp_path, program):
    client.write_tooling("T1", by_hand.TOOLING)
    waiting = client.cut_path("removal", program, "T1", **COARSE).id
    assert client.cancel_path(waiting).state == "cancelled"
    refused(409, client.cancel_path, waiting)
    refused(409, client.path_table, waiting)
    monkeypatch.setattr(job_context, "DELIVERY", 0.01)
    running = client.cut_path("removal", program, "T1", **(COARSE | {"step_mm": 0.01})).id
    context_of = work.remove_along

    def cancelled(tooling, path, field, step, progress):
        client.cancel_path(running)
        return context_of(tooling, path, field, step, progress)

    monkeypatch.setattr(work, "remove_along", cancelled)
    engine = Steps()
    carry(store.jobs, carriers(store, tmp_path), "here", 3, running, lambda name, compute: engine.remember(running, name, compute))
    found = client.path_job(running)
    assert (found.job.state, found.answer) == ("cancelled", None)
    refused(404, client.path_job, "x")
