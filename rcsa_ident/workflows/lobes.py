"""From what the tip answers to stability lobes, with bands and the speeds that allow most."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from rcsa_ident.arrays import ComplexArray, FloatArray
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.modal import ModalModel
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.errors import InputError
from rcsa_ident.stability.full_discretisation import FullDiscretisation
from rcsa_ident.stability.lobes import StabilityMethod, stability_lobes, uncoupled_planes
from rcsa_ident.stability.result import StabilityLobes
from rcsa_ident.stability.semi_discretisation import SemiDiscretisation
from rcsa_ident.stability.time_domain import TimeDomain
from rcsa_ident.stability.tip_modes import TipModes, fitted_modes
from rcsa_ident.stability.zero_order import ZeroOrder
from rcsa_ident.workflows.tip import TooltipResponse

#: Two peaks are one pocket unless the limit between them falls below this share of the lower one.
POCKET = 0.85
#: Methods that march through time: they take modes.
MARCHING = (SemiDiscretisation, FullDiscretisation, TimeDomain)


@dataclass(frozen=True, slots=True)
class LobeConditions:
    """What a stability limit is asked for.

    Parameters
    ----------
    process : MillingProcess
    speeds : array, shape (n,) [rad/s]
    max_depth : float [m]
    method : StabilityMethod
    """

    process: MillingProcess
    speeds: FloatArray
    max_depth: float
    method: StabilityMethod = field(default_factory=ZeroOrder)

    def lobes(self, tip: Receptance | TipModes) -> StabilityLobes:
        """Return the lobes for the tip's 2 x 2 receptance or modes; a method that needs modes gets those of a fit, and says so."""
        if isinstance(tip, TipModes) or not isinstance(self.method, MARCHING):
            return stability_lobes(tip, self.process, self.speeds, self.max_depth, self.method)
        modes, error = fitted_modes(tip)
        found = stability_lobes(modes, self.process, self.speeds, self.max_depth, self.method)
        share = f"{100.0 * error:.2g}" if error > 1e-4 else "less than 0.01"
        told = f"the receptance was fitted with {modes.pole.size} modes, {share} % beside it"
        return replace(found, warnings=(*found.warnings, told))


def tooling_lobes(response: TooltipResponse, conditions: LobeConditions) -> StabilityLobes:
    """Return the lobes of a tooling on an identified machine, whose planes do not feel each other."""
    return conditions.lobes(uncoupled_planes(response.coupled.get(Dof.X), response.coupled.get(Dof.Y)))


def lobe_bands(
    response: TooltipResponse, conditions: LobeConditions, draws: int = 60, seed: int = 1
) -> tuple[FloatArray, FloatArray] | None:
    """Return the limit depths between which 95 % of the machines lie that the records allow, or None without a posterior.

    Parameters
    ----------
    response : TooltipResponse
        With its spread.
    draws : int
        Receptances drawn from it, the axes independently of each other.
    seed : int

    Returns
    -------
    (array, array), shape (n,) each [m]
        Infinite where the cut is stable up to the depth that was asked for.
    """
    limits = drawn_limits(response, conditions, draws, seed)
    if limits is None:
        return None
    # an infinite limit has its rank like any other, but can't be interpolated
    low, high = np.quantile(limits, (0.025, 0.975), axis=0, method="nearest")
    return low, high


def stability_probability(
    response: TooltipResponse, conditions: LobeConditions, depths: FloatArray, draws: int = 200, seed: int = 1
) -> FloatArray | None:
    """Return how probable it is that cuts are stable, or None without a posterior: the share of the machines that the records allow.

    Parameters
    ----------
    response : TooltipResponse
        With its spread.
    conditions : LobeConditions
        Its speeds are those of the cuts.
    depths : array, shape (d,) or (d, n) [m]
        The same at every speed, or one for each; up to the largest depth of the conditions.
    draws : int
        Receptances drawn from the posterior, the axes independently of each other: the answer is good to about 1 / (2 sqrt(draws)).
    seed : int

    Returns
    -------
    array, shape (d, n)
        From 0 to 1, at each speed never more at the larger of two depths.
    """
    depths = np.asarray(depths, dtype=float)
    depths = depths[:, None] if depths.ndim == 1 else depths
    if not np.all((depths > 0.0) & (depths <= conditions.max_depth)):
        raise InputError("depths", depths.ravel().tolist(), f"above 0 and up to {conditions.max_depth:g} m")
    limits = drawn_limits(response, conditions, draws, seed)
    return None if limits is None else np.mean(limits[:, None, :] > depths, axis=0)


def drawn_limits(response: TooltipResponse, conditions: LobeConditions, draws: int, seed: int) -> FloatArray | None:
    """Return the limits of machines drawn from the posterior, shape (draws, n) [m], or None without one.

    The same seed draws the same machines, whatever the speeds are.
    """
    if draws < 2 or any(axis not in response.spread for axis in response.coupled):
        return None
    rng = np.random.default_rng(seed)
    steps: dict[Dof, list[FloatArray]] = {axis: [] for axis in response.coupled}
    for _ in range(draws):
        for axis, kept in steps.items():
            kept.append(rng.standard_normal(response.spread[axis].shape[:1]))
    drawn = {axis: response.tip(axis) + _real_times(np.array(kept), response.spread[axis]) for axis, kept in steps.items()}
    omega = next(iter(response.coupled.values())).omega
    if isinstance(conditions.method, ZeroOrder):
        rigid = np.zeros((draws, omega.size), dtype=complex)
        tips = (drawn.get(Dof.X, rigid), drawn.get(Dof.Y, rigid))
        return conditions.method.depths(omega, tips, conditions.process, conditions.speeds, conditions.max_depth)
    limits = np.empty((draws, conditions.speeds.size))
    for i in range(draws):
        curves = {axis: (omega / (2.0 * np.pi), tips[i]) for axis, tips in drawn.items()}
        limits[i] = conditions.lobes(measured_tip(curves)).limit_depth
    return limits


def _real_times(weights: FloatArray, curves: ComplexArray) -> ComplexArray:
    """Return weights @ curves without making the weights complex first, shapes (d, p), (p, n) -> (d, n)."""
    parts = np.ascontiguousarray(curves).view(float)
    found: ComplexArray = (weights @ parts).view(complex)
    return found


def best_speeds(lobes: StabilityLobes, count: int = 3) -> list[tuple[float, float]]:
    """Return the speeds that allow the largest depths, one for each pocket of the lobes, the best first.

    Parameters
    ----------
    lobes : StabilityLobes
    count : int
        At most so many.

    Returns
    -------
    list of (float, float) [rad/s, m]
        Peaks of the limit; the middle of a range that is stable up to the depth that was asked for, with an infinite limit.
    """
    return peaks(lobes.spindle_speed, lobes.limit_depth, count)


def peaks(speed: FloatArray, level: FloatArray, count: int = 3) -> list[tuple[float, float]]:
    """Return the speeds at which a level is highest, one for each pocket, the best first.

    Parameters
    ----------
    speed, level : array, shape (n,)
        In any order; an infinite level is one, too.
    count : int
        At most so many.

    Returns
    -------
    list of (float, float)
        Speed and level of the peaks; the middle of a plateau.
    """
    order = np.argsort(speed)
    speed, limit = np.asarray(speed)[order], np.asarray(level)[order]
    edges = np.flatnonzero(np.concatenate([[True], limit[1:] != limit[:-1]]))
    ends = np.concatenate([edges[1:], [limit.size]]) - 1
    level = limit[edges]
    outside = np.concatenate([[-np.inf], level, [-np.inf]])
    tops = [k for k in range(level.size) if level[k] > outside[k] and level[k] > outside[k + 2]]
    width = speed[ends] - speed[edges]
    tops.sort(key=lambda k: (-level[k], -width[k]))
    chosen: list[int] = []
    for k in tops:
        # an infinite limit and its neighbour are pockets of their own: something finite lies between them
        if all(np.min(level[min(k, c) : max(k, c) + 1]) < POCKET * level[k] for c in chosen):
            chosen.append(k)
    return [(float(0.5 * (speed[edges[k]] + speed[ends[k]])), float(level[k])) for k in chosen[:count]]


def modal_tip(models: Mapping[Dof, ModalModel]) -> Receptance:
    """Return the tip's 2 x 2 receptance of a modal model, at frequencies that resolve its sharpest mode.

    Parameters
    ----------
    models : mapping of Dof to ModalModel
        With ``tip.x``, ``tip.y``; a direction that is missing is rigid.
    """
    return TipModes.of(models).receptance()


def receptance_from_dc(modes: TipModes) -> Receptance:
    """Return the receptance of modes from 0 Hz to four times the highest, at frequencies that resolve the sharpest."""
    fine = modes.receptance().omega
    omega = np.arange(0.0, 2.0 * fine[-1], fine[1] - fine[0])
    tip = (Coordinate("tip", Dof.X), Coordinate("tip", Dof.Y))
    return Receptance(omega, modes.response(omega), tip, tip)


def measured_tip(
    curves: Mapping[Dof, tuple[FloatArray, ComplexArray]], cross: Mapping[tuple[Dof, Dof], tuple[FloatArray, ComplexArray]] | None = None
) -> Receptance:
    """Return the tip's 2 x 2 receptance of measured FRFs.

    Parameters
    ----------
    curves : mapping of Dof to (frequency [Hz], values [m/N])
        A direction that is missing is rigid.
    cross : mapping of (response, force) to (frequency [Hz], values [m/N]), optional
        Of two directions that are both there; one of the two stands for the other, too, as Maxwell's reciprocity has it.
    """
    planes = {}
    for axis, (frequency, values) in curves.items():
        tip = (Coordinate("tip", axis),)
        planes[axis] = Receptance(2.0 * np.pi * frequency, np.asarray(values)[:, None, None], tip, tip)
    both = uncoupled_planes(planes.get(Dof.X), planes.get(Dof.Y))
    if not cross:
        return both
    missing = [axis for axis in (Dof.X, Dof.Y) if axis not in planes]
    if missing:
        raise InputError("cross FRF", f"one without an FRF in {missing[0].upper()}", "FRFs in both directions beside it")
    full = both.values.copy()
    places = {Dof.X: 0, Dof.Y: 1}
    for (response, force), (frequency, values) in cross.items():
        if not np.array_equal(2.0 * np.pi * frequency, both.omega):
            raise InputError("cross FRF", f"{np.size(frequency)} frequencies", f"the {both.omega.size} frequencies of the direct FRFs")
        full[:, places[response], places[force]] = values
        if (force, response) not in cross:
            full[:, places[force], places[response]] = values
    return Receptance(both.omega, full, both.rows, both.cols)


def band_warning(lobes: StabilityLobes, band_hz: tuple[float, float]) -> str | None:
    """Return a sentence where the limiting vibration lies outside the identified band, else None."""
    frequency = lobes.chatter_frequency[np.isfinite(lobes.chatter_frequency)] / (2.0 * np.pi)
    outside = (frequency < band_hz[0]) | (frequency > band_hz[1])
    if not outside.any():
        return None
    worst = float(frequency[outside][np.argmax(np.abs(frequency[outside] - np.mean(band_hz)))])
    return (
        f"at {int(outside.sum())} of {lobes.spindle_speed.size} speeds chatter is expected outside the identified band "
        f"{band_hz[0]:.0f}-{band_hz[1]:.0f} Hz (as far as {worst:.0f} Hz): the machine is extrapolated there"
    )
