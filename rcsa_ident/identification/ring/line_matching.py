"""Which line that was heard is which mode: pairs of planes are gathered, assignments compared by their evidence."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.signals.sound.ring_down import RingingMode
from rcsa_ident.tool_holder.free_modes import FreeMode

#: How far the two planes of a bending mode may lie apart, as a share: of three teeth and more, whose section bends alike in all planes,
#: and of one or two.
_PLANES, _PLANES_OF_TWO = 0.012, 0.12
#: Standard deviation of a frequency that was heard in one of two planes which differ, as a share.
_ONE_PLANE = 0.02
#: Twice the negative logarithm of the prior of a line that is no mode (and lies anywhere in four logarithms of frequency and of damping),
#: of a mode below another one that is not heard, where it decays slowly and where it does not.
_STRANGER, _UNHEARD, _DEAD = 8.0, 4.0, 1.0
_ANYWHERE = 2.0 * np.log(4.0)
#: Damping ratio above which a mode is hardly heard.
_HARDLY = 0.05
#: Damping of a model that is not told by the drawing to better than so, where it only helps to find which mode it is.
_DAMPING = 0.15


@dataclass(frozen=True, slots=True)
class Heard:
    """One line, or both planes' lines of one mode.

    `omega`, `omega_std` [rad/s]: the planes' mean
    `damping`, `damping_std` [-]; `level` [-]
    `split` [-]: by what share the planes differ; 0 of a line alone
    """

    omega: float
    omega_std: float
    damping: float
    damping_std: float
    level: float
    split: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Predicted:
    """What is expected of the bending modes.

    `mean`, shape (2 k,): logarithms of the frequencies [rad/s], then of the damping ratios
    `covariance`, shape (2 k, 2 k): of what the drawing does not tell
    `model`, shape (k,): own error of the computed frequencies, as a share
    `damping`: whether damping is compared
    """

    mean: FloatArray
    covariance: FloatArray
    model: FloatArray
    damping: bool


@dataclass(frozen=True, slots=True)
class Match:
    """What each line is: a place among the bending modes, or among axial and torsional ones, or neither."""

    bending: tuple[int | None, ...]
    rods: tuple[int | None, ...]
    cost: float


def gathered(lines: Sequence[RingingMode], teeth: int) -> tuple[Heard, ...]:
    """Return lines in ascending order, both planes of a bending mode as one.

    `teeth`: of the cutter: its planes are alike with three and more
    """
    apart = _PLANES if teeth > 2 else _PLANES_OF_TWO
    found: list[Heard] = []
    for line in sorted(lines, key=lambda each: each.omega):
        one = Heard(line.omega, line.omega_std, line.damping, line.damping_std, line.level)
        last = found[-1] if found else None
        if last is not None and last.split == 0.0 and line.omega < (1.0 + apart) * last.omega:
            omega = float(np.sqrt(0.5 * (last.omega**2 + line.omega**2)))
            found[-1] = Heard(
                omega,
                float(np.hypot(last.omega_std, line.omega_std)) / 2.0,
                0.5 * (last.damping + line.damping),
                float(np.hypot(last.damping_std, line.damping_std)) / 2.0,
                max(last.level, line.level),
                (line.omega - last.omega) / omega,
            )
        else:
            found.append(one)
    if teeth <= 2:
        found = [
            each if each.split else replace(each, omega_std=float(np.hypot(each.omega_std, _ONE_PLANE * each.omega))) for each in found
        ]
    return tuple(found)


def matched(predicted: Predicted, lines: Sequence[Heard], rods: Sequence[FreeMode], reach: float) -> Match | None:
    """Return the assignment with the largest evidence, or None where no line is heard.

    `lines`: ascending
    `rods`: axial and torsional ones
    `reach`: standard deviation of these, as a share
    """
    if not lines:
        return None
    count = predicted.model.size
    elsewhere = [_elsewhere(line, rods, reach, predicted.damping) for line in lines]
    best: Match | None = None
    for places in _assignments(len(lines), count):
        taken = [(i, place) for i, place in enumerate(places) if place is not None]
        cost = sum(elsewhere[i][0] for i, place in enumerate(places) if place is None)
        cost += sum(_unheard(predicted, k) for k in range(max((p for _, p in taken), default=0)) if k not in {p for _, p in taken})
        if best is not None and cost >= best.cost + 40.0:
            continue
        if taken:
            cost += _misfit(predicted, lines, taken)
        if best is None or cost < best.cost:
            best = Match(places, tuple(elsewhere[i][1] if place is None else None for i, place in enumerate(places)), cost)
    return best


def _assignments(lines: int, modes: int, start: int = 0) -> Iterator[tuple[int | None, ...]]:
    """All ways to give ascending lines ascending modes, or none."""
    if lines == 0:
        yield ()
        return
    for rest in _assignments(lines - 1, modes, start):
        yield (None, *rest)
    for place in range(start, modes):
        for rest in _assignments(lines - 1, modes, place + 1):
            yield (place, *rest)


def _unheard(predicted: Predicted, place: int) -> float:
    return _DEAD if np.exp(predicted.mean[predicted.model.size + place]) > _HARDLY else _UNHEARD


def _elsewhere(line: Heard, rods: Sequence[FreeMode], reach: float, damping: bool) -> tuple[float, int | None]:
    """Cost of a line that is no bending mode, and which of the rods' modes it is."""
    anywhere = _ANYWHERE * (2.0 if damping else 1.0)
    costs = [
        (_log_density(np.log(line.omega / rod.omega), reach) + (_ANYWHERE if damping else 0.0) + _UNHEARD, i) for i, rod in enumerate(rods)
    ]
    stranger: tuple[float, int | None] = (_STRANGER + anywhere, None)
    return min([stranger, *costs], key=lambda each: each[0])


def _log_density(away: float, std: float) -> float:
    """Twice the negative logarithm of a normal density."""
    return float((away / std) ** 2 + np.log(2.0 * np.pi * std**2))


def _misfit(predicted: Predicted, lines: Sequence[Heard], taken: Sequence[tuple[int, int]]) -> float:
    count = predicted.model.size
    rows = [place for _, place in taken]
    value = [np.log(lines[i].omega) for i, _ in taken]
    own = [predicted.model[place] ** 2 + (lines[i].omega_std / lines[i].omega) ** 2 for i, place in taken]
    if predicted.damping:
        rows += [count + place for _, place in taken]
        value += [np.log(lines[i].damping) for i, _ in taken]
        own += [_DAMPING**2 + (lines[i].damping_std / lines[i].damping) ** 2 for i, _ in taken]
    spread = predicted.covariance[np.ix_(rows, rows)] + np.diag(own)
    away = np.array(value) - predicted.mean[rows]
    return float(away @ np.linalg.solve(spread, away) + np.linalg.slogdet(2.0 * np.pi * spread)[1])
