"""LEARNT.json: a tip as labelled cuts have taught it, everything that lobes, advice and further labels need."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.units import from_hz, from_rpm, to_hz, to_rpm
from rcsa_ident.io.files import write_text
from rcsa_ident.io.results.parts import layout, plain, read_json
from rcsa_ident.io.settings.tested_cuts import OWN, cell_of, own_conditions
from rcsa_ident.io.settings.workpieces import WORKPIECE_KEYS, workpiece_keys, workpiece_of
from rcsa_ident.io.validated_table import Table
from rcsa_ident.machine.learnt_tip import LearntTip
from rcsa_ident.stability.labels.label_noise import LabelNoise
from rcsa_ident.stability.labels.label_posterior import LabelModel, LabelPosterior
from rcsa_ident.stability.labels.label_process import CutFeatures, LabelProcess
from rcsa_ident.stability.labels.limit_discrepancy import LimitDiscrepancy
from rcsa_ident.stability.labels.tested_cuts import OwnConditions, TestedCuts, Verdict
from rcsa_ident.stability.labels.uncertain_tip import UncertainTip
from rcsa_ident.stability.lobes import METHODS
from rcsa_ident.stability.tip_modes import TipModes
from rcsa_ident.version import __version__

#: What the key ``kind`` of such a file says; RESULT.json has no such key.
KIND = "learnt tip"
SCHEMA_VERSION = 2
#: Digits of draws: they are no better known.
_DIGITS = 7
#: Speeds of points in rev/min.
_PER_POINT = np.array([to_rpm(1.0), 1.0, 1.0])
Nouns = TypeVar("Nouns", LabelNoise, LimitDiscrepancy)


def write_learnt_tip(path: str | Path, learnt: LearntTip) -> None:
    """Write LEARNT.json; the old file or the new one, never half of it."""
    write_text(path, layout(plain(learnt_tip_to_json(learnt))) + "\n")


def read_learnt_tip(path: str | Path) -> LearntTip:
    """Return the tip of LEARNT.json after every key, shape and number has been checked.

    Raises `InputError`, which names the file, the key, what was found and what is allowed.
    """
    return learnt_tip_of(read_json(path, "learnt tip"), str(path))


def is_learnt_tip(data: Any) -> bool:
    """Return whether the content of a JSON file says that it is one."""
    return isinstance(data, dict) and data.get("kind") == KIND


def learnt_tip_to_json(learnt: LearntTip) -> dict[str, Any]:
    """Return the content of LEARNT.json; complex numbers are [real, imaginary]."""
    prior, cuts, found = learnt.prior, learnt.cuts, learnt.posterior
    modes = prior.modes
    return {
        "schema_version": SCHEMA_VERSION,
        "kind": KIND,
        "status": "suspect" if learnt.remarks else "converged",
        "reasons": list(learnt.remarks),
        "software": f"rcsa-ident {__version__}",
        "workpiece": workpiece_keys(learnt.workpiece, all_spreads=True),
        "method": learnt.method.name,
        "believed": believed(learnt),
        "prior": {
            "modes": [
                {"pole": _pair(pole / (2.0 * np.pi)), "outputs": [_pair(v) for v in out], "inputs": [_pair(v) for v in into]}
                for pole, out, into in zip(modes.pole, modes.outputs.T, modes.inputs, strict=True)
            ],
            "residual_compliance": modes.constant.tolist(),
            "root": prior.root.tolist(),
            "coefficients": prior.coefficients.tolist(),
            "softening_sd_percent_per_1000_rpm": 1e5 * from_rpm(prior.softening),
        },
        "labels": {part: {f.name: getattr(noun, f.name) for f in fields(noun)} for part, noun in _parts(learnt.model)},
        "cuts": [
            {"spindle_speed_rpm": to_rpm(float(speed), 6), "axial_depth_mm": round(1e3 * float(depth), 9), "verdict": str(verdict)}
            | ({} if np.isnan(chatter) else {"chatter_frequency_hz": to_hz(float(chatter))})
            | {name: cell for name in OWN if (cell := cell_of(own, name))}
            for speed, depth, verdict, chatter, own in zip(
                cuts.spindle_speed, cuts.axial_depth, cuts.verdict, cuts.chatter_frequency, cuts.own, strict=True
            )
        ],
        "posterior": {
            "effective_draws": found.effective,
            "log_evidence": found.log_evidence,
            "log_score_before": found.log_score_before,
            "points": (found.points * _PER_POINT).tolist(),
            "draws": _rounded(found.z),
            "errors": _rounded(found.error),
        },
    } | _process_to_json(learnt)


def _process_to_json(learnt: LearntTip) -> dict[str, Any]:
    """The labels without physics, beside it."""
    own = learnt.process
    if own is None:
        return {}
    features = own.features
    return {
        "without_physics": {
            "log_evidence": own.log_evidence,
            "middle": own.middle.tolist(),
            "sessions": list(own.sessions),
            "numbers": features.numbers.tolist(),
            "kinds": features.kinds.tolist(),
            "session": features.session.tolist(),
            "counts": own.counts.tolist(),
            "draws": _rounded(own.drawn),
        }
    }


def _process_of(top: Table) -> LabelProcess | None:
    """The same as `LearntTip` takes it."""
    if "without_physics" not in top.data:
        return None
    table = top.table("without_physics")
    numbers, kinds, counts, drawn = (_matrix(table, key, n) for key, n in (("numbers", 4), ("kinds", 2), ("counts", 3), ("draws", None)))
    session = np.array(table.numbers("session", None))
    names = tuple(str(each) for each in table.value("sessions", "a list of names"))
    features = CutFeatures(numbers, kinds, session)
    with table.naming({}):
        return LabelProcess(features, np.array(table.numbers("middle", 4)), names, counts, drawn, table.number("log_evidence"))


def believed(learnt: LearntTip) -> dict[str, Any]:
    """Return mean and standard deviation of modes and coefficients before and after the labels, in the field's units."""
    prior, n = learnt.prior, learnt.prior.modes.pole.size
    omega = np.abs(prior.modes.pole)
    means = np.concatenate(
        [
            to_hz(omega),
            -prior.modes.pole.real / omega,
            np.ones(n),
            1e-6 * learnt.coefficients.tangential * np.array([1.0, learnt.coefficients.radial_ratio]),
        ]
    )
    before = np.concatenate([np.sqrt(np.expm1(np.sum(root**2, axis=1))) for root in (prior.root, prior.coefficients)]) * means
    drawn = prior.factors(learnt.posterior.z) * means
    values = list(zip(means, before, drawn.mean(axis=0), drawn.std(axis=0), strict=True))

    def told(k: int) -> dict[str, list[float]]:
        mean, spread, after, left = (float(f"{v:.5g}") for v in values[k])
        return {"before": [mean, spread], "after": [after, left]}

    names = ("natural_frequency_hz", "damping_ratio", "stiffness_factor")
    rows = [{name: told(part * n + k) for part, name in enumerate(names)} for k in range(n)]
    return {"modes": rows, "tangential_mpa": told(3 * n), "radial_mpa": told(3 * n + 1)}


def learnt_tip_of(data: Any, where: str) -> LearntTip:
    """Return the tip of a file's content; `where` is the file, for the messages."""
    top = Table(data, where)
    version = top.number("schema_version", whole=True)
    if version != SCHEMA_VERSION:
        top.refuse("schema_version", version, f"{SCHEMA_VERSION}")
    top.text("kind", choices=(KIND,))
    workpiece = workpiece_of(top.table("workpiece", WORKPIECE_KEYS))
    table = top.table("prior")
    modes = table.tables("modes")
    pole = 2.0 * np.pi * np.array([complex(*mode.numbers("pole", 2, "Hz")) for mode in modes])
    with table.naming({}):
        tip = TipModes(pole, _complex(modes, "outputs").T, _complex(modes, "inputs"), _matrix(table, "residual_compliance", None))
        prior = UncertainTip(
            tip,
            _matrix(table, "root", None),
            _matrix(table, "coefficients", 2),
            1e-5 * table.number("softening_sd_percent_per_1000_rpm", "%", least=0.0) / from_rpm(1.0),
        )
    labels = top.table("labels")
    model = LabelModel(_noun(labels, "noise", LabelNoise), _noun(labels, "discrepancy", LimitDiscrepancy))
    found = top.table("posterior")
    z = _matrix(found, "draws", prior.size)
    points = (_matrix(found, "points", 3) if top.data.get("cuts") else np.zeros((0, 3))) / _PER_POINT
    errors = _matrix(found, "errors", len(points)) if len(points) else np.zeros((len(z), 0))
    with found.naming({}):
        posterior = LabelPosterior(
            z, points, errors, found.number("log_evidence"), found.number("effective_draws", above=0.0), found.number("log_score_before")
        )
    method = METHODS[top.text("method", choices=tuple(METHODS))]()
    return LearntTip(prior, workpiece.coefficients, method, model, _cuts(top), posterior, _process_of(top))


def _cuts(top: Table) -> TestedCuts:
    rows = top.tables("cuts") if top.data.get("cuts") else []
    return TestedCuts(
        from_rpm(np.array([row.number("spindle_speed_rpm", "rev/min", above=0.0) for row in rows])),
        1e-3 * np.array([row.number("axial_depth_mm", "mm", above=0.0) for row in rows]),
        tuple(Verdict(row.text("verdict", choices=tuple(Verdict))) for row in rows),
        from_hz(np.array([row.number("chatter_frequency_hz", "Hz", np.nan, above=0.0) for row in rows])),
        tuple(_own(row) for row in rows),
    )


def _own(row: Table) -> OwnConditions:
    with row.naming({}):
        return own_conditions({name: str(row.data[name]) for name in OWN if name in row.data})


def _parts(model: LabelModel) -> Sequence[tuple[str, LabelNoise | LimitDiscrepancy]]:
    return ("noise", model.noise), ("discrepancy", model.discrepancy)


def _noun(top: Table, key: str, kind: type[Nouns]) -> Nouns:
    table = top.table(key)
    with table.naming({}):
        return kind(**{f.name: table.number(f.name) for f in fields(kind)})


def _matrix(table: Table, key: str, columns: int | None) -> FloatArray:
    """A list of rows of numbers, as many in each."""
    allowed = f"a list of rows of {'equally many' if columns is None else columns} finite numbers"
    rows = table.value(key, allowed)
    try:
        found = np.array(rows, dtype=float)
    except (TypeError, ValueError, OverflowError):
        table.refuse(key, "rows that differ, or no numbers", allowed)
    if found.ndim != 2 or not np.all(np.isfinite(found)) or (columns is not None and found.shape[1] != columns):
        table.refuse(key, f"shape {found.shape}", allowed)
    return found


def _complex(modes: Sequence[Table], key: str) -> ComplexArray:
    found = [_matrix(mode, key, 2) @ np.array([1.0, 1.0j]) for mode in modes]
    for mode, own in zip(modes, found, strict=True):
        if own.size != found[0].size:
            mode.refuse(key, f"{own.size} rows", f"as many as of the first mode: {found[0].size}")
    return np.array(found)


def _pair(value: complex) -> list[float]:
    return [float(value.real), float(value.imag)]


def _rounded(values: FloatArray) -> list[list[float]]:
    return np.round(values, _DIGITS).tolist()
