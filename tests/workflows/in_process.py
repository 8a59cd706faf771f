"""A virtual machine's flange as modes at a spindle speed: what a perfect identification would return."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.dynamics.coordinates import Dof, plane
from rcsa_ident.dynamics.modal import ModalModel
from rcsa_ident.io.settings.machines import read_machine
from rcsa_ident.machine.flange_machine import FlangeMachine
from rcsa_ident.virtual.reduction import poles, reduced
from rcsa_ident.virtual.rotor import rotor

MACHINES = Path(__file__).resolve().parents[2] / "data" / "machines"
RPM = np.pi / 30.0
#: All that a test looks at [rad/s].
BAND = (2.0 * np.pi * 10.0, 2.0 * np.pi * 10_000.0)


def softening_spindle():
    """The stiff machine without gyroscopic moments: X and Y apart, bearings that soften with speed."""
    return replace(read_machine(MACHINES / "stiff.toml").spindle, gyroscopic=False)


def modal_machine(spindle, speed):
    """Exact complex modes of the flange at a spindle speed [rad/s], both axes."""
    j = spindle.joint
    joint = LumpedJoint(j.translational_stiffness, j.rotational_stiffness, j.translational_damping, j.rotational_damping)
    flanges = []
    both = ("flange.x", "flange.x'", "flange.y", "flange.y'")
    small = reduced(rotor(spindle, None), inputs=both)
    for axis in (Dof.X, Dof.Y):
        ports = tuple(str(c) for c in plane("flange", axis))
        system = poles(small, speed, inputs=ports)
        rows = [[str(c) for c in system.coordinates].index(p) for p in ports]
        residues = np.einsum("pk,kq->kpq", system.outputs[rows], system.inputs)
        # the other plane's modes leave nothing here; a symmetric residue of rank one is phi phi^T
        strength = np.abs(residues[:, 0, 0])
        kept = strength > 1e-12 * strength.max()
        residues, pole = residues[kept], system.pole[kept]
        phi_t = np.sqrt(residues[:, 0, 0])
        phi = np.stack([phi_t, residues[:, 1, 0] / phi_t], axis=1)
        size = np.abs(pole)
        flanges.append(ModalModel(size, np.clip(-pole.real / size, 1e-9, 1.0), phi, np.zeros((2, 2)), plane("flange", axis)))
    return FlangeMachine(tuple(flanges), BAND, joint)
