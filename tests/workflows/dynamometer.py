"""A dynamometer under the virtual machine's cuts: true forces from the time march, then the sensor's own dynamics and noise."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import scipy.signal

from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.io.machines import read_machine
from rcsa_ident.io.setups import read_tooling
from rcsa_ident.virtual.milling import mill_cut
from rcsa_ident.virtual.reduction import poles, reduced
from rcsa_ident.virtual.rotor import rotor
from rcsa_ident.virtual.sensors import padding, sample

MACHINES = Path(__file__).resolve().parents[2] / "data" / "machines"
COEFFICIENTS = CuttingCoefficients(800e6, 0.3, tangential_edge=12e3, radial_edge=9e3)
TRUE = np.array([800e6, 240e6, 12e3, 9e3])
CUTTER = Cutter(4, 0.012, np.radians(30.0))
RPM = np.pi / 30.0
FEEDS = (4e-5, 6e-5, 8e-5, 1e-4, 1.2e-4)
DOWN, SLOT = Engagement(0.5 * np.pi, np.pi), Engagement(0.0, np.pi)
_OVER = 8


@cache
def dynamics(name: str):
    """Poles of a virtual machine with its first tooling, at 1000 rad/s."""
    machine = read_machine(MACHINES / f"{name}.toml")
    return poles(reduced(rotor(machine.spindle, read_tooling(machine.toolings[0]).assembly)), 1000.0)


def true_force(conditions, duration, rate, angle, runout=0.0, machine="hpm", resonance=(), cutter=CUTTER):
    """Force on the tool that vibrates and leaves the cut where it does, sampled with an anti-alias filter, shape (n, 2) [N].

    `resonance` holds frequency [Hz] and damping of the dynamometer along X and Y.
    """
    step, count, lead = 1.0 / (rate * _OVER), round(duration * rate), padding(_OVER)
    settling = round(0.1 / step)
    total = settling + _OVER * (count - 1 + 2 * lead) + 1
    start = angle - conditions.spindle_speed * step * (settling + _OVER * lead)
    eccentric = replace(cutter, runout=runout * np.cos(cutter.tooth_angle - 1.1))
    force = mill_cut(dynamics(machine), eccentric, conditions, COEFFICIENTS, step, total, start).force.copy()
    for axis, (frequency, damping) in enumerate(resonance):
        w = 2.0 * np.pi * frequency
        b, a, _ = scipy.signal.cont2discrete(([w * w], [1.0, 2.0 * damping * w, w * w]), step, method="foh")
        force[:, axis] = scipy.signal.lfilter(b.ravel(), a, force[:, axis])
    return np.stack([sample(force[settling:, i], _OVER, step, 0.0, None) for i in (0, 1)], axis=1)


def plan(depth=4e-4, engagement=DOWN, speed=6000.0 * RPM):
    return [CuttingConditions(speed, depth, feed, engagement) for feed in FEEDS]
