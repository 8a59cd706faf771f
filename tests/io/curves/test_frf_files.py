"""Tap-test FRFs: formats, units, choice of the tip's FRF among many, bad files."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.curves.frf_files import Source, parse_units, read_frfs, read_tap_tests
from rcsa_ident.io.curves.tips import write_frf_csv
from rcsa_ident.io.uff import ACCELERATION, DISPLACEMENT, EXCITATION_FORCE, FRF, VELOCITY, UffAxis, UffFunction, write_uff
from tests.fixtures.paths import SHARED

FREQUENCY = np.arange(0.0, 2000.0, 5.0)
OMEGA = 2.0 * np.pi * FREQUENCY


def mode(frequency, stiffness=1e7, zeta=0.03):
    natural = 2.0 * np.pi * frequency
    return natural**2 / stiffness / (natural**2 - OMEGA**2 + 2j * zeta * natural * OMEGA)


X, Y, XY = mode(700.0), mode(900.0), 0.2 * mode(800.0)


def tip(values, **more):
    given = {"ordinate": UffAxis(DISPLACEMENT, "m"), "denominator": UffAxis(EXCITATION_FORCE, "N"), **more}
    return UffFunction(FRF, FREQUENCY, values, **given)


@pytest.mark.parametrize(
    ("axes", "factor", "order"),
    [
        ((UffAxis(DISPLACEMENT, "m"), UffAxis(EXCITATION_FORCE, "N")), 1.0, 0),
        ((UffAxis(DISPLACEMENT, ""), UffAxis(EXCITATION_FORCE, "")), 1.0, 0),
        ((UffAxis(VELOCITY, ""), UffAxis(EXCITATION_FORCE, "")), 1.0, 1),
        ((UffAxis(ACCELERATION, ""), UffAxis(EXCITATION_FORCE, "")), 1.0, 2),
        # labels win over a data type that somebody left at its default
        ((UffAxis(0, "m/s^2"), UffAxis(0, "N")), 1.0, 2),
        ((UffAxis(DISPLACEMENT, "g"), UffAxis(EXCITATION_FORCE, "N")), 9.80665, 2),
        ((UffAxis(ACCELERATION, "(m/s²)/N"), UffAxis(0, "")), 1.0, 2),
        ((UffAxis(ACCELERATION, "g/N"), UffAxis(EXCITATION_FORCE, "NONE")), 9.80665, 2),
        ((UffAxis(DISPLACEMENT, "µm"), UffAxis(EXCITATION_FORCE, "kN")), 1e-9, 0),
        ((UffAxis(DISPLACEMENT, "in"), UffAxis(EXCITATION_FORCE, "lbf")), 0.0254 / 4.4482216152605, 0),
        ((UffAxis(VELOCITY, "mm/s"), UffAxis(EXCITATION_FORCE, "")), 1e-3, 1),
    ],
)
def test_what_is_on_the_axis_becomes_a_receptance(tmp_path, axes, factor, order):
    path = tmp_path / "tip.uff"
    values = X * (1j * OMEGA) ** order / factor
    write_uff(path, [tip(values, response=(1, 1), reference=(1, 1), ordinate=axes[0], denominator=axes[1])])
    frequency, found = read_tap_tests([Source(path)])["X", "X"]
    kept = FREQUENCY > 0.0 if order else FREQUENCY >= 0.0
    np.testing.assert_allclose(frequency, FREQUENCY[kept], rtol=1e-9)
    np.testing.assert_allclose(found, X[kept], rtol=1e-10)


@pytest.mark.parametrize(("label", "factor"), [("Hz", 1.0), ("NONE", 1.0), ("", 1.0), ("kHz", 1e-3), ("rad/s", 2.0 * np.pi), ("rpm", 60.0)])
def test_the_label_of_the_abscissa_counts(tmp_path, label, factor):
    path = tmp_path / "tip.uff"
    function = UffFunction(
        FRF, FREQUENCY * factor, X, (1, 1), (1, 1), UffAxis(18, label), UffAxis(DISPLACEMENT, "m"), UffAxis(EXCITATION_FORCE, "N")
    )
    write_uff(path, [function])
    # the header has six digits of an even step
    np.testing.assert_allclose(read_tap_tests([Source(path)])["X", "X"][0], FREQUENCY, rtol=1e-6)


def test_an_abscissa_in_an_unknown_unit_is_refused(tmp_path):
    path = tmp_path / "tip.uff"
    write_uff(path, [UffFunction(FRF, FREQUENCY, X, (1, 1), (1, 1), UffAxis(18, "furlong"), UffAxis(DISPLACEMENT, "m"), UffAxis(13, "N"))])
    with pytest.raises(InputError, match="unit of the abscissa: found furlong, allowed is Hz, kHz, rad/s or rpm"):
        read_frfs(path)


@pytest.mark.parametrize("encoding", ["utf-8", "cp1252"])
def test_labels_beyond_ascii(tmp_path, encoding):
    path = tmp_path / "tip.uff"
    write_uff(path, [tip(X * 1e6, response=(1, 1), reference=(1, 1), ordinate=UffAxis(DISPLACEMENT, "um"))])
    path.write_bytes(path.read_bytes().replace(b"um  ", "µm  ".encode(encoding)))
    np.testing.assert_allclose(read_tap_tests([Source(path)])["X", "X"][1], X, rtol=1e-10)


def test_units_that_the_user_says_win(tmp_path):
    path = tmp_path / "tip.uff"
    write_uff(path, [tip(X * 1e3, response=(1, 1), reference=(1, 1))])
    np.testing.assert_allclose(read_tap_tests([Source(path)], "mm/N")["X", "X"][1], X, rtol=1e-10)


def test_units_of_the_file_as_a_whole(tmp_path):
    path = tmp_path / "tip.uff"
    silent = {"ordinate": UffAxis(DISPLACEMENT), "denominator": UffAxis(EXCITATION_FORCE)}
    write_uff(path, [tip(X, response=(1, 1), reference=(1, 1), **silent)])
    raw = path.read_bytes()
    # millimetres and millinewtons: the values are those of m/N; then millimetres and newtons
    for force, factor in ((1e3, 1.0), (1.0, 1e-3)):
        path.write_bytes(raw.replace(f"{1.0:25.17E}{1.0:25.17E}".encode(), f"{1e3:25.17E}{force:25.17E}".encode(), 1))
        np.testing.assert_allclose(read_tap_tests([Source(path)])["X", "X"][1], factor * X, rtol=1e-10)


def test_a_unit_that_nobody_knows_is_asked_for(tmp_path):
    path = tmp_path / "tip.uff"
    write_uff(path, [tip(X, response=(1, 1), reference=(1, 1), ordinate=UffAxis(DISPLACEMENT, "furlong"))])
    with pytest.raises(InputError, match=r"tip.uff line \d+: frf_units: found .*furlong"):
        read_tap_tests([Source(path)])
    np.testing.assert_allclose(read_tap_tests([Source(path)], "m/N")["X", "X"][1], X, rtol=1e-10)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("m/N", (1.0, 0, False)),
        ("um / N", (1e-6, 0, False)),
        ("(m/s^2)/N", (1.0, 2, False)),
        ("m/s**2/kN", (1e-3, 2, False)),
        ("N/m", (1.0, 0, True)),
    ],
)
def test_units(text, expected):
    assert parse_units(text) == pytest.approx(expected)


@pytest.mark.parametrize("text", ["", "m", "N", "m/", "/N", "kg/N", "m/s^3/N"])
def test_units_that_are_none(text):
    with pytest.raises(InputError, match="motion over force"):
        parse_units(text)


def test_the_tip_is_hit_where_it_is_measured(tmp_path):
    path = tmp_path / "survey.uff"
    records = [
        UffFunction(6, FREQUENCY, np.ones(FREQUENCY.size)),
        tip(XY, response=(7, 1), reference=(1, 1)),
        tip(-X, response=(1, 1), reference=(1, -1)),
        tip(Y, response=(1, -2), reference=(1, -2)),
        tip(XY, response=(1, 1), reference=(1, 2)),
        tip(XY, response=(1, 3), reference=(1, 3)),
    ]
    write_uff(path, records)
    found = read_tap_tests([Source(path)])
    assert set(found) == {("X", "X"), ("Y", "Y"), ("X", "Y"), ("Z", "Z")}
    # a sensor that looks against the force
    np.testing.assert_allclose(found["X", "X"][1], X, rtol=1e-10)
    assert found["X", "X"].remarks == ()
    np.testing.assert_allclose(found["Y", "Y"][1], Y, rtol=1e-10)
    chosen = read_tap_tests([Source(path, ("X", "X"), 2)])
    np.testing.assert_allclose(chosen["X", "X"][1], XY, rtol=1e-10)
    assert [t.record for t in read_frfs(path)] == [2, 3, 4, 5, 6]
    with pytest.raises(InputError, match="record 1, allowed is the number of an FRF"):
        read_tap_tests([Source(path, None, 1)])
    with pytest.raises(InputError, match="no FRF of axis YX, allowed is an axis that the file holds"):
        read_tap_tests([Source(path, ("Y", "X"))])
    with pytest.raises(InputError, match="X twice"):
        read_tap_tests([Source(path), Source(path, ("X", "X"))])
    write_uff(path, [*records, tip(X, response=(2, 1), reference=(2, 1))])
    with pytest.raises(InputError, match=r"3 FRFs of axis X.*chosen by its record: 3 \(1 / 1\), 7 \(2 / 2\)"):
        read_tap_tests([Source(path)])


def test_functions_of_another_kind_are_named(tmp_path):
    path = tmp_path / "t.uff"
    write_uff(path, [UffFunction(1, FREQUENCY, X.real), UffFunction(9, FREQUENCY, X.real)])
    with pytest.raises(InputError, match=r"time response, power spectral density.*frequency response functions"):
        read_frfs(path)


def test_a_scalar_direction_is_what_it_was_called(tmp_path):
    path = tmp_path / "t.uff"
    write_uff(path, [tip(X)])
    np.testing.assert_allclose(read_tap_tests([Source(path, ("Y", "Y"))])["Y", "Y"][1], X, rtol=1e-10)
    with pytest.raises(InputError, match=r"names no axis.*axes of its response and force"):
        read_tap_tests([Source(path)])


def test_csv_with_cross_terms(tmp_path):
    path = tmp_path / "F.csv"
    write_frf_csv(path, FREQUENCY, {"X": X, "Y": Y}, {"XY_re": XY.real, "XY_im": XY.imag, "YX_re": XY.real})
    found = read_tap_tests([Source(path)])
    assert set(found) == {("X", "X"), ("Y", "Y"), ("X", "Y")}
    np.testing.assert_array_equal(found["X", "Y"][1], XY)
    with pytest.raises(InputError, match="frf_units"):
        read_tap_tests([Source(path)], "um/N")


def test_csv_with_an_axial_frf(tmp_path):
    path = tmp_path / "F.csv"
    cross = {"XZ_re": XY.real, "XZ_im": XY.imag}
    write_frf_csv(path, FREQUENCY, {"X": X, "Z": Y}, cross)
    assert path.read_text().splitlines()[0] == "frequency_hz,X_re,X_im,Z_re,Z_im,XZ_re,XZ_im"
    found = read_tap_tests([Source(path)])
    assert set(found) == {("X", "X"), ("Z", "Z"), ("X", "Z")}
    np.testing.assert_array_equal(found["Z", "Z"][1], Y)
    # what moved in X under a force in Z is of no use without the motion in Z itself
    write_frf_csv(path, FREQUENCY, {"X": X}, cross)
    assert set(read_tap_tests([Source(path)])) == {("X", "X")}


def columns(separator, decimal=".", scale=1.0):
    rows = [f"{f:.6e}{separator}{v.real * scale:.12e}{separator}{v.imag * scale:.12e}" for f, v in zip(FREQUENCY, X, strict=True)]
    return [row.replace(".", decimal) for row in rows]


@pytest.mark.parametrize(
    ("head", "separator", "decimal", "scale", "tail"),
    [
        ([], "\t", ".", 1.0, "\tFreq\tHz\tReal\tm/N\tImag\tReal\t"),
        ([], "  ", ".", 1e6, " Freq Hz Real um/N"),
        (["Tap test of 2026-11-21", "Freq (Hz), Real (mm/N), Imag"], ", ", ".", 1e3, ""),
        (["Frequenz;Real;Imag"], ";", ",", 1.0, ""),
        (["f\tRe\tIm"], "\t", ",", 1.0, ""),
    ],
)
def test_text_columns(tmp_path, head, separator, decimal, scale, tail):
    path = tmp_path / "x.frf"
    rows = columns(separator, decimal, scale)
    path.write_text("\n".join([*head, "", rows[0] + tail, *rows[1:]]) + "\n", encoding="utf-8")
    frequency, values = read_tap_tests([Source(path, ("X", "X"))])["X", "X"]
    np.testing.assert_allclose(frequency, FREQUENCY)
    np.testing.assert_allclose(values, X, rtol=1e-11, atol=1e-20)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("1 2 3\n4 5\n6 7 8\n", "x.frf line 2: FRF: found 4 5, allowed is three numbers"),
        ("a\nb\n1 2 3\n4 5 x\n", "x.frf line 4: FRF: found 4 5 x"),
        ("hello\n", "0 lines of numbers"),
        ("1 2 3\n", "1 lines of numbers"),
        ("1 2 3\n2 nan 3\n", "not finite"),
        ("1 2 3\n1 2 3\n", "do not increase"),
        ("1 2 3\n1_000 2 3\n", "line 2"),
        ("1 2 3\0\n2 3 4\n", "binary data"),
    ],
)
def test_text_that_is_not_read(tmp_path, text, words):
    path = tmp_path / "x.frf"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_tap_tests([Source(path, ("X", "X"))])
    assert words in str(caught.value)


def test_lines_below_a_frequency_are_left_out(tmp_path):
    path = tmp_path / "tip.frf"
    path.write_text("".join(f"{f} {f * 1e-9} 0\n" for f in (10, 20, 30, 40)))
    frequency, values = read_tap_tests([Source(path, ("X", "X"))], from_hz=20.0)["X", "X"]
    np.testing.assert_array_equal(frequency, [20.0, 30.0, 40.0])
    np.testing.assert_allclose(values, [20e-9, 30e-9, 40e-9], rtol=1e-15)
    with pytest.raises(InputError, match="frf_from_hz: found 35, allowed is a frequency below the last, 40 Hz"):
        read_tap_tests([Source(path, ("X", "X"))], from_hz=35.0)


def test_the_face_mill(tmp_path):
    paths = {axis: SHARED / f"facemill_{axis}.frf" for axis in "xy"}
    if not all(path.exists() for path in paths.values()):
        pytest.skip("the face mill's FRFs are not beside the project")
    found = read_tap_tests([Source(path, (axis.upper(),) * 2) for axis, path in paths.items()])
    for pair, peak, at in ((("X", "X"), 2.065e-6, 1448.0), (("Y", "Y"), 2.187e-6, 515.0)):
        frequency, values = found[pair]
        assert np.max(np.abs(values)) == pytest.approx(peak, rel=3e-4)
        assert frequency[np.argmax(np.abs(values))] == at
