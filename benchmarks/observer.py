"""Force observer: cost of a step beside filterpy, and forces of a virtual cut at a speed below the identification's lines.

The case is that of [inprocess]: half-immersion down-milling at 12 000 rev/min, 2 teeth, 1 mm deep, 0.15 mm a tooth, here on the
sample machine of `data/machines/hpm.toml`. The observer knows the machine as `rcsa-ident identify data/sample_runs` found it, not as it is.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import butter, sosfiltfilt

from benchmarks.timing import best_of, row
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.io.identifications import machine_from_json, speed_bands_from_json
from rcsa_ident.io.machines import read_machine
from rcsa_ident.io.results import read_result
from rcsa_ident.io.setups import read_tooling
from rcsa_ident.machining_setup import Tooling
from rcsa_ident.observer._kernels import kalman_steps
from rcsa_ident.observer.kalman import KalmanFilter
from rcsa_ident.observer.response import ObserverFRF, observer_response
from rcsa_ident.observer.tuning import ObserverMethod, PaperWalk, Resonators, harmonics
from rcsa_ident.signals.recording import Quantity, Recording, Sensor
from rcsa_ident.virtual.machine import VirtualSpindle
from rcsa_ident.virtual.milling import mill_cut
from rcsa_ident.virtual.reduction import poles, reduced
from rcsa_ident.virtual.rotor import frequency_response, rotor
from rcsa_ident.virtual.sensors import clamp, padding, record, sample
from rcsa_ident.workflows.estimate_forces import MonitoredCut, observe
from rcsa_ident.workflows.simulate import OVERSAMPLING
from rcsa_ident.workflows.speeds import MachineOverSpeed

DATA = Path(__file__).resolve().parent.parent / "data"
AXES = (Dof.X, Dof.Y)
#: Half-immersion down-milling, 12 000 rev/min, 1 mm deep, 0.15 mm a tooth.
CASE = CuttingConditions(12000.0 * np.pi / 30.0, 1e-3, 0.15e-3, Engagement.from_immersion(0.5, "down"))
#: Band of the error figures [Hz].
BAND_HZ = (300.0, 4300.0)
#: Left out of every error figure at the start and at the end of a record [s].
SETTLING, END = 0.06, 0.02


@dataclass(frozen=True, slots=True, eq=False)
class VirtualCut:
    """A simulated cut with what was true.

    Parameters
    ----------
    cut, air : Recording
    force : array, shape (n, 2) [N]
        On the tool, X and Y, below 10 kHz.
    angle, air_angle : float [rad]
        Of tooth 1 at the first sample.
    tooling : Tooling
    spindle : VirtualSpindle
    """

    cut: Recording
    air: Recording
    force: np.ndarray
    angle: float
    spindle_speed: float
    tooling: Tooling
    spindle: VirtualSpindle
    air_angle: float = 0.0

    def true_cross(self, omega: np.ndarray) -> np.ndarray:
        """Return flange displacement per tip force from the full equations, X and Y, shape (n, 2) [m/N]."""
        model = rotor(self.spindle, self.tooling.assembly)
        values = frequency_response(model, omega, self.spindle_speed, outputs=("flange.x", "flange.y"))
        return np.stack([values[:, 0, 0], values[:, 1, 1]], axis=1)


def virtual_cut(conditions: CuttingConditions = CASE, teeth: int = 2, duration: float = 0.4, seed: int = 11, **sensors: Any) -> VirtualCut:
    """Return a cut and an air cut on the sample machine with the second tooling and a cutter of so many teeth.

    Parameters
    ----------
    sensors
        Changes of the sensors' imperfections.
    """
    machine = read_machine(DATA / "machines" / "hpm.toml")
    tooling = read_tooling(DATA / "machines" / "toolings" / "S2-PG25.toml")
    cutter = Cutter(teeth, tooling.cutter.diameter, tooling.cutter.helix)
    tooling = replace(tooling, cutter=cutter)
    suite, rng = replace(machine.sensors, **sensors), np.random.default_rng(seed)
    dynamics = poles(reduced(rotor(machine.spindle, tooling.assembly)))
    clamping = clamp(suite, cutter.tooth_angle, rng)
    count, step, lead = round(duration * suite.rate), 1.0 / (suite.rate * OVERSAMPLING), padding(OVERSAMPLING)
    settling = round(0.15 / step)
    channels, force, angles, speeds = [], np.zeros((count, 2)), [], []
    for cutting in (True, False):
        speed = conditions.spindle_speed * (1.0 + suite.speed_error * rng.normal())
        angle, history = 2.0 * np.pi * rng.random(), None
        if cutting:
            total = settling + OVERSAMPLING * (count - 1 + 2 * lead) + 1
            own, eccentric = replace(conditions, spindle_speed=speed), replace(cutter, runout=clamping.runout)
            start = angle - speed * step * (settling + OVERSAMPLING * lead)
            history = mill_cut(dynamics, eccentric, own, machine.workpiece.coefficients, step, total, start).after(settling)
            force = np.stack([sample(column, OVERSAMPLING, step, 0.0, None) for column in history.force.T], axis=1)
        channels.append(record(suite, clamping, speed, angle, conditions.feed_angle, count, OVERSAMPLING, history, rng))
        angles.append(angle)
        speeds.append(speed)
    own_sensors = []
    for kind, quantity in (("flange", Quantity.DISPLACEMENT), ("fixture", Quantity.ACCELERATION)):
        of = "gap" if kind == "flange" else "acceleration"
        scale, delay, bandwidth = (getattr(suite, f"{of}_{name}") for name in ("sensitivity", "delay", "bandwidth"))
        own_sensors += [Sensor(f"{kind}_{axis}", quantity, axis, scale, delay, bandwidth) for axis in AXES]
    cut, air = (
        Recording(suite.rate, np.stack([each[s.name] / s.sensitivity for s in own_sensors], axis=1), tuple(own_sensors))
        for each in channels
    )
    return VirtualCut(cut, air, force, angles[0], speeds[0], tooling, machine.spindle, angles[1])


def identified(result: Path | None = None) -> tuple[MachineOverSpeed, tuple[float, float]]:
    """Return the sample machine as identified from the sample runs, and the band [rad/s]; `result` saves the minute that it takes."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "RESULT.json"
        if result is None:
            command = [sys.executable, "-m", "rcsa_ident.cli", "identify", str(DATA / "sample_runs"), "--out", str(path), "--json"]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=os.environ | {"OPENBLAS_NUM_THREADS": "1"})
        data = read_result(result or path)
    low, high = (2.0 * np.pi * f for f in data["band_hz"])
    return MachineOverSpeed(machine_from_json(data, "sample runs"), speed_bands_from_json(data, "sample runs")), (low, high)


def relative_error(
    estimate: np.ndarray, true: np.ndarray, rate: float, lag: float = 0.0, band: tuple[float, float] = BAND_HZ
) -> np.ndarray:
    """Return rms error over rms force of each axis in a band, means removed, the estimate moved ahead by `lag` samples."""
    sections = butter(6, band, "bandpass", fs=rate, output="sos")
    kept = slice(round(SETTLING * rate), -round(END * rate))
    both = [sosfiltfilt(sections, values, axis=0) for values in (estimate, true)]
    both[0] = _advanced(both[0], lag)
    return np.std(both[0][kept] - both[1][kept], axis=0) / np.std(both[1][kept], axis=0)


def _advanced(values: np.ndarray, lag: float) -> np.ndarray:
    """Move a band-limited series ahead by a share of a sample."""
    spectrum = np.fft.rfft(values, axis=0)
    turn = 2.0 * np.pi * np.fft.rfftfreq(values.shape[0]) * lag
    return np.fft.irfft(spectrum * np.exp(1j * turn)[:, None], values.shape[0], axis=0)


def best_lag(estimate: np.ndarray, true: np.ndarray, rate: float) -> tuple[float, np.ndarray]:
    """Return the lag [samples] without which the error is least, and that error of each axis."""
    trial = np.arange(-2.0, 12.0, 0.25)
    errors = np.array([relative_error(estimate, true, rate, lag) for lag in trial])
    k = int(np.argmin(np.mean(errors, axis=1)))
    return float(trial[k]), errors[k]


def true_response(found: MonitoredCut, cut: VirtualCut, axis: int, smoothed: bool = False) -> ObserverFRF:
    """Return the observer's response compensated with the virtual machine's true C31."""
    own = found.observer.axes[axis]
    omega = 2.0 * np.pi * np.arange(100.0, 6000.0, 10.0)
    lines = harmonics(found.spindle_speed, 1, found.band)
    sensor = cut.cut.sensors[axis]
    machine, at_line = (cut.true_cross(w)[:, axis] * sensor.response(w) for w in (omega, lines))
    return observer_response(own, omega, machine, lines, at_line, smoothed=smoothed)


def filterpy_run(kalman: KalmanFilter, measured: np.ndarray, steady: bool) -> np.ndarray:
    """Return the force of a plain filterpy filter with the same matrices, shape (n,)."""
    from filterpy.kalman import KalmanFilter as Plain

    a, seen, force, q = kalman.model.matrices()
    plain = Plain(dim_x=a.shape[0], dim_z=1)
    plain.F, plain.H, plain.Q, plain.R, plain.P = a, seen[None], q, np.eye(1), kalman.model.first_covariance()
    # the same gain to the last digit, as its user would set it
    plain.K = (kalman.gain[-1].T.ravel()[kalman.model.live] * kalman.model.noise)[:, None]
    result = np.empty(measured.size)
    for k, z in enumerate(measured / kalman.model.noise):
        if steady:
            plain.predict_steadystate()
            plain.update_steadystate(np.array([[z]]))
        else:
            plain.predict()
            plain.update(z)
        result[k] = force @ plain.x[:, 0]
    return result


def step_rows(kalman: KalmanFilter, measured: np.ndarray, name: str) -> list[dict[str, Any]]:
    """Time a step in the steady state and with full covariance, both against filterpy on the same samples."""
    few = measured[:1500]
    steady = replace(kalman, gain=kalman.gain[-1:], variance=kalman.variance[-1:], row=kalman.row[-1:])
    arrays, state, result = steady._arrays(), np.zeros((2, kalman.model.decay.size)), np.empty((measured.size, 3))

    def ours() -> None:
        kalman_steps(*arrays, steady.gain, 0, measured, state, result)

    seconds = best_of(ours) / measured.size
    mine = steady.run(steady.init(), few)[1][:, 0]
    rows = []
    full = kalman.run(kalman.init(), few[: kalman.gain.shape[0] - 1])[1][:, 0]
    states = int(np.sum(kalman.model.live))
    for title, constant, own, count in (("steady state", True, mine, few.size), ("full covariance", False, full, 300)):
        peer = filterpy_run(kalman, few[:count], constant)
        size = np.max(np.abs(peer))
        apart = float(np.max(np.abs(peer[: min(count, own.size)] - own[:count])) / size)
        cost = best_of(partial(filterpy_run, kalman, few[:count], constant), repeats=3, seconds=0.05) / count
        claim = f"observer, {name}, {states} states: a step and axis in steady state; peer: filterpy, {title}"
        rows.append(row(claim, seconds * 1e6, cost * 1e6, "us", f"forces agree to {apart:.1e}"))
    return rows


def _whole_row(found: MonitoredCut, cut: VirtualCut, name: str) -> dict[str, Any]:
    """Time a stream in blocks of 40 ms with everything: run-out, high-pass, integrated acceleration, filter."""
    observer, gap, acceleration = found.observer, cut.cut.samples[:1024, :2], cut.cut.samples[:1024, 2:4]
    state = observer.init()
    cost = best_of(lambda: observer.run(state, gap, acceleration)) / gap.size
    order, flat = observer.axes[0].transfer.order, observer.axes[0].transfer.flatness
    times = 1.0 / (cut.cut.rate * cost)
    text = f"{times:.0f} times faster than the samples come, each axis; C31 of order {order}, fitted to {flat:.3f} dB"
    return row(f"observer, {name}: a step and axis with run-out and both sensors", cost * 1e6, None, "us", text)


def force_rows(machine: MachineOverSpeed, band: tuple[float, float], cut: VirtualCut) -> list[dict[str, Any]]:
    """Errors and bandwidths of both observers, live and smoothed."""
    rows, rate = [], cut.cut.rate
    methods: Sequence[tuple[str, ObserverMethod]] = (("resonators", Resonators()), ("random walk", PaperWalk()))
    for name, method in methods:
        for smooth in (False, True):
            found = observe(
                machine, cut.tooling.assembly, cut.tooling.cutter.teeth, cut.cut, cut.air, band, CASE.spindle_speed, method, None, smooth
            )
            error = relative_error(found.estimate.force, cut.force, rate)
            lag, least = best_lag(found.estimate.force, cut.force, rate)
            kind = f"{name}, {'smoothed' if smooth else 'causal'}"
            how = f"X {error[0]:.4f} Y {error[1]:.4f}; {BAND_HZ[0]:.0f}-{BAND_HZ[1]:.0f} Hz, mean removed"
            how += f"; without its lag of {lag:.2f} samples X {least[0]:.4f} Y {least[1]:.4f}"
            rows.append(row(f"rms error over rms force, {kind}", float(error.max()), None, "-", how))
            for i, axis in enumerate(AXES):
                response = true_response(found, cut, i, smooth)
                any_hz, line_hz = (
                    tuple(w / (2.0 * np.pi) for w in response.usable(start, at))
                    for start, at in ((1.3 * found.band[0], False), (response.line[0], True))
                )
                words = ["nowhere" if np.isnan(f[0]) else f"{f[0]:.0f}-{f[1]:.0f} Hz" for f in (any_hz, line_hz)]
                text = f"any frequency {words[0]}, at spindle orders {words[1]}"
                flat = float(np.max(np.abs(20.0 * np.log10(np.abs(response.at_line)))))
                delay = f"lag {response.delay_at_lines * rate:.2f} samples, largest deviation at orders {flat:.2f} dB"
                best = np.nanmax([any_hz[1], line_hz[1], 0.0])
                rows.append(
                    row(f"upper end of +-1 dB with the true C31, {axis.upper()}, {kind}", float(best), None, "Hz", f"{text}; {delay}")
                )
            if not smooth:
                gap = cut.cut.samples[:, 0] * 1.0
                rows += step_rows(found.observer.axes[0].kalman, gap - gap.mean(), name)
                rows.append(_whole_row(found, cut, name))
    return rows


def run() -> list[dict[str, Any]]:
    """Identify the sample machine, cut on it at a speed of its own, and look at both observers."""
    result = os.environ.get("RCSA_IDENT_OBSERVER_RESULT")
    machine, band = identified(Path(result) if result else None)
    return force_rows(machine, band, virtual_cut())
