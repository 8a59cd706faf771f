"""RESULT.json of a robot: its data sheet, what cuts have told of it, and how well."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.units import to_hz
from rcsa_ident.identification.arm.posterior import RobotPosterior, RobotUnknowns
from rcsa_ident.identification.arm.result import RobotIdentification
from rcsa_ident.identification.arm.unknowns import PosedLayout, unpack
from rcsa_ident.io.files import write_text
from rcsa_ident.io.results.parts import STATUSES, check_covariance, layout, matrix_of, plain, read_json
from rcsa_ident.io.settings.robots import robot_keys, robot_of
from rcsa_ident.io.validated_table import Table
from rcsa_ident.version import __version__

#: What the key ``kind`` of such a file says; RESULT.json of a machine has no such key.
KIND = "identified robot"
SCHEMA_VERSION = 1
#: Digits of a covariance: it is no better known.
_DIGITS = 8


def write_robot_result(path: str | Path, found: RobotIdentification, campaign: str, left_out: Sequence[tuple[str, str]]) -> None:
    """Write RESULT.json; the old file or the new one, never half of it. `campaign`: its name. `left_out`: sequence of (cut id, reason)."""
    write_text(path, layout(plain(robot_result_to_json(found, campaign, left_out))) + "\n")


def read_robot_result(path: str | Path) -> RobotPosterior:
    """Return what RESULT.json says of a robot after every key, shape and number has been checked.

    Parameters
    ----------
    path : path

    Raises
    ------
    InputError
        Names the file, the key, what was found and what is allowed.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> found = ri.read_robot_result("ROBOT.json")
    >>> print(found.sheet)
    KUKA KR210: 6 joints, 18 freedoms, 1233 kg
    """
    return robot_posterior_of(read_json(path, "robot"), str(path))


def robot_result_to_json(found: RobotIdentification, campaign: str, left_out: Sequence[tuple[str, str]]) -> dict[str, Any]:
    """Return the content of the file."""
    posterior = found.posterior
    best = unpack(posterior.best.theta, posterior.best.layout)
    names = [*(joint.name for joint in posterior.sheet.joints), *(["payload"] if posterior.sheet.payload is not None else [])]
    pole = best.spindle.omega_n
    return {
        "schema_version": SCHEMA_VERSION,
        "kind": KIND,
        "status": str(found.status),
        "reasons": [str(each) for each in found.reasons],
        "notes": [str(each) for each in found.notes],
        "seed": found.seed,
        "software": f"rcsa-ident {__version__}",
        "campaign": {
            "name": campaign,
            "cuts_used": len(found.cut_ids),
            "cuts_left_out": [{"id": id, "reason": reason} for id, reason in left_out],
            "postures_deg": np.degrees(found.postures).tolist(),
        },
        "band_hz": list(found.band_hz),
        "misfit": {"chi2_per_point": found.chi2_per_point, "model_error": list(found.model_error)},
        "springs": [
            {"name": name, "stiffness_nm_per_rad": k, "sd_percent": 100.0 * share, "told": told, "damping_nms_per_rad": d}
            for (name, k, share, told), d in zip(found.springs, best.damping.tolist(), strict=True)
        ],
        "masses": dict(zip(names, best.heavier.tolist(), strict=True)),
        "spindle": {
            "natural_frequencies_hz": to_hz(pole).tolist(),
            "damping_ratios": (np.sum(best.spindle.factor**2, axis=1) / (2.0 * pole)).tolist(),
        },
        "robot": robot_keys(posterior.sheet),
        "tilts": posterior.tilts,
        "posterior": {
            "modes": posterior.best.layout.modes,
            "springs_nm_per_rad": list(posterior.best.layout.springs),
            "unknowns": posterior.best.theta.tolist(),
            "believed_sd": posterior.believed.tolist(),
            "matrix": [[float(f"{value:.{_DIGITS}g}") for value in row] for row in posterior.covariance.tolist()],
            "rivals": [{"modes": each.layout.modes, "unknowns": each.theta.tolist()} for each in posterior.rivals],
        },
    }


def robot_posterior_of(data: Any, where: str) -> RobotPosterior:
    """Return the posterior that the content of such a file describes."""
    top = Table(data, where)
    if top.text("kind") != KIND:
        top.refuse("kind", top.text("kind"), KIND)
    version = top.number("schema_version", whole=True)
    if version != SCHEMA_VERSION:
        top.refuse("schema_version", version, f"{SCHEMA_VERSION}")
    top.text("status", choices=STATUSES)
    sheet, tilts = robot_of(dict(top.table("robot").data), where), top.flag("tilts", True)
    table = top.table("posterior")
    freedoms, bodies = sheet.freedoms(tilts), len(sheet.joints) + (sheet.payload is not None)
    springs = tuple(table.numbers("springs_nm_per_rad", freedoms, "N m/rad", above=0.0))

    def unknowns(own: Table) -> RobotUnknowns:
        modes = int(own.number("modes", least=0, whole=True))
        form = PosedLayout(springs, bodies, modes)
        return RobotUnknowns(np.array(own.numbers("unknowns", form.size)), form)

    best = unknowns(table)
    size = best.theta.size
    covariance = matrix_of(table, "matrix", size)
    check_covariance(table, covariance)
    rivals = tuple(unknowns(each) for each in table.tables("rivals")) if table.data.get("rivals") else ()
    believed: FloatArray = np.array(table.numbers("believed_sd", size, above=0.0))
    return RobotPosterior(sheet, tilts, best, covariance, believed, rivals)
