"""Tip force to measured displacement as a sampled filter: the machine's own response, sensors, high-pass, integration."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.signal

from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.observer.transfer_function import SampledModes, acceleration_filter, high_pass, transfer_function, warped
from rcsa_ident.signals.recording import Quantity, Sensor
from tests.fixtures.flange_machine import BAND, paper_cut

STEP = 1.0 / 25600.0
OMEGA = 2.0 * np.pi * np.arange(100.0, 5500.0, 5.0)
INSIDE = (BAND[0] <= OMEGA) & (BAND[1] >= OMEGA)
CORNER = 0.25 * BAND[0]


@pytest.fixture(scope="module")
def cross():
    """True C31 of the virtual machine, X."""
    return paper_cut().true_cross(OMEGA)[:, 0]


@pytest.fixture(scope="module")
def transfer(cross):
    return transfer_function(OMEGA, cross, STEP, BAND)


@pytest.mark.slow
def test_it_is_the_machines_response_in_the_band(transfer, cross):
    np.testing.assert_allclose(transfer.response(OMEGA[INSIDE]), cross[INSIDE], rtol=0.01)
    assert transfer.flatness < 0.1
    assert 8 <= transfer.order <= 24


@pytest.mark.slow
def test_it_is_stable_and_strictly_proper(transfer):
    system = transfer.fit.state_space()
    assert system.stable
    np.testing.assert_array_equal(system.D, 0.0)
    assert np.all(np.abs(transfer.behind_high_pass(CORNER).decay) < 1.0)


@pytest.mark.slow
def test_the_sampled_filter_has_the_response_of_machine_and_high_pass(transfer, cross):
    """At every frequency of the band, at 25.6 kHz: no hold's droop (9 % at 4.3 kHz) and no delay of half a sample."""
    passed = (1j * warped(OMEGA, STEP)) ** 2
    c = warped(np.array(CORNER), STEP)
    passed = passed / (passed + np.sqrt(2.0) * c * 1j * warped(OMEGA, STEP) + c**2)
    np.testing.assert_allclose(high_pass(CORNER, STEP).response(OMEGA), passed, rtol=1e-9)
    plant = transfer.behind_high_pass(CORNER)
    np.testing.assert_allclose(plant.response(OMEGA), transfer.response(OMEGA) * passed, rtol=1e-7)
    np.testing.assert_allclose(plant.response(OMEGA[INSIDE]), (cross * passed)[INSIDE], rtol=0.01)


def test_high_pass_is_scipys_butterworth():
    b, a = scipy.signal.butter(2, CORNER / (2.0 * np.pi), "highpass", fs=1.0 / STEP)
    np.testing.assert_allclose(high_pass(CORNER, STEP).response(OMEGA), scipy.signal.freqz(b, a, OMEGA * STEP)[1], rtol=1e-7)


def test_integrated_acceleration_and_gap_pass_alike():
    passed = acceleration_filter(CORNER, STEP, BAND).response(OMEGA) * -(OMEGA**2)
    np.testing.assert_allclose(passed[INSIDE], high_pass(CORNER, STEP).response(OMEGA[INSIDE]), rtol=5e-3)


def test_sensors_bandwidth_and_delay_are_in_it(cross):
    gap = Sensor("g", Quantity.DISPLACEMENT, Dof.X, delay=60e-6, bandwidth=6000.0).response(OMEGA)
    acceleration = Sensor("a", Quantity.ACCELERATION, Dof.X, delay=20e-6, bandwidth=9000.0).response(OMEGA)
    slow = transfer_function(OMEGA, cross, STEP, BAND, gap)
    np.testing.assert_allclose(slow.response(OMEGA[INSIDE]), (cross * gap)[INSIDE], rtol=0.015)
    assert slow.fit.state_space().stable
    # an accelerometer that is faster than the gap sensor is slowed down to it
    shaken = acceleration_filter(CORNER, STEP, BAND, gap / acceleration, OMEGA).response(OMEGA) * acceleration * -(OMEGA**2)
    np.testing.assert_allclose(shaken[INSIDE], (high_pass(CORNER, STEP).response(OMEGA) * gap)[INSIDE], rtol=5e-3)


def test_an_order_that_is_asked_for_is_kept(cross):
    assert transfer_function(OMEGA, cross, STEP, BAND, order=10).order == 10


def test_filter_is_the_difference_equation_in_blocks_too():
    modes = SampledModes(np.array([0.9 * np.exp(0.4j), 0.5]), np.array([0.3 - 0.2j, 0.7]), 0.25, STEP)
    rng = np.random.default_rng(1)
    signal = rng.normal(size=200)
    # numerator and denominator of each pair, by hand; a real pole stands with half its residue
    pair = scipy.signal.lfilter([0.0, 0.6, -2.0 * ((0.3 - 0.2j) * 0.9 * np.exp(-0.4j)).real], [1.0, -1.8 * np.cos(0.4), 0.81], signal)
    expected = 0.25 * signal + pair + scipy.signal.lfilter([0.0, 1.4], [1.0, -0.5], signal)
    state, whole = modes.run(modes.init(), signal)
    np.testing.assert_allclose(whole, expected, rtol=1e-10, atol=1e-12)
    first, one = modes.run(modes.init(), signal[:77])
    second, two = modes.run(first, signal[77:])
    np.testing.assert_array_equal(np.concatenate([one, two]), whole)
    np.testing.assert_array_equal(second, state)


def test_bands_that_cannot_be_are_refused(cross):
    for band in ((BAND[1], BAND[0]), (2.0 * np.pi * 12000.0, 2.0 * np.pi * 12500.0)):
        with pytest.raises(InputError, match="band"):
            transfer_function(OMEGA, cross, STEP, band)
