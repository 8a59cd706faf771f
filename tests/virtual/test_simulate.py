import csv
import dataclasses
import hashlib
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.force import force_lines
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.front.samples import simulate_campaign as simulate
from rcsa_ident.io.curves.tips import read_tip
from rcsa_ident.io.recordings.readers import read_recording
from rcsa_ident.io.settings.machines import read_machine
from rcsa_ident.io.settings.setups import read_campaign
from rcsa_ident.signals.recording import Quantity, Role
from rcsa_ident.virtual.rotor import frequency_response, rotor


@pytest.fixture(scope="module")
def small(hpm):
    plan = dataclasses.replace(hpm.plan, spindle_speeds=(8200.0 * np.pi / 30.0, 15500.0 * np.pi / 30.0))
    return dataclasses.replace(hpm, plan=plan, toolings=hpm.toolings[:1], truth_toolings=())


@pytest.fixture(scope="module")
def written(small, tmp_path_factory):
    return simulate(small, tmp_path_factory.mktemp("run") / "campaign", seed=7)


@pytest.fixture(scope="module")
def turned(small):
    """Housing and bearings at angles of their own, and gyroscopic moments."""
    spindle = small.spindle
    bearings = tuple(dataclasses.replace(b, angle=np.radians(a)) for b, a in zip(spindle.bearings, (-17.0, -4.0, 11.0), strict=True))
    housing = dataclasses.replace(spindle.housing, angle=np.radians(14.0))
    return dataclasses.replace(small, spindle=dataclasses.replace(spindle, bearings=bearings, housing=housing, gyroscopic=True))


@pytest.fixture(scope="module")
def coupled(turned, tmp_path_factory):
    return simulate(turned, tmp_path_factory.mktemp("coupled") / "campaign", seed=7)


@pytest.fixture
def quick_truth(monkeypatch):
    """The truth at few frequencies, where a test does not look at it."""
    monkeypatch.setattr("rcsa_ident.workflows.simulate.TRUTH_FREQUENCIES", (100.0, 4500.0, 100.0))


def digest(folder):
    files = sorted(p for p in folder.rglob("*") if p.is_file())
    return {str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest() for p in files}


def true_records(result):
    with (result.truth / "records.csv").open() as file:
        rows = list(csv.DictReader(file))
    return {r["record"]: (float(r["spindle_speed_rpm"]) * np.pi / 30.0, np.radians(float(r["tooth_angle_deg"]))) for r in rows}


def receptances(path, omega):
    """The curves of a file of the truth by their names, at these frequencies."""
    header = path.read_text().splitlines()[0].split(",")
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    frequency = omega / (2.0 * np.pi)
    parts = {name: np.interp(frequency, table[:, 0], column) for name, column in zip(header[1:], table[:, 1:].T, strict=True)}
    return {name[:-3]: parts[name] + 1j * parts[f"{name[:-3]}_im"] for name in parts if name.endswith("_re")}


def lines(values, angle, orders):
    basis = np.exp(1j * np.outer(angle, orders))
    slow = np.linspace(-1.0, 1.0, angle.size)[:, None] ** np.arange(4)
    found = np.linalg.lstsq(np.hstack([basis.real, -basis.imag, slow]), values, rcond=None)[0]
    return found[: orders.size] + 1j * found[orders.size : 2 * orders.size]


@pytest.mark.witness
@pytest.mark.slow
@pytest.mark.parametrize("machine", ["written", "coupled"])
def test_recordings_hold_the_true_cross_receptance(machine, request):
    # what a reader of the folder, told speed and tooth angle, finds: cut minus air, against the analytic force of both axes
    result = request.getfixturevalue(machine)
    campaign, truth = read_campaign(result.folder), true_records(result)
    tooling = campaign.toolings["S1-ER32"]
    for cut in campaign.cuts:
        seen: dict[Dof, list] = {Dof.X: [], Dof.Y: []}
        for kind, path in (("cut", cut.recording), ("air", cut.air)):
            speed, start = truth[f"{cut.id}_{kind}"]
            recording = read_recording(path, campaign.sensors)
            orders = np.arange(1, int(2.0 * np.pi * 4300.0 / speed))
            angle = start + speed * recording.time
            for axis, lists in seen.items():
                gap = lines(recording.channel(Quantity.DISPLACEMENT, axis)[1], angle, orders)
                bend = lines(recording.channel(Quantity.ACCELERATION, axis)[1], angle, orders) / (orders * speed) ** 2
                lists.append(gap - bend)
        speed, _ = truth[f"{cut.id}_cut"]
        programmed = round(cut.conditions.spindle_speed * 30.0 / np.pi)
        name = "S1-ER32.csv" if machine == "written" else f"S1-ER32-{programmed}rpm.csv"
        for row, axis in enumerate("XY"):
            cut_lines, air_lines = seen[Dof(axis.lower())]
            orders = np.arange(1, min(cut_lines.size, air_lines.size) + 1)
            teeth = orders % 4 == 0
            found = (cut_lines[: orders.size] - air_lines[: orders.size])[teeth]
            conditions = dataclasses.replace(cut.conditions, spindle_speed=speed)
            force = force_lines(tooling.cutter, conditions, campaign.workpiece.coefficients, orders[teeth])
            h = receptances(result.truth / "cross" / name, orders[teeth] * speed)
            expected = h[axis] * force[:, row]
            if machine == "coupled":
                apart = np.linalg.norm(found - expected)
                expected = expected + h["XY" if axis == "X" else "YX"] * force[:, 1 - row]
                assert np.linalg.norm(found - expected) < 0.5 * apart
            assert np.linalg.norm(found - expected) < 1e-2 * np.linalg.norm(expected)


@pytest.mark.slow
def test_a_pair_on_the_housing_feels_what_a_fixture_there_would(small, tmp_path, quick_truth):
    """Of all records and from the campaign's own words: cuts of the same machine and the same chance whose fixture stands elsewhere."""
    sensors = dataclasses.replace(small.sensors, acceleration_noise=0.0)
    plan = dataclasses.replace(small.plan, spindle_speeds=small.plan.spindle_speeds[:1], duration=0.1)
    quiet = dataclasses.replace(small, sensors=sensors, plan=plan)
    spindles = dataclasses.replace(small.spindle, housing_positions=(0.35,)), dataclasses.replace(small.spindle, fixture_position=0.35)
    found = []
    for k, spindle in enumerate(spindles):
        campaign = read_campaign(simulate(dataclasses.replace(quiet, spindle=spindle), tmp_path / f"{k}", seed=7).folder)
        found.append((campaign, read_recording(campaign.cuts[0].recording, campaign.sensors)))
    (campaign, beside), (_, there) = found
    roles = {sensor.name: sensor.role for sensor in campaign.sensors if sensor.quantity is Quantity.ACCELERATION}
    assert roles == {"fixture_x": Role.FIXTURE, "fixture_y": Role.FIXTURE, "housing_x": Role.SPINDLE, "housing_y": Role.SPINDLE}
    for axis in (Dof.X, Dof.Y):
        felt, expected = (
            record.samples[:, record.sensors.index(record.accelerometer(axis, role))]
            for record, role in ((beside, Role.SPINDLE), (there, Role.FIXTURE))
        )
        assert np.std(felt - expected) < 1e-6 * np.std(expected)
        # 350 mm behind the housing tilts the other way
        fixed = beside.samples[:, beside.sensors.index(beside.accelerometer(axis, Role.FIXTURE))]
        assert np.std(felt - fixed) > 0.1 * np.std(fixed)


@pytest.mark.slow
def test_the_truth_of_a_coupled_machine_has_both_cross_terms_at_three_speeds(coupled, turned, tooling):
    names = {"S1-ER32.csv": 11850.0, "S1-ER32-8200rpm.csv": 8200.0, "S1-ER32-15500rpm.csv": 15500.0}
    assert {p.name for p in (coupled.truth / "tip").iterdir()} == {p.name for p in (coupled.truth / "cross").iterdir()} == set(names)
    omega = 2.0 * np.pi * np.array([700.0, 1500.0, 2900.0])
    for name, rpm in names.items():
        model = rotor(turned.spindle, tooling.assembly)
        values = frequency_response(model, omega, rpm * np.pi / 30.0, outputs=("tip.x", "tip.y"))
        written = receptances(coupled.truth / "tip" / name, omega)
        for key, (row, col) in {"X": (0, 0), "Y": (1, 1), "XY": (0, 1), "YX": (1, 0)}.items():
            assert written[key] == pytest.approx(values[:, row, col], rel=1e-7)
        tip = read_tip(coupled.truth / "tip" / name)
        there = np.searchsorted(tip.omega, omega - 1e-3)
        assert np.allclose(tip.values[there], values, rtol=1e-7)
    header = (coupled.truth / "spindle.csv").read_text().splitlines()[0].split(",")
    assert len(header) == 1 + 4 * 8
    assert header[17:19] == ["XY_tF_re", "XY_tF_im"]


@pytest.mark.slow
def test_true_forces_are_those_of_the_cut(written):
    campaign, truth = read_campaign(written.folder), true_records(written)
    cut = campaign.cuts[0]
    table = np.loadtxt(written.truth / "forces" / f"{cut.id}.csv", delimiter=",", skiprows=1)
    orders = table[:, 0].astype(int)
    conditions = dataclasses.replace(cut.conditions, spindle_speed=truth[f"{cut.id}_cut"][0])
    expected = force_lines(campaign.toolings[cut.tooling].cutter, conditions, campaign.workpiece.coefficients, orders)
    teeth = (orders % 4 == 0) & (orders > 0)
    found = table[:, [1, 3]] + 1j * table[:, [2, 4]]
    assert np.abs(found - expected)[teeth].max() < 5e-3 * np.abs(expected).max()


@pytest.mark.slow
def test_the_truth_lies_outside(written):
    assert written.cuts == 2
    assert written.truth.parent == written.folder.parent
    assert sorted(p.name for p in written.folder.iterdir()) == ["campaign.toml", "recordings", "toolings"]
    assert sorted(p.name for p in written.truth.iterdir()) == ["cross", "forces", "records.csv", "spindle.csv", "tip"]
    tip = np.loadtxt(written.truth / "tip" / "S1-ER32.csv", delimiter=",", skiprows=1)
    assert tip.shape == (900, 5)
    assert (tip[0, 0], tip[-1, 0]) == (5.0, 4500.0)


@pytest.mark.slow
def test_speeds_differ_from_the_programmed_and_from_each_other(written):
    truth = true_records(written)
    programmed = {cut.id: cut.conditions.spindle_speed for cut in read_campaign(written.folder).cuts}
    off = np.array([speed / programmed[record.rsplit("_", 1)[0]] - 1.0 for record, (speed, _) in truth.items()])
    assert np.unique(off).size == 4
    assert 1e-5 < np.abs(off).max() < 5e-3
    assert np.unique([angle for _, angle in truth.values()]).size == 4


@pytest.mark.slow
def test_same_seed_same_files_in_any_order(small, written, tmp_path):
    done = []
    with ThreadPoolExecutor(2) as pool:
        again = simulate(small, tmp_path / "a", seed=7, progress=lambda *step: done.append(step), mapper=pool.map)
    assert digest(again.folder) == digest(written.folder)
    assert digest(again.truth) == digest(written.truth)
    assert done == [(1, 2), (2, 2)]


@pytest.mark.slow
def test_another_seed_other_records(small, written, tmp_path, quick_truth):
    other, one = digest(simulate(small, tmp_path / "b", seed=8).folder), digest(written.folder)
    assert other.keys() == one.keys()
    assert {name for name in one if one[name] != other[name]} == {name for name in one if name.startswith("recordings/")}


@pytest.mark.slow
def test_one_more_speed_leaves_the_other_records(small, written, tmp_path, quick_truth):
    plan = dataclasses.replace(small.plan, spindle_speeds=(*small.plan.spindle_speeds, 1900.0))
    more = simulate(dataclasses.replace(small, plan=plan), tmp_path / "more", seed=7)
    assert digest(written.folder / "recordings").items() <= digest(more.folder / "recordings").items()


@pytest.mark.slow
def test_a_folder_with_content_is_left_alone(small, tmp_path):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine.txt").write_text("mine")
    with pytest.raises(InputError, match="empty"):
        simulate(small, tmp_path / "full")
    assert [p.name for p in tmp_path.iterdir()] == ["full"]


@pytest.mark.slow
def test_machine_with_everything(machines_folder, tmp_path, quick_truth):
    # trigger, lagging sensors, gyroscopic moments, edge forces, feed along Y: the campaign says so and can be read
    machine = read_machine(machines_folder / "stiff.toml")
    plan = dataclasses.replace(machine.plan, spindle_speeds=(1000.0,), duration=0.05, settling=0.02)
    result = simulate(dataclasses.replace(machine, plan=plan, toolings=machine.toolings[:1], truth_toolings=()), tmp_path / "out")
    campaign = read_campaign(result.folder)
    sensors = {sensor.name: sensor for sensor in campaign.sensors}
    assert sensors["trigger"].tooth_angle == pytest.approx(np.radians(35.0))
    assert sensors["flange_x"].bandwidth == 20000.0
    assert sensors["fixture_y"].delay == 1.5e-5
    assert campaign.cuts[0].conditions.feed_angle == pytest.approx(0.5 * np.pi)
    assert campaign.workpiece.coefficients.radial_edge == pytest.approx(6e3)
    recording = read_recording(campaign.cuts[0].recording, campaign.sensors)
    speed, start = true_records(result)["S1-ER32-00_cut"]
    rising = np.flatnonzero(np.diff(recording.channel(Quantity.TRIGGER)[1]) > 0.5) + 1
    late = np.mod(start + speed * rising / recording.rate - np.radians(35.0), 2.0 * np.pi)
    assert rising.size >= 7
    assert np.all(late <= speed / recording.rate * (1.0 + 1e-6))
