"""A tool, and the machine behind it, that the cut pushes away from the wall: teeth then enter later than programmed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import numpy as np

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError, non_negative, positive
from rcsa_ident.cutting.conditions import same_everywhere
from rcsa_ident.cutting.process import MillingProcess

#: Nodes per metre of depth, and at least so many.
_NODES, _FEWEST = 20_000.0, 12
#: Change of the radial depth at which the iteration ends [m], share of each change that is made, and rounds at most.
_SETTLED, _RELAXATION, _ROUNDS = 1e-9, 0.5, 200


@dataclass(frozen=True, slots=True)
class ToolDeflection:
    """Static deflection of a cantilever tool on a compliant machine, and what it does to the engagement [du2023].

    While a point of the edge generates the wall, the forces on the points of the edge that cut at that instant bend the tool; the
    point moves by Y off the wall, and its radial depth is a_e - Y. That changes the angle at which it enters and so the force:
    repeated until it settles, point by point. With the helix a cut deeper than R arccos(1 - a_e / R) / tan(helix) has points
    beyond which nothing cuts at that instant: the deflection stops growing there.

    `length` [m]: from the tip to where the tool is clamped
    `bending_stiffness` [N m^2]: E I of the tool
    `machine_yy`, `machine_yx` [m/N]: static compliance of the machine at the tool: motion off the wall (normal) per force in normal and in
        feed direction
    `feed_rate` [m/s]: kept at all speeds; without it the process's feed per tooth is
    `chip_reduction`: {"none", "literal"}; "literal" also takes the shift of the entry off the chip, as [du2023] prints it; each tooth finds
        the same deflection, so that in a steady cut the mean chip is what it was
    `all_teeth`: forces of all teeth in the cut at that instant; [du2023] counts one tooth
    """

    length: float
    bending_stiffness: float
    machine_yy: float = 0.0
    machine_yx: float = 0.0
    feed_rate: float | None = None
    chip_reduction: Literal["none", "literal"] = "none"
    all_teeth: bool = False

    def __post_init__(self) -> None:
        positive("length", self.length, "m")
        positive("bending_stiffness", self.bending_stiffness, "N m^2")
        non_negative("machine_yy", self.machine_yy, "m/N")
        if not np.isfinite(self.machine_yx):
            raise InputError("machine_yx", self.machine_yx, "a finite compliance [m/N]")
        if self.feed_rate is not None:
            positive("feed_rate", self.feed_rate, "m/s")
        if self.chip_reduction not in ("none", "literal"):
            raise InputError("chip_reduction", self.chip_reduction, "none or literal")

    def feed_per_tooth(self, process: MillingProcess, speed: float) -> float:
        """Return the feed per tooth [m] at a spindle speed [rad/s]."""
        if self.feed_rate is not None:
            return 2.0 * np.pi * self.feed_rate / (process.cutter.teeth * speed)
        if process.feed_per_tooth is None:
            raise InputError("feed_per_tooth", "nothing", "a feed per tooth of the process, or a feed rate")
        return process.feed_per_tooth


@dataclass(frozen=True, slots=True, eq=False)
class DeflectedEdge:
    """Where each point of the edge enters and leaves, bent by the cut.

    `height` [m], shape (n,): distances from the tip
    `deflection` [m], shape (n,): off the wall, at the instant at which the point generates it
    `start`, `end` [rad], shape (n,)
    `settled`: whether the iteration ended at every point
    """

    height: FloatArray
    deflection: FloatArray
    start: FloatArray
    end: FloatArray
    settled: bool


def deflected_edge(process: MillingProcess, deflection: ToolDeflection, speed: float, depth: float) -> DeflectedEdge:
    """Return the deflection along the edge, and the angles between which it cuts.

    `process`: down-milling up to pi or up-milling from 0
    `speed` [rad/s]; `depth` [m]
    Raises `InputError` if the cut generates no wall, or is deeper than the tool is long.
    """
    if not process.cutter.is_cylinder:
        raise InputError("cutter", str(process.cutter), "a cylinder with one helix: of other shapes no deflection is computed")
    radius = 0.5 * process.cutter.diameter
    entry, leave = same_everywhere(process.engagement).angles
    down = bool(abs(leave - np.pi) < 1e-9)
    if down == (entry < 1e-9):
        raise InputError("engagement", np.degrees([entry, leave]).tolist(), "down-milling up to 180 degrees, or up-milling from 0")
    if not 0.0 < depth < deflection.length:
        raise InputError("depth", depth, f"above 0 and below the tool's length, {deflection.length:g} m")
    nominal = radius * (1.0 - np.cos(leave - entry))
    feed = deflection.feed_per_tooth(process, speed)
    count = max(_FEWEST, int(np.ceil(depth * _NODES)))
    edges = np.linspace(0.0, depth, count + 1)
    middle, width = 0.5 * (edges[1:] + edges[:-1]), depth / count
    lag = np.tan(process.cutter.helix) / radius * middle
    half = 0.5 * np.tan(process.cutter.helix) / radius * width
    teeth = 2.0 * np.pi / process.cutter.teeth * np.arange(process.cutter.teeth) if deflection.all_teeth else np.zeros(1)
    c, kr = process.coefficients, process.coefficients.tangential * process.coefficients.radial_ratio
    bent = _bending(middle, deflection)
    offs, settled = np.empty(count), True
    off = 0.0
    for k in range(count):
        # rotation at which this point generates the wall, and where the other points of the edge are then
        phi = ((np.pi if down else 0.0) - lag[:, None] + lag[k] + teeth + np.pi) % (2.0 * np.pi) - np.pi
        phi = np.where(phi < -1e-12, phi + 2.0 * np.pi, phi)
        s, co = np.sin(phi), np.cos(phi)
        for _ in range(_ROUNDS):
            actual = min(max(nominal - off, 0.0), 2.0 * radius)
            span = np.arccos(1.0 - actual / radius)
            first, last = (np.pi - span, np.pi) if down else (0.0, span)
            # the share of each slice that is in the cut; of the one that generates the wall, half
            inside = np.minimum(phi + half, last) - np.maximum(phi - half, first)
            cuts = np.maximum(inside, 0.0) / (2.0 * half) if half > 0.0 else (inside >= -1e-12).astype(float)
            chip = feed
            if deflection.chip_reduction == "literal":
                chip = feed - radius * abs(np.sin(leave - entry) - np.sin(span))
            tangential = cuts * (c.tangential * chip * s + c.tangential_edge)
            radial = cuts * (kr * chip * s + c.radial_edge)
            forward = width * np.sum(-tangential * co - radial * s, axis=1)
            normal = width * np.sum(tangential * s - radial * co, axis=1)
            new = float(bent[k] @ normal + deflection.machine_yy * normal.sum() + deflection.machine_yx * forward.sum())
            new = new if down else -new
            change = new - off
            off += _RELAXATION * change
            if abs(change) <= _SETTLED:
                break
        else:
            # the number of points that cut is whole: the rounds may end in a swing of one point's force
            settled = settled and abs(change) < 1e-3 * nominal
        offs[k] = off
    span = np.arccos(1.0 - np.clip(nominal - offs, 0.0, 2.0 * radius) / radius)
    start, end = (np.pi - span, np.full(count, np.pi)) if down else (np.zeros(count), span)
    return DeflectedEdge(middle, offs, start, end, settled)


def _bending(height: FloatArray, deflection: ToolDeflection) -> FloatArray:
    """Deflection of a cantilever at each height (rows) per force at each height (columns), clamped at its length [m/N]."""
    arm = deflection.length - height
    short, long = np.minimum(arm[:, None], arm), np.maximum(arm[:, None], arm)
    return short**2 * (3.0 * long - short) / (6.0 * deflection.bending_stiffness)


@dataclass(frozen=True, slots=True)
class DeflectedEngagement:
    """The `EngagementProfile` of a deflected tool.

    `process`: as it would be without deflection
    `slices_per_metre` [1/m]: parts of the edge, at least four
    """

    process: MillingProcess
    deflection: ToolDeflection
    slices_per_metre: float = 6000.0

    def __call__(self, speed: float, depth: float) -> FloatArray:
        """Return the rows at a spindle speed [rad/s] and a depth [m], shape (k, 4)."""
        return _rows(self, speed, depth)


@lru_cache(maxsize=4096)
def _rows(profile: DeflectedEngagement, speed: float, depth: float) -> FloatArray:
    edge = deflected_edge(profile.process, profile.deflection, speed, depth)
    count = max(4, int(np.ceil(depth * profile.slices_per_metre)))
    shares = np.linspace(0.0, 1.0, count + 1)
    middle = 0.5 * (shares[1:] + shares[:-1]) * depth
    start, end = (np.interp(middle, edge.height, each) for each in (edge.start, edge.end))
    return frozen(np.stack([shares[:-1], shares[1:], start, end], axis=1))


def deflected_process(process: MillingProcess, deflection: ToolDeflection) -> MillingProcess:
    """Return the cut with the engagement that a deflected tool has along its edge."""
    bare = replace(process, engagement_profile=None)
    return replace(bare, engagement_profile=DeflectedEngagement(bare, deflection))
