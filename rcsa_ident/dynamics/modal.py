"""Modes: poles with shapes at named coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.shown import Shown
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.poles import PoleResidue, frequencies, pair_sum, pole_sum
from rcsa_ident.dynamics.receptance import Receptance

_FREQUENCIES = "finite natural frequencies above 0 [rad/s]"


@dataclass(frozen=True, slots=True, eq=False)
class PoleModel:
    """Receptance as sum of outputs inputs / (i omega - pole), for omega > 0.

    Parameters
    ----------
    pole : complex array, shape (m,) [rad/s]
    outputs : complex array, shape (p, m)
    inputs : complex array, shape (m, p)
    coordinates : tuple of Coordinate, length p

    Notes
    -----
    With material loss factors the poles do not come in conjugate pairs: the loss factor's sign belongs to positive
    frequencies.
    """

    pole: ComplexArray
    outputs: ComplexArray
    inputs: ComplexArray
    coordinates: tuple[Coordinate, ...]

    def __post_init__(self) -> None:
        for name in ("pole", "outputs", "inputs"):
            object.__setattr__(self, name, frozen(getattr(self, name), np.complex128))

    def receptance(self, omega: FloatArray) -> Receptance:
        """Return the receptance between all coordinates; cost about 8 p^2 m n flops."""
        omega = frozen(omega)
        p, m = self.outputs.shape
        residues = np.einsum("pk,kq->kpq", self.outputs, self.inputs).reshape(m, p * p)
        values = pole_sum(omega, self.pole, residues).reshape(omega.size, p, p)
        return Receptance(omega, values, self.coordinates, self.coordinates)

    def entries(self, omega: FloatArray, places: Sequence[tuple[int, int]]) -> ComplexArray:
        """Return some of the receptance's entries (row, column), shape (g, n): for those who need a few of all."""
        rows, columns = np.array(places).T
        # the very products that `receptance` makes: near-rigid poles come in pairs that cancel to seven digits
        residues = np.einsum("pk,kq->kpq", self.outputs, self.inputs)[:, rows, columns]
        return pole_sum(omega, self.pole, residues).T


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ModalModel(Shown):
    """Complex modes and a residual compliance ([inprocess], eq. 13, plus the modes above the band).

    h_pq = sum_n phi_pn phi_qn / (i omega - lambda_n) + conj(phi_pn phi_qn) / (i omega - conj(lambda_n)) + R_pq,
    lambda_n = -zeta_n omega_n + i omega_n sqrt(1 - zeta_n^2).

    Parameters
    ----------
    omega_n : array, shape (m,) [rad/s]
    zeta : array, shape (m,) [-]
        Damping ratios in (0, 1]; at 1 the pole is real and the pair coincides.
    phi : complex array, shape (m, d) [sqrt(s/kg), sqrt(s/(kg m^2))]
        A normal mode with mass-normalised shape psi has phi = psi (1 - i) / (2 sqrt(omega_d)).
    residual : array, shape (d, d) [m/N, rad/N, m/(N m), rad/(N m)]
        Symmetric; positive semidefinite where the model is passive.
    coordinates : tuple of Coordinate, length d

    Examples
    --------
    `normal_modes` makes the complex shapes of ordinary, mass-normalised ones:

    >>> from rcsa_ident.dynamics.coordinates import plane
    >>> modes = normal_modes([5000.0], [0.03], [[0.7, 4.0]], plane("flange"))
    >>> modes.phi.shape, modes.pole.round(1).tolist()
    ((1, 2), [(-150+4997.7j)])
    """

    omega_n: FloatArray
    zeta: FloatArray
    phi: ComplexArray
    residual: FloatArray
    coordinates: tuple[Coordinate, ...]

    def __post_init__(self) -> None:
        for name, dtype in (("omega_n", float), ("zeta", float), ("phi", complex), ("residual", float)):
            object.__setattr__(self, name, frozen(getattr(self, name), dtype))
        m, d = self.omega_n.size, len(self.coordinates)
        if self.phi.shape != (m, d):
            raise InputError("phi", self.phi.shape, f"shape {(m, d)}: modes, coordinates")
        if self.residual.shape != (d, d):
            raise InputError("residual", self.residual.shape, f"shape {(d, d)}")
        if not np.all(np.isfinite(self.omega_n) & (self.omega_n > 0.0)):
            raise InputError("omega_n", self.omega_n.tolist(), _FREQUENCIES)
        if self.zeta.shape != (m,) or not np.all((self.zeta > 0.0) & (self.zeta <= 1.0)):
            raise InputError("zeta", self.zeta.tolist(), f"{m} damping ratios above 0 and not above 1")

    @property
    def pole(self) -> ComplexArray:
        """Poles with non-negative imaginary part, shape (m,) [rad/s]."""
        return -self.zeta * self.omega_n + 1j * self.omega_n * np.sqrt(1.0 - self.zeta**2)

    def receptance(self, omega: FloatArray) -> Receptance:
        """Return the receptance between all coordinates.

        Examples
        --------
        >>> import rcsa_ident as ri
        >>> mode = ri.normal_modes([ri.hz(900.0)], [0.02], [[5.0]], (ri.Coordinate("tip", ri.Dof.Y),))
        >>> mode.receptance(ri.hz(800.0, 1000.0, 100.0)).values.shape
        (3, 1, 1)
        """
        values = pair_sum(omega, self.pole, np.einsum("mp,mq->mpq", self.phi, self.phi)) + self.residual
        return Receptance(omega, values, self.coordinates, self.coordinates)

    def pole_residue(self) -> PoleResidue:
        """Return the same as poles and residues between all coordinates.

        Examples
        --------
        >>> import rcsa_ident as ri
        >>> import numpy as np
        >>> modes = ri.normal_modes([ri.hz(900.0), ri.hz(1500.0)], [0.02, 0.03], [[5.0], [4.0]], (ri.Coordinate("tip", ri.Dof.Y),))
        >>> omega = ri.hz(800.0, 1000.0, 100.0)
        >>> bool(np.allclose(modes.pole_residue().response(omega), modes.receptance(omega).values))
        True
        """
        return PoleResidue(self.pole, self.phi.T, self.phi, self.residual)

    def to_control(self) -> Any:
        """Return the model as python-control's ``StateSpace``: forces in, displacements out, both named after the coordinates.

        Examples
        --------
        >>> import rcsa_ident as ri
        >>> mode = ri.normal_modes([ri.hz(900.0)], [0.02], [[5.0]], (ri.Coordinate("tip", ri.Dof.Y),))
        >>> system = mode.to_control()
        >>> system.nstates, system.input_labels
        (2, ['tip_y'])
        """
        names = [str(each) for each in self.coordinates]
        return self.pole_residue().to_control(names, names)

    def __str__(self) -> str:
        return f"{', '.join(str(c) for c in self.coordinates)}: {frequencies('modes', self.omega_n)}"


def normal_modes(
    omega_n: FloatArray, zeta: FloatArray, psi: FloatArray, coordinates: tuple[Coordinate, ...], residual: FloatArray | None = None
) -> ModalModel:
    """Return the modal model of proportionally damped modes.

    Parameters
    ----------
    omega_n : array, shape (m,) [rad/s]
    zeta : array, shape (m,) [-], below 1
    psi : array, shape (m, d) [1/sqrt(kg), 1/sqrt(kg m^2)]
        Mass-normalised shapes.
    coordinates : tuple of Coordinate, length d
    residual : array, shape (d, d), optional [m/N, rad/N, m/(N m), rad/(N m)]
        Static compliance of the modes above the band; by default none.

    Examples
    --------
    A mode of 800 Hz, 3 % damping and a modal mass of 2 kg, that is a stiffness of 50.5 N/um:

    >>> from rcsa_ident.dynamics.coordinates import Coordinate
    >>> omega_n = 2 * np.pi * 800.0
    >>> modes = normal_modes([omega_n], [0.03], [[1 / np.sqrt(2.0)]], (Coordinate.parse("tip.x"),))
    >>> h = modes.receptance([1.0, omega_n]).between("tip.x", "tip.x")
    >>> [f"{value:.3g} m/N" for value in abs(h)]
    ['1.98e-08 m/N', '3.3e-07 m/N']
    """
    omega_n, zeta, psi = (np.asarray(a, dtype=float) for a in (omega_n, zeta, psi))
    if not np.all((zeta > 0.0) & (zeta < 1.0)):
        raise InputError("zeta", zeta.tolist(), "damping ratios above 0 and below 1")
    if not np.all(np.isfinite(omega_n) & (omega_n > 0.0)):
        raise InputError("omega_n", omega_n.tolist(), _FREQUENCIES)
    omega_d = omega_n * np.sqrt(1.0 - zeta**2)
    phi = psi * ((1.0 - 1.0j) / (2.0 * np.sqrt(omega_d)))[:, None]
    d = len(coordinates)
    return ModalModel(omega_n, zeta, phi, np.zeros((d, d)) if residual is None else residual, coordinates)


def damped_modes(
    omega_n: FloatArray, damping: FloatArray, psi: FloatArray, residual: FloatArray, coordinates: tuple[Coordinate, ...]
) -> ModalModel:
    """Return the complex modes of real modes coupled by a full damping matrix.

    Solves q'' + D q' + diag(omega_n^2) q = psi f, w = psi^T q, exactly; a real pole becomes a mode with zeta = 1 and
    half its residue, so that the pair of poles sums to it.

    `omega_n` [rad/s], shape (m,)
    `damping` [rad/s], shape (m, m): symmetric positive semidefinite
    `psi` [1/sqrt(kg), 1/sqrt(kg m^2)], shape (m, d): mass-normalised shapes
    `residual` [m/N, rad/N, m/(N m), rad/(N m)], shape (d, d): static compliance of the modes above the band
    `coordinates`: tuple of Coordinate, length d
    """
    values, q, norm = _free_motions(omega_n, damping)
    # where a pair of poles is about to become real it has no two shapes: a few millionths more damping tell it apart
    for _ in range(3):
        if np.all(np.abs(norm) > 1e-3 * np.abs(values) * np.einsum("ik,ik->k", q, q.conj()).real):
            break
        damping = damping * (1.0 + 4e-6)
        values, q, norm = _free_motions(omega_n, damping)
    shapes = (psi.T @ q) / np.sqrt(norm)
    tolerance = 1e-9 * np.abs(values)
    pairs = values.imag > tolerance
    real = np.abs(values.imag) <= tolerance
    lam = np.concatenate([values[pairs], values[real].real.astype(complex)])
    phi = np.concatenate([shapes.T[pairs], shapes.T[real] / np.sqrt(2.0)])
    frequency = np.abs(lam)
    order = np.argsort(frequency, kind="stable")
    zeta = np.clip(-lam.real / frequency, 1e-9, 1.0)
    return ModalModel(frequency[order], zeta[order], phi[order], residual, coordinates)


def _free_motions(omega_n: FloatArray, damping: FloatArray) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Poles s and shapes q of (s^2 + s D + diag(omega_n^2)) q = 0, with q^T (2 s + D) q."""
    m = omega_n.size
    state = np.zeros((2 * m, 2 * m))
    state[:m, m:] = np.eye(m)
    state[m:, :m] = -np.diag(omega_n**2)
    state[m:, m:] = -damping
    values, right = np.linalg.eig(state)
    # left vectors of this companion form follow from the right ones: q^T [s + D, 1], with q^T (2 s + D) q as norm
    q = right[:m]
    norm = np.einsum("ik,ik->k", q, 2.0 * values * q + damping @ q)
    return values.astype(complex), q.astype(complex), norm.astype(complex)


def directions(modes: ModalModel) -> FloatArray:
    """Return the angles from +X of the lines along which modes of both planes move, above -90 and up to 90 degrees, shape (m,) [rad].

    A mode that moves round an ellipse has the direction of its longer axis.
    """
    x, y = (modes.phi[:, [c.dof for c in modes.coordinates].index(axis)] for axis in (Dof.X, Dof.Y))
    # the phase that makes a shape as real as it can be
    turn = np.exp(-0.5j * np.angle(x**2 + y**2))
    angle = np.arctan2((y * turn).real, (x * turn).real)
    found: FloatArray = angle - np.pi * np.ceil(angle / np.pi - 0.5)
    return found
