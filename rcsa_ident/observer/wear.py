"""Tool wear from estimated forces: cutting and edge coefficients revolution by revolution, with bands and a trend."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.cutting.conditions import CuttingConditions
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import unit_lines

#: What a force consists of; shearing grows with the chip, rubbing with a worn edge.
COEFFICIENTS = ("K_tc", "K_rc", "K_te", "K_re")
#: Largest condition number of the scaled normal equations at which coefficients count as told from each other.
SEPARABLE = 1e4
#: Trial angles in a tooth pitch at which a search for the teeth's angle starts.
_TRIALS = 96


@dataclass(frozen=True, slots=True, eq=False)
class WearIndicators:
    """Coefficients of each revolution.

    `time` [s], shape (n,): middle of each revolution
    `coefficient` [N/m^2 of K_tc and K_rc, N/m of K_te and K_re], shape (n, c): least squares of each revolution by itself
    `standard_deviation`, shape (n, c): as what the model leaves of that revolution's lines suggests
    `tracked`, `tracked_deviation`, shape (n, c): coefficients and standard deviations of a slow random walk, each given all revolutions
    `names`: of the c coefficients
    `separable`: False where the lines in the band do not tell the coefficients from each other: then only sums of them mean something
    `condition`: condition number of the scaled normal equations
    `angle` [rad]: immersion of tooth 1 at the first sample, up to a pitch
    `misfit` [-]: norm of what is left of all lines over their own
    """

    time: FloatArray
    coefficient: FloatArray
    standard_deviation: FloatArray
    tracked: FloatArray
    tracked_deviation: FloatArray
    names: tuple[str, ...]
    separable: bool
    condition: float
    angle: float
    misfit: float

    def trend(self) -> tuple[FloatArray, FloatArray]:
        """Return each coefficient's change per second and its standard deviation, by a straight line through the revolutions."""
        t = self.time - self.time.mean()
        weight = 1.0 / self.standard_deviation**2
        centre = np.sum(weight * t[:, None], axis=0) / np.sum(weight, axis=0)
        lever = t[:, None] - centre
        information = np.sum(weight * lever**2, axis=0)
        slope = np.sum(weight * lever * self.coefficient, axis=0) / information
        offset = np.sum(weight * self.coefficient, axis=0) / np.sum(weight, axis=0)
        rest = self.coefficient - offset - slope * lever
        scatter = np.sum(weight * rest**2, axis=0) / max(t.size - 2, 1)
        return slope, np.sqrt(np.maximum(scatter, 1.0) / information)


def wear_indicators(
    force: FloatArray,
    step: float,
    cutter: Cutter,
    conditions: CuttingConditions,
    band: tuple[float, float],
    *,
    edges: bool = True,
    angle: float | None = None,
    first: int = 0,
    walk: float = 0.01,
) -> WearIndicators:
    """Return cutting and edge coefficients of every revolution of a record.

    Parameters
    ----------
    force : array, shape (n, 2) [N]
        X and Y; its mean is not looked at.
    step : float [s]
    cutter : Cutter
    conditions : CuttingConditions
        The cut, with the spindle speed of the record.
    band : two floats [rad/s]
        Frequencies between which the force is known: only the teeth's harmonics there are used.
    edges : bool
        Whether edge coefficients are found, too; else K_tc and K_rc alone.
    angle : float [rad], optional
        Immersion of tooth 1 at the record's first sample; by default found from the forces themselves.
    first : int
        Number of the first force's sample in its record: times and the angle count from the record's first sample.
    walk : float
        How far a coefficient may move in a revolution, as a share of itself.

    Raises
    ------
    InputError
        If fewer than two revolutions are left or no harmonic lies in the band.

    Notes
    -----
    F(m) = sum_c K_c B_c(m) e^{i m angle}: lines are linear in the coefficients (`cutting.force.force_lines`), the angle is one
    number for the record. A revolution's real and imaginary parts in X and Y give 4 equations a harmonic for 4 unknowns. Where the edge
    leans, X and Y of one depth cannot tell radial from axial coefficients: the radial ones stand for both.
    """
    force = np.asarray(force, dtype=float)
    if force.ndim != 2 or force.shape[1] != 2:
        raise InputError("forces", force.shape, "two columns, X and Y")
    positive("walk", walk)
    speed = conditions.spindle_speed
    period = 2.0 * np.pi / speed / step
    turns = int(force.shape[0] / period)
    if turns < 2:
        raise InputError("forces", f"{turns} whole revolutions", "two or more")
    harmonic = cutter.teeth * np.arange(1, int(band[1] / speed / cutter.teeth + 1e-9) + 1)
    harmonic = harmonic[harmonic * speed >= band[0] * (1.0 - 1e-9)]
    if harmonic.size == 0:
        raise InputError("band", [w / (2.0 * np.pi) for w in band], "one that holds a tooth-passing harmonic [Hz]")
    lines = _revolution_lines(force, first, period, turns, harmonic, speed * step)
    basis = unit_lines(cutter, conditions, harmonic)[:, :, : len(COEFFICIENTS) if edges else 2]
    mean = lines.mean(axis=0)
    angle = _angle(mean, basis, harmonic, cutter) if angle is None else angle
    matrix = basis * np.exp(1j * harmonic * angle)[:, None, None]
    rows = _stacked(matrix.reshape(-1, matrix.shape[2]))
    size = np.linalg.norm(rows, axis=0)
    left, values, right = np.linalg.svd(rows / size, full_matrices=False)
    condition = float((values[0] / values[-1]) ** 2)
    inverse = (right.T / values) @ left.T / size[:, None]
    data = _stacked(lines.reshape(turns, -1).T)
    coefficient = (inverse @ data).T
    rest = data - rows @ coefficient.T
    free = max(rows.shape[0] - rows.shape[1], 1)
    # what the model leaves is of one kind in all revolutions, and so is its size
    noise = np.sqrt(np.sum(rest**2, axis=0) / free)
    deviation = noise[:, None] * np.sqrt(np.sum(inverse**2, axis=1))
    scatter = np.std(coefficient - coefficient.mean(axis=0), axis=0)
    tracked, spread = _tracked(coefficient, np.maximum(scatter, 1e-12 * np.abs(coefficient).max(axis=0) + 1e-300), walk)
    return WearIndicators(
        frozen((first + (np.arange(turns) + 0.5) * period) * step),
        frozen(coefficient),
        frozen(deviation),
        frozen(tracked),
        frozen(spread),
        COEFFICIENTS[: matrix.shape[2]],
        condition <= SEPARABLE,
        condition,
        float(angle % (2.0 * np.pi / cutter.teeth)) if cutter.equally_spaced else float(angle % (2.0 * np.pi)),
        float(np.linalg.norm(rest) / np.linalg.norm(data)),
    )


def _revolution_lines(force: FloatArray, first: int, period: float, turns: int, harmonic: np.ndarray, turn: float) -> ComplexArray:
    """Amplitudes of every revolution, phases from the record's first sample, shape (turns, m, 2)."""
    result = np.empty((turns, harmonic.size, 2), dtype=complex)
    highest = int(harmonic[-1])
    order = np.arange(highest + 1)
    for k in range(turns):
        start, end = round(k * period), round((k + 1) * period)
        phase = np.outer((first + np.arange(start, end)) * turn, order)
        columns = np.hstack([np.cos(phase), -np.sin(phase[:, 1:])])
        found = np.linalg.lstsq(columns, force[start:end], rcond=None)[0]
        result[k] = found[harmonic] + 1j * found[highest + harmonic]
    return result


def _stacked(values: ComplexArray) -> FloatArray:
    return np.concatenate([values.real, values.imag])


def _angle(mean: ComplexArray, basis: ComplexArray, harmonic: np.ndarray, cutter: Cutter) -> float:
    """The angle at which the coefficients explain most of the mean revolution; tooth by tooth where the teeth are alike."""
    reach = 2.0 * np.pi / cutter.teeth if cutter.equally_spaced else 2.0 * np.pi
    data = _stacked(mean.reshape(-1))

    def left(angle: float) -> float:
        rows = _stacked((basis * np.exp(1j * harmonic * angle)[:, None, None]).reshape(-1, basis.shape[2]))
        rows = rows / np.linalg.norm(rows, axis=0)
        solution = np.linalg.lstsq(rows, data, rcond=None)[0]
        # chips and edges push: an angle that needs them to pull is half a turn off
        wrong = max(-float(solution[0]), 0.0)
        return float(np.sum((data - rows @ solution) ** 2)) + wrong**2

    from scipy.optimize import minimize_scalar

    trial = np.arange(_TRIALS) * reach / _TRIALS
    best = float(trial[int(np.argmin([left(a) for a in trial]))])
    return float(
        minimize_scalar(left, bounds=(best - reach / _TRIALS, best + reach / _TRIALS), method="bounded", options={"xatol": 1e-9}).x
    )


def _tracked(coefficient: FloatArray, scatter: FloatArray, walk: float) -> tuple[FloatArray, FloatArray]:
    """Each coefficient as a random walk seen with its own scatter, given all revolutions (filterpy's filter and smoother)."""
    from filterpy.kalman import KalmanFilter

    value, spread = np.empty_like(coefficient), np.empty_like(coefficient)
    for c, column in enumerate(coefficient.T):
        # in units of the scatter, so that large and small coefficients are alike to the filter
        walker = KalmanFilter(dim_x=1, dim_z=1)
        walker.x, walker.P = np.array([[column[0] / scatter[c]]]), np.eye(1)
        walker.F, walker.H, walker.R = np.eye(1), np.eye(1), np.eye(1)
        walker.Q = np.eye(1) * (walk * np.abs(column).mean() / scatter[c]) ** 2
        means, covariances, _, _ = walker.batch_filter(column / scatter[c])
        smooth, known, _, _ = walker.rts_smoother(means, covariances)
        value[:, c], spread[:, c] = smooth[:, 0, 0] * scatter[c], np.sqrt(known[:, 0, 0]) * scatter[c]
    return value, spread
