"""Jobs, and results of identifications."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import ConfigDict, Field

from api.schemas.common import Answer, Body, Fault, Id, Name
from api.schemas.queries import LobeAnswer

JobState = Literal["queued", "running", "done", "failed", "cancelled"]


class NewIdentification(Body):
    """Identification of a machine, or of a robot, from a campaign."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"campaign": "c1", "seed": 1, "method": "default"}]})

    campaign: Id
    seed: Annotated[int, Field(ge=0, le=2**63 - 1, description="The same seed and recordings give the same result.")] = 1
    method: Annotated[Literal["default", "paper"], Field(description="paper: the published genetic algorithm, which takes long.")] = (
        "default"
    )
    start: bool = Field(False, description="Start from the machine's current identification; with the default method only.")
    apply: bool = Field(True, description="Make it the machine's current identification, unless it failed; of a robot nothing is.")
    robot: Name | None = Field(
        None, description="A robot, kept or published, that made the cuts, each at its posture_deg: its springs and spindle are found."
    )


class Progress(Answer):
    """Progress of a stage."""

    stage: str
    done: int
    total: int


class QueuePlace(Answer):
    """Where a job stands among those of its kind that wait; 1 is the next one."""

    place: int
    waiting: int


class JobProblem(Answer):
    """Why a job failed, or why the service cancelled it."""

    detail: str
    errors: list[Fault]


class JobAnswer(Answer):
    """A job."""

    id: str
    kind: Literal["identification", "lobes", "path"]
    machine: str = Field(description="Its id; empty where a robot is asked.")
    campaign: str | None
    state: JobState
    progress: Progress | None
    queue: QueuePlace | None = Field(description="While it waits for a worker.")
    waited_s: float = Field(description="Until a worker took it up, or so far.")
    running_s: float = Field(description="Since a worker took it up, until it ended or so far.")
    created: str = Field(description="UTC, ISO 8601.")
    started: str | None
    finished: str | None
    status: Literal["converged", "not validated", "suspect", "failed"] | None = Field(description="Of a finished identification.")
    problem: JobProblem | None


class LobeJob(Answer):
    """Lobes that were computed as a job."""

    job: JobAnswer
    answer: LobeAnswer | None = Field(description="Once the job is done.")


class PartialLobes(Answer):
    """What is known of a tooling's lobes while a job computes them speed by speed; each replaces the one before."""

    tooling: str
    index: int = Field(description="Of the tooling in the question, from 0.")
    spindle_speed_rpm: list[float] = Field(description="Whose limits are known, rising; some lie beside those that were asked for.")
    limit_depth_mm: list[float | None] = Field(description="null: stable up to the depth that was asked for.")
    chatter_frequency_hz: list[float | None]


class Lines(Answer):
    """Measured and fitted lines of the cross FRF from the tip force to the flange [m/N], with the delay of each cut removed."""

    frequency_hz: list[float]
    measured_re: list[float]
    measured_im: list[float]
    model_re: list[float]
    model_im: list[float]
    coherence: list[float]
    tooling: list[str]


class FittedLines(Answer):
    """Measured and fitted lines of all axes."""

    axes: dict[str, Lines]
