"""Virtual machines drawn by chance: spindle, bearings, housing, joint, toolings, workpiece and damping all differ.

The seeds of the study, `EVALUATION` and `DEVELOPMENT`, were fixed before the identification was tuned on any of these machines; the
evaluation machines are for the final figures only. The distributions were settled after a look at all true receptances and at a first
identification of the development machines: docs/study.md says what changed then. What the sensors add is that of
``data/machines/hpm.toml``.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rcsa_ident.base.units import from_hz
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.io.settings.machines import MachineFile, read_machine
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.tip_modes import TIP
from rcsa_ident.virtual.disturbances import Disturbances
from rcsa_ident.workflows.simulate import true_receptances

EVALUATION = tuple(range(1, 11))
DEVELOPMENT = (101, 102, 103)
#: Seeds of the coupled machines, by the same rule; fixed on 2026-11-22, before the package identified cross terms.
COUPLED = tuple(range(201, 211))
COUPLED_DEVELOPMENT = (301, 302, 303)
#: Housing and bearings of a coupled machine are turned by at most so much [deg].
TURNED = 20.0
#: The sample machine with coupled planes: angle of the housing and of each bearing [deg], gyroscopic or not, and what Y's springs and
#: dampers are of those in the file: as X's and Y's are in it, turning both does little.
TURNED_SAMPLE: dict[str, tuple[float, tuple[float, ...], bool, float]] = {
    **{f"oblique-{angle}": (angle, (angle,) * 3, False, 0.6) for angle in (2, 5, 10, 30)},
    "gyroscopic": (0.0, (0.0,) * 3, True, 1.0),
    "turned": (14.0, (-17.0, -4.0, 11.0), True, 1.0),
}
#: What a workshop adds; fixed on 2026-11-23, before the speed was followed inside the record.
WORKSHOP = Disturbances(speed_wander=1e-3, wander_time=0.3, clock_error=1e-3, hum=2e-7, knocks=3.0, knock=1e-7)
#: Before and behind the steady part of each cut, whose length stays as it is [s].
ENTRY = 0.05


class Condition(NamedTuple):
    """What tells the campaigns of one machine apart.

    `noise`: factor on the noise of gap and accelerometer
    `disturbances`: where there are some, each cut enters and leaves the material in its record, too
    `clock`: what is told of the recorder's clock: ``exactly``, ``from the speeds`` (what the identification's remark proposes) or
        ``nothing``
    `campaign`: the condition whose records are taken, where they are the same
    `toolings`: that cut: with 3 the similar one is among them
    `housing` [m]: where on the spindle's housing accelerometers are the only sensors, from the flange's face; None where the flange is seen
    `beside` [m]: where on the housing a further pair of accelerometers stands beside all other sensors; None for none
    `passes`: of four seconds each that take the place of a tooling's 40 cuts, from 8000 to 20000 rev/min one after the other; 0 for none
    """

    trigger: bool = False
    noise: float = 1.0
    disturbances: Disturbances | None = None
    clock: str = "nothing"
    campaign: str = ""
    passes: int = 0
    toolings: int = 2
    housing: float | None = None
    beside: float | None = None


CONDITIONS = {
    "trigger": Condition(trigger=True),
    "no-trigger": Condition(),
    "noise-x3": Condition(noise=3.0),
    "workshop": Condition(disturbances=WORKSHOP, clock="exactly"),
    "workshop-speeds": Condition(disturbances=WORKSHOP, clock="from the speeds", campaign="workshop"),
    "workshop-clock": Condition(disturbances=WORKSHOP, campaign="workshop"),
    "workshop-trigger": Condition(trigger=True, disturbances=WORKSHOP, clock="exactly"),
    "three-toolings": Condition(toolings=3),
    "housing": Condition(toolings=3, housing=0.0, campaign="three-toolings"),
    "housing-beside": Condition(toolings=3, beside=0.35),
    "housing-two": Condition(housing=0.0, campaign="no-trigger"),
    "housing-rear": Condition(toolings=3, housing=0.35),
    "housing-loud": Condition(toolings=3, housing=0.0, disturbances=replace(WORKSHOP, machine_noise=3.4), clock="exactly"),
    "passes": Condition(passes=12),
    "passes-trigger": Condition(trigger=True, passes=12),
    "passes-few": Condition(passes=6),
    "passes-workshop": Condition(disturbances=WORKSHOP, clock="exactly", passes=12),
    "workshop-loud": Condition(disturbances=replace(WORKSHOP, machine_noise=3.4), clock="exactly"),
}
#: What sensors reach, side by side: see docs/study.md.
SENSOR_TESTS = ("three-toolings", "housing-beside", "housing", "housing-two", "housing-rear", "housing-loud")
#: Those of the study; the others are asked for by name.
USUAL = ("trigger", "no-trigger", "noise-x3")
#: Toolings that cut, and those that never do: one in a holder that cut, one in another.
CUT, HELD_OUT = ("first", "second"), ("similar", "different")
#: The stability limit at every speed is at least so many times the depth of the cuts.
MARGIN = 1.35

#: Length, outer and inner diameter of the shaft's segments [mm], from the flange face to the rear.
_SHAFTS = (
    ((30.0, 88.0, 40.0), (110.0, 72.0, 36.0), (180.0, 84.0, 30.0), (120.0, 58.0, 26.0)),
    ((28.0, 100.0, 42.0), (120.0, 90.0, 38.0), (150.0, 104.0, 34.0), (82.0, 70.0, 30.0)),
)
#: Stiffness [N/m] and damping [N s/m] of a front and of a rear bearing.
_BEARINGS = (((3.4e8, 7.8e3), (2.2e8, 5.0e3)), ((5.9e8, 1.2e4), (3.6e8, 8.0e3)))
#: Mass [kg], inertia [kg m^2]; stiffness and damping against translation and against tilting.
_HOUSINGS = ((160.0, 5.5, 8.3e7, 1.15e4, 1.1e7, 900.0), (260.0, 9.0, 1.5e8, 2.0e4, 1.9e7, 1500.0))
#: Segments as (length, outer, end, what the bore has more than the tool) [mm], the first being the insertion; contact per metre.
_HOLDERS = {
    "collet chuck": (((40.0, 50.0, 50.0, 0.0), (32.0, 50.0, 50.0, 2.0)), (2.0e10, 6.0e5, 1.0e5, 40.0)),
    "power chuck": (((44.0, 40.0, 40.0, 0.0), (6.0, 40.0, 40.0, 1.0), (24.0, 45.0, 45.0, 2.0)), (3.0e10, 9.0e5, 1.0e5, 45.0)),
    "shrink fit": (((36.0, 27.0, 32.0, 0.0), (34.0, 34.0, 34.0, 2.0)), (6.0e10, 1.8e6, 8.0e4, 30.0)),
    "hydraulic chuck": (((38.0, 34.0, 36.0, 0.0), (22.0, 50.0, 50.0, 2.0)), (2.5e10, 7.5e5, 1.2e5, 45.0)),
}

SENSORS = """\
[sensors]
sampling_rate_hz = 25600.0
fixture_position_mm = 0.0
flange_sensitivity = 10.0e3
flange_noise_nm = 2.0
flange_drift_um = 1.0
fixture_sensitivity = 1.1094e-3
fixture_noise = 0.05
roundness_um = 4.0
roundness_orders = 8
cutter_runout_um = 2.0
speed_error_percent = 0.1
trigger = true
tooth_angle_deg = {angle:.2f}
"""
CUTS = """\
[cuts]
toolings = ["toolings/first.toml", "toolings/second.toml"]
truth_toolings = ["toolings/similar.toml", "toolings/different.toml"]
spindle_speeds_rpm = {{ from = 8000.0, to = 20000.0, count = 40 }}
axial_depth_mm = {depth:.3f}
feed_per_tooth_mm = 0.1
entry_angle_deg = 90.0
exit_angle_deg = 180.0
feed_direction = "+X"
duration_s = 0.28
settling_s = 0.25
"""

#: What the names of the coupled machines begin with; those of the others are their seeds alone.
_COUPLED = "coupled-"

Holder = dict[str, Any]
Tool = dict[str, Any]


def random_machine(seed: int, folder: Path, coupled: bool = False) -> Path:
    """Draw a machine with its toolings, write both into `folder`, and return the machine file; same seed, same files.

    `folder`: made if it is not there
    `coupled`: turn housing and bearings by angles of their own, drawn evenly within +-`TURNED`, and let gyroscopic moments act; all else is
        as the same seed draws it without, but for the depth of cut
    """
    rngs = np.random.default_rng(seed).spawn(6)
    turn = rngs[5] if coupled else None
    housing = _housing_and_joint(rngs[1], turn)
    gyroscopic, spindle = _spindle(rngs[0], turn)
    gyroscopic = gyroscopic or coupled
    depth, angle = rngs[4].uniform(0.2, 0.4), rngs[4].uniform(0.0, 360.0)
    (folder / "toolings").mkdir(parents=True, exist_ok=True)
    for name, text in _toolings(rngs[2]).items():
        (folder / "toolings" / f"{name}.toml").write_text(text, encoding="utf-8")
    head = f'[machine]\nname = "{"Coupled" if coupled else "Drawn"} machine {seed}"\ngyroscopic = {"true" if gyroscopic else "false"}\n'
    parts = [head, spindle, housing, SENSORS.format(angle=angle), _workpiece(rngs[3])]
    path = folder / "machine.toml"

    def write(depth: float) -> None:
        path.write_text("\n".join([*parts, CUTS.format(depth=depth)]), encoding="utf-8")

    write(depth)
    limit = least_limit(read_machine(path))
    while MARGIN * depth * 1e-3 > limit:
        depth *= 0.9
    write(depth)
    return path


def drawn(name: str) -> tuple[int, bool] | None:
    """Return seed and whether it is coupled of a drawn machine, as ``3`` or ``coupled-203``; None of another name."""
    seed = name.removeprefix(_COUPLED)
    return (int(seed), seed != name) if seed.isdigit() else None


def is_coupled(name: str) -> bool:
    """Return whether the name is that of a coupled machine."""
    return name in TURNED_SAMPLE or (drawn(name) or (0, False))[1]


def turned_sample(path: Path, name: str) -> MachineFile:
    """Return the sample machine of a file with the planes of one of `TURNED_SAMPLE`."""
    housing_angle, bearing_angles, gyroscopic, share = TURNED_SAMPLE[name]
    machine = read_machine(path)

    def softer(values: tuple[float, float]) -> tuple[float, float]:
        return values[0], share * values[1]

    old = machine.spindle
    names = ("stiffness", "damping", "tilting_stiffness", "tilting_damping")
    housing = replace(old.housing, angle=np.deg2rad(housing_angle), **{each: softer(getattr(old.housing, each)) for each in names})
    bearings = tuple(
        replace(b, angle=np.deg2rad(angle), **{each: softer(getattr(b, each)) for each in names[:2]})
        for b, angle in zip(old.bearings, bearing_angles, strict=True)
    )
    return replace(machine, name=name, spindle=replace(old, housing=housing, bearings=bearings, gyroscopic=gyroscopic))


def named(names: Sequence[str]) -> list[str]:
    """Return the machines' names; ``drawn`` and ``coupled`` stand for the ten of either kind, ``turned-sample`` for those."""
    groups = {
        "drawn": [str(seed) for seed in EVALUATION],
        "coupled": [f"{_COUPLED}{seed}" for seed in COUPLED],
        "turned-sample": list(TURNED_SAMPLE),
    }
    return [each for name in names for each in groups.get(name, [name])]


def under(machine: MachineFile, condition: str) -> MachineFile:
    """Return the machine with the sensors of one of the `CONDITIONS`."""
    trigger, noise, disturbances = CONDITIONS[condition][:3]
    sensors, plan = machine.sensors, machine.plan
    gap, acceleration = noise * sensors.gap_noise, noise * sensors.acceleration_noise
    if CONDITIONS[condition].passes:
        ends = np.linspace(plan.spindle_speeds[0], plan.spindle_speeds[-1], CONDITIONS[condition].passes + 1)
        plan = replace(plan, spindle_speeds=(), passes=tuple(itertools.pairwise(ends.tolist())))
    if CONDITIONS[condition].toolings == len(CUT) + 1:
        similar, *others = machine.truth_toolings
        machine = replace(machine, toolings=(*machine.toolings, similar), truth_toolings=tuple(others))
    place = CONDITIONS[condition].housing
    if place is not None:
        machine = replace(machine, spindle=replace(machine.spindle, fixture_position=place))
    beside = CONDITIONS[condition].beside
    if beside is not None:
        machine = replace(machine, spindle=replace(machine.spindle, housing_positions=(beside,)))
    sensors = replace(sensors, trigger=trigger, gap_noise=gap, acceleration_noise=acceleration)
    if disturbances is None:
        return replace(machine, sensors=sensors, plan=plan)
    more = 2.0 * ENTRY
    plan = replace(plan, duration=plan.duration + more, pass_duration=plan.pass_duration + more, entry=ENTRY, leave=ENTRY)
    return replace(machine, sensors=sensors, disturbances=disturbances, plan=plan)


def least_limit(machine: MachineFile) -> float:
    """Return the least depth [m] at which a cut of the campaign can chatter, from the true tip receptances (zero-order limit).

    Those at the mean of the speeds; of a coupled machine also those at the slowest and the fastest.
    """
    plan = machine.plan
    least = np.inf
    for path in machine.toolings:
        tooling = read_tooling(path)
        process = MillingProcess(tooling.cutter, machine.workpiece.coefficients, plan.engagement, plan.feed_angle)
        speeds = np.linspace(0.99 * min(plan.spindle_speeds), 1.01 * max(plan.spindle_speeds), 2000)
        for speed in (None, min(plan.spindle_speeds), max(plan.spindle_speeds))[: 3 if machine.spindle.coupled else 1]:
            lobes = stability_lobes(true_tip(machine, tooling, speed), process, speeds, 1.0)
            least = min(least, float(lobes.limit_depth.min()))
    return least


def true_tip(machine: MachineFile, tooling: Tooling, speed: float | None = None) -> Receptance:
    """Return the tip's true receptance, cross terms included, at a spindle speed [rad/s], by default the mean of the plan's."""
    true = true_receptances(machine, tooling, speed)
    return Receptance(from_hz(true.frequency_hz), true.tip, TIP, TIP)


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _pair(rng: np.random.Generator, value: float) -> str:
    """X and Y: Y up to 15 % below."""
    return f"[{value:.5g}, {value * (1.0 - rng.uniform(0.0, 0.15)):.5g}]"


def _angle(turn: np.random.Generator | None) -> list[str]:
    """The line of an element's angle, where elements are turned."""
    return [] if turn is None else [f"angle_deg = {turn.uniform(-TURNED, TURNED):.2f}"]


def _spindle(rng: np.random.Generator, turn: np.random.Generator | None) -> tuple[bool, str]:
    """Whether gyroscopic moments act, and the text of shaft and bearings; the shaft is within 25 % of one of two."""
    kind = int(rng.integers(2))
    lines = ["[shaft]", "segments = ["]
    length = 0.0
    for piece, outer, inner in _SHAFTS[kind]:
        own, wide = piece * rng.uniform(0.75, 1.25), rng.uniform(0.75, 1.25)
        length += round(own, 1)
        lines.append(
            f"  {{ length_mm = {own:.1f}, outer_diameter_mm = {outer * wide:.1f}, inner_diameter_mm = {inner * wide:.1f}, "
            'material = "steel" },'
        )
    lines.append("]")
    count = int(rng.integers(2, 5))
    front, rear = rng.uniform(0.09, 0.13), rng.uniform(0.84, 0.93)
    places = [front, front + rng.uniform(0.07, 0.11), rear, rear - rng.uniform(0.07, 0.11)]
    chosen = sorted({2: [places[0], places[2]], 3: places[:3], 4: places}[count])
    # the whole machine is lightly or strongly damped, not each bearing for itself
    damped = _log_uniform(rng, 0.4, 2.5)
    softening = _log_uniform(rng, 1e-6, 5e-6) if rng.random() < 0.3 else 0.0
    for place in chosen:
        stiffness, damping = _BEARINGS[kind][int(place > 0.5)]
        lines += [
            "[[bearings]]",
            f"position_mm = {place * length:.1f}",
            f"stiffness = {_pair(rng, stiffness * _log_uniform(rng, 0.5, 2.0))}",
            f"damping = {_pair(rng, damping * damped * _log_uniform(rng, 0.8, 1.25))}",
            *_angle(turn),
        ]
        if softening:
            lines.append(f"softening_per_rpm = {softening:.3g}")
    lines.append("")
    return bool(rng.random() < 0.1), "\n".join(lines)


def _housing_and_joint(rng: np.random.Generator, turn: np.random.Generator | None) -> str:
    kind = int(rng.integers(2))
    mass, inertia, *springs = _HOUSINGS[kind]
    heavy = rng.uniform(0.75, 1.25)
    stiffness, damping, tilting_stiffness, tilting_damping = (
        value * _log_uniform(rng, low, 1.0 / low) for value, low in zip(springs, (0.6, 0.4, 0.6, 0.4), strict=True)
    )
    lines = [
        "[housing]",
        f"position_mm = {rng.uniform(150.0, 220.0):.1f}",
        f"mass = {mass * heavy:.1f}",
        f"inertia = {inertia * heavy * rng.uniform(0.75, 1.25):.3g}",
        f"stiffness = {_pair(rng, stiffness)}",
        f"damping = {_pair(rng, damping)}",
        f"tilting_stiffness = {_pair(rng, tilting_stiffness)}",
        f"tilting_damping = {_pair(rng, tilting_damping)}",
        *_angle(turn),
        "",
        "[joint]",
        f"translational_stiffness = {_log_uniform(rng, 1.0e9, 1.0e10):.4g}",
        f"translational_damping = {_log_uniform(rng, 500.0, 5000.0):.4g}",
        f"rotational_stiffness = {_log_uniform(rng, 2.0e6, 2.0e7):.4g}",
        f"rotational_damping = {_log_uniform(rng, 4.0, 40.0):.4g}",
        "",
    ]
    return "\n".join(lines)


def _toolings(rng: np.random.Generator) -> dict[str, str]:
    families = [str(name) for name in rng.permutation(list(_HOLDERS))]
    diameters = [float(d) for d in rng.choice([10.0, 12.0, 14.0, 16.0], 3)]
    holders = [_holder(rng, family, diameter) for family, diameter in zip(families[:3], diameters, strict=True)]
    tools = [_tool(rng, diameter) for diameter in diameters]
    like = int(rng.integers(2))
    # the same holder with the same tool farther out or in, or with another tool
    other = dict(tools[like]) if rng.random() < 0.5 else _tool(rng, diameters[like])
    change = float(rng.choice([-1.0, 1.0])) * rng.uniform(4.0, 9.0)
    other["stickout"] = tools[like]["stickout"] + change
    named = zip((*CUT, *HELD_OUT), (*holders[:2], holders[like], holders[2]), (*tools[:2], other, tools[2]), strict=True)
    return {name: _tooling_text(name, holder, tool) for name, holder, tool in named}


def _holder(rng: np.random.Generator, family: str, bore: float) -> Holder:
    segments, contact = _HOLDERS[family]
    drawn = []
    for length, outer, end, more in segments:
        wide = rng.uniform(0.9, 1.1)
        # thin tools need no thick shrink fit: walls stay, bores differ
        grow = bore - 12.0 if family in ("shrink fit", "hydraulic chuck") else 0.0
        drawn.append((length * rng.uniform(0.8, 1.2), outer * wide + grow, end * wide + grow, bore + more))
    stiff, damped = _log_uniform(rng, 0.6, 1.6), _log_uniform(rng, 0.6, 1.6)
    k_t, k_r, c_t, c_r = contact
    return {"family": family, "segments": drawn, "contact": (k_t * stiff, k_r * stiff, c_t * damped, c_r * damped)}


def _tool(rng: np.random.Generator, diameter: float) -> Tool:
    steel = bool(rng.random() < 0.2)
    # steel bends three times as easily
    reach = rng.uniform(48.0, 65.0) * np.sqrt(diameter / 12.0) * (0.75 if steel else 1.0)
    return {
        "diameter": diameter,
        "material": "steel" if steel else "carbide",
        "stickout": reach,
        "fluted": rng.uniform(1.8, 2.4) * diameter,
        "core": rng.uniform(0.77, 0.83) * diameter,
        "teeth": int(rng.choice([2, 3, 4], p=[0.15, 0.15, 0.7])),
        "helix": float(rng.uniform(25.0, 45.0)),
    }


def _tooling_text(name: str, holder: Holder, tool: Tool) -> str:
    insertion = round(holder["segments"][0][0], 1)
    stickout, fluted = round(tool["stickout"], 1), round(tool["fluted"], 1)
    lines = [
        f"# {holder['family']}",
        f'name = "{name}"',
        "[cutter]",
        f"teeth = {tool['teeth']}",
        f"diameter_mm = {tool['diameter']:.1f}",
        f"helix_deg = {tool['helix']:.1f}",
        "[tool]",
        f"stickout_mm = {stickout:.1f}",
        "segments = [",
        f'  {{ length_mm = {fluted:.1f}, outer_diameter_mm = {tool["core"]:.2f}, material = "{tool["material"]}" }},',
        f"  {{ length_mm = {stickout + insertion - fluted:.1f}, outer_diameter_mm = {tool['diameter']:.1f}, "
        f'material = "{tool["material"]}" }},',
        "]",
        "[holder]",
        f"insertion_mm = {insertion:.1f}",
        "segments = [",
    ]
    # an HSK-A63 collar ends every holder
    for length, outer, end, inner in (*holder["segments"], (26.0, 63.0, 63.0, 20.0)):
        cone = f"end_diameter_mm = {end:.1f}, " if end != outer else ""
        lines.append(
            f'  {{ length_mm = {length:.1f}, outer_diameter_mm = {outer:.1f}, {cone}inner_diameter_mm = {inner:.1f}, material = "steel" }},'
        )
    lines += ["]", "[contact]"]
    keys = ("translational_stiffness", "rotational_stiffness", "translational_damping", "rotational_damping")
    lines += [f"{key} = {value:.4g}" for key, value in zip(keys, holder["contact"], strict=True)]
    return "\n".join([*lines, ""])


def _workpiece(rng: np.random.Generator) -> str:
    """EN AW-6082 without edge forces, as on ``hpm``, or EN AW-7075 with, as on ``stiff``."""
    edges = bool(rng.random() >= 0.5)
    lines = [
        "[workpiece]",
        f'name = "{"EN AW-7075" if edges else "EN AW-6082"}"',
        f"tangential_coefficient_mpa = {rng.uniform(700.0, 1000.0):.1f}",
        f"radial_ratio = {rng.uniform(0.2, 0.35):.3f}",
    ]
    if edges:
        lines += [
            f"tangential_edge_n_per_mm = {rng.uniform(0.0, 10.0):.2f}",
            f"radial_edge_n_per_mm = {rng.uniform(0.0, 8.0):.2f}",
        ]
    return "\n".join([*lines, ""])
