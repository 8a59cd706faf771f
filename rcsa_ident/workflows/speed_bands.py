"""One model for each of several ranges of spindle speed: how the machine changes with it, without a law for the change."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.scaleout import Map
from rcsa_ident.base.units import to_rpm
from rcsa_ident.identification.data import IdentificationData
from rcsa_ident.identification.method import Method
from rcsa_ident.identification.result import Identification
from rcsa_ident.identification.status import FEWEST_CUTS
from rcsa_ident.setup.campaign import Campaign
from rcsa_ident.signals.measurement import Reading
from rcsa_ident.workflows.identify import data_of


@dataclass(frozen=True, slots=True, eq=False)
class SpeedBand:
    """A range of spindle speeds and what its cuts say for themselves.

    `speeds`: (float, float) [rad/s]; lowest and highest; one band ends where the next begins
    """

    speeds: tuple[float, float]
    found: Identification


def speed_bands(campaign: Campaign, readings: Sequence[Reading], count: int, method: Method, seed: int, map: Map = map) -> list[SpeedBand]:
    """Return one identification for each of `count` equal ranges of the usable cuts' spindle speeds.

    `method`: that starts from the whole campaign's answer: a band alone has too few cuts to be explored
    `map`: the bands do not depend on each other
    Raises `InputError` if a band has too few cuts with one of the toolings.
    """
    jobs = [_BandJob(method, speeds, data_of(campaign, cuts), seed) for speeds, cuts in split_by_speed(readings, count)]
    return list(map(_identify_band, jobs))


def split_by_speed(readings: Sequence[Reading], count: int) -> list[tuple[tuple[float, float], list[Reading]]]:
    """Return `count` equal ranges of speed [rad/s], each with its usable cuts.

    Raises `InputError` if a range has too few cuts with one of the toolings.
    """
    # each window of a pass for itself
    usable = [(replace(each, measurements=(one,)), one.spindle_speed) for each in readings for one in each.measurements]
    if not usable:
        raise InputError("cuts", f"none of {len(readings)} usable", "at least one usable cut")
    speeds = [speed for _, speed in usable]
    edges = np.linspace(min(speeds), max(speeds), count + 1)
    band_of = np.clip(np.searchsorted(edges, speeds, side="right") - 1, 0, count - 1)
    found = []
    for b in range(count):
        cuts = [each for (each, _), own in zip(usable, band_of, strict=True) if own == b]
        low, high = float(edges[b]), float(edges[b + 1])
        for name in dict.fromkeys(each.tooling for each, _ in usable):
            number = sum(each.tooling == name for each in cuts)
            if number < FEWEST_CUTS:
                raise InputError(
                    "speed_bands",
                    f"{number} cuts with {name} from {to_rpm(low):.0f} to {to_rpm(high):.0f} rev/min",
                    f"at least {FEWEST_CUTS} cuts with each tooling in each of {count} bands: fewer bands, or more cuts",
                )
        found.append(((low, high), cuts))
    return found


@dataclass(frozen=True, slots=True, eq=False)
class _BandJob:
    """The identification of one band."""

    method: Method
    speeds: tuple[float, float]
    data: IdentificationData
    seed: int


def _identify_band(job: _BandJob) -> SpeedBand:
    return SpeedBand(job.speeds, job.method.run(job.data, job.seed, map))
