"""What a robot is: links that turn on joints, springs and dampers in the joints, and what its flange carries."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from math import degrees
from typing import NamedTuple, TypeVar

import numpy as np

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError, non_negative, positive
from rcsa_ident.base.shown import Shown

#: How far from square, or from a unit length, given axes may be.
_ROUNDED = 1e-6
#: Density of the stuff that robots are made of, at most [kg/m^3]: a solid ball of it has the least inertia that its mass can have.
_STEEL = 7850.0


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """Axes at a place, as seen from others.

    `turn`, shape (3, 3): its axes as columns
    `offset` [m], shape (3,): its origin

    Examples
    --------
    >>> Frame(offset=(0.0, 0.0, 0.2)).then(Frame(offset=(0.1, 0.0, 0.0))).offset.tolist()
    [0.1, 0.0, 0.2]
    """

    turn: FloatArray = field(default_factory=lambda: np.eye(3))
    offset: FloatArray = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        object.__setattr__(self, "turn", frozen(self.turn))
        object.__setattr__(self, "offset", frozen(self.offset))
        if self.turn.shape != (3, 3) or np.max(np.abs(self.turn.T @ self.turn - np.eye(3))) > _ROUNDED or np.linalg.det(self.turn) < 0.0:
            raise InputError("turn", self.turn.tolist(), "three unit vectors at right angles, right-handed, as columns")
        if self.offset.shape != (3,) or not np.all(np.isfinite(self.offset)):
            raise InputError("offset", self.offset.tolist(), "three finite lengths [m]")

    def then(self, other: Frame) -> Frame:
        """Return a frame that is seen from this one as it is seen from where this one is seen from."""
        return Frame(self.turn @ other.turn, self.offset + self.turn @ other.offset)

    @property
    def inverse(self) -> Frame:
        """The frame that this one is seen from, as seen from this one."""
        return Frame(self.turn.T, -self.turn.T @ self.offset)

    def point(self, place: FloatArray) -> FloatArray:
        """Return where a point of this frame is as seen from where the frame is seen from, shape (3,) [m]."""
        return self.offset + self.turn @ place


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """A rigid body in the axes of the frame that carries it.

    `mass` [kg]
    `centre` [m], shape (3,): centre of mass
    `inertia` [kg m^2], shape (3, 3): about the centre; the entries off the diagonal are the tensor's own
    """

    mass: float
    centre: FloatArray = field(default_factory=lambda: np.zeros(3))
    inertia: FloatArray = field(default_factory=lambda: np.zeros((3, 3)))

    def __post_init__(self) -> None:
        non_negative("mass", self.mass, "kg")
        object.__setattr__(self, "centre", frozen(self.centre))
        object.__setattr__(self, "inertia", frozen(self.inertia))
        if self.centre.shape != (3,) or not np.all(np.isfinite(self.centre)):
            raise InputError("center_of_mass", self.centre.tolist(), "three finite lengths [m]")
        if self.inertia.shape != (3, 3) or not np.all(np.isfinite(self.inertia)) or not np.allclose(self.inertia, self.inertia.T):
            raise InputError("inertia", self.inertia.tolist(), "a symmetric tensor, shape (3, 3) [kg m^2]")

    def times(self, factor: float) -> Body:
        """Return a body of the same shape, so many times as heavy."""
        return Body(factor * self.mass, self.centre, factor * self.inertia)

    def seen_from(self, frame: Frame) -> Body:
        """Return the body in the axes that its own frame is seen from."""
        return Body(self.mass, frame.point(self.centre), frame.turn @ self.inertia @ frame.turn.T)

    def beside(self, other: Body) -> Body:
        """Return both as one body; they stand in the same axes."""
        mass = self.mass + other.mass
        if mass == 0.0:
            return self
        centre = (self.mass * self.centre + other.mass * other.centre) / mass
        return Body(mass, centre, self._about(centre) + other._about(centre))

    def _about(self, point: FloatArray) -> FloatArray:
        arm = self.centre - point
        return self.inertia + self.mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))

    def warnings(self, name: str) -> tuple[str, ...]:
        """Return what no body of this mass can have, in words."""
        if self.mass == 0.0:
            return ()
        principal = np.linalg.eigvalsh(self.inertia)
        said = []
        if principal[0] < -1e-12 or principal[2] > (principal[0] + principal[1]) * (1.0 + 1e-9):
            told = ", ".join(f"{v:.3g}" for v in principal)
            said.append(f"{name}: no body has the principal moments of inertia {told} kg m²: none exceeds the sum of the two others")
        least = 0.4 * self.mass * (3.0 * self.mass / (4.0 * np.pi * _STEEL)) ** (2.0 / 3.0) * 3.0
        if np.sum(principal) < least:
            told = f"{np.sum(principal):.3g} kg m²"
            said.append(f"{name}: its moments of inertia sum up to {told}, a solid ball of steel of its {self.mass:.3g} kg has {least:.3g}")
        return tuple(said)


@dataclass(frozen=True, slots=True, eq=False)
class Tilt:
    """A spring across a joint's own axis: what its bearings and the links beside it give way.

    `axis`, shape (3,): unit vector in the joint's frame
    `stiffness` [N m/rad]; `damping` [N m s/rad]
    """

    axis: FloatArray
    stiffness: float
    damping: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "axis", _unit("tilt axis", self.axis))
        positive("tilt stiffness", self.stiffness, "N m/rad")
        non_negative("tilt damping", self.damping, "N m s/rad")


@dataclass(frozen=True, slots=True, eq=False)
class Joint:
    """A driven joint and the link that it moves.

    `frame`: where it stands in the link before it, at angle zero
    `axis`, shape (3,): unit vector in its own frame; its sign is that of the robot's own angle
    `body`: the link, in the joint's frame
    `stiffness` [N m/rad]: of drive and gear, at the link
    `damping` [N m s/rad]
    `backlash` [rad]: half of the play: how far the link may leave the drive before the spring feels it
    `tilts`: in the order in which they turn, behind the joint's own turn
    `limits`: (float, float) [rad]
    `gravity_compensated`: whether the control takes the sag of this joint's spring under the arm's own weight out
    """

    name: str
    frame: Frame
    axis: FloatArray
    body: Body
    stiffness: float
    damping: float = 0.0
    backlash: float = 0.0
    tilts: tuple[Tilt, ...] = ()
    limits: tuple[float, float] = (-np.inf, np.inf)
    gravity_compensated: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "axis", _unit(f"axis of {self.name}", self.axis))
        positive(f"stiffness of {self.name}", self.stiffness, "N m/rad")
        non_negative(f"damping of {self.name}", self.damping, "N m s/rad")
        non_negative(f"backlash of {self.name}", self.backlash, "rad")
        if not self.limits[0] < self.limits[1]:
            low, high = (degrees(each) for each in self.limits)
            raise InputError(f"limits of {self.name}", f"{low:g} to {high:g}°", "a lower limit below the upper one")


_Spring = TypeVar("_Spring", Joint, Tilt)


class Chain(NamedTuple):
    """The freedoms of a robot one after the other, as the kernels read them; see `rcsa_ident.machine.robot._kernels`.

    `turn`, `offset`, `axis`: arrays, shapes (n, 3, 3), (n, 3), (n, 3)
    `mass`, `centre`, `inertia`: arrays, shapes (n,), (n, 3), (n, 3, 3)
    `stiffness`, `damping`, shape (n,)
    `driven`: array of int, shape (j,); the freedoms that are the joints' own angles
    """

    turn: FloatArray
    offset: FloatArray
    axis: FloatArray
    mass: FloatArray
    centre: FloatArray
    inertia: FloatArray
    stiffness: FloatArray
    damping: FloatArray
    driven: np.ndarray

    def angles(self, posture: FloatArray) -> FloatArray:
        """Return all angles at a posture of the joints, shape (n,) [rad]: nothing tilts."""
        full = np.zeros(self.mass.size)
        full[self.driven] = posture
        return full


@dataclass(frozen=True, eq=False, repr=False)
class RobotModel(Shown):
    """A robot arm: joints in a row, from the base to the flange.

    Parameters
    ----------
    name : str
    joints : tuple of Joint
    flange : Frame
        In the last joint's frame.
    tool_point : Frame
        Where the tool-holder's flange sits, in the robot's flange: z points out of the spindle, along the tool.
    payload : Body or None
        What hangs on the robot's flange, spindle and all, in the flange's axes.
    gravity : array, shape (3,) [m/s^2]
        Acceleration of free fall in the base's axes.
    base_mass : float [kg]
        Of what does not move; it only counts in the robot's weight.
    source : str

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> robot = ri.sample_robot("tx200")
    >>> print(robot)
    Stäubli TX200: 6 joints, 18 freedoms, 1045 kg
    >>> robot.spring_names()[:3]
    ('J1', 'J1 about x', 'J1 about y')
    """

    name: str
    joints: tuple[Joint, ...]
    flange: Frame = field(default_factory=Frame)
    tool_point: Frame = field(default_factory=Frame)
    payload: Body | None = None
    gravity: FloatArray = field(default_factory=lambda: np.array([0.0, 0.0, -9.81]))
    base_mass: float = 0.0
    source: str = ""

    def __post_init__(self) -> None:
        if not self.joints:
            raise InputError("joints", 0, "at least one")
        object.__setattr__(self, "gravity", frozen(self.gravity))

    def __str__(self) -> str:
        return f"{self.name}: {len(self.joints)} joints, {self.freedoms()} freedoms, {self.mass:.0f} kg"

    @property
    def weighed(self) -> bool:
        """Whether masses are known: without them an arm has postures and stiffness, but no natural frequencies."""
        return self.chain().mass[-1] > 0.0

    @property
    def mass(self) -> float:
        """Mass of the whole arm and of what it carries [kg]."""
        return self.base_mass + sum(j.body.mass for j in self.joints) + (0.0 if self.payload is None else self.payload.mass)

    def freedoms(self, tilts: bool = True) -> int:
        """Return the number of angles, tilts included or not."""
        return sum(1 + (len(j.tilts) if tilts else 0) for j in self.joints)

    def chain(self, tilts: bool = True, payload: bool = True) -> Chain:
        """Return the freedoms one after the other.

        Parameters
        ----------
        tilts : bool
            With the springs across the joints' axes.
        payload : bool
            With what hangs on the flange as part of the last link; without it where it is coupled to the flange.
        """
        return self._chains[tilts, payload and self.payload is not None]

    @cached_property
    def _chains(self) -> dict[tuple[bool, bool], Chain]:
        return {(tilts, payload): self._chain(tilts, payload) for tilts in (False, True) for payload in (False, True)}

    def _chain(self, tilts: bool, payload: bool) -> Chain:
        none = Body(0.0)
        frames: list[Frame] = []
        bodies: list[Body] = []
        springs: list[Joint | Tilt] = []
        driven: list[int] = []
        for joint in self.joints:
            body = joint.body
            if payload and self.payload is not None and joint is self.joints[-1]:
                body = body.beside(self.payload.seen_from(self.flange))
            turning: list[Joint | Tilt] = [joint, *(joint.tilts if tilts else ())]
            driven.append(len(springs))
            springs += turning
            frames += [joint.frame, *[Frame()] * (len(turning) - 1)]
            # what tilts behind a joint carries the link
            bodies += [*[none] * (len(turning) - 1), body]
        return Chain(
            frozen([f.turn for f in frames]),
            frozen([f.offset for f in frames]),
            frozen([s.axis for s in springs]),
            frozen([b.mass for b in bodies]),
            frozen([b.centre for b in bodies]),
            frozen([b.inertia for b in bodies]),
            frozen([s.stiffness for s in springs]),
            frozen([s.damping for s in springs]),
            frozen(driven, np.intp),
        )

    def spring_names(self, tilts: bool = True) -> tuple[str, ...]:
        """Return what each freedom's spring is called, in the order of the chain: the joint's name, or that and across which axis."""
        said = []
        for joint in self.joints:
            said.append(joint.name)
            said += [f"{joint.name} about {_axis_name(tilt.axis)}" for tilt in (joint.tilts if tilts else ())]
        return tuple(said)

    def with_springs(self, stiffness: FloatArray, damping: FloatArray | None = None, tilts: bool = True) -> RobotModel:
        """Return the robot with other springs of its freedoms, in the order of the chain.

        Parameters
        ----------
        stiffness : array, shape (n,) [N m/rad]
        damping : array, shape (n,) [N m s/rad], default as it is
        tilts : bool
            Whether those across the joints' axes are among them.
        """
        chain = self.chain(tilts)
        springs = iter(
            zip(*(np.asarray(each).tolist() for each in (stiffness, chain.damping if damping is None else damping)), strict=True)
        )

        def with_next(each: _Spring) -> _Spring:
            k, d = next(springs)
            return replace(each, stiffness=k, damping=d)

        joints = []
        for joint in self.joints:
            turning = with_next(joint)
            joints.append(replace(turning, tilts=tuple(with_next(tilt) for tilt in joint.tilts)) if tilts else turning)
        return replace(self, joints=tuple(joints))

    def heavier(self, factors: FloatArray) -> RobotModel:
        """Return the robot with so many times the mass, and the inertia, of each link, and last of the payload where there is one."""
        values = np.asarray(factors, dtype=float).tolist()
        joints = tuple(replace(joint, body=joint.body.times(k)) for joint, k in zip(self.joints, values, strict=False))
        return replace(self, joints=joints, payload=None if self.payload is None else self.payload.times(values[-1]))

    def posture(self, angles: FloatArray) -> FloatArray:
        """Return a posture as an array, shape (j,) [rad].

        Raises
        ------
        InputError
            If there is not one finite angle a joint.
        """
        found = np.asarray(angles, dtype=float)
        if found.shape != (len(self.joints),) or not np.all(np.isfinite(found)):
            raise InputError("posture", np.degrees(found).tolist(), f"{len(self.joints)} finite angles, one a joint [°]")
        return frozen(found)

    def beyond_limits(self, posture: FloatArray) -> tuple[str, ...]:
        """Return, in words, which angles of a posture no motor reaches; whole turns count.

        Examples
        --------
        >>> import rcsa_ident as ri
        >>> import numpy as np
        >>> robot = ri.sample_robot("tx200")
        >>> robot.beyond_limits(np.radians([0.0, 20.0, 100.0, 0.0, 60.0, 0.0]))
        ()
        >>> robot.beyond_limits(np.radians([0.0, 220.0, 100.0, 0.0, 60.0, 0.0]))
        ('J2 stands at 220.00°, its limits are -115° and 120°',)
        """
        said = []
        for joint, angle in zip(self.joints, posture, strict=True):
            low, high = joint.limits
            # a thousandth of a degree: what a printed angle may have lost
            if not np.isfinite(turned_within(angle, (low - 2e-5, high + 2e-5))):
                said.append(f"{joint.name} stands at {degrees(angle):.2f}°, its limits are {degrees(low):g}° and {degrees(high):g}°")
        return tuple(said)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What speaks against the numbers, in words: bodies that cannot be."""
        said = [text for j in self.joints for text in j.body.warnings(f"link behind {j.name}")]
        return tuple(said if self.payload is None else [*said, *self.payload.warnings("payload")])


def turned_within(angle: float, limits: tuple[float, float], near: float = 0.0) -> float:
    """Return an angle with as many whole turns as bring it within limits, the nearest to another one; NaN where none does."""
    low, high = limits
    turns = np.arange(-3, 4) * 2.0 * np.pi + np.arctan2(np.sin(angle), np.cos(angle))
    within = turns[(turns >= low) & (turns <= high)]
    return float(within[np.argmin(np.abs(within - near))]) if within.size else np.nan


def _axis_name(axis: FloatArray) -> str:
    along = np.flatnonzero(np.abs(axis) > 1.0 - _ROUNDED)
    return "xyz"[along[0]] if along.size else ", ".join(f"{v:.3g}" for v in axis)


def _unit(name: str, axis: FloatArray) -> FloatArray:
    found = frozen(axis)
    if found.shape != (3,) or not abs(np.linalg.norm(found) - 1.0) < _ROUNDED:
        raise InputError(name, np.asarray(axis).tolist(), "a vector of three, of length 1")
    return found
