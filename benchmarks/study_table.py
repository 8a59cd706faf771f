"""What the study found, as Markdown: median and worst, bands, status against the truth, and every run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks.machines import CONDITIONS, drawn, is_coupled
from rcsa_ident.base.arrays import FloatArray

#: Aims for toolings that never cut, and what no run that calls itself converged may exceed.
AIMS, WORST = {"similar": 0.01, "different": 0.025}, 0.05
#: The same of coupled machines: medians, the worst of toolings that never cut, cross terms over their own norm.
COUPLED_AIMS = {"cut": 0.005, "similar": 0.01, "different": 0.015}
COUPLED_WORST, CROSS_AIM = {"similar": 0.02, "different": 0.04}, 0.05


def line(row: dict[str, Any]) -> str:
    """Return a run in one line."""
    errors = "  ".join(f"{kind} {row[kind]['errors'][0]:.4f} {row[kind]['errors'][1]:.4f}" for kind in AIMS)
    if "cross" in row["similar"]:
        errors += "  XY over direct, over own " + "  ".join(f"{max(row[kind][n]):.4f}" for kind in AIMS for n in ("cross", "cross_own"))
    bands = ""
    if row["similar"]["bands"]:
        bands = "  90 % band " + " ".join(f"{100 * row[kind]['bands']['90']:.0f}" for kind in ("cut", *AIMS))
    seconds = row["seconds"]
    return (
        f"{row['machine']:>6} {row['condition']:<10} {row['method']:<32} seed {row['seed']}  {errors}{bands}  "
        f"{row['status']}  {seconds['read']:.1f} + {seconds['identify']:.1f} s"
    )


def _summary(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Median and worst of each method under each condition, drawn machines together, others each for itself."""
    lines = [
        "| machines | condition | method | runs | similar: median | worst | different: median | worst | converged | seconds "
        "| medians over the default's: similar, different, seconds |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    groups: dict[tuple[str, str, str], list[dict[str, Any]]] = {}
    for row in rows:
        machines = "drawn" if drawn(row["machine"]) else row["machine"]
        groups.setdefault((machines, row["condition"], row["method"]), []).append(row)
    for key, members in groups.items():
        cells = [*key, str(len(members))]
        for kind in AIMS:
            errors = np.array([e for row in members for e in row[kind]["errors"]])
            cells += [f"{np.median(errors):.4f}", f"{errors.max():.4f}"]
        converged = sum(row["status"] == "converged" for row in members)
        cells += [f"{converged} of {len(members)}", f"{_medians(members)[-1]:.1f}"]
        default = groups.get((*key[:2], "default"))
        ratios = _medians(members) / _medians(default) if default and default is not members else ()
        lines.append("| " + " | ".join([*cells, ", ".join(f"{ratio:.3g}" for ratio in ratios) or "-"]) + " |")
    return lines


def _medians(members: Sequence[dict[str, Any]]) -> FloatArray:
    """Of the errors of either kind, and of the seconds."""
    errors = [np.median([e for row in members for e in row[kind]["errors"]]) for kind in AIMS]
    return np.array([*errors, np.median([sum(row["seconds"].values()) for row in members])])


def _bands(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Coverage of the default method's bands, mean over the runs and the least of them."""
    lines = [
        "| condition | toolings | in the 50 % band | in the 90 % band | least of a run | rms error / deviation |",
        "|---|---|---|---|---|---|",
    ]
    for condition in CONDITIONS:
        members = [r for r in rows if r["condition"] == condition and r["method"] == "default" and _judged(r)]
        for kind in ("cut", *AIMS) if members else ():
            bands = [row[kind]["bands"] for row in members if row[kind]["bands"]]
            if not bands:
                continue
            half, most, rms = (np.array([b[name] for b in bands]) for name in ("50", "90", "rms"))
            lines.append(
                f"| {condition} | {kind} | {100 * half.mean():.0f} % | {100 * most.mean():.0f} % | {100 * most.min():.0f} % "
                f"| {np.sqrt(np.mean(rms**2)):.2f} |"
            )
    return lines


def _judged(row: dict[str, Any]) -> bool:
    """Whether a run is one of those that are judged together: the published algorithm's own machine stands for itself."""
    return drawn(row["machine"]) is not None or is_coupled(row["machine"])


def counts(rows: Sequence[dict[str, Any]]) -> dict[str, int]:
    """Return how the default method's status meets the truth: runs, converged above `WORST`, good runs, good ones called suspect."""
    members = [r for r in rows if r["method"] == "default" and _judged(r)]
    worst = [max(e for kind in AIMS for e in r[kind]["errors"]) for r in members]
    good = [all(e <= aim for kind, aim in AIMS.items() for e in r[kind]["errors"]) for r in members]
    converged = [r["status"] == "converged" for r in members]
    return {
        "runs": len(members),
        "converged above": sum(c and w > WORST for c, w in zip(converged, worst, strict=True)),
        "good": sum(good),
        "good but suspect": sum(g and not c for g, c in zip(good, converged, strict=True)),
    }


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Return the study as Markdown: summary, bands, status, and every run of the default method."""
    lines = [*_summary(rows), ""]
    number = counts(rows)
    if number["runs"]:
        lines += [*_bands(rows), ""]
        lines += [
            f"Of {number['runs']} runs of the default method, {number['converged above']} are `converged` with an error above {WORST}. "
            f"{number['good']} are good (at most {AIMS['similar']} similar and {AIMS['different']} different holder); "
            f"{number['good but suspect']} of these are called suspect.",
            "",
        ]
    return "\n".join([*lines, *_every_run(rows)]).rstrip() + "\n"


def _every_run(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Every run of the default method, and the reasons for doubt."""
    lines = [
        "| machine | condition | seed | similar X | Y | different X | Y | status | model error X | Y | modes | seconds |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    members = [row for row in rows if row["method"] == "default"]
    for row in members:
        errors = [f"{e:.4f}" for kind in AIMS for e in row[kind]["errors"]]
        shares = [f"{100 * e:.2f} %" for e in row["model_error"]]
        modes, seconds = ", ".join(str(m) for m in row["modes"]), f"{sum(row['seconds'].values()):.1f}"
        cells = [row["machine"], row["condition"], str(row["seed"]), *errors, row["status"], *shares, modes, seconds]
        lines.append("| " + " | ".join(cells) + " |")
    return [*lines, "", *_doubts(members)] if members else []


def _doubts(rows: Sequence[dict[str, Any]]) -> list[str]:
    """The reasons for `suspect`, each with the runs that it is said of."""
    said: dict[str, list[str]] = {}
    for r in rows:
        for reason in r["reasons"]:
            said.setdefault(str(reason), []).append(f"{r['machine']}, {r['condition']}")
    return [f"- {'; '.join(runs)}: {reason}" for reason, runs in said.items()]


#: What the sensors of a condition are, for people who decide what to buy.
_SENSORS = {
    "three-toolings": "displacement of the flange, and accelerometers on its fixture",
    "housing-beside": "the same, and a pair of accelerometers on the housing, 350 mm behind the flange's face",
    "housing": "accelerometers on the housing alone, level with the flange's face",
    "housing-two": "the same, two toolings",
    "housing-rear": "accelerometers on the housing alone, 350 mm behind the flange's face",
    "housing-loud": "accelerometers on the housing alone, in a workshop and a machine as loud as a real one",
}


def sensors_table(rows: Sequence[dict[str, Any]]) -> str:
    """Return what sensors reach as Markdown: errors of a tooling in a holder that never cut and of those that cut, bands and status."""
    lines = [
        "| sensors for X and Y | condition | machines | never cut: median | worst | cut: median | worst | in the 90 % band | converged |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for condition, words in _SENSORS.items():
        group = [row for row in rows if row["condition"] == condition]
        if not group:
            continue
        cells = [words, f"`{condition}`", str(len(group))]
        for kind in ("different", "cut"):
            errors = np.array([e for row in group for e in row[kind]["errors"]])
            cells += [f"{np.median(errors):.4f}", f"{errors.max():.4f}"]
        bands = [row["different"]["bands"]["90"] for row in group if row["different"]["bands"]]
        converged = sum(row["status"] == "converged" for row in group)
        lines.append("| " + " | ".join([*cells, f"{100 * np.mean(bands):.0f} %", f"{converged} of {len(group)}"]) + " |")
    return "\n".join([*lines, "", *_every_run(rows)]).rstrip() + "\n"


def coupled_table(rows: Sequence[dict[str, Any]]) -> str:
    """Return the coupled machines' part as Markdown: errors of XX, YY and of the cross terms, each at the worst of three speeds.

    `rows`: with ``cross`` and ``cross_own`` beside ``errors`` of each kind of tooling
    """
    members = [r for r in rows if r["method"] == "default"]
    lines = [
        "| condition | toolings | runs | XX, YY: median | worst | XY over XX: median | worst | XY over XY: median | worst "
        "| converged | seconds |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for condition in dict.fromkeys(r["condition"] for r in members):
        group = [r for r in members if r["condition"] == condition]
        for kind in COUPLED_AIMS:
            cells = [condition, kind, str(len(group))]
            for name in ("errors", "cross", "cross_own"):
                errors = np.array([e for row in group for e in row[kind][name]])
                cells += [f"{np.median(errors):.4f}", f"{errors.max():.4f}"]
            converged = sum(row["status"] == "converged" for row in group)
            seconds = np.median([sum(row["seconds"].values()) for row in group])
            lines.append("| " + " | ".join([*cells, f"{converged} of {len(group)}", f"{seconds:.1f}"]) + " |")
    aims, most = (", ".join(f"{kind} {aim:g}" for kind, aim in these.items()) for these in (COUPLED_AIMS, COUPLED_WORST))
    above = counts(members)["converged above"]
    lines += ["", f"Aims: medians {aims}; worst {most}; cross terms {CROSS_AIM:g} of their own norm.", "", *_bands(rows), ""]
    lines += [f"Of {len(members)} runs, {above} are `converged` with an error above {WORST} in a tooling that never cut.", ""]
    columns = [f"{kind} {name}" if name == "XX" else name for kind in COUPLED_AIMS for name in ("XX", "YY", "XY / XX", "XY / XY")]
    lines += ["| machine | condition | seed | " + " | ".join(columns) + " | status | seconds |", "|" + "---|" * (len(columns) + 5)]
    for row in members:
        shown: list[float] = []
        for kind in COUPLED_AIMS:
            found = row[kind]
            shown += [max(found["errors"][0::2]), max(found["errors"][1::2]), max(found["cross"]), max(found["cross_own"])]
        cells = [row["machine"], row["condition"], str(row["seed"]), *(f"{e:.4f}" for e in shown), row["status"]]
        lines.append("| " + " | ".join([*cells, f"{sum(row['seconds'].values()):.1f}"]) + " |")
    return "\n".join([*lines, "", *_doubts(members)]).rstrip() + "\n"
