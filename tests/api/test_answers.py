"""Answers that are kept: the same question is computed once, another one anew, and those not asked for longest go first."""

from __future__ import annotations

import asyncio
import pickle

import pytest

from api.work.answers import Answers
from api.work.requests import MachineText, ToolingSource
from rcsa_ident.base.errors import InputError

MACHINE, TOOLING = MachineText("abc", "text"), ToolingSource("T1", "teeth = 2")


class Counted:
    """Work that counts what it is asked."""

    waiting, ready = 0, True

    def __init__(self):
        self.asked = []

    async def run(self, call, *arguments):
        self.asked.append(arguments)
        return call(*arguments)

    def start(self):
        pass

    def stop(self):
        pass


def limits(machine, tooling, speeds):
    if not speeds:
        raise InputError("speeds", "none", "one at least")
    return {"tooling": tooling.name, "limit_depth_mm": [1.0 / speed for speed in speeds]}


def others(machine, tooling, speeds):
    return "others"


def test_a_question_is_computed_once():
    work = Counted()
    answers = Answers(work)
    first = asyncio.run(answers.of(limits, MACHINE, TOOLING, (1.0, 2.0)))
    # what somebody does to an answer is not the next one's
    first["limit_depth_mm"].clear()
    again = asyncio.run(answers.of(limits, MachineText("abc", "text"), ToolingSource("T1", "teeth = 2"), (1.0, 2.0)))
    assert again == {"tooling": "T1", "limit_depth_mm": [1.0, 0.5]}
    assert len(work.asked) == 1


@pytest.mark.parametrize(
    ("call", "machine", "tooling", "speeds"),
    [
        (others, MACHINE, TOOLING, (1.0,)),
        (limits, MachineText("abd", "text"), TOOLING, (1.0,)),
        (limits, MACHINE, ToolingSource("T2", "teeth = 2"), (1.0,)),
        (limits, MACHINE, ToolingSource("T1", keys={"teeth": 2}), (1.0,)),
        (limits, MACHINE, TOOLING, (1.0000000000000002,)),
    ],
)
def test_another_question_is_another(call, machine, tooling, speeds):
    work = Counted()
    answers = Answers(work)
    asyncio.run(answers.of(limits, MACHINE, TOOLING, (1.0,)))
    assert asyncio.run(answers.of(call, machine, tooling, speeds)) == call(machine, tooling, speeds)
    assert len(work.asked) == 2


def test_failures_are_not_kept_and_the_oldest_go_first():
    work, most = Counted(), 3 * len(pickle.dumps(limits(MACHINE, TOOLING, (1.0,))))
    answers = Answers(work, most)
    for _ in range(2):
        with pytest.raises(InputError, match="speeds"):
            asyncio.run(answers.of(limits, MACHINE, TOOLING, ()))
    for speed in (1.0, 2.0, 1.0, 3.0, 4.0, 1.0, 2.0):
        asyncio.run(answers.of(limits, MACHINE, TOOLING, (speed,)))
        assert answers.size == sum(map(len, answers.kept.values())) <= most
    assert [speeds for _, _, speeds in work.asked[2:]] == [(1.0,), (2.0,), (3.0,), (4.0,), (2.0,)]
    asyncio.run(answers.of(limits, MACHINE, TOOLING, tuple(range(1, 100))))
    assert answers.size <= most
