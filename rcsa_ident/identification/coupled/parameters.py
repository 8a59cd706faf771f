"""Both planes' unknowns as one vector, and the vector as physics.

A machine with m modes: log natural frequencies (m); mass-normalised shapes (4 m: translation and lever x slope in X, then in Y); the
lower triangle of the damping factor L by rows (diagonal as logarithm); the lower triangle of the residual compliance's factor (10);
where gap and fixture are two outputs the fixture's shapes (2 m) and its residual to the flange (8); where the machine changes with
speed the lower triangle of its softening by rows; the gyroscopic coupling. Behind them stands what `parameters.Layout` has there, too:
the joint's four logarithms, the forces' coefficients, the clampings' tooth angles.

With D = L L^T, R = R_f R_f^T and a skew G every vector is a passive machine at every speed: the damping's Hermitian part is D, and
i omega W G takes and gives nothing in the mean.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.identification.parameters import (
    DAMPING_UNIT,
    PLACE_UNIT,
    RESIDUAL_UNIT,
    AxisParameters,
    Unknowns,
    lower_factor,
    lower_triangle,
)

#: Directions of the flange: translation and slope in X, then in Y; their translations.
DIRECTIONS = 4
TRANSLATIONS = (0, 2)
_RESIDUAL = DIRECTIONS * (DIRECTIONS + 1) // 2
#: `CoupledLayout.skew` where each pair of modes has an entry of its own.
EVERY_PAIR = -1


@dataclass(frozen=True, slots=True)
class CoupledLayout(Unknowns):
    """Which unknown of both planes stands where in the vector.

    Parameters
    ----------
    modes : int
        Of the whole machine.
    fixture : bool
        Gap and fixture are two outputs; else their sum, the flange's own motion, is the only one.
    softening : bool
        The stiffness changes with the spindle's speed.
    skew : int
        How the gyroscopic coupling G is written: none (0), as a sum of so many a b^T - b a^T, each what a disc's two slopes do, or
        entry by entry (`EVERY_PAIR`).
    turning : int
        1 where tool-holders have their gyroscopic moments, -1 where the spindle turns the other way, 0 where they have none.
    coefficients, clampings : int
        As in `parameters.Layout`.
    """

    modes: int
    fixture: bool = False
    softening: bool = False
    skew: int = 0
    turning: int = 0
    coefficients: int = 0
    clampings: int = 0

    @property
    def pairs(self) -> int:
        """Number of entries of a lower triangle over the modes."""
        return self.modes * (self.modes + 1) // 2

    @property
    def core(self) -> int:
        """Length of the part that describes the flange at the campaign's middle speed, without gyroscopic coupling."""
        return (1 + DIRECTIONS) * self.modes + self.pairs + _RESIDUAL

    @property
    def _fixture_size(self) -> int:
        return (2 * self.modes + 2 * DIRECTIONS) * self.fixture

    @property
    def skew_size(self) -> int:
        """Unknowns of the gyroscopic coupling."""
        return self.modes * (self.modes - 1) // 2 if self.skew == EVERY_PAIR else 2 * self.modes * self.skew

    @property
    def tail(self) -> int:
        """Place in the vector at which the machine's own part ends."""
        return self.core + self._fixture_size + self.pairs * self.softening + self.skew_size

    def axis(self, i: int) -> slice:
        """Return what an axis' lines depend on: the whole machine."""
        del i
        return slice(0, self.tail)

    @property
    def shapes(self) -> slice:
        """Places of the shapes."""
        return slice(self.modes, (1 + DIRECTIONS) * self.modes)

    @property
    def damping(self) -> slice:
        """Places of the damping factor's lower triangle."""
        return slice(self.shapes.stop, self.shapes.stop + self.pairs)

    @property
    def residual(self) -> slice:
        """Places of the residual compliance's factor."""
        return slice(self.damping.stop, self.core)

    @property
    def fixture_shapes(self) -> slice:
        """Places of the fixture's shapes."""
        return slice(self.core, self.core + 2 * self.modes * self.fixture)

    @property
    def fixture_residual(self) -> slice:
        """Places of the fixture's residual to the flange."""
        return slice(self.fixture_shapes.stop, self.core + self._fixture_size)

    @property
    def softenings(self) -> slice:
        """Places of the softening's lower triangle."""
        return slice(self.core + self._fixture_size, self.core + self._fixture_size + self.pairs * self.softening)

    @property
    def skews(self) -> slice:
        """Places of the gyroscopic coupling."""
        return slice(self.softenings.stop, self.tail)

    @property
    def modes_of_axes(self) -> tuple[int, ...]:
        """Modes that may be exchanged with each other without changing anything: all of them."""
        return (self.modes,)

    @property
    def machine(self) -> np.ndarray:
        """Places of all that describes the flange: without the fixture, the joint and the forces."""
        places = np.arange(self.tail)
        return np.concatenate([places[: self.core], places[self.softenings.start :]])

    @property
    def flange(self) -> CoupledLayout:
        """The same without what only the campaign needs: fixture, forces and tooth angles."""
        return replace(self, fixture=False, coefficients=0, clampings=0)


@dataclass(frozen=True, slots=True, eq=False)
class CoupledParameters:
    """Both planes in scaled physical units, as the kernel takes them.

    Parameters
    ----------
    omega_n : array, shape (m,) [rad/s]
    psi : array, shape (m, 4) [1/sqrt(kg)]
        Mass-normalised shapes at the flange: translation, and slope times the lever, in X and in Y.
    factor : array, shape (m, m) [sqrt(rad/s)]
        L of the damping matrix D = L L^T in modal coordinates.
    residual : array, shape (4, 4) [sqrt(m/N)]
        Lower triangular factor of the residual compliance, the modes above the band.
    fixture : array, shape (m, 2) [1/sqrt(kg)]
        The modes' shapes at the fixture in X and Y; zeros where the flange's motion is the only output.
    fixture_residual : array, shape (2, 4) [m/N]
    softening : array, shape (m, m) or (0, 0) [-]
        Symmetric, as in `parameters.AxisParameters`.
    skew : array, shape (m, m) or (0, 0) [-]
        G: a velocity of mode j at spindle speed W pushes mode i with W G_ij.
    """

    omega_n: FloatArray
    psi: FloatArray
    factor: FloatArray
    residual: FloatArray
    fixture: FloatArray
    fixture_residual: FloatArray
    softening: FloatArray
    skew: FloatArray

    @property
    def order(self) -> int:
        """Number of modes."""
        return self.omega_n.size

    def at(self, x: float) -> CoupledParameters:
        """Return the machine at relative speed x (-1 and 1 are the campaign's lowest and highest), in its own modes there."""
        if self.softening.size == 0:
            return self
        stiffness = np.outer(self.omega_n, self.omega_n) * (np.eye(self.order) + x * self.softening)
        squares, turn = np.linalg.eigh(stiffness)
        # far outside the measured speeds the straight line may cross zero: a machine does not
        omega_n = np.sqrt(np.maximum(squares, 1e-6 * np.min(self.omega_n) ** 2))
        return CoupledParameters(
            omega_n,
            turn.T @ self.psi,
            lower_factor(turn.T @ self.factor),
            self.residual,
            turn.T @ self.fixture,
            self.fixture_residual,
            np.zeros((0, 0)),
            turn.T @ self.skew @ turn if self.skew.size else self.skew,
        )


@lru_cache
def strict_triangle(order: int) -> tuple[np.ndarray, np.ndarray]:
    """Return rows and columns of the entries above a square's diagonal, row by row: those of a skew matrix."""
    rows, cols = (frozen(index, np.intp) for index in np.triu_indices(order, 1))
    return rows, cols


def parameter_names(layout: CoupledLayout) -> tuple[str, ...]:
    """Return the names of the unknowns of a flange and the joint, in the vector's order; `layout` is that of a flange alone."""
    m = layout.modes
    directions = ("x_t", "lever*x_r", "y_t", "lever*y_r")
    pairs = [(i, j) for i in range(m) for j in range(i + 1)]
    names = [f"log natural_frequency_rad_s[{n}]" for n in range(m)]
    names += [f"psi_{k}[{n}]" for n in range(m) for k in directions]
    names += [f"log damping_factor[{i},{j}]" if i == j else f"damping_factor[{i},{j}]" for i, j in pairs]
    names += [f"residual_factor[{i},{j}]" for i in range(DIRECTIONS) for j in range(i + 1)]
    names += [f"softening[{i},{j}]" for i, j in pairs if layout.softening]
    names += [f"disc_{k}_{side}[{n}]" for k in range(max(layout.skew, 0)) for side in ("a", "b") for n in range(m)]
    names += [f"gyroscopic[{i},{j}]" for i in range(m) for j in range(i + 1, m) if layout.skew == EVERY_PAIR]
    return (*names, "log joint.k_t", "log joint.k_r", "log joint.c_t", "log joint.c_r")


def unpack(part: FloatArray, layout: CoupledLayout) -> CoupledParameters:
    """Return the physics of the machine's own part of the vector, shape (tail,) or longer."""
    m = layout.modes
    rows, cols, diagonal = lower_triangle(m)
    lower = DAMPING_UNIT * part[layout.damping]
    lower[diagonal] = DAMPING_UNIT * np.exp(part[layout.damping][diagonal])
    factor = np.zeros((m, m))
    factor[rows, cols] = lower
    residual = np.zeros((DIRECTIONS, DIRECTIONS))
    residual[np.tril_indices(DIRECTIONS)] = RESIDUAL_UNIT * part[layout.residual]
    fixture, fixture_residual, softening = np.zeros((m, 2)), np.zeros((2, DIRECTIONS)), np.zeros((0, 0))
    if layout.fixture:
        fixture = part[layout.fixture_shapes].reshape(m, 2)
        fixture_residual = PLACE_UNIT * part[layout.fixture_residual].reshape(2, DIRECTIONS)
    if layout.softening:
        softening = np.zeros((m, m))
        softening[rows, cols] = softening[cols, rows] = part[layout.softenings]
    psi = part[layout.shapes].reshape(m, DIRECTIONS)
    return CoupledParameters(np.exp(part[:m]), psi, factor, residual, fixture, fixture_residual, softening, _skew(part, layout))


def _skew(part: FloatArray, layout: CoupledLayout) -> FloatArray:
    m = layout.modes
    if layout.skew == 0:
        return np.zeros((0, 0))
    if layout.skew == EVERY_PAIR:
        rows, cols = strict_triangle(m)
        skew = np.zeros((m, m))
        skew[rows, cols] = part[layout.skews]
        return skew - skew.T
    discs = part[layout.skews].reshape(layout.skew, 2, m)
    half: FloatArray = np.einsum("ki,kj->ij", discs[:, 0], discs[:, 1])
    return half - half.T


def pack(machine: CoupledParameters, layout: CoupledLayout, discs: FloatArray | None = None) -> FloatArray:
    """Return the machine's own part of the vector; the inverse of `unpack`.

    Parameters
    ----------
    machine : CoupledParameters
    layout : CoupledLayout
    discs : array, shape (skew, 2, m), optional
        The gyroscopic coupling's a and b; by default none, or with `EVERY_PAIR` the machine's own entries.
    """
    rows, cols, diagonal = lower_triangle(machine.order)
    lower = machine.factor[rows, cols] / DAMPING_UNIT
    lower = np.where(diagonal, np.log(np.where(diagonal, np.abs(lower), 1.0)), lower)
    residual = machine.residual[np.tril_indices(DIRECTIONS)] / RESIDUAL_UNIT
    parts = [np.log(machine.omega_n), machine.psi.ravel(), lower, residual]
    if layout.fixture:
        parts += [machine.fixture.ravel(), machine.fixture_residual.ravel() / PLACE_UNIT]
    if layout.softening:
        parts.append(machine.softening[rows, cols] if machine.softening.size else np.zeros(layout.pairs))
    if layout.skew == EVERY_PAIR:
        parts.append(machine.skew[strict_triangle(machine.order)] if machine.skew.size else np.zeros(layout.skew_size))
    elif layout.skew:
        parts.append(np.zeros(layout.skew_size) if discs is None else discs.ravel())
    return np.concatenate(parts)


def chain(machine: CoupledParameters, layout: CoupledLayout) -> FloatArray:
    """Return d physics / d vector for each entry, in the vector's order; 1 for the gyroscopic coupling (see `skew_chain`)."""
    rows, cols, diagonal = lower_triangle(machine.order)
    factor = np.where(diagonal, machine.factor[rows, cols], DAMPING_UNIT)
    parts = [np.ones((1 + DIRECTIONS) * machine.order), factor, np.full(_RESIDUAL, RESIDUAL_UNIT)]
    if layout.fixture:
        parts += [np.ones(2 * machine.order), np.full(2 * DIRECTIONS, PLACE_UNIT)]
    return np.concatenate([*parts, np.ones(layout.tail - layout.softenings.start)])


def skew_chain(part: FloatArray, layout: CoupledLayout) -> FloatArray:
    """Return d G_ij (i < j, row by row) / d the gyroscopic unknowns, shape (m (m - 1) / 2, skew_size)."""
    m = layout.modes
    rows, cols = strict_triangle(m)
    if layout.skew == EVERY_PAIR:
        return np.eye(rows.size)
    discs = part[layout.skews].reshape(layout.skew, 2, m)
    place = np.arange(rows.size)
    found = np.zeros((rows.size, layout.skew, 2, m))
    for k, (a, b) in enumerate(discs):
        # G_ij = a_i b_j - b_i a_j
        found[place, k, 0, rows] = b[cols]
        found[place, k, 0, cols] = -b[rows]
        found[place, k, 1, cols] = a[rows]
        found[place, k, 1, rows] = -a[cols]
    return found.reshape(rows.size, -1)


def side_by_side(x: AxisParameters, y: AxisParameters) -> CoupledParameters:
    """Return two planes that feel nothing of each other as one machine, the modes of X first."""
    m, first = x.order + y.order, x.order
    psi, fixture = np.zeros((m, DIRECTIONS)), np.zeros((m, 2))
    psi[:first, :2], psi[first:, 2:] = x.psi, y.psi
    factor, residual, fixture_residual = np.zeros((m, m)), np.zeros((DIRECTIONS, DIRECTIONS)), np.zeros((2, DIRECTIONS))
    factor[:first, :first], factor[first:, first:] = x.factor, y.factor
    residual[:2, :2], residual[2:, 2:] = x.residual, y.residual
    if x.places.size and y.places.size:
        fixture[:first, 0], fixture[first:, 1] = x.places[:, 0], y.places[:, 0]
        fixture_residual[0, :2], fixture_residual[1, 2:] = x.place_residual[0], y.place_residual[0]
    softening = np.zeros((0, 0))
    if x.softening.size:
        softening = np.zeros((m, m))
        softening[:first, :first], softening[first:, first:] = x.softening, y.softening
    omega_n = np.concatenate([x.omega_n, y.omega_n])
    return CoupledParameters(omega_n, psi, factor, residual, fixture, fixture_residual, softening, np.zeros((0, 0)))
