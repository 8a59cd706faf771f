"""Figures of receptances of any kind, and of the channels of a recording."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import to_hz
from rcsa_ident.dynamics.coordinates import Coordinate
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.dynamics.uncertain import UncertainReceptance
from rcsa_ident.report.figures import tooltip_frf
from rcsa_ident.report.style import COLOURS, CURVES, STYLE, figure_grid, letters, wide, without_jumps
from rcsa_ident.report.summaries import entries_of
from rcsa_ident.signals.recording import Quantity, Recording
from rcsa_ident.stability.tip_modes import TIP

#: Frequencies of a figure, at most about twice as many.
MOST_LINES = 600
#: What an axis of time is called, and what a channel is multiplied by for it.
_UNITS = {
    Quantity.DISPLACEMENT: ("displacement [µm]", 1e6),
    Quantity.ACCELERATION: ("acceleration [m/s²]", 1.0),
    Quantity.FORCE: ("force [N]", 1.0),
    Quantity.TRIGGER: ("trigger [–]", 1.0),
}
Deviation = dict[tuple[Coordinate, Coordinate], tuple[FloatArray, FloatArray]]


def tip_figure(tip: Receptance, band: tuple[float, float] | None = None) -> Figure:
    """The tooltip FRFs of both directions and those across, with two standard deviations where a spread is known.

    `band`: (float, float) [rad/s]; in which the machine is known; outside is shaded
    """
    tip = _thinned(tip)
    deviation = _deviation(tip)
    entries = entries_of(tip, [c for c in tip.rows if not c.dof.is_slope])
    return tooltip_frf(
        to_hz(tip.omega),
        {name: tip.between(str(row), str(col)) for name, (row, col) in entries.items()},
        {name: deviation[pair] for name, pair in entries.items() if pair in deviation},
        band_hz=None if band is None else (to_hz(band[0]), to_hz(band[1])),
    )


def is_tip(receptance: Receptance) -> bool:
    """Tell whether a receptance is that of a tip alone, direction by direction."""
    return receptance.rows == receptance.cols and all(c in TIP for c in receptance.rows)


def receptance_figure(receptance: Receptance, slopes: bool = False) -> Figure:
    """Magnitude and phase of a receptance, a column for each direction of the force, with two standard deviations where they are known.

    `slopes`: slopes over moments in place of displacements over forces
    """
    forces = [c for c in receptance.cols if c.dof.is_slope is slopes]
    if not forces:
        raise InputError("receptance", "no moments" if slopes else "no forces", "coordinates of that kind")
    receptance = _thinned(receptance)
    deviation, frequency = _deviation(receptance), to_hz(receptance.omega)
    figure, grid = figure_grid(2, len(forces), 4.6, (1.6, 1.0))
    unit, scale = ("rad/(N m)", 1.0) if slopes else ("µm/N", 1e6)
    sizes: list[FloatArray] = []
    with mpl.rc_context(STYLE):
        for column, force in enumerate(forces):
            top, bottom = grid[:, column]
            moved = [c for c in receptance.rows if c.dof.is_slope is slopes and np.any(receptance.between(str(c), str(force)))]
            for motion, colour in zip(moved, CURVES, strict=False):
                value = scale * receptance.between(str(motion), str(force))
                size = np.abs(value)
                if (motion, force) in deviation:
                    real, imaginary = (scale * part for part in deviation[motion, force])
                    across = np.hypot(real * value.real, imaginary * value.imag) / np.maximum(size, 1e-300)
                    low, high = np.maximum(size - 2.0 * across, 1e-3 * size), size + 2.0 * across
                    top.fill_between(frequency, low, high, color=colour, alpha=0.3, lw=0)
                top.plot(frequency, size, color=colour, label=str(motion))
                sizes.append(size)
                bottom.plot(frequency, without_jumps(np.degrees(np.angle(value))), color=colour)
            top.set_yscale("log")
            top.set_title(f"{'moment' if slopes else 'force'} at {force}", parse_math=False)
            top.legend(loc="best")
            bottom.set_ylim(-190.0, 190.0)
            bottom.set_yticks([-180, -90, 0, 90, 180])
            bottom.set_xlabel("frequency [Hz]")
            bottom.set_xlim(frequency[0], frequency[-1])
        # the curves set the scale, not what is not known of them
        grid[0, 0].set_ylim(0.5 * float(np.min(sizes)), 2.0 * float(np.max(sizes)))
        grid[0, 0].set_ylabel(f"|H|  [{unit}]")
        grid[1, 0].set_ylabel("phase [°]")
    return figure


def _thinned(receptance: Receptance) -> Receptance:
    """The same at no more frequencies than an eye resolves."""
    omega = receptance.omega
    places = np.arange(0, omega.size, max(omega.size // MOST_LINES, 1))
    if wide(omega):
        places = np.unique(np.searchsorted(omega, np.geomspace(max(omega[0], 1e-6 * omega[-1]), omega[-1], 2 * MOST_LINES)))
    if isinstance(receptance, UncertainReceptance):
        return receptance.at_places(places)
    return Receptance(receptance.omega[places], receptance.values[places], receptance.rows, receptance.cols)


def _deviation(receptance: Receptance) -> Deviation:
    return receptance.deviation() if isinstance(receptance, UncertainReceptance) else {}


def recording_figure(recording: Recording, seconds: float = 0.05, start: float | None = None) -> Figure:
    """A stretch of a recording, the channels of each quantity in a panel.

    `seconds` [s]: that are drawn
    `start` [s]: time of the first sample; by default they lie in the middle
    """
    time = recording.time
    start = max(0.5 * (time[-1] - seconds), 0.0) if start is None else start
    shown = (time >= start) & (time <= start + seconds)
    quantities = [quantity for quantity in Quantity if any(sensor.quantity is quantity for sensor in recording.sensors)]
    figure, grid = figure_grid(len(quantities), 1, 0.8 + 1.9 * len(quantities), sharey="none")
    with mpl.rc_context(STYLE):
        for quantity, ax in zip(quantities, grid[:, 0], strict=True):
            name, scale = _UNITS[quantity]
            for i, sensor in enumerate(recording.sensors):
                if sensor.quantity is quantity:
                    colour = COLOURS.get(str(sensor.axis or "").upper(), "#52606d")
                    ax.plot(time[shown], scale * recording.samples[shown, i], color=colour, lw=1.0, label=letters(sensor.name))
            ax.set_ylabel(name)
            ax.legend(loc="upper right", ncols=3)
        grid[-1, 0].set_xlabel("time [s]")
    return figure
