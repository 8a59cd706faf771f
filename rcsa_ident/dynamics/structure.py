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


def poles(structure: Structure, max_omega: float, snapshots: int = 8, tolerance: float = 1e-9) -> PoleModel:
    """Return the receptance as poles and residues, good up to `max_omega`.

    The equations are projected on their own exact solutions at a few frequencies of the band (a rational Krylov
    space, real and imaginary parts apart), and the small damped problem is diagonalised. `tests/dynamics` holds the
    result against the full solution: 1e-6 of each entry's largest value.

    Parameters
    ----------
    max_omega : float [rad/s]
    snapshots : int
        Frequencies at which the full equations are solved, Chebyshev points of the band.
    tolerance : float
        Directions whose share of the solutions' mass norm, squared, is smaller are dropped.
    """
    points = 0.5 * max_omega * (1.0 - np.cos(np.pi * (np.arange(snapshots) + 0.5) / snapshots))
    solutions = np.hstack(list(unit_responses(structure, points)))
    basis = _orthonormal(np.hstack([solutions.real, solutions.imag]), structure.mass, tolerance)
    stiffness = basis.T @ (structure.stiffness + 1j * structure.structural_damping) @ basis
    damping = basis.T @ structure.damping @ basis
    return _diagonalise(basis.T @ structure.mass @ basis, damping, stiffness, basis[structure.index], structure.coordinates)


def _orthonormal(columns: FloatArray, mass: FloatArray, tolerance: float) -> FloatArray:
    """Mass-orthonormalise the columns; directions that add nothing are dropped."""
    norms = np.sqrt(np.einsum("ij,ij->j", columns, mass @ columns))
    scaled = columns[:, norms > 0.0] / norms[norms > 0.0]
    factor = np.linalg.cholesky(mass)
    left, size, _ = np.linalg.svd(factor.T @ scaled, full_matrices=False)
    kept = left[:, size > np.sqrt(tolerance) * size[0]]
    return scipy.linalg.solve_triangular(factor.T, kept, lower=False)


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
