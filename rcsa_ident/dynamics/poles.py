"""Poles and residues: what modal methods compute with, whether modes, a fit or a state space gave them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.shown import Shown
from rcsa_ident.base.units import to_hz
from rcsa_ident.dynamics import _kernels
from rcsa_ident.dynamics.state_space import StateSpace

#: Condition number of the eigenvectors beyond which poles are taken to coincide.
_COINCIDING = 1e12


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PoleResidue(Shown):
    """A linear system with real coefficients as a sum over its poles, each with a residue of rank one.

    H(s) = sum_k outputs_k inputs_k / (s - pole_k) + conj(outputs_k inputs_k) / (s - conj(pole_k)) + constant

    Parameters
    ----------
    pole : complex array, shape (m,) [rad/s]
        One of each conjugate pair, imaginary parts not negative; a real pole stands with half its residue, so that the sum holds
        for it, too (as in `ModalModel`). A residue of higher rank is several terms with the same pole.
    outputs : complex array, shape (r, m)
    inputs : complex array, shape (m, c)
    constant : array, shape (r, c)
        The direct term; of a receptance the residual compliance of modes beyond the band [m/N].

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> modes = ri.normal_modes([ri.hz(900.0), ri.hz(1500.0)], [0.02, 0.03], [[5.0], [4.0]], (ri.Coordinate("tip", ri.Dof.Y),))
    >>> poles = modes.pole_residue()
    >>> poles.pole.size, poles.response(ri.hz(800.0, 1000.0, 100.0)).shape
    (2, (3, 1, 1))
    """

    pole: ComplexArray
    outputs: ComplexArray
    inputs: ComplexArray
    constant: FloatArray

    def __post_init__(self) -> None:
        for name, dtype in (("pole", complex), ("outputs", complex), ("inputs", complex), ("constant", float)):
            object.__setattr__(self, name, frozen(getattr(self, name), dtype))
        m = self.pole.size
        r, c = self.constant.shape if self.constant.ndim == 2 else (len(self.outputs), self.inputs.shape[-1])
        for name, shape in (("pole", (m,)), ("outputs", (r, m)), ("inputs", (m, c)), ("constant", (r, c))):
            if getattr(self, name).shape != shape:
                raise InputError(name, getattr(self, name).shape, f"shape {shape}")
            if not np.all(np.isfinite(getattr(self, name))):
                raise InputError(name, "values that are not finite", "finite values")

    def __str__(self) -> str:
        return frequencies("poles", np.abs(self.pole))

    @classmethod
    def joined(cls, parts: Sequence[PoleResidue]) -> Self:
        """Return the sum of systems between the same inputs and outputs."""
        return cls(
            np.concatenate([part.pole for part in parts]),
            np.concatenate([part.outputs for part in parts], axis=1),
            np.concatenate([part.inputs for part in parts]),
            np.sum([part.constant for part in parts], axis=0),
        )

    @classmethod
    def from_state_space(cls, system: StateSpace) -> Self:
        """Return the poles and residues of a state space in continuous time.

        Raises
        ------
        InputError
            If it is sampled, or poles coincide and share their shape: such a pole has no residue of its own.
        """
        if system.step:
            raise InputError("step", f"{system.step:g} s", "0: a system in continuous time")
        pole, shapes = np.linalg.eig(system.A)
        if system.order and np.linalg.cond(shapes) > _COINCIDING:
            raise InputError("poles", pole.tolist(), "poles that differ")
        outputs, inputs = system.C @ shapes, np.linalg.solve(shapes, system.B)
        outputs = np.where(pole.imag == 0.0, 0.5, 1.0) * outputs
        upper = pole.imag >= 0.0
        return cls(pole[upper], outputs[:, upper], inputs[upper], system.D)

    @classmethod
    def from_control(cls, system: Any) -> Self:
        """Return the poles and residues of a system of python-control in continuous time."""
        return cls.from_state_space(StateSpace.from_control(system))

    def projected(self, left: FloatArray, right: FloatArray) -> PoleResidue:
        """Return left H right: the system between other inputs and outputs, which are linear combinations of its own."""
        return PoleResidue(self.pole, left @ self.outputs, self.inputs @ right, left @ self.constant @ right)

    def response(self, omega: FloatArray) -> ComplexArray:
        """Return H over frequency, shape (n, r, c).

        Parameters
        ----------
        omega : array, shape (n,) [rad/s]
        """
        residue = np.einsum("rm,mc->mrc", self.outputs, self.inputs)
        return pair_sum(omega, self.pole, residue) + self.constant

    def state_space(self) -> StateSpace:
        """Return the real state space in modal form: two states for each pair of poles, one for a real pole."""
        m, (r, c) = self.pole.size, self.constant.shape
        k, real, imaginary = np.arange(m), self.pole.real, self.pole.imag
        # z' = pole z + v f, y = 2 Re(u z) in the real and imaginary part of z
        moved, driven = np.zeros((m, 2, m, 2)), np.stack([self.inputs.real, self.inputs.imag], axis=1)
        moved[k, 0, k, 0], moved[k, 0, k, 1], moved[k, 1, k, 0], moved[k, 1, k, 1] = real, -imaginary, imaginary, real
        seen = 2.0 * np.stack([self.outputs.real, -self.outputs.imag], axis=2)
        # the parts of a real pole do not meet: one that is not driven, or not seen, is none
        live = ((imaginary != 0.0)[:, None] | (np.any(driven, axis=2) & np.any(seen, axis=0))).ravel()
        a, b, output = moved.reshape(2 * m, 2 * m)[np.ix_(live, live)], driven.reshape(2 * m, c)[live], seen.reshape(r, 2 * m)[:, live]
        return StateSpace(a, b, output, self.constant)

    def to_control(self, inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None) -> Any:
        """Return the system as python-control's ``StateSpace``, in real modal form; see `StateSpace.to_control`.

        Examples
        --------
        >>> import rcsa_ident as ri
        >>> modes = ri.normal_modes([ri.hz(900.0), ri.hz(1500.0)], [0.02, 0.03], [[5.0], [4.0]], (ri.Coordinate("tip", ri.Dof.Y),))
        >>> modes.pole_residue().to_control().nstates
        4
        """
        return self.state_space().to_control(inputs, outputs)


def pole_sum(omega: FloatArray, pole: ComplexArray, residue: ComplexArray) -> ComplexArray:
    """Return sum_k residue_k / (i omega - pole_k), shape (n, g), of residues of shape (m, g)."""
    found: ComplexArray = _kernels.pole_sum(frozen(omega), frozen(pole, complex), np.ascontiguousarray(residue))
    return found


def pair_sum(omega: FloatArray, pole: ComplexArray, residue: ComplexArray) -> ComplexArray:
    """Return sum_k residue_k / (i omega - pole_k) + conj(residue_k) / (i omega - conj(pole_k)), shape (n, r, c).

    `omega` [rad/s], shape (n,); `pole` [rad/s], shape (m,); `residue`, shape (m, r, c)
    """
    m, r, c = residue.shape
    flat = residue.reshape(m, r * c)
    return pole_sum(omega, np.concatenate([pole, pole.conj()]), np.concatenate([flat, flat.conj()])).reshape(-1, r, c)


def frequencies(what: str, omega: FloatArray, most: int = 8) -> str:
    """Return a line about natural frequencies [rad/s], rising; of many the first ones and the last."""
    named = [f"{frequency:.0f}" for frequency in np.sort(to_hz(omega))]
    shown = named if len(named) <= most else [*named[: most - 1], "...", named[-1]]
    return f"{len(named)} {what if len(named) != 1 else what.removesuffix('s')} at {', '.join(shown)} Hz"
