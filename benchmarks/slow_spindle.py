"""``python -m benchmarks slow_spindle``: limits where a vibration is forgotten before the next tooth, beside those of the time domain.

Cuts are drawn in which the structure damps a vibration by 5 to 40 nepers from tooth to tooth. Each has its limit by full discretisation,
by its multipliers alone, and in time, where a push off the steady state has to grow 20 000 times to be chatter (with the linear equations
of the others). Of the first two the ratio to the third is told, and what the one costs more than the other.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from typing import NamedTuple
from unittest.mock import patch

import numpy as np

from rcsa_ident.base.units import to_rpm
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.process import MillingProcess, ProcessDamping
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.modal import normal_modes
from rcsa_ident.stability import multiplier_limits
from rcsa_ident.stability.discretisation import FullDiscretisation
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.methods import StabilityMethod
from rcsa_ident.stability.time_domain import TimeDomain
from rcsa_ident.stability.tip_modes import TipModes

DEEPEST = 20e-3
SHARES = (0.0, 0.05, 0.5, 0.95, 1.0)


class Slow(NamedTuple):
    """A cut, its tip, and the speed [rad/s]."""

    tip: TipModes
    process: MillingProcess
    speed: float
    told: str

    def limit(self, method: StabilityMethod) -> tuple[float, bool, float]:
        """Return the limit [m], whether it is one of what passes, and the seconds of a core that it took."""
        begun = time.process_time()
        found = stability_lobes(self.tip, self.process, np.array([self.speed]), DEEPEST, method)
        spent = time.process_time() - begun
        return float(found.limit_depth[0]), any("thousandfold" in each for each in found.warnings), spent


def drawn(count: int, seed: int) -> Iterator[Slow]:
    """Yield cuts of a mill with one mode in each direction."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        hertz, zeta = np.exp(rng.uniform(np.log(400.0), np.log(2500.0))), np.exp(rng.uniform(np.log(0.01), np.log(0.12)))
        modes = {}
        for axis, times in ((Dof.X, rng.uniform(0.8, 1.2)), (Dof.Y, 1.0)):
            own = 2.0 * np.pi * hertz * times
            modes[axis] = normal_modes(np.array([own]), np.array([zeta]), np.array([[own / np.sqrt(2e6)]]), (Coordinate("tip", axis),))
        teeth, immersion, nepers = int(rng.integers(2, 5)), rng.choice([1.0, 0.5, 0.2]), np.exp(rng.uniform(np.log(5.0), np.log(40.0)))
        wear = rng.uniform(1e-5, 6e-5) if rng.random() < 0.5 else None
        helix = np.radians(30.0) if rng.random() < 0.3 else 0.0
        speed = 2.0 * np.pi / teeth * zeta * 2.0 * np.pi * hertz / nepers
        process = MillingProcess(
            Cutter(teeth, 0.02, helix),
            CuttingCoefficients(8e8, 0.3),
            Engagement.from_immersion(float(immersion), str(rng.choice(["up", "down"]))),
            damping=None if wear is None else ProcessDamping(5e13, wear),
            feed_per_tooth=1e-4,
        )
        told = f"{hertz:.0f} Hz, damping {zeta:.3f}, {teeth} teeth, a/D {immersion:g}, {to_rpm(speed):.0f} rev/min, {nepers:.0f} nepers, "
        told += "sharp" if wear is None else f"wear {1e6 * wear:.0f} um"
        yield Slow(TipModes.of(modes), process, float(speed), told)


def main(arguments: list[str]) -> None:
    """Draw, compute, and print ratios."""
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(prog="benchmarks slow_spindle", description=__doc__, formatter_class=raw)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args(arguments)
    rows, costs = [], []
    for cut in drawn(given.count, given.seed):
        full, passes, spent = cut.limit(FullDiscretisation())
        with patch.object(multiplier_limits, "_passing_limit", lambda *_: None):
            alone, _, less = cut.limit(FullDiscretisation())
        slow = cut.limit(TimeDomain(contact_loss=False))[0]
        costs.append((spent, less))
        print(f"{cut.told}: {1e3 * full:.3f}{'*' if passes else ''}, {1e3 * alone:.3f}, {1e3 * slow:.3f} mm", flush=True)
        if np.isfinite(slow):
            # infinite where there is none
            rows.append((full / slow, alone / slow, passes))
    ratio, alone, passes = np.array(rows).T
    for name, of in (("where it passes", passes == 1.0), ("elsewhere", passes == 0.0)):
        for what, values in (("full discretisation", ratio[of]), ("multipliers alone", alone[of])):
            told = ", ".join(f"{each:.3f}" for each in np.quantile(values, SHARES, method="nearest")) if values.size else "none"
            print(f"{name} ({values.size}): {what} over time: least, 5 %, median, 95 %, most {told}; {np.sum(values > 1.05)} above 1.05")
    with_, without = np.sum(costs, axis=0)
    print(f"processor time over that of multipliers alone: {with_ / without:.3f}")
