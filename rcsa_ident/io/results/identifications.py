"""Between RESULT.json and nouns: an identification on its way out, the machine and its workpiece on their way in."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.units import from_hz, to_hz, to_rpm
from rcsa_ident.cutting.force import REFERENCE_RUNOUT, ForceCoefficient, ForceTerm
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.coupled.posterior import CoupledPosterior
from rcsa_ident.identification.machine import IdentifiedMachine, SpeedModel
from rcsa_ident.identification.posterior import MachineAxis, Posterior
from rcsa_ident.identification.result import AxisResult, Identification, workpiece_after
from rcsa_ident.identification.status import Status
from rcsa_ident.identification.unknowns import JOINT, ModalBlock
from rcsa_ident.io.results.axial_flanges import axial_of
from rcsa_ident.io.results.both_planes import both_planes_from_json, both_planes_to_json
from rcsa_ident.io.results.changes import changes_to_json, law_of, warmed_of, warmed_to_json, warming_of
from rcsa_ident.io.results.drawings import axis_toolings_of, axis_toolings_to_json, known_toolings_of, known_toolings_to_json
from rcsa_ident.io.results.parts import AXES, SCHEMA_VERSION, spindle_from_json, spindle_to_json
from rcsa_ident.io.results.workpiece_sides import workpiece_side_of, workpiece_side_to_json
from rcsa_ident.io.settings.setups import sensor_of
from rcsa_ident.io.settings.workpieces import workpiece_keys, workpiece_of
from rcsa_ident.io.validated_table import Table, describe
from rcsa_ident.machine.spindle import Spindle
from rcsa_ident.setup.campaign import Campaign
from rcsa_ident.setup.cut import Workpiece
from rcsa_ident.signals.recording import Quantity, Sensor
from rcsa_ident.tool_holder.drawings import KnownToolings
from rcsa_ident.version import __version__

_MOST_MODES = 200
#: Standard deviations of natural frequencies [rad/s] and damping ratios, per axis.
ModeDeviations = Mapping[Dof, tuple[FloatArray, FloatArray]]


def identification_to_json(
    identification: Identification,
    campaign: Campaign,
    left_out: Sequence[tuple[str, str]],
    deviations: ModeDeviations | None = None,
) -> dict[str, Any]:
    """Return the content of RESULT.json.

    Parameters
    ----------
    identification : Identification
    campaign : Campaign
        That it came from.
    left_out : sequence of (cut id, reason)
    deviations : mapping of Dof to (array, array), optional
        Standard deviations of each mode's natural frequency [rad/s] and damping ratio.

    Notes
    -----
    ``delays``: the angle by which the spindle turns from the first sample until a tooth stands at immersion 0, between 0
    and the mean pitch of the teeth; which of the teeth it is, cuts of equal teeth do not tell.
    """
    return {
        "schema_version": SCHEMA_VERSION,
        "status": str(identification.status),
        "reasons": list(identification.reasons),
        "notes": list(identification.notes),
        "seed": identification.seed,
        "method": identification.method,
        "software": f"rcsa-ident {__version__}",
        "campaign": {
            "name": campaign.name,
            "cuts_used": len(identification.cut_ids),
            "cuts_left_out": [{"id": cut, "reason": reason} for cut, reason in left_out],
            **({"hammer_tests": [test.id for test in campaign.tests]} if campaign.tests else {}),
        },
        "sensors": {sensor.name: _sensor_to_json(sensor) for sensor in campaign.sensors},
        **({} if campaign.workpiece is None else {"workpiece": workpiece_keys(campaign.workpiece, all_spreads=True)}),
        "coefficients": {str(each): _coefficient(each, *found) for each, found in identification.coefficients.items()},
        "band_hz": [to_hz(w) for w in identification.band],
        **(
            {} if identification.toolings is None else {"toolings": known_toolings_to_json(identification.toolings, identification.learned)}
        ),
        **({"learned": changes_to_json(identification.changes)} if identification.changes else {}),
        "axes": _axes_to_json(identification, deviations or {}),
        **_both_planes(identification, deviations or {}),
        **({} if identification.workpiece_side is None else {"workpiece_side": workpiece_side_to_json(identification.workpiece_side)}),
        "delays": _delays(identification, campaign),
    }


def speed_band_to_json(
    speeds: tuple[float, float], identification: Identification, deviations: ModeDeviations | None = None
) -> dict[str, Any]:
    """Return one entry of ``speed_bands``: what the cuts of a range of spindle speeds [rad/s] say for themselves.

    `speeds`: (float, float) [rad/s]; lowest and highest speed
    `identification`: of the cuts between them
    `deviations`: standard deviations of its modes, as in `identification_to_json`
    """
    return {
        "speed_range_rpm": [to_rpm(speed) for speed in speeds],
        "cuts_used": len(identification.cut_ids),
        "status": str(identification.status),
        "reasons": list(identification.reasons),
        "notes": list(identification.notes),
        "axes": _axes_to_json(identification, deviations or {}),
        **_both_planes(identification, deviations or {}),
    }


def _both_planes(identification: Identification, deviations: ModeDeviations) -> dict[str, Any]:
    """The machine whose planes feel each other; nothing where they do not."""
    if identification.whole is None:
        return {}
    # both axes have the modes of the whole machine
    content = both_planes_to_json(identification.whole, next(iter(deviations.values()), None))
    return {"both_planes": {"in_words": identification.coupling, **content}}


def _axes_to_json(identification: Identification, deviations: ModeDeviations) -> dict[str, Any]:
    found = {axis.upper(): _axis_to_json(part, deviations.get(axis)) for axis, part in identification.axes.items()}
    for each in identification.predictions:
        found[each.axis.upper()].setdefault("validation", {})[each.tooling] = {"error": each.error, "promised": each.promised}
    return found


def _axis_to_json(axis: AxisResult, deviation: tuple[FloatArray, FloatArray] | None) -> dict[str, Any]:
    data = spindle_to_json(axis.modes, axis.joint)
    if deviation is not None:
        for mode, omega_n, zeta in zip(data["modes"], *(d.tolist() for d in deviation), strict=True):
            mode |= {"natural_frequency_std_hz": to_hz(omega_n), "damping_ratio_std": zeta}
    posterior = axis.posterior
    if posterior is not None:
        middle, half = posterior.speed_range
        data["layout"] = {"modes": posterior.layout.modes, "softening": posterior.layout.softening}
        data["speed_range_rpm"] = [to_rpm(middle - half), to_rpm(middle + half)]
        data["unknowns"] = posterior.theta.tolist()
        data["rivals"] = [rival.tolist() for rival in posterior.rivals]
        data["covariance"] = {"parameters": list(axis.parameters), "matrix": posterior.covariance.tolist()}
        data |= axis_toolings_to_json(posterior) | warmed_to_json(posterior)
    data["misfit"] = {"chi2_per_point": axis.chi2_per_point, "per_tooling": dict(axis.per_tooling)}
    data["model_error"] = axis.model_error
    if axis.standstill is not None:
        names = ("frequency_percent", "frequency_std_percent", "damping_percent", "damping_std_percent")
        data["standstill"] = dict(zip(names, (100.0 * value for value in axis.standstill), strict=True))
    if axis.tests:
        data["hammer_tests"] = {
            test.lines.id: {
                "lines": test.lines.omega.size,
                "error": test.error,
                "gain": test.gain,
                "gain_std": test.gain_std,
                "chi2_per_point": test.chi2_per_point,
            }
            for test in axis.tests
        }
    return data


def _coefficient(coefficient: ForceCoefficient, value: float, std: float) -> dict[str, float]:
    """A factor on what the campaign says, or a run-out; with its standard deviation."""
    if coefficient.term is ForceTerm.RUNOUT:
        unit = 1e6 * REFERENCE_RUNOUT
        return {"runout_um": value * unit, "std_um": std * unit}
    scale = math.exp(value)
    return {"scale": scale, "std": scale * std}


def _sensor_to_json(sensor: Sensor) -> dict[str, Any]:
    data: dict[str, Any] = {"quantity": str(sensor.quantity)}
    if sensor.quantity is Quantity.TRIGGER:
        data["pulses_per_revolution"] = sensor.pulses_per_revolution
        if sensor.tooth_angle is not None:
            data["tooth_angle_deg"] = float(np.degrees(sensor.tooth_angle))
    else:
        data |= {"axis": sensor.axis.upper() if sensor.axis else "", "sensitivity": sensor.sensitivity}
    if sensor.delay != 0.0:
        data["delay_s"] = sensor.delay
    if sensor.bandwidth is not None:
        data["bandwidth_hz"] = sensor.bandwidth
    if sensor.role is not None:
        data["role"] = str(sensor.role)
    if sensor.mount_resonance is not None:
        data["mount_resonance_hz"] = sensor.mount_resonance
    if sensor.rotation != 0.0:
        data["rotation_deg"] = float(np.degrees(sensor.rotation))
    if sensor.distance is not None:
        data |= {"distance_behind_flange_mm": 1e3 * sensor.distance, "distance_spread_mm": 1e3 * sensor.distance_spread}
    return data


def _delays(identification: Identification, campaign: Campaign) -> dict[str, dict[str, float]]:
    # the windows of a pass have no delay in common
    tooling = {cut.id: cut.tooling for cut in campaign.cuts if cut.last_speed is None}
    delays = {}
    rows = (identification.delay, identification.delay_std, identification.spindle_speed)
    for cut, delay, std, speed in zip(identification.cut_ids, *(row.tolist() for row in rows), strict=True):
        if cut not in tooling:
            continue
        pitch = 2.0 * np.pi / campaign.toolings[tooling[cut]].cutter.teeth
        delays[cut] = {"angle_deg": float(np.degrees(speed * delay % pitch)), "std_deg": float(np.degrees(speed * std))}
    return delays


def machine_from_json(data: Mapping[str, Any], where: str) -> IdentifiedMachine:
    """Return the identified machine, each axis with its posterior where the file holds one, and the models of single speed ranges.

    `data`: the result as `read_result` returns it
    `where`: the file, for the messages
    Raises `InputError` if the identification has failed and no axis is there, or unknowns and covariance do not belong together.
    """
    top = Table(data, where)
    toolings = known_toolings_of(top.table("toolings")) if "toolings" in top else None
    axes = _axes(top, toolings)
    low, high = data["band_hz"]
    return IdentifiedMachine(
        axes,
        (from_hz(low), from_hz(high)),
        tuple(_speed_models(top)),
        status=Status(data["status"]),
        reasons=tuple(data["reasons"]),
        identified_workpiece=_workpiece(top),
        sensors=tuple(sensor_of(name, table.data, where) for name, table in top.named_tables("sensors", default={}).items()),
        name=data["campaign"]["name"],
        whole=_whole(top),
        toolings=toolings,
        workpiece_side=workpiece_side_of(top),
        axial=axial_of(top),
        warming=warming_of(top),
    )


def _workpiece(top: Table) -> Workpiece | None:
    return workpiece_after(workpiece_of(top.table("workpiece")), _found(top), law_of(top)) if "workpiece" in top else None


def _found(top: Table) -> dict[ForceTerm, tuple[float, float]]:
    """What cuts found of the coefficients that all toolings have in common: logarithms, and their standard deviations."""
    tables = top.named_tables("coefficients", default={})
    scales = {term: tables[term] for term in (ForceTerm.TANGENTIAL, ForceTerm.RATIO) if term in tables}
    read = {term: (table.number("scale", above=0.0), table.number("std", least=0.0)) for term, table in scales.items()}
    return {term: (math.log(scale), std / scale) for term, (scale, std) in read.items()}


def _whole(table: Table) -> CoupledPosterior | None:
    """Both planes where they feel each other."""
    return both_planes_from_json(table.table("both_planes")) if "both_planes" in table else None


def _speed_models(top: Table) -> Iterator[SpeedModel]:
    """The machine of each range of speeds; none where the file has none."""
    for table in top.tables("speed_bands") if top.data.get("speed_bands") else []:
        low, high = table.numbers("speed_range_rpm", 2, "rev/min")
        if table.table("axes").data:
            yield SpeedModel((low / to_rpm(1.0), high / to_rpm(1.0)), _axes(table), _whole(table))


def _axes(table: Table, toolings: KnownToolings | None = None) -> dict[Dof, MachineAxis]:
    axes = table.named_tables("axes")
    if not axes:
        table.refuse("axes", "no axis: the identification has failed", "a result with axis X, Y or both")
    machine = {}
    for name, dof in AXES.items():
        if name in axes:
            modes, joint = spindle_from_json(axes[name].data, dof, table.where, axes[name].path)
            machine[dof] = MachineAxis(Spindle(modes), joint, _posterior(axes[name], toolings))
    return machine


def _posterior(axis: Table, toolings: KnownToolings | None) -> Posterior | None:
    if "unknowns" not in axis or "covariance" not in axis:
        return None
    unknowns = axis.numbers("unknowns", None)
    matrix = np.array(axis.table("covariance").data["matrix"], dtype=float)
    layout = _layout(axis, len(unknowns))
    if matrix.shape != (len(unknowns),) * 2:
        axis.refuse("covariance.matrix", f"{len(matrix)} rows", f"a row for each of the {len(unknowns)} unknowns")
    low, high = axis.numbers("speed_range_rpm", 2, "rev/min") if "speed_range_rpm" in axis else (0.0, 0.0)
    if not 0.0 <= low <= high:
        axis.refuse("speed_range_rpm", f"{[low, high]}", "lowest and highest speed, 0 <= lowest <= highest [rev/min]")
    speed_range = 0.5 * (low + high) / to_rpm(1.0), 0.5 * (high - low) / to_rpm(1.0)
    rivals = tuple(_rivals(axis, layout))
    of_toolings = axis_toolings_of(axis, toolings, len(unknowns), len(rivals))
    warmed = warmed_of(axis, len(unknowns), layout.pairs, len(rivals))
    return Posterior(np.array(unknowns), matrix, layout, speed_range, rivals, **of_toolings, warmed=warmed)


def _layout(axis: Table, size: int) -> ModalBlock:
    """The layout that a file says; one that says nothing holds a machine that does not change with speed."""
    if "layout" not in axis:
        found = _layout_of_size(size, False)
        if found is None:
            axis.refuse("unknowns", f"{size} numbers", "as many as a whole number of modes and the joint have")
        return found
    table = axis.table("layout")
    softening = table.value("softening", "true or false", False)
    if not isinstance(softening, bool):
        table.refuse("softening", describe(softening), "true or false")
    layout = ModalBlock(table.number("modes", least=1, most=_MOST_MODES, whole=True), softening=softening)
    if layout.size + JOINT != size:
        axis.refuse("unknowns", f"{size} numbers", f"{layout.size + JOINT}, as {layout.modes} modes and the joint have")
    return layout


def _rivals(axis: Table, layout: ModalBlock) -> list[FloatArray]:
    """Unknowns of rival models, each of a whole number of modes."""
    allowed = "lists of numbers, each as many as a whole number of modes and the joint have"
    rows = axis.value("rivals", allowed, [])
    if not isinstance(rows, list):
        axis.refuse("rivals", describe(rows), allowed)
    found = []
    for i, row in enumerate(rows):
        numbers = Table({f"rivals[{i}]": row}, axis.where, axis.path).numbers(f"rivals[{i}]", None)
        if _layout_of_size(len(numbers), layout.softening) is None:
            axis.refuse(f"rivals[{i}]", f"{len(numbers)} numbers", allowed)
        found.append(np.array(numbers))
    return found


def _layout_of_size(size: int, softening: bool) -> ModalBlock | None:
    layouts = (ModalBlock(m, softening=softening) for m in range(1, _MOST_MODES))
    return next((layout for layout in layouts if layout.size + JOINT == size), None)
