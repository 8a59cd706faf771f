import dataclasses

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.settings.machines import read_machine
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.virtual.reduction import Poles, alike, poles, reduced
from rcsa_ident.virtual.rotor import frequency_response, rotor

BAND = 2.0 * np.pi * np.arange(450.0, 4301.0, 35.0)


@pytest.mark.parametrize(("machine", "name"), [("hpm", "S1-ER32"), ("hpm", "S2-PG25"), ("stiff", "S4-shrink"), ("table2", "S1-ER32")])
def test_causal_system_is_the_rotor(machines_folder, machine, name):
    setup = read_machine(machines_folder / f"{machine}.toml")
    model = rotor(setup.spindle, read_tooling(machines_folder / "toolings" / f"{name}.toml").assembly)
    speed = setup.plan.spindle_speeds[-1]
    exact = frequency_response(model, BAND, speed)
    causal = poles(reduced(model), speed).response(BAND)
    for row, col in ((0, 0), (1, 1), (2, 0), (3, 1), (4, 0), (5, 1)):
        assert np.linalg.norm(causal[:, row, col] - exact[:, row, col]) < 2e-3 * np.linalg.norm(exact[:, row, col])


def test_reduction_alone_is_exact_in_the_band(model):
    # the same hysteretic equations on both sides: what is left is the basis
    small = reduced(model)
    eye = np.eye(small.stiffness.shape[0])
    tip = small.ports[:2].T
    exact = frequency_response(model, BAND)
    for w, values in zip(BAND, exact, strict=True):
        found = small.ports @ np.linalg.solve(small.stiffness + 1j * small.loss + 1j * w * small.damping - w**2 * eye, tip)
        assert np.abs(found - values).max() < 1e-4 * np.abs(values).max()


def test_all_poles_decay(dynamics):
    assert np.all(dynamics.pole.real < 0.0)
    assert np.all(dynamics.pole.imag >= 0.0)


def test_overdamped_modes_are_followed_too(hpm, tooling):
    # a housing that creeps: its poles are real
    heavy = dataclasses.replace(hpm.spindle.housing, damping=(1e6, 2e6), tilting_damping=(1e5, 1e5))
    model = rotor(dataclasses.replace(hpm.spindle, housing=heavy), tooling.assembly)
    causal = poles(reduced(model))
    assert np.sum(causal.pole.imag == 0.0) >= 8
    omega = 2.0 * np.pi * np.geomspace(2.0, 4000.0, 60)
    exact, found = frequency_response(model, omega), causal.response(omega)
    assert np.linalg.norm(found[:, 0, 0] - exact[:, 0, 0]) < 2e-3 * np.linalg.norm(exact[:, 0, 0])


def test_spindle_that_shakes_itself_is_refused(hpm, tooling):
    loose = [dataclasses.replace(b, softening=2e-3) for b in hpm.spindle.bearings]
    model = rotor(dataclasses.replace(hpm.spindle, bearings=tuple(loose)), tooling.assembly)
    with pytest.raises(InputError, match="grows"):
        poles(reduced(model), speed=1000.0)


def test_poles_of_a_machine_that_changed_a_little_come_in_the_same_order_and_scale():
    rng = np.random.default_rng(4)
    pole = 2.0 * np.pi * np.array([700.0, 1500.0, 900.0]) * (-0.03 + 1j)
    inputs, outputs = (rng.standard_normal(shape) + 1j * rng.standard_normal(shape) for shape in ((3, 2), (6, 3)))
    first = Poles(pole, inputs, outputs, ())
    order, scale = np.array([2, 0, 1]), np.array([0.3j, -2.0, 1.0 + 1j])
    moved = Poles(1.002 * pole[order], inputs[order] / scale[:, None], outputs[:, order] * scale, ())
    found = alike(first, moved)
    np.testing.assert_allclose(found.pole, 1.002 * pole, rtol=1e-14)
    np.testing.assert_allclose(found.outputs, outputs, rtol=1e-12)
    np.testing.assert_allclose(found.inputs, inputs, rtol=1e-12)
    # its response is what it was
    omega = np.array([3000.0, 6000.0])
    np.testing.assert_allclose(found.response(omega), moved.response(omega), rtol=1e-12)
    with pytest.raises(InputError, match="2 poles"):
        alike(first, Poles(pole[:2], inputs[:2], outputs[:, :2], ()))
