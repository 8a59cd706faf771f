"""Lines as a perfect reader of records would hand them over, from the virtual machine: no model that is fitted has made them."""

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from rcsa_ident.cutting.force import force_lines
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.data import prepare
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.parameters import axis_size
from rcsa_ident.identification.priors import Priors
from rcsa_ident.io.machines import read_machine
from rcsa_ident.io.setups import read_tooling
from rcsa_ident.signals.measurement import AxisLines, CutMeasurement
from rcsa_ident.tool_holder.model import tool_holder_receptance
from rcsa_ident.virtual.rotor import frequency_response, rotor

MACHINES = Path(__file__).parents[2] / "data" / "machines"
HIGHEST = 4300.0


@dataclass(frozen=True)
class Shop:
    """A virtual machine with its toolings, and the true cross receptances at the lines of its cuts.

    `truth[tooling][k]` holds order, omega, values (n, 2) for X and Y, force (n, 2) of cut k.
    """

    machine: object
    toolings: dict
    held_out: object
    truth: dict
    tip_omega: np.ndarray
    tip: np.ndarray

    def measurements(self, rng, names=None, axes=(Dof.X, Dof.Y), noise=2e-10, runout=0.0, change=lambda values, force, axis: values):
        """Cuts with an unknown delay each; displacement noise [m] per real and imaginary part of a line."""
        cuts, delays = [], []
        for name in names or self.truth:
            teeth = self.toolings[name].cutter.teeth
            for k, (order, omega, values, force) in enumerate(self.truth[name]):
                speed = omega[0] / order[0]
                delay = rng.uniform(0.0, 2.0 * np.pi / speed / teeth)
                lines = {}
                for axis in axes:
                    i = 0 if axis is Dof.X else 1
                    f = force[:, i]
                    scatter = noise * (rng.standard_normal(order.size) + 1j * rng.standard_normal(order.size)) / np.abs(f)
                    still = runout * (rng.standard_normal(order.size) + 1j * rng.standard_normal(order.size)) / f / order
                    variance = np.full(order.size, noise**2) / np.abs(f) ** 2
                    turned = change(values[:, i], f, axis) * np.exp(-1j * omega * delay) + scatter
                    lines[axis] = AxisLines(order, omega, turned + still, still, variance, np.ones(order.size), f)
                cuts.append(CutMeasurement(f"{name}-{k}", name, speed, lines, 0.01 if runout else 0.0))
                delays.append(delay)
        return cuts, np.array(delays)

    def prepare(self, cuts, toolings=None):
        """The identification's own substructure A beside the cuts."""
        toolings = toolings or self.toolings
        receptances = {name: partial(tool_holder_receptance, t.assembly) for name, t in toolings.items()}
        return prepare(cuts, receptances, {name: t.cutter.teeth for name, t in toolings.items()})


@pytest.fixture(scope="session")
def shop():
    return open_shop()


def open_shop(speeds=20):
    machine = read_machine(MACHINES / "hpm.toml")
    toolings = [read_tooling(path) for path in machine.toolings]
    held_out = read_tooling(machine.truth_toolings[1])
    # not the programmed speeds: what a record shows is never quite those
    speeds = np.linspace(8000.0, 20000.0, speeds) * np.pi / 30.0 * (1.0 + 1e-3 * np.sin(np.arange(speeds)))
    truth = {}
    for tooling in toolings:
        model = rotor(machine.spindle, tooling.assembly)
        truth[tooling.name] = []
        for speed in speeds:
            order = tooling.cutter.teeth * np.arange(1, int(2.0 * np.pi * HIGHEST / speed / tooling.cutter.teeth) + 1)
            values = frequency_response(model, order * speed, speed, outputs=("flange.x", "flange.y"))
            force = force_lines(tooling.cutter, machine.plan.conditions(speed), machine.workpiece.coefficients, order)
            truth[tooling.name].append((order, order * speed, np.einsum("nii->ni", values), force))
    omega = 2.0 * np.pi * np.arange(600.0, 4000.0, 20.0)
    tip = frequency_response(rotor(machine.spindle, held_out.assembly), omega, float(speeds.mean()), outputs=("tip.x", "tip.y"))
    return Shop(machine, {t.name: t for t in toolings}, held_out, truth, omega, np.einsum("nii->ni", tip))


def remade(data, theta, orders, rng, noise=1e-2, scatter=0.0):
    """The same cuts with lines of a model at `theta`: for tests of the optimiser and the statistics, not of the physics.

    `noise` and `scatter` are relative, per line; the data know of the first only. Returns the data and the true delays.
    """
    misfit = Misfit(data, Priors(), (0.0,) * len(data.axes))
    models = misfit.evaluate(theta, orders, np.zeros((len(data.cut_ids), 2))).models
    delay = rng.uniform(0.0, data.cut_prior[:, 3])
    axes = []
    for axis, model in zip(data.axes, models, strict=True):
        draws = (rng.standard_normal((2, model.size)) + 1j * rng.standard_normal((2, model.size))) / np.sqrt(2.0)
        lines = model * (1.0 + noise * draws[0] + scatter * draws[1]) * np.exp(-1j * axis.omega * delay[axis.cut])
        variance = 0.5 * max(noise, 1e-6) ** 2 * np.abs(model) ** 2
        axes.append(replace(axis, lines=np.stack([lines, np.zeros_like(lines)], axis=1), variance=variance))
    return replace(data, axes=tuple(axes)), delay


def machine_vector(frequency_hz, seed=1, axes=1):
    """A vector with these natural frequencies and shapes, dampings and a joint as spindles have them."""
    rng = np.random.default_rng(seed)
    m = len(frequency_hz)
    parts = []
    for _ in range(axes):
        part = np.zeros(axis_size(m))
        part[:m] = np.log(2.0 * np.pi * np.asarray(frequency_hz))
        part[m : 3 * m] = rng.choice([-1.0, 1.0], 2 * m) * rng.uniform(0.2, 0.5, 2 * m)
        rows, cols = np.tril_indices(m)
        own = np.log(2.0 * 0.05 * np.exp(part[:m])) / 2.0 - np.log(30.0)
        part[3 * m : -3] = np.where(rows == cols, own[rows], 0.3 * rng.standard_normal(rows.size))
        part[-3:] = [1.0, 0.2, 0.8]
        parts.append(part)
    return np.concatenate([*parts, np.log([2e9, 5e6, 1e3, 10.0])])


@pytest.fixture(scope="session")
def few(shop):
    """Every third cut of both toolings, both axes."""
    cuts, _ = shop.measurements(np.random.default_rng(1), runout=1e-7)
    return shop.prepare(cuts[::3])
