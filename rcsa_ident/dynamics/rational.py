"""Rational functions with common poles, fitted to receptances over frequency."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from rcsa_ident.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.dynamics._kernels import pole_sum
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.dynamics.state_space import StateSpace
from rcsa_ident.errors import InputError

#: An entry smaller than this share of its rms size is fitted as if it were that large, where no noise says otherwise.
FLOOR = 0.02
#: Frequencies at least, per pole, that the order is looked for with; all are used in the last fit.
_THINNED = 25
#: Relocations of the poles at most.
_RELOCATIONS = 30
#: Share of the largest part below which a residue's further rank-one parts are dropped.
_RANK = 1e-6


class FitStatus(StrEnum):
    """How a fit ended."""

    CONVERGED = "converged"
    TOLERANCE_NOT_MET = "tolerance not met"


@dataclass(frozen=True, slots=True, eq=False)
class RankOneModes:
    """Receptances as sum of outputs inputs / (s - pole), with the conjugates of all: what modal methods work on.

    Parameters
    ----------
    pole : complex array, shape (m,) [rad/s]
        Imaginary parts not negative, real parts negative.
    outputs : complex array, shape (r, m)
    inputs : complex array, shape (m, c)
    constant : array, shape (r, c)
        Residual compliance.

    Notes
    -----
    H(s) = sum_k outputs[:, k] inputs[k] / (s - pole[k]) + conj(outputs[:, k] inputs[k]) / (s - conj(pole[k])) + constant; a
    real pole stands with half its residue, so that the sum holds for it, too (as in `ModalModel`).
    """

    pole: ComplexArray
    outputs: ComplexArray
    inputs: ComplexArray
    constant: FloatArray

    def __post_init__(self) -> None:
        for name, dtype in (("pole", complex), ("outputs", complex), ("inputs", complex), ("constant", float)):
            object.__setattr__(self, name, frozen(getattr(self, name), dtype))

    def response(self, omega: FloatArray) -> ComplexArray:
        """Return the receptances, shape (n, r, c)."""
        residues = np.einsum("rm,mc->mrc", self.outputs, self.inputs)
        return _pair_sum(np.asarray(omega, dtype=float), self.pole, residues) + self.constant

    def state_space(self) -> StateSpace:
        """Return the real state space in modal form: two states for each pair of poles, one for a real pole."""
        order = int(np.sum(np.where(self.pole.imag > 0.0, 2, 1)))
        r, c = self.constant.shape
        a, b, output, k = np.zeros((order, order)), np.zeros((order, c)), np.zeros((r, order)), 0
        for pole, u, v in zip(self.pole, self.outputs.T, self.inputs, strict=True):
            if pole.imag > 0.0:
                # z' = pole z + v f, y = 2 Re(u z) in the real and imaginary part of z
                a[k : k + 2, k : k + 2] = [[pole.real, -pole.imag], [pole.imag, pole.real]]
                b[k], b[k + 1] = v.real, v.imag
                output[:, k], output[:, k + 1] = 2.0 * u.real, -2.0 * u.imag
                k += 2
            else:
                a[k, k], b[k], output[:, k] = pole.real, v.real, 2.0 * u.real
                k += 1
        return StateSpace(a, b, output, self.constant)


@dataclass(frozen=True, slots=True, eq=False)
class RationalFit:
    """A stable rational function with real coefficients: common poles, a residue matrix for each.

    Parameters
    ----------
    pole : complex array, shape (m,) [rad/s]
        Imaginary parts not negative, real parts negative.
    residue : complex array, shape (m, r, c)
        Of H(s) = sum_k residue[k] / (s - pole[k]) + conj(residue[k]) / (s - conj(pole[k])) + constant; a real pole's is half.
    constant : array, shape (r, c)
        Residual compliance; 0 where the fit is strictly proper.
    error : float [-]
        Root mean square of the weighted misfit: relative where no noise was given, else in standard deviations.
    relative_error : float [-]
        Norm of the misfit over norm of the values, the worst entry's.
    order : int
        Number of poles, both of each pair counted: the degree of the denominator.
    status : FitStatus
    """

    pole: ComplexArray
    residue: ComplexArray
    constant: FloatArray
    error: float
    relative_error: float
    order: int
    status: FitStatus

    def __post_init__(self) -> None:
        for name, dtype in (("pole", complex), ("residue", complex), ("constant", float)):
            object.__setattr__(self, name, frozen(getattr(self, name), dtype))

    def response(self, omega: FloatArray) -> ComplexArray:
        """Return the function over frequency, shape (n, r, c)."""
        return _pair_sum(np.asarray(omega, dtype=float), self.pole, self.residue) + self.constant

    def modes(self, rank: float = _RANK) -> RankOneModes:
        """Return the function with each residue as a sum of rank-one parts, by singular values.

        Parameters
        ----------
        rank : float
            Share of a residue's largest singular value below which a part is dropped; 1 keeps a single shape for each pole, as a
            structure's modes have.
        """
        parts = []
        for pole, residue in zip(self.pole, self.residue, strict=True):
            # a real residue has real shapes
            left, size, right = np.linalg.svd(residue if pole.imag > 0.0 else residue.real, full_matrices=False)
            kept = max(int(np.sum(size > rank * size[0])), 1)
            parts += [(pole, left[:, j] * np.sqrt(size[j]), right[j] * np.sqrt(size[j])) for j in range(kept)]
        r, c = self.constant.shape
        return RankOneModes(
            np.array([p for p, _, _ in parts]),
            np.array([u for _, u, _ in parts]).reshape(-1, r).T,
            np.array([v for _, _, v in parts]).reshape(-1, c),
            self.constant,
        )

    def state_space(self) -> StateSpace:
        """Return the real state space in modal form."""
        return self.modes(1e-14).state_space()


def rational_fit(
    omega: FloatArray,
    values: ComplexArray,
    *,
    order: int | None = None,
    tolerance: float = 1e-3,
    noise: FloatArray | float | None = None,
    weight: FloatArray | None = None,
    constant: bool = True,
    highest_order: int = 60,
) -> RationalFit:
    """Return the rational function that fits receptances best, by relaxed vector fitting.

    Parameters
    ----------
    omega : array, shape (n,) [rad/s]
        Above 0.
    values : complex array, shape (n,), (n, r) or (n, r, c)
        All entries share the poles.
    order : int, optional
        Number of poles. By default the smallest with which the weighted rms misfit is within the tolerance, or within the noise.
    tolerance : float
        Relative rms misfit that is looked for where no noise is given.
    noise : array of the values' shape (or broadcast to it), optional
        Standard deviation of the real and of the imaginary part each.
    weight : array of the values' shape (or broadcast to it), optional
        Further factor on each misfit.
    constant : bool
        With a real constant (the modes above the band), else strictly proper.
    highest_order : int
        Where the search ends. If no order is good enough, Bayes's information criterion chooses, and the status says so.

    Raises
    ------
    InputError
        If values and frequencies do not fit each other, or hold too little for the order.

    Notes
    -----
    With sigma(s) = sum_k c~_k phi_k(s) + d~ and the poles of the last step, sigma h = sum_k c_k phi_k + d is solved by linear
    least squares; zeros of sigma are the next poles (Gustavsen and Semlyen 1999; relaxed: Gustavsen 2006; each entry
    condensed by its own QR: Deschrijver et al. 2008). An unstable pole is mirrored. The next higher order starts from the poles
    of the last and a pair where the misfit is largest, and from evenly spaced poles.
    """
    problem = _Problem.of(omega, values, tolerance, noise, weight, constant)
    if order is not None:
        if not 1 <= order <= problem.highest:
            raise InputError("order", order, f"a whole number from 1 to {problem.highest}")
        candidates = list(_growing(problem.thinned(order), order))
        best = min((c for c in candidates if c.order == order), key=lambda c: c.rms)
        return problem.finished(best.pole, True)
    found: list[_Candidate] = []
    for candidate in _growing(problem.thinned(min(highest_order, problem.highest)), min(highest_order, problem.highest)):
        found.append(candidate)
        if candidate.rms <= problem.target(candidate.order):
            fit = problem.finished(candidate.pole, True)
            if fit.error <= problem.goal(fit.order):
                return fit
    if not found:
        raise InputError("frequencies", problem.omega.size, "enough for two poles")
    return problem.finished(min(found, key=problem.criterion).pole, False)


def tip_modes(receptance: Receptance, **options: float | int | bool | None) -> RankOneModes:
    """Return modal shapes for the whole receptance; planes that do not couple keep their own poles.

    Parameters
    ----------
    receptance : Receptance
        Square; where all entries off the diagonal are 0, each diagonal entry is fitted for itself.
    options
        Of `rational_fit`.
    """
    values = receptance.values
    r, c = values.shape[1:]
    positive = receptance.omega > 0.0
    omega, values = receptance.omega[positive], values[positive]
    if r != c or np.any(values[:, ~np.eye(r, dtype=bool)]):
        return rational_fit(omega, values, **options).modes()  # type: ignore[arg-type]
    poles, outputs, inputs, rest = [], [], [], np.zeros((r, r))
    for i in range(r):
        if not np.any(values[:, i, i]):
            continue
        part = rational_fit(omega, values[:, i, i], **options).modes()  # type: ignore[arg-type]
        unit = np.eye(r)[i]
        poles.append(part.pole)
        outputs.append(unit[:, None] * part.outputs)
        inputs.append(part.inputs * unit)
        rest[i, i] = part.constant[0, 0]
    if not poles:
        raise InputError("receptance", "zero at every frequency", "at least one entry that is not")
    return RankOneModes(np.concatenate(poles), np.hstack(outputs), np.vstack(inputs), rest)


@dataclass(frozen=True, slots=True, eq=False)
class _Candidate:
    """Poles and how well they do: weighted rms misfit and the misfit over frequency."""

    pole: ComplexArray
    rms: float
    misfit: FloatArray

    @property
    def order(self) -> int:
        return _order(self.pole)


@dataclass(frozen=True, slots=True, eq=False)
class _Problem:
    """Entries side by side, in units of the highest frequency and of each entry's size.

    omega: (n,) scaled; values, weight: (n, e); weight makes a misfit of 1 out of what is allowed.
    """

    omega: FloatArray
    values: ComplexArray
    weight: FloatArray
    constant: bool
    noisy: bool
    top: float
    size: FloatArray
    shape: tuple[int, ...]
    tolerance: float

    @classmethod
    def of(
        cls,
        omega: FloatArray,
        values: ComplexArray,
        tolerance: float,
        noise: FloatArray | float | None,
        weight: FloatArray | None,
        constant: bool,
    ) -> _Problem:
        omega, values = np.asarray(omega, dtype=float), np.asarray(values, dtype=complex)
        if values.shape[:1] != omega.shape or omega.ndim != 1 or values.ndim not in (1, 2, 3):
            raise InputError("values", values.shape, f"one to three axes, the first with {omega.size} frequencies")
        if omega.size < 4 or not np.all(np.isfinite(omega)) or np.any(omega <= 0.0):
            raise InputError("frequencies", f"{omega.size} of them", "four or more, finite and above 0")
        if not np.all(np.isfinite(values)) or not np.any(values):
            raise InputError("values", "not finite, or all zero", "finite values that are not all zero")
        flat = values.reshape(omega.size, -1)
        rms = np.sqrt(np.mean(np.abs(flat) ** 2, axis=0))
        rms[rms == 0.0] = rms.max()
        if noise is None:
            allowed = tolerance * np.maximum(np.abs(flat), FLOOR * rms)
        else:
            allowed = np.sqrt(2.0) * np.broadcast_to(np.asarray(noise, dtype=float), values.shape).reshape(flat.shape)
        if not np.all(allowed > 0.0):
            raise InputError("tolerance or noise", float(np.min(allowed)), "above 0 everywhere")
        scale = 1.0 / allowed
        if weight is not None:
            scale = scale * np.broadcast_to(np.asarray(weight, dtype=float), values.shape).reshape(flat.shape)
        top = float(omega.max())
        return cls(
            omega / top,
            flat / rms,
            scale * rms,
            constant,
            noise is not None,
            top,
            rms,
            values.shape,
            1.0 if noise is not None else tolerance,
        )

    @property
    def highest(self) -> int:
        """The order that leaves a point for each unknown."""
        n, e = self.values.shape
        return max((2 * n * e - e) // (2 + e) - 1, 1)

    def thinned(self, order: int) -> _Problem:
        """The problem on fewer frequencies, evenly left out."""
        n = self.omega.size
        wanted = max(_THINNED * order, 400)
        if n <= 2 * wanted:
            return self
        keep = np.round(np.linspace(0, n - 1, wanted)).astype(int)
        return replace(self, omega=self.omega[keep], values=self.values[keep], weight=self.weight[keep])

    def unknowns(self, order: int) -> int:
        return order + self.values.shape[1] * (order + self.constant)

    def target(self, order: int) -> float:
        """Weighted rms misfit that is good enough."""
        if not self.noisy:
            return 1.0
        points = 2 * self.values.size
        free = max(points - self.unknowns(order), 1)
        return float(np.sqrt(free / points) * (1.0 + 3.0 / np.sqrt(2.0 * free)))

    def goal(self, order: int) -> float:
        """The same in the unit of `RationalFit.error`."""
        return 1.0001 * self.target(order) * self.tolerance

    def criterion(self, candidate: _Candidate) -> float:
        points = 2 * self.values.size
        return points * float(np.log(candidate.rms**2)) + self.unknowns(candidate.order) * float(np.log(points))

    def relocated(self, pole: ComplexArray) -> tuple[ComplexArray, float]:
        """The zeros of the best sigma for these poles, mirrored where unstable, one of each pair; the rms misfit with these poles."""
        basis = _basis(self.omega, pole)
        m = basis.shape[1]
        extended = np.hstack([basis, np.ones((basis.shape[0], 1))]) if self.constant else basis
        full = np.hstack([basis, np.ones((basis.shape[0], 1))])
        blocks = []
        for h, w in zip(self.values.T, self.weight.T, strict=True):
            rows = w[:, None] * np.hstack([extended, -h[:, None] * full])
            triangle = np.linalg.qr(np.vstack([rows.real, rows.imag]), mode="r")
            blocks.append(triangle[extended.shape[1] :, extended.shape[1] :])
        # the last column is h itself less what these poles explain
        rms = float(np.sqrt(sum(np.sum(block[:, -1] ** 2) for block in blocks) / self.values.size))
        # sigma may not vanish: its mean real part is 1, with the weight that the values have
        scale = float(np.linalg.norm(self.weight * self.values)) / self.omega.size
        blocks.append(scale * np.sum(full.real, axis=0)[None])
        matrix = np.vstack(blocks)
        right = np.zeros(matrix.shape[0])
        right[-1] = scale * self.omega.size
        size = np.linalg.norm(matrix, axis=0)
        size[size == 0.0] = 1.0
        solution = np.linalg.lstsq(matrix / size, right, rcond=None)[0] / size
        numerator, d = solution[:m], solution[m]
        if abs(d) < 1e-8:
            d = 1e-8 if d >= 0.0 else -1e-8
            held = np.linalg.lstsq(matrix[:-1, :m] / size[:m], -d * matrix[:-1, m], rcond=None)[0]
            numerator = held / size[:m]
        a, b = _companion(pole)
        zeros = np.linalg.eigvals(a - np.outer(b, numerator) / d).astype(complex)
        zeros = np.where(zeros.real > 0.0, -zeros.conj(), zeros)
        # a pole on the axis would be no fit at all
        zeros = np.minimum(zeros.real, -1e-9 * np.maximum(np.abs(zeros), 1e-9)) + 1j * zeros.imag
        zeros = zeros[zeros.imag >= 0.0]
        return zeros[np.argsort(np.abs(zeros), kind="stable")], rms

    def residues(self, pole: ComplexArray) -> tuple[FloatArray, ComplexArray]:
        """Coefficients of the real basis, shape (m + constant, e), and the weighted misfit, shape (n, e)."""
        basis = _basis(self.omega, pole)
        if self.constant:
            basis = np.hstack([basis, np.ones((basis.shape[0], 1))])
        coefficients = np.empty((basis.shape[1], self.values.shape[1]))
        for e, (h, w) in enumerate(zip(self.values.T, self.weight.T, strict=True)):
            rows = np.hstack([(w[:, None] * basis).real.T, (w[:, None] * basis).imag.T]).T
            size = np.linalg.norm(rows, axis=0)
            right = np.concatenate([(w * h).real, (w * h).imag])
            coefficients[:, e] = np.linalg.lstsq(rows / size, right, rcond=None)[0] / size
        return coefficients, self.weight * (basis @ coefficients - self.values)

    def settled(self, pole: ComplexArray) -> _Candidate:
        """The best poles on the way that starts from these."""
        best, least, idle = pole, np.inf, 0
        for _ in range(_RELOCATIONS):
            moved, rms = self.relocated(pole)
            # what no longer gains a thousandth is not worth the next relocation
            idle = 0 if rms < 0.999 * least else idle + 1
            if rms < least:
                best, least = pole, rms
            if idle > 2:
                break
            pole = moved
        misfit = np.sum(np.abs(self.residues(best)[1]) ** 2, axis=1)
        return _Candidate(best, float(np.sqrt(np.sum(misfit) / self.values.size)), misfit)

    def finished(self, pole: ComplexArray, converged: bool) -> RationalFit:
        """The fit on all frequencies, in physical units."""
        pole = self.settled(pole).pole
        coefficients, weighted = self.residues(pole)
        misfit = np.abs(weighted / self.weight)
        relative = np.linalg.norm(misfit, axis=0) / np.maximum(np.linalg.norm(self.values, axis=0), 1e-300)
        residue, k = np.empty((pole.size, self.values.shape[1]), dtype=complex), 0
        for i, p in enumerate(pole):
            if p.imag > 0.0:
                residue[i] = coefficients[k] + 1j * coefficients[k + 1]
                k += 2
            else:
                residue[i] = 0.5 * coefficients[k]
                k += 1
        constant = coefficients[k] if self.constant else np.zeros(self.values.shape[1])
        rms = float(np.sqrt(np.mean(np.abs(weighted) ** 2)))
        shape = (*self.shape[1:], 1, 1)[:2]
        return RationalFit(
            pole=pole * self.top,
            residue=(residue * self.top * self.size).reshape(-1, *shape),
            constant=(constant * self.size).reshape(shape),
            error=rms * self.tolerance,
            relative_error=float(relative.max()),
            order=_order(pole),
            status=FitStatus.CONVERGED if converged else FitStatus.TOLERANCE_NOT_MET,
        )


def _growing(problem: _Problem, highest: int) -> Iterator[_Candidate]:
    """Candidates of ascending order."""
    low, high = float(problem.omega.min()), 1.0
    last: _Candidate | None = None
    for order in range(2 - highest % 2 if highest < 3 else 2, highest + 1, 1 if highest < 4 else 2):
        yield (last := _best_of(problem, order, last, low, high))
    if highest >= 4 and highest % 2:
        yield _best_of(problem, highest, last, low, high)


def _best_of(problem: _Problem, order: int, last: _Candidate | None, low: float, high: float) -> _Candidate:
    starts = [_spaced(order, low, high)]
    if last is not None and last.order < order:
        worst = problem.omega[int(np.argmax(last.misfit))]
        more = _spaced(order - last.order, worst, worst) if order - last.order == 2 else np.array([-worst + 0.0j])
        starts.append(np.concatenate([last.pole, more]))
    found = [problem.settled(start) for start in starts]
    return min((c for c in found if c.order == order), key=lambda c: c.rms, default=found[0])


def _spaced(order: int, low: float, high: float) -> ComplexArray:
    """Lightly damped pairs evenly over the band, and one real pole where the order is odd."""
    frequency = np.linspace(low, high, order // 2) if order // 2 > 1 else np.array([0.5 * (low + high)] * (order // 2))
    pairs = frequency * (-0.02 + 1j)
    return np.concatenate([pairs, np.full(order % 2, -0.5 * (low + high) + 0.0j)])


def _order(pole: ComplexArray) -> int:
    return int(np.sum(np.where(pole.imag > 0.0, 2, 1)))


def _basis(omega: FloatArray, pole: ComplexArray) -> ComplexArray:
    """Functions with real coefficients: two for a pair, one for a real pole, shape (n, order)."""
    s = 1j * omega[:, None]
    direct, mirrored = 1.0 / (s - pole), 1.0 / (s - pole.conj())
    columns = []
    for k, p in enumerate(pole):
        columns.append(direct[:, k] + mirrored[:, k] if p.imag > 0.0 else direct[:, k])
        if p.imag > 0.0:
            columns.append(1j * (direct[:, k] - mirrored[:, k]))
    return np.stack(columns, axis=1)


def _companion(pole: ComplexArray) -> tuple[FloatArray, FloatArray]:
    """Real blocks whose eigenvalues are the poles, and the input that goes with `_basis`."""
    order, k = _order(pole), 0
    a: FloatArray = np.zeros((order, order))
    b: FloatArray = np.zeros(order)
    for p in pole:
        if p.imag > 0.0:
            a[k : k + 2, k : k + 2] = [[p.real, p.imag], [-p.imag, p.real]]
            b[k] = 2.0
            k += 2
        else:
            a[k, k], b[k] = p.real, 1.0
            k += 1
    return a, b


def _pair_sum(omega: FloatArray, pole: ComplexArray, residue: ComplexArray) -> ComplexArray:
    m, r, c = residue.shape
    flat = np.ascontiguousarray(residue.reshape(m, r * c))
    both = np.concatenate([flat, flat.conj()])
    return pole_sum(omega, np.concatenate([pole, pole.conj()]), both).reshape(omega.size, r, c)
