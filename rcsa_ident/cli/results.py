"""Machines from files: identified ones, and measured or decoupled flanges."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from rcsa_ident.base.errors import InputError
from rcsa_ident.cli.common import warn

if TYPE_CHECKING:
    from rcsa_ident.identification.machine import IdentifiedMachine
    from rcsa_ident.machine.machine import Machine, TipSource


def read_machine(path: Path) -> Machine:
    """Return the machine of a RESULT.json or of a FLANGE.csv."""
    from rcsa_ident.io.curves.flanges import read_flange_machine

    return read_flange_machine(path) if path.suffix.lower() == ".csv" else read_identified(path)[0]


def read_tip_source(path: Path) -> TipSource:
    """Return what the tip of a tooling is asked of: the machine of RESULT.json or FLANGE.csv, or a tip that labelled cuts have taught."""
    from rcsa_ident.io.results.learnt_tips import is_learnt_tip, learnt_tip_of
    from rcsa_ident.io.results.parts import read_json

    if path.suffix.lower() != ".csv":
        data = read_json(path, "result")
        if is_learnt_tip(data):
            return learnt_tip_of(data, str(path))
    return read_machine(path)


def at_temperature(machine: TipSource, celsius: float | None) -> TipSource:
    """Return the machine at a temperature [°C]; errors name the option."""
    try:
        return machine.at_temperature(celsius)
    except InputError as error:
        raise InputError("--temperature-c", error.found, error.allowed) from None


def read_identified(path: Path) -> tuple[IdentifiedMachine, dict[str, Any]]:
    """Return the machine of a result file beside the file's content."""
    from rcsa_ident.io.results.identifications import machine_from_json
    from rcsa_ident.io.results.parts import read_result

    data = read_result(path)
    return machine_from_json(data, str(path)), data


def tell(machine: Machine, path: Path) -> None:
    """Say what speaks against a machine, where no answer says it."""
    for remark in machine.remarks:
        warn(f"{path}: {remark}")
