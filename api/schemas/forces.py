"""Forces of a recording, and the first message of a stream."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import ConfigDict, Field, StringConstraints

from api.schemas.campaigns import SensorKeys
from api.schemas.common import Answer, Body, Id, Line
from api.schemas.queries import Cut, Depth, Percent, Tooling
from api.schemas.toolings import EXAMPLE
from api.work.forces import ForceQuestion, WornQuestion
from rcsa_ident.base.units import from_rpm
from rcsa_ident.cutting.conditions import Engagement

MOST_CHANNELS = 32
#: Sampling rates of a stream [Hz]; those of a file may be higher.
LEAST_RATE, MOST_RATE = 1000.0, 500_000.0
Rate = Annotated[float, Field(ge=LEAST_RATE, le=10_000_000.0)]
Speed = Annotated[float | None, Field(ge=100.0, le=200_000.0, description="Programmed speed, accurate to 1 %; null: from the trigger.")]
Method = Literal["resonators", "paper"]
#: Name of a recording in its campaign: the last part of a path, without control characters.
FileName = Annotated[str, StringConstraints(min_length=1, max_length=255, pattern=r"^[^\x00-\x1f\x7f/\\]+$")]
Axis = Literal["X", "Y"]


Sensors = Annotated[
    dict[Line, SensorKeys] | None,
    Field(min_length=1, max_length=MOST_CHANNELS, description="Sensors by channel; null: those of the machine's identification."),
]
Angle = Annotated[float, Field(ge=0.0, le=180.0)]
Turn = Annotated[float, Field(ge=-360.0, le=360.0)]


class WornCut(Body):
    """The cut whose cutting coefficients are estimated revolution by revolution."""

    axial_depth_mm: Depth
    feed_per_tooth_mm: Annotated[float, Field(gt=0.0, le=10.0)]
    immersion: Annotated[float, Field(ge=0.001, le=1.0)] = 0.5
    strategy: Literal["up", "down"] = "down"
    entry_deg: Annotated[Angle | None, Field(description="Together with exit_deg, instead of immersion.")] = None
    exit_deg: Angle | None = None
    feed_direction: Literal["+X", "-X", "+Y", "-Y"] | Turn = "+X"

    def question(self) -> WornQuestion:
        """Return the cut in SI."""
        cut = Cut(**self.model_dump(exclude={"axial_depth_mm", "feed_per_tooth_mm"})).spec()
        told = cut.engagement
        engagement = told if isinstance(told, Engagement) else Engagement.from_immersion(self.immersion, self.strategy)
        return WornQuestion(self.axial_depth_mm * 1e-3, self.feed_per_tooth_mm * 1e-3, engagement, cut.feed_angle)


class ForceKeys(Body):
    """Keys of both forms of the query."""

    machine: Id
    spindle_speed_rpm: Speed = None
    method: Annotated[
        Method,
        Field(
            description="Force model of the Kalman filter: resonators at the spindle harmonics, or the random walk of the published method."
        ),
    ] = "resonators"
    smooth: Annotated[bool, Field(description="Smoothed estimate from the whole record, instead of the filtered one of a live stream.")] = (
        False
    )
    idle_percent: Annotated[
        Percent | None, Field(gt=0.0, description="Least share of the time in which no tooth cuts, from which the mean force is estimated.")
    ] = None
    cut: Annotated[WornCut | None, Field(description="For cutting coefficients over time.")] = None

    def question(self, programmed: float | None = None) -> ForceQuestion:
        """Return the query in SI; `programmed` [rad/s] is the campaign's speed."""
        speed = programmed if self.spindle_speed_rpm is None else from_rpm(self.spindle_speed_rpm)
        idle = None if self.idle_percent is None else self.idle_percent / 100.0
        return ForceQuestion(speed, self.method, self.smooth, idle, None if self.cut is None else self.cut.question())


class ForceUpload(ForceKeys):
    """Query for an uploaded file: the part `query` of a form."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"machine": "m1", "tooling": EXAMPLE, "spindle_speed_rpm": 12000.0, "smooth": True}]}
    )

    tooling: Tooling
    sensors: Sensors = None
    sampling_rate_hz: Annotated[Rate | None, Field(description="For a recording without a sampling rate.")] = None


class ForceQuery(ForceKeys):
    """Forces of a recording of a campaign; its air cut is the campaign's."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"machine": "m1", "campaign": "c1", "recording": "S1-ER32-00_cut.h5"}]})

    campaign: Id
    recording: FileName
    tooling: Annotated[Tooling | None, Field(description="null: the tooling of the cut.")] = None


class AxisForces(Answer):
    """Forces along an axis [N]."""

    std_n: float = Field(description="Standard deviation of a sample of the estimate.")
    mean_n: float | None = Field(description="Mean force; null where the sensors do not show it.")
    rms_n: float = Field(description="Root mean square without the mean.")
    peak_n: float
    low: list[float] = Field(description="Minimum of each bucket.")
    high: list[float]


class Harmonic(Answer):
    """A harmonic of the force."""

    order: int = Field(description="Order of the harmonic of the spindle frequency.")
    frequency_hz: float
    amplitude_n: float


class Coefficient(Answer):
    """A cutting coefficient over the record."""

    mean: float
    std: float
    trend_per_s: float
    trend_std_per_s: float
    unit: str


class Wear(Answer):
    """Cutting coefficients."""

    coefficients: dict[str, Coefficient]
    separable: bool = Field(description="Whether the harmonics in the band separate the coefficients.")
    misfit: float


class ForceAnswer(Answer):
    """Forces of a recording as an envelope of at most 2000 buckets; every sample with Accept: text/csv."""

    spindle_speed_rpm: float
    sampling_rate_hz: float
    band_hz: list[float]
    notes: list[str]
    axes: dict[str, AxisForces]
    left_out_s: float = Field(description="Beginning of the recording in which the observer settles: without forces, nowhere counted.")
    time_s: list[float] = Field(description="Time of each bucket's first sample in the recording.")
    harmonics: dict[str, list[Harmonic]]
    wear: Wear | None


class StreamSummary(Answer):
    """An open stream."""

    session: str
    name: str
    machine: str
    tooling: str
    started: str
    stage: str
    sampling_rate_hz: float
    axes: list[str]
    samples: int
    lost: int
    dropped: int


class StreamsAnswer(Answer):
    """All open streams of the group."""

    items: list[StreamSummary]


class AirCut(Body):
    """An uploaded air cut."""

    campaign: Id
    recording: FileName


class Replay(AirCut):
    """Replay of an uploaded recording."""

    rate: Annotated[float, Field(ge=0.1, le=100.0, description="Replay speed as a multiple of the recorded one.")] = 1.0


class Hello(Body):
    """Keys of the first message of every stream."""

    key: Annotated[str, StringConstraints(max_length=300)] | None = None
    format: Literal["float32", "json"] = "float32"
    envelope: Annotated[int | None, Field(ge=1, le=1_000_000)] = None


class StreamHello(Hello):
    """First message of a data logger."""

    machine: Id
    tooling: Tooling
    spindle_speed_rpm: Speed = None
    sampling_rate_hz: Annotated[float, Field(ge=LEAST_RATE, le=MOST_RATE)]
    channels: list[Line] = Field(min_length=1, max_length=MOST_CHANNELS)
    axes: Annotated[list[Axis] | None, Field(min_length=1, max_length=2)] = None
    sensors: Sensors = None
    name: Line = ""
    settle_s: Annotated[float, Field(ge=0.2, le=5.0)] = 1.0
    begins: Literal["air", "cut"] = "cut"
    air: AirCut | None = None
    method: Method = "resonators"


class ReplayHello(Hello):
    """First message of a replay."""

    replay: Replay
    machine: Id | None = None
    tooling: Tooling | None = None
    name: Line = ""
    method: Method = "resonators"


class WatchHello(Hello):
    """First message of a viewer of another client's stream."""

    watch: Id
