"""Substructures of a candidate's size, as the kernels take them."""

import numpy as np

from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.dynamics.coordinates import plane
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.identification.data import LEVER


def substructure(rng, omega):
    """A free tool-holder's receptances: random, of a real one's size; symmetric as they must be."""
    scale = np.array([1.0, 1.0 / LEVER, 1.0, 1.0 / LEVER])
    values = 1e-8 * (rng.standard_normal((omega.size, 4, 4)) + 1j * rng.standard_normal((omega.size, 4, 4)))
    values = (values + np.swapaxes(values, 1, 2)) * np.outer(scale, scale)
    points = (*plane("tip"), *plane("flange"))
    response = Receptance(omega, values, points, points)
    a22, a21 = response["flange", "flange"], response["flange", "tip"]
    flange = np.stack([a22[:, 0, 0], LEVER * a22[:, 0, 1], LEVER**2 * a22[:, 1, 1]], axis=1)
    return response, flange, np.stack([a21[:, 0, 0], LEVER * a21[:, 1, 0]], axis=1)


def candidate(rng, m, soft=False, places=1):
    """Natural frequencies, shapes, damping factor, softening, residual, joint."""
    omega_n = 2.0 * np.pi * rng.uniform(300.0, 4000.0, m)
    psi = rng.standard_normal((m, 2 + places))
    factor = np.tril(10.0 * rng.standard_normal((m, m)))
    softening = 0.1 * rng.standard_normal((m, m)) if soft else np.zeros((0, 0))
    residual = np.array([[4e-5, 0.0], [1e-5, 3e-5], *[[2e-10, -3e-10], [1e-10, 4e-10]][:places]])
    joint = np.array([2e8, 3e8, 900.0, 700.0]) * rng.uniform(0.5, 2.0, 4)  # scaled: rotational ones per lever squared
    return omega_n, psi, factor, softening + softening.T, residual, joint


def lumped(joint):
    return LumpedJoint(joint[0], joint[1] * LEVER**2, joint[2], joint[3] * LEVER**2)
