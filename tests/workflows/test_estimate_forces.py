"""Forces of a recording: what is found out on the way (speed, noise, bands), what is said, what is refused; figures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError, Unsteady
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.io.curves.flanges import read_flange_machine, write_flange_machine
from rcsa_ident.machine.flange_machine import FlangeMachine
from rcsa_ident.machine.measured import MeasuredFlange
from rcsa_ident.observer.tuning import PaperWalk, Resonators
from rcsa_ident.report.forces import force_history, observer_frf
from rcsa_ident.signals.measurement import NO_AIR
from rcsa_ident.signals.recording import Quantity, Recording, Sensor
from rcsa_ident.workflows.estimate_forces import observe, trigger_speed, wear_of
from tests.fixtures import by_hand
from tests.fixtures.flange_machine import BAND, decoupled_file, flange_machine, paper_cut
from tests.fixtures.force_stream import SECOND, streamed, turning
from tests.fixtures.virtual_cut import relative_error, virtual_cut

RPM = np.pi / 30.0


def watch(cut, air=None, teeth=2, machine=None, speed=12000.0 * RPM, **options):
    return observe(machine or flange_machine(), paper_cut().tooling.assembly, teeth, cut, air, speed, **options)


def known_in(band):
    return replace(flange_machine(), known=band)


@pytest.fixture(scope="module")
def found():
    return watch(paper_cut().cut, paper_cut().air)


def with_trigger(cut, speed, pulses=1):
    turn = np.arange(cut.samples.shape[0]) / cut.rate * speed * pulses
    signal = (np.mod(turn, 2.0 * np.pi) < 0.4).astype(float)
    sensor = Sensor("trigger", Quantity.TRIGGER, pulses_per_revolution=pulses)
    return Recording(cut.rate, np.column_stack([cut.samples, signal]), (*cut.sensors, sensor))


@pytest.mark.slow
def test_speed_and_noise_come_from_the_record(found):
    assert found.spindle_speed == pytest.approx(paper_cut().spindle_speed, rel=1e-6)
    for noise in found.noise.values():
        assert noise == pytest.approx(2e-9, rel=0.2)


@pytest.mark.slow
def test_the_fundamental_below_the_identified_band_is_said(found):
    assert found.band[0] < 2.0 * np.pi * 400.0 < BAND[0]
    assert any("400 Hz, lies below the identified band" in note for note in found.notes)
    higher = watch(paper_cut().cut, paper_cut().air, machine=known_in((2.0 * np.pi * 700.0, BAND[1])))
    assert any("harmonics below 490 Hz are left out" in note for note in higher.notes)
    assert higher.band[0] > 2.0 * np.pi * 400.0


@pytest.mark.slow
def test_a_missing_air_cut_is_said():
    assert NO_AIR in watch(paper_cut().cut).notes


@pytest.mark.slow
@pytest.mark.parametrize("place", [0, 1])
def test_one_axis_alone_is_watched(place):
    """Its own sensors and its own machine, whatever stands beside it in the record."""
    whole = flange_machine()
    one = replace(whole, flanges=whole.flanges[place : place + 1])
    only = watch(paper_cut().cut, paper_cut().air, machine=one)
    assert only.estimate.axes == (Dof.X, Dof.Y)[place : place + 1]
    assert relative_error(only.estimate.force, paper_cut().force[:, place : place + 1], paper_cut().cut.rate) < 0.05
    # without an air cut, whose angle comes from fewer channels then, only the last digits of the speed differ
    alone, both = (watch(paper_cut().cut, machine=machine).estimate.force[-4096:] for machine in (one, whole))
    assert np.std(alone[:, 0] - both[:, place]) < 1e-4 * np.std(both[:, place])


def measured(low_hz, high_hz, step_hz=5.0):
    """The same machine, its flange as a tap test in this range would give it."""
    grid = 2.0 * np.pi * np.arange(low_hz, high_hz, step_hz)
    flanges = tuple(MeasuredFlange(flange.receptance(grid)) for flange in flange_machine().flanges)
    return FlangeMachine(flanges, flanges[0].band, flange_machine().joint, ends=True)


@pytest.mark.slow
def test_a_measured_flange_gives_the_forces_of_its_modes(found):
    """From where the identified machine's band begins; beyond what was measured nothing is asked for, and nothing told."""
    alone = watch(paper_cut().cut, paper_cut().air, machine=measured(373.0, 4400.0))
    assert 2.0 * np.pi * 373.0 <= alone.band[0] < alone.band[1] <= 2.0 * np.pi * 4400.0
    for response in alone.response.values():
        assert response.omega[0] >= 2.0 * np.pi * 373.0
        assert response.omega[-1] <= 2.0 * np.pi * 4400.0
    settled = slice(-4096, None)
    difference = np.std(alone.estimate.force[settled] - found.estimate.force[settled], axis=0)
    assert np.all(difference < 0.01 * np.std(found.estimate.force[settled], axis=0))
    assert np.all(relative_error(alone.estimate.force, paper_cut().force, paper_cut().cut.rate) < 0.03)
    # a range that begins above the tooth-passing frequency
    high = watch(paper_cut().cut, paper_cut().air, machine=measured(450.0, 4400.0))
    assert high.band[0] == 2.0 * np.pi * 450.0
    assert any("harmonics below 450 Hz are left out" in note for note in high.notes)


@pytest.mark.slow
def test_a_flange_that_holds_its_joint_is_refused(tmp_path, found):
    """It tells the tip, and not the spindle's motion behind the joint, which is what the sensor sees."""
    decoupled = read_flange_machine(decoupled_file(tmp_path / "FLANGE.csv"))
    with pytest.raises(InputError, match=r"machine: found a flange that holds .* \(X, Y\), allowed is .*bare flange with its joint"):
        watch(paper_cut().cut, paper_cut().air, machine=decoupled)
    # with the joint of one axis alone, and a record of both
    bare = measured(373.0, 4400.0)
    with pytest.raises(InputError, match=r"\(Y\)"):
        watch(paper_cut().cut, paper_cut().air, machine=replace(bare, joint={Dof.X: bare.joint}))
    # by its file a bare flange with its joint is what it was
    write_flange_machine(tmp_path / "BARE.csv", bare)
    again = watch(paper_cut().cut, paper_cut().air, machine=read_flange_machine(tmp_path / "BARE.csv"))
    assert np.all(relative_error(again.estimate.force, paper_cut().force, paper_cut().cut.rate) < 0.03)


@pytest.mark.slow
def test_sensors_that_lag_and_lose_are_undone():
    """The same cut seen through slower sensors: the forces stay, without their delay."""
    slow = virtual_cut(gap_delay=60e-6, gap_bandwidth=7000.0, acceleration_delay=20e-6)
    estimate = watch(slow.cut, slow.air).estimate
    assert np.all(relative_error(estimate.force, slow.force, slow.cut.rate) < 0.045)
    wrong = replace(slow.cut, sensors=tuple(replace(s, delay=0.0, bandwidth=None) for s in slow.cut.sensors))
    worse = watch(wrong, replace(slow.air, sensors=wrong.sensors)).estimate
    assert np.all(relative_error(worse.force, slow.force, slow.cut.rate) > 0.3)


@pytest.mark.slow
def test_a_narrow_bandwidth_keeps_few_harmonics():
    narrow = watch(paper_cut().cut, paper_cut().air, bandwidth=2.0 * np.pi * 1000.0)
    spectrum = np.abs(np.fft.rfft(narrow.estimate.force[-4096:] * np.hanning(4096)[:, None], axis=0))
    frequency = np.fft.rfftfreq(4096, 1.0 / 25600.0)
    assert spectrum[frequency > 2500.0].max() < 0.05 * spectrum[frequency < 1100.0].max()


@pytest.mark.slow
def test_a_trigger_tells_the_speed(found):
    speed = paper_cut().spindle_speed
    for pulses in (1, 3):
        assert trigger_speed(with_trigger(paper_cut().cut, speed, pulses)) == pytest.approx(speed, rel=0.01)
    by_trigger = watch(with_trigger(paper_cut().cut, speed), paper_cut().air, speed=None, method=PaperWalk())
    assert by_trigger.spindle_speed == pytest.approx(speed, rel=1e-6)
    with pytest.raises(InputError, match="spindle_speed"):
        watch(paper_cut().cut, speed=None)
    still = with_trigger(paper_cut().cut, 0.0)
    with pytest.raises(Unsteady, match="trigger"):
        watch(still, speed=None)


@pytest.mark.slow
def test_the_posterior_widens_the_bands(found):
    """Of a machine whose C31 is uncertain by a known share: the force is, too."""
    machine = replace(by_hand.machine(rivals=0), identified_band=BAND)
    certain = {
        axis: replace(part, posterior=replace(part.posterior, covariance=0.0 * part.posterior.covariance))
        for axis, part in machine.identified.items()
    }
    machines = (machine, replace(machine, identified=certain))
    one, two = (watch(paper_cut().cut, paper_cut().air, machine=each, method=PaperWalk()) for each in machines)
    for i, axis in enumerate(one.estimate.axes):
        assert one.model_error[axis] > 0.0
        assert two.model_error[axis] == 0.0
        own, bare = one.estimate.standard_deviation[:, i], two.estimate.standard_deviation[:, i]
        np.testing.assert_allclose(own**2, bare**2 + one.model_error[axis] ** 2, rtol=1e-6)


@pytest.mark.slow
def test_wear_of_the_paper_case(found):
    """Through machine, sensors and observer: K_tc and K_rc of the virtual workpiece (902 MPa, 0.26), no edges."""
    made = paper_cut()
    from tests.fixtures.virtual_cut import CASE

    worn = wear_of(found, Cutter(2, 0.012, made.tooling.cutter.helix), CASE)
    assert worn.separable
    assert worn.misfit < 0.05
    np.testing.assert_allclose(worn.coefficient[:, :2].mean(axis=0), [902e6, 0.26 * 902e6], rtol=0.04)
    assert np.all(np.abs(worn.coefficient[:, 2:].mean(axis=0)) < 2e3)
    assert np.mod(worn.angle - made.angle + 0.1, np.pi) == pytest.approx(0.1, abs=0.02)


@pytest.mark.slow
def test_bad_records_are_refused_in_a_sentence():
    cut = paper_cut().cut
    lost = np.array(cut.samples)
    lost[100, 0] = np.nan
    with pytest.raises(Unsteady, match="drop-outs"):
        watch(replace(cut, samples=lost))
    with pytest.raises(Unsteady, match="too short"):
        watch(replace(cut, samples=cut.samples[:600]))
    with pytest.raises(InputError, match="no displacement") as missing:
        watch(replace(cut, samples=cut.samples[:, 2:], sensors=cut.sensors[2:]))
    # no later part of the signal has a sensor more
    assert not isinstance(missing.value, Unsteady)
    with pytest.raises(InputError, match="band"):
        watch(cut, machine=known_in((2.0 * np.pi * 20000.0, 2.0 * np.pi * 30000.0)))


@pytest.mark.slow
def test_the_observers_start_is_left_out(found):
    """Of a long recording as much as the observer needs, and of a short one half, with a word."""
    long = streamed()[0][SECOND + SECOND // 2 :]
    estimate, observer = watch(turning().recording(long)).estimate, found.observer
    assert estimate.force.shape[0] < len(long)
    assert estimate.time[0] == estimate.start == pytest.approx((len(long) - estimate.force.shape[0]) * estimate.step)
    assert np.abs(estimate.force).max() < 6.0 * np.std(estimate.force[-SECOND // 2 :], axis=0).max()
    count = paper_cut().cut.samples.shape[0]
    assert observer.settling > count // 2
    assert found.estimate.start == pytest.approx(count // 2 * found.estimate.step)
    assert any("its first half is left out" in remark for remark in found.remarks)
    assert set(found.notes) < set(found.remarks)


@pytest.mark.slow
def test_figures_have_units_and_bands(found):
    history = force_history(found.estimate, found.spindle_speed)
    assert [ax.get_ylabel() for ax in history.axes] == ["force X [N]", "force Y [N]"]
    assert history.axes[-1].get_xlabel() == "time [ms]"
    low, high = history.axes[0].get_xlim()
    assert high - low > 3.0 * 5.0
    responses = observer_frf(found.response, found.band)
    assert "dB" in responses.axes[0].get_ylabel()
    assert responses.axes[-1].get_xlabel() == "frequency [Hz]"
    with_truth = force_history(found.estimate, found.spindle_speed, true=paper_cut().force[-found.estimate.force.shape[0] :])
    assert len(with_truth.axes[0].lines) == len(history.axes[0].lines) + 1


def test_methods_are_objects():
    assert Resonators().colours_noise
    assert not PaperWalk().colours_noise
