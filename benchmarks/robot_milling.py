"""A robot that mills, beside the published simulation and experiment: forces, walls, steel, and what a pass costs.

``python -m benchmarks robot_milling``: the TX200 of [huynh2018] at the posture of its table 7 goes 90 mm along a block, four of ten
millimetres down-milling, 1.6 mm deep. Published rows were read before this was written. The time of a pass is told in times of its own
march without springs, and beside the virtual machine's march (exact poles, chips from delays) of as many instants in the same run.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.front.samples import sample_robot
from rcsa_ident.machine.robot.flexible import FlexibleRobot
from rcsa_ident.toolpath.march import Carrier, Cut, March, mill_block
from rcsa_ident.toolpath.surface import roughness
from rcsa_ident.toolpath.walls import Walls
from rcsa_ident.virtual.milling import rigid_force_lines
from rcsa_ident.workflows.paths.robot_milling import arm_carrier, feed_turn

POSTURE = np.radians([-11.71, 20.78, 147.86, 82.76, 60.80, -166.96])
SIDES = (-np.inf, -0.001)
LENGTH = 0.09
ALUMINIUM = Cut(
    Cutter(2, 0.010, np.radians(30.0), pitch=np.radians([170.0, 190.0])),
    CuttingCoefficients(661.553e6, 253.458 / 661.553),
    0.0016,
    18700.0 * 2.0 * np.pi / 60.0,
)
STEEL = Cut(
    Cutter(2, 0.010, np.radians(30.0), runout=np.array([0.0, 6.929e-6])),
    CuttingCoefficients(3333e6, 2289.0 / 3333.0),
    0.0016,
    3100.0 * 2.0 * np.pi / 60.0,
)
#: min Fx, min Fy, max Fx, mean Fx, mean Fy, rms Fx, rms Fy [N], table 10.
PUBLISHED = {
    "basic": (-7.63, -111.39, 38.82, 8.78, -25.67, 16.28, 44.42),
    "weight, compensated": (-8.53, -113.4, 38.84, 8.72, -26.1, 16.31, 44.96),
    "orthogonal springs": (-7.92, -112.45, 38.98, 8.79, -25.70, 16.29, 44.47),
    "play": (-8.31, -117.07, 42.40, 8.92, -25.43, 16.41, 44.15),
    "experiment": (-24.66, -143.69, 68.11, 15.14, -29.75, 27.16, 50.45),
}


def row(found: March) -> FloatArray:
    """The columns of table 10, from 0.4 to 1.4 s; across the feed as a force on the workpiece."""
    force = found.force[(found.time > 0.4) & (found.time < 1.4)] * [1.0, -1.0, 1.0]
    low, high, mean = force.min(axis=0), force.max(axis=0), force.mean(axis=0)
    rms = np.sqrt(np.mean(force**2, axis=0))
    return np.array([low[0], low[1], high[0], mean[0], mean[1], rms[0], rms[1]])


def wall(walls: Walls, cutoff: float) -> str:
    """Ra, Rq, Rt between 10 and 80 mm of the middle slice [um]."""
    inside = (walls.x > 0.01) & (walls.x < 0.08)
    found = roughness(walls.tops[0, walls.tops.shape[1] // 2, inside], walls.spacing, cutoff)
    return f"{1e6 * found.mean:.2f}, {1e6 * found.rms:.2f}, {1e6 * found.total:.1f}"


def feed(cut: Cut, millimetres_per_minute: float) -> float:
    """Feed per tooth [m]."""
    return millimetres_per_minute * 1e-3 / 60.0 / (cut.cutter.teeth * cut.spindle_speed / (2.0 * np.pi))


def main(arguments: Sequence[str]) -> None:
    """Print the tables."""
    argparse.ArgumentParser(prog="python -m benchmarks robot_milling", description=__doc__).parse_args(arguments)
    arm = {tilts: FlexibleRobot(sample_robot("tx200"), tilts) for tilts in (False, True)}
    turn = feed_turn(arm[True], POSTURE, np.array([1.0, 0.0, 0.0]))
    carriers = {
        "rigid": Carrier(),
        "basic": arm_carrier(arm[False], POSTURE, turn, play=False),
        "weight, compensated": arm_carrier(arm[False], POSTURE, turn, play=False, weight=True),
        "orthogonal springs": arm_carrier(arm[True], POSTURE, turn, play=False),
        "play": arm_carrier(arm[True], POSTURE, turn),
        "play, feed along the tool's x": arm_carrier(arm[True], POSTURE),
    }
    mill_block(carriers["play"], ALUMINIUM, 0.01, SIDES, feed(ALUMINIUM, 3700.0))  # compiled
    print("| forces in aluminium [N]: ours (published) | min Fx | min Fy | max Fx | mean Fx | mean Fy | rms Fx | rms Fy | tip [um] | s |")
    print("|" + "---|" * 10)
    profiles = {}
    for name, carrier in carriers.items():
        start = time.perf_counter()
        found, profiles[name] = mill_block(carrier, ALUMINIUM, LENGTH, SIDES, feed(ALUMINIUM, 3700.0))
        seconds = time.perf_counter() - start
        published = PUBLISHED.get(name)
        cells = [f"{x:.2f}" + ("" if published is None else f" ({published[i]:.2f})") for i, x in enumerate(row(found))]
        tip = 1e6 * found.tip[(found.time > 0.4) & (found.time < 1.4)].mean(axis=0)
        print(f"| {name} | {' | '.join(cells)} | {tip[0]:.1f}, {tip[1]:.1f} | {seconds:.2f} |")
    print(f"| experiment | {' | '.join(f'{x:.2f}' for x in PUBLISHED['experiment'])} | | |")
    print("\n| wall in aluminium, 10 to 80 mm [um] | Ra, Rq, Rt behind 0.8 mm | behind 8 mm | published: 0.37, 0.50, 13.5 |")
    print("|---|---|---|---|")
    for name, walls in profiles.items():
        print(f"| {name} | {wall(walls, 0.8e-3)} | {wall(walls, 8e-3)} | |")
    print(
        "\n| steel, joint dampers times | largest Fx, Fy [N] | tip beside what repeats each turn [um] | Ra, Rq, Rt behind 8 mm [um] | s |"
    )
    print("|---|---|---|---|---|")
    for tilts in (False, True):
        for direction, along in (("base's x", turn), ("tool's x", 0.0)):
            carrier = arm_carrier(arm[tilts], POSTURE, along, play=False)
            for damper in (1.0, 10.0):
                start = time.perf_counter()
                found, walls = mill_block(replace(carrier, damping=damper * carrier.damping), STEEL, LENGTH, SIDES, feed(STEEL, 280.0))
                seconds = time.perf_counter() - start
                turns = found.tip[found.tip.shape[0] // 3 :][: 720 * 400].reshape(400, 720, 3)
                beside = 1e6 * np.sqrt(np.mean(np.var(turns, axis=0), axis=0))
                force = np.abs(found.force).max(axis=0)
                lost = ", tool lost" if found.lost else ""
                name = f"{carrier.stiffness.size} freedoms, feed along the {direction}, {damper:g}"
                cells = f"{force[0]:.0f}, {force[1]:.0f}{lost} | {beside[0]:.0f}, {beside[1]:.0f} | {wall(walls, 8e-3)}"
                print(f"| {name} | {cells} | {seconds:.2f} |")
    conditions = CuttingConditions(
        ALUMINIUM.spindle_speed, ALUMINIUM.depth, feed(ALUMINIUM, 3700.0), Engagement(np.pi - np.arccos(0.2), np.pi)
    )
    count = 720 * 480
    rigid_force_lines(ALUMINIUM.cutter, conditions, ALUMINIUM.coefficients, 6, 720)
    times = []
    for work in (
        lambda: mill_block(Carrier(), ALUMINIUM, LENGTH, SIDES, feed(ALUMINIUM, 3700.0)),
        lambda: mill_block(carriers["play"], ALUMINIUM, LENGTH, SIDES, feed(ALUMINIUM, 3700.0)),
        lambda: rigid_force_lines(ALUMINIUM.cutter, conditions, ALUMINIUM.coefficients, 6, count),
    ):
        taken = []
        for _ in range(5):
            start = time.perf_counter()
            work()
            taken.append(time.perf_counter() - start)
        times.append(min(taken))
    print(
        f"\na pass without springs {times[0]:.2f} s, with 18 freedoms and play {times[1] / times[0]:.2f} times that; "
        f"chips from delays alone, without walls or springs, {times[2] / times[0]:.2f} times"
    )
