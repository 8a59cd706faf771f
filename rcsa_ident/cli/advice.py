"""advise: what a machinist asks of lobes."""

from __future__ import annotations

import hashlib
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import from_rpm, to_rpm
from rcsa_ident.cli.common import Json, Stages, answers, emit, say, warn, writable
from rcsa_ident.cli.conditions import change_of, cut_of, drive_of, numbers, share_of, speeds_of, subjects_of
from rcsa_ident.cli.lobes import Plot, check_plot
from rcsa_ident.cli.options import Bands, CutOptions, DriveOptions, SpeedOptions, StiffnessSpread, TemperatureC, TipOptions, takes_groups
from rcsa_ident.cli.results import at_temperature
from rcsa_ident.stability.methods import MethodName

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rcsa_ident.machine.machine import TipSource
    from rcsa_ident.stability.advice import Advice

#: Toolings and stickouts that are compared at once.
_MOST = 12


@answers
@takes_groups
def advise(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="[RESULT.json] TOOLING.toml...",
            help="Several toolings are compared; with --modes or --frf one alone.",
            show_default=False,
        ),
    ],
    tip: TipOptions,
    cut: CutOptions,
    speeds: SpeedOptions,
    drive: DriveOptions,
    depth_mm: Annotated[
        float | None, typer.Option(help="Axial depth to find speeds for, mm.", show_default=False, rich_help_panel="Questions")
    ] = None,
    planned: Annotated[
        list[str] | None,
        typer.Option(
            "--cut",
            metavar="RPM:MM",
            help="Planned cut whose distance to chatter is computed: spindle speed and depth; may be repeated.",
            show_default=False,
            rich_help_panel="Questions",
        ),
    ] = None,
    stickout_mm: Annotated[
        str | None,
        typer.Option(metavar="A,B,...", help="Compare the tool at these stickouts, mm.", show_default=False, rich_help_panel="Questions"),
    ] = None,
    next_test: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=200,
            help="Name so many cuts to test next, whose labels tell most; of LEARNT.json, or of MODES.toml before any label.",
            show_default=False,
            rich_help_panel="Questions",
        ),
    ] = None,
    among: Annotated[
        Path | None,
        typer.Option(
            help="CUTS.csv: the cuts to choose from, with --next-test; default: any of the speeds.",
            show_default=False,
            rich_help_panel="Questions",
        ),
    ] = None,
    tolerance: Annotated[
        float, typer.Option(help="Tolerance of the spindle speed within which a cut stays stable, %.", rich_help_panel="Questions")
    ] = 1.0,
    probability: Annotated[
        float,
        typer.Option(
            help="Probability that a recommended cut is stable, %, where there is a posterior; 100: on every machine drawn from it.",
            rich_help_panel="Questions",
        ),
    ] = 95.0,
    reserve: Annotated[
        float, typer.Option(help="Share of the stable depth that is kept in reserve, %.", rich_help_panel="Questions")
    ] = 10.0,
    out: Annotated[
        Path | None, typer.Option(help="ADVICE.csv to write: recommended depth over speed for each tooling.", show_default=False)
    ] = None,
    plot: Plot = None,
    card: Annotated[
        Path | None,
        typer.Option(
            help="CARD.html to write, a page of A4 for each tooling: drawing, recommended cuts, conditions and warnings.",
            show_default=False,
        ),
    ] = None,
    temperature_c: TemperatureC = None,
    bands: Bands = True,
    stiffness_spread: StiffnessSpread = 0.05,
    json_: Json = False,
) -> None:
    """Tell the best speeds for a depth, the highest removal rate within power and torque, and the margin of planned cuts."""
    from rcsa_ident.io.curves.lobes import write_advice
    from rcsa_ident.workflows.advise import advise as ask

    check_plot(plot)
    for path in (out, card):
        if path is not None:
            writable(path)
    if among is not None and next_test is None:
        raise InputError("--among", str(among), "given together with --next-test")
    if next_test is not None:
        _name_tests(files, tip, cut, speeds, next_test, among, stiffness_spread, json_)
        return
    if cut.feed_per_tooth_mm is None:
        raise InputError("--feed-per-tooth-mm", "nothing", "the feed per tooth [mm]: power and removal rate grow with it")
    shares = (
        share_of(tolerance, "--tolerance", 20.0),
        share_of(probability, "--probability", 100.0, above=True),
        share_of(reserve, "--reserve", 90.0),
    )
    machine, toolings = subjects_of(files, tip, stickout_mm, _MOST)
    machine = at_temperature(machine, temperature_c)
    cuts = [_planned(text, speeds.max_depth_mm) for text in planned or []]
    asked, has, depth = cut_of(cut, speeds.speed_variation), drive_of(drive), None if depth_mm is None else depth_mm * 1e-3
    answered: list[Advice] = []
    stages = Stages(quiet=json_)
    with stages.stage("advice") as line:
        for i, tooling in enumerate(toolings):
            line(i, len(toolings))
            change = change_of(machine, tooling, asked, speeds, bands, stiffness_spread)
            answered.append(ask(change, has, *shares, depth=depth, planned=cuts))
    if out is not None:
        write_advice(out, answered)
    if plot is not None:
        from rcsa_ident.report.advice import advice_figure
        from rcsa_ident.report.lobes import save_figure

        save_figure(advice_figure(answered), str(plot))
    if card is not None:
        from rcsa_ident.io.files import write_text
        from rcsa_ident.report.html import ToolCard, tool_cards_html

        about, versions = _machine_of(machine, files, tip), [_version(path) for path in files]
        cards = [ToolCard(tool, asked, told, about, *shares, versions) for tool, told in zip(toolings, answered, strict=True)]
        write_text(card, tool_cards_html(cards, datetime.now().astimezone()))
    remarks = list(dict.fromkeys(remark for answer in answered for remark in answer.remarks))
    if json_:
        from rcsa_ident.report.summaries import advice_summary

        files_ = {name: str(path) for name, path in (("out", out), ("plot", plot), ("card", card)) if path is not None}
        emit({"toolings": [advice_summary(answer) for answer in answered], "warnings": remarks, "seconds": stages.seconds, **files_})
        return
    from rcsa_ident.cli.tables import show_comparison, show_planned, show_points, show_windows

    for answer in answered:
        about = answer.tooling if len(answered) > 1 else ""
        if not about:
            show_points(answer)
        if depth_mm is not None:
            show_windows(answer.windows, depth_mm, about)
        if cuts:
            show_planned(answer.planned, about)
    if len(answered) > 1:
        show_comparison(answered)
    for remark in remarks:
        warn(remark)
    for word, path in (("drawn", plot), ("written", out), ("written", card)):
        if path is not None:
            say(f"{word}: {path}")


def _name_tests(
    files: Sequence[Path],
    tip: TipOptions,
    cut: CutOptions,
    speeds: SpeedOptions,
    count: int,
    among: Path | None,
    stiffness_spread: float,
    json_: bool,
) -> None:
    """Tell which cuts to test next."""
    from rcsa_ident.cli.learn import believed_of
    from rcsa_ident.io.settings.tested_cuts import OWN, cell_of, read_candidates
    from rcsa_ident.stability.labels.tested_cuts import TestedCuts
    from rcsa_ident.stability.lobes import METHODS
    from rcsa_ident.workflows.learn_from_cuts import learn_from_cuts, next_tests

    spec = cut_of(cut)
    candidates = None if among is None else read_candidates(among)
    belief, tooling, learnt = believed_of(files, tip, spec, stiffness_spread)
    stages = Stages(quiet=json_)
    with stages.stage("next tests"):
        if learnt is None:
            method = METHODS[MethodName.FULL_DISCRETISATION if speeds.method == MethodName.ZERO_ORDER else speeds.method]()
            learnt = learn_from_cuts(belief, tooling, spec, TestedCuts.none(), method)
        process = spec.process(tooling.cutter, learnt.workpiece)
        found = next_tests(learnt, process, count, candidates, speeds_of(speeds), speeds.max_depth_mm * 1e-3)
    remarks = [*belief.remarks, *learnt.remarks]
    if json_:
        rows = [
            {
                "spindle_speed_rpm": to_rpm(each.spindle_speed, 6),
                "axial_depth_mm": round(1e3 * each.axial_depth, 9),
                "probability_stable": each.probability_stable,
            }
            | {column: cell for column in OWN if (cell := cell_of(each.own, column))}
            for each in found
        ]
        emit({"next_tests": rows, "warnings": remarks, "seconds": stages.seconds})
        return
    from rcsa_ident.cli.tables import show_next_tests

    show_next_tests(found)
    for remark in remarks:
        warn(remark)


def _machine_of(machine: TipSource, files: Sequence[Path], tip: TipOptions) -> str:
    """What takes the toolings, in words."""
    if tip.modes or tip.frf:
        return f"the tip itself, of {', '.join(tip.modes or tip.frf or [])}"
    return f"{machine}, of {files[0].name}"


def _version(path: Path) -> str:
    """Name and first digits of a file's SHA-256."""
    return f"{path.name} {hashlib.sha256(path.read_bytes()).hexdigest()[:12]}"


def _planned(text: str, max_depth_mm: float) -> tuple[float, float]:
    parts = numbers(text.replace(":", ","), "--cut", "RPM:MM")
    if len(parts) != 2 or min(parts) <= 0.0:
        raise InputError("--cut", text, "RPM:MM, as 12000:1.5")
    if parts[1] > max_depth_mm:
        raise InputError("--cut", text, f"a depth up to --max-depth-mm, {max_depth_mm:g}")
    return from_rpm(parts[0]), parts[1] * 1e-3
