"""CutPro's modal files: what is read is what MODES.toml says of the same modes, and contradictions are refused."""

from __future__ import annotations

import numpy as np
import pytest

import rcsa_ident as ri
from rcsa_ident.base.errors import InputError
from rcsa_ident.io.settings.modal_files import read_modes_files

MODES = {"x": ((480.0, 0.02, 13.4), (1270.0, 0.018, 0.66)), "y": ((585.0, 0.03, 15.4),), "z": ((560.0, 0.019, 1.4),)}


def text(modes, **changed):
    """A file as CutPro writes it."""
    rows = [("MODES", len(modes)), ("PNTS", 1), ("REALM", 1)]
    for hertz, zeta, mass in modes:
        rows += [("WN", hertz), ("ZETA", zeta), ("MASS", mass), ("STIFK", mass * (2.0 * np.pi * hertz) ** 2)]
    rows += [("LOCNS", 0), *(("MODSH", mass**-0.5) for _, _, mass in modes)]
    return "".join(f"{key}\t{changed.get(key, value):.15G}\n" for key, value in rows)


def test_modes_of_three_directions(tmp_path):
    names, toml = [], []
    for axis, modes in MODES.items():
        (tmp_path / f"{axis}.cmp").write_text(text(modes))
        names.append(f"{axis.upper()}={tmp_path / axis}.cmp")
        for hertz, zeta, mass in modes:
            toml.append(f"[[{axis}]]\nnatural_frequency_hz = {hertz}\ndamping_ratio = {zeta}\nmodal_mass_kg = {mass}\n")
    (tmp_path / "MODES.toml").write_text("".join(toml))
    expected, found = ri.read_modes(tmp_path / "MODES.toml"), ri.read_modes(*names[::-1])
    np.testing.assert_allclose(found.pole, expected.pole, rtol=1e-12)
    np.testing.assert_allclose(found.outputs * found.inputs.T, expected.outputs * expected.inputs.T, rtol=1e-12)
    assert expected.directions == 3


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"STIFK": 122.8}, "line 7: STIFK: found 122.8, allowed is 1.21884e+08 N/m, as MASS 13.4 kg and WN 480 Hz have it"),
        ({"WN": 480.0 * 2.0 * np.pi}, "in which units are they?"),
        ({"MASS": 13400.0}, "in which units are they?"),
        ({"MODSH": 0.5}, "line 9: MODSH: found 0.5, allowed is 0.273179"),
        ({"ZETA": 0.0}, "ZETA: found 0, allowed is a number above 0"),
        ({"PNTS": 2}, "PNTS: found 2, allowed is 1: one point with real modes"),
        ({"REALM": 2}, "REALM: found 2"),
        ({"MODES": 2}, "WN: found 1 lines, allowed is 2, as MODES says"),
        ({"MODES": 0}, "MODES: found 0, allowed is a whole number from 1 to 200"),
        ({"WN": np.nan}, "line 4: modal file: found"),
    ],
)
def test_what_contradicts_itself_is_refused(tmp_path, changed, words):
    (tmp_path / "x.cmp").write_text(text(MODES["x"][:1], **changed))
    with pytest.raises(InputError) as caught:
        read_modes_files([f"X={tmp_path}/x.cmp"])
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("LOCNS", "COLOUR", "line 8: modal file: found 'COLOUR"),
        ("ZETA", "ZETA x", "line 5: modal file"),
        ("PNTS\t1\n", "", "PNTS: found 0 lines"),
    ],
)
def test_lines_that_are_none_are_refused(tmp_path, old, new, words):
    (tmp_path / "x.cmp").write_text(text(MODES["x"][:1]).replace(old, new))
    with pytest.raises(InputError) as caught:
        read_modes_files([f"X={tmp_path}/x.cmp"])
    assert words in " ".join(str(caught.value).split())


def test_each_direction_once_and_named(tmp_path):
    (tmp_path / "x.cmp").write_text(text(MODES["x"]))
    one = f"{tmp_path}/x.cmp"
    for given, words in (
        ([one], "with their directions"),
        ([f"X={one}", f"x={one}"], "X twice"),
        ([f"X={one}", "M.toml"], "MODES.toml alone"),
    ):
        with pytest.raises(InputError, match=words):
            read_modes_files(given)
