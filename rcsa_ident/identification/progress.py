"""What a search says of itself while it runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import StrEnum

from rcsa_ident.identification.candidate import Candidate

#: Axis of a step that is about both.
BOTH = "both"


class Stage(StrEnum):
    """What a step of a search has done; costs of one stage compare with each other."""

    SEARCH = "search"
    REFINE = "refine"
    NOISE = "learn noise"
    MODES = "modes"
    EXCHANGE = "exchange"
    OTHER_AXIS = "from the other axis"
    POLISH = "polish"
    GROW = "grow"
    GENERATION = "generation"


@dataclass(frozen=True, slots=True)
class Step:
    """One step of a search.

    `axis`: x, y or `BOTH`
    `cost`: what it came to; of `Stage.MODES` minus twice the log evidence, which may be below zero
    `modes`: of all its axes together
    `candidate`: where the search stands, told while it runs; a trace does not keep it
    """

    axis: str
    stage: Stage
    cost: float
    modes: int
    candidate: Candidate | None = field(default=None, compare=False, repr=False)

    @property
    def label(self) -> str:
        """What a reader is shown: the stage, or how many modes were tried."""
        return f"{self.modes} modes" if self.stage is Stage.MODES else str(self.stage)


#: Is told of every step; with a map over processes it has to be picklable.
Progress = Callable[[Step], None]


class Silent:
    """A progress callable that tells nobody: what one becomes in a process from which it reaches no one."""

    def __call__(self, step: Step) -> None:
        """Leave the step unsaid."""
