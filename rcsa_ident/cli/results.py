"""Identified machines from result files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from rcsa_ident.cli.common import warn

if TYPE_CHECKING:
    from rcsa_ident.dynamics.coordinates import Dof
    from rcsa_ident.identification.posterior import MachineAxis
    from rcsa_ident.workflows.speeds import MachineOverSpeed


def read_machine(path: Path) -> tuple[dict[Dof, MachineAxis], dict[str, Any]]:
    """Return the machine of a result file beside the file's content."""
    from rcsa_ident.io.identifications import machine_from_json
    from rcsa_ident.io.results import read_result

    data = read_result(path)
    machine = machine_from_json(data, str(path))
    if data["status"] != "converged":
        warn(f"{path} is {data['status']}: {'; '.join(data['reasons'])}")
    return machine, data


def read_machine_over_speed(path: Path) -> tuple[MachineOverSpeed, dict[str, Any]]:
    """Return the machine of a result file, with the models of single speed bands, beside the file's content."""
    from rcsa_ident.io.identifications import speed_bands_from_json
    from rcsa_ident.workflows.speeds import MachineOverSpeed

    machine, data = read_machine(path)
    return MachineOverSpeed(machine, speed_bands_from_json(data, str(path))), data
