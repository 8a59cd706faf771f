"""plan: which cuts to make next."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.base.units import from_rpm, to_rpm
from rcsa_ident.cli.common import Json, Seed, Stages, answers, emit, say, warn, writable
from rcsa_ident.cli.conditions import engagement, feed_angle
from rcsa_ident.cli.options import Strategy, option

if TYPE_CHECKING:
    from rcsa_ident.cutting.coefficients import CuttingCoefficients
    from rcsa_ident.dynamics.coordinates import Dof
    from rcsa_ident.identification.experiment_design import Goal
    from rcsa_ident.identification.machine import IdentifiedMachine
    from rcsa_ident.workflows.plan import PlannedCut, PlannedCuts
    from rcsa_ident.workflows.plan_course import Course
    from rcsa_ident.workflows.plan_passes import PlannedPasses

#: Recordings of a campaign that its noise is learned from.
MOST_READ = 8


class GoalName(StrEnum):
    """What the cuts should serve, by name."""

    tooltip = "tooltip"
    unknowns = "unknowns"


@answers
def plan(
    result: Annotated[Path, typer.Argument(help="RESULT.json of an identification.", show_default=False)],
    toolings: Annotated[list[Path], typer.Option(help="TOOLING.toml to cut with; once each.", show_default=False)],
    target: Annotated[list[Path], typer.Option(help="TOOLING.toml whose tooltip is wanted; once each.", show_default=False)],
    out: Annotated[Path, typer.Option(help="PLAN.toml to write: [[cuts]] for a campaign.toml.", show_default=False)],
    depths_mm: Annotated[str, typer.Option(help="Axial depths to choose from, mm, separated by commas.")] = "0.4",
    cuts: Annotated[int, typer.Option(min=1, max=500, help="Largest number of cuts.")] = 16,
    band: Annotated[
        float | None,
        typer.Option(
            help="Standard deviation of the tooltip FRF that is wanted, %: plans the fewest cuts that reach it.", show_default=False
        ),
    ] = None,
    goal: Annotated[
        GoalName, typer.Option(help="Smallest variance of the targets' tooltip FRFs, or most information on all unknowns.")
    ] = GoalName.tooltip,
    speed_from: Annotated[
        float | None, typer.Option(help="Lowest spindle speed, rev/min; default: the campaign's.", show_default=False)
    ] = None,
    speed_to: Annotated[float | None, typer.Option(help="Highest spindle speed; default: the campaign's.", show_default=False)] = None,
    immersion: Annotated[str, option("immersion")] = "0.5",
    strategy: Annotated[Strategy, option("strategy")] = Strategy.down,
    entry_deg: Annotated[float | None, option("entry_deg")] = None,
    exit_deg: Annotated[float | None, option("exit_deg")] = None,
    feed_direction: Annotated[
        str | None,
        typer.Option(
            help="+X -X +Y -Y, or degrees from +X; default: +X, and +Y in turn where that pushes the tools in further directions.",
            show_default=False,
        ),
    ] = None,
    feed_per_tooth_mm: Annotated[float, typer.Option(help="Feed per tooth, mm.")] = 0.1,
    chip_thickness_mm: Annotated[
        float | None,
        typer.Option(
            help="Largest chip thickness, mm, in place of the feed: each cutter takes the feed per tooth that makes it, a high-feed one "
            "several times that of a wall.",
            show_default=False,
        ),
    ] = None,
    margin: Annotated[float, typer.Option(help="Least ratio of the stability limit to the depth.")] = 1.5,
    from_: Annotated[
        float | None,
        typer.Option(
            "--from", help="Lowest frequency of the tooltip FRF that is wanted, Hz; default: the identified band.", show_default=False
        ),
    ] = None,
    to: Annotated[float | None, typer.Option("--to", help="Highest frequency, Hz.", show_default=False)] = None,
    noise_nm: Annotated[float, typer.Option(help="Standard deviation of a displacement line's real and imaginary part, nm.")] = 0.1,
    passes: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=100,
            help="Passes whose speed changes, so many with each tooling, in place of cuts at one speed each: they cross all speeds.",
            show_default=False,
        ),
    ] = None,
    pass_seconds: Annotated[float, typer.Option(help="Length of each pass, s.")] = 4.0,
    campaign: Annotated[
        Path | None, typer.Option(help="Campaign whose recordings give the noise, instead of --noise-nm.", show_default=False)
    ] = None,
    seed: Seed = 1,
    json_: Json = False,
) -> None:
    """Choose the stable cuts that tell most about the tooltips that are wanted, and say what they will be good for.

    PLAN.toml has them in the order in which to make them: half an hour of warm-up before each tooling, then speeds in random order.
    Among them are six further cuts at half the feed; the first cut of each tooling is made once more at the end.
    """
    from rcsa_ident.cli.results import read_identified, tell
    from rcsa_ident.io.files import write_text
    from rcsa_ident.io.settings.setups import read_tooling
    from rcsa_ident.workflows.plan import CutConstraints, alternating, plan_cuts
    from rcsa_ident.workflows.plan_course import in_course
    from rcsa_ident.workflows.plan_passes import plan_passes

    writable(out)
    machine, data = read_identified(result)
    tell(machine, result)
    wanted = None if band is None else 1e-2 * positive("--band", band, "%")
    allowed = CutConstraints(
        *_speeds(machine, speed_from, speed_to),
        _depths(depths_mm),
        positive("--feed-per-tooth-mm", feed_per_tooth_mm, "mm") * 1e-3,
        engagement(immersion, strategy, entry_deg, exit_deg),
        feed_angle("+X" if feed_direction is None else feed_direction),
        margin,
        chip_thickness=None if chip_thickness_mm is None else positive("--chip-thickness-mm", chip_thickness_mm, "mm") * 1e-3,
    )
    low, high = data["band_hz"]
    stages = Stages(quiet=json_)
    with stages.stage("plan"):
        noise = positive("--noise-nm", noise_nm, "nm") * 1e-9 if campaign is None else _noise_of(campaign)
        cut_with = [read_tooling(path) for path in toolings]
        wanted_tips = [read_tooling(path) for path in target]
        within = (low if from_ is None else from_, high if to is None else to)
        known, errors = _coefficients(data, str(result)), _model_errors(machine, data)
        if passes is not None:
            planned_passes = plan_passes(machine, cut_with, wanted_tips, allowed, known, noise, errors, within, passes, pass_seconds)
        else:
            if feed_direction is None:
                allowed = alternating(allowed, cut_with, known)
            planned = plan_cuts(machine, cut_with, wanted_tips, allowed, known, noise, errors, within, cuts, wanted, _goal(goal))
            course = in_course(planned.cuts, machine, cut_with, allowed, known, seed)
    if passes is not None:
        _tell_passes(planned_passes, out, noise, json_, stages.seconds)
        return
    write_text(out, plan_text(planned, course))
    if json_:
        emit(_summary(planned, course, wanted) | {"noise_nm": noise * 1e9, "seconds": stages.seconds, "out": str(out)})
        return
    _show(planned)
    for each in course:
        counts = ", ".join(f"{count} for {what}" for what, count in Counter(str(cut.purpose) for cut in each.cuts).items())
        say(f"{each.tooling}: half an hour of warm-up at {to_rpm(each.warm_up_speed):.0f} rev/min, then {counts}, in random order")
    for doubt in planned.warnings:
        warn(doubt)
    say(f"written: {out} ({sum(len(each.cuts) for each in course)} cuts, {stages.seconds['plan']:.2f} s)")


def _tell_passes(planned: PlannedPasses, out: Path, noise: float, json_: bool, seconds: dict[str, float]) -> None:
    """Write passes as a campaign file has them, and print them with what they are expected to leave open."""
    from rich.markup import escape
    from rich.table import Table

    from rcsa_ident.cli.tables import show
    from rcsa_ident.io.files import write_text
    from rcsa_ident.io.settings.cuts import cut_keys
    from rcsa_ident.io.toml_text import toml_of

    names = [f"{each.tooling}-pass-{i:02d}" for i, each in enumerate(planned.passes, start=1)]
    keys = [cut_keys(name, each.tooling, each.conditions, each.last_speed) for name, each in zip(names, planned.passes, strict=True)]
    write_text(out, toml_of({"cuts": keys}, digits=9))
    bands = [dict(zip(planned.targets, (100.0 * row).tolist(), strict=True)) for row in planned.band]
    if json_:
        rows = [
            key | {"seconds": each.seconds, "path_mm": 1e3 * each.path, "limit_depth_mm": 1e3 * each.limit_depth, "band_percent": after}
            for key, each, after in zip(keys, planned.passes, bands[1:], strict=True)
        ]
        summary = {"passes": rows, "band_percent": bands[0], "warnings": list(planned.warnings), "noise_nm": noise * 1e9}
        emit(summary | {"seconds": seconds, "out": str(out)})
        return
    heads = [f"{escape(name)}\n± %" for name in planned.targets]
    columns = ("tooling", "from\nrev/min", "to\nrev/min", "depth\nmm", "path\nm", "stable up to\nmm", *heads)
    table = Table(*columns, title=f"passes of {planned.passes[0].seconds:g} s", title_justify="left")
    for column in table.columns[1:]:
        column.justify = "right"
    table.add_row("before", "", "", "", "", "", *(f"{band:.3f}" for band in bands[0].values()))
    for each, after in zip(planned.passes, bands[1:], strict=True):
        c, limit = each.conditions, f"{each.limit_depth * 1e3:.2f}" if math.isfinite(each.limit_depth) else "more"
        numbers = f"{to_rpm(c.spindle_speed):.0f}", f"{to_rpm(each.last_speed):.0f}", f"{c.axial_depth * 1e3:g}", f"{each.path:.2f}", limit
        table.add_row(escape(each.tooling), *numbers, *(f"{band:.3f}" for band in after.values()))
    show(table)
    for doubt in planned.warnings:
        warn(doubt)
    say(f"written: {out} ({len(planned.passes)} passes, {sum(each.seconds for each in planned.passes):g} s of cutting)")


def plan_text(planned: PlannedCuts, course: Sequence[Course]) -> str:
    """Return the cuts as a campaign file has them, in the order in which they are made; the recordings are named, not yet made."""
    from rcsa_ident.io.settings.cuts import cut_keys
    from rcsa_ident.io.toml_text import toml_of
    from rcsa_ident.workflows.plan_course import WARM_UP

    parts = []
    for each in course:
        cuts = [cut_keys(turn.id, turn.cut.tooling, turn.cut.conditions) for turn in each.cuts]
        turning = f"{to_rpm(each.warm_up_speed):.0f} rev/min for {WARM_UP / 60.0:g} minutes"
        remarks = (
            f"{each.tooling}: let the spindle turn at {turning}, then cut in this order.",
            "Write `started` into each cut, and `temperature_c` of a thermometer near the bearings.",
        )
        parts.append(toml_of({"cuts": cuts}, remarks, digits=9))
    text = "\n".join(parts)
    if planned.judges:
        judges = [cut_keys(_judge(cut), cut.tooling, cut.conditions) | {"validation": True} for cut in planned.judges]
        # a campaign does not know these toolings yet
        lines = ["To judge the answer, once [toolings] names their toolings:", *toml_of({"cuts": judges}, digits=9).splitlines()]
        text += "\n" + "".join(f"# {line}".rstrip() + "\n" for line in lines)
    return text


def _judge(cut: PlannedCut) -> str:
    """The id of a cut that judges the answer."""
    return f"{cut.tooling}-validation"


def _depths(text: str) -> tuple[float, ...]:
    try:
        return tuple(sorted({positive("--depths-mm", float(part), "mm") * 1e-3 for part in text.split(",")}))
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError("--depths-mm", text, "numbers separated by commas [mm]") from None


def _speeds(machine: IdentifiedMachine, lowest: float | None, highest: float | None) -> tuple[float, float]:
    """The speeds asked for, those of the campaign where nothing is said [rad/s]."""
    each = [machine.whole, *(part.posterior for part in machine.identified.values())]
    middle, half = next((known.speed_range for known in each if known is not None), (0.0, 0.0))
    found = []
    for name, given, known in (("--speed-from", lowest, middle - half), ("--speed-to", highest, middle + half)):
        if given is None and known <= 0.0:
            raise InputError(name, "nothing", "a spindle speed [rev/min]: the result does not say which ones were cut")
        found.append(known if given is None else from_rpm(positive(name, given, "rev/min")))
    if found[1] < found[0]:
        raise InputError("--speed-to", to_rpm(found[1]), f"--speed-from ({to_rpm(found[0]):g}) or more [rev/min]")
    return found[0], found[1]


def _coefficients(data: dict[str, Any], where: str) -> CuttingCoefficients:
    """The result's cutting coefficients, as well known as the identification has left them."""
    from dataclasses import replace

    from rcsa_ident.cutting.force import SLOPES
    from rcsa_ident.io.settings.workpieces import workpiece_of
    from rcsa_ident.io.validated_table import Table

    given = workpiece_of(Table(data, where).table("workpiece")).coefficients
    found = data.get("coefficients", {})
    known = {}
    for name, spread in zip(SLOPES, ("tangential_spread", "ratio_spread"), strict=False):
        if name in found:
            known[spread] = min(float(found[name]["std"]) / float(found[name]["scale"]), getattr(given, spread))
    return replace(given, **known)


def _model_errors(machine: IdentifiedMachine, data: dict[str, Any]) -> dict[Dof, float]:
    return {axis: float(data["axes"][axis.upper()].get("model_error", 0.0)) for axis in machine.identified}


def _goal(name: GoalName) -> Goal:
    from rcsa_ident.identification.experiment_design import MeanVariance, Volume

    goals: dict[GoalName, Callable[[], Goal]] = {GoalName.tooltip: MeanVariance, GoalName.unknowns: Volume}
    return goals[name]()


def _noise_of(folder: Path) -> float:
    """Noise of a displacement line in a few cuts of a campaign [m]."""
    from functools import partial

    from rcsa_ident.io.recordings.readers import read_cut
    from rcsa_ident.io.settings.setups import read_campaign
    from rcsa_ident.workflows.identify import judge_cut
    from rcsa_ident.workflows.plan import line_noise

    known = read_campaign(folder)
    read = partial(read_cut, known.sensors, known.sampling_rate)
    some = known.cuts[:: max(1, math.ceil(len(known.cuts) / MOST_READ))]
    return line_noise([measurement for cut in some for measurement in judge_cut(known, read, cut).measurements])


def _direction(angle: float) -> str | float:
    from rcsa_ident.io.settings.cuts import feed_direction_of

    found = feed_direction_of(angle)
    return found if isinstance(found, str) else float(f"{found:.9g}")


def _row(name: str, cut: PlannedCut) -> dict[str, Any]:
    c = cut.conditions
    return {
        "id": name,
        "tooling": cut.tooling,
        "spindle_speed_rpm": float(f"{to_rpm(c.spindle_speed):.9g}"),
        "axial_depth_mm": float(f"{c.axial_depth * 1e3:.9g}"),
        "feed_per_tooth_mm": float(f"{c.feed_per_tooth * 1e3:.9g}"),
        "feed_direction": _direction(c.feed_angle),
        "limit_depth_mm": cut.limit_depth * 1e3,
    }


def _summary(planned: PlannedCuts, course: Sequence[Course], wanted: float | None) -> dict[str, Any]:
    """What a machine wants to know of a plan."""
    from rcsa_ident.workflows.plan_course import WARM_UP, names_of

    rows = [_row(name, cut) for name, cut in zip(names_of(planned.cuts), planned.cuts, strict=True)]
    bands = [dict(zip(planned.targets, (100.0 * row).tolist(), strict=True)) for row in planned.band]
    summary: dict[str, Any] = {
        "cuts": [row | {"band_percent": after} for row, after in zip(rows, bands[1:], strict=True)],
        "band_percent": bands[0],
        "even_band_percent": dict(zip(planned.targets, (100.0 * planned.even).tolist(), strict=True)),
        "candidates": planned.candidates,
        "unstable": planned.unstable,
        "warnings": list(planned.warnings),
        "validation": [_row(_judge(cut), cut) for cut in planned.judges],
        "course": [
            {
                "tooling": each.tooling,
                "warm_up_minutes": WARM_UP / 60.0,
                "warm_up_speed_rpm": to_rpm(each.warm_up_speed),
                "cuts": [_row(turn.id, turn.cut) | {"purpose": str(turn.purpose)} for turn in each.cuts],
            }
            for each in course
        ],
    }
    if wanted is not None:
        enough = planned.fewest(wanted)
        summary["fewest"] = {"cuts": enough.cuts, "band_percent": 100.0 * enough.band, "reached": enough.reached}
    return summary


def _show(planned: PlannedCuts) -> None:
    """Print the cuts with what they are expected to leave open."""
    from rich.markup import escape
    from rich.table import Table

    from rcsa_ident.cli.tables import console, show

    names = [f"{escape(name)}\n± %" for name in planned.targets]
    table = Table(
        "", "tooling", "spindle speed\nrev/min", "depth\nmm", "feed", "stable up to\nmm", *names, title="cuts", title_justify="left"
    )
    for column in (*table.columns[:1], *table.columns[2:]):
        column.justify = "right"
    table.add_row("", "before", "", "", "", "", *(f"{100.0 * v:.3f}" for v in planned.band[0]))
    for i, (cut, after) in enumerate(zip(planned.cuts, planned.band[1:], strict=True), start=1):
        c, limit = cut.conditions, f"{cut.limit_depth * 1e3:.2f}" if math.isfinite(cut.limit_depth) else "more"
        numbers = (
            f"{to_rpm(c.spindle_speed):.0f}",
            f"{c.axial_depth * 1e3:g}",
            str(_direction(c.feed_angle)),
            limit,
            *(f"{100.0 * v:.3f}" for v in after),
        )
        table.add_row(str(i), escape(cut.tooling), *numbers)
    show(table)
    even = ", ".join(f"{escape(name)} {100.0 * v:.3f} %" for name, v in zip(planned.targets, planned.even, strict=True))
    console().print(
        f"chosen from {planned.candidates} stable cuts ({planned.unstable} more may chatter); "
        f"as many at even distances would come to {even}"
    )
    for cut in planned.judges:
        c = cut.conditions
        console().print(
            f"to judge the answer: {escape(cut.tooling)} at {to_rpm(c.spindle_speed):.0f} rev/min, {c.axial_depth * 1e3:g} mm, "
            "as a cut with validation = true"
        )
