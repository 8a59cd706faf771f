"""What stands behind forces that are wrong in the orders of the teeth: a curved law of the chip, edge forces, the angle of entry.

With F_m the line that was simulated and e^{c_m} the factor on it that an identification has learned,

    (e^{c_m} - 1) F_m = sum_k x_k dF_m / dx_k

is solved for what few physical unknowns x explain of many factors, weighted, with a prior for each: logarithms of K_tc and k_rc, the
exponent e of a coefficient that follows the chip as K_tc (h / h_0)^e [altintas2012], both edge forces, and the angle by which teeth enter
later.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.cutting.coefficients import REFERENCE_CHIP, CuttingCoefficients, ForceLaw
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import tooth_force, unit_lines, unit_values
from rcsa_ident.cutting.rows import rows_of

#: Spreads of the unknowns before anything was measured: logarithms of K_tc and k_rc, the exponent, edge forces over K_tc [m], entry [rad].
_TANGENTIAL, _RATIO, _EXPONENT, _EDGE, _ENTRY = 0.1, 0.1, 0.3, 2e-5, float(np.radians(3.0))
#: What a factor may be wrong by beside its own deviation [-].
_FLOOR = 3e-3
#: Step of the entry angle [rad], and nodes along an arc: h log h is no polynomial where a chip begins at 0.
_STEP, _NODES = 1e-4, 200


@dataclass(frozen=True, slots=True, eq=False)
class KnownFactors:
    """Factors on one kind of cut, along X and Y.

    `kind`: of the cuts
    `log`, `deviation` [-], shape (n,): logarithms, and standard deviations of their real and imaginary parts
    `change`, shape (n, 6) [-]: as `law_changes` gives it for the order and the axis of each
    """

    kind: int
    log: ComplexArray
    deviation: FloatArray
    change: ComplexArray


def law_changes(cutter: Cutter, conditions: CuttingConditions, coefficients: CuttingCoefficients, orders: np.ndarray) -> ComplexArray:
    """Return by what share lines of the force change with each unknown, shape (m, 2, 6) [-]; 0 where there is no force.

    Logarithms of K_tc and k_rc, the exponent, K_te and K_re in units of K_tc, which have the unit of length [m], and the entry [rad].

    `orders`: array of int, shape (m,); multiples of the spindle frequency

    Raises
    ------
    InputError
        As `cutting.force.force_lines`.
    """
    values, arc = unit_values(coefficients), conditions.engagement
    unit = unit_lines(cutter, conditions, orders)
    total = unit @ values
    change = np.zeros((*total.shape, 6), dtype=complex)
    change[..., 0] = unit[..., [0, 1, 4]] @ values[[0, 1, 4]]
    change[..., 1] = unit[..., 1] * values[1]
    change[..., 2] = _of_the_exponent(cutter, conditions, coefficients, orders)
    change[..., 3:5] = coefficients.tangential * unit[..., 2:4]
    if isinstance(arc, Engagement) and arc.entry > 0.0:
        step = min(_STEP, 0.5 * (arc.exit - arc.entry))
        later = replace(conditions, engagement=Engagement(arc.entry + step, arc.exit))
        change[..., 5] = (unit_lines(cutter, later, orders) @ values - total) / step
    return np.divide(change, total[..., None], out=np.zeros_like(change), where=total[..., None] != 0.0)


def _of_the_exponent(cutter: Cutter, conditions: CuttingConditions, coefficients: CuttingCoefficients, orders: np.ndarray) -> ComplexArray:
    """Change of the lines with the exponent at 0, shape (m, 2) [N]: those of a chip h log(h / h_0), by quadrature along each arc."""
    rows = rows_of(cutter.running_true(), conditions.engagement, conditions.axial_depth, conditions.feed_per_tooth)
    node, weight = np.polynomial.legendre.leggauss(_NODES)
    half, middle = 0.5 * (rows.end - rows.start)[:, None], 0.5 * (rows.end + rows.start)[:, None]
    phi = middle + half * node
    chip = (rows.feed[:, None] * np.sin(phi) + rows.step[:, None]) * np.sin(rows.kappa)[:, None]
    bent = np.where(chip > 0.0, chip * np.log(np.maximum(chip, 1e-300) / REFERENCE_CHIP), 0.0)
    no_edges = replace(coefficients, tangential_edge=0.0, radial_edge=0.0, axial_edge=0.0)
    force = np.stack([tooth_force(p, h, no_edges, kappa) for p, h, kappa in zip(phi, bent, rows.kappa, strict=True)])[..., :2]
    force *= (weight * half * rows.width[:, None])[..., None]
    # turned to where the row's tooth stands, and the mean over the lags along a wall
    turned = np.exp(1j * orders[:, None, None] * ((rows.angle - 0.5 * (rows.near + rows.far))[:, None] - phi))
    wall = np.sinc(orders[:, None] * ((0.5 / np.pi) * (rows.far - rows.near)))
    lines = np.einsum("mrk,mr,rkc->mc", turned, wall, force)
    copies = round(2.0 * np.pi / rows.spacing)
    lines *= (np.where(orders == 0, 1.0, 2.0) * (orders % copies == 0) * (copies / (2.0 * np.pi)))[:, None]
    return lines @ conditions.machine_from_feed.T if conditions.feed_angle else lines


def fit_law(known: Sequence[KnownFactors], coefficients: CuttingCoefficients, feed: float) -> ForceLaw:
    """Return what factors on the force say of its law.

    `known`: those of each kind of cut; kinds have an entry each, all else in common
    `coefficients`: of the straight line that was simulated
    `feed` [m]: per tooth, for which it was
    """
    entries = sorted({each.kind for each in known if np.any(each.change[:, 5])})
    spread = np.array([_TANGENTIAL, _RATIO, _EXPONENT, _EDGE, _EDGE, *([_ENTRY] * len(entries))])
    rows, wanted, sigma = [], [], []
    for each in known:
        columns = np.zeros((each.log.size, spread.size), dtype=complex)
        columns[:, :5] = each.change[:, :5]
        if each.kind in entries:
            columns[:, 5 + entries.index(each.kind)] = each.change[:, 5]
        factor = np.exp(each.log)
        rows += [columns.real, columns.imag]
        wanted += [(factor - 1.0).real, (factor - 1.0).imag]
        sigma += [np.hypot(np.abs(factor) * each.deviation, _FLOOR)] * 2
    weight = 1.0 / np.concatenate(sigma)
    a, b = np.concatenate(rows) * weight[:, None], np.concatenate(wanted) * weight
    covariance = np.linalg.inv(a.T @ a + np.diag(spread**-2))
    found = covariance @ (a.T @ b)
    rest = float(np.sum((b - a @ found) ** 2))
    # what is left is larger than the factors' deviations where the law is another one
    deviation = np.sqrt(np.diag(covariance) * max(rest / max(b.size - found.size, 1), 1.0))
    pairs = list(zip(found.tolist(), deviation.tolist(), strict=True))
    edges = [(coefficients.tangential * value, coefficients.tangential * std) for value, std in pairs[3:5]]
    explained = 1.0 - rest / max(float(np.sum(b**2)), 1e-300)
    return ForceLaw(pairs[2], edges[0], edges[1], dict(zip(entries, pairs[5:], strict=True)), max(explained, 0.0), feed)
