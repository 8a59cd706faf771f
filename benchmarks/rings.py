"""Virtual rings: a tool-holder on a string, tapped, a phone beside it. The identification shares little of what makes them.

The thing that rings has a finer mesh, another shear coefficient and what no drawing tells: a nut with grooves and a softer thread, slots
and a coolant tube in the taper, a pull stud of another make, the tool's rear end in the bore, flutes whose area is no circle's, planes
that differ a little. The sound has the hit's own click, reflections, a room, hum, a fan, noise, 16 bits, and where asked a gain control.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.units import from_hz, to_hz
from rcsa_ident.dynamics.structure import Structure
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.tool_holder.free_modes import Motion, bare, damped_poles, rod_modes
from rcsa_ident.tool_holder.geometry import MATERIALS, BeamSegment, ToolAssembly
from rcsa_ident.tool_holder.model import free_body
from rcsa_ident.tool_holder.taper import taper
from rcsa_ident.tool_holder.timoshenko import hutchinson

RATE = 48_000.0


@dataclass(frozen=True, slots=True)
class Room:
    """What a recording adds.

    `noise` [-]: root mean square over the peak of the loudest ring
    `reflections` [-]: amplitude of the first ones over the direct sound
    `tail` [-]: amplitude of the room's tail at its beginning
    `reverberation` [s]: in which the tail falls by 60 dB
    """

    noise: float = 1e-3
    reflections: float = 0.08
    tail: float = 3e-3
    reverberation: float = 0.4
    gain_control: bool = False


def hanging(tooling: Tooling, rng: np.random.Generator) -> ToolAssembly:
    """Return the tooling as it truly hangs there, with what its drawing leaves out. `tooling`: with its true dimensions."""
    assembly = tooling.assembly
    steel = MATERIALS["steel"]
    front, *others = assembly.holder
    # the nut: wrench grooves take mass away, its thread is softer than solid steel
    share = rng.uniform(0.4, 0.6) * front.length
    nut = front.part(0.0, share)
    soft = replace(steel, youngs_modulus=steel.youngs_modulus * rng.uniform(0.8, 0.95), density=steel.density * rng.uniform(0.93, 0.99))
    holder = [replace(nut, material=soft), front.part(share, front.length), *others]
    if tooling.tool_behind:
        # the tool's rear end fills the bore behind the insertion
        rear = sum(s.length for s in tooling.tool_behind)
        at, inside = 0.0, []
        for segment in holder:
            first, last = max(at, assembly.insertion), min(at + segment.length, assembly.insertion + rear)
            if last - first > 1e-6:
                heavy = replace(segment.material, density=segment.material.density * 1.02)
                inside.append((segment, heavy))
            at += segment.length
        for segment, heavy in inside:
            holder[holder.index(segment)] = replace(segment, material=heavy)
    if tooling.taper:
        made = taper(tooling.taper).segments
        light = replace(steel, density=steel.density * rng.uniform(0.92, 1.08))
        holder += [replace(s, material=light) for s in made]
        if tooling.taper.startswith("HSK"):
            holder.append(BeamSegment(0.020, 0.012, replace(steel, density=steel.density * rng.uniform(0.3, 1.5)), inner_diameter=0.007))
    return replace(assembly, tool=_fluted(assembly.tool, rng), holder=tuple(holder))


def alone(tooling: Tooling, rng: np.random.Generator) -> ToolAssembly:
    """Return the tool alone as it truly is."""
    *front, last = tooling.whole_tool
    if len(tooling.tool_behind) == 1 and abs(front[-1].end - last.diameter) < 1e-9:
        front, last = front[:-1], replace(last, length=last.length + front[-1].length)
    return bare((*_fluted((*front, last), rng)[:-1], last))


def _fluted(tool: Sequence[BeamSegment], rng: np.random.Generator) -> tuple[BeamSegment, ...]:
    """The same tool with flutes whose area is not that of the circle that bends alike."""
    share = float(np.exp(0.02 * rng.standard_normal()))
    *front, last = tool
    made = [
        replace(s, area=min(share, 1.0) * np.pi / 4.0 * s.diameter**2, second_moment=np.pi / 64.0 * s.diameter**4) if s.area is None else s
        for s in front
    ]
    return (*made, last)


def sound(body: ToolAssembly, rng: np.random.Generator, hits: int = 5, room: Room | None = None, planes: float = 0.002) -> FloatArray:
    """Return what a phone hears of a body that is tapped at its tip, full scale 1, at `RATE`.

    `hits`: one in 0.7 s
    `planes` [-]: by what share the two bending planes differ at most
    """
    room = Room() if room is None else room
    modes = _modes(body, rng, planes)
    gap, quiet = int(0.7 * RATE), int(0.4 * RATE)
    signal = np.zeros(quiet + hits * gap)
    for k in range(hits):
        ring = _hit(modes, rng, gap)
        signal[quiet + k * gap : quiet + (k + 1) * gap] += rng.uniform(0.4, 1.0) * ring
    signal /= np.max(np.abs(signal))
    signal = _in_room(signal, rng, room)
    time = np.arange(signal.size) / RATE
    signal += room.noise * rng.standard_normal(signal.size)
    for frequency, size in ((50.0, 0.02), (100.0, 0.01), (150.0, 0.005), (rng.uniform(900.0, 6000.0), room.noise)):
        signal += size * np.sin(2.0 * np.pi * frequency * time + rng.uniform(0.0, 6.0))
    if room.gain_control:
        signal *= _gain(signal)
    return np.asarray(np.round(0.8 * 32767.0 * signal / np.max(np.abs(signal))) / 32768.0)


def true_modes(body: ToolAssembly) -> np.ndarray:
    """Return the poles of its bending modes, in ascending order [1/s]."""
    return damped_poles(_structure(body), 24e3)


def _structure(body: ToolAssembly) -> Structure:
    return free_body(body, 24e3, shear_coefficient=hutchinson, refinement=2).structure


def _modes(body: ToolAssembly, rng: np.random.Generator, planes: float) -> list[tuple[complex, float]]:
    """Poles and how loud they are."""
    found: list[tuple[complex, float]] = []
    for pole in true_modes(body):
        if abs(pole) > from_hz(22e3):
            break
        split = planes * rng.uniform(0.0, 0.5)
        for side in (-1.0, 1.0):
            found.append((complex(pole * (1.0 + side * split)), float(rng.uniform(0.3, 1.0))))
    for motion in (Motion.AXIAL, Motion.TORSION):
        for mode in rod_modes(body, motion, 22e3):
            damping = rng.uniform(0.002, 0.02) if body.contact is not None else 0.0015
            omega = mode.omega * (1.0 + 0.03 * rng.standard_normal())
            if omega < from_hz(22e3):
                found.append((complex(-damping * omega, omega), float(rng.uniform(0.02, 0.15))))
    return found


def _hit(modes: Sequence[tuple[complex, float]], rng: np.random.Generator, length: int) -> FloatArray:
    """One hit: a half sine of force, its click, and what rings."""
    pulse = rng.uniform(0.08e-3, 0.2e-3)
    time = np.arange(length) / RATE
    ring = np.zeros(length)
    direction = rng.uniform(0.2, 0.8)
    for i, (pole, size) in enumerate(modes):
        # what a half sine excites falls beyond its own frequency
        excited = 1.0 / (1.0 + (to_hz(abs(pole)) * pulse * 1.5) ** 2)
        side = direction if i % 2 else 1.0 - direction
        ring += size * side * excited * np.real(np.exp(pole * time + 1j * rng.uniform(0.0, 0.6)))
    ring *= 1.0 - np.exp(-time / (0.3 * pulse))
    click = int(2.0 * pulse * RATE)
    ring[:click] += 0.7 * np.max(np.abs(ring)) * rng.standard_normal(click) * np.hanning(click)
    return ring


def _in_room(signal: FloatArray, rng: np.random.Generator, room: Room) -> FloatArray:
    length = int(room.reverberation * RATE)
    answer = np.zeros(length)
    answer[0] = 1.0
    for delay in rng.uniform(2.5e-3, 12e-3, 5):
        answer[int(delay * RATE)] += room.reflections * rng.choice([-1.0, 1.0]) * 2.5e-3 / delay
    decay = np.exp(-6.9 * np.arange(length) / length)
    tail = room.tail * decay * rng.standard_normal(length)
    tail[: int(4e-3 * RATE)] = 0.0
    size = signal.size + length
    return np.asarray(np.fft.irfft(np.fft.rfft(signal, size) * np.fft.rfft(answer + tail, size), size)[: signal.size])


def _gain(signal: FloatArray) -> FloatArray:
    """What a phone's gain control does: down within some milliseconds, up again within a quarter of a second."""
    attack, release = np.exp(-1.0 / (3e-3 * RATE)), np.exp(-1.0 / (0.25 * RATE))
    level, gains = 0.0, np.empty(signal.size)
    for i, value in enumerate(np.abs(signal)):
        level = value + (attack if value > level else release) * (level - value)
        gains[i] = 1.0 / (1.0 + 6.0 * level)
    return gains
