"""Hammer tests alone on the ten drawn machines: how well they tell tools that were never hit.

``python -m benchmarks hammer``. Each machine (`benchmarks.machines`, seeds fixed long before) is hit at standstill with both of its
toolings clamped, at the tip and on the holder in front of its flange, X and Y, the response at the tip. Noise of 1 nm/N a line of 2 Hz, a
gain of each test that is 1 % off (standard deviation); errors over 600 to 4000 Hz against the truth at standstill.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from benchmarks.machines import named, random_machine
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.evidence import EvidenceSelection
from rcsa_ident.identification.hammer_data import with_tests
from rcsa_ident.identification.hammer_lines import HammerLines, noise_of, thinned
from rcsa_ident.io.settings.machines import MachineFile, read_machine
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.tool_holder.model import receptance_at_points
from rcsa_ident.virtual.rotor import frequency_response, rotor

AXES = (Dof.X, Dof.Y)
OMEGA = 2.0 * np.pi * np.arange(100.0, 4301.0, 2.0)
TIP = 2.0 * np.pi * np.arange(600.0, 4000.0, 10.0)
#: Noise of real and imaginary part of a line [m/N], standard deviation of a gain, share that each line is said to be off by.
NOISE, GAIN, SHARE = 1e-9, 0.01, 0.005


def hit(machine: MachineFile, tooling: Tooling, rng: np.random.Generator) -> list[HammerLines]:
    """Return the tests of one tooling."""
    assembly = tooling.assembly
    place = assembly.stickout + sum(segment.length for segment in assembly.holder[:-1])
    model = rotor(machine.spindle, assembly, points={"holder": place})
    tests = []
    for axis in AXES:
        values = frequency_response(model, OMEGA, 0.0, (f"tip.{axis}",), (f"tip.{axis}", f"holder.{axis}"))[:, :, 0]
        for z, true in zip((0.0, place), values.T, strict=True):
            noise = NOISE * (rng.standard_normal(OMEGA.size) + 1j * rng.standard_normal(OMEGA.size))
            value = (1.0 + GAIN * rng.standard_normal()) * true + noise
            variance = noise_of(value)
            kept = thinned(OMEGA, value, variance)
            known = variance[kept] + 0.5 * (SHARE * np.abs(value[kept])) ** 2
            name = f"{tooling.name} {1e3 * z:.0f} {axis}"
            tests.append(HammerLines(name, tooling.name, axis, OMEGA[kept], value[kept], known, 0.0, z))
    return tests


def errors(seed: str) -> dict[str, float]:
    """Return the error of each tooling of a machine, both axes together, and whether the answer is called converged."""
    with tempfile.TemporaryDirectory() as folder:
        machine = read_machine(random_machine(int(seed), Path(folder)))
        hammered = [read_tooling(path) for path in machine.toolings]
        others = [read_tooling(path) for path in machine.truth_toolings]
    rng = np.random.default_rng(1000 + int(seed))
    tests = [test for tooling in hammered for test in hit(machine, tooling, rng)]
    points = {tooling.name: partial(receptance_at_points, tooling.assembly) for tooling in hammered}
    found = EvidenceSelection().run(with_tests(None, tests, points), seed=1)
    result = {"converged": float(str(found.status) == "converged")}
    for tooling in {each.name: each for each in (*hammered, *others)}.values():
        names = tuple(f"tip.{axis}" for axis in AXES)
        true = np.einsum("nii->ni", frequency_response(rotor(machine.spindle, tooling.assembly), TIP, 0.0, names, names))
        tip = found.machine.tip(tooling, TIP, spread=False)
        own = np.stack([tip.between(name, name) for name in names], axis=1)
        result[tooling.name] = float(np.linalg.norm(own - true) / np.linalg.norm(true))
    return result


def main(arguments: Sequence[str]) -> None:
    """Print the table; names of machines may be given."""
    seeds = named(list(arguments) or ["drawn"])
    with get_context("spawn").Pool(2) as pool:
        found = dict(zip(seeds, pool.map(errors, seeds, chunksize=1), strict=True))
    columns = list(next(iter(found.values())))
    print(f"| machine | {' | '.join(columns)} |\n{'|---' * (1 + len(columns))}|")
    for seed, row in found.items():
        print(f"| {seed} | " + " | ".join(f"{row[name]:.4f}" for name in columns) + " |")
    for name, of in (("median", np.median), ("worst", np.max)):
        print(f"| {name} | " + " | ".join(f"{of([row[c] for row in found.values()]):.4f}" for c in columns) + " |")


if __name__ == "__main__":
    main([])
