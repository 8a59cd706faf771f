import dataclasses
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import SLOPES, force_and_slope, force_lines
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.io.recordings.readers import read_cut
from rcsa_ident.io.settings.machines import read_machine
from rcsa_ident.io.settings.setups import read_campaign, read_tooling
from rcsa_ident.signals.measurement import among_fellows, fits_by_chance, measure_cut
from rcsa_ident.signals.recording import Quantity, Recording, Role, Sensor
from rcsa_ident.signals.verdict import RecordCode
from rcsa_ident.virtual.rotor import frequency_response, rotor
from rcsa_ident.workflows.identify import judge, judge_cut
from rcsa_ident.workflows.simulate import simulate
from tests.fixtures.paths import SAMPLES
from tests.fixtures.synthetic import COEFFICIENTS, FIXTURE, RATE, RPM, conditions, cross, pair, wave

AXES = (Dof.X, Dof.Y)


def errors(made, **changes):
    """Errors over their standard deviation, real and imaginary."""
    z = []
    for axis, lines in made.measure(**changes).measurement.axes.items():
        rest = (lines.receptance - made.expected(lines, axis)) / np.sqrt(lines.variance.sum(axis=1))
        z += [*rest.real, *rest.imag]
    return np.array(z)


@pytest.mark.slow
@pytest.mark.parametrize("rpm", [8000.0, 11500.0, 18300.0])
@pytest.mark.parametrize("noise", [2e-9, 5e-8])
def test_known_receptances_come_back_within_their_noise(rpm, noise):
    # without run-out of the cutter the angle to the air cut is as good as known
    z = np.concatenate([errors(pair(seed, rpm, noise=noise)) for seed in range(8)])
    assert np.sqrt(np.mean(z**2)) == pytest.approx(1.0, abs=0.2)
    assert np.abs(z).max() < 5.0


@pytest.mark.slow
def test_the_angle_to_the_air_cut_explains_the_rest():
    # with run-out, lines that the roundness reaches are as good as that angle
    z = []
    for seed in range(12):
        made = pair(seed, 12000.0, runout=5e-8)
        measured = made.measure().measurement
        for axis, lines in measured.axes.items():
            rest = lines.receptance - made.expected(lines, axis)
            total = 2.0 * lines.variance.sum(axis=1) + (lines.order * np.abs(lines.air.sum(axis=1)) * measured.alignment_std) ** 2
            z += [*(np.abs(rest) / np.sqrt(total))]
    assert np.sqrt(np.mean(np.square(z))) == pytest.approx(1.0, abs=0.25)


def test_variance_is_in_proportion():
    few, many = (pair(7, 12000.0, noise=n, accelerometers=False).measure().measurement for n in (4e-9, 4e-8))
    short = pair(7, 12000.0, noise=4e-9, accelerometers=False, duration=0.14).measure().measurement
    for axis in AXES:
        assert np.median(many.axes[axis].variance / few.axes[axis].variance) == pytest.approx(100.0, rel=0.3)
        assert np.median(short.axes[axis].variance[:5] / few.axes[axis].variance[:5]) == pytest.approx(2.0, rel=0.4)
        # cut and air cut, white noise: 2 times 2 sigma^2 / n over the force's square
        lines = few.axes[axis]
        expected = 2.0 * 2.0 * 4e-9**2 / 7168 / np.abs(lines.force) ** 2
        assert np.median(lines.variance[:, 0] / expected) == pytest.approx(1.0, abs=0.25)


def test_coherence():
    clear, noisy = pair(8).measure().measurement, pair(8, noise=2e-6).measure().measurement
    for axis in AXES:
        assert np.median(clear.axes[axis].coherence) > 0.99
        if axis in noisy.axes:
            assert np.all((noisy.axes[axis].coherence >= 0.0) & (noisy.axes[axis].coherence <= 1.0))
            assert np.median(noisy.axes[axis].coherence) < 0.9


@pytest.mark.slow
def test_a_force_that_scatters_widens_the_variance():
    z = np.concatenate([errors(pair(seed, 12000.0, scatter=0.03)) for seed in range(10)])
    steady = pair(0, 12000.0).measure().measurement.axes[Dof.X]
    unsteady = pair(0, 12000.0, scatter=0.03).measure().measurement.axes[Dof.X]
    strong = np.argmax(np.abs(steady.receptance * steady.force))
    assert unsteady.variance[strong, 0] > 100.0 * steady.variance[strong, 0]
    assert 0.4 < np.sqrt(np.mean(z**2)) < 2.0


def test_delay_and_bandwidth_of_the_sensors_are_undone():
    plain = errors(pair(9, 12000.0, accelerometers=False))
    lagging = pair(9, 12000.0, accelerometers=False, delay=7e-5, bandwidth=5000.0)
    z = errors(lagging)
    assert np.sqrt(np.mean(z**2)) < 1.3 * max(np.sqrt(np.mean(plain**2)), 0.8)
    forgotten = Recording(
        lagging.cut.rate, lagging.cut.samples, tuple(dataclasses.replace(s, delay=0.0, bandwidth=None) for s in lagging.cut.sensors)
    )
    assert np.abs(errors(lagging, cut=forgotten)).max() > 100.0


def test_the_fixtures_motion_is_added_with_its_sign():
    assert np.sqrt(np.mean(errors(pair(10, 12000.0)) ** 2)) < 1.4
    # an accelerometer that is mounted backwards, or none: a fifth, a tenth is missing
    for sensor, missing in ((-1.0, 0.2), (0.0, 0.1)):
        made = pair(10, 12000.0, bad_compensation=sensor)
        lines = made.measure().measurement.axes[Dof.X]
        expected = made.expected(lines, Dof.X)
        strong = np.abs(lines.air.sum(axis=1)) < 0.05 * np.abs(lines.cut.sum(axis=1))
        assert np.median(np.abs(lines.receptance - expected)[strong] / np.abs(expected)[strong]) == pytest.approx(missing, rel=0.1)


def test_gap_and_fixture_are_two_outputs():
    """Each is what its own sensor saw of the true motion; together they are the flange's."""
    for seed in range(4):
        made = pair(seed, 12000.0)
        for axis, lines in made.measure().measurement.axes.items():
            assert lines.cut.shape == lines.air.shape == lines.variance.shape == (lines.order.size, 2)
            flange = made.expected(lines, axis)
            rest = lines.cut - lines.air - flange[:, None] * np.array([1.0 - FIXTURE, FIXTURE])
            z = rest / np.sqrt(2.0 * lines.variance)
            assert np.sqrt(np.mean(np.abs(z) ** 2)) < 1.5
            # an accelerometer sees no roundness
            assert np.all(np.abs(lines.air[:, 1]) < 5.0 * np.sqrt(2.0 * lines.variance[:, 1]))
            np.testing.assert_allclose(lines.receptance, np.sum(lines.cut - lines.air, axis=1), rtol=1e-12)
            one = lines.summed()
            assert one.outputs == 1
            np.testing.assert_allclose(one.receptance, lines.receptance, rtol=1e-12)
            np.testing.assert_allclose(one.variance[:, 0], lines.variance.sum(axis=1), rtol=1e-12)


def test_without_accelerometers_there_is_one_output():
    for axis, lines in pair(10, 12000.0, accelerometers=False).measure().measurement.axes.items():
        assert lines.outputs == 1, axis
        assert lines.summed().outputs == 1


def test_an_accelerometer_on_one_axis():
    """The other axis has the gap alone, as if there were none at all; its lines do not mix."""
    # with a trigger the angle to the air cut does not come from the lines
    made = pair(10, 12000.0, trigger={})
    keep = [i for i, s in enumerate(made.cut.sensors) if s.name != "fixture_y"]
    cut, air = (Recording(r.rate, r.samples[:, keep], tuple(r.sensors[i] for i in keep)) for r in (made.cut, made.air))
    found = made.measure(cut=cut, air=air).measurement
    both = made.measure().measurement
    assert [found.axes[a].outputs for a in AXES] == [2, 1]
    for field in ("cut", "air", "variance"):
        np.testing.assert_allclose(getattr(found.axes[Dof.X], field), getattr(both.axes[Dof.X], field), rtol=1e-9)
        np.testing.assert_allclose(getattr(found.axes[Dof.Y], field)[:, 0], getattr(both.axes[Dof.Y], field)[:, 0], rtol=1e-9)


def test_lines_carry_force_and_slopes_at_the_records_speed():
    made = pair(10, 11500.0)
    for axis, lines in made.measure().measurement.axes.items():
        force, slope = force_and_slope(made.cutter, conditions(made.speed / RPM), COEFFICIENTS, lines.order)
        column = 0 if axis is Dof.X else 1
        np.testing.assert_allclose(lines.force, force[:, column], rtol=1e-4)
        assert lines.force_slope.shape == (lines.order.size, len(SLOPES))
        np.testing.assert_allclose(lines.force_slope, slope[:, column], rtol=1e-3, atol=1e-4)


def test_one_axis_alone():
    made = pair(11, accelerometers=False)
    keep = [1]
    cut, air = (Recording(r.rate, r.samples[:, keep], tuple(r.sensors[i] for i in keep)) for r in (made.cut, made.air))
    measured = made.measure(cut=cut, air=air).measurement
    assert set(measured.axes) == {Dof.Y}
    lines = measured.axes[Dof.Y]
    both = made.measure().measurement.axes[Dof.Y]
    np.testing.assert_allclose(np.abs(lines.receptance), np.abs(both.receptance), rtol=0.02, atol=1e-10)


def test_missing_displacements_are_told():
    made = pair(12)
    fixed = tuple(dataclasses.replace(sensor, role=Role.FIXTURE) for sensor in made.cut.sensors[2:])
    blind = Recording(made.cut.rate, made.cut.samples[:, 2:], fixed)
    with pytest.raises(InputError, match="no displacement"):
        made.measure(cut=blind)
    with pytest.raises(InputError, match="no displacement X"):
        made.measure(air=blind)
    with pytest.raises(InputError, match="no displacement X"):
        made.measure(air=Recording(made.cut.rate, made.cut.samples[:, 2:], made.cut.sensors[2:]))


def housing(made, recording, noise=0.05, seed=8):
    """The record of two accelerometers on a housing that moves with `FIXTURE` of the flange, and a little noise."""
    rng = np.random.default_rng(seed)
    order = np.arange(made.cutter.teeth, int(2.0 * np.pi * 5000.0 / made.speed) + 1, made.cutter.teeth)
    omega = order * made.speed
    force = force_lines(made.cutter, conditions(made.speed / RPM), COEFFICIENTS, order)
    moved = np.zeros((order[-1] + 1, 2), dtype=complex)
    moved[order] = -(omega**2)[:, None] * FIXTURE * cross(omega) * force * np.exp(1j * order * made.angle)[:, None]
    n = recording.samples.shape[0]
    samples = wave(moved, made.speed, n) + noise * rng.normal(size=(n, 2))
    return Recording(RATE, samples, tuple(Sensor(f"housing_{a}", Quantity.ACCELERATION, a) for a in (Dof.X, Dof.Y)))


def test_accelerometers_on_the_housing_alone():
    made, off, ratio = pair(seed=31), [], []
    for seed in range(12):
        found = made.measure(cut=housing(made, made.cut, seed=seed), air=None)
        assert found.verdict.usable
        assert found.measurement.housing
        assert [note.code for note in found.verdict.notes] == [RecordCode.HOUSING]
        assert found.spindle_speed == pytest.approx(made.speed, rel=1e-6)
        for axis, lines in found.measurement.axes.items():
            assert lines.outputs == 1
            # how far the phase of all turns with the speed's own error is the delay's business
            error = np.abs(lines.receptance) - np.abs(FIXTURE * made.expected(lines, axis))
            off.append(error / np.sqrt(lines.variance[:, 0]))
            # a / omega^2: a line's noise at 600 Hz is fifty times that at 4 kHz
            noise = lines.variance[:, 0] * np.abs(lines.force) ** 2 * lines.omega**4
            ratio.append(noise[0] / noise[-1])
    assert np.median(ratio) == pytest.approx(1.0, abs=0.25)
    assert np.sqrt(np.mean(np.square(off))) == pytest.approx(1.0, abs=0.15)
    assert not made.measure().measurement.housing


def both(made, seed=8):
    """The pair of records with two accelerometers on the housing beside all other sensors; in the air they feel noise."""

    def beside(record, felt):
        roles = (None, None, Role.FIXTURE, Role.FIXTURE, Role.SPINDLE, Role.SPINDLE)
        told = zip((*record.sensors, *felt.sensors), roles, strict=True)
        sensors = tuple(dataclasses.replace(sensor, role=role) for sensor, role in told)
        return Recording(RATE, np.hstack([record.samples, felt.samples]), sensors)

    felt = housing(made, made.cut, seed=seed)
    still = dataclasses.replace(felt, samples=0.05 * np.random.default_rng(seed + 1).normal(size=felt.samples.shape))
    return beside(made.cut, felt), beside(made.air, still)


def test_accelerometers_on_the_housing_beside_displacement_sensors():
    made, off = pair(seed=31), []
    plain = made.measure().measurement
    for seed in range(10, 22):
        cut, air = both(made, seed)
        found = made.measure(cut=cut, air=air)
        assert found.verdict.usable
        assert found.verdict.notes == ()
        assert not found.measurement.housing
        for axis, lines in found.measurement.axes.items():
            np.testing.assert_array_equal(lines.shares, [[1, -1, 0], [0, 1, 0], [0, 0, 1]])
            # what the flange's own sensors show does not hang on those beside, but for lines above the band, which cannot leak any more
            assert np.all(np.abs(lines.cut[:, :2] - plain.axes[axis].cut) < 0.5 * np.sqrt(lines.variance[:, :2]))
            np.testing.assert_allclose(lines.receptance, lines.first().receptance, rtol=1e-14)
            error = (lines.cut - lines.air)[:, 2] - FIXTURE * made.expected(lines, axis)
            off += [*(error.real / np.sqrt(lines.variance[:, 2])), *(error.imag / np.sqrt(lines.variance[:, 2]))]
    assert np.sqrt(np.mean(np.square(off))) == pytest.approx(1.0, abs=0.1)
    with pytest.raises(InputError, match="no acceleration X in the air cut"):
        made.measure(cut=both(made)[0])


def test_two_pairs_of_accelerometers_alone():
    """Each is an output of its own; a search looks for the first."""
    made = pair(seed=31)
    front, rear = (housing(made, made.cut, seed=seed) for seed in (8, 9))
    named = tuple(dataclasses.replace(sensor, name=f"rear_{sensor.axis}") for sensor in rear.sensors)
    four = Recording(RATE, np.hstack([front.samples, -2.0 * rear.samples]), (*front.sensors, *named))
    one, found = (made.measure(cut=each, air=None).measurement for each in (front, four))
    assert found.housing
    for axis, lines in found.axes.items():
        np.testing.assert_array_equal(lines.shares, [[0, 1, 0], [0, 0, 1]])
        strong = np.abs(lines.cut[:, 0]) > 30.0 * np.sqrt(lines.variance[:, 0])
        assert np.sum(strong) > 3
        np.testing.assert_allclose(lines.cut[strong, 1], -2.0 * lines.cut[strong, 0], rtol=0.15)
        # the angle is followed by all of them: in the first one's lines a little less noise
        np.testing.assert_allclose(np.abs(lines.receptance[strong]), np.abs(one.axes[axis].receptance[strong]), rtol=0.02)


@pytest.mark.parametrize("degrees", [(5.0, 5.0), (2.0, -1.0)])
def test_sensors_that_are_turned_show_the_same_motion(degrees):
    made = pair(seed=31)
    a, b = np.radians(degrees)
    mixed = np.array([[np.cos(a), np.sin(a)], [-np.sin(b), np.cos(b)]])

    def turned(record, told):
        samples = np.hstack([record.samples[:, :2] @ mixed.T, record.samples[:, 2:] @ mixed.T])
        angles = [a, b] * 2 if told else [0.0] * 4
        return Recording(RATE, samples, tuple(dataclasses.replace(s, rotation=r) for s, r in zip(record.sensors, angles, strict=True)))

    straight = made.measure().measurement
    told, silent = (made.measure(cut=turned(made.cut, tells), air=turned(made.air, tells)).measurement for tells in (True, False))
    for axis, lines in straight.axes.items():
        noise = np.sqrt(lines.variance)
        assert np.all(np.abs(told.axes[axis].cut - lines.cut) < 0.02 * noise + 1e-6 * np.abs(lines.cut))
        # a degree that nobody tells of is no small error
        assert np.abs(silent.axes[axis].receptance / lines.receptance - 1.0).max() > 0.01
    alone = dataclasses.replace(made.cut, samples=made.cut.samples[:, :1], sensors=(dataclasses.replace(made.cut.sensors[0], rotation=a),))
    with pytest.raises(InputError, match="rotation_deg"):
        made.measure(cut=alone, air=None)


def test_a_housing_that_chatters_below_half_a_slow_rate():
    # orders above half the rate stand folded back; the mode beside them is what the verdict names
    rng, speed, rate, n = np.random.default_rng(5), 6900.0 * RPM, 1650.0, 16500
    t = np.arange(n) / rate
    lines = np.zeros((25, 2), dtype=complex)
    lines[4::4] = rng.normal(size=(6, 2)) + 1j * rng.normal(size=(6, 2))
    sensors = tuple(Sensor(f"a_{a}", Quantity.ACCELERATION, a) for a in (Dof.X, Dof.Y))
    quiet = wave(lines, speed, n, rate) + 0.02 * rng.normal(size=(n, 2))
    cutter = Cutter(4, 12e-3)

    def verdict(samples):
        return measure_cut("c", "t", Recording(rate, samples, sensors), None, cutter, conditions(6900.0), COEFFICIENTS).verdict

    assert verdict(quiet).usable
    found = verdict(quiet + 3.0 * np.cos(2.0 * np.pi * 275.0 * t)[:, None]).reasons
    assert [reason.code for reason in found] == [RecordCode.CHATTER]
    assert "the structure's is at 275 Hz" in found[0]


def test_a_mount_that_resonates_is_undone():
    made = pair(seed=31)
    loose = housing(made, made.cut)
    told = tuple(dataclasses.replace(sensor, mount_resonance=10e3) for sensor in loose.sensors)
    plain, undone = (made.measure(cut=dataclasses.replace(loose, sensors=s), air=None).measurement for s in (loose.sensors, told))
    for axis, lines in plain.axes.items():
        ratio = undone.axes[axis].receptance / lines.receptance
        np.testing.assert_allclose(ratio, 1.0 - (lines.omega / (2.0 * np.pi * 10e3)) ** 2, rtol=1e-9)


def test_other_channels_are_left_alone():
    made = pair(13)
    sensors = (Sensor("force", Quantity.FORCE, Dof.X), *made.cut.sensors)
    with_force = Recording(made.cut.rate, np.column_stack([np.full(7168, np.nan), made.cut.samples]), sensors)
    for axis, lines in made.measure(cut=with_force).measurement.axes.items():
        np.testing.assert_array_equal(lines.cut, made.measure().measurement.axes[axis].cut)


def test_entry_and_exit_do_not_matter():
    made = pair(14, 12000.0, duration=0.5, roundness=0.0, noise=1e-9)
    count = made.cut.samples.shape[0]
    level = np.interp(np.arange(count), [2500, 3400, 10500, 11400], [0.0, 1.0, 1.0, 0.0])[:, None]
    cut = Recording(made.cut.rate, made.cut.samples * level + (1.0 - level) * made.air.samples, made.cut.sensors)
    for axis, lines in made.measure(cut=cut).measurement.axes.items():
        error = np.abs((lines.receptance - made.expected(lines, axis)) * lines.force)
        assert error.max() < 1e-2 * np.abs(lines.receptance * lines.force).max()


@pytest.mark.slow
@pytest.mark.parametrize("tooth_angle", [0.0, 1.9])
def test_a_trigger_gives_the_delay(tooth_angle):
    for seed in range(5):
        made = pair(seed, 12000.0, trigger={"tooth_angle": tooth_angle})
        measured = made.measure().measurement
        assert measured.tooth_angle_known
        turns = (measured.delay + made.angle / made.speed) * made.speed / (2.0 * np.pi)
        assert (turns - round(turns)) * 2.0 * np.pi / made.speed == pytest.approx(0.0, abs=4.0 * measured.delay_std)
        assert measured.delay_std * made.cut.rate < 0.3


@pytest.mark.slow
def test_a_trigger_of_unknown_tooth_angle_gives_its_edge():
    """The angle that turns edges into delays is the same in all cuts of a clamping."""
    angles = []
    for seed in range(5):
        made = pair(seed, 12000.0, trigger={})
        measured = made.measure().measurement
        assert not measured.tooth_angle_known
        delay = -made.angle / made.speed  # tooth 1 at immersion 0, up to turns
        angles.append(((delay - measured.delay) * made.speed) % (2.0 * np.pi))
    spread = np.angle(np.exp(1j * np.array(angles)))
    # `pair` marks tooth 1 at immersion 0 where no angle is given: edge and delay are one
    assert np.abs(spread).max() < 4.0 * measured.delay_std * made.speed
    none = pair(0, 12000.0).measure().measurement
    assert (none.delay, none.delay_std, none.tooth_angle_known) == (None, None, True)


def test_a_limit_below_the_first_harmonic():
    made = pair(15, 12000.0)
    found = measure_cut("c", "t", made.cut, made.air, made.cutter, conditions(12000.0), COEFFICIENTS, max_frequency=700.0)
    assert found.verdict.reasons == ("no tooth-passing line below 700 Hz",)


@pytest.fixture(scope="module")
def virtual():
    machine = read_machine(Path(__file__).parents[2] / "data" / "machines" / "hpm.toml")
    speeds = tuple(rpm * RPM for rpm in (8600.0, 16100.0))
    machine = dataclasses.replace(machine, plan=dataclasses.replace(machine.plan, spindle_speeds=speeds))
    tooling = read_tooling(machine.toolings[0])
    return machine, tooling, list(simulate(machine, [tooling], seed=3))


def recording(machine, record):
    suite = machine.sensors
    sensors, columns = [], []
    for axis in AXES:
        for name, quantity, scale in (
            (f"flange_{axis}", Quantity.DISPLACEMENT, suite.gap_sensitivity),
            (f"fixture_{axis}", Quantity.ACCELERATION, suite.acceleration_sensitivity),
        ):
            sensors.append(Sensor(name, quantity, axis))
            columns.append(record.channels[name] / scale)
    return Recording(suite.rate, np.column_stack(columns), tuple(sensors))


@pytest.mark.slow
def test_the_virtual_machines_cross_frf(virtual):
    machine, tooling, cuts = virtual
    assert len(cuts) == 2
    for i, cut in enumerate(cuts):
        records = {kind: recording(machine, record) for kind, record in cut.records.items()}
        found = measure_cut(
            cut.id,
            cut.tooling,
            records["cut"],
            records["air"],
            tooling.cutter,
            machine.plan.conditions(machine.plan.spindle_speeds[i]),
            machine.workpiece.coefficients,
        )
        assert found.verdict.usable
        truth = cut.records["cut"]
        assert found.measurement.spindle_speed == pytest.approx(truth.spindle_speed, rel=3e-7)
        model = rotor(machine.spindle, tooling.assembly)
        for column, lines in enumerate(found.measurement.axes.values()):
            outputs = ("flange.x", "flange.y")
            response = frequency_response(model, lines.omega, truth.spindle_speed, outputs=outputs)[:, column, column]
            expected = response * np.exp(1j * lines.order * truth.tooth_angle) * lines.force
            assert np.linalg.norm(lines.receptance * lines.force - expected) < 1e-2 * np.linalg.norm(expected)


#: Cuts of both toolings; with three teeth for four, three of the first ones fit by chance.
SOME = (14, 15, 16, 17, 18, 19, 20, 46, 47, 48)
CHANCE = ("S1-ER32-15", "S1-ER32-17", "S1-ER32-18")


def with_teeth(teeth):
    """Some of the sample runs, the first tooling with another number of teeth."""
    campaign = read_campaign(SAMPLES)
    toolings = dict(campaign.toolings)
    if teeth is not None:
        own = toolings["S1-ER32"]
        toolings["S1-ER32"] = dataclasses.replace(
            own, cutter=dataclasses.replace(own.cutter, teeth=teeth, pitch=None, runout=None, axial_runout=None)
        )
    return dataclasses.replace(campaign, toolings=toolings, cuts=tuple(campaign.cuts[k] for k in SOME))


def reader(campaign):
    return partial(read_cut, campaign.sensors, campaign.sampling_rate)


@pytest.mark.slow
def test_what_fits_a_wrong_tooth_count_by_chance_is_left_out():
    campaign = with_teeth(3)
    alone = [judge_cut(campaign, reader(campaign), cut) for cut in campaign.cuts]
    assert [each.cut_id for each in alone[:7] if each.verdict.usable] == list(CHANCE)
    found = {each.cut_id: each for each in judge(campaign, reader(campaign))}
    for id in CHANCE:
        verdict = found[id].verdict
        assert not verdict.usable
        assert found[id].measurement is None
        assert [reason.code for reason in verdict.reasons] == [RecordCode.TOOTH_COUNT]
        assert "4 of 7 cuts with S1-ER32 contradict it, and this one fits by chance" in verdict.reasons[0]
    # what speaks against one tooling is nothing to the other
    assert [each.verdict.usable for each in found.values()] == [False] * 7 + [True] * 3


@pytest.mark.slow
def test_with_the_right_tooth_count_nothing_is_left_out():
    campaign = with_teeth(None)
    assert all(each.verdict.usable for each in judge(campaign, reader(campaign)))


def test_the_most_cuts_decide_and_others_have_no_say():
    cuts = [("A", True), ("A", False), ("A", None), ("A", None), ("B", False), ("B", True), ("B", False)]
    reasons = fits_by_chance(cuts)
    assert [reason is not None for reason in reasons] == [False] * 5 + [True, False]
    assert "2 of 3 cuts with B" in reasons[5]
    assert fits_by_chance([]) == among_fellows([]) == []
