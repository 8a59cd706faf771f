"""An identification as a job: every recording's judgement and every search is a step that is not done twice."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from typing import Any

import numpy as np

from api.jobs.job_context import JobContext, Spread
from api.stores.entities import digest_of
from api.stores.jobs import Applied, Job, Outcome
from api.work import tasks
from api.work.machine_cache import posteriors
from rcsa_ident.arrays import FloatArray
from rcsa_ident.errors import InputError
from rcsa_ident.identification.data import IdentificationData
from rcsa_ident.identification.evidence import SMOOTH_ERROR, EvidenceSelection
from rcsa_ident.identification.genetic_algorithm import PaperGeneticAlgorithm
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.parameters import Layout
from rcsa_ident.identification.result import Identification
from rcsa_ident.io.identifications import identification_to_json
from rcsa_ident.io.results import check_result, layout, plain
from rcsa_ident.machining_setup import Campaign, Cut
from rcsa_ident.signals.measurement import Reading
from rcsa_ident.signals.recording import Recording
from rcsa_ident.units import to_hz
from rcsa_ident.workflows import identify as workflow
from rcsa_ident.workflows.identify import Method, ReadCut, judge_cut, left_out, mode_deviations

#: Returns a campaign of a group and what reads its cuts.
Load = Callable[[str, str], tuple[Campaign, ReadCut]]
#: Cuts that are judged in one step, and points of a curve.
CHUNK, POINTS = 4, 300
_STAGES = {"_search_axis": "search", "_from_other_axis": "from the other axis", "_from_start": "both axes", "_search": "search"}


def carry(load: Load, job: Job, desk: JobContext, spread: Spread = map) -> Outcome:
    """Identify a machine.

    Parameters
    ----------
    load : callable
    job : Job
        With campaign, seed, method and apply in its request; the identification that it goes on from is its text ``start``.
    spread : callable
        A map that the searches may go through, in place of the builtin.

    Raises
    ------
    InputError
        The campaign is gone or has changed, or none of its cuts is usable.
    """
    request = json.loads(job.request)
    start = desk.jobs.text(job.id, "start")
    campaign, read = load(job.group, str(job.campaign))
    plan = desk.remember("plan", lambda: [_files(cut) for cut in campaign.cuts])
    campaign = _planned(campaign, plan)
    readings = _readings(campaign, read, desk)
    found = workflow.identify(campaign, readings, _method(request["method"], start, desk, job), request["seed"], _Steps(desk, spread))
    desk.progress("result", 0, 1)
    deviations = mode_deviations(found)
    data = plain(identification_to_json(found, campaign, left_out(readings), deviations))
    if start is not None:
        data["started_from"] = digest_of(start)
    check_result(data, "")
    text = layout(data) + "\n"
    texts = {"result": text, "frf": json.dumps(_lines(found, campaign)), "report": _report(found, campaign, readings, deviations)}
    applied, problem = _applied(text) if request["apply"] else (None, None)
    desk.progress("result", 1, 1)
    return Outcome("done", "", status=str(found.status), texts=texts, applied=applied, problem=problem)


def _files(cut: Cut) -> list[str]:
    """What a cut is read from: the names say what is in the files."""
    return [cut.id, cut.recording.name, "" if cut.air is None else cut.air.name]


def _planned(campaign: Campaign, plan: list[list[str]]) -> Campaign:
    """The campaign as it was when the job began: what has been uploaded since then belongs to the next one."""
    there = {cut.id: cut for cut in campaign.cuts}
    cuts = []
    for id, recording, air in plan:
        if id not in there or _files(there[id])[1] != recording:
            raise InputError(
                "campaign", f"another recording of {id}, or none, since the job began", "recordings that stay while a job runs"
            )
        cuts.append(there[id] if air else replace(there[id], air=None))
    return replace(campaign, cuts=tuple(cuts))


def _readings(campaign: Campaign, read: ReadCut, desk: JobContext) -> list[Reading]:
    def reading(cut: Cut) -> Reading:
        desk.check()
        return judge_cut(campaign, anonymous, cut)

    def anonymous(cut: Cut) -> tuple[Recording, Recording | None]:
        try:
            return read(cut)
        except InputError as error:
            # where the service keeps its files is nobody's business
            raise InputError(error.field, error.found, error.allowed) from None

    readings: list[Reading] = []
    for first in range(0, len(campaign.cuts), CHUNK):
        cuts = campaign.cuts[first : first + CHUNK]
        desk.progress("recordings", first, len(campaign.cuts))
        readings += desk.remember(f"recordings.{first}", partial(_all, reading, cuts))
    desk.progress("recordings", len(campaign.cuts), len(campaign.cuts))
    return readings


def _all(reading: Callable[[Cut], Reading], cuts: Iterable[Cut]) -> list[Reading]:
    return [reading(cut) for cut in cuts]


def _method(name: str, start: str | None, desk: JobContext, job: Job) -> Method:
    if name == "paper":
        return PaperGeneticAlgorithm()
    known = None if start is None else posteriors(start)
    return _Telling(EvidenceSelection(start=known), desk, datetime.fromisoformat(str(job.started)))


class _Steps:
    """A map whose every result is a step of the job."""

    def __init__(self, desk: JobContext, spread: Spread) -> None:
        self.desk, self.spread, self.calls = desk, spread, 0

    def __call__(self, function: Callable[[Any], Any], tasks: Iterable[Any]) -> Iterable[Any]:
        name = getattr(function, "__name__", "tasks")
        self.calls += 1
        return self.desk.map(function, tasks, f"{self.calls}{name}", _STAGES.get(name, "identification"), self.spread)


@dataclass(frozen=True, slots=True)
class _Telling:
    """The default method, which says where it is."""

    method: EvidenceSelection
    desk: JobContext
    begun: datetime

    def run(self, data: IdentificationData, seed: int, map: Spread) -> Identification:
        global _story
        _story = _Story(self.desk, data, self.method, self.begun)
        try:
            return self.method.run(data, seed, map, _tell)
        finally:
            _story = None


class _Story:
    """What is told of a search: cost for cost, and now and then the lines beside the model's."""

    def __init__(self, desk: JobContext, data: IdentificationData, method: EvidenceSelection, begun: datetime) -> None:
        self.desk, self.method = desk, method
        # the time that went by while nobody worked on it belongs to it, too
        self.start = time.monotonic() - max((datetime.now(UTC) - begun).total_seconds(), 0.0)
        summed = data.summed()
        self.data = {str(a.axis): summed.only(a.axis).with_smooth_errors(SMOOTH_ERROR) for a in data.axes}
        self.data["both"] = data.with_smooth_errors(SMOOTH_ERROR)
        self.misfits: dict[str, Misfit] = {}
        self.best: dict[tuple[str, str], float] = {}

    def tell(self, axis: str, stage: str, cost: float, theta: FloatArray, layout: Layout) -> None:
        if not math.isfinite(cost):
            return
        seconds = round(time.monotonic() - self.start, 3)
        self.desk.word("trace", {"axis": axis.upper() if axis != "both" else axis, "stage": stage, "cost": cost, "seconds": seconds})
        if cost <= self.best.get((axis, stage), math.inf):
            self.best[axis, stage] = cost
            for i, part in enumerate(self.data[axis].axes):
                self.desk.curve(f"fit {part.axis}", partial(self._curve, axis, i, theta, layout))

    def _curve(self, axis: str, i: int, theta: FloatArray, layout: Layout) -> dict[str, Any] | None:
        data = self.data[axis]
        if axis not in self.misfits:
            self.misfits[axis] = Misfit(data, self.method.priors, (self.method.coarse[1],) * len(data.axes))
        found = self.misfits[axis].evaluate(theta, layout, np.zeros((len(data.cut_ids), 2)))
        part = data.axes[i]
        order = np.argsort(part.omega, kind="stable")
        order = order[np.linspace(0, order.size - 1, min(order.size, POINTS)).round().astype(int)]
        curves = {
            "frequency_hz": to_hz(part.omega),
            "measured_abs": np.abs(part.measured),
            "model_abs": np.abs(np.sum(found.models[i], axis=1)),
        }
        if not all(np.all(np.isfinite(values)) for values in curves.values()):
            return None
        return {"axis": part.axis.upper()} | {name: [float(f"{v:.6g}") for v in values[order]] for name, values in curves.items()}


# what is told crosses to no other process: a search that runs elsewhere is silent
_story: _Story | None = None


def _tell(axis: str, stage: str, cost: float, theta: FloatArray, layout: Layout) -> None:
    if _story is not None:
        _story.tell(axis, stage, cost, theta, layout)


def _lines(found: Identification, campaign: Campaign) -> dict[str, Any]:
    """Measured lines beside the model's, by frequency."""
    tooling = {cut.id: cut.tooling for cut in campaign.cuts}
    axes = {}
    for axis, part in found.axes.items():
        lines = part.measured
        order = np.argsort(lines["omega"], kind="stable")
        value, model = (np.asarray(lines[name], dtype=complex)[order] for name in ("value", "model"))
        axes[axis.upper()] = {
            "frequency_hz": to_hz(lines["omega"][order]).tolist(),
            "measured_re": value.real.tolist(),
            "measured_im": value.imag.tolist(),
            "model_re": model.real.tolist(),
            "model_im": model.imag.tolist(),
            "coherence": np.asarray(lines["coherence"])[order].tolist(),
            "tooling": [tooling[found.cut_ids[cut]] for cut in lines["cut"][order]],
        }
    return {"axes": axes}


def _report(found: Identification, campaign: Campaign, readings: list[Reading], deviations: Any) -> str:
    from rcsa_ident.report.html import report_html

    return report_html(found, campaign, readings, deviations=deviations)


def _applied(text: str) -> tuple[Applied | None, str | None]:
    """What becomes the machine's identification, or why it cannot."""
    try:
        summary = tasks.check(text)
    except InputError as error:
        return None, json.dumps({"detail": f"it is not made the machine's identification: {error}", "errors": []})
    return (Applied(text, json.dumps(summary), digest_of(text)) if summary["status"] != "failed" else None), None
