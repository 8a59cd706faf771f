"""Second-order structures: mass, damping and stiffness with named points."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.linalg

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics._kernels import add_banded, independent_columns
from rcsa_ident.dynamics.coordinates import Coordinate
from rcsa_ident.dynamics.modal import PoleModel
from rcsa_ident.dynamics.receptance import Receptance


@dataclass(frozen=True, slots=True, eq=False)
class Structure:
    """A linear structure, M q'' + C q' + (K + i S) q = f.

    `mass`, `damping`, `stiffness`, `structural_damping`, shape (d, d): SI; `structural_damping` S is the imaginary part of the stiffness
        (material loss factors, hysteretic)
    `coordinates`: tuple of Coordinate, length p
    `index`: array of int, shape (p,); the degree of freedom that each coordinate is; empty where `shapes` are given
    `shapes`, shape (d, p): how each coordinate moves with every degree of freedom, where coordinates are none of these themselves
    """

    mass: FloatArray
    damping: FloatArray
    stiffness: FloatArray
    structural_damping: FloatArray
    coordinates: tuple[Coordinate, ...]
    index: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.intp))
    shapes: FloatArray | None = None

    def __post_init__(self) -> None:
        for name in ("mass", "damping", "stiffness", "structural_damping"):
            matrix = frozen(getattr(self, name))
            if matrix.ndim != 2 or matrix.shape != (self.mass.shape[0],) * 2:
                raise InputError(name, matrix.shape, "a square matrix of the mass matrix's shape")
            object.__setattr__(self, name, matrix)
        object.__setattr__(self, "index", frozen(self.index, np.intp))
        if self.shapes is not None:
            shape = (self.mass.shape[0], len(self.coordinates))
            object.__setattr__(self, "shapes", frozen(self.shapes))
            if self.shapes.shape != shape or self.index.size:
                raise InputError("shapes", self.shapes.shape, f"shape {shape}: degrees of freedom, coordinates; and no index beside them")
        elif len(self.coordinates) != self.index.size:
            raise InputError("coordinates", len(self.coordinates), f"{self.index.size}, one for each index")

    @property
    def ports(self) -> FloatArray:
        """How each coordinate moves with every degree of freedom, shape (d, p)."""
        if self.shapes is not None:
            return self.shapes
        ports = np.zeros((self.mass.shape[0], self.index.size))
        ports[self.index, np.arange(self.index.size)] = 1.0
        return ports

    def receptance(self, omega: FloatArray) -> Receptance:
        """Return the receptance between all coordinates, by one solution of the full equations per frequency.

        The exact and slow way; `poles` is the fast one.
        """
        omega = frozen(omega)
        ports = self.ports
        values = np.array([ports.T @ x for x in unit_responses(self, omega)])
        return Receptance(omega, values.reshape(omega.size, *2 * (ports.shape[1],)), self.coordinates, self.coordinates)


@dataclass(frozen=True, slots=True)
class _Bands:
    """The matrices by diagonals: entry (i, j) stands at [half + i - j, j]."""

    half: int
    stiffness: ComplexArray
    damping: ComplexArray
    mass: ComplexArray

    @classmethod
    def of(cls, structure: Structure) -> _Bands:
        stiffness = structure.stiffness + 1j * structure.structural_damping
        rows, cols = np.nonzero((structure.mass != 0.0) | (structure.damping != 0.0) | (stiffness != 0.0))
        half = int(np.max(np.abs(rows - cols)))
        bands = []
        for matrix in (stiffness, structure.damping, structure.mass):
            band = np.zeros((2 * half + 1, matrix.shape[0]), dtype=complex)
            band[half + rows - cols, cols] = matrix[rows, cols]
            bands.append(band)
        return cls(half, *bands)

    def times(self, band: ComplexArray, x: np.ndarray) -> np.ndarray:
        """Return the product of one of the matrices with x, shape (d, k)."""
        total = np.zeros(x.shape, dtype=np.result_type(band, x))
        add_banded(total, np.ascontiguousarray(band), np.ascontiguousarray(x))
        return total


def unit_responses(structure: Structure, omega: FloatArray) -> Iterator[ComplexArray]:
    """Yield, per frequency, the motion of every freedom under a unit force at each coordinate, shape (d, p).

    The dynamic stiffness is solved as a band: cost about 2 d b^2 complex flops with half-bandwidth b.
    """
    return _unit_responses(structure, _Bands.of(structure), omega)


def _unit_responses(structure: Structure, bands: _Bands, omega: FloatArray) -> Iterator[ComplexArray]:
    force = structure.ports.astype(complex)
    for w in omega:
        dynamic = bands.stiffness + 1j * w * bands.damping - w**2 * bands.mass
        yield scipy.linalg.solve_banded((bands.half, bands.half), dynamic, force, overwrite_ab=True, check_finite=False)


def natural_frequencies(structure: Structure) -> FloatArray:
    """Return the undamped natural frequencies, ascending, shape (d,) [rad/s]; rigid-body modes are zero."""
    squares = scipy.linalg.eigvalsh(structure.stiffness, structure.mass)
    return np.sqrt(np.maximum(squares, 0.0))


def rigid_body_modes(structure: Structure, max_omega: float) -> FloatArray:
    """Return the mass-orthonormal motions that no spring, damper or loss factor feels, shape (d, k), k = 0 if there are none.

    `max_omega` [rad/s]: a frequency of the elastic motion; a thousandth of it shifts the inverse iteration
    """
    return _rigid_body_modes(_Bands.of(structure), max_omega)


def _rigid_body_modes(bands: _Bands, max_omega: float) -> FloatArray:
    stiffness, mass, half = bands.stiffness.real, bands.mass.real, bands.half
    d = mass.shape[1]
    shifted = (stiffness + (1e-3 * max_omega) ** 2 * mass)[half:]
    factor = (scipy.linalg.cholesky_banded(shifted, lower=True), True)
    motions = np.random.default_rng(0).normal(size=(d, min(6, d)))
    for _ in range(4):
        motions = np.linalg.qr(scipy.linalg.cho_solve_banded(factor, bands.times(mass, motions)))[0]
    _, mix = scipy.linalg.eigh(motions.T @ bands.times(stiffness, motions), motions.T @ bands.times(mass, motions))
    motions = motions @ mix
    free = np.ones(motions.shape[1], dtype=bool)
    for band in (stiffness, bands.damping.real, bands.stiffness.imag):
        # a force that is nothing but the rounding of the sums that make it
        force, sums = bands.times(band, motions), bands.times(np.abs(band), np.abs(motions))
        free &= np.max(np.abs(force), axis=0) <= 1e-13 * np.max(sums, axis=0)
    return motions[:, free]


def poles(structure: Structure, max_omega: float, snapshots: int = 6, tolerance: float = 3e-7) -> PoleModel:
    """Return the receptance as poles and residues, good up to `max_omega`.

    The equations are projected on their own exact solutions at a few frequencies of the band (a rational Krylov
    space, real and imaginary parts apart), and the small damped problem is diagonalised. Rigid-body motions are split
    off before: their double pole at zero has no diagonal form, and stands as a pair at a ten-millionth of `max_omega`.
    `tests/dynamics` holds the result against the full solution: 1e-6 of each entry at every frequency.

    `max_omega` [rad/s]
    `snapshots`: frequencies at which the full equations are solved, Chebyshev points of the band
    `tolerance`: directions whose share of the solutions is smaller are dropped
    """
    bands = _Bands.of(structure)
    rigid = _rigid_body_modes(bands, max_omega)
    basis = _elastic_basis(_snapshots(structure, [bands], max_omega, snapshots), bands, rigid, tolerance)
    mass, damping, stiffness = (basis.T @ bands.times(band, basis) for band in (bands.mass.real, bands.damping.real, bands.stiffness))
    elastic = _diagonalise(mass, damping, stiffness, structure.ports.T @ basis, structure.coordinates)
    small, at_ports = 1e-7j * max_omega, structure.ports.T @ rigid
    pair = np.concatenate([np.full(rigid.shape[1], small), np.full(rigid.shape[1], -small)])
    return PoleModel(
        np.concatenate([elastic.pole, pair]),
        np.hstack([elastic.outputs, at_ports, at_ports]),
        np.vstack([elastic.inputs, at_ports.T / (2.0 * small), -at_ports.T / (2.0 * small)]),
        structure.coordinates,
    )


def projection_basis(
    structure: Structure, rigid: FloatArray, moments: Sequence[FloatArray], max_omega: float, snapshots: int = 6, tolerance: float = 3e-7
) -> FloatArray:
    """Return the undamped modes within what `poles` projects on, for equations that moments across the velocity join; shape (d, k).

    `rigid`, shape (d, r): its rigid-body motions, mass-orthonormal, as the basis is; both are orthogonal to each other
    `moments`: sequence of arrays, shape (d, d). Symmetric, within the bands of the mass. The dynamic stiffness loses omega times one of
        them; the basis is good for each of them and what lies between.
    `max_omega`, `snapshots`, `tolerance`: as in `poles`; so many snapshots for each of the moments
    """
    bands = _Bands.of(structure)
    rows, cols = np.nonzero(structure.mass)
    changed = []
    for moment in moments:
        damping = bands.damping.copy()
        damping[bands.half + rows - cols, cols] += 1j * moment[rows, cols]
        changed.append(replace(bands, damping=damping))
    elastic = _elastic_basis(_snapshots(structure, changed, max_omega, snapshots), bands, rigid, tolerance)
    _, shapes = scipy.linalg.eigh(elastic.T @ structure.stiffness @ elastic, elastic.T @ structure.mass @ elastic)
    modes: FloatArray = elastic @ shapes
    return modes


def _snapshots(structure: Structure, equations: Sequence[_Bands], max_omega: float, count: int) -> FloatArray:
    """Solutions of some equations at Chebyshev points of the band, real and imaginary parts side by side."""
    points = 0.5 * max_omega * (1.0 - np.cos(np.pi * (np.arange(count) + 0.5) / count))
    solutions = np.hstack([x for each in equations for x in _unit_responses(structure, each, points)])
    return np.hstack([solutions.real, solutions.imag])


def _elastic_basis(columns: FloatArray, bands: _Bands, rigid: FloatArray, tolerance: float) -> FloatArray:
    """Independent directions of the columns, free of rigid-body motion."""
    momentum = bands.times(bands.mass.real, rigid)
    for _ in range(2):
        columns = columns - rigid @ (momentum.T @ columns)
    # slopes and deflections, long and short elements on one scale
    scale = np.sqrt(bands.mass.real[bands.half])[:, None]
    basis = independent_columns(np.asfortranarray(scale * columns), tolerance) / scale
    return basis - rigid @ (momentum.T @ basis)


def _diagonalise(
    mass: FloatArray, damping: FloatArray, stiffness: FloatArray, ports: FloatArray, coordinates: tuple[Coordinate, ...]
) -> PoleModel:
    """Poles and residues of ports (K + i w C - w^2 M)^-1 ports^T for w > 0."""
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
