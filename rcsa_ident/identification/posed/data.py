"""What a robot is fitted to: points of cuts at several postures, with the forces along all three axes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from rcsa_ident.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.errors import InputError
from rcsa_ident.identification.coupled.data import CoupledData, couplable, coupled_data
from rcsa_ident.identification.data import LEVER, IdentificationData
from rcsa_ident.machine.robot.flexible import FlexibleRobot

#: From SI to scaled units: slopes times the lever.
SCALE = np.array([1.0, LEVER, 1.0, LEVER, 1.0, LEVER])

#: A cut and frequencies [rad/s] to the cut's tool-holder along its axis and about it: flange over flange, tip over flange along the axis;
#: shapes (n,), (n,), (n,) [m/N], [rad/(N m)], [m/N].
Rods = Callable[[int, FloatArray], tuple[ComplexArray, ComplexArray, ComplexArray]]
#: A cut and its orders to the force along Z, and how it changes with the uncertain coefficients; shapes (n,), (n, c) [N].
Axial = Callable[[int, np.ndarray], tuple[ComplexArray, ComplexArray]]


@dataclass(frozen=True, slots=True, eq=False)
class PosedData:
    """Points of a campaign on a robot: each is one tooth-passing line of one cut, in X, in Y or in both.

    Parameters
    ----------
    base : IdentificationData
    teeth : array of int, shape (t,)
        Of each tooling's cutter.
    mass : array, shape (c, n, n) [kg m^2]
        Of all freedoms at each posture.
    shapes : array, shape (c, n, 6)
        What each freedom moves where the tool-holder sits, in the spindle's axes: t, lever r in X and in Y, along Z, lever times turn.
    posture : array of int, shape (p,)
        Of each point.
    omega : array, shape (p,) [rad/s]
    place : array of int, shape (p, 2)
        The line of X and of Y that stands there, -1 where there is none.
    force : complex array, shape (p, 3) [N]
    slope : complex array, shape (p, 3, c) [-]
        Change of the forces' logarithms with the uncertain coefficients.
    flange, tip : complex arrays, shapes (p, 6, 6), (p, 6, 3) [m/N]
        A22 and A21 of the cut's tooling, scaled by the lever.
    """

    base: IdentificationData
    teeth: np.ndarray
    mass: FloatArray
    shapes: FloatArray
    posture: np.ndarray
    omega: FloatArray
    place: np.ndarray
    force: ComplexArray
    slope: ComplexArray
    flange: ComplexArray
    tip: ComplexArray

    @property
    def freedoms(self) -> int:
        """Of the arm."""
        return self.mass.shape[1]

    def below(self, omega: float) -> PosedData:
        """Return the points below a frequency [rad/s]."""
        return self._kept(self.omega < omega, [axis.omega < omega for axis in self.base.axes])

    def up_to_harmonic(self, highest: int) -> PosedData:
        """Return the points up to a multiple of the tooth-passing frequency."""
        most = highest * self.teeth[self.base.cut_tooling]
        orders = np.zeros(self.omega.size)
        for i, axis in enumerate(self.base.axes):
            own = self.place[:, i] >= 0
            orders[own] = (axis.order <= most[axis.cut])[self.place[own, i]]
        return self._kept(orders > 0.0, [axis.order <= most[axis.cut] for axis in self.base.axes])

    def _kept(self, points: np.ndarray, lines: list[np.ndarray]) -> PosedData:
        place = np.array(self.place[points])
        for i, kept in enumerate(lines):
            there = place[:, i] >= 0
            place[there, i] = (np.cumsum(kept) - 1)[place[there, i]]
        axes = tuple(axis.of(kept) for axis, kept in zip(self.base.axes, lines, strict=True))
        own = {name: getattr(self, name)[points] for name in ("posture", "omega", "force", "slope", "flange", "tip")}
        return replace(self, base=replace(self.base, axes=axes), place=place, **own)

    def summed(self) -> PosedData:
        """Return the same with the flange's motion as the only output, and without the triggers of unknown tooth angle."""
        return replace(self, base=self.base.summed())


def posed_data(
    data: IdentificationData,
    robot: FlexibleRobot,
    postures: FloatArray,
    of_cut: np.ndarray,
    teeth: Mapping[str, int],
    rods: Rods,
    axial: Axial,
) -> PosedData:
    """Return a campaign's points on a robot.

    Parameters
    ----------
    data : IdentificationData
        Lines of X and Y, of the flange's own motion.
    robot : FlexibleRobot
    postures : array, shape (c, j) [rad]
    of_cut : array of int, shape (k,)
        Posture of each cut.
    teeth : mapping of str to int
        Of the toolings.
    rods, axial : callables

    Raises
    ------
    InputError
        If the cuts do not tell the flange's motion along both axes.
    """
    if data.sweeps:
        raise InputError("cuts", "passes whose speed changes", "cuts at one speed each, on a robot")
    if not couplable(data):
        allowed = "displacement sensors at the flange along X and Y and an accelerometer for each, in all cuts"
        raise InputError("sensors", "cuts that do not tell the flange's own motion along both axes", allowed)
    plain = coupled_data(replace(data, turning={}))
    cut, order = _cuts_and_orders(data, plain)
    structures = [robot.at(posture) for posture in postures]
    count = plain.omega.size
    flange, tip = np.zeros((count, 6, 6), dtype=complex), np.zeros((count, 6, 3), dtype=complex)
    flange[:, :4, :4], tip[:, :4, :2] = plain.flange[0], plain.tip[0]
    force = np.concatenate([plain.force, np.zeros((count, 1))], axis=1)
    slope = np.concatenate([plain.slope, np.zeros((count, 1, plain.slope.shape[2]))], axis=1)
    for k in np.unique(cut):
        own = cut == k
        flange[own, 4, 4], turning, tip[own, 4, 2] = rods(int(k), plain.omega[own])
        flange[own, 5, 5] = turning * LEVER**2
        force[own, 2], slope[own, 2] = axial(int(k), order[own])
    return PosedData(
        plain.base,
        frozen([teeth[name] for name in data.toolings], np.intp),
        frozen([s.mass for s in structures]),
        frozen([s.ports * SCALE for s in structures]),
        frozen(of_cut[cut], np.intp),
        plain.omega,
        plain.place,
        *(frozen(each, np.complex128) for each in (force, slope, flange, tip)),
    )


def _cuts_and_orders(data: IdentificationData, points: CoupledData) -> tuple[np.ndarray, np.ndarray]:
    """Cut and order of each point."""
    cut, order = np.zeros(points.omega.size, dtype=np.intp), np.zeros(points.omega.size, dtype=np.intp)
    for i, axis in enumerate(data.axes):
        own = points.place[:, i] >= 0
        cut[own], order[own] = axis.cut[points.place[own, i]], np.rint(axis.order[points.place[own, i]])
    return cut, order
