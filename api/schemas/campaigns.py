"""Campaigns as in campaign.toml, and their recordings."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, StringConstraints

from api.schemas.common import CORRECTION, Answer, Body, CorrectionName, EngagementRows, Fault, Line
from api.schemas.toolings import EXAMPLE as TOOLING
from api.schemas.toolings import Text, ToolingKeys
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.signals.recording import Quantity, Role, Sensor

FileName = Annotated[str, StringConstraints(min_length=1, max_length=1000)]

EXAMPLE: dict[str, Any] = {
    "campaign": {"name": "HPM 800U, 2026-11", "sampling_rate_hz": 51200.0},
    "sensors": {
        "flange_x": {"quantity": "displacement", "axis": "X", "sensitivity": 10000.0},
        "fixture_x": {"quantity": "acceleration", "axis": "X", "sensitivity": 0.0011094},
    },
    "workpiece": {"name": "EN AW-6082", "tangential_coefficient_mpa": 902.0, "radial_ratio": 0.26},
    "toolings": {"S1-ER32": TOOLING},
    "cuts": [
        {
            "id": "S1-ER32-00",
            "tooling": "S1-ER32",
            "spindle_speed_rpm": 8000.0,
            "axial_depth_mm": 0.4,
            "feed_per_tooth_mm": 0.1,
            "entry_angle_deg": 90.0,
            "exit_angle_deg": 180.0,
            "feed_direction": "+X",
            "cut": "S1-ER32_00_cut.h5",
            "air": "S1-ER32_00_air.h5",
        }
    ],
}


class HeadKeys(Body):
    """[campaign]"""

    name: Line | None = None
    sampling_rate_hz: float | None = Field(None, description="For files without a sampling rate.")
    clock_error_percent: float | None = Field(
        None, ge=-2.0, le=2.0, description="By how much the recorder's clock runs fast: it takes that many more samples in a second."
    )
    axial_depth_spread_mm: float | None = Field(None, description="Standard deviation of the depth, common to a tooling's cuts; 0.02.")
    speed_softening_percent: float | None = Field(
        None, description="Standard deviation of the stiffness's change from the middle of the speeds to their end."
    )


class SensorKeys(Body):
    """A sensor as [sensors.CHANNEL] of campaign.toml; the key is the channel's name in the recordings."""

    quantity: Literal["displacement", "acceleration", "trigger", "force"]
    axis: Literal["X", "Y", "Z"] | None = None
    sensitivity: float | None = Field(
        None, ge=-1e12, le=1e12, description="Signal per quantity: V/m, V/(m/s^2), V/N; 1 where the file is in SI."
    )
    delay_s: float | None = Field(None, ge=-1.0, le=1.0)
    bandwidth_hz: float | None = Field(None, gt=0.0)
    role: Literal["spindle", "fixture", "table", "workpiece"] | None = Field(None, description="What an accelerometer is fixed to.")
    mount_resonance_hz: float | None = Field(None, gt=0.0, description="Of the sensor on its mount, a magnet or wax.")
    rotation_deg: float | None = Field(
        None, ge=-180.0, le=180.0, description="Of what the sensor measures from its axis, about the spindle's, from +X towards +Y."
    )
    pulses_per_revolution: int | None = Field(None, ge=1, le=100_000)
    tooth_angle_deg: float | None = Field(None, ge=-360.0, le=360.0)
    gain_spread_percent: float | None = Field(None, description="Standard deviation of the gain; 2. Counts where drawings are rough.")
    cross_talk_percent: float | None = Field(None, description="Standard deviation of what it feels of the other axis; 1.5.")
    delay_spread_us: float | None = Field(None, description="Standard deviation of its delay; 5.")
    distance_behind_flange_mm: float | None = Field(
        None,
        ge=-100.0,
        le=300.0,
        description="How far a displacement sensor looks behind the face between holder and spindle; negative: at the holder.",
    )
    distance_spread_mm: float | None = Field(None, ge=0.0, le=100.0, description="Standard deviation of that distance; 1.")

    def sensor(self, name: str) -> Sensor:
        """Return the sensor of a channel."""
        return Sensor(
            name,
            Quantity(self.quantity),
            None if self.axis is None else Dof(self.axis.lower()),
            1.0 if self.sensitivity is None else self.sensitivity,
            0.0 if self.delay_s is None else self.delay_s,
            self.bandwidth_hz,
            1 if self.pulses_per_revolution is None else self.pulses_per_revolution,
            None if self.tooth_angle_deg is None else math.radians(self.tooth_angle_deg),
            None if self.role is None else Role(self.role),
            self.mount_resonance_hz,
            0.0 if self.rotation_deg is None else math.radians(self.rotation_deg),
            distance=None if self.distance_behind_flange_mm is None else 1e-3 * self.distance_behind_flange_mm,
            distance_spread=1e-3 * (1.0 if self.distance_spread_mm is None else self.distance_spread_mm),
        )


def given_sensors(keys: Mapping[str, SensorKeys] | None) -> tuple[Sensor, ...]:
    """Return the sensors that a query brings."""
    return tuple(each.sensor(name) for name, each in (keys or {}).items())


class WorkpieceKeys(Body):
    """[workpiece]"""

    name: Text
    tangential_coefficient_mpa: float
    radial_ratio: float
    axial_ratio: float | None = None
    tangential_edge_n_per_mm: float | None = None
    radial_edge_n_per_mm: float | None = None
    axial_edge_n_per_mm: float | None = None
    tangential_coefficient_spread_percent: float | None = None
    radial_ratio_spread_percent: float | None = None
    edge_spread_percent: float | None = None
    edge_force_spread_n_per_mm: float | None = Field(None, description="Standard deviation of edge forces that nobody tells; 10.")


class CutConditions(BaseModel):
    """What a cut was: how its cutter was engaged is told by angles, a radial depth, a block's sides, or a map."""

    id: Text
    tooling: Text
    spindle_speed_rpm: float
    spindle_speed_to_rpm: float | None = Field(None, description="At which a pass ends whose speed changes evenly; null keeps the speed.")
    axial_depth_mm: float
    feed_per_tooth_mm: float
    entry_angle_deg: float | None = Field(None, description="At the cutter's diameter; with a shape, down and up milling are stepovers.")
    exit_angle_deg: float | None = None
    radial_depth_mm: float | None = Field(None, description="With strategy, instead of the angles.")
    strategy: Literal["up", "down"] | None = None
    stock: Literal["stepover", "block"] | None = Field(None, description="What stood around the cutter.")
    y_from_mm: float | None = Field(None, description="Of a block: its sides beside the cutter's path, along the normal direction.")
    y_to_mm: float | None = None
    engagement: EngagementRows | None = Field(None, description="Rows of z_mm, entry_angle_deg, exit_angle_deg from the tip up.")
    lead_deg: float | None = Field(None, description="By which the tool leans in the direction of the feed, with engagement.")
    tilt_deg: float | None = None
    feed_direction: str | float = Field(description="+X, -X, +Y, -Y, or an angle from +X in degrees.")
    posture_deg: list[float] | None = Field(None, description="Of a robot's joints; an identification of the robot asks for it.")
    started: str | None = Field(None, description="When the recording began, as 2026-11-27T08:15:00.")
    temperature_c: float | None = Field(None, description="Near the spindle's bearings.")
    validation: bool | None = Field(None, description="The cut is predicted, and nothing is learned from it.")


class CutKeys(Body, CutConditions):
    """[[cuts]]"""

    cut: FileName = Field(description="Recording of the cut; only the last part of a path counts, and its suffix is the format.")
    air: FileName | None = Field(None, description="Recording at the same speed without cutting; may serve several cuts.")


class HammerTestKeys(Body):
    """[[frfs]]"""

    id: Text
    tooling: Text
    axis: Literal["X", "Y"]
    response: Literal["tip", "flange"] | float = Field(description="tip, flange (the machine's side of it), or mm from the tip.")
    force: Literal["tip", "flange"] | float = Field(description="As response; one of the two is a point of tool or holder.")
    file: FileName = Field(description="File of the FRF; only the last part of a path counts, and its content says what it is.")
    record: int | None = Field(None, description="Which of several FRFs in the file.")
    units: str | None = Field(None, description="Of a file that tells none: a motion over a force, such as um/N.")
    standstill: bool | None = None
    sensor_mass_g: float | None = None
    from_hz: float | None = None
    to_hz: float | None = None
    error_percent: float | None = Field(None, description="By how much each line may be wrong beside its noise; 2 if left out.")
    correction: CorrectionName | None = Field(None, description=CORRECTION)


class NewCampaign(Body):
    """A campaign to make, with the keys of campaign.toml: cuts, hammer tests, or both."""

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE]})

    campaign: HeadKeys | None = None
    sensors: dict[str, SensorKeys] | None = Field(None, description="Asked for where there are cuts, as is the workpiece.")
    workpiece: WorkpieceKeys | None = None
    toolings: dict[str, ToolingKeys | str] | None = Field(
        None,
        description="For each name that cuts and hammer tests use: a name of the library, the keys of a tooling, or a path that ends in "
        ".toml, which means the library's tooling of that very name. Left out, all names are the library's.",
    )
    cuts: list[CutKeys] | None = Field(None, min_length=1)
    frfs: list[HammerTestKeys] | None = Field(None, min_length=1, description="Hammer tests, beside the cuts or in their place.")


class VerdictAnswer(Answer):
    """Whether a recording is used."""

    usable: bool
    reasons: list[str] = Field(description="Why the recording is not usable.")
    notes: list[str] = Field(description="Remarks on a usable recording.")
    spindle_speed_rpm: float | None = Field(description="Measured speed of a usable cut.")
    lines: int = Field(description="Points of the cross FRF, all axes together.")
    windows: int = Field(1, description="As how many cuts of nearly one speed a usable recording counts: more than one of a pass.")
    signal_to_noise_db: dict[str, float] = Field(description="Median over the lines, for each axis.")


class FileState(Answer):
    """A file that a cut or a hammer test names."""

    name: str
    uploaded: bool


class CutAnswer(Answer, CutConditions):
    """A cut of a campaign."""

    cut: FileState
    air: FileState | None
    verdict: VerdictAnswer | None = Field(description="With the recordings uploaded so far; null without the cut's recording.")


class HammerTestAnswer(Answer):
    """A hammer test of a campaign."""

    id: str
    tooling: str
    axis: Literal["X", "Y"]
    response: str | float
    force: str | float
    file: FileState
    lines: int | None = Field(description="Lines of its FRF that an identification uses; null without its file.")


class CampaignAnswer(Answer):
    """A campaign."""

    id: str
    machine: str
    name: str
    created: str
    example: bool = Field(description="Whether the virtual machine makes its recordings; it takes no others.")
    sampling_rate_hz: float | None
    sensors: dict[str, dict[str, Any]]
    workpiece: dict[str, Any] = Field(description="Empty where hammer tests alone tell none.")
    toolings: list[str]
    rough_toolings: list[str] = Field([], description="Those whose drawings are not exact: cuts teach them.")
    usable: int = Field(description="Number of cuts that an identification would use.")
    remarks: list[str] = Field(description="What is unusual about its toolings, its workpiece and its cuts.")
    too_few: str | None = Field(description="What is missing, where these are too few for an identification that can be relied on.")
    cuts: list[CutAnswer]
    hammer_tests: list[HammerTestAnswer] = Field([], description="The tables [[frfs]].")


class CampaignSummary(Answer):
    """Summary of a campaign."""

    id: str
    machine: str
    name: str
    created: str
    cuts: int
    uploaded: int = Field(description="Number of cuts with a recording.")
    usable: int
    hammer_tests: int = Field(0, description="Number of hammer tests.")
    missing: int = Field(description="Number of files, of cuts, in the air and of hammer tests, that it names and nobody has uploaded.")
    without_air: int = Field(description="Number of cuts for which the campaign names no air cut.")


class FrfAnswer(Answer):
    """An FRF of a hammer test: the lines of it that an identification uses."""

    id: str
    lines: int
    from_hz: float
    to_hz: float


class RecordingAnswer(Answer):
    """An uploaded recording, or a file of hammer tests, and its description."""

    name: str
    role: Literal["cut", "air", "hammer"]
    cuts: list[str] = Field(description="Ids of the cuts, or of the hammer tests, that it serves.")
    size_bytes: int
    sha256: str = Field(description="SHA-256 of the original file.")
    sampling_rate_hz: float | None = Field(description="Null for hammer tests, as is the duration.")
    duration_s: float | None
    frfs: list[FrfAnswer] = Field([], description="Of hammer tests.")
    channels: list[str]
    spindle_speed_rpm: float | None = Field(description="Measured speed.")
    harmonics_above_noise: dict[str, int] = Field(
        description="Number of harmonics above the noise for each axis: of the tooth-passing frequency, of an air cut of the spindle's."
    )
    verdict: VerdictAnswer
    created: str


class ItemProblem(Answer):
    """Why a file of an upload was not stored."""

    detail: str
    errors: list[Fault] | None


class UploadItem(Answer):
    """One file of a common upload."""

    name: str
    status: int = Field(description="201 where it is stored, 200 where it existed already, or the status of the same upload on its own.")
    recording: RecordingAnswer | None
    problem: ItemProblem | None


class UploadAnswer(Answer):
    """Outcome of each file."""

    items: list[UploadItem]


class ChannelSpectrum(Answer):
    """Amplitudes of a channel."""

    unit: str
    amplitude: list[float]


class SpectrumAnswer(Answer):
    """Amplitudes over frequency."""

    frequency_hz: list[float]
    channels: dict[str, ChannelSpectrum]
    harmonics_hz: list[float] = Field(description="Harmonics of the spindle frequency.")


class ChannelOutline(Answer):
    """Minima and maxima of a channel; null where all samples of an interval were lost."""

    unit: str
    low: list[float | None]
    high: list[float | None]


class SignalAnswer(Answer):
    """Envelope of a recording over time."""

    time_s: list[float]
    channels: dict[str, ChannelOutline]
