"""What further cuts teach of the toolings that they were made with."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from api.schemas.common import Answer
from api.schemas.toolings import ToolingKeys


class LearntNumber(Answer):
    """A number of a drawing before and after the cuts, with its standard deviations."""

    what: str
    unit: str
    drawn: float
    drawn_std: float
    found: float
    found_std: float


class LearntTooling(Answer):
    """A tooling before and after its cuts."""

    name: str = Field(description="In the campaign, and in the library once it is taken over.")
    contradiction: str = Field(description="Why its cuts cannot have been made with it; empty where they can.")
    learned: list[LearntNumber]
    tooling: ToolingKeys | None = Field(description="With what was learned; null where its cuts contradict it.")


class LeftOut(Answer):
    """A cut that is not used."""

    cut: str
    reason: str


class LearnAnswer(Answer):
    """What the cuts of a campaign teach, as `rcsa-ident learn --toolings` tells it."""

    campaign: str
    machine: str
    status: Literal["converged", "suspect", "not-converged"] = Field(description="suspect: cuts contradict their tooling.")
    toolings: list[LearntTooling]
    model_error: list[float] = Field(description="Share of the lines of each axis that is left unexplained.")
    notes: list[str]
    left_out: list[LeftOut]
    warnings: list[str] = Field(description="What speaks against the machine that is taken as known.")
    etag: str = Field(description="Of identification, campaign and recordings, for If-Match where it is taken over.")
    written: list[str] = Field([], description="Toolings of the library that were written now.")
    machine_written: bool = Field(False, description="Whether the machine's identification was written now.")
