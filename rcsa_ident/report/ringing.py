"""A figure of what a ring told of a tooling: lines beside the modes as drawn and as learned, unknowns before and after."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from rcsa_ident.base.units import to_hz
from rcsa_ident.identification.ring.ringing import UNKNOWNS, RungTooling
from rcsa_ident.report.style import COLOURS, STYLE
from rcsa_ident.tool_holder.free_modes import Motion

_PRIOR, _AFTER = "#9aa5b1", "#009E73"


def ring_figure(found: RungTooling) -> Figure:
    """Draw what a ring told: lines beside the modes as drawn and as learned, unknowns before and after."""
    known = [line for line in found.lines if line.mode is not None and line.mode.motion is Motion.BENDING and line.after is not None]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(8.4, 3.2 + 0.3 * len(UNKNOWNS)), layout="constrained")
        top, bottom = figure.subplots(2, 1, height_ratios=(1.0, 2.0))
        figure.suptitle(f"{found.after.name}: what its ring tells", fontsize=11, fontweight="bold")
        for i, line in enumerate(known):
            assert line.mode is not None
            assert line.after is not None
            away = 100.0 * np.log(np.array([line.mode.omega, line.after]) / line.heard.omega)
            top.plot(away[0], i, "o", color=_PRIOR, label="drawn" if i == 0 else None)
            top.plot(away[1], i, "o", color=_AFTER, label="learned" if i == 0 else None)
        names = [f"{'tool alone' if line.bare else 'tooling'}, {line.mode}, {to_hz(line.heard.omega):.0f} Hz" for line in known]
        top.axvline(0.0, color=COLOURS["X"], lw=1.0)
        top.set(yticks=range(len(names)), yticklabels=names, ylim=(-0.6, len(names) - 0.4), xlabel="computed over heard, minus 1 [%]")
        if known:
            top.legend(loc="best")
        free = [i for i, std in enumerate(found.prior_std) if std > 0.0]
        share, left = found.mean[free] / found.prior_std[free], found.std[free] / found.prior_std[free]
        rows = np.arange(len(free))
        bottom.barh(rows, 2.0, left=-1.0, height=0.7, color=_PRIOR, alpha=0.35, label="believed before, ± 1 standard deviation")
        bottom.errorbar(share, rows, xerr=left, fmt="o", color=_AFTER, capsize=3, label="after")
        bottom.set(
            yticks=rows,
            yticklabels=[UNKNOWNS[i].replace("_", " ") for i in free],
            xlabel="difference from the drawing [its standard deviations]",
        )
        bottom.invert_yaxis()
        bottom.legend(loc="best")
    return figure
