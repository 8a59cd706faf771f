"""Campaigns whose drawings are only roughly right: toolings, clampings, coefficients, sensors and depths differ from what is told.

Seeds of the machines, `ROUGH` and `ROUGH_DEVELOPMENT`, and the distributions here were fixed on 2026-11-24, before the identification
took anything of a tooling for unknown. A machine, its drawn toolings and its plan are those of `benchmarks.machines` for the same seed;
what is true differs from them by chances of its own:

* tool and holder by the spreads that a tooling file takes by default, but for the contact's damping, which is half as wide; those of one
  model are alike in all clampings,
* the contact and the flange's joint by a little more in each clamping,
* K_tc by 2 %, the radial ratio by 9 %, edge forces of up to some 10 N/mm that nobody tells,
* gap sensors by 2 % of gain and 1.5 % of cross-talk,
* the depth by 0.02 mm in all cuts of a tooling and 0.005 mm in each,
* bearings that soften by up to a tenth to the fastest speed.
"""

from __future__ import annotations

import contextlib
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from benchmarks.machines import CUT, HELD_OUT, random_machine
from rcsa_ident.cutting.conditions import CuttingConditions
from rcsa_ident.io.settings.machines import MachineFile, read_machine
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.io.settings.simulations import write_simulation
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.tool_holder.alteration import Alteration, altered
from rcsa_ident.tool_holder.spread import Spread
from rcsa_ident.virtual.campaign import SimulatedCut
from rcsa_ident.virtual.machine import CutPlan
from rcsa_ident.workflows.simulate import simulate, true_flange, true_receptances

ROUGH = tuple(range(401, 411))
ROUGH_DEVELOPMENT = (501, 502, 503)
#: Standard deviations of what toolings do not hold: of logarithms, of the forces [N/m] and of the depths [m].
TANGENTIAL, RATIO, EDGE, GAIN, CROSS_TALK, DEPTH, DEPTH_OF_CUT = 0.02, 0.09, 10e3, 0.02, 0.015, 0.02e-3, 0.005e-3
#: Share of the bearings' stiffness that is lost at the fastest speed, at most.
SOFTER = 0.1
#: What a tooling file says of itself.
_SPREAD = "\n[spread]  # the defaults: what an honest drawing is good for\n"


@dataclass(frozen=True, slots=True)
class _RoughPlan(CutPlan):
    """Cuts that are not exactly as deep as programmed: differences [m] by speed."""

    deeper: Mapping[float, float] = field(default_factory=dict)

    def conditions(self, spindle_speed: float) -> CuttingConditions:
        told = CutPlan.conditions(self, spindle_speed)
        return replace(told, axial_depth=told.axial_depth + self.deeper.get(spindle_speed, 0.0))


@dataclass(frozen=True, slots=True)
class RoughMachine:
    """What is told of a machine, and what is true.

    `toolings`: mapping of name to Tooling, as drawn: those of the cuts, then those that never cut
    `true`: mapping of name to (MachineFile, Tooling); the machine as each of them is clamped in it, and the tooling as it is
    `alterations`: mapping of name to Alteration
    `gains`, `cross_talk`: (float, float) [-]; of the gap sensors of X and Y
    """

    told: MachineFile
    toolings: Mapping[str, Tooling]
    true: Mapping[str, tuple[MachineFile, Tooling]]
    alterations: Mapping[str, Alteration]
    gains: tuple[float, float]
    cross_talk: tuple[float, float]


def rough_machine(scratch: Path, seed: int) -> RoughMachine:
    """Return a drawn machine; its files are written to `scratch` where they are not there."""
    folder = scratch / f"rough-{seed}" / "machine"
    if not folder.is_dir():
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=scratch) as half, contextlib.suppress(OSError):
            random_machine(seed, Path(half) / "machine")
            for name, (tool, holder) in _models(Path(half) / "machine").items():
                path = Path(half) / "machine" / "toolings" / f"{name}.toml"
                text = path.read_text("utf-8").replace("[tool]\n", f'[tool]\nmodel = "{tool}"\n')
                path.write_text(text.replace("[holder]\n", f'[holder]\nmodel = "{holder}"\n') + _SPREAD, encoding="utf-8")
            (Path(half) / "machine").rename(folder)
    told = read_machine(folder / "machine.toml")
    # sensors and forces are told without what nobody knows of them
    known = replace(told.workpiece.coefficients, tangential_edge=0.0, radial_edge=0.0)
    told = replace(told, sensors=replace(told.sensors, trigger=False), workpiece=replace(told.workpiece, coefficients=known))
    toolings = {name: read_tooling(folder / "toolings" / f"{name}.toml") for name in (*CUT, *HELD_OUT)}
    return _drawn_truth(told, toolings, np.random.default_rng([seed, 1]))


def _models(folder: Path) -> dict[str, tuple[str, str]]:
    """Models of each tooling's tool and holder: alike where the drawings are, but for a tool's stickout."""
    assemblies = {name: read_tooling(folder / "toolings" / f"{name}.toml").assembly for name in (*CUT, *HELD_OUT)}
    tools: dict[tuple, str] = {}
    holders: dict[tuple, str] = {}
    found = {}
    for name, each in assemblies.items():
        front = each.tool[0]
        tool = (front.length, front.diameter, front.material, each.tool[-1].diameter)
        found[name] = (
            tools.setdefault(tool, f"tool {len(tools) + 1}"),
            holders.setdefault((each.holder, each.insertion), f"holder {len(holders) + 1}"),
        )
    return found


def _drawn_truth(told: MachineFile, toolings: Mapping[str, Tooling], rng: np.random.Generator) -> RoughMachine:
    """Draw what is true."""
    spread, plan = Spread(), told.plan
    tool_rng, holder_rng, clamping_rng, machine_rng = rng.spawn(4)
    tools: dict[str, tuple[float, float, float]] = {}
    holders: dict[str, tuple[float, float, float, float, float]] = {}
    for each in toolings.values():
        if each.tool_model not in tools:
            diameter, modulus, length = tool_rng.normal(size=3) * (spread.fluted_diameter, spread.youngs_modulus, spread.segment_length)
            tools[each.tool_model] = (float(diameter), float(modulus), float(length))
        if each.holder_model not in holders:
            stiff, damped, wide = spread.contact_stiffness, spread.contact_damping, spread.holder_diameter
            # dampings of log-normal size e would leave none or all of it: half as wide is as rough as a shop floor
            drawn = holder_rng.normal(size=5) * (stiff, stiff, 0.5 * damped, 0.5 * damped, wide)
            k_t, k_r, c_t, c_r, width = (float(value) for value in drawn)
            holders[each.holder_model] = (k_t, k_r, c_t, c_r, width)
    softer = machine_rng.uniform(0.0, SOFTER) / max(plan.programmed)
    coefficients = replace(
        told.workpiece.coefficients,
        tangential=told.workpiece.coefficients.tangential * float(np.exp(machine_rng.normal() * TANGENTIAL)),
        radial_ratio=told.workpiece.coefficients.radial_ratio * float(np.exp(machine_rng.normal() * RATIO)),
        tangential_edge=abs(machine_rng.normal()) * EDGE,
        radial_edge=abs(machine_rng.normal()) * EDGE,
    )
    gains, talk = machine_rng.normal(size=2) * GAIN, machine_rng.normal(size=2) * CROSS_TALK
    bearings = tuple(replace(b, softening=max(b.softening, softer)) for b in told.spindle.bearings)
    alterations, true = {}, {}
    for name, each in toolings.items():
        diameter, modulus, length = tools[each.tool_model]
        k_t, k_r, c_t, c_r, wide = holders[each.holder_model]
        again = clamping_rng.normal(size=3) * (spread.reclamping, spread.reclamping, spread.stickout)
        joint = np.exp(clamping_rng.normal(size=2) * spread.spindle_joint)
        by = Alteration(
            stickout=float(again[2]),
            fluted_length=length,
            fluted_diameter=diameter,
            youngs_modulus=modulus,
            translational_stiffness=k_t + float(again[0]),
            rotational_stiffness=k_r + float(again[1]),
            translational_damping=c_t,
            rotational_damping=c_r,
            holder_diameter=wide,
        )
        clamped = replace(
            told.spindle.joint,
            translational_stiffness=told.spindle.joint.translational_stiffness * joint[0],
            rotational_stiffness=told.spindle.joint.rotational_stiffness * joint[1],
        )
        deeper = clamping_rng.normal() * DEPTH + clamping_rng.normal(size=len(plan.spindle_speeds)) * DEPTH_OF_CUT
        own = _RoughPlan(
            **{key: getattr(plan, key) for key in CutPlan.__dataclass_fields__},
            deeper=dict(zip(plan.spindle_speeds, deeper.tolist(), strict=True)),
        )
        spindle = replace(told.spindle, bearings=bearings, joint=clamped)
        machine = replace(told, spindle=spindle, plan=own, workpiece=replace(told.workpiece, coefficients=coefficients))
        alterations[name] = by
        true[name] = (machine, replace(each, assembly=altered(each.assembly, by)))
    pair = (float(gains[0]), float(gains[1])), (float(talk[0]), float(talk[1]))
    return RoughMachine(told, toolings, true, alterations, *pair)


def rough_campaign(
    scratch: Path, seed: int, cut: Sequence[str] = CUT, name: str = "campaign", speeds: Sequence[int] | None = None
) -> tuple[RoughMachine, Path]:
    """Return a rough machine and the folder of its campaign, simulated if it is not there.

    `cut`: toolings that cut
    `name`: of the folder
    `speeds`: which of the plan's speeds, by their number; all by default
    """
    machine = rough_machine(scratch, seed)
    folder = scratch / f"rough-{seed}" / name
    if folder.is_dir():
        return machine, folder
    if speeds is not None:
        machine = _at_speeds(machine, speeds)
    told = replace(machine.told, toolings=tuple(p for p in (*machine.told.toolings, *machine.told.truth_toolings) if p.stem in cut))
    first = machine.true[cut[0]][0]
    truths = (true_receptances(*machine.true[each]) for each in machine.toolings)
    with tempfile.TemporaryDirectory(dir=scratch) as half:
        drawn = [machine.toolings[each] for each in cut]
        made = write_simulation(Path(half) / "campaign", told, drawn, _cuts(machine, cut, seed), truths, true_flange(first))
        shutil.rmtree(truth_of(folder), ignore_errors=True)
        made.truth.rename(truth_of(folder))
        made.folder.rename(folder)
    return machine, folder


def _at_speeds(machine: RoughMachine, speeds: Sequence[int]) -> RoughMachine:
    """The machine with a plan of some of its speeds alone."""

    def fewer(file: MachineFile) -> MachineFile:
        return replace(file, plan=replace(file.plan, spindle_speeds=tuple(file.plan.spindle_speeds[k] for k in speeds)))

    true = {name: (fewer(setup), tooling) for name, (setup, tooling) in machine.true.items()}
    return replace(machine, told=fewer(machine.told), true=true)


def truth_of(campaign: Path) -> Path:
    """Return where the truth of a campaign lies."""
    return campaign.with_name(f"{campaign.name}.truth")


def _cuts(machine: RoughMachine, cut: Sequence[str], seed: int) -> Iterator[SimulatedCut]:
    for name in cut:
        setup, tooling = machine.true[name]
        place = list(machine.toolings).index(name)
        for made in simulate(setup, [tooling], 1000 * seed + place):
            yield as_seen(machine, made)


def as_seen(machine: RoughMachine, cut: SimulatedCut) -> SimulatedCut:
    """Return a cut as recorded by sensors whose gains are off and that feel a share of each other's direction."""
    records = {}
    for kind, record in cut.records.items():
        channels = dict(record.channels)
        true = {axis: channels[f"flange_{axis}"] for axis in "xy"}
        for (axis, other), gain, talk in zip(("xy", "yx"), machine.gains, machine.cross_talk, strict=True):
            channels[f"flange_{axis}"] = (1.0 + gain) * (true[axis] + talk * true[other])
        records[kind] = replace(record, channels=channels)
    return replace(cut, records=records)
