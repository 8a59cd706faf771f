"""Machines and their identifications."""

from __future__ import annotations

from typing import Any

from pydantic import ConfigDict, Field

from api.schemas.common import Answer, Body, Line, Name


class NewMachine(Body):
    """A machine to make."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"name": "HPM 800U", "description": "hall 3"}]})

    name: Name = Field(description="Unique in the group.")
    description: Line = ""


class MachineAnswer(Answer):
    """A machine."""

    id: str
    name: str
    description: str
    created: str = Field(description="UTC, ISO 8601.")
    identification: IdentificationSummary | None = Field(description="null where the machine has not been identified.")


class IdentificationSummary(Answer):
    """Summary of an identification."""

    status: str = Field(description="converged, suspect or failed; measured where a flange was measured in place of it")
    reasons: list[str]
    campaign: str
    axes: list[str]
    band_hz: list[float]
    changed: str
    etag: str


class Identification(Answer):
    """RESULT.json of `rcsa-ident identify`; further keys are kept."""

    model_config = ConfigDict(extra="allow")

    schema_version: int
    status: str
    reasons: list[str]
    seed: int
    method: str
    software: str
    campaign: dict[str, Any]
    sensors: dict[str, Any]
    workpiece: dict[str, Any]
    band_hz: list[float]
    axes: dict[str, Any]


class Mode(Answer):
    """A mode of the spindle at its flange."""

    natural_frequency_hz: float
    natural_frequency_std_hz: float | None
    damping_ratio: float
    damping_ratio_std: float | None
    phi_t: list[float] = Field(description="Real and imaginary part of the translation [sqrt(s/kg)].")
    phi_r: list[float] = Field(description="Real and imaginary part of the slope.")


class AxisModes(Answer):
    """One axis of an identification."""

    modes: list[Mode]
    joint: dict[str, float]
    misfit_per_point: float | None


class Modes(Answer):
    """Modes of an identification, with standard deviations where it has them."""

    status: str
    reasons: list[str]
    notes: list[str] = Field(description="What the data could not determine.")
    band_hz: list[float]
    axes: dict[str, AxisModes]


class Frf(Answer):
    """Receptances over frequency."""

    frequency_hz: list[float]
    axes: dict[str, Curve]


class Curve(Answer):
    """A receptance [m/N], with the standard deviations of its real and imaginary parts where there is a posterior."""

    re: list[float]
    im: list[float]
    re_std: list[float] | None
    im_std: list[float] | None


MachineAnswer.model_rebuild()
Frf.model_rebuild()
