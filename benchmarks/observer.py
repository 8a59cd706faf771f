"""Force observer: cost of a step beside filterpy, and forces of a virtual cut at a speed below the identification's lines.

The case is that of [inprocess]: half-immersion down-milling at 12 000 rev/min, 2 teeth, 1 mm deep, 0.15 mm a tooth, here on the
sample machine of `data/machines/hpm.toml`. The observer knows the machine as `rcsa-ident identify data/sample_runs` found it, not as it is.

And the same cut on a machine whose axes feel each other (oblique by 10 degrees and gyroscopic), which the observer knows as it is: one
filter for both forces beside one for each axis, which leaves the cross terms out.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.timing import Race, best_of, row
from rcsa_ident.identification.machine import IdentifiedMachine
from rcsa_ident.io.results.identifications import machine_from_json
from rcsa_ident.io.results.parts import read_result
from rcsa_ident.observer._kernels import kalman_steps
from rcsa_ident.observer.kalman import KalmanFilter
from rcsa_ident.observer.tuning import ObserverMethod, PaperWalk, Resonators
from rcsa_ident.workflows.estimate_forces import MonitoredCut, observe
from tests.fixtures.oblique_cut import measured_flange, oblique_cut, oblique_machine
from tests.fixtures.virtual_cut import AXES, BAND_HZ, CASE, VirtualCut, relative_error, true_response, virtual_cut

DATA = Path(__file__).resolve().parent.parent / "data"


def identified(result: Path | None = None) -> IdentifiedMachine:
    """Return the sample machine as identified from the sample runs; `result` saves the minute that it takes."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "RESULT.json"
        if result is None:
            command = [sys.executable, "-m", "rcsa_ident.cli", "identify", str(DATA / "sample_runs"), "--out", str(path), "--json"]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=os.environ | {"OPENBLAS_NUM_THREADS": "1"})
        return machine_from_json(read_result(result or path), "sample runs")


def best_lag(estimate: np.ndarray, true: np.ndarray, rate: float) -> tuple[float, np.ndarray]:
    """Return the lag [samples] without which the error is least, and that error of each axis."""
    trial = np.arange(-2.0, 12.0, 0.25)
    errors = np.array([relative_error(estimate, true, rate, lag) for lag in trial])
    k = int(np.argmin(np.mean(errors, axis=1)))
    return float(trial[k]), errors[k]


def filterpy_run(kalman: KalmanFilter, measured: np.ndarray, steady: bool) -> np.ndarray:
    """Return the force of a plain filterpy filter with the same matrices, shape (n,)."""
    from filterpy.kalman import KalmanFilter as Plain

    a, seen, (force,), q = kalman.model.matrices()
    plain = Plain(dim_x=a.shape[0], dim_z=1)
    plain.F, plain.H, plain.Q, plain.R, plain.P = a, seen, q, np.eye(1), kalman.model.first_covariance()
    # the same gain to the last digit, as its user would set it
    plain.K = (kalman.gain[-1, 0].T.ravel()[kalman.model.live] * kalman.model.noise)[:, None]
    result = np.empty(measured.size)
    for k, z in enumerate(measured / kalman.model.noise[0]):
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
    return [race.row() for race in step_races(kalman, measured, name)]


def step_races(kalman: KalmanFilter, measured: np.ndarray, name: str) -> list[Race]:
    """Return a step in the steady state beside filterpy's there and with full covariance."""
    few = measured[:1500]
    steady = replace(kalman, gain=kalman.gain[-1:], variance=kalman.variance[-1:], row=kalman.row[-1:])
    arrays, state, result = steady._one_axis(), np.zeros((2, kalman.model.decay.size)), np.empty((measured.size, 3))

    def ours() -> None:
        kalman_steps(*arrays, steady.gain[:, 0], 0, measured, state, result)

    mine = steady.run(steady.init(), few[:, None])[1][:, 0, 0]
    found = []
    full = kalman.run(kalman.init(), few[: kalman.gain.shape[0] - 1, None])[1][:, 0, 0]
    states = int(np.sum(kalman.model.live))
    for title, constant, own, count in (("steady state", True, mine, few.size), ("full covariance", False, full, 300)):
        peer = filterpy_run(kalman, few[:count], constant)
        size = np.max(np.abs(peer))
        apart = float(np.max(np.abs(peer[: min(count, own.size)] - own[:count])) / size)
        claim = f"observer, {name}, {states} states: a step and axis in steady state"
        theirs = partial(filterpy_run, kalman, few[:count], constant)
        found.append(Race(claim, f"filterpy, {title}", "filterpy", ours, theirs, f"forces agree to {apart:.1e}", (measured.size, count)))
    return found


def races() -> list[Race]:
    """Oscillators at the spindle's orders on a made-up flange, 25 600 samples a second."""
    from tests.observer.test_force import monitored

    kalman = monitored(Resonators()).observer.filters[0]
    return step_races(kalman, 1e-8 * np.random.default_rng(1).normal(size=10240), "resonators")


def _whole_row(found: MonitoredCut, cut: VirtualCut, name: str) -> dict[str, Any]:
    """Time a stream in blocks of 40 ms with everything: run-out, high-pass, integrated acceleration, filter."""
    observer, gap, acceleration = found.observer, cut.cut.samples[:1024, :2], cut.cut.samples[:1024, 2:4]
    state = observer.init()
    cost = best_of(lambda: observer.run(state, gap, acceleration)) / gap.size
    order, flat = observer.axes[0].transfer.order, observer.axes[0].transfer.flatness
    times = 1.0 / (cut.cut.rate * cost)
    text = f"{times:.0f} times faster than the samples come, each axis; C31 of order {order}, fitted to {flat:.3f} dB"
    return row(f"observer, {name}: a step and axis with run-out and both sensors", cost * 1e6, None, "us", text)


def force_rows(machine: IdentifiedMachine, cut: VirtualCut) -> list[dict[str, Any]]:
    """Errors and bandwidths of both observers, live and smoothed."""
    rows, rate = [], cut.cut.rate
    methods: Sequence[tuple[str, ObserverMethod]] = (("resonators", Resonators()), ("random walk", PaperWalk()))
    for name, method in methods:
        for smooth in (False, True):
            found = observe(
                machine, cut.tooling.assembly, cut.tooling.cutter.teeth, cut.cut, cut.air, CASE.spindle_speed, method, None, smooth
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
                rows += step_rows(found.observer.filters[0], gap - gap.mean(), name)
                rows.append(_whole_row(found, cut, name))
    return rows


def coupled_rows() -> list[dict[str, Any]]:
    """Errors with and without the cross terms, and what a step costs."""
    rows: list[dict[str, Any]] = []
    cut = oblique_cut()
    for smooth in (False, True):
        errors = []
        for machine in (oblique_machine(), measured_flange(cross=False)):
            found = observe(machine, cut.tooling.assembly, 2, cut.cut, cut.air, CASE.spindle_speed, Resonators(), None, smooth)
            errors.append(relative_error(found.estimate.force, cut.force, cut.cut.rate))
            together = found.observer.filters[0]
            if together.count == 2 and not smooth:
                measured, state = 1e-8 * np.random.default_rng(1).normal(size=(10240, 2)), together.init()
                seconds = best_of(partial(together.run, state, measured)) / measured.shape[0]
                gap, acceleration = cut.cut.samples[:1024, :2], cut.cut.samples[:1024, 2:4]
                whole = best_of(partial(found.observer.run, found.observer.init(), gap, acceleration)) / gap.shape[0]
                states, order = int(np.sum(together.model.live)), found.observer.axes[0].transfer.order
                text = f"{1e6 * whole:.3f} us with run-out and both sensors; C31 of order {order}"
                rows.append(row(f"observer of both axes, {states} states: a step of both in steady state", seconds * 1e6, None, "us", text))
        (own, other), kind = errors, "smoothed" if smooth else "causal"
        text = f"X {own[0]:.4f} Y {own[1]:.4f}; without cross terms X {other[0]:.4f} Y {other[1]:.4f}"
        rows.append(row(f"rms error over rms force, axes that feel each other, {kind}", float(own.max()), float(other.max()), "-", text))
    return rows


def run() -> list[dict[str, Any]]:
    """Identify the sample machine, cut on it at a speed of its own, and look at both observers; then at axes that feel each other."""
    result = os.environ.get("RCSA_IDENT_OBSERVER_RESULT")
    return [*force_rows(identified(Path(result) if result else None), virtual_cut()), *coupled_rows()]
