"""Figures of measurements beside: mean forces over the feed, hammer tests beside identified or modelled dynamics."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.report.style import COLOURS, STYLE

_HAMMER = "#1f2933"
_FORCE_COLOURS = ("#0072B2", "#C8501A", "#009E73")

#: What is drawn of an FRF.
_View = Callable[[ComplexArray], FloatArray]


def save(figure: Figure, path: str | Path) -> None:
    """Write a figure; the suffix says the format (png, svg, pdf)."""
    with mpl.rc_context(STYLE):
        figure.savefig(path, dpi=150, facecolor="white")


@dataclass(frozen=True, slots=True, eq=False)
class MeanForces:
    """Mean forces of cuts that differ in their feed only.

    `feed` [m], shape (n,)
    `force` [N], shape (n, c): X, Y and perhaps axial
    `line_feed` [m], shape (2,)
    `line` [N], shape (2, c): what the fitted coefficients say
    """

    title: str
    feed: FloatArray
    force: FloatArray
    line_feed: FloatArray
    line: FloatArray


def mean_forces(groups: Sequence[MeanForces]) -> Figure:
    """Measured mean forces over the feed per tooth with the regression's lines, a column for each group."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(max(5.6, 4.2 * len(groups)), 3.8), layout="constrained")
        grid = figure.subplots(1, len(groups), squeeze=False, sharey=True)
        for ax, group in zip(grid[0], groups, strict=True):
            for c, name in enumerate(("X", "Y", "axial")[: group.force.shape[1]]):
                colour = _FORCE_COLOURS[c]
                ax.plot(1e3 * group.line_feed, group.line[:, c], color=colour, lw=1.2)
                ax.plot(1e3 * group.feed, group.force[:, c], "o", ms=4.5, mfc="white", mec=colour, mew=1.3, label=f"F {name}")
            ax.axhline(0.0, color="#9aa5b1", lw=0.8)
            ax.set_title(group.title, parse_math=False)
            ax.set_xlabel("feed per tooth [mm]")
            ax.set_xlim(left=0.0)
        grid[0, 0].set_ylabel("mean force on the tool [N]")
        grid[0, -1].legend(loc="best")
    return figure


@dataclass(frozen=True, slots=True, eq=False)
class FrfPair:
    """One response, measured by hammer and identified.

    `title`: what it is a response of, as in ``C11, tool tip, X``
    `colour`: X or Y
    `frequency` [Hz], shape (n,); `identified` [m/N], shape (n,); `hammer_frequency` [Hz], shape (h,); `hammer` [m/N], shape (h,)
    `deviation`: (array, array) or None, shape (n,) each [m/N]; standard deviations of the identified real and imaginary part
    `peaks`: sequence of (hammer Hz, identified Hz or None); modes that both show, and such as only the hammer test does
    `correlation`: (array, array) or None; middles of frequency bands [Hz] and the FRAC in each [-]
    """

    title: str
    colour: str
    frequency: FloatArray
    identified: ComplexArray
    hammer_frequency: FloatArray
    hammer: ComplexArray
    deviation: tuple[FloatArray, FloatArray] | None = None
    peaks: Sequence[tuple[float, float | None]] = ()
    correlation: tuple[FloatArray, FloatArray] | None = None


def frf_comparison(
    pairs: Sequence[FrfPair],
    names: tuple[str, str] = ("idle, hammer", "in process, identified"),
    band_hz: tuple[float, float] | None = None,
    real_and_imaginary: bool = False,
) -> Figure:
    """Hammer and identified responses on top of each other, a column for each; below them their FRAC over frequency.

    `names`: (str, str); names of the hammer's and of the other curve
    `band_hz`: (float, float); frequencies between which the machine was identified; outside is shaded
    `real_and_imaginary`: draw these in place of magnitude and phase
    """
    correlated = any(pair.correlation is not None for pair in pairs)
    rows, ratios = (3, (1.6, 1.0, 0.6)) if correlated else (2, (1.6, 1.0))
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(max(5.2, 4.3 * len(pairs) + 0.8), 2.0 * sum(ratios) + 0.9), layout="constrained")
        grid = figure.subplots(rows, len(pairs), sharex="col", squeeze=False, height_ratios=ratios)
        for column, pair in zip(grid.T, pairs, strict=True):
            views = _views(real_and_imaginary)
            for ax, view in zip(column, views, strict=False):
                # the dashes on top, so that both are seen where they agree
                style = {"ls": (0, (4, 2.5)), "zorder": 3}
                ax.plot(pair.hammer_frequency, view(pair.hammer), color=_HAMMER, lw=1.1, label=names[0], **style)
                ax.plot(pair.frequency, view(pair.identified), color=COLOURS[pair.colour], lw=2.0, label=names[1])
                if band_hz is not None:
                    _shade(ax, band_hz, (pair.hammer_frequency, pair.frequency))
            _band(column, pair, real_and_imaginary)
            _peaks(column[0], pair, views[0])
            if not real_and_imaginary:
                column[0].set_yscale("log")
                column[1].set_yticks([-180, -90, 0, 90, 180])
                column[1].set_ylim(-190, 190)
            column[0].set_title(pair.title, parse_math=False)
            if correlated:
                if pair.correlation is not None:
                    column[2].step(*pair.correlation, where="mid", color="#52606d", lw=1.4)
                column[2].set_ylim(0.0, 1.05)
            column[-1].set_xlabel("frequency [Hz]")
        labels = ("real [µm/N]", "imaginary [µm/N]") if real_and_imaginary else ("magnitude [µm/N]", "phase [°]")
        for ax, label in zip(grid[:, 0], (*labels, "FRAC [–]"), strict=False):
            ax.set_ylabel(label)
        figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=4)
    return figure


def _views(real_and_imaginary: bool) -> tuple[_View, _View]:
    if real_and_imaginary:
        return (lambda h: 1e6 * h.real), (lambda h: 1e6 * h.imag)

    def phase(h: ComplexArray) -> FloatArray:
        degrees = np.degrees(np.angle(h))
        degrees[1:][np.abs(np.diff(degrees)) > 180.0] = np.nan
        return degrees

    return (lambda h: 1e6 * np.abs(h)), phase


def _band(column: np.ndarray, pair: FrfPair, real_and_imaginary: bool) -> None:
    """Two standard deviations to each side."""
    if pair.deviation is None:
        return
    real, imaginary = pair.deviation
    h, colour = pair.identified, COLOURS[pair.colour]
    if real_and_imaginary:
        sides = [(h.real, real), (h.imag, imaginary)]
        for ax, (value, std) in zip(column, sides, strict=False):
            ax.fill_between(pair.frequency, 1e6 * (value - 2 * std), 1e6 * (value + 2 * std), color=colour, alpha=0.25, lw=0, label="± 2 σ")
        return
    unit = h / np.abs(h)
    std = np.hypot(real * unit.real, imaginary * unit.imag)
    low = np.maximum(np.abs(h) - 2 * std, 0.02 * np.abs(h))
    column[0].fill_between(pair.frequency, 1e6 * low, 1e6 * (np.abs(h) + 2 * std), color=colour, alpha=0.25, lw=0, label="± 2 σ")


def _peaks(ax: Axes, pair: FrfPair, view: _View) -> None:
    for measured, identified in pair.peaks:
        ax.plot(measured, np.interp(measured, pair.hammer_frequency, view(pair.hammer)), "v", ms=6.0, color=_HAMMER)
        if identified is not None:
            ax.plot(identified, np.interp(identified, pair.frequency, view(pair.identified)), "^", ms=6.0, color=COLOURS[pair.colour])


def _shade(ax: Axes, band_hz: tuple[float, float], frequencies: Sequence[FloatArray]) -> None:
    low, high = min(f.min() for f in frequencies), max(f.max() for f in frequencies)
    for a, b in ((low, band_hz[0]), (band_hz[1], high)):
        if b > a:
            ax.axvspan(a, b, color="#e4e7eb", alpha=0.5, lw=0, zorder=0)
    ax.set_xlim(low, high)


@dataclass(frozen=True, slots=True, eq=False)
class FlangePair:
    """A flange's receptance block, decoupled or measured, beside an identified one.

    `frequency` [Hz], shape (n,)
    `values`: mapping of name to complex array, shape (n, 2, 2); at most three curves
    `colours`: mapping of name to str
    """

    title: str
    frequency: FloatArray
    values: Mapping[str, ComplexArray]
    colours: Mapping[str, str] = field(default_factory=dict)


def flange_comparison(pair: FlangePair) -> Figure:
    """The three independent entries of the uncoupled spindle's flange, magnitude and phase."""
    entries = (((0, 0), "h_tF [m/N]"), ((0, 1), "h_tM = h_rF [rad/N]"), ((1, 1), "h_rM [rad/(N m)]"))
    usual = ("#1f2933", "#0072B2", "#C8501A")
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(11.0, 4.8), layout="constrained")
        grid = figure.subplots(2, 3, sharex=True, squeeze=False, height_ratios=(1.6, 1.0))
        for column, ((i, j), label) in zip(grid.T, entries, strict=True):
            for k, (name, values) in enumerate(pair.values.items()):
                colour = pair.colours.get(name, usual[k % 3])
                style = {"ls": (0, (4, 1.5))} if k == 0 and len(pair.values) > 1 else {}
                column[0].semilogy(pair.frequency, np.abs(values[:, i, j]), color=colour, label=name, **style)
                phase = np.degrees(np.angle(values[:, i, j]))
                phase[1:][np.abs(np.diff(phase)) > 180.0] = np.nan
                column[1].plot(pair.frequency, phase, color=colour, **style)
            column[0].set_title(label)
            column[1].set_ylim(-190, 190)
            column[1].set_yticks([-180, -90, 0, 90, 180])
            column[1].set_xlabel("frequency [Hz]")
        grid[0, 0].set_ylabel("magnitude")
        grid[1, 0].set_ylabel("phase [°]")
        figure.suptitle(pair.title, parse_math=False)
        figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure
