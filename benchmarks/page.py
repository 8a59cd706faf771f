"""Where the studies leave what they found: lines of JSON, and blocks and pictures of ``docs/study.md``."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

DOCS = Path(__file__).resolve().parent.parent / "docs"
PAGE = DOCS / "study.md"
MARKS = {"trigger": "^", "no-trigger": "o", "noise-x3": "x"}


def read_rows(path: Path) -> list[dict[str, Any]]:
    """Return the rows of a file of results; a last line that an interruption cut short is left out."""
    rows = []
    for text in path.read_text(encoding="utf-8").splitlines() if path.exists() else []:
        try:
            rows.append(json.loads(text))
        except json.JSONDecodeError:
            continue
    return rows


def append_row(path: Path, row: dict[str, Any]) -> None:
    """Write a row at the end of a file of results, on a line of its own."""
    whole = not path.exists() or path.read_bytes()[-1:] in (b"", b"\n")
    with path.open("a", encoding="utf-8") as file:
        file.write(("" if whole else "\n") + json.dumps(row) + "\n")


def write_rows(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    """Write a file of results anew."""
    path.write_text("".join(json.dumps(row) + "\n" for row in rows), encoding="utf-8")


def write_block(name: str, text: str, page: Path = PAGE) -> None:
    """Replace what stands between the page's two marks of this name."""
    begin, end = f"<!-- {name}: written by python -m benchmarks -->", f"<!-- end of {name} -->"
    content = page.read_text(encoding="utf-8")
    pattern = re.compile(f"{re.escape(begin)}.*?{re.escape(end)}", re.DOTALL)
    if len(pattern.findall(content)) != 1:
        raise ValueError(f"{page} has no single block {begin} ... {end}")
    page.write_text(pattern.sub(lambda _: f"{begin}\n\n{text.rstrip()}\n\n{end}", content), encoding="utf-8")


def draw_study(rows: Sequence[dict[str, Any]], path: Path = DOCS / "study.png") -> None:
    """Draw the default method's tooltip errors, machine by machine, X and Y."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    shown = [r for r in rows if r["method"] == "default"]
    machines = list(dict.fromkeys(r["machine"] for r in shown))
    figure, panels = plt.subplots(1, 2, figsize=(10.0, 4.2), sharey=True, layout="constrained")
    for panel, (kind, aim) in zip(panels, (("similar", 0.01), ("different", 0.025)), strict=True):
        for shift, (condition, mark) in zip((-0.2, 0.0, 0.2), MARKS.items(), strict=True):
            members = [r for r in shown if r["condition"] == condition]
            for status, colour in (("converged", "tab:blue"), ("suspect", "tab:red"), ("failed", "black")):
                points = [(machines.index(r["machine"]) + shift, e) for r in members if r["status"] == status for e in r[kind]["errors"]]
                x, y = np.array(points).reshape(-1, 2).T
                panel.plot(x, y, mark, color=colour, fillstyle="none", label=f"{condition}, {status}" if points else None)
        panel.axhline(aim, color="grey", linestyle="--", linewidth=1.0)
        panel.set_yscale("log")
        panel.set_xticks(range(len(machines)), machines)
        panel.set_xlabel("machine")
        panel.set_title(f"{kind} holder (dashed: aim for the median, {aim:g})")
        panel.grid(alpha=0.3)
    panels[0].set_ylabel(r"$\|\Delta C_{11}\| / \|C_{11}\|$, X and Y")
    handles = {label: h for panel in panels for h, label in zip(*panel.get_legend_handles_labels(), strict=True)}
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=3, frameon=False)
    figure.savefig(path, dpi=100)
    plt.close(figure)


def draw_searches(rows: Sequence[dict[str, Any]], path: Path = DOCS / "search_trace.png") -> None:
    """Draw misfit and error on the different holder over time."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    machines = list(dict.fromkeys(r["machine"] for r in rows))
    methods = list(dict.fromkeys(r["method"] for r in rows))
    figure, panels = plt.subplots(2, len(machines), figsize=(11.0, 6.8), sharex=True, sharey="row", squeeze=False, layout="constrained")
    for row in rows:
        time, _, misfit, _, different = np.array(row["points"]).T
        column = machines.index(row["machine"])
        colour = f"C{methods.index(row['method'])}"
        for panel, values in zip(panels[:, column], (misfit, different), strict=True):
            panel.plot(time, values, drawstyle="steps-post", color=colour, linewidth=1.2, alpha=0.8)
            panel.plot(time[-1], values[-1], "o", color=colour, markersize=5)
    for panel in panels.flat:
        panel.set_xscale("log")
        panel.set_yscale("log")
        panel.grid(alpha=0.3)
    for column, machine in enumerate(machines):
        panels[0, column].set_title(f"machine {machine}")
        panels[1, column].set_xlabel("processor time [s]")
    panels[0, 0].set_ylabel("mean squared residual at 2 % of each line")
    panels[1, 0].set_ylabel(r"$\|\Delta C_{11}\| / \|C_{11}\|$, different holder, X")
    handles = [plt.Line2D([], [], color=f"C{i}", label=method) for i, method in enumerate(methods)]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(methods), frameon=False)
    figure.savefig(path, dpi=100)
    plt.close(figure)
