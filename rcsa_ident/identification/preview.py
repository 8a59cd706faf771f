"""What a search has come to, as curves: measured lines beside the model's, while it runs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.coupled.data import coupled_data
from rcsa_ident.identification.coupled.misfit import CoupledMisfit
from rcsa_ident.identification.data import SMOOTH_ERROR, IdentificationData
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.priors import Priors
from rcsa_ident.identification.progress import BOTH, Step
from rcsa_ident.identification.unknowns import CoupledLayout


@dataclass(frozen=True, slots=True, eq=False)
class FittedLines:
    """Lines of one axis, by frequency, beside a candidate's.

    `omega` [rad/s], shape (n,)
    `measured` [m/N], shape (n,): the flange's motion over the force at the tip, up to each cut's delay
    `model` [m/N], shape (n,): the same without delay
    """

    omega: FloatArray
    measured: ComplexArray
    model: ComplexArray


class Preview:
    """Lines of an identification's data beside those of the candidates that `EvidenceSelection` tells of.

    `data`: that the method was given
    """

    def __init__(self, data: IdentificationData) -> None:
        summed = data.summed()
        self.data = {str(a.axis): summed.only(a.axis).with_smooth_errors(SMOOTH_ERROR) for a in data.axes}
        self.data[BOTH] = data.with_smooth_errors(SMOOTH_ERROR)
        self.misfits: dict[tuple[str, bool], Misfit] = {}

    def axes(self, step: Step) -> tuple[Dof, ...]:
        """Return the axes that a step is about; none where it has no candidate."""
        return () if step.candidate is None else tuple(a.axis for a in self.data[step.axis].axes)

    def lines(self, step: Step, axis: Dof) -> FittedLines:
        """Return the lines of one of these axes."""
        data, i = self.data[step.axis], self.axes(step).index(axis)
        assert step.candidate is not None
        layout = step.candidate.layout
        together = isinstance(layout, CoupledLayout)
        if (step.axis, together) not in self.misfits:
            # what the model says of the lines depends on no noise
            anything = Priors(), (1.0,) * len(data.axes)
            misfit = CoupledMisfit(coupled_data(data), *anything) if together else Misfit(data, *anything)
            self.misfits[step.axis, together] = misfit
        models = self.misfits[step.axis, together].models(step.candidate.theta, layout)
        part = data.axes[i]
        order = np.argsort(part.omega, kind="stable")
        return FittedLines(part.omega[order], part.measured[order], np.sum(models[i], axis=1)[order])
