"""Modes of a receptance: what is inside the band is found, what is outside does not chatter."""

from __future__ import annotations

import numpy as np
import pytest
from rcsa_ident.workflows.lobes import LobeConditions, modal_tip, receptance_from_dc

from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.modal import normal_modes
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.errors import InputError
from rcsa_ident.stability.full_discretisation import FullDiscretisation
from rcsa_ident.stability.multi_frequency import MultiFrequency
from rcsa_ident.stability.tip_modes import DAMPED_OUTSIDE, TIP, TipModes, fitted_modes

#: Natural frequencies [Hz], damping ratios, stiffnesses [N/m] of a plane; the last mode lies above the band.
PLANES = {
    Dof.X: ((700.0, 0.03, 8e6), (1500.0, 0.04, 2e7), (4700.0, 0.004, 1e8)),
    Dof.Y: ((760.0, 0.035, 7e6), (1700.0, 0.03, 3e7), (4900.0, 0.004, 1e8)),
}
OMEGA = 2.0 * np.pi * np.arange(100.0, 4300.0)


def models():
    found = {}
    for axis, modes in PLANES.items():
        f, z, k = np.array(modes).T
        w = 2.0 * np.pi * f
        found[axis] = normal_modes(w, z, (w / np.sqrt(k))[:, None], (Coordinate("tip", axis),))
    return found


def receptance(angle=0.0, omega=OMEGA):
    values = TipModes.of(models()).response(omega)
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s], [s, c]])
    return Receptance(omega, turn @ values @ turn.T, TIP, TIP)


@pytest.mark.parametrize("angle", [0.0, 0.5])
def test_modes_of_the_band_are_found_and_others_are_calm(angle):
    modes, error = fitted_modes(receptance(angle))
    assert error < 0.03
    frequency, zeta = np.abs(modes.pole), -modes.pole.real / np.abs(modes.pole)
    for f, z, _ in (mode for plane in PLANES.values() for mode in plane[:2]):
        k = int(np.argmin(np.abs(frequency - 2.0 * np.pi * f)))
        assert frequency[k] / (2.0 * np.pi) == pytest.approx(f, rel=2e-3)
        assert zeta[k] == pytest.approx(z, rel=0.05)
    assert np.all(zeta[frequency > OMEGA[-1]] > 0.99 * DAMPED_OUTSIDE)
    # a mode that was seen from afar is lightly damped in the truth, and has the largest peak of all
    assert modes.strength[frequency > OMEGA[-1]].max(initial=0.0) < 0.2 * modes.strength.max()


def test_a_rigid_direction_stays_rigid():
    x = modal_tip({Dof.X: models()[Dof.X]})
    modes, _ = fitted_modes(x)
    assert not np.any(modes.outputs[1])
    assert not np.any(modes.inputs[:, 1])
    with pytest.raises(InputError, match="zero at every frequency"):
        fitted_modes(Receptance(OMEGA, np.zeros((OMEGA.size, 2, 2)), TIP, TIP))


def test_lobes_of_the_fit_are_those_of_the_receptance():
    """The march on fitted modes against the frequency domain on the receptance itself."""
    process = MillingProcess(Cutter(2, 12e-3), CuttingCoefficients(700e6, 0.3), Engagement.from_immersion(0.5, "down"))
    speeds = np.linspace(500.0, 1600.0, 12)
    marched = LobeConditions(process, speeds, 0.02, FullDiscretisation()).lobes(receptance())
    exact = LobeConditions(process, speeds, 0.02, MultiFrequency()).lobes(receptance())
    np.testing.assert_allclose(marched.limit_depth, exact.limit_depth, rtol=0.02)
    assert any("fitted with" in warning and "% beside it" in warning for warning in marched.warnings)
    # modes that were given are taken as they are
    given = LobeConditions(process, speeds[:2], 0.02, FullDiscretisation()).lobes(TipModes.of(models()))
    assert not any("fitted" in warning for warning in given.warnings)


def test_from_rest_begins_at_0_hz():
    modes = TipModes.of(models())
    tip = receptance_from_dc(modes)
    assert tip.omega[0] == 0.0
    assert tip.omega[-1] > 2.0 * np.pi * 4900.0 * 3.9
    np.testing.assert_allclose(tip.values[0], np.diag([sum(1.0 / k for *_, k in PLANES[a]) for a in (Dof.X, Dof.Y)]), rtol=1e-9)
