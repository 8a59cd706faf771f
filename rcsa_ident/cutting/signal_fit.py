"""Cutting coefficients from the whole force over time: run-out, tooth angle and the dynamometer's own dynamics as unknowns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.calibration import NAMES, TOGETHER, ForceCalibration, leaning, plausible
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import unit_lines
from rcsa_ident.cutting.force_record import ANGLES, ForceRecord
from rcsa_ident.cutting.regression import cluster_covariance, student_quantile

#: From so many cuts on their scatter is asked, too.
CUTS_FOR_SCATTER = 4
#: Share of the force's size that may stay unexplained.
WORST_MISFIT = 0.05
_STEPS = 60
#: Resonances of a dynamometer with its workpiece from which the search begins [Hz], and the share of the misfit that one has to leave.
_RESONANCES, _WORTH = (900.0, 2500.0), 0.9
#: Prior of an eccentricity's component [m] and of a helix' tangent: wide, they only keep what no force feels in place.
_RUNOUT_PRIOR, _HELIX_PRIOR = 2e-5, 0.3
#: Prior of the logarithms of a dynamometer's frequency and damping.
_SENSOR_PRIOR = 1.0


@dataclass(frozen=True, slots=True)
class Dynamometer:
    """What is not known of the force sensor.

    `order`: 0: it follows the force; 1: first-order low-pass per axis; 2: one resonance per axis
    `frequency` [Hz]: bandwidth or natural frequency to start from
    `damping`: damping ratio to start from, with order 2
    """

    order: int = 0
    frequency: float = 3000.0
    damping: float = 0.03

    def response(self, omega: FloatArray, unknowns: FloatArray) -> ComplexArray:
        """Return its frequency response, shape (n, 2); `unknowns` holds logarithms per axis, relative to the start."""
        answer = np.ones((omega.size, 2), dtype=complex)
        for axis in range(2 if self.order else 0):
            own = unknowns[axis * self.order : (axis + 1) * self.order]
            x = omega / (2.0 * np.pi * self.frequency * np.exp(own[0]))
            answer[:, axis] = 1.0 / (1.0 + 1j * x if self.order == 1 else 1.0 - x**2 + 2j * self.damping * np.exp(own[1]) * x)
        return answer


@dataclass(frozen=True, slots=True, eq=False)
class SignalCalibration:
    """Coefficients with what was found beside them.

    `runout`: dict of clamping to array, shape (teeth,) [m]
    `helix` [rad]: the helix angle found, where it was an unknown
    `angle` [rad], shape (k,): immersion of tooth 1 at each record's start, up to the pitch where teeth are alike
    `sensor`, shape (2, order): frequency [Hz] and damping per axis
    `noise_half_width`, `cut_half_width`, shape (4,): 95 % by what scatters within records, and by what scatters between cuts (infinite
        where they are too few)
    """

    forces: ForceCalibration
    runout: dict[str, FloatArray]
    helix: float | None
    angle: FloatArray
    sensor: FloatArray
    noise_half_width: FloatArray
    cut_half_width: FloatArray


class _Problem:
    """Residuals of all cuts over one vector: scaled coefficients, angles, eccentricities, tan(helix), sensor."""

    def __init__(self, records: Sequence[ForceRecord], dynamometer: Dynamometer, free_helix: bool, runout: bool) -> None:
        self.records, self.dynamometer, self.free_helix = [r.transverse for r in records], dynamometer, free_helix
        self.clampings = list(dict.fromkeys(r.clamping for r in records)) if runout else []
        k = len(records)
        self.angles = slice(4, 4 + k)
        self.ecc = slice(4 + k, 4 + k + 2 * len(self.clampings))
        self.helix = slice(self.ecc.stop, self.ecc.stop + free_helix)
        self.sensor = slice(self.helix.stop, self.helix.stop + 2 * dynamometer.order)
        self.size = self.sensor.stop
        # only the teeth's own lines as long as no run-out is in the model
        self.orders = [np.arange(r.lines.shape[0]) if runout else r.own_orders for r in records]
        self.model_error = 0.0
        self.scale = np.ones(4)

    def cutter(self, k: int, theta: FloatArray) -> Cutter:
        record = self.records[k]
        cutter = record.cutter
        if self.free_helix:
            cutter = replace(cutter, helix=float(np.clip(np.arctan(theta[self.helix][0]), 0.0, 1.4)))
        if self.clampings:
            i = self.ecc.start + 2 * self.clampings.index(record.clamping)
            cutter = replace(cutter, runout=eccentric(cutter, theta[i : i + 2]))
        return cutter

    def columns(self, k: int, theta: FloatArray) -> ComplexArray:
        """Lines per scaled coefficient as the sensors see them, shape (m, 2, 4)."""
        record, orders = self.records[k], self.orders[k]
        columns = unit_lines(self.cutter(k, theta), record.conditions, orders, runout=bool(self.clampings))[:, :, :4] * self.scale
        columns = columns * np.exp(1j * orders * theta[self.angles][k])[:, None, None]
        return columns * self.dynamometer.response(orders * record.conditions.spindle_speed, theta[self.sensor])[:, :, None]

    def weights(self, k: int) -> FloatArray:
        """One over the standard deviation of each line's real part: noise, and a share of the record's force."""
        record, orders = self.records[k], self.orders[k]
        size = float(np.sqrt(np.mean(np.abs(record.lines[orders]) ** 2)))
        return 1.0 / np.sqrt(record.variance[orders] + (self.model_error * size) ** 2)

    def residual(self, theta: FloatArray) -> FloatArray:
        parts = [self.part(k, self.columns(k, theta) @ theta[:4]) for k in range(len(self.records))]
        return np.concatenate([*parts, self.prior(theta)])

    def part(self, k: int, lines: ComplexArray, data: bool = True) -> FloatArray:
        """Whitened residual of a cut (or its change), real parts first."""
        left = (lines - self.records[k].lines[self.orders[k]] * data) * self.weights(k)
        return np.concatenate([left.real.ravel(), left.imag.ravel()])

    def prior(self, theta: FloatArray) -> FloatArray:
        helix = [np.tan(r.cutter.helix) for r in self.records[: int(self.free_helix)]]
        return np.concatenate(
            [theta[self.ecc] / _RUNOUT_PRIOR, (theta[self.helix] - helix) / _HELIX_PRIOR, theta[self.sensor] / _SENSOR_PRIOR]
        )

    def jacobian(self, theta: FloatArray) -> FloatArray:
        """Coefficients and angles in closed form, the others by differences of a cut's own lines."""
        rows = []
        for k in range(len(self.records)):
            columns = self.columns(k, theta)
            lines = columns @ theta[:4]
            own = np.zeros((2 * lines.size, self.size))
            for c in range(4):
                own[:, c] = self.part(k, columns[:, :, c], data=False)
            own[:, self.angles.start + k] = self.part(k, 1j * self.orders[k][:, None] * lines, data=False)
            for p in range(self.ecc.start, self.size):
                clamping = (p - self.ecc.start) // 2
                if p < self.ecc.stop and self.clampings[clamping] != self.records[k].clamping:
                    continue
                step = 1e-9 if p < self.ecc.stop else 1e-6
                moved = theta.copy()
                moved[p] += step
                own[:, p] = self.part(k, (self.columns(k, moved) @ theta[:4] - lines) / step, data=False)
            rows.append(own)
        slopes = np.concatenate([np.full(2 * len(self.clampings), 1.0 / _RUNOUT_PRIOR), np.full(int(self.free_helix), 1.0 / _HELIX_PRIOR),
                                 np.full(2 * self.dynamometer.order, 1.0 / _SENSOR_PRIOR)])  # fmt: skip
        prior = np.zeros((slopes.size, self.size))
        prior[np.arange(slopes.size), self.ecc.start + np.arange(slopes.size)] = slopes
        return np.concatenate([*rows, prior])


def eccentric(cutter: Cutter, components: FloatArray) -> FloatArray:
    """Return the teeth's radial offsets of a cutter that runs out by a vector fixed to tooth 1, shape (teeth,) [m]."""
    return components[0] * np.cos(cutter.tooth_angle) + components[1] * np.sin(cutter.tooth_angle)


def calibrate_signal(
    records: Sequence[ForceRecord], dynamometer: Dynamometer | None = None, free_helix: bool = False, start: FloatArray | None = None
) -> SignalCalibration:
    """Return the coefficients that explain the force over time.

    Parameters
    ----------
    records : sequence of ForceRecord, length k
    dynamometer : Dynamometer, optional
        What to find of the sensor. By default it follows the force, and where that leaves more than `WORST_MISFIT` unexplained, a
        resonance per axis is tried and kept if it explains a good part of that.
    free_helix : bool
        Whether the helix is an unknown, too; one for all records.
    start : array, shape (4,) [N/m^2 or N/m], optional
        K_tc, K_rc, K_te, K_re to find the tooth angles with, such as those of the mean forces; else each record tells its own.

    Notes
    -----
    The force of a steady cut is periodic in the revolution, so that least squares over time is least squares over its lines at
    the spindle's orders, where helix and sensor have closed forms. Noise weights are each line's own; what the model does not
    explain is learned as a share of the force. Intervals are the wider ones of two sandwiches: scores of blocks of
    revolutions, and scores of whole cuts (`regression.cluster_covariance`), the tooth angles profiled out.
    """
    if not records:
        raise InputError("records", "none", "at least one record of the cutting force")
    if dynamometer is not None:
        return _fitted(records, dynamometer, free_helix, start)
    stiff = _fitted(records, Dynamometer(), free_helix, start)
    if stiff.forces.misfit <= WORST_MISFIT:
        return stiff
    trials = [_fitted(records, Dynamometer(2, frequency), free_helix, start) for frequency in _RESONANCES]
    best = min(trials, key=lambda trial: trial.forces.misfit)
    return best if best.forces.misfit < _WORTH * stiff.forces.misfit else stiff


def _fitted(records: Sequence[ForceRecord], dynamometer: Dynamometer, free_helix: bool, start: FloatArray | None) -> SignalCalibration:
    problem = _Problem(records, dynamometer, free_helix, runout=False)
    theta = _start(problem, start)
    theta = _polish(problem, theta)
    if any(r.cutter.teeth > 1 for r in records):
        problem, theta = _with_runout(problem, theta)
        theta = _polish(problem, theta)
    for _ in range(4):
        before = problem.model_error
        _learn(problem, theta)
        theta = _polish(problem, theta)
        if abs(problem.model_error - before) < 0.02 * problem.model_error:
            break
    return _answer(problem, theta)


def _start(problem: _Problem, start: FloatArray | None) -> FloatArray:
    """Tooth angles by scanning, with known coefficients or with those that fit each record best."""
    theta = np.zeros(problem.size)
    if problem.free_helix:
        theta[problem.helix] = np.tan(problem.records[0].cutter.helix)
    if start is not None:
        theta[problem.angles] = [record.tooth_angle(start)[0] for record in problem.records]
        theta[:4] = start
    else:
        scanned = [_scan(problem, k, theta) for k in range(len(problem.records))]
        if not all(np.isfinite(cost) for cost, _, _ in scanned):
            raise InputError("force", "no tooth angle at which K_tc is above zero", "the force of the cut that the campaign describes")
        theta[problem.angles] = [angle for _, angle, _ in scanned]
        theta[:4] = np.median([solution for _, _, solution in scanned], axis=0)
    problem.scale = np.maximum(np.abs(theta[:4]), 1e-6 * np.abs(theta[:4]).max())
    problem.scale[2:] = np.maximum(problem.scale[2:], 1e-6 * problem.scale[0])
    theta[:4] /= problem.scale
    return theta


def _scan(problem: _Problem, k: int, theta: FloatArray) -> tuple[float, float, FloatArray]:
    """Cost, angle of tooth 1 and coefficients of one record alone, best of a circle of angles with K_tc > 0."""
    record, orders = problem.records[k], problem.orders[k]
    reach = 2.0 * np.pi / (record.cutter.teeth if record.cutter.equally_spaced else 1)
    columns = problem.columns(k, theta)
    weight = 1.0 / float(np.sqrt(np.mean(np.abs(record.lines[orders]) ** 2)))
    target = record.lines[orders].ravel() * weight
    right = np.concatenate([target.real, target.imag])
    best = (np.inf, 0.0, np.zeros(4))
    angles = np.arange(ANGLES * (record.cutter.teeth if reach > 6.0 else 1)) * reach
    for angle in angles / angles.size:
        turned = (columns * (weight * np.exp(1j * orders * angle))[:, None, None]).reshape(-1, 4)
        design = np.concatenate([turned.real, turned.imag])
        size = np.maximum(np.linalg.norm(design, axis=0), 1e-300)
        # edges hardly show in a single record: a little ridge keeps them near zero
        gram = design.T @ design / size[:, None] / size + np.diag([1e-9, 1e-9, 1e-3, 1e-3])
        solution = np.linalg.solve(gram, design.T @ right / size) / size
        if solution[0] > 0.0 and solution[0] + solution[1] > 0.0:
            cost = float(np.sum((design @ solution - right) ** 2))
            if cost < best[0]:
                best = (cost, float(angle), solution)
    return best


def _with_runout(problem: _Problem, theta: FloatArray) -> tuple[_Problem, FloatArray]:
    """The problem with a run-out per clamping: its best of a grid for the first record, then each record's own first tooth."""
    full = _Problem(problem.records, problem.dynamometer, problem.free_helix, runout=True)
    full.scale, full.model_error = problem.scale, 0.01
    wider = np.zeros(full.size)
    wider[:4], wider[full.angles] = theta[:4], theta[problem.angles]
    wider[full.helix], wider[full.sensor] = theta[problem.helix], theta[problem.sensor]

    def cost(k: int, trial: FloatArray) -> float:
        return float(np.sum(full.part(k, full.columns(k, trial) @ trial[:4]) ** 2))

    for number, clamping in enumerate(full.clampings):
        members = [k for k, r in enumerate(full.records) if r.clamping == clamping]
        first, place = members[0], slice(full.ecc.start + 2 * number, full.ecc.start + 2 * number + 2)
        feed = full.records[first].conditions.feed_per_tooth
        angles = np.arange(16) * np.pi / 8
        grid = [np.zeros(2), *(a * feed * np.array([np.cos(p), np.sin(p)]) for a in (0.01, 0.03, 0.1, 0.3) for p in angles)]
        trials = []
        for components in grid:
            trial = wider.copy()
            trial[place] = components
            trials.append((cost(first, trial), components))
        wider[place] = min(trials, key=lambda t: t[0])[1]
        for k in members[1:]:
            cutter = full.records[k].cutter
            if cutter.equally_spaced:
                base = wider[full.angles][k]
                shifts = []
                for turn in cutter.tooth_angle:
                    trial = wider.copy()
                    trial[full.angles.start + k] = base + turn
                    shifts.append((cost(k, trial), base + turn))
                wider[full.angles.start + k] = min(shifts)[1]
    return full, wider


def _polish(problem: _Problem, theta: FloatArray) -> FloatArray:
    """Levenberg-Marquardt with Marquardt's scaling; small and dense."""
    left = problem.residual(theta)
    damping, cost = 1e-3, float(left @ left)
    for _ in range(_STEPS):
        slope = problem.jacobian(theta)
        gram, gradient = slope.T @ slope, slope.T @ left
        size = np.maximum(np.diag(gram), 1e-300)
        gained = 0.0
        while damping < 1e8:
            trial = theta - np.linalg.solve(gram + damping * np.diag(size), gradient)
            tried = problem.residual(trial)
            new = float(tried @ tried)
            if new < cost:
                gained, theta, left, cost = cost - new, trial, tried, new
                damping = max(0.2 * damping, 1e-12)
                break
            damping *= 5.0
        if gained <= 1e-9 * cost:
            break
    return theta


def _learn(problem: _Problem, theta: FloatArray) -> None:
    """Choose the model's error, as a share of the force, so that residuals have their expected size."""
    parts, sizes = [], []
    for k, record in enumerate(problem.records):
        orders = problem.orders[k]
        left = problem.columns(k, theta) @ theta[:4] - record.lines[orders]
        size = np.sqrt(np.mean(np.abs(record.lines[orders]) ** 2))
        parts.append((0.5 * np.abs(left) ** 2 / size**2).ravel())
        sizes.append((record.variance[orders] / size**2).ravel())
    power, noise = np.concatenate(parts), np.concatenate(sizes)
    low, high = 0.0, 1.0
    for _ in range(60):
        share = 0.5 * (low + high)
        if np.mean(power / (noise + share)) > 1.0:
            low = share
        else:
            high = share
    problem.model_error = float(np.sqrt(0.5 * (low + high)))


def _answer(problem: _Problem, theta: FloatArray) -> SignalCalibration:
    notes = [TOGETHER] if any(leaning(r.cutter, r.conditions) for r in problem.records) else []
    slope, left = problem.jacobian(theta), problem.residual(theta)
    count = [2 * 2 * o.size for o in problem.orders]
    edges = np.concatenate([[0], np.cumsum(count)])
    shared = np.r_[0:4, problem.ecc.start : problem.size]
    design = slope[:, shared].copy()
    for k, (a, b) in enumerate(pairwise(edges)):
        angle = slope[a:b, problem.angles.start + k]
        design[a:b] -= np.outer(angle, angle @ design[a:b]) / max(float(angle @ angle), 1e-300)
    unit = np.linalg.norm(design, axis=0)
    design = design / unit
    bread = np.linalg.inv(design.T @ design)
    meat, freedom = np.zeros_like(bread), 0
    for k, record in enumerate(problem.records):
        own, blocks = design[edges[k] : edges[k + 1]], record.blocks[:, problem.orders[k]]
        b = blocks.shape[0]
        scores = np.array([own.T @ problem.part(k, block, data=False) for block in blocks])
        scores -= scores.mean(axis=0)
        meat += scores.T @ scores / (b * (b - 1))
        freedom += b - 1
    noise = bread @ meat @ bread
    scale = np.concatenate([problem.scale, np.ones(shared.size - 4)]) / unit
    noise_width = student_quantile(np.array(float(freedom))) * np.sqrt(np.diag(noise)) * scale
    cut_width, covariance = np.full(shared.size, np.inf), noise
    if len(problem.records) >= CUTS_FOR_SCATTER:
        cluster = np.concatenate([np.repeat(np.arange(len(count)), count), len(count) + np.arange(left.size - edges[-1])])
        between, dof = cluster_covariance(design, left, cluster)
        cut_width = student_quantile(dof) * np.sqrt(np.diag(between)) * scale
        covariance = between
    else:
        few = f"{len(problem.records)} cuts are too few to estimate their scatter"
        notes.append(f"{few}: the intervals contain these recordings' noise only")
    covariance = (covariance * scale[:, None] * scale)[:4, :4]
    width = np.maximum(noise_width, np.where(np.isfinite(cut_width), cut_width, 0.0))[:4]
    value = theta[:4] * problem.scale
    for i in (2, 3):
        if value[i] < 0.0 and -value[i] > width[i]:
            notes.append(f"{NAMES[i]} is below zero, {value[i] * 1e-3:.2g} N/mm: the model is incomplete; set to 0")
    data = slice(0, edges[-1])
    weight = np.concatenate([np.tile(problem.weights(k).ravel(), 2) for k in range(len(count))])
    force = np.sqrt(sum(np.sum(np.abs(r.lines[o]) ** 2) for r, o in zip(problem.records, problem.orders, strict=True)))
    misfit = float(np.linalg.norm(left[data] / weight) / force)
    reasons = plausible(NAMES[:4], value, width)
    if misfit > WORST_MISFIT:
        # what no model explains may as well belong to the coefficients
        width = np.maximum(width, misfit * np.abs(value))
        more = "other dynamics of the dynamometer" if problem.dynamometer.order else "a dynamometer that does not follow"
        left_over = f"{100.0 * misfit:.0f} % of the force over time remains unexplained, and no interval is narrower"
        reasons = (*reasons, f"{left_over}: {more}, or vibration?")
    forces = ForceCalibration("signal", NAMES[:4], value, covariance, width, misfit, reasons, tuple(notes))
    runout = {
        name: eccentric(next(r.cutter for r in problem.records if r.clamping == name), theta[problem.ecc][2 * i : 2 * i + 2])
        for i, name in enumerate(problem.clampings)
    }
    start = np.array([problem.dynamometer.frequency, problem.dynamometer.damping])[: problem.dynamometer.order]
    sensor = start * np.exp(theta[problem.sensor].reshape(2, -1))
    helix = float(np.arctan(theta[problem.helix][0])) if problem.free_helix else None
    angle = np.mod(theta[problem.angles], 2.0 * np.pi)
    return SignalCalibration(forces, runout, helix, frozen(angle), frozen(sensor), noise_width[:4], cut_width[:4])
