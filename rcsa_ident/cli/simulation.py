"""A machine file's campaign, from the virtual machine to the disk."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from rcsa_ident.errors import InputError
from rcsa_ident.io.machines import MachineFile, read_machine
from rcsa_ident.io.setups import read_tooling
from rcsa_ident.io.simulations import Progress, SimulatedCampaign, write_simulation
from rcsa_ident.workflows.simulate import simulate, true_flange, true_receptances


def simulate_campaign(
    machine: str | Path | MachineFile,
    out: str | Path,
    seed: int = 1,
    progress: Progress | None = None,
    mapper: Callable[[Callable, Iterable], Iterable] = map,
) -> SimulatedCampaign:
    """Let a virtual machine make its cuts; write the campaign into `out` and the truth into ``<out>.truth``.

    Parameters
    ----------
    machine : path of a machine file, or what was read from one
    out : path
        A folder that does not exist yet, or an empty one.
    seed : int
        Same seed, same files.
    progress : callable of (done, total), optional
    mapper : callable like `map`, optional
    """
    setup = machine if isinstance(machine, MachineFile) else read_machine(machine)
    toolings = [read_tooling(path) for path in setup.toolings]
    known = [*toolings, *(read_tooling(path) for path in setup.truth_toolings)]
    if len({t.name for t in known}) != len(known):
        raise InputError("cuts.toolings", ", ".join(t.name for t in known), "toolings with different names")
    cuts = simulate(setup, toolings, seed, mapper)
    truths = (true_receptances(setup, tooling) for tooling in known)
    return write_simulation(out, setup, toolings, cuts, truths, true_flange(setup), progress)
