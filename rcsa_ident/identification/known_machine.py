"""A machine that earlier cuts have told, as what is known before further cuts: one Gaussian over machine, joint and toolings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg

from rcsa_ident.arrays import FloatArray
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.errors import InputError
from rcsa_ident.identification.data import IdentificationData
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.parameters import JOINT, AxisLayout, Layout, Unknowns
from rcsa_ident.identification.posterior import Posterior
from rcsa_ident.identification.priors import Known, Priors
from rcsa_ident.tool_holder.drawings import KnownToolings


@dataclass(frozen=True, eq=False)
class Gaussian:
    """A normal distribution as residuals of unit variance, C^-1 (theta - centre) with covariance = C C^T.

    Parameters
    ----------
    centre : array, shape (p,)
    covariance : array, shape (p, p)
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
    def log_volume(self) -> float:
        """log det of the information matrix."""
        return float(-2.0 * np.sum(np.log(np.diag(self._factor))))

    def residual(self, theta: FloatArray) -> FloatArray:
        """Return the residuals at a vector, shape (p,)."""
        found: FloatArray = self.jacobian @ (theta - self.centre)
        return found


@dataclass(frozen=True, eq=False)
class KnownMachine:
    """What earlier cuts have told of a machine whose planes feel nothing of each other, and of toolings.

    Parameters
    ----------
    posteriors : mapping of Dof to Posterior
    toolings : KnownToolings or None
    """

    posteriors: Mapping[Dof, Posterior]
    toolings: KnownToolings | None = None

    @property
    def speed_range(self) -> tuple[float, float]:
        """Middle of the earlier cuts' speeds and half their range [rad/s]."""
        return next(iter(self.posteriors.values())).speed_range

    def relative(self, speed: FloatArray) -> FloatArray:
        """Return where speeds [rad/s] lie among the earlier cuts', -1 to 1: beyond them the machine stays as it is at their ends."""
        middle, half = self.speed_range
        found: FloatArray = np.clip((speed - middle) / half, -1.0, 1.0) if half else np.zeros(speed.size)
        return found

    def layout(self, data: IdentificationData) -> Layout:
        """Return the unknowns of further cuts.

        Raises
        ------
        InputError
            An axis of the cuts is not one of the machine.
        """
        axes = []
        for axis in data.axes:
            if axis.axis not in self.posteriors:
                told = ", ".join(known.upper() for known in self.posteriors)
                raise InputError("axes", f"cuts that show {axis.axis.upper()}", f"what the machine is known along: {told}")
            axes.append(AxisLayout(self.posteriors[axis.axis].layout.modes, softening=self.posteriors[axis.axis].layout.softening))
        return Layout(tuple(axes), len(data.coefficient_spread))

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
            found[x, y] = links[0] @ np.linalg.solve(found[shared, shared], links[1].T)
            found[y, x] = found[x, y].T
        return found

    def entries(self, data: IdentificationData, first: int) -> tuple[np.ndarray, FloatArray]:
        """Return where each number that is known of earlier toolings stands among those of further cuts, and one of its units in theirs.

        Parameters
        ----------
        data : IdentificationData
        first : int
            Where the forces' unknowns begin.

        Returns
        -------
        places (-1 where it does not), factors
        """
        if self.toolings is None or data.rough is None:
            return np.zeros(0, dtype=np.intp), np.zeros(0)
        among = {unknown: k for k, unknown in enumerate(data.rough.unknowns)}
        place = np.array([among.get(unknown, -1) for unknown in self.toolings.unknowns], dtype=np.intp)
        unit = np.where(place < 0, 1.0, self.toolings.spread / data.rough.spread[place])
        return np.where(place < 0, -1, first + data.rough_place.start + place), unit

    def prior(self, data: IdentificationData, reclamped: float) -> Gaussian:
        """Return what is known before further cuts: of the machine and of models by the earlier ones, of all else by itself.

        Parameters
        ----------
        data : IdentificationData
        reclamped : float
            Standard deviation by which the joint's stiffnesses differ in a further clamping: of their logarithms.
        """
        known = [self.posteriors[axis.axis] for axis in data.axes]
        joint = np.mean([each.theta[-JOINT:] for each in known], axis=0)
        centre = np.concatenate([*(each.theta[:-JOINT] for each in known), joint, np.zeros(len(data.coefficient_spread))])
        size = centre.size - len(data.coefficient_spread)
        covariance = self.joint_covariance(data)
        found = np.diag(np.concatenate([np.zeros(size), np.square(data.coefficient_spread)]))
        found[:size, :size] = covariance[:size, :size]
        found[range(size - JOINT, size - JOINT + 2), range(size - JOINT, size - JOINT + 2)] += reclamped**2
        entries, unit = self.entries(data, size)
        if self.toolings is not None and np.any(entries >= 0):
            here, own = entries[entries >= 0], np.flatnonzero(entries >= 0)
            unit = unit[own]
            centre[here] = unit * self.toolings.mean[own]
            found[np.ix_(here, here)] = unit[:, None] * covariance[np.ix_(size + own, size + own)] * unit
            found[:size, here] = covariance[:size, size + own] * unit
            found[here, :size] = found[:size, here].T
        return Gaussian(centre, found)


class FurtherMisfit(Misfit):
    """The residual of further cuts on a machine that is known.

    Parameters
    ----------
    data : IdentificationData
    machine : KnownMachine
    known : Gaussian
        As the machine's `prior` returns it.
    model_error : tuple of float [-]
    cut_weight : array, shape (k,), optional
    """

    def __init__(
        self,
        data: IdentificationData,
        machine: KnownMachine,
        known: Gaussian,
        model_error: tuple[float, ...],
        cut_weight: FloatArray | None = None,
    ) -> None:
        self._machine, self._known = machine, known
        super().__init__(data, Priors(), model_error, cut_weight)

    @property
    def relative_speed(self) -> FloatArray:
        """Spindle speed of each cut within those of the earlier ones, from -1 to 1, shape (k,) [-]."""
        return self._machine.relative(self.data.spindle_speed)

    def prior(self, layout: Unknowns) -> Known:
        """Return what was known before."""
        del layout
        return self._known
