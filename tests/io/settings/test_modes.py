"""MODES.toml."""

from __future__ import annotations

import numpy as np
import pytest

import rcsa_ident as ri
from rcsa_ident.base.errors import InputError
from rcsa_ident.io.settings.modes import read_modes_file
from rcsa_ident.stability.tip_modes import TipModes

TEXT = """\
[[x]]
natural_frequency_hz = 900.0
damping_ratio = 0.02
modal_mass_kg = 0.04
[[x]]
natural_frequency_hz = 1500.0
damping_ratio = 0.01
stiffness_n_per_m = 5.0e7
"""


def test_receptance_of_the_modes(tmp_path):
    path = tmp_path / "MODES.toml"
    path.write_text(TEXT)
    omega = 2 * np.pi * np.array([10.0, 800.0, 1500.0])
    expected = np.zeros(3, complex)
    for frequency, zeta, stiffness in ((900.0, 0.02, 0.04 * (2 * np.pi * 900.0) ** 2), (1500.0, 0.01, 5e7)):
        ratio = omega / (2 * np.pi * frequency)
        expected += 1.0 / stiffness / (1.0 - ratio**2 + 2j * zeta * ratio)
    np.testing.assert_allclose(ri.read_modes(path).response(omega), expected[:, None, None] * [[1.0, 0.0], [0.0, 0.0]], rtol=1e-12)


def test_an_axial_mode_is_read_behind_the_others(tmp_path):
    axial = "[[z]]\nnatural_frequency_hz = 1450.0\ndamping_ratio = 0.04\nstiffness_n_per_m = 6.0e7\nstiffness_sd_n_per_m = 6.0e6\n"
    (tmp_path / "MODES.toml").write_text(axial + TEXT)
    found = read_modes_file(tmp_path / "MODES.toml")
    assert found.modes.response(np.array([0.0]))[0, 2, 2] == pytest.approx(1.0 / 6e7)
    assert found.spreads[2, -1] == pytest.approx(0.1)


#: Of modes in any direction: natural frequency [Hz], damping ratio, stiffness [N/m], direction cosines.
OBLIQUE = ((700.0, 0.03, 8e6, (0.6, 0.8, 0.0)), (950.0, 0.02, 2e7, (-2.0 / 3.0, 1.0 / 3.0, 2.0 / 3.0)))


def oblique(modes):
    keys = ("natural_frequency_hz", "damping_ratio", "stiffness_n_per_m", "direction_cosines")
    return "".join(
        "[[modes]]\n" + "".join(f"{k} = {list(v) if isinstance(v, tuple) else v}\n" for k, v in zip(keys, m, strict=True)) for m in modes
    )


@pytest.mark.parametrize("count", [1, 2])
def test_modes_in_any_direction_are_the_sum_of_their_motions_along_lines(tmp_path, count):
    """H = sum of d d^T / k / (1 - r^2 + 2 i zeta r), and what is saved is read again."""
    path = tmp_path / "MODES.toml"
    path.write_text(oblique(OBLIQUE[:count]))
    tip = ri.read_modes(path)
    assert tip.directions == 1 + count  # the second one moves along Z, too
    omega = 2.0 * np.pi * np.array([10.0, 690.0, 950.0, 1500.0])
    expected = np.zeros((4, 3, 3), complex)
    for hertz, zeta, stiffness, cosines in OBLIQUE[:count]:
        ratio = omega / (2.0 * np.pi * hertz)
        expected += np.outer(cosines, cosines) / (stiffness * (1.0 - ratio**2 + 2j * zeta * ratio))[:, None, None]
    np.testing.assert_allclose(tip.response(omega), expected[:, : 1 + count, : 1 + count], rtol=1e-12, atol=1e-20)
    again = ri.read_modes(tip.save(tmp_path / "AGAIN.toml"))
    np.testing.assert_allclose(again.response(omega), tip.response(omega), rtol=1e-9, atol=1e-16)


def test_rounded_cosines_are_made_a_direction(tmp_path):
    (tmp_path / "MODES.toml").write_text(oblique([(*OBLIQUE[0][:3], (0.71, 0.71, 0.0))]))
    static = ri.read_modes(tmp_path / "MODES.toml").response(np.zeros(1))[0]
    np.testing.assert_allclose(static, np.full((2, 2), 0.5 / 8e6), rtol=1e-12)


def test_a_mass_in_grams_is_asked_about_and_no_mode_vanishes_for_it(tmp_path):
    """1500 Hz with 350 g, read as 350 kg: so stiff a mode would hardly move."""
    (tmp_path / "MODES.toml").write_text(TEXT.replace("stiffness_n_per_m = 5.0e7", "modal_mass_kg = 350.0"))
    (said,) = ri.read_modes(tmp_path / "MODES.toml").remarks
    assert str(said).startswith("stiffness of the tip's stiffest mode is 3.1")
    assert "were modal masses given in g (3.1" in said


def test_what_is_no_motion_along_a_line_is_not_written(tmp_path):
    around = TipModes(np.array([-50.0 + 5000.0j]), np.array([[1.0], [1.0j]]), np.array([[1e-4, -1e-4j]]), np.zeros((2, 2)))
    residual = TipModes(around.pole, np.array([[-1e-4j], [0.0]]), np.array([[1.0, 0.0]]), 1e-9 * np.eye(2))
    overdamped = TipModes(np.array([-500.0]), np.array([[1.0], [0.0]]), np.array([[1e-4, 0.0]]), np.zeros((2, 2)))
    for tip in (around, residual, overdamped):
        with pytest.raises(InputError, match="modes that move along lines"):
            tip.save(tmp_path / "MODES.toml")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("[[x]]", "[[w]]", r"w: found an unknown key"),
        ("[[x]]", "[x]", r"line 5, column 3: modes: found a TOML error"),
        ("damping_ratio = 0.02", "damping_ratio = 2", r"x\[0\]\.damping_ratio: found 2"),
        ("modal_mass_kg = 0.04", "", r"x\[0\]\.modal_mass_kg: found nothing, allowed is one of"),
        ("modal_mass_kg = 0.04", "modal_mass_kg = 1\nstiffness_n_per_m = 1", r"x\[0\]\.modal_mass_kg: found both"),
        ("modal_mass_kg = 0.04", "modal_mass_kg = -1", r"x\[0\]\.modal_mass_kg: found -1"),
        ("natural_frequency_hz = 900.0", "frequency_hz = 900.0", r"x\[0\]\.frequency_hz: found an unknown key"),
        (TEXT, "# nothing", r"x: found nothing, allowed is tables"),
        (TEXT, "x = []", r"x: found an empty list"),
        ("[[x]]", "[[modes]]", r"modes\[0\]\.direction_cosines: found nothing"),
        (
            "[[x]]",
            "[[modes]]\ndirection_cosines = [1, 1, 0]",
            r"modes\[0\]\.direction_cosines: found a length of 1\.414, allowed is cosines",
        ),
        ("[[x]]", "[[x]]\ndirection_cosines = [1, 0, 0]", r"x\[0\]\.direction_cosines: found an unknown key"),
        ("5.0e7", "50", r"MODES\.toml: stiffness of the tip's softest mode: found 50 N/m, .*was it given in N/µm \(5e\+07 N/m\)\?"),
    ],
)
def test_bad_modes(tmp_path, old, new, words):
    path = tmp_path / "MODES.toml"
    path.write_text(TEXT.replace(old, new, 1))
    with pytest.raises(InputError, match=words):
        read_modes_file(path)
