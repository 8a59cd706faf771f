"""What a worker answers: plain tables with the units of the files, None where nothing is known."""

from __future__ import annotations

import math
import tempfile
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from api.work.machine_cache import Known, Shelf, parsed, read
from api.work.requests import AdviceQuestion, CutQuestion, LobeQuestion, MachineText, TipQuestion, ToolingText, TooLong
from api.work.toolings import tooling_of, weigh
from rcsa_ident.arrays import FloatArray
from rcsa_ident.cutting.materials import material
from rcsa_ident.cutting.power import SpindleDrive
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.errors import InputError
from rcsa_ident.identification.posterior import spread
from rcsa_ident.io.curves import write_frf_csv
from rcsa_ident.io.identifications import workpiece_from_json
from rcsa_ident.machining_setup import Tooling
from rcsa_ident.stability.full_discretisation import FullDiscretisation
from rcsa_ident.stability.multi_frequency import MultiFrequency
from rcsa_ident.stability.semi_discretisation import SemiDiscretisation
from rcsa_ident.stability.tested_cuts import TestedCuts, Verdict
from rcsa_ident.stability.time_domain import TimeDomain
from rcsa_ident.stability.zero_order import ZeroOrder
from rcsa_ident.workflows.advice import highest_removal, planned_cut, speed_windows, usable_depths
from rcsa_ident.workflows.limits import Limits, classify_tested_cuts, machine_limits, pad_speeds
from rcsa_ident.workflows.lobes import MARCHING, LobeConditions, band_warning, best_speeds
from rcsa_ident.workflows.tip import TooltipResponse
from rcsa_ident.workflows.tip import tooltip as tip_response

_RPM = 30.0 / math.pi
_METHODS: dict[str, Any] = {
    "zero-order": ZeroOrder,
    "multi-frequency": MultiFrequency,
    "semi-discretisation": SemiDiscretisation,
    "full-discretisation": FullDiscretisation,
    "time-domain": TimeDomain,
}
#: Seconds for one speed at 4000 rev/min, on a core of a plain server; lobes come closer as a spindle turns slower.
_COST = {"zero-order": 2e-5, "multi-frequency": 0.15, "semi-discretisation": 0.4, "full-discretisation": 0.06, "time-domain": 4.5}
#: Further seconds: for one speed with bands; for unequal pitch, times as much; for a machine that changes with speed.
_BAND_COST, _PITCH_FACTOR, _CHANGING = 2e-4, 30.0, 4.0
#: Machines drawn from a posterior, as with `lobes`; how far beyond the band methods that fit modes look.
DRAWS, BEYOND = 60, 1.5
MOST_LINES = 20_000

_MODE = ("natural_frequency_hz", "natural_frequency_std_hz", "damping_ratio", "damping_ratio_std", "phi_t", "phi_r")

_ALLOWED = "at most {:g} s (fewer of them, no bands, zero-order)"

_shelf = Shelf(4)


def keep(machines: int) -> None:
    """Say how many machines this worker keeps."""
    _shelf.most = machines


def check(text: str) -> dict[str, Any]:
    """Return what a result says in short, after everything in it has been checked."""
    data = parsed(text)
    # a failed identification is a result, too, but nothing to compute with
    if data["axes"]:
        read(text)
    return summary_of(data)


def summary_of(data: dict[str, Any]) -> dict[str, Any]:
    """Return a result in short."""
    return {
        "status": data["status"],
        "reasons": data["reasons"],
        "campaign": data["campaign"]["name"],
        "axes": sorted(data["axes"]),
        "band_hz": data["band_hz"],
    }


def modes(data: dict[str, Any]) -> dict[str, Any]:
    """Return the modes of a result that has been checked."""
    axes = {}
    for name, axis in data["axes"].items():
        rows = [{key: mode.get(key) for key in _MODE} for mode in axis["modes"]]
        axes[name] = {"modes": rows, "joint": axis["joint"], "misfit_per_point": axis.get("misfit", {}).get("chi2_per_point")}
    return {key: data.get(key, []) for key in ("status", "reasons", "notes", "band_hz")} | {"axes": axes}


def flange_frf(machine: MachineText, lines: tuple[float, float | None, float], work_seconds: float) -> dict[str, Any]:
    """Return the spindle's receptance at its flange, translation over force, with the posterior's standard deviations."""
    known = _shelf.get(machine)
    frequency = _lines(known, *lines)
    _affordable(known.spread_seconds(frequency.size), f"{frequency.size} frequencies", work_seconds)
    omega = 2.0 * np.pi * frequency
    curves, deviations = {}, {}
    for axis, part in known.machine.whole.items():

        def at_flange(model: Any, _joint: Any) -> Any:
            return model.receptance(omega)["flange", "flange"][:, 0, 0]

        curves[axis] = at_flange(*part.at(axis, None))
        if part.posterior is not None:
            change = spread(part.posterior, axis, at_flange)
            deviations[axis] = (np.sqrt(np.sum(change.real**2, axis=0)), np.sqrt(np.sum(change.imag**2, axis=0)))
    return _frf(frequency, curves, deviations)


def tooltip(machine: MachineText, tooling: ToolingText, question: TipQuestion, csv: bool = False) -> Any:
    """Return the tooltip FRF with standard deviations, as a table or as the text of FRF.csv."""
    known, tool = _shelf.get(machine), tooling_of(tooling.text)
    frequency = _lines(known, question.low, question.high, question.step)
    weigh(tool.assembly, float(frequency[-1]))
    omega = 2.0 * np.pi * frequency
    response: TooltipResponse
    if known.quick and np.array_equal(omega, known.omega()):
        response = known.side(question.bands).response(tool.assembly, question.bands, question.stiffness_spread)
    else:
        if question.bands:
            _affordable(known.spread_seconds(omega.size), f"{omega.size} frequencies with bands", question.work_seconds)
        own = known.machine.at(question.speed)
        response = tip_response(own, tool.assembly, omega, question.bands, question.speed, question.stiffness_spread)
    tips = {axis: response.tip(axis) for axis in response.coupled}
    if csv:
        return _csv(frequency, tips, response.deviation)
    warnings = _outside(known, None if question.speed is None else np.array([question.speed]))
    if frequency[-1] > 1.001 * known.data["band_hz"][1]:
        warnings.append(f"the machine was identified up to {known.data['band_hz'][1]:.0f} Hz; above that the FRF is extrapolated")
    return {"tooling": tooling.name, "warnings": [*_doubts(known), *warnings]} | _frf(frequency, tips, response.deviation)


def lobes(machine: MachineText, tooling: ToolingText, question: LobeQuestion) -> dict[str, Any]:
    """Return the stability lobes of a tooling."""
    known, tool = _shelf.get(machine), tooling_of(tooling.text)
    process = _process(question.cut, tool, known)
    limits = _limits(known, tool, process, question, np.array(question.speeds))
    tested = _tested(known, tool, process, question)
    found, band = limits.lobes, limits.band
    return {
        "tooling": tooling.name,
        "method": found.method,
        "spindle_speed_rpm": np.round(found.spindle_speed * _RPM, 6).tolist(),
        "limit_depth_mm": _numbers(found.limit_depth * 1e3),
        "limit_depth_low_mm": None if band is None else _numbers(band[0] * 1e3),
        "limit_depth_high_mm": None if band is None else _numbers(band[1] * 1e3),
        "chatter_frequency_hz": _numbers(found.chatter_frequency / (2.0 * math.pi)),
        "lobe": [None if n < 0 else n for n in found.lobe.tolist()],
        "flip": [] if found.flip is None else found.flip.tolist(),
        "absolute_limit_mm": _number(found.absolute_limit * 1e3),
        "absolute_frequency_hz": _number(found.absolute_frequency / (2.0 * math.pi)),
        "best_speeds": [{"spindle_speed_rpm": _rpm(s), "limit_depth_mm": _number(d * 1e3)} for s, d in best_speeds(found)],
        "tested": tested,
        "warnings": _told(known, limits, np.array(question.speeds)),
    }


def _tested(known: Known, tool: Tooling, process: MillingProcess, question: LobeQuestion) -> dict[str, Any] | None:
    """How many of the cuts that were tried the limits tell right; None without any."""
    if not question.tested:
        return None
    speed, depth, verdict = zip(*question.tested, strict=True)
    cuts = TestedCuts(np.array(speed), np.array(depth), tuple(Verdict(each) for each in verdict))
    plain = replace(question, bands=False)

    def limits(conditions: LobeConditions) -> Limits:
        return _limits(known, tool, process, replace(plain, max_depth=conditions.max_depth), conditions.speeds)

    conditions = LobeConditions(process, cuts.spindle_speed, question.max_depth, _METHODS[question.method]())
    found = classify_tested_cuts(cuts, conditions, limits)
    return asdict(found) | {"share_right": _number(found.share_right)}


def advice(machine: MachineText, tooling: ToolingText, question: AdviceQuestion) -> dict[str, Any]:
    """Return the cuts that remove most, the speeds for a depth, and how planned cuts stand."""
    known, tool = _shelf.get(machine), tooling_of(tooling.text)
    q = question.lobes
    process = _process(q.cut, tool, known)
    drive = SpindleDrive.flat(question.max_power, question.max_torque, question.max_speed)
    wide = pad_speeds(np.array(q.speeds), question.tolerance, [speed for speed, _ in question.planned])
    limits = _limits(known, tool, process, q, wide)
    low, high = q.speeds[0], q.speeds[-1]
    usable = usable_depths(limits, process, drive, question.tolerance, question.probability, question.reserve).between(low, high)
    windows = [] if question.depth is None else speed_windows(usable, question.depth)
    planned = [planned_cut(limits, process, drive, s, d, question.tolerance, question.probability) for s, d in question.planned]
    return {
        "tooling": tooling.name,
        "stickout_mm": tool.assembly.stickout * 1e3,
        "highest_removal": [
            {
                "spindle_speed_rpm": _rpm(p.spindle_speed),
                "axial_depth_mm": p.depth * 1e3,
                "removal_rate_cm3_per_min": p.removal_rate * 6e7,
                "power_kw": p.power * 1e-3,
                "torque_nm": p.torque,
                "bound": str(p.bound),
            }
            for p in highest_removal(usable, process)
        ],
        "windows": [
            {"from_rpm": _rpm(w.low), "to_rpm": _rpm(w.high), "best_rpm": _rpm(w.best), "allowed_mm": w.allowed * 1e3} for w in windows
        ],
        "planned": [_planned(cut) for cut in planned],
        "warnings": _told(known, limits, np.array(q.speeds)),
    }


def _planned(cut: Any) -> dict[str, Any]:
    data = asdict(cut)
    return {
        "spindle_speed_rpm": _rpm(cut.spindle_speed),
        "axial_depth_mm": cut.depth * 1e3,
        "stable": cut.stable,
        "limit_depth_mm": _number(cut.limit * 1e3),
        "robust_limit_mm": _number(cut.robust_limit * 1e3),
        "margin": _number(cut.margin),
        "chatter_frequency_hz": _number(cut.chatter_frequency / (2.0 * math.pi)),
        **{f"{name}_rpm": None if data[name] is None else _rpm(data[name]) for name in ("slower", "faster")},
        "probability": cut.probability,
        "load": _number(cut.load),
        "power_kw": cut.power * 1e-3,
        "torque_nm": cut.torque,
        "removal_rate_cm3_per_min": cut.removal_rate * 6e7,
    }


def _process(cut: CutQuestion, tool: Tooling, known: Known) -> MillingProcess:
    given = dict(cut.coefficients)
    base = workpiece_from_json(known.data, "").coefficients if cut.material is None else material(cut.material).coefficients
    cutter = tool.cutter
    if cut.runout is not None:
        if len(cut.runout) != cutter.teeth:
            raise InputError("cut.runout_um", f"{len(cut.runout)} numbers", f"{cutter.teeth}, one for each tooth [um]")
        cutter = replace(cutter, runout=np.array(cut.runout))
    return MillingProcess(cutter, replace(base, **given), cut.engagement, cut.feed_angle, cut.feed_per_tooth, cut.damping)


def _limits(known: Known, tool: Tooling, process: MillingProcess, question: LobeQuestion, speeds: FloatArray) -> Limits:
    """The limits at rising speeds, after a look at what they will cost."""
    marching = issubclass(_METHODS[question.method], MARCHING)
    highest = known.data["band_hz"][1] * (BEYOND if marching else 1.0)
    weigh(tool.assembly, highest)
    zero_order = question.method == "zero-order"
    cost = _COST[question.method] + (_BAND_COST if question.bands else 0.0)
    cost *= float(np.sum(4000.0 / (speeds * _RPM)))
    if zero_order and np.ptp(process.cutter.pitch) > 1e-9:
        cost *= _PITCH_FACTOR
    quick = zero_order and known.quick
    omega = known.omega(BEYOND if marching else 1.0)
    if not quick:
        cost += _CHANGING * (0.0 if known.steady else 1.0)
        cost += known.spread_seconds(omega.size) if question.bands else 0.0
    _affordable(cost, f"{speeds.size} speeds by {question.method}", question.work_seconds)
    conditions = LobeConditions(process, np.unique(speeds), question.max_depth, _METHODS[question.method]())
    draws = DRAWS if question.bands else 0
    if quick:
        return known.side(question.bands).limits(tool.assembly, conditions, draws, question.stiffness_spread)
    return machine_limits(known.machine, tool.assembly, omega, conditions, draws, question.stiffness_spread)


def _affordable(seconds: float, what: str, most: float) -> None:
    if seconds > most:
        found = f"{what}, about {seconds:.0f} s of work"
        raise TooLong("speeds" if "speeds" in what else "step_hz", found, _ALLOWED.format(most), seconds=seconds)


def _told(known: Known, limits: Limits, speeds: FloatArray) -> list[str]:
    """What speaks against limits."""
    doubt = band_warning(limits.lobes, tuple(known.data["band_hz"]))
    return [*_doubts(known), *dict.fromkeys(limits.lobes.warnings), *([doubt] if doubt else []), *_outside(known, speeds)]


def _doubts(known: Known) -> list[str]:
    data = known.data
    return [] if data["status"] == "converged" else [f"the identification is {data['status']}: {'; '.join(data['reasons'])}"]


def _outside(known: Known, speeds: FloatArray | None) -> list[str]:
    span = known.machine.speed_range
    if span is None or speeds is None or (speeds.min() >= span[0] * (1.0 - 1e-9) and speeds.max() <= span[1] * (1.0 + 1e-9)):
        return []
    low, high = (each * _RPM for each in span)
    return [f"the machine was identified from {low:.0f} to {high:.0f} rev/min; outside it stays what it is at the nearest of them"]


def _lines(known: Known, low: float, high: float | None, step: float) -> FloatArray:
    """Frequencies [Hz], the last one included."""
    last = known.data["band_hz"][1] if high is None else high
    count = math.floor((last - low) / step + 1e-9) + 1
    if not 2 <= count <= MOST_LINES:
        raise InputError("to_hz", f"{max(count, 0)} frequencies from {low:g} to {last:g} Hz", f"2 to {MOST_LINES} of them")
    if high is None and step == 1.0:
        # the very lines that are kept
        kept = known.omega() / (2.0 * np.pi)
        return kept if low == kept[0] else low + np.arange(count)
    return low + step * np.arange(count)


def _frf(frequency: FloatArray, curves: dict[Dof, Any], deviations: Any) -> dict[str, Any]:
    axes = {}
    for axis, values in curves.items():
        real, imaginary = deviations.get(axis, (None, None))
        parts = {"re": values.real, "im": values.imag, "re_std": real, "im_std": imaginary}
        if not all(part is None or np.all(np.isfinite(part)) for part in parts.values()):
            raise InputError("tooling", "a receptance that is not finite", "a tooling whose receptance is finite at every frequency")
        axes[axis.upper()] = {key: None if part is None else part.tolist() for key, part in parts.items()}
    return {"frequency_hz": np.round(frequency, 9).tolist(), "axes": axes}


def _csv(frequency: FloatArray, tips: dict[Dof, Any], deviations: Any) -> str:
    columns: dict[str, FloatArray] = {}
    for axis, (real, imaginary) in deviations.items():
        columns |= {f"{axis.upper()}_re_std": real, f"{axis.upper()}_im_std": imaginary}
    with tempfile.TemporaryDirectory(prefix="rcsa-ident-") as folder:
        path = Path(folder) / "FRF.csv"
        write_frf_csv(path, np.round(frequency, 9), {axis.upper(): values for axis, values in tips.items()}, columns)
        return path.read_text(encoding="utf-8")


def _rpm(speed: float) -> float:
    # the last digit comes from the way to rad/s and back
    return round(speed * _RPM, 6)


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _numbers(values: FloatArray) -> list[float | None]:
    known: list[float | None] = values.tolist()
    return known if np.all(np.isfinite(values)) else [_number(value) for value in values.tolist()]
