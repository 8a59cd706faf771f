"""Modes of a whole machine whose spindle turns: bending planes that feel each other, and gyroscopic moments."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.shown import Shown
from rcsa_ident.base.units import to_rpm
from rcsa_ident.dynamics.coordinates import Coordinate
from rcsa_ident.dynamics.poles import PoleResidue, frequencies
from rcsa_ident.dynamics.receptance import Receptance

#: How far a matrix may be from symmetric, skew or passive, as a share of its size: rounding.
_ROUNDING = 1e-9
#: Condition number of the shapes beyond which two poles are about to become one, and how much more damping tells them apart.
_COINCIDING, _MORE_DAMPING = 1e9, 4e-6


@dataclass(frozen=True, eq=False, repr=False)
class TurningModes(Shown):
    """Modes at one spindle speed W, coupled by damping and by gyroscopic moments.

    H(w) = psi^T [K - w^2 I + i w (D + W G)]^-1 psi + R, K = diag(omega_n^2) + stiffness_change. It is not reciprocal:
    H(W)^T = H(-W). It takes energy at every frequency and speed as long as D and R are positive semidefinite and K is positive definite:
    skew G does no work.

    `omega_n` [rad/s], shape (m,): undamped natural frequencies of the spindle that does not turn
    `damping` [rad/s], shape (m, m): D, symmetric positive semidefinite
    `gyroscopic` [-], shape (m, m): G, skew: G_ij = integral of 2 rho I (y'_i x'_j - x'_i y'_j) over all that turns
    `psi` [1/sqrt(kg), 1/sqrt(kg m^2)], shape (m, d): mass-normalised shapes
    `residual` [m/N, rad/N, m/(N m), rad/(N m)], shape (d, d): static compliance of the modes above the band, symmetric positive
        semidefinite
    `speed` [rad/s]: W, positive where the spindle turns from +Y to +X, as a right-hand cutter does
    `coordinates`: tuple of Coordinate, length d
    `stiffness_change`: array, shape (m, m) [rad^2/s^2], default none; of a machine that softens with speed: symmetric, at this speed

    Examples
    --------
    A mode in X and one in Y at 1000 Hz, which the turning spindle splits by 2 %:

    >>> from rcsa_ident.dynamics.coordinates import Dof, plane
    >>> omega_n, flange = 2.0 * np.pi * np.array([1000.0, 1000.0]), (*plane("flange", Dof.X), *plane("flange", Dof.Y))
    >>> shapes = [[0.2, 1.0, 0.0, 0.0], [0.0, 0.0, 0.2, 1.0]]
    >>> damping, moments = np.diag(2.0 * 0.01 * omega_n), [[0.0, -0.06], [0.06, 0.0]]
    >>> modes = TurningModes(omega_n, damping, moments, shapes, np.zeros((4, 4)), 2000.0, flange)
    >>> (np.abs(modes.pole_residue().pole) / (2.0 * np.pi)).round().tolist()
    [990.0, 1010.0]
    """

    omega_n: FloatArray
    damping: FloatArray
    gyroscopic: FloatArray
    psi: FloatArray
    residual: FloatArray
    speed: float
    coordinates: tuple[Coordinate, ...]
    stiffness_change: FloatArray | None = None

    def __post_init__(self) -> None:
        names = ("omega_n", "damping", "gyroscopic", "psi", "residual", *(() if self.stiffness_change is None else ("stiffness_change",)))
        for name in names:
            object.__setattr__(self, name, frozen(getattr(self, name)))
            if not np.all(np.isfinite(getattr(self, name))):
                raise InputError(name, "values that are not finite", "finite values")
        m, d = self.omega_n.size, len(self.coordinates)
        shapes = {"damping": (m, m), "gyroscopic": (m, m), "psi": (m, d), "residual": (d, d), "stiffness_change": (m, m)}
        for name in names[1:]:
            if getattr(self, name).shape != shapes[name]:
                raise InputError(name, getattr(self, name).shape, f"shape {shapes[name]}")
        if not np.all(self.omega_n > 0.0):
            raise InputError("omega_n", self.omega_n.tolist(), "natural frequencies above 0 [rad/s]")
        if not np.isfinite(self.speed):
            raise InputError("speed", self.speed, "a finite spindle speed [rad/s]")
        for name in ("damping", "residual"):
            _semidefinite(name, getattr(self, name))
        if np.max(np.abs(self.gyroscopic + self.gyroscopic.T), initial=0.0) > _ROUNDING * np.max(np.abs(self.gyroscopic), initial=0.0):
            raise InputError("gyroscopic", self.gyroscopic.tolist(), "a skew matrix")
        if self._stiffness[0].min(initial=1.0) <= 0.0:
            raise InputError("stiffness_change", "one that leaves no stiffness", "a stiffness that stays positive definite")

    @property
    def stiffness(self) -> FloatArray:
        """K, shape (m, m) [rad^2/s^2]."""
        own = np.diag(self.omega_n**2)
        return own if self.stiffness_change is None else own + 0.5 * (self.stiffness_change + self.stiffness_change.T)

    @cached_property
    def _stiffness(self) -> tuple[FloatArray, FloatArray]:
        """Eigenvalues of K, and the shapes that go with them."""
        if self.stiffness_change is None:
            return self.omega_n**2, np.eye(self.omega_n.size)
        squares, turn = np.linalg.eigh(self.stiffness)
        return squares, turn

    @cached_property
    def _poles(self) -> PoleResidue:
        squares, turn = self._stiffness
        moments = self.speed * (turn.T @ self.gyroscopic @ turn)
        return gyroscopic_poles(np.sqrt(squares), turn.T @ self.damping @ turn, moments, turn.T @ self.psi, self.residual)

    def pole_residue(self) -> PoleResidue:
        """Return the same as poles and residues between all coordinates, left and right shapes apart."""
        return self._poles

    def receptance(self, omega: FloatArray) -> Receptance:
        """Return the receptance between all coordinates."""
        omega = frozen(omega)
        return Receptance(omega, self._poles.response(omega), self.coordinates, self.coordinates)

    def at(self, speed: float) -> TurningModes:
        """Return the same modes at another spindle speed [rad/s]; a softening stays what it is."""
        return replace(self, speed=speed)

    def to_control(self) -> Any:
        """Return the modes as python-control's ``StateSpace``: forces in, displacements out, both named after the coordinates."""
        names = [str(each) for each in self.coordinates]
        return self._poles.to_control(names, names)

    def __str__(self) -> str:
        turning = f"{to_rpm(self.speed):.0f} rev/min"
        return f"{', '.join(str(c) for c in self.coordinates)} at {turning}: {frequencies('modes', self.omega_n)}"


def gyroscopic_poles(natural: FloatArray, damping: FloatArray, moments: FloatArray, psi: FloatArray, residual: FloatArray) -> PoleResidue:
    """Return psi^T [diag(natural^2) - w^2 + i w (damping + moments)]^-1 psi + residual as poles, rising.

    `natural` [rad/s], shape (m,)
    `damping`, `moments` [rad/s], shape (m, m): symmetric and skew
    `psi` [1/sqrt(kg), 1/sqrt(kg m^2)], shape (m, d); `residual` [m/N, rad/N, m/(N m), rad/(N m)], shape (d, d)
    """
    value, right = _free_motions(natural, damping + moments)
    for _ in range(3):
        # two poles that are about to become one have a single shape: a few millionths more damping tell them apart
        if np.linalg.cond(right) < _COINCIDING:
            break
        damping = damping * (1.0 + _MORE_DAMPING)
        value, right = _free_motions(natural, damping + moments)
    m = natural.size
    force = np.zeros((2 * m, psi.shape[1]))
    force[m:] = psi
    inputs = np.linalg.solve(right, force)
    outputs = np.where(value.imag == 0.0, 0.5, 1.0) * ((psi / natural[:, None]).T @ right[:m])
    kept = np.flatnonzero(value.imag >= 0.0)
    order = kept[np.argsort(np.abs(value[kept]), kind="stable")]
    return PoleResidue(value[order], outputs[:, order], inputs[order], residual)


def _free_motions(natural: FloatArray, velocity: FloatArray) -> tuple[ComplexArray, ComplexArray]:
    """Poles s and shapes (natural q, s q) of (s^2 + s velocity + diag(natural^2)) q = 0."""
    m = natural.size
    state = np.zeros((2 * m, 2 * m))
    state[:m, m:], state[m:, :m], state[m:, m:] = np.diag(natural), -np.diag(natural), -velocity
    value, right = np.linalg.eig(state)
    return value.astype(complex), right.astype(complex)


def _semidefinite(name: str, matrix: FloatArray) -> None:
    """Refuse a matrix that is not symmetric or has a negative eigenvalue, beyond rounding and whatever its units are."""
    scale = np.sqrt(np.abs(np.diag(matrix)))
    scale = np.where(scale > 0.0, scale, 1.0)
    alike = matrix / np.outer(scale, scale)
    size = np.max(np.abs(alike), initial=0.0)
    if np.max(np.abs(alike - alike.T), initial=0.0) > _ROUNDING * size:
        raise InputError(name, matrix.tolist(), "a symmetric matrix")
    if np.min(np.linalg.eigvalsh(alike), initial=0.0) < -_ROUNDING * size:
        raise InputError(name, matrix.tolist(), "a positive semidefinite matrix: it may not feed in energy")
