"""What a workshop adds, against the figures that it was asked for; and a spindle that turns evenly uses no chance."""

import dataclasses

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.front.samples import simulate_campaign
from rcsa_ident.io.recordings.readers import read_recording
from rcsa_ident.io.settings.machines import read_machine
from rcsa_ident.io.settings.setups import read_campaign
from rcsa_ident.signals.spectra import refine_speed
from rcsa_ident.virtual.disturbances import Disturbances, disturbed, turning

STEP = 1.0 / 2000.0
RPM = np.pi / 30.0


def test_nothing_disturbs_by_default():
    rng = np.random.default_rng(1)
    angle = turning(Disturbances(), 900.0, 0.3, STEP, 500, 100, rng)
    np.testing.assert_allclose(angle, 0.3 + 900.0 * STEP * (np.arange(500) - 100))
    gap, acceleration = disturbed(Disturbances(), 25600.0, 500, rng)
    assert not gap.any()
    assert not acceleration.any()
    assert rng.random() == np.random.default_rng(1).random()


@pytest.mark.parametrize("correlation", [0.1, 1.0])
def test_the_speed_wanders_as_it_is_told(correlation):
    wandering = Disturbances(speed_wander=1e-3, wander_time=correlation)
    angle = turning(wandering, 900.0, 0.3, STEP, 1_000_000, 1234, np.random.default_rng(2))
    assert angle[1234] == 0.3
    share = np.diff(angle) / STEP / 900.0 - 1.0
    assert share.std() == pytest.approx(1e-3, rel=0.1)
    assert abs(share.mean()) < 3e-4
    lag = round(correlation / STEP)
    alike = np.mean(share[lag:] * share[:-lag]) / share.var()
    # e^{-1} of the slow part, a little more for the quick one
    assert alike == pytest.approx(np.exp(-1.0), abs=0.08)
    # no jumps from one instant to the next
    assert np.abs(np.diff(share)).max() < 0.1 * share.std()


def test_hum_noise_and_knocks():
    rate, count = 25600.0, 25600 * 8
    rng = np.random.default_rng(3)
    gap, nothing = disturbed(Disturbances(hum=2e-7, mains=60.0), rate, count, rng)
    spectrum = np.abs(np.fft.rfft(gap, axis=0)) * 2.0 / count
    frequency = np.fft.rfftfreq(count, 1.0 / rate)
    for hertz, size in ((60.0, 2e-7), (120.0, 8e-8), (180.0, 1e-7)):
        assert spectrum[frequency == hertz] == pytest.approx(size, rel=1e-6)
    assert not nothing.any()
    _, acceleration = disturbed(Disturbances(machine_noise=3.4), rate, count, rng)
    assert acceleration.std(axis=0) == pytest.approx([3.4, 3.4], rel=1e-9)
    power = np.abs(np.fft.rfft(acceleration, axis=0)) ** 2
    assert power[(frequency > 450.0) & (frequency < 1800.0)].sum() > 0.6 * power.sum()
    _, four = disturbed(Disturbances(machine_noise=3.4), rate, count, rng, accelerometers=2)
    assert four.shape == (count, 4)
    assert np.abs(np.corrcoef(four.T) - np.eye(4)).max() < 0.1
    np.testing.assert_allclose(four.std(axis=0), 3.4)
    gap, acceleration = disturbed(Disturbances(knocks=3.0, knock=1e-7), rate, count, rng)
    assert 1e-7 < np.abs(gap).max() < 1e-6
    assert np.abs(acceleration).max() > 0.1
    # most of the time it is quiet
    assert np.median(np.abs(gap)) < 0.02 * np.abs(gap).max()


@pytest.mark.parametrize(
    ("changes", "field"),
    [({"speed_wander": 0.05}, "speed_wander"), ({"clock_error": 0.1}, "clock_error"), ({"hum": -1.0}, "hum"), ({"mains": 0.0}, "mains")],
)
def test_what_no_workshop_does(changes, field):
    with pytest.raises(InputError, match=field):
        Disturbances(**changes)


def test_a_workshop_is_read_from_the_machine_file(machines_folder, tmp_path):
    text = (machines_folder / "hpm.toml").read_text().replace("duration_s = 0.28", "duration_s = 0.4\nentry_s = 0.05\nexit_s = 0.04")
    text = text.replace("toolings/", f"{machines_folder}/toolings/")
    keys = "speed_wander_percent = 0.1\nwander_time_s = 0.2\nclock_error_percent = -0.1\nhum_um = 0.2\nmains_hz = 60.0"
    (tmp_path / "m.toml").write_text(f"{text}\n[disturbances]\n{keys}\nmachine_noise = 3.4\nknocks_per_s = 2.0\nknock_um = 0.1\n")
    machine = read_machine(tmp_path / "m.toml")
    found, expected = dataclasses.astuple(machine.disturbances), (1e-3, 0.2, -1e-3, 2e-7, 60.0, 3.4, 2.0, 1e-7)
    assert found == pytest.approx(expected)
    assert (machine.plan.entry, machine.plan.leave) == (0.05, 0.04)
    (tmp_path / "m.toml").write_text(text.replace("duration_s = 0.4", "duration_s = 0.09"))
    with pytest.raises(InputError, match="duration_s"):
        read_machine(tmp_path / "m.toml")


def test_entry_exit_and_a_clock_that_is_off(hpm, tmp_path):
    plan = dataclasses.replace(hpm.plan, spindle_speeds=(12000.0 * RPM,), duration=0.3, entry=0.08, leave=0.06)
    sensors = dataclasses.replace(hpm.sensors, roundness=0.0, gap_drift=0.0, speed_error=0.0)
    machine = dataclasses.replace(
        hpm, plan=plan, sensors=sensors, toolings=hpm.toolings[:1], truth_toolings=(), disturbances=Disturbances(clock_error=0.01)
    )
    made = simulate_campaign(machine, tmp_path / "campaign", seed=5)
    campaign = read_campaign(made.folder)
    cut = read_recording(campaign.cuts[0].recording, sensors=campaign.sensors, default_rate=campaign.sampling_rate)
    assert cut.rate == sensors.rate
    level = np.sqrt(np.convolve(np.sum(cut.samples[:, :2] ** 2, axis=1), np.ones(256) / 256.0, "same"))
    time = np.arange(level.size) / cut.rate
    whole = np.median(level[(time > 0.09) & (time < 0.23)])
    assert level[time < 0.03].max() < 0.05 * whole
    assert level[time > 0.28].max() < 0.3 * whole
    assert np.interp(0.06, time, level) == pytest.approx(0.5 * whole, rel=0.25)
    # the clock takes more samples in a second than it says: the record seems slow
    inside = (time > 0.09) & (time < 0.23)
    assert refine_speed(cut.samples[inside][:, :2], cut.rate, 12000.0 * RPM / 1.01) == pytest.approx(12000.0 * RPM / 1.01, rel=1e-4)
