"""The example campaign: what the virtual machine cuts, and its recordings one cut at a time, so that no query waits long behind them."""

from __future__ import annotations

import os
from pathlib import Path


def plan() -> tuple[str, dict[str, str]]:
    """Return campaign.toml, and the texts of all toolings of the sample machine by name: those that cut come first."""
    from rcsa_ident.front.samples import sample_machine
    from rcsa_ident.io.settings.setups import read_tooling
    from rcsa_ident.io.settings.simulations import campaign_text

    machine = sample_machine()
    texts = {path.stem: path.read_text(encoding="utf-8") for path in (*machine.toolings, *machine.truth_toolings)}
    return campaign_text(machine, [read_tooling(path) for path in machine.toolings]), texts


def make_cut(number: int, cut: Path, air: Path) -> None:
    """Write the recordings of a cut, in the order of campaign.toml, and sync them to the disk."""
    from rcsa_ident.front.samples import sample_machine
    from rcsa_ident.io.recordings.hdf5 import write_hdf5
    from rcsa_ident.io.settings.setups import read_tooling
    from rcsa_ident.workflows.simulate import simulate

    machine = sample_machine()
    toolings = [read_tooling(path) for path in machine.toolings]
    # each cut has its own share of chance: alone it is what it is among all
    (made,) = simulate(machine, toolings, 1, lambda run, jobs: [run(job) for k, job in enumerate(jobs) if k == number])
    for kind, path in (("cut", cut), ("air", air)):
        write_hdf5(path, machine.sensors.rate, made.records[kind].channels)
        with path.open("rb+") as file:
            os.fsync(file.fileno())
