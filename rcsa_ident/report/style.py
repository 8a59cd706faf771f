"""What all figures share: palette, style, grid of axes, and the way from a figure to text."""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from rcsa_ident.base.arrays import FloatArray

#: Distinct for colour-blind readers, too (Okabe & Ito), and dark enough on white.
COLOURS = {
    "X": "#0072B2", "Y": "#C8501A", "Z": "#5D4FA2",
    "XY": "#009E73", "YX": "#AA4499", "XZ": "#B8860B", "ZX": "#7F3C00", "YZ": "#56B4E9", "ZY": "#1F2933",
}  # fmt: skip
#: Lines of curves that are compared.
CURVES = ("#0072B2", "#C8501A", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#1f2933")
TRUTH = "#1f2933"
GREY, GREEN, RED = "#52606d", "#00704f", "#a33f12"
#: Highest over lowest frequency, above which the scale is logarithmic.
_WIDE = 200.0
STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans", "Arial", "Helvetica"],
    "font.size": 10.0,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#52606d",
    "axes.labelcolor": "#1f2933",
    "grid.color": "#e4e7eb",
    "xtick.color": "#52606d",
    "ytick.color": "#52606d",
    "legend.frameon": False,
    "legend.fontsize": 9.0,
    "lines.linewidth": 1.5,
    "path.simplify_threshold": 0.3,
}


def svg(figure: Figure, name: str) -> str:
    """Return the figure as an SVG element for a page.

    `name`: prefix of its ids, which a page with several figures needs to be different; the same figure gives the same text
    """
    text = io.StringIO()
    with mpl.rc_context({**STYLE, "svg.hashsalt": name}):
        figure.savefig(text, format="svg", transparent=True, metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
    content = text.getvalue()
    content = content[content.index("<svg") :]
    content = re.sub(r'\bid="', f'id="{name}-', content)
    content = re.sub(r'(url\(#|href="#)', rf"\g<1>{name}-", content)
    # the page sets the width, the view box keeps the shape
    content = re.sub(r'<svg ([^>]*?)width="[^"]*"', r"<svg \1", content, count=1)
    content = re.sub(r'<svg ([^>]*?)height="[^"]*"', r"<svg \1", content, count=1)
    # a hundredth of a point is below what an eye resolves
    content = re.sub(r"(\d\.\d\d)\d+", r"\1", content)
    return re.sub(r"<metadata>.*?</metadata>\s*", "", content, flags=re.DOTALL)


def letters(name: str) -> str:
    """Return a label that shows a name letter by letter: matplotlib takes what stands between two dollar signs for a formula."""
    return name.replace("$", r"\$")


def figure_grid(
    rows: int, cols: int, height: float, ratios: Sequence[float] | None = None, sharey: Literal["row", "none"] = "row"
) -> tuple[Figure, np.ndarray]:
    """Return a figure as wide as a page and its axes over one abscissa, shape (rows, cols)."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.6, height), layout="constrained")
        axes = figure.subplots(rows, cols, sharex=True, sharey=sharey, squeeze=False, height_ratios=ratios)
    return figure, axes


def without_jumps(degrees: FloatArray) -> FloatArray:
    """Break the line where the phase wraps."""
    broken = degrees.copy()
    broken[1:][np.abs(np.diff(degrees)) > 180.0] = np.nan
    return broken


def wide(frequency: FloatArray) -> bool:
    """Say whether a scale in proportion would leave no room for the lowest modes: an arm's stand two decades below the tool's."""
    return bool(frequency[-1] > _WIDE * frequency[0])
