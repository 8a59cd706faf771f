"""Tooltip FRFs of an identification beside those of the virtual machine: errors, and how often the bands hold the truth.

Error of an FRF: ||dC11|| / ||C11|| over 600-4000 Hz in 5 Hz steps, X and Y each. Coverage: share of the real and imaginary parts whose
error is at most 0.6745 (50 %) or 1.645 (90 %) standard deviations of the band.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.study_table import AIMS
from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.units import to_hz
from rcsa_ident.io.curves.tips import read_frf_csv, read_tip
from rcsa_ident.io.settings.machines import MachineFile
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.io.settings.simulations import true_name
from rcsa_ident.machine.machine import Machine
from rcsa_ident.stability.tip_modes import TIP

FREQUENCY = np.arange(600.0, 4000.1, 5.0)
#: Half-widths of the bands in standard deviations.
BANDS = {"50": 0.6745, "90": 1.645}


def relative_error(found: ComplexArray, true: ComplexArray) -> float:
    """Return ||found - true|| / ||true||."""
    return float(np.linalg.norm(found - true) / np.linalg.norm(true))


def in_deviations(error: ComplexArray, deviation: tuple[FloatArray, FloatArray]) -> FloatArray:
    """Return the error's real and imaginary parts in the band's standard deviations, shape (2 n,); 0 where both vanish."""
    parts, sigma = np.concatenate([error.real, error.imag]), np.concatenate(deviation)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(parts == 0.0, 0.0, parts / sigma)


def coverage(z: FloatArray) -> dict[str, float]:
    """Return the share inside each of the `BANDS`, and the errors' root mean square, of errors in standard deviations."""
    inside = {name: float(np.mean(np.abs(z) <= width)) for name, width in BANDS.items()}
    return {**inside, "rms": float(np.sqrt(np.mean(z**2)))}


def compared(machine: Machine | None, setup: MachineFile, truth: Path) -> dict[str, dict[str, Any]]:
    """Return errors [X, Y] and coverage of the tooltip FRFs of the toolings that cut and of those that never did.

    `machine`: None, of a failed identification, predicts no motion
    `truth`: the campaign's; at the mean of the speeds
    """
    found: dict[str, dict[str, Any]] = {}
    for kind, paths in _kinds(setup).items():
        errors, deviations = [], []
        for path in paths:
            tooling = read_tooling(path)
            if machine is None:
                errors += [1.0, 1.0]
                continue
            true = read_frf_csv(truth / "tip" / true_name(tooling.name))
            at = np.searchsorted(true.frequency, FREQUENCY - 1e-6)
            tip = machine.tip(tooling, 2.0 * np.pi * FREQUENCY)
            deviation = tip.deviation()
            for row in TIP:
                found_here, true_here = tip.between(str(row), str(row)), true.values[row.dof.upper()][at]
                errors.append(relative_error(found_here, true_here))
                if (row, row) in deviation:
                    deviations.append(in_deviations(found_here - true_here, deviation[row, row]))
        bands = coverage(np.concatenate(deviations)) if deviations else None
        found[kind] = {"errors": _digits(errors), "bands": bands}
    return found


def compared_at_speeds(machine: Machine | None, setup: MachineFile, truth: Path) -> dict[str, dict[str, Any]]:
    """Return the same of a coupled machine with its cross terms, at the slowest, the mean and the fastest of the plan's speeds.

    ``errors`` are [X, Y] of each tooling, as of `compared`, at the worst of the speeds. ``cross`` are those of the cross terms over the
    norm of the direct FRF of the direction that moves, ||dC_XY|| / ||C_XX|| and ||dC_YX|| / ||C_YY||, ``cross_own`` those over their
    own norm, ||dC_XY|| / ||C_XY||: of each tooling the worse of both at the worst of the speeds. ``bands`` are over all speeds and
    over all terms that have one.

    `machine`: None, of a failed identification, predicts no motion
    `truth`: the campaign's
    """
    programmed = setup.plan.spindle_speeds
    mean = float(np.mean(programmed))
    found: dict[str, dict[str, Any]] = {}
    for kind, paths in _kinds(setup).items():
        direct, cross, own, deviations = [], [], [], []
        for path in paths:
            tooling = read_tooling(path)
            worst = np.zeros((3, 2))
            for speed in (min(programmed), mean, max(programmed)):
                # where nothing changes with the speed, one file is true of all
                its_own = speed != mean and setup.spindle.speed_dependent
                known = read_tip(truth / "tip" / true_name(tooling.name, speed if its_own else None))
                true = known.values[np.searchsorted(to_hz(known.omega), FREQUENCY - 1e-6)]
                values = np.zeros_like(true)
                if machine is not None:
                    tip = machine.at(speed).tip(tooling, 2.0 * np.pi * FREQUENCY)
                    values = tip.block(TIP).values
                    for (row, col), deviation in tip.deviation().items():
                        i, j = TIP.index(row), TIP.index(col)
                        deviations.append(in_deviations(values[:, i, j] - true[:, i, j], deviation))
                error, size = np.linalg.norm(values - true, axis=0), np.linalg.norm(true, axis=0)
                across = error[[0, 1], [1, 0]]
                here = [np.diag(error) / np.diag(size), across / np.diag(size), across / size[[0, 1], [1, 0]]]
                worst = np.maximum(worst, here)
            direct += worst[0].tolist()
            cross.append(float(worst[1].max()))
            own.append(float(worst[2].max()))
        bands = coverage(np.concatenate(deviations)) if deviations else None
        found[kind] = {"errors": _digits(direct), "cross": _digits(cross), "cross_own": _digits(own), "bands": bands}
    return found


def _kinds(setup: MachineFile) -> dict[str, tuple[Path, ...]]:
    """Files of the toolings that cut, of the one in a holder that cut, and of the one in another."""
    return {"cut": tuple(setup.toolings), **{kind: (path,) for kind, path in zip(AIMS, setup.truth_toolings, strict=True)}}


def _digits(errors: list[float]) -> list[float]:
    return [float(f"{e:.4g}") for e in errors]
