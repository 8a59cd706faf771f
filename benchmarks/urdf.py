"""Arms from URDF beside Pinocchio's own reader, where it is installed (``pip install pin``): pose, mass matrix, torques against weight."""

from __future__ import annotations

import importlib
import importlib.util
import tempfile
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.timing import Race, best_of, row
from rcsa_ident.front.samples import sample_robot
from rcsa_ident.io.settings.urdf import read_urdf
from rcsa_ident.machine.robot.inertia import gravity_torques, mass_matrix
from rcsa_ident.machine.robot.kinematics import flange_at, posed
from tests.io.urdf_files import random_urdf, urdf_of

#: Arms whose parts stand anyhow.
ARMS = 20


def run() -> list[dict[str, Any]]:
    """Both published arms with masses, and some that nobody would build."""
    rng = np.random.default_rng(5)
    texts = [urdf_of(sample_robot(name)) for name in ("tx200", "kr210")] + [random_urdf(rng) for _ in range(ARMS)]
    there = importlib.util.find_spec("pinocchio") is not None
    worst, rows = 0.0, []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "ARM.urdf"
        for text in texts:
            path.write_text(text)
            arm, _ = read_urdf(path, [1e6], flange="tool0")
            angles = rng.uniform(-2.9, 2.9, len(arm.joints))
            flange = flange_at(arm, angles)
            ours = flange.offset, flange.turn, mass_matrix(posed(arm, angles)), gravity_torques(arm, angles)
            if there:
                theirs = pinocchio(text, {j.name: float(a) for j, a in zip(arm.joints, angles, strict=True)})
                worst = max([worst, *(np.max(np.abs(a - b)) / np.max(np.abs(b)) for a, b in zip(ours, theirs, strict=True))])
        path.write_text(texts[0])
        ms = 1e3 * best_of(partial(read_urdf, path, [1e6]))
        peer = 1e3 * best_of(partial(importlib.import_module("pinocchio").buildModelFromXML, texts[0])) if there else None
    rows.append(row(f"urdf: {len(texts)} arms (peer: Pinocchio)", ms, peer, "ms", f"{worst:.0e}" if there else "no peer"))
    return rows


def races() -> list[Race]:
    """An arm of six joints with masses, where the peer is installed."""
    if not importlib.util.find_spec("pinocchio"):
        return []
    text, folder = urdf_of(sample_robot("tx200")), tempfile.TemporaryDirectory()
    path = Path(folder.name) / "ARM.urdf"
    path.write_text(text)
    theirs = partial(importlib.import_module("pinocchio").buildModelFromXML, text)

    def ours(kept: Any = folder) -> Any:
        return read_urdf(path, [1e6], flange="tool0")

    return [Race("arm from URDF: file to model", "Pinocchio", "pin", ours, theirs, "pose, masses, weights 4e-15", (1, 1), "ms", 1e3)]


def pinocchio(text: str, angles: dict[str, float]) -> tuple[np.ndarray, ...]:
    """Return place and axes of tool0, mass matrix and torques against the weight, as the peer reads a file."""
    pin = importlib.import_module("pinocchio")
    model = pin.buildModelFromXML(text)
    data, q = model.createData(), np.zeros(model.nq)
    for name, angle in angles.items():
        joint = model.joints[model.getJointId(name)]
        # a joint without limits is a point on a circle there
        q[joint.idx_q : joint.idx_q + joint.nq] = [angle] if joint.nq == 1 else [np.cos(angle), np.sin(angle)]
    upper = np.triu(np.array(pin.crba(model, data, q)))
    torque = np.array(pin.computeGeneralizedGravity(model, data, q))
    pin.framesForwardKinematics(model, data, q)
    place = data.oMf[model.getFrameId("tool0")]
    return np.array(place.translation), np.array(place.rotation), upper + np.triu(upper, 1).T, torque
