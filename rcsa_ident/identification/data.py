"""What the identification is given: the cuts' lines beside the tool-holders' receptances, as flat arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np

from rcsa_ident.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.cutting.force import SLOPES, ForceCoefficient, ForceTerm
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.errors import InputError
from rcsa_ident.identification.hammer_lines import HammerLines
from rcsa_ident.signals.frf import AxisLines
from rcsa_ident.signals.measurement import CutMeasurement

#: Slopes are multiplied and moments divided by it, so that all receptances have one unit and size [m].
LEVER = 0.1
#: Standard deviation of a clamping's run-out, in units of the cutting model's reference.
RUNOUT_SPREAD = 3.0
#: Where within the half of a frequency range a line sweeps its tool-holder is asked beside the middle: Gauss's node.
NODE = float(np.sqrt(0.6))
#: Half the range of the spindle speeds, over their middle, below which nothing is asked about a change with speed.
LEAST_SPEED_RANGE = 0.05


#: Frequencies [rad/s] and the spindle's speed over each, shape (n,) both, to the free receptances of a turning tool-holder for x + i y
#: and x - i y, shape (n, 4, 4) each: translation and slope of the tip, then of the flange.
Turning = Callable[[FloatArray, FloatArray], tuple[ComplexArray, ComplexArray]]


@dataclass(frozen=True, slots=True, eq=False)
class AxisData:
    """Points of one axis, sorted by cut and, in a cut, by order; each with one output (the flange's motion) or two (gap, fixture).

    Behind the cuts stand hammer tests (`HammerLines`), as cuts of one output without an air cut whose forces are measured.

    Parameters
    ----------
    axis : Dof
    omega, order : arrays, shape (n,) [rad/s], [-]
        Frequency of each point, and that over the spindle's.
    variance : array, shape (n, o) [m^2/N^2]
        Variance of the real and imaginary part each.
    lines : complex array, shape (n, o, 2) [m/N]
        Cut and turned air cut over the simulated force.
    cut : array of int, shape (n,)
        Index into the data's cuts.
    flange : complex array, shape (n, 3) [m/N]
        A22 of the cut's tooling: tt, tr, rr, scaled by the lever.
    tip : complex array, shape (n, 2) [m/N]
        A21 for a force at the tip: t, r.
    force_slope : complex array, shape (n, c) [-]
        Change of the force's logarithm with each uncertain coefficient.
    force, across : complex arrays, shape (n,) [N]
        Force along this axis, and along the other one in the same lines; empty where the latter is not told.
    across_slope : complex array, shape (n, c) or (0, c) [-]
        `force_slope` of the other axis' force, without smooth errors.
    beside : array, shape (n, o) or (0, o) [m^2/N^2]
        What is added to the lines' own power where their model error is a share of it.
    on_holder : array of bool, shape (n,) or (0,)
        Points whose motion is the tool-holder's, not the machine's; empty where there are none.
    still : array of bool, shape (n,) or (0,)
        Points at which the spindle did not turn; empty where there are none.
    point : complex array, shape (n, 3) or (0, 3) [m/N]
        Of those: their free receptance to the force, and minus that to the flange: t, r.
    sweep : array, shape (n, 2) or (0, 2) [rad/s^2], [s]
        By which a line's frequency changes, and for how long; empty where none does.
    around : complex array, shape (n, 2, 5) or (0, 2, 5) [m/N]
        `flange` and `tip` at `node` below and above each frequency.
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

    def __post_init__(self) -> None:
        for name in ("omega", "order", "variance", "beside", "sweep"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        for name in ("lines", "flange", "tip", "force_slope", "force", "across", "across_slope", "point", "around"):
            object.__setattr__(self, name, frozen(getattr(self, name), np.complex128))
        for name in ("on_holder", "still"):
            object.__setattr__(self, name, frozen(getattr(self, name), np.bool_))

    def kernel_points(self, relative_speed: FloatArray) -> FloatArray:
        """Return frequency, relative speed, whose motion it is, and whether the spindle stands, as the kernel takes them, shape (n, 4).

        Parameters
        ----------
        relative_speed : array, shape (n,)
        """
        own = ~self.on_holder if self.on_holder.size else np.ones(self.omega.size)
        still = self.still if self.still.size else np.zeros(self.omega.size)
        return np.column_stack([self.omega, relative_speed, own, still])

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
        """Number of outputs of each point: 1 or 2."""
        return self.variance.shape[1]

    @property
    def measured(self) -> ComplexArray:
        """The flange's motion, cut less air cut, shape (n,) [m/N]."""
        return np.sum(self.lines[:, :, 0] - self.lines[:, :, 1], axis=1)

    @property
    def noise(self) -> FloatArray:
        """Variance of the flange's motion, of the real and the imaginary part each, shape (n,) [m^2/N^2]."""
        return np.sum(self.variance, axis=1)

    @property
    def power(self) -> FloatArray:
        """Power of each line, of which a model error is a share, shape (n, o) [m^2/N^2]."""
        size = np.abs(self.lines[:, :, 0] - self.lines[:, :, 1]) ** 2
        return size + self.beside if self.beside.size else size

    def summed(self) -> AxisData:
        """Return the same points with the flange's motion as the only output."""
        if self.outputs == 1:
            return self
        lines, beside = np.sum(self.lines, axis=1, keepdims=True), np.sum(self.beside, axis=1, keepdims=True)
        return replace(self, variance=self.noise[:, None], lines=lines, beside=beside if self.beside.size else self.beside)

    def of(self, keep: np.ndarray) -> AxisData:
        """Return some of the points: a mask or indices, shape (n,)."""
        whole = (each.name for each in fields(self) if each.name != "axis")
        return replace(self, **{name: getattr(self, name)[keep] for name in whole if len(getattr(self, name))})


def nodes(sweep: FloatArray) -> FloatArray:
    """Return how far from the middle of each line's range its tool-holder is asked, shape (n,) [rad/s]; `sweep` as in `AxisData`."""
    return NODE * 0.5 * np.abs(sweep[:, 0]) * sweep[:, 1]


@dataclass(frozen=True, slots=True, eq=False)
class CutPrior:
    """What is known beforehand of each cut's delay and of the angle to its air cut; arrays of shape (k,).

    Parameters
    ----------
    delay : array [s]
        From a trigger of known tooth angle.
    delay_weight : array [1/s^2]
        Inverse variance of it; 0 without such a trigger.
    angle_weight : array [1/rad^2]
        Inverse variance of the angle between cut and air cut, whose mean is 0.
    tooth_period : array [s]
        In which the delay may lie anywhere where nothing is known of it.
    """

    delay: FloatArray
    delay_weight: FloatArray
    angle_weight: FloatArray
    tooth_period: FloatArray

    def __post_init__(self) -> None:
        for each in fields(self):
            object.__setattr__(self, each.name, frozen(getattr(self, each.name)))

    @property
    def weights(self) -> FloatArray:
        """Weights of delay and angle, shape (k, 2)."""
        return np.stack([self.delay_weight, self.angle_weight], axis=1)

    @property
    def rows(self) -> FloatArray:
        """All four side by side, as the kernel takes them, shape (k, 4)."""
        return np.stack([self.delay, self.delay_weight, self.angle_weight, self.tooth_period], axis=1)


@dataclass(frozen=True, slots=True, eq=False)
class IdentificationData:
    """All cuts of a campaign, and behind them its hammer tests: cuts without an air cut whose forces are measured.

    Parameters
    ----------
    cut_ids : tuple of str, length k
    cut_tooling : array of int, shape (k,)
    toolings : tuple of str
    axes : tuple of AxisData
    spindle_speed : array, shape (k,) [rad/s]
    cut_prior : CutPrior
    clamping : array of int, shape (k,)
        Which unknown tooth angle stands between the cut's trigger and its delay; -1 where there is none.
    edge : array, shape (k, 2)
        Time of that trigger's edge [s] and its weight [1/s^2].
    coefficients : tuple of ForceCoefficient, length c
        What is uncertain about the forces.
    coefficient_spread : tuple of float, length c or more
        Their standard deviations; behind them those of smooth errors, which have no name.
    turning : mapping of tooling to Turning
        Its receptances while it turns; empty where nobody asks for them.
    tests : tuple of HammerLines
        The last of the cuts. Their gains have no name among the coefficients either and stand in front of the smooth errors.
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

    @property
    def cuts(self) -> int:
        """Number of cuts that are none of the hammer's tests."""
        return len(self.cut_ids) - len(self.tests)

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

        Parameters
        ----------
        share : float
            Standard deviation of each term's real and imaginary part.
        terms : int
            Chebyshev polynomials from 0 Hz to the highest line.
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

    def with_forces_of(self, other: IdentificationData) -> IdentificationData:
        """Return these lines with what other data of the same cuts hold uncertain about their forces: without smooth errors."""
        axes = tuple(replace(axis, force_slope=own.force_slope) for axis, own in zip(self.axes, other.axes, strict=True))
        return replace(self, axes=axes, coefficient_spread=other.coefficient_spread)

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
            cut_prior=CutPrior(*self.cut_prior.rows[keep].T),
            clamping=self.clamping[keep],
            edge=self.edge[keep],
        )

    def only(self, axis: Dof) -> IdentificationData:
        """Return the same data with one axis."""
        return replace(self, axes=tuple(a for a in self.axes if a.axis is axis), turning={})

    def summed(self) -> IdentificationData:
        """Return the same data with the flange's motion as the only output, and without the triggers of unknown tooth angle."""
        return replace(self, axes=tuple(a.summed() for a in self.axes), clamping=np.full(self.clamping.size, -1))


def prepare(
    measurements: Sequence[CutMeasurement],
    receptances: Mapping[str, Callable[[FloatArray], Receptance]],
    teeth: Mapping[str, int],
    coefficient_spread: Sequence[float] = (),
    turning: Mapping[str, Turning] | None = None,
) -> IdentificationData:
    """Return the data of all measurements; each tool-holder is asked once for the frequencies of all its cuts.

    Parameters
    ----------
    measurements : sequence of CutMeasurement
    receptances : mapping of tooling to a function omega -> Receptance
        Free-free receptances with points ``tip`` and ``flange`` in one bending plane.
    teeth : mapping of tooling to its number of teeth
    coefficient_spread : sequence of float, length c
        Standard deviations of K_tc's, k_rc's, K_te's and K_re's logarithms; 0 where known exactly. Without them the forces are
        taken as they are, and cutters to run true.
    turning : mapping of tooling to Turning, optional
        Asked only where both planes are fitted together.

    Raises
    ------
    InputError
        If there are no measurements.
    """
    if not measurements:
        raise InputError("cuts", "none usable", "at least one usable cut")
    toolings = tuple(dict.fromkeys(m.tooling for m in measurements))
    axes = tuple(axis for axis in (Dof.X, Dof.Y) if any(axis in m.axes for m in measurements))
    holder: dict[str, FloatArray] = {}
    table: dict[str, ComplexArray] = {}
    for name in toolings:
        own = [(m, m.axes[a]) for m in measurements if m.tooling == name for a in m.axes]
        asked = [lines.omega + side * nodes(_sweep(m, lines)) for m, lines in own for side in ((-1, 0, 1) if m.acceleration else (0,))]
        omega = np.unique(np.concatenate(asked or [np.zeros(0)]))
        response = receptances[name](omega)
        a22, a21 = response["flange", "flange"], response["flange", "tip"]
        columns = (a22[:, 0, 0], LEVER * a22[:, 0, 1], LEVER**2 * a22[:, 1, 1], a21[:, 0, 0], LEVER * a21[:, 1, 0])
        table[name] = np.stack(columns, axis=1)
        holder[name] = omega
    sweeping = any(m.acceleration for m in measurements)

    def at(measurement: CutMeasurement, omega: FloatArray) -> ComplexArray:
        """Flange and tip of the tool-holder at frequencies that were asked, shape (n, 5)."""
        return table[measurement.tooling][np.searchsorted(holder[measurement.tooling], omega)]

    uncertain = [c for c, spread in enumerate(coefficient_spread) if spread > 0.0]
    coefficients = [ForceCoefficient(SLOPES[c]) for c in uncertain]
    spread = [float(coefficient_spread[c]) for c in uncertain]
    if coefficient_spread:
        coefficients += [ForceCoefficient(ForceTerm.RUNOUT, name) for name in toolings]
        spread += [RUNOUT_SPREAD] * len(toolings)
    data = []
    for axis in axes:
        present = [(k, m, m.axes[axis]) for k, m in enumerate(measurements) if axis in m.axes]
        # a cut without an accelerometer's lines leaves the axis with the sum of both
        lines = (
            [each.summed() for _, _, each in present] if len({each.outputs for _, _, each in present}) > 1 else [e for _, _, e in present]
        )
        free = np.concatenate([at(m, each.omega) for _, m, each in present])
        sweeps = [_sweep(m, each) for _, m, each in present] if sweeping else []
        beside = [
            np.stack([at(m, each.omega + side * nodes(own)) for side in (-1, 1)], axis=1)
            for (_, m, each), own in zip(present, sweeps, strict=sweeping)
        ]
        data.append(
            AxisData(
                axis=axis,
                omega=np.concatenate([each.omega for each in lines]),
                order=np.concatenate([each.order for each in lines]).astype(float),
                variance=np.concatenate([each.variance for each in lines]),
                lines=np.concatenate([np.stack([each.cut, each.air], axis=2) for each in lines]),
                cut=np.concatenate([np.full(each.omega.size, k) for k, _, each in present]),
                flange=free[:, :3],
                tip=free[:, 3:],
                force_slope=np.concatenate(
                    [_slopes(each.force_slope, uncertain, toolings.index(m.tooling), len(coefficients)) for _, m, each in present]
                ),
                **({"sweep": np.concatenate(sweeps), "around": np.concatenate(beside)} if sweeping else {}),
                **_both_forces([(each, toolings.index(m.tooling)) for _, m, each in present], uncertain, len(coefficients)),
            )
        )
    speed = np.array([m.spindle_speed for m in measurements])
    index = np.array([toolings.index(m.tooling) for m in measurements])
    prior, clamping, edge = _cut_priors(measurements, speed, teeth)
    return IdentificationData(
        cut_ids=tuple(m.cut_id for m in measurements),
        cut_tooling=index,
        toolings=toolings,
        axes=tuple(data),
        spindle_speed=frozen(speed),
        cut_prior=prior,
        clamping=frozen(clamping, np.intp),
        edge=frozen(edge),
        coefficients=tuple(coefficients),
        coefficient_spread=tuple(spread),
        turning={} if turning is None else turning,
    )


def _sweep(measurement: CutMeasurement, lines: AxisLines) -> FloatArray:
    """By which each line's frequency changes, and for how long, shape (n, 2) [rad/s^2], [s]."""
    return np.column_stack([lines.order * measurement.acceleration, np.full(lines.omega.size, measurement.length)])


def _slopes(slope: ComplexArray, uncertain: Sequence[int], tooling: int, count: int) -> ComplexArray:
    """Columns of a cut's force slopes: the coefficients that all cuts share, then its own tooling's run-out, shape (n, count)."""
    columns = np.zeros((slope.shape[0], count), dtype=complex)
    columns[:, : len(uncertain)] = slope[:, uncertain]
    if count > len(uncertain):
        columns[:, len(uncertain) + tooling] = slope[:, -1]
    return columns


def _both_forces(lines: Sequence[tuple[AxisLines, int]], uncertain: Sequence[int], count: int) -> dict[str, ComplexArray]:
    """Forces along both axes in the lines of one, where all cuts tell them."""
    found = [(e.force, e.across, e.across_slope, t) for e, t in lines if e.across is not None and e.across_slope is not None]
    if len(found) < len(lines):
        return {}
    return {
        "force": np.concatenate([force for force, _, _, _ in found]),
        "across": np.concatenate([across for _, across, _, _ in found]),
        "across_slope": np.concatenate([_slopes(slope, uncertain, tooling, count) for _, _, slope, tooling in found]),
    }


def _cut_priors(
    measurements: Sequence[CutMeasurement], speed: FloatArray, teeth: Mapping[str, int]
) -> tuple[CutPrior, np.ndarray, FloatArray]:
    """What is known of each cut's delay and air-cut angle; which clamping its trigger belongs to, and that trigger's edge."""
    count = len(measurements)
    delay, delay_weight, edge = np.zeros(count), np.zeros(count), np.zeros((count, 2))
    angle_weight = np.array([1.0 / max(m.alignment_std, 1e-4) ** 2 for m in measurements])
    tooth_period = np.array([2.0 * np.pi / speed[k] / teeth[m.tooling] for k, m in enumerate(measurements)])
    clamping = np.full(count, -1)
    names: dict[str, int] = {}
    for k, m in enumerate(measurements):
        if m.delay is None or m.delay_std is None:
            continue
        if m.tooth_angle_known:
            delay[k], delay_weight[k] = m.delay, 1.0 / m.delay_std**2
        else:
            clamping[k] = names.setdefault(m.clamping or m.tooling, len(names))
            edge[k] = m.delay, 1.0 / m.delay_std**2
    return CutPrior(delay, delay_weight, angle_weight, tooth_period), clamping, edge
