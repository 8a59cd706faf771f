"""Milling in time: a tool that springs carry goes through material that it takes away, and its force pushes it aside.

What a tooth finds is what the teeth before it left, wherever they were pushed: regeneration, teeth that leave the material, entry and exit
come of themselves [huynh2018].
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.teeth import Slices, slices_of
from rcsa_ident.dynamics.poles import PoleResidue
from rcsa_ident.dynamics.state_space import StateSpace
from rcsa_ident.dynamics.structure import Structure
from rcsa_ident.toolpath._kernels import march as kernels
from rcsa_ident.toolpath.walls import Walls

#: Share of the radius by which a tip may be off its path: the walls are those on both sides of a path that the tool is on.
LOST = 0.1
#: Share of the strongest mode's peak below which another one counts for nothing.
_WEAK = 0.01
#: A carrier without modes.
_NO_MODES = PoleResidue(np.zeros(0), np.zeros((3, 0)), np.zeros((0, 3)), np.zeros((3, 3)))
#: Within what the tip's place at an instant is solved [m].
SOLVED = 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class Carrier:
    """What carries a tool: M q'' + D q' + K q = load + motion^T F with springs that may have play, and modes beside it; rigid by default.

    `mass`, `damping`, shape (n, n)
    `stiffness`, shape (n,): each freedom has a spring of its own, as a joint has
    `motion`, shape (3, n): of the tool's tip along the feed, its normal and the axis towards the spindle, with each freedom
    `play`: array, shape (n,), default none; half of it: a spring feels nothing within
    `load`: array, shape (n,), default none; that is always there, as weight is
    `zero`: array, shape (3,), default none [m]; where the tip counts as on its path: the sag at which the workpiece was touched
    `modes`: from the force to what the tip moves by besides, 3 by 3

    Examples
    --------
    An arm of 100 kg on 1 N/um, seen along the feed:

    >>> Carrier(np.array([[100.0]]), np.array([[2e3]]), np.array([1e6]), np.array([[1.0], [0.0], [0.0]])).stiffness.tolist()
    [1000000.0]
    """

    mass: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    damping: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    stiffness: FloatArray = field(default_factory=lambda: np.zeros(0))
    motion: FloatArray = field(default_factory=lambda: np.zeros((3, 0)))
    play: FloatArray = field(default=None)  # type: ignore[arg-type]
    load: FloatArray = field(default=None)  # type: ignore[arg-type]
    zero: FloatArray = field(default=None)  # type: ignore[arg-type]
    modes: PoleResidue | None = None

    def __post_init__(self) -> None:
        n = np.shape(self.stiffness)[0]
        shapes = {"mass": (n, n), "damping": (n, n), "stiffness": (n,), "motion": (3, n), "play": (n,), "load": (n,), "zero": (3,)}
        for name, shape in shapes.items():
            given = getattr(self, name)
            values = frozen(np.zeros(shape) if given is None else given)
            if values.shape != shape or not np.all(np.isfinite(values)):
                raise InputError(name, values.shape, f"finite numbers, shape {shape}")
            object.__setattr__(self, name, values)
        if self.modes is not None and self.modes.constant.shape != (3, 3):
            raise InputError("modes", self.modes.constant.shape, "three directions by three")

    @classmethod
    def at_tip(cls, structure: Structure, lever: float = 0.0, play: FloatArray | None = None, load: FloatArray | None = None) -> Carrier:
        """Return a structure whose freedoms have springs of their own as what carries a tip.

        `structure`: over x, its slope, y, its slope and z where a tool-holder sits, in the feed's axes (`FlexibleRobot.at`)
        `lever` [m]: from there to the tip; what lies between is rigid
        `play`, `load`, shape (n,)
        Raises `InputError` if its springs couple freedoms.
        """
        springs = np.diag(structure.stiffness)
        if np.any(np.abs(structure.stiffness - np.diag(springs)) > 1e-12 * springs.max()) or structure.structural_damping.any():
            raise InputError("stiffness", "springs between freedoms", "a spring for each of them alone")
        x, slope_x, y, slope_y, z = structure.ports.T[:5]
        motion = np.stack([x - lever * slope_x, y - lever * slope_y, z])
        none = np.zeros_like(springs)
        return cls(structure.mass, structure.damping, springs, motion, none if play is None else play, none if load is None else load)

    @property
    def poles(self) -> PoleResidue:
        """Its freedoms without their play as modes of the tip, 3 by 3."""
        n = self.stiffness.size
        zero, compliance = np.zeros((n, n)), np.linalg.inv(self.mass)
        rates = np.block([[zero, np.eye(n)], [-compliance * self.stiffness, -compliance @ self.damping]])
        pushed = np.concatenate([np.zeros((n, 3)), compliance @ self.motion.T])
        moved = np.concatenate([self.motion, np.zeros((3, n))], axis=1)
        return PoleResidue.from_state_space(StateSpace(rates, pushed, moved, np.zeros((3, 3))))

    @property
    def rest(self) -> FloatArray:
        """Where the load leaves the freedoms, shape (n,)."""
        twist = self.load / self.stiffness
        return twist + np.sign(twist) * self.play

    @property
    def fastest(self) -> float:
        """Of its modes the highest frequency that moves the tip by a hundredth of what the softest one does [rad/s]; 0 without modes."""
        if self.modes is None or not self.modes.pole.size:
            return 0.0
        size = np.linalg.norm(self.modes.outputs, axis=0) * np.linalg.norm(self.modes.inputs, axis=1) / -self.modes.pole.real
        return float(np.max(np.abs(self.modes.pole.imag)[size >= _WEAK * size.max()]))

    @property
    def sag(self) -> FloatArray:
        """Where the load leaves the tip, shape (3,) [m]."""
        return np.asarray(self.motion @ self.rest)


@dataclass(frozen=True, slots=True, eq=False)
class Cut:
    """How the tool turns and what it takes.

    `depth` [m]: axial, from the tip up
    `spindle_speed` [rad/s]
    `slices`: int, default 6; of what stands between bottom and depth
    `bottom` [m], default 0: height above the tip below which there is no material beside the path
    """

    cutter: Cutter
    coefficients: CuttingCoefficients
    depth: float
    spindle_speed: float
    slices: int = 6
    bottom: float = 0.0

    def __post_init__(self) -> None:
        positive("depth", self.depth, "m")
        positive("spindle_speed", self.spindle_speed, "rad/s")
        if not 1 <= self.slices <= 1000:
            raise InputError("slices", self.slices, "1 to 1000")
        if not 0.0 <= self.bottom < self.depth:
            raise InputError("bottom", self.bottom, f"0 or more, below the depth of {self.depth:g} m")

    @property
    def parts(self) -> Slices:
        """Its slices: as many levels as the walls need."""
        if self.bottom == 0.0:
            return slices_of(self.cutter, self.depth, self.slices)
        whole = int(np.ceil(self.slices * self.depth / (self.depth - self.bottom) - 1e-9))
        found = slices_of(self.cutter, self.depth, whole, heights=(self.bottom,))
        above = found.height > self.bottom
        return Slices(*(values[..., above] for values in found))


@dataclass(frozen=True, slots=True, eq=False)
class March:
    """What happened in a march, and where it can go on.

    `step` [s]; `time` [s], shape (k,)
    `force` [N], shape (k, 3): on the tool along the feed, its normal and the axis towards the spindle
    `tip` [m], shape (k, 3): by which the tip is off its path
    `unsettled`: instants at which force and deflection did not agree within a tenth of a micrometre; as a rule they do within `SOLVED`
    `lost`: whether the tip was ever off its path by more than `LOST` radii: what follows means nothing
    `state`, shape (3, n): deflections, rates and accelerations of the carrier's freedoms at the end
    `swing`, shape (m,): of its modes
    `angle` [rad]: of tooth 1 at the next instant
    `trail`, `held`: arrays, shapes (teeth, slices, m, 2) [m] and (teeth, slices); where each edge stood lately, and of how many instants
    """

    step: float
    time: FloatArray
    force: FloatArray
    tip: FloatArray
    unsettled: int
    lost: bool
    state: FloatArray
    swing: ComplexArray
    angle: float
    trail: FloatArray
    held: np.ndarray


def start_of(carrier: Carrier, cut: Cut, step: float, time: float = 0.0, angle: float = 0.0) -> March:
    """Return the state before a march: at rest under the carrier's load, no edge has been anywhere.

    `step` [s]; `time` [s]
    `angle` [rad]: of tooth 1, clockwise from the normal
    """
    state = np.zeros((3, carrier.stiffness.size))
    state[0] = carrier.rest
    none, edges = np.zeros((1, 3)), cut.parts.lag.shape
    swing = np.zeros(0 if carrier.modes is None else carrier.modes.pole.size, dtype=complex)
    turn = int(np.ceil(2.0 * np.pi / (cut.spindle_speed * positive("step", step, "s"))))
    return March(
        step,
        np.array([time]),
        none,
        none,
        0,
        False,
        state,
        swing,
        angle,
        np.zeros((*edges, max(turn, 2), 2)),
        np.zeros(edges, dtype=np.int64),
    )


def march(before: March, carrier: Carrier, cut: Cut, walls: Walls, places: FloatArray) -> March:
    """March on through walls, which are taken down.

    Freedoms by Newmark's mean acceleration (beta 1/4, gamma 1/2), modes exactly for a force that is linear between instants; force and
    deflection of an instant are solved together.

    Parameters
    ----------
    before : March
        Where it goes on from: of `start_of`, or an earlier one with the same carrier's freedoms.
    carrier : Carrier
    cut : Cut
    walls : Walls
    places : array, shape (k, 2) [m]
        Where the tool's centre is sent at each instant, along the walls and beside.

    Notes
    -----
    Per instant n^2 for the inverse and n^2 for the damping, and as many rays as there are edges in slices, two or three times over.
    """
    parts, c = cut.parts, cut.coefficients
    if walls.tops.shape[1] != parts.radius.size:
        raise InputError("walls", f"{walls.tops.shape[1]} slices", f"{parts.radius.size}, as the cut has")
    step, count = before.step, len(places)
    turning = before.angle + cut.spindle_speed * step * np.arange(count + 1)
    cutting = c.tangential, c.tangential * c.radial_ratio, c.tangential * c.axial_ratio, c.tangential_edge, c.radial_edge, c.axial_edge
    inverse = np.linalg.inv(carrier.mass + 0.5 * step * carrier.damping + 0.25 * step**2 * np.diag(carrier.stiffness))
    edges = np.stack([parts.radius + parts.offset, np.sin(parts.lean), np.cos(parts.lean), parts.width], axis=-1)
    force, tip = np.empty((count, 3)), np.empty((count, 3))
    modes = _NO_MODES if carrier.modes is None else carrier.modes
    turn = modes.pole * step
    first = np.expm1(turn) / turn
    second = (first - 1.0) / turn
    went = kernels.Going(before.state.copy(), before.swing.copy(), before.force[-1].copy(), before.trail.copy(), before.held.copy())
    unsettled = kernels.march(
        kernels.Springs(inverse, carrier.damping, carrier.stiffness, carrier.load, carrier.motion, carrier.zero, carrier.play),
        kernels.Swings(np.exp(turn), step * (first - second), step * second, modes.outputs, modes.inputs, modes.constant),
        went,
        kernels.Teeth(edges, parts.lag - cut.cutter.tooth_angle[:, None], np.array(cutting)),
        kernels.Columns(walls.tops, walls.feet, walls.start, walls.spacing),
        np.column_stack([turning[:-1], places]),
        step,
        SOLVED,
        force,
        tip,
    )
    time = before.time[-1] + step * np.arange(1, count + 1)
    lost = before.lost or bool(np.any(np.abs(tip) > LOST * parts.radius.max()))
    return March(step, time, force, tip, unsettled, lost, went.state, went.swing, float(turning[-1]), went.trail, went.held)


def mill_block(
    carrier: Carrier, cut: Cut, length: float, sides: tuple[float, float], feed_per_tooth: float, steps: int = 720, spacing: float = 4e-6
) -> tuple[March, Walls]:
    """Return a straight pass along a block, from where the cutter begins to touch it to where its centre leaves it, and the walls left.

    `length` [m]
    `sides`: tuple of float [m], of the block, along the normal from the path, the lower one first; infinite where the cutter does not come
        to them
    `feed_per_tooth` [m]: on average over the teeth
    `steps`: a revolution
    `spacing` [m]: of the walls' columns
    """
    parts, step = cut.parts, 2.0 * np.pi / cut.spindle_speed / steps
    reach = float(np.max(parts.radius + parts.offset.max(axis=0)))
    nearest = min(max(sides[0], 0.0), sides[1]) if sides[1] > 0.0 else sides[1]
    start = -np.sqrt(max(reach**2 - nearest**2, 0.0))
    walls = Walls.block(length, *sides, parts.radius.size, 1.2 * reach, spacing)
    rate = positive("feed_per_tooth", feed_per_tooth, "m") * cut.cutter.teeth * cut.spindle_speed / (2.0 * np.pi)
    x = start + rate * step * np.arange(int((length - start) / (rate * step)))
    return march(start_of(carrier, cut, step), carrier, cut, walls, np.column_stack([x, np.zeros_like(x)])), walls
