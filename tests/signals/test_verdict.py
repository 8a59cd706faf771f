"""Every reason to leave a record out, with a record that deserves it and a neighbour that does not."""

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.remarks import says
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.signals.measurement import judge_air
from rcsa_ident.signals.recording import Quantity, Recording, Sensor
from rcsa_ident.signals.verdict import RecordCode, examined, raw_faults, tooth_count_fault
from tests.fixtures.synthetic import RATE, RPM, changed, conditions, drift, pair, profile, wave


@pytest.fixture(scope="module")
def good():
    return pair(seed=1, rpm=9000.0, runout=3e-8)


def reasons(made, **changes):
    return " | ".join(made.measure(**changes).verdict.reasons)


def test_a_good_cut(good):
    reading = good.measure()
    assert reading.verdict.usable
    assert reading.verdict.notes == ()
    assert set(reading.measurement.axes) == {Dof.X, Dof.Y}


def test_no_air_cut_is_a_note(good):
    reading = good.measure(air=None)
    assert reading.verdict.usable
    assert "no air cut" in reading.verdict.notes[0]
    assert reading.measurement.alignment_std == 0.0


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_lost_samples(good, value):
    def lose(x):
        x[400:404, 1] = value

    assert "drop-outs: 4 samples of flange_y are missing, the first at 0.01562 s" in reasons(good, cut=changed(good.cut, lose))
    assert reasons(good, air=changed(good.air, lose)).startswith("air cut: drop-outs")


def test_a_frozen_channel(good):
    def freeze(x):
        x[3000:3030, 0] = x[3000, 0]

    def to_the_end(x):
        x[-60:, 1] = x[-60, 1]

    def briefly(x):
        x[3000:3003, 0] = x[3000, 0]

    assert "flange_x is frozen for 30 samples" in reasons(good, cut=changed(good.cut, freeze))
    assert "flange_y is frozen for 60 samples" in reasons(good, cut=changed(good.cut, to_the_end))
    assert reasons(good, cut=changed(good.cut, briefly)) == ""


def test_a_dead_channel(good):
    def kill(x):
        x[:, 2] = 0.3

    assert "no signal: fixture_x has the constant value 0.3" in reasons(good, cut=changed(good.cut, kill))


@pytest.mark.parametrize("sides", ["both", "upper"])
def test_saturation(good, sides):
    def clip(x):
        top, bottom = np.quantile(x[:, 0], [0.97, 0.03])
        x[:, 0] = np.clip(x[:, 0], bottom if sides == "both" else -np.inf, top)

    assert "saturation" in reasons(good, cut=changed(good.cut, clip))


@pytest.mark.parametrize("resolution", [1e-9, 30e-9, 100e-9])
def test_a_coarse_resolution_is_no_saturation(resolution):
    # a smooth peak repeats its highest level, too
    made = pair(seed=2, rpm=8000.0, noise=1e-9)

    def round_off(x):
        x[:, :2] = np.round(x[:, :2] / resolution) * resolution

    assert reasons(made, cut=changed(made.cut, round_off), air=changed(made.air, round_off)) == ""


@pytest.mark.parametrize("resolution", [30e-9, 300e-9])
def test_a_slow_coarse_signal_is_not_frozen(resolution):
    t = np.arange(7168) / RATE
    x = np.round((1e-6 * np.sin(800.0 * t) + 1e-7 * np.sin(2300.0 * t)) / resolution) * resolution
    sensor = Sensor("g", Quantity.DISPLACEMENT, Dof.X)
    assert raw_faults(Recording(RATE, x[:, None], (sensor,))) == ()


def test_a_trigger_may_stand_still(good):
    sensors = (*good.cut.sensors, Sensor("t", Quantity.TRIGGER))
    still = Recording(RATE, np.column_stack([good.cut.samples, np.zeros(7168)]), sensors)
    assert raw_faults(still) == ()


@pytest.mark.parametrize("off", [-0.05, 0.02, 0.1])
def test_a_wrong_programmed_speed(good, off):
    found = reasons(good, conditions=conditions(9000.0 * (1.0 + off)))
    assert "speed: the record repeats at" in found
    assert f"the programmed speed is {9000.0 * (1.0 + off):.0f} rev/min" in found


def test_a_programmed_speed_that_is_nearly_right(good):
    for off in (-0.008, 0.008):
        reading = good.measure(conditions=conditions(9000.0 * (1.0 + off)))
        assert reading.verdict.usable
        assert reading.measurement.spindle_speed == pytest.approx(good.speed, rel=1e-6)


def ramped(made, change):
    """The cut with a speed that grows by this share from its first to its last sample."""
    n = made.cut.samples.shape[0]
    t = np.arange(n) / RATE
    bent = t + change * (0.5 * t**2 / t[-1] - 0.5 * t)

    def warp(x):
        for c in range(4):
            x[:, c] = np.interp(bent, t, x[:, c])

    return changed(made.cut, warp)


def test_a_drifting_speed_is_followed(good):
    even, drifting = good.measure(), good.measure(cut=ramped(good, 0.005))
    assert drifting.verdict.usable
    notes = [str(note) for note in drifting.verdict.notes if note.code is RecordCode.FOLLOWED]
    # a ramp of half a percent has a standard deviation of 0.14 %
    assert notes == ["the speed changes by 0.14 % (standard deviation) within the record, and is followed"]
    assert not says(even.verdict.notes, RecordCode.FOLLOWED)
    for axis, lines in drifting.measurement.axes.items():
        steady = even.measurement.axes[axis]
        # interpolation between the samples, which bent the record, takes its share of the highest lines
        low = lines.omega < 2.0 * np.pi * 2000.0
        np.testing.assert_allclose(np.abs(lines.receptance[low]), np.abs(steady.receptance[low]), rtol=0.02)


@pytest.mark.parametrize("change", [0.015, 0.05])
def test_a_speed_that_changes_too_much_is_left_out(good, change):
    assert "speed drifts" in reasons(good, cut=ramped(good, change))


@pytest.mark.parametrize("hertz", [860.0, 1300.0, 2210.0])
def test_chatter(good, hertz):
    t = np.arange(7168) / RATE
    largest = max(np.abs(a.receptance * a.force).max() for a in good.measure().measurement.axes.values())

    def shake(share):
        def edit(x):
            x[:, :2] += share * largest * np.sin(2.0 * np.pi * hertz * t)[:, None]

        return changed(good.cut, edit)

    found = reasons(good, cut=shake(0.7))
    assert found.startswith("chatter: ")
    # to half a bin of the spectrum
    assert float(found.split(" at ")[1].split(" Hz")[0]) == pytest.approx(hertz, abs=0.5 * RATE / 7168 + 0.5)
    assert reasons(good, cut=shake(0.02)) == ""


def test_chatter_of_a_spindle_that_swings_with_its_housing(good):
    """A displacement sensor that stands on the housing does not see it; the accelerometer beside it does."""
    t, hertz = np.arange(7168) / RATE, 860.0
    largest = max(np.abs(a.receptance * a.force).max() for a in good.measure().measurement.axes.values())
    felt = [k for k, sensor in enumerate(good.cut.sensors) if sensor.quantity is Quantity.ACCELERATION]
    assert felt

    def swing(x):
        x[:, felt] -= 0.7 * largest * (2.0 * np.pi * hertz) ** 2 * np.sin(2.0 * np.pi * hertz * t)[:, None]

    assert reasons(good, cut=changed(good.cut, swing)).startswith("chatter: ")


def test_no_cutting(good):
    idle = pair(seed=3, force=0.0)
    assert "no cutting" in reasons(idle)
    assert reasons(pair(seed=3, force=0.02)) == ""


def test_too_short():
    assert "too short: 0.045 s hold fewer than 8 revolutions" in reasons(pair(seed=4, rpm=9000.0, duration=0.045))
    assert reasons(pair(seed=4, rpm=9000.0, duration=0.06)) == ""


def test_nothing_steady():
    made = pair(seed=4, duration=0.28)
    rng = np.random.default_rng(0)
    level = np.repeat(rng.permutation(np.geomspace(0.05, 1.0, 28)), 256)[:, None]
    found = changed(made.cut, lambda x: x.__setitem__((slice(None), slice(0, 2)), x[:, :2] * level))
    assert not made.measure(cut=found).verdict.usable


@pytest.mark.parametrize(
    ("true", "declared"),
    [(4, 2), (2, 4), (4, 3), (3, 4), (6, 3), (3, 6), (5, 4), (2, 3)],
)
@pytest.mark.parametrize("rpm", [8300.0, 14000.0])
def test_wrong_tooth_count(true, declared, rpm):
    made = pair(seed=true, rpm=rpm, teeth=true, runout=2e-8)
    assert "wrong tooth count" in reasons(made, cutter=Cutter(declared, 16e-3, np.radians(30.0)))


@pytest.mark.parametrize("teeth", [2, 3, 4, 6])
@pytest.mark.parametrize("runout", [0.0, 3e-8, 1e-7])
def test_the_right_tooth_count(teeth, runout):
    for seed, rpm in enumerate((8000.0, 11000.0, 15000.0, 19500.0)):
        assert reasons(pair(seed=seed, rpm=rpm, teeth=teeth, runout=runout)) == ""


def test_one_tooth_is_never_wrong():
    assert tooth_count_fault(np.array([0.0, 1.0, 0.5, 0.2, 0.1]), 1) is None


@pytest.mark.slow
@pytest.mark.parametrize("noise", [2e-9, 2e-8])
def test_an_air_cut_of_noise_alone_is_used(noise):
    for seed in range(12):
        reading = pair(seed=seed, rpm=14000.0, roundness=0.0, noise=noise, accelerometers=False, duration=0.2).measure()
        assert reading.verdict.usable
        # the angle between both cannot be told, and nobody needs it
        assert reading.measurement.alignment_std > 1.0


def test_an_air_cut_that_holds_another_speed(good):
    rng = np.random.default_rng(0)
    x = wave(profile(rng), 9500.0 * RPM, 7168) + drift(rng, 7168)[:, None] + 2e-9 * rng.normal(size=(7168, 2))
    samples = np.column_stack([x, 0.05 * rng.normal(size=(7168, 2))])
    assert reasons(good, air=Recording(RATE, samples, good.cut.sensors)).startswith("air cut: speed")


@pytest.mark.parametrize(("factor", "words"), [(1e4, "flange_x has a peak"), (1e-5, "flange_x has a peak"), (1.0, None)])
def test_motion_that_no_spindle_makes_is_a_note(good, factor, words):
    def scale(x):
        x[:, 0] *= factor

    notes = good.measure(cut=changed(good.cut, scale)).verdict.notes
    assert len(notes) == (words is not None)
    assert words is None or (words in notes[0] and "check its unit and sensitivity" in notes[0])


def test_an_acceleration_in_the_wrong_unit_is_a_note(good):
    def scale(x):
        x[:, 2] *= 1e6

    assert examined(good.cut).notes == ()
    assert ["fixture_x" in note for note in examined(changed(good.cut, scale)).notes] == [True]
    # lost samples and silence are told otherwise
    silent = Recording(RATE, np.full((100, 1), np.nan), (Sensor("x", Quantity.DISPLACEMENT, Dof.X),))
    assert examined(silent).notes == ()


def test_speed_and_harmonics_are_told_of_what_is_not_usable_too(good):
    expected = good.measure()
    assert expected.spindle_speed == expected.measurement.spindle_speed
    # 600 Hz of tooth passing up to 4300 Hz
    assert expected.harmonics == {Dof.X: 7, Dof.Y: 7}
    off = good.measure(conditions=conditions(9100.0))
    assert not off.verdict.usable
    assert off.spindle_speed == pytest.approx(good.speed, rel=1e-3)
    lost = good.measure(cut=changed(good.cut, lambda x: x.__setitem__((0, 0), np.nan)))
    assert (lost.spindle_speed, lost.harmonics) == (None, {})


def test_noise_has_no_harmonics(good):
    rng = np.random.default_rng(7)
    noise = Recording(RATE, 1e-7 * rng.standard_normal(good.cut.samples.shape), good.cut.sensors)
    found = good.measure(cut=noise, air=None)
    assert not found.verdict.usable
    assert sum(found.harmonics.values()) <= 1


def test_an_air_cut_alone(good):
    found = judge_air("c", "t", good.air, conditions(9000.0))
    assert found.verdict.usable
    assert found.measurement is None
    assert found.spindle_speed == pytest.approx(9000.0 * RPM, rel=2e-3)
    assert min(found.harmonics.values()) >= 8
    assert not judge_air("c", "t", good.air, conditions(6500.0)).verdict.usable
    short = Recording(RATE, good.air.samples[:300], good.air.sensors)
    assert judge_air("c", "t", short, conditions(9000.0)).verdict.reasons[0].startswith("too short")
    frozen = changed(good.air, lambda x: x.__setitem__((slice(None), 1), 0.5))
    assert judge_air("c", "t", frozen, conditions(9000.0)).verdict.reasons[0].startswith("no signal")
    none = Recording(RATE, good.air.samples[:, :1], (Sensor("trigger", Quantity.TRIGGER),))
    with pytest.raises(InputError, match="no displacement"):
        judge_air("c", "t", none, conditions(9000.0))
