"""Figures of what is recommended: usable depth and removal rate over spindle speed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.units import to_cm3_per_min, to_rpm
from rcsa_ident.report.lobes import stability_figure
from rcsa_ident.report.style import COLOURS, CURVES, GREEN, RED, STYLE, TRUTH, figure_grid, letters
from rcsa_ident.stability.advice import Advice, PlannedCut, UsableDepths
from rcsa_ident.stability.operating_point import OperatingPoint


class Mark(NamedTuple):
    """A cut to point at: speed [rad/s], depth [m], removal rate [m^3/s], what it is; without a limit both are infinite, and only told."""

    spindle_speed: float
    depth: float
    removal_rate: float
    text: str


def usable_figure(
    depths: UsableDepths, marks: Sequence[Mark] = (), planned: Sequence[Mark] = (), common: FloatArray | None = None
) -> Figure:
    """How deep one may cut and what stands against more, the removal rate below.

    `marks`: recommended cuts
    `planned`: cuts that somebody wants to make
    `common` [m], shape (n,): what is stable on all machines that are consistent with the recordings
    """
    figure, grid = figure_grid(2, 1, 5.2, (2.0, 1.0), sharey="none")
    top, bottom = grid[:, 0]
    speed = to_rpm(depths.spindle_speed)
    limit, depth = 1e3 * depths.limit, 1e3 * depths.depth
    ceiling = 1.18 * float(max(limit.max(), *(1e3 * mark.depth for mark in planned), 1e-6))
    with mpl.rc_context(STYLE):
        top.fill_between(speed, 0.0, depth, color="#009E73", alpha=0.16, lw=0, label="recommended depth")
        top.fill_between(speed, limit, ceiling, color="#C8501A", alpha=0.10, lw=0)
        for values, colour, name in ((depths.by_power, "#CC79A7", "power"), (depths.by_torque, "#8c6d00", "torque")):
            curve = 1e3 * values
            if np.any(curve < limit):
                top.plot(speed, np.where(curve < ceiling, curve, np.nan), color=colour, lw=1.3, label=f"limited by {name}")
                top.fill_between(speed, np.minimum(curve, limit), limit, color=colour, alpha=0.13, lw=0)
        if common is not None:
            top.plot(speed, 1e3 * common, ":", color=TRUTH, lw=1.2, label="stable on all machines consistent with the recordings")
        if np.any(np.abs(depths.stable - depths.limit) > 1e-9):
            top.plot(speed, 1e3 * depths.stable, color=GREEN, lw=1.1, label="recommended depth by stability alone")
        top.plot(speed, limit, color=COLOURS["X"], label="stability limit")
        for group, marker, colour, name in ((marks, "v", GREEN, "recommended"), (planned, "s", RED, "planned")):
            for i, mark in enumerate(group):
                x, y = to_rpm(mark.spindle_speed), 1e3 * mark.depth
                if mark.depth < np.inf:
                    top.plot(x, y, marker, color=colour, ms=7.0, zorder=5, label=name if i == 0 else None)
                    bottom.plot(x, to_cm3_per_min(mark.removal_rate), marker, color=colour, ms=6.0, zorder=5)
                _beside(top, x, min(y, float(limit.max())), mark.text, colour, speed)
        top.set_ylim(0.0, ceiling)
        top.set_ylabel("axial depth [mm]")
        figure.legend(*top.get_legend_handles_labels(), loc="outside upper center", ncols=4, fontsize=9.0, frameon=False)
        bottom.plot(speed, to_cm3_per_min(depths.removal), color=GREEN)
        bottom.set_ylim(bottom=0.0)
        bottom.set_ylabel("removal rate [cm³/min]")
        bottom.set_xlabel("spindle speed [rev/min]")
        bottom.set_xlim(speed.min(), speed.max())
    return figure


def advice_figure(answers: Sequence[Advice]) -> Figure:
    """What is recommended of one tooling with what stands against more; of several their depths beside each other.

    Without a feed per tooth, which the removal rate grows with, it is the figure of one tooling's stability.
    """
    if len(answers) == 1:
        (answer,) = answers
        if answer.usable.removal_rate is None:
            return stability_figure(answer.lobes, answer.recommended, usable=answer.usable, around=answer.drawn_around)
        recommended, planned = ([_mark(cut) for cut in cuts] for cuts in (answer.recommended, answer.planned))
        return usable_figure(answer.usable, recommended, planned, answer.common)
    deep = {answer.tooling: [cut for cut in answer.recommended if cut.removal_rate is not None] for answer in answers}
    best = {name: _mark(cuts[0]) for name, cuts in deep.items() if cuts}
    marks_ = {name: mark._replace(text=f"{to_cm3_per_min(mark.removal_rate):.0f} cm³/min") for name, mark in best.items()}
    return comparison_figure({answer.tooling: answer.usable for answer in answers}, marks_)


def _mark(cut: OperatingPoint | PlannedCut) -> Mark:
    if isinstance(cut, OperatingPoint) and cut.depth == np.inf:
        return Mark(cut.spindle_speed, cut.depth, np.inf, f"{to_rpm(cut.spindle_speed):.0f} rev/min\nno limit up to {1e3 * cut.limit:g} mm")
    removal, power = cut.removal_rate or 0.0, cut.power or 0.0
    what = f"{to_rpm(cut.spindle_speed):.0f} rev/min, {1e3 * cut.depth:.2f} mm"
    return Mark(cut.spindle_speed, cut.depth, removal, f"{what}\n{to_cm3_per_min(removal):.0f} cm³/min, {1e-3 * power:.2g} kW")


def _beside(ax: Axes, x: float, y: float, text: str, colour: str, speed: FloatArray) -> None:
    """Write beside a mark, away from the nearer end of the axis."""
    right = x < speed.min() + 0.8 * np.ptp(speed)
    ax.annotate(
        text,
        (x, y),
        xytext=(8 if right else -8, 4),
        textcoords="offset points",
        ha="left" if right else "right",
        fontsize=8.5,
        color=colour,
    )


def comparison_figure(curves: Mapping[str, UsableDepths], marks: Mapping[str, Mark]) -> Figure:
    """Usable depth and removal rate of several toolings or stickouts over speed.

    `curves`: mapping of name to UsableDepths
    `marks`: mapping of name to Mark, the best cut of each
    """
    figure, grid = figure_grid(2, 1, 5.6, (1.4, 1.0), sharey="none")
    top, bottom = grid[:, 0]
    with mpl.rc_context(STYLE):
        for i, (name, depths) in enumerate(curves.items()):
            colour, dashes = CURVES[i % len(CURVES)], ("-", "--", ":")[i // len(CURVES) % 3]
            speed = to_rpm(depths.spindle_speed)
            top.plot(speed, 1e3 * depths.limit, dashes, color=colour, lw=0.8, alpha=0.6)
            top.plot(speed, 1e3 * depths.depth, dashes, color=colour, label=letters(name))
            bottom.plot(speed, to_cm3_per_min(depths.removal), dashes, color=colour)
            if name in marks:
                mark = marks[name]
                top.plot(to_rpm(mark.spindle_speed), 1e3 * mark.depth, "v", color=colour, ms=7.0, zorder=5)
                bottom.plot(to_rpm(mark.spindle_speed), to_cm3_per_min(mark.removal_rate), "v", color=colour, ms=7.0, zorder=5)
                _beside(bottom, to_rpm(mark.spindle_speed), to_cm3_per_min(mark.removal_rate), mark.text, colour, speed)
            bottom.set_xlim(speed.min(), speed.max())
        top.set_ylim(bottom=0.0)
        top.set_ylabel("recommended depth [mm]\n(thin: stability limit)")
        bottom.set_ylim(bottom=0.0)
        bottom.margins(y=0.15)
        bottom.set_ylabel("removal rate [cm³/min]")
        bottom.set_xlabel("spindle speed [rev/min]")
        figure.legend(*top.get_legend_handles_labels(), loc="outside upper center", ncols=4, fontsize=9.0, frameon=False)
    return figure
