"""A figure of a receptance from hammer hits: magnitude with its band, phase, and coherence where there is one."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from rcsa_ident.base.units import to_hz
from rcsa_ident.report.style import COLOURS, STYLE
from rcsa_ident.signals.tap import TapFrf


def tap_figure(found: TapFrf) -> Figure:
    """Draw a receptance from hammer hits over frequency."""
    axis, rows = found.axis, 2 if found.coherence is None else 3
    frequency, size = to_hz(found.omega), np.abs(found.receptance)
    band = 2.0 * np.sqrt(found.variance)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(8.0, 2.2 + 1.7 * rows), layout="constrained")
        top, *others = figure.subplots(rows, 1, sharex=True, height_ratios=(2.0, 1.0, 1.0)[:rows])
        top.fill_between(frequency, 1e6 * np.maximum(size - band, 1e-3 * size), 1e6 * (size + band), color=COLOURS[axis], alpha=0.2, lw=0.0)
        top.semilogy(frequency, 1e6 * size, color=COLOURS[axis], lw=1.0)
        top.set(ylabel="|H| [µm/N]", title=f"receptance {axis} from {found.used} of {len(found.hits)} hits, ± 2 standard deviations")
        others[0].plot(frequency, np.degrees(np.angle(found.receptance)), color=COLOURS[axis], lw=0.8)
        others[0].set(ylabel="phase [°]", yticks=[-180, -90, 0, 90, 180])
        if found.coherence is not None:
            others[1].plot(frequency, found.coherence, color="#52606d", lw=0.8)
            others[1].set(ylabel="coherence [-]", ylim=(0.0, 1.02))
        others[-1].set(xlabel="frequency [Hz]", xlim=(0.0, float(frequency[-1])))
    return figure
