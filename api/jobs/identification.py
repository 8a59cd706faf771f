"""An identification as a job: every recording's judgement and every search is a step that is not done twice."""

from __future__ import annotations

import json
import logging
import math
import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from typing import Any

import numpy as np

from api.jobs.job_context import JobContext, patiently
from api.stores.entities import digest_of, whole
from api.stores.jobs import Applied, Job, Outcome
from api.work import tasks
from api.work.machine_cache import starts
from api.work.requests import anonymous
from api.work.robots import parsed, robot_from
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.scaleout import Map
from rcsa_ident.base.units import to_hz
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.evidence import EvidenceSelection
from rcsa_ident.identification.genetic_algorithm import PaperGeneticAlgorithm
from rcsa_ident.identification.method import Method
from rcsa_ident.identification.preview import Preview
from rcsa_ident.identification.progress import BOTH, Silent, Step
from rcsa_ident.identification.result import Identification
from rcsa_ident.identification.task import Task
from rcsa_ident.io.results.identifications import identification_to_json
from rcsa_ident.io.results.parts import check_result, layout, plain
from rcsa_ident.io.results.robot_results import robot_result_to_json
from rcsa_ident.machine.robot.flexible import FlexibleRobot
from rcsa_ident.setup.campaign import Campaign, HammerTest
from rcsa_ident.setup.cut import Cut
from rcsa_ident.signals.measurement import Reading, among_fellows
from rcsa_ident.workflows.identify import ReadCut, ReadTest, data_of, hammer_lines, judge_cut, left_out, mode_deviations, of_campaign
from rcsa_ident.workflows.identify_robot import identify_robot

log = logging.getLogger("rcsa_ident.jobs")
#: Returns a campaign of a group, what reads its cuts and what reads its hammer tests.
Load = Callable[[str, str], tuple[Campaign, ReadCut, ReadTest]]
#: Said by a job whose result is there, beside it.
NO_REPORT = "an internal error occurred while the report was written; it is logged under this job's id"
#: Cuts that are judged in one step, and points of a curve.
CHUNK, POINTS = 4, 300


def carry(load: Load, job: Job, context: JobContext, spread: Map = map) -> Outcome:
    """Identify a machine.

    `job`: with campaign, seed, method and apply in its request; the identification that it goes on from is its text ``start``, a robot's
        data sheet its text ``robot``
    `spread`: a map that the searches may go through, in place of the builtin
    Raises `InputError`: the campaign is gone or has changed, or none of its cuts is usable and there is no hammer test.
    """
    request = json.loads(whole(job.request, job.request_digest, f"request of the job {job.id}", "ask for the job once more"))
    start, robot = (context.text(name) for name in ("start", "robot"))
    campaign, read, read_test = patiently(lambda: load(job.group, str(job.campaign)))
    plan = context.remember("plan", lambda: [_files(each) for each in _parts(campaign)])
    campaign = _planned(campaign, plan)
    readings = _readings(campaign, read, context)
    if robot is not None:
        return _of_robot(robot, campaign, readings, request["seed"], context, spread)
    tests = hammer_lines(campaign, partial(anonymous, read_test))
    data = data_of(campaign, readings, tests)
    story = _Story(context, Preview(data), datetime.fromisoformat(str(job.started)))
    found = _method(request["method"], start).run(data, request["seed"], _Remembering(context, spread), story)
    found = of_campaign(found, campaign, readings, tests)
    context.progress("result", 0, 1)
    deviations = mode_deviations(found)
    content = plain(identification_to_json(found, campaign, left_out(readings), deviations))
    if start is not None:
        content["started_from"] = digest_of(start)
    check_result(content, "")
    text = layout(content) + "\n"
    texts = {"result": text, "frf": json.dumps(_lines(found, campaign))}
    applied, problem = _applied(text) if request["apply"] else (None, None)
    try:
        texts["report"] = _report(found, campaign, readings, deviations)
    except Exception as error:
        # the work is done, and its result is more than a picture of it
        log.error("a report cannot be written", exc_info=error)
        problem = problem or json.dumps({"detail": NO_REPORT, "errors": []})
    context.progress("result", 1, 1)
    return Outcome("done", "", status=str(found.status), texts=texts, applied=applied, problem=problem)


def _of_robot(robot: str, campaign: Campaign, readings: list[Reading], seed: int, context: JobContext, spread: Map) -> Outcome:
    """A robot's springs, dampers and spindle, in the file that takes ROBOT.toml's place."""

    def told(stage: object, cost: float, solution: object) -> None:
        del solution
        context.event("trace", {"axis": BOTH, "stage": str(stage), "cost": cost, "seconds": round(time.monotonic() - begun, 3)})

    begun = time.monotonic()
    found = identify_robot(campaign, readings, FlexibleRobot(robot_from(parsed(robot))), seed, _Remembering(context, spread), told)
    content = robot_result_to_json(found, campaign.name, left_out(readings))
    return Outcome("done", "", status=str(found.status), texts={"result": layout(plain(content)) + "\n"})


def _parts(campaign: Campaign) -> list[Cut | HammerTest]:
    return [*campaign.cuts, *campaign.tests]


def _files(each: Cut | HammerTest) -> list[str]:
    """What a cut or a hammer test is read from: the names say what is in the files."""
    if isinstance(each, HammerTest):
        return [each.id, each.file.name, ""]
    return [each.id, each.recording.name, "" if each.air is None else each.air.name]


def _planned(campaign: Campaign, plan: list[list[str]]) -> Campaign:
    """The campaign as it was when the job began: what has been uploaded since then belongs to the next one."""
    there = {each.id: each for each in _parts(campaign)}
    cuts: list[Cut] = []
    tests: list[HammerTest] = []
    for id, recording, air in plan:
        if id not in there or _files(there[id])[1] != recording:
            raise InputError(
                "campaign", f"another recording of {id}, or none, since the job began", "recordings that stay while a job runs"
            )
        each = there[id]
        if isinstance(each, HammerTest):
            tests.append(each)
        else:
            cuts.append(each if air else replace(each, air=None))
    return replace(campaign, cuts=tuple(cuts), tests=tuple(tests))


def _readings(campaign: Campaign, read: ReadCut, context: JobContext) -> list[Reading]:
    def reading(cut: Cut) -> Reading:
        context.check()
        return judge_cut(campaign, partial(anonymous, read), cut)

    readings: list[Reading] = []
    for first in range(0, len(campaign.cuts), CHUNK):
        cuts = campaign.cuts[first : first + CHUNK]
        context.progress("recordings", first, len(campaign.cuts))
        readings += context.remember(f"recordings.{first}", partial(_all, reading, cuts))
    context.progress("recordings", len(campaign.cuts), len(campaign.cuts))
    return among_fellows(readings)


def _all(reading: Callable[[Cut], Reading], cuts: Iterable[Cut]) -> list[Reading]:
    return [reading(cut) for cut in cuts]


def _method(name: str, start: str | None) -> Method:
    if name == "paper":
        return PaperGeneticAlgorithm()
    return EvidenceSelection(start=None if start is None else starts(start))


class _Remembering:
    """A map whose every result is a step of the job."""

    def __init__(self, context: JobContext, spread: Map) -> None:
        self.context, self.spread, self.calls = context, spread, 0

    def __call__(self, function: Callable[[Any], Any], tasks: Iterable[Any]) -> Iterable[Any]:
        """Return the results of the tasks of one phase, as methods give them to their map."""
        waiting: list[Task] = list(tasks)
        phase = waiting[0].phase
        self.calls += 1
        return self.context.map(function, waiting, f"{self.calls}.{phase.name.lower()}", str(phase), self.spread)


class _Story:
    """A progress callable that tells the job's watchers: cost for cost, and now and then the lines beside the model's.

    A copy of it in another process is silent.
    """

    def __init__(self, context: JobContext, preview: Preview, begun: datetime) -> None:
        self.context, self.preview = context, preview
        # the time that went by while nobody worked on it belongs to it, too
        self.start = time.monotonic() - max((datetime.now(UTC) - begun).total_seconds(), 0.0)
        self.best: dict[tuple[str, str], float] = {}

    def __reduce__(self) -> tuple[type[Silent], tuple[()]]:
        return Silent, ()

    def __call__(self, step: Step) -> None:
        """Tell of a step."""
        if not math.isfinite(step.cost):
            return
        axis = step.axis if step.axis == BOTH else step.axis.upper()
        seconds = round(time.monotonic() - self.start, 3)
        self.context.event("trace", {"axis": axis, "stage": step.label, "cost": step.cost, "seconds": seconds})
        if step.cost <= self.best.get((step.axis, step.label), math.inf):
            self.best[step.axis, step.label] = step.cost
            for each in self.preview.axes(step):
                self.context.curve(f"fit {each}", partial(self._curve, step, each))

    def _curve(self, step: Step, axis: Dof) -> dict[str, Any] | None:
        lines = self.preview.lines(step, axis)
        some = np.linspace(0, lines.omega.size - 1, min(lines.omega.size, POINTS)).round().astype(int)
        curves = {
            "frequency_hz": to_hz(lines.omega),
            "measured_abs": np.abs(lines.measured),
            "model_abs": np.abs(lines.model),
        }
        if not all(np.all(np.isfinite(values)) for values in curves.values()):
            return None
        return {"axis": axis.upper()} | {name: [float(f"{v:.6g}") for v in values[some]] for name, values in curves.items()}


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
