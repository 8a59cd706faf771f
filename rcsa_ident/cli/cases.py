"""cases: tested cuts of several configurations beside the lobes of an identified machine."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rcsa_ident.cli.common import Json, Stages, answers, emit, say, warn
from rcsa_ident.cli.conditions import Subject, coefficients, idle_tip, speeds_of
from rcsa_ident.cli.lobes import Plot, ResultFile, check_plot, judged
from rcsa_ident.cli.options import CutOptions, SpeedOptions, takes_groups
from rcsa_ident.cli.results import read_machine_over_speed

if TYPE_CHECKING:
    from rcsa_ident.arrays import FloatArray
    from rcsa_ident.io.cases import Case
    from rcsa_ident.report.lobes import Judged, Panel
    from rcsa_ident.workflows.lobes import LobeConditions


@answers
@takes_groups
def cases(
    result: ResultFile,
    file: Annotated[Path, typer.Argument(metavar="CASES.toml", help="Configurations with their tested cuts.", show_default=False)],
    speeds: SpeedOptions,
    ktc_mpa: Annotated[
        float | None, typer.Option(help="Tangential coefficient, MPa; default: the result's workpiece.", show_default=False)
    ] = None,
    krc: Annotated[float | None, typer.Option(help="Radial ratio; default: the result's workpiece.", show_default=False)] = None,
    plot: Plot = None,
    json_: Json = False,
) -> None:
    """Count tested cuts of several toolings and cuts beside the lobes, and draw all of them in one figure."""
    from rcsa_ident.cutting.process import MillingProcess
    from rcsa_ident.io.cases import read_cases
    from rcsa_ident.report.lobes import Panel, cases_figure, save_figure

    check_plot(plot)
    found = read_cases(file)
    machine, data = read_machine_over_speed(result)
    known = coefficients(CutOptions(ktc_mpa=ktc_mpa, krc=krc), (data, str(result)))
    stages = Stages(quiet=json_)
    panels: list[Panel] = []
    rows: list[tuple[str, Judged | None, Judged | None]] = []
    doubts: list[str] = []
    with stages.stage("lobes") as line:
        for i, case in enumerate(found):
            line(i, len(found))
            subject = Subject(case.tooling, machine, data, None, 0.0)
            process = MillingProcess(case.tooling.cutter, known, case.engagement, case.feed_angle, case.feed_per_tooth)
            conditions = speeds_of(speeds, process)
            limits = subject.limits(conditions, False)
            doubts += [f"{case.name}: {doubt}" for doubt in subject.doubts(limits)]
            own = None if case.cuts is None else judged(case.cuts, subject, conditions)
            idle, others = _idle(case, subject, conditions) if case.idle else (None, {})
            panels.append(Panel(case.name, limits.lobes, conditions.max_depth, others, own))
            rows.append((case.name, own, idle))
    if plot is not None:
        save_figure(cases_figure(panels), str(plot))
    if json_:
        emit(
            {
                "cases": [
                    {"name": name, **{key: _summary(each) for key, each in (("tested", own), ("tested_idle", idle)) if each is not None}}
                    for name, own, idle in rows
                ],
                "warnings": doubts,
                "seconds": stages.seconds,
                **({} if plot is None else {"plot": str(plot)}),
            }
        )
        return
    from rcsa_ident.cli.tables import show_cases

    show_cases([(name, None if own is None else own.tally, None if idle is None else idle.tally) for name, own, idle in rows])
    for doubt in doubts:
        warn(doubt)
    if plot is not None:
        say(f"drawn: {plot}")


def _idle(case: Case, subject: Subject, conditions: LobeConditions) -> tuple[Judged | None, dict[str, FloatArray]]:
    """What tap tests of the same tooling say of its cuts."""
    other = replace(subject, machine=None, data={}, tip=idle_tip(case.idle))
    limit = other.limits(conditions, False).lobes.limit_depth
    return None if case.cuts is None else judged(case.cuts, other, conditions), {"from tap tests": limit}


def _summary(each: Judged) -> dict[str, float]:
    return asdict(each.tally) | {"share_right": each.tally.share_right}
