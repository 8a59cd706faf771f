"""Vector fitting [gustavsen1999]: poles of a rational function that several responses share, by relocation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.errors import InputError

#: An entry smaller than this share of its rms size is fitted as if it were that large, where no noise says otherwise.
FLOOR = 0.02
#: Frequencies at least, per pole, that the order is looked for with; all are used in the last fit.
_THINNED = 25
#: Relocations of the poles at most.
_RELOCATIONS = 30
#: Correlation of neighbouring lines' misfits at most: of a few points at least each is taken to tell something of its own.
_ALIKE = 0.9


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """Poles and how well they do: weighted rms misfit, the misfit over frequency, and how much each line's tells that its neighbour's
    does not, as a share."""

    pole: ComplexArray
    rms: float
    misfit: FloatArray
    independent: float

    @property
    def order(self) -> int:
        """Number of poles, both of each pair counted."""
        return order_of(self.pole)

    def with_pair(self, omega: FloatArray, count: int = 2) -> ComplexArray:
        """Return the poles and a pair, or so many, where the misfit is largest; frequencies scaled, shape (n,)."""
        worst = omega[int(np.argmax(self.misfit))]
        return np.concatenate([self.pole, _spaced(count, worst, worst) if count == 2 else np.array([-worst + 0.0j])])


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
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
    ) -> Problem:
        """Return the scaled problem; the parameters are those of `rational_fit`, checked here.

        `omega` [rad/s], shape (n,)
        `values`: complex array, shape (n,), (n, r) or (n, r, c)
        `tolerance`: relative rms misfit that counts as 1 where no noise is given
        `noise`, `weight`: arrays of the values' shape (or broadcast to it), or None
        `constant`: whether a real constant is fitted, too
        """
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
        """The highest order that leaves a point for each unknown."""
        n, e = self.values.shape
        return max((2 * n * e - e) // (2 + e) - 1, 1)

    def thinned(self, order: int) -> Problem:
        """Return the problem on fewer frequencies, evenly left out."""
        n = self.omega.size
        wanted = max(_THINNED * order, 400)
        if n <= 2 * wanted:
            return self
        keep = np.round(np.linspace(0, n - 1, wanted)).astype(int)
        return replace(self, omega=self.omega[keep], values=self.values[keep], weight=self.weight[keep])

    def unknowns(self, order: int) -> int:
        """Return the number of real unknowns of a fit of this order."""
        return order + self.values.shape[1] * (order + self.constant)

    def target(self, order: int) -> float:
        """Return the weighted rms misfit that is good enough for an order."""
        if not self.noisy:
            return 1.0
        points = 2 * self.values.size
        free = max(points - self.unknowns(order), 1)
        return float(np.sqrt(free / points) * (1.0 + 3.0 / np.sqrt(2.0 * free)))

    def goal(self, order: int) -> float:
        """Return the same in the unit of `RationalFit.error`."""
        return 1.0001 * self.target(order) * self.tolerance

    def criterion(self, candidate: Candidate, independent: float = 1.0) -> float:
        """Return Bayes's information criterion [schwarz1978], less is better, where so large a share of the points tells something new."""
        points = 2 * self.values.size * independent
        return points * float(np.log(candidate.rms**2)) + self.unknowns(candidate.order) * float(np.log(points))

    def relocated(self, pole: ComplexArray) -> tuple[ComplexArray, float]:
        """Return the zeros of the best sigma for these poles, mirrored where unstable, one of each pair; and the rms misfit."""
        basis = _basis(self.omega, pole)
        m = basis.shape[1]
        extended = np.hstack([basis, np.ones((basis.shape[0], 1))]) if self.constant else basis
        full = np.hstack([basis, np.ones((basis.shape[0], 1))])
        blocks = []
        for h, w in zip(self.values.T, self.weight.T, strict=True):
            rows = w[:, None] * np.hstack([extended, -h[:, None] * full])
            triangle: FloatArray = np.asarray(np.linalg.qr(np.vstack([rows.real, rows.imag]), mode="r"))
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
        """Return the coefficients of the real basis, shape (m + constant, e), and the weighted misfit, shape (n, e)."""
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

    def settled(self, pole: ComplexArray) -> Candidate:
        """Return the best poles on the way that starts from these."""
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
        left = self.residues(best)[1]
        misfit = np.sum(np.abs(left) ** 2, axis=1)
        # of white noise neighbours tell nothing of each other; what a window smears, or poles leave, they share: of points whose
        # correlation falls with the distance so many are worth as much as independent ones [bayley1946]
        alike = float(np.clip(np.vdot(left[1:], left[:-1]).real / max(np.sum(misfit), 1e-300), 0.0, _ALIKE))
        return Candidate(best, float(np.sqrt(np.sum(misfit) / self.values.size)), misfit, (1.0 - alike) / (1.0 + alike))


def growing(problem: Problem, highest: int) -> Iterator[Candidate]:
    """Yield the best fit of each order, ascending up to the highest."""
    low, high = float(problem.omega.min()), 1.0
    last: Candidate | None = None
    for order in range(2 - highest % 2 if highest < 3 else 2, highest + 1, 1 if highest < 4 else 2):
        yield (last := _best_of(problem, order, last, low, high))
    if highest >= 4 and highest % 2:
        yield _best_of(problem, highest, last, low, high)


def _best_of(problem: Problem, order: int, last: Candidate | None, low: float, high: float) -> Candidate:
    starts = [_spaced(order, low, high)]
    if last is not None and last.order < order:
        starts.append(last.with_pair(problem.omega, order - last.order))
    found = [problem.settled(start) for start in starts]
    return min((c for c in found if c.order == order), key=lambda c: c.rms, default=found[0])


def _spaced(order: int, low: float, high: float) -> ComplexArray:
    """Lightly damped pairs evenly over the band, and one real pole where the order is odd."""
    frequency = np.linspace(low, high, order // 2) if order // 2 > 1 else np.array([0.5 * (low + high)] * (order // 2))
    pairs = frequency * (-0.02 + 1j)
    return np.concatenate([pairs, np.full(order % 2, -0.5 * (low + high) + 0.0j)])


def order_of(pole: ComplexArray) -> int:
    """Return the number of poles, both of each pair counted."""
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
    order, k = order_of(pole), 0
    a = np.zeros((order, order))
    b = np.zeros(order)
    for p in pole:
        if p.imag > 0.0:
            a[k : k + 2, k : k + 2] = [[p.real, p.imag], [-p.imag, p.real]]
            b[k] = 2.0
            k += 2
        else:
            a[k, k], b[k] = p.real, 1.0
            k += 1
    return a, b
