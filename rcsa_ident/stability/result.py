"""The answer of every lobe method, with the limits of possible machines and cutting coefficients."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.shown import Drawn, Shown
from rcsa_ident.base.units import to_rpm
from rcsa_ident.stability.pockets import least_within_tolerance, peaks

_ARRAYS = ("spindle_speed", "limit_depth", "chatter_frequency", "lobe", "flip")
#: What a recommendation holds back: speed right within this share, stable on this share of the possible machines and coefficients, and so
#: much of that depth kept in reserve.
TOLERANCE, PROBABILITY, RESERVE = 0.01, 0.95, 0.1


@dataclass(frozen=True, slots=True, repr=False)
class Pocket(Shown):
    """A spindle speed that allows more depth than its neighbours.

    Parameters
    ----------
    spindle_speed : float [rad/s]
    limit_depth : float [m]
        The stability limit there; infinite where the cut is stable up to the depth that was asked for.
    recommended_depth : float [m]
        The limit there less what a recommendation holds back; infinite where nothing limits the cut up to that depth, NaN where none is
        recommended.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> mode = ri.normal_modes([ri.hz(900.0)], [0.02], [[5.0]], (ri.Coordinate("tip", ri.Dof.Y),))
    >>> cut = ri.MillingProcess(ri.Cutter(2, 0.012), ri.CuttingCoefficients(7e8, 0.3), ri.Engagement.from_immersion(0.5, "down"))
    >>> tip = ri.TipModes.of({ri.Dof.Y: mode})
    >>> lobes = ri.stability_lobes(tip, cut, ri.rpm(8000, 16_000, 50), max_depth=10e-3)
    >>> pocket = lobes.best_speeds()[0]
    >>> print(pocket)
    13650 rev/min: stability limit 2.48 mm, recommended 1.23 mm
    """

    spindle_speed: float
    limit_depth: float
    recommended_depth: float

    def __str__(self) -> str:
        limit = (
            "no stability limit in the depths asked for"
            if self.limit_depth == np.inf
            else f"stability limit {1e3 * self.limit_depth:.2f} mm"
        )
        deep = f"recommended {1e3 * self.recommended_depth:.2f} mm" if np.isfinite(self.recommended_depth) else "no depth recommended"
        return f"{to_rpm(self.spindle_speed):.0f} rev/min: {limit}, {deep}"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class StabilityLobes(Drawn):
    """The smallest depth at which a cut loses stability, over spindle speed.

    Methods that march also end where a vibration grows a thousandfold before it dies away, and say so.

    Parameters
    ----------
    spindle_speed : array, shape (n,) [rad/s]
    limit_depth : array, shape (n,) [m]
        Infinite where the cut is stable up to `max_depth`.
    chatter_frequency : array, shape (n,) [rad/s]
        NaN where `limit_depth` is infinite: nothing vibrates there.
    lobe : array of int, shape (n,)
        Whole waves between two teeth; -1 where `limit_depth` is infinite.
    max_depth : float [m]
        Up to which a limit was looked for.
    method : str
        What computed it.
    absolute_limit : float or None [m]
        No speed is unstable below it; infinite if there is no such depth, None where the method does not tell it.
    absolute_frequency : float or None [rad/s]
        Chatter frequency at the absolute limit.
    warnings : tuple of str
        Why the answer may be wrong; empty where nothing is known against it.
    flip : array of bool, shape (n,), default all False
        Where stability is lost by period doubling (an eigenvalue of -1 per tooth period); elsewhere the vibration is quasi-periodic.
    drawn : array, shape (d, n) [m], or None
        Limits of machines and coefficients drawn from what is left open of them.
    withheld : str
        Why no depth is recommended from these limits; empty where one is.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> mode = ri.normal_modes([ri.hz(900.0)], [0.02], [[5.0]], (ri.Coordinate("tip", ri.Dof.Y),))
    >>> cut = ri.MillingProcess(ri.Cutter(2, 0.012), ri.CuttingCoefficients(7e8, 0.3), ri.Engagement.from_immersion(0.5, "down"))
    >>> tip = ri.TipModes.of({ri.Dof.Y: mode})
    >>> lobes = ri.stability_lobes(tip, cut, ri.rpm(8000, 16_000, 50), max_depth=10e-3)
    >>> round(1e3 * lobes.absolute_limit, 2), lobes.limit_depth.shape
    (0.32, (161,))
    >>> print(lobes.save("lobes.csv"))
    lobes.csv
    """

    spindle_speed: FloatArray
    limit_depth: FloatArray
    chatter_frequency: FloatArray
    lobe: NDArray[np.intp]
    max_depth: float
    method: str
    absolute_limit: float | None = None
    absolute_frequency: float | None = None
    warnings: tuple[str, ...] = ()
    flip: NDArray[np.bool_] = None  # type: ignore[assignment]  # all False, of the speeds' shape
    drawn: FloatArray | None = None
    withheld: str = ""

    def __post_init__(self) -> None:
        for name in ("spindle_speed", "limit_depth", "chatter_frequency"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        object.__setattr__(self, "lobe", frozen(self.lobe, np.intp))
        flip = np.zeros(self.spindle_speed.shape, dtype=bool) if self.flip is None else self.flip
        object.__setattr__(self, "flip", frozen(flip, np.bool_))
        for name in _ARRAYS[1:]:
            shape = getattr(self, name).shape
            if shape != self.spindle_speed.shape:
                raise InputError(name, shape, f"the speeds' shape, {self.spindle_speed.shape}")
        if self.drawn is not None:
            object.__setattr__(self, "drawn", frozen(self.drawn))
            if self.drawn.ndim != 2 or self.drawn.shape[0] == 0 or self.drawn.shape[1] != self.spindle_speed.size:
                raise InputError("drawn", self.drawn.shape, f"shape (draws, {self.spindle_speed.size})")

    @property
    def stable(self) -> NDArray[np.bool_]:
        """True where no limit was found up to `max_depth`, shape (n,)."""
        return np.isinf(self.limit_depth)

    @property
    def nominal(self) -> FloatArray:
        """The limit up to `max_depth`, shape (n,) [m]."""
        return np.minimum(self.limit_depth, self.max_depth)

    @property
    def band(self) -> tuple[FloatArray, FloatArray] | None:
        """Depths between which 95 % of the drawn limits lie, shape (n,) each [m], infinite beyond `max_depth`; None without them."""
        if self.drawn is None:
            return None
        limits = np.where(self.drawn > self.max_depth, np.inf, self.drawn)
        # an infinite limit has its rank like any other, but cannot be interpolated
        low, high = np.quantile(limits, (0.025, 0.975), axis=0, method="nearest")
        return low, high

    def limit_quantile(self, probability: float) -> FloatArray:
        """Return the depth up to which at least this share of the drawn machines is stable, shape (n,) [m]; 1 is what all have in common.

        Without drawn machines it is the nominal limit.

        Examples
        --------
        Of what is left open about a machine that was identified:

        >>> import rcsa_ident as ri
        >>> machine, tool = ri.read_machine("RESULT.json"), ri.sample_tooling("S3-PG25-long")
        >>> process = ri.CutSpec().process(tool.cutter, machine.workpiece)
        >>> lobes = ri.stability_lobes(machine.tip(tool), process, ri.rpm(14_000, 15_000, 500), 5e-3)
        >>> bool((lobes.limit_quantile(0.95) < lobes.limit_depth).all())
        True
        """
        return held_by(np.minimum(self.limit_depth[None] if self.drawn is None else self.drawn, self.max_depth), probability)

    def probability(self, place: int, depth: float) -> float | None:
        """Return the share of the drawn machines that are stable at a speed's place and a depth [m], or None without them.

        Raises
        ------
        InputError
            Beyond `max_depth` no limit was looked for.

        Examples
        --------
        >>> import rcsa_ident as ri
        >>> machine, tool = ri.read_machine("RESULT.json"), ri.sample_tooling("S3-PG25-long")
        >>> process = ri.CutSpec().process(tool.cutter, machine.workpiece)
        >>> lobes = ri.stability_lobes(machine.tip(tool), process, ri.rpm(14_000, 15_000, 500), 5e-3)
        >>> lobes.probability(1, 1e-3), lobes.probability(1, 3e-3)
        (1.0, 0.0)
        """
        if not 0.0 < depth <= self.max_depth:
            raise InputError("depth", depth, f"above 0 and up to {self.max_depth:g} m")
        return None if self.drawn is None else float(np.mean(self.drawn[:, place] >= depth))

    def recommended_depth(self, tolerance: float = TOLERANCE, probability: float = PROBABILITY, reserve: float = RESERVE) -> FloatArray:
        """Return the depth that is recommended at each speed, shape (n,) [m]: the limit less what is held back of it; NaN if `withheld`.

        Infinite where the limit lies beyond `max_depth`: how far one may go there was not looked for, and no depth follows from it.

        Parameters
        ----------
        tolerance : float
            The limit counts that is the lowest within this share of the speed; speeds rise.
        probability : float
            That the cut is stable, where machines were drawn.
        reserve : float
            Share of that depth that is kept in reserve.

        Examples
        --------
        >>> import rcsa_ident as ri
        >>> mode = ri.normal_modes([ri.hz(900.0)], [0.02], [[5.0]], (ri.Coordinate("tip", ri.Dof.Y),))
        >>> cut = ri.MillingProcess(ri.Cutter(2, 0.012), ri.CuttingCoefficients(7e8, 0.3), ri.Engagement.from_immersion(0.5, "down"))
        >>> tip = ri.TipModes.of({ri.Dof.Y: mode})
        >>> lobes = ri.stability_lobes(tip, cut, ri.rpm(8000, 16_000, 50), max_depth=10e-3)
        >>> round(1e3 * float(lobes.recommended_depth().max()), 2), round(1e3 * float(lobes.limit_depth.max()), 2)
        (2.0, 2.48)
        """
        if not 0.0 <= reserve < 1.0:
            raise InputError("reserve", reserve, "a share from 0 to below 1")
        if self.withheld:
            return np.full(self.spindle_speed.shape, np.nan)
        return self.searched((1.0 - reserve) * self.robust_limit(tolerance, probability), reserve)

    def robust_limit(self, tolerance: float = TOLERANCE, probability: float = PROBABILITY) -> FloatArray:
        """Return the depth that is stable within a share of each speed on this share of the drawn machines, shape (n,) [m].

        Each machine counts with its own lowest limit within the tolerance; the nominal one is never exceeded. Speeds rise.

        Examples
        --------
        >>> import rcsa_ident as ri
        >>> machine, tool = ri.read_machine("RESULT.json"), ri.sample_tooling("S3-PG25-long")
        >>> process = ri.CutSpec().process(tool.cutter, machine.workpiece)
        >>> lobes = ri.stability_lobes(machine.tip(tool), process, ri.rpm(14_000, 15_000, 100), 5e-3)
        >>> bool((lobes.robust_limit() <= lobes.limit_quantile(0.95)).all())
        True
        """
        least = least_within_tolerance(self.spindle_speed, self.nominal, tolerance)
        if self.drawn is None:
            return least
        drawn = np.minimum(self.drawn, self.max_depth)
        each = np.array([least_within_tolerance(self.spindle_speed, limit, tolerance) for limit in drawn])
        return np.minimum(least, held_by(each, probability))

    def searched(self, depth: FloatArray, reserve: float = 0.0) -> FloatArray:
        """Return depths with infinity in place of what is as deep as the search went, less a reserve: no limit was found there."""
        return np.where(depth < (1.0 - reserve) * self.max_depth * (1.0 - 1e-12), depth, np.inf)

    def best_speeds(self, count: int = 3, recommended: FloatArray | None = None) -> list[Pocket]:
        """Return the speeds with the highest limits, one for each pocket of the lobes, the highest first.

        Parameters
        ----------
        count : int
            At most so many. The middle of a range that is stable up to `max_depth` stands for it.
        recommended : array, shape (n,) [m], default `recommended_depth`
            At rising speeds.

        Examples
        --------
        >>> import rcsa_ident as ri
        >>> mode = ri.normal_modes([ri.hz(900.0)], [0.02], [[5.0]], (ri.Coordinate("tip", ri.Dof.Y),))
        >>> cut = ri.MillingProcess(ri.Cutter(2, 0.012), ri.CuttingCoefficients(7e8, 0.3), ri.Engagement.from_immersion(0.5, "down"))
        >>> tip = ri.TipModes.of({ri.Dof.Y: mode})
        >>> lobes = ri.stability_lobes(tip, cut, ri.rpm(8000, 16_000, 50), max_depth=10e-3)
        >>> print(lobes.best_speeds(count=1)[0])
        13650 rev/min: stability limit 2.48 mm, recommended 1.23 mm
        """
        lobes = self.ordered()
        recommended = lobes.recommended_depth() if recommended is None else recommended
        found, speeds = [], lobes.spindle_speed
        for speed, limit in peaks(speeds, lobes.limit_depth, count):
            # a plateau's middle lies on a speed or between two, where an infinite depth cannot be interpolated
            beside = np.searchsorted(speeds, speed, "right") - 1, np.searchsorted(speeds, speed)
            found.append(Pocket(speed, limit, min(float(recommended[place]) for place in beside)))
        return found

    def ordered(self) -> StabilityLobes:
        """Return the same with rising speeds."""
        return self.at_places(np.argsort(self.spindle_speed, kind="stable"))

    def between(self, low: float, high: float) -> StabilityLobes:
        """Return the part within a range of speeds [rad/s].

        Examples
        --------
        >>> import rcsa_ident as ri
        >>> mode = ri.normal_modes([ri.hz(900.0)], [0.02], [[5.0]], (ri.Coordinate("tip", ri.Dof.Y),))
        >>> cut = ri.MillingProcess(ri.Cutter(2, 0.012), ri.CuttingCoefficients(7e8, 0.3), ri.Engagement.from_immersion(0.5, "down"))
        >>> tip = ri.TipModes.of({ri.Dof.Y: mode})
        >>> lobes = ri.stability_lobes(tip, cut, ri.rpm(8000, 16_000, 50), max_depth=10e-3)
        >>> print(lobes.between(ri.rpm(8000), ri.rpm(10_000)).best_speeds()[0])
        9100 rev/min: stability limit 1.66 mm, recommended 0.88 mm
        """
        # the last digit of a speed that was written in rev/min is nobody's wish
        inside = (self.spindle_speed >= low * (1.0 - 1e-9)) & (self.spindle_speed <= high * (1.0 + 1e-9))
        return self.at_places(np.flatnonzero(inside))

    def at_places(self, places: NDArray[np.intp]) -> StabilityLobes:
        """Return the part at some of the speeds' places."""
        drawn = None if self.drawn is None else self.drawn[:, places]
        return replace(self, **{name: getattr(self, name)[places] for name in _ARRAYS}, drawn=drawn)

    @classmethod
    def joined(cls, parts: Sequence[StabilityLobes], places: Sequence[NDArray[np.intp]]) -> StabilityLobes:
        """Return the lobes of several blocks of speeds as one, each speed back in its place; drawn limits if all blocks have them."""
        back = np.argsort(np.concatenate(places))
        arrays = {name: np.concatenate([getattr(part, name) for part in parts])[back] for name in _ARRAYS}
        lowest = min(parts, key=lambda part: np.inf if part.absolute_limit is None else part.absolute_limit)
        drawn = [part.drawn for part in parts if part.drawn is not None]
        return cls(
            **arrays,
            max_depth=parts[0].max_depth,
            method=parts[0].method,
            absolute_limit=lowest.absolute_limit,
            absolute_frequency=lowest.absolute_frequency,
            warnings=tuple(dict.fromkeys(warning for part in parts for warning in part.warnings)),
            drawn=np.concatenate(drawn, axis=1)[:, back] if len(drawn) == len(parts) else None,
            withheld=next((part.withheld for part in parts if part.withheld), ""),
        )

    def __str__(self) -> str:
        if self.spindle_speed.size == 0:
            return f"{self.method}, no speeds"
        low, high = (to_rpm(float(speed)) for speed in (self.spindle_speed.min(), self.spindle_speed.max()))
        known = self.absolute_limit is not None and np.isfinite(self.absolute_limit)
        anywhere = f", stable below {1e3 * (self.absolute_limit or 0.0):.2f} mm at any speed" if known else ""
        best = self.best_speeds(1)
        return f"{self.method}, {low:.0f} to {high:.0f} rev/min{anywhere}" + (f"; best {best[0]}" if best else "")


def held_by(limits: FloatArray, probability: float) -> FloatArray:
    """The depth up to which at least this share of some limits, shape (d, n), is stable, shape (n,)."""
    if not 0.0 < probability <= 1.0:
        raise InputError("probability", probability, "above 0 and not above 1")
    return np.sort(limits, axis=0)[int((1.0 - probability) * limits.shape[0] + 1e-9)]
