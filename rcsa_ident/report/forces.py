"""Figures of the force observer: forces over time with their bands, and what the observer does to each frequency."""

from __future__ import annotations

from collections.abc import Mapping

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.units import to_hz
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.observer.force import ForceEstimate
from rcsa_ident.observer.response import FLAT, ObserverFRF, decibel
from rcsa_ident.report.style import COLOURS, STYLE, TRUTH, figure_grid


def force_history(
    estimate: ForceEstimate, spindle_speed: float, revolutions: float = 3.0, start: float | None = None, true: FloatArray | None = None
) -> Figure:
    """Draw a few revolutions of the estimated force, a panel for each axis, with two standard deviations.

    `spindle_speed` [rad/s]
    `start` [s]: time of the first one drawn; by default they lie in the middle of the forces
    `true` [N], shape (n, a): a measured or simulated force, with or without its mean as the estimate
    """
    time = estimate.time
    length = revolutions * 2.0 * np.pi / spindle_speed
    start = max(0.5 * (time[0] + time[-1] - length), time[0]) if start is None else start
    shown = (time >= start) & (time <= start + length)
    figure, grid = figure_grid(len(estimate.axes), 1, 1.2 + 2.2 * len(estimate.axes), sharey="none")
    with mpl.rc_context(STYLE):
        for i, (axis, ax) in enumerate(zip(estimate.axes, grid[:, 0], strict=True)):
            name, milliseconds = axis.upper(), 1e3 * (time[shown] - start)
            force, band = estimate.force[shown, i], 2.0 * estimate.standard_deviation[shown, i]
            colour = COLOURS[name]
            ax.fill_between(milliseconds, force - band, force + band, color=colour, alpha=0.2, lw=0.0, label="± 2 standard deviations")
            if true is not None:
                ax.plot(milliseconds, true[shown, i], color=TRUTH, lw=1.0, ls="--", label="true")
            ax.plot(milliseconds, force, color=colour, label="estimated")
            ax.set_ylabel(f"force {name} [N]")
            ax.set_title(f"{name}: {revolutions:g} revolutions from {start:.3f} s")
        grid[0, 0].legend(loc="upper right", ncols=3)
        grid[-1, 0].set_xlabel("time [ms]")
    return figure


def observer_frf(responses: Mapping[Dof, ObserverFRF], band: tuple[float, float]) -> Figure:
    """Draw each axis' observer (displacement to force) and the compensated response with the band of 1 dB, both in dB.

    `band`: two floats [rad/s], frequencies between which forces are estimated; outside is shaded
    """
    figure, grid = figure_grid(2, len(responses), 5.2, (1.0, 1.0))
    with mpl.rc_context(STYLE):
        for column, (axis, response) in enumerate(responses.items()):
            name, frequency = axis.upper(), to_hz(response.omega)
            top, bottom = grid[:, column]
            # a newton per micrometre is the size of these machines
            top.plot(frequency, decibel(response.observer) - 120.0, color=COLOURS[name])
            top.set_title(f"{name}: observer, displacement to force")
            bottom.axhspan(-FLAT, FLAT, color="#009E73", alpha=0.15, lw=0.0, label=f"± {FLAT:g} dB")
            bottom.plot(frequency, response.level, color=COLOURS[name], lw=1.0, label="any frequency")
            if response.line.size:
                bottom.plot(
                    to_hz(response.line),
                    decibel(response.at_line),
                    "o",
                    ms=4.0,
                    color=TRUTH,
                    mfc="none",
                    label="spindle's orders",
                )
            bottom.set_title(f"{name}: compensated, force to estimate")
            bottom.set_ylim(-12.0, 6.0)
            bottom.set_xlabel("frequency [Hz]")
            for ax in (top, bottom):
                low, high = (to_hz(w) for w in band)
                ax.set_xlim(frequency[0], frequency[-1])
                ax.axvspan(frequency[0], low, color="#9aa5b1", alpha=0.2, lw=0.0)
                ax.axvspan(high, frequency[-1], color="#9aa5b1", alpha=0.2, lw=0.0)
        grid[0, 0].set_ylabel("|F / x|  [dB re 1 N/µm]")
        grid[1, 0].set_ylabel("|F estimate / F|  [dB]")
        grid[1, 0].legend(loc="upper right", ncols=3)
    return figure
