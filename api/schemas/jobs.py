"""Jobs, and what an identification has found."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import ConfigDict, Field

from api.schemas.common import Answer, Body, Fault, Id
from api.schemas.queries import LobeAnswer

JobState = Literal["queued", "running", "done", "failed", "cancelled"]


class NewIdentification(Body):
    """A campaign to identify its machine from."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"campaign": "c1", "seed": 1, "method": "default"}]})

    campaign: Id
    seed: Annotated[int, Field(ge=0, le=2**63 - 1, description="Same seed and recordings, same answer.")] = 1
    method: Annotated[Literal["default", "paper"], Field(description="paper: the published genetic algorithm, which takes long.")] = (
        "default"
    )
    start: bool = Field(False, description="Go on from the machine's current identification; with the default method.")
    apply: bool = Field(True, description="Make it the machine's current identification, unless it failed.")


class Progress(Answer):
    """How far a stage is."""

    stage: str
    done: int
    total: int


class JobProblem(Answer):
    """Why a job failed."""

    detail: str
    errors: list[Fault]


class JobAnswer(Answer):
    """A job."""

    id: str
    kind: Literal["identification", "lobes"]
    machine: str
    campaign: str | None
    state: JobState
    progress: Progress | None
    created: str = Field(description="UTC, ISO 8601.")
    started: str | None
    finished: str | None
    status: Literal["converged", "suspect", "failed"] | None = Field(description="Of an identification that is done.")
    problem: JobProblem | None


class LobeJob(Answer):
    """Lobes that were computed as a job."""

    job: JobAnswer
    answer: LobeAnswer | None = Field(description="Once it is done.")


class Lines(Answer):
    """Lines of the cross FRF from the tip's force to the flange [m/N], each cut's delay taken out, beside the model's."""

    frequency_hz: list[float]
    measured_re: list[float]
    measured_im: list[float]
    model_re: list[float]
    model_im: list[float]
    coherence: list[float]
    tooling: list[str]


class FittedLines(Answer):
    """What was measured, and what was fitted to it."""

    axes: dict[str, Lines]
