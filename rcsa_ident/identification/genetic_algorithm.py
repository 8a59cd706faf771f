"""The published identification: a genetic algorithm over boxes, with its printed search space and cost ([inprocess], Table 2, eq. 14).

64 variables a direction: ten complex modes (p1..p6) and the joint (p7..p10). What [inprocess] does not say is how the simulated
force's phase is tied to the record; here each cut is granted its best delay on a grid, for every candidate. As there, sensors are taken to
look at the flange itself: how far behind it they look is not asked.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.remarks import Remark
from rcsa_ident.base.scaleout import Map
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.dynamics.coordinates import plane
from rcsa_ident.dynamics.modal import ModalModel
from rcsa_ident.dynamics.receptance import dissipation
from rcsa_ident.identification._kernels.lines import best_grid_misfit, modal_cross_frf
from rcsa_ident.identification.data import LEVER, AxisData, IdentificationData
from rcsa_ident.identification.diagnostics import failed, not_finite
from rcsa_ident.identification.progress import Progress, Stage, Step
from rcsa_ident.identification.result import AxisResult, Identification, IdentificationCode
from rcsa_ident.identification.status import Status
from rcsa_ident.identification.task import Phase, finite, perform

#: Delays that each cut is tried at, over a tooth-passing period.
GRID = 64
#: Mean squared residual, at 2 % model error, above which the answer is not to be believed.
WORST_MISFIT = 4.0


@dataclass(frozen=True, slots=True)
class SearchSpace:
    """Boxes of the variables; the defaults are those of [inprocess], Table 2.

    `natural_frequency_hz`, `damping_ratio`: (low, high)
    `phi_t`: largest |p3| [sqrt(s/kg)]
    `phase`: largest |p4| and |p6|
    `slope_ratio`: (low, high); |p5| [1/m]; the sign is free
    `log_k_t`, `log_k_r`: (low, high); decimal logarithms of [N/m] and [N m/rad]
    `c_t`, `c_r`: largest damping [N s/m], [N m s/rad]
    """

    natural_frequency_hz: tuple[float, float] = (600.0, 3500.0)
    damping_ratio: tuple[float, float] = (0.05, 0.20)
    phi_t: float = 0.005
    phase: float = 1.0
    slope_ratio: tuple[float, float] = (5.0, 15.0)
    log_k_t: tuple[float, float] = (10.0, 15.0)
    log_k_r: tuple[float, float] = (8.0, 15.0)
    c_t: float = 1000.0
    c_r: float = 100.0


#: Boxes that hold spindles with low, lightly damped modes and real joints, which Table 2 of [inprocess] leaves out.
WIDE = SearchSpace((50.0, 5000.0), (0.003, 0.30), 0.02, 1.0, (0.0, 40.0), (8.0, 12.0), (5.0, 9.0), 1e5, 1e3)


@dataclass(frozen=True, slots=True)
class LiteralCost:
    """kappa sum_j ||E_j|| + nu sum_n |p3,n|, E_j in m/N over the lines of tooling j, with the constants of [inprocess], eq. 14."""

    kappa: float = 1.0e6
    nu: float = 700.0

    def weights(self, data: AxisData) -> FloatArray:
        """Return the lines' weights, shape (n,): all count alike."""
        return np.ones(data.omega.size)

    def value(self, misfit: FloatArray, points: FloatArray, p3: FloatArray, space: SearchSpace) -> FloatArray:
        """Return the cost of k candidates, shape (k,).

        `misfit`, shape (k, toolings): weighted sum of squares of each tooling's lines
        `points`, shape (toolings,): number of lines of each tooling
        `p3` [sqrt(s/kg)], shape (k, modes): real parts of the translational shapes
        """
        return self.kappa * np.sqrt(misfit).sum(axis=1) + self.nu * np.abs(p3).sum(axis=1)


@dataclass(frozen=True, slots=True)
class NoiseWeightedCost:
    """The same with each line in its own standard deviations, and a penalty without units.

    `model_error`: share of each line added to the records' noise
    `strength`: penalty of a mode with the largest shape, in units of the rms residual
    """

    model_error: float = 0.02
    strength: float = 0.01

    def weights(self, data: AxisData) -> FloatArray:
        """Return the lines' weights, shape (n,): inverse variances."""
        return 1.0 / (data.noise + 0.5 * self.model_error**2 * np.abs(data.measured) ** 2)

    def value(self, misfit: FloatArray, points: FloatArray, p3: FloatArray, space: SearchSpace) -> FloatArray:
        """Return the cost of k candidates, shape (k,); parameters as in `LiteralCost`."""
        return np.sqrt(misfit / (2.0 * points)).sum(axis=1) + self.strength * np.abs(p3).sum(axis=1) / space.phi_t


@dataclass(frozen=True, slots=True)
class PaperGeneticAlgorithm:
    """pymoo's genetic algorithm [blank2020] as [inprocess] sets it: population 20, 5000 iterations, each direction for itself."""

    cost: LiteralCost | NoiseWeightedCost = field(default_factory=LiteralCost)
    space: SearchSpace = field(default_factory=SearchSpace)
    modes: int = 10
    population: int = 20
    generations: int = 5000

    @property
    def name(self) -> str:
        """Name of the method in a result file."""
        return "paper"

    def run(self, data: IdentificationData, seed: int, map: Map = map, progress: Progress | None = None) -> Identification:
        """Return the identification; each axis gets a seed of its own.

        `seed`: same seed, same answer, whatever `map` is
        `map`: the builtin, or a pool's
        `progress`: told of every step; with a pool's map it has to be picklable
        Raises `InputError` if hammer tests or passes are among the data, or no displacement of the flange: its candidates know that at one
            speed alone.
        """
        if data.tests:
            raise InputError("method", f"{self.name}, with hammer tests", "the default method, which knows of them")
        if not data.of_flange:
            raise InputError("method", f"{self.name}, with accelerometers on the housing alone", "the default method, which knows of them")
        if data.sweeps:
            raise InputError("method", f"{self.name}, with passes whose speed changes", "the default method, which knows of them")
        if not_finite(data):
            return failed(data, seed, self.name)
        data = data.learned_from()
        sequences = np.random.SeedSequence(seed).spawn(len(data.axes))
        seeds = [int(s.generate_state(1)[0]) for s in sequences]
        tasks = [GeneticSearch(self, data.only(a.axis), own, progress) for a, own in zip(data.axes, seeds, strict=True)]
        try:
            found = finite(map(perform, tasks))
        except FloatingPointError:
            return failed(data, seed, self.name)
        axes, reasons, trace = {}, [], []
        problem = None
        for axis, (x, costs) in zip(data.axes, found, strict=True):
            problem = _Problem(self, data.only(axis.axis))
            axes[axis.axis] = problem.result(x)
            trace += [Step(str(axis.axis), Stage.GENERATION, float(c), self.modes) for c in costs]
            name, misfit = str(axis.axis).upper(), axes[axis.axis].chi2_per_point
            if misfit > WORST_MISFIT:
                words = (
                    f"{name}: the modes do not fit the lines, chi² per point is {misfit:.0f} at an error of 2 % (limit {WORST_MISFIT:g})"
                )
                reasons.append(Remark(IdentificationCode.LINES_MISSED, words))
            omega = np.linspace(axis.omega.min(), axis.omega.max(), 400)
            worst = float(dissipation(omega, axes[axis.axis].modes.receptance(omega).values).min())
            if worst < -1e-9:
                words = f"{name}: the modes are not passive, the real part of the mobility falls to {worst:.2f} of its magnitude"
                reasons.append(Remark(IdentificationCode.NOT_PASSIVE, words))
        assert problem is not None
        delays = problem.delays(axes[data.axes[-1].axis])
        return Identification(
            status=Status.SUSPECT if reasons else Status.NOT_VALIDATED,
            reasons=tuple(reasons),
            seed=seed,
            method=self.name,
            axes=axes,
            cut_ids=data.cut_ids,
            delay=delays,
            delay_std=data.cut_prior.tooth_period / GRID,
            spindle_speed=data.spindle_speed,
            trace=tuple(trace),
        )


class _Problem:
    """Costs of many candidates of one axis."""

    def __init__(self, method: PaperGeneticAlgorithm, data: IdentificationData) -> None:
        self.method, self.data, self.axis = method, data, data.axes[0]
        axis = self.axis
        self.start = np.searchsorted(axis.cut, np.arange(len(data.cut_ids) + 1))
        self.weight = method.cost.weights(axis)
        period = data.cut_prior.tooth_period[axis.cut]
        delay = np.arange(GRID) / GRID * period[:, None]
        turned = axis.measured[:, None] * np.exp(1j * axis.omega[:, None] * delay)
        self.table = np.ascontiguousarray(np.stack([turned.real, turned.imag], axis=1))
        self.measured = np.abs(axis.measured) ** 2
        self.flange = np.ascontiguousarray(np.concatenate([[c.real, c.imag] for c in axis.flange.T]))
        self.tip = np.ascontiguousarray(np.concatenate([[c.real, c.imag] for c in axis.tip.T]))
        _, self.tooling = np.unique(data.cut_tooling, return_inverse=True)
        self.points = np.bincount(self.tooling[axis.cut]).astype(float)
        self.model = np.empty((2, axis.omega.size))

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Return the lower and the upper bounds of the variables, shape (6 modes + 4,) each."""
        s = self.method.space
        reach = s.slope_ratio[1] - s.slope_ratio[0]
        low = [s.natural_frequency_hz[0], s.damping_ratio[0], -s.phi_t, -s.phase, -reach, -s.phase]
        high = [s.natural_frequency_hz[1], s.damping_ratio[1], s.phi_t, s.phase, reach, s.phase]
        m = self.method.modes
        joint_low, joint_high = [s.log_k_t[0], s.log_k_r[0], 0.0, 0.0], [s.log_k_t[1], s.log_k_r[1], s.c_t, s.c_r]
        return np.array([*np.repeat(low, m), *joint_low]), np.array([*np.repeat(high, m), *joint_high])

    def decode(self, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return omega_n, zeta, phi_t, phi_r, shapes (k, modes), and the joint (k, 4), of candidates (k, variables)."""
        m = self.method.modes
        p1, p2, p3, p4, u5, p6 = (x[:, i * m : (i + 1) * m] for i in range(6))
        # one variable runs over the split interval of p5: the gap around zero is cut out
        p5 = u5 + np.where(u5 >= 0.0, 1.0, -1.0) * self.method.space.slope_ratio[0]
        joint = np.concatenate([10.0 ** x[:, -4:-2], x[:, -2:]], axis=1)
        return 2.0 * np.pi * p1, p2, p3 * (1.0 + 1j * p4), p3 * p5 * (1.0 + 1j * p6), joint

    def costs(self, x: FloatArray) -> FloatArray:
        """Return the cost of each candidate, shape (k,), of vectors (k, variables)."""
        omega_n, zeta, phi_t, phi_r, joint = self.decode(x)
        fractions = modal_fractions(omega_n, zeta, phi_t, LEVER * phi_r)
        joint = joint / np.array([1.0, LEVER**2, 1.0, LEVER**2])
        misfit = np.zeros((x.shape[0], self.points.size))
        for k in range(x.shape[0]):
            modal_cross_frf(fractions[k], joint[k], self.axis.omega, self.flange, self.tip, self.model)
            best_grid_misfit(self.model, self.measured, self.weight, self.table, self.start, self.tooling, misfit[k])
        m = self.method.modes
        return self.method.cost.value(misfit, self.points, x[:, 2 * m : 3 * m], self.method.space)

    def result(self, x: FloatArray) -> AxisResult:
        """Return modes, joint and statistics of one candidate."""
        omega_n, zeta, phi_t, phi_r, joint = self.decode(x[None])
        order = np.argsort(omega_n[0])
        coordinates = plane("flange", self.axis.axis)
        phi = np.stack([phi_t[0], phi_r[0]], axis=1)[order]
        modes = ModalModel(omega_n[0][order], zeta[0][order], phi, np.zeros((2, 2)), coordinates)
        k_t, k_r, c_t, c_r = (float(v) for v in joint[0])
        self.costs(x[None])
        model = self.model[0] + 1j * self.model[1]
        delay = self._best_delays(model)[self.axis.cut]
        measured = self.axis.measured * np.exp(1j * self.axis.omega * delay)
        weight = NoiseWeightedCost().weights(self.axis)
        squares = weight * np.abs(measured - model) ** 2
        tooling = self.data.cut_tooling[self.axis.cut]
        return AxisResult(
            modes=modes,
            joint=LumpedJoint(k_t, k_r, c_t, c_r),
            chi2_per_point=float(squares.mean() / 2.0),
            per_tooling={n: float(squares[tooling == t].mean() / 2.0) for t, n in enumerate(self.data.toolings) if np.any(tooling == t)},
            model_error=NoiseWeightedCost().model_error,
            parameters=(),
            posterior=None,
            measured={
                "omega": self.axis.omega,
                "value": measured,
                "model": model,
                "tooling": tooling,
                "cut": self.axis.cut,
                "coherence": self.measured / np.maximum(self.measured + 2.0 * self.axis.noise, 1e-300),
            },
        )

    def delays(self, result: AxisResult) -> FloatArray:
        """Return each cut's best delay on the grid for a result, shape (k,) [s]."""
        return self._best_delays(np.asarray(result.measured["model"]))

    def _best_delays(self, model: np.ndarray) -> FloatArray:
        overlap = self.weight[:, None] * (model.real[:, None] * self.table[:, 0] + model.imag[:, None] * self.table[:, 1])
        best = np.zeros(len(self.data.cut_ids))
        for cut in range(best.size):
            first, last = self.start[cut], self.start[cut + 1]
            if last > first:
                best[cut] = np.argmax(overlap[first:last].sum(axis=0)) / GRID * self.data.cut_prior.tooth_period[cut]
        return best


def modal_fractions(omega_n: FloatArray, zeta: FloatArray, phi_t: np.ndarray, phi_r: np.ndarray) -> FloatArray:
    """Return conjugate pairs as real fractions (a + i w b) / (w_n^2 - w^2 + 2 i zeta w_n w), shape (..., modes, 8).

    a = -2 Re(r conj(lambda)) and b = 2 Re(r) with the residue r = phi_p phi_q, for tt, tr, rr.

    `omega_n`, `zeta`: arrays, shape (..., modes) [rad/s], [-]
    `phi_t`, `phi_r`: complex arrays, shape (..., modes) [sqrt(s/kg)]; shapes: translation, and slope times the lever
    """
    conjugate = -zeta * omega_n - 1j * omega_n * np.sqrt(1.0 - zeta**2)
    columns = [omega_n**2, 2.0 * zeta * omega_n]
    for residue in (phi_t * phi_t, phi_t * phi_r, phi_r * phi_r):
        columns += [-2.0 * (residue * conjugate).real, 2.0 * residue.real]
    return np.ascontiguousarray(np.stack(columns, axis=-1))


@dataclass(frozen=True, slots=True, eq=False)
class GeneticSearch:
    """The search of one axis; it answers with the best variables and the best cost of the generations, some five hundred of them.

    `data`: of one axis
    """

    phase: ClassVar[Phase] = Phase.SEARCH
    method: PaperGeneticAlgorithm
    data: IdentificationData
    seed: int
    progress: Progress | None = None

    def run(self) -> tuple[FloatArray, list[float]]:
        """Return best variables and costs."""
        from pymoo.algorithms.soo.nonconvex.ga import GA
        from pymoo.core.problem import Problem
        from pymoo.optimize import minimize

        method = self.method
        problem = _Problem(method, self.data)
        low, high = problem.bounds()

        class Vectorised(Problem):
            def __init__(self) -> None:
                super().__init__(n_var=low.size, n_obj=1, xl=low, xu=high)

            def _evaluate(self, x: FloatArray, out: dict[str, FloatArray], *args: Any, **kwargs: Any) -> None:
                out["F"] = problem.costs(np.asarray(x, dtype=float))[:, None]

        best: list[float] = []

        def follow(algorithm: Any) -> None:
            best.append(float(algorithm.opt.get("F").min()))
            if self.progress is not None:
                self.progress(Step(str(self.data.axes[0].axis), Stage.GENERATION, best[-1], method.modes))

        settings = {"seed": self.seed, "callback": follow, "verbose": False}
        found = minimize(Vectorised(), GA(pop_size=method.population), ("n_gen", method.generations), **settings)
        if found.X is None or not np.isfinite(best[-1]):
            raise FloatingPointError("no candidate of finite cost")
        step = max(len(best) // 500, 1)
        return np.asarray(found.X, dtype=float), best[::step]
