"""An identified machine made by hand, and the files that the commands read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.force import ForceCoefficient, ForceTerm
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.parameters import AxisLayout, flange_modes, joint_of, pack, parameter_names, simple_axis, unpack
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


@pytest.fixture
def tooling_file(tmp_path: Path) -> Path:
    path = tmp_path / "T1.toml"
    path.write_text(TOOLING, encoding="utf-8")
    return path


@pytest.fixture
def campaign(tmp_path: Path, tooling_file: Path) -> Campaign:
    conditions = CuttingConditions(1000.0, 4e-4, 1e-4, Engagement(0.5 * np.pi, np.pi))
    return Campaign(
        "by hand",
        25600.0,
        (
            Sensor("flange_x", Quantity.DISPLACEMENT, Dof.X, 1e4, delay=1e-5),
            Sensor("trigger", Quantity.TRIGGER, pulses_per_revolution=2, tooth_angle=0.25 * np.pi),
        ),
        Workpiece("EN AW-6082", CuttingCoefficients(902e6, 0.26, radial_edge=5e3)),
        {"T1": read_tooling(tooling_file)},
        tuple(Cut(f"T1-{i}", "T1", conditions, tmp_path / "none.h5") for i in range(3)),
    )


@pytest.fixture
def identification() -> Identification:
    """Two axes of two modes each with a posterior; the third cut is left out."""
    axes, layout = {}, AxisLayout(2)
    logs = np.log([2e9, 5e6, 1e4, 10.0])
    for axis, shift in ((Dof.X, 1.0), (Dof.Y, 0.95)):
        natural = 2.0 * np.pi * shift * np.array([900.0, 2000.0])
        damping = np.diag(2.0 * np.array([0.05, 0.04]) * natural)
        physics = simple_axis(natural, np.array([[0.15, 0.1], [0.2, -0.3]]), np.linalg.cholesky(damping), np.diag([2e-5, 3e-5]))
        theta = np.concatenate([pack(physics), logs])
        deviation = np.full(theta.size, 0.004)
        omega = 2.0 * np.pi * np.array([600.0, 1200.0, 3000.0, 700.0])
        value = np.array([1e-8, 3e-8j, -1e-9, 2e-8 + 1e-8j])
        axes[axis] = AxisResult(
            flange_modes(unpack(theta[:-4], layout), axis), joint_of(logs), 1.1, {"T1": 1.1}, 0.004, parameter_names(layout),
            Posterior(theta, np.diag(deviation**2), layout, (1050.0, 50.0)),
            {"omega": omega, "value": value, "model": 1.01 * value, "cut": np.array([0, 0, 0, 1]), "coherence": np.ones(4)},
        )  # fmt: skip
    told = ((Stage.SEARCH, 9.0, 3), (Stage.SEARCH, 5.0, 3), (Stage.REFINE, 3.0, 3), (Stage.MODES, -20.0, 3), (Stage.MODES, -40.0, 2))
    trace = [Step(axis, stage, cost, modes) for axis in ("x", "y") for stage, cost, modes in told]
    return Identification(
        Status.SUSPECT,
        (Remark(IdentificationCode.FEW_CUTS, "few cuts: 2 with T1, at least 8 are wanted"),),
        7,
        "default",
        axes,
        ("T1-0", "T1-1"),
        np.array([1e-3, 2.5e-3]),
        np.array([1e-6, 2e-6]),
        np.array([1000.0, 1100.0]),
        (*trace, Step(BOTH, Stage.POLISH, 2.0, 4)),
        (
            Remark(
                IdentificationCode.COEFFICIENT_UNKNOWN,
                "run-out of T1: the cuts say little about it; it is known to 250 %, nearly as before",
            ),
        ),
        {ForceCoefficient(ForceTerm.TANGENTIAL): (0.03, 0.02), ForceCoefficient(ForceTerm.RUNOUT, "T1"): (0.4, 2.5)},
    )
