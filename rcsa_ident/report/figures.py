"""Figures of an identification, without a window: each function returns a figure, `style.svg` makes text of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.units import to_hz
from rcsa_ident.identification.progress import BOTH, Stage, Step
from rcsa_ident.identification.result import AxisResult, Identification, MetTest
from rcsa_ident.report.style import COLOURS, STYLE, TRUTH, figure_grid, wide, without_jumps

#: Share of the largest value below which curves across the planes, which pass through zero, are cut off.
_LEAST_SHOWN = 3e-4
STAGES = {
    Stage.SEARCH: ("genetic search", "#9aa5b1"),
    Stage.REFINE: ("refined candidates", "#0072B2"),
    Stage.NOISE: ("noise learned from the data", "#009E73"),
    Stage.EXCHANGE: ("modes added, merged or removed", "#CC79A7"),
    Stage.OTHER_AXIS: ("started from the other axis", "#E69F00"),
    Stage.POLISH: ("joint fit of both axes", "#C8501A"),
    Stage.GROW: ("one mode more than the evidence supports", "#56B4E9"),
    Stage.GENERATION: ("best of each generation", "#0072B2"),
}


def cross_frf(axis: AxisResult, tooling: Sequence[str], name: str) -> Figure:
    """Measured points and the fitted cross FRF C31, magnitude and phase, a column for each tooling.

    `tooling`: sequence of str, length k; name of each cut's tooling
    `name`: X or Y
    """
    omega, cut = axis.measured["omega"], np.asarray(axis.measured["cut"], dtype=int)
    value, model = (np.asarray(axis.measured[key], dtype=complex) for key in ("value", "model"))
    of = np.array(tooling)[cut]
    names = list(dict.fromkeys(of.tolist()))
    figure, grid = figure_grid(2, len(names), 4.6, (1.6, 1.0))
    with mpl.rc_context(STYLE):
        for column, each in enumerate(names):
            order = np.flatnonzero(of == each)
            order = order[np.argsort(omega[order])]
            frequency = to_hz(omega[order])
            top, bottom = grid[:, column]
            points, line = value[order], model[order]
            pairs = (
                (top, 1e6 * np.abs(points), 1e6 * np.abs(line)),
                (bottom, np.degrees(np.angle(points)), without_jumps(np.degrees(np.angle(line)))),
            )
            for ax, measured, fitted in pairs:
                ax.plot(frequency, measured, "o", ms=3.4, mfc="none", mec=COLOURS[name], mew=1.0, zorder=3, label="measured")
                ax.plot(frequency, fitted, color=TRUTH, lw=1.0, zorder=2, label="fitted")
        _size_over_phase(grid, "|C31|  [µm/N]", [f"{name}: {each}" for each in names])
    return figure


def hammer_tests(tests: Sequence[MetTest], name: str) -> Figure:
    """Hammer tests and the fitted receptances, magnitude and phase, a column for each test. `tests`: of one axis. `name`: X or Y."""
    figure, grid = figure_grid(2, len(tests), 4.6, (1.6, 1.0))
    with mpl.rc_context(STYLE):
        for column, test in enumerate(tests):
            frequency = to_hz(test.lines.omega)
            top, bottom = grid[:, column]
            top.plot(frequency, 1e6 * np.abs(test.lines.value), "o", ms=2.6, mfc="none", mec=COLOURS[name], mew=0.8, label="hammer")
            top.plot(frequency, 1e6 * np.abs(test.model), color=TRUTH, lw=1.0, label="fitted")
            for value, style in (
                (test.lines.value, {"color": COLOURS[name], "lw": 2.4, "alpha": 0.5}),
                (test.model, {"color": TRUTH, "lw": 1.0}),
            ):
                bottom.plot(frequency, without_jumps(np.degrees(np.angle(value))), **style)
        _size_over_phase(grid, "receptance  [µm/N]", [f"{name}: {test.lines.id}" for test in tests])
    return figure


def _size_over_phase(grid: np.ndarray, size: str, titles: Sequence[str]) -> None:
    """Scales, titles and words of a grid with a size above its phase in every column."""
    for (top, bottom), title in zip(grid.T, titles, strict=True):
        top.set_yscale("log")
        top.set_title(title, parse_math=False)
        bottom.set_ylim(-190.0, 190.0)
        bottom.set_yticks([-180, -90, 0, 90, 180])
        bottom.set_xlabel("frequency [Hz]")
    grid[0, 0].set_ylabel(size)
    grid[1, 0].set_ylabel("phase [°]")
    grid[0, -1].legend(loc="upper right")


def convergence(found: Identification) -> Figure:
    """Cost over the search's evaluations, and what the data pay for another mode, a row for each axis."""
    names = [str(axis) for axis in found.axes]
    counted = any(step.stage is Stage.MODES for step in found.trace)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 2.5 * len(names) + 0.4), layout="constrained")
        grid = figure.subplots(len(names), 2 if counted else 1, squeeze=False, width_ratios=(1.9, 1.0) if counted else (1.0,))
        for row, name in zip(grid, names, strict=True):
            own = [step for step in found.trace if step.axis in (name, BOTH)]
            _costs(row[0], [step for step in own if step.stage is not Stage.MODES], name.upper())
            if counted:
                _evidence(row[1], [step for step in own if step.stage is Stage.MODES], name.upper())
        grid[-1, 0].set_xlabel("evaluation")
        handles: dict[str, Artist] = {}
        for row in grid:
            handles |= {str(line.get_label()): line for line in row[0].get_lines() if not str(line.get_label()).startswith("_")}
        figure.legend(list(handles.values()), list(handles), loc="outside lower center", ncols=3)
    return figure


def _costs(ax: Axes, trace: Sequence[Step], name: str) -> None:
    cost = np.array([step.cost for step in trace])
    number = np.arange(1, cost.size + 1)
    for stage, (label, colour) in STAGES.items():
        # thousands of generations look the same as hundreds of them
        chosen = [i for i, step in enumerate(trace) if step.stage is stage and np.isfinite(cost[i])]
        chosen = chosen[:: max(1, len(chosen) // 400)]
        if chosen:
            ax.plot(number[chosen], cost[chosen], "o", ms=3.5, color=colour, label=label)
    searched = [i for i, step in enumerate(trace) if step.stage is Stage.SEARCH]
    if searched:
        ax.plot(number[searched], np.minimum.accumulate(cost[searched]), color="#52606d", lw=1.2, label="best so far")
    if cost.size and np.nanmin(cost) > 0.0:
        ax.set_yscale("log")
    ax.set_title(f"{name}: search")
    ax.set_ylabel("cost [–]")


def _evidence(ax: Axes, trace: Sequence[Step], name: str) -> None:
    best: dict[int, float] = {}
    for step in trace:
        best[step.modes] = min(step.cost, best.get(step.modes, np.inf))
    counts = sorted(best)
    lowest = min(best.values(), default=0.0)
    ax.plot(counts, [best[c] - lowest for c in counts], "o-", color=COLOURS.get(name, TRUTH), ms=4.0)
    ax.set_yscale("symlog", linthresh=10.0)
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    ax.set_title(f"{name}: number of modes")
    ax.set_ylabel("–2 ln evidence, above best")
    ax.set_xlabel("modes")


def tooltip_frf(
    frequency: FloatArray,
    tip: Mapping[str, ComplexArray],
    deviation: Mapping[str, tuple[FloatArray, FloatArray]],
    truth: Mapping[str, ComplexArray] | None = None,
    band_hz: tuple[float, float] | None = None,
) -> Figure:
    """Tooltip receptance C11, magnitude and real part, a column for each axis and one for what is across, with 2 standard deviations.

    `frequency` [Hz], shape (n,)
    `tip`: mapping of X, Y, Z, XY (motion in X under a force in Y) and the like to complex array, shape (n,) [m/N]
    `deviation`: mapping of the same names to (real, imaginary) standard deviations [m/N]
    `truth`: mapping of the same names to complex array, shape (n,) [m/N]; the true one, where it is known
    `band_hz`: (low, high) [Hz]; band that was identified; what lies outside is shaded
    """
    columns = list(dict.fromkeys("across" if len(name) > 1 else name for name in tip))
    reversed_ = {name: name[::-1] for name in tip if name < name[::-1] in tip}
    alike = {a: b for a, b in reversed_.items() if np.allclose(tip[a], tip[b], rtol=0.0, atol=1e-6 * float(np.max(np.abs(tip[a]))))}
    figure, grid = figure_grid(2, len(columns), 4.8, (1.3, 1.0))
    with mpl.rc_context(STYLE):
        for axis, value in tip.items():
            if axis in alike.values():
                continue
            column = columns.index("across" if len(axis) > 1 else axis)
            top, bottom = grid[:, column]
            name = f"{axis} = {alike[axis]}" if axis in alike else axis
            size, real = 1e6 * np.abs(value), 1e6 * value.real
            if axis in deviation:
                std_real, std_imaginary = (1e6 * d for d in deviation[axis])
                unit = value / np.abs(value)
                std_size = np.hypot(std_real * unit.real, std_imaginary * unit.imag)
                low = np.maximum(size - 2.0 * std_size, 1e-3 * size)
                band = "± 2 σ" if len(axis) == 1 else None
                top.fill_between(frequency, low, size + 2.0 * std_size, color=COLOURS[axis], alpha=0.3, lw=0, label=band)
                bottom.fill_between(frequency, real - 2.0 * std_real, real + 2.0 * std_real, color=COLOURS[axis], alpha=0.3, lw=0)
            top.plot(frequency, size, color=COLOURS[axis], label=name if len(axis) > 1 else "predicted")
            bottom.plot(frequency, real, color=COLOURS[axis])
            if truth is not None and axis in truth:
                top.plot(frequency, 1e6 * np.abs(truth[axis]), "--", color=TRUTH, lw=1.1, label="true" if len(axis) == 1 else None)
                bottom.plot(frequency, 1e6 * truth[axis].real, "--", color=TRUTH, lw=1.1)
            top.set_yscale("log")
        for (top, bottom), name in zip(grid.T, columns, strict=True):
            for ax in (top, bottom):
                _shade_outside(ax, frequency, band_hz, name != "across")
            top.set_title("motion across the force" if name == "across" else f"{name}: tooltip")
            # receptances fall with frequency: that corner is free, and what is across is smaller everywhere
            top.legend(loc="upper right" if name == "across" else "lower left")
            bottom.set_xlabel("frequency [Hz]")
            bottom.set_xscale("log" if wide(frequency) else "linear")
            bottom.set_xlim(frequency[frequency > 0.0][0], frequency[-1])
        # the curves set the scale, not what is unknown outside the band
        all_sizes = 1e6 * np.abs(np.concatenate(list(tip.values())))
        all_real = 1e6 * np.concatenate(list(tip.values())).real
        reach = 0.08 * float(np.ptp(all_real))
        least = max(0.5 * float(np.min(all_sizes)), _LEAST_SHOWN * float(np.max(all_sizes)) * ("across" in columns))
        grid[0, 0].set_ylim(least, 2.0 * float(np.max(all_sizes)))
        grid[1, 0].set_ylim(float(np.min(all_real)) - reach, float(np.max(all_real)) + reach)
        grid[0, 0].set_ylabel("|C11|  [µm/N]")
        grid[1, 0].set_ylabel("real part [µm/N]")
    return figure


def _shade_outside(ax: Axes, frequency: FloatArray, band_hz: tuple[float, float] | None, named: bool = True) -> None:
    for start, end in () if band_hz is None else ((frequency[0], band_hz[0]), (band_hz[1], frequency[-1])):
        if start < end:
            ax.axvspan(start, end, color="#52606d", alpha=0.10, lw=0, label="outside the identified band" if named else None)
