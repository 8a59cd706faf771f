"""The tool-holder contact from tap tests of assemblies, free in space or clamped in a known machine."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.base.remarks import Remark
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.line_noise import differences_noise, line_noise
from rcsa_ident.dynamics.receptance import Receptance, Substructure
from rcsa_ident.tool_holder.geometry import BeamSegment, Contact, ToolAssembly
from rcsa_ident.tool_holder.model import tool_holder_receptance

NAMES = ("translational_stiffness", "rotational_stiffness", "translational_damping", "rotational_damping")
#: Where nothing is known before: a collet chuck, and a factor of ten to each side as standard deviation.
USUAL, PRIOR_STD = Contact(2e10, 6e5, 1e5, 40.0), float(np.log(10.0))
#: Standard deviation of a logarithm from which on the taps do not tell a parameter: a factor of 1.6.
UNTOLD = 0.5
#: Starts beside the prior's centre: logarithms of all stiffnesses and of all dampings.
_STARTS = ((0.0, 0.0), (1.5, 0.0), (-1.5, 0.0), (0.0, 1.5), (0.0, -1.5), (3.0, 1.0))
_TRIED = 3
_STEP = 1e-4


@dataclass(frozen=True, slots=True)
class Support:
    """A known machine that the assembly was clamped in.

    `flange`: one bending plane, or both where they feel each other
    `axis`: along which was tapped; None is the plane's own
    """

    flange: Substructure
    joint: LumpedJoint
    axis: Dof | None = None


@dataclass(frozen=True, slots=True, eq=False)
class TapTest:
    """One measured translation receptance of an assembly.

    `assembly`: its own contact is not used
    `omega` [rad/s], shape (n,); `values` [m/N], shape (n,)
    `support`: None is free in space
    `row`, `col`: ``tip``, or ``flange`` of a free assembly, or ``spindle`` of a clamped one
    `std` [m/N], shape (n,): of the real and of the imaginary part each; None finds it from neighbouring frequencies
    `band`: (float, float) or None [rad/s]; what is used; None is all
    `remarks`: what the file does not state and was assumed
    """

    name: str
    assembly: ToolAssembly
    omega: FloatArray
    values: ComplexArray
    support: Support | None = None
    row: str = "tip"
    col: str = "tip"
    std: FloatArray | None = None
    band: tuple[float, float] | None = None
    remarks: tuple[Remark, ...] = ()

    def __post_init__(self) -> None:
        omega, values = frozen(self.omega), frozen(self.values, np.complex128)
        if omega.ndim != 1 or omega.shape != values.shape or not np.all(np.diff(omega, prepend=0.0) > 0.0):
            raise InputError(
                "tap test", f"{omega.shape} and {values.shape}", "one value for each of increasing frequencies above 0", self.name
            )
        if not np.all(np.isfinite(values)) or np.any(values == 0.0):
            raise InputError("tap test", "zero or no number", "a receptance above 0 at every frequency [m/N]", self.name)
        std = neighbour_noise(values) if self.std is None else frozen(np.broadcast_to(self.std, values.shape))
        low, high = self.band or (0.0, np.inf)
        kept = (omega >= low) & (omega <= high)
        if np.sum(kept) < 8:
            raise InputError("tap test", f"{np.sum(kept)} frequencies in the band", "eight at least", self.name)
        if self.assembly.insertion == 0.0:
            raise InputError("insertion", "0 mm", "a tool inside the holder's bore: without one there is no contact", self.name)
        for name, value in (("omega", omega), ("values", values), ("std", std)):
            object.__setattr__(self, name, frozen(value[kept], value.dtype))


@dataclass(frozen=True, slots=True, eq=False)
class ContactCalibration:
    """What tap tests say of a contact.

    `log_std`, shape (4,): standard deviations of the logarithms of `NAMES`, residuals that go together over frequency taken into account
    `correlation`, shape (4, 4)
    `modulus` [-]: factor on all moduli of tool and holder that went with it
    `modulus_std` [-]
    `gain`: dict of tap name to float [-], factor on each measured receptance's scale that went with it: hammer and sensor are known to a
        few percent only
    `model_error` [-]: share of the receptances that neither model nor noise explain
    `misfit`: dict of tap name to float [-], root mean square of log(measured / model)
    `told`: tuple of bool, length 4
    """

    contact: Contact
    log_std: FloatArray
    correlation: FloatArray
    modulus: float
    modulus_std: float
    gain: dict[str, float]
    model_error: float
    misfit: dict[str, float]
    told: tuple[bool, ...]
    notes: tuple[str, ...]


def calibrate_contact(
    taps: Sequence[TapTest],
    prior: Contact | None = None,
    prior_std: float = PRIOR_STD,
    modulus_spread: float = 0.01,
    gain_spread: float = 0.02,
    progress: Callable[[int, int], None] | None = None,
) -> ContactCalibration:
    """Return the contact that explains all tap tests together.

    Parameters
    ----------
    taps : sequence of TapTest
        Any number of stickouts, holders of one kind, free or clamped.
    prior : Contact, optional
        Centre of a log-normal prior.
    prior_std : float [-]
        Its standard deviation, of the logarithms.
    modulus_spread : float [-]
        Standard deviation of the moduli of tool and holder, a nuisance: left out, the contact would take their error. 0 leaves it out.
    gain_spread : float [-]
        Standard deviation of each tap's calibration (hammer times sensor), another nuisance.
    progress : callable of (done, total)

    Notes
    -----
    Least squares on the complex logarithm log(measured / model), so that resonances and antiresonances count alike, weighted by
    noise and a model error that is learned from the residuals; coarse first. Residuals of neighbouring frequencies go together
    (meshes, geometry), so the covariance is multiplied by their correlation length.
    """
    if not taps:
        raise InputError("taps", "none", "at least one tap test")
    problem = _Problem(tuple(taps), prior or USUAL, positive("prior_std", prior_std), modulus_spread, positive("gain_spread", gain_spread))
    starts = []
    for stiffer, looser in _STARTS:
        start = np.zeros(problem.size)
        start[:2], start[2:4] = stiffer, looser
        starts.append((_loss(problem.residual(start)), start))
    # the prior's centre, and those that begin best
    likely = [starts[0], *sorted(starts[1:], key=lambda s: s[0])[: _TRIED - 1]]
    best: tuple[float, FloatArray] | None = None
    for done, (_, start) in enumerate(likely, start=1):
        found, cost = problem.solve(start, 10, 1e-2)
        if best is None or cost < best[0]:
            best = (cost, found)
        if progress is not None:
            progress(done, _TRIED + 3)
    assert best is not None
    theta = best[1]
    for k in range(3):
        problem.learn(theta)
        theta, _ = problem.solve(theta, 20, 1e-5)
        if progress is not None:
            progress(_TRIED + k + 1, _TRIED + 3)
    answer = _answer(problem, theta)
    return replace(answer, notes=(*answer.notes, *dict.fromkeys(remark for tap in taps for remark in tap.remarks)))


def tap_model(tap: TapTest, contact: Contact, modulus: float = 1.0) -> ComplexArray:
    """Return what the model says of a tap test, shape (n,) [m/N]."""
    assembly = replace(
        tap.assembly, tool=_scaled(tap.assembly.tool, modulus), holder=_scaled(tap.assembly.holder, modulus), contact=contact
    )
    if tap.support is None:
        return tool_holder_receptance(assembly, tap.omega)[tap.row, tap.col][:, 0, 0]
    planes = [c.dof for c in tap.support.flange.coordinates if not c.dof.is_slope]
    axis = planes[0] if tap.support.axis is None else tap.support.axis
    free = Receptance.block_diagonal([tool_holder_receptance(assembly, tap.omega, each) for each in planes])
    found = couple(free, tap.support.flange.receptance(tap.omega), tap.support.joint)
    return found.between(f"{tap.row}.{axis}", f"{tap.col}.{axis}")


def _scaled(segments: tuple[BeamSegment, ...], factor: float) -> tuple[BeamSegment, ...]:
    if factor == 1.0:
        return segments
    return tuple(replace(s, material=replace(s.material, youngs_modulus=s.material.youngs_modulus * factor)) for s in segments)


def neighbour_noise(values: ComplexArray) -> FloatArray:
    """Return the standard deviation of each part from differences over frequency, shape (n,); of a few values a share of their size."""
    if values.size < 8:
        return np.full(values.size, 0.01 * float(np.median(np.abs(values))))
    return np.maximum(differences_noise(values), line_noise(values)) + 1e-6 * np.abs(values)


class _Problem:
    """Residuals over logarithms: of the contact relative to the prior, of the modulus, of each tap's gain."""

    def __init__(self, taps: tuple[TapTest, ...], prior: Contact, prior_std: float, modulus_spread: float, gain_spread: float) -> None:
        self.taps = taps
        # a prior of no damping has no logarithm: the usual one takes its place
        self.centre = np.array([getattr(prior, name) or getattr(USUAL, name) for name in NAMES])
        self.physical = 4 + (modulus_spread > 0.0)
        self.width = np.array([prior_std] * 4 + [modulus_spread] * (modulus_spread > 0.0) + [gain_spread] * len(taps))
        self.size = self.width.size
        self.model_error = 0.3

    def contact(self, theta: FloatArray) -> Contact:
        return Contact(*(self.centre * np.exp(np.clip(theta[:4], -30.0, 30.0))).tolist())

    def modulus(self, theta: FloatArray) -> float:
        return float(np.exp(theta[4])) if self.physical > 4 else 1.0

    def logs(self, theta: FloatArray) -> list[ComplexArray]:
        contact, modulus = self.contact(theta), self.modulus(theta)
        gains = theta[self.physical :]
        return [np.log(tap.values / tap_model(tap, contact, modulus)) - g for tap, g in zip(self.taps, gains, strict=True)]

    def weights(self) -> list[FloatArray]:
        return [1.0 / np.sqrt((np.asarray(tap.std) / np.abs(tap.values)) ** 2 + self.model_error**2) for tap in self.taps]

    def residual(self, theta: FloatArray) -> FloatArray:
        parts = [log * weight for log, weight in zip(self.logs(theta), self.weights(), strict=True)]
        return np.concatenate([*(np.concatenate([p.real, p.imag]) for p in parts), theta / self.width])

    def jacobian(self, theta: FloatArray, here: FloatArray) -> FloatArray:
        """Differences; a phase that jumps by a turn within a step is no slope."""
        slope = np.zeros((here.size, self.size))
        for k in range(self.physical):
            moved = theta.copy()
            moved[k] += _STEP
            slope[:, k] = (self.residual(moved) - here) / _STEP
        slope[np.abs(slope) * _STEP * self.model_error > 3.0] = 0.0
        start = 0
        for k, weight in enumerate(self.weights(), start=self.physical):
            slope[start : start + weight.size, k] = -weight
            start += 2 * weight.size
            slope[here.size - self.size + k, k] = 1.0 / self.width[k]
        return slope

    def solve(self, theta: FloatArray, steps: int, least_gain: float) -> tuple[FloatArray, float]:
        """Levenberg-Marquardt on a loss that grows linearly from four deviations on."""
        left = self.residual(theta)
        cost, damping = _loss(left), 1e-2
        for _ in range(steps):
            slope = self.jacobian(theta, left)
            factor = 1.0 / np.sqrt(1.0 + (left / 4.0) ** 2)
            gram, gradient = slope.T @ (factor[:, None] * slope), slope.T @ (factor * left)
            gained = 0.0
            for _ in range(6):
                step = np.linalg.solve(gram + damping * np.diag(np.diag(gram)), gradient)
                trial = theta - np.clip(step, -1.5, 1.5)
                tried = self.residual(trial)
                new = _loss(tried)
                if new < cost:
                    gained, theta, left, cost, damping = cost - new, trial, tried, new, 0.2 * damping
                    break
                damping = max(5.0 * damping, 1e-6)
            if gained <= least_gain * cost:
                break
        return theta, cost

    def learn(self, theta: FloatArray) -> None:
        """Choose the model error so that squared residuals have their expected size; not below a tenth of a percent."""
        power = np.concatenate([0.5 * np.abs(log) ** 2 for log in self.logs(theta)])
        noise = np.concatenate([(np.asarray(tap.std) / np.abs(tap.values)) ** 2 for tap in self.taps])
        low, high = 1e-6, 1.0
        for _ in range(60):
            share = 0.5 * (low + high)
            low, high = (share, high) if np.mean(power / (noise + share)) > 1.0 else (low, share)
        self.model_error = float(np.sqrt(0.5 * (low + high)))


def _loss(left: FloatArray) -> float:
    """Pseudo-Huber, scale 4."""
    return float(np.sum(32.0 * (np.sqrt(1.0 + (left / 4.0) ** 2) - 1.0)))


def _correlation_length(parts: Sequence[FloatArray]) -> float:
    """How many neighbouring residuals say the same: 1 + 2 sum of their correlations up to the first that is none."""
    lengths = []
    for part in parts:
        centred = part - part.mean()
        power = float(centred @ centred)
        total = 1.0
        for k in range(1, min(part.size // 4, 400)):
            rho = float(centred[:-k] @ centred[k:]) / max(power, 1e-300)
            if rho < 0.1:
                break
            total += 2.0 * rho
        lengths.append(total)
    return float(np.mean(lengths))


def _answer(problem: _Problem, theta: FloatArray) -> ContactCalibration:
    left = problem.residual(theta)
    slope = problem.jacobian(theta, left)
    data = slice(0, left.size - problem.size)
    edges = np.cumsum([0, *(n for tap in problem.taps for n in (tap.omega.size, tap.omega.size))])
    parts = [left[a:b] for a, b in pairwise(edges)]
    length = _correlation_length(parts)
    told_by_data = slope[data].T @ slope[data] / length
    covariance = np.linalg.inv(told_by_data + np.diag(problem.width**-2.0))
    std = np.sqrt(np.diag(covariance))
    correlation = covariance[:4, :4] / std[:4, None] / std[:4]
    logs = problem.logs(theta)
    misfit = {tap.name: float(np.sqrt(np.mean(np.abs(log) ** 2))) for tap, log in zip(problem.taps, logs, strict=True)}
    told = tuple(bool(s < UNTOLD) for s in std[:4])
    notes = []
    for name, s, ok in zip(NAMES, std[:4], told, strict=True):
        if not ok:
            known = f"known to within a factor of {np.exp(s):.2g}"
            notes.append(f"{name.replace('_', ' ')}: hardly determined by the tap tests ({known}); the prior dominates")
    for i in range(4):
        for j in range(i):
            if abs(correlation[i, j]) > 0.95 and told[i] and told[j]:
                both = f"{NAMES[j].replace('_', ' ')} and {NAMES[i].replace('_', ' ')}"
                tied = f"correlation {correlation[i, j]:+.2f}"
                notes.append(f"{both} are determined only together ({tied}): tap tests at other stickouts would separate them")
    if problem.model_error > 0.1:
        share = 100.0 * problem.model_error
        notes.append(f"the model leaves {share:.0f} % of the receptances unexplained: geometry, materials or support differ from it")
    if problem.physical > 4 and abs(theta[4]) > 2.5 * problem.width[4]:
        notes.append(f"the fit changed the moduli by {100.0 * np.expm1(theta[4]):+.1f} %: check materials and geometry")
    modulus_std = float(std[4]) if problem.physical > 4 else 0.0
    gain = {tap.name: float(np.exp(g)) for tap, g in zip(problem.taps, theta[problem.physical :], strict=True)}
    return ContactCalibration(
        problem.contact(theta),
        frozen(std[:4]),
        frozen(correlation),
        problem.modulus(theta),
        modulus_std,
        gain,
        problem.model_error,
        misfit,
        told,
        tuple(notes),
    )
