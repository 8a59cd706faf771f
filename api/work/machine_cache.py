"""Identified machines that a worker knows: read once, checked, and kept while they are asked for."""

from __future__ import annotations

import json
from collections import OrderedDict
from dataclasses import dataclass, field
from typing import Any, NoReturn

import numpy as np

from api.work.machine_side import MachineSide
from api.work.requests import MachineText
from rcsa_ident.arrays import FloatArray
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.errors import InputError
from rcsa_ident.identification.posterior import Posterior
from rcsa_ident.io.identifications import machine_from_json, speed_bands_from_json
from rcsa_ident.io.results import check_result
from rcsa_ident.workflows.speeds import MachineOverSpeed

#: As with `lobes`: lower end of the receptances that limits are computed from, and their step [Hz].
LOWEST, STEP = 100.0, 1.0
#: Seconds for a line and an unknown, and how many of both together are kept (100 bytes each).
SPREAD_COST, MOST_KEPT = 1e-5, 1_000_000
#: What the service takes; the largest campaigns stay far below.
HIGHEST_HZ, MOST_MODES, MOST_UNKNOWNS, MOST_RIVALS, MOST_BANDS = 20_000.0, 60, 600, 20, 20


@dataclass(slots=True, eq=False)
class Known:
    """A machine, with what is kept of it.

    Parameters
    ----------
    machine : MachineOverSpeed
    data : dict
        The content of RESULT.json.
    sides : dict of bool to MachineSide
        With and without the posterior.
    """

    machine: MachineOverSpeed
    data: dict[str, Any]
    sides: dict[bool, MachineSide] = field(default_factory=dict)

    @property
    def steady(self) -> bool:
        """Whether it is the same at all speeds."""
        return not self.machine.bands and self.machine.speed_range is None

    @property
    def unknowns(self) -> int:
        """Directions of the posterior of all axes of the machine that has most of them."""
        machines = (self.machine.whole, *(band for _, band in self.machine.bands))
        return max(sum(0 if part.posterior is None else part.posterior.theta.size for part in each.values()) for each in machines)

    def spread_seconds(self, lines: int) -> float:
        """Return about how long the posterior takes to a tip's receptance of so many lines without anything kept [s]."""
        return SPREAD_COST * self.unknowns * lines

    @property
    def quick(self) -> bool:
        """Whether the machine's side of the coupling can be kept: it is the same at all speeds, and not too large."""
        return self.steady and self.unknowns * self.omega().size <= MOST_KEPT

    def omega(self, beyond: float = 1.0) -> FloatArray:
        """Return the frequencies [rad/s] of the receptances, up to so many times the highest that was identified."""
        low, high = self.data["band_hz"]
        return 2.0 * np.pi * np.arange(min(LOWEST, low), beyond * high + 0.5 * STEP, STEP)

    def side(self, bands: bool) -> MachineSide:
        """Return the machine's side of the coupling; of a steady machine only."""
        if bands not in self.sides:
            self.sides[bands] = MachineSide.of(self.machine.whole, self.omega(), bands)
        return self.sides[bands]


class Shelf:
    """The machines that were asked for last."""

    def __init__(self, most: int) -> None:
        self.most = most
        self.machines: OrderedDict[str, Known] = OrderedDict()

    def get(self, machine: MachineText) -> Known:
        """Return a machine, read if it is not known."""
        if machine.digest not in self.machines:
            self.machines[machine.digest] = read(machine.text)
        self.machines.move_to_end(machine.digest)
        while len(self.machines) > self.most:
            self.machines.popitem(last=False)
        return self.machines[machine.digest]


def parsed(text: str) -> dict[str, Any]:
    """Return the content of RESULT.json after every check that the commands make, and the service's own limits."""

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        table = dict(pairs)
        if len(table) < len(pairs):
            names = [key for key, _ in pairs]
            raise InputError(next(key for key in names if names.count(key) > 1), "the same key twice", "every key once")
        return table

    def no_number(word: str) -> NoReturn:
        raise InputError("identification", word[:40], "finite numbers")

    def finite(word: str) -> float:
        value = float(word)
        return value if np.isfinite(value) else no_number(word)

    try:
        data = json.loads(text, object_pairs_hook=once, parse_constant=no_number, parse_float=finite)
        check_result(data, "")
    except InputError:
        raise
    except RecursionError:
        raise InputError("identification", "lists in lists without end", "a result") from None
    except ValueError as error:
        found = f"a JSON error ({error.msg} in line {error.lineno})" if isinstance(error, json.JSONDecodeError) else "no JSON"
        raise InputError("identification", found, "JSON") from None
    _limits(data)
    return data


def read(text: str) -> Known:
    """Return a machine whose receptances are finite."""
    data = parsed(text)
    machine = MachineOverSpeed(machine_from_json(data, ""), speed_bands_from_json(data, ""))
    known = Known(machine, data)
    ends = 2.0 * np.pi * np.array([LOWEST, 0.5 * data["band_hz"][1] + 1.0, data["band_hz"][1]])
    for each in (machine.whole, *(band for _, band in machine.bands)):
        try:
            with np.errstate(all="ignore"):
                axes = MachineSide.of(each, ends).axes.values()
            finite = all(
                np.all(np.isfinite(part)) for side in axes for part in (side.nominal, side.ahead, side.behind, side.rivals, side.weight)
            )
        except (ArithmeticError, np.linalg.LinAlgError, InputError):
            finite = False
        if not finite:
            raise InputError("axes", "unknowns or modes without a finite receptance", "a machine that the reader of results can compute")
    return known


def posteriors(data: dict[str, Any]) -> dict[Dof, Posterior]:
    """Return what an identification may go on from.

    Raises
    ------
    InputError
        There is none, as with the published method.
    """
    found = {}
    for axis, part in machine_from_json(data, "").items():
        if part.posterior is None:
            allowed = "a result of the default method, with unknowns and covariance of each axis"
            raise InputError("start", f"axis {axis.upper()} without a covariance (method {data['method']})", allowed)
        found[axis] = part.posterior
    return found


def _limits(data: dict[str, Any]) -> None:
    if data["band_hz"][1] > HIGHEST_HZ:
        raise InputError("band_hz", f"up to {data['band_hz'][1]:g} Hz", f"at most {HIGHEST_HZ:g} Hz")
    bands = data.get("speed_bands") or []
    _at_most("speed_bands", bands, MOST_BANDS)
    for table in (data, *bands):
        for name, axis in table["axes"].items():
            for key, most in (("modes", MOST_MODES), ("unknowns", MOST_UNKNOWNS), ("rivals", MOST_RIVALS)):
                value = axis.get(key) or []
                if isinstance(value, list):
                    _at_most(f"axes.{name}.{key}", value, most)


def _at_most(name: str, value: list[Any], most: int) -> None:
    if len(value) > most:
        raise InputError(name, f"{len(value)} entries", f"at most {most}")
