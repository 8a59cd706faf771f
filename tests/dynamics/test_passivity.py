"""What a measured FRF must be: every turn of a passive one is found, named and undone; proper ones and noise are left alone."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.passivity import Correction, FrfCode, correction_of, judged, reciprocal

FREQUENCY = np.arange(50.0, 3000.0, 5.0)
OMEGA = 2.0 * np.pi * FREQUENCY
#: What went wrong, and what puts it right: each is its own inverse.
WRONG = {
    Correction.REVERSE: lambda h: -h,
    Correction.CONJUGATE: np.conj,
    Correction.CONJUGATE_REVERSE: lambda h: -np.conj(h),
    Correction.EXCHANGE: lambda h: h.imag + 1j * h.real,
    Correction.EXCHANGE_REVERSE: lambda h: -(h.imag + 1j * h.real),
}


def mode(hertz, stiffness, zeta):
    natural = 2.0 * np.pi * hertz
    return natural**2 / stiffness / (natural**2 - OMEGA**2 + 2j * zeta * natural * OMEGA)


#: Tips: one mode, two and one above, a stiff tool above soft machine modes, a wide one.
TIPS = {
    "one": mode(900.0, 2e7, 0.03),
    "two": mode(700.0, 2e7, 0.03) + mode(1300.0, 1e7, 0.02) + mode(5000.0, 5e7, 0.02),
    "machine": mode(60.0, 5e7, 0.05) + mode(450.0, 4e7, 0.04) + mode(2100.0, 8e6, 0.015),
    "wide": mode(1000.0, 1e7, 0.12) + 2e-8,
    "stiff": mode(900.0, 2e7, 0.03) + 3e-7,
}


def noisy(h, share, seed=3):
    rng = np.random.default_rng(seed)
    return h + share * np.abs(h).max() * (rng.standard_normal(h.size) + 1j * rng.standard_normal(h.size))


@pytest.mark.parametrize("damping", [0.005, 0.03])
@pytest.mark.parametrize(("degrees", "said"), [(40.0, False), (-40.0, False), (51.0, True), (-51.0, True)])
def test_a_phase_of_45_degrees_makes_an_frf_that_is_none_of_a_driving_point(damping, degrees, said):
    """Whatever the mode: what is given back is a matter of the phase alone."""
    _, remarks = judged(FREQUENCY, mode(900.0, 2e7, damping) * np.exp(1j * np.radians(degrees)))
    assert any("no driving point has" in remark for remark in remarks) == said


@pytest.mark.parametrize("share", [0.0, 1e-3])
@pytest.mark.parametrize("tip", TIPS)
def test_a_passive_frf_is_left_alone(tip, share):
    h = noisy(TIPS[tip], share)
    values, remarks = judged(FREQUENCY, h)
    assert values is h
    assert remarks == ()


@pytest.mark.parametrize("share", [0.0, 1e-3])
@pytest.mark.parametrize("correction", WRONG)
@pytest.mark.parametrize("tip", TIPS)
def test_what_is_certain_is_turned_and_named(tip, correction, share):
    h = noisy(TIPS[tip], share)
    values, (remark,) = judged(FREQUENCY, WRONG[correction](h))
    np.testing.assert_allclose(values, h, rtol=1e-15)
    assert remark.code is FrfCode.TURNED
    assert f"(correction {correction})" in remark


@pytest.mark.parametrize("correction", WRONG)
def test_what_is_asked_is_done_and_what_is_forbidden_is_only_named(correction):
    h = TIPS["two"]
    wrong = WRONG[correction](h)
    values, remarks = judged(FREQUENCY, wrong, correction)
    np.testing.assert_allclose(values, h, rtol=1e-15)
    assert remarks == ()
    values, (remark,) = judged(FREQUENCY, wrong, Correction.NONE)
    assert values is wrong
    assert remark.code is FrfCode.NOT_PASSIVE
    assert f"(correction {correction}) would explain it" in remark
    # one that makes it worse is said
    values, (remark,) = judged(FREQUENCY, h, correction)
    assert remark.endswith(f"after the correction {correction}")


def test_two_points_are_no_driving_point():
    """A mode of the other sign is of two points: nothing turns it."""
    h = mode(700.0, 2e7, 0.03) - mode(1300.0, 2e7, 0.02)
    values, (remark,) = judged(FREQUENCY, h)
    assert values is h
    assert remark == "Im > 0 at 1300 Hz, which no driving point has: were response and force one point?"
    # where they are known to be two, there is nothing to say, and only the sign of time can be told
    assert judged(FREQUENCY, h, driving=False) == (h, ())
    values, (remark,) = judged(FREQUENCY, np.conj(h), driving=False)
    np.testing.assert_array_equal(values, h)
    assert remark.startswith("the FRF turns anticlockwise: time as e^(-iωt)")
    assert judged(FREQUENCY, -h, driving=False)[1] == ()


@pytest.mark.parametrize(("order", "name"), [(1, "a mobility"), (2, "an accelerance")])
def test_another_quantity_explains_it_where_nobody_told_the_unit(order, name):
    h = TIPS["two"] * (1j * OMEGA) ** order
    values, (remark,) = judged(FREQUENCY, h, unit_told=False)
    assert values is h
    assert f"{name} whose unit nobody told" in remark
    assert name not in judged(FREQUENCY, h)[1][0]


@pytest.mark.parametrize("seed", range(20))
def test_noise_says_nothing(seed):
    rng = np.random.default_rng(seed)
    h = 1e-8 * (rng.standard_normal(FREQUENCY.size) + 1j * rng.standard_normal(FREQUENCY.size))
    assert judged(FREQUENCY, h) == (h, ())


def test_drift_below_the_first_mode_is_not_judged():
    h = TIPS["two"] + 1e-2 * np.exp(1j) / OMEGA**2 * (FREQUENCY < 100.0)
    assert judged(FREQUENCY, h)[1] == ()


def test_a_delay_of_the_sensor_is_no_fault():
    h = TIPS["two"] * np.exp(-1j * OMEGA * 2e-5)
    assert judged(FREQUENCY, h)[1] == ()


@pytest.mark.parametrize("count", [0, 1, 3, 19])
def test_a_few_lines_are_not_judged(count):
    assert judged(FREQUENCY[:count], np.conj(TIPS["two"][:count]))[1] == ()


def test_lines_outside_of_the_band_do_not_count():
    h = np.where(FREQUENCY > 2500.0, np.conj(1e3 * TIPS["two"]), TIPS["two"])
    assert judged(FREQUENCY, h, band=(0.0, 2400.0))[1] == ()
    assert judged(FREQUENCY, h)[1] != ()


def test_reciprocity():
    h = mode(700.0, 2e7, 0.03) - mode(1300.0, 2e7, 0.02)
    assert reciprocal(FREQUENCY, h, noisy(h, 0.01), ("XY", "YX")) == ()
    for turned, words in (
        (-h, "a reversed sensor or hammer in one"),
        (np.conj(h), "time as e^(-iωt) in one"),
        (3.0 * h, "same two points"),
    ):
        (remark,) = reciprocal(FREQUENCY, h, turned, ("XY", "YX"))
        assert remark.code is FrfCode.NOT_RECIPROCAL
        assert words in remark


def test_a_correction_that_nobody_knows_is_refused():
    with pytest.raises(InputError, match="correction: found backwards, allowed is auto, none, reverse"):
        correction_of("backwards")
