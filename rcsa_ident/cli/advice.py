"""advise: what a machinist asks of lobes."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rcsa_ident.cli.common import Json, Stages, answers, emit, say, warn, writable
from rcsa_ident.cli.conditions import drive_of, numbers, process_of, speeds_of, subjects_of, warn_outside
from rcsa_ident.cli.lobes import Plot, check_plot
from rcsa_ident.cli.options import Bands, CutOptions, DriveOptions, SpeedOptions, StiffnessSpread, TipOptions, takes_groups
from rcsa_ident.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rcsa_ident.arrays import FloatArray
    from rcsa_ident.cli.conditions import Subject
    from rcsa_ident.report.lobes import Depths
    from rcsa_ident.workflows.advice import OperatingPoint, PlannedCut, SpeedWindow, UsableDepths

_RPM = 30.0 / math.pi
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
        float | None, typer.Option(help="At which speeds may one cut so deep? mm", show_default=False, rich_help_panel="Questions")
    ] = None,
    planned: Annotated[
        list[str] | None,
        typer.Option(
            "--cut",
            metavar="RPM:MM",
            help="How far is this cut from chatter? Spindle speed and depth; again for more.",
            show_default=False,
            rich_help_panel="Questions",
        ),
    ] = None,
    stickout_mm: Annotated[
        str | None,
        typer.Option(metavar="A,B,...", help="Compare the tool at these stickouts, mm.", show_default=False, rich_help_panel="Questions"),
    ] = None,
    tolerance: Annotated[
        float, typer.Option(help="The limit shall hold for speeds so much slower or faster, %.", rich_help_panel="Questions")
    ] = 1.0,
    probability: Annotated[
        float,
        typer.Option(
            help="That a cut is stable, %, where a posterior tells it; 100: on every machine that it allows.", rich_help_panel="Questions"
        ),
    ] = 95.0,
    reserve: Annotated[
        float, typer.Option(help="Share of the stable depth that is kept in reserve, %.", rich_help_panel="Questions")
    ] = 10.0,
    out: Annotated[
        Path | None, typer.Option(help="ADVICE.csv to write: what is usable over speed, of each tooling.", show_default=False)
    ] = None,
    plot: Plot = None,
    bands: Bands = True,
    stiffness_spread: StiffnessSpread = 0.05,
    json_: Json = False,
) -> None:
    """Tell the best speeds for a depth, the highest removal rate within power and torque, and the margin of planned cuts."""
    from rcsa_ident.workflows.limits import pad_speeds

    check_plot(plot)
    if out is not None:
        writable(out)
    if cut.feed_per_tooth_mm is None:
        raise InputError("--feed-per-tooth-mm", "nothing", "the feed per tooth [mm]: power and removal rate grow with it")
    shares = {"--tolerance": tolerance, "--probability": probability, "--reserve": reserve}
    for name, value, most in (("--tolerance", tolerance, 20.0), ("--probability", probability, 100.0), ("--reserve", reserve, 90.0)):
        if not 0.0 <= value <= most or (name == "--probability" and value == 0.0):
            raise InputError(name, shares[name], f"a number {'above' if name == '--probability' else 'from'} 0 to {most:g} [%]")
    subjects = subjects_of(files, tip, stiffness_spread, stickout_mm, _MOST)
    cuts = [_planned(text, speeds.max_depth_mm) for text in planned or []]
    has = drive_of(drive)
    answered: list[_Answer] = []
    stages = Stages(quiet=json_)
    with stages.stage("advice") as line:
        for i, subject in enumerate(subjects):
            line(i, len(subjects))
            process = process_of(cut, speeds, subject)
            asked = speeds_of(speeds, process)
            wide = pad_speeds(asked.speeds, tolerance / 100.0, [speed for speed, _ in cuts])
            if i == 0:
                warn_outside(subject, asked.speeds)
            answered.append(
                _Answer(
                    subject, process, asked, wide, has, (tolerance / 100.0, probability / 100.0, reserve / 100.0), depth_mm, cuts, bands
                )
            )
    if out is not None:
        _write(out, answered)
    if plot is not None:
        _draw(plot, answered)
    doubts = list(dict.fromkeys(doubt for answer in answered for doubt in answer.doubts))
    if json_:
        files_ = {name: str(path) for name, path in (("out", out), ("plot", plot)) if path is not None}
        emit({"toolings": [answer.summary() for answer in answered], "warnings": doubts, "seconds": stages.seconds, **files_})
        return
    from rcsa_ident.cli.tables import show_comparison, show_planned, show_points, show_windows

    for answer in answered:
        if len(answered) == 1:
            show_points(answer.points)
        if depth_mm is not None:
            show_windows(answer.windows, depth_mm, answer.name if len(answered) > 1 else "")
        if cuts:
            show_planned(answer.planned, answer.name if len(answered) > 1 else "")
    if len(answered) > 1:
        show_comparison([(answer.name, answer.absolute, answer.points) for answer in answered])
    for doubt in doubts:
        warn(doubt)
    for word, path in (("drawn", plot), ("written", out)):
        if path is not None:
            say(f"{word}: {path}")


class _Answer:
    """What is known of one tooling."""

    def __init__(
        self,
        subject: Subject,
        process: Any,
        asked: Any,
        wide: FloatArray,
        drive: Any,
        shares: tuple[float, float, float],
        depth_mm: float | None,
        cuts: Sequence[tuple[float, float]],
        bands: bool,
    ) -> None:
        from dataclasses import replace

        from rcsa_ident.workflows.advice import highest_removal, planned_cut, speed_windows, usable_depths

        tolerance, probability, reserve = shares
        self.name = subject.tooling.name
        self.stickout = subject.tooling.assembly.stickout
        self.limits = subject.limits(replace(asked, speeds=wide), bands)
        self.doubts = subject.doubts(self.limits)
        low, high = float(asked.speeds[0]), float(asked.speeds[-1])
        self.usable: UsableDepths = usable_depths(self.limits, process, drive, tolerance, probability, reserve).between(low, high)
        self.inside = (wide >= low * (1.0 - 1e-9)) & (wide <= high * (1.0 + 1e-9))
        self.points: list[OperatingPoint] = highest_removal(self.usable, process)
        self.windows: list[SpeedWindow] = [] if depth_mm is None else speed_windows(self.usable, depth_mm * 1e-3)
        self.planned: list[PlannedCut] = [
            planned_cut(self.limits, process, drive, speed, depth, tolerance, probability) for speed, depth in cuts
        ]

    @property
    def absolute(self) -> float:
        """Lowest limit of the range of speeds [m]."""
        return float(self.limits.nominal[self.inside].min())

    @property
    def common(self) -> FloatArray | None:
        """What is stable on all machines that were drawn [m]."""
        return None if self.limits.drawn is None else self.limits.limit_quantile(1.0)[self.inside]

    @property
    def depths(self) -> Depths:
        """What a figure takes."""
        from rcsa_ident.report.lobes import Depths

        u = self.usable
        return Depths(u.spindle_speed, self.limits.nominal[self.inside], u.stable, u.by_power, u.by_torque, u.depth, u.removal_rate)

    def summary(self) -> dict[str, Any]:
        """What a machine wants to know."""
        return {
            "tooling": self.name,
            "stickout_mm": self.stickout * 1e3,
            "lowest_limit_mm": self.absolute * 1e3,
            "common_stable_depth_mm": None if self.common is None else float(self.common.min()) * 1e3,
            "highest_removal": [_point(point) for point in self.points],
            "windows": [
                {"from_rpm": _rpm(w.low), "to_rpm": _rpm(w.high), "best_rpm": _rpm(w.best), "allowed_mm": w.allowed * 1e3}
                for w in self.windows
            ],
            "planned": [_summary_of(each) for each in self.planned],
        }


def _rpm(speed: float) -> float:
    # the last digit comes from the way to rad/s and back
    return round(speed * _RPM, 6)


def _point(point: OperatingPoint) -> dict[str, Any]:
    return {
        "spindle_speed_rpm": _rpm(point.spindle_speed),
        "axial_depth_mm": point.depth * 1e3,
        "removal_rate_cm3_per_min": point.removal_rate * 6e7,
        "power_kw": point.power * 1e-3,
        "torque_nm": point.torque,
        "bound": str(point.bound),
    }


def _summary_of(cut: PlannedCut) -> dict[str, Any]:
    data = asdict(cut)
    return {
        "spindle_speed_rpm": _rpm(cut.spindle_speed),
        "axial_depth_mm": cut.depth * 1e3,
        "stable": cut.stable,
        "limit_depth_mm": cut.limit * 1e3,
        "robust_limit_mm": cut.robust_limit * 1e3,
        "margin": cut.margin,
        "chatter_frequency_hz": cut.chatter_frequency / (2.0 * math.pi),
        **{f"{name}_rpm": None if data[name] is None else _rpm(data[name]) for name in ("slower", "faster")},
        "probability": cut.probability,
        "load": cut.load,
        "power_kw": cut.power * 1e-3,
        "torque_nm": cut.torque,
        "removal_rate_cm3_per_min": cut.removal_rate * 6e7,
    }


def _planned(text: str, max_depth_mm: float) -> tuple[float, float]:
    parts = numbers(text.replace(":", ","), "--cut", "RPM:MM")
    if len(parts) != 2 or min(parts) <= 0.0:
        raise InputError("--cut", text, "RPM:MM, as 12000:1.5")
    if parts[1] > max_depth_mm:
        raise InputError("--cut", text, f"a depth up to --max-depth-mm, {max_depth_mm:g}")
    return parts[0] / _RPM, parts[1] * 1e-3


def _write(path: Path, answers_: Sequence[_Answer]) -> None:
    """Write what is usable over speed, the columns of further toolings with their number behind the name."""
    import numpy as np

    from rcsa_ident.io.curves import write_speed_csv

    first = answers_[0].usable.spindle_speed
    columns: dict[str, FloatArray] = {}
    for i, answer in enumerate(answers_):
        u, end = answer.usable, "" if len(answers_) == 1 else f"_{i + 1}"
        columns |= {
            f"limit_depth_mm{end}": answer.limits.lobes.limit_depth[answer.inside] * 1e3,
            f"stable_depth_mm{end}": u.stable * 1e3,
            f"power_depth_mm{end}": np.where(u.by_power >= answer.limits.max_depth, np.inf, u.by_power) * 1e3,
            f"torque_depth_mm{end}": np.where(u.by_torque >= answer.limits.max_depth, np.inf, u.by_torque) * 1e3,
            f"usable_depth_mm{end}": u.depth * 1e3,
            f"removal_rate_cm3_per_min{end}": u.removal_rate * 6e7,
        }
        if answer.common is not None:
            columns[f"common_depth_mm{end}"] = answer.common * 1e3
    write_speed_csv(path, np.round(first * _RPM, 9), columns)


def _draw(path: Path, answers_: Sequence[_Answer]) -> None:
    from rcsa_ident.report.lobes import Mark, comparison_figure, save_figure, usable_figure

    def mark(point: Any) -> Mark:
        cut = f"{point.spindle_speed * _RPM:.0f} rev/min, {1e3 * point.depth:.2f} mm"
        text = f"{cut}\n{6e7 * point.removal_rate:.0f} cm³/min, {1e-3 * point.power:.2g} kW"
        return Mark(point.spindle_speed, point.depth, point.removal_rate, text)

    if len(answers_) == 1:
        (answer,) = answers_
        figure = usable_figure(answer.depths, [mark(p) for p in answer.points], [mark(c) for c in answer.planned], answer.common)
    else:
        best = {}
        for answer in answers_:
            if answer.points:
                point = answer.points[0]
                best[answer.name] = mark(point)._replace(text=f"{6e7 * point.removal_rate:.0f} cm³/min")
        figure = comparison_figure({answer.name: answer.depths for answer in answers_}, best)
    save_figure(figure, str(path))
