"""The rotor in few coordinates, and as a causal system that a time march can follow exactly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.optimize
import scipy.sparse

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import Coordinate
from rcsa_ident.virtual.rotor import Rotor, frequency_motion

#: Frequencies [Hz] at which the reduced rotor is exact.
EXACT_AT = (300.0, 1000.0, 2000.0, 3000.0, 4200.0, 6000.0)
#: A pole whose imaginary part is a smaller share of it belongs to an overdamped mode: the loss factors leave no more.
_OVERDAMPED = 0.03


@dataclass(frozen=True, slots=True, eq=False)
class ReducedRotor:
    """The rotor in fewer coordinates, orthonormal with its mass.

    `damping`, `stiffness`, `loss`, `gyroscopic`, `softening`, shape (m, m): the mass is the identity
    `ports`, shape (p, m)
    `coordinates`: tuple of Coordinate, length p
    """

    damping: FloatArray
    stiffness: FloatArray
    loss: FloatArray
    gyroscopic: FloatArray
    softening: FloatArray
    ports: FloatArray
    coordinates: tuple[Coordinate, ...]


def reduced(
    model: Rotor,
    max_frequency: float = 16e3,
    inputs: tuple[str, ...] = ("tip.x", "tip.y"),
    exact_at: tuple[float, ...] = EXACT_AT,
    planes: int = 2,
) -> ReducedRotor:
    """Return the rotor on its undamped modes up to `max_frequency` [Hz] and its damped motion under forces at `inputs`.

    `max_frequency` [Hz]
    `inputs`: coordinates such as ``tip.x`` at which forces act
    `exact_at`: tuple of float [Hz], frequencies at which the full solutions, real and imaginary parts apart, join the basis: dampers that
        act in one place, as in the tool's clamping, excite shapes that no low undamped mode has
    `planes`: equal parts of the freedoms between which there is no mass: X and Y; 1 of a rotor on a robot
    """
    d = model.mass.shape[0]
    size = d // planes
    solutions = frequency_motion(model, 2.0 * np.pi * np.asarray(exact_at), inputs)
    motion = np.concatenate([solutions.real, solutions.imag]).transpose(1, 0, 2).reshape(d, -1)
    bases = []
    for plane in (slice(k * size, (k + 1) * size) for k in range(planes)):
        mass, stiffness = model.mass[plane, plane].toarray(), model.stiffness[plane, plane].toarray()
        limit = (2.0 * np.pi * max_frequency) ** 2
        _, shapes = scipy.linalg.eigh(stiffness, mass, subset_by_value=(-np.inf, limit))
        extra = motion[plane]
        for _ in range(2):
            extra = extra - shapes @ (shapes.T @ (mass @ extra))
            length = np.sqrt(np.maximum(np.einsum("ij,ij->j", extra, mass @ extra), 0.0))
            extra = extra[:, length > 1e-9 * length.max()] / length[length > 1e-9 * length.max()]
        gram, turn = scipy.linalg.eigh(extra.T @ mass @ extra)
        kept = gram > 1e-7 * gram[-1]
        extra = extra @ (turn[:, kept] / np.sqrt(gram[kept]))
        full = np.zeros((d, shapes.shape[1] + extra.shape[1]))
        full[plane] = np.hstack([shapes, extra])
        bases.append(full)
    basis = np.hstack(bases)

    def project(matrix: scipy.sparse.csc_array) -> FloatArray:
        return basis.T @ (matrix @ basis)

    return ReducedRotor(
        damping=project(model.damping),
        stiffness=project(model.stiffness),
        loss=project(model.loss),
        gyroscopic=project(model.gyroscopic),
        softening=project(model.softening),
        ports=model.ports @ basis,
        coordinates=model.coordinates,
    )


@dataclass(frozen=True, slots=True, eq=False)
class Poles:
    """A real linear system: q' = pole q + inputs F, w = 2 Re(outputs q).

    `pole` [rad/s], shape (m,): those with positive imaginary part; real ones of overdamped modes, with half their residue
    `inputs`, shape (m, i); `outputs`, shape (p, m)
    `coordinates`: tuple of Coordinate, length p
    """

    pole: ComplexArray
    inputs: ComplexArray
    outputs: ComplexArray
    coordinates: tuple[Coordinate, ...]

    def response(self, omega: FloatArray) -> ComplexArray:
        """Return the receptances, shape (n, p, i)."""
        iw = 1j * np.asarray(omega, dtype=float)
        one = np.einsum("pk,nk,ki->npi", self.outputs, 1.0 / (iw[:, None] - self.pole), self.inputs, optimize=True)
        two = np.einsum("pk,nk,ki->npi", self.outputs.conj(), 1.0 / (iw[:, None] - self.pole.conj()), self.inputs.conj(), optimize=True)
        return one + two


def poles(model: ReducedRotor, speed: float = 0.0, inputs: tuple[str, ...] = ("tip.x", "tip.y")) -> Poles:
    """Return the causal system whose response is that of the rotor.

    Hysteretic damping exists only for steady vibration: its equations hold for positive frequencies, and their poles
    with negative imaginary part are unstable. The poles of positive frequency together with their conjugates make a
    real, causal system; it differs from the hysteretic one by a share of the loss factor far from resonance
    (`tests/virtual/test_reduction.py` holds it below 0.2 %).

    `speed` [rad/s]: spindle speed
    `inputs`: coordinates at which forces act
    """
    m = model.stiffness.shape[0]
    state = np.zeros((2 * m, 2 * m), dtype=complex)
    state[:m, m:] = np.eye(m)
    state[m:, :m] = -(model.stiffness - speed * model.softening + 1j * model.loss)
    state[m:, m:] = -(model.damping + speed * model.gyroscopic)
    value, right = np.linalg.eig(state)
    force = np.zeros((2 * m, len(inputs)), dtype=complex)
    force[m:] = model.ports[_rows(model.coordinates, inputs)].T
    left = np.linalg.solve(right, force)
    shape = model.ports @ right[:m]
    # an overdamped mode has two poles that decay without oscillating; each stands for itself, its conjugate included
    decaying = np.abs(value.imag) < _OVERDAMPED * np.abs(value)
    value = np.where(decaying, value.real, value)
    shape = np.where(decaying, 0.5 * shape, shape)
    keep = (value.imag > 0.0) | decaying
    if np.any(value[keep].real >= 0.0):
        raise InputError("spindle", "a mode that grows by itself", "bearings and dampers that leave every mode stable")
    return Poles(value[keep], left[keep], shape[:, keep], model.coordinates)


def alike(first: Poles, other: Poles) -> Poles:
    """Return poles of nearly the same machine in the order and scale of the first ones.

    The state of a march may then go on from one to the other: what the slow change of the shapes themselves would add to it is of the
    order of that change within one period of a mode.

    Raises `InputError` if the machine does not have as many poles of its own.
    """
    if other.pole.size != first.pole.size:
        raise InputError("dynamics", f"{other.pole.size} poles", f"{first.pole.size}, as many as before")
    order = scipy.optimize.linear_sum_assignment(np.abs(first.pole[:, None] - other.pole[None, :]))[1]
    outputs = other.outputs[:, order]
    scale = np.sum(outputs.conj() * first.outputs, axis=0) / np.sum(np.abs(outputs) ** 2, axis=0)
    return Poles(other.pole[order], other.inputs[order] / scale[:, None], outputs * scale, other.coordinates)


def _rows(coordinates: tuple[Coordinate, ...], names: tuple[str, ...]) -> np.ndarray:
    known = [str(c) for c in coordinates]
    return np.array([known.index(name) for name in names])
