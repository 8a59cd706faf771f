"""What a table shows of a recording, a mode or a curve, as plain rows: for the console, for machines, for a page."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from rcsa_ident.arrays import FloatArray
from rcsa_ident.cutting.force import REFERENCE_RUNOUT, ForceCoefficient, ForceTerm
from rcsa_ident.dynamics.modal import ModalModel
from rcsa_ident.signals.measurement import Reading

_RPM = 30.0 / np.pi


@dataclass(frozen=True, slots=True)
class RecordingRow:
    """One recording and its verdict.

    Parameters
    ----------
    programmed_rpm, found_rpm : float, float or None [rev/min]
    lines : int
        Points of the cross FRF that it gives, both axes together.
    signal_to_noise_db : dict of axis to float
        Median over the lines.
    """

    id: str
    tooling: str
    usable: bool
    reasons: tuple[str, ...]
    notes: tuple[str, ...]
    programmed_rpm: float
    found_rpm: float | None = None
    lines: int = 0
    signal_to_noise_db: dict[str, float] = field(default_factory=dict)


def recording_rows(readings: Iterable[Reading]) -> list[RecordingRow]:
    """Return a row for each reading, in their order."""
    rows = []
    for reading in readings:
        verdict, found = reading.verdict, reading.measurement
        common = (reading.cut_id, reading.tooling, verdict.usable, verdict.reasons, verdict.notes, reading.programmed_speed * _RPM)
        if found is None:
            rows.append(RecordingRow(*common))
            continue
        ratios = {
            axis.upper(): float(10.0 * np.log10(np.median(np.abs(lines.receptance) ** 2 / (2.0 * np.sum(lines.variance, axis=1)))))
            for axis, lines in found.axes.items()
            if lines.omega.size
        }
        count = sum(lines.omega.size for lines in found.axes.values())
        rows.append(RecordingRow(*common, found.spindle_speed * _RPM, count, ratios))
    return rows


@dataclass(frozen=True, slots=True)
class ModeRow:
    """One mode at the flange, in the field's units; standard deviations where a posterior gives them.

    Parameters
    ----------
    frequency_hz, damping_percent : float
    phi_t, phi_r : complex [sqrt(s/kg)], [sqrt(s/(kg m^2))]
    frequency_std_hz, damping_std_percent : float or None
    """

    frequency_hz: float
    damping_percent: float
    phi_t: complex
    phi_r: complex
    frequency_std_hz: float | None = None
    damping_std_percent: float | None = None


def mode_rows(modes: ModalModel, deviation: tuple[FloatArray, FloatArray] | None = None) -> list[ModeRow]:
    """Return a row for each mode, by frequency.

    Parameters
    ----------
    modes : ModalModel
    deviation : (array, array), optional
        Standard deviations of natural frequencies [rad/s] and damping ratios, in the modes' order.
    """
    order = np.argsort(modes.omega_n)
    deviations = (
        [(None, None)] * order.size if deviation is None else [(d / (2.0 * np.pi), 100.0 * z) for d, z in zip(*deviation, strict=True)]
    )
    return [
        ModeRow(
            float(modes.omega_n[n] / (2.0 * np.pi)),
            float(100.0 * modes.zeta[n]),
            complex(modes.phi[n, 0]),
            complex(modes.phi[n, 1]),
            *deviations[n],
        )
        for n in order
    ]


@dataclass(frozen=True, slots=True)
class CoefficientRow:
    """What was found of a force's uncertain coefficient: a factor on what the campaign says, or a run-out [µm]."""

    name: str
    value: float
    std: float
    unit: str


def coefficient_rows(found: Mapping[ForceCoefficient, tuple[float, float]]) -> list[CoefficientRow]:
    """Return a row for each coefficient of an identification, whose logarithms become factors."""
    rows = []
    for coefficient, (value, std) in found.items():
        name = str(coefficient)
        if coefficient.term is ForceTerm.RUNOUT:
            unit = 1e6 * REFERENCE_RUNOUT
            rows.append(CoefficientRow(name, value * unit, std * unit, "µm"))
        else:
            rows.append(CoefficientRow(name, float(np.exp(value)), float(np.exp(value)) * std, "times the campaign's"))
    return rows


@dataclass(frozen=True, slots=True)
class PeakRow:
    """Where a tip receptance is largest, and where its real part is lowest (which limits a cut)."""

    frequency_hz: float
    magnitude: float
    lowest_real_part: float


def peak_row(frequency_hz: np.ndarray, values: np.ndarray) -> PeakRow:
    """Return the largest peak of a receptance [m/N]."""
    k = int(np.argmax(np.abs(values)))
    return PeakRow(float(frequency_hz[k]), float(np.abs(values[k])), float(values.real.min()))


def two_digits(std: float, value: float | None = None) -> str:
    """Return a standard deviation with two digits and no exponent, below a millionth 0; or a value with as many places as it."""
    places = max(0, 1 - int(np.floor(np.log10(std)))) if std > 1e-6 else 0 if value is None else 6
    return f"{std if value is None else value:.{places}f}"
