"""The depth at which a cut on the virtual machine loses stability, from the growth of a small disturbance in time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy.optimize

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions, same_everywhere
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.virtual.reduction import Poles

#: Longest step of the march [s].
STEP = 5e-6
#: Instants that are marched at once.
_BLOCK = 16
#: Tooth periods after which the growth is looked at, and as many more each time.
_CHECK = 12
#: Ratio of the depths at which the growth is looked at before a change of sign is refined.
_SCAN = 1.12
#: A peak of the growth (logarithm per tooth period) below zero that may reach it between the depths looked at.
_NEAR = 0.05


@dataclass(frozen=True, slots=True)
class TrueLimit:
    """Where a cut loses stability.

    `depth` [m]: the smallest unstable depth; infinite where the cut is stable over the whole bracket
    `multiplier`: by which the most persistent disturbance is multiplied per tooth period at that depth, of the pair the one above the real
        axis; near -1 for a flip. NaN where `depth` is infinite.
    `marches`: how many depths were simulated
    """

    depth: float
    multiplier: complex
    marches: int


def true_limit(
    dynamics: Poles,
    cutter: Cutter,
    conditions: CuttingConditions,
    coefficients: CuttingCoefficients,
    bracket: tuple[float, float],
    tolerance: float = 1e-3,
    step: float = STEP,
) -> TrueLimit:
    """Return the smallest depth in the bracket at which a small disturbance of the steady cut no longer dies away.

    `dynamics`: the machine at the cut's speed, with inputs ``tip.x``, ``tip.y``
    `cutter`: one with equal teeth
    `conditions`: depth and feed are left aside
    `bracket`: (float, float) [m]; the cut has to be stable at the first; depths up to the second are looked at
    `tolerance`: relative error of the depth that is allowed
    `step` [s]: see `multiplier`
    Raises `InputError` if the cut is unstable at the bracket's first depth.
    """
    low, high = (positive(f"bracket[{i}]", value, "m") for i, value in enumerate(bracket))
    if not low < high:
        raise InputError("bracket", f"{low:g} to {high:g} m", "a smaller and a larger depth")
    march = _Disturbance(dynamics, cutter, conditions, coefficients, step)
    known: dict[float, float] = {}

    def growth(size: float) -> float:
        """Logarithm of the multiplier per tooth period over the logarithm of the depth."""
        if size not in known:
            known[size] = float(np.log(abs(march.multiplier(float(np.exp(size))))))
        return known[size]

    def root(stable: float, unstable: float) -> TrueLimit:
        place = float(scipy.optimize.brentq(growth, stable, unstable, xtol=0.5 * tolerance, rtol=1e-12))
        depth = float(np.exp(place))
        return TrueLimit(depth, march.multiplier(depth), len(known) + 1)

    places = np.linspace(np.log(low), np.log(high), 2 + int(np.log(high / low) / np.log(_SCAN)))
    if growth(places[0]) >= 0.0:
        raise InputError("bracket", f"unstable at its first depth, {low:g} m", "a first depth at which the cut is stable")
    for i in range(1, places.size):
        here = growth(places[i])
        if i >= 2 and growth(places[i - 1]) > max(growth(places[i - 2]), here, -_NEAR):
            # an island of instability may lie between the depths looked at
            inside = (float(places[i - 2]), float(places[i]))
            top = scipy.optimize.minimize_scalar(lambda s: -growth(float(s)), bounds=inside, method="bounded", options={"maxiter": 8})
            if top.fun < 0.0:
                return root(inside[0], float(top.x))
        if here >= 0.0:
            return root(float(places[i - 1]), float(places[i]))
    return TrueLimit(float("inf"), complex("nan"), len(known))


def multiplier(
    dynamics: Poles, cutter: Cutter, conditions: CuttingConditions, coefficients: CuttingCoefficients, step: float = STEP
) -> complex:
    """Return the factor by which the most persistent disturbance of a steady cut changes in a tooth period.

    The cut is stable where its magnitude is below 1. Between two equal teeth a steady cut repeats, so a disturbance d
    of the tool's path obeys F = a K_tc [alpha(t)] {d(t) - d(t - T)} as long as it is small against the feed: no tooth
    leaves the material. It is marched from tooth to tooth as `mill_cut` marches the cut (force linear within a step,
    poles exact), with the directional matrix averaged over depth and step in closed form, and the delay a whole number
    of steps. The largest eigenvalue of the march over one tooth period is found by Arnoldi's method
    [arnoldi1951].

    `dynamics`: at the cut's speed, with inputs ``tip.x``, ``tip.y``
    `cutter`: with equal teeth
    `step` [s]: longest step of the march; the error falls with its square
    """
    return _Disturbance(dynamics, cutter, conditions, coefficients, step).multiplier(conditions.axial_depth)


class _Disturbance:
    """The march of a small disturbance over one tooth period, for any depth."""

    def __init__(
        self, dynamics: Poles, cutter: Cutter, conditions: CuttingConditions, coefficients: CuttingCoefficients, step: float
    ) -> None:
        if not cutter.equally_spaced:
            raise InputError("cutter", "unequal pitch or run-out", "equal teeth, whose steady cut repeats from tooth to tooth")
        if not cutter.is_cylinder:
            raise InputError("cutter", str(cutter), "a cylinder: of no other shape this limit is known")
        names = [str(c) for c in dynamics.coordinates]
        tip = dynamics.outputs[[names.index("tip.x"), names.index("tip.y")]]
        self.cutter, self.conditions, self.coefficients = cutter, conditions, coefficients
        period = 2.0 * np.pi / (cutter.teeth * conditions.spindle_speed)
        self.blocks = int(np.ceil(period / (positive("step", step, "s") * _BLOCK)))
        self.count = self.blocks * _BLOCK
        h = period / self.count
        # poles scaled so that each has the same part in the tip's motion
        size = np.linalg.norm(tip, axis=0)
        size[size == 0.0] = 1.0
        tip, inputs = tip / size, dynamics.inputs * size[:, None]
        x = dynamics.pole * h
        decay = np.exp(x)
        first = np.expm1(x) / x
        second = (first - 1.0) / x
        before, now = ((h * g)[:, None] * inputs for g in (first - second, second))
        # p: the state one step on under the old force alone; p' = decay p + later F, tip = 2 Re(tip p) + instant F
        later = decay[:, None] * now + before
        powers = decay ** np.arange(_BLOCK)[:, None]
        seen = (2.0 * powers[:, None, :] * tip).reshape(2 * _BLOCK, -1)
        self.seen = np.hstack([seen.real, -seen.imag])
        echo = np.einsum("ak,ik,kb->iab", 2.0 * tip, powers, later).real
        compliance = np.zeros((_BLOCK, 2, _BLOCK, 2))
        for i in range(_BLOCK):
            compliance[i, :, i] = 2.0 * (tip @ now).real
            for j in range(i):
                compliance[i, :, j] = echo[i - j - 1]
        self.compliance = compliance.reshape(2 * _BLOCK, 2 * _BLOCK)
        self.decay = decay**_BLOCK
        driven = (powers[::-1, :, None] * later).transpose(1, 0, 2).reshape(-1, 2 * _BLOCK)
        self.driven = np.vstack([driven.real, driven.imag])
        self.modes = dynamics.pole.size

    def multiplier(self, depth: float) -> complex:
        """Return the eigenvalue of largest magnitude at this depth."""
        stiffness = depth * self.coefficients.tangential * directional_matrices(
            self.cutter, replace(self.conditions, axial_depth=depth), self.coefficients, self.count
        ).reshape(self.blocks, _BLOCK, 2, 2)  # fmt: skip
        gains: list[FloatArray | None] = []
        for block in stiffness:
            if not block.any():
                gains.append(None)
                continue
            wide = np.zeros((_BLOCK, 2, _BLOCK, 2))
            wide[np.arange(_BLOCK), :, np.arange(_BLOCK), :] = block
            square = wide.reshape(2 * _BLOCK, 2 * _BLOCK)
            gains.append(square @ np.linalg.inv(np.eye(2 * _BLOCK) - self.compliance @ square))
        m, states, width = self.modes, 2 * self.modes, 2 * _BLOCK

        def one_tooth(start: FloatArray) -> FloatArray:
            end = np.empty_like(start)
            real, imag = start[:m], start[m:states]
            for b, gain in enumerate(gains):
                part = slice(states + b * width, states + (b + 1) * width)
                free = self.seen @ np.concatenate([real, imag])
                real, imag = self.decay.real * real - self.decay.imag * imag, self.decay.real * imag + self.decay.imag * real
                if gain is not None:
                    force = gain @ (free - start[part])
                    free = free + self.compliance @ force
                    kick = self.driven @ force
                    real, imag = real + kick[:m], imag + kick[m:]
                end[part] = free
            end[:m], end[m:states] = real, imag
            return end

        largest = _largest_eigenvalue(one_tooth, states + 2 * self.count)
        return complex(largest.real, abs(largest.imag))


def _largest_eigenvalue(apply: Callable[[FloatArray], FloatArray], size: int) -> complex:
    """Arnoldi's method without restarts: what does not die within a tooth period spans far fewer dimensions than the path.

    The Ritz value of largest magnitude is taken when its residual is below 1e-7 of it.
    """
    start = np.random.default_rng(0).standard_normal(size)
    basis = np.empty((_CHECK + 1, size))
    basis[0] = start / np.linalg.norm(start)
    hessenberg = np.zeros((_CHECK + 1, _CHECK))
    for k in range(size):
        if k + 1 == basis.shape[0]:
            values, vectors = np.linalg.eig(hessenberg[:k, :k])
            best = int(np.argmax(np.abs(values)))
            if abs(hessenberg[k, k - 1] * vectors[-1, best]) < 1e-7 * abs(values[best]):
                return complex(values[best])
            basis = np.concatenate([basis, np.empty((_CHECK, size))])
            hessenberg = np.pad(hessenberg, ((0, _CHECK), (0, _CHECK)))
        after = apply(basis[k])
        # Gram-Schmidt, twice against rounding
        for _ in range(2):
            parts = basis[: k + 1] @ after
            after = after - parts @ basis[: k + 1]
            hessenberg[: k + 1, k] += parts
        hessenberg[k + 1, k] = np.linalg.norm(after)
        if hessenberg[k + 1, k] < 1e-14 * np.linalg.norm(hessenberg[: k + 1, k]):
            break
        basis[k + 1] = after / hessenberg[k + 1, k]
    values = np.linalg.eigvals(hessenberg[: k + 1, : k + 1])
    return complex(values[np.argmax(np.abs(values))])


def directional_matrices(cutter: Cutter, conditions: CuttingConditions, coefficients: CuttingCoefficients, count: int) -> FloatArray:
    """Return [alpha] at `count` instants of a tooth period, summed over equal teeth, in machine axes, shape (count, 2, 2).

    Each is the mean over the depth, along the helix, and over the step around its instant, in closed form.

    `cutter`: with equal teeth
    `count`: instants in a tooth period
    """
    pitch = 2.0 * np.pi / cutter.teeth
    entry, leave = same_everywhere(conditions.engagement).angles
    kr = coefficients.radial_ratio
    lag = 2.0 * conditions.axial_depth * np.tan(cutter.helix) / cutter.diameter
    step = pitch / count

    def once(phi: FloatArray) -> FloatArray:
        """Integral of [alpha] from the entry on, of a tooth that cuts once."""
        inside = np.clip(phi, entry, leave)
        sc, ss, cc = (f(inside) - f(entry) for f in _PRIMITIVES)
        return np.array([[-sc - kr * ss, -cc - kr * sc], [ss - kr * sc, sc - kr * cc]])

    def twice(phi: FloatArray) -> FloatArray:
        """Return the integral of `once` from the entry on."""
        inside = np.clip(phi, entry, leave)
        run = inside - entry
        sc, ss, cc = (g(inside) - g(entry) - f(entry) * run for f, g in zip(_PRIMITIVES, _SECOND_PRIMITIVES, strict=True))
        matrix = np.array([[-sc - kr * ss, -cc - kr * sc], [ss - kr * sc, sc - kr * cc]])
        return matrix + once(phi) * np.maximum(phi - leave, 0.0)

    alpha = np.zeros((2, 2, count))
    for turn in range(int(np.ceil((leave + lag) / pitch)) + 2):
        phi = step * np.arange(count) + (turn - 1) * pitch
        above, below = phi + 0.5 * step, phi - 0.5 * step
        if lag < 1e-4 * step:
            alpha += (once(above) - once(below)) / step
        else:
            alpha += (twice(above) - twice(below) - twice(above - lag) + twice(below - lag)) / (step * lag)
    rotation = conditions.machine_from_feed
    return np.ascontiguousarray(np.einsum("ij,jkn,lk->nil", rotation, alpha, rotation))


#: Integrals of sin cos, sin^2, cos^2, and theirs.
_Primitives = tuple[Callable[[FloatArray | float], FloatArray], ...]
_PRIMITIVES: _Primitives = (
    lambda p: -0.25 * np.cos(2.0 * p),
    lambda p: 0.5 * p - 0.25 * np.sin(2.0 * p),
    lambda p: 0.5 * p + 0.25 * np.sin(2.0 * p),
)
_SECOND_PRIMITIVES: _Primitives = (
    lambda p: -0.125 * np.sin(2.0 * p),
    lambda p: 0.25 * p**2 + 0.125 * np.cos(2.0 * p),
    lambda p: 0.25 * p**2 - 0.125 * np.cos(2.0 * p),
)
