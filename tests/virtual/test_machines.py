import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.settings.machines import read_machine
from rcsa_ident.io.settings.setups import read_tooling


@pytest.mark.parametrize("name", ["hpm", "stiff", "table2"])
def test_example_machines_and_their_toolings_can_be_read(machines_folder, name):
    machine = read_machine(machines_folder / f"{name}.toml")
    names = [read_tooling(path).name for path in (*machine.toolings, *machine.truth_toolings)]
    assert len(set(names)) == 4
    assert len(machine.plan.spindle_speeds) >= 24


def test_units_become_si(hpm, tooling):
    assert hpm.plan.spindle_speeds[0] == pytest.approx(8000.0 * np.pi / 30.0)
    assert hpm.plan.spindle_speeds[-1] == pytest.approx(20000.0 * np.pi / 30.0)
    assert hpm.spindle.shaft[0].diameter == pytest.approx(0.088)
    assert hpm.spindle.bearings[0].position == pytest.approx(0.048)
    assert hpm.sensors.gap_noise == pytest.approx(2e-9)
    assert hpm.workpiece.coefficients.tangential == pytest.approx(902e6)
    assert tooling.assembly.tool_length == pytest.approx(0.1105)
    assert not hpm.spindle.speed_dependent


def test_further_accelerometers_stand_where_the_file_says(machines_folder, tmp_path):
    text = (machines_folder / "hpm.toml").read_text().replace('"toolings/', f'"{machines_folder}/toolings/')
    told = text.replace("fixture_position_mm = 0.0", "fixture_position_mm = 0.0\nhousing_positions_mm = [350.0, -20.0]")
    path = tmp_path / "machine.toml"
    path.write_text(told)
    assert read_machine(path).spindle.housing_positions == pytest.approx((0.35, -0.02))
    assert read_machine(machines_folder / "hpm.toml").spindle.housing_positions == ()
    path.write_text(told.replace("350.0", '"350"'))
    with pytest.raises(InputError, match=r"sensors.housing_positions_mm"):
        read_machine(path)


def test_softening_is_per_speed(machines_folder):
    spindle = read_machine(machines_folder / "stiff.toml").spindle
    assert spindle.bearings[0].softening * 10000.0 * np.pi / 30.0 == pytest.approx(0.06)
    assert spindle.speed_dependent


def test_angles_are_in_degrees_and_each_element_has_its_own(machines_folder, tmp_path):
    text = (machines_folder / "hpm.toml").read_text()
    text = text.replace("position_mm = 86.0", "position_mm = 86.0\nangle_deg = -17.0").replace(
        "mass = 160.0", "mass = 160.0\nangle_deg = 14.0"
    )
    path = tmp_path / "turned.toml"
    path.write_text(text)
    spindle = read_machine(path).spindle
    assert np.degrees([spindle.housing.angle, *(b.angle for b in spindle.bearings)]) == pytest.approx([14.0, 0.0, -17.0, 0.0])
    assert spindle.coupled
    assert not spindle.speed_dependent


def test_a_machine_is_gyroscopic_unless_it_says_otherwise(machines_folder, tmp_path):
    text = (machines_folder / "hpm.toml").read_text()
    path = tmp_path / "silent.toml"
    path.write_text(text.replace("gyroscopic = false\n", ""))
    assert read_machine(path).spindle.gyroscopic
    assert [read_machine(machines_folder / f"{name}.toml").spindle.gyroscopic for name in ("hpm", "stiff", "table2")] == [
        False,
        True,
        False,
    ]
    assert not read_machine(machines_folder / "hpm.toml").spindle.coupled


CASES = [
    ("[shaft]", "[shafts]", "shafts", "did you mean shaft"),
    ("position_mm = 48.0", "position_mm = 4800.0", "position_mm", "440"),
    ("stiffness = [3.6e8, 3.3e8]", "stiffness = 3.6e8", "bearings[0].stiffness", "2 finite numbers"),
    ("stiffness = [3.6e8, 3.3e8]", "stiffness = [3.6e8, -1.0]", "bearings[0].stiffness", "numbers above 0"),
    ("damping = [8.5e3, 7.6e3]", "damping = [8.5e3, nan]", "bearings[0].damping", "finite"),
    ("mass = 160.0", "mass = 0.0", "housing.mass", "above 0"),
    ("mass = 160.0", "mass = 160.0\nangle_deg = 200.0", "housing.angle_deg", "at most 180"),
    ("mass = 160.0", "mass = 160.0\nangle = 20.0", "housing.angle", "did you mean angle_deg"),
    ("position_mm = 86.0", 'position_mm = 86.0\nangle_deg = "oblique"', "bearings[1].angle_deg", "finite number"),
    ("position_mm = 86.0", "position_mm = 86.0\nangle_deg = [10.0, 20.0]", "bearings[1].angle_deg", "finite number"),
    ("gyroscopic = false", 'gyroscopic = "no"', "machine.gyroscopic", "true or false"),
    ("trigger = false", "triger = false", "sensors.triger", "did you mean trigger"),
    ("roundness_orders = 8", "roundness_orders = 8.5", "sensors.roundness_orders", "whole number"),
    ("{ from = 8000.0, to = 20000.0, count = 40 }", "[]", "cuts.spindle_speeds_rpm", "one or more speeds"),
    ("{ from = 8000.0, to = 20000.0, count = 40 }", "{ from = 8000.0, to = 20000.0 }", "cuts.spindle_speeds_rpm.count", "whole number"),
    ("exit_angle_deg = 180.0", "exit_angle_deg = 80.0", "cuts.exit_angle_deg", "above entry_angle_deg"),
    ('feed_direction = "+X"', 'feed_direction = "up"', "cuts.feed_direction", "+X"),
    ('["toolings/S1-ER32.toml", "toolings/S2-PG25.toml"]', '"toolings/S1-ER32.toml"', "cuts.toolings", "a list of paths"),
    ("duration_s = 0.28", "duration_s = -1.0", "cuts.duration_s", "above 0"),
    ("tangential_coefficient_mpa = 902.0", "", "workpiece.tangential_coefficient_mpa", "nothing"),
    (
        "stiffness = [3.6e8, 3.3e8]",
        "softening_per_rpm = 1e-4\nstiffness = [3.6e8, 3.3e8]",
        "bearings[0].softening_per_rpm",
        "20000 rev/min",
    ),
]


@pytest.mark.parametrize(("old", "new", "key", "words"), CASES)
def test_a_bad_machine_is_answered_with_file_key_and_range(machines_folder, tmp_path, old, new, key, words):
    text = (machines_folder / "hpm.toml").read_text()
    assert old in text
    path = tmp_path / "bad.toml"
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(InputError) as caught:
        read_machine(path)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert key in message
    assert words in message
