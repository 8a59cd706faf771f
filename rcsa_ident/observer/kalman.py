"""Kalman filter [kalman1960] of the augmented state {q, f} ([inprocess], eq. 17): settling, steady, streaming, fixed lag, smoothing."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rcsa_ident.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.dynamics.state_space import StateSpace
from rcsa_ident.errors import InputError
from rcsa_ident.observer._kernels import kalman_steps, lagged_force, smoothed_force
from rcsa_ident.observer.force_model import AugmentedModel

#: Relative distance of a gain from its steady value at which the settling phase ends, and its longest duration in steps.
SETTLED, LONGEST_SETTLING = 1e-6, 1000


@dataclass(frozen=True, slots=True, eq=False)
class FilterState:
    """Where a stream stands.

    Parameters
    ----------
    count : int
        Samples seen.
    modes : array, shape (2, m)
    waiting : array, shape (w, 3)
        Results that a fixed lag still holds back.
    """

    count: int
    modes: FloatArray
    waiting: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class KalmanFilter:
    """Gains of one axis: a settling phase of full covariance, then the steady state.

    Parameters
    ----------
    model : AugmentedModel
    gain : array, shape (s, 2, m)
        The last is the steady one.
    variance : array, shape (s,) [m^2]
        Variance of the innovation.
    row : array, shape (s, 2, m)
        Covariance of the force with the state after the correction.
    force_variance : array, shape (s,) [N^2]
        Variance of the force after the correction.
    """

    model: AugmentedModel
    gain: FloatArray
    variance: FloatArray
    row: FloatArray
    force_variance: FloatArray

    def init(self) -> FilterState:
        """Return the state before the first sample."""
        return FilterState(0, np.zeros((2, self.model.decay.size)), np.zeros((0, 3)))

    def step(self, state: FilterState, measured: float) -> tuple[FilterState, FloatArray]:
        """Return the state and (force, its walking part, innovation) after one sample."""
        state, result = self.run(state, np.array([measured]))
        return state, result[0]

    def run(self, state: FilterState, measured: FloatArray) -> tuple[FilterState, FloatArray]:
        """Return the state after a block, and force [N], its walking part [N] and innovation [m] at its samples, shape (n, 3)."""
        modes, measured = np.array(state.modes), np.ascontiguousarray(measured, dtype=float)
        result = np.empty((measured.size, 3))
        kalman_steps(*self._arrays(), self.gain, state.count, measured, modes, result)
        return FilterState(state.count + measured.size, modes, state.waiting), result

    def predict(self, state: FilterState, count: int) -> tuple[FilterState, FloatArray]:
        """Return the state after samples that nobody has measured, and the same at them as `run`, innovations 0, shape (n, 3)."""
        modes, result = np.array(state.modes), np.empty((count, 3))
        # an innovation that corrects nothing
        still = frozen(np.zeros((1, *modes.shape)))
        kalman_steps(*self._arrays(), still, 0, np.zeros(count), modes, result)
        result[:, 2] = 0.0
        return FilterState(state.count + count, modes, state.waiting), result

    def run_lagged(self, state: FilterState, measured: FloatArray, weight: FloatArray) -> tuple[FilterState, FloatArray]:
        """Return the state after a block, and the force `weight.size` samples before each sample, as far as there is one.

        Parameters
        ----------
        state : FilterState
        measured : array, shape (n,) [m]
        weight : array, shape (lag,) [N/m]
            As `lag_weights` gives them.

        Returns
        -------
        FilterState and array, shape (k,) [N]
            In the first block the lag is missing: k = n - lag; later ones are complete.
        """
        state, result = self.run(state, measured)
        joined = np.concatenate([state.waiting, result])
        force = lagged_force(weight, np.ascontiguousarray(joined[:, 2]), np.ascontiguousarray(joined[:, 0]))
        return replace(state, waiting=joined[force.size :]), force

    def smooth(self, result: FloatArray) -> FloatArray:
        """Return the force given the whole record, shape (n,) [N]; `result` is that of `run` from the first sample on.

        The fixed-interval smoother of Rauch, Tung and Striebel [rauch1965] in the form of Bryson and Frazier [bryson1963], which needs no
        inverse of a covariance and costs as little as the filter.
        """
        force, innovation = (np.ascontiguousarray(result[:, c]) for c in (0, 2))
        return smoothed_force(*self._arrays(), self.gain, self.variance, self.row, innovation, force)

    def lag_weights(self, lag: int, at: int | None = None) -> FloatArray:
        """Return what each later innovation adds to the estimate of a sample, shape (lag,) [N/m].

        Parameters
        ----------
        lag : int
            Number of later innovations.
        at : int, optional
            Number of the sample in the settling phase; by default one of the steady state.
        """
        at = self.gain.shape[0] - 1 if at is None else min(at, self.gain.shape[0] - 1)
        modes, result = -np.array(self.row[at]), np.empty((lag, 3))
        kalman_steps(*self._arrays(), self.gain, at + 1, np.zeros(lag), modes, result)
        return result[:, 2] / self.variance[np.minimum(at + 1 + np.arange(lag), self.gain.shape[0] - 1)]

    def standard_deviation(self, count: int, smoothed: bool = False, longest: int = 4096) -> FloatArray:
        """Return the force's standard deviation at `count` samples from the first, given those before or all, shape (count,) [N].

        Parameters
        ----------
        count : int
        smoothed : bool
            Given all samples; else given those before.
        longest : int
            How far a sample looks ahead.
        """
        place = np.minimum(np.arange(count), self.gain.shape[0] - 1)
        variance = self.force_variance[place]
        if smoothed:
            steady = self.lag_weights(min(longest, count)) ** 2 * self.variance[-1]
            told = np.concatenate([[0.0], np.cumsum(steady)])
            gained = told[np.minimum(np.arange(count)[::-1], told.size - 1)]
            for k in range(min(self.gain.shape[0] - 1, count)):
                ahead = min(longest, count - 1 - k)
                later = np.minimum(k + 1 + np.arange(ahead), self.gain.shape[0] - 1)
                gained[k] = np.sum(self.lag_weights(ahead, k) ** 2 * self.variance[later])
            variance = variance - gained
        return np.sqrt(np.maximum(variance, 0.0))

    def response(self, omega: FloatArray, lag: int = 0) -> tuple[ComplexArray, ComplexArray]:
        """Return the observer's frequency response in the steady state, measured displacement to force, shape (n,) [N/m].

        Parameters
        ----------
        omega : array, shape (n,) [rad/s]
        lag : int
            With a fixed lag, the delay by it taken out; a long one stands for the smoother.

        Returns
        -------
        complex arrays, shape (n,)
            Displacement to force, displacement to innovation.
        """
        a, seen, row, gain = self._steady()
        back = np.exp(-1j * np.asarray(omega, dtype=float) * self.model.step)
        closed = a - np.outer(gain, seen @ a)
        states = np.linalg.solve(np.eye(row.size) - back[:, None, None] * closed, np.broadcast_to(gain[:, None], (back.size, row.size, 1)))
        force = states[:, :, 0] @ row
        innovation = 1.0 - back * (states[:, :, 0] @ (seen @ a))
        if lag:
            ahead = back[:, None] ** -np.arange(1.0, lag + 1.0)
            force = force + innovation * (ahead @ self.lag_weights(lag))
        return force, innovation

    def state_space(self) -> StateSpace:
        """Return the filter in the steady state: measured displacement [m] in, force [N] and innovation [m] out.

        Its poles are those of the estimate's error.
        """
        a, seen, row, gain = self._steady()
        closed = a - np.outer(gain, seen @ a)
        outputs = np.stack([row @ closed, -(seen @ a)])
        return StateSpace(closed, gain[:, None], outputs, np.array([[row @ gain], [1.0]]), self.model.step)

    def loop(self) -> StateSpace:
        """Return the innovation loop, cut open: innovation [m] in, the displacement predicted from past corrections [m] out.

        L(z) = H (z I - A)^-1 A K; the innovation is S = 1 / (1 + L) times the measured displacement.
        """
        a, seen, _, gain = self._steady()
        return StateSpace(a, (a @ gain)[:, None], seen[None], np.zeros((1, 1)), self.model.step)

    def _steady(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """A, H, the force's row and the gain of the live real states, in metres and newtons."""
        a, seen, row, _ = self.model.matrices()
        return a, seen * self.model.noise, row, self.gain[-1].T.ravel()[self.model.live]

    def _arrays(self) -> tuple[FloatArray, FloatArray, int, int, float]:
        model = self.model
        decay = np.stack([model.decay.real, model.decay.imag])
        return decay, np.stack([model.observed.real, -model.observed.imag]), *model.counts, model.through


def kalman_filter(model: AugmentedModel, longest_settling: int = LONGEST_SETTLING) -> KalmanFilter:
    """Return the filter's gains: steady ones from the Riccati equation, before them those of the full covariance.

    Parameters
    ----------
    model : AugmentedModel
    longest_settling : int
        Steps of full covariance at most; they end where the gain is steady. 0 starts with the steady gain.

    Raises
    ------
    InputError
        If the Riccati equation has no stabilising solution: a force mode that the measurement does not show.
    """
    a, seen, row, q = model.matrices()
    steady = riccati(a, seen, q)
    live, places = model.live, model.decay.size
    parts = [*_settling(model, steady, longest_settling), _corrected(steady, seen)]

    def spread(vectors: list[FloatArray]) -> FloatArray:
        full = np.zeros((len(vectors), 2 * places))
        full[:, live] = vectors
        return frozen(full.reshape(-1, places, 2).transpose(0, 2, 1))

    gain, variance, covariance = [p[0] for p in parts], [p[1] for p in parts], [p[2] for p in parts]
    rows = [p @ row for p in covariance]
    return KalmanFilter(
        model,
        gain=spread([g / model.noise for g in gain]),
        variance=frozen(np.array(variance) * model.noise**2),
        row=spread(rows),
        force_variance=frozen([row @ r for r in rows]),
    )


def riccati(a: FloatArray, seen: FloatArray, q: FloatArray) -> FloatArray:
    """Return the steady covariance before the correction, for measurements of unit noise, by structure-preserving doubling.

    Each step covers twice the samples of the last [chu2004]. Oscillators without damping have poles on the unit
    circle, where the ordered Schur form of the usual solution loses its order.

    Parameters
    ----------
    a, q : arrays, shape (n, n)
    seen : array, shape (n,) or (p, n)
    """
    size = 1.0 / np.maximum(np.sqrt(np.diag(q)), 1e-3 * np.sqrt(np.max(np.diag(q))))
    # in units of what each state gains in a step, so that none is lost beside another
    rows = np.atleast_2d(seen) / size
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
    raise InputError("force model", "no steady Kalman gain", "modes that are observable in the displacement, each driven by noise")


def _corrected(predicted: FloatArray, seen: FloatArray) -> tuple[FloatArray, float, FloatArray]:
    """Gain, innovation variance and covariance after the correction, in units of the measurement's noise."""
    variance = float(seen @ predicted @ seen) + 1.0
    gain = predicted @ seen / variance
    keep = np.eye(seen.size) - np.outer(gain, seen)
    return gain, variance, keep @ predicted @ keep.T + np.outer(gain, gain)


def _settling(model: AugmentedModel, steady: FloatArray, longest: int) -> list[tuple[FloatArray, float, FloatArray]]:
    """The first steps' gains, innovation variances and covariances, from filterpy's filter with its full covariance."""
    from filterpy.kalman import KalmanFilter as FullFilter

    a, seen, _, q = model.matrices()
    target = _corrected(steady, seen)[0]
    full = FullFilter(dim_x=a.shape[0], dim_z=1)
    full.F, full.H, full.Q, full.R, full.P = a, seen[None], q, np.eye(1), model.first_covariance()
    found = []
    for _ in range(longest):
        full.predict()
        full.update(0.0)
        gain = full.K[:, 0].copy()
        if np.linalg.norm(gain - target) <= SETTLED * np.linalg.norm(target):
            break
        found.append((gain, float(full.S[0, 0]), full.P.copy()))
    return found
