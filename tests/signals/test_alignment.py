import numpy as np
import pytest

from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.signals.alignment import align, trigger_delay, trigger_edge
from rcsa_ident.signals.recording import Quantity, Recording, Sensor
from tests.fixtures.synthetic import RATE, RPM, pair, profile


def profiles(rng, teeth, forced, noise=3e-11, orders=33, roundness=4e-6):
    """Lines of a cut and its air cut, and the angle between them; `forced` is what cutter run-out adds at order 1 [m]."""
    air = np.zeros((orders, 2), dtype=complex)
    air[:9] = profile(rng, roundness)
    angle = rng.uniform(0.0, 2.0 * np.pi)
    order = np.arange(orders)
    cut = air * np.exp(1j * order * angle)[:, None]
    beside = order[(order % teeth == 1) | (order % teeth == teeth - 1)]
    response = rng.normal(size=(beside.size, 2)) + 1j * rng.normal(size=(beside.size, 2))
    cut[beside] += forced * rng.uniform(0.2, 1.5, (beside.size, 1)) * response / np.sqrt(2.0 * beside)[:, None]
    cut[::teeth] += 1e-6 * np.exp(2j * np.pi * rng.random())
    noises = [noise * (rng.normal(size=air.shape) + 1j * rng.normal(size=air.shape)) for _ in range(2)]
    return cut + noises[0], air + noises[1], angle


def difference(a, b):
    return np.angle(np.exp(1j * (a - b)))


@pytest.mark.parametrize("angle", [0.0, 0.3, 3.1, 6.2])
def test_an_exact_rotation_is_found(angle):
    rng = np.random.default_rng(0)
    air = profile(rng)
    found, std = align(air * np.exp(1j * np.arange(9) * angle)[:, None], air, 4)
    assert difference(found, angle) == pytest.approx(0.0, abs=1e-9)
    assert std < 2e-4


@pytest.mark.parametrize("teeth", [2, 3, 4, 6])
@pytest.mark.parametrize("forced", [2e-8, 1e-7])
def test_its_standard_deviation_is_honest(teeth, forced):
    rng = np.random.default_rng(1)
    z = []
    for _ in range(200):
        cut, air, angle = profiles(rng, teeth, forced)
        found, std = align(cut, air, teeth)
        z.append(difference(found, angle) / std)
    assert 0.6 < np.sqrt(np.mean(np.square(z))) < 1.15
    assert np.abs(z).max() < 6.0


def test_noise_and_unlike_profiles_tell_no_angle():
    rng = np.random.default_rng(2)
    for _ in range(20):
        cut, air, _ = profiles(rng, 4, 1e-7, roundness=0.0)
        assert align(cut, air, 4)[1] > 1.5
        other = profiles(rng, 4, 0.0)[1]
        assert align(cut, other, 4)[1] > 1.5


def test_orders_of_the_teeth_carry_nothing():
    cut, air, angle = profiles(np.random.default_rng(3), 4, 0.0)
    cut[::4] *= 1e3
    assert difference(align(cut, air, 4)[0], angle) == pytest.approx(0.0, abs=1e-3)


def trigger(speed, first, n=7168, pulses=1, jitter=0.0, delay=0.0, rng=None, **options):
    """Recording of a trigger alone; a pulse rises at `first` [s] and every turn, or part of it, after that."""
    sensor = Sensor("t", Quantity.TRIGGER, delay=delay, pulses_per_revolution=pulses, **options)
    t = np.arange(n) / RATE - delay
    if jitter:
        t = t + jitter * np.repeat(rng.normal(size=n // 64 + 1), 64)[:n]
    x = (np.mod(pulses * speed * (t - first), 2.0 * np.pi) < 1.0).astype(float)
    return Recording(RATE, np.column_stack([x, np.zeros(n)]), (sensor, Sensor("d", Quantity.DISPLACEMENT, Dof.X)))


@pytest.mark.parametrize("rpm", [8000.0, 8000.5, 12347.0, 19999.0])
@pytest.mark.parametrize("pulses", [1, 4])
def test_edges_together_are_better_than_a_sample(rpm, pulses):
    rng = np.random.default_rng(4)
    z, error = [], []
    for _ in range(60):
        speed = rpm * RPM
        at = rng.uniform(0.05, 0.95) * 2.0 * np.pi / speed / pulses
        time, std = trigger_edge(trigger(speed, at, pulses=pulses, delay=3e-4), speed)
        # lag of the channel and the first edge that the record holds
        period = 2.0 * np.pi / speed / pulses
        error.append((time - at + 0.5 * period) % period - 0.5 * period)
        z.append(error[-1] / std)
    # at 8000 rev/min every edge falls on the same part of a sample: no better than one edge
    assert np.std(error) * RATE < (0.33 if rpm == 8000.0 else 0.15)
    assert abs(np.mean(error)) * RATE < 0.1
    assert np.sqrt(np.mean(np.square(z))) < 1.3
    assert np.abs(z).max() < 3.0


def test_edges_that_jitter():
    rng = np.random.default_rng(5)
    speed = 9013.0 * RPM
    z = []
    for _ in range(60):
        time, std = trigger_edge(trigger(speed, 2e-3, jitter=1.0 / RATE, rng=rng), speed)
        z.append((time - 2e-3) / std)
    assert 0.4 < np.sqrt(np.mean(np.square(z))) < 1.5


def test_a_stray_edge_and_lost_samples_do_not_matter():
    speed = 9013.0 * RPM
    record = trigger(speed, 2e-3)
    samples = record.samples.copy()
    samples[20:24, 0] = 1.0
    samples[2000:2100, 0] = np.nan
    time, _ = trigger_edge(Recording(RATE, samples, record.sensors), speed)
    assert (time - 2e-3) * RATE == pytest.approx(0.0, abs=0.2)


def test_no_trigger_no_edge():
    speed = 9000.0 * RPM
    assert trigger_edge(Recording(RATE, np.zeros((100, 1)), (Sensor("d", Quantity.DISPLACEMENT, Dof.X),)), speed) is None
    assert trigger_edge(trigger(0.71 * speed, 2e-3), speed) is None
    flat = Recording(RATE, np.zeros((7168, 1)), (Sensor("t", Quantity.TRIGGER),))
    assert trigger_edge(flat, speed) is None
    assert trigger_delay(flat, speed, 4) == (None, None, True)


def test_a_known_tooth_angle_makes_a_delay():
    speed = 9013.0 * RPM
    delay, std, known = trigger_delay(trigger(speed, 2e-3, tooth_angle=0.4), speed, 4)
    assert known
    assert delay == pytest.approx(2e-3 - 0.4 / speed, abs=3.0 * std)
    assert trigger_delay(trigger(speed, 2e-3, tooth_angle=0.0), speed, 4)[2]


def test_without_one_the_edge_is_given_and_it_is_said():
    speed = 9013.0 * RPM
    record = trigger(speed, 2e-3)
    assert trigger_delay(record, speed, 4) == (*trigger_edge(record, speed), False)


@pytest.mark.parametrize("tooth_angle", [None, 0.4])
def test_marks_have_to_fit_the_teeth(tooth_angle):
    speed = 9013.0 * RPM
    for pulses, fits in ((1, True), (2, True), (3, False), (4, True)):
        found = trigger_delay(trigger(speed, 1e-3, pulses=pulses, tooth_angle=tooth_angle), speed, 4)
        if fits:
            assert found[0] is not None
            assert found[2] == (tooth_angle is not None)
        else:
            assert found == (None, None, True)


@pytest.mark.parametrize("pulses", [1, 2, 4, 5])
def test_a_trigger_turns_the_air_cut(pulses):
    # enough run-out that the profile alone would be poor
    made = pair(seed=6, runout=1e-7, trigger={"pulses_per_revolution": pulses, "tooth_angle": 0.9})
    measured = made.measure().measurement
    assert measured.alignment_std < 3e-3
    for axis, lines in measured.axes.items():
        error = np.abs(lines.receptance - made.expected(lines, axis))
        assert np.all(
            error * np.abs(lines.force)
            < 4.0 * np.sqrt(2.0 * lines.variance.sum(axis=1)) * np.abs(lines.force) + lines.order * 3.0e-3 * 6e-7
        )
