"""A small campaign that reads well; every test breaks one thing in it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rcsa_ident.io.recordings.hdf5 import write_hdf5

TOOLING = """\
name = "S1-ER32"
[cutter]
teeth = 4
diameter_mm = 12.0
helix_deg = 30.0
pitch_deg = [90, 90, 90, 90]
[tool]
stickout_mm = 70.5
segments = [
  { length_mm = 26.0, outer_diameter_mm = 9.6, inner_diameter_mm = 0.0, material = "carbide" },
  { length_mm = 84.5, outer_diameter_mm = 12.0, material = "carbide" },
]
[holder]
insertion_mm = 40.0
segments = [ { length_mm = 40.0, outer_diameter_mm = 50.0, inner_diameter_mm = 12.0, material = "steel" } ]
[contact]
translational_stiffness = 2.0e10
rotational_stiffness = 6.0e5
translational_damping = 6.0e4
rotational_damping = 9.0
[materials.carbide]
youngs_modulus_gpa = 600.0
density = 14400.0
poisson = 0.22
loss_factor = 0.003
"""

CAMPAIGN = """\
[campaign]
name = "HPM 800U, 2026-11"
sampling_rate_hz = 51200.0
[sensors.flange_x]
quantity = "displacement"
axis = "X"
sensitivity = 10.0e3
[sensors.fixture_x]
quantity = "acceleration"
axis = "X"
sensitivity = 1.1094e-3
delay_s = 1.0e-5
bandwidth_hz = 1.0e4
[sensors.trigger]
quantity = "trigger"
pulses_per_revolution = 1
tooth_angle_deg = 90.0
[workpiece]
name = "EN AW-6082"
tangential_coefficient_mpa = 902.0
radial_ratio = 0.26
radial_edge_n_per_mm = 5.0
[toolings]
S1-ER32 = "toolings/S1-ER32.toml"
[[cuts]]
id = "S1-ER32-00"
tooling = "S1-ER32"
spindle_speed_rpm = 8000.0
axial_depth_mm = 0.4
feed_per_tooth_mm = 0.1
entry_angle_deg = 90.0
exit_angle_deg = 180.0
feed_direction = "+X"
cut = "recordings/S1-ER32_00_cut.h5"
air = "recordings/S1-ER32_00_air.h5"
[[cuts]]
id = "S1-ER32-01"
tooling = "S1-ER32"
spindle_speed_rpm = 8300.0
axial_depth_mm = 0.4
feed_per_tooth_mm = 0.1
entry_angle_deg = 90.0
exit_angle_deg = 180.0
feed_direction = 30
cut = "recordings/S1-ER32_00_cut.h5"
"""


@pytest.fixture
def tooling_text() -> str:
    return TOOLING


@pytest.fixture
def campaign_text() -> str:
    return CAMPAIGN


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    """A folder with the campaign above."""
    folder = tmp_path / "campaign"
    (folder / "toolings").mkdir(parents=True)
    (folder / "recordings").mkdir()
    (folder / "toolings" / "S1-ER32.toml").write_text(TOOLING, encoding="utf-8")
    (folder / "campaign.toml").write_text(CAMPAIGN, encoding="utf-8")
    rng = np.random.default_rng(1)
    for kind in ("cut", "air"):
        channels = {name: rng.normal(size=64) for name in ("flange_x", "fixture_x", "trigger")}
        write_hdf5(folder / "recordings" / f"S1-ER32_00_{kind}.h5", 51200.0, channels)
    return folder
