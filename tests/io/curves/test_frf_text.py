"""FRFs as text: a generator writes the grammar of docs/formats/frf.md in its dialects; each is read back, or refused by its words."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.curves.frf_files import read_frfs

FREQUENCY = np.arange(100.0, 2000.0, 7.0)
OMEGA = 2.0 * np.pi * FREQUENCY
NATURAL = 2.0 * np.pi * 900.0
H = NATURAL**2 / 1e7 / (NATURAL**2 - OMEGA**2 + 2j * 0.03 * NATURAL * OMEGA)
POUND, GRAVITY = 4.4482216152605, 9.80665
#: Units, and what they make of a receptance in m/N.
UNITS = {
    "m/N": lambda h: h, "µm/N": lambda h: 1e6 * h, "mm / kN": lambda h: 1e6 * h, "in/lbf": lambda h: h * POUND / 0.0254,
    "m/s/N": lambda h: 1j * OMEGA * h, "mm/s/N": lambda h: 1e3j * OMEGA * h, "(m/s)/N": lambda h: 1j * OMEGA * h,
    "(m/s²)/N": lambda h: -(OMEGA**2) * h, "g/N": lambda h: -(OMEGA**2) * h / GRAVITY, "1/kg": lambda h: -(OMEGA**2) * h,
    "(1/N)*(m/s²)": lambda h: -(OMEGA**2) * h, "mg/mN": lambda h: -(OMEGA**2) * h / GRAVITY, "mm·s⁻²/N": lambda h: -1e3 * OMEGA**2 * h,
    "N/m": lambda h: 1.0 / h, "N/µm": lambda h: 1e-6 / h, "kg": lambda h: -1.0 / (OMEGA**2 * h), "N·s/m": lambda h: 1.0 / (1j * OMEGA * h),
}  # fmt: skip
FREQUENCIES = {
    "Hz": 1.0,
    "kHz": 1e-3,
    "rad/s": 2.0 * np.pi,
    "rpm": 60.0,
}
#: Delimiter and decimal sign.
LAYOUTS = [(",", "."), ("\t", "."), (";", "."), (";", ","), ("\t", ","), ("  ", "."), (" ", ","), (" ; ", ".")]
PARTS = {
    "real": np.real,
    "imag": np.imag,
    "mag": np.abs,
    "deg": lambda v: np.angle(v, deg=True),
    "rad": np.angle,
    "dB": lambda v: 20.0 * np.log10(np.abs(v)),
}
#: Names of columns, with {u} for the unit of the values and {f} for that of the frequency, and what they hold.
NAMES = [
    (("Frequency ({f})", "Real ({u})", "Imag ({u})"), ("f", "real", "imag")),
    (("Frequency [{f}]", "Real [{u}]", "Imaginary"), ("f", "real", "imag")),
    (("freq [{f}]", "Im(H) [{u}]", "Re(H) [{u}]"), ("f", "imag", "real")),
    (("No.", "Frequency ({f})", "Real part ({u})", "Imaginary part ({u})"), ("i", "f", "real", "imag")),
    (("Frequency ({f})", "Magnitude ({u})", "Phase (deg)"), ("f", "mag", "deg")),
    (("f ({f})", "|H| ({u})", "Phase angle (rad)"), ("f", "mag", "rad")),
    (("Phase (°)", "Amplitude [{u}]", "Frequency [{f}]"), ("deg", "mag", "f")),
    (("Frequency ({f})", "Magnitude (dB re 1 {u})", "Phase (deg)"), ("f", "dB", "deg")),
    (("Frequenz [{f}]", "Betrag [{u}]", "Phasenwinkel [°]"), ("f", "mag", "deg")),
    (("Frequency ({f})", "Real ({u})", "Imag ({u})", "Coherence"), ("f", "real", "imag", "i")),
    (("Frequency ({f})", "Real ({u})", "Imag ({u})", "Magnitude ({u})", "Phase (deg)"), ("f", "real", "imag", "mag", "deg")),
    (("Spectral line", "Frequency ({f})", "Mag ({u})", "Phase [deg]"), ("i", "f", "mag", "deg")),
]


def text(names, holds, unit, hertz, layout, above=(), units=()):
    """The file of one dialect."""
    delimiter, decimal = layout
    values = UNITS[unit](H)
    known = {"f": FREQUENCY * FREQUENCIES[hertz], "i": np.arange(1.0, FREQUENCY.size + 1.0)}
    table = np.stack([known[each] if each in known else PARTS[each](values) for each in holds], axis=1)
    rows = [delimiter.join(f"{value:.15e}".replace(".", decimal) for value in row) for row in table]
    head = [delimiter.join(line).format(u=unit, f=hertz) for line in (names, units) if line]
    return "\n".join([*(line.format(u=unit, f=hertz) for line in above), *head, *rows]) + "\n"


def read_back(path):
    (test,) = read_frfs(path)
    np.testing.assert_allclose(test.frequency, FREQUENCY, rtol=1e-12)
    assert np.max(np.abs(test.values - H)) <= 1e-12 * np.max(np.abs(H))
    return test


# every form of names with every unit, every unit of the frequency and every layout, each pair of them at least once
DIALECTS = [
    (*NAMES[i % len(NAMES)], unit, list(FREQUENCIES)[(i + j) % 4], LAYOUTS[(i + 3 * j) % len(LAYOUTS)])
    for j, unit in enumerate(UNITS)
    for i in range(len(NAMES))
]


@pytest.mark.parametrize("k", range(len(NAMES)), ids=["+".join(holds) + f"-{names[0][:9]}" for names, holds in NAMES])
def test_what_the_header_says_is_read(tmp_path, k):
    for i, (names, holds, unit, hertz, layout) in enumerate(DIALECTS[k :: len(NAMES)]):
        path = tmp_path / f"{i}.txt"
        path.write_text(text(names, holds, unit, hertz, layout), encoding="utf-8")
        test = read_back(path)
        unread = [
            name for name, held in zip(names, holds, strict=True) if name == "Coherence" or ("real" in holds and held in ("mag", "deg"))
        ]
        assert [str(remark) for remark in test.remarks] == ([f"not read: {', '.join(unread).format(u=unit)}"] if unread else [])


@pytest.mark.parametrize(
    ("names", "units", "above", "holds", "unit", "hertz"),
    [
        (("Freq", "Real", "Imag"), ("{f}", "{u}", "{u}"), (), ("f", "real", "imag"), "g/N", "kHz"),
        (("Freq", "Mag", "Phase"), ("[{f}]", "[{u}]", "[deg]"), (), ("f", "mag", "deg"), "mm / kN", "Hz"),
        (("Freq", "Real", "Imag"), ("{f}", "{u}", "-"), ("Tap of 2026-11-21",), ("f", "real", "imag"), "m/s/N", "Hz"),
        (("f", "Re", "Im"), (), ("Units: Hz, µm/N",), ("f", "real", "imag"), "µm/N", "Hz"),
        (("f", "Re", "Im"), (), ("FRF in [g/N]", "Frequency unit: rad/s"), ("f", "real", "imag"), "g/N", "rad/s"),
        (("freq_{f}", "real_{u}", "imag_{u}"), (), (), ("f", "real", "imag"), "m/N", "Hz"),
        (("f/{f}", "Re/({u})", "Im/({u})"), (), (), ("f", "real", "imag"), "m/N", "kHz"),
        (("omega [{f}]", "Receptance real [{u}]", "Receptance imag [{u}]"), (), (), ("f", "real", "imag"), "m/N", "rad/s"),
        (("Frequency ({f})", "Real(H(f)) ({u})", "Imag(H(f)) ({u})"), (), (), ("f", "real", "imag"), "N/µm", "Hz"),
        (("# Frequency [{f}]", "Real [{u}]", "Imag [{u}]"), (), ("# lab 3",), ("f", "real", "imag"), "m/N", "Hz"),
        (("Frequenz in {f}", "Realteil in {u}", "Imaginärteil in {u}"), (), (), ("f", "real", "imag"), "µm/N", "Hz"),
        (("Frequency ({f})", "FRF (Real) [{u}]", "FRF (Imag) [{u}]"), (), (), ("f", "real", "imag"), "g/N", "Hz"),
        (("Frequency ({f})", "H11 Real [{u}]", "H11 Imag. [{u}]"), ("-----", "-----", "-----"), (), ("f", "real", "imag"), "m/N", "Hz"),
        (("Frequency [{f}]", "Dynamic compliance [{u}]", "Phase [deg]"), (), (), ("f", "mag", "deg"), "µm/N", "Hz"),
        (("freq_{f}", "mag_dB", "phase_deg"), (), ("Units: {u}",), ("f", "dB", "deg"), "m/N", "Hz"),
        (("f [{f}]", "Re{{H}} [{u}]", "Im{{H}} [{u}]"), (), (), ("f", "real", "imag"), "kg", "kHz"),
        (("f [{f}]", "Dynamic stiffness real [{u}]", "Dynamic stiffness imag [{u}]"), (), (), ("f", "real", "imag"), "N/µm", "Hz"),
    ],
)
@pytest.mark.parametrize("layout", [("\t", "."), (";", ","), (", ", ".")])
def test_units_stand_in_a_line_or_in_the_names(tmp_path, names, units, above, holds, unit, hertz, layout):
    path = tmp_path / "x.txt"
    path.write_text(text(names, holds, unit, hertz, layout, above, units), encoding="utf-8")
    assert all("0 dB" in remark for remark in read_back(path).remarks)


def test_rows_may_be_indented(tmp_path):
    """Found by fuzzing: between tabs the indent was a cell more than the first row has."""
    path = tmp_path / "x.txt"
    path.write_text(text(*NAMES[0], "m/N", "Hz", ("\t", ".")).replace("\n", "\n \t"))
    read_back(path)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252", "utf-16"])
def test_encodings(tmp_path, encoding):
    path = tmp_path / "x.txt"
    path.write_bytes(text(*NAMES[0], "µm/N", "Hz", ("\t", ",")).replace("\n", "\r\n").encode(encoding))
    read_back(path)


@pytest.mark.parametrize(
    ("word", "unit"),
    [
        ("Receptance", "m/N"), ("Mobility", "m/s/N"), ("Accelerance", "(m/s²)/N"), ("Inertance", "(m/s²)/N"),
        ("Dynamic stiffness", "N/m"), ("Apparent mass", "kg"), ("Acceleration/Force", "(m/s²)/N"), ("Mechanical impedance", "N·s/m"),
    ],
)  # fmt: skip
def test_a_quantity_that_is_said_counts_and_its_unit_is_remarked(tmp_path, word, unit):
    path = tmp_path / "x.txt"
    path.write_text(text(("Frequency (Hz)", "Real", "Imag"), ("f", "real", "imag"), unit, "Hz", ("\t", "."), [word]), encoding="utf-8")
    (remark,) = read_back(path).remarks
    assert remark.startswith("the table has no unit: ")


@pytest.mark.parametrize(
    "time", ["e^{-iωt}", "exp(-i w t)", "exp(-j*omega*t)", "exp(-j*2*pi*f*t)", "e^-2πift", "Time dependence: exp(-jωt)", "e^(−iωt)"]
)
def test_the_sign_of_time(tmp_path, time):
    path = tmp_path / "x.txt"
    path.write_text(
        text(
            ("Frequency (Hz)", "Real (m/N)", "-Imag (m/N)"),
            ("f", "real", "imag"),
            "m/N",
            "Hz",
            ("\t", "."),
            [time.replace("{", "{{").replace("}", "}}")],
        )
    )
    read_back(path)
    path.write_text(path.read_text().replace("-Imag", "Imag").replace("-i", "i").replace("-j", "j").replace("−i", "i").replace("^-2", "^2"))
    read_back(path)


def test_axes_in_the_names(tmp_path):
    values = {"X": H, "Y": 2.0 * H, "XY": 0.1 * H}
    names = ["Frequency (Hz)", *(f"{part} {axis} (m/N)" for axis in values for part in ("Real", "Imag"))]
    rows = np.stack([FREQUENCY, *itertools.chain.from_iterable((v.real, v.imag) for v in values.values())], axis=1)
    np.savetxt(tmp_path / "x.txt", rows, fmt="%.15e", delimiter="\t", header="\t".join(names), comments="")
    found = {(test.response, test.force): test.values for test in read_frfs(tmp_path / "x.txt")}
    assert set(found) == {("X", "X"), ("Y", "Y"), ("X", "Y")}
    np.testing.assert_allclose(found["X", "Y"], 0.1 * H, rtol=1e-12)


def test_what_is_not_said_is_remarked(tmp_path):
    path = tmp_path / "x.txt"
    rows = np.stack([FREQUENCY, H.real, H.imag], axis=1)
    np.savetxt(path, rows, fmt="%.15e")
    assert read_back(path).remarks == (
        "the table has no unit: receptance [m/N] is assumed",
        "the table names no columns: frequency [Hz], real part, imaginary part are assumed",
    )
    np.savetxt(path, rows, fmt="%.15e", header="f Re Im", comments="")
    assert read_back(path).remarks == ("the table has no unit: receptance [m/N] is assumed", "the frequency has no unit: Hz is assumed")
    np.savetxt(
        path, np.stack([FREQUENCY, np.abs(H), np.angle(H, deg=True)], axis=1), fmt="%.15e", header="f[Hz] |H|[m/N] phase", comments=""
    )
    assert read_back(path).remarks == ("the phase has no unit: deg is assumed",)
    decibels = np.stack([FREQUENCY, 20.0 * np.log10(np.abs(H)), np.angle(H)], axis=1)
    np.savetxt(path, decibels, fmt="%.15e", delimiter="\t", header="f[Hz]\tMag [dB]\tphase [rad]", comments="")
    assert len(read_back(path).remarks) == 2


@pytest.mark.parametrize(
    ("head", "words"),
    [
        (
            "Frequency (furlong)\tReal (m/N)\tImag (m/N)",
            "unit of column Frequency (furlong): found furlong, allowed is Hz, kHz, rad/s or rpm",
        ),
        ("Frequency (1/s)\tReal (m/N)\tImag (m/N)", "found 1/s"),
        ("Frequency (Hz)\tReal (furlong/N)\tImag", "found furlong/N"),
        ("Frequency (Hz)\tReal (mV/N)\tImag", "found mV/N"),
        ("Frequency (Hz)\tMagnitude (m/N)\tPhase (turns)", "found turns, allowed is deg or rad"),
        ("Frequency (Hz)\tMagnitude (dB re 1 V)\tPhase (deg)", "found dB re 1 V"),
        ("Frequency (Hz)\tReal (m/N)\tReal (m/N)", "two columns of the real"),
        ("Frequency (Hz)\tReal (m/N)\tPhase (deg)", "only real and phase"),
        ("Frequency (Hz)\tReal (m/N)\tQuality", "Quality"),
        ("Frequency (Hz)\tReal (m/N)\tImag (m/s/N)", "two quantities"),
        ("Frequency (Hz)\tFirst\tSecond", "First"),
        ("f../Hz\tReal.../furlong\tImag", "furlong"),
        ("Frequency (Hz)\tReal (m/N)\tImag (m/N)\tCoherence", "4 names for 3 columns"),
        ("Time (s)\tReal (m/N)\tImag (m/N)", "Time (s)"),
        ("Magnitude and phase of the tip", "Magnitude and phase"),
        ("all in rad/s", "all in rad/s"),
        ("Accelerance\nFrequency (Hz)\tReal (m/N)\tImag (m/N)", "accelerance in a unit of receptance"),
        ("Accelerance or receptance\nFrequency (Hz)\tReal\tImag", "accelerance, receptance, and no unit"),
        ("Units: furlong/N\nFrequency (Hz)\tReal\tImag", "unit in the header: found furlong/N"),
        ("Freq\tReal\tImag\nHz\tfurlong\t-", "furlong"),
        ("Sign convention: European\nFrequency (Hz)\tReal (m/N)\tImag (m/N)", "sign of time"),
        ("Convention: engineers'\nFrequency (Hz)\tReal (m/N)\tImag (m/N)", "sign of time"),
        ("complex conjugate\nFrequency (Hz)\tReal (m/N)\tImag (m/N)", "sign of time"),
    ],
)
def test_what_is_said_and_not_understood_is_refused_by_its_words(tmp_path, head, words):
    path = tmp_path / "x.txt"
    np.savetxt(path, np.stack([FREQUENCY, np.abs(H), H.imag], axis=1), fmt="%.15e", delimiter="\t", header=head, comments="")
    with pytest.raises(InputError) as caught:
        read_frfs(path)
    assert words in str(caught.value)


def test_a_phase_that_could_be_either_is_refused(tmp_path):
    path = tmp_path / "x.txt"
    phase = -12.0 * np.linspace(0.1, 1.0, FREQUENCY.size)
    np.savetxt(path, np.stack([FREQUENCY, np.abs(H), phase], axis=1), delimiter="\t", header="f[Hz]\tmag[m/N]\tphase", comments="")
    with pytest.raises(InputError, match="unit of column phase: found none, allowed is deg or rad"):
        read_frfs(path)


def test_four_columns_without_names_are_refused(tmp_path):
    path = tmp_path / "x.txt"
    np.savetxt(path, np.stack([np.arange(FREQUENCY.size), FREQUENCY, H.real, H.imag], axis=1))
    with pytest.raises(InputError, match="4 columns without names"):
        read_frfs(path)


def test_negative_magnitudes_are_decibels_that_nobody_named(tmp_path):
    path = tmp_path / "x.txt"
    table = np.stack([FREQUENCY, 20.0 * np.log10(np.abs(H)), np.angle(H)], axis=1)
    np.savetxt(path, table, delimiter="\t", header="f[Hz]\tmag[m/N]\tphase[rad]", comments="")
    with pytest.raises(InputError, match="or dB in its name"):
        read_frfs(path)
