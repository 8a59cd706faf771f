"""What changes on a virtual machine from cut to cut: warmth against closed forms, joints and chips against their laws."""

import dataclasses
import tomllib
from datetime import datetime

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import from_rpm
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.io.settings.machines import read_machine
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.io.settings.simulations import campaign_text
from rcsa_ident.virtual.changes import REFERENCE_SPEED, Changes, ChipLaw, JointChanges, Turn, Warming, changed, course_of
from rcsa_ident.virtual.milling import mill_cut, rigid_force_lines
from rcsa_ident.virtual.rotor import rotor
from rcsa_ident.workflows.simulate import simulate

SOFT = Warming(0.1, time_constant=600.0)
COLD = Turn(0, 0, 0.0, (0.0, 0.0, 0.0))


def plan_of(hpm, *rpm, duration=0.06):
    """The machine's plan with other speeds."""
    return dataclasses.replace(hpm.plan, spindle_speeds=tuple(from_rpm(each) for each in rpm), duration=duration, settling=0.05)


def warmth(hpm, warming, *rpm):
    """Of each bearing in each cut, shape (cuts, bearings)."""
    return np.array([turn.warmth for turn in course_of(plan_of(hpm, *rpm), hpm.spindle, Changes(warming), 1, 1)])


@pytest.fixture(scope="module")
def small(hpm):
    """Two speeds of two toolings, quickly simulated."""
    return dataclasses.replace(hpm, plan=plan_of(hpm, 9000.0, 15_000.0), truth_toolings=())


def records(setup, seed=3):
    """All samples of a campaign by record and channel."""
    toolings = [read_tooling(path) for path in setup.toolings]
    found = {}
    for cut in simulate(setup, toolings, seed):
        found |= {(cut.id, kind, name): each for kind, record in cut.records.items() for name, each in record.channels.items()}
    return found


def test_all_bearings_end_as_warm_as_the_reference_speed_makes_them(hpm):
    long = dataclasses.replace(SOFT, running=200.0 * SOFT.time_constant)
    np.testing.assert_allclose(warmth(hpm, long, 14_000.0), 1.0, rtol=1e-6)
    # and at other speeds as friction goes
    np.testing.assert_allclose(warmth(hpm, long, 7000.0), 0.5**1.25, rtol=1e-6)
    assert pytest.approx(from_rpm(14_000.0)) == REFERENCE_SPEED


def test_a_bearing_warms_against_a_cold_housing_first(hpm):
    """In front of the housing's own warming it follows 1 - e^(-t / tau) of its share, which that only adds to."""
    alone = 4.0 / 5.0
    for share in (1e-3, 0.1, 1.0):
        found = warmth(hpm, dataclasses.replace(SOFT, running=2.0 * share * SOFT.time_constant), 14_000.0)
        least = alone * (1.0 - np.exp(-share))
        assert np.all((found >= least * (1.0 - 1e-9)) & (found < 1.0))
        if share < 0.01:
            np.testing.assert_allclose(found, least, rtol=1e-3)


def test_what_stands_still_cools_and_a_warm_up_makes_cuts_alike(hpm):
    rpm = (14_000.0,) * 12
    cold, paused = (warmth(hpm, dataclasses.replace(SOFT, pause=pause), *rpm)[:, 0] for pause in (0.0, 300.0))
    assert np.all(np.diff(cold) > 0.0)
    assert np.all(paused[1:] < cold[1:])
    assert paused[0] == cold[0]
    warm = warmth(hpm, dataclasses.replace(SOFT, pause=0.0, warm_up=100.0 * SOFT.time_constant), *rpm)[:, 0]
    assert np.ptp(warm) < 1e-6


def test_the_order_is_random_only_where_it_shall_be_and_the_same_with_the_same_seed(hpm):
    plan, spindle = plan_of(hpm, *np.linspace(8000.0, 20_000.0, 9)), hpm.spindle
    shuffled = Changes(dataclasses.replace(SOFT, shuffled=True))
    one, same, other = ([(t.tooling, t.cut) for t in course_of(plan, spindle, shuffled, 2, seed)] for seed in (4, 4, 5))
    assert one == same != other
    in_order = [(t, k) for t in range(2) for k in range(9)]
    assert sorted(one) == in_order
    assert [tooling for tooling, _ in one] == [0] * 9 + [1] * 9
    for changes in (Changes(), Changes(SOFT)):
        assert [(t.tooling, t.cut) for t in course_of(plan, spindle, changes, 2, 4)] == in_order


def test_a_thermometer_shows_the_warmth_in_degrees_and_its_noise_has_a_seed(hpm):
    plan, spindle = plan_of(hpm, *np.linspace(8000.0, 20_000.0, 40)), hpm.spindle
    exact, noisy = dataclasses.replace(SOFT, rise=15.0, reading=0.0), dataclasses.replace(SOFT, rise=15.0, reading=0.5)
    course = course_of(plan, spindle, Changes(exact), 2, 4)
    np.testing.assert_allclose([turn.temperature for turn in course], [22.0 + 15.0 * turn.warmth[0] for turn in course])
    one, same, other = (np.array([t.temperature for t in course_of(plan, spindle, Changes(noisy), 2, seed)]) for seed in (4, 4, 5))
    np.testing.assert_array_equal(one, same)
    off = one - [turn.temperature for turn in course]
    assert 0.35 < np.std(off) < 0.65
    assert not np.any(one == other)
    assert {turn.temperature for turn in course_of(plan, spindle, Changes(SOFT), 1, 4)} == {None}


def test_the_campaign_tells_when_its_cuts_began_and_how_warm_it_was(small):
    """Each turn of 60 s is recorded in its middle and followed by a pause of 20 s."""
    toolings = [read_tooling(path) for path in small.toolings]
    found = tomllib.loads(campaign_text(dataclasses.replace(small, changes=Changes(dataclasses.replace(SOFT, rise=15.0))), toolings, 3))
    began = [datetime.fromisoformat(cut["started"]) for cut in found["cuts"]]
    assert [(each - began[0]).total_seconds() for each in began] == [80.0 * k for k in range(4)]
    assert (began[0] - datetime(2026, 1, 5, 8)).total_seconds() == pytest.approx(30.0 - 0.5 * 0.06)
    assert all(21.0 < cut["temperature_c"] < 40.0 for cut in found["cuts"])
    blind, steady = (
        tomllib.loads(campaign_text(dataclasses.replace(small, changes=each), toolings, 3)) for each in (Changes(SOFT), Changes())
    )
    assert [cut["started"] for cut in blind["cuts"]] == [cut["started"] for cut in found["cuts"]]
    assert not any("temperature_c" in cut for cut in blind["cuts"])
    assert not any("started" in cut for cut in steady["cuts"])


def test_bearings_lose_their_share_of_stiffness_and_all_else_stays(hpm):
    turn = Turn(0, 0, 0.0, (1.0, 0.5, 0.0))
    found = changed(hpm.spindle, Changes(SOFT), turn, 0.0)
    for before, after, left in zip(hpm.spindle.bearings, found.bearings, (0.9, 0.95, 1.0), strict=True):
        np.testing.assert_allclose(after.stiffness, left * np.array(before.stiffness))
        assert dataclasses.replace(after, stiffness=before.stiffness) == before
    assert dataclasses.replace(found, bearings=hpm.spindle.bearings) == hpm.spindle


def test_a_joint_gives_way_with_amplitude_and_differs_from_clamping_to_clamping(hpm):
    changes, joint = Changes(joint=JointChanges(0.2, 1e-7, 0.05)), hpm.spindle.joint
    for clamping, amplitude, share in ((0.0, 0.0, 1.0), (0.0, 1e-7, 0.9), (0.0, 1.0, 0.8), (0.1, 0.0, np.exp(0.1))):
        found = changed(hpm.spindle, changes, COLD, clamping, amplitude).joint
        assert found.translational_stiffness == pytest.approx(share * joint.translational_stiffness, rel=1e-6)
        assert found.rotational_stiffness == pytest.approx(share * joint.rotational_stiffness, rel=1e-6)
        assert found.translational_damping == joint.translational_damping


@pytest.mark.slow
def test_an_untouched_machine_gives_the_same_records_to_the_last_bit(small):
    plain = records(small)
    for changes in (Changes(), Changes(chip_law=ChipLaw(0.0))):
        again = records(dataclasses.replace(small, changes=changes))
        assert again.keys() == plain.keys()
        for name, values in plain.items():
            np.testing.assert_array_equal(again[name], values)


@pytest.mark.slow
def test_each_change_shows_in_the_records_and_the_campaign_keeps_their_order(small):
    plain = records(small)
    warm = dataclasses.replace(SOFT, running=3000.0, shuffled=True)
    for changes in (Changes(warm), Changes(joint=JointChanges(reclamping=0.1)), Changes(chip_law=ChipLaw(-0.3))):
        setup = dataclasses.replace(small, changes=changes)
        found = records(setup)
        moved = {name[0] for name, values in plain.items() if not np.array_equal(values, found[name])}
        assert moved == {name[0] for name in plain}
        text = campaign_text(setup, [read_tooling(path) for path in setup.toolings], 3)
        # the file tells the cuts in the order in which they were made
        made = list(dict.fromkeys(name[0] for name in found))
        assert [line.split('"')[1] for line in text.splitlines() if line.startswith("id = ")] == made


@pytest.mark.slow
def test_two_toolings_are_clamped_on_two_joints(small, monkeypatch):
    seen = []

    def listened(spindle, *args, **more):
        seen.append(spindle)
        return rotor(spindle, *args, **more)

    monkeypatch.setattr("rcsa_ident.workflows.simulate.rotor", listened)
    setup = dataclasses.replace(small, changes=Changes(joint=JointChanges(reclamping=0.1)))
    records(setup)
    own = {each.joint.translational_stiffness for each in seen} - {small.spindle.joint.translational_stiffness}
    # one for each tooling, in all of its cuts
    assert len(own) == len(small.toolings)


def test_a_chip_law_is_a_straight_line_where_its_exponent_is_nothing_and_bends_elsewhere(small):
    cutter, coefficients = read_tooling(small.toolings[0]).cutter, small.workpiece.coefficients
    conditions = CuttingConditions(from_rpm(9000.0), 4e-4, 1e-4, Engagement.from_immersion(0.5, "down"))
    plain, none, bent = (
        rigid_force_lines(cutter, conditions, coefficients, law=law) for law in (None, ChipLaw(0.0), ChipLaw(-0.25, thickness=1e-4))
    )
    np.testing.assert_array_equal(none, plain)
    # chips thinner than that of the law cost more
    assert abs(bent[0, 0]) > 1.05 * abs(plain[0, 0])
    thinner = rigid_force_lines(
        cutter, dataclasses.replace(conditions, feed_per_tooth=5e-5), coefficients, law=ChipLaw(-0.25, thickness=1e-4)
    )
    # F = K h (h / h0)^c: half the feed makes 2^-(1 + c) of the force, whatever the engagement
    np.testing.assert_allclose(thinner[0], 0.5**0.75 * bent[0], rtol=1e-3)


def test_a_law_counts_in_a_cut_that_vibrates(small, dynamics):
    cutter, coefficients = read_tooling(small.toolings[0]).cutter, small.workpiece.coefficients
    conditions = CuttingConditions(from_rpm(9000.0), 4e-4, 1e-4, Engagement.from_immersion(0.5, "down"))
    straight, bent = (
        mill_cut(dynamics, cutter, conditions, coefficients, 1e-5, 2000, law=law).force for law in (None, ChipLaw(-0.25, 1e-4))
    )
    assert np.mean(np.abs(bent[1000:])) > 1.05 * np.mean(np.abs(straight[1000:]))


KEYS = """
[warming]
loss_percent = 6.0
time_constant_s = 500.0
exponent = 1.5
running_s = 30.0
pause_s = 5.0
warm_up_s = 60.0
shuffled = true
rise_c = 15.0
reading_sd_c = 0.1
[joint_changes]
softening_percent = 20.0
amplitude_um = 0.2
reclamping_percent = 3.0
[chip_law]
exponent = -0.2
thickness_mm = 0.1
"""


def test_a_machines_file_tells_them(hpm, machines_folder, tmp_path):
    path = tmp_path / "machine.toml"
    text = (machines_folder / "hpm.toml").read_text()
    path.write_text(text.replace("fixture_position_mm = 0.0", "fixture_position_mm = 0.0\nflange_position_mm = 30.0") + KEYS)
    found = read_machine(path)
    assert found.spindle.seen_at == pytest.approx(0.03)
    assert found.changes.warming == Warming(0.06, 500.0, 1.5, 30.0, 5.0, 60.0, True, 15.0, 0.1)
    assert dataclasses.astuple(found.changes.joint) == pytest.approx((0.2, 2e-7, 0.03))
    assert dataclasses.astuple(found.changes.chip_law) == pytest.approx((-0.2, 1e-4))
    assert found.changes.of_the_machine
    assert hpm.changes == Changes()
    assert not hpm.changes.of_the_machine
    assert not Changes(chip_law=ChipLaw(-0.2)).of_the_machine


@pytest.mark.parametrize(
    ("line", "changed_to", "field"),
    [
        ("loss_percent = 6.0", "loss_percent = 60.0", "warming.loss_percent"),
        ("loss_percent = 6.0\n", "", "warming.loss_percent"),
        ("time_constant_s = 500.0", "time_constant_s = 0.0", "warming.time_constant_s"),
        ("shuffled = true", 'shuffled = "yes"', "warming.shuffled"),
        ("rise_c = 15.0", "rise_c = 0.0", "warming.rise_c"),
        ("reading_sd_c = 0.1", "reading_sd_c = -0.1", "warming.reading_sd_c"),
        ("softening_percent = 20.0", "softening_percent = 100.0", "joint_changes.softening_percent"),
        ("amplitude_um = 0.2", "amplitude_um = -1.0", "joint_changes.amplitude_um"),
        ("[chip_law]\nexponent = -0.2", "[chip_law]\nexponent = 0.2", "chip_law.exponent"),
        ("thickness_mm = 0.1", "thickness = 0.1", "chip_law.thickness"),
    ],
)
def test_what_is_wrong_there_is_named(machines_folder, tmp_path, line, changed_to, field):
    assert line in KEYS
    path = tmp_path / "machine.toml"
    path.write_text((machines_folder / "hpm.toml").read_text() + KEYS.replace(line, changed_to))
    with pytest.raises(InputError, match=field.replace(".", r"\.")):
        read_machine(path)


@pytest.mark.parametrize("millimetres", ["-101.0", "250.0"])
def test_a_sensor_looks_at_shaft_or_holder(machines_folder, tmp_path, millimetres):
    path = tmp_path / "machine.toml"
    text = (machines_folder / "hpm.toml").read_text()
    path.write_text(text.replace("fixture_position_mm = 0.0", f"fixture_position_mm = 0.0\nflange_position_mm = {millimetres}"))
    with pytest.raises(InputError, match=r"sensors\.flange_position_mm"):
        read_machine(path)


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda: Warming(0.6), "loss"),
        (lambda: Warming(0.1, running=0.0), "running"),
        (lambda: Warming(0.1, pause=-1.0), "pause"),
        (lambda: Warming(0.1, rise=0.0), "rise"),
        (lambda: Warming(0.1, reading=-0.1), "reading"),
        (lambda: JointChanges(1.0), "softening"),
        (lambda: JointChanges(amplitude=0.0), "amplitude"),
        (lambda: JointChanges(reclamping=-0.1), "reclamping"),
        (lambda: ChipLaw(0.1), "exponent"),
        (lambda: ChipLaw(-0.1, 0.0), "thickness"),
    ],
)
def test_scripts_are_told_as_files_are(make, field):
    with pytest.raises(InputError, match=field):
        make()
