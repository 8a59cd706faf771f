"""Nouns as JSON and back, to the last bit: what jobs remember, and plans of streams. Without code; only known nouns come out of it."""

from __future__ import annotations

import base64
import dataclasses
import importlib
import json
import math
from datetime import datetime
from enum import Enum
from functools import cache
from typing import Any, Literal

import numpy as np

from rcsa_ident.base.remarks import Remark

#: Places of all nouns that may be written, by the names under which they are stored. A name stays for ever, since jobs outlive an upgrade:
#: where a class moves or is renamed, its place alone follows. Texts of an earlier release can be read as long as the fields stay.
NOUNS = {
    "Dof": "rcsa_ident.dynamics.coordinates.Dof",
    "Remark": "rcsa_ident.base.remarks.Remark",
    "RecordCode": "rcsa_ident.signals.verdict.RecordCode",
    "FrfCode": "rcsa_ident.dynamics.passivity.FrfCode",
    "IdentificationCode": "rcsa_ident.identification.result.IdentificationCode",
    "PlausibilityCode": "rcsa_ident.base.plausibility.PlausibilityCode",
    "FlangeCode": "rcsa_ident.machine.measured.FlangeCode",
    "CourseCode": "rcsa_ident.setup.cut_course.CourseCode",
    "SensorCode": "rcsa_ident.signals.recording.SensorCode",
    "CutterCode": "rcsa_ident.cutting.shape.CutterCode",
    "RobotCode": "rcsa_ident.identification.arm.result.RobotCode",
    "Verdict": "rcsa_ident.signals.verdict.Verdict",
    "AxisLines": "rcsa_ident.signals.frf.AxisLines",
    "CutMeasurement": "rcsa_ident.signals.measurement.CutMeasurement",
    "Reading": "rcsa_ident.signals.measurement.Reading",
    "AxisLayout": "rcsa_ident.identification.unknowns.ModalBlock",
    "Layout": "rcsa_ident.identification.unknowns.Layout",
    "Candidate": "rcsa_ident.identification.candidate.Candidate",
    "CoupledSearch": "rcsa_ident.identification.coupled.fit.CoupledSearch",
    "CoupledLayout": "rcsa_ident.identification.unknowns.CoupledLayout",
    "PosedLayout": "rcsa_ident.identification.arm.unknowns.PosedLayout",
    "Stage": "rcsa_ident.identification.progress.Stage",
    "Step": "rcsa_ident.identification.progress.Step",
    "AxisSearch": "rcsa_ident.identification.joint_fit.AxisSearch",
    "Engagement": "rcsa_ident.cutting.conditions.Engagement",
    "Block": "rcsa_ident.cutting.conditions.Block",
    "Stepover": "rcsa_ident.cutting.conditions.Stepover",
    "EngagementMap": "rcsa_ident.cutting.conditions.EngagementMap",
    "Immersion": "rcsa_ident.cutting.stock.Immersion",
    "ProcessDamping": "rcsa_ident.cutting.process.ProcessDamping",
    "SpeedVariation": "rcsa_ident.cutting.process.SpeedVariation",
    "MachineText": "api.work.requests.MachineText",
    "CutSpec": "rcsa_ident.setup.cut.CutSpec",
    "ToolingSource": "api.work.requests.ToolingSource",
    "LobeRequest": "api.work.requests.LobeRequest",
    "PathRequest": "api.work.paths.PathRequest",
    "Plan": "api.streams.engine.Plan",
    "Column": "api.streams.engine.Column",
    "LiveObserver": "rcsa_ident.workflows.stream_forces.LiveObserver",
    "AngleReference": "rcsa_ident.workflows.stream_forces.AngleReference",
    "ForceObserver": "rcsa_ident.observer.force.ForceObserver",
    "AxisSensors": "rcsa_ident.observer.force.AxisSensors",
    "RunOut": "rcsa_ident.observer.force.RunOut",
    "TransferFunction": "rcsa_ident.observer.transfer_function.TransferFunction",
    "SampledModes": "rcsa_ident.observer.transfer_function.SampledModes",
    "RationalFit": "rcsa_ident.dynamics.rational.RationalFit",
    "FitStatus": "rcsa_ident.dynamics.rational.FitStatus",
    "KalmanFilter": "rcsa_ident.observer.kalman.KalmanFilter",
    "AugmentedModel": "rcsa_ident.observer.force_model.AugmentedModel",
}
_NAMES = {place: name for name, place in NOUNS.items()}


class Unknown(ValueError):
    """Something that is not among the known nouns, or no text of this module."""


def encode(value: Any) -> str:
    """Return a value as JSON.

    Raises `Unknown`: it holds something else than numbers, texts, arrays of numbers, lists, tuples, tables and the nouns of `NOUNS`.
    """
    return json.dumps(_plain(value), ensure_ascii=False, allow_nan=False, separators=(",", ":"))


def decode(text: str) -> Any:
    """Return the value that `encode` has written: same types, same bits, arrays of the same layout in memory.

    Raises `Unknown` if it has not, or its nouns have other fields now, or are gone.
    """
    try:
        return _value(json.loads(text))
    except Unknown:
        raise
    except (ValueError, TypeError, KeyError, AttributeError, ImportError, RecursionError) as error:
        raise Unknown(f"no text of a known noun ({type(error).__name__})") from error


def _plain(value: Any) -> Any:
    if isinstance(value, Enum):
        return {"~enum": [_name(type(value)), value.value]}
    if isinstance(value, Remark):
        return {f"~{_name(Remark)}": {"code": _plain(value.code), "sentence": str(value)}}
    if value is None or type(value) in (bool, int, str):
        return value
    if type(value) is float:
        # JSON writes the shortest digits that lead back to the same number
        return value if math.isfinite(value) else {"~float": str(value)}
    if type(value) is datetime:
        return {"~moment": value.isoformat()}
    if type(value) is complex:
        return {"~complex": [_plain(value.real), _plain(value.imag)]}
    if isinstance(value, np.ndarray):
        return {"~array": _array(value)}
    if isinstance(value, np.generic):
        return {"~number": _array(np.asarray(value))}
    if type(value) is list:
        return [_plain(each) for each in value]
    if type(value) is tuple:
        return {"~tuple": [_plain(each) for each in value]}
    if type(value) is dict:
        return {"~table": [[_plain(key), _plain(each)] for key, each in value.items()]}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f"~{_name(type(value))}": {field.name: _plain(getattr(value, field.name)) for field in dataclasses.fields(value)}}
    raise Unknown(f"a {type(value).__name__} cannot be encoded")


def _value(plain: Any) -> Any:
    if isinstance(plain, list):
        return [_value(each) for each in plain]
    if not isinstance(plain, dict):
        return plain
    if len(plain) != 1:
        raise Unknown(f"a table of {len(plain)} keys")
    ((kind, content),) = plain.items()
    if kind == "~float":
        return float(content)
    if kind == "~moment":
        return datetime.fromisoformat(content)
    if kind == "~complex":
        return complex(*(_value(each) for each in content))
    if kind == "~array":
        return _array_of(content)
    if kind == "~number":
        return _array_of(content)[()]
    if kind == "~tuple":
        return tuple(_value(each) for each in content)
    if kind == "~table":
        return {_value(key): _value(each) for key, each in content}
    if kind == "~enum":
        return _noun(content[0])(content[1])
    if not kind.startswith("~"):
        raise Unknown(f"the key {kind[:40]}")
    return _noun(kind[1:])(**{name: _value(each) for name, each in content.items()})


def _array(values: np.ndarray) -> list[Any]:
    if values.dtype.kind not in "biufc" or type(values) is not np.ndarray:
        raise Unknown(f"an array of {values.dtype}")
    # sums over an array depend on how it lies in memory, in their last bits
    order: Literal["F", "C"] = "F" if values.flags.f_contiguous and not values.flags.c_contiguous else "C"
    little = values.astype(values.dtype.newbyteorder("<"), copy=False)
    return [little.dtype.str, list(values.shape), order, values.flags.writeable, base64.b64encode(little.tobytes(order)).decode("ascii")]


def _array_of(content: list[Any]) -> np.ndarray:
    kind, shape, order, writeable, text = content
    dtype = np.dtype(str(kind))
    if dtype.kind not in "biufc":
        raise Unknown(f"an array of {dtype}")
    values = np.frombuffer(base64.b64decode(text, validate=True), dtype=dtype).reshape(shape, order=order)
    values = values.astype(dtype.newbyteorder("="), order="K", copy=True)
    values.setflags(write=bool(writeable))
    return values


def _name(kind: type) -> str:
    name = _NAMES.get(f"{kind.__module__}.{kind.__qualname__}")
    if name is None:
        raise Unknown(f"a {kind.__name__} is none of the known nouns")
    return name


@cache
def _noun(name: str) -> Any:
    place = NOUNS.get(name)
    if place is None:
        raise Unknown(f"{name[:40]} is none of the known nouns")
    module, _, own = place.rpartition(".")
    return getattr(importlib.import_module(module), own)
