"""Second-order structures: mass, damping and stiffness with named points."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from rcsa_ident.dynamics.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.dynamics.coordinates import Coordinate
from rcsa_ident.dynamics.modal import PoleModel
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.errors import InputError


@dataclass(frozen=True, slots=True, eq=False)
class Structure:
    """A linear structure, M q'' + C q' + (K + i S) q = f.

    Parameters
    ----------
    mass, damping, stiffness, structural_damping : arrays, shape (d, d)
        SI; `structural_damping` S is the imaginary part of the stiffness (material loss factors, hysteretic).
    coordinates : tuple of Coordinate, length p
    index : array of int, shape (p,)
        The degree of freedom that each coordinate is.
    """

    mass: FloatArray
    damping: FloatArray
    stiffness: FloatArray
    structural_damping: FloatArray
    coordinates: tuple[Coordinate, ...]
    index: np.ndarray

    def __post_init__(self) -> None:
        for name in ("mass", "damping", "stiffness", "structural_damping"):
            matrix = frozen(getattr(self, name))
            if matrix.ndim != 2 or matrix.shape != (self.mass.shape[0],) * 2:
                raise InputError(name, matrix.shape, "a square matrix of the mass matrix's shape")
            object.__setattr__(self, name, matrix)
        object.__setattr__(self, "index", frozen(self.index, np.intp))
        if len(self.coordinates) != self.index.size:
            raise InputError("coordinates", len(self.coordinates), f"{self.index.size}, one for each index")

    def receptance(self, omega: FloatArray) -> Receptance:
        """Return the receptance between all coordinates, by one solution of the full equations per frequency.

        The exact and slow way; `poles` is the fast one.
        """
        omega = frozen(omega)
        values = np.array([x[self.index] for x in unit_responses(self, omega)])
        return Receptance(omega, values.reshape(omega.size, *2 * (self.index.size,)), self.coordinates, self.coordinates)


def unit_responses(structure: Structure, omega: FloatArray) -> Iterator[ComplexArray]:
    """Yield, per frequency, the motion of every freedom under a unit force at each coordinate, shape (d, p).

    The dynamic stiffness is solved as a band: cost about 2 d b^2 complex flops with half-bandwidth b.
    """
    d, p = structure.mass.shape[0], structure.index.size
    force = np.zeros((d, p), dtype=complex)
    force[structure.index, np.arange(p)] = 1.0
    stiffness = structure.stiffness + 1j * structure.structural_damping
    rows, cols = np.nonzero((structure.mass != 0.0) | (structure.damping != 0.0) | (stiffness != 0.0))
    half = int(np.max(np.abs(rows - cols)))
    bands = []
    for matrix in (stiffness, structure.damping, structure.mass):
        band = np.zeros((2 * half + 1, d), dtype=complex)
        band[half + rows - cols, cols] = matrix[rows, cols]
        bands.append(band)
    for w in omega:
        yield scipy.linalg.solve_banded((half, half), bands[0] + 1j * w * bands[1] - w**2 * bands[2], force)


def natural_frequencies(structure: Structure) -> FloatArray:
    """Return the undamped natural frequencies, ascending, shape (d,) [rad/s]; rigid-body modes are zero."""
    squares = scipy.linalg.eigvalsh(structure.stiffness, structure.mass)
    return np.sqrt(np.maximum(squares, 0.0))


def rigid_body_modes(structure: Structure, max_omega: float) -> FloatArray:
    """Return the mass-orthonormal motions that no spring, damper or loss factor feels, shape (d, k), k = 0 if there are none.

    Parameters
    ----------
    max_omega : float [rad/s]
        A frequency of the elastic motion; a thousandth of it shifts the inverse iteration.
    """
    mass, stiffness = structure.mass, structure.stiffness
    d = mass.shape[0]
    factor = scipy.linalg.cho_factor(stiffness + (1e-3 * max_omega) ** 2 * mass)
    motions = np.random.default_rng(0).normal(size=(d, min(6, d)))
    for _ in range(4):
        motions = np.linalg.qr(scipy.linalg.cho_solve(factor, mass @ motions))[0]
    _, mix = scipy.linalg.eigh(motions.T @ stiffness @ motions, motions.T @ mass @ motions)
    motions = motions @ mix
    free = np.ones(motions.shape[1], dtype=bool)
    for matrix in (stiffness, structure.damping, structure.structural_damping):
        # a force that is nothing but the rounding of the sums that make it
        free &= np.max(np.abs(matrix @ motions), axis=0) <= 1e-13 * np.max(np.abs(matrix) @ np.abs(motions), axis=0)
    return motions[:, free]


def poles(structure: Structure, max_omega: float, snapshots: int = 6, tolerance: float = 1e-7) -> PoleModel:
    """Return the receptance as poles and residues, good up to `max_omega`.

    The equations are projected on their own exact solutions at a few frequencies of the band (a rational Krylov
    space, real and imaginary parts apart), and the small damped problem is diagonalised. Rigid-body motions are split
    off before: their double pole at zero has no diagonal form, and stands as a pair at a ten-millionth of `max_omega`.
    `tests/dynamics` holds the result against the full solution: 1e-6 of each entry at every frequency.

    Parameters
    ----------
    max_omega : float [rad/s]
    snapshots : int
        Frequencies at which the full equations are solved, Chebyshev points of the band.
    tolerance : float
        Directions whose share of the solutions' mass norm is smaller are dropped.
    """
    points = 0.5 * max_omega * (1.0 - np.cos(np.pi * (np.arange(snapshots) + 0.5) / snapshots))
    solutions = np.hstack(list(unit_responses(structure, points)))
    rigid = rigid_body_modes(structure, max_omega)
    basis = _orthonormal(np.hstack([solutions.real, solutions.imag]), structure.mass, rigid, tolerance)
    stiffness = basis.T @ (structure.stiffness + 1j * structure.structural_damping) @ basis
    damping = basis.T @ structure.damping @ basis
    elastic = _diagonalise(basis.T @ structure.mass @ basis, damping, stiffness, basis[structure.index], structure.coordinates)
    small, at_ports = 1e-7j * max_omega, rigid[structure.index]
    pair = np.concatenate([np.full(rigid.shape[1], small), np.full(rigid.shape[1], -small)])
    return PoleModel(
        np.concatenate([elastic.pole, pair]),
        np.hstack([elastic.outputs, at_ports, at_ports]),
        np.vstack([elastic.inputs, at_ports.T / (2.0 * small), -at_ports.T / (2.0 * small)]),
        structure.coordinates,
    )


def _orthonormal(columns: FloatArray, mass: FloatArray, rigid: FloatArray, tolerance: float) -> FloatArray:
    """Mass-orthonormalise the columns against `rigid` and each other; directions that add nothing are dropped."""
    momentum = mass @ rigid
    for _ in range(2):
        columns = columns - rigid @ (momentum.T @ columns)
    norms = np.sqrt(np.einsum("ij,ij->j", columns, mass @ columns))
    scaled = columns[:, norms > 0.0] / norms[norms > 0.0]
    factor = np.linalg.cholesky(mass)
    left, size, _ = np.linalg.svd(factor.T @ scaled, full_matrices=False)
    kept = left[:, size > tolerance * np.max(size, initial=0.0)]
    basis = scipy.linalg.solve_triangular(factor.T, kept, lower=False)
    return basis - rigid @ (momentum.T @ basis)


def _diagonalise(mass, damping, stiffness, ports, coordinates):  # type: ignore[no-untyped-def]
    """Poles and residues of ports (K + i w C - w^2 M)^-1 ports^T for w > 0, M the identity up to rounding."""
    m = mass.shape[0]
    inverse = np.linalg.inv(mass)
    state = np.zeros((2 * m, 2 * m), dtype=complex)
    state[:m, m:] = np.eye(m)
    state[m:, :m] = -inverse @ stiffness
    state[m:, m:] = -inverse @ damping
    values, right = np.linalg.eig(state)
    inputs = np.zeros((2 * m, ports.shape[0]), dtype=complex)
    inputs[m:] = inverse @ ports.T
    left = np.linalg.solve(right, inputs)
    return PoleModel(values, ports @ right[:m], left, coordinates)
