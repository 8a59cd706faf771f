"""Linear systems in state space, in continuous time or sampled; the door to python-control."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.base.errors import InputError


@dataclass(frozen=True, slots=True, eq=False)
class StateSpace:
    """x' = A x + B u (or x[k+1] where sampled), y = C x + D u.

    Parameters
    ----------
    A : array, shape (n, n)
    B : array, shape (n, i)
    C : array, shape (o, n)
    D : array, shape (o, i)
    step : float [s]
        Time between samples; 0 in continuous time.

    Examples
    --------
    >>> lag = StateSpace([[-2.0]], [[2.0]], [[1.0]], [[0.0]])
    >>> abs(lag.response([2.0])).round(4).item()
    0.7071
    """

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: FloatArray
    step: float = 0.0

    def __post_init__(self) -> None:
        for name in ("A", "B", "C", "D"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        n, inputs, outputs = len(self.A), self.B.shape[-1], len(self.C)
        for name, shape in (("A", (n, n)), ("B", (n, inputs)), ("C", (outputs, n)), ("D", (outputs, inputs))):
            if getattr(self, name).shape != shape:
                raise InputError(f"state space {name}", getattr(self, name).shape, f"shape {shape}")

    @property
    def order(self) -> int:
        """Number of states."""
        return self.A.shape[0]

    @property
    def pole(self) -> ComplexArray:
        """Eigenvalues of A, shape (n,) [rad/s], or [-] where sampled."""
        return np.linalg.eigvals(self.A).astype(complex)

    @property
    def stable(self) -> bool:
        """Whether every free motion dies out."""
        return bool(np.all(np.abs(self.pole) < 1.0) if self.step else np.all(self.pole.real < 0.0))

    def response(self, omega: FloatArray) -> ComplexArray:
        """Return outputs per input over frequency, shape (n, o, i).

        Parameters
        ----------
        omega : array, shape (n,) [rad/s]
        """
        omega = np.asarray(omega, dtype=float)
        point = np.exp(1j * omega * self.step) if self.step else 1j * omega
        return self.C @ np.linalg.solve(point[:, None, None] * np.eye(self.order) - self.A, self.B) + self.D

    @classmethod
    def from_control(cls, system: Any) -> StateSpace:
        """Return a linear system of python-control: a state space, or a transfer function of one input and one output.

        Raises
        ------
        InputError
            If it is sampled, and nobody knows how fast.
        """
        import control

        if system.dt is True:
            raise InputError("dt", "not known", "0, or the time between samples [s]")
        found = control.ss(system)
        return cls(found.A, found.B, found.C, found.D, float(found.dt or 0.0))

    def to_control(self, inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None) -> Any:
        """Return the system as python-control's ``StateSpace``, for its feedback, its plots and its design methods.

        Parameters
        ----------
        inputs, outputs : sequence of str, optional
            Names of the signals; a dot becomes an underscore, since python-control reserves it.

        Examples
        --------
        >>> import rcsa_ident as ri
        >>> modes = ri.normal_modes([ri.hz(900.0), ri.hz(1500.0)], [0.02, 0.03], [[5.0], [4.0]], (ri.Coordinate("tip", ri.Dof.Y),))
        >>> modes.pole_residue().state_space().to_control().nstates
        4
        """
        import control

        names = {
            key: [name.replace(".", "_") for name in given]
            for key, given in (("inputs", inputs), ("outputs", outputs))
            if given is not None
        }
        return control.ss(self.A, self.B, self.C, self.D, self.step, **names)
