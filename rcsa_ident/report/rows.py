"""What a table shows of a recording, a mode or a curve, as plain rows: for the console, for machines, for a page."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from rcsa_ident.dynamics.modal import ModalModel
from rcsa_ident.machining_setup import Cut
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


def recording_rows(readings: Iterable[tuple[Cut, Reading]]) -> list[RecordingRow]:
    """Return a row for each recording, in the campaign's order."""
    rows = []
    for cut, reading in readings:
        verdict, found = reading.verdict, reading.measurement
        common = (cut.id, cut.tooling, verdict.usable, verdict.reasons, verdict.notes, cut.conditions.spindle_speed * _RPM)
        if found is None:
            rows.append(RecordingRow(*common))
            continue
        ratios = {
            axis.upper(): float(10.0 * np.log10(np.median(np.abs(lines.receptance) ** 2 / (2.0 * lines.variance))))
            for axis, lines in found.axes.items()
            if lines.omega.size
        }
        count = sum(lines.omega.size for lines in found.axes.values())
        rows.append(RecordingRow(*common, found.spindle_speed * _RPM, count, ratios))
    return rows


@dataclass(frozen=True, slots=True)
class ModeRow:
    """One mode at the flange: shapes times 10^3, as the field prints them."""

    frequency_hz: float
    damping_percent: float
    phi_t: complex
    phi_r: complex


def mode_rows(modes: ModalModel) -> list[ModeRow]:
    """Return a row for each mode, by frequency."""
    order = np.argsort(modes.omega_n)
    return [
        ModeRow(float(modes.omega_n[n] / (2.0 * np.pi)), float(100.0 * modes.zeta[n]), complex(modes.phi[n, 0]), complex(modes.phi[n, 1]))
        for n in order
    ]


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
