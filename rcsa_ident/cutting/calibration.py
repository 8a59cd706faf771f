"""Cutting coefficients from measured mean forces [altintas2012], with intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import REFERENCE_RUNOUT, UNIT_NAMES, unit_lines
from rcsa_ident.cutting.regression import cluster_covariance, student_quantile
from rcsa_ident.cutting.segments import Line

#: Coefficients in the order of `ForceCalibration.value`; the last two want a dynamometer that measures along the axis, or leaning edges.
NAMES = UNIT_NAMES
UNITS = {"K_tc": "N/m^2", "K_rc": "N/m^2", "K_ac": "N/m^2", "K_te": "N/m", "K_re": "N/m", "K_ae": "N/m"}
#: Fewest cuts from which a scatter between cuts can be told.
LEAST_CUTS = 3
_NORMAL_95 = 1.959964
#: Condition number of the scaled regression from which on coefficients cannot be told apart.
_WORST_CONDITION = 1e5
#: The same for what X and Y tell of the axial coefficients of a leaning edge: one depth tells nothing, two depths or more may.
_WORST_LEANING = 100.0
#: Note where an edge leans and X and Y alone, at too few depths, tell radial and axial coefficients together.
TOGETHER = "the edge leans, and X and Y at these depths cannot tell radial and axial coefficients apart: K_rc and K_re stand for both there"
_OTHER_AXES = "sign or axes of the sensors may be others than told: they can be tried all"


@dataclass(frozen=True, slots=True, eq=False)
class ForceCalibration:
    """Cutting and edge coefficients with 95 % intervals: F = K_c h b + K_e b for each direction.

    `method`: ``mean`` or ``signal``
    `names`: tuple of str, length p; the coefficients that were fitted, out of `NAMES`
    `value` [N/m^2 or N/m], shape (p,); `covariance`, shape (p, p)
    `half_width`, shape (p,): half widths of the 95 % intervals, by a t-distribution
    `misfit` [-]: root mean square of what is left over that of the forces
    `reasons`, `notes`: why the answer is suspect; what was found beside it
    """

    method: str
    names: tuple[str, ...]
    value: FloatArray
    covariance: FloatArray
    half_width: FloatArray
    misfit: float
    reasons: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("value", "covariance", "half_width"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    def of(self, name: str) -> tuple[float, float]:
        """Return a coefficient and the half width of its interval; (0, 0) of one that was not fitted."""
        if name not in self.names:
            return 0.0, 0.0
        i = self.names.index(name)
        return float(self.value[i]), float(self.half_width[i])

    @property
    def coefficients(self) -> CuttingCoefficients:
        """As a workpiece carries them; standard deviations of logarithms are the intervals' half widths over 1.96."""
        tangential, width = self.of("K_tc")
        edges = {name: self.of(name) for name in ("K_te", "K_re", "K_ae")}
        shares = [w / v for v, w in edges.values() if v > 0.0]
        tangential_edge, radial_edge, axial_edge = (max(v, 0.0) for v, _ in edges.values())
        return CuttingCoefficients(
            tangential,
            self.of("K_rc")[0] / tangential,
            self.of("K_ac")[0] / tangential,
            tangential_edge,
            radial_edge,
            axial_edge,
            tangential_spread=min(width / tangential / _NORMAL_95, 1.0),
            ratio_spread=self._ratio_spread(),
            edge_spread=min(max(shares, default=0.0) / _NORMAL_95, 1.0),
        )

    def _ratio_spread(self) -> float:
        """Standard deviation of log(K_rc / K_tc), errors of both going together as the covariance says."""
        t, r = (self.names.index(name) for name in ("K_tc", "K_rc"))
        if self.value[r] == 0.0:
            return 1.0
        slope = np.zeros(self.value.size)
        slope[[t, r]] = -1.0 / self.value[t], 1.0 / self.value[r]
        deviation = np.sqrt(np.maximum(np.diag(self.covariance)[[t, r]], 1e-300))
        factor = float(np.max(self.half_width[[t, r]] / deviation)) / _NORMAL_95
        # of errors that cancel, rounding may leave less than nothing
        return min(factor * float(np.sqrt(max(float(slope @ self.covariance @ slope), 0.0))), 1.0)


def mean_force_matrix(cutter: Cutter, conditions: CuttingConditions) -> FloatArray:
    """Return the mean force of a cut per unit of each coefficient of `NAMES`, in machine axes X, Y and axial, shape (3, 6).

    It is linear in the feed: mean F = N a / (2 pi) (feed K_c int sin phi ... + K_e int ...) of a wall, and neither helix nor run-out
    change it as long as every tooth cuts. Axial is from the spindle towards the tip, -z.
    """
    matrix = unit_lines(cutter, conditions, np.array([0]), axial=True)[0].real
    return np.array([1.0, 1.0, -1.0])[:, None] * matrix


def leaning(cutter: Cutter, conditions: CuttingConditions) -> bool:
    """Whether the axial coefficients push in X and Y, too: somewhere in the cut the edge's envelope is no wall."""
    upright = [
        isinstance(segment, Line) and abs(segment.kappa - 0.5 * np.pi) < 1e-9
        for segment, _, _ in cutter.outline.pieces(conditions.axial_depth)
    ]
    return not all(upright)


def calibrate_mean_force(
    cuts: Sequence[tuple[Cutter, CuttingConditions]], force: FloatArray, runout: float = REFERENCE_RUNOUT
) -> ForceCalibration:
    """Return the coefficients from the mean forces of cuts at several feeds.

    Parameters
    ----------
    cuts : sequence of (Cutter, CuttingConditions), length n
        Any engagement; three at least, with two different feeds per tooth at least.
    force : array, shape (n, 2) or (n, 3) [N]
        Mean force on the tool over whole revolutions: X, Y and, for the axial coefficients, along the axis.
    runout : float [m]
        Standard deviation of the cutter's unknown eccentricity. Where the chip runs out to nothing an eccentric tooth loses contact
        and its edge force with it; that bends the mean over the feed alike in all cuts, so no scatter shows it.

    Raises
    ------
    InputError
        The cuts are too few, or do not tell the coefficients apart.

    Notes
    -----
    Linear least squares. Each cut is a cluster of `cluster_covariance`: errors of its axes go together, and large forces may
    scatter more than small ones. An edge force that comes out negative is set to 0 and the others fitted again.
    """
    force = np.asarray(force, dtype=float)
    if len(cuts) < LEAST_CUTS:
        raise InputError("cuts", len(cuts), f"at least {LEAST_CUTS}, so that their scatter can be estimated")
    count = force.shape[1]
    design = np.concatenate([mean_force_matrix(*cut)[:count] for cut in cuts])
    notes: list[str] = []
    names: tuple[str, ...] = NAMES
    if count == 2:
        leans, size = any(leaning(*cut) for cut in cuts), np.linalg.norm(design, axis=0)
        if not (leans and np.all(size > 0.0) and np.linalg.cond(design / size) <= _WORST_LEANING):
            names, design = NAMES[:4], design[:, :4]
            notes += [TOGETHER] if leans else []
    observed, cluster = force.reshape(-1), np.repeat(np.arange(len(cuts)), count)
    kept = list(range(len(names)))
    while True:
        scale = np.linalg.norm(design[:, kept], axis=0)
        if not np.all(scale > 0.0) or np.linalg.cond(design[:, kept] / scale) > _WORST_CONDITION:
            found = ", ".join(f"{1e3 * f:g}" for f in sorted({c.feed_per_tooth for _, c in cuts}))
            raise InputError(
                "feed_per_tooth_mm of the cuts", found, "two or more different feeds per tooth, so that edge forces can be separated"
            )
        solution = np.linalg.lstsq(design[:, kept] / scale, observed)[0] / scale
        negative = [i for i, k in enumerate(kept) if names[k].endswith("e") and solution[i] < 0.0]
        if not negative:
            break
        worst = min(negative, key=lambda i: solution[i] * scale[i])
        notes.append(f"{names[kept[worst]]} came out below zero ({solution[worst] * 1e-3:.2g} N/mm) and was set to 0")
        del kept[worst]
    residual = observed - design[:, kept] @ solution
    covariance, dof = cluster_covariance(design[:, kept] / scale, residual, cluster)
    covariance = covariance / scale[:, None] / scale
    width = student_quantile(dof) * np.sqrt(np.diag(covariance))
    bend = np.concatenate([_runout_effect(*cut, solution, kept, runout)[:count] for cut in cuts])
    common = np.linalg.lstsq(design[:, kept] / scale, bend)[0] / scale
    covariance, width = covariance + np.outer(common, common), np.hypot(width, _NORMAL_95 * common)
    value, total, half_width = np.zeros(len(names)), np.zeros((len(names),) * 2), np.zeros(len(names))
    value[kept], half_width[kept] = solution, width
    total[np.ix_(kept, kept)] = covariance
    misfit = float(np.linalg.norm(residual)) / max(float(np.linalg.norm(observed)), 1e-300)
    return ForceCalibration("mean", names, value, total, half_width, misfit, plausible(names, value, half_width), tuple(notes))


def _runout_effect(cutter: Cutter, conditions: CuttingConditions, solution: FloatArray, kept: Sequence[int], runout: float) -> FloatArray:
    """Change of a cut's mean force by an eccentricity, shape (3,) [N]; the axial one is not followed."""
    known = np.zeros(len(NAMES))
    known[list(kept)] = solution
    # no tooth stands where the eccentricity is 0 or largest
    eccentric = replace(cutter, runout=runout * np.cos(cutter.tooth_angle - 0.125 * cutter.pitch[0]))
    order = np.array([0])
    change = unit_lines(eccentric, conditions, order, runout=True) - unit_lines(cutter, conditions, order)
    return np.concatenate([(change[0].real @ known), [0.0]])


def plausible(names: Sequence[str], value: FloatArray, half_width: FloatArray) -> tuple[str, ...]:
    """Return what speaks against a set of coefficients, in words.

    `names`: sequence of str, length p; out of `NAMES`
    `value`, `half_width` [N/m^2 or N/m], shape (p,): coefficients and half widths of their 95 % intervals
    """
    known = dict(zip(names, zip(value.tolist(), half_width.tolist(), strict=True), strict=True))
    reasons = []
    tangential, width = known["K_tc"]
    if tangential <= 0.0:
        reasons.append(f"K_tc is below zero: the force is not the one on the tool in the machine's axes; {_OTHER_AXES}")
    elif width > 0.5 * tangential:
        reasons.append(f"K_tc is known only to {100.0 * width / tangential:.0f} %: use more feeds, or feeds farther apart")
    if tangential > 0.0 and not -0.2 <= known["K_rc"][0] / tangential <= 2.0:
        reasons.append(f"K_rc / K_tc is {known['K_rc'][0] / tangential:.2g}: unusual; is the engagement as told? {_OTHER_AXES}")
    return tuple(reasons)
