"""Figures of stability lobes, what was tested beside them, and what a machinist makes of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rcsa_ident.arrays import FloatArray
from rcsa_ident.report.figures import _STYLE, _TRUTH, COLOURS, _grid
from rcsa_ident.stability.advice import OperatingPoint, UsableDepths
from rcsa_ident.stability.result import StabilityLobes
from rcsa_ident.stability.stability_map import StabilityMap
from rcsa_ident.stability.surface_error import SurfaceError
from rcsa_ident.stability.tested_cuts import Tally, TestedCuts, Verdict
from rcsa_ident.units import to_cm3_per_min, to_hz, to_rpm

_GREY, _GREEN, _RED = "#52606d", "#00704f", "#a33f12"
#: Marker, colour and filling of a tested cut.
_VERDICTS = {Verdict.STABLE: ("o", _GREEN, "none"), Verdict.CHATTER: ("X", _RED, _RED), Verdict.MARGINAL: ("D", "#b8860b", "none")}
#: Lines of curves that are compared.
_CURVES = ("#0072B2", "#C8501A", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#1f2933")


class Judged(NamedTuple):
    """Tested cuts with what the lobes said of them."""

    cuts: TestedCuts
    tally: Tally


class Panel(NamedTuple):
    """One case: its lobes, others to compare them with, and tested cuts.

    Parameters
    ----------
    title : str
    lobes : StabilityLobes
    others : mapping of name to array, shape (n,) [m]
        Limits at the same speeds, as of idle FRFs.
    tested : Judged or None
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
) -> Figure:
    """Stability limit and recommended depth over spindle speed, the recommended cuts marked, the chatter frequency below.

    Parameters
    ----------
    lobes : StabilityLobes
    recommended : sequence of OperatingPoint
        Their depth is the limit less what a recommendation holds back.
    true_limit : array, shape (n,) [m]
        The true limit, where it is known.
    tested : Judged, optional
        Drawn over the lobes.
    surface : SurfaceError, optional
        Drawn below them.
    chart : StabilityMap, optional
        Tells the cuts that are stable above the first limit.
    usable : UsableDepths, optional
        The recommended depths; by default those of the lobes alone.
    """
    rows = (2.2, 1.0) if surface is None else (2.2, 1.0, 1.0)
    figure, grid = _grid(len(rows), 1, 4.6 if surface is None else 5.8, rows, sharey="none")
    top, bottom = grid[0, 0], grid[-1, 0]
    with mpl.rc_context(_STYLE):
        max_depth, ceiling = lobes.max_depth, _ceiling(lobes, tested)
        if chart is not None:
            ceiling = 1e3 * float(chart.depth[-1])
        _draw_limit(top, lobes, ceiling, chart)
        if true_limit is not None:
            top.plot(
                to_rpm(lobes.spindle_speed), 1e3 * np.minimum(true_limit, max_depth), "--", color=_TRUTH, lw=1.1, label="from the true FRF"
            )
        if lobes.absolute_limit is not None and lobes.absolute_limit < max_depth:
            label = f"stable at any speed: {1e3 * lobes.absolute_limit:.2f} mm"
            top.axhline(1e3 * lobes.absolute_limit, color=_GREY, ls=":", lw=1.2, label=label)
        if recommended:
            speed, depth = lobes.ordered().spindle_speed, lobes.ordered().recommended_depth()
            if usable is not None:
                speed, depth = usable.spindle_speed, usable.stable
            top.plot(to_rpm(speed), 1e3 * depth, color=_GREEN, lw=1.1, label="recommended depth")
        for point in recommended:
            x, y = to_rpm(point.spindle_speed), 1e3 * point.depth
            top.plot(x, y, "v", color=_GREEN, ms=8.0)
            # above the limit, where no line crosses it
            above = (x, min(1e3 * point.limit, 0.86 * ceiling))
            text = f"{x:.0f} rev/min\n{y:.2f} mm"
            top.annotate(text, above, xytext=(0, 6), textcoords="offset points", ha="center", fontsize=8.5, color=_GREEN)
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


def _draw_limit(ax: Axes, lobes: StabilityLobes, ceiling: float, chart: StabilityMap | None = None, bands: bool = True) -> None:
    max_depth, band = lobes.max_depth, lobes.band if bands else None
    speed, limit = to_rpm(lobes.spindle_speed), 1e3 * np.minimum(lobes.limit_depth, max_depth)
    if chart is None:
        ax.fill_between(speed, 0.0, limit, color="#009E73", alpha=0.13, lw=0)
        ax.fill_between(speed, limit, ceiling, color="#C8501A", alpha=0.10, lw=0)
    else:
        # a cut of no depth is stable
        depth = 1e3 * np.concatenate([[0.0], chart.depth])
        growth = np.concatenate([np.minimum(chart.growth[:, :1], -0.1), chart.growth], axis=1).T
        ax.contourf(to_rpm(chart.spindle_speed), depth, growth, [-np.inf, 0.0, np.inf], colors=["#009E73", "#C8501A"], alpha=0.13)
        ax.contour(to_rpm(chart.spindle_speed), depth, growth, [0.0], colors=[_GREY], linewidths=0.9)
    if band is not None:
        low, high = (1e3 * np.minimum(edge, max_depth) for edge in band)
        ax.fill_between(speed, low, high, color=COLOURS["X"], alpha=0.35, lw=0, label="95 % uncertainty band")
    ax.plot(speed, limit, color=COLOURS["X"], label="stability limit")
    if np.any(lobes.flip):
        ax.plot(speed[lobes.flip], limit[lobes.flip], "o", color="#CC79A7", ms=3.5, label="by period doubling")
    ax.text(0.008, 0.97, "chatter", transform=ax.transAxes, va="top", color=_RED, fontsize=9.5, style="italic")
    ax.text(0.008, 0.03, "stable", transform=ax.transAxes, va="bottom", color=_GREEN, fontsize=9.5, style="italic")


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
    ax.plot(speed, chatter, color=_GREY)
    ax.set_ylabel("chatter [Hz]")


def _draw_surface(ax: Axes, surface: SurfaceError) -> None:
    speed, error = to_rpm(surface.spindle_speed), 1e6 * surface.error
    ax.fill_between(speed, error.min(axis=1), error.max(axis=1), color="#CC79A7", alpha=0.35, lw=0, label="over the depth")
    ax.plot(speed, error.mean(axis=1), color="#CC79A7", label="mean")
    ax.axhline(0.0, color=_GREY, lw=0.8)
    ax.set_ylabel("wall [µm]\n+ left, – gone")
    ax.set_title(f"surface location error at {1e3 * float(surface.height[-1]):g} mm depth, where teeth {_LEAVE[str(surface.wall)]}")


_LEAVE = {"entry": "enter", "exit": "leave"}


def cases_figure(panels: Sequence[Panel]) -> Figure:
    """Lobes of several cases with the cuts that were tested in each, two in a row."""
    rows = (len(panels) + 1) // 2
    cols = min(2, len(panels))
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(9.6, 0.5 + 2.9 * rows), layout="constrained")
        grid = figure.subplots(rows, cols, squeeze=False)
        labels: dict[str, Artist] = {}
        for ax, panel in zip(grid.ravel(), panels, strict=False):
            ceiling = _ceiling(panel.lobes, panel.tested)
            _draw_limit(ax, panel.lobes, ceiling, bands=False)
            speed = to_rpm(panel.lobes.spindle_speed)
            for (name, limit), colour in zip(panel.others.items(), (_TRUTH, *_CURVES[2:]), strict=False):
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


class Mark(NamedTuple):
    """A cut to point at: speed [rad/s], depth [m], removal rate [m^3/s], what it is."""

    spindle_speed: float
    depth: float
    removal_rate: float
    text: str


def usable_figure(
    depths: UsableDepths, marks: Sequence[Mark] = (), planned: Sequence[Mark] = (), common: FloatArray | None = None
) -> Figure:
    """How deep one may cut and what stands against more, the removal rate below.

    Parameters
    ----------
    depths : UsableDepths
    marks : sequence of Mark
        Recommended cuts.
    planned : sequence of Mark
        Cuts that somebody wants to make.
    common : array, shape (n,) [m], optional
        What is stable on all machines that are consistent with the recordings.
    """
    figure, grid = _grid(2, 1, 5.2, (2.0, 1.0), sharey="none")
    top, bottom = grid[:, 0]
    speed = to_rpm(depths.spindle_speed)
    limit, depth = 1e3 * depths.limit, 1e3 * depths.depth
    ceiling = 1.18 * float(max(limit.max(), *(1e3 * mark.depth for mark in planned), 1e-6))
    with mpl.rc_context(_STYLE):
        top.fill_between(speed, 0.0, depth, color="#009E73", alpha=0.16, lw=0, label="recommended depth")
        top.fill_between(speed, limit, ceiling, color="#C8501A", alpha=0.10, lw=0)
        for values, colour, name in ((depths.by_power, "#CC79A7", "power"), (depths.by_torque, "#8c6d00", "torque")):
            curve = 1e3 * values
            if np.any(curve < limit):
                top.plot(speed, np.where(curve < ceiling, curve, np.nan), color=colour, lw=1.3, label=f"limited by {name}")
                top.fill_between(speed, np.minimum(curve, limit), limit, color=colour, alpha=0.13, lw=0)
        if common is not None:
            top.plot(speed, 1e3 * common, ":", color=_TRUTH, lw=1.2, label="stable on all machines consistent with the recordings")
        if np.any(np.abs(depths.stable - depths.limit) > 1e-9):
            top.plot(speed, 1e3 * depths.stable, color=_GREEN, lw=1.1, label="recommended depth by stability alone")
        top.plot(speed, limit, color=COLOURS["X"], label="stability limit")
        for group, marker, colour, name in ((marks, "v", _GREEN, "recommended"), (planned, "s", _RED, "planned")):
            for i, mark in enumerate(group):
                x, y = to_rpm(mark.spindle_speed), 1e3 * mark.depth
                top.plot(x, y, marker, color=colour, ms=7.0, zorder=5, label=name if i == 0 else None)
                bottom.plot(x, to_cm3_per_min(mark.removal_rate), marker, color=colour, ms=6.0, zorder=5)
                _beside(top, x, y, mark.text, colour, speed)
        top.set_ylim(0.0, ceiling)
        top.set_ylabel("axial depth [mm]")
        figure.legend(*top.get_legend_handles_labels(), loc="outside upper center", ncols=4, fontsize=9.0, frameon=False)
        bottom.plot(speed, to_cm3_per_min(depths.removal), color=_GREEN)
        bottom.set_ylim(bottom=0.0)
        bottom.set_ylabel("removal rate [cm³/min]")
        bottom.set_xlabel("spindle speed [rev/min]")
        bottom.set_xlim(speed.min(), speed.max())
    return figure


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

    Parameters
    ----------
    curves : mapping of name to UsableDepths
    marks : mapping of name to Mark
        The best cut of each.
    """
    figure, grid = _grid(2, 1, 5.6, (1.4, 1.0), sharey="none")
    top, bottom = grid[:, 0]
    with mpl.rc_context(_STYLE):
        for i, (name, depths) in enumerate(curves.items()):
            colour, dashes = _CURVES[i % len(_CURVES)], ("-", "--", ":")[i // len(_CURVES) % 3]
            speed = to_rpm(depths.spindle_speed)
            top.plot(speed, 1e3 * depths.limit, dashes, color=colour, lw=0.8, alpha=0.6)
            top.plot(speed, 1e3 * depths.depth, dashes, color=colour, label=name.replace("$", r"\$"))
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


def save_figure(figure: Figure, path: str) -> None:
    """Write a figure as PNG or SVG, as the name ends; the same figure gives the same file."""
    with mpl.rc_context({**_STYLE, "svg.hashsalt": "figure"}):
        metadata = {"Date": None} if path.lower().endswith(".svg") else {"Software": None}
        figure.savefig(path, dpi=150, metadata=metadata)
