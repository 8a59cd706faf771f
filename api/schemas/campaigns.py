"""Campaigns as in campaign.toml, and their recordings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, StringConstraints

from api.schemas.common import Answer, Body, Declared, EngagementRows, Fault, Keys
from api.schemas.toolings import EXAMPLE as TOOLING
from api.schemas.toolings import Text, ToolingKeys
from rcsa_ident.io.settings.setups import sensor_of_keys
from rcsa_ident.setup.fields import CAMPAIGN, CUT, HAMMER_TEST, RECORDINGS, SENSOR, WORKPIECE
from rcsa_ident.signals.recording import Sensor

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

#: What a query of forces does not ask of a sensor.
_UNHEARD = ("gain_spread_percent", "cross_talk_percent", "delay_spread_us")


class HeadKeys(Keys, fields=CAMPAIGN):
    """[campaign]"""

    clock_error_percent: Annotated[float, Field(ge=-2.0, le=2.0)] | None = None


class SensorKeys(Keys, fields=SENSOR, limits=True):
    """A sensor as [sensors.CHANNEL] of campaign.toml; the key is the channel's name in the recordings."""

    sensitivity: Annotated[float, Field(ge=-1e12, le=1e12)] | None = None
    gain_spread_percent: float | None = None
    cross_talk_percent: float | None = None
    delay_spread_us: float | None = None

    def sensor(self, name: str) -> Sensor:
        """Return the sensor of a channel; how well it is known counts in identifications only."""
        return sensor_of_keys(name, {key: value for key, value in dict(self).items() if key not in _UNHEARD})


def given_sensors(keys: Mapping[str, SensorKeys] | None) -> tuple[Sensor, ...]:
    """Return the sensors that a query brings."""
    return tuple(each.sensor(name) for name, each in (keys or {}).items())


class WorkpieceKeys(Keys, fields=WORKPIECE):
    """[workpiece]"""

    name: Text


class CutConditions(Declared, fields=CUT):
    """What a cut was: how its cutter was engaged is told by angles, a radial depth, a block's sides, or a map."""

    id: Text
    tooling: Text
    engagement: EngagementRows | None = None
    feed_direction: str | float
    started: str | None = None


class CutKeys(Keys, CutConditions, fields=RECORDINGS):
    """[[cuts]]"""

    cut: FileName
    air: FileName | None = None


class HammerTestKeys(Keys, fields=HAMMER_TEST):
    """[[frfs]]"""

    id: Text
    tooling: Text
    file: FileName
    units: str | None = None


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
