"""Receptance: displacement per force over frequency, the only thing that substructures exchange."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.remarks import Remark
from rcsa_ident.base.shown import Drawn
from rcsa_ident.dynamics.coordinates import Coordinate


class MeasuredCurve(tuple[FloatArray, ComplexArray]):
    """Frequencies [Hz] and receptance [m/N] of one FRF, shape (n,) both, that also says what its reader assumed.

    `frequency`: array, shape (n,) [Hz]
    `values`: complex array, shape (n,) [m/N]
    """

    remarks: tuple[Remark, ...]

    def __new__(cls, frequency: FloatArray, values: ComplexArray, remarks: Iterable[Remark] = ()) -> MeasuredCurve:
        """Return the pair with its remarks."""
        made = super().__new__(cls, (frequency, values))
        made.remarks = tuple(remarks)
        return made


def assumed_of(curves: Iterable[tuple[FloatArray, ComplexArray]]) -> tuple[Remark, ...]:
    """Return what the readers of curves assumed, each remark once."""
    return tuple(dict.fromkeys(remark for curve in curves if isinstance(curve, MeasuredCurve) for remark in curve.remarks))


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Receptance(Drawn):
    """Displacements of `rows` per unit force on `cols`.

    Parameters
    ----------
    omega : array, shape (n,) [rad/s]
    values : complex array, shape (n, r, c) [m/N, rad/N, m/(N m), rad/(N m)]
        The time dependence is e^{+i omega t}.
    rows, cols : tuple of Coordinate, lengths r and c
        Where and in which direction motion is seen, and where a force (for a slope, a moment) acts.

    Examples
    --------
    Two frequencies between tip and flange, a force at the tip:

    >>> tip, flange = Coordinate.parse("tip.x"), Coordinate.parse("flange.x")
    >>> h = Receptance([100.0, 200.0], [[[2e-6], [1e-6]], [[3e-6], [1e-6]]], rows=(tip, flange), cols=(tip,))
    >>> h["flange", "tip"].shape
    (2, 1, 1)
    >>> abs(h.between("tip.x", "tip.x")).tolist()
    [2e-06, 3e-06]
    """

    omega: FloatArray
    values: ComplexArray
    rows: tuple[Coordinate, ...]
    cols: tuple[Coordinate, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "omega", frozen(self.omega))
        object.__setattr__(self, "values", frozen(self.values, np.complex128))
        expected = (self.omega.size, len(self.rows), len(self.cols))
        if self.omega.ndim != 1 or self.values.shape != expected:
            raise InputError("receptance values", self.values.shape, f"shape {expected}: frequencies, rows, columns")

    def __getitem__(self, points: tuple[str, str]) -> ComplexArray:
        """Return the block between two points, shape (n, r, c)."""
        row_point, col_point = points
        rows = _at(self.rows, row_point)
        cols = _at(self.cols, col_point)
        return self.values[:, rows[:, None], cols[None, :]]

    def between(self, row: str, col: str) -> ComplexArray:
        """Return one entry, named as ``flange.x``, over frequency, shape (n,).

        Examples
        --------
        >>> import rcsa_ident as ri
        >>> mode = ri.normal_modes([ri.hz(900.0)], [0.02], [[5.0]], (ri.Coordinate("tip", ri.Dof.Y),))
        >>> h = mode.receptance(ri.hz(800.0, 1000.0, 100.0))
        >>> abs(1e6 * h.between("tip.y", "tip.y")).round(2)
        array([ 3.67, 19.54,  3.27])
        """
        try:
            i = self.rows.index(Coordinate.parse(row))
            j = self.cols.index(Coordinate.parse(col))
        except ValueError:
            known = ", ".join(str(c) for c in (*self.rows, *self.cols))
            raise InputError("coordinate", f"{row} or {col}", f"one of {known}") from None
        return self.values[:, i, j]

    def block(self, coordinates: Sequence[Coordinate]) -> Receptance:
        """Return the receptance between some of its coordinates, which are rows as well as columns.

        Examples
        --------
        >>> import rcsa_ident as ri
        >>> machine, tool = ri.read_machine("RESULT.json"), ri.sample_tooling("S3-PG25-long")
        >>> tip = machine.tip(tool, ri.hz(500.0, 4000.0, 5.0))
        >>> print(tip.block([ri.Coordinate("tip", ri.Dof.X)]))
        tip.x: 701 frequencies, 500 to 4000 Hz
        """
        rows, cols = ([side.index(c) for c in coordinates] for side in (self.rows, self.cols))
        return Receptance(self.omega, self.values[:, rows][:, :, cols], tuple(coordinates), tuple(coordinates))

    @classmethod
    def block_diagonal(cls, parts: Sequence[Receptance]) -> Receptance:
        """Return the receptance of parts that do not feel each other, with zeros between them.

        Raises
        ------
        InputError
            If the parts' frequencies differ, or there is no part.
        """
        if not parts:
            raise InputError("receptances", "none", "at least one")
        omega = parts[0].omega
        if any(not np.array_equal(part.omega, omega) for part in parts[1:]):
            raise InputError("receptances", "frequencies that differ", f"the {omega.size} frequencies of the first")
        rows, cols = tuple(c for p in parts for c in p.rows), tuple(c for p in parts for c in p.cols)
        values = np.zeros((omega.size, len(rows), len(cols)), dtype=complex)
        row = col = 0
        for part in parts:
            values[:, row : row + len(part.rows), col : col + len(part.cols)] = part.values
            row, col = row + len(part.rows), col + len(part.cols)
        return cls(omega, values, rows, cols)

    def __str__(self) -> str:
        low, high = (w / (2.0 * np.pi) for w in (self.omega.min(initial=np.inf), self.omega.max(initial=-np.inf)))
        between = ", ".join(str(c) for c in self.rows) + ("" if self.rows == self.cols else " over " + ", ".join(str(c) for c in self.cols))
        return f"{between}: {self.omega.size} frequencies, {low:.0f} to {high:.0f} Hz"

    def to_control(self, tolerance: float = 1e-3) -> Any:
        """Return a rational fit as python-control's ``StateSpace``: forces in, displacements out, both named after the coordinates.

        Parameters
        ----------
        tolerance : float
            Norm of the misfit, as a share of the values' own.

        Raises
        ------
        InputError
            If rows and columns differ, or no fit is within the tolerance.

        Examples
        --------
        >>> import rcsa_ident as ri
        >>> modes = ri.normal_modes([ri.hz(900.0), ri.hz(1500.0)], [0.02, 0.03], [[5.0], [4.0]], (ri.Coordinate("tip", ri.Dof.Y),))
        >>> system = modes.receptance(ri.hz(300.0, 3000.0, 5.0)).to_control()
        >>> system.nstates
        4
        """
        # late: whoever reads receptances needs no compiled kernels
        from rcsa_ident.dynamics.rational import fitted_poles

        if self.rows != self.cols:
            raise InputError("receptance", "rows that are not its columns", "displacements where the forces act")
        # each value counts relative to its own size in the fit, the largest most in the norm
        fit, error = fitted_poles(self.omega, self.values, 0.5 * tolerance)
        if error > tolerance:
            raise InputError("tolerance", tolerance, f"{error:.2g} or more: no fit with 60 poles or fewer comes nearer")
        names = [str(each) for each in self.rows]
        return fit.to_control(names, names)


def _at(coordinates: tuple[Coordinate, ...], point: str) -> np.ndarray:
    found = np.array([i for i, c in enumerate(coordinates) if c.point == point], dtype=int)
    if found.size == 0:
        raise InputError("point", point, "one of " + ", ".join(sorted({c.point for c in coordinates})))
    return found


class Substructure(Protocol):
    """Whatever can stand on one side of a coupling: a tool-holder, a spindle, a tap-tested flange, a robot at a posture."""

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """The points where it can be coupled or looked at."""
        ...

    def receptance(self, omega: FloatArray) -> Receptance:
        """Return its receptance between all its coordinates."""
        ...


def dissipation(omega: FloatArray, values: ComplexArray) -> FloatArray:
    """Return the smallest eigenvalue of the mobility's Hermitian part, relative to the mobility's norm, shape (n,).

    A structure without an inner source of energy has none below zero: the mean power that a harmonic force f feeds
    in is f^H (Y + Y^H) f / 4 with the mobility Y = i omega H.

    `omega` [rad/s], shape (n,)
    `values`, shape (n, d, d): a square receptance, rows as columns
    """
    mobility = 1j * omega[:, None, None] * values
    hermitian = 0.5 * (mobility + np.conj(np.swapaxes(mobility, 1, 2)))
    # translations and slopes have different units: a congruence with the diagonal's size makes the figure unit-free
    scale = np.sqrt(np.abs(np.einsum("nii->ni", mobility)))
    scale[scale == 0.0] = 1.0
    hermitian = hermitian / scale[:, :, None] / scale[:, None, :]
    return np.linalg.eigvalsh(hermitian)[:, 0]
