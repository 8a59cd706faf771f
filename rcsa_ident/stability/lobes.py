"""One verb for all lobe methods, and what they need to know of the tip."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.plausibility import CUTTING_SPEED, SEARCHED_DEPTH, SPINDLE_SPEED, remarks_of
from rcsa_ident.base.remarks import Remark
from rcsa_ident.base.units import to_rpm
from rcsa_ident.cutting.conditions import widest
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.cutting.rows import rows_of
from rcsa_ident.dynamics.coordinates import Coordinate
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.dynamics.uncertain import UncertainReceptance
from rcsa_ident.stability.axial_doubt import axial_doubt
from rcsa_ident.stability.discretisation import FullDiscretisation, SemiDiscretisation
from rcsa_ident.stability.drawn_modes import DrawnTips, drawn_tips, of_draw
from rcsa_ident.stability.methods import StabilityMethod
from rcsa_ident.stability.multi_frequency import MultiFrequency
from rcsa_ident.stability.result import StabilityLobes
from rcsa_ident.stability.time_domain import TimeDomain
from rcsa_ident.stability.tip_modes import DIRECTIONS, TIP, TipModes, fitted_modes, known_modes, receptance_of
from rcsa_ident.stability.zero_order import ZeroOrder

#: All methods by their names.
METHODS: Mapping[str, type[StabilityMethod]] = {
    ZeroOrder.name: ZeroOrder,
    MultiFrequency.name: MultiFrequency,
    SemiDiscretisation.name: SemiDiscretisation,
    FullDiscretisation.name: FullDiscretisation,
    TimeDomain.name: TimeDomain,
}
_ZERO_ORDER = ZeroOrder()
#: Machines drawn from what the records leave open, each with cutting coefficients of its own.
DRAWS = 60
#: How much deeper than asked for the zero-order method looks, for proportions.
DEEPER = 5.0
#: Between speeds at which drawn machines are asked by their own period maps, as a share.
APART = 0.015
#: Share of a drawn receptance from which on it is said that modes leave so much of it.
ROUGH_FIT = 0.05
#: Longest estimated time that one limit may take [s].
LONGEST_LIMIT = 3600.0


def method_named(name: str, field: str = "method") -> StabilityMethod:
    """Return a method with its default settings.

    `name`: one of `MethodName`
    `field`: what the user calls the name, for the error
    Raises `InputError` if there is no such method.
    """
    if name not in METHODS:
        raise InputError(field, name, f"one of {', '.join(METHODS)}")
    return METHODS[name]()


def stability_lobes(
    tip: Receptance | TipModes,
    process: MillingProcess,
    speeds: FloatArray,
    max_depth: float,
    method: StabilityMethod = _ZERO_ORDER,
    draws: int = DRAWS,
    seed: int = 1,
) -> StabilityLobes:
    """Return the stability limit of a milling cut over spindle speed.

    Parameters
    ----------
    tip : Receptance, UncertainReceptance or TipModes
        Over ``tip.x`` and ``tip.y`` (machine axes) with their cross terms; a direction that is missing is rigid. Where the cutter has a
        shape, ``tip.z`` and the slopes ``tip.x'`` and ``tip.y'`` count, too; else they are left aside. A method that needs modes gets
        those of a rational fit where a receptance is given, and its warnings say so.
    process : MillingProcess
    speeds : array, shape (n,) [rad/s]
        In any order.
    max_depth : float [m]
        Limits beyond it are not of interest; where the cutter's edge ends before, or its teeth meet, that is where the search ends.
    method : StabilityMethod, default ZeroOrder()
    draws : int
        Machines drawn from what is not known of the tip and of the cutting coefficients, where the tip is an `UncertainReceptance` with
        a spread; below 2 none are drawn.
    seed : int
        The same one draws the same machines, whatever the speeds are.

    Raises
    ------
    InputError
        If no direction of the tip is known, or a speed or the depth is not usable.

    Notes
    -----
    Drawn machines are asked by the zero-order method where that is the method, else each by its own period map (`with_own_draws`).

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> mode = ri.normal_modes([ri.hz(900.0)], [0.02], [[5.0]], (ri.Coordinate("tip", ri.Dof.Y),))
    >>> cut = ri.MillingProcess(ri.Cutter(2, 0.012), ri.CuttingCoefficients(7e8, 0.3), ri.Engagement.from_immersion(0.5, "down"))
    >>> tip = ri.TipModes.of({ri.Dof.Y: mode})
    >>> lobes = ri.stability_lobes(tip, cut, ri.rpm(8000, 16_000, 50), max_depth=10e-3)
    >>> print(lobes)
    zero-order, 8000 to 16000 rev/min, stable below 0.32 mm at any speed; best 13650 rev/min: stability limit 2.48 mm, recommended 1.23 mm
    >>> for pocket in lobes.best_speeds():
    ...     print(pocket)
    13650 rev/min: stability limit 2.48 mm, recommended 1.23 mm
    9100 rev/min: stability limit 1.66 mm, recommended 0.88 mm
    """
    unusual = unusual_speeds(process, asked_speeds(speeds)) + list(tip.remarks if isinstance(tip, TipModes) else ())
    found = limits_of(tip, process, speeds, max_depth, method, draws, seed)
    return replace(found, warnings=(*found.warnings, *unusual))


def limits_of(
    tip: Receptance | TipModes,
    process: MillingProcess,
    speeds: FloatArray,
    max_depth: float,
    method: StabilityMethod = _ZERO_ORDER,
    draws: int = DRAWS,
    seed: int = 1,
) -> StabilityLobes:
    """Return what `stability_lobes` does, without a word on what is unusual about its speeds and modes: whoever pads speeds says it."""
    speeds = asked_speeds(speeds)
    max_depth = SEARCHED_DEPTH.checked("max_depth", max_depth)
    affordable(method, tip, process, speeds, max_depth)
    within = process.within_reach(max_depth)
    # an engagement that the cutter cannot have is said before anything is computed
    widest(process.engagement, process.cutter.outline, within)
    told = f"the cutter's edge ends, or its teeth meet, at {1e3 * within:.4g} mm: no deeper cut is looked at"
    ends = () if within == max_depth else (told,)
    found = _limits(tip, process, speeds, within, method, draws, seed)
    # the smallest limit is the depth beside which a corner radius is seen
    return replace(found, warnings=(*found.warnings, *ends, *process.cutter.cylinder_remarks(float(found.nominal.min()))))


def asked_speeds(speeds: FloatArray) -> FloatArray:
    """Return spindle speeds that are possible, in their order, shape (n,) [rad/s]; the lowest and the highest are looked at."""
    speeds = np.atleast_1d(np.asarray(speeds, dtype=float))
    if speeds.ndim != 1 or speeds.size == 0:
        raise InputError("speeds", speeds.tolist(), "one or more spindle speeds [rad/s]")
    for end in (speeds.min(), speeds.max()):
        SPINDLE_SPEED.checked("speeds", float(end))
    return speeds


def affordable(method: StabilityMethod, tip: Receptance | TipModes, process: MillingProcess, speeds: FloatArray, max_depth: float) -> None:
    """Refuse a speed that is so low that its limit takes hours and all memory: both grow as it falls."""
    top = float(np.abs(tip.pole).max()) if isinstance(tip, TipModes) else float(tip.omega[-1])
    seconds = method.seconds_per_operation * method.operations(process, speeds, top, max_depth)
    slow = int(np.argmax(seconds))
    if seconds[slow] > LONGEST_LIMIT:
        faster = speeds[seconds <= LONGEST_LIMIT]
        lowest = f"{to_rpm(float(faster.min())):.0f} rev/min or more" if faster.size else "higher speeds"
        found = f"{to_rpm(float(speeds[slow])):.3g} rev/min, whose limit by {method.name} takes about {seconds[slow] / 3600.0:.2g} h"
        allowed = f"{lowest}, another method or a smaller depth: at most {LONGEST_LIMIT / 60.0:.0f} min for one limit"
        raise InputError("speeds", found, allowed)


def unusual_speeds(process: MillingProcess, speeds: FloatArray) -> list[Remark]:
    """Return what is unusual about spindle speeds [rad/s], as a wrong unit would make it."""
    ends = dict.fromkeys((float(speeds.min()), float(speeds.max())))
    found = remarks_of(("spindle speed", SPINDLE_SPEED, end) for end in ends)
    slowest = min(ends) * process.cutter.outline.largest_radius
    return [*found, *remarks_of([("cutting speed of the lowest spindle speed", CUTTING_SPEED, slowest)])]


def _limits(
    tip: Receptance | TipModes,
    process: MillingProcess,
    speeds: FloatArray,
    max_depth: float,
    method: StabilityMethod,
    draws: int,
    seed: int,
) -> StabilityLobes:
    """What `stability_lobes` returns, of the cylinder."""
    plain = process.is_plain
    both = (tip.planar if plain else tip) if isinstance(tip, TipModes) else directions_for(process, tip)
    modes = both if isinstance(both, TipModes) else None
    if isinstance(both, TipModes) or method.needs == "receptance":
        found = method.lobes(both, process, speeds, max_depth)
    else:
        modes, told = as_modes(both)
        found = method.lobes(modes, process, speeds, max_depth)
        found = replace(found, warnings=(*found.warnings, told))
    axial = "" if plain else _axial(both, process, found)
    found = replace(found, warnings=(*found.warnings, *([axial] if axial else []), *process.remarks))
    if draws < 2 or not isinstance(tip, UncertainReceptance) or not tip.complete:
        return found
    if isinstance(method, ZeroOrder):
        return replace(found, drawn=drawn_limits(tip, process, speeds, max_depth, draws, seed))
    modes = fitted_modes(directions_for(process, tip))[0] if modes is None else modes
    return with_own_draws(found, tip, modes, process, draws, seed)


def as_modes(tip: Receptance) -> tuple[TipModes, str]:
    """Return the modes that stand for a tip where a method needs them, and how well they do, in words."""
    known = known_modes(tip)
    modes, error = fitted_modes(tip) if known is None else known
    share = f"{100.0 * error:.2g}" if error > 1e-4 else "less than 0.01"
    what, noise = ("a fit with", ", noise included") if known is None else ("the assembly's own", "")
    return modes, f"the receptance was replaced by {what} {modes.pole.size} modes (relative error {share} %{noise})"


def _axial(tip: Receptance | TipModes, process: MillingProcess, found: StabilityLobes) -> str:
    """What a soft axis would change, where the tip knows X and Y alone."""
    receptance = receptance_of(tip)
    rigid = len(receptance.rows) == 2 or not np.any(receptance.values[:, 2, 2])
    return axial_doubt(receptance, process, found) if rigid and _pushes_along(process, found) else ""


def _pushes_along(process: MillingProcess, found: StabilityLobes) -> bool:
    """Whether an axial motion changes the chip: not where the edge is a wall."""
    rows = rows_of(process.cutter, process.engagement, found.max_depth, process.feed_per_tooth)
    return bool(rows.count and np.max(np.abs(np.cos(rows.kappa))) > 1e-9) and process.speed_variation is None


def drawn_limits(
    tip: UncertainReceptance, process: MillingProcess, speeds: FloatArray, max_depth: float, draws: int = DRAWS, seed: int = 1
) -> FloatArray:
    """Return the zero-order limits of tips drawn from a receptance's spread, each with coefficients of its own, shape (draws, n) [m].

    Notes
    -----
    Infinite beyond `max_depth`. They are told from a part of the frequencies: close where the tip's receptance changes from line to line,
    far apart where a quintic goes through it.
    """
    drawn = draws_of(tip, process, draws, seed)
    return _ZERO_ORDER.depths(drawn.omega, drawn.tips, process, speeds, max_depth, drawn.factors)


def with_own_draws(
    known: StabilityLobes, tip: UncertainReceptance, modes: TipModes, process: MillingProcess, draws: int = DRAWS, seed: int = 1
) -> StabilityLobes:
    """Return limits with those of the same drawn tips by their own period maps.

    Parameters
    ----------
    known : StabilityLobes
        Of the tip itself, by a method that fits the cut.
    tip : UncertainReceptance
    modes : TipModes
        That stand for it.
    process : MillingProcess
    draws, seed : int

    Notes
    -----
    Of the speeds some `APART` from each other are asked, and those where the limit is highest or lowest beside its neighbours; between
    them the ratio to the limit of the tip itself is a straight line.
    """
    drawn, speeds, deepest = draws_of(tip, process, draws, seed), known.spindle_speed, known.max_depth
    tips = drawn_tips(drawn.omega, drawn.middle, drawn.tips, modes, of_draw(process, drawn.factors, draws))
    order = np.argsort(speeds, kind="stable")
    limit = known.nominal[order]
    places = _telling(speeds[order], limit)
    own = speeds[order][places]
    # where to look first: in the proportion of the zero-order limits
    looked = [
        _ZERO_ORDER.depths(drawn.omega, each, process, own, DEEPER * deepest, factors)
        for each, factors in ((drawn.tips, drawn.factors), (drawn.middle[None], None))
    ]
    guess = in_proportion(looked[0], looked[1][0], limit[places])
    found = tips.limits(FullDiscretisation().monodromy(modes, process), own, known.limit_depth[order][places], guess, deepest)
    ratio = np.log(np.minimum(found, deepest) / limit[places])
    whole = np.array([limit * np.exp(np.interp(speeds[order], own, each)) for each in ratio])
    limits = np.empty_like(whole)
    limits[:, order] = np.where(whole < deepest * (1.0 - 1e-9), whole, np.inf)
    return replace(known, drawn=limits, warnings=(*known.warnings, *left_by_modes(tips)))


def left_by_modes(tips: DrawnTips) -> tuple[str, ...]:
    """Return a sentence where drawn machines as modes are far from their receptances."""
    rough = f"modes leave up to {100.0 * tips.error:.2g} % of the receptances of drawn machines: the band is as rough as that"
    return (rough,) if tips.error > ROUGH_FIT else ()


def _telling(speeds: FloatArray, limit: FloatArray) -> NDArray[np.intp]:
    """Places of rising speeds that tell a curve: some far apart, its peaks and valleys."""
    step = np.floor(np.log(speeds / speeds[0]) / np.log1p(APART))
    kept = np.concatenate([[True], np.diff(step) > 0.0])
    kept[-1] = True
    kept[1:-1] |= (limit[1:-1] - limit[:-2]) * (limit[2:] - limit[1:-1]) < 0.0
    return np.flatnonzero(kept)


class Draws(NamedTuple):
    """Tips drawn from a spread: frequencies, the middle (n, r, r), draws (d, n, r, r), factors of K_tc and K_rc / K_tc (d, 2) or None."""

    omega: FloatArray
    middle: ComplexArray
    tips: ComplexArray
    factors: FloatArray | None


def draws_of(tip: UncertainReceptance, process: MillingProcess, draws: int, seed: int) -> Draws:
    """Return tips drawn from a spread, in the directions that count for a cut, each with cutting coefficients of its own."""
    nodes, known = tip.thinned(), process.coefficients
    wanted = TIP if process.is_plain else known_directions(nodes)
    tips = embedded(nodes.drawn(draws, np.random.default_rng(seed)), nodes, wanted)
    factors = None
    if known.tangential_spread or known.ratio_spread:
        # from draws of their own, so that machines are the same ones whatever is known of the coefficients
        weights = np.random.default_rng([seed, 1]).standard_normal((draws, 2))
        factors = np.exp(weights * (known.tangential_spread, known.ratio_spread))
    return Draws(nodes.omega, embedded(nodes.values[None], nodes, wanted)[0], tips, factors)


def asked_directions(process: MillingProcess) -> tuple[Coordinate, ...]:
    """Return the directions of the tip that a cut asks for: X and Y along a wall, else Z and the slopes, too."""
    return TIP if process.is_plain else DIRECTIONS


def directions_for(process: MillingProcess, tip: Receptance) -> Receptance:
    """Return the tip's receptance in the directions that a cut asks for, as far as it knows them."""
    return both_directions(tip) if process.is_plain else all_directions(tip)


def both_directions(tip: Receptance) -> Receptance:
    """Return the tip's 2 x 2 receptance over ``tip.x`` and ``tip.y``; a direction that is missing is rigid."""
    if tip.rows == TIP and tip.cols == TIP:
        return tip
    return Receptance(tip.omega, embedded(tip.values, tip), TIP, TIP)


def all_directions(tip: Receptance) -> Receptance:
    """Return the tip's receptance in as many directions as it knows: 2, 3 with Z, 5 with slopes; one that is missing is rigid."""
    wanted = known_directions(tip)
    if tip.rows == wanted and tip.cols == wanted:
        return tip
    return Receptance(tip.omega, embedded(tip.values, tip, wanted), wanted, wanted)


def known_directions(tip: Receptance) -> tuple[Coordinate, ...]:
    """Return the directions that count of those that a tip's receptance has: 2, 3 with Z, 5 with slopes."""
    known = set(tip.rows) & set(tip.cols)
    return DIRECTIONS if known & set(DIRECTIONS[3:]) else DIRECTIONS[: 3 if DIRECTIONS[2] in known else 2]


def embedded(values: np.ndarray, tip: Receptance, wanted: tuple[Coordinate, ...] = TIP) -> np.ndarray:
    """Return values of a tip's receptance, shape (..., r, c), among zeros for the directions that are missing, shape (..., w, w)."""
    known = [(i, tip.rows.index(c), tip.cols.index(c)) for i, c in enumerate(wanted) if c in tip.rows and c in tip.cols]
    if not any(i < 2 for i, _, _ in known):
        found = ", ".join(str(c) for c in tip.rows)
        raise InputError("tip receptance", found, "tip.x, tip.y or both: at least one flexible direction")
    embedded = np.zeros((*values.shape[:-2], len(wanted), len(wanted)), dtype=complex)
    for i, row, _ in known:
        for j, _, col in known:
            embedded[..., i, j] = values[..., row, col]
    return embedded


def in_proportion(drawn: FloatArray, nominal: FloatArray, wanted: FloatArray) -> FloatArray:
    """Return limits that are to `wanted` as the drawn ones are to `nominal`; where one of these is infinite no proportion is known."""
    ratio = np.divide(wanted, nominal, out=np.ones(nominal.shape), where=np.isfinite(wanted) & np.isfinite(nominal))
    return np.where(np.isinf(nominal) & np.isfinite(wanted), wanted, drawn * ratio)


def uncoupled_planes(x: Receptance | None, y: Receptance | None) -> Receptance:
    """Return the tip's 2 x 2 receptance of a machine whose bending planes do not feel each other.

    `x`: with ``tip.x``, as coupling gives it for the X plane; None is a rigid direction
    `y`: with ``tip.y``, at the same frequencies
    """
    known = [h.block((c,)) for h, c in ((x, TIP[0]), (y, TIP[1])) if h is not None]
    if not known:
        raise InputError("tip receptances", "none", "at least one flexible direction")
    if len(known) == 2 and not np.array_equal(known[0].omega, known[1].omega):
        raise InputError("y receptance", f"{known[1].omega.size} frequencies", f"the {known[0].omega.size} frequencies of the x receptance")
    return both_directions(Receptance.block_diagonal(known))
