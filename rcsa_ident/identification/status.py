"""May an answer be used, and are there enough cuts for one?"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from enum import StrEnum

#: Toolings, and usable cuts of each, with fewer of which every identification is suspect.
FEWEST_TOOLINGS, FEWEST_CUTS = 2, 8
#: The same where accelerometers on the spindle's housing are the only sensors.
FEWEST_OF_HOUSING = 3


class Status(StrEnum):
    """May the answer be used?

    It has converged where the toolings predict each other within their bands; it is not validated where nothing could be compared, suspect
    where something speaks against it. One that has failed has no axes.
    """

    CONVERGED = "converged"
    NOT_VALIDATED = "not validated"
    SUSPECT = "suspect"
    FAILED = "failed"


def too_few(toolings: Iterable[str], of_flange: bool = True) -> str | None:
    """Return a sentence where the usable cuts are too few for an answer without doubts, else None.

    `toolings`: of each usable cut
    `of_flange`: whether sensors see the flange; accelerometers on the housing alone do not
    """
    needed, words = (FEWEST_TOOLINGS, "two toolings") if of_flange else (FEWEST_OF_HOUSING, "three toolings, as no sensor sees the flange,")
    if sum(count >= FEWEST_CUTS for count in Counter(toolings).values()) >= needed:
        return None
    return f"Too few for an identification that can be relied on: it needs {words} with {FEWEST_CUTS} usable cuts each, better 20."
