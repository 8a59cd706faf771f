"""Figures of stability lobes, what was tested beside them, and what a machinist makes of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.units import to_hz, to_rpm
from rcsa_ident.report.style import COLOURS, CURVES, GREEN, GREY, RED, STYLE, TRUTH, figure_grid
from rcsa_ident.stability.advice import UsableDepths
from rcsa_ident.stability.labels.tested_cuts import Tally, TestedCuts, Verdict
from rcsa_ident.stability.operating_point import OperatingPoint
from rcsa_ident.stability.result import StabilityLobes
from rcsa_ident.stability.stability_map import StabilityMap
from rcsa_ident.stability.surface_error import SurfaceError

#: Marker, colour and filling of a tested cut.
_VERDICTS = {Verdict.STABLE: ("o", GREEN, "none"), Verdict.CHATTER: ("X", RED, RED), Verdict.MARGINAL: ("D", "#b8860b", "none")}


class Judged(NamedTuple):
    """Tested cuts with what the lobes said of them."""

    cuts: TestedCuts
    tally: Tally


class Panel(NamedTuple):
    """One case: its lobes, others to compare them with, and tested cuts.

    `others`: mapping of name to array, shape (n,) [m]; limits at the same speeds, as of idle FRFs
    """

    title: str
    lobes: StabilityLobes
    others: Mapping[str, FloatArray] = {}
    tested: Judged | None = None


def stability_figure(
    lobes: StabilityLobes,
    recommended: Sequence[OperatingPoint] = (),
    true_limit: FloatArray | None = None,
    tested: Judged | None = None,
    surface: SurfaceError | None = None,
    chart: StabilityMap | None = None,
    usable: UsableDepths | None = None,
    around: Sequence[StabilityLobes] | None = None,
) -> Figure:
    """Stability limit and recommended depth over spindle speed, the recommended cuts marked, the chatter frequency below.

    `recommended`: their depth is the limit less what a recommendation holds back
    `true_limit` [m], shape (n,): the true limit, where it is known
    `tested`: drawn over the lobes
    `surface`: drawn below them
    `chart`: tells the cuts that are stable above the first limit
    `usable`: the recommended depths; by default those of the lobes alone
    `around`: limits around the recommended cuts, with bands of their own; the lobes are then drawn as the preview that they are
    """
    rows = (2.2, 1.0) if surface is None else (2.2, 1.0, 1.0)
    figure, grid = figure_grid(len(rows), 1, 4.6 if surface is None else 5.8, rows, sharey="none")
    top, bottom = grid[0, 0], grid[-1, 0]
    with mpl.rc_context(STYLE):
        max_depth, ceiling = lobes.max_depth, _ceiling(lobes, tested)
        if chart is not None:
            ceiling = 1e3 * float(chart.depth[-1])
        _draw_limit(top, lobes, ceiling, chart, preview=around is not None)
        for k, each in enumerate(around or ()):
            _draw_exact(top, each, named=k == 0)
        if true_limit is not None:
            top.plot(
                to_rpm(lobes.spindle_speed), 1e3 * np.minimum(true_limit, max_depth), "--", color=TRUTH, lw=1.1, label="from the true FRF"
            )
        if lobes.absolute_limit is not None and lobes.absolute_limit < max_depth:
            label = f"stable at any speed: {1e3 * lobes.absolute_limit:.2f} mm"
            top.axhline(1e3 * lobes.absolute_limit, color=GREY, ls=":", lw=1.2, label=label)
        if recommended and around is None:
            speed, depth = lobes.ordered().spindle_speed, lobes.ordered().recommended_depth()
            if usable is not None:
                speed, depth = usable.spindle_speed, usable.stable
            top.plot(to_rpm(speed), 1e3 * depth, color=GREEN, lw=1.1, label="recommended depth")
        for point in recommended:
            x, y = to_rpm(point.spindle_speed), 1e3 * point.depth
            if point.depth < np.inf:
                top.plot(x, y, "v", color=GREEN, ms=8.0)
            # above the limit, where no line crosses it
            above = (x, min(1e3 * point.limit, 0.86 * ceiling))
            none = "no depth recommended" if point.why else f"no limit up to {1e3 * point.limit:g} mm"
            text = f"{x:.0f} rev/min\n" + (f"{y:.2f} mm" if point.depth < np.inf else none)
            top.annotate(text, above, xytext=(0, 6), textcoords="offset points", ha="center", fontsize=8.5, color=GREEN)
        if tested is not None:
            _draw_tested(top, tested)
        top.set_ylim(0.0, ceiling)
        top.set_ylabel("axial depth [mm]")
        told = None if tested is None else _told(tested.tally)
        figure.legend(*top.get_legend_handles_labels(), loc="outside upper center", ncols=5, fontsize=9.0, frameon=False, title=told)
        _draw_chatter(grid[1, 0], lobes)
        if surface is not None:
            _draw_surface(grid[2, 0], surface)
        bottom.set_xlabel("spindle speed [rev/min]")
        speed = to_rpm(lobes.spindle_speed)
        bottom.set_xlim(np.min(speed), np.max(speed))
    return figure


def _ceiling(lobes: StabilityLobes, tested: Judged | None) -> float:
    deepest = 1e3 * lobes.max_depth
    ceiling = deepest if np.any(lobes.stable) else min(deepest, 1.25e3 * float(np.max(lobes.nominal)))
    return ceiling if tested is None else max(ceiling, 1.08e3 * float(tested.cuts.axial_depth.max()))


def _draw_exact(ax: Axes, lobes: StabilityLobes, named: bool) -> None:
    """Limits around a recommended cut, with their band."""
    speed, limit = to_rpm(lobes.spindle_speed), 1e3 * lobes.nominal
    if lobes.band is not None:
        low, high = (1e3 * np.minimum(edge, lobes.max_depth) for edge in lobes.band)
        ax.fill_between(speed, low, high, color=COLOURS["X"], alpha=0.35, lw=0, label="its 95 % uncertainty band" if named else None)
    ax.plot(speed, limit, color=COLOURS["X"], lw=2.0, label=f"stability limit, {lobes.method}" if named else None)


def _draw_limit(
    ax: Axes, lobes: StabilityLobes, ceiling: float, chart: StabilityMap | None = None, bands: bool = True, preview: bool = False
) -> None:
    max_depth, band = lobes.max_depth, lobes.band if bands and not preview else None
    speed, limit = to_rpm(lobes.spindle_speed), 1e3 * np.minimum(lobes.limit_depth, max_depth)
    if chart is None:
        ax.fill_between(speed, 0.0, limit, color="#009E73", alpha=0.13, lw=0)
        ax.fill_between(speed, limit, ceiling, color="#C8501A", alpha=0.10, lw=0)
    else:
        _draw_map(ax, chart)
    if band is not None:
        low, high = (1e3 * np.minimum(edge, max_depth) for edge in band)
        ax.fill_between(speed, low, high, color=COLOURS["X"], alpha=0.35, lw=0, label="95 % uncertainty band")
    if preview:
        ax.plot(speed, limit, ":", color=COLOURS["X"], lw=1.1, label=f"preview, {lobes.method}")
    else:
        ax.plot(speed, limit, color=COLOURS["X"], label="stability limit")
    if np.any(lobes.flip):
        ax.plot(speed[lobes.flip], limit[lobes.flip], "o", color="#CC79A7", ms=3.5, label="by period doubling")
    _name_sides(ax)


def _name_sides(ax: Axes) -> None:
    ax.text(0.008, 0.97, "chatter", transform=ax.transAxes, va="top", color=RED, fontsize=9.5, style="italic")
    ax.text(0.008, 0.03, "stable", transform=ax.transAxes, va="bottom", color=GREEN, fontsize=9.5, style="italic")


def _draw_map(ax: Axes, chart: StabilityMap) -> None:
    # a cut of no depth is stable
    depth = 1e3 * np.concatenate([[0.0], chart.depth])
    growth = np.concatenate([np.minimum(chart.growth[:, :1], -0.1), chart.growth], axis=1).T
    ax.contourf(to_rpm(chart.spindle_speed), depth, growth, [-np.inf, 0.0, np.inf], colors=["#009E73", "#C8501A"], alpha=0.13)
    ax.contour(to_rpm(chart.spindle_speed), depth, growth, [0.0], colors=[GREY], linewidths=0.9)


def map_figure(chart: StabilityMap) -> Figure:
    """Stable and unstable cuts over spindle speed and depth."""
    figure, grid = figure_grid(1, 1, 3.6)
    with mpl.rc_context(STYLE):
        _draw_map(grid[0, 0], chart)
        _name_sides(grid[0, 0])
        grid[0, 0].set_ylabel("axial depth [mm]")
        grid[0, 0].set_xlabel("spindle speed [rev/min]")
        grid[0, 0].set_ylim(0.0, 1e3 * float(chart.depth[-1]))
    return figure


def surface_figure(surface: SurfaceError) -> Figure:
    """Surface location error over spindle speed."""
    figure, grid = figure_grid(1, 1, 3.0)
    with mpl.rc_context(STYLE):
        _draw_surface(grid[0, 0], surface)
        grid[0, 0].set_xlabel("spindle speed [rev/min]")
        grid[0, 0].legend(loc="upper right")
    return figure


def _draw_tested(ax: Axes, tested: Judged) -> None:
    speed, depth = to_rpm(tested.cuts.spindle_speed), 1e3 * tested.cuts.axial_depth
    for verdict, (marker, colour, filling) in _VERDICTS.items():
        seen = tested.cuts.seen(verdict)
        if seen.any():
            ax.plot(
                speed[seen], depth[seen], marker, ms=5.5, mec=colour, mfc=filling, mew=1.1, ls="none", zorder=4, label=f"tested: {verdict}"
            )


def _told(tally: Tally) -> str:
    """The four cases in one line."""
    words = f"{tally.stable_stable + tally.chatter_chatter} of {tally.decided} tested cuts classified correctly"
    wrong = [
        f"{count} {what}"
        for count, what in ((tally.stable_chatter, "unexpected chatter"), (tally.chatter_stable, "stable above the limit"))
        if count
    ]
    return words + (f" ({', '.join(wrong)})" if wrong else "")


def _draw_chatter(ax: Axes, lobes: StabilityLobes) -> None:
    order = np.argsort(lobes.spindle_speed)
    speed, chatter = to_rpm(lobes.spindle_speed[order]), to_hz(lobes.chatter_frequency[order])
    # another lobe or another mode: no line between them
    jumps = np.abs(np.diff(chatter, prepend=chatter[0])) > 0.03 * chatter
    chatter[jumps] = np.nan
    ax.plot(speed, chatter, color=GREY)
    ax.set_ylabel("chatter [Hz]")


def _draw_surface(ax: Axes, surface: SurfaceError) -> None:
    speed, error = to_rpm(surface.spindle_speed), 1e6 * surface.error
    ax.fill_between(speed, error.min(axis=1), error.max(axis=1), color="#CC79A7", alpha=0.35, lw=0, label="over the depth")
    ax.plot(speed, error.mean(axis=1), color="#CC79A7", label="mean")
    ax.axhline(0.0, color=GREY, lw=0.8)
    ax.set_ylabel("wall [µm]\n+ left, – gone")
    ax.set_title(f"surface location error at {1e3 * float(surface.height[-1]):g} mm depth, where teeth {_LEAVE[str(surface.wall)]}")


_LEAVE = {"entry": "enter", "exit": "leave"}


def cases_figure(panels: Sequence[Panel]) -> Figure:
    """Lobes of several cases with the cuts that were tested in each, two in a row."""
    rows = (len(panels) + 1) // 2
    cols = min(2, len(panels))
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 0.5 + 2.9 * rows), layout="constrained")
        grid = figure.subplots(rows, cols, squeeze=False)
        labels: dict[str, Artist] = {}
        for ax, panel in zip(grid.ravel(), panels, strict=False):
            ceiling = _ceiling(panel.lobes, panel.tested)
            _draw_limit(ax, panel.lobes, ceiling, bands=False)
            speed = to_rpm(panel.lobes.spindle_speed)
            for (name, limit), colour in zip(panel.others.items(), (TRUTH, *CURVES[2:]), strict=False):
                ax.plot(speed, 1e3 * np.minimum(limit, panel.lobes.max_depth), "--", color=colour, lw=1.1, label=name)
            title = panel.title
            if panel.tested is not None:
                _draw_tested(ax, panel.tested)
                title += f"\n{_told(panel.tested.tally)}"
            ax.set_title(title, parse_math=False, fontsize=9.5)
            ax.set_ylim(0.0, ceiling)
            ax.set_xlim(speed.min(), speed.max())
            labels |= {label: handle for handle, label in zip(*ax.get_legend_handles_labels(), strict=True)}
        for ax in grid.ravel()[len(panels) :]:
            ax.set_visible(False)
        for ax in grid[-1]:
            ax.set_xlabel("spindle speed [rev/min]")
        for ax in grid[:, 0]:
            ax.set_ylabel("axial depth [mm]")
        figure.legend(list(labels.values()), list(labels), loc="outside upper center", ncols=5, fontsize=9.0, frameon=False)
    return figure


def save_figure(figure: Figure, path: str) -> None:
    """Write a figure as PNG or SVG, as the name ends; the same figure gives the same file."""
    with mpl.rc_context({**STYLE, "svg.hashsalt": "figure"}):
        metadata = {"Date": None} if path.lower().endswith(".svg") else {"Software": None}
        figure.savefig(path, dpi=150, metadata=metadata)
