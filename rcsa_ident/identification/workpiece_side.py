"""What gives way on the workpiece's side of the cut, from accelerometers on table or workpiece.

Their lines do not depend on the tooling: those of all cuts are one receptance G_w, turned by each cut's delay, which is the flange's, and
over the force as the flange's lines found it. What those leave open of delays and forces is in the lines' covariance.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.optimize

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.remarks import Remark
from rcsa_ident.cutting.force import SLOPES, ForceCoefficient, ForceTerm, scaled_force
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.model_order import unexplained_share
from rcsa_ident.identification.result import Identification, IdentificationCode
from rcsa_ident.machine.workpiece_side import WorkpieceAxis, WorkpieceSide, gives_way
from rcsa_ident.signals.measurement import CutMeasurement
from rcsa_ident.signals.motion import workpiece_channels
from rcsa_ident.signals.recording import Sensor

#: Prior of damping ratios and stiffnesses: middle and standard deviation of the logarithms. A table is some tons on screws and rails.
_ZETA, _STIFFNESS = (math.log(0.03), 1.0), (math.log(5e7), 2.3)
#: Natural frequencies are looked for from so many times the lowest line to so many times the highest: what lies above is a spring.
_LOW, _HIGH = 0.3, 1.5
#: Where a new mode is tried: frequencies, and damping ratios.
_PLACES, _DAMPING = 160, (0.01, 0.03, 0.1)
#: Modes at most, new ones that are polished of each step, and what each mode more costs of the evidence: e^-3 of its probability before.
MOST_MODES, _TRIED, _FEW = 6, 3, 6.0
#: Share of the lines' mean power that is taken to be unexplained at first, then of each line's own: at least so much, worked out so often.
#: Between a force that is simulated and a point that is not the cut itself nothing is better than the least.
_COARSE, _LEAST, _ROUNDS = 0.1, 2e-3, 8
#: Share of unexplained lines from which on it is told.
_TELLING = 0.1


def workpiece_side(
    found: Identification, measurements: Sequence[CutMeasurement], sensors: Sequence[Sensor]
) -> tuple[WorkpieceSide | None, tuple[Remark, ...]]:
    """Return what gives way on the workpiece's side, and what to know of it; None where no accelerometer stands there.

    `found`: of these cuts
    `measurements`: in its order
    `sensors`: the campaign's
    """
    channels = workpiece_channels(sensors)
    if channels is None or not found.axes:
        return None, ()
    axes, remarks = {}, []
    for sensor, axis in zip(channels.sensors, channels.axes, strict=True):
        where = f"workpiece's side, {axis.upper()}: {sensor.name}, on the {sensor.role},"
        lines = _Lines.of(axis, found, measurements)
        if lines is None:
            words = f"{where} has no line: no cut at one speed has a force along {axis.upper()}; nothing is taken to give way there"
            remarks.append(Remark(IdentificationCode.WORKPIECE_SIDE, words))
            continue
        assert sensor.role is not None
        logs, problem = _fit(lines)
        omega_n, zeta, stiffness = np.exp(logs)
        statistics = lines.omega.size, problem.chi2_per_point(logs), problem.share
        axes[axis] = WorkpieceAxis(sensor.name, sensor.role, omega_n, zeta, stiffness, problem.covariance(logs), *statistics)
        if not logs.size:
            words = f"{where} shows nothing above the noise in {lines.omega.size} lines: nothing is taken to give way there"
            remarks.append(Remark(IdentificationCode.WORKPIECE_SIDE, words))
        elif problem.share > _TELLING:
            words = (
                f"{where} shows lines of which modes of a point that gives way under the cutting force leave {100.0 * problem.share:.0f} % "
                "unexplained: it may stand where the workpiece moves otherwise than at the cut"
            )
            remarks.append(Remark(IdentificationCode.WORKPIECE_SIDE, words))
    side = WorkpieceSide(axes)
    told = (Remark(IdentificationCode.WORKPIECE_SIDE, side.words),) if side.words else ()
    return side, (*told, *remarks)


@dataclass(frozen=True, slots=True, eq=False)
class _Lines:
    """Lines of G_w along an axis.

    `omega` [rad/s], shape (n,); `value` [m/N], shape (n,)
    `variance` [m^2/N^2], shape (n,): of the real and of the imaginary part each
    `open` [-], shape (n, q): how their logarithms change with what is not known of delays and forces, per standard deviation
    """

    omega: FloatArray
    value: ComplexArray
    variance: FloatArray
    open: ComplexArray

    @classmethod
    def of(cls, axis: Dof, found: Identification, measurements: Sequence[CutMeasurement]) -> _Lines | None:
        """Return the lines of all cuts, or None where there are none."""
        present = [(k, m, m.workpiece[axis]) for k, m in enumerate(measurements) if axis in m.workpiece]
        if not present:
            return None
        # where drawings are rough, forces may be far from those that were simulated: they add up exactly, as in the misfit
        terms = {ForceCoefficient(term): i for i, term in enumerate(SLOPES[:-1])}
        exact = {term: i for i, term in enumerate(SLOPES[:-1])} if found.toolings is not None else {}
        omega, value, variance, opened = [], [], [], []
        for number, (k, measurement, lines) in enumerate(present):
            own = {**terms, ForceCoefficient(ForceTerm.RUNOUT, measurement.tooling): len(terms)}
            logs = np.array([found.coefficients.get(each, (0.0, 0.0))[0] for each in own])
            force, slope = scaled_force(lines.force_slope, logs, exact)
            # the workpiece is moved by minus the force on the tool
            values = -lines.receptance * np.exp(1j * lines.omega * found.delay[k]) / force
            columns = np.zeros((lines.omega.size, len(present) + len(found.coefficients)), dtype=complex)
            columns[:, number] = 1j * lines.omega * found.delay_std[k]
            for i, (coefficient, (_, std)) in enumerate(found.coefficients.items()):
                if coefficient in own:
                    columns[:, len(present) + i] = -slope[:, own[coefficient]] * std
            omega.append(lines.omega)
            value.append(values)
            variance.append(lines.variance.sum(axis=1) / np.abs(force) ** 2)
            opened.append(columns)
        return cls(*(np.concatenate(each) for each in (omega, value, variance, opened)))


class _Problem:
    """The misfit of modes on the lines of an axis, with a share of each that is left unexplained.

    What is not known of delays and forces moves the lines along V z, z standard normal: with Q the orthonormal columns of [V; 1], the
    squares of [r; 0] less its part along Q are the least of |r + V z|^2 + |z|^2 over all z.
    """

    def __init__(self, lines: _Lines, share: float, known: FloatArray | None = None) -> None:
        self.lines, self.share = lines, share
        size = np.abs(lines.value) ** 2
        # of all lines the same where no mode is known yet: what counts then are resonances, and not the valleys beside them
        self.deviation = np.sqrt(lines.variance + 0.5 * share**2 * (np.mean(size) if known is None else size))
        # a line of nothing in a record without noise is not infinitely sure
        self.deviation = np.maximum(self.deviation, 1e-6 * float(np.max(np.abs(lines.value), initial=1e-30)))
        # what a delay or a force changes of modes: of lines it would take those for surest that noise has made small
        opened = self._white(lines.open.T * (lines.value if known is None else gives_way(known, lines.omega)[0]))
        self.along = np.linalg.qr(np.vstack([opened, np.eye(opened.shape[1])]))[0]
        self.points = 2 * lines.omega.size
        self.target = self._projected(self._white(lines.value[None]))[:, 0]
        low, high = np.log(_LOW * lines.omega.min()), np.log(_HIGH * lines.omega.max())
        self.range = low, high
        self.middle, self.spread = np.array([[0.5 * (low + high), 0.5 * (high - low)], _ZETA, _STIFFNESS]).T

    def _white(self, values: ComplexArray) -> FloatArray:
        """Values at the lines, shape (c, n), in standard deviations, real over imaginary parts, shape (2 n, c)."""
        scaled = values / self.deviation
        return np.concatenate([scaled.real, scaled.imag], axis=1).T

    def _projected(self, columns: FloatArray) -> FloatArray:
        """Columns without what delays and forces may be, shape (2 n, c) -> (2 n + q, c)."""
        whole = np.vstack([columns, np.zeros((self.along.shape[0] - columns.shape[0], columns.shape[1]))])
        return whole - self.along @ (self.along.T @ whole)

    def residual(self, logs: FloatArray) -> FloatArray:
        """What modes leave of the lines, in standard deviations."""
        return self.target - self._projected(self._white(gives_way(logs.reshape(3, -1), self.lines.omega)[0][None]))[:, 0]

    def _with_prior(self, logs: FloatArray) -> FloatArray:
        away = (logs.reshape(3, -1) - self.middle[:, None]) / self.spread[:, None]
        return np.concatenate([self.residual(logs), away.ravel()])

    def _jacobian(self, logs: FloatArray) -> FloatArray:
        change = gives_way(logs.reshape(3, -1), self.lines.omega)[1].reshape(logs.size, -1)
        return np.vstack([-self._projected(self._white(change)), np.diag(np.repeat(1.0 / self.spread, logs.size // 3))])

    def polished(self, logs: FloatArray) -> FloatArray:
        """The same modes where the misfit is least, shape (3, m)."""
        if not logs.size:
            return logs
        low = np.repeat([self.range[0] - 1.0, math.log(1e-4), -np.inf], logs.shape[1])
        high = np.repeat([self.range[1] + 1.0, math.log(0.9), np.inf], logs.shape[1])
        found = scipy.optimize.least_squares(
            self._with_prior, logs.ravel(), self._jacobian, (low, high), x_scale=np.repeat(self.spread, logs.shape[1]), max_nfev=60
        )
        return found.x.reshape(3, -1)

    def evidence(self, logs: FloatArray) -> float:
        """Minus twice the log evidence by Laplace's approximation, up to a constant of the lines: less is better."""
        if not logs.size:
            return float(np.sum(self.target**2))
        rows, jacobian, modes = self._with_prior(logs.ravel()), self._jacobian(logs.ravel()), logs.shape[1]
        sign, volume = np.linalg.slogdet(jacobian.T @ jacobian)
        known = -2.0 * modes * float(np.sum(np.log(self.spread)))
        # modes may stand in any order: as many equal minima
        value = float(rows @ rows + volume - known - 2.0 * math.lgamma(modes + 1)) + _FEW * modes
        omega, zeta = np.sort(np.exp(logs[0])), np.exp(logs[1][np.argsort(logs[0])])
        # a point shows modes within each other's half-power width as one, and how they share its compliance has no volume of its own
        apart = np.all(np.diff(omega) > 0.5 * (zeta[1:] * omega[1:] + zeta[:-1] * omega[:-1]))
        return value if sign > 0.0 and apart else np.inf

    def promising(self, logs: FloatArray) -> Iterator[FloatArray]:
        """Yield one mode more, at those places where one that gives way lowers the misfit most; the others stay as they are."""
        rest = self.residual(logs)
        places = [(omega, zeta) for omega in np.linspace(*self.range, _PLACES).tolist() for zeta in np.log(_DAMPING).tolist()]
        unit = np.concatenate([gives_way(np.array([[omega], [zeta], [0.0]]), self.lines.omega)[0][None] for omega, zeta in places])
        columns = self._projected(self._white(unit))
        size, along = np.sum(columns**2, axis=0), columns.T @ rest
        gain = np.where(along > 0.0, along**2 / size, 0.0)
        for _ in range(_TRIED):
            best = int(np.argmax(gain))
            if gain[best] <= 0.0:
                return
            omega, zeta = places[best]
            yield np.column_stack([logs, [omega, zeta, np.log(size[best] / along[best])]])
            gain[np.abs(np.array([each for each, _ in places]) - omega) < 0.1] = 0.0

    def chosen(self, logs: FloatArray) -> FloatArray:
        """Return as many modes as the evidence asks for, shape (3, m), by rising frequency: from these on, one more or one less a step."""
        logs = self.polished(logs)
        least = self.evidence(logs)
        while True:
            more = self.promising(logs) if logs.shape[1] < MOST_MODES else iter(())
            trials = [self.polished(each) for each in (*more, *(np.delete(logs, n, axis=1) for n in range(logs.shape[1])))]
            values = [self.evidence(each) for each in trials]
            if not values or min(values) >= least:
                return logs[:, np.argsort(logs[0])]
            logs, least = trials[int(np.argmin(values))], min(values)

    def unexplained(self, logs: FloatArray) -> float:
        """Return the share of the lines that neither modes nor noise explain."""
        rest = self.residual(logs)[: self.points].reshape(2, -1) * self.deviation
        used = logs.size + float(np.sum(self.along[: self.points] ** 2))
        freedom = self.points * max(1.0 - used / self.points, 0.1)
        return unexplained_share(np.sum(rest**2, axis=0), self.lines.variance, np.abs(self.lines.value) ** 2, freedom, _LEAST)

    def chi2_per_point(self, logs: FloatArray) -> float:
        """Return the mean squared residual."""
        return float(np.sum(self.residual(logs) ** 2) / self.points)

    def covariance(self, logs: FloatArray) -> FloatArray:
        """Return the covariance of the logarithms, shape (3 m, 3 m)."""
        if not logs.size:
            return np.zeros((0, 0))
        jacobian = self._jacobian(logs.ravel())
        return np.linalg.inv(jacobian.T @ jacobian)


def _fit(lines: _Lines) -> tuple[FloatArray, _Problem]:
    """Modes on the lines, and the misfit with the share of them that is left unexplained."""
    problem = _Problem(lines, _COARSE)
    logs = problem.chosen(np.zeros((3, 0)))
    for _ in range(_ROUNDS):
        share = problem.unexplained(logs)
        settled = abs(math.log(share / problem.share)) < 0.05
        problem = _Problem(lines, share, logs)
        logs = problem.chosen(logs)
        if settled:
            break
    return logs, problem
