"""Long work of an identification as tasks, for a map that may send them to other processes."""

from __future__ import annotations

from collections.abc import Iterable
from enum import StrEnum
from typing import Any, ClassVar, Protocol

import numpy as np


class Phase(StrEnum):
    """Parts of an identification whose tasks are independent of each other: each is one call of the map."""

    SEARCH = "search"
    OTHER_AXIS = "from the other axis"
    BOTH_AXES = "both axes"
    COUPLED = "both planes together"


class Task(Protocol):
    """What a method gives to its map, through `perform`: the same task, the same answer, to the last bit.

    It answers with arrays, numbers, `Candidate` or `AxisSearch`, which a service may keep in place of doing the task again. Where its
    numbers lead nowhere finite it raises ArithmeticError or LinAlgError.
    """

    #: The part that it belongs to, the same for all tasks of a call.
    phase: ClassVar[Phase]

    def run(self) -> Any:
        """Return the task's answer."""
        ...


def perform(task: Task) -> Any:
    """Return a task's answer, None where its numbers lead nowhere finite: the one function that methods map."""
    try:
        return task.run()
    except (ArithmeticError, np.linalg.LinAlgError):
        return None


def finite(answers: Iterable[Any]) -> list[Any]:
    """Return the answers of a phase. Raises `FloatingPointError` if one of them is none."""
    found = list(answers)
    if any(answer is None for answer in found):
        raise FloatingPointError("a task without a finite answer")
    return found
