"""Machines and their identifications."""

from __future__ import annotations

from typing import Any, Literal

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
    example: bool = Field(description="Whether the virtual machine made its recordings.")
    identification: IdentificationSummary | None = Field(description="null where the machine has not been identified.")


class CampaignContents(Answer):
    """What is deleted with a campaign."""

    id: str
    name: str
    example: bool = Field(description="Whether the virtual machine made it.")
    recordings: list[str] = Field(description="Names of the files that were uploaded for it.")
    size_bytes: int


class MachineContents(Answer):
    """What is deleted with a machine."""

    id: str
    name: str
    example: bool = Field(description="Whether it is the example.")
    identification: str | None = Field(description="Its status; null where there is none.")
    campaigns: list[CampaignContents]
    toolings: list[str] = Field(description="Toolings of the example that nobody has changed; empty for other machines.")
    etag: str


class IdentificationSummary(Answer):
    """Summary of an identification."""

    status: str = Field(description="converged, not validated, suspect or failed; measured where a flange was measured in place of it")
    reasons: list[str]
    campaign: str
    axes: list[str]
    band_hz: list[float]
    toolings: list[str] = Field([], description="That it was identified with.")
    taught_by: list[str] = Field([], description="Campaigns of further toolings that have taught the machine, too.")
    temperature_c: list[float] | None = Field(
        None, description="Lowest and highest of the cuts, where the machine changes with the temperature near the bearings; else null."
    )
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
    both_planes: BothPlanes | None = Field(
        None, description="Where X and Y feel each other: the machine; `axes` then hold each plane at standstill, without the other."
    )


class IdentifiedRobot(Answer):
    """RESULT.json of `rcsa-ident robot identify`; further keys are kept."""

    model_config = ConfigDict(extra="allow")

    schema_version: int
    kind: Literal["identified robot"]
    status: str
    reasons: list[str]
    seed: int
    software: str
    campaign: dict[str, Any]
    band_hz: list[float]
    springs: list[dict[str, Any]]
    robot: dict[str, Any]


class WholeMode(Answer):
    """A mode of a machine whose X and Y feel each other, its spindle at standstill."""

    natural_frequency_hz: float
    natural_frequency_std_hz: float | None = None
    damping_ratio: float
    damping_ratio_std: float | None = None
    direction_deg: float = Field(description="Of the line along which it moves the flange, from +X towards +Y, above -90 to 90.")
    phi: list[list[float]] = Field(description="Real and imaginary part of translation and slope in X, then in Y.")


class BothPlanesModes(Answer):
    """Modes of a machine whose X and Y feel each other."""

    in_words: str = Field("", description="How strong, where, and of which kind.")
    modes: list[WholeMode]
    gyroscopic: bool = Field(description="Whether gyroscopic moments couple them: receptances then depend on the spindle speed.")


class BothPlanes(Answer):
    """`both_planes` of RESULT.json; further keys are kept."""

    model_config = ConfigDict(extra="allow")

    in_words: str = Field("", description="How strong the coupling is, where, and of which kind.")
    layout: dict[str, Any] = Field(description="Modes, softening, discs of gyroscopic moments, and the sense of rotation: 1, -1 or 0.")
    speed_range_rpm: list[float]
    modes: list[WholeMode]
    gyroscopic: list[list[float]] = Field(description="G between the modes; empty where there is none.")
    residual_compliance: list[list[float]]
    unknowns: list[float]
    rivals: list[dict[str, Any]]
    covariance: dict[str, Any]


class Mode(Answer):
    """A mode of the spindle at its flange."""

    natural_frequency_hz: float
    natural_frequency_std_hz: float | None
    damping_ratio: float
    damping_ratio_std: float | None
    phi_t: list[float] = Field(description="Real and imaginary part of the translation [sqrt(s/kg)].")
    phi_r: list[float] = Field(description="Real and imaginary part of the slope.")


class Prediction(Answer):
    """How the lines of a tooling are predicted by the others, or of a cut that judges the answer."""

    error: float = Field(description="Norm of the difference over that of what was measured.")
    promised: float = Field(description="The same as bands and noise promise it.")


class AxisModes(Answer):
    """One axis of an identification."""

    modes: list[Mode]
    joint: dict[str, float]
    misfit_per_point: float | None
    validation: dict[str, Prediction] = Field({}, description="By tooling; empty where nothing could be compared.")


class SideMode(Answer):
    """A mode of the workpiece's side of the cut."""

    natural_frequency_hz: float
    natural_frequency_std_hz: float
    damping_ratio: float
    damping_ratio_std: float
    stiffness_n_per_m: float
    stiffness_std_n_per_m: float


class SideModes(Answer):
    """What gives way on the workpiece's side along an axis."""

    sensor: str = Field(description="The accelerometer that showed it.")
    role: Literal["table", "workpiece"] = Field(description="What that is fixed to.")
    lines: int
    modes: list[SideMode] = Field(description="Empty where nothing stands above the noise.")
    misfit_per_point: float


class LearnedNumber(Answer):
    """A number of a drawing before and after the cuts."""

    toolings: list[str] = Field(description="That share it.")
    what: str
    unit: str
    drawn: float
    spread: float = Field(description="Standard deviation of what is drawn.")
    found: float
    deviation: float = Field(description="Standard deviation of what is found.")
    hardly_taught: bool = Field(description="Whether the cuts hardly taught it.")


class Modes(Answer):
    """Modes of an identification, with standard deviations where it has them."""

    status: str
    reasons: list[str]
    notes: list[str] = Field(description="What the data could not determine.")
    band_hz: list[float]
    axes: dict[str, AxisModes]
    both_planes: BothPlanesModes | None = Field(None, description="Where X and Y feel each other: the modes of both together.")
    workpiece_side: dict[str, SideModes] = Field(
        {}, description="What gives way under the workpiece, by axis: limits hold for tool and workpiece together, a tip FRF is the tool's."
    )
    learned: list[str] = Field(
        [], description="What was learned beyond the modes: warming, forces and joints that differ from what was told."
    )
    toolings: list[LearnedNumber] = Field([], description="What the cuts taught of toolings whose drawings are not exact.")


class Frf(Answer):
    """Receptances over frequency."""

    frequency_hz: list[float]
    axes: dict[str, Curve]
    cross: dict[str, Curve] = Field(default={}, description="Where planes feel each other: XY is the motion in X under a force in Y.")
    spindle_speed_rpm: float | None = Field(None, description="At which they hold; null where they do not change with it.")


class Curve(Answer):
    """A receptance [m/N], with the standard deviations of its real and imaginary parts where there is a posterior."""

    re: list[float]
    im: list[float]
    re_std: list[float] | None
    im_std: list[float] | None


MachineAnswer.model_rebuild()
Identification.model_rebuild()
Frf.model_rebuild()
