"""A spindle's flange as it was measured: receptances over frequency in place of modes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.remarks import Remark, RemarkCode
from rcsa_ident.dynamics.coordinates import Coordinate, Dof, plane
from rcsa_ident.dynamics.receptance import Receptance

#: Estimated relative error of the interpolation from which on the measured grid is called coarse, and the share of the frequencies that
#: are asked for at which it has to be: a narrow antiresonance alone changes no limit.
COARSE, COARSE_SHARE = 0.02, 0.01


class FlangeCode(RemarkCode):
    """What may be said of a measured flange."""

    COARSE = "coarse"


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredFlange:
    """Measured or decoupled receptances at the flange, good between their first and last frequency.

    Parameters
    ----------
    measured : Receptance
        Point ``flange``, rows as columns: translation and slope of one bending plane or of both; at least four frequencies that rise.

    Notes
    -----
    Between frequencies the receptance is a local cubic, or the inverse of a local cubic in the dynamic stiffness, whichever
    errs less there by its own estimate: stiffness is nearly a parabola near a resonance, the receptance is flat near an
    antiresonance. The estimate is the difference of the two parabolas that share the interval, an order below the cubic.
    """

    measured: Receptance

    def __post_init__(self) -> None:
        if any(c.point != "flange" for c in self.measured.rows) or self.measured.rows != self.measured.cols:
            found = ", ".join(str(c) for c in (*self.measured.rows, *self.measured.cols))
            raise InputError("flange coordinates", found, "coordinates of the point flange, rows as columns")
        if self.measured.omega.size < 4 or not np.all(np.diff(self.measured.omega) > 0.0):
            raise InputError("flange frequencies", self.measured.omega.size, "at least four, increasing [rad/s]")
        if not np.all(np.isfinite(self.measured.values)):
            raise InputError("flange receptance", "not finite", "finite numbers")

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """Directions of the flange that were measured."""
        return self.measured.rows

    @property
    def band(self) -> tuple[float, float]:
        """First and last frequency [rad/s]."""
        return float(self.measured.omega[0]), float(self.measured.omega[-1])

    def receptance(self, omega: FloatArray) -> Receptance:
        """Return B33 at any frequencies within the measured band.

        Raises
        ------
        InputError
            Outside the band nothing is known.
        """
        return Receptance(omega, self._interpolated(omega)[0], self.coordinates, self.coordinates)

    def interpolation_error(self, omega: FloatArray) -> FloatArray:
        """Return the estimated relative error of `receptance`, shape (n,); 0 at the measured frequencies."""
        values, error = self._interpolated(omega)
        return np.max(error / np.maximum(_size(values), 1e-300), axis=(1, 2))

    def coarse(self, omega: FloatArray) -> Remark | None:
        """Return a remark where the measured frequencies are too far apart for those that are asked for [rad/s], else None.

        Noise of the measurement looks the same: both leave open what the receptance is between two measured frequencies.
        """
        omega = np.asarray(omega, dtype=float)
        error = self.interpolation_error(omega)
        share = float(np.mean(error > COARSE))
        if share < COARSE_SHARE:
            return None
        worst = int(np.argmax(error))
        return Remark(
            FlangeCode.COARSE,
            f"flange measured too coarsely or with too much noise at {share * 100.0:.0f} % of the frequencies: between the measured ones "
            f"its receptance may be {error[worst] * 100.0:.0f} % off at {omega[worst] / (2.0 * np.pi):.0f} Hz",
        )

    def _interpolated(self, omega: FloatArray) -> tuple[ComplexArray, FloatArray]:
        """Values and estimated errors, shapes (n, d, d)."""
        omega = np.asarray(omega, dtype=float)
        grid, values = self.measured.omega, self.measured.values
        first, last = self.band
        outside = (omega < first * (1.0 - 1e-12)) | (omega > last * (1.0 + 1e-12))
        if outside.any():
            hertz = 2.0 * np.pi
            raise InputError(
                "frequency",
                f"{omega[outside][0] / hertz:.6g} Hz",
                f"{first / hertz:.6g} to {last / hertz:.6g} Hz, where the flange was measured",
            )
        direct, error = _cubic(grid, values, omega)
        # units apart: a congruence keeps the inverse's rounding small
        scale = np.sqrt(np.median(np.abs(np.einsum("nii->ni", values)), axis=0))
        if np.all(scale > 0.0) and np.linalg.cond(values / scale[:, None] / scale).max() < 1e10:
            stiffness = np.linalg.inv(values / scale[:, None] / scale)
            back, change = _cubic(grid, stiffness, omega)
            other = np.linalg.inv(back)
            # d(S^-1) = -S^-1 dS S^-1
            wrong = np.abs(other) @ change @ np.abs(other) * scale[:, None] * scale
            other = other * scale[:, None] * scale
            better = (_norm(wrong / scale[:, None] / scale) < _norm(error / scale[:, None] / scale))[:, None, None]
            direct, error = np.where(better, other, direct), np.where(better, wrong, error)
        return direct, error


def _cubic(grid: FloatArray, values: ComplexArray, omega: FloatArray) -> tuple[ComplexArray, FloatArray]:
    """Cubic through the four nearest points, and the difference of the parabolas through the first and last three of them."""
    left = np.clip(np.searchsorted(grid, omega, side="right") - 2, 0, grid.size - 4)
    places = left[:, None] + np.arange(4)
    x, y = grid[places], values[places]
    weights = np.stack([_lagrange(x, omega, members) for members in ((0, 1, 2, 3), (0, 1, 2), (1, 2, 3))])
    cubic, early, late = np.einsum("snk,nkij->snij", weights, y)
    # at a measured frequency nothing is interpolated, also at the ends, which only one of the parabolas reaches
    between = np.all(x != omega[:, None], axis=1)
    return cubic, np.where(between[:, None, None], np.abs(early - late), 0.0)


def _lagrange(x: FloatArray, at: FloatArray, members: tuple[int, ...]) -> FloatArray:
    """Weights of the points in `members` of each row of x, 0 for the others, shape (n, 4)."""
    weights = np.zeros(x.shape)
    for k in members:
        others = [m for m in members if m != k]
        weights[:, k] = np.prod([(at - x[:, m]) / (x[:, k] - x[:, m]) for m in others], axis=0)
    return weights


def _norm(values: FloatArray) -> FloatArray:
    return np.max(np.abs(values), axis=(1, 2))


def _size(values: ComplexArray) -> FloatArray:
    """What an entry is small or large against: the geometric mean of its diagonal entries."""
    diagonal = np.sqrt(np.abs(np.einsum("nii->ni", values)))
    return diagonal[:, :, None] * diagonal[:, None, :]


def translations_only(omega: FloatArray, values: ComplexArray, axis: Dof = Dof.X) -> MeasuredFlange:
    """Return a flange of which only the translation was measured, and which is taken not to turn.

    A flange that does not turn is the usual assumption where rotations cannot be measured; it makes the coupled machine stiffer than
    it is. Decoupling (several toolings) or neighbouring points (finite differences) give the rotations.

    `omega` [rad/s], shape (n,)
    `values` [m/N], shape (n,): displacement per force of the flange
    `axis`: machine axis X or Y: the bending plane
    """
    block = np.zeros((np.size(omega), 2, 2), dtype=complex)
    block[:, 0, 0] = frozen(values, np.complex128)
    rows = plane("flange", axis)
    return MeasuredFlange(Receptance(omega, block, rows, rows))
