"""What a tool does in many cuts: margin, force, motion of the tip and wall; cuts on one tip share what it costs to know that."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.scaleout import Map
from rcsa_ident.cutting.force import force_history
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.stability.lobes import both_directions
from rcsa_ident.stability.margins import AskedTip, Margin
from rcsa_ident.stability.surface_error import forced_vibration, from_rest, surface_location_error
from rcsa_ident.workflows.tool_change import ToolChange

#: Cuts of one task: however many processes there are, the tasks are the same ones.
_TOGETHER = 64
#: Instants of a revolution, and slices of the depth, for forces.
_ANGLES, _SLICES = 180, 16


class Cut(NamedTuple):
    """A cut at a place: its number among the tips.

    `depth` [m]
    """

    place: int
    process: MillingProcess
    depth: float


class CutAnswer(NamedTuple):
    """What a tool does in a cut.

    `mean_force` [N], shape (3,): on the tool along the feed, its normal and the axis towards the spindle
    `peak_force` [N]: across the axis, in a revolution
    `deflection` [m]: of the tip across the axis, the largest in a revolution; not a number where the cut is unstable
    `form_error` [m]: of the wall, mean along the edge; not a number where none is left, or the cut is unstable
    """

    margin: Margin
    mean_force: FloatArray
    peak_force: float
    deflection: float
    form_error: float


class _Place(NamedTuple):
    """A tip at one speed: as margins ask for it, and its receptance in X and Y from rest, for stable cuts."""

    asked: AskedTip
    plane: Receptance


class _Task(NamedTuple):
    """Some cuts at a place, with their margins where these are known."""

    place: _Place
    cuts: Sequence[Cut]
    margins: Sequence[Margin] = ()


def judged(
    questions: Sequence[ToolChange], cuts: Sequence[Cut], map_: Map = map, progress: Callable[[int, int], None] | None = None
) -> list[CutAnswer]:
    """Return what a tool does in each cut.

    `questions`: one for each place: any of its cuts, at its speed
    `map_`: over places with few cuts, and over tasks of some cuts of a place with many: what a tip leaves open is kept of one at a time
    `progress`: told how many cuts are done, and of how many
    """
    answers: dict[int, CutAnswer] = {}

    def known(which: Sequence[int], found: Sequence[CutAnswer]) -> None:
        answers.update(zip(which, found, strict=True))
        if progress is not None:
            progress(len(answers), len(cuts))

    of_place: dict[int, list[int]] = {}
    for k, cut in enumerate(cuts):
        of_place.setdefault(cut.place, []).append(k)
    few = {at: own for at, own in of_place.items() if len(own) <= _TOGETHER}
    for own, found in zip(few.values(), map_(_whole, [(questions[at], [cuts[k] for k in own]) for at, own in few.items()]), strict=True):
        known(own, found)
    for at, own in of_place.items():
        if at in few:
            continue
        place = _place(questions[at])
        parts = [own[i : i + _TOGETHER] for i in range(0, len(own), _TOGETHER)]
        for which, found in zip(parts, map_(_judged, [_Task(place, [cuts[k] for k in which]) for which in parts]), strict=True):
            known(which, found)
        answers |= zip(own, _settled(place, [cuts[k] for k in own], [answers[k] for k in own], map_), strict=True)
    return [answers[k] for k in range(len(cuts))]


def _whole(task: tuple[ToolChange, Sequence[Cut]]) -> list[CutAnswer]:
    """All cuts of a place."""
    question, cuts = task
    place = _place(question)
    return _settled(place, cuts, _judged(_Task(place, cuts)), map)


def _settled(place: _Place, cuts: Sequence[Cut], answers: Sequence[CutAnswer], map_: Map) -> list[CutAnswer]:
    """The answers with those lower margins settled that are doubtful."""
    doubtful = [k for k, (cut, answer) in enumerate(zip(cuts, answers, strict=True)) if place.asked.doubtful(cut.process, answer.margin)]
    if not doubtful:
        return list(answers)
    place = place._replace(asked=place.asked.with_drawn_modes(cuts[doubtful[0]].process))
    parts = [doubtful[i : i + _TOGETHER] for i in range(0, len(doubtful), _TOGETHER)]
    tasks = [_Task(place, [cuts[k] for k in which], [answers[k].margin for k in which]) for which in parts]
    margins = dict(zip(doubtful, itertools.chain.from_iterable(map_(_settled_margins, tasks)), strict=True))
    return [answer._replace(margin=margins.get(k, answer.margin)) for k, answer in enumerate(answers)]


def _place(question: ToolChange) -> _Place:
    """The tip of a question, ready to be asked about other cuts."""
    ((_, tip),) = question.tips(question.speeds, question.omega, spread=question.draws > 0)
    asked = AskedTip.of(tip, question.process, float(question.speeds[0]), question.method, question.draws)
    plane = from_rest(tip)
    return _Place(asked, both_directions(Receptance(plane.omega, plane.values, plane.rows, plane.cols)))


def _judged(task: _Task) -> list[CutAnswer]:
    return [_answer(task.place, cut) for cut in task.cuts]


def _settled_margins(task: _Task) -> list[Margin]:
    asked = task.place.asked
    return [asked.settled(cut.process, cut.depth, margin) for cut, margin in zip(task.cuts, task.margins, strict=True)]


def _answer(place: _Place, cut: Cut) -> CutAnswer:
    process, depth, speed = cut.process, cut.depth, place.asked.speed
    margin = place.asked.margin(process, depth)
    cutter = process.cutter
    # teeth that come round alike repeat each other
    instants = -(-_ANGLES // cutter.symmetry)
    angle = 2.0 * np.pi * np.arange(instants) / (instants * cutter.symmetry)
    force = force_history(cutter, process.conditions(speed, depth), process.coefficients, angle, _SLICES) * [1.0, 1.0, -1.0]
    # from the machine's axes into the feed's
    force[:, :2] = force[:, :2] @ process.machine_from_feed
    moved, error = np.nan, np.nan
    if margin.times >= 1.0:
        moved = float(np.max(np.linalg.norm(forced_vibration(place.plane, process, speed, depth), axis=1)))
        # no wall is left by most cuts of a shape, and by cuts in the middle of the material
        with suppress(InputError):
            error = float(surface_location_error(place.plane, process, np.array([speed]), depth).mean[0])
    return CutAnswer(margin, force.mean(axis=0), float(np.max(np.linalg.norm(force[:, :2], axis=1))), moved, error)
