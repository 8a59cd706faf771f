"""The tip's motion as modes; of a fit, what is inside the band is found, and what is outside does not chatter."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.modal import ModalModel, normal_modes
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.stability.tip_modes import DAMPED_OUTSIDE, TIP, TipModes, fitted_modes, receptance_of, require_modes
from tests.stability.mills import SKEWED, tip


def response(w):
    """Closed form of the skewed mill's modes."""
    h = np.zeros((w.size, 2, 2), dtype=complex)
    for axis, frequency, zeta, mass in SKEWED:
        wn = 2.0 * np.pi * frequency
        h[:, axis, axis] += 1.0 / (mass * (wn**2 - w**2 + 2j * zeta * wn * w))
    return h


def test_receptance():
    w = np.linspace(1.0, 20_000.0, 500)
    np.testing.assert_allclose(tip(SKEWED).response(w), response(w), rtol=1e-10, atol=1e-20)
    constant = np.array([[3e-8, 0.0], [0.0, 1e-8]])
    np.testing.assert_allclose(tip(SKEWED, (3e-8, 1e-8)).response(w), response(w) + constant, rtol=1e-10, atol=1e-20)
    c, s = np.cos(0.4), np.sin(0.4)
    turn = np.array([[c, -s], [s, c]])
    np.testing.assert_allclose(tip(SKEWED, turn=0.4).response(w), turn @ response(w) @ turn.T, rtol=1e-9, atol=1e-20)


@pytest.mark.parametrize("wide", [False, True])
def test_frequencies_resolve_every_mode(wide):
    found = tip(SKEWED).receptance(wide)
    w = found.omega
    assert np.all(np.diff(w) > 0.0)
    np.testing.assert_allclose(found.values, response(w), rtol=1e-9, atol=1e-20)
    for _, frequency, zeta, _ in SKEWED:
        k = np.searchsorted(w, 2.0 * np.pi * frequency)
        assert w[k] - w[k - 1] < 2.0 * zeta * 2.0 * np.pi * frequency / 9.0
    top = w[-1] / (2.0 * np.pi * 1350.0)
    assert (top > 9.0) == wide
    assert top > 1.99
    assert receptance_of(found) is found
    assert require_modes(tip(SKEWED), "any").pole.size == 3


def test_a_real_pole():
    """With half its residue it stands for one exponential."""
    modes = TipModes(np.array([-500.0]), np.array([[1.0], [0.0]]), np.array([[1e-4, 0.0]]), np.zeros((2, 2)))
    w = np.array([0.0, 300.0, 5000.0])
    np.testing.assert_allclose(modes.response(w)[:, 0, 0], 2e-4 / (1j * w + 500.0), rtol=1e-12)
    assert modes.largest == pytest.approx(2e-4 / 500.0)
    assert np.all(np.isfinite(modes.receptance().values))


def test_largest_and_strength():
    modes = tip(SKEWED)
    w = np.linspace(100.0, 12_000.0, 40_001)
    exact = np.max(np.linalg.norm(response(w), 2, axis=(1, 2)))
    assert modes.largest == pytest.approx(exact, rel=2e-2)
    assert modes.largest <= exact * (1.0 + 1e-9)
    peaks = [1.0 / (mass * (2.0 * np.pi * f) ** 2 * 2.0 * zeta) for _, f, zeta, mass in SKEWED]
    np.testing.assert_allclose(modes.strength, peaks, rtol=2e-3)


def test_a_missing_direction_is_rigid():
    y = normal_modes(np.array([5000.0]), np.array([0.02]), np.ones((1, 1)), (Coordinate("tip", Dof.Y),), np.array([[1e-8]]))
    modes = TipModes.of({Dof.Y: y})
    assert np.all(modes.outputs[0] == 0.0)
    np.testing.assert_array_equal(modes.constant, [[0.0, 0.0], [0.0, 1e-8]])


def test_further_coordinates_are_left_aside():
    where = (Coordinate("flange", Dof.X), Coordinate("tip", Dof.X))
    model = normal_modes(np.array([5000.0]), np.array([0.02]), np.array([[0.3, 2.0]]), where)
    alone = ModalModel(model.omega_n, model.zeta, model.phi[:, 1:], np.zeros((1, 1)), where[1:])
    np.testing.assert_array_equal(TipModes.of({Dof.X: model}).outputs, TipModes.of({Dof.X: alone}).outputs)


def _changed(**change):
    fine = tip(SKEWED)
    known = {"pole": fine.pole, "outputs": fine.outputs, "inputs": fine.inputs, "constant": fine.constant}
    return TipModes(**{**known, **change})


@pytest.mark.parametrize(
    ("make", "field", "words"),
    [
        (lambda: TipModes.of({}), "tip modes", "at least one"),
        (lambda: _changed(outputs=np.zeros((2, 3))), "tip modes", "at least one"),
        (lambda: _changed(pole=np.array([1j, -1.0, -2.0])), "pole", "negative real parts"),
        (lambda: _changed(pole=np.array([np.nan, -1.0, -2.0])), "pole", "finite"),
        (lambda: _changed(inputs=np.zeros((2, 3))), "inputs", r"shape \(3, 2\)"),
        (lambda: _changed(constant=np.zeros(2)), "constant", r"shape \(2, 2\)"),
        (lambda: _changed(heights=np.array([0.0])), "heights and shape", "both, or neither"),
        (lambda: _changed(heights=np.array([1.0, 0.5]), shape=np.ones((2, 3))), "heights", "ascending"),
        (lambda: _changed(heights=np.array([0.0, 0.5]), shape=np.ones((2, 2))), "shape", "heights, modes"),
        (lambda: _changed(heights=np.array([0.0]), shape=np.ones((1, 3)), constant=1e-8 * np.eye(2)), "constant", "zero beside"),
        (lambda: _changed(pole=np.array([-1e-4 + 5000.0j, -1.0 + 1.0j, -1.0 + 1.0j])).receptance(), "damping_ratio", "resolve"),
    ],
)
def test_bad_input(make, field, words):
    with pytest.raises(InputError, match=words) as error:
        make()
    assert error.value.field == field
    assert error.value.found is not None


def test_modal_tip_resolves_the_sharpest_mode():
    model = normal_modes(np.array([5000.0]), np.array([0.01]), np.ones((1, 1)), (Coordinate("tip", Dof.Y),))
    found = TipModes.of({Dof.Y: model}).receptance()
    np.testing.assert_array_equal(found.between("tip.x", "tip.x"), 0.0)
    step = np.diff(found.omega).max()
    assert step <= 2.0 * 0.01 * 5000.0 / 10.0
    peak = found.omega[np.argmax(np.abs(found.between("tip.y", "tip.y")))]
    assert peak == pytest.approx(5000.0, rel=2e-3)


def test_a_mode_too_sharp_to_resolve_is_refused():
    model = normal_modes(np.array([5000.0]), np.array([1e-6]), np.ones((1, 1)), (Coordinate("tip", Dof.X),))
    with pytest.raises(InputError, match="damping_ratio"):
        TipModes.of({Dof.X: model}).receptance()


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


def test_a_rigid_direction_stays_rigid_in_a_fit():
    modes, _ = fitted_modes(TipModes.of({Dof.X: models()[Dof.X]}).receptance())
    assert not np.any(modes.outputs[1])
    assert not np.any(modes.inputs[:, 1])
    with pytest.raises(InputError, match="zero at every frequency"):
        fitted_modes(Receptance(OMEGA, np.zeros((OMEGA.size, 2, 2)), TIP, TIP))


def test_modes_give_the_static_compliance():
    values = TipModes.of(models()).response(np.zeros(1))[0]
    np.testing.assert_allclose(values, np.diag([sum(1.0 / k for *_, k in PLANES[a]) for a in (Dof.X, Dof.Y)]), rtol=1e-9)
