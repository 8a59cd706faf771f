"""A machine that earlier cuts have told, as what is known before further cuts: one Gaussian over machine, joint and toolings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.data import IdentificationData
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.posterior import Posterior
from rcsa_ident.identification.priors import Known, Priors
from rcsa_ident.identification.unknowns import JOINT, Layout, ModalBlock, Unknowns
from rcsa_ident.tool_holder.drawings import KnownToolings


@dataclass(frozen=True, eq=False)
class Gaussian:
    """A normal distribution as residuals of unit variance, C^-1 (theta - centre) with covariance = C C^T.

    `centre`, shape (p,); `covariance`, shape (p, p)
    """

    centre: FloatArray
    covariance: FloatArray

    @cached_property
    def _factor(self) -> FloatArray:
        return np.linalg.cholesky(self.covariance)

    @cached_property
    def jacobian(self) -> FloatArray:
        """Derivative of the residuals, shape (p, p)."""
        inverse: FloatArray = scipy.linalg.solve_triangular(self._factor, np.eye(self.centre.size), lower=True, check_finite=False)
        return inverse

    @cached_property
    def information(self) -> FloatArray:
        """jacobian^T jacobian, shape (p, p)."""
        return self.jacobian.T @ self.jacobian

    @cached_property
    def log_volume(self) -> float:
        """log det of the information matrix."""
        return float(-2.0 * np.sum(np.log(np.diag(self._factor))))

    def residual(self, theta: FloatArray) -> FloatArray:
        """Return the residuals at a vector, shape (p,)."""
        found: FloatArray = self.jacobian @ (theta - self.centre)
        return found


@dataclass(frozen=True, eq=False)
class KnownMachine:
    """What earlier cuts have told of a machine whose planes feel nothing of each other, and of toolings."""

    posteriors: Mapping[Dof, Posterior]
    toolings: KnownToolings | None = None

    @property
    def speed_range(self) -> tuple[float, float]:
        """Middle of the earlier cuts' speeds and half their range [rad/s]."""
        return next(iter(self.posteriors.values())).speed_range

    def relative(self, speed: FloatArray, still: float = -1.0) -> FloatArray:
        """Return where speeds [rad/s] lie among the earlier cuts', -1 to 1: beyond them the machine stays as it is at their ends.

        `speed` [rad/s], shape (k,)
        `still`: where a spindle counts that stands still
        """
        middle, half = self.speed_range
        if not half:
            return np.zeros(speed.size)
        return np.where(speed == 0.0, still, np.clip((speed - middle) / half, -1.0, 1.0))

    def standstills(self, data: IdentificationData) -> tuple[float, ...]:
        """Return where a spindle that stands still may count among the earlier cuts' speeds, where some of the lines are such a one's.

        As at the slowest of them, or as far along the straight line that they showed.
        """
        middle, half = self.speed_range
        softens = half > 0.0 and any(posterior.layout.softening for posterior in self.posteriors.values())
        return (-1.0, -middle / half) if softens and middle > half and any(np.any(axis.still) for axis in data.axes) else (-1.0,)

    def layout(self, data: IdentificationData) -> Layout:
        """Return the unknowns of further cuts. Raises `InputError`: an axis of the cuts is not one of the machine."""
        axes = []
        for axis in data.axes:
            if axis.axis not in self.posteriors:
                told = ", ".join(known.upper() for known in self.posteriors)
                raise InputError("axes", f"cuts that show {axis.axis.upper()}", f"what the machine is known along: {told}")
            known = self.posteriors[axis.axis].layout
            # a machine that was found while it turned may be another one at standstill
            still = bool(self.speed_range[0]) and bool(np.any(axis.still))
            axes.append(ModalBlock(known.modes, softening=known.softening, standstill=still))
        return Layout(tuple(axes), len(data.coefficient_spread))

    def places(self, layout: Layout) -> np.ndarray:
        """Return where the axes' machines and the joint stand in the vector of further cuts, in the order of `joint_covariance`."""
        found = [layout.axis(i).start + axis.machine for i, axis in enumerate(layout.axes)]
        return np.concatenate([*found, np.arange(layout.joint.start, layout.joint.stop)])

    def joint_covariance(self, data: IdentificationData) -> FloatArray:
        """Return the covariance of the axes' machines, the joint and the earlier toolings together, in this order.

        Each axis is told with joint and toolings, but not with the other axis: as little as that allows they have in common besides,
        cov(x, y) = cov(x, c) cov(c)^-1 cov(c, y) with what they share, c.
        """
        known = [self.posteriors[axis.axis] for axis in data.axes]
        cores = [each.theta.size - JOINT for each in known]
        sizes = np.cumsum([0, *cores])
        tail, told = int(sizes[-1]), 0 if self.toolings is None else len(self.toolings.unknowns)
        shared = slice(tail, tail + JOINT + told)
        found = np.zeros((shared.stop, shared.stop))
        links = []
        for i, (each, core) in enumerate(zip(known, cores, strict=True)):
            cross = each.tooling_cross if each.tooling_cross.size else np.zeros((each.theta.size, told))
            here, joint = slice(sizes[i], sizes[i + 1]), slice(tail, tail + JOINT)
            links.append(np.hstack([each.covariance[:core, core:], cross[:core]]))
            found[here, here] = each.covariance[:core, :core]
            found[here, shared], found[shared, here] = links[i], links[i].T
            found[joint, joint], found[joint, joint.stop :], found[joint.stop :, joint] = (
                each.covariance[core:, core:],
                cross[core:],
                cross[core:].T,
            )
        if self.toolings is not None:
            found[tail + JOINT :, tail + JOINT :] = self.toolings.covariance
        if len(links) == 2:
            x, y = slice(0, sizes[1]), slice(sizes[1], sizes[2])
            # what is known exactly varies with nothing: no inverse where rounding makes a zero of it
            size = np.sqrt(np.diag(found[shared, shared]))
            size[size == 0.0] = 1.0
            inverse = np.linalg.pinv(found[shared, shared] / np.outer(size, size), hermitian=True)
            found[x, y] = (links[0] / size) @ inverse @ (links[1] / size).T
            found[y, x] = found[x, y].T
        return found

    def entries(self, data: IdentificationData, first: int) -> tuple[np.ndarray, FloatArray]:
        """Return where each number that is known of earlier toolings stands among those of further cuts, and one of its units in theirs.

        `first`: where the forces' unknowns begin
        Returns places (-1 where it does not), factors.
        """
        if self.toolings is None or data.rough is None:
            return np.zeros(0, dtype=np.intp), np.zeros(0)
        among = {unknown: k for k, unknown in enumerate(data.rough.unknowns)}
        place = np.array([among.get(unknown, -1) for unknown in self.toolings.unknowns], dtype=np.intp)
        unit = np.where(place < 0, 1.0, self.toolings.spread / data.rough.spread[place])
        return np.where(place < 0, -1, first + data.rough_place.start + place), unit

    def prior(self, data: IdentificationData, reclamped: float) -> Gaussian:
        """Return what is known before further cuts: of the machine and of models by the earlier ones, of all else by itself.

        Joint stiffnesses of a further clamping differ; what standing still changes is known as before an identification.

        `reclamped`: standard deviation by which the joint's stiffnesses differ in a further clamping: of their logarithms
        """
        known = [self.posteriors[axis.axis] for axis in data.axes]
        layout = self.layout(data)
        machine, size = self.places(layout), self.places(layout).size
        centre, found = np.zeros(layout.size), np.zeros((layout.size, layout.size))
        centre[machine] = np.concatenate([*(each.theta[:-JOINT] for each in known), np.mean([k.theta[-JOINT:] for k in known], axis=0)])
        covariance = self.joint_covariance(data)
        found[np.ix_(machine, machine)] = covariance[:size, :size]
        stiffnesses = layout.joint.start + np.arange(2)
        found[stiffnesses, stiffnesses] += reclamped**2
        force = np.arange(layout.force.start, layout.force.stop)
        found[force, force] = np.square(data.coefficient_spread)
        for i, axis in enumerate(layout.axes):
            still = layout.axis(i).start + np.arange(axis.size)[axis.parts["standstill"]]
            found[still, still] = np.square(Priors().standstill)[: still.size]
        entries, unit = self.entries(data, layout.force.start)
        if self.toolings is not None and np.any(entries >= 0):
            here, own = entries[entries >= 0], np.flatnonzero(entries >= 0)
            unit = unit[own]
            centre[here] = unit * self.toolings.mean[own]
            found[np.ix_(here, here)] = unit[:, None] * covariance[np.ix_(size + own, size + own)] * unit
            found[np.ix_(machine, here)] = covariance[:size, size + own] * unit
            found[np.ix_(here, machine)] = found[np.ix_(machine, here)].T
        return Gaussian(centre, found)


class FurtherMisfit(Misfit):
    """The residual of further cuts on a machine that is known.

    `known`: as the machine's `prior` returns it
    `model_error`: tuple of float [-]
    `cut_weight`, shape (k,)
    `still`: as in `KnownMachine.relative`
    """

    def __init__(
        self,
        data: IdentificationData,
        machine: KnownMachine,
        known: Gaussian,
        model_error: tuple[float, ...],
        cut_weight: FloatArray | None = None,
        still: float = -1.0,
    ) -> None:
        self._machine, self._known, self._still = machine, known, still
        super().__init__(data, Priors(), model_error, cut_weight)

    @property
    def relative_speed(self) -> FloatArray:
        """Spindle speed of each cut within those of the earlier ones, from -1 to 1, shape (k,) [-]."""
        return self._machine.relative(self.data.spindle_speed, self._still)

    def prior(self, layout: Unknowns) -> Known:
        """Return what was known before."""
        del layout
        return self._known
