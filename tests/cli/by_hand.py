"""An identification made by hand: two axes of two modes with a full posterior and a rival; nothing was searched."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.force import ForceCoefficient, ForceTerm
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.parameters import AxisLayout, AxisParameters, pack, parameter_names, simple_axis
from rcsa_ident.identification.posterior import Posterior
from rcsa_ident.identification.progress import BOTH, Stage, Step
from rcsa_ident.identification.result import AxisResult, Identification, IdentificationCode, Status
from rcsa_ident.io.setups import read_tooling
from rcsa_ident.machining_setup import Campaign, Cut, Workpiece
from rcsa_ident.remarks import Remark
from rcsa_ident.signals.recording import Quantity, Sensor

TOOLING = """\
name = "T1"
[cutter]
teeth = 4
diameter_mm = 12.0
[tool]
stickout_mm = 60.0
segments = [ { length_mm = 100.0, outer_diameter_mm = 12.0, material = "carbide" } ]
[holder]
insertion_mm = 40.0
segments = [ { length_mm = 60.0, outer_diameter_mm = 50.0, inner_diameter_mm = 12.0, material = "steel" } ]
[contact]
translational_stiffness = 2.0e10
rotational_stiffness = 6.0e5
translational_damping = 6.0e4
rotational_damping = 9.0
"""
LEFT_OUT = [("T1-2", "chatter: 3 µm at 1500 Hz")]
JOINT_LOGS = np.log([2e9, 5e6, 1e4, 10.0])
#: Middle and half range of the spindle speeds [rad/s].
SPEEDS = (1000.0, 400.0)


def physics(shift: float = 1.0) -> AxisParameters:
    """Two modes, lightly coupled."""
    natural = 2.0 * np.pi * shift * np.array([900.0, 2000.0])
    damping = np.diag(2.0 * np.array([0.05, 0.04]) * natural)
    factor = np.linalg.cholesky(damping)
    factor[1, 0] = 2.0
    return simple_axis(natural, np.array([[0.15, 0.1], [0.2, -0.3]]), factor, np.array([[2e-5, 0.0], [1e-5, 3e-5]]))


def posterior(shift: float = 1.0, softening: bool = False, seed: int = 3) -> Posterior:
    """Unknowns with a full covariance, and a rival of one mode less."""
    rng = np.random.default_rng(seed)
    layout = AxisLayout(2, softening=softening)
    axis = physics(shift)
    if softening:
        axis = replace(axis, softening=np.array([[-0.06, 0.01], [0.01, -0.04]]))
    theta = np.concatenate([pack(axis, layout), JOINT_LOGS])
    directions = 0.002 * rng.standard_normal((theta.size, theta.size)) / np.sqrt(theta.size)
    covariance = directions @ directions.T + np.diag(np.full(theta.size, 0.002**2))
    covariance = 0.5 * (covariance + covariance.T)
    fewer = AxisLayout(1, softening=softening)
    rival = rng.standard_normal(fewer.size + 4)
    rival[0], rival[3], rival[-4:] = np.log(6000.0), 0.0, JOINT_LOGS
    return Posterior(theta, covariance, layout, SPEEDS, (rival,))


def axis_result(axis: Dof, known: Posterior) -> AxisResult:
    """What an identification says of one axis."""
    omega = 2.0 * np.pi * np.array([600.0, 1200.0, 3000.0, 700.0])
    value = np.array([1e-8, 3e-8j, -1e-9, 2e-8 + 1e-8j])
    modes, joint = known.machine(axis)
    return AxisResult(
        modes, joint, 1.1, {"T1": 1.1}, 0.004, parameter_names(known.layout), known,
        {"omega": omega, "value": value, "model": 1.01 * value, "cut": np.array([0, 0, 0, 1]), "coherence": np.ones(4)},
    )  # fmt: skip


def identification(softening: bool = False) -> Identification:
    """Two axes with a posterior; the third cut is left out."""
    known = {Dof.X: posterior(1.0, softening, 3), Dof.Y: posterior(0.95, softening, 4)}
    told = ((Stage.SEARCH, 9.0, 3), (Stage.SEARCH, 5.0, 3), (Stage.REFINE, 3.0, 3), (Stage.MODES, -20.0, 3), (Stage.MODES, -40.0, 2))
    trace = [Step(axis, stage, cost, modes) for axis in ("x", "y") for stage, cost, modes in told]
    return Identification(
        Status.SUSPECT,
        (Remark(IdentificationCode.FEW_CUTS, "few cuts: 2 with T1, at least 8 are wanted"),),
        7,
        "default",
        {axis: axis_result(axis, each) for axis, each in known.items()},
        ("T1-0", "T1-1"),
        np.array([1e-3, 2.5e-3]),
        np.array([1e-6, 2e-6]),
        np.array([1000.0, 1100.0]),
        (*trace, Step(BOTH, Stage.POLISH, 2.0, 4)),
        ("joint: its rotational damping cannot be told",),
        {ForceCoefficient(ForceTerm.TANGENTIAL): (np.log(1.25), 0.02), ForceCoefficient(ForceTerm.RUNOUT, "T1"): (-0.5, 0.25)},
    )


def campaign(folder: Path) -> Campaign:
    """Three cuts with one tooling, whose file is written into the folder."""
    tooling = folder / "T1.toml"
    tooling.write_text(TOOLING, encoding="utf-8")
    conditions = CuttingConditions(1000.0, 4e-4, 1e-4, Engagement(0.5 * np.pi, np.pi))
    return Campaign(
        "by hand",
        25600.0,
        (
            Sensor("flange_x", Quantity.DISPLACEMENT, Dof.X, 1e4, delay=1e-5),
            Sensor("trigger", Quantity.TRIGGER, pulses_per_revolution=2, tooth_angle=0.25 * np.pi),
        ),
        Workpiece("EN AW-6082", CuttingCoefficients(902e6, 0.26, radial_edge=5e3, ratio_spread=0.07, edge_spread=0.0)),
        {"T1": read_tooling(tooling)},
        tuple(Cut(f"T1-{i}", "T1", conditions, folder / "none.h5") for i in range(3)),
    )
