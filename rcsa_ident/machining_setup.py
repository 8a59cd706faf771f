"""What was on the machine: toolings, workpiece, sensors, cuts. A campaign file becomes these nouns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.signals.recording import Sensor
from rcsa_ident.tool_holder.geometry import ToolAssembly


@dataclass(frozen=True, slots=True)
class Tooling:
    """A cutter, with the tool and holder that carry it."""

    name: str
    cutter: Cutter
    assembly: ToolAssembly


@dataclass(frozen=True, slots=True)
class Workpiece:
    """A material and its cutting coefficients with the campaign's cutters."""

    name: str
    coefficients: CuttingCoefficients


@dataclass(frozen=True, slots=True)
class Cut:
    """One cut, and the files that it was recorded in.

    Parameters
    ----------
    id : str
    tooling : str
        Key of the campaign's toolings.
    conditions : CuttingConditions
        As programmed; the true speed comes from the record.
    recording : Path
    air : Path or None
        The same speed without cutting.
    """

    id: str
    tooling: str
    conditions: CuttingConditions
    recording: Path
    air: Path | None = None


@dataclass(frozen=True, slots=True)
class Campaign:
    """Recordings of one machine.

    Parameters
    ----------
    sampling_rate : float or None [Hz]
        For files that carry none.
    """

    name: str
    sampling_rate: float | None
    sensors: tuple[Sensor, ...]
    workpiece: Workpiece
    toolings: Mapping[str, Tooling]
    cuts: tuple[Cut, ...]
