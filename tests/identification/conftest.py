"""Lines as a perfect reader of records would hand them over, from the virtual machine: no model that is fitted has made them."""

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from rcsa_ident.cutting.force import force_and_slope
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.data import prepare
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.parameters import DAMPING_UNIT, JOINT, flange_layout
from rcsa_ident.identification.priors import Priors
from rcsa_ident.io.machines import read_machine
from rcsa_ident.io.setups import read_tooling
from rcsa_ident.signals.frf import AxisLines
from rcsa_ident.signals.measurement import CutMeasurement
from rcsa_ident.tool_holder.model import tool_holder_receptance
from rcsa_ident.virtual.rotor import frequency_response, rotor

MACHINES = Path(__file__).parents[2] / "data" / "machines"
HIGHEST = 4300.0
AXES = (Dof.X, Dof.Y)
TIP_OMEGA = 2.0 * np.pi * np.arange(600.0, 4000.0, 20.0)


@dataclass(frozen=True)
class Shop:
    """A virtual machine with its toolings, and the true cross receptances at the lines of its cuts.

    `truth[tooling][k]` holds order, omega, values (n, 2, 2) of cut k: X and Y, gap and fixture.
    """

    machine: object
    toolings: dict
    held_out: object
    truth: dict

    def tip(self, speed):
        """True tooltip FRFs of the tooling that never cuts, shape (n, 2), at `TIP_OMEGA`."""
        model = rotor(self.machine.spindle, self.held_out.assembly)
        return np.einsum("nii->ni", frequency_response(model, TIP_OMEGA, speed, outputs=("tip.x", "tip.y")))

    def force(self, name, order, speed, coefficients=None):
        """Simulated force (n, 2) and its slopes (n, 2, 5), with the workpiece's own coefficients by default."""
        coefficients = coefficients or self.machine.workpiece.coefficients
        return force_and_slope(self.toolings[name].cutter, self.machine.plan.conditions(speed), coefficients, order)

    def measurements(
        self,
        rng,
        names=None,
        axes=AXES,
        noise=2e-10,
        runout=0.0,
        change=lambda values, force, axis: values,
        fixture=True,
        trigger=None,
        believed=None,
    ):
        """Cuts with an unknown delay each, and the delays.

        Parameters
        ----------
        noise : float [m]
            Per real and imaginary part of a gap's line; half of it for the fixture.
        change : callable
            Of true values (n, o), force and axis: what the sensors make of them.
        fixture : bool
            Gap and fixture are two outputs.
        trigger : mapping of tooling to (tooth angle, whether it is known), optional
        believed : CuttingCoefficients, optional
            What the simulated force is made with; the workpiece's own by default.
        """
        cuts, delays = [], []
        for name in names or self.truth:
            teeth = self.toolings[name].cutter.teeth
            for k, (order, omega, values) in enumerate(self.truth[name]):
                speed = omega[0] / order[0]
                delay = rng.uniform(0.0, 2.0 * np.pi / speed / teeth)
                true_force = self.force(name, order, speed)[0]
                force, slope = self.force(name, order, speed, believed)
                lines = {}
                for axis in axes:
                    i = 0 if axis is Dof.X else 1
                    f = force[:, i, None]

                    def draws(f=f):
                        return (rng.standard_normal((f.size, 2)) + 1j * rng.standard_normal((f.size, 2))) / f

                    deviation = noise * np.array([1.0, 0.5])
                    scatter, still = deviation * draws(), runout * draws() / order[:, None] * np.array([1.0, 0.0])
                    variance = deviation**2 / np.abs(f) ** 2
                    moved = change(values[:, i], f[:, 0], axis) * true_force[:, i, None] / f
                    turned = moved * np.exp(-1j * omega * delay)[:, None] + scatter
                    whole = AxisLines(order, omega, turned + still, still, variance, np.ones(order.size), f[:, 0], slope[:, i])
                    lines[axis] = whole if fixture else whole.summed()
                given = {}
                if trigger is not None:
                    angle, known = trigger[name]
                    given = {"delay": delay - (0.0 if known else angle / speed), "delay_std": 2e-7, "tooth_angle_known": known}
                cuts.append(CutMeasurement(f"{name}-{k}", name, speed, lines, 0.01 if runout else 0.0, **given))
                delays.append(delay)
        return cuts, np.array(delays)

    def prepare(self, cuts, toolings=None, spread=()):
        """The identification's own substructure A beside the cuts."""
        toolings = toolings or self.toolings
        receptances = {name: partial(tool_holder_receptance, t.assembly) for name, t in toolings.items()}
        return prepare(cuts, receptances, {name: t.cutter.teeth for name, t in toolings.items()}, spread)


@pytest.fixture(scope="session")
def shop():
    return open_shop()


def open_shop(speeds=20, change=lambda spindle: spindle):
    """The sample machine's shop; `change` alters the spindle."""
    machine = read_machine(MACHINES / "hpm.toml")
    machine = replace(machine, spindle=change(machine.spindle))
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
            outputs = ("flange.x", "flange.y", "fixture.x", "fixture.y")
            values = frequency_response(model, order * speed, speed, outputs=outputs)
            flange, fixture = np.einsum("nii->ni", values[:, :2]), np.einsum("nii->ni", values[:, 2:])
            truth[tooling.name].append((order, order * speed, np.stack([flange - fixture, fixture], axis=2)))
    return Shop(machine, {t.name: t for t in toolings}, held_out, truth)


def remade(data, theta, layout, rng, noise=1e-2, scatter=0.0):
    """The same cuts with lines of a model at `theta`: for tests of the optimiser and the statistics, not of the physics.

    `noise` and `scatter` are relative, per line; the data know of the first only. Returns the data and the true delays.
    """
    misfit = Misfit(data, Priors(), (0.0,) * len(data.axes))
    models = misfit.evaluate(theta, layout, np.zeros((len(data.cut_ids), 2))).models
    delay = rng.uniform(0.0, data.cut_prior.tooth_period)
    axes = []
    for axis, model in zip(data.axes, models, strict=True):
        draws = (rng.standard_normal((2, *model.shape)) + 1j * rng.standard_normal((2, *model.shape))) / np.sqrt(2.0)
        lines = model * (1.0 + noise * draws[0] + scatter * draws[1]) * np.exp(-1j * axis.omega * delay[axis.cut])[:, None]
        variance = 0.5 * max(noise, 1e-6) ** 2 * np.abs(model) ** 2
        axes.append(replace(axis, lines=np.stack([lines, np.zeros_like(lines)], axis=2), variance=variance))
    return replace(data, axes=tuple(axes)), delay


def vector_of(layout, frequency_hz, seed=1):
    """A vector of a layout with these natural frequencies (one list for each axis), all else as spindles have it."""
    rng = np.random.default_rng(seed)
    theta = np.zeros(layout.size)
    for i, (axis, hertz) in enumerate(zip(layout.axes, frequency_hz, strict=True)):
        m = axis.modes
        part = theta[layout.axis(i)]
        part[:m] = np.log(2.0 * np.pi * np.asarray(hertz))
        part[m : 3 * m] = rng.choice([-1.0, 1.0], 2 * m) * rng.uniform(0.2, 0.5, 2 * m)
        rows, cols = np.tril_indices(m)
        own = np.log(2.0 * 0.05 * np.exp(part[:m])) / 2.0 - np.log(DAMPING_UNIT)
        part[3 * m : axis.core - 3] = np.where(rows == cols, own[rows], 0.3 * rng.standard_normal(rows.size))
        part[axis.core - 3 : axis.core] = [1.0, 0.2, 0.8]
        if axis.fixture:
            part[axis.core : axis.core + m] = 0.1 * rng.standard_normal(m)
            part[axis.core + m : axis.core + m + 2] = [0.3, -0.2]
        if axis.softening:
            part[axis.size - axis.pairs :] = 0.03 * rng.standard_normal(axis.pairs)
    theta[layout.joint] = np.log([2e9, 5e6, 1e3, 10.0])
    theta[layout.force] = 0.05 * rng.standard_normal(layout.coefficients)
    theta[layout.clamping] = rng.uniform(-1.0, 1.0, layout.clampings)
    return theta


def machine_vector(frequency_hz, seed=1):
    """A vector of one axis, its flange the only output."""
    return vector_of(flange_layout(len(frequency_hz)), (frequency_hz,), seed)


def own(theta):
    """The part of an only axis."""
    return theta[:-JOINT]


@pytest.fixture(scope="session")
def few(shop):
    """Every third cut of both toolings, both axes, the flange's motion alone."""
    cuts, _ = shop.measurements(np.random.default_rng(1), runout=1e-7, fixture=False)
    return shop.prepare(cuts[::3])


@pytest.fixture(scope="session")
def rich(shop):
    """The same cuts with all that the data may hold: two outputs, triggers of unknown tooth angle, uncertain forces, smooth errors."""
    first, second = shop.truth
    cuts, _ = shop.measurements(np.random.default_rng(1), runout=1e-7, trigger={first: (0.7, False), second: (-0.4, False)})
    return shop.prepare(cuts[::3], spread=(0.05, 0.1, 0.0, 0.0)).with_smooth_errors(2e-3, 2)
