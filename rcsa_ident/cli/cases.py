"""cases: tested cuts of several configurations beside the lobes of an identified machine."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rcsa_ident.cli.common import Json, Stages, answers, emit, say, warn
from rcsa_ident.cli.conditions import change_of, cut_of, idle_tip
from rcsa_ident.cli.lobes import Plot, ResultFile, check_plot
from rcsa_ident.cli.options import CutOptions, SpeedOptions, option, takes_groups
from rcsa_ident.cli.results import read_machine

if TYPE_CHECKING:
    from rcsa_ident.base.arrays import FloatArray
    from rcsa_ident.io.settings.cases import Case
    from rcsa_ident.report.lobes import Panel
    from rcsa_ident.stability.labels.tested_cuts import Tally
    from rcsa_ident.workflows.tool_change import ToolChange


@answers
@takes_groups
def cases(
    result: ResultFile,
    file: Annotated[Path, typer.Argument(metavar="CASES.toml", help="Configurations with their tested cuts.", show_default=False)],
    speeds: SpeedOptions,
    ktc_mpa: Annotated[float | None, option("ktc_mpa")] = None,
    krc: Annotated[float | None, option("krc")] = None,
    plot: Plot = None,
    json_: Json = False,
) -> None:
    """Count tested cuts of several toolings and cuts beside the lobes, and draw all of them in one figure."""
    from rcsa_ident.io.settings.cases import read_cases
    from rcsa_ident.report.lobes import Judged, Panel, cases_figure, save_figure
    from rcsa_ident.report.summaries import tally_summary
    from rcsa_ident.workflows.tool_change import classify_tested_cuts

    check_plot(plot)
    found = read_cases(file)
    machine = read_machine(result)
    coefficients = cut_of(CutOptions(ktc_mpa=ktc_mpa, krc=krc))
    stages = Stages(quiet=json_)
    panels: list[Panel] = []
    rows: list[tuple[str, Tally | None, Tally | None]] = []
    remarks: list[str] = []
    with stages.stage("lobes") as line:
        for i, case in enumerate(found):
            line(i, len(found))
            cut = replace(coefficients, engagement=case.engagement, feed_angle=case.feed_angle, feed_per_tooth=case.feed_per_tooth)
            change = change_of(machine, case.tooling, cut, speeds, False, 0.0)
            lobes = change.limits()
            remarks += [f"{case.name}: {remark}" for remark in change.remarks(lobes)]
            own = None if case.cuts is None else classify_tested_cuts(change, case.cuts)
            idle, others, said = _idle(case, change) if case.idle else (None, {}, ())
            remarks += [f"{case.name}, from tap tests: {remark}" for remark in said]
            panels.append(Panel(case.name, lobes, others, None if case.cuts is None or own is None else Judged(case.cuts, own)))
            rows.append((case.name, own, idle))
    if plot is not None:
        save_figure(cases_figure(panels), str(plot))
    if json_:
        told = [(name, (("tested", own), ("tested_idle", idle))) for name, own, idle in rows]
        emit(
            {
                "cases": [{"name": name, **{key: tally_summary(t) for key, t in tallies if t is not None}} for name, tallies in told],
                "warnings": remarks,
                "seconds": stages.seconds,
                **({} if plot is None else {"plot": str(plot)}),
            }
        )
        return
    from rcsa_ident.cli.tables import show_cases

    show_cases(rows)
    for remark in remarks:
        warn(remark)
    if plot is not None:
        say(f"drawn: {plot}")


def _idle(case: Case, change: ToolChange) -> tuple[Tally | None, dict[str, FloatArray], tuple[str, ...]]:
    """What tap tests of the same tooling say of its cuts, and what is to be said of them."""
    from rcsa_ident.machine.known_tip import KnownTip
    from rcsa_ident.workflows.tool_change import classify_tested_cuts

    # the cut's coefficients are the identified workpiece's where the case names none
    process = change.process
    cut = replace(
        change.cut, coefficients={"tangential": process.coefficients.tangential, "radial_ratio": process.coefficients.radial_ratio}
    )
    machine = KnownTip(idle_tip(case.idle))
    idle = replace(change, machine=machine, cut=cut)
    tally = None if case.cuts is None else classify_tested_cuts(idle, case.cuts)
    return tally, {"from tap tests": idle.limits().limit_depth}, machine.remarks
