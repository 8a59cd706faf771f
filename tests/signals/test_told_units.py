"""Units as files write them: what is known, what is something else, and what is refused to be guessed."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.signals.recording import Quantity
from rcsa_ident.signals.told_units import frf_unit, hertz_in, is_untold, quantity_in, rate_in, seconds_in, told_unit, volts_in

GRAVITY = 9.80665


@pytest.mark.parametrize(
    ("text", "factor", "quantity"),
    [
        ("mg", 1e-3 * GRAVITY, Quantity.ACCELERATION), ("g", GRAVITY, Quantity.ACCELERATION), ("gn", GRAVITY, Quantity.ACCELERATION),
        ("g_n", GRAVITY, Quantity.ACCELERATION), ("G", GRAVITY, Quantity.ACCELERATION), ("ft/s²", 0.3048, Quantity.ACCELERATION),
        ("mm/s²", 1e-3, Quantity.ACCELERATION), ("m/s/s", 1.0, Quantity.ACCELERATION), ("m·s⁻²", 1.0, Quantity.ACCELERATION),
        ("m s^-2", 1.0, Quantity.ACCELERATION), ("m.s-2", 1.0, Quantity.ACCELERATION), ("m/(s*s)", 1.0, Quantity.ACCELERATION),
        ("m/sec^2", 1.0, Quantity.ACCELERATION), ("M/S**2", 1.0, Quantity.ACCELERATION), ("in/s2", 0.0254, Quantity.ACCELERATION),
        ("N", 1.0, Quantity.FORCE), ("mN", 1e-3, Quantity.FORCE), ("MN", 1e6, Quantity.FORCE), ("daN", 10.0, Quantity.FORCE),
        ("kgf", GRAVITY, Quantity.FORCE), ("lbf", 4.4482216152605, Quantity.FORCE), ("kg m/s^2", 1.0, Quantity.FORCE),
        ("mil", 25.4e-6, Quantity.DISPLACEMENT), ("µm", 1e-6, Quantity.DISPLACEMENT), ("UM", 1e-6, Quantity.DISPLACEMENT),
        ("mPa", 1e-3, Quantity.SOUND),
        ("nm", 1e-9, Quantity.DISPLACEMENT), ("MM", 1e-3, Quantity.DISPLACEMENT), ("Pa", 1.0, Quantity.SOUND),
        ("Nm", 1.0, None), ("mm/s", 1e-3, None), ("mV", 1e-3, None), ("V", 1.0, None), ("m/s^3", 1.0, None),
        ("ms-2", 1e6, None), ("kN/mm", 1e6, None), ("mV/g", 1e-3 / GRAVITY, None),
    ],
)  # fmt: skip
def test_known_units(text, factor, quantity):
    found = quantity_in(text)
    assert found == (pytest.approx(factor, rel=1e-14), quantity)


@pytest.mark.parametrize(
    "text",
    ["furlong", "counts", "EU", "m/s*s", "m/N s", "NM", "nM", "MPA", "MM/MN", "mn", "m/", "/N", "m//s", "(m", "m)", "", "g/√Hz", "10 mm",
     "m^", "m^x", "dB", "%", "g rms", "x" * 1000, "(" * 79, "m" + "/s" * 60],
)  # fmt: skip
def test_what_is_unknown_or_could_be_either_is_none(text):
    assert told_unit(text) is None
    assert quantity_in(text) == (1.0, None)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("mm/s²/mN", (1.0, 2, False)), ("(1/N)*(m/s²)", (1.0, 2, False)), ("1/kg", (1.0, 2, False)), ("m/(N·s²)", (1.0, 2, False)),
        ("m per N", (1.0, 0, False)), ("mil/lbf", (25.4e-6 / 4.4482216152605, 0, False)), ("ips/lbf", (0.0254 / 4.4482216152605, 1, False)),
        ("kN/mm", (1e6, 0, True)), ("N s/m", (1.0, 1, True)), ("kg", (1.0, 2, True)),
    ],
)  # fmt: skip
def test_units_of_frfs(text, expected):
    assert frf_unit(text) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("text", ["m", "N", "m/(N m)", "rad/N", "g/mV", "1/N", "Hz", "m/s^3/N", "kg/N"])
def test_what_is_no_unit_of_an_frf(text):
    assert frf_unit(text) is None


def test_other_quantities():
    assert (hertz_in("kHz"), hertz_in("KHz"), hertz_in("rpm"), hertz_in("1/s"), hertz_in("s")) == (1e3, 1e3, 1.0 / 60.0, None, None)
    assert hertz_in("rad/s") == pytest.approx(0.5 / np.pi)
    assert [seconds_in(text) for text in ("ms", "nsec", "min", "µs", "Sekunden", "sec.", "Milliseconds", "N", "")] == [
        1e-3, 1e-9, 60.0, 1e-6, 1.0, 1.0, 1e-3, None, None
    ]  # fmt: skip
    rates = ["S/s", "kSa/s", "MS/s", "ksps", "samples/sec", "MHZ", "k", "s^-1", "mHz"]
    assert [rate_in(text) for text in rates] == [1.0, 1e3, 1e6, 1e3, 1.0, 1e6, 1e3, 1.0, 1e-3]
    assert [rate_in(text) for text in ("ms/s", "mhz", "rpm", "g", "")] == [None] * 5
    assert (volts_in("mV"), volts_in("MV"), volts_in("Millivolts"), volts_in("V/g")) == (1e-3, 1e-3, 1e-3, None)
    assert [is_untold(text) for text in ("", " - ", "NONE", "m", "EU")] == [True, True, True, False, False]
