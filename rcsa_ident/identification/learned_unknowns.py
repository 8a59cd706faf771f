"""What an answer has learned beyond the machine's modes, out of the vector of its unknowns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.identification.data import IdentificationData
from rcsa_ident.identification.further_unknowns import (
    FRICTION_SPREAD,
    TIME_SPREAD,
    CutScales,
    GivingWay,
    Grips,
    OrderFactors,
    Warming,
    further_places,
)
from rcsa_ident.identification.learned_changes import LearnedChanges, LearnedFactor, LearnedWarming
from rcsa_ident.identification.levenberg_marquardt import Solution
from rcsa_ident.identification.unknowns import lower_triangle, planes

#: Standard deviations from which on a change is told.
TOLD = 2.0


def changes_learned(data: IdentificationData, solution: Solution, covariance: FloatArray) -> LearnedChanges:
    """Return what an answer has learned beyond the machine.

    `covariance`, shape (p, p): of all unknowns
    """
    logs, start = solution.theta[solution.layout.force], solution.layout.force.start
    known = np.sqrt(np.diag(covariance))
    found = LearnedChanges()
    for each, place in further_places(data):
        values, deviations = logs[place], known[start + place.start : start + place.stop]
        match each:
            case Warming():
                found = replace(found, warming=_warming(data, solution, each, values, known))
            case OrderFactors(keys=keys):
                pairs = values.reshape(-1, 2)
                told = {
                    (data.axes[i].axis, int(kind), int(order)): LearnedFactor(complex(*pairs[k]), float(deviations[2 * k]))
                    for k, (i, kind, order) in enumerate(keys)
                }
                found = replace(found, orders=told)
            case CutScales(cut_ids=names):
                found = replace(found, scales=_factors(names, values, deviations))
            case GivingWay():
                louder = float(np.ptp(data.grip[:, data.grip_places == place.start]))
                found = replace(found, amplitude=LearnedFactor(complex(louder * values[0]), louder * float(deviations[0])))
            case Grips(toolings=names):
                found = replace(found, joints=_factors(names, values, deviations))
    return found


def _factors(names: tuple[str, ...], values: FloatArray, deviations: FloatArray) -> dict[str, LearnedFactor]:
    return {
        name: LearnedFactor(complex(value), float(std))
        for name, value, std in zip(names, values.tolist(), deviations.tolist(), strict=True)
    }


def _warming(data: IdentificationData, solution: Solution, each: Warming, values: FloatArray, known: FloatArray) -> LearnedWarming:
    """Of the mode that changes most among those of which the lines tell it, over both axes."""
    layout, course = planes(solution.layout), data.warmth + data.course @ values
    own = []
    for i, block in enumerate(layout.axes):
        places = layout.axis(i).start + np.arange(block.size)[block.parts["warming"]][lower_triangle(block.modes)[2]]
        own += [(float(solution.theta[place]), float(known[place])) for place in places]
    # half of the stiffness' change
    warmer = 0.5 * float(np.ptp(course))
    # modes beyond the band may seem to change by anything
    told = [pair for pair in own if abs(pair[0]) > TOLD * pair[1]] or own
    change, deviation = max(told, key=lambda pair: abs(pair[0]), default=(0.0, 0.0))
    if each.time_constant is None:
        told = data.made.temperature[~data.made.judged]
        return LearnedWarming(warmer * change, warmer * deviation, coldest=float(told.min()), warmest=float(told.max()))
    constant = each.time_constant * float(np.exp(TIME_SPREAD * values[0]))
    exponent = each.exponent + FRICTION_SPREAD * float(values[1])
    return LearnedWarming(warmer * change, warmer * deviation, constant, exponent, warmed_up=each.warmed_up)
