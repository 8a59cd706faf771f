"""What a worker answers: the library's own summaries, in the units of the files, None where nothing is known."""

from __future__ import annotations

import json
import math
import tempfile
from pathlib import Path
from typing import Any, cast

import numpy as np

from api.work.machine_cache import MachineCache, is_result, parsed, read
from api.work.requests import AdviceRequest, LobeRequest, MachineText, TipRequest, ToolingSource, TooLong
from api.work.tips import is_tapped, tapped
from api.work.toolings import tooling_from, weigh
from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import from_hz, to_hz, to_rpm
from rcsa_ident.cutting.power import SpindleDrive
from rcsa_ident.io.curves.tips import write_tip_csv
from rcsa_ident.machine.machine import Machine
from rcsa_ident.report.summaries import advice_summary, frf_summary, lobes_curves, lobes_summary
from rcsa_ident.stability.methods import Watch
from rcsa_ident.workflows.advise import advise
from rcsa_ident.workflows.tool_change import TipAnswer, ToolChange, spread_seconds
from rcsa_ident.workflows.tool_change import tooltip as ask_tip

MOST_LINES = 20_000

_MODE = ("natural_frequency_hz", "natural_frequency_std_hz", "damping_ratio", "damping_ratio_std", "phi_t", "phi_r")
_WHOLE_MODE = (*_MODE[:4], "direction_deg", "phi")
#: What a measured flange does not tell.
_UNTOLD: dict[str, Any] = {"toolings": [], "taught_by": []}
_ALLOWED = "at most {:g} s (fewer of them, no bands, zero-order)"

_machines = MachineCache(4)


def keep(machines: int) -> None:
    """Say how many machines this worker keeps."""
    _machines.most = machines


def known(machine: MachineText, spread: bool) -> Machine:
    """Return a machine, read if this worker does not know it."""
    return _machines.get(machine, spread)


def check(text: str) -> dict[str, Any]:
    """Return what a result or a flange says in short, after everything in it has been checked."""
    if is_result(text):
        data = parsed(text)
        # a failed identification is a result, too, but nothing to compute with
        if data["axes"]:
            read(text)
        return summary_of(data)
    machine = read(text)
    assert machine.band is not None
    axes = sorted(axis.upper() for axis in machine.axes)
    return {"status": "measured", "reasons": [], "campaign": "", "axes": axes, "band_hz": [to_hz(w) for w in machine.band]} | _UNTOLD


def summary_of(data: dict[str, Any]) -> dict[str, Any]:
    """Return a result in short."""
    return {
        "status": data["status"],
        "reasons": data["reasons"],
        "campaign": data["campaign"]["name"],
        "axes": sorted(data["axes"]),
        "band_hz": data["band_hz"],
        "toolings": sorted({name for axis in data["axes"].values() for name in axis.get("misfit", {}).get("per_tooling", ())}),
        "taught_by": data.get("taught_by", []),
        "temperature_c": _temperatures(data),
    }


def _temperatures(data: dict[str, Any]) -> list[float] | None:
    """Between which the cuts were made, of a machine that changes with the temperature."""
    known = {} if data.get("both_planes") else data.get("learned", {}).get("warming", {})
    return [known["coldest_c"], known["warmest_c"]] if known.get("by") == "temperature" else None


def modes(text: str) -> dict[str, Any]:
    """Return the modes of a result that has been checked. Raises `InputError`: a measured flange has none."""
    if not is_result(text):
        raise InputError("machine", "a measured flange, which has no modes", "a machine with an identification")
    data = json.loads(text)
    if "kind" in data:
        raise InputError("identification", "one of a robot, whose springs and modes stand in its result", "one of a machine")
    axes = {}
    for name, axis in data["axes"].items():
        rows = [{key: mode.get(key) for key in _MODE} for mode in axis["modes"]]
        axes[name] = {"modes": rows, "joint": axis["joint"], "misfit_per_point": axis.get("misfit", {}).get("chi2_per_point")}
        axes[name] |= {"validation": axis.get("validation", {})}
    whole = data.get("both_planes")
    both = None
    if whole is not None:
        rows = [{key: mode.get(key) for key in _WHOLE_MODE} for mode in whole["modes"]]
        both = {"in_words": whole.get("in_words", ""), "modes": rows, "gyroscopic": whole["layout"]["turning"] != 0}
    side = {
        name: {key: axis[key] for key in ("sensor", "role", "lines", "modes")} | {"misfit_per_point": axis["misfit"]["chi2_per_point"]}
        for name, axis in data.get("workpiece_side", {}).items()
    }
    told = {
        "learned": data.get("learned", {}).get("in_words", []),
        "axes": axes,
        "both_planes": both,
        "workpiece_side": side,
        "toolings": data.get("toolings", {}).get("learned", []),
    }
    return {key: data.get(key, []) for key in ("status", "reasons", "notes", "band_hz")} | told


def flange_frf(machine: MachineText, lines: tuple[float | None, float | None, float], work_seconds: float) -> dict[str, Any]:
    """Return the spindle's receptance at its flange, translation over force, with the posterior's standard deviations."""
    known = _machines.get(machine, spread=False)
    omega = _lines(known, *lines)
    _affordable(spread_seconds(known, omega), f"{omega.size} frequencies", work_seconds)
    flange = known.receptance(omega)
    return frf_summary(flange, [c for c in flange.rows if not c.dof.is_slope]) | _speed(known.speed_answered())


def tooltip(machine: MachineText, tooling: ToolingSource, request: TipRequest, csv: bool = False) -> Any:
    """Return the tooltip FRF with standard deviations, as a table or as the text of FRF.csv; one that was tapped as it is."""
    if is_tapped(machine.text):
        found = ask_tip(tapped(machine.text), tooling_from(tooling, tip_known=True))
    else:
        found = _predicted(machine, tooling, request)
    if not csv:
        told = {"tooling": found.tooling.name, "warnings": list(found.remarks), "state": found.state or None} | _speed(found.speed)
        return told | frf_summary(found.tip, found.tip.rows)
    with tempfile.TemporaryDirectory(prefix="rcsa-ident-") as folder:
        path = Path(folder) / "FRF.csv"
        write_tip_csv(path, found.tip)
        return path.read_text(encoding="utf-8")


def _predicted(machine: MachineText, tooling: ToolingSource, request: TipRequest) -> TipAnswer:
    """The tip of a tooling on a machine, after a look at what it will cost."""
    known = cast(Machine, _machines.get(machine, request.bands).at_temperature(request.temperature))
    omega = _lines(known, request.low, request.high, request.step)
    tool = tooling_from(tooling)
    weigh(tool.assembly, to_hz(float(omega[-1])))
    if request.bands and not (known.prepared and np.array_equal(omega, known.lines())):
        _affordable(spread_seconds(known, omega), f"{omega.size} frequencies with bands", request.work_seconds)
    return ask_tip(known, tool, omega, request.speed, request.bands, request.stiffness_spread)


def _speed(speed: float | None) -> dict[str, float | None]:
    """The spindle speed that receptances hold at."""
    return {"spindle_speed_rpm": None if speed is None else to_rpm(speed, 6)}


def lobes(machine: MachineText, tooling: ToolingSource, request: LobeRequest, watch: Watch | None = None) -> dict[str, Any]:
    """Return the stability lobes of a tooling, and what is recommended within them; `watch` is told of speeds as they come."""
    change = _change(machine, tooling, request)
    if watch is not None:
        change = change.watched(watch)
    advice = advise(change, tested=request.tested_cuts)
    return {"tooling": advice.tooling, "warnings": list(advice.remarks)} | lobes_summary(advice) | lobes_curves(advice)


def advice(machine: MachineText, tooling: ToolingSource, request: AdviceRequest) -> dict[str, Any]:
    """Return the recommended cuts, the speeds for a depth, and how planned cuts stand."""
    change = _change(machine, tooling, request.lobes)
    drive = SpindleDrive.flat(request.max_power, request.max_torque, request.max_speed)
    found = advise(change, drive, request.tolerance, request.probability, request.reserve, request.depth, request.planned)
    return advice_summary(found) | {"warnings": list(found.remarks)}


def _change(machine: MachineText, tooling: ToolingSource, request: LobeRequest) -> ToolChange:
    """What is asked of a machine and a tooling, or of a tip that is known and its cutter, after a look at what it will cost."""
    if is_tapped(machine.text):
        asked = request.change(tapped(machine.text), tooling_from(tooling, tip_known=True))
    else:
        asked = request.change(_machines.get(machine, request.bands), tooling_from(tooling))
        weigh(asked.tooling.assembly, to_hz(float(asked.omega[-1])))
    _affordable(asked.seconds, f"{len(request.speeds)} speeds by {request.method}", request.work_seconds)
    return asked


def _affordable(seconds: float, what: str, most: float) -> None:
    if seconds > most:
        found = f"{what}, about {seconds:.0f} s of work"
        raise TooLong("speeds" if "speeds" in what else "step_hz", found, _ALLOWED.format(most), seconds=seconds)


def _lines(known: Machine, low: float | None, high: float | None, step: float) -> FloatArray:
    """Frequencies [rad/s], the last one included."""
    assert known.band is not None
    low = to_hz(known.lowest) if low is None else low
    last = to_hz(known.band[1]) if high is None else high
    count = math.floor((last - low) / step + 1e-9) + 1
    if not 2 <= count <= MOST_LINES:
        raise InputError("to_hz", f"{max(count, 0)} frequencies from {low:g} to {last:g} Hz", f"2 to {MOST_LINES} of them")
    kept = known.lines()
    # the very lines that are kept
    same = high is None and step == 1.0 and low == to_hz(kept[0])
    return kept if same else from_hz(low + step * np.arange(count))
