"""What the identification is given: the cuts' lines beside the tool-holders' receptances, as flat arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.cutting.force import ForceCoefficient
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.hammer_lines import HammerLines
from rcsa_ident.identification.made_cuts import CutPrior, MadeCuts, in_order
from rcsa_ident.identification.rough_toolings import RoughLines, placed
from rcsa_ident.identification.status import FEWEST_CUTS, FEWEST_OF_HOUSING
from rcsa_ident.signals.motion import FLANGE_ALONE, ONE_PLACE, searched, usual_shares
from rcsa_ident.tool_holder.drawings import RoughToolings
from rcsa_ident.tool_holder.rough import RoughToolHolder

#: Slopes are multiplied and moments divided by it, so that all receptances have one unit and size [m].
LEVER = 0.1
#: Where within the half of a frequency range a line sweeps its tool-holder is asked beside the middle: Gauss's node.
NODE = float(np.sqrt(0.6))
#: Share of the lines by which force model, tool-holder or sensors may be wrong alike at neighbouring frequencies.
SMOOTH_ERROR = 2e-3
#: Half the range of the spindle speeds, over their middle, below which nothing is asked about a change with speed.
LEAST_SPEED_RANGE = 0.05


#: Frequencies [rad/s] and the spindle's speed over each, shape (n,) both, to the free receptances of a turning tool-holder for x + i y
#: and x - i y, shape (n, 4, 4) each: translation and slope of the tip, then of the flange.
Turning = Callable[[FloatArray, FloatArray], tuple[ComplexArray, ComplexArray]]


@dataclass(frozen=True, slots=True, eq=False)
class AxisData:
    """Points of one axis, sorted by cut and, in a cut, by order; each with one output or more.

    One is the flange's motion and two are gap and fixture, where `shares` does not tell otherwise.

    Behind the cuts stand hammer tests (`HammerLines`), as cuts of one output without an air cut whose forces are measured.

    `omega`, `order`: arrays, shape (n,) [rad/s], [-]; frequency of each point, and that over the spindle's
    `variance` [m^2/N^2], shape (n, o): variance of the real and imaginary part each
    `lines` [m/N], shape (n, o, 2): cut and turned air cut over the simulated force
    `cut`: array of int, shape (n,); index into the data's cuts
    `flange` [m/N], shape (n, 3): A22 of the cut's tooling: tt, tr, rr, scaled by the lever
    `tip` [m/N], shape (n, 2): A21 for a force at the tip: t, r
    `force_slope` [-], shape (n, c): change of the force's logarithm with each uncertain coefficient
    `force`, `across` [N], shape (n,): force along this axis, and along the other one in the same lines; empty where the latter is not told
    `across_slope`: complex array, shape (n, c) or (0, c) [-]; `force_slope` of the other axis' force, without smooth errors
    `beside`: array, shape (n, o) or (0, o) [m^2/N^2]; what is added to the lines' own power where their model error is a share of it
    `on_holder`: array of bool, shape (n,) or (0,); points whose motion is the tool-holder's, not the machine's; empty where there are none
    `still`: array of bool, shape (n,) or (0,); points at which the spindle did not turn; empty where there are none
    `point`: complex array, shape (n, 3) or (0, 3) [m/N]; of those: their free receptance to the force, and minus that to the flange: t, r
    `sweep`: array, shape (n, 2) or (0, 2) [rad/s^2], [s]; by which a line's frequency changes, and for how long; empty where none does
    `around`: complex array, shape (n, 2, 5) or (0, 2, 5) [m/N]; `flange` and `tip` at `node` below and above each frequency
    `talk`: complex array, shape (n, o, 2) or (0, 0, 0) [m/N]; what `lines` would hold besides if a sensor felt as much of the other axis'
        motion as of its own; empty where none does
    `shares`: array, shape (o, 1 + e) or (0, 0) [-]. What of the flange's motion, and of that of other places of the machine, is in each
        output. The first output, or the first two, is what a search looks for: the flange's motion, or where no sensor sees that, another
        place's.
    `behind` [-]: how far behind the joint the flange's sensor looks, over the lever; negative: at the holder
    """

    axis: Dof
    omega: FloatArray
    order: FloatArray
    variance: FloatArray
    lines: ComplexArray
    cut: np.ndarray
    flange: ComplexArray
    tip: ComplexArray
    force_slope: ComplexArray
    force: ComplexArray = field(default_factory=lambda: np.zeros(0, dtype=complex))
    across: ComplexArray = field(default_factory=lambda: np.zeros(0, dtype=complex))
    across_slope: ComplexArray = field(default_factory=lambda: np.zeros((0, 0), dtype=complex))
    beside: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    on_holder: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    still: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    point: ComplexArray = field(default_factory=lambda: np.zeros((0, 3), dtype=complex))
    sweep: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))
    around: ComplexArray = field(default_factory=lambda: np.zeros((0, 2, 5), dtype=complex))
    talk: ComplexArray = field(default_factory=lambda: np.zeros((0, 0, 0), dtype=complex))
    shares: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    behind: float = 0.0

    def __post_init__(self) -> None:
        for name in ("omega", "order", "variance", "beside", "sweep", "shares"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        for name in ("lines", "flange", "tip", "force_slope", "force", "across", "across_slope", "point", "around", "talk"):
            object.__setattr__(self, name, frozen(getattr(self, name), np.complex128))
        for name in ("on_holder", "still"):
            object.__setattr__(self, name, frozen(getattr(self, name), np.bool_))

    @property
    def kernel_points(self) -> FloatArray:
        """Frequency, whose motion it is, whether the spindle stands, and the joint's factor 1, as the kernel takes them, shape (n, 4)."""
        own = ~self.on_holder if self.on_holder.size else np.ones(self.omega.size)
        still = self.still if self.still.size else np.zeros(self.omega.size)
        return np.column_stack([self.omega, own, still, np.ones(self.omega.size)])

    @property
    def kernel_holder(self) -> ComplexArray:
        """The tool-holders' receptances as the kernel takes them, shape (n, 8) [m/N]."""
        point = self.point if self.point.size else np.zeros((self.omega.size, 3))
        return np.concatenate([self.flange, self.tip, point], axis=1)

    @property
    def node(self) -> FloatArray:
        """Distance from each frequency at which `around` is told, shape (n,) [rad/s]; 0 where it does not sweep."""
        return nodes(self.sweep)

    @property
    def outputs(self) -> int:
        """Number of outputs of each point."""
        return self.variance.shape[1]

    @property
    def output_shares(self) -> FloatArray:
        """What of the flange's motion and of that of other places is in each output, shape (o, 1 + e) [-]."""
        return self.shares if self.shares.size else usual_shares(self.outputs)

    @property
    def places(self) -> int:
        """Number of places beside the flange whose motion is in the outputs."""
        return self.output_shares.shape[1] - 1

    @property
    def of_flange(self) -> bool:
        """Whether the flange's motion is among what was measured."""
        return bool(self.output_shares[0, 0])

    @property
    def searched(self) -> slice:
        """The outputs whose sum a search looks for: those that are the flange's motion together, or the first one."""
        return searched(self.output_shares)

    @property
    def measured(self) -> ComplexArray:
        """The motion that a search looks for, cut less air cut, shape (n,) [m/N]."""
        return np.sum(self.lines[:, self.searched, 0] - self.lines[:, self.searched, 1], axis=1)

    @property
    def noise(self) -> FloatArray:
        """Variance of it, of the real and the imaginary part each, shape (n,) [m^2/N^2]."""
        return np.sum(self.variance[:, self.searched], axis=1)

    @property
    def power(self) -> FloatArray:
        """Power of each line, of which a model error is a share, shape (n, o) [m^2/N^2]."""
        size = np.abs(self.lines[:, :, 0] - self.lines[:, :, 1]) ** 2
        return size + self.beside if self.beside.size else size

    def summed(self) -> AxisData:
        """Return the same points with the motion that a search looks for as the only output."""
        if self.outputs == 1:
            return self
        lines = np.sum(self.lines[:, self.searched], axis=1, keepdims=True)
        beside = np.sum(self.beside[:, self.searched], axis=1, keepdims=True) if self.beside.size else self.beside
        talk = np.sum(self.talk[:, self.searched], axis=1, keepdims=True) if self.talk.size else self.talk
        shares = FLANGE_ALONE if self.of_flange else ONE_PLACE
        return replace(self, variance=self.noise[:, None], lines=lines, beside=beside, talk=talk, shares=shares)

    def first(self) -> AxisData:
        """Return the same points with the outputs alone that a search looks for, not summed: without accelerometers on the housing."""
        own = self.searched
        if own.stop == self.outputs:
            return self
        beside = self.beside[:, own] if self.beside.size else self.beside
        shares = usual_shares(own.stop) if self.of_flange else ONE_PLACE
        talk = self.talk[:, own] if self.talk.size else self.talk
        return replace(self, variance=self.variance[:, own], lines=self.lines[:, own], beside=beside, talk=talk, shares=shares)

    def of(self, keep: np.ndarray) -> AxisData:
        """Return some of the points: a mask or indices, shape (n,)."""
        whole = (each.name for each in fields(self) if each.name not in ("axis", "shares", "behind"))
        return replace(self, **{name: getattr(self, name)[keep] for name in whole if len(getattr(self, name))})


def nodes(sweep: FloatArray) -> FloatArray:
    """Return how far from the middle of each line's range its tool-holder is asked, shape (n,) [rad/s]; `sweep` as in `AxisData`."""
    return NODE * 0.5 * np.abs(sweep[:, 0]) * sweep[:, 1]


@dataclass(frozen=True, slots=True, eq=False)
class IdentificationData:
    """All cuts of a campaign, and behind them its hammer tests: cuts without an air cut whose forces are measured.

    `cut_ids`: tuple of str, length k
    `cut_tooling`: array of int, shape (k,)
    `spindle_speed` [rad/s], shape (k,)
    `clamping`: array of int, shape (k,); which unknown tooth angle stands between the cut's trigger and its delay; -1 where there is none
    `edge`, shape (k, 2): time of that trigger's edge [s] and its weight [1/s^2]
    `coefficients`: tuple of ForceCoefficient, length c; what is uncertain about the forces
    `coefficient_spread`: tuple of float, length c or more; their standard deviations; behind them those of smooth errors, which have no
        name
    `turning`: mapping of tooling to Turning, its receptances while it turns; empty where nobody asks for them
    `tests`: the last of the cuts. Their gains have no name among the coefficients either and stand in front of the smooth errors.
    `softening_spread` [-]: standard deviation of the stiffness' change from the middle to the end of the speeds; None where nobody told any
    `talk_place`: where the share that an axis' sensor feels of the other axis' motion stands among the coefficients
    `distance_place`: where what is not known of an axis' `behind` stands among them
    `distance_told`: whether somebody has told where the flange's sensors look
    `made`: when the cuts, without the tests, were made, and which of them judge the answer
    `rough`: what drawings do not tell; unknowns in units of their spreads, behind the gains and in front of the smooth errors
    `rough_holders`: one for each tooling, where there is something that drawings do not tell
    `rough_first`: where their unknowns begin among the coefficients
    `rough_start`, shape (u,): values of theirs at which `flange` and `tip` of the axes stand, and from which a fit starts
    `further`: what `identification.further_unknowns` has added
    `warmth`: array, shape (k,) or (0,) [-]; how much warmer the machine was at each cut than the one that is answered for, as a share of
        what it warms up by; empty where that is not in the model
    `course`, shape (k, q): how that changes with each of what is not known of it
    `course_first`: where these begin among the coefficients
    `steady` [-]: how much warmer a warm machine is at the highest speed than at the middle one
    `grip`, shape (k, q) or (0, 0): how the logarithm of the joint's stiffnesses changes in each cut with what stands at `grip_places`
    `grip_places`: array of int, shape (q,), among the coefficients
    """

    cut_ids: tuple[str, ...]
    cut_tooling: np.ndarray
    toolings: tuple[str, ...]
    axes: tuple[AxisData, ...]
    spindle_speed: FloatArray
    cut_prior: CutPrior
    clamping: np.ndarray
    edge: FloatArray
    coefficients: tuple[ForceCoefficient, ...] = ()
    coefficient_spread: tuple[float, ...] = ()
    turning: Mapping[str, Turning] = field(default_factory=dict)
    tests: tuple[HammerLines, ...] = ()
    softening_spread: float | None = None
    talk_place: Mapping[Dof, int] = field(default_factory=dict)
    distance_place: Mapping[Dof, int] = field(default_factory=dict)
    distance_told: bool = True
    made: MadeCuts = field(default=None)  # type: ignore[assignment]
    rough: RoughToolings | None = None
    rough_holders: tuple[RoughToolHolder, ...] = ()
    rough_first: int = 0
    rough_start: FloatArray = field(default_factory=lambda: np.zeros(0))
    further: tuple[Any, ...] = ()
    warmth: FloatArray = field(default_factory=lambda: np.zeros(0))
    course: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    course_first: int = 0
    steady: float = 0.0
    grip: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    grip_places: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.intp))

    def __post_init__(self) -> None:
        if self.made is None:
            object.__setattr__(self, "made", in_order(self.cuts))

    def learned_from(self) -> IdentificationData:
        """Return the same data without the cuts that judge the answer."""
        keep = np.ones(len(self.cut_ids), dtype=bool)
        keep[: self.cuts] = ~self.made.judged
        return self if np.all(keep) else self.of_cuts(np.flatnonzero(keep))

    @property
    def used_toolings(self) -> tuple[str, ...]:
        """Toolings of which there are lines."""
        return tuple(self.toolings[t] for t in np.unique(self.cut_tooling))

    @property
    def course_place(self) -> slice:
        """Where what is not known of the warmth stands among the coefficients."""
        return slice(self.course_first, self.course_first + self.course.shape[1])

    @property
    def rough_place(self) -> slice:
        """Where what drawings do not tell stands among the coefficients."""
        return slice(self.rough_first, self.rough_first + (0 if self.rough is None else len(self.rough.unknowns)))

    def rough_lines(self) -> RoughLines | None:
        """Return the tool-holders at all lines as functions of what their drawings do not tell; None where all are as drawn."""
        if self.rough is None:
            return None
        points = [(axis.omega, self.cut_tooling[axis.cut]) for axis in self.axes]
        hit = {int(t) for t in self.cut_tooling[self.cuts :]}
        return RoughLines(self.rough, self.rough_holders, points, LEVER, self.rough_first, hit)

    def with_unknowns(self, spread: tuple[float, ...], slopes: Sequence[FloatArray] | Sequence[ComplexArray] | None) -> IdentificationData:
        """Return the same data with further unknowns behind the coefficients.

        `spread`: their standard deviations
        `slopes`: how the logarithms of each axis' lines change with them, shape (n, unknowns); None where they do not
        """
        axes = []
        for i, axis in enumerate(self.axes):
            more = np.zeros((axis.omega.size, len(spread))) if slopes is None else slopes[i]
            # the other axis' force in the same lines is asked for where both planes are one machine alone, which has none of these
            across = np.pad(axis.across_slope, ((0, 0), (0, len(spread)))) if axis.across_slope.size else axis.across_slope
            axes.append(replace(axis, force_slope=np.hstack([axis.force_slope, more]), across_slope=across))
        return replace(self, axes=tuple(axes), coefficient_spread=(*self.coefficient_spread, *spread))

    def with_toolings_at(self, values: FloatArray) -> IdentificationData:
        """Return the same data whose tool-holders stand at other values of what their drawings do not tell, shape (u,)."""
        lines = self.rough_lines()
        assert lines is not None
        axes = []
        for axis, toolings in zip(self.axes, lines.at(values, False), strict=True):
            hit = axis.on_holder if axis.on_holder.size else np.zeros(axis.omega.size, dtype=bool)
            holder = placed(axis.kernel_holder, toolings, hit)
            point = holder[:, 5:] if axis.point.size else axis.point
            axes.append(replace(axis, flange=holder[:, :3], tip=holder[:, 3:5], point=point))
        return replace(self, axes=tuple(axes), rough_start=values)

    def as_drawn(self) -> IdentificationData:
        """Return the same data whose tool-holders are taken as they were drawn."""
        if self.rough is None:
            return self
        place = self.rough_place
        drop = np.arange(place.start, place.stop)
        axes = []
        for axis in self.axes:
            across = np.delete(axis.across_slope, drop, axis=1) if axis.across_slope.size else axis.across_slope
            axes.append(replace(axis, force_slope=np.delete(axis.force_slope, drop, axis=1), across_slope=across))
        spread = (*self.coefficient_spread[: place.start], *self.coefficient_spread[place.stop :])
        return replace(self, axes=tuple(axes), coefficient_spread=spread, rough=None, rough_holders=())

    @property
    def cuts(self) -> int:
        """Number of cuts that are none of the hammer's tests."""
        return len(self.cut_ids) - len(self.tests)

    @property
    def of_flange(self) -> bool:
        """Whether the flange's motion was measured, along each axis."""
        return all(axis.of_flange for axis in self.axes)

    @property
    def side_minima(self) -> bool:
        """Whether further starts pay: no sensor sees the flange, of fewer than three toolings, each of which has cut often enough."""
        _, cuts = np.unique(self.cut_tooling[: self.cuts], return_counts=True)
        return not self.of_flange and cuts.size < FEWEST_OF_HOUSING and bool(np.all(cuts >= FEWEST_CUTS))

    @property
    def sweeps(self) -> bool:
        """Whether the speed changed while some of the lines were recorded."""
        return any(np.any(axis.sweep[:, 0]) for axis in self.axes)

    @property
    def swept_cuts(self) -> int:
        """Number of cuts that are windows of a pass."""
        own = [axis.cut[axis.sweep[:, 0] != 0.0] for axis in self.axes if axis.sweep.size]
        return int(np.unique(np.concatenate(own)).size) if own else 0

    @property
    def stands_still(self) -> bool:
        """Whether some of the points belong to a spindle that stands still, and others to one that turns."""
        return self.cuts > 0 and any(test.standstill for test in self.tests)

    @property
    def clampings(self) -> int:
        """Number of unknown tooth angles."""
        return int(np.max(self.clamping, initial=-1)) + 1

    @property
    def speed_range(self) -> tuple[float, float]:
        """Middle of the spindle speeds and half their range [rad/s]; the latter 0 where nothing can change with speed."""
        speed = self.spindle_speed[: self.cuts]
        # the answer's own speeds, whatever judges it
        speed = speed[~self.made.judged] if not np.all(self.made.judged) else speed
        if speed.size == 0:
            return 0.0, 0.0
        low, high = float(np.min(speed)), float(np.max(speed))
        return 0.5 * (low + high), 0.5 * (high - low)

    @property
    def speed_changes(self) -> bool:
        """Whether the spindle speeds differ by enough to ask what changes with them."""
        middle, half = self.speed_range
        return half > LEAST_SPEED_RANGE * middle

    @property
    def band_hz(self) -> tuple[float, float]:
        """Lowest and highest line of all axes [Hz]."""
        omega = np.concatenate([axis.omega for axis in self.axes])
        return float(omega.min() / (2.0 * np.pi)), float(omega.max() / (2.0 * np.pi))

    @property
    def relative_speed(self) -> FloatArray:
        """Spindle speed of each cut, from -1 at the lowest (and where it stands still) to 1 at the highest, shape (k,) [-]."""
        middle, half = self.speed_range
        if half == 0.0:
            return np.zeros(self.spindle_speed.size)
        return np.where(np.arange(self.spindle_speed.size) < self.cuts, (self.spindle_speed - middle) / half, -1.0)

    def with_smooth_errors(self, share: float, terms: int = 4) -> IdentificationData:
        """Return the same data whose lines may be wrong by a smooth factor of their frequency, for each axis and tooling.

        Where the model of force, tool-holder or sensor is off by a little, it is off by nearly the same in neighbouring lines,
        and no number of cuts averages that out.

        `share`: standard deviation of each term's real and imaginary part
        `terms`: Chebyshev polynomials from 0 Hz to the highest line
        """
        toolings = len(self.toolings)
        highest = max(float(a.omega.max()) for a in self.axes)
        axes = []
        for i, axis in enumerate(self.axes):
            basis = np.polynomial.chebyshev.chebvander(2.0 * axis.omega / highest - 1.0, terms - 1)
            columns = np.zeros((axis.omega.size, len(self.axes), toolings, 2, terms), dtype=complex)
            place = (np.arange(axis.omega.size), i, self.cut_tooling[axis.cut])
            columns[(*place, 0)], columns[(*place, 1)] = basis, 1j * basis
            axes.append(replace(axis, force_slope=np.hstack([axis.force_slope, columns.reshape(axis.omega.size, -1)])))
        count = len(self.axes) * toolings * 2 * terms
        spread = (*self.coefficient_spread, *(share,) * count)
        return replace(self, axes=tuple(axes), coefficient_spread=spread)

    def of_cuts(self, keep: np.ndarray) -> IdentificationData:
        """Return the same data with some of the cuts: ascending indices, those of all hammer tests among them."""
        number = np.full(len(self.cut_ids), -1)
        number[keep] = np.arange(keep.size)
        axes = [axis.of(number[axis.cut] >= 0) for axis in self.axes]
        return replace(
            self,
            cut_ids=tuple(self.cut_ids[k] for k in keep),
            cut_tooling=self.cut_tooling[keep],
            axes=tuple(replace(axis, cut=number[axis.cut]) for axis in axes),
            spindle_speed=self.spindle_speed[keep],
            cut_prior=CutPrior(*self.cut_prior.columns[keep].T),
            clamping=self.clamping[keep],
            edge=self.edge[keep],
            warmth=self.warmth[keep] if self.warmth.size else self.warmth,
            course=self.course[keep] if self.course.size else self.course,
            grip=self.grip[keep] if self.grip.size else self.grip,
            made=self.made.of(keep[keep < self.cuts]),
        )

    def only(self, axis: Dof) -> IdentificationData:
        """Return the same data with one axis."""
        return replace(self, axes=tuple(a for a in self.axes if a.axis is axis), turning={})

    @property
    def beside(self) -> bool:
        """Whether further places are among the outputs, beside those that a search looks for."""
        return any(axis.searched.stop < axis.outputs for axis in self.axes)

    def first(self) -> IdentificationData:
        """Return the same data without those further places."""
        return replace(self, axes=tuple(a.first() for a in self.axes)) if self.beside else self

    def summed(self) -> IdentificationData:
        """Return the same data with the flange's motion as the only output, and without the triggers of unknown tooth angle."""
        return replace(self, axes=tuple(a.summed() for a in self.axes), clamping=np.full(self.clamping.size, -1))
