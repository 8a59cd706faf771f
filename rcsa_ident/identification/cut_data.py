"""From the cuts' measurements to the data of an identification: lines beside their tool-holders' receptances."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.force import SLOPES, ForceCoefficient, ForceTerm
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.identification.data import LEVER, AxisData, IdentificationData, Turning, nodes
from rcsa_ident.identification.made_cuts import CutPrior
from rcsa_ident.identification.status import FEWEST_OF_HOUSING, FEWEST_TOOLINGS
from rcsa_ident.signals.frf import AxisLines
from rcsa_ident.signals.measurement import CutMeasurement

#: Standard deviation of a clamping's run-out, in units of the cutting model's reference.
RUNOUT_SPREAD = 3.0


def prepare(
    measurements: Sequence[CutMeasurement],
    receptances: Mapping[str, Callable[[FloatArray], Receptance]],
    teeth: Mapping[str, int],
    coefficient_spread: Sequence[float] = (),
    turning: Mapping[str, Turning] | None = None,
    unlike: Collection[str] = (),
) -> IdentificationData:
    """Return the data of all measurements; each tool-holder is asked once for the frequencies of all its cuts.

    `receptances`: mapping of tooling to a function omega -> Receptance, free-free receptances with points ``tip`` and ``flange`` in one
        bending plane
    `teeth`: mapping of tooling to its number of teeth
    `coefficient_spread`: sequence of float, length c. Standard deviations of K_tc's, k_rc's, K_te's and K_re's logarithms; 0 where known
        exactly. Without them the forces are taken as they are, and cutters to run true.
    `turning`: mapping of tooling to Turning; asked only where both planes are fitted together
    `unlike`: toolings whose teeth are unlike: a delay is one of a turn, and not of a tooth's pitch
    Raises `InputError` if there are no measurements; if some are of the flange and some of the housing; or if all are of the housing, and
        of one tooling.
    """
    if not measurements:
        raise InputError("cuts", "none usable", "at least one usable cut")
    toolings = tuple(dict.fromkeys(m.tooling for m in measurements))
    _sensible(measurements, toolings)
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
        lines = _alike([each for _, _, each in present])
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
                shares=lines[0].output_shares,
                behind=0.0,
                **({"sweep": np.concatenate(sweeps), "around": np.concatenate(beside)} if sweeping else {}),
                **_both_forces([(each, toolings.index(m.tooling)) for _, m, each in present], uncertain, len(coefficients)),
            )
        )
    speed = np.array([m.spindle_speed for m in measurements])
    index = np.array([toolings.index(m.tooling) for m in measurements])
    prior, clamping, edge = _cut_priors(measurements, speed, teeth, unlike)
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


def _alike(lines: list[AxisLines]) -> list[AxisLines]:
    """The lines of an axis with the outputs that all its cuts have: a cut without an accelerometer's lines leaves the axis without them."""
    for fewer in (AxisLines.first, AxisLines.summed):
        if len({each.output_shares.tobytes() for each in lines}) > 1:
            lines = [fewer(each) for each in lines]
    return lines


def _sensible(measurements: Sequence[CutMeasurement], toolings: Sequence[str]) -> None:
    """Refuse cuts of which only some saw the flange, and what one tooling cannot tell where none did."""
    housing = sum(m.housing for m in measurements)
    if 0 < housing < len(measurements):
        told = f"{housing} of {len(measurements)} cuts with accelerometers on the housing alone"
        raise InputError("sensors", told, "a displacement sensor at the flange in all cuts or in none")
    if housing and len(toolings) < FEWEST_TOOLINGS:
        allowed = f"at least {FEWEST_TOOLINGS}, better {FEWEST_OF_HOUSING}: the flange shows on the housing by what changes with them"
        raise InputError("toolings", f"{toolings[0]} alone, with accelerometers on the housing alone", allowed)


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
    measurements: Sequence[CutMeasurement], speed: FloatArray, teeth: Mapping[str, int], unlike: Collection[str]
) -> tuple[CutPrior, np.ndarray, FloatArray]:
    """What is known of each cut's delay and air-cut angle; which clamping its trigger belongs to, and that trigger's edge."""
    count = len(measurements)
    delay, delay_weight, edge = np.zeros(count), np.zeros(count), np.zeros((count, 2))
    angle_weight = np.array([1.0 / max(m.alignment_std, 1e-4) ** 2 for m in measurements])
    passing = np.array([teeth[m.tooling] for m in measurements], dtype=float)
    pitches = np.where([m.tooling in unlike for m in measurements], passing, 1.0)
    tooth_period = 2.0 * np.pi / speed / passing * pitches
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
    return CutPrior(delay, delay_weight, angle_weight, tooth_period, pitches), clamping, edge
