"""What a tool does in many cuts: margin, force, motion of the tip and wall; cuts on one tip share what it costs to know that."""

from __future__ import annotations

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
    `map_`: over the tips, then over tasks of some cuts
    `progress`: told how many cuts are done, and of how many
    """
    places = list(map_(_place, questions))
    tasks = _tasks(places, cuts, range(len(cuts)))
    answers: dict[int, CutAnswer] = {}
    for which, found in zip(tasks, map_(_judged, tasks.values()), strict=True):
        answers |= zip(which, found, strict=True)
        if progress is not None:
            progress(len(answers), len(cuts))
    doubtful = [k for k, cut in enumerate(cuts) if places[cut.place].asked.doubtful(cut.process, answers[k].margin)]
    again = {cuts[k].place: cuts[k].process for k in reversed(doubtful)}
    for at, tip in zip(again, map_(_with_drawn_modes, [(places[at].asked, process) for at, process in again.items()]), strict=True):
        places[at] = places[at]._replace(asked=tip)
    tasks = _tasks(places, cuts, doubtful, answers)
    for which, margins in zip(tasks, map_(_settled, tasks.values()), strict=True):
        answers |= {k: answers[k]._replace(margin=margin) for k, margin in zip(which, margins, strict=True)}
    return [answers[k] for k in range(len(cuts))]


def _tasks(
    places: Sequence[_Place], cuts: Sequence[Cut], which: Sequence[int], known: dict[int, CutAnswer] | None = None
) -> dict[tuple[int, ...], _Task]:
    """Some cuts of one place each, by their numbers."""
    of_place: dict[int, list[int]] = {}
    for k in which:
        of_place.setdefault(cuts[k].place, []).append(k)
    parts = [(at, own[i : i + _TOGETHER]) for at, own in of_place.items() for i in range(0, len(own), _TOGETHER)]
    return {
        tuple(own): _Task(places[at], [cuts[k] for k in own], [] if known is None else [known[k].margin for k in own]) for at, own in parts
    }


def _place(question: ToolChange) -> _Place:
    """The tip of a question, ready to be asked about other cuts."""
    ((_, tip),) = question.tips(question.speeds, question.omega, spread=question.draws > 0)
    asked = AskedTip.of(tip, question.process, float(question.speeds[0]), question.method, question.draws)
    plane = from_rest(tip)
    return _Place(asked, both_directions(Receptance(plane.omega, plane.values, plane.rows, plane.cols)))


def _judged(task: _Task) -> list[CutAnswer]:
    return [_answer(task.place, cut) for cut in task.cuts]


def _with_drawn_modes(task: tuple[AskedTip, MillingProcess]) -> AskedTip:
    return task[0].with_drawn_modes(task[1])


def _settled(task: _Task) -> list[Margin]:
    asked = task.place.asked
    return [asked.settled(cut.process, cut.depth, margin) for cut, margin in zip(task.cuts, task.margins, strict=True)]


def _answer(place: _Place, cut: Cut) -> CutAnswer:
    process, depth, speed = cut.process, cut.depth, place.asked.speed
    margin = place.asked.margin(process, depth)
    cutter = process.cutter
    # teeth that are alike repeat each other
    alike = cutter.teeth if cutter.equally_spaced and not cutter.offset else 1
    instants = -(-_ANGLES // alike)
    angle = 2.0 * np.pi * np.arange(instants) / (instants * alike)
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
