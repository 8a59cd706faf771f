"""What both planes are fitted to together: points with the lines of both axes, both forces, and turning tool-holders."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.data import LEVER, AxisData, IdentificationData

#: Share of the other axis' line that counts as this axis' model error: a line in which both forces' shares cancel is not exact.
OF_OTHER = 0.03
_SCALE = np.array([1.0, LEVER])


@dataclass(frozen=True, slots=True, eq=False)
class CoupledData:
    """Points of a campaign: each is one tooth-passing line of one cut, in X, in Y or in both.

    `base`: lines of X and Y, with the other axis' share in their power
    `omega`, `speed`, `relative_speed`: arrays, shape (p,) [rad/s], [rad/s], [-]
    `place`: array of int, shape (p, 2); the line of X and of Y that stands there, -1 where there is none
    `force` [N], shape (p, 2): simulated, along X and Y
    `slope` [-], shape (p, 2, c): change of the forces' logarithms with the uncertain coefficients
    `flange`, `tip`: complex arrays, shapes (3, p, 4, 4), (3, p, 4, 2) [m/N]; A22 and A21 of the cut's tooling over both planes, scaled by
        the lever: without gyroscopic moments, with them, and with them for a spindle that turns the other way (index 0, 1, -1)
    """

    base: IdentificationData
    omega: FloatArray
    speed: FloatArray
    relative_speed: FloatArray
    place: np.ndarray
    force: ComplexArray
    slope: ComplexArray
    flange: ComplexArray
    tip: ComplexArray

    @property
    def turns(self) -> bool:
        """Whether the tool-holders' gyroscopic moments are known."""
        return self.flange.shape[0] == 3

    def summed(self) -> CoupledData:
        """Return the same with the flange's motion as the only output, and without the triggers of unknown tooth angle."""
        return replace(self, base=self.base.summed())


def couplable(data: IdentificationData) -> bool:
    """Whether both planes can be fitted together: the flange's lines in X and Y with as many outputs, and both forces in each."""
    if tuple(a.axis for a in data.axes) != (Dof.X, Dof.Y) or len({a.outputs for a in data.axes}) > 1 or not data.of_flange:
        return False
    return all(a.across.size == a.omega.size for a in data.axes)


def coupled_data(data: IdentificationData) -> CoupledData:
    """Return a campaign's points; the tool-holders are asked what they do while they turn. `data`: for which `couplable` holds."""
    x, y = data.axes
    key = [(axis.cut * 2**20 + np.rint(axis.order).astype(np.int64)) for axis in data.axes]
    points = np.unique(np.concatenate(key))
    place = np.stack([_places(points, each) for each in key], axis=1)
    cut, order = points // 2**20, (points % 2**20).astype(float)
    omega, force = np.zeros(points.size), np.zeros((points.size, 2), dtype=complex)
    named = len(data.coefficients)
    slope = np.zeros((points.size, 2, named), dtype=complex)
    flange, tip = np.zeros((points.size, 3), dtype=complex), np.zeros((points.size, 2), dtype=complex)
    for i, axis in enumerate(data.axes):
        at = np.searchsorted(points, key[i])
        omega[at], flange[at], tip[at] = axis.omega, axis.flange, axis.tip
        force[at, i], force[at, 1 - i] = axis.force, axis.across
        slope[at, i], slope[at, 1 - i] = axis.force_slope[:, :named], axis.across_slope[:, :named]
    tables = [_straight(flange, tip)]
    if data.turning:
        tables += _turning(data, cut, omega, 1.0 / order)
    beside = [_beside(data.axes[1 - i], place[:, 1 - i], place[:, i], force[:, 1 - i] / force[:, i]) for i in range(2)]
    base = replace(data, axes=tuple(replace(axis, beside=b) for axis, b in zip((x, y), beside, strict=True)), turning={})
    return CoupledData(
        base,
        frozen(omega),
        frozen(data.spindle_speed[cut]),
        frozen(data.relative_speed[cut]),
        frozen(place, np.intp),
        frozen(force, np.complex128),
        frozen(slope, np.complex128),
        *(frozen(np.array(each), np.complex128) for each in zip(*tables, strict=True)),
    )


def _places(points: np.ndarray, key: np.ndarray) -> np.ndarray:
    found = np.full(points.size, -1)
    found[np.searchsorted(points, key)] = np.arange(key.size)
    return found


def _beside(other: AxisData, theirs: np.ndarray, ours: np.ndarray, ratio: ComplexArray) -> FloatArray:
    """Power of the other axis' lines that counts for the lines of an axis, in its own unit, shape (n, o)."""
    found = np.zeros((int(np.sum(ours >= 0)), other.outputs))
    both = (ours >= 0) & (theirs >= 0)
    motion = other.lines[theirs[both], :, 0] - other.lines[theirs[both], :, 1]
    found[ours[both]] = OF_OTHER**2 * np.abs(motion * ratio[both, None]) ** 2
    return found


def _straight(flange: ComplexArray, tip: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """Both planes' A22 and A21 where neither feels the other."""
    one = flange[:, [0, 1, 1, 2]].reshape(-1, 2, 2)
    return _planes(one, np.zeros_like(one)), _planes(tip[:, :, None], np.zeros_like(tip)[:, :, None])


def _turning(data: IdentificationData, cut: np.ndarray, omega: FloatArray, ratio: FloatArray) -> list[tuple[ComplexArray, ComplexArray]]:
    """The same while the tool-holder turns, in the cutter's sense and in the other one: A = [[S, i D], [-i D, S]]."""
    tooling = data.cut_tooling[cut]
    sums, differences = (np.zeros((2, omega.size, 4, 4), dtype=complex) for _ in range(2))
    for t, name in enumerate(data.toolings):
        own = np.flatnonzero(tooling == t)
        if not own.size:
            continue
        forward, backward = data.turning[name](omega[own], ratio[own])
        sums[0, own], differences[0, own] = 0.5 * (forward + backward), 0.5 * (forward - backward)
    lever = np.outer(_SCALE, _SCALE)
    s22, d22 = sums[0, :, 2:, 2:] * lever, differences[0, :, 2:, 2:] * lever
    s21, d21 = (each[0, :, 2:, :1] * _SCALE[:, None] for each in (sums, differences))
    return [(_planes(s22, sense * d22), _planes(s21, sense * d21)) for sense in (1.0, -1.0)]


def _planes(same: ComplexArray, other: ComplexArray) -> ComplexArray:
    """[[S, i D], [-i D, S]], shape (p, r, c) -> (p, 2 r, 2 c)."""
    return np.concatenate([np.concatenate([same, 1j * other], axis=2), np.concatenate([-1j * other, same], axis=2)], axis=1)
