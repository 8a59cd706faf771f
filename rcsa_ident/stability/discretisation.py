"""Semi- and full discretisation: within each step the motion is exact, the cut's coefficients stand still or its forces are polynomials."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, Literal

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.stability.methods import MethodName, Watch
from rcsa_ident.stability.monodromy import MonodromyOperator
from rcsa_ident.stability.multiplier_limits import check_resolution, marched_lobes, visits
from rcsa_ident.stability.result import StabilityLobes
from rcsa_ident.stability.tip_modes import TipModes, require_modes

#: Of the polynomials that stand for semi-discretisation's exact answer within a step: at 24 steps a wave they leave 1e-7 of the multiplier.
_SEMI_DEGREE = 3


@dataclass(frozen=True, slots=True)
class SemiDiscretisation:
    """First-order semi-discretisation of the periodic delay equation [insperger2004].

    On each step K(t) and C(t) are replaced by their means and y(t - T) by the straight line between its ends; what is left has
    constant coefficients and is solved exactly. The error falls with the square of the step. As in [bachrathy2013] the map of
    a period is applied step by step, never multiplied out: its cost is linear in steps and modes.

    Takes what `FullDiscretisation` takes; that one needs far fewer steps.

    Parameters
    ----------
    intervals : int or None, default None
        Steps per tooth period, at least; None chooses them from an estimate of the error.
    tolerance : float, default 3e-3
        Of the limit depth, relative, where `intervals` is None.
    watch : callable or None
        Told of each speed once its limit is known.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> mode = ri.normal_modes([ri.hz(900.0)], [0.02], [[5.0]], (ri.Coordinate("tip", ri.Dof.Y),))
    >>> cut = ri.MillingProcess(ri.Cutter(2, 0.012), ri.CuttingCoefficients(7e8, 0.3), ri.Engagement.from_immersion(0.5, "down"))
    >>> tip = ri.TipModes.of({ri.Dof.Y: mode})
    >>> lobes = ri.stability_lobes(tip, cut, ri.rpm(8000, 16_000, 2000), 10e-3, ri.SemiDiscretisation())
    >>> (1e3 * lobes.limit_depth).round(2).tolist()
    [0.62, 0.33, 1.25, 0.82, 0.33]
    """

    name: ClassVar[str] = MethodName.SEMI_DISCRETISATION.value
    needs: ClassVar[Literal["receptance", "modes"]] = "modes"
    seconds_per_operation: ClassVar[float] = 3e-8
    gives_maps: ClassVar[bool] = True

    intervals: int | None = None
    tolerance: float = 3e-3
    watch: Watch | None = field(default=None, repr=False, compare=False)

    def __post_init__(self) -> None:
        check_resolution(self.intervals, self.tolerance)

    def monodromy(self, tip: Receptance | TipModes, process: MillingProcess) -> MonodromyOperator:
        """Return the cut's monodromy operator."""
        return MonodromyOperator(require_modes(tip, self.name), process, _SEMI_DEGREE, frozen=True)

    def operations(self, process: MillingProcess, speeds: FloatArray, top: float, max_depth: float) -> FloatArray:
        """Return how often a mode is moved on to the next point of the cut, at each speed."""
        return visits(process, speeds, top, max_depth, _SEMI_DEGREE, frozen=True)

    def lobes(self, tip: Receptance | TipModes, process: MillingProcess, speeds: FloatArray, max_depth: float) -> StabilityLobes:
        """Return the limit at each speed by itself."""
        return marched_lobes(self.monodromy(tip, process), speeds, max_depth, self.intervals, self.tolerance, self.name, self.watch)


@dataclass(frozen=True, slots=True)
class FullDiscretisation:
    """Full discretisation of the periodic delay equation [ding2010].

    p' = pole p + inputs F moves exactly, F = K(t) (y - y(t - T)) + C(t) y' is a polynomial within each step: a straight line in the
    published method (degree 1), through Gauss-Lobatto nodes here. Steps begin and end where teeth enter and leave, so the error falls
    with the degree's order even in interrupted cuts. The map of a period is applied, never written down: its cost is linear in steps
    and modes, and Arnoldi's method [arnoldi1951] finds its largest multiplier.

    Takes unequal pitch, run-out (with the feed per tooth), helix, a varying speed, process damping, modes with a shape and an
    engagement that changes along the edge.

    Parameters
    ----------
    intervals : int or None, default None
        Steps per tooth period, at least; None chooses them from an estimate of the error.
    degree : int, default 6
    tolerance : float, default 3e-3
        Of the limit depth, relative, where `intervals` is None.
    watch : callable or None
        Told of each speed once its limit is known.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> mode = ri.normal_modes([ri.hz(900.0)], [0.02], [[5.0]], (ri.Coordinate("tip", ri.Dof.Y),))
    >>> cut = ri.MillingProcess(ri.Cutter(2, 0.012), ri.CuttingCoefficients(7e8, 0.3), ri.Engagement.from_immersion(0.5, "down"))
    >>> tip = ri.TipModes.of({ri.Dof.Y: mode})
    >>> lobes = ri.stability_lobes(tip, cut, ri.rpm(8000, 16_000, 2000), 10e-3, ri.FullDiscretisation())
    >>> (1e3 * lobes.limit_depth).round(2).tolist()
    [0.62, 0.33, 1.25, 0.82, 0.33]
    """

    name: ClassVar[str] = MethodName.FULL_DISCRETISATION.value
    needs: ClassVar[Literal["receptance", "modes"]] = "modes"
    seconds_per_operation: ClassVar[float] = 3e-8
    gives_maps: ClassVar[bool] = True

    intervals: int | None = None
    degree: int = 6
    tolerance: float = 3e-3
    watch: Watch | None = field(default=None, repr=False, compare=False)

    def __post_init__(self) -> None:
        check_resolution(self.intervals, self.tolerance)
        if not 1 <= self.degree <= 8:
            raise InputError("degree", self.degree, "a whole number from 1 to 8")

    def monodromy(self, tip: Receptance | TipModes, process: MillingProcess) -> MonodromyOperator:
        """Return the cut's monodromy operator."""
        return MonodromyOperator(require_modes(tip, self.name), process, self.degree)

    def operations(self, process: MillingProcess, speeds: FloatArray, top: float, max_depth: float) -> FloatArray:
        """Return how often a mode is moved on to the next point of the cut, at each speed."""
        return visits(process, speeds, top, max_depth, self.degree, frozen=False)

    def lobes(self, tip: Receptance | TipModes, process: MillingProcess, speeds: FloatArray, max_depth: float) -> StabilityLobes:
        """Return the limit at each speed by itself."""
        return marched_lobes(self.monodromy(tip, process), speeds, max_depth, self.intervals, self.tolerance, self.name, self.watch)
