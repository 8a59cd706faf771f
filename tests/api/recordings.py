"""Campaigns and recordings for tests of the service: cuts whose every line is known, in any format."""

from __future__ import annotations

import copy
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from rcsa_ident.io.recordings.hdf5 import write_hdf5
from rcsa_ident.signals.recording import Quantity
from tests.fixtures import synthetic

RATE, RPM = synthetic.RATE, 9000.0
#: Of the sensors below [V/m], [V/(m/s^2)].
SENSITIVITY = {Quantity.DISPLACEMENT: 1.0e4, Quantity.ACCELERATION: 1.0e-3}
TOOLING = {
    "cutter": {"teeth": 4, "diameter_mm": 16.0, "helix_deg": 30.0},
    "tool": {"stickout_mm": 60.0, "segments": [{"length_mm": 100.0, "outer_diameter_mm": 16.0, "material": "carbide"}]},
    "holder": {
        "insertion_mm": 40.0,
        "segments": [{"length_mm": 60.0, "outer_diameter_mm": 50.0, "inner_diameter_mm": 16.0, "material": "steel"}],
    },
    "contact": {
        "translational_stiffness": 2.0e10,
        "rotational_stiffness": 6.0e5,
        "translational_damping": 6.0e4,
        "rotational_damping": 9.0,
    },
}


def declared(cuts: int = 1, suffix: str = ".h5", **changed: Any) -> dict[str, Any]:
    """Keys of a campaign whose cuts all have an air cut."""
    sensors = {
        f"{place}_{axis}": {"quantity": str(quantity), "axis": axis.upper(), "sensitivity": SENSITIVITY[quantity]}
        for place, quantity in (("flange", Quantity.DISPLACEMENT), ("fixture", Quantity.ACCELERATION))
        for axis in "xy"
    }
    for axis in "xy":
        sensors[f"flange_{axis}"] |= {"distance_behind_flange_mm": 0.0, "distance_spread_mm": 0.0}
    conditions = {
        "tooling": "T1", "spindle_speed_rpm": RPM, "axial_depth_mm": 0.4, "feed_per_tooth_mm": 0.1,
        "entry_angle_deg": 90.0, "exit_angle_deg": 180.0, "feed_direction": "+X",
    }  # fmt: skip
    return {
        "campaign": {"name": "by hand", "sampling_rate_hz": RATE},
        "sensors": sensors,
        "workpiece": {"name": "EN AW-6082", "tangential_coefficient_mpa": 902.0, "radial_ratio": 0.26},
        "toolings": {"T1": copy.deepcopy(TOOLING)},
        "cuts": [{"id": f"c{k}", **conditions, "cut": f"c{k}_cut{suffix}", "air": f"c{k}_air{suffix}"} for k in range(cuts)],
    } | changed


@cache
def pair(seed: int = 0, noise: float = 2e-9) -> synthetic.Pair:
    """A cut and its air cut."""
    return synthetic.pair(seed, RPM, noise=noise)


def channels(seed: int = 0, air: bool = False) -> dict[str, np.ndarray]:
    """Signals by channel, as they stand in a file [V]."""
    found = pair(seed).air if air else pair(seed).cut
    names = [f"{place}_{axis}" for place in ("flange", "fixture") for axis in "xy"]
    return {
        name: found.samples[:, i] * SENSITIVITY[sensor.quantity] for i, (name, sensor) in enumerate(zip(names, found.sensors, strict=True))
    }


def content(folder: Path, seed: int = 0, air: bool = False, **changed: np.ndarray) -> bytes:
    """An HDF5 recording."""
    path = folder / f"made{seed}{air}.h5"
    write_hdf5(path, RATE, channels(seed, air) | changed)
    return path.read_bytes()


def recording(campaign: dict[str, Any], folder: Path) -> bytes:
    """A recording of noise that has the channels of a campaign."""
    rng = np.random.default_rng(1)
    path = folder / "noise.h5"
    write_hdf5(path, 51200.0, {name: rng.standard_normal(4000) for name in campaign["sensors"]})
    return path.read_bytes()
