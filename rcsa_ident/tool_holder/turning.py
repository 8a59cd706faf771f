"""Tool and holder that turn: the gyroscopic moments of a free assembly, exactly and one plane at a time.

A section that turns with the spindle speed W asks for a moment 2 rho I W per length and rate of the other plane's slope. With
u = x + i y and v = x - i y the equations of both planes fall apart into two of one plane, in which the rotary inertia per length
rho I has become rho I (1 + 2 W / w), for v rho I (1 - 2 W / w). So

    A = [[S, i D], [-i D, S]],  S = (A+ + A-) / 2,  D = (A+ - A-) / 2

over the X and then the Y plane, with symmetric A+ and A-. W counts positive where the cutter turns from +Y to +X.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Self

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import Dof, plane
from rcsa_ident.dynamics.poles import pole_sum
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.dynamics.structure import projection_basis
from rcsa_ident.tool_holder.geometry import ToolAssembly
from rcsa_ident.tool_holder.model import free_body, tool_holder_poles
from rcsa_ident.tool_holder.timoshenko import ShearCoefficient, cowper

#: Lines that are solved at once.
_AT_ONCE = 256
#: The double pole of the rigid translation stands as a pair at this share of the highest frequency.
_APART = 1e-7
#: Spindle speeds at two frequencies that differ by less, as a share, are one speed.
_SAME = 1e-12
#: Below this share of the highest frequency a speed's own poles lie too close to each other; above so many lines they pay.
_SLOW, _MANY = 1e-4, 400
#: All entries of a symmetric receptance of four coordinates.
_UPPER = tuple((i, j) for i in range(4) for j in range(i, 4))


@dataclass(frozen=True, slots=True, eq=False)
class TurningToolHolder:
    """A free assembly in few coordinates whose mass is the identity: translation, rotation, elastic motions.

    `stiffness`, shape (m, m): with the materials' loss in its imaginary part
    `damping`, `rotary`, shape (m, m): `rotary` is the rotary inertia's share of the mass; the translation, which comes first, has none
    `ports`, shape (4, m): translation and slope of the tip, then of the flange
    `highest`, `fastest` [rad/s]: frequency, and spindle speed of either sense, up to which it is good
    """

    stiffness: ComplexArray
    damping: FloatArray
    rotary: FloatArray
    ports: FloatArray
    highest: float
    fastest: float

    def __post_init__(self) -> None:
        for name, dtype in (("stiffness", complex), ("damping", float), ("rotary", float), ("ports", float)):
            object.__setattr__(self, name, frozen(getattr(self, name), dtype))

    @classmethod
    def of(cls, assembly: ToolAssembly, highest: float, fastest: float, shear_coefficient: ShearCoefficient = cowper) -> Self:
        """Return the reduced assembly; its coordinates are its own exact solutions at a few frequencies, turning both ways.

        `highest` [rad/s]: frequency up to which it is good
        `fastest` [rad/s]: spindle speed up to which it is good
        `shear_coefficient`: as in `tool_holder_structure`
        """
        body = free_body(assembly, highest / (2.0 * np.pi), shear_coefficient=shear_coefficient)
        structure, rotary = body.structure, body.rotary
        translation, rotation = body.rigid.T
        translation = translation / np.sqrt(translation @ structure.mass @ translation)
        rotation = rotation - translation * (translation @ structure.mass @ rotation)
        rigid = np.stack([translation, rotation / np.sqrt(rotation @ structure.mass @ rotation)], axis=1)
        moments = [sense * 2.0 * fastest * rotary for sense in (1.0, -1.0)]
        elastic = projection_basis(structure, rigid, moments, highest)
        m = 2 + elastic.shape[1]
        stiffness, damping = np.zeros((m, m), dtype=complex), np.zeros((m, m))
        stiffness[2:, 2:] = elastic.T @ (structure.stiffness + 1j * structure.structural_damping) @ elastic
        damping[2:, 2:] = elastic.T @ structure.damping @ elastic
        basis = np.hstack([rigid, elastic])
        turned = basis.T @ rotary @ basis
        turned[0], turned[:, 0] = 0.0, 0.0
        return cls(stiffness, damping, turned, basis[structure.index], highest, fastest)

    def pair(self, omega: FloatArray, ratio: float | FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Return A+ and A-, shape (n, 4, 4) each.

        `omega`: array, shape (n,) [rad/s], above 0
        `ratio`: float or array, shape (n,); spindle speed over frequency
        """
        omega, ratio = np.broadcast_arrays(np.asarray(omega, dtype=float), np.asarray(ratio, dtype=float))
        speed = ratio * omega
        if omega.size > _MANY and np.ptp(speed) <= _SAME * np.max(np.abs(speed)):
            forward, backward = (_symmetric(each) for each in self.at_speed(omega, float(speed[0]), _UPPER))
            return forward, backward
        forward, backward = (self._solved(omega, sense * speed) for sense in (1.0, -1.0))
        return forward, backward

    def at_speed(self, omega: FloatArray, speed: float, places: Sequence[tuple[int, int]]) -> tuple[ComplexArray, ComplexArray]:
        """Return some entries (row, column) of A+ and A- at one spindle speed, shape (g, n) each: many frequencies from its poles.

        `omega`: array, shape (n,) [rad/s], above 0
        `speed` [rad/s]
        `places`: sequence of (row, column)
        """
        rows, columns = np.array(places).T
        if omega.size > _MANY and abs(speed) > _SLOW * self.highest:
            forward, backward = (self._poles(omega, sense * speed, rows, columns) for sense in (1.0, -1.0))
        else:
            turning = np.full(omega.size, speed)
            forward, backward = (self._solved(omega, sense * turning)[:, rows, columns].T for sense in (1.0, -1.0))
        return forward, backward

    def _solved(self, omega: FloatArray, speed: FloatArray) -> ComplexArray:
        """A+ by one small solution for each frequency and the speed that goes with it."""
        found = np.empty((omega.size, 4, 4), dtype=complex)
        unit, force = np.eye(len(self.damping)), self.ports.T.astype(complex)
        for first in range(0, omega.size, _AT_ONCE):
            some = slice(first, first + _AT_ONCE)
            w, turning = omega[some, None, None], speed[some, None, None]
            dynamic = self.stiffness + w * (1j * self.damping - 2.0 * turning * self.rotary - w * unit)
            found[some] = self.ports @ np.linalg.solve(dynamic, np.broadcast_to(force, (len(dynamic), *force.shape)))
        return found

    def _poles(self, omega: FloatArray, speed: float, rows: np.ndarray, columns: np.ndarray) -> ComplexArray:
        """Entries of A+ from the poles of one speed, shape (g, n); the translation, which nothing holds or turns, stands apart."""
        m = len(self.damping) - 1
        state, force = np.zeros((2 * m, 2 * m), dtype=complex), np.zeros((2 * m, 4), dtype=complex)
        state[:m, m:] = np.eye(m)
        state[m:, :m] = -self.stiffness[1:, 1:]
        state[m:, m:] = -self.damping[1:, 1:] - 2j * speed * self.rotary[1:, 1:]
        force[m:] = self.ports[:, 1:].T
        pole, right = np.linalg.eig(state)
        outputs, inputs = self.ports[:, 1:] @ right[:m], np.linalg.solve(right, force)
        values = pole_sum(omega, pole, outputs[rows].T * inputs[:, columns]).T
        return values - np.outer(self.ports[rows, 0] * self.ports[columns, 0], 1.0 / omega**2)


def turning_pair(
    assembly: ToolAssembly, omega: FloatArray, ratio: float | FloatArray, shear_coefficient: ShearCoefficient = cowper
) -> tuple[ComplexArray, ComplexArray]:
    """Return A+ and A-, the free receptances between tip and flange with the gyroscopic moments, shape (n, 4, 4) each.

    Parameters
    ----------
    assembly : ToolAssembly
    omega : array, shape (n,) [rad/s], above 0
    ratio : float or array, shape (n,)
        Spindle speed over frequency: 1 / (k N) on the k-th line of N teeth. Below 0 the cutter turns the other way.
    shear_coefficient : callable
        As in `tool_holder_structure`.

    Notes
    -----
    `tests/tool_holder` holds them against the full equations: 1e-6 of each entry at every frequency. Who asks more than once keeps a
    `TurningToolHolder`.

    Examples
    --------
    >>> from rcsa_ident.tool_holder.geometry import MATERIALS, BeamSegment
    >>> disc = ToolAssembly((BeamSegment(0.01, 0.1, MATERIALS["steel"]),), (), 0.0)
    >>> forward, backward = turning_pair(disc, [1000.0, 2000.0], 0.25)
    >>> forward.shape
    (2, 4, 4)
    """
    omega = np.atleast_1d(np.asarray(omega, dtype=float))
    ratio = np.asarray(ratio, dtype=float)
    if omega.ndim != 1 or omega.size == 0 or not np.all(np.isfinite(omega) & (omega > 0.0)):
        raise InputError("omega", omega.tolist(), "one or more finite frequencies above 0 [rad/s]")
    if ratio.shape not in ((), omega.shape) or not np.all(np.isfinite(ratio)):
        raise InputError("ratio", ratio.tolist(), f"a finite number, or {omega.size} of them")
    highest, fastest = float(omega.max()), float(np.max(np.abs(ratio * omega)))
    if fastest == 0.0:
        still = tool_holder_poles(assembly, highest, shear_coefficient=shear_coefficient).receptance(omega).values
        return still, still
    return TurningToolHolder.of(assembly, highest, fastest, shear_coefficient).pair(omega, ratio)


def turning_tool_holder(assembly: ToolAssembly, highest: float, speed: float) -> TurningToolHolder:
    """Return a reduced assembly that is good for a spindle speed; those who ask at many speeds find it made.

    `highest` [rad/s]: frequency up to which it is good
    `speed` [rad/s]: of either sense
    """
    return _kept(assembly, highest, 2.0 ** float(np.ceil(np.log2(max(abs(speed), 1.0)))))


@lru_cache(maxsize=8)
def _kept(assembly: ToolAssembly, highest: float, fastest: float) -> TurningToolHolder:
    return TurningToolHolder.of(assembly, highest, fastest)


def entries_at_speed(
    assembly: ToolAssembly, omega: FloatArray, speed: float, places: Sequence[tuple[int, int]]
) -> tuple[ComplexArray, ComplexArray]:
    """Return some entries (row, column) of A+ and A- at one spindle speed, shape (g, n) each.

    `omega`: array, shape (n,) [rad/s], above 0, ascending
    `speed` [rad/s]: positive where the cutter turns from +Y to +X
    `places`: sequence of (row, column); of translation and slope of the tip, then of the flange
    """
    return turning_tool_holder(assembly, float(omega[-1]), speed).at_speed(omega, speed, places)


def turning_receptance(assembly: ToolAssembly, omega: FloatArray, speed: float) -> Receptance:
    """Return the free receptances of both bending planes at one spindle speed, shape (n, 8, 8).

    `omega`: array, shape (n,) [rad/s], above 0, ascending
    `speed` [rad/s]: positive where the cutter turns from +Y to +X
    Returns Receptance: points ``tip`` and ``flange``, each with translation and slope of X, then of Y.
    """
    omega = frozen(omega)
    forward, backward = (_symmetric(each) for each in entries_at_speed(assembly, omega, speed, _UPPER))
    # plane by plane as it comes, point by point as it goes
    order = np.array([0, 1, 4, 5, 2, 3, 6, 7])
    values = both_planes(forward, backward)[:, order][:, :, order]
    ends = tuple(c for point in ("tip", "flange") for axis in (Dof.X, Dof.Y) for c in plane(point, axis))
    return Receptance(omega, values, ends, ends)


def both_planes(forward: ComplexArray, backward: ComplexArray) -> ComplexArray:
    """Return [[S, i D], [-i D, S]] of any block of A+ and A-: X plane, then Y plane, shapes (..., r, c) -> (..., 2 r, 2 c)."""
    alike, across = 0.5 * (forward + backward), 0.5j * (forward - backward)
    found: ComplexArray = np.concatenate(
        [np.concatenate([alike, across], axis=-1), np.concatenate([-across, alike], axis=-1)],
        axis=-2,
    )
    return found


def _symmetric(upper: ComplexArray) -> ComplexArray:
    """The whole of what `_UPPER` names, shape (10, n) -> (n, 4, 4)."""
    rows, columns = np.array(_UPPER).T
    found = np.empty((upper.shape[1], 4, 4), dtype=complex)
    found[:, rows, columns] = found[:, columns, rows] = upper.T
    return found
