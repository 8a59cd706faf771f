"""MACHINE.toml: a virtual machine, its sensors and the cuts that it shall make."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.plausibility import AXIAL_DEPTH, FEED_PER_TOOTH, LARGEST_SWEEP, LEAST_SWEEP
from rcsa_ident.base.units import from_hz, from_rpm, to_rpm
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.io.settings.cuts import feed_angle_of
from rcsa_ident.io.settings.setups import beam_segments, material_library
from rcsa_ident.io.settings.workpieces import WORKPIECE_KEYS, workpiece_of
from rcsa_ident.io.toml_text import read_toml
from rcsa_ident.io.validated_table import Table
from rcsa_ident.setup.cut import Workpiece
from rcsa_ident.virtual.changes import Changes, ChipLaw, JointChanges, Warming
from rcsa_ident.virtual.disturbances import Disturbances
from rcsa_ident.virtual.machine import Bearing, CutPlan, FlangeJoint, Housing, PerAxis, VirtualSpindle
from rcsa_ident.virtual.robot import VirtualRobot
from rcsa_ident.virtual.sensors import UNDISTURBED, SensorSuite
from rcsa_ident.virtual.workpiece_side import ROLES, SideMode, VirtualWorkpieceSide

_TOP = (
    "machine", "shaft", "materials", "bearings", "housing", "joint", "workpiece_side", "sensors", "disturbances", "warming",
    "joint_changes", "chip_law", "workpiece", "cuts",
)  # fmt: skip
_BEARING = ("position_mm", "stiffness", "damping", "softening_per_rpm", "angle_deg")
_HOUSING = ("position_mm", "mass", "inertia", "stiffness", "damping", "tilting_stiffness", "tilting_damping", "angle_deg")
_SIDE_MODE = ("natural_frequency_hz", "damping_ratio", "stiffness_n_per_m")
_JOINT = ("translational_stiffness", "translational_damping", "rotational_stiffness", "rotational_damping")
_SENSORS = (
    "sampling_rate_hz", "fixture_position_mm", "flange_position_mm", "housing_positions_mm",
    "flange_sensitivity", "flange_noise_nm", "flange_drift_um",
    "flange_delay_s", "flange_bandwidth_hz", "fixture_sensitivity", "fixture_noise", "fixture_delay_s", "fixture_bandwidth_hz",
    "roundness_um",
    "roundness_orders", "cutter_runout_um", "speed_error_percent", "trigger", "tooth_angle_deg",
)  # fmt: skip
_CUTS = (
    "toolings", "truth_toolings", "spindle_speeds_rpm", "axial_depth_mm", "feed_per_tooth_mm", "entry_angle_deg", "exit_angle_deg",
    "feed_direction", "duration_s", "settling_s", "entry_s", "exit_s", "passes_rpm", "pass_duration_s",
)  # fmt: skip
_DISTURBANCES = (
    "speed_wander_percent", "wander_time_s", "clock_error_percent", "hum_um", "mains_hz", "machine_noise", "knocks_per_s", "knock_um",
)  # fmt: skip

_WARMING = ("loss_percent", "time_constant_s", "exponent", "running_s", "pause_s", "warm_up_s", "shuffled", "rise_c", "reading_sd_c")
_JOINT_CHANGES = ("softening_percent", "amplitude_um", "reclamping_percent")
STEADY = Changes()


@dataclass(frozen=True, slots=True, eq=False)
class MachineFile:
    """What a machine file says.

    `toolings`: tooling files of the cuts
    `truth_toolings`: toolings that never cut, whose receptances are wanted
    `workpiece_side`: what gives way under the workpiece, with a pair of accelerometers on it; None where it is rigid
    `changes`: what is not the same in every cut
    """

    name: str
    spindle: VirtualSpindle
    sensors: SensorSuite
    workpiece: Workpiece
    plan: CutPlan
    toolings: tuple[Path, ...]
    truth_toolings: tuple[Path, ...] = ()
    disturbances: Disturbances = UNDISTURBED
    workpiece_side: VirtualWorkpieceSide | None = None
    changes: Changes = STEADY


@dataclass(frozen=True, slots=True, eq=False)
class RobotSetup:
    """A virtual robot with the sensors of a virtual machine, what it cuts at each of some postures, and how.

    `postures` [rad], shape (c, j)
    `plan`: of the cuts of each tooling at each posture; the feed is told in the spindle's X-Y plane
    """

    robot: VirtualRobot
    postures: FloatArray
    sensors: SensorSuite
    workpiece: Workpiece
    plan: CutPlan
    disturbances: Disturbances = UNDISTURBED

    @property
    def spindle(self) -> VirtualSpindle:
        """The spindle in its hand."""
        return self.robot.spindle

    @property
    def workpiece_side(self) -> None:
        """Nothing else gives way."""
        return

    @property
    def changes(self) -> Changes:
        """Each cut finds the same robot."""
        return STEADY


def read_machine(path: str | Path) -> MachineFile:
    """Return what a machine file says; paths of toolings are relative to it.

    Raises `InputError`, which names the file, the key, what was found and what is allowed.
    """
    path = Path(path)
    return machine_of(read_toml(path, "machine"), str(path), path.stem, path.parent)


def machine_of(data: Mapping[str, Any], where: str, name: str, folder: Path) -> MachineFile:
    """Return what a machine's table of keys says, as `read_machine` finds it in a file.

    `data`: the table's keys
    `where`: the file, for the messages
    `name`: counts where the table has none
    `folder`: that paths of toolings are relative to
    """
    top = Table(data, where, known=_TOP)
    head = top.table("machine", ("name", "gyroscopic"), {})
    sensors = top.table("sensors", _SENSORS, {})
    cuts = top.table("cuts", _CUTS)
    with top.naming({}):
        plan = _plan(cuts)
        spindle = VirtualSpindle(
            shaft=beam_segments(top.table("shaft", ("segments",)), material_library(top)),
            bearings=tuple(_bearing(table) for table in top.tables("bearings", _BEARING)),
            housing=_housing(top.table("housing", _HOUSING)),
            joint=_joint(top.table("joint", _JOINT)),
            gyroscopic=head.flag("gyroscopic", True),
            fixture_position=sensors.number("fixture_position_mm", "mm", 0.0, least=-1000.0, most=5000.0) * 1e-3,
            housing_positions=_positions(sensors),
            seen_at=sensors.number("flange_position_mm", "mm", 0.0, least=-100.0, most=200.0) * 1e-3,
        )
        fastest = max(plan.programmed)
        for i, bearing in enumerate(spindle.bearings):
            if bearing.softening * fastest >= 1.0:
                allowed = f"below {1.0 / to_rpm(fastest):.3g} at {to_rpm(fastest):g} rev/min, so that some stiffness is left"
                top.refuse(f"bearings[{i}].softening_per_rpm", f"{bearing.softening * from_rpm(1.0):g}", allowed)
        return MachineFile(
            name=head.text("name", name),
            spindle=spindle,
            sensors=_sensors(sensors),
            workpiece=workpiece_of(top.table("workpiece", WORKPIECE_KEYS)),
            plan=plan,
            toolings=_paths(cuts, "toolings", folder, required=True),
            truth_toolings=_paths(cuts, "truth_toolings", folder, required=False),
            disturbances=_disturbances(top.table("disturbances", _DISTURBANCES, {})),
            workpiece_side=_workpiece_side(top.table("workpiece_side", ("role", "x", "y"))) if "workpiece_side" in top else None,
            changes=_changes(top),
        )


def _changes(top: Table) -> Changes:
    warming = joint = law = None
    if "warming" in top:
        table = top.table("warming", _WARMING)
        warming = Warming(
            table.number("loss_percent", "%", least=-50.0, most=50.0) * 1e-2,
            table.number("time_constant_s", "s", 900.0, above=0.0),
            table.number("exponent", "", 1.25, least=0.0, most=3.0),
            table.number("running_s", "s", 60.0, above=0.0),
            table.number("pause_s", "s", 20.0, least=0.0),
            table.number("warm_up_s", "s", 0.0, least=0.0),
            table.flag("shuffled", False),
            table.number("rise_c", "K", None, above=0.0, most=100.0),
            table.number("reading_sd_c", "K", 0.2, least=0.0, most=20.0),
        )
    if "joint_changes" in top:
        table = top.table("joint_changes", _JOINT_CHANGES)
        joint = JointChanges(
            table.number("softening_percent", "%", 0.0, least=0.0, most=99.0) * 1e-2,
            table.number("amplitude_um", "um", 0.1, above=0.0) * 1e-6,
            table.number("reclamping_percent", "%", 0.0, least=0.0, most=50.0) * 1e-2,
        )
    if "chip_law" in top:
        table = top.table("chip_law", ("exponent", "thickness_mm"))
        law = ChipLaw(table.number("exponent", "", least=-0.9, most=0.0), table.number("thickness_mm", "mm", 0.05, above=0.0) * 1e-3)
    return Changes(warming, joint, law)


def _bearing(table: Table) -> Bearing:
    return Bearing(
        table.number("position_mm", "mm", least=0.0, most=5000.0) * 1e-3,
        _pair(table, "stiffness", "N/m", above=0.0),
        _pair(table, "damping", "N s/m", least=0.0),
        table.number("softening_per_rpm", "1/(rev/min)", 0.0, least=-1e-3, most=1e-3) / from_rpm(1.0),
        _angle(table),
    )


def _housing(table: Table) -> Housing:
    return Housing(
        position=table.number("position_mm", "mm", least=-5000.0, most=5000.0) * 1e-3,
        mass=table.number("mass", "kg", above=0.0),
        inertia=table.number("inertia", "kg m^2", above=0.0),
        stiffness=_pair(table, "stiffness", "N/m", above=0.0),
        damping=_pair(table, "damping", "N s/m", least=0.0),
        tilting_stiffness=_pair(table, "tilting_stiffness", "N m/rad", above=0.0),
        tilting_damping=_pair(table, "tilting_damping", "N m s/rad", least=0.0),
        angle=_angle(table),
    )


def _joint(table: Table) -> FlangeJoint:
    stiff, damped, stiff_turning, damped_turning = _JOINT
    return FlangeJoint(
        table.number(stiff, "N/m", above=0.0),
        table.number(damped, "N s/m", least=0.0),
        table.number(stiff_turning, "N m/rad", above=0.0),
        table.number(damped_turning, "N m s/rad", least=0.0),
    )


def _workpiece_side(table: Table) -> VirtualWorkpieceSide:
    def modes(axis: str) -> tuple[SideMode, ...]:
        return tuple(_side_mode(mode) for mode in table.tables(axis, _SIDE_MODE)) if axis in table else ()

    return VirtualWorkpieceSide(modes("x"), modes("y"), table.text("role", "table", choices=ROLES))


def _side_mode(table: Table) -> SideMode:
    return SideMode(
        from_hz(table.number("natural_frequency_hz", "Hz", above=0.0, most=1e5)),
        table.number("damping_ratio", "", above=0.0, most=0.999),
        table.number("stiffness_n_per_m", "N/m", above=0.0),
    )


def _sensors(table: Table) -> SensorSuite:
    usual = SensorSuite()
    return SensorSuite(
        rate=table.number("sampling_rate_hz", "Hz", usual.rate, above=0.0, most=1e6),
        gap_noise=table.number("flange_noise_nm", "nm", usual.gap_noise * 1e9, least=0.0) * 1e-9,
        gap_drift=table.number("flange_drift_um", "um", usual.gap_drift * 1e6, least=0.0) * 1e-6,
        acceleration_noise=table.number("fixture_noise", "m/s^2", usual.acceleration_noise, least=0.0),
        roundness=table.number("roundness_um", "um", usual.roundness * 1e6, least=0.0) * 1e-6,
        roundness_orders=table.number("roundness_orders", "", usual.roundness_orders, least=0, most=64, whole=True),
        cutter_runout=table.number("cutter_runout_um", "um", usual.cutter_runout * 1e6, least=0.0) * 1e-6,
        speed_error=table.number("speed_error_percent", "%", usual.speed_error * 1e2, least=0.0, most=4.0) * 1e-2,
        trigger=table.flag("trigger", False),
        tooth_angle=float(np.radians(table.number("tooth_angle_deg", "deg", 0.0, least=-360.0, most=360.0))),
        gap_sensitivity=table.number("flange_sensitivity", "V/m", 1.0),
        acceleration_sensitivity=table.number("fixture_sensitivity", "V/(m/s^2)", 1.0),
        gap_delay=table.number("flange_delay_s", "s", 0.0, least=0.0, most=2e-4),
        acceleration_delay=table.number("fixture_delay_s", "s", 0.0, least=0.0, most=2e-4),
        gap_bandwidth=table.number("flange_bandwidth_hz", "Hz", None, above=0.0),
        acceleration_bandwidth=table.number("fixture_bandwidth_hz", "Hz", None, above=0.0),
    )


def _positions(table: Table) -> tuple[float, ...]:
    """Of further accelerometers on the housing [m]."""
    given = table.numbers("housing_positions_mm", None, "mm", least=-1000.0) if "housing_positions_mm" in table else []
    return tuple(1e-3 * each for each in given)


def _disturbances(table: Table) -> Disturbances:
    usual = UNDISTURBED
    return Disturbances(
        speed_wander=table.number("speed_wander_percent", "%", usual.speed_wander * 1e2, least=0.0, most=2.0) * 1e-2,
        wander_time=table.number("wander_time_s", "s", usual.wander_time, above=0.0, most=60.0),
        clock_error=table.number("clock_error_percent", "%", usual.clock_error * 1e2, least=-2.0, most=2.0) * 1e-2,
        hum=table.number("hum_um", "um", usual.hum * 1e6, least=0.0) * 1e-6,
        mains=table.number("mains_hz", "Hz", usual.mains, above=0.0, most=1000.0),
        machine_noise=table.number("machine_noise", "m/s^2", usual.machine_noise, least=0.0),
        knocks=table.number("knocks_per_s", "1/s", usual.knocks, least=0.0, most=1000.0),
        knock=table.number("knock_um", "um", usual.knock * 1e6, least=0.0) * 1e-6,
    )


def _plan(table: Table) -> CutPlan:
    entry = table.number("entry_angle_deg", "deg", least=0.0, most=180.0)
    exit_ = table.number("exit_angle_deg", "deg", least=0.0, most=180.0)
    if exit_ <= entry:
        table.refuse("exit_angle_deg", f"{exit_:g}", f"above entry_angle_deg, {entry:g}, and at most 180 [deg]")
    return CutPlan(
        spindle_speeds=tuple(from_rpm(float(speed)) for speed in _speeds(table)),
        axial_depth=table.quantity("axial_depth_mm", AXIAL_DEPTH) * 1e-3,
        feed_per_tooth=table.quantity("feed_per_tooth_mm", FEED_PER_TOOTH) * 1e-3,
        engagement=Engagement(float(np.radians(entry)), float(np.radians(exit_))),
        feed_angle=feed_angle_of(table),
        duration=table.number("duration_s", "s", 0.3, above=0.0, most=60.0),
        settling=table.number("settling_s", "s", 0.15, least=0.0, most=60.0),
        entry=table.number("entry_s", "s", 0.0, least=0.0, most=60.0),
        leave=table.number("exit_s", "s", 0.0, least=0.0, most=60.0),
        passes=_passes(table),
        pass_duration=table.number("pass_duration_s", "s", 4.0, above=0.0, most=60.0),
    )


def _speeds(table: Table) -> list[float]:
    """A list of speeds, or from, to and count; none where there are passes."""
    if "spindle_speeds_rpm" not in table and "passes_rpm" in table:
        return []
    value = table.value("spindle_speeds_rpm", "a list of speeds, or { from, to, count } [rev/min]")
    if not isinstance(value, dict):
        speeds = table.numbers("spindle_speeds_rpm", None, "rev/min", above=0.0)
        if not speeds or max(speeds) > 500000.0:
            table.refuse("spindle_speeds_rpm", f"{speeds}", "one or more speeds above 0 and at most 500000 [rev/min]")
        return speeds
    limits = table.table("spindle_speeds_rpm", ("from", "to", "count"))
    first, last = (limits.number(key, "rev/min", above=0.0, most=500000.0) for key in ("from", "to"))
    return np.linspace(first, last, limits.number("count", "", least=1, most=10000, whole=True)).tolist()


def _passes(table: Table) -> tuple[tuple[float, float], ...]:
    """Passes one after the other, [rad/s]: from, to and count."""
    if "passes_rpm" not in table:
        return ()
    limits = table.table("passes_rpm", ("from", "to", "count"))
    first, last = (limits.number(key, "rev/min", above=0.0, most=500000.0) for key in ("from", "to"))
    ends = np.linspace(first, last, limits.number("count", "", least=1, most=1000, whole=True) + 1)
    least = 100.0 * LEAST_SWEEP
    for low, high in itertools.pairwise(ends.tolist()):
        if not LEAST_SWEEP <= abs(high / low - 1.0) <= LARGEST_SWEEP:
            allowed = f"{least:g} % to {100 * LARGEST_SWEEP:g} % of change in each pass"
            table.refuse("passes_rpm", f"a pass from {low:g} to {high:g}", allowed)
    return tuple((from_rpm(low), from_rpm(high)) for low, high in itertools.pairwise(ends.tolist()))


def _pair(table: Table, key: str, unit: str, *, above: float | None = None, least: float | None = None) -> PerAxis:
    x, y = table.numbers(key, 2, unit, above=above, least=least)
    return x, y


def _angle(table: Table) -> float:
    """Of an element's principal directions about the spindle's axis."""
    return float(np.radians(table.number("angle_deg", "deg", 0.0, least=-180.0, most=180.0)))


def _paths(table: Table, key: str, folder: Path, required: bool) -> tuple[Path, ...]:
    allowed = "a list of paths of tooling files, relative to the machine file"
    return tuple(folder / path for path in table.texts(key, allowed, required))
