"""The spindle's flange from several toolings: least squares on translations, with conditioning and uncertainty."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.coupling.decoupling import interface_receptance
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.coupling.rcsa import SPINDLE
from rcsa_ident.coupling.smoothing import band_covariance, band_solve, bending, second_differences
from rcsa_ident.dynamics.receptance import Receptance, dissipation

#: Damping ratio below which no mode of the flange is expected: how fast its receptance may bend over frequency.
LEAST_DAMPING = 0.02
#: Median condition number from which on the linearised deviations are too small.
POOR_CONDITION = 50.0
#: Share by which neighbours narrow an entry's standard deviation from which on the frequency counts as regularised.
LEANING = 0.5
#: Distance from its neighbours' median, in the entries' usual size, from which on a frequency's own solution is not believed.
ALONE = 3.0
_STEPS = 40
#: Where b_tt, b_tr, b_rr stand in the flange's symmetric block.
_ENTRIES = np.zeros((3, 2, 2))
_ENTRIES[0, 0, 0] = _ENTRIES[1, 0, 1] = _ENTRIES[1, 1, 0] = _ENTRIES[2, 1, 1] = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """One measured entry of an assembly with one known tool-holder.

    `tool_holder`: one bending plane, points ``tip`` and ``flange``
    `row`, `col`: ``tip`` or ``spindle``: where translation is seen and force applied
    `values` [m/N], shape (n,)
    `std`: array, shape (n,), or float [m/N]; standard deviation of the real and of the imaginary part each
    """

    tool_holder: Receptance
    row: str
    col: str
    values: ComplexArray
    std: FloatArray | float

    def __post_init__(self) -> None:
        n = self.tool_holder.omega.size
        object.__setattr__(self, "values", frozen(self.values, np.complex128))
        std = frozen(np.broadcast_to(np.asarray(self.std, dtype=float), (n,)))
        object.__setattr__(self, "std", std)
        if self.values.shape != (n,):
            raise InputError("observed values", self.values.shape, f"shape ({n},), the tool-holder's frequencies")
        if {self.row, self.col} - {"tip", SPINDLE}:
            raise InputError("observed entry", f"{self.row}, {self.col}", f"tip or {SPINDLE}")
        if not np.all(std > 0.0):
            raise InputError("std", float(std.min()), "above 0 [m/N]")


@dataclass(frozen=True, slots=True, eq=False)
class DecoupledFlange:
    """A flange found from several toolings.

    `receptance`: point ``flange``: [[h_tF, h_tM], [h_rF, h_rM]], symmetric
    `std`, shape (n, 2, 2): standard deviation of the real and of the imaginary part each; the prior's share is in it where there is one
    `condition` [-], shape (n,): condition number of each frequency's equations, noise-weighted and scaled to the entries' own size
    `chi2`, shape (n,): sum of squared residuals in standard deviations; `freedom` is expected where measurements outnumber unknowns
    `freedom`: real measurements less real unknowns at a frequency
    `regularised`: array of bool, shape (n,); True where neighbouring frequencies were needed as a prior
    `ambiguous`: array of bool, shape (n,); True where another passive solution explains the measurements as well
    `dissipation` [-], shape (n,): below zero the result feeds energy in: noise, or a tool-holder that is not as modelled
    """

    receptance: Receptance
    std: FloatArray
    condition: FloatArray
    chi2: FloatArray
    freedom: int
    regularised: np.ndarray
    ambiguous: np.ndarray
    dissipation: FloatArray
    notes: tuple[str, ...]


def least_squares_flange(
    observations: Sequence[Observation], joint: LumpedJoint | None = None, least_damping: float | None = LEAST_DAMPING
) -> DecoupledFlange:
    """Return the flange's three independent entries at every frequency from translations of assemblies with known tool-holders.

    Parameters
    ----------
    observations : sequence of Observation
        Three at least, of toolings (or entries) that differ; all at the same frequencies and in the same bending plane.
    joint : LumpedJoint or None
        Between holder and spindle; None leaves it in the flange. Tip measurements alone never tell it from the flange.
    least_damping : float or None
        Damping ratio below which the flange has no mode. It bounds the second differences over frequency, a prior that matters
        where the equations are ill-conditioned and the grid is finer than that mode's width; None is each frequency for itself.

    Notes
    -----
    A tip measurement g = A11 - C11 = a^T (D + B)^-1 a is linear in b_tt, b_tr, b_rr and their determinant q: with
    D = A22 + K^-1 and a = A21's column, g (q + d_rr b_tt + d_tt b_rr - 2 d_tr b_tr + det D) = a_t^2 (d_rr + b_rr) -
    2 a_t a_r (d_tr + b_tr) + a_r^2 (d_tt + b_tt). Three of them leave a line in (b, q), which meets q = det B twice; more of
    them give the start directly. Each start is refined by Gauss-Newton steps on the noise-weighted residuals of all observations,
    and of several solutions the one with the best misfit, then a passive one, then the one nearest to its neighbour is taken.
    """
    if len(observations) < 3:
        raise InputError("observations", len(observations), "at least three: the flange has three independent entries")
    omega = observations[0].tool_holder.omega
    flange = tuple(c for c in observations[0].tool_holder.rows if c.point == "flange")
    for each in observations:
        if not np.array_equal(each.tool_holder.omega, omega):
            raise InputError("tool-holders", f"{each.tool_holder.omega.size} frequencies", f"the same {omega.size} frequencies for all")
        if tuple(c for c in each.tool_holder.rows if c.point == "flange") != flange or len(flange) != 2:
            raise InputError("tool-holders", "different directions", "one bending plane, the same for all")
    model = _Assemblies.of(observations, joint)
    if sum(o.row == o.col == "tip" for o in observations) < 3:
        raise InputError("observations", "fewer than three at the tip", "at least three tip receptances, from which the solution starts")
    starts = [_tamed(start) for start in model.starts()]
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        solved = [_tamed(model.polish(start)) for start in starts]
    entries, ambiguous = _choose(model, solved)
    condition, alone = model.conditioning(entries)
    covariance, regularised = alone, np.zeros(omega.size, dtype=bool)
    if least_damping is not None and omega.size >= 5:
        entries, covariance = _smoothed(model, omega, entries, solved, alone, positive("least_damping", least_damping))
        condition, alone = model.conditioning(entries)
        narrowed = np.einsum("nee->ne", covariance).real / np.maximum(np.einsum("nee->ne", alone).real, 1e-300)
        regularised = np.any(narrowed < LEANING**2, axis=1)
    values = np.einsum("ne,eij->nij", entries, _ENTRIES)
    deviation = np.sqrt(np.maximum(np.einsum("nee->ne", covariance).real, 0.0))
    std = np.einsum("ne,eij->nij", deviation, _ENTRIES)
    loss = dissipation(omega, values)
    chi2 = np.sum(np.abs(model.residual(entries)) ** 2, axis=1)
    freedom = 2 * (len(observations) - 3)
    receptance = Receptance(omega, values, flange, flange)
    notes = _notes(omega, condition, regularised, ambiguous, loss, chi2, freedom)
    flags = frozen(regularised, bool), frozen(ambiguous, bool)
    return DecoupledFlange(receptance, frozen(std), frozen(condition), frozen(chi2), freedom, *flags, frozen(loss), notes)


@dataclass(frozen=True, slots=True, eq=False)
class _Assemblies:
    """All observations as arrays: a, D, A11 per observation, shapes (n, k, 2), (n, k, 2, 2), (n, k)."""

    tip: ComplexArray
    interface: ComplexArray
    free: ComplexArray
    values: ComplexArray
    std: FloatArray
    row_tip: np.ndarray
    col_tip: np.ndarray

    @classmethod
    def of(cls, observations: Sequence[Observation], joint: LumpedJoint | None) -> _Assemblies:
        holders = [o.tool_holder for o in observations]
        directions = tuple(c.dof for c in holders[0].rows if c.point == "flange")
        return cls(
            np.stack([h["flange", "tip"][:, :, 0] for h in holders], axis=1),
            np.stack([interface_receptance(h, directions, joint) for h in holders], axis=1),
            np.stack([h["tip", "tip"][:, 0, 0] for h in holders], axis=1),
            np.stack([o.values for o in observations], axis=1),
            np.stack([o.std for o in observations], axis=1),
            np.array([o.row == "tip" for o in observations]),
            np.array([o.col == "tip" for o in observations]),
        )

    def starts(self) -> list[ComplexArray]:
        """Two solutions, shape (n, 3) each, of the linear equations in b_tt, b_tr, b_rr and their determinant, both with q = det B."""
        k = np.flatnonzero(self.row_tip & self.col_tip)
        a, d, g = self.tip[:, k], self.interface[:, k], self.free[:, k] - self.values[:, k]
        at, ar, dtt, dtr, drr = a[..., 0], a[..., 1], d[..., 0, 0], d[..., 0, 1], d[..., 1, 1]
        matrix = np.stack([g * drr - ar**2, 2.0 * (at * ar - g * dtr), g * dtt - at**2, g], axis=-1)
        right = at**2 * drr - 2.0 * at * ar * dtr + ar**2 * dtt - g * (dtt * drr - dtr**2)
        size = np.linalg.norm(matrix, axis=2, keepdims=True)
        matrix, right = matrix / size, right / size[..., 0]
        column = np.linalg.norm(matrix, axis=1, keepdims=True)
        u, s, vh = np.linalg.svd(matrix / column, full_matrices=True)
        s = np.concatenate([s, np.zeros((*s.shape[:1], 4 - s.shape[1]))], axis=1)
        # the best solution within the three strong directions, and the line along the weakest
        along = np.einsum("nki,nk->ni", u[:, :, :3].conj(), right) / s[:, :3]
        base = np.einsum("nij,ni->nj", vh[:, :3].conj(), along) / column[:, 0]
        line = vh[:, 3].conj() / column[:, 0]
        # (q + t q') = (b1 + t b1') (b3 + t b3') - (b2 + t b2')^2
        second = line[:, 0] * line[:, 2] - line[:, 1] ** 2
        first = base[:, 0] * line[:, 2] + base[:, 2] * line[:, 0] - 2.0 * base[:, 1] * line[:, 1] - line[:, 3]
        zeroth = base[:, 0] * base[:, 2] - base[:, 1] ** 2 - base[:, 3]
        root = np.sqrt(first**2 - 4.0 * second * zeroth)
        root = np.where((first.conj() * root).real >= 0.0, root, -root)
        half = -0.5 * (first + root)
        tiny = 1e-300
        steps = (half / np.where(np.abs(second) > tiny, second, tiny), zeroth / np.where(np.abs(half) > tiny, half, tiny))
        found = [base[:, :3] + t[:, None] * line[:, :3] for t in steps]
        if k.size >= 4:
            scaled = matrix / column
            normal = np.swapaxes(scaled.conj(), 1, 2)
            direct = np.linalg.solve(normal @ scaled, normal @ right[..., None])[..., 0] / column[:, 0]
            found.append(direct[:, :3])
        return found

    def response(self, entries: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """What B predicts of each observation and its derivatives, shapes (n, k) and (n, k, 3)."""
        b = np.einsum("ne,eij->nij", entries, _ENTRIES)[:, None]
        z_tip = np.linalg.solve(self.interface + b, self.tip[..., None])[..., 0]
        # z_row^T dB z_col is every entry's change: at the tip z = Z a, at the spindle z = (I - Z B) e_t
        z_spindle = np.linalg.solve(self.interface + b, self.interface[..., :, :1])[..., 0]
        left = np.where(self.row_tip[None, :, None], z_tip, z_spindle)
        right = np.where(self.col_tip[None, :, None], z_tip, z_spindle)
        slope = np.einsum("nki,eij,nkj->nke", left, _ENTRIES, right)
        through_tip = np.einsum("nki,nki->nk", self.tip, z_tip)
        moved = np.einsum("nij,nkj->nki", b[:, 0], z_tip)[..., 0]
        still = np.einsum("nij,nkj->nki", b[:, 0], z_spindle)[..., 0]
        both = self.row_tip & self.col_tip
        neither = ~self.row_tip & ~self.col_tip
        value = np.where(both, self.free - through_tip, np.where(neither, still, moved))
        return value, slope

    def residual(self, entries: ComplexArray) -> ComplexArray:
        return (self.response(entries)[0] - self.values) / self.std

    def polish(self, entries: ComplexArray) -> ComplexArray:
        """Damped Gauss-Newton steps, all frequencies at once."""
        damping = np.full(entries.shape[0], 1e-6)
        cost = self._cost(entries)
        for _ in range(_STEPS):
            value, slope = self.response(entries)
            scale = np.maximum(np.abs(entries), 1e-3 * np.abs(entries).max(axis=0) + 1e-300)
            matrix = slope * scale[:, None] / self.std[..., None]
            gram = np.swapaxes(matrix.conj(), 1, 2) @ matrix
            gradient = np.einsum("nke,nk->ne", matrix.conj(), (value - self.values) / self.std)
            size = np.einsum("nee->ne", gram).real
            damped = gram + np.einsum("n,ne,ef->nef", damping, size + 1e-300, np.eye(3))
            trial = entries - scale * np.linalg.solve(damped, gradient[..., None])[..., 0]
            tried = self._cost(trial)
            better = tried < cost
            entries = np.where(better[:, None], trial, entries)
            gained = np.where(better, (cost - tried) / np.maximum(cost, 1e-300), 0.0)
            cost = np.where(better, tried, cost)
            damping = np.clip(np.where(better, 0.1 * damping, 10.0 * damping), 1e-12, 1e6)
            if np.all(gained < 1e-12) and np.all(better | (damping >= 1e3)):
                break
        return entries

    def _cost(self, entries: ComplexArray) -> FloatArray:
        cost = np.sum(np.abs(self.residual(entries)) ** 2, axis=1)
        return np.where(np.isfinite(cost), cost, np.inf)

    def conditioning(self, entries: ComplexArray) -> tuple[FloatArray, ComplexArray]:
        """Condition number, and covariance of the entries, shapes (n,) and (n, 3, 3)."""
        scale = np.maximum(np.abs(entries), 1e-300)
        matrix = self.response(entries)[1] * scale[:, None] / self.std[..., None]
        singular = np.linalg.svd(matrix, compute_uv=False)
        gram = np.swapaxes(matrix.conj(), 1, 2) @ matrix
        covariance = np.linalg.pinv(gram, hermitian=True, rcond=1e-14) * scale[:, :, None] * scale[:, None, :]
        return singular[:, 0] / np.maximum(singular[:, -1], 1e-300), covariance


def _tamed(entries: ComplexArray) -> ComplexArray:
    """Starts that are far from all others lead nowhere but to overflow: they are pulled back to a thousand times the usual size."""
    entries = np.where(np.isfinite(entries), entries, 0.0)
    most = 1e3 * np.median(np.abs(entries), axis=0) + 1e-300
    return entries * np.minimum(1.0, most / np.maximum(np.abs(entries), 1e-300))


def _choose(model: _Assemblies, solved: list[ComplexArray]) -> tuple[ComplexArray, np.ndarray]:
    """Of several solutions per frequency the one to take, and where another would do as well."""
    omega_free = np.stack(solved)
    cost = np.stack([np.sum(np.abs(model.residual(s)) ** 2, axis=1) for s in solved])
    cost = np.where(np.isfinite(cost), cost, np.inf)
    values = np.einsum("sne,eij->snij", omega_free, _ENTRIES)
    ones = np.ones(values.shape[1])
    # passivity does not depend on the frequency's size, only on its sign
    loss = np.stack([dissipation(ones, v) for v in values])
    good = cost <= cost.min(axis=0) * 1.5 + 4.0
    passive = good & (loss > -1e-6)
    allowed = np.where(passive.any(axis=0), passive, good)
    n = ones.size
    chosen = np.argmin(np.where(allowed, cost, np.inf), axis=0)
    size = np.median(np.abs(omega_free), axis=(0, 1)) + 1e-300
    distance = np.abs(omega_free[:, None] - omega_free[None]) / size
    other = (distance.max(axis=-1) > 1e-3 * (1.0 + np.abs(omega_free[None]).max(axis=-1) / size.max())) & allowed[:, None] & allowed[None]
    ambiguous = other.any(axis=(0, 1))
    # from frequencies with one solution to their neighbours
    if ambiguous.any() and not ambiguous.all():
        chosen = _continued(omega_free, allowed, chosen, ambiguous, size)
    return omega_free[chosen, np.arange(n)], ambiguous


def _continued(found: ComplexArray, allowed: np.ndarray, chosen: np.ndarray, ambiguous: np.ndarray, size: FloatArray) -> np.ndarray:
    """Follow the solutions through the ambiguous frequencies from the sure ones below, or above at the lower end."""
    chosen, n = chosen.copy(), chosen.size
    first = int(np.flatnonzero(~ambiguous)[0])
    for order in (range(first + 1, n), range(first - 1, -1, -1)):
        last = found[chosen[first], first]
        for i in order:
            if ambiguous[i]:
                away = np.sum(np.abs((found[:, i] - last) / size) ** 2, axis=1)
                chosen[i] = int(np.argmin(np.where(allowed[:, i], away, np.inf)))
            last = found[chosen[i], i]
    return chosen


def _smoothed(
    model: _Assemblies, omega: FloatArray, entries: ComplexArray, solved: list[ComplexArray], alone: ComplexArray, least_damping: float
) -> tuple[ComplexArray, ComplexArray]:
    """Most probable entries under the measurements and bounded second differences over frequency; covariances, shape (n, 3, 3).

    The first steps take each frequency's own solutions as Gaussian data and choose among them the one nearest to the smooth
    curve; then come Gauss-Newton steps on the measurements themselves. The normal equations are a band of half-width 6.
    """
    n = omega.size
    reach, near = (np.clip(np.arange(n)[:, None] + np.arange(-w, w + 1), 0, n - 1) for w in (20, 4))
    for _ in range(3):
        size = np.median(np.abs(entries)[reach], axis=1)
        bend = bending(omega, size, least_damping)
        precision = np.linalg.pinv(alone, hermitian=True, rcond=1e-13)
        # a solution that stands alone is a wrong one, however sure it is of itself
        middle = np.median(entries.real[near], axis=1) + 1j * np.median(entries.imag[near], axis=1)
        precision[np.any(np.abs(entries - middle) > ALONE * size, axis=1)] = 0.0
        smooth = band_solve(precision, np.einsum("nef,nf->ne", precision, entries), bend, size)
        candidates = np.stack([*solved, _tamed(model.polish(smooth))])
        away = np.sum(np.abs((candidates - smooth) / size) ** 2, axis=2)
        nearest = np.argmin(np.where(np.isfinite(away), away, np.inf), axis=0)
        entries = candidates[nearest, np.arange(n)]
        alone = model.conditioning(entries)[1]
    entries, damping = smooth, 1e-3
    size = np.median(np.abs(entries)[reach], axis=1)
    bend = bending(omega, size, least_damping)

    def cost(x: ComplexArray) -> float:
        total = float(np.sum(np.abs(model.residual(x)) ** 2)) + float(np.sum(np.abs(second_differences(bend, x)) ** 2))
        return total if np.isfinite(total) else np.inf

    now = cost(entries)
    for _ in range(_STEPS):
        value, slope = model.response(entries)
        matrix = slope / model.std[..., None]
        gram = np.swapaxes(matrix.conj(), 1, 2) @ matrix
        pull = np.einsum("nke,nk->ne", matrix.conj(), (value - model.values) / model.std)
        raised = gram + damping * np.einsum("nee,ef->nef", gram.real, np.eye(3))
        # the prior's own pull: second differences of what is there now
        trial = entries + band_solve(raised, -pull, bend, size, entries)
        new = cost(trial)
        if new < now:
            gained, entries, now, damping = now - new, trial, new, max(0.1 * damping, 1e-9)
            if gained < 1e-8 * now + 1e-12:
                break
        else:
            damping *= 10.0
            if damping > 1e6:
                break
    slope = model.response(entries)[1] / model.std[..., None]
    return entries, band_covariance(np.swapaxes(slope.conj(), 1, 2) @ slope, bend, size)


def _notes(
    omega: FloatArray,
    condition: FloatArray,
    regularised: np.ndarray,
    ambiguous: np.ndarray,
    loss: FloatArray,
    chi2: FloatArray,
    freedom: int,
) -> tuple[str, ...]:
    notes = []
    if regularised.any():
        worst = f"condition number up to {condition[regularised].max():.2g}"
        notes.append(
            f"{np.mean(regularised) * 100.0:.0f} % of the frequencies are ill-conditioned ({worst}) and regularised by their neighbours"
        )
    if np.median(condition) > POOR_CONDITION:
        notes.append(
            f"half of the frequencies have a condition number above {np.median(condition):.0f}: receptances measured at the spindle "
            "with the same toolings contribute more than further tip receptances"
        )
    if ambiguous.any():
        share = np.mean(ambiguous) * 100.0
        notes.append(
            f"at {share:.0f} % of the frequencies two passive flanges explain the measurements: a fourth tooling would decide between them"
        )
    active = loss < -1e-3
    if active.any():
        notes.append(
            f"not passive at {np.mean(active) * 100.0:.0f} % of the frequencies, first at {omega[active][0] / (2.0 * np.pi):.0f} Hz"
        )
    if freedom > 0 and np.median(chi2) > 3.0 * freedom:
        notes.append(
            f"misfit {np.median(chi2):.3g} where {freedom} is expected: tool-holders or joint differ from their models, or noise is larger"
        )
    return tuple(notes)
