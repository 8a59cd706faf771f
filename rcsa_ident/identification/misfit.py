"""Misfit between model and lines, with every cut's delay and air-cut angle fitted inside."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.cutting.force import ForceTerm, scaled_force
from rcsa_ident.identification._kernels.frf import cross_frf, cross_frf_gradient
from rcsa_ident.identification._kernels.lines import fit_cuts, force_rows, mix_cuts, turn_lines
from rcsa_ident.identification.data import AxisData, IdentificationData
from rcsa_ident.identification.linearisation import DELAY_UNIT, Linearisation, Residual
from rcsa_ident.identification.made_cuts import CutPrior
from rcsa_ident.identification.modal_parameters import ModalParameters, residual_turn
from rcsa_ident.identification.priors import Known, PriorRows, Priors
from rcsa_ident.identification.rough_toolings import ToolingAt, placed
from rcsa_ident.identification.unknowns import JOINT, RESIDUAL_UNIT, Layout, ModalBlock, Unknowns, chain, prior_rows, scaled_joint, unpack

#: Entries of a tool-holder that a line feels: the flange's tt, tr, rr, flange over tip t, r, and where the tip was hit the tip's own.
HOLDER = 6


@dataclass(frozen=True, slots=True, eq=False)
class Evaluation:
    """Cost at a vector, and its normal equations where asked for.

    `cost` [-]: chi2 of all axes, of the cuts' priors and of the parameters' priors
    `nuisance`, shape (k, 2): delay [s] and angle [rad] of each cut at the optimum for this vector
    `models`: tuple of complex arrays, shape (n, o) [m/N]; the model's cross FRFs on the lines of each axis
    `residual`: its squares add up to the cost
    `linear`: gradient and Gauss-Newton matrix of half the cost, where asked for
    `answers`: what they can be made of, until they are
    """

    cost: float
    nuisance: FloatArray
    models: tuple[ComplexArray, ...]
    residual: Residual
    linear: Linearisation | None = None
    answers: Sequence[Answer] = ()

    @property
    def chi2(self) -> tuple[float, ...]:
        """Sum of squares of each axis' lines, in standard deviations."""
        return self.residual.chi2

    @property
    def hessian(self) -> FloatArray:
        """Gauss-Newton matrix of half the cost, shape (p, p)."""
        assert self.linear is not None
        return self.linear.hessian


class Misfit:
    """The residual of an identification.

    `model_error`: tuple of float [-], standard deviation of what the force model leaves out, as a share of each line, for each axis
    `cut_weight`, shape (k,): factor on the weights of each cut's lines: below 1 for one that contradicts the others
    """

    def __init__(
        self, data: IdentificationData, priors: Priors, model_error: tuple[float, ...], cut_weight: FloatArray | None = None
    ) -> None:
        self.data = data
        self.priors = priors
        self.model_error = model_error
        self.cut_weight = np.ones(len(data.cut_ids)) if cut_weight is None else cut_weight
        # where little is told, forces are far from those that were simulated: they add up exactly
        exact = {c.term: k for k, c in enumerate(data.coefficients) if not c.tooling} if data.rough is not None else {}
        self._axes = tuple(WeightedLines(a, self._states, f, self.cut_weight, exact) for a, f in zip(data.axes, model_error, strict=True))
        # lines of all axes, cut by cut: a cut's delay and angle are the same for both
        cut = np.concatenate([a.cut for a in self._axes])
        self._order = np.argsort(cut, kind="stable")
        self._start = np.searchsorted(cut[self._order], np.arange(len(data.cut_ids) + 1))
        columns = [np.stack([a.omega, a.order, a.weight], axis=1) for a in self._axes]
        self._weights = np.concatenate(columns)[self._order]
        self._rough = data.rough_lines()
        self._talk = tuple(data.talk_place.get(a.axis) for a in data.axes)
        self._lines = self._in_order(tuple(a.lines for a in self._axes))

    def with_cut_weight(self, weight: FloatArray) -> Misfit:
        """Return the misfit of the same data with other factors on the weights of the cuts' lines, shape (k,)."""
        return Misfit(self.data, self.priors, self.model_error, weight)

    def with_data(self, data: IdentificationData, weight: FloatArray, error: tuple[float, ...] | None = None) -> Misfit:
        """Return the misfit of other data of the same machine, with factors on the weights of its cuts' lines, shape (k,)."""
        return Misfit(data, self.priors, self.model_error if error is None else error, weight)

    @property
    def points(self) -> int:
        """Number of real residuals of the lines."""
        return 2 * sum(a.omega.size for a in self._axes)

    def evaluate(self, theta: FloatArray, layout: Unknowns, nuisance: FloatArray, grid: int = 0, normal: bool = False) -> Evaluation:
        """Return the cost at `theta`, and with `normal` its gradient and Hessian.

        `theta`, shape (p,): see `parameters`
        `nuisance`, shape (k, 2): delay [s] and angle [rad] at which each cut's fit starts; not changed
        `grid`: delays tried over a tooth-passing period; 0 stays near `nuisance`
        `normal`: whether gradient and Gauss-Newton matrix are made, too
        """
        answers = self._answers(theta, layout)
        models = [answer.model for answer in answers]
        nuisance = nuisance.copy()
        prior = self._cut_prior(theta, layout)
        at_lines = self._in_order([m.ravel() for m in models])
        lines = self._in_order(self._seen(theta, layout)) if self.data.talk_place else self._lines
        fit_cuts(lines, self._weights, at_lines, self._start, prior.rows, nuisance, grid * int(prior.pitches.max()))
        residual = self._residual(theta, layout, models, nuisance, prior)
        here = Evaluation(residual.cost, nuisance, tuple(models), residual, answers=answers)
        return self.linearised(here, theta, layout) if normal else here

    def linearised(self, here: Evaluation, theta: FloatArray, layout: Unknowns) -> Evaluation:
        """Return an evaluation with its gradient and Hessian. `here`: at `theta`, as `evaluate` has returned it. `theta`, shape (p,)."""
        answers = self._with_slopes(here.answers, theta, layout)
        linear = self._linearise(theta, layout, answers, here.residual, here.nuisance, self._cut_prior(theta, layout))
        return replace(here, linear=linear, answers=())

    def root_weight(self, axis: int) -> FloatArray:
        """Return one over the standard deviation of each line of an axis, shape (n o,) [N/m]."""
        return np.sqrt(self._axes[axis].weight)

    def models(self, theta: FloatArray, layout: Unknowns) -> tuple[ComplexArray, ...]:
        """Return the model's cross FRFs on the lines of each axis, shapes (n, o) [m/N]; no delay and no noise is in them."""
        return tuple(answer.model for answer in self._answers(theta, layout))

    def residual_at(self, theta: FloatArray, layout: Unknowns, nuisance: FloatArray) -> Residual:
        """Return the residual with the cuts' delays and angles as they are given.

        `theta`, shape (p,)
        `nuisance`, shape (k, 2): delay [s] and angle [rad] of each cut
        """
        return self._residual(theta, layout, self.models(theta, layout), nuisance, self._cut_prior(theta, layout))

    @property
    def relative_speed(self) -> FloatArray:
        """Spindle speed of each cut within those over which the machine changes, from -1 to 1, shape (k,) [-]."""
        return self.data.relative_speed

    @property
    def _states(self) -> FloatArray:
        """What the stiffness may change with at each cut: warmth and relative speed, shape (k, 2)."""
        warmth = self.data.warmth if self.data.warmth.size else np.zeros(self.relative_speed.size)
        return np.column_stack([warmth, self.relative_speed])

    def rows(self, layout: Unknowns) -> PriorRows:
        """Return the priors of a layout's unknowns before any cut of the machine."""
        return prior_rows(layout, self.priors, self.data.coefficient_spread[: layout.coefficients])

    def prior(self, layout: Unknowns) -> Known:
        """Return what is known of a layout's unknowns beforehand."""
        return self.rows(layout)

    def without_delay(self, i: int, theta: FloatArray, layout: Unknowns, nuisance: FloatArray) -> ComplexArray:
        """Return the measured motion of an axis (see `AxisData.measured`) with tooth 1 at immersion 0 at the start, shape (n,) [m/N]."""
        lines = self._axes[i]
        return np.sum(
            lines.turned(self._seen(theta, layout)[i], nuisance)[0].reshape(-1, lines.outputs)[:, self.data.axes[i].searched], axis=1
        )

    def weight(self, i: int) -> FloatArray:
        """Return the weights of an axis' lines, shape (n, o) [N^2/m^2]."""
        return self._axes[i].weight.reshape(-1, self._axes[i].outputs)

    def _answers(self, theta: FloatArray, layout: Unknowns) -> Sequence[Answer]:
        """What the model says of each axis' lines."""
        assert isinstance(layout, Layout)
        joint = scaled_joint(theta[layout.joint])
        toolings = self._toolings(theta, layout, False)
        answers = []
        for i, (lines, part) in enumerate(zip(self._axes, layout.axes, strict=True)):
            axis = unpack(theta[layout.axis(i)], part)
            both = np.append(joint, axis.standstill)
            holder = lines.with_toolings(toolings[i]) if toolings else lines.holder
            seen, points = self.seen_at(i, theta, layout), self._points(i, theta, layout)
            machine = axis.omega_n, axis.shapes, axis.factor, axis.changes, both
            values, kept, turned = cross_frf(*machine, (lines.shares, seen), points, holder)
            factor, slope = lines.drawn_force, lines.force_slope[:, :0]
            if layout.coefficients:
                factor, slope = lines.force(theta[layout.force])
                values *= factor[:, None]
            changes = self._grips(i, layout), self.data.grip_places, self._course(i, layout), self.data.course_place
            felt = _Felt(seen, turned, self.distance_place(i, layout), points, *changes)
            answers.append(_AxisAnswer(values, kept, factor, slope, axis, part, both, toolings[i] if toolings else [], felt))
        return answers

    def _points(self, i: int, theta: FloatArray, layout: Layout) -> FloatArray:
        """The points of an axis as the kernel takes them, with the states that its machine changes with, shape (n, 4 + s)."""
        lines, part, grips = self._axes[i], layout.axes[i], self._grips(i, layout)
        points = lines.in_states[part.warming, part.softening]
        course = self._course(i, layout)
        if grips.size or course.size:
            points, logs = points.copy(), theta[layout.force]
            if grips.size:
                points[:, 3] = np.exp(grips @ logs[self.data.grip_places])
            if course.size:
                # the first of the states
                points[:, 4] += course @ logs[self.data.course_place]
                # the gradient is asked for over it
                points[points[:, 4] == 0.0, 4] = 1e-9
        return points

    def _course(self, i: int, layout: Layout) -> FloatArray:
        """How the warmth in each line changes with what is not known of it, shape (n, q); empty where that is not asked for."""
        data = self.data
        asked = layout.axes[i].warming and data.course.size and data.course_place.stop <= layout.coefficients
        return data.course[data.axes[i].cut] if asked else np.zeros((0, 0))

    def _grips(self, i: int, layout: Unknowns) -> FloatArray:
        """How the logarithm of each line's joint stiffness changes with what stands at `grip_places`, shape (n, q)."""
        grip = self.data.grip
        asked = grip.size and np.max(self.data.grip_places) < layout.coefficients
        return grip[self.data.axes[i].cut] if asked else np.zeros((0, 0))

    def seen_at(self, i: int, theta: FloatArray, layout: Unknowns) -> FloatArray:
        """Return how far behind the joint an axis' flange sensor looks, over the lever, and 1 where it looks at the holder, shape (2,)."""
        told, place = self.data.axes[i].behind, self.distance_place(i, layout)
        more = 0.0 if place is None else float(theta[layout.force][place])
        return np.array([told + more, float(told < 0.0)])

    def distance_place(self, i: int, layout: Unknowns) -> int | None:
        """Return where what is not known of that distance stands among a layout's coefficients; None where it does not."""
        place = self.data.distance_place.get(self.data.axes[i].axis)
        return None if place is None or place >= layout.coefficients else place

    def _with_slopes(self, answers: Sequence[Answer], theta: FloatArray, layout: Unknowns) -> Sequence[Answer]:
        """The answers, ready to be linearised."""
        found = []
        for answer, own in zip(answers, self._toolings(theta, layout, True) or [[]] * len(answers), strict=True):
            assert isinstance(answer, _AxisAnswer)
            found.append(replace(answer, toolings=own))
        return found

    def _in_order(self, of_axes: Sequence[ComplexArray]) -> ComplexArray:
        """Lines of all axes, cut by cut."""
        return np.concatenate(of_axes)[self._order]

    def _seen(self, theta: FloatArray, layout: Unknowns) -> tuple[ComplexArray, ...]:
        """Lines of each axis without what its sensor feels of the other one, shape (n o, 2)."""
        force = theta[layout.force]
        return tuple(
            axis.lines if place is None or place >= force.size else axis.lines - force[place] * axis.talk
            for axis, place in zip(self._axes, self._talk, strict=True)
        )

    def _toolings(self, theta: FloatArray, layout: Unknowns, slopes: bool) -> list[list[ToolingAt]]:
        """What each axis' lines feel of toolings whose drawing is rough; nothing where all are as drawn or the layout leaves them so."""
        place = self.data.rough_place
        if self._rough is None or layout.coefficients < place.stop:
            return []
        return self._rough.at(theta[layout.force][place], slopes)

    def _cut_prior(self, theta: FloatArray, layout: Unknowns) -> CutPrior:
        """What is known of each cut, with the triggers of unknown tooth angle where that is an unknown of the layout."""
        prior = self.data.cut_prior
        if not layout.clampings:
            return prior
        delay, weight = prior.delay.copy(), prior.delay_weight.copy()
        known = self.data.clamping >= 0
        angle = theta[layout.clamping][self.data.clamping[known]]
        delay[known] = self.data.edge[known, 0] + angle / self.data.spindle_speed[known]
        weight[known] = self.data.edge[known, 1]
        return replace(prior, delay=delay, delay_weight=weight)

    def _residual(
        self, theta: FloatArray, layout: Unknowns, models: Sequence[ComplexArray], nuisance: FloatArray, prior: CutPrior
    ) -> Residual:
        seen = self._seen(theta, layout)
        lines = tuple(axis.rest(each, model, nuisance) for axis, each, model in zip(self._axes, seen, models, strict=True))
        own = self.prior(layout).residual(theta)
        cuts = np.sqrt(prior.weights) * nuisance
        cuts[:, 0] -= np.sqrt(prior.delay_weight) * prior.delay
        return Residual(lines, own, cuts)

    def _linearise(
        self, theta: FloatArray, layout: Unknowns, answers: Sequence[Answer], residual: Residual, nuisance: FloatArray, prior: CutPrior
    ) -> Linearisation:
        """Gauss-Newton matrices of the parameters after eliminating two unknowns per cut (Schur complement)."""
        size, cuts = layout.size, len(self.data.cut_ids)
        known = self.prior(layout)
        hessian = known.information.copy()
        cut_prior = np.sqrt(prior.weights) * np.array([DELAY_UNIT, 1.0])
        mixed = np.zeros((cuts, 2, size))
        inner = np.zeros((cuts, 2, 2))
        inner[:, 0, 0], inner[:, 1, 1] = cut_prior[:, 0] ** 2, cut_prior[:, 1] ** 2
        jacobians, all_columns, compliance = [], [], []
        for i, (lines, seen, answer) in enumerate(zip(self._axes, self._seen(theta, layout), answers, strict=True)):
            block, felt = layout.axis(i), self._talk[i]
            jacobian, change = answer.jacobian(lines, layout)
            if felt is not None and felt < layout.coefficients:
                jacobian[felt - layout.coefficients] = -lines.whitened(lines.turned(lines.talk, nuisance)[0])
            compliance.append(change)
            part, shared = block.stop - block.start, slice(layout.tail, layout.force.stop)
            product = jacobian @ jacobian.T
            hessian[block, block] += product[:part, :part]
            hessian[block, shared] += product[:part, part:]
            hessian[shared, block] += product[part:, :part]
            hessian[shared, shared] += product[part:, part:]
            columns = lines.columns(seen, nuisance)
            mix_cuts(jacobian, columns, lines.cut, part, block.start, layout.tail, inner, mixed)
            jacobians.append(jacobian)
            all_columns.append(columns)
        clamping = self._clamping(layout, prior)
        if layout.clampings:
            np.add.at(hessian, (clamping[0], clamping[0]), clamping[1] ** 2)
            mixed[np.arange(cuts), 0, clamping[0]] += cut_prior[:, 0] * clamping[1]
        _without_information(inner, prior.tooth_period)
        # inner = L L^T, cut by cut: hessian - mixed^T inner^-1 mixed = hessian - half^T half
        first = np.sqrt(inner[:, 0, 0])
        low = inner[:, 1, 0] / first
        second = np.sqrt(np.maximum(inner[:, 1, 1] - low**2, 1e-12 * inner[:, 1, 1]))
        upper = mixed[:, 0] / first[:, None]
        half = np.concatenate([upper, (mixed[:, 1] - low[:, None] * upper) / second[:, None]])
        hessian -= half.T @ half
        index = tuple(lines.cut for lines in self._axes)
        lines_of = tuple(jacobians), tuple(all_columns), index
        normal = np.empty(0), hessian, inner, mixed
        linear = Linearisation(layout, *lines_of, known.jacobian, cut_prior, clamping, *normal, tuple(compliance))
        return replace(linear, gradient=linear.pull(residual))

    def _clamping(self, layout: Unknowns, prior: CutPrior) -> tuple[np.ndarray, FloatArray]:
        """Place of the tooth angle that each cut's prior depends on, and the prior's change with it."""
        cuts = len(self.data.cut_ids)
        if not layout.clampings:
            return np.zeros(cuts, dtype=np.intp), np.zeros(cuts)
        known = self.data.clamping >= 0
        place = layout.clamping.start + np.maximum(self.data.clamping, 0)
        return place, np.where(known, -np.sqrt(prior.delay_weight) / self.data.spindle_speed, 0.0)


class WeightedLines:
    """Lines of one axis as rows, output after output at each point, with what never changes about them."""

    def __init__(
        self,
        axis: AxisData,
        states: FloatArray,
        model_error: float,
        cut_weight: FloatArray,
        exact: Mapping[ForceTerm, int] | None = None,
    ) -> None:
        o = axis.outputs
        self.outputs = o
        self.shares = axis.output_shares
        self.points, every = axis.kernel_points, itertools.product((False, True), repeat=2)
        # with the states that a layout asks for
        self.in_states = {each: np.hstack([self.points, states[axis.cut][:, each]]) for each in every}
        self.holder = axis.kernel_holder
        self.force_slope = axis.force_slope
        self.drawn_force = np.ones(axis.omega.size, dtype=complex)
        self.omega, self.order, self.cut = np.repeat(axis.omega, o), np.repeat(axis.order, o), np.repeat(axis.cut, o)
        self.lines, self.talk = axis.lines.reshape(-1, 2), axis.talk.reshape(-1, 2)
        self.weight = (_weight(axis, model_error) * cut_weight[axis.cut][:, None]).ravel()
        self.root = np.sqrt(self.weight)
        self.rates = np.stack([self.omega, self.order, self.weight], axis=1)
        self.exact = exact or {}

    def turned(self, lines: ComplexArray, nuisance: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Lines, shape (n o, 2), as they would be without delay, and the air cut's part of them, shape (n o,)."""
        found = np.empty_like(lines)
        turn_lines(lines, self.rates, self.cut, nuisance, found)
        return found[:, 0], found[:, 1]

    def whitened(self, values: ComplexArray) -> FloatArray:
        """In standard deviations, real over imaginary parts, shape (2 n o,)."""
        values = values * self.root
        return np.concatenate([values.real, values.imag])

    def rest(self, lines: ComplexArray, model: ComplexArray, nuisance: FloatArray) -> FloatArray:
        """Residual, real over imaginary parts, shape (2 n o,)."""
        return self.whitened(self.turned(lines, nuisance)[0] - model.ravel())

    def columns(self, lines: ComplexArray, nuisance: FloatArray) -> ComplexArray:
        """The lines' change with delay and angle of their cut, shape (n o, 2)."""
        measured, air = self.turned(lines, nuisance)
        return np.stack([1j * self.omega * DELAY_UNIT * measured, -1j * self.order * air], axis=1) * self.root[:, None]

    def with_toolings(self, toolings: Sequence[ToolingAt]) -> ComplexArray:
        """The tool-holders' receptances with those of rough toolings in place of the drawn ones, shape (n, 8)."""
        return placed(self.holder, toolings, self.points[:, 1] == 0.0)

    def force(self, logs: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """What the forces are of those that were simulated, shape (n,), and how its logarithm changes with each unknown, shape (n, c)."""
        return scaled_force(self.force_slope[:, : logs.size], logs, self.exact)


class Answer(Protocol):
    """What a model says of one axis' lines: `model`, shape (n, o) [m/N]."""

    @property
    def model(self) -> ComplexArray:
        """Cross FRFs without delay and noise, shape (n, o) [m/N]."""
        ...

    def jacobian(self, lines: WeightedLines, layout: Unknowns) -> tuple[FloatArray, ComplexArray]:
        """Return the residual's change with the axis' own parameters, the joint and the coefficients, shape (q + c, 2 n o), and that with
        the flange's receptance, shape (n o, 3)."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class _Felt:
    """What differs between an axis' lines beside the machine.

    `seen`, shape (2,): where the flange's sensor looks
    `turned`, shape (n,): the slope there
    `place`: where what is not known of the former stands among the coefficients
    `points`, shape (n, 4 + s): as the kernel took them
    `grips`, shape (n, q): how the logarithms of their joints' stiffness change with what stands at `grip_places`
    `course`, shape (n, q): how their warmth changes with what stands at `course_place`
    """

    seen: FloatArray
    turned: ComplexArray
    place: int | None
    points: FloatArray
    grips: FloatArray
    grip_places: np.ndarray
    course: FloatArray
    course_place: slice


@dataclass(frozen=True, slots=True, eq=False)
class _AxisAnswer:
    """One bending plane's lines, what their gradient is made of, and the physics behind them."""

    model: ComplexArray
    kept: FloatArray
    factor: ComplexArray
    slope: ComplexArray
    axis: ModalParameters
    layout: ModalBlock
    joint: FloatArray
    toolings: Sequence[ToolingAt]
    felt: _Felt

    def jacobian(self, lines: WeightedLines, layout: Unknowns) -> tuple[FloatArray, ComplexArray]:
        axis, bare = self.axis, self.layout.parts["residual"]
        n, o = self.model.shape
        scale = np.concatenate([chain(axis, self.layout), self.joint[:JOINT]])
        own, forces, holder = scale.size, self.slope.shape[1], HOLDER if self.toolings else 0
        # first as it changes with the flange's receptance itself
        scale[bare] = 1.0
        root = -lines.root.reshape(n, o)
        out = np.empty((own + max(forces, holder), 2 * n * o))
        rows, weight = out[: own + holder], root * self.factor[:, None]
        machine = axis.omega_n, axis.factor, axis.changes, self.joint
        cross_frf_gradient(*machine, (lines.shares, self.felt.seen), self.felt.points, self.kept, weight, scale, rows)
        compliance = complex_columns(out[bare])
        out[bare] = (RESIDUAL_UNIT * residual_turn(axis.residual)).T @ out[bare]
        with_holder = complex_columns(out[own : own + holder])
        force_rows(self.slope, root * self.model, out[own : own + forces])
        if self.felt.place is not None:
            change = (weight * lines.shares[:, 0] * self.felt.turned[:, None]).ravel()
            out[own + self.felt.place] = np.concatenate([change.real, change.imag])
        if self.felt.grips.size:
            stiffer = np.tile(np.repeat(self.felt.grips.T, o, axis=1), 2)
            out[own + self.felt.grip_places] = stiffer * (out[own - JOINT] + out[own - JOINT + 1])
        if self.felt.course.size:
            # each of the warming's rows is the change with an entry, times the warmth
            entries = axis.warming[np.tril_indices(axis.order)] @ out[self.layout.parts["warming"]]
            by_warmth = entries / np.tile(np.repeat(self.felt.points[:, 4], o), 2)
            out[own:][self.felt.course_place] = np.tile(np.repeat(self.felt.course.T, o, axis=1), 2) * by_warmth
        for each in self.toolings:
            moved = with_holder.reshape(n, o, holder)[each.points, :, : each.values.shape[1]] @ each.slopes
            place = (each.points[:, None] * o + np.arange(o)).ravel()
            change = moved.reshape(place.size, -1).T
            out[np.ix_(own + each.unknowns, place)] = change.real
            out[np.ix_(own + each.unknowns, n * o + place)] = change.imag
        return out[: own + forces], compliance


def complex_columns(rows: FloatArray) -> ComplexArray:
    """Return rows of real and then imaginary parts, shape (q, 2 n), as complex columns, shape (n, q)."""
    half = rows.shape[1] // 2
    found: ComplexArray = (rows[:, :half] + 1j * rows[:, half:]).T
    return found


def _without_information(inner: FloatArray, period: FloatArray) -> None:
    """A cut of which nothing tells the delay, no line and no trigger, has it anywhere in a tooth-passing period."""
    unknown = ~(inner[:, 0, 0] > 0.0)
    inner[unknown, 0, 0] = 12.0 / (period[unknown] / DELAY_UNIT) ** 2


def _weight(axis: AxisData, model_error: float) -> FloatArray:
    size = axis.power
    # a line of nothing in a record without noise is not infinitely sure
    floor = 1e-12 * float(np.mean(size)) if np.any(size) else 1e-30
    return 1.0 / np.maximum(axis.variance + 0.5 * model_error**2 * size, floor)
