"""Zero-order (single-frequency) stability limit."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import to_rpm
from rcsa_ident.cutting.conditions import same_everywhere
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.directional import mean_directional_matrix
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.stability._kernels.depth_at_speed import envelope, envelopes, largest_real_part, pitch_envelope
from rcsa_ident.stability.depth_march import Marched, finer, ladder, march, strengths
from rcsa_ident.stability.methods import MethodName
from rcsa_ident.stability.regeneration import check_constant, regeneration
from rcsa_ident.stability.result import StabilityLobes
from rcsa_ident.stability.tip_modes import DIRECTIONS, TipModes, receptance_of

#: Teeth in the cut, on average, below which the mean directional matrix no longer tells the whole story.
FEWEST_TEETH_IN_CUT = 1.0
#: Unequal pitch asks each speed at all frequencies: so many times as much.
_PITCH_FACTOR = 30.0
#: Operations of a march through depths.
_MARCH = 2500.0
#: How many times as long as the tip remembers a vibration the next tooth may take: about from there on one grew a thousandfold before it
#: died away, in cuts with one mode by full discretisation. Where the tip is asked, as shares of the critical frequency.
_FORGOTTEN, _BELOW, _ABOVE = 8.0, 0.8, 1.1
#: Difference of pitches up to which teeth are alike [rad].
_ALIKE = 1e-9
#: Times the limit of a tip up to which those of others like it are looked for.
_OVER = 1.5


@dataclass(frozen=True, slots=True)
class ZeroOrder:
    """The closed form of Altintas and Budak [altintas1995], with cross receptances.

    F = a K_tc [alpha0] (1 - e^{-i w tau}) G(w) F with the mean directional matrix [alpha0]: at each frequency the two
    eigenvalues mu of [alpha0] G give the boundary a = 1 / (2 K_tc Re mu) at w tau = pi + 2 arg mu + 2 pi l. Between the
    given frequencies trace and determinant of [alpha0] G are interpolated by quintics. Unequal pitch replaces
    1 - e^{-i w tau} by its mean over the teeth [altintas1999] and costs
    speeds times frequencies; limits can be twice as high as the true ones there, so that no depth is recommended from them.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> mode = ri.normal_modes([ri.hz(900.0)], [0.02], [[5.0]], (ri.Coordinate("tip", ri.Dof.Y),))
    >>> cut = ri.MillingProcess(ri.Cutter(2, 0.012), ri.CuttingCoefficients(7e8, 0.3), ri.Engagement.from_immersion(0.5, "down"))
    >>> tip = ri.TipModes.of({ri.Dof.Y: mode})
    >>> lobes = ri.stability_lobes(tip, cut, ri.rpm(8000, 16_000, 2000), 10e-3, ri.ZeroOrder())
    >>> (1e3 * lobes.limit_depth).round(2).tolist()
    [0.58, 0.32, 1.14, 0.81, 0.32]
    """

    name: ClassVar[str] = MethodName.ZERO_ORDER.value
    needs: ClassVar[Literal["receptance", "modes"]] = "receptance"
    seconds_per_operation: ClassVar[float] = 2e-5
    gives_maps: ClassVar[bool] = False

    def operations(self, process: MillingProcess, speeds: FloatArray, top: float, max_depth: float) -> FloatArray:
        """Return how many lobes stand above each speed, over those at 4000 rev/min; with unequal pitch all frequencies are asked.

        Of a shape the march through its depths costs as much for one speed as for many, with unlike teeth for each of them.
        """
        if not process.is_plain:
            return np.full(speeds.size, _MARCH / (speeds.size if process.cutter.equally_spaced else 1.0))
        return (1.0 if _equal_pitch(process) else _PITCH_FACTOR) * 4000.0 / to_rpm(speeds)

    def lobes(self, tip: Receptance | TipModes, process: MillingProcess, speeds: FloatArray, max_depth: float) -> StabilityLobes:
        """Return the lower envelope of all lobes in the range of `speeds`."""
        if not process.is_plain:
            return self._marched(receptance_of(tip), process, speeds, max_depth)
        cutter, coefficients = process.cutter, process.coefficients
        receptance = receptance_of(tip)
        omega, trace, determinant = _characteristic(receptance, _directions(process))
        order = np.argsort(speeds, kind="stable")
        ascending = np.ascontiguousarray(speeds[order])
        if _equal_pitch(process):
            curve = envelope(omega, trace, determinant, coefficients.tangential, cutter.teeth, ascending)
        else:
            curve = pitch_envelope(omega, trace, determinant, coefficients.tangential, cutter.pitch, ascending)
        beyond = ~(curve[0] <= max_depth)
        limit = np.empty(speeds.size)
        chatter = np.empty(speeds.size)
        lobe = np.empty(speeds.size, dtype=np.intp)
        limit[order] = np.where(beyond, np.inf, curve[0])
        chatter[order] = np.where(beyond, np.nan, curve[1])
        lobe[order] = np.where(beyond, -1, curve[2])
        strongest, place = largest_real_part(omega, trace, determinant)
        exists = strongest > 1e-12 * float(np.max(np.abs(trace)))
        absolute = 1.0 / (2.0 * coefficients.tangential * strongest) if exists else np.inf
        found = Marched(limit, chatter, lobe, absolute, place if exists else np.nan)
        return self._answer(found, receptance, process, speeds, max_depth)

    def strength(self, tip: Receptance | TipModes, process: MillingProcess, speed: float, depth: float, most: float) -> tuple[float, float]:
        """Return how many times stronger the material may be in a cut of one depth [m], and how it vibrates then [rad/s].

        The mean stiffness is proportional to the strength, which is marched through as depths are.
        """
        check_constant(process)
        receptance = receptance_of(tip)
        found = march(*finer(receptance), process, strengths(process, receptance.values.shape[1], depth, most), np.array([speed]))
        return float(found.limit[0]), float(found.chatter[0])

    def _marched(self, receptance: Receptance, process: MillingProcess, speeds: FloatArray, max_depth: float) -> StabilityLobes:
        """Return the limits of a cut whose mean stiffness is not proportional to the depth."""
        check_constant(process)
        directions = receptance.values.shape[1]
        found = march(*finer(receptance), process, ladder(process, directions, max_depth), speeds)
        return self._answer(found, receptance, process, speeds, max_depth)

    def _answer(
        self, found: Marched, receptance: Receptance, process: MillingProcess, speeds: FloatArray, max_depth: float
    ) -> StabilityLobes:
        """Return limits with what speaks against them; the absolute limit is that of equal teeth, and others have limits below it."""
        unlike, critical = _unlike_teeth(process), found.frequency if np.isfinite(found.absolute) else None
        return StabilityLobes(
            speeds,
            found.limit,
            found.chatter,
            found.lobe,
            max_depth,
            self.name,
            absolute_limit=None if unlike else float(found.absolute),
            absolute_frequency=None if unlike else critical,
            warnings=(*([unlike] if unlike else []), *_doubts(process, receptance, critical, speeds)),
            withheld=unlike,
        )

    def _marched_depths(
        self,
        omega: FloatArray,
        tips: ComplexArray,
        process: MillingProcess,
        speeds: FloatArray,
        max_depth: float,
        factors: FloatArray | None,
    ) -> FloatArray:
        """Return what `depths` does for a shaped cut; its ladder is linear in K_tc and in k_rc."""
        check_constant(process)
        directions = tips.shape[-1]
        whole, half = (ladder(each, directions, max_depth) for each in (process, _half_ratio(process)))
        names = DIRECTIONS[:directions]
        limits = []
        for k, values in enumerate(tips):
            stiffness, ratio = (1.0, 1.0) if factors is None else factors[k]
            own = stiffness * (whole.stiffness + 2.0 * (ratio - 1.0) * (whole.stiffness - half.stiffness))
            drawn = finer(Receptance(omega, values, names, names))
            limits.append(march(*drawn, process, whole._replace(stiffness=own), speeds).limit)
        return np.array(limits)

    def depths(
        self,
        omega: FloatArray,
        tips: ComplexArray,
        process: MillingProcess,
        speeds: FloatArray,
        max_depth: float,
        factors: FloatArray | None = None,
    ) -> FloatArray:
        """Return the limits of many tips, as `lobes` does for each of them.

        Parameters
        ----------
        omega : array, shape (n,) [rad/s]
        tips : complex array, shape (d, n, r, r) [m/N]
            The receptances in X and Y, and further directions where the cut is not plain; a rigid direction is zero.
        speeds : array, shape (m,) [rad/s]
            In any order.
        factors : array, shape (d, 2) [-], or None
            On K_tc and k_rc of the cut with each tip.

        Returns
        -------
        array, shape (d, m) [m]
            Infinite beyond `max_depth`.
        """
        if not process.is_plain:
            return self._marched_depths(omega, tips, process, speeds, max_depth, factors)
        kept, order = _above_rest(omega), np.argsort(speeds, kind="stable")
        loop = _Loop(process.cutter, process.coefficients.tangential, _directions(process), _of_ratio(process))
        found = loop.limits(omega[kept], tips[:, kept], np.ascontiguousarray(speeds[order]), factors)
        limits = np.empty(found.shape)
        limits[:, order] = np.where(found <= max_depth, found, np.inf)
        return limits

    def shares(
        self, middle: Receptance, tips: ComplexArray, process: MillingProcess, speed: float, depth: float, factors: FloatArray | None = None
    ) -> tuple[float, FloatArray]:
        """Return the margin of a cut on the tip in the middle of many, and what the limits of these are beside its limit.

        Parameters
        ----------
        middle : Receptance
            In the directions that count for the cut.
        tips : complex array, shape (d, n, r, r) [m/N]
            At its frequencies, in these directions or in X and Y alone.
        speed : float [rad/s]
        depth : float [m]
            Of a cut that changes along the edge: there it is the strength of the material that has a limit, and X and Y alone count.
        factors : array, shape (d, 2) [-], or None
            On K_tc and k_rc of the cut with each tip.

        Returns
        -------
        float
            The limit over the depth, or how many times stronger the material may be; infinite where there is none.
        array, shape (d,)
            Ones where the middle has no limit; infinite where a tip has none below `_OVER` times that of the middle: frequencies whose
            boundary lies above that, whatever the speed, take no part.
        """
        at, kept = np.array([speed]), slice(_above_rest(middle.omega)[0], None)
        omega, center, tips = middle.omega[kept], middle.values[None, kept, :2, :2], tips[:, kept, :2, :2]
        if process.is_plain:
            loop = _Loop(process.cutter, process.coefficients.tangential, _directions(process), _of_ratio(process))
        else:
            matrix, half = (regeneration(each, depth, 2).mean for each in (process, _half_ratio(process)))
            loop = _Loop(process.cutter, 1.0, matrix, 2.0 * (matrix - half))
        limit = float(loop.limits(omega, center, at)[0, 0])
        if not np.isfinite(limit):
            return np.inf, np.ones(len(tips))
        found = np.full(len(tips), np.inf)
        for run in _runs(loop.boundary(center[0]) < _OVER * limit):
            found = np.minimum(found, loop.limits(omega[run], tips[:, run], at, factors)[:, 0] / limit)
        return limit / depth if process.is_plain else limit, found


@dataclass(frozen=True, slots=True, eq=False)
class _Loop:
    """A cut whose mean stiffness in X and Y is proportional to what has a limit.

    `stiffness`: factor on both matrices
    `matrix`, `change`, shape (2, 2): the mean stiffness of 1 - e^{-i w tau}, and what of it is in proportion to k_rc
    """

    cutter: Cutter
    stiffness: float
    matrix: FloatArray
    change: FloatArray

    def boundary(self, tip: ComplexArray) -> FloatArray:
        """Return the lowest boundary at each frequency of a tip, shape (n, 2, 2), whatever the speed; infinite where there is none."""
        loop = self.stiffness * self.matrix @ tip
        half = 0.5 * np.einsum("nii->n", loop)
        root = np.sqrt(half**2 - loop[:, 0, 0] * loop[:, 1, 1] + loop[:, 0, 1] * loop[:, 1, 0])
        strongest = np.maximum((half + root).real, (half - root).real)
        return np.divide(0.5, strongest, out=np.full(strongest.shape, np.inf), where=strongest > 0.0)

    def limits(self, omega: FloatArray, tips: ComplexArray, speeds: FloatArray, factors: FloatArray | None = None) -> FloatArray:
        """Return the limits of many tips, shape (d, m), infinite where there is none.

        `omega`, shape (n,): above 0; `tips`, shape (d, n, 2, 2)
        `speeds`, shape (m,): rising
        `factors`, shape (d, 2), or None: on K_tc and k_rc with each tip
        """
        alpha = np.repeat(self.matrix[None], len(tips), axis=0)
        if factors is not None:
            alpha += (factors[:, 1] - 1.0)[:, None, None] * self.change
        omega = np.ascontiguousarray(omega)
        x, y = (np.ascontiguousarray(tips[:, :, i, i]) for i in range(2))
        xy, yx = tips[:, :, 0, 1], tips[:, :, 1, 0]
        teeth, pitch, equal = self.cutter.teeth, self.cutter.pitch, bool(np.ptp(self.cutter.pitch) < _ALIKE)
        if equal and not np.any(xy) and not np.any(yx):
            found = envelopes(omega, x, y, alpha, self.stiffness, teeth, speeds)
        else:
            xx, down, up, yy = alpha.reshape(-1, 4).T[:, :, None]
            traces = xx * x + down * yx + up * xy + yy * y
            determinants = (xx * yy - down * up) * (x * y - xy * yx)
            _finite(traces, determinants)
            each = zip(traces, determinants, strict=True)
            if equal:
                found = np.array([envelope(omega, t, d, self.stiffness, teeth, speeds)[0] for t, d in each])
            else:
                found = np.array([pitch_envelope(omega, t, d, self.stiffness, pitch, speeds)[0] for t, d in each])
        _finite(np.where(np.isinf(found), 0.0, found))
        return found if factors is None else found / factors[:, :1]


def _runs(there: NDArray[np.bool_]) -> list[slice]:
    """Return the runs of places where something is so, with a neighbour on either side."""
    wide = there | np.concatenate([there[1:], [False]]) | np.concatenate([[False], there[:-1]])
    ends = np.flatnonzero(np.diff(np.concatenate([[False], wide, [False]]).astype(int)))
    return [slice(int(first), int(last)) for first, last in ends.reshape(-1, 2)]


def _directions(process: MillingProcess) -> FloatArray:
    """[alpha0] of a cut at constant speed."""
    check_constant(process)
    return mean_directional_matrix(process.cutter.teeth, same_everywhere(process.engagement), process.coefficients, process.feed_angle)


def _of_ratio(process: MillingProcess) -> FloatArray:
    """What of [alpha0] is in proportion to k_rc."""
    return 2.0 * (_directions(process) - _directions(_half_ratio(process)))


def _half_ratio(process: MillingProcess) -> MillingProcess:
    """The cut with half of k_rc."""
    known = process.coefficients
    return replace(process, coefficients=replace(known, radial_ratio=0.5 * known.radial_ratio))


def _equal_pitch(process: MillingProcess) -> bool:
    return bool(np.ptp(process.cutter.pitch) < _ALIKE)


def _characteristic(receptance: Receptance, alpha: FloatArray) -> tuple[FloatArray, ComplexArray, ComplexArray]:
    """Frequencies above zero, ascending, with trace and determinant of [alpha0] G."""
    xx, xy = receptance.between("tip.x", "tip.x"), receptance.between("tip.x", "tip.y")
    yx, yy = receptance.between("tip.y", "tip.x"), receptance.between("tip.y", "tip.y")
    kept = _above_rest(receptance.omega)
    trace = (alpha[0, 0] * xx + alpha[0, 1] * yx + alpha[1, 0] * xy + alpha[1, 1] * yy)[kept]
    determinant = _determinant(alpha) * (xx * yy - xy * yx)[kept]
    _finite(trace, determinant)
    return np.ascontiguousarray(receptance.omega[kept]), np.ascontiguousarray(trace), np.ascontiguousarray(determinant)


def _determinant(alpha: FloatArray) -> float:
    return float(alpha[0, 0] * alpha[1, 1] - alpha[0, 1] * alpha[1, 0])


def _above_rest(omega: FloatArray) -> NDArray[np.intp]:
    """The places of frequencies above zero, which ascend."""
    kept = np.flatnonzero(omega > 0.0)
    if kept.size < 2 or np.any(np.diff(omega[kept]) <= 0.0):
        raise InputError("tip receptance frequencies", f"{omega.size} frequencies", "two or more above 0, ascending")
    return kept


def _finite(*values: ComplexArray | FloatArray) -> None:
    if not all(np.all(np.isfinite(each)) for each in values):
        raise InputError("tip receptance", "values that are not finite", "finite values at every frequency above 0")


def _unlike_teeth(process: MillingProcess) -> str:
    """Why no depth is recommended for teeth that are not alike; empty where they are."""
    told = []
    if not _equal_pitch(process):
        told.append(
            f"unequal pitch ({'/'.join(f'{angle:.4g}' for angle in np.degrees(process.cutter.pitch))} degrees) is taken as the mean of its "
            "delays: limits can be twice as high as the true ones"
        )
    if np.ndim(process.cutter.helix) > 0:
        helix = "/".join(f"{angle:.4g}" for angle in np.degrees(process.cutter.helices))
        told.append(f"unequal helix ({helix} degrees) is taken as the mean of its delays: limits are 0.75 to 2.3 times the true ones")
    if process.cutter.offset:
        told.append(
            "that teeth cut what those before the last one left is left out"
            if process.cutter.serration is not None
            else "run-out is left out: the limit is that of equal teeth"
        )
    return f"{'; '.join(told)}; no depth is recommended from zero-order limits: full-discretisation takes unlike teeth" if told else ""


def _doubts(process: MillingProcess, receptance: Receptance, critical: float | None, speeds: FloatArray) -> list[str]:
    cutter, engagement = process.cutter, process.widest
    doubts = []
    in_cut = cutter.teeth * (engagement.exit - engagement.entry) / (2.0 * np.pi)
    if in_cut < FEWEST_TEETH_IN_CUT - 1e-9:
        angle = np.degrees(engagement.exit - engagement.entry)
        doubts.append(
            f"interrupted cut: {in_cut:.2f} teeth in the cut on average ({cutter.teeth} teeth, {angle:.0f} degrees of engagement); it has "
            "moved limits, and at low immersion period-doubling (flip) lobes, that the mean directional coefficients do not show: "
            "multi-frequency and full-discretisation do"
        )
    if process.damping is not None:
        doubts.append("process damping is left out: the limit is too low at low speeds")
    if critical is not None:
        doubts += _band_doubts(receptance, critical)
        passing = 2.0 * np.pi / (cutter.teeth * speeds)
        slow = int(np.sum(passing > _FORGOTTEN * _memory(receptance, critical)))
        if slow:
            doubts.append(
                f"at {slow} of {speeds.size} speeds a vibration is forgotten long before the next tooth: what grows within a turn before "
                "it dies away is left out, and the limit may be far too high; full-discretisation tells it"
            )
    return doubts


def _memory(receptance: Receptance, critical: float) -> float:
    """For how long the tip remembers a vibration about a critical frequency: the longest delay of a group of waves there [s]."""
    own = np.abs(np.einsum("kii->ki", receptance.values))
    near = (receptance.omega > _BELOW * critical) & (receptance.omega < _ABOVE * critical)
    if near.sum() < 3:
        return np.inf
    strongest = int(np.argmax(own[near].max(axis=0)))
    phase = np.unwrap(np.angle(receptance.values[near, strongest, strongest]))
    return float(np.max(-np.gradient(phase, receptance.omega[near])))


def _band_doubts(receptance: Receptance, critical: float) -> list[str]:
    omega = receptance.omega[receptance.omega > 0.0]
    if not omega[0] < critical < omega[-1]:
        band = f"{omega[0] / (2 * np.pi):.0f}-{omega[-1] / (2 * np.pi):.0f} Hz"
        return [f"the absolute limit lies at the edge of the receptance's band ({band}): modes outside may be more critical"]
    k = int(np.searchsorted(receptance.omega, critical))
    around = receptance.values[max(k - 3, 0) : k + 3].reshape(-1, receptance.values.shape[1] * receptance.values.shape[2])
    # the share by which the largest receptance changes from line to line at the critical mode
    step = float(np.max(np.abs(np.diff(around, axis=0))) / np.max(np.abs(around)))
    if step <= 0.35:
        return []
    spacing = (receptance.omega[k] - receptance.omega[k - 1]) / (2.0 * np.pi)
    return [f"the receptance is coarse at the critical mode ({spacing:.3g} Hz between lines): the limit may be percents off"]
