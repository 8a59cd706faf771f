"""What all searches are measured by, whatever cost and unknowns they have of their own."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.comparison import FREQUENCY, relative_error
from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.modal import ModalModel
from rcsa_ident.identification.data import LEVER, IdentificationData
from rcsa_ident.io.curves.tips import read_frf_csv
from rcsa_ident.io.settings.machines import MachineFile
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.machine.flange_machine import FlangeMachine

#: Model error of the misfit.
SHARE = 0.02


class Yardstick:
    """Measures what was found for one axis by the lines, and by the true tooltips of toolings that never cut."""

    def __init__(self, data: IdentificationData, setup: MachineFile, truth: Path) -> None:
        self.data, self.axis = data, data.axes[0].axis
        self.wanted = []
        for path in setup.truth_toolings:
            tooling = read_tooling(path)
            true = read_frf_csv(truth / "tip" / f"{tooling.name}.csv")
            at = np.searchsorted(true.frequency, FREQUENCY - 1e-6)
            self.wanted.append((tooling, true.values[self.axis.upper()][at]))

    def measure(self, modes: ModalModel, joint: LumpedJoint) -> list[float]:
        """Return the mean squared residual of the lines, and the tooltip errors of the toolings that never cut."""
        omega, tip = 2.0 * np.pi * FREQUENCY, f"tip.{self.axis}"
        machine = FlangeMachine((modes,), (omega[0], omega[-1]), joint)
        errors = [relative_error(machine.tip(tooling, omega).between(tip, tip), true) for tooling, true in self.wanted]
        return [lines_misfit(self.data, modes, joint), *errors]


def lines_misfit(data: IdentificationData, modes: ModalModel, joint: LumpedJoint) -> float:
    """Return the mean squared residual of an axis' lines in deviations of noise and `SHARE` of each line, each cut at its best delay."""
    axis = data.axes[0]
    measured = axis.measured
    weight = 1.0 / (axis.noise + 0.5 * SHARE**2 * np.abs(measured) ** 2)
    model = cross_receptance(modes, joint, axis.omega, axis.flange, axis.tip)
    cuts = len(data.cut_ids)
    period = data.cut_prior.tooth_period
    best, width, reach = 0.5 * period, 0.5 * period, 64
    for _ in range(4):
        trial = best[:, None] + width[:, None] * np.linspace(-1.0, 1.0, reach + 1)
        turned = weight[:, None] * np.abs(measured[:, None] * np.exp(1j * axis.omega[:, None] * trial[axis.cut]) - model[:, None]) ** 2
        cost = np.zeros((cuts, reach + 1))
        np.add.at(cost, axis.cut, turned)
        least = np.argmin(cost, axis=1)
        best, width, reach = trial[np.arange(cuts), least], 2.0 * width / reach, 16
    return float(np.sum(np.min(cost, axis=1)) / (2.0 * measured.size))


def cross_receptance(modes: ModalModel, joint: LumpedJoint, omega: FloatArray, flange: ComplexArray, tip: ComplexArray) -> ComplexArray:
    """Return C31 = B [A22 + 1/K + B]^-1 A21 at lines of any tooling (slopes scaled by the lever), shape (n,) [m/N]."""
    lever = np.array([1.0, LEVER])
    block = modes.receptance(omega).values * np.outer(lever, lever)
    total = block + np.stack([flange[:, :2], flange[:, 1:]], axis=1)
    total[:, [0, 1], [0, 1]] += joint.compliance_along(omega, (Dof.X, Dof.SLOPE_X)) * lever**2
    return np.einsum("ni,ni->n", block[:, 0], np.linalg.solve(total, tip[:, :, None])[:, :, 0])
