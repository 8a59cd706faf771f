"""How wrong a tooltip is before and after a tooling was rung: true machines, drawings as wrong as honest ones are.

Seeds, toolings, tapers and the machines (development ones of the study) were fixed before the method was tuned on any of it. The
identification's model shares neither mesh nor shear coefficient, nut, slots and stud with what rings, see `benchmarks.rings`; on the
machine stands the same true tooling, without nut and slots, as in the study.

    python -m benchmarks ring [--seeds 4] [--draws 40]
"""

from __future__ import annotations

import argparse
import tempfile
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.machines import random_machine
from benchmarks.rings import RATE, Room, alone, hanging, sound
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import from_hz
from rcsa_ident.identification.ring.ringing import UNKNOWNS, RungTooling, _assembly, _whole_tool, learned, prior_std
from rcsa_ident.io.settings.machines import MachineFile, read_machine
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.signals.sound.ring_down import ring_down
from rcsa_ident.tool_holder.geometry import ToolAssembly
from rcsa_ident.tool_holder.spread import Spread
from rcsa_ident.virtual.rotor import frequency_response, rotor

TOOLINGS = Path(__file__).parents[1] / "data" / "machines" / "toolings"
#: Drawing, its taper.
CASES = (("S1-ER32", "HSK-A63"), ("S2-PG25", "HSK-A63"), ("S4-shrink", "HSK-A63"), ("S1-ER32", "BT40"), ("S4-shrink", "BT40"))
FIRST_SEED = 7000
MACHINE = 101
#: Frequencies of the tooltip [Hz].
BAND = np.linspace(600.0, 4000.0, 86)


def true_tooling(drawn: Tooling, rng: np.random.Generator) -> Tooling:
    """Return a tooling that differs from its drawing as its spread says."""
    std = prior_std(drawn)
    unknowns = std * rng.standard_normal(std.size)
    assembly = _assembly(drawn.assembly, unknowns)
    whole = _whole_tool(drawn, unknowns)
    rear = sum(s.length for s in whole) - assembly.tool_length
    behind = (whole[-1].part(whole[-1].length - rear, whole[-1].length),) if drawn.tool_behind else ()
    return replace(drawn, assembly=assembly, tool_behind=behind)


def tip(machine: MachineFile, assembly: ToolAssembly) -> np.ndarray:
    """Return the tip's receptance in X on a machine, shape (n,) [m/N]."""
    return frequency_response(rotor(machine.spindle, assembly), from_hz(BAND), 0.0, ("tip.x",), ("tip.x",))[:, 0, 0]


def apart(found: np.ndarray, true: np.ndarray) -> float:
    """Return how wrong a receptance is [-]."""
    return float(np.linalg.norm(found - true) / np.linalg.norm(true))


def coverage(machine: MachineFile, found: RungTooling, true: np.ndarray, rng: np.random.Generator, draws: int) -> float:
    """Return the share of frequencies at which the magnitude is within the posterior's 90 % band."""
    sizes = np.abs([tip(machine, assembly) for assembly in found.drawn(rng, draws)])
    low, high = np.quantile(sizes, [0.05, 0.95], axis=0)
    return float(np.mean((low <= np.abs(true)) & (np.abs(true) <= high)))


def main(arguments: list[str] | None = None) -> None:
    """Print a line per tooling and seed, and medians."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED)
    parser.add_argument("--draws", type=int, default=0, help="Of the posterior, for the band's coverage.")
    parser.add_argument("--gain-control", action="store_true")
    asked = parser.parse_args(arguments)
    warnings.simplefilter("error")
    rows, names = [], ("drawn", "rung", "bare, rung", "bare, rung, weighed")
    with tempfile.TemporaryDirectory() as folder, threadpool_limits(1):
        machine = read_machine(random_machine(MACHINE, Path(folder)))
        print(
            f"{'tooling':24s}{'seed':>6s}"
            + "".join(f"{name:>20s}" for name in names)
            + "   band   true-found/std: d_flute, E, k_t, k_r, c_t, c_r"
        )
        for name, taper in CASES:
            for seed in range(asked.first_seed, asked.first_seed + asked.seeds):
                row = _case(machine, name, taper, seed, asked.draws, Room(gain_control=asked.gain_control))
                if row is not None:
                    rows.append(row)
    table = np.array(rows)
    print(
        f"{'median':30s}"
        + "".join(f"{value:20.3f}" for value in np.median(table, axis=0)[:4])
        + f"{np.nanmean(table[:, 4]) if asked.draws else np.nan:7.2f}"
    )
    print(f"{'largest':30s}" + "".join(f"{value:20.3f}" for value in np.max(table, axis=0)[:4]))


def _case(machine: MachineFile, name: str, taper: str, seed: int, draws: int, room: Room) -> list[float] | None:
    rng = np.random.default_rng((seed, sum(map(ord, name + taper))))
    drawn = replace(read_tooling(TOOLINGS / f"{name}.toml"), taper=taper, spread=Spread())
    std = prior_std(drawn)
    true = true_tooling(drawn, rng)
    tool = alone(true, rng)
    thing = replace(hanging(true, rng))
    thing = replace(thing, tool=(*tool.tool[:-1], thing.tool[-1]))
    mass = sum(s.mass for s in (*tool.tool, *tool.holder)) * (1.0 + 5e-4 * rng.standard_normal())
    right = tip(machine, true.assembly)
    line = f"{name + ' ' + taper:24s}{seed:6d}"
    try:
        heard = ring_down([(RATE, sound(thing, rng, room=room))])
        bare_heard = ring_down([(RATE, sound(tool, rng, room=room))])
        answers = [learned(drawn, heard), learned(drawn, heard, bare_heard), learned(drawn, heard, bare_heard, mass)]
    except InputError as error:
        print(line, error)
        return None
    errors = [apart(tip(machine, each), right) for each in (drawn.assembly, *(found.after.assembly for found in answers))]
    band = coverage(machine, answers[-1], right, rng, draws) if draws else np.nan
    unknowns = _unknowns(drawn, true)
    away = (answers[-1].mean - unknowns) / np.where(std > 0.0, answers[-1].std, 1.0)
    chosen = [
        UNKNOWNS.index(each)
        for each in (
            "fluted_diameter",
            "youngs_modulus",
            "translational_stiffness",
            "rotational_stiffness",
            "translational_damping",
            "rotational_damping",
        )
    ]
    doubt = f"  ({heard.damping_doubt})" if heard.damping_doubt else ""
    matched = [str(each.mode) if each.mode else "?" for each in answers[-1].lines]
    print(
        line
        + "".join(f"{value:20.3f}" for value in errors)
        + f"{band:7.2f}   "
        + " ".join(f"{away[i]:5.1f}" for i in chosen)
        + f" p={answers[-1].probability:.2g} "
        + ",".join(matched)
        + doubt,
        flush=True,
    )
    return [*errors, band]


def _unknowns(drawn: Tooling, true: Tooling) -> np.ndarray:
    """What the true tooling differs by, of those that are shown."""
    values = dict.fromkeys(UNKNOWNS, 0.0)
    values["fluted_diameter"] = float(np.log(true.assembly.tool[0].diameter / drawn.assembly.tool[0].diameter))
    values["youngs_modulus"] = float(np.log(true.assembly.tool[0].material.youngs_modulus / drawn.assembly.tool[0].material.youngs_modulus))
    for name in ("translational_stiffness", "rotational_stiffness", "translational_damping", "rotational_damping"):
        values[name] = float(np.log(getattr(true.assembly.contact, name) / getattr(drawn.assembly.contact, name)))
    return np.array([values[name] for name in UNKNOWNS])


if __name__ == "__main__":
    main()
