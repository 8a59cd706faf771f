"""RESULT.json: what an identification found, small enough to read, everything that later commands need."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import from_hz, to_hz
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.dynamics.coordinates import Dof, plane
from rcsa_ident.dynamics.modal import ModalModel
from rcsa_ident.io.files import MEGABYTE, read_bytes, write_text
from rcsa_ident.io.settings.workpieces import workpiece_of
from rcsa_ident.io.validated_table import Table, as_number, describe
from rcsa_ident.signals.recording import CAMPAIGN_QUANTITIES, Quantity

SCHEMA_VERSION = 1
STATUSES = ("converged", "not validated", "suspect", "failed")
AXES = {"X": Dof.X, "Y": Dof.Y}
LARGEST_RESULT = 64 * MEGABYTE
_JOINT = ("translational_stiffness", "translational_damping", "rotational_stiffness", "rotational_damping")
_LINE = 140


def spindle_to_json(modes: ModalModel, joint: LumpedJoint) -> dict[str, Any]:
    """Return one axis as it stands in the file; complex numbers are [real, imaginary].

    `modes`: coordinates: translation and slope of the flange
    """
    if len(modes.coordinates) != 2:
        raise InputError("coordinates", ", ".join(map(str, modes.coordinates)), "translation and slope of the flange")
    return {
        "modes": [
            {
                "natural_frequency_hz": float(to_hz(omega)),
                "damping_ratio": float(zeta),
                "phi_t": [float(phi[0].real), float(phi[0].imag)],
                "phi_r": [float(phi[1].real), float(phi[1].imag)],
            }
            for omega, zeta, phi in zip(modes.omega_n, modes.zeta, modes.phi, strict=True)
        ],
        "residual_compliance": modes.residual.tolist(),
        "joint": {key: float(getattr(joint, key)) for key in _JOINT},
    }


def spindle_from_json(data: Any, axis: Dof, where: str, path: str = "") -> tuple[ModalModel, LumpedJoint]:
    """Return modes at the flange and joint of one axis.

    `data`: mapping, what `spindle_to_json` writes; further keys are left alone
    `axis`: X or Y
    `where`, `path`: file and dotted key, for the messages
    """
    table = Table(data, where, path or f"axes.{axis.upper()}")
    modes = table.tables("modes")
    frequency = [mode.number("natural_frequency_hz", "Hz", above=0.0) for mode in modes]
    zeta = [mode.number("damping_ratio", "", above=0.0, most=1.0) for mode in modes]
    phi = [[complex(*mode.numbers(key, 2)) for key in ("phi_t", "phi_r")] for mode in modes]
    residual = matrix_of(table, "residual_compliance", 2)
    joint = table.table("joint")
    values = [joint.number(key, above=0.0) if key.endswith("stiffness") else joint.number(key, least=0.0) for key in _JOINT]
    model = ModalModel(from_hz(np.array(frequency)), np.array(zeta), np.array(phi), residual, plane("flange", axis))
    return model, LumpedJoint(**dict(zip(_JOINT, values, strict=True)))


def read_result(path: str | Path) -> dict[str, Any]:
    """Return the content of RESULT.json after every key, type, shape and number has been checked.

    Raises `InputError`, which names the file, the key or line, what was found and what is allowed.
    """
    data = read_json(path, "result")
    check_result(data, str(path))
    return data


def write_result(path: str | Path, identification: Mapping[str, Any]) -> None:
    """Write RESULT.json, after the same checks as on reading; the old file or the new one, never half of it."""
    data = plain(identification)
    check_result(data, str(path))
    write_text(path, layout(data) + "\n")


def read_json(path: str | Path, field: str) -> Any:
    """Return the content of a JSON file; a syntax error names its line, a doubled key and NaN are refused."""
    where = str(path)

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        table = dict(pairs)
        if len(table) < len(pairs):
            keys = [key for key, _ in pairs]
            doubled = next(key for key in keys if keys.count(key) > 1)
            raise InputError(doubled, "the same key twice", "every key once", where)
        return table

    def no_number(text: str) -> float:
        raise InputError(field, text, "finite numbers", where)

    def finite(text: str) -> float:
        value = float(text)
        return value if np.isfinite(value) else no_number(text)

    try:
        raw = read_bytes(path, field, LARGEST_RESULT)
        return json.loads(raw, object_pairs_hook=once, parse_constant=no_number, parse_float=finite)
    except json.JSONDecodeError as error:
        raise InputError(field, f"a JSON error ({error.msg})", "JSON", f"{where} line {error.lineno}") from None
    except UnicodeDecodeError:
        raise InputError(field, "bytes that are not text", "JSON in UTF-8", where) from None
    except RecursionError:
        raise InputError(field, "lists nested too deeply", "JSON", where) from None
    except InputError:
        raise
    except ValueError as error:
        raise InputError(field, f"a JSON error ({error})", "JSON", where) from None


def check_result(data: Any, where: str) -> None:
    """Raise `InputError` unless `data` is a result that every later command can use; unknown keys are left alone."""
    top = Table(data, where)
    version = top.number("schema_version", whole=True)
    if version != SCHEMA_VERSION:
        top.refuse("schema_version", version, f"{SCHEMA_VERSION}")
    status = top.text("status", choices=STATUSES)
    _texts(top, "reasons")
    top.number("seed", least=0, whole=True)
    for key in ("method", "software"):
        top.text(key)
    _check_campaign(top.table("campaign"))
    for sensor in top.named_tables("sensors").values():
        if sensor.text("quantity", choices=CAMPAIGN_QUANTITIES) != Quantity.TRIGGER:
            sensor.text("axis", choices=tuple(AXES))
            sensor.number("sensitivity")
    # hammer tests alone cut nothing
    if "workpiece" in top or top.table("campaign").data.get("cuts_used") != 0:
        workpiece_of(top.table("workpiece"))
    for key in ("notes", "taught_by", "taught_recordings"):
        if key in top:
            _texts(top, key)
    low, high = top.numbers("band_hz", 2, "Hz")
    if not 0.0 <= low < high:
        top.refuse("band_hz", [low, high], "lower and upper end, 0 <= lower < upper [Hz]")
    _check_axes(top, status)
    for band in top.tables("speed_bands") if top.data.get("speed_bands") else []:
        slowest, fastest = band.numbers("speed_range_rpm", 2, "rev/min")
        if not 0.0 <= slowest <= fastest:
            band.refuse("speed_range_rpm", f"{[slowest, fastest]}", "lowest and highest speed, 0 <= lowest <= highest [rev/min]")
        _check_axes(band, band.text("status", choices=STATUSES))
    for coefficient in top.named_tables("coefficients", default={}).values():
        for key in coefficient:
            coefficient.number(key)
    for delay in top.named_tables("delays", default={}).values():
        delay.number("angle_deg", "deg")
        delay.number("std_deg", "deg", least=0.0)


def _check_axes(table: Table, status: str) -> None:
    axes = table.named_tables("axes")
    if not axes and status != "failed":
        table.refuse("axes", "an empty table", "X, Y or both")
    for name, axis in axes.items():
        if name not in AXES:
            table.refuse("axes", name, "X, Y or both")
        spindle_from_json(axis.data, AXES[name], table.where, axis.path)
        _check_statistics(axis)


def _check_campaign(campaign: Table) -> None:
    campaign.text("name")
    campaign.number("cuts_used", least=0, whole=True)
    left_out = campaign.value("cuts_left_out", "a list of tables with id and reason")
    if not isinstance(left_out, list):
        campaign.refuse("cuts_left_out", describe(left_out), "a list of tables with id and reason")
    for i, item in enumerate(left_out):
        cut = Table(item, campaign.where, f"{campaign.name('cuts_left_out')}[{i}]")
        cut.text("id")
        cut.text("reason")


def _check_statistics(axis: Table) -> None:
    """What a result made by hand may lack."""
    if "covariance" in axis:
        covariance = axis.table("covariance")
        names = _texts(covariance, "parameters")
        check_covariance(covariance, matrix_of(covariance, "matrix", len(names)))
    if "misfit" in axis:
        misfit = axis.table("misfit")
        misfit.number("chi2_per_point", least=0.0)
        tooling = misfit.table("per_tooling", default={})
        for name in tooling:
            tooling.number(name, least=0.0)


def _texts(table: Table, key: str) -> list[str]:
    value = table.value(key, "a list of texts")
    if not isinstance(value, list) or not all(isinstance(text, str) for text in value):
        table.refuse(key, describe(value), "a list of texts")
    return value


def check_covariance(table: Table, matrix: FloatArray) -> None:
    """Refuse a table's ``matrix`` that is none of variances and covariances."""
    size = np.sqrt(np.abs(np.diag(matrix)))
    if np.any(np.diag(matrix) < 0.0) or np.any(np.abs(matrix - matrix.T) > 1e-6 * np.outer(size, size)):
        table.refuse("matrix", "one that is not symmetric or has a variance below 0", "a covariance matrix")


def matrix_of(table: Table, key: str, size: int) -> FloatArray:
    """Return a square matrix of finite numbers."""
    allowed = f"{size} rows of {size} finite numbers"
    value = table.value(key, allowed)
    if not isinstance(value, list) or len(value) != size or not all(isinstance(row, list) and len(row) == size for row in value):
        table.refuse(key, describe(value), allowed)
    for i, row in enumerate(value):
        for j, number in enumerate(row):
            if as_number(number) is None:
                table.refuse(f"{key}[{i}][{j}]", describe(number), "a finite number")
    return np.array(value, dtype=float).reshape(size, size)


def plain(value: Any, key: str = "") -> Any:
    """Return `value` of Python's own types, as JSON knows them; the key of a number that is not finite is named."""
    if isinstance(value, Mapping):
        return {str(k): plain(v, f"{key}.{k}" if key else str(k)) for k, v in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [plain(v, f"{key}[{i}]") for i, v in enumerate(value)]
    if isinstance(value, float) and not np.isfinite(value):
        raise InputError(key or "value", value, "a finite number")
    if value is None or isinstance(value, bool | int | float):
        return value
    if isinstance(value, str):
        return str(value)
    raise InputError(key or "value", f"a {type(value).__name__}", "numbers, texts, lists and tables")


def layout(value: Any, indent: str = "") -> str:
    """Return JSON with what is short on one line, and lists of numbers too: a covariance takes a line a row, not a number."""
    flat = json.dumps(value, ensure_ascii=False, allow_nan=False)
    numbers = isinstance(value, list) and not any(isinstance(v, dict | list) for v in value)
    if not isinstance(value, dict | list) or not value or numbers or (indent and len(indent) + len(flat) <= _LINE):
        return flat
    inner = indent + "  "
    if isinstance(value, dict):
        parts = [f"{json.dumps(k, ensure_ascii=False)}: {layout(v, inner)}" for k, v in value.items()]
        return "{\n" + ",\n".join(inner + part for part in parts) + f"\n{indent}" + "}"
    return "[\n" + ",\n".join(inner + layout(v, inner) for v in value) + f"\n{indent}]"
