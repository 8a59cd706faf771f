"""What a table shows of a recording, a mode or a curve, as plain rows: for the console, for machines, for a page."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from itertools import permutations
from typing import Any

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import SHOWN, to_cm3_per_min, to_hz, to_rpm
from rcsa_ident.cutting.force import REFERENCE_RUNOUT, ForceCoefficient, ForceTerm
from rcsa_ident.dynamics.coordinates import Coordinate
from rcsa_ident.dynamics.modal import ModalModel, directions
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.dynamics.uncertain import UncertainReceptance
from rcsa_ident.signals.listening import Listening
from rcsa_ident.signals.measurement import Reading
from rcsa_ident.signals.tap import TapFrf
from rcsa_ident.stability.advice import Advice, PlannedCut
from rcsa_ident.stability.band_shares import BandShares
from rcsa_ident.stability.labels.tested_cuts import Tally
from rcsa_ident.stability.operating_point import HeldBack, OperatingPoint
from rcsa_ident.stability.result import StabilityLobes
from rcsa_ident.tool_holder.learnt import LearnedValue


@dataclass(frozen=True, slots=True)
class RecordingRow:
    """One recording and its verdict.

    `programmed_rpm`, `found_rpm`: float, float or None [rev/min]
    `lines`: points of the cross FRF that it gives, both axes together
    `signal_to_noise_db`: dict of axis to float, median over the lines
    """

    id: str
    tooling: str
    usable: bool
    reasons: tuple[str, ...]
    notes: tuple[str, ...]
    programmed_rpm: float
    found_rpm: float | None = None
    lines: int = 0
    signal_to_noise_db: dict[str, float] = field(default_factory=dict)


def recording_rows(readings: Iterable[Reading]) -> list[RecordingRow]:
    """Return a row for each reading, in their order."""
    rows = []
    for reading in readings:
        verdict = reading.verdict
        common = (reading.cut_id, reading.tooling, verdict.usable, verdict.reasons, verdict.notes, to_rpm(reading.programmed_speed))
        if not reading.measurements:
            rows.append(RecordingRow(*common))
            continue
        of_axis: dict[str, list[FloatArray]] = {}
        for axis, lines in (each for found in reading.measurements for each in found.axes.items() if each[1].omega.size):
            power = np.abs(lines.receptance) ** 2 / (2.0 * np.sum(lines.variance, axis=1))
            of_axis.setdefault(axis.upper(), []).append(power)
        ratios = {axis: float(10.0 * np.log10(np.median(np.concatenate(each)))) for axis, each in of_axis.items()}
        count = sum(part.size for each in of_axis.values() for part in each)
        speed = float(np.mean([found.spindle_speed for found in reading.measurements]))
        rows.append(RecordingRow(*common, to_rpm(speed), count, ratios))
    return rows


@dataclass(frozen=True, slots=True)
class ModeRow:
    """One mode at the flange, in the field's units; standard deviations where a posterior gives them.

    `phi_t`, `phi_r`: complex [sqrt(s/kg)], [sqrt(s/(kg m^2))]
    """

    frequency_hz: float
    damping_percent: float
    phi_t: complex
    phi_r: complex
    frequency_std_hz: float | None = None
    damping_std_percent: float | None = None


def mode_rows(modes: ModalModel, deviation: tuple[FloatArray, FloatArray] | None = None) -> list[ModeRow]:
    """Return a row for each mode, by frequency.

    `deviation`: (array, array); standard deviations of natural frequencies [rad/s] and damping ratios, in the modes' order
    """
    order = np.argsort(modes.omega_n)
    deviations = [(None, None)] * order.size if deviation is None else [(to_hz(d), 100.0 * z) for d, z in zip(*deviation, strict=True)]
    return [
        ModeRow(
            float(to_hz(modes.omega_n[n])),
            float(100.0 * modes.zeta[n]),
            complex(modes.phi[n, 0]),
            complex(modes.phi[n, 1]),
            *deviations[n],
        )
        for n in order
    ]


@dataclass(frozen=True, slots=True)
class WholeModeRow:
    """One mode of a machine whose planes feel each other, its spindle at standstill.

    `direction_deg`: of the line along which it moves the flange, from +X towards +Y
    `phi_t`, `phi_r`: float [sqrt(s/kg)], [sqrt(s/(kg m^2))]; size of its translation and of its slope, whatever their direction
    """

    frequency_hz: float
    damping_percent: float
    direction_deg: float
    phi_t: float
    phi_r: float
    frequency_std_hz: float | None = None
    damping_std_percent: float | None = None


def whole_mode_rows(modes: ModalModel, deviation: tuple[FloatArray, FloatArray] | None = None) -> list[WholeModeRow]:
    """Return a row for each mode of both planes, by frequency.

    `modes`: translation and slope in X, then in Y
    `deviation`: (array, array); as in `mode_rows`
    """
    angles = np.degrees(directions(modes))
    order = np.argsort(modes.omega_n)
    deviations = [(None, None)] * order.size if deviation is None else [(to_hz(d), 100.0 * z) for d, z in zip(*deviation, strict=True)]
    return [
        WholeModeRow(
            float(to_hz(modes.omega_n[n])),
            float(100.0 * modes.zeta[n]),
            float(angles[n]),
            float(np.linalg.norm(modes.phi[n, [0, 2]])),
            float(np.linalg.norm(modes.phi[n, [1, 3]])),
            *deviations[n],
        )
        for n in order
    ]


@dataclass(frozen=True, slots=True)
class CoefficientRow:
    """What was found of a force's uncertain coefficient: a factor on what the campaign says, or a run-out [µm]."""

    name: str
    value: float
    std: float
    unit: str


def coefficient_rows(found: Mapping[ForceCoefficient, tuple[float, float]]) -> list[CoefficientRow]:
    """Return a row for each coefficient of an identification, whose logarithms become factors."""
    rows = []
    for coefficient, (value, std) in found.items():
        name = str(coefficient)
        if coefficient.term is ForceTerm.RUNOUT:
            unit = 1e6 * REFERENCE_RUNOUT
            rows.append(CoefficientRow(name, value * unit, std * unit, "µm"))
        else:
            rows.append(CoefficientRow(name, float(np.exp(value)), float(np.exp(value)) * std, "times the campaign's"))
    return rows


@dataclass(frozen=True, slots=True)
class DrawingRow:
    """A number of a drawing before and after the cuts, as it is written.

    `drawn`, `spread`, `found`, `deviation`: what the drawing says with its standard deviation, and what is believed now with its own
    `hardly`: the cuts hardly taught it
    """

    toolings: str
    what: str
    unit: str
    drawn: str
    spread: str
    found: str
    deviation: str
    hardly: bool

    def __str__(self) -> str:
        return f"{self.toolings}: {self.what} {self.drawn} → {self.found} ± {self.deviation} {self.unit}"


def drawing_rows(learned: Iterable[LearnedValue]) -> list[DrawingRow]:
    """Return a row for each number of the toolings' drawings that was not exact."""
    rows = []
    for each in learned:
        unit, size = SHOWN.get(each.unit, (each.unit, 1.0))
        numbers = [[size * value for value in pair] for pair in ((each.drawn, each.spread), (each.found, each.deviation))]
        # a contact has ten digits in front of its point
        texts = [
            (two_digits(std, value), two_digits(std)) if each.unit in SHOWN else (f"{value:.3g}", f"{std:.2g}") for value, std in numbers
        ]
        (drawn, spread), (found, deviation) = texts
        rows.append(DrawingRow(", ".join(each.toolings), each.words, unit, drawn, spread, found, deviation, each.hardly))
    return rows


@dataclass(frozen=True, slots=True)
class PeakRow:
    """Where a tip receptance is largest, and where its real part is lowest (which limits a cut)."""

    frequency_hz: float
    magnitude: float
    lowest_real_part: float


def peak_row(frequency_hz: np.ndarray, values: np.ndarray) -> PeakRow:
    """Return the largest peak of a receptance [m/N]."""
    k = int(np.argmax(np.abs(values)))
    return PeakRow(float(frequency_hz[k]), float(np.abs(values[k])), float(values.real.min()))


def two_digits(std: float, value: float | None = None) -> str:
    """Return a standard deviation with two digits and no exponent, below a millionth 0; or a value with as many places as it."""
    places = max(0, 1 - int(np.floor(np.log10(std)))) if std > 1e-6 else 0 if value is None else 6
    return f"{std if value is None else value:.{places}f}"


def lobes_summary(advice: Advice) -> dict[str, Any]:
    """Return what is worth knowing of stability limits without reading the curve; None where there is nothing to tell.

    The stability limit is where chatter begins; the recommended depth is the limit less what a recommendation holds back.
    """
    lobes = advice.lobes
    return {
        "method": lobes.method,
        "state": advice.state or None,
        "absolute_limit_mm": finite(lobes.absolute_limit, 1e3),
        "absolute_frequency_hz": None if lobes.absolute_frequency is None else to_hz(lobes.absolute_frequency),
        "best_speeds": [
            {
                "spindle_speed_rpm": to_rpm(pocket.spindle_speed, 6),
                "limit_depth_mm": finite(pocket.limit_depth, 1e3),
                "recommended_depth_mm": finite(pocket.recommended_depth, 1e3),
            }
            for pocket in advice.pockets
        ],
        "recommended_by": advice.recommended_by,
        "recommended": [_point(point, lobes) for point in advice.recommended],
        "withheld": lobes.withheld or None,
        "band": band_summary(advice.band),
        "around": [_limits(each) for each in advice.around],
        "flip_speeds": int(lobes.flip.sum()),
        "tested": None if advice.tested is None else tally_summary(advice.tested),
    }


def lobes_curves(advice: Advice) -> dict[str, Any]:
    """Return stability limits over speed; None belongs to a cut that is stable up to the depth that was asked for.

    A preview has neither band nor recommended depths; limits around the recommended cuts have bands of their own.
    """
    lobes = advice.lobes
    recommended = np.full(lobes.spindle_speed.shape, np.nan) if advice.preview else advice.usable.stable
    return {
        **_limits(lobes, band=not advice.preview),
        "recommended_depth_mm": _finite_list(1e3 * recommended),
        "lobe": [None if n < 0 else n for n in lobes.lobe.tolist()],
        "flip": lobes.flip.tolist(),
    }


def _limits(lobes: StabilityLobes, band: bool = True) -> dict[str, Any]:
    low, high = (lobes.band or (None, None)) if band else (None, None)
    return {
        "spindle_speed_rpm": to_rpm(lobes.spindle_speed, 6).tolist(),
        "limit_depth_mm": _finite_list(lobes.limit_depth * 1e3),
        "limit_depth_low_mm": None if low is None else _finite_list(low * 1e3),
        "limit_depth_high_mm": None if high is None else _finite_list(high * 1e3),
        "chatter_frequency_hz": _finite_list(to_hz(lobes.chatter_frequency)),
    }


def tally_summary(tally: Tally) -> dict[str, Any]:
    """Return how many tested cuts were told right."""
    return asdict(tally) | {"share_right": finite(tally.share_right)}


def advice_summary(advice: Advice) -> dict[str, Any]:
    """Return which cuts are recommended, the speeds for a depth, and how planned cuts stand."""
    common = advice.common
    return {
        "tooling": advice.tooling,
        "stickout_mm": None if advice.stickout is None else advice.stickout * 1e3,
        "state": advice.state or None,
        "lowest_limit_mm": finite(float(advice.lobes.limit_depth.min()), 1e3),
        "common_stable_depth_mm": None if common is None else finite(float(common.min()), 1e3),
        "withheld": advice.lobes.withheld or None,
        "recommended_by": advice.recommended_by,
        "band": band_summary(advice.band),
        "highest_removal": [_point(point, advice.lobes) for point in advice.recommended],
        "windows": [
            {
                "from_rpm": to_rpm(w.low, 6),
                "to_rpm": to_rpm(w.high, 6),
                "best_rpm": to_rpm(w.best, 6),
                "allowed_mm": finite(w.allowed, 1e3),
            }
            for w in advice.windows
        ],
        "planned": [_planned(cut) for cut in advice.planned],
        "around": [_limits(each) for each in advice.around],
    }


def band_summary(band: BandShares | None) -> dict[str, Any] | None:
    """Return what the band of the first recommended cut's limit consists of."""
    if band is None:
        return None
    shares = [{"of": str(name), "share": share} for name, share in band.shares.items()]
    most = band.leading
    leading = None if most is None else {"parameter": most.name, "share": most.share, "in_words": most.words}
    return {"deviation_percent": 100.0 * band.deviation, "shares": shares, "depends_most_on": leading, "in_words": band.words}


def _point(point: OperatingPoint, lobes: StabilityLobes) -> dict[str, Any]:
    depth, held = finite(point.depth, 1e3), point.held
    return {
        "spindle_speed_rpm": to_rpm(point.spindle_speed, 6),
        "recommended_depth_mm": depth,
        "limit_depth_mm": None if point.limit >= lobes.max_depth else point.limit * 1e3,
        "axial_depth_mm": depth,
        "removal_rate_cm3_per_min": None if point.removal_rate is None else to_cm3_per_min(point.removal_rate),
        "power_kw": None if point.power is None else point.power * 1e-3,
        "torque_nm": point.torque,
        "bound": str(point.bound),
        "why": point.why or None,
        "held_back": None if held is None else _held_back(held, lobes.max_depth),
    }


def _held_back(held: HeldBack, max_depth: float) -> dict[str, Any]:
    steps = {"within_tolerance_mm": held.within_tolerance, "with_probability_mm": held.with_probability, "less_reserve_mm": held.depth}
    depths = {name: None if depth is None or depth >= max_depth else 1e3 * depth for name, depth in steps.items()}
    shares = {"tolerance": held.tolerance, "probability": held.probability, "reserve": held.reserve}
    return depths | {f"{name}_percent": 100.0 * share for name, share in shares.items()} | {"in_words": str(held)}


def _planned(cut: PlannedCut) -> dict[str, Any]:
    return {
        "spindle_speed_rpm": to_rpm(cut.spindle_speed, 6),
        "axial_depth_mm": cut.depth * 1e3,
        "stable": cut.stable,
        "method": cut.method,
        "limit_depth_mm": finite(cut.limit, 1e3),
        "robust_limit_mm": finite(cut.robust_limit, 1e3),
        "margin": finite(cut.margin),
        "chatter_frequency_hz": None if cut.chatter_frequency is None else to_hz(cut.chatter_frequency),
        "slower_rpm": None if cut.slower is None else to_rpm(cut.slower, 6),
        "faster_rpm": None if cut.faster is None else to_rpm(cut.faster, 6),
        "probability": cut.probability,
        "load": finite(cut.load),
        "power_kw": cut.power * 1e-3,
        "torque_nm": cut.torque,
        "removal_rate_cm3_per_min": to_cm3_per_min(cut.removal_rate),
    }


def entries_of(receptance: Receptance, coordinates: Sequence[Coordinate] | None = None) -> dict[str, tuple[Coordinate, Coordinate]]:
    """Return motion and force of each direct receptance under its axis' name, then of each cross term that is not zero: XY is X by Y.

    `coordinates`: translations, one for each axis; by default all rows
    """
    known = receptance.rows if coordinates is None else tuple(coordinates)
    found = {c.dof.upper(): (c, c) for c in known}
    crossed = ((row, col) for row, col in permutations(known, 2) if np.any(receptance.between(str(row), str(col))))
    return found | {f"{row.dof}{col.dof}".upper(): (row, col) for row, col in crossed}


def frf_summary(receptance: UncertainReceptance, coordinates: Sequence[Coordinate]) -> dict[str, Any]:
    """Return receptances over frequency with standard deviations where there are some [m/N]: of each axis, and across where planes couple.

    `coordinates`: translations, one for each axis
    Raises `InputError` if a receptance is not finite.
    """
    deviation = receptance.deviation()
    axes: dict[str, Any] = {}
    cross: dict[str, Any] = {}
    for name, (row, col) in entries_of(receptance, coordinates).items():
        real, imaginary = deviation.get((row, col), (None, None))
        values = receptance.between(str(row), str(col))
        parts = {"re": values.real, "im": values.imag, "re_std": real, "im_std": imaginary}
        if not all(part is None or np.all(np.isfinite(part)) for part in parts.values()):
            raise InputError("tooling", "a receptance that is not finite", "a tooling whose receptance is finite at every frequency")
        (axes if row == col else cross)[name] = {key: None if part is None else part.tolist() for key, part in parts.items()}
    return {"frequency_hz": np.round(to_hz(receptance.omega), 9).tolist(), "axes": axes, "cross": cross}


def listening_row(answer: Listening) -> dict[str, Any]:
    """Return what a recording says in the units of the shop floor, of an answer with its record."""
    assert answer.record is not None

    def rpm(speed: float | None) -> float | None:
        return None if speed is None else to_rpm(speed)

    return {
        "channels": list(answer.record.channels),
        "quantity": str(answer.record.quantity),
        "verdict": str(answer.verdict),
        "reasons": list(answer.reasons),
        "spindle_speed_rpm": rpm(answer.spindle_speed),
        "spindle_speed_std_rpm": rpm(answer.spindle_speed_std),
        "other_speeds_rpm": [to_rpm(speed) for speed in answer.other_speeds],
        "speed_probabilities": list(answer.speed_probabilities),
        "chatter_probability": answer.chatter_probability,
        "speed_wander_percent": None if answer.wander is None else 100.0 * answer.wander,
        "ramp": None if answer.ramp is None else [to_rpm(speed) for speed in answer.ramp],
        "teeth": answer.teeth,
        "explained_share": answer.explained_share,
        "folded_orders": answer.folded,
        "chatter_frequencies_hz": list(answer.chatter),
        "chatter_aliases_hz": list(answer.aliases),
        "chatter_lines_hz": list(answer.lines),
        "suggested_speeds_rpm": [to_rpm(speed) for speed in answer.suggested_speeds],
        "events": [{"event": event.kind, "time_s": event.time} for event in answer.events],
        "duration_s": answer.duration,
        "part_s": list(answer.part),
        "band_hz": answer.band,
    }


def tap_row(found: TapFrf, names: Sequence[str]) -> dict[str, Any]:
    """Return what became of hammer hits. `names`: of the recordings, in their order."""
    rows = [
        {"recording": names[hit.record], "time_s": hit.time, "force_n": hit.force, "left_out": hit.reason or None} for hit in found.hits
    ]
    band = to_hz(found.omega[[0, -1]]).tolist()
    return {"hits": rows, "used": found.used, "band_hz": band, "window_decay_per_s": found.window_decay, "remarks": list(found.remarks)}


def finite(value: float | None, unit: float = 1.0) -> float | None:
    """Return a number in a unit, None where it is not known or not finite."""
    return None if value is None or not np.isfinite(value) else value * unit


def _finite_list(values: FloatArray) -> list[float | None]:
    known: list[float | None] = values.tolist()
    return known if np.all(np.isfinite(values)) else [finite(value) for value in values.tolist()]
