"""Between RESULT.json and nouns: an identification on its way out, the machine and its workpiece on their way in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rcsa_ident import __version__
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.errors import InputError
from rcsa_ident.identification.parameters import axis_size
from rcsa_ident.identification.posterior import MachineAxis, Posterior
from rcsa_ident.identification.result import AxisResult, Identification
from rcsa_ident.io.keys import Table
from rcsa_ident.io.results import AXES, SCHEMA_VERSION, spindle_from_json, spindle_to_json
from rcsa_ident.machine.spindle import Spindle
from rcsa_ident.machining_setup import Campaign, Workpiece
from rcsa_ident.signals.recording import Quantity, Sensor

#: Edge forces of a workpiece: key and unit in N/m.
_EDGES = {"tangential_edge_n_per_mm": 1e3, "radial_edge_n_per_mm": 1e3, "axial_edge_n_per_mm": 1e3}


def identification_to_json(
    identification: Identification, campaign: Campaign, left_out: Sequence[tuple[str, str]], max_frequency_hz: float = 4300.0
) -> dict[str, Any]:
    """Return the content of RESULT.json.

    Parameters
    ----------
    identification : Identification
    campaign : Campaign
        That it came from.
    left_out : sequence of (cut id, reason)
    max_frequency_hz : float [Hz]
        Upper end of the band where the identification carries no lines.

    Notes
    -----
    ``delays``: the angle by which the spindle turns from the first sample until a tooth stands at immersion 0, between 0
    and the mean pitch of the teeth; which of the teeth it is, cuts of equal teeth do not tell.
    """
    omega = [axis.measured["omega"] for axis in identification.axes.values() if "omega" in axis.measured]
    band = [float(min(w.min() for w in omega)), float(max(w.max() for w in omega))] if omega else [0.0, 2.0 * np.pi * max_frequency_hz]
    return {
        "schema_version": SCHEMA_VERSION,
        "status": str(identification.status),
        "reasons": list(identification.reasons),
        "seed": identification.seed,
        "method": identification.method,
        "software": f"rcsa-ident {__version__}",
        "campaign": {
            "name": campaign.name,
            "cuts_used": len(identification.cut_ids),
            "cuts_left_out": [{"id": cut, "reason": reason} for cut, reason in left_out],
        },
        "sensors": {sensor.name: _sensor_to_json(sensor) for sensor in campaign.sensors},
        "workpiece": workpiece_to_json(campaign.workpiece),
        "band_hz": [w / (2.0 * np.pi) for w in band],
        "axes": {axis.upper(): _axis_to_json(part) for axis, part in identification.axes.items()},
        "delays": _delays(identification, campaign),
    }


def _axis_to_json(axis: AxisResult) -> dict[str, Any]:
    data = spindle_to_json(axis.modes, axis.joint)
    if axis.covariance is not None and axis.theta is not None:
        data["unknowns"] = axis.theta.tolist()
        # a file is checked for symmetry, an inverse is symmetric up to rounding
        data["covariance"] = {"parameters": list(axis.parameters), "matrix": (0.5 * (axis.covariance + axis.covariance.T)).tolist()}
    data["misfit"] = {"chi2_per_point": axis.chi2_per_point, "per_tooling": dict(axis.per_tooling)}
    data["model_error"] = axis.model_error
    return data


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
    return data


def workpiece_to_json(workpiece: Workpiece) -> dict[str, Any]:
    """Return a workpiece as campaign and result write it; what is zero is left away."""
    c = workpiece.coefficients
    data = {"name": workpiece.name, "tangential_coefficient_mpa": c.tangential * 1e-6, "radial_ratio": c.radial_ratio}
    if c.axial_ratio != 0.0:
        data["axial_ratio"] = c.axial_ratio
    edges = (c.tangential_edge, c.radial_edge, c.axial_edge)
    return data | {key: value / unit for (key, unit), value in zip(_EDGES.items(), edges, strict=True) if value != 0.0}


def _delays(identification: Identification, campaign: Campaign) -> dict[str, dict[str, float]]:
    tooling = {cut.id: cut.tooling for cut in campaign.cuts}
    delays = {}
    rows = (identification.delay, identification.delay_std, identification.spindle_speed)
    for cut, delay, std, speed in zip(identification.cut_ids, *(row.tolist() for row in rows), strict=True):
        pitch = 2.0 * np.pi / campaign.toolings[tooling[cut]].cutter.teeth
        delays[cut] = {"angle_deg": float(np.degrees(speed * delay % pitch)), "std_deg": float(np.degrees(speed * std))}
    return delays


def machine_from_json(data: Mapping[str, Any], where: str) -> dict[Dof, MachineAxis]:
    """Return the identified machine, each axis with its posterior where the file holds one.

    Parameters
    ----------
    data : mapping
        As `read_result` returns it.
    where : str
        The file, for the messages.

    Raises
    ------
    InputError
        If the identification has failed and no axis is there, or unknowns and covariance do not belong together.
    """
    top = Table(data, where)
    axes = top.named_tables("axes")
    if not axes:
        raise InputError("axes", "no axis: the identification has failed", "a result with axis X, Y or both", where)
    machine = {}
    for name, dof in AXES.items():
        if name in axes:
            modes, joint = spindle_from_json(axes[name].data, dof, where, axes[name].path)
            machine[dof] = MachineAxis(Spindle(modes), joint, _posterior(axes[name]))
    return machine


def _posterior(axis: Table) -> Posterior | None:
    if "unknowns" not in axis or "covariance" not in axis:
        return None
    unknowns = axis.numbers("unknowns", None)
    matrix = np.array(axis.table("covariance").data["matrix"], dtype=float)
    if not any(axis_size(m) + 4 == len(unknowns) for m in range(1, 200)):
        axis.refuse("unknowns", f"{len(unknowns)} numbers", "as many as a whole number of modes and the joint have")
    if matrix.shape != (len(unknowns),) * 2:
        axis.refuse("covariance.matrix", f"{len(matrix)} rows", f"a row for each of the {len(unknowns)} unknowns")
    return Posterior(np.array(unknowns), matrix)


def workpiece_from_json(data: Mapping[str, Any], where: str) -> Workpiece:
    """Return the workpiece of a result."""
    table = Table(data, where).table("workpiece")
    return Workpiece(
        table.text("name"),
        CuttingCoefficients(
            table.number("tangential_coefficient_mpa", "MPa", above=0.0) * 1e6,
            table.number("radial_ratio", "", least=-1.0, most=5.0),
            table.number("axial_ratio", "", 0.0, least=-5.0, most=5.0),
            *(table.number(key, "N/mm", 0.0, least=0.0) * unit for key, unit in _EDGES.items()),
        ),
    )
