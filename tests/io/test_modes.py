"""MODES.toml."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.errors import InputError
from rcsa_ident.io.modes import read_modes, read_modes_file

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
    models = read_modes(path)
    assert list(models) == [Dof.X]
    omega = 2 * np.pi * np.array([10.0, 800.0, 1500.0])
    expected = np.zeros(3, complex)
    for frequency, zeta, stiffness in ((900.0, 0.02, 0.04 * (2 * np.pi * 900.0) ** 2), (1500.0, 0.01, 5e7)):
        ratio = omega / (2 * np.pi * frequency)
        expected += 1.0 / stiffness / (1.0 - ratio**2 + 2j * zeta * ratio)
    np.testing.assert_allclose(models[Dof.X].receptance(omega).between("tip.x", "tip.x"), expected, rtol=1e-12)


def test_an_axial_mode_is_read_behind_the_others(tmp_path):
    axial = "[[z]]\nnatural_frequency_hz = 1450.0\ndamping_ratio = 0.04\nstiffness_n_per_m = 6.0e7\nstiffness_sd_n_per_m = 6.0e6\n"
    (tmp_path / "MODES.toml").write_text(axial + TEXT)
    found = read_modes_file(tmp_path / "MODES.toml")
    assert list(found.models) == [Dof.X, Dof.Z]
    assert found.models[Dof.Z].receptance(np.array([0.0])).between("tip.z", "tip.z")[0] == pytest.approx(1.0 / 6e7)
    assert found.spreads[2, -1] == pytest.approx(0.1)


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
    ],
)
def test_bad_modes(tmp_path, old, new, words):
    path = tmp_path / "MODES.toml"
    path.write_text(TEXT.replace(old, new, 1))
    with pytest.raises(InputError, match=words):
        read_modes(path)
