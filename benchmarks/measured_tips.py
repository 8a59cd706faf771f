"""Limits of tips that were measured with noise, beside the exact receptance's: how much noise a fit of modes takes for the tip.

``python -m benchmarks measured_tips``. The tip of each machine's first tooling at standstill (`benchmarks.machines`, seeds fixed long
before), 100 to 5000 Hz in lines of 1 Hz, with noise of several kinds; limits by full discretisation at nine speeds up to 30 mm. The
truth is another route: multi-frequency limits of the receptance without noise, to which nothing is fitted. Beside it stands the same
fit, not told of the noise: its error, and how many times longer it and its limits take. A measured file, where it is there, has no truth:
limits of its even and of its odd lines are compared.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Sequence
from multiprocessing import get_context
from pathlib import Path
from unittest.mock import patch

import numpy as np

from benchmarks.machines import named, random_machine
from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.units import from_hz, from_rpm
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.io.settings.machines import MachineFile, read_machine
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.stability import tip_modes
from rcsa_ident.stability.discretisation import FullDiscretisation
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.multi_frequency import MultiFrequency
from rcsa_ident.stability.tip_modes import TIP, fitted_modes
from rcsa_ident.virtual.rotor import frequency_response, rotor

OMEGA, SPEEDS, DEEPEST = from_hz(np.arange(100.0, 5001.0)), from_rpm(np.linspace(4000.0, 14_000.0, 9)), 30e-3
#: Modes of a stiff tip: frequency [Hz], damping ratio, stiffness [N/m].
STIFF = ((900.0, 0.03, 2e8), (2300.0, 0.03, 3e8), (4800.0, 0.02, 3e8), (9000.0, 0.02, 4e8))
#: Of one hit at the tip of a real tool: frequency [Hz], real and imaginary part [m/N].
HIT = Path(__file__).resolve().parents[2] / "shared" / "data" / "hammer" / "frf_tip_from_point_1.txt"


def white(rng: np.random.Generator) -> ComplexArray:
    """Alike at all lines."""
    return rng.standard_normal(OMEGA.size) + 1j * rng.standard_normal(OMEGA.size)


def accelerometer(rng: np.random.Generator) -> ComplexArray:
    """Alike in acceleration, as white noise at 1 kHz."""
    return white(rng) * (from_hz(1000.0) / OMEGA) ** 2


def hann(rng: np.random.Generator) -> ComplexArray:
    """Neighbours share what a Hann window smears."""
    found: ComplexArray = np.convolve(white(rng), np.array([-0.5, 1.0, -0.5]) / np.sqrt(1.5), "same")
    return found


#: Kinds of noise, and its standard deviation over the largest value.
NOISES: dict[str, tuple[Callable[[np.random.Generator], ComplexArray], float]] = {
    "none": (white, 0.0),
    "white, 0.1 %": (white, 1e-3),
    "white, 1 %": (white, 1e-2),
    "accelerometer's, 0.1 % at 1 kHz": (accelerometer, 1e-3),
    "Hann window's, 1 %": (hann, 1e-2),
}


def limits(tip: Receptance, process: MillingProcess) -> tuple[FloatArray, int, float]:
    """Return the limits of a tip, its modes and the processor time [s]."""
    start = time.process_time()
    modes, _ = fitted_modes(tip)
    found = stability_lobes(modes, process, SPEEDS, DEEPEST, FullDiscretisation()).limit_depth
    return found, modes.pole.size, time.process_time() - start


def untold(tip: Receptance, process: MillingProcess) -> tuple[FloatArray, int, float]:
    """The same by a fit that is not told of the noise."""
    with patch.object(tip_modes, "_allowed", lambda _: None):
        return limits(tip, process)


def drawn(seed: str) -> tuple[MachineFile, Tooling, MillingProcess]:
    """Return a machine, its first tooling and what that cuts."""
    with tempfile.TemporaryDirectory() as folder:
        machine = read_machine(random_machine(int(seed), Path(folder)))
        tooling = read_tooling(machine.toolings[0])
    engagement = machine.plan.conditions(float(SPEEDS[0])).engagement
    return machine, tooling, MillingProcess(tooling.cutter, machine.workpiece.coefficients, engagement)


def compared(seed: str) -> dict[str, list[tuple[FloatArray, int, float]]]:
    """Return relative errors of the limits, modes and time of both fits, for each kind of noise."""
    machine, tooling, process = drawn(seed)
    names = tuple(str(each) for each in TIP)
    exact = frequency_response(rotor(machine.spindle, tooling.assembly), OMEGA, 0.0, names, names)
    true = stability_lobes(Receptance(OMEGA, exact, TIP, TIP), process, SPEEDS, DEEPEST, MultiFrequency()).limit_depth
    found: dict[str, list[tuple[FloatArray, int, float]]] = {}
    for name, (kind, level) in NOISES.items():
        rng, values = np.random.default_rng(2000 + int(seed)), exact.copy()
        for axis in range(2):
            own = values[:, axis, axis]
            own += np.sqrt(0.5) * level * np.abs(own).max() * kind(rng)
        tip = Receptance(OMEGA, values, TIP, TIP)
        rows = [way(tip, process) for way in (limits, untold)]
        found[name] = [(np.abs(np.minimum(own, DEEPEST) / np.minimum(true, DEEPEST) - 1.0), modes, spent) for own, modes, spent in rows]
    return found


def halves(path: Path, way: Callable[[Receptance, MillingProcess], tuple[FloatArray, int, float]]) -> FloatArray:
    """Return by how much limits of a measured file's even and odd lines differ, relative; from 120 Hz on, below which the sensor drifts."""
    hertz, real, imaginary = np.loadtxt(path, skiprows=1, unpack=True)[:3, 120:]
    values = np.zeros((hertz.size, 2, 2), dtype=complex)
    values[:, 0, 0] = values[:, 1, 1] = real + 1j * imaginary
    _, _, process = drawn("1")
    even, odd = (way(Receptance(from_hz(hertz[k::2]), values[k::2], TIP, TIP), process)[0] for k in (0, 1))
    return np.abs(np.minimum(even, DEEPEST) / np.minimum(odd, DEEPEST) - 1.0)


def stiff(way: Callable[[Receptance, MillingProcess], tuple[FloatArray, int, float]]) -> float:
    """Return the processor time of a stiff tip in 15 000 lines with 0.1 % of noise [s]."""
    omega, rng = from_hz(np.arange(100.0, 15_001.0)), np.random.default_rng(1)
    values = np.zeros((omega.size, 2, 2), dtype=complex)
    for axis in range(2):
        own = values[:, axis, axis]
        for hertz, zeta, stiffness in STIFF:
            natural = from_hz(hertz * (1.0 + 0.05 * axis))
            own += natural**2 / stiffness / (natural**2 - omega**2 + 2j * zeta * natural * omega)
        own += 1e-3 * np.abs(own).max() * (rng.standard_normal(omega.size) + 1j * rng.standard_normal(omega.size))
    return way(Receptance(omega, values, TIP, TIP), drawn("1")[2])[2]


def main(arguments: Sequence[str]) -> None:
    """Print the table; names of machines may be given."""
    seeds = named(list(arguments) or ["drawn"])
    with get_context("spawn").Pool(2) as pool:
        found = pool.map(compared, seeds, chunksize=1)
    print("| noise | error of limits: median, largest | modes | not told of it: median, largest | modes | its time over ours |")
    print("|---|---|---|---|---|---|")
    for name in NOISES:
        ours, theirs = ([machine[name][k] for machine in found] for k in (0, 1))
        told = []
        for rows in (ours, theirs):
            error = np.concatenate([row[0] for row in rows])
            modes = [row[1] for row in rows]
            told.append(f"{np.median(error):.4f}, {error.max():.4f} | {min(modes)} to {max(modes)}")
        ratio = sum(row[2] for row in theirs) / sum(row[2] for row in ours)
        print(f"| {name} | {' | '.join(told)} | {ratio:.1f} |")
    print(f"a stiff tip up to 15 kHz: {stiff(untold) / stiff(limits):.1f} times ours where the fit is not told")
    if HIT.exists():
        for name, way in (("told", limits), ("not told", untold)):
            apart = halves(HIT, way)
            print(
                f"a real hit, {name} of its noise: even and odd lines' limits differ by {np.median(apart):.4f} (median), {apart.max():.4f}"
            )


if __name__ == "__main__":
    main([])
