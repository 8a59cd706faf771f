"""Recordings from the virtual machine: a campaign's folder, and the truth outside it."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rcsa_ident.cutting.conditions import CuttingConditions
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.dynamics.arrays import FloatArray
from rcsa_ident.errors import InputError
from rcsa_ident.io.files import write_text
from rcsa_ident.io.machines import MachineFile, read_machine
from rcsa_ident.io.recordings import write_hdf5
from rcsa_ident.io.setups import read_tooling
from rcsa_ident.machining_setup import Tooling
from rcsa_ident.virtual.milling import CutHistory, mill_cut, synchronous_lines
from rcsa_ident.virtual.reduction import Poles, poles, reduced
from rcsa_ident.virtual.rotor import frequency_response, rotor
from rcsa_ident.virtual.sensors import Clamping, clamp, padding, record

#: Instants of the time march per sample of the records.
OVERSAMPLING = 8
#: Frequencies of the true receptances [Hz].
TRUTH_FREQUENCIES = (5.0, 4500.0, 5.0)

Progress = Callable[[int, int], None]


@dataclass(frozen=True, slots=True)
class SimulatedCampaign:
    """Where a simulated campaign was written.

    Parameters
    ----------
    folder : Path
    truth : Path
        ``tip/``, ``cross/``, ``spindle.csv``: receptances; ``records.csv``: true speeds and tooth angles at the first sample;
        ``forces/``: lines of the true force, F = Re sum_m lines[m] e^{i m angle of tooth 1}. No reader of the folder sees it.
    cuts : int
    """

    folder: Path
    truth: Path
    cuts: int


@dataclass(frozen=True, slots=True, eq=False)
class _Job:
    """One pair of records, cut and air, with its own share of chance."""

    id: str
    tooling: Tooling
    dynamics: Poles
    clamping: Clamping
    conditions: CuttingConditions
    rng: np.random.Generator


def simulate(
    machine: str | Path | MachineFile,
    out: str | Path,
    seed: int = 1,
    progress: Progress | None = None,
    mapper: Callable[[Callable, Iterable], Iterable] = map,
) -> SimulatedCampaign:
    """Let a virtual machine make its cuts; write the campaign into `out` and the truth into ``<out>.truth``.

    Parameters
    ----------
    machine : path of a machine file, or what was read from one
    out : path
        A folder that does not exist yet, or an empty one.
    seed : int
        Same seed, same files.
    progress : callable of (done, total), optional
    mapper : callable like `map`, optional
        Runs the cuts; they do not depend on each other's order.
    """
    setup = machine if isinstance(machine, MachineFile) else read_machine(machine)
    out = Path(out)
    truth = out.with_name(out.name + ".truth")
    for folder in (out, truth):
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise InputError("out", str(folder), "a folder that does not exist or is empty")
    toolings = [read_tooling(path) for path in setup.toolings]
    extra = [read_tooling(path) for path in setup.truth_toolings]
    if len({t.name for t in (*toolings, *extra)}) != len(toolings) + len(extra):
        raise InputError("cuts.toolings", ", ".join(t.name for t in (*toolings, *extra)), "toolings with different names")
    for folder in (out / "recordings", out / "toolings", truth / "tip", truth / "cross", truth / "forces"):
        folder.mkdir(parents=True, exist_ok=True)
    for path, tooling in zip(setup.toolings, toolings, strict=True):
        shutil.copyfile(path, out / "toolings" / f"{tooling.name}.toml")
    write_text(out / "campaign.toml", _campaign_text(setup, toolings))
    jobs = list(_jobs(setup, toolings, np.random.default_rng(seed)))
    rows = ["record,spindle_speed_rpm,tooth_angle_deg"]
    for done, (job, (records, lines)) in enumerate(zip(jobs, mapper(_Worker(setup), jobs), strict=True), start=1):
        order = np.arange(lines.shape[0])
        table = np.column_stack([order, lines[:, 0].real, lines[:, 0].imag, lines[:, 1].real, lines[:, 1].imag])
        _write_table(truth / "forces" / f"{job.id}.csv", "order,X_re,X_im,Y_re,Y_im", table)
        for kind, (speed, angle, channels) in records.items():
            write_hdf5(out / "recordings" / f"{job.id}_{kind}.h5", setup.sensors.rate, channels)
            rows.append(f"{job.id}_{kind},{speed * 30.0 / np.pi:.9g},{np.degrees(angle):.9g}")
        if progress is not None:
            progress(done, len(jobs))
    write_text(truth / "records.csv", "\n".join(rows) + "\n")
    write_truth(setup, [*toolings, *extra], truth)
    return SimulatedCampaign(out, truth, len(jobs))


def write_truth(setup: MachineFile, toolings: list[Tooling], folder: Path) -> None:
    """Write the true receptances, from the full equations at the mean of the programmed speeds.

    ``tip/`` and ``cross/`` hold tip-tip and flange-tip of each tooling, ``spindle.csv`` the flange without a tooling.
    """
    first, last, step = TRUTH_FREQUENCIES
    frequency = np.arange(first, last + 0.5 * step, step)
    omega = 2.0 * np.pi * frequency
    speed = float(np.mean(setup.plan.spindle_speeds))
    for tooling in toolings:
        outputs = ("tip.x", "tip.y", "flange.x", "flange.y")
        values = frequency_response(rotor(setup.spindle, tooling.assembly), omega, speed, outputs=outputs)
        for name, start in (("tip", 0), ("cross", 2)):
            x, y = values[:, start, 0], values[:, start + 1, 1]
            table = np.column_stack([frequency, x.real, x.imag, y.real, y.imag])
            _write_table(folder / name / f"{tooling.name}.csv", "frequency_hz,X_re,X_im,Y_re,Y_im", table)
    columns, header = [frequency], ["frequency_hz"]
    planes = ("flange.x", "flange.x'", "flange.y", "flange.y'")
    values = frequency_response(rotor(setup.spindle, None), omega, speed, inputs=planes, outputs=planes)
    for axis, first_row in (("X", 0), ("Y", 2)):
        for row, col, entry in ((0, 0, "tF"), (0, 1, "tM"), (1, 0, "rF"), (1, 1, "rM")):
            column = values[:, first_row + row, first_row + col]
            columns += [column.real, column.imag]
            header += [f"{axis}_{entry}_re", f"{axis}_{entry}_im"]
    _write_table(folder / "spindle.csv", ",".join(header), np.column_stack(columns))


def _write_table(path: Path, header: str, table: FloatArray) -> None:
    lines = [",".join(f"{value:.9g}" for value in row) for row in table]
    write_text(path, "\n".join([header, *lines]) + "\n")


def _jobs(setup: MachineFile, toolings: list[Tooling], rng: np.random.Generator) -> Iterable[_Job]:
    for tooling in toolings:
        # a child of its own for each tooling and cut, so that one more speed does not change the other records
        chance = rng.spawn(1)[0]
        clamping = clamp(setup.sensors, tooling.cutter.tooth_angle, chance)
        small = reduced(rotor(setup.spindle, tooling.assembly))
        dynamics = None if setup.spindle.speed_dependent else poles(small)
        for i, speed in enumerate(setup.plan.spindle_speeds):
            own = poles(small, speed) if dynamics is None else dynamics
            yield _Job(f"{tooling.name}-{i:02d}", tooling, own, clamping, setup.plan.conditions(speed), chance.spawn(1)[0])


@dataclass(frozen=True, slots=True, eq=False)
class _Worker:
    """Makes the two records of a job; a picklable callable for a process pool."""

    setup: MachineFile

    def __call__(self, job: _Job) -> tuple[dict[str, tuple[float, float, dict[str, FloatArray]]], np.ndarray]:
        suite, plan = self.setup.sensors, self.setup.plan
        lines = np.zeros((0, 2), dtype=complex)
        count = round(plan.duration * suite.rate)
        records = {}
        for kind in ("cut", "air"):
            speed = job.conditions.spindle_speed * (1.0 + suite.speed_error * job.rng.normal())
            angle = 2.0 * np.pi * job.rng.random()
            history = None
            if kind == "cut":
                conditions = replace(job.conditions, spindle_speed=speed)
                cutter = replace(job.tooling.cutter, runout=job.clamping.runout)
                history = _history(self.setup, job.dynamics, cutter, conditions, angle, count)
                highest = int(2.0 * np.pi * TRUTH_FREQUENCIES[1] / speed)
                lines = synchronous_lines(history.angle, history.force, highest + 1)
            channels = record(suite, job.clamping, speed, angle, job.conditions.feed_angle, count, OVERSAMPLING, history, job.rng)
            records[kind] = (speed, angle, channels)
        return records, lines


def _history(setup: MachineFile, dynamics: Poles, cutter: Cutter, conditions: CuttingConditions, angle: float, count: int) -> CutHistory:
    """The cut with what the filters need before and after, and the settling before that dropped."""
    suite = setup.sensors
    step = 1.0 / (suite.rate * OVERSAMPLING)
    lead = padding(OVERSAMPLING)
    settling = round(setup.plan.settling / step)
    total = settling + OVERSAMPLING * (count - 1 + 2 * lead) + 1
    start = angle - conditions.spindle_speed * step * (settling + OVERSAMPLING * lead)
    return mill_cut(dynamics, cutter, conditions, setup.workpiece.coefficients, step, total, start).after(settling)


def _campaign_text(setup: MachineFile, toolings: list[Tooling]) -> str:
    """The campaign file, as a machinist would write it."""
    suite, plan = setup.sensors, setup.plan
    lines = ["[campaign]", f"name = {_quoted(setup.name)}", f"sampling_rate_hz = {suite.rate!r}"]
    for axis in "XY":
        lines += _sensor("flange", "displacement", axis, suite.gap_sensitivity, suite.gap_delay, suite.gap_bandwidth)
    for axis in "XY":
        lines += _sensor(
            "fixture", "acceleration", axis, suite.acceleration_sensitivity, suite.acceleration_delay, suite.acceleration_bandwidth
        )
    if suite.trigger:
        lines += [
            "[sensors.trigger]",
            'quantity = "trigger"',
            "pulses_per_revolution = 1",
            f"tooth_angle_deg = {np.degrees(suite.tooth_angle):.9g}",
        ]
    c = setup.workpiece.coefficients
    lines += ["[workpiece]", f"name = {_quoted(setup.workpiece.name)}", f"tangential_coefficient_mpa = {c.tangential * 1e-6:.9g}"]
    lines += [f"radial_ratio = {c.radial_ratio:.9g}"]
    optional = (
        ("axial_ratio", c.axial_ratio, 1.0),
        ("tangential_edge_n_per_mm", c.tangential_edge, 1e-3),
        ("radial_edge_n_per_mm", c.radial_edge, 1e-3),
        ("axial_edge_n_per_mm", c.axial_edge, 1e-3),
    )
    lines += [f"{key} = {value * scale:.9g}" for key, value, scale in optional if value != 0.0]
    lines += ["[toolings]", *(f"{_quoted(t.name)} = {_quoted(f'toolings/{t.name}.toml')}" for t in toolings)]
    for tooling in toolings:
        for i, speed in enumerate(plan.spindle_speeds):
            cut = f"{tooling.name}-{i:02d}"
            lines += [
                "[[cuts]]",
                f"id = {_quoted(cut)}",
                f"tooling = {_quoted(tooling.name)}",
                f"spindle_speed_rpm = {speed * 30.0 / np.pi:.9g}",
                f"axial_depth_mm = {plan.axial_depth * 1e3:.9g}",
                f"feed_per_tooth_mm = {plan.feed_per_tooth * 1e3:.9g}",
                f"entry_angle_deg = {np.degrees(plan.engagement.entry):.9g}",
                f"exit_angle_deg = {np.degrees(plan.engagement.exit):.9g}",
                f"feed_direction = {_feed(plan.feed_angle)}",
                f"cut = {_quoted(f'recordings/{cut}_cut.h5')}",
                f"air = {_quoted(f'recordings/{cut}_air.h5')}",
            ]
    return "\n".join(lines) + "\n"


def _sensor(place: str, quantity: str, axis: str, sensitivity: float, delay: float, bandwidth: float | None) -> list[str]:
    lines = [f"[sensors.{place}_{axis.lower()}]", f'quantity = "{quantity}"', f'axis = "{axis}"', f"sensitivity = {sensitivity!r}"]
    if delay != 0.0:
        lines.append(f"delay_s = {delay!r}")
    if bandwidth is not None:
        lines.append(f"bandwidth_hz = {bandwidth!r}")
    return lines


def _feed(angle: float) -> str:
    for name, known in (("+X", 0.0), ("+Y", 0.5 * np.pi), ("-X", np.pi), ("-Y", -0.5 * np.pi)):
        if abs(angle - known) < 1e-12:
            return f'"{name}"'
    return f"{np.degrees(angle):.9g}"


def _quoted(text: str) -> str:
    """A TOML string."""
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
