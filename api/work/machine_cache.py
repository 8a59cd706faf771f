"""Machines that a worker knows: read once, checked, and kept while they are asked for."""

from __future__ import annotations

import json
from collections import OrderedDict
from typing import Any, NoReturn

import numpy as np

from api.work.requests import MachineText
from api.work.robots import is_posed, posed
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import from_hz, to_hz
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.machine import IdentifiedMachine
from rcsa_ident.identification.posterior import PlaneUnknowns, Posterior
from rcsa_ident.io.curves.flanges import flange_machine_of
from rcsa_ident.io.results.identifications import machine_from_json
from rcsa_ident.io.results.parts import check_result
from rcsa_ident.machine.machine import LOWEST, Machine

#: What the service takes; the largest campaigns stay far below.
HIGHEST_HZ, MOST_MODES, MOST_UNKNOWNS, MOST_RIVALS, MOST_BANDS, MOST_TOLD = 20_000.0, 60, 600, 20, 20, 200


class MachineCache:
    """The machines that were asked for last."""

    def __init__(self, most: int) -> None:
        self.most = most
        self.machines: OrderedDict[str, Machine] = OrderedDict()

    def get(self, machine: MachineText, spread: bool = True) -> Machine:
        """Return a machine, read if it is not known, with what many toolings share worked out; of its spread only where it is wanted."""
        known = self.machines.get(machine.digest) or read(machine.text)
        self.machines[machine.digest] = known = known.kept(spread)
        self.machines.move_to_end(machine.digest)
        while len(self.machines) > self.most:
            self.machines.popitem(last=False)
        return known


def is_result(text: str) -> bool:
    """Return whether a text is a RESULT.json; else it is a FLANGE.csv."""
    return text.lstrip()[:1] == "{"


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


def read(text: str) -> Machine:
    """Return a machine whose receptances are finite, of a RESULT.json, a FLANGE.csv or a robot at a posture."""
    if is_posed(text):
        return posed(text)
    if not is_result(text):
        try:
            machine = flange_machine_of(text)
        except InputError as error:
            if not error.where:
                raise
            # a line of the text, not a file of the service
            raise InputError(f"{error.where.strip()}, {error.field}", error.found, error.allowed) from None
        if to_hz(machine.band[1]) > HIGHEST_HZ:
            raise InputError("frequency_hz", f"up to {to_hz(machine.band[1]):g} Hz", f"at most {HIGHEST_HZ:g} Hz")
        return machine
    identified = machine_from_json(parsed(text), "")
    ends = np.array([from_hz(LOWEST), 0.5 * identified.band[1] + 1.0, identified.band[1]])
    speeds = [None, *(0.5 * sum(model.speeds) for model in identified.speed_models)]
    machines = [identified.at(speed) for speed in speeds]
    if identified.thermometer is not None and not identified.speed_models:
        machines.append(identified.at_temperature(identified.thermometer[0]))
    if not all(_finite(each, ends) for each in machines):
        raise InputError("axes", "unknowns or modes without a finite receptance", "a machine that the reader of results can compute")
    return identified


def starts(text: str) -> dict[Dof, Posterior | PlaneUnknowns]:
    """Return what an identification may go on from, axis by axis.

    Raises `InputError`: there is none: a measured flange, or a result of the published method.
    """
    if not is_result(text):
        raise InputError("start", "a measured flange", "a machine with an identification by the default method")
    try:
        return machine_from_json(json.loads(text), "").starts()
    except InputError as error:
        raise InputError("start", f"{error.field}: {error.found}", error.allowed) from None


def _finite(machine: IdentifiedMachine, omega: np.ndarray) -> bool:
    try:
        with np.errstate(all="ignore"):
            sides = [side.kept() for side in machine.sides(omega)]
            gives_way = () if machine.workpiece_side is None else machine.workpiece_side.yielding.values()
            beside = [part for each in gives_way for part in (each.receptance(omega), each.changes(omega))]
            beside += [] if machine.axial is None else [machine.axial.receptance(omega).values]
    except (ArithmeticError, np.linalg.LinAlgError, InputError):
        return False
    ends = [part for side in sides if side.ends is not None for part in (side.ends.ahead, side.ends.behind)]
    kept = [*ends, *beside, *(part for side in sides for part in (side.nominal, side.rivals))]
    return all(np.all(np.isfinite(part)) for part in kept)


def _limits(data: dict[str, Any]) -> None:
    if data["band_hz"][1] > HIGHEST_HZ:
        raise InputError("band_hz", f"up to {data['band_hz'][1]:g} Hz", f"at most {HIGHEST_HZ:g} Hz")
    bands = data.get("speed_bands") or []
    _at_most("speed_bands", bands, MOST_BANDS)
    for key in ("taught_by", "taught_recordings"):
        _at_most(key, data.get(key, []), MOST_TOLD)
    along = data.get("axial")
    if isinstance(along, dict) and isinstance(along.get("poles"), list):
        _at_most("axial.poles", along["poles"], MOST_MODES)
    for table in (data, *bands):
        named = {f"axes.{name}": axis for name, axis in table["axes"].items()}
        named |= {"both_planes": table["both_planes"]} if isinstance(table.get("both_planes"), dict) else {}
        side = table.get("workpiece_side")
        named |= {f"workpiece_side.{name}": axis for name, axis in side.items() if isinstance(axis, dict)} if isinstance(side, dict) else {}
        for name, axis in named.items():
            for key, most in (("modes", MOST_MODES), ("unknowns", MOST_UNKNOWNS), ("rivals", MOST_RIVALS)):
                value = axis.get(key) or []
                if isinstance(value, list):
                    _at_most(f"{name}.{key}", value, most)


def _at_most(name: str, value: list[Any], most: int) -> None:
    if len(value) > most:
        raise InputError(name, f"{len(value)} entries", f"at most {most}")
