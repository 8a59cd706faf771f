"""Kalman filter [kalman1960] of the augmented state {q, f} ([inprocess], eq. 17): settling, steady, streaming, smoothing.

One filter serves one axis, or all axes that feel each other: a force and a measurement for each.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.state_space import StateSpace
from rcsa_ident.observer._kernels import coupled_smoothed, coupled_steps, kalman_steps, smoothed_force
from rcsa_ident.observer.force_model import AugmentedModel

#: Relative distance of a gain from its steady value at which the settling phase ends, and its longest duration in steps.
SETTLED, LONGEST_SETTLING = 1e-6, 1000


@dataclass(frozen=True, slots=True, eq=False)
class FilterState:
    """Where a stream stands. `count`: samples seen. `modes`, shape (2, m)."""

    count: int
    modes: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class KalmanFilter:
    """Gains for c forces and as many measurements: a settling phase of full covariance, then the steady state.

    `gain`, shape (s, c, 2, m): of each measurement; the last is the steady one
    `variance` [m^2], shape (s, c, c): covariance of the innovations
    `row`, shape (s, c, 2, m): covariance of each force with the state after the correction
    `force_variance` [N^2], shape (s, c): variance of each force after the correction
    """

    model: AugmentedModel
    gain: FloatArray
    variance: FloatArray
    row: FloatArray
    force_variance: FloatArray

    @property
    def count(self) -> int:
        """Number of forces, and of measurements."""
        return self.model.noise.size

    def init(self) -> FilterState:
        """Return the state before the first sample."""
        return FilterState(0, np.zeros((2, self.model.decay.size)))

    def run(self, state: FilterState, measured: FloatArray) -> tuple[FilterState, FloatArray]:
        """Return the state after a block, and forces [N], their walking parts [N] and innovations [m] at its samples, shape (n, 3, c).

        `measured` [m], shape (n, c)
        """
        return self._scan(state, self.gain, state.count, np.ascontiguousarray(measured, dtype=float))

    def predict(self, state: FilterState, count: int) -> tuple[FilterState, FloatArray]:
        """Return the state after samples that nobody has measured, and the same at them as `run`, innovations 0, shape (n, 3, c)."""
        # innovations that correct nothing
        still = frozen(np.zeros((1, *self.gain.shape[1:])))
        after, result = self._scan(state, still, 0, np.zeros((count, self.count)))
        result[:, 2] = 0.0
        return after, result

    def smooth(self, result: FloatArray) -> FloatArray:
        """Return the forces given the whole record, shape (n, c) [N]; `result` is that of `run` from the first sample on.

        The fixed-interval smoother of Rauch, Tung and Striebel [rauch1965] in the form of Bryson and Frazier [bryson1963], which needs no
        inverse of a covariance and costs as little as the filter.
        """
        force, innovation = np.ascontiguousarray(result[:, 0]), result[:, 2]
        if self.count == 1:
            flat = (self.gain[:, 0], self.variance[:, 0, 0], self.row[:, 0], innovation[:, 0], force[:, 0])
            return smoothed_force(*self._one_axis(), *(np.ascontiguousarray(each) for each in flat))[:, None]
        place = np.minimum(np.arange(result.shape[0]), self.gain.shape[0] - 1)
        weighed = np.einsum("nij,nj->ni", np.linalg.inv(self.variance)[place], innovation)
        return coupled_smoothed(*self._axes(), self.gain, self.row, np.ascontiguousarray(weighed), force)

    def lag_weights(self, lag: int, at: int | None = None) -> FloatArray:
        """Return what each later innovation adds to the forces of a sample, shape (lag, c, c) [N/m]: later sample, force, innovation.

        `lag`: number of later innovations
        `at`: number of the sample in the settling phase; by default one of the steady state
        """
        shown, inverse = self._ahead(lag, at)
        return shown @ inverse

    def standard_deviation(self, count: int, smoothed: bool = False, longest: int = 4096) -> FloatArray:
        """Return the forces' standard deviations at `count` samples from the first, given those before or all, shape (count, c) [N].

        `smoothed`: given all samples; else given those before
        `longest`: how far a sample looks ahead
        """
        last = self.gain.shape[0] - 1
        variance = self.force_variance[np.minimum(np.arange(count), last)]
        if smoothed:
            told = np.concatenate([np.zeros((1, self.count)), np.cumsum(self._told(min(longest, count)), axis=0)])
            gained = told[np.minimum(np.arange(count)[::-1], told.shape[0] - 1)]
            for k in range(min(last, count)):
                gained[k] = np.sum(self._told(min(longest, count - 1 - k), k), axis=0)
            variance = variance - gained
        return np.sqrt(np.maximum(variance, 0.0))

    def response(self, omega: FloatArray, lag: int = 0) -> tuple[ComplexArray, ComplexArray]:
        """Return the observer's frequency response in the steady state, measured displacements to forces, shape (n, c, c) [N/m].

        `omega` [rad/s], shape (n,)
        `lag`: with a fixed lag, the delay by it taken out; a long one stands for the smoother
        Returns complex arrays, shape (n, c, c): displacements to forces [N/m], displacements to innovations [-].
        """
        a, seen, rows, gain = self._steady()
        # triangular, so that each frequency costs a substitution: a solution each takes seconds and hundreds of megabytes
        balanced, (scale, _) = scipy.linalg.matrix_balance(a - gain @ seen @ a, permute=False, separate=True)
        triangle, basis = scipy.linalg.schur(balanced, output="complex")
        entering, leaving = basis.conj().T @ (gain / scale[:, None]), scale[:, None] * basis
        turn = np.asarray(omega, dtype=float)[:, None] * self.model.step
        back = np.exp(-1j * turn)
        states = np.empty((len(entering), turn.size, self.count), dtype=complex)
        for k in range(len(entering) - 1, -1, -1):
            later = np.tensordot(triangle[k, k + 1 :], states[k + 1 :], axes=1)
            states[k] = (entering[k] + back * later) / (1.0 - back * triangle[k, k])
        force = np.tensordot(rows @ leaving, states, axes=1).transpose(1, 0, 2)
        innovation = np.eye(self.count) - back[:, :, None] * np.tensordot(seen @ a @ leaving, states, axes=1).transpose(1, 0, 2)
        if lag:
            ahead = np.exp(1j * turn * np.arange(1.0, lag + 1.0))
            force = force + np.tensordot(ahead, self.lag_weights(lag), axes=1) @ innovation
        return force, innovation

    def state_space(self) -> StateSpace:
        """Return the filter in the steady state: measured displacements [m] in, forces [N] and then innovations [m] out.

        Its poles are those of the estimate's error.
        """
        a, seen, rows, gain = self._steady()
        closed = a - gain @ seen @ a
        outputs, direct = np.vstack([rows @ closed, -(seen @ a)]), np.vstack([rows @ gain, np.eye(self.count)])
        return StateSpace(closed, gain, outputs, direct, self.model.step)

    def loop(self) -> StateSpace:
        """Return the innovation loop, cut open: innovations [m] in, the displacements predicted from past corrections [m] out.

        L(z) = H (z I - A)^-1 A K; the innovations are S = (1 + L)^-1 times the measured displacements.
        """
        a, seen, _, gain = self._steady()
        return StateSpace(a, a @ gain, seen, np.zeros((self.count, self.count)), self.model.step)

    def _scan(self, state: FilterState, gain: FloatArray, first: int, measured: FloatArray) -> tuple[FilterState, FloatArray]:
        modes, result = np.array(state.modes), np.empty((measured.shape[0], 3, self.count))
        if self.count == 1:
            kalman_steps(*self._one_axis(), gain[:, 0], first, measured[:, 0], modes, result[:, :, 0])
        else:
            coupled_steps(*self._axes(), gain, first, measured, modes, result)
        return FilterState(state.count + measured.shape[0], modes), result

    def _ahead(self, lag: int, at: int | None) -> tuple[FloatArray, FloatArray]:
        """How later innovations covary with the forces of a sample [m N], and the inverses of their covariances; (lag, c, c) each."""
        last = self.gain.shape[0] - 1
        at = last if at is None else min(at, last)
        shown = np.empty((lag, self.count, self.count))
        for f in range(self.count):
            state = FilterState(0, -np.array(self.row[at, f]))
            shown[:, f] = self._scan(state, self.gain, at + 1, np.zeros((lag, self.count)))[1][:, 2]
        return shown, np.linalg.inv(self.variance)[np.minimum(at + 1 + np.arange(lag), last)]

    def _told(self, lag: int, at: int | None = None) -> FloatArray:
        """By how much each later innovation lessens the variance of each force of a sample, shape (lag, c) [N^2]."""
        shown, inverse = self._ahead(lag, at)
        return np.sum((shown @ inverse) * shown, axis=2)

    def _steady(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """A, H, the forces' rows and the gains (n, c) of the live real states, in metres and newtons."""
        a, seen, rows, _ = self.model.matrices()
        gain = self.gain[-1].transpose(2, 1, 0).reshape(-1, self.count)[self.model.live]
        return a, seen * self.model.noise[:, None], rows, gain

    def _axes(self) -> tuple[FloatArray, FloatArray, FloatArray, np.ndarray, FloatArray]:
        model = self.model
        decay, inputs = (np.stack([each.real, each.imag]) for each in (model.decay, model.inputs.T))
        observed = np.stack([model.observed.real, -model.observed.imag], axis=1)
        return decay, np.ascontiguousarray(inputs.transpose(1, 0, 2)), observed, np.array(model.ends), model.through

    def _one_axis(self) -> tuple[FloatArray, FloatArray, int, int, float]:
        decay, (observed,), (plants, end) = self.model.decay, self.model.observed, self.model.ends
        parts = np.stack([decay.real, decay.imag]), np.stack([observed.real, -observed.imag])
        return *parts, plants, end - plants, float(self.model.through[0, 0])


def kalman_filter(model: AugmentedModel, longest_settling: int = LONGEST_SETTLING) -> KalmanFilter:
    """Return the filter's gains: steady ones from the Riccati equation, before them those of the full covariance.

    `longest_settling`: steps of full covariance at most; they end where the gain is steady. 0 starts with the steady gain.
    Raises `InputError` if the Riccati equation has no stabilising solution: a force mode that no measurement shows.
    """
    a, seen, rows, q = model.matrices()
    steady = riccati(a, seen, q)
    gain, variance, covariance = _corrected(steady, seen)
    parts = [*_settling(model, steady, longest_settling), (gain, variance, covariance @ rows.T)]
    live, places, count = model.live, model.decay.size, model.noise.size

    def spread(columns: list[FloatArray]) -> FloatArray:
        full = np.zeros((len(columns), count, 2 * places))
        full[:, :, live] = np.transpose(columns, (0, 2, 1))
        return frozen(full.reshape(-1, count, places, 2).transpose(0, 1, 3, 2))

    across = [each for _, _, each in parts]
    return KalmanFilter(
        model,
        gain=spread([gain / model.noise for gain, _, _ in parts]),
        variance=frozen(np.array([variance for _, variance, _ in parts]) * np.outer(model.noise, model.noise)),
        row=spread(across),
        force_variance=frozen([np.einsum("fn,nf->f", rows, each) for each in across]),
    )


def riccati(a: FloatArray, seen: FloatArray, q: FloatArray) -> FloatArray:
    """Return the steady covariance before the correction, for measurements of unit noise, by structure-preserving doubling.

    Each step covers twice the samples of the last [chu2004]. Oscillators without damping have poles on the unit
    circle, where the ordered Schur form of the usual solution loses its order.

    `a`, `q`, shape (n, n); `seen`, shape (p, n)
    """
    size = 1.0 / np.maximum(np.sqrt(np.diag(q)), 1e-3 * np.sqrt(np.max(np.diag(q))))
    # in units of what each state gains in a step, so that none is lost beside another
    rows = seen / size
    transition, known, covariance = (a * size[:, None] / size).T, rows.T @ rows, q * np.outer(size, size)
    for _ in range(60):
        through = np.linalg.solve(np.eye(size.size) + known @ covariance, np.hstack([transition, known]))
        inner, outer = through[:, : size.size], through[:, size.size :]
        known = known + transition @ outer @ transition.T
        grown = covariance + transition.T @ covariance @ inner
        transition = transition @ inner
        change = np.linalg.norm(grown - covariance)
        covariance = 0.5 * (grown + grown.T)
        if not np.all(np.isfinite(covariance)):
            break
        if change <= 1e-14 * np.linalg.norm(covariance):
            return covariance / np.outer(size, size)
    raise InputError("force model", "no steady Kalman gain", "modes that are observable in the displacements, each driven by noise")


def _corrected(predicted: FloatArray, seen: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Gains (n, c), innovation covariance and covariance after the correction, in units of the measurements' noise."""
    shown = predicted @ seen.T
    variance = seen @ shown + np.eye(len(seen))
    gain = np.linalg.solve(variance, shown.T).T
    keep = np.eye(len(predicted)) - gain @ seen
    return gain, variance, keep @ predicted @ keep.T + gain @ gain.T


def _settling(model: AugmentedModel, steady: FloatArray, longest: int) -> list[tuple[FloatArray, FloatArray, FloatArray]]:
    """The first steps' gains, innovation covariances and the forces' covariance with the states, from filterpy's full covariance."""
    from filterpy.kalman import KalmanFilter as FullFilter

    a, seen, rows, q = model.matrices()
    target = _corrected(steady, seen)[0]
    full = FullFilter(dim_x=a.shape[0], dim_z=len(seen))
    full.F, full.H, full.Q, full.R, full.P = a, seen, q, np.eye(len(seen)), model.first_covariance()
    found, none = [], np.zeros(len(seen))
    for _ in range(longest):
        full.predict()
        full.update(none)
        gain = full.K.copy()
        if np.linalg.norm(gain - target) <= SETTLED * np.linalg.norm(target):
            break
        found.append((gain, full.S.copy(), full.P @ rows.T))
    return found
