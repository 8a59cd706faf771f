"""Passes whose speed changes: the angle that is followed, the windows' lines, and what is wrong with a recording."""

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.errors import InputError
from rcsa_ident.io.machines import read_machine
from rcsa_ident.io.setups import read_tooling
from rcsa_ident.signals.measurement import measure_cut
from rcsa_ident.signals.recording import Quantity, Recording, Sensor
from rcsa_ident.signals.sweep import judge_pass_air, measure_pass
from rcsa_ident.signals.verdict import RecordCode
from rcsa_ident.virtual.disturbances import Disturbances
from rcsa_ident.virtual.rotor import frequency_response, rotor
from rcsa_ident.workflows.simulate import simulate
from tests.fixtures.paths import MACHINES, TOOLINGS

RPM = np.pi / 30.0
AXES = (Dof.X, Dof.Y)
#: A pass that sweeps fast, its length [s], and the speed of a cut that does not.
SPEEDS, SECONDS, CONSTANT = (11500.0 * RPM, 12500.0 * RPM), 1.5, 12000.0 * RPM
TOOTH_ANGLE = 0.6


class Pass:
    """A simulated pass and a cut at the speed in its middle, with everything that measuring them takes."""

    def __init__(self, trigger=False, wander=0.0, tooling="S1-ER32", entry=0.0, seed=1, **sensors):
        machine = read_machine(MACHINES / "hpm.toml")
        suite = replace(machine.sensors, speed_error=0.0, trigger=trigger, tooth_angle=TOOTH_ANGLE, **sensors)
        plan = replace(machine.plan, spindle_speeds=(CONSTANT,), passes=(SPEEDS,), pass_duration=SECONDS, entry=entry, leave=entry)
        self.machine = replace(machine, sensors=suite, plan=plan, disturbances=Disturbances(speed_wander=wander))
        self.tooling = read_tooling(TOOLINGS / f"{tooling}.toml")
        self.constant, self.moving = simulate(self.machine, [self.tooling], seed)
        self.cut, self.air = (self.recording(self.moving.records[kind]) for kind in ("cut", "air"))

    @staticmethod
    def sensors_of():
        return read_machine(MACHINES / "hpm.toml").sensors

    def recording(self, record):
        suite = self.machine.sensors
        kinds = {
            "flange": (Quantity.DISPLACEMENT, suite.gap_sensitivity),
            "fixture": (Quantity.ACCELERATION, suite.acceleration_sensitivity),
        }
        sensors, columns = [], []
        for name, values in record.channels.items():
            if name == "trigger":
                sensors.append(Sensor(name, Quantity.TRIGGER, tooth_angle=TOOTH_ANGLE))
                columns.append(values)
                continue
            quantity, scale = kinds[name[:-2]]
            sensors.append(Sensor(name, quantity, Dof(name[-1])))
            columns.append(values / scale)
        return Recording(suite.rate, np.stack(columns, axis=1), tuple(sensors))

    def measure(self, cut=None, air="its own", speeds=SPEEDS):
        conditions = self.machine.plan.conditions(speeds[0])
        air = self.air if isinstance(air, str) else air
        coefficients = self.machine.workpiece.coefficients
        return measure_pass("p", "S1", self.cut if cut is None else cut, air, self.tooling.cutter, conditions, speeds[1], coefficients)

    def at_constant_speed(self):
        cut, air = (self.recording(self.constant.records[kind]) for kind in ("cut", "air"))
        conditions = self.machine.plan.conditions(CONSTANT)
        return measure_cut("c", "S1", cut, air, self.tooling.cutter, conditions, self.machine.workpiece.coefficients).measurement

    def true_cross(self, axis, omega, speed):
        model = rotor(self.machine.spindle, self.tooling.assembly)
        return frequency_response(model, omega, speed, inputs=(f"tip.{axis}",), outputs=(f"flange.{axis}",))[:, 0, 0]

    def swept(self, axis, measurement, lines):
        """What the sweep makes of the true lines: mean over the range and lag, by brute force."""
        found = []
        for order in lines.order:
            middle, rate = order * measurement.spindle_speed, order * measurement.acceleration
            places = middle + np.linspace(-0.5, 0.5, 61) * rate * measurement.length
            step = 0.02 * abs(places[-1] - places[0])
            low, mid, high = (self.true_cross(axis, places + k * step, measurement.spindle_speed) for k in (-1, 0, 1))
            found.append(np.mean(mid - 0.5j * rate * (high - 2.0 * mid + low) / step**2))
        return np.array(found)


@pytest.fixture(scope="module")
def plain():
    return Pass()


def errors(made, measurement, cut):
    """Worst of a window's lines against the truth, the force's own error taken out by a cut at the same speed: with the sweep, without."""
    worst = []
    for axis in AXES:
        lines, same = measurement.axes[axis], cut.axes[axis]
        orders = np.intersect1d(lines.order, same.order)
        here, there = (each.of(np.isin(each.order, orders)) for each in (lines, same))
        strong = 2.0 * here.variance.sum(axis=1) + 2.0 * there.variance.sum(axis=1) < (1e-3 * np.abs(here.receptance)) ** 2
        true_there = made.true_cross(axis, there.omega, cut.spindle_speed)
        for expected in (made.swept(axis, measurement, here), made.true_cross(axis, here.omega, measurement.spindle_speed)):
            ratio = here.receptance / there.receptance * true_there / expected
            # one delay is free
            trial = np.linspace(-np.pi, np.pi, 20001)
            off = np.abs(ratio[:, None] * np.exp(1j * orders[:, None] * trial) - 1.0)[strong]
            worst.append(float(off.max(axis=0).min()))
    return max(worst[::2]), max(worst[1::2])


def test_a_pass_is_usable_window_by_window(plain):
    found = plain.measure()
    assert found.verdict.usable
    assert not found.verdict.notes
    assert len(found.measurements) == int(SECONDS / 0.28)
    assert found.measurement is None
    speeds = [each.spindle_speed for each in found.measurements]
    # even steps between the ends
    np.testing.assert_allclose(np.diff(speeds), (SPEEDS[1] - SPEEDS[0]) / len(speeds), rtol=2e-3)
    np.testing.assert_allclose([each.acceleration for each in found.measurements], (SPEEDS[1] - SPEEDS[0]) / SECONDS, rtol=5e-3)
    assert str(found) == f"p: usable, {sum(a.omega.size for m in found.measurements for a in m.axes.values())} lines in 5 windows"


def test_windows_show_the_machine_of_a_cut_at_constant_speed(plain):
    cut = plain.at_constant_speed()
    window = min(plain.measure().measurements, key=lambda each: abs(each.spindle_speed - CONSTANT))
    with_sweep, without = errors(plain, window, cut)
    # a few 1e-4 are noise; what the sweep does is seen above it
    assert with_sweep < 1.2e-3
    assert without > 1.5 * with_sweep


def test_all_windows_share_one_angle(plain):
    # the delays, which tell where tooth 1 stood, are those of one turning spindle: the lines of all windows agree up to one angle
    found = plain.measure().measurements
    angles = []
    for each in found:
        lines = each.axes[Dof.Y]
        value = lines.receptance * np.exp(1j * lines.omega * each.delay)
        ratio = value / plain.swept(Dof.Y, each, lines)
        # the first order's phase is that of the common angle
        angles.append(np.angle(ratio[0]) / lines.order[0])
    apart = np.angle(np.exp(1j * 4 * (np.array(angles) - angles[0]))) / 4
    assert np.abs(apart).max() < 2e-3
    assert all(not each.tooth_angle_known and each.clamping == "p" for each in found)


def test_a_trigger_tells_the_angle():
    made = Pass(trigger=True)
    for each in made.measure().measurements:
        assert each.tooth_angle_known
        lines = each.axes[Dof.Y]
        ratio = lines.receptance * np.exp(1j * lines.omega * each.delay) / made.swept(Dof.Y, each, lines)
        # the force model's own phase is the rest
        assert abs(np.angle(ratio[0])) < 0.03
        assert each.delay_std * each.spindle_speed < 0.02


def test_a_speed_that_wanders_on_its_way_is_followed():
    steady, wandering = Pass(), Pass(wander=1e-3)
    noise = [np.sqrt(np.mean(each.measure().measurements[2].axes[Dof.Y].variance[:2])) for each in (steady, wandering)]
    assert wandering.measure().verdict.usable
    assert noise[1] < 4.0 * noise[0]


def test_without_an_air_cut_it_is_said(plain):
    found = plain.measure(air=None)
    assert found.verdict.usable
    assert [note.code for note in found.verdict.notes] == [RecordCode.NO_AIR_CUT]
    assert all(each.alignment_std == 0.0 for each in found.measurements)


def test_a_pass_of_other_speeds_is_left_out(plain):
    for speeds in ((13000.0 * RPM, 14000.0 * RPM), SPEEDS[::-1], (11000.0 * RPM, 13500.0 * RPM)):
        found = plain.measure(speeds=speeds)
        assert not found.verdict.usable
        assert found.verdict.reasons[0].code is RecordCode.WRONG_SPEED
        assert not found.measurements


def test_a_cut_that_keeps_its_speed_is_no_pass(plain):
    found = plain.measure(cut=plain.recording(plain.constant.records["cut"]), air=None)
    assert not found.verdict.usable
    assert "programmed is from 11500 to 12500 rev/min" in str(found.verdict.reasons[0])


def test_an_air_cut_told_as_a_cut_is_left_out(plain):
    found = plain.measure(cut=plain.air, air=None)
    assert not found.verdict.usable or all(not each.axes for each in found.measurements) or found.verdict.notes
    found = plain.measure(cut=plain.air)
    assert not found.verdict.usable
    assert str(found.verdict.reasons[0]).startswith("5 of 5 windows are not usable")


def test_windows_of_entry_and_exit_are_left_out():
    found = Pass(entry=0.05).measure()
    assert found.verdict.usable
    assert len(found.measurements) == 3
    assert "2 of 5 windows are left out" in str(found.verdict.notes[0])


def test_an_air_cut_is_judged_alone(plain):
    found = judge_pass_air("p", "S1", plain.air, SPEEDS)
    assert found.verdict.usable
    assert found.spindle_speed == pytest.approx(CONSTANT, rel=1e-3)
    assert not judge_pass_air("p", "S1", plain.air, (13000.0 * RPM, 14000.0 * RPM)).verdict.usable


def test_without_displacement_it_is_refused(plain):
    kept = [i for i, sensor in enumerate(plain.cut.sensors) if sensor.quantity is Quantity.ACCELERATION]
    bare = Recording(plain.cut.rate, plain.cut.samples[:, kept], tuple(plain.cut.sensors[i] for i in kept))
    with pytest.raises(InputError, match="followed by the flange's run-out"):
        plain.measure(cut=bare)
    with pytest.raises(InputError, match="the same sensors"):
        plain.measure(air=Recording(plain.cut.rate, plain.air.samples[:, :1], plain.air.sensors[:1]))


def test_a_pass_too_short_or_too_long_is_told(plain):
    few = replace(plain.cut, samples=plain.cut.samples[:5000])
    found = plain.measure(cut=few, air=None)
    assert str(found.verdict.reasons[0]).startswith("too short: 0.195 s")
    still = replace(plain.air, samples=plain.air.samples[:5000])
    assert str(plain.measure(air=still).verdict.reasons[0]).startswith("air cut: too short")
    assert not judge_pass_air("p", "S1", still, SPEEDS).verdict.usable
    many = replace(plain.cut, samples=np.tile(plain.cut.samples, (60, 1)))
    assert str(plain.measure(cut=many, air=None).verdict.reasons[0]).startswith("too long: 90 s")
