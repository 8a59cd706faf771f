"""What a robot is fitted to: points of cuts at several postures, with the forces along all three axes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.identification.coupled.data import CoupledData, couplable, coupled_data
from rcsa_ident.identification.data import LEVER, IdentificationData
from rcsa_ident.machine.robot.flexible import FlexibleRobot
from rcsa_ident.machine.robot.model import RobotModel
from rcsa_ident.machine.robot.sensitivity import mass_slopes

#: From SI to scaled units: slopes times the lever.
SCALE = np.array([1.0, LEVER, 1.0, LEVER, 1.0, LEVER])

#: A cut and frequencies [rad/s] to the cut's tool-holder along its axis and about it: flange over flange, tip over flange along the axis;
#: shapes (n,), (n,), (n,) [m/N], [rad/(N m)], [m/N].
Rods = Callable[[int, FloatArray], tuple[ComplexArray, ComplexArray, ComplexArray]]
#: A cut and its orders to the force along Z, and how it changes with the uncertain coefficients; shapes (n,), (n, c) [N].
Axial = Callable[[int, np.ndarray], tuple[ComplexArray, ComplexArray]]


@dataclass(frozen=True, eq=False)
class PosedData:
    """Points of a campaign on a robot: each is one tooth-passing line of one cut, in X, in Y or in both.

    `teeth`: array of int, shape (t,); of each tooling's cutter
    `bodies` [sqrt(kg) m], shape (c, b, 6, n): G of each body at each posture: G^T G is what it adds to the mass matrix of all freedoms, as
        heavy as the data sheet has it
    `shapes`, shape (c, n, 6): what each freedom moves where the tool-holder sits, in the spindle's axes: t, lever r in X and in Y, along Z,
        lever times turn
    `posture`: array of int, shape (p,); of each point
    `omega` [rad/s], shape (p,)
    `place`: array of int, shape (p, 2); the line of X and of Y that stands there, -1 where there is none
    `force` [N], shape (p, 3)
    `slope` [-], shape (p, 3, c): change of the forces' logarithms with the uncertain coefficients
    `flange`, `tip`: complex arrays, shapes (p, 6, 6), (p, 6, 3) [m/N]; A22 and A21 of the cut's tooling, scaled by the lever
    """

    base: IdentificationData
    teeth: np.ndarray
    bodies: FloatArray
    shapes: FloatArray
    posture: np.ndarray
    omega: FloatArray
    place: np.ndarray
    force: ComplexArray
    slope: ComplexArray
    flange: ComplexArray
    tip: ComplexArray

    @property
    def masses(self) -> int:
        """Number of bodies: links, and the payload."""
        return self.bodies.shape[1]

    @property
    def freedoms(self) -> int:
        """Of the arm."""
        return self.bodies.shape[3]

    @cached_property
    def mass(self) -> FloatArray:
        """What each body adds to the mass matrix at each posture, shape (c, b, n, n) [kg m^2]."""
        return frozen(np.swapaxes(self.bodies, 2, 3) @ self.bodies)

    def below(self, omega: float) -> PosedData:
        """Return the points below a frequency [rad/s]."""
        return self._kept(self.omega < omega, [axis.omega < omega for axis in self.base.axes])

    def at_harmonics(self, wanted: Sequence[int]) -> PosedData:
        """Return the points at some multiples of the tooth-passing frequency."""
        lines = [np.isin(np.rint(axis.order / self.teeth[self.base.cut_tooling[axis.cut]]), wanted) for axis in self.base.axes]
        points = np.zeros(self.omega.size, dtype=bool)
        for i, kept in enumerate(lines):
            own = self.place[:, i] >= 0
            points[own] |= kept[self.place[own, i]]
        return self._kept(points, lines)

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

    `data`: lines of X and Y, of the flange's own motion
    `postures` [rad], shape (c, j)
    `of_cut`: array of int, shape (k,); posture of each cut
    `teeth`: of the toolings
    `rods`, `axial`: callables
    Raises `InputError` if the cuts do not tell the flange's motion along both axes.
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
        frozen([roots_of_mass(robot, posture) for posture in postures]),
        frozen([s.ports * SCALE for s in structures]),
        frozen(of_cut[cut], np.intp),
        plain.omega,
        plain.place,
        *(frozen(each, np.complex128) for each in (force, slope, flange, tip)),
    )


def check_postures(postures: Sequence[tuple[float, ...]], ids: Sequence[str], robot: RobotModel) -> tuple[FloatArray, np.ndarray]:
    """Return the postures of cuts, each once, and which of them each cut has; shapes (c, j) [rad], (k,).

    Raises `InputError` if a cut tells none, or one of another number of joints.
    """
    for id, posture in zip(ids, postures, strict=True):
        if len(posture) != len(robot.joints):
            found = f"{len(posture)} angles of cut {id}" if posture else f"nothing of cut {id}"
            raise InputError("posture_deg", found, f"{len(robot.joints)} angles, one a joint [°], of every cut")
    # a control tells its angles to a ten-thousandth of a degree
    every, of_cut = np.unique(np.round(np.degrees(np.array(postures)), 4), axis=0, return_inverse=True)
    return np.radians(every), of_cut.ravel()


def roots_of_mass(robot: FlexibleRobot, posture: FloatArray) -> FloatArray:
    """Return G of each link and of the payload, G^T G what it adds to the mass matrix at a posture, shape (b, 6, n) [sqrt(kg) m]."""
    values, vectors = np.linalg.eigh(mass_slopes(robot.model, posture, robot.tilts))
    # a body moves in six directions
    most = np.sqrt(np.maximum(values[:, -6:], 0.0) * np.array(body_masses(robot.model))[:, None])
    found: FloatArray = np.swapaxes(vectors[:, :, -6:] * most[:, None, :], 1, 2)
    return found


def body_masses(robot: RobotModel) -> tuple[float, ...]:
    """Return the masses of the links, then of the payload where there is one [kg]."""
    return (*(joint.body.mass for joint in robot.joints), *(() if robot.payload is None else (robot.payload.mass,)))


def _cuts_and_orders(data: IdentificationData, points: CoupledData) -> tuple[np.ndarray, np.ndarray]:
    """Cut and order of each point."""
    cut, order = np.zeros(points.omega.size, dtype=np.intp), np.zeros(points.omega.size, dtype=np.intp)
    for i, axis in enumerate(data.axes):
        own = points.place[:, i] >= 0
        cut[own], order[own] = axis.cut[points.place[own, i]], np.rint(axis.order[points.place[own, i]])
    return cut, order
