"""``python -m benchmarks physics_pictures``: draw pictures of ``docs/physics``: immersion, coupling, waves of teeth."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

FOLDER = Path(__file__).resolve().parent.parent / "docs" / "physics"
_BLUE, _RED, _GREY = "#1f5fa8", "#b3392b", "#8a8f96"


def _figure(width: float, height: float) -> tuple[Any, Any]:
    import matplotlib

    matplotlib.use("Agg")
    # equal pictures are equal files
    matplotlib.rcParams |= {"svg.hashsalt": "rcsa-ident", "svg.fonttype": "path", "font.size": 9.0}
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(width, height), layout="constrained")
    axes.set_aspect("equal")
    axes.axis("off")
    return figure, axes


def _arrow(axes: Any, start: tuple[float, float], end: tuple[float, float], colour: str = "black") -> None:
    axes.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": colour, "shrinkA": 0, "shrinkB": 0})


def immersion(path: Path) -> None:
    """Draw half-immersion down-milling seen from the spindle: feed x, normal y, immersion clockwise from y."""
    figure, axes = _figure(5.2, 3.9)
    # the tool moves along x: material is ahead, and below the wall that it leaves beside the path
    corner = np.radians(np.linspace(90.0, 180.0, 60))
    arc = np.stack([np.sin(corner), np.cos(corner)])
    outline = np.concatenate([arc, [[0.0, 2.1, 2.1], [-1.0, -1.0, 0.0]]], axis=1)
    axes.fill(*outline, color="#d9dde2", lw=0.0)
    turn = np.linspace(0.0, 2.0 * np.pi, 200)
    axes.plot(np.sin(turn), np.cos(turn), color="black", lw=1.2)
    axes.plot(*arc, color=_BLUE, lw=3.0)
    for phi in np.radians([20.0, 140.0, 260.0]):
        axes.plot([0.0, np.sin(phi)], [0.0, np.cos(phi)], color=_GREY, lw=0.8)
        axes.plot(np.sin(phi), np.cos(phi), "o", color="black", markersize=4)
    _arrow(axes, (0.0, 0.0), (1.75, 0.0))
    _arrow(axes, (0.0, 0.0), (0.0, 1.45))
    axes.text(1.78, 0.06, "$x$, feed")
    axes.text(0.05, 1.4, "$y$, normal")
    swept = np.linspace(0.0, np.radians(140.0), 60)
    axes.plot(0.45 * np.sin(swept), 0.45 * np.cos(swept), color=_RED, lw=1.2)
    _arrow(axes, (0.45 * np.sin(swept[-4]), 0.45 * np.cos(swept[-4])), (0.45 * np.sin(swept[-1]), 0.45 * np.cos(swept[-1])), _RED)
    axes.text(0.5, 0.22, r"$\varphi$", color=_RED, fontsize=12)
    axes.text(1.06, 0.08, r"$\varphi_{entry}=90°$", color=_BLUE)
    axes.text(-0.2, -1.2, r"$\varphi_{exit}=180°$", color=_BLUE)
    axes.text(1.25, -0.55, "material")
    tooth = np.radians(140.0)
    place = np.array([np.sin(tooth), np.cos(tooth)])
    tangent = np.array([-np.cos(tooth), np.sin(tooth)])
    for direction, name in ((0.55 * tangent, "$F_t$"), (-0.55 * place, "$F_r$")):
        _arrow(axes, tuple(place), tuple(place + direction), _RED)
        axes.text(*(place + 1.12 * direction), name, color=_RED)
    axes.set_xlim(-1.2, 2.5)
    axes.set_ylim(-1.35, 1.6)
    figure.savefig(path, metadata={"Date": None})


def coupling(path: Path) -> None:
    """Draw tool-holder, joint and spindle with the points 1, 2 and 3."""
    figure, axes = _figure(6.4, 2.3)
    parts = (
        ((0.0, 1.6), 0.24, "tool"),
        ((1.6, 2.6), 0.62, "holder"),
        ((2.6, 3.0), 0.9, ""),
        ((3.6, 4.0), 0.9, ""),
        ((4.0, 6.0), 0.7, "spindle"),
    )
    for (left, right), height, name in parts:
        axes.fill([left, right, right, left], [-height / 2, -height / 2, height / 2, height / 2], color="#d9dde2", ec="black", lw=0.8)
        axes.text(0.5 * (left + right), 0.0, name, ha="center", va="center")
    for y in (0.3, -0.3):
        x = np.linspace(3.0, 3.6, 9)
        axes.plot(x, y + 0.06 * np.array([0, 0, 1, -1, 1, -1, 1, 0, 0]), color=_BLUE, lw=1.2)
    axes.text(3.3, 0.45, r"$\mathbf{K}$", color=_BLUE, ha="center")
    for x in (4.5, 5.6):
        for side in (1.0, -1.0):
            axes.plot([x, x], [side * 0.35, side * 0.6], color="black", lw=0.8)
            axes.plot([x - 0.15, x + 0.15], [side * 0.6] * 2, color="black", lw=1.5)
    for x, name in ((0.0, "1"), (3.0, "2"), (3.6, "3")):
        axes.plot(x, 0.0, "o", color=_RED, markersize=5)
        axes.text(x - 0.02, -0.62, name, color=_RED, ha="center", fontsize=11)
    for left, right, name in ((0.0, 3.0, r"$\mathbf{A}$"), (3.6, 6.0, r"$\mathbf{B}$")):
        axes.annotate("", (right, 0.8), (left, 0.8), arrowprops={"arrowstyle": "<->", "color": _GREY})
        axes.text(0.5 * (left + right), 0.84, name, ha="center")
    _arrow(axes, (0.0, 0.55), (0.0, 0.14), _RED)
    axes.text(-0.3, 0.42, "$F$", color=_RED)
    _arrow(axes, (0.25, -0.8), (1.15, -0.8))
    axes.text(1.2, -0.85, "$z$")
    axes.set_xlim(-0.4, 6.1)
    axes.set_ylim(-0.95, 1.05)
    figure.savefig(path, metadata={"Date": None})


def regeneration(path: Path) -> None:
    """Draw the waves that two teeth leave, in phase and out of it, and the chip between them."""
    figure, axes = _figure(6.4, 2.1)
    along = np.linspace(0.0, 6.0, 91)
    for left, phase, name in ((0.0, 0.0, "in phase: the chip is even"), (7.0, np.pi, "out of phase: it is not")):
        new, old = 0.16 * np.sin(2.0 * np.pi * along / 2.0), 0.55 + 0.16 * np.sin(2.0 * np.pi * along / 2.0 + phase)
        axes.fill_between(left + along, new, old, color="#d9dde2")
        axes.plot(left + along, old, color=_GREY, lw=1.2)
        axes.plot(left + along, new, color=_BLUE, lw=1.6)
        axes.text(left + 3.0, -0.75, name, ha="center")
        middle = left + 2.5
        thick = float(np.interp(middle - left, along, old - new))
        low = float(np.interp(middle - left, along, new))
        axes.annotate("", (middle, low + thick), (middle, low), arrowprops={"arrowstyle": "<->", "color": _RED, "shrinkA": 0, "shrinkB": 0})
        axes.text(middle + 0.12, low + 0.3 * thick, "$h$", color=_RED)
    axes.text(-0.15, 0.62, "tooth before", color=_GREY, ha="right", va="center")
    axes.text(-0.15, 0.0, "this tooth", color=_BLUE, ha="right", va="center")
    axes.set_xlim(-2.6, 13.2)
    axes.set_ylim(-1.0, 1.1)
    figure.savefig(path, metadata={"Date": None})


def main(arguments: list[str]) -> None:
    """Draw them."""
    parser = argparse.ArgumentParser(prog="benchmarks physics_pictures", description=__doc__)
    parser.add_argument("--out", type=Path, default=FOLDER)
    out = parser.parse_args(arguments).out
    for draw in (immersion, coupling, regeneration):
        draw(out / f"{draw.__name__}.svg")
        print(f"written: {out / draw.__name__}.svg")
