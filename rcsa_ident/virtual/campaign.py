"""What a virtual machine's campaign consists of, and the truth that no machine shop has."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from rcsa_ident.base.arrays import ComplexArray, FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedRecord:
    """One record with what was true while it was made.

    `spindle_speed` [rad/s]
    `tooth_angle` [rad]: immersion of tooth 1 at the first sample
    `channels`: mapping of str to array, shape (n,)
    """

    spindle_speed: float
    tooth_angle: float
    channels: Mapping[str, FloatArray]


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedCut:
    """A cut and its air cut.

    `records`: mapping of ``cut`` and ``air`` to SimulatedRecord
    `force_lines` [N], shape (m + 1, 2): true force by spindle order, F = Re sum_m lines[m] e^{i m angle of tooth 1}, X and Y
    """

    id: str
    tooling: str
    records: Mapping[str, SimulatedRecord]
    force_lines: ComplexArray


@dataclass(frozen=True, slots=True, eq=False)
class TrueReceptances:
    """Of one tooling on the machine at a spindle speed, from the full equations.

    `spindle_speed` [rad/s]; `frequency_hz`, shape (n,)
    `tip`, `cross` [m/N], shape (n, 2, 2): tip-tip and flange-tip: motion in X and Y, then force in X and Y
    """

    tooling: str
    spindle_speed: float
    frequency_hz: FloatArray
    tip: ComplexArray
    cross: ComplexArray


@dataclass(frozen=True, slots=True, eq=False)
class TrueFlange:
    """The spindle's flange without a tooling.

    `frequency_hz`, shape (n,)
    `values`, shape (n, 4, 4): translation and slope in X, then in Y, under force and moment in X, then in Y
    """

    frequency_hz: FloatArray
    values: ComplexArray
