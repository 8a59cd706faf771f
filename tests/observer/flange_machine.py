"""The sample machine as a tap test at its flange would give it: modes fitted to the true flange receptances."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from benchmarks.observer import DATA, VirtualCut, virtual_cut
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.dynamics.coordinates import Dof, plane
from rcsa_ident.dynamics.modal import ModalModel
from rcsa_ident.dynamics.rational import rational_fit
from rcsa_ident.identification.posterior import MachineAxis
from rcsa_ident.io.machines import read_machine
from rcsa_ident.machine.spindle import Spindle
from rcsa_ident.virtual.rotor import frequency_response, rotor
from rcsa_ident.workflows.speeds import MachineOverSpeed

MACHINE = Path(DATA) / "machines" / "hpm.toml"
BAND = (2.0 * np.pi * 533.0, 2.0 * np.pi * 4270.0)


@cache
def flange_machine() -> MachineOverSpeed:
    machine = read_machine(MACHINE)
    omega = 2.0 * np.pi * np.arange(20.0, 6000.0, 10.0)
    ports = ("flange.x", "flange.x'", "flange.y", "flange.y'")
    values = frequency_response(rotor(machine.spindle, None), omega, 1000.0, inputs=ports, outputs=ports)
    joint = machine.spindle.joint
    axes = {}
    for i, axis in enumerate((Dof.X, Dof.Y)):
        part = values[:, 2 * i : 2 * i + 2, 2 * i : 2 * i + 2]
        scale = np.array([[1.0, 0.1], [0.1, 0.01]])
        fit = rational_fit(omega, part * scale, tolerance=2e-3)
        modes = fit.modes(rank=1.0)
        # a symmetric residue: both shapes are one up to a factor
        phi = modes.outputs.T * np.sqrt(modes.inputs[:, :1] / modes.outputs[:1].T) / np.array([1.0, 0.1])
        residual = (fit.constant + fit.constant.T) / 2.0 / scale
        axes[axis] = MachineAxis(
            Spindle(
                ModalModel(np.abs(fit.pole), np.clip(-fit.pole.real / np.abs(fit.pole), 1e-9, 1.0), phi, residual, plane("flange", axis))
            ),
            LumpedJoint(joint.translational_stiffness, joint.rotational_stiffness, joint.translational_damping, joint.rotational_damping),
        )
    return MachineOverSpeed(axes)


@cache
def paper_cut() -> VirtualCut:
    return virtual_cut()
