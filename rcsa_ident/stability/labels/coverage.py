"""Whether labels say something of a cut, or whether its probability is a guess from before the first of them."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.remarks import counted
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.stability.labels.cut_margins import points_of
from rcsa_ident.stability.labels.tested_cuts import TestedCuts, Verdict

#: Ratio of widths up to which labels of one width tell of another.
_WIDER = 1.6
#: How near the nearest label is to a cut that is covered, one length of the process away, and to one that is partly so, two lengths.
_COVERED, _PARTLY = np.exp(-0.5), np.exp(-2.0)


class Covered(StrEnum):
    """Whether labels say something of a cut."""

    YES = "yes"
    PARTLY = "partly"
    NO = "no"


@dataclass(frozen=True, slots=True, eq=False)
class TestedAnswers:
    """What is believed of cuts.

    `stable`, shape (n,): probability that each is called stable
    `covered`: tuple of Covered, length n
    """

    __test__ = False  # a noun, though pytest looks for such names

    stable: FloatArray
    covered: tuple[Covered, ...]


def covered(points: FloatArray, edges: frozenset[str], asked: TestedCuts, process: MillingProcess, near: FloatArray) -> tuple[Covered, ...]:
    """Return whether labels cover each cut: never in a direction that has none, and partly at most with edges that have none.

    `points`, shape (n, 3): speeds, immersions and directions of the labels, as of `points_of`
    `edges`: states of the edges that labels have
    `near`, shape (m,): how near the nearest label is, as of `LabelProcess.told`
    """
    found = []
    for share, up, own in zip(near, points_of(asked, process)[:, 2], asked.own, strict=True):
        if up not in points[:, 2] or share < _PARTLY:
            found.append(Covered.NO)
        elif share < _COVERED or own.edge_state not in edges:
            found.append(Covered.PARTLY)
        else:
            found.append(Covered.YES)
    return tuple(found)


def unlabelled(points: FloatArray, process: MillingProcess) -> tuple[str, ...]:
    """Return in words how a cut that is asked about differs from all labelled ones.

    `points`, shape (n, 3): speeds, immersions and directions of the labels, as of `points_of`
    """
    if not len(points):
        return ()
    ((_, share, up),) = points_of(TestedCuts(np.ones(1), np.ones(1), (Verdict.MARGINAL,)), process)
    said = []
    if up not in points[:, 2]:
        said.append(
            f"no label was ever taken in {'up' if up else 'down'} milling: limits there are what the labels of the other direction say"
        )
    low, high = float(points[:, 1].min()), float(points[:, 1].max())
    if not low / _WIDER < share < high * _WIDER:
        widths = [f"{1e3 * each * process.cutter.diameter:.3g}" for each in (share, low, high)]
        said.append(
            f"the cut is {widths[0]} mm wide, labels are of widths from {widths[1]} to {widths[2]} mm: limits there are extrapolated"
        )
    return tuple(said)


def uncovered(points: FloatArray, asked: TestedCuts, process: MillingProcess, cover: tuple[Covered, ...]) -> tuple[str, ...]:
    """Return in words which cuts labels do not cover, and why; `points` as of `covered`."""
    said, wanted = [], points_of(asked, process)[:, 2]
    for up, name in ((1.0, "up"), (0.0, "down")):
        count = int(np.sum(wanted == up))
        if count and up not in points[:, 2]:
            of = counted(count, "cut")
            said.append(
                f"no label was ever taken in {name} milling: the probability of {of} is what was believed before, or an even chance"
            )
    told = np.array([each is Covered.NO for each in cover]) & np.isin(wanted, points[:, 2])
    if told.any():
        are, far = "is" if told.sum() == 1 else "are", counted(int(told.sum()), "cut")
        said.append(f"{far} {are} far from every label: the probability is extrapolated")
    return tuple(said)
