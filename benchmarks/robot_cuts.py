"""Robots from cuts at six postures, beside a Gaussian process over hammer tests at fifty, in one run.

``python -m benchmarks robot_cuts --seeds 11 12 13``: each virtual robot (`robot_machines`) makes ten cuts at each of six postures, five
speeds with two toolings, and is identified from them and its data sheet. The peer is given what published work gives it: the tip's
receptance of the same tooling from hammer tests at fifty postures, one per cent of noise on every line, from which a Gaussian process
interpolates real and imaginary part over the joints' angles; length scales and noise maximise the marginal likelihood of all lines.
Both are asked at twenty postures that nobody tested.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import scipy.linalg
import scipy.optimize

from benchmarks.robot_machines import CUT, EVALUATION, NEVER_CUT, campaign, drawn, known, postures, toolings
from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.units import from_hz
from rcsa_ident.identification.arm.result import RobotIdentification
from rcsa_ident.io.recordings.readers import read_cut
from rcsa_ident.io.settings.setups import read_campaign
from rcsa_ident.machine.robot.flexible import FlexibleRobot
from rcsa_ident.machine.robot.posed_robot import PosedRobot
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.virtual.robot import VirtualRobot
from rcsa_ident.workflows.identify import judge
from rcsa_ident.workflows.identify_robot import identify_robot
from rcsa_ident.workflows.simulate import true_robot_tip

#: Postures of the cuts, of the hammer tests, and those at which both are asked; their seeds follow the robot's.
CUT_AT, HIT_AT, ASKED_AT = 6, 50, 20
#: Lines [Hz]: where the arm moves, and where the spindle and the tool do.
LOW, HIGH = np.arange(5.0, 120.0, 0.5), np.arange(120.0, 4000.0, 4.0)
NOISE = 0.01


def study(seed: int, scratch: Path) -> dict[str, Any]:
    """Return the errors of one robot's tips, and of the peer's."""
    robot, tools = drawn(seed), toolings(CUT + NEVER_CUT, scratch)
    folder = scratch / "campaign"
    with ProcessPoolExecutor() as pool:
        campaign(folder, robot, postures(CUT_AT, 100 + seed), {p: t for p, t in tools.items() if t.name in CUT}, seed, pool.map)
        start = time.perf_counter()
        cuts = read_campaign(folder)
        readings = judge(cuts, partial(read_cut, cuts.sensors, cuts.sampling_rate), pool.map)
        found = identify_robot(cuts, readings, FlexibleRobot(known(robot)), 1, pool.map)
        seconds = time.perf_counter() - start
    asked, hit = postures(ASKED_AT, 200 + seed), postures(HIT_AT, 300 + seed)
    rows = []
    for tooling in tools.values():
        truth = [true_robot_tip(robot, q, tooling, from_hz(np.concatenate([LOW, HIGH])))[:, :2, :2] for q in asked]
        row: dict[str, Any] = {"tooling": tooling.name, "cut": tooling.name in CUT}
        row |= _errors("", truth, [_tip(found.posterior.at(q), tooling) for q in asked])
        row |= _errors("sheet_", truth, [_tip(PosedRobot(FlexibleRobot(known(robot)), q), tooling) for q in asked])
        if tooling.name == CUT[0]:
            row |= _errors("peer_", truth, interpolated(robot, tooling, hit, asked, seed))
            row["inside_two_deviations"] = _inside(found, tooling, asked, truth)
        rows.append(row)
    true = robot.arm.chain().stiffness
    springs = [abs(float(np.log(k / other))) for (_, k, _, told), other in zip(found.springs, true, strict=True) if told]
    off = [abs(float(np.log(k / other))) / share for (_, k, share, told), other in zip(found.springs, true, strict=True) if told]
    return {
        "seed": seed,
        "status": str(found.status),
        "reasons": [str(each) for each in found.reasons],
        "cuts": len(found.cut_ids),
        "modes": found.posterior.best.layout.modes,
        "springs_told": len(springs),
        "spring_error_median": float(np.median(springs)),
        "springs_within_two_deviations": float(np.mean(np.array(off) < 2.0)),
        "model_error": list(found.model_error),
        "seconds": seconds,
        "tips": rows,
    }


def interpolated(robot: VirtualRobot, tooling: Tooling, hit: FloatArray, asked: FloatArray, seed: int) -> list[ComplexArray]:
    """Return the tips that a Gaussian process interpolates from hammer tests, shape (n, 2, 2) each."""
    rng, omega = np.random.default_rng(400 + seed), from_hz(np.concatenate([LOW, HIGH]))
    tests = np.array([true_robot_tip(robot, q, tooling, omega)[:, :2, :2] for q in hit])
    tests = tests * (1.0 + NOISE * (rng.standard_normal(tests.shape) + 1j * rng.standard_normal(tests.shape)) / np.sqrt(2.0))
    values = np.concatenate([tests.real, tests.imag], axis=1).reshape(len(hit), -1)
    # every line by its own size, so that all count alike
    middle, size = values.mean(axis=0), values.std(axis=0) + 1e-300
    answers = _gaussian_process(hit, (values - middle) / size, asked) * size + middle
    parts = answers.reshape(len(asked), 2, omega.size, 2, 2)
    return [each[0] + 1j * each[1] for each in parts]


def _gaussian_process(known: FloatArray, values: FloatArray, asked: FloatArray) -> FloatArray:
    """Return what a Gaussian process expects: squared exponential, a length scale for each input, white noise; best of three starts.

    `known`, shape (k, j)
    `values`, shape (k, f): of unit variance
    `asked`, shape (a, j)
    """
    k, columns = values.shape
    gram = values @ values.T

    def covariance(a: FloatArray, b: FloatArray, logs: FloatArray) -> FloatArray:
        apart = (a[:, None] - b[None, :]) / np.exp(logs[:-2])
        found: FloatArray = np.exp(2.0 * logs[-2] - 0.5 * np.sum(apart**2, axis=2))
        return found

    def cost(logs: FloatArray) -> float:
        factor = np.linalg.cholesky(covariance(known, known, logs) + np.exp(2.0 * logs[-1]) * np.eye(k))
        return float(0.5 * np.trace(scipy.linalg.cho_solve((factor, True), gram)) + columns * np.sum(np.log(np.diag(factor))))

    bounds = [(np.log(0.05), np.log(50.0))] * known.shape[1] + [(np.log(0.1), np.log(10.0)), (np.log(1e-3), 0.0)]
    starts = (np.append(np.full(known.shape[1], np.log(length)), [0.0, np.log(0.1)]) for length in (0.3, 1.0, 3.0))
    best = min((scipy.optimize.minimize(cost, start, bounds=bounds) for start in starts), key=lambda each: each.fun).x
    weights = np.linalg.solve(covariance(known, known, best) + np.exp(2.0 * best[-1]) * np.eye(k), values)
    found: FloatArray = covariance(asked, known, best) @ weights
    return found


def _tip(machine: PosedRobot, tooling: Tooling) -> ComplexArray:
    omega = from_hz(np.concatenate([LOW, HIGH]))
    found: ComplexArray = machine.tip(tooling, omega, spread=False).values[:, :2, :2]
    return found


def _errors(name: str, truth: Sequence[ComplexArray], found: Sequence[ComplexArray]) -> dict[str, float]:
    """Medians and largest over the postures of the norm of the difference over that of the truth."""
    low = np.arange(LOW.size + HIGH.size) < LOW.size
    told: dict[str, float] = {}
    for band, own in (("low", low), ("high", ~low)):
        each = [float(np.linalg.norm(f[own] - t[own]) / np.linalg.norm(t[own])) for f, t in zip(found, truth, strict=True)]
        told |= {f"{name}{band}_median": float(np.median(each)), f"{name}{band}_largest": max(each)}
    return told


def _inside(found: RobotIdentification, tooling: Tooling, asked: FloatArray, truth: Sequence[ComplexArray]) -> float:
    """Share of lines along X below 120 Hz that lie within two deviations, real and imaginary part each."""
    inside = []
    for q, true in zip(asked, truth, strict=True):
        tip = found.posterior.at(q).tip(tooling, from_hz(LOW))
        real, imaginary = next(each for (row, col), each in tip.deviation().items() if str(row) == str(col) == "tip.x")
        rest = tip.values[:, 0, 0] - true[: LOW.size, 0, 0]
        inside += [np.mean(np.abs(rest.real) < 2.0 * real), np.mean(np.abs(rest.imag) < 2.0 * imaginary)]
    return float(np.mean(inside))


def main(arguments: Sequence[str]) -> None:
    """Print one line of JSON a robot."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks robot_cuts", description=__doc__)
    parser.add_argument("--seeds", type=int, nargs="+", default=list(EVALUATION))
    for seed in parser.parse_args(arguments).seeds:
        with tempfile.TemporaryDirectory() as scratch:
            print(json.dumps(study(seed, Path(scratch))), flush=True)
