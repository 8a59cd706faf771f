"""What a virtual machine's campaign consists of, and the truth that no machine shop has."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from rcsa_ident.base.arrays import ComplexArray, FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedRecord:
    """One record with what was true while it was made.

    Parameters
    ----------
    spindle_speed : float [rad/s]
    tooth_angle : float [rad]
        Immersion of tooth 1 at the first sample.
    channels : mapping of str to array, shape (n,)
    """

    spindle_speed: float
    tooth_angle: float
    channels: Mapping[str, FloatArray]


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedCut:
    """A cut and its air cut.

    Parameters
    ----------
    id, tooling : str
    records : mapping of ``cut`` and ``air`` to SimulatedRecord
    force_lines : complex array, shape (m + 1, 2) [N]
        True force by spindle order, F = Re sum_m lines[m] e^{i m angle of tooth 1}, X and Y.
    """

    id: str
    tooling: str
    records: Mapping[str, SimulatedRecord]
    force_lines: ComplexArray


@dataclass(frozen=True, slots=True, eq=False)
class TrueReceptances:
    """Of one tooling on the machine at a spindle speed, from the full equations.

    Parameters
    ----------
    tooling : str
    spindle_speed : float [rad/s]
    frequency_hz : array, shape (n,)
    tip, cross : complex arrays, shape (n, 2, 2) [m/N]
        Tip-tip and flange-tip: motion in X and Y, then force in X and Y.
    """

    tooling: str
    spindle_speed: float
    frequency_hz: FloatArray
    tip: ComplexArray
    cross: ComplexArray


@dataclass(frozen=True, slots=True, eq=False)
class TrueFlange:
    """The spindle's flange without a tooling.

    Parameters
    ----------
    frequency_hz : array, shape (n,)
    values : complex array, shape (n, 4, 4)
        Translation and slope in X, then in Y, under force and moment in X, then in Y.
    """

    frequency_hz: FloatArray
    values: ComplexArray
