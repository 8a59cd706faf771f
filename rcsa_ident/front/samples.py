"""Campaigns on the virtual machine, and the sample machine with its toolings that travel with the package."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.sample_files import sample_data, sample_robots
from rcsa_ident.base.scaleout import Map
from rcsa_ident.io.settings.machines import MachineFile, read_machine
from rcsa_ident.io.settings.robots import read_robot
from rcsa_ident.io.settings.setups import CAMPAIGN_FILE, read_tooling
from rcsa_ident.io.settings.simulations import Progress, SimulatedCampaign, write_simulation
from rcsa_ident.machine.robot.model import RobotModel
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.workflows.simulate import simulate, true_flange, true_receptances, truth_speeds

#: Cuts of a sample campaign that is made on the spot: three in ten of those in the repository's, and a good answer all the same.
SAMPLE_CUTS = 24


def simulate_campaign(
    machine: str | Path | MachineFile,
    out: str | Path,
    seed: int = 1,
    progress: Progress | None = None,
    mapper: Map = map,
) -> SimulatedCampaign:
    """Let a virtual machine make its cuts; write the campaign into `out` and the truth into ``<out>.truth``.

    `machine`: path of a machine file, or what was read from one
    `out`: a folder that does not exist yet, or an empty one
    `seed`: same seed, same files
    `progress`: callable of (done, total)
    `mapper`: callable like `map`
    """
    setup = machine if isinstance(machine, MachineFile) else read_machine(machine)
    toolings = [read_tooling(path) for path in setup.toolings]
    known = [*toolings, *(read_tooling(path) for path in setup.truth_toolings)]
    if len({t.name for t in known}) != len(known):
        raise InputError("cuts.toolings", ", ".join(t.name for t in known), "toolings with different names")
    cuts = simulate(setup, toolings, seed, mapper)
    truths = (true_receptances(setup, tooling, speed) for tooling in known for speed in truth_speeds(setup))
    return write_simulation(out, setup, toolings, cuts, truths, true_flange(setup), progress, seed)


def sample_robot(name: str) -> RobotModel:
    """Return a published arm: ``tx200``, ``kr210`` or ``kr500``, which has no masses.

    Parameters
    ----------
    name : str

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> print(ri.sample_robot("tx200"))
    Stäubli TX200: 6 joints, 18 freedoms, 1045 kg
    """
    known = sample_robots()
    if name not in known:
        raise InputError("robot", name, f"one of {', '.join(known)}")
    return read_robot(known[name])


def sample_toolings() -> dict[str, Path]:
    """Return the files of the sample machine's toolings by their names: two that a campaign cuts with, and two that never cut."""
    return {path.stem: path for path in sorted((sample_data() / "toolings").glob("*.toml"))}


def sample_tooling(name: str) -> Tooling:
    """Return a tooling of the sample machine, as ``S3-PG25-long``, which no sample campaign cuts with.

    Parameters
    ----------
    name : str

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> print(ri.sample_tooling("S3-PG25-long"))
    S3-PG25-long: 4 teeth, Ø12 mm, helix 30°, stickout 65.9 mm, insertion 44 mm, holder 100 mm
    """
    known = sample_toolings()
    if name not in known:
        raise InputError("tooling", name, f"one of {', '.join(known)}")
    return read_tooling(known[name])


def make_sample_campaign(
    folder: str | Path,
    cuts: int = SAMPLE_CUTS,
    seed: int = 1,
    progress: Progress | None = None,
    mapper: Map = map,
) -> Path:
    """Have the sample machine make a campaign, unless the folder holds one already, and return the folder.

    `folder`: what is true of the machine goes beside it, into ``<folder>.truth``; no reader of the folder sees that
    `cuts`: half of them with each of two toolings, each with its air cut
    `seed`, `progress`, `mapper`: as of `simulate_campaign`
    """
    folder = Path(folder)
    if (folder / CAMPAIGN_FILE).is_file():
        return folder
    machine = sample_machine(cuts)
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError("folder", str(folder), "a campaign, an empty folder, or one that does not exist")
    return simulate_campaign(machine, folder, seed, progress, mapper).folder


def sample_machine(cuts: int = SAMPLE_CUTS) -> MachineFile:
    """Return the sample machine with a plan of so many cuts, half of them with each of its two toolings."""
    machine = read_machine(sample_data() / "hpm.toml")
    each = cuts // len(machine.toolings)
    if each < 1 or each * len(machine.toolings) != cuts:
        raise InputError("cuts", cuts, f"a multiple of {len(machine.toolings)}: so many toolings cut")
    speeds = np.linspace(machine.plan.spindle_speeds[0], machine.plan.spindle_speeds[-1], each)
    return replace(machine, plan=replace(machine.plan, spindle_speeds=tuple(speeds.tolist())))
