"""Hill's determinant of a milling cut: all harmonics of the directional coefficients at one spindle speed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import scipy.linalg

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.forms import Directions, lines_of_rows
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.stability._kernels.depth_at_speed import receptance_at
from rcsa_ident.stability.eigenvalue_tracking import Branches, Crossing, crossings_between
from rcsa_ident.stability.regeneration import directions_of, regeneration

#: Largest change of a harmonic's receptance from one frequency to the next, as a share of it and of the largest one.
_STEP, _FLOOR = 0.25, 0.05
#: Harmonics are looked at in the search whose own eigenvalue may reach this share of that at the limit; left out are those
#: whose receptance stays below this share of the largest.
_LOUD, _SILENT = 0.15, 1e-3
#: Frequencies in half a tooth-passing interval at least, and how often the steps between may be halved.
_LEAST, _HALVINGS = 25, 8
#: Crossings up to this multiple of the smallest depth are refined: the silent harmonics and the helix may change their order.
_RANKS = 1.5
#: Change of the first harmonic's phase by the helix [rad] beyond which the search is repeated with the depth found.
_TURN = 0.05
#: Change of the depth, as a share of it, beyond which it is repeated where the cutter has a shape.
_CLOSE = 0.02
#: Searches at one speed at most.
_LOOKS = 6
#: Steps of Newton's method for a crossing.
_NEWTON = 15
#: Delays whose phases differ by more stand apart [rad]; a polynomial of so many nodes, and more with the phase, is exact to 1e-10.
_APART, _DEGREE = 1.0, 14


@dataclass(frozen=True, slots=True, eq=False)
class TipMotion:
    """The tip's receptance at any frequency, its entries row by row, shape (n, r r)."""

    omega: FloatArray
    values: ComplexArray

    @classmethod
    def of(cls, receptance: Receptance) -> TipMotion:
        r = len(receptance.rows)
        kept = np.flatnonzero(receptance.omega > 0.0)
        if kept.size < 2 or np.any(np.diff(receptance.omega[kept]) <= 0.0):
            raise InputError("tip receptance frequencies", f"{receptance.omega.size} frequencies", "two or more above 0, ascending")
        values = receptance.values[kept].reshape(-1, r * r)
        if not np.all(np.isfinite(values)):
            raise InputError("tip receptance", "values that are not finite", "finite values at every frequency above 0")
        if not np.any(values):
            raise InputError("tip receptance", "zero at every frequency", "at least one flexible direction")
        return cls(np.ascontiguousarray(receptance.omega[kept]), np.ascontiguousarray(values))

    @property
    def size(self) -> float:
        return float(np.max(np.abs(self.values)))

    @property
    def directions(self) -> Directions:
        return directions_of(round(np.sqrt(self.values.shape[1])))

    def at(self, omega: FloatArray) -> ComplexArray:
        """Return the receptances, shape (..., r, r)."""
        flat, r = np.ascontiguousarray(omega.ravel()), self.directions
        return receptance_at(self.omega, self.values, flat).reshape(*omega.shape, r, r)


@dataclass(frozen=True, slots=True, eq=False)
class Harmonics:
    """The harmonics of a cut's stiffness per depth, by delay, and of what it rubs with: n of them about zero.

    `delay` [rad], shape (d,); `stiffness` [N/m^2], shape (d, n, r, r)
    `rubbing` [N/m^2], shape (n, r, r): per velocity, times the spindle's speed
    """

    delay: FloatArray
    stiffness: ComplexArray
    rubbing: ComplexArray | None


class PeriodicTeeth:
    """A cut's stiffness as harmonics of the frequency with which it repeats itself: tooth passing, or the spindle's with unlike teeth.

    `harmonics`: that are kept; None keeps all
    `directions`: 2, 3 or 5
    """

    def __init__(self, process: MillingProcess, harmonics: int | None, directions: Directions) -> None:
        self.process, self.kept, self.directions = process, harmonics, directions
        #: How often a turn repeats itself.
        self.base = process.cutter.symmetry
        #: By which the first harmonic is turned per depth [rad/m].
        self.slope = 0.5 * self.base * process.cutter.largest_lag
        self._latest: tuple[int, float] | None = None
        self._harmonics: Harmonics | None = None
        self._straight: dict[int, Harmonics] = {}

    def harmonics(self, count: int, depth: float) -> Harmonics:
        """Return the harmonics -count..count, tooth 1 at immersion 0 with its tip when t = 0."""
        if self._harmonics is None or self._latest != (count, depth):
            make = self._leaning if self.process.is_plain else partial(self._computed, self.process)
            self._latest, self._harmonics = (count, depth), make(count, depth)
        return self._harmonics

    def _leaning(self, count: int, depth: float) -> Harmonics:
        """The harmonics of a wall: all of its edges lag alike, so that those of straight ones are turned and spread."""
        cutter = self.process.cutter
        if count not in self._straight:
            straight = replace(self.process, cutter=replace(cutter, helix=0.0))
            self._straight[count] = self._computed(straight, count, cutter.diameter)
        known = self._straight[count]
        half = self.slope * depth * np.arange(-count, count + 1)
        turn = (np.exp(-1j * half) * np.sinc(half / np.pi))[:, None, None]
        return Harmonics(known.delay, turn * known.stiffness, None if known.rubbing is None else turn * known.rubbing)

    def _computed(self, process: MillingProcess, count: int, depth: float) -> Harmonics:
        order = np.arange(-count, count + 1)
        kept = np.abs(order) <= (count if self.kept is None else self.kept)
        known = regeneration(process, depth, self.directions)
        rows = known.rows
        delay, place = np.unique(np.round(rows.delay, 12), return_inverse=True)
        per_depth = (kept / depth)[:, None, None, None] / rows.width[:, None, None]
        members = (place == np.arange(delay.size)[:, None]).astype(float)
        lines = per_depth * lines_of_rows(rows, known.stiffness, self.base * order)
        stiffness = np.tensordot(members, lines, axes=(1, 1))
        delay, stiffness = fewer_delays(delay, stiffness, self.base * (count + 1.0))
        if known.rubbing is None:
            return Harmonics(delay, stiffness, None)
        return Harmonics(delay, stiffness, np.sum(per_depth * lines_of_rows(rows, known.rubbing, self.base * order), axis=1))


def fewer_delays(delay: FloatArray, stiffness: ComplexArray, highest: float) -> tuple[FloatArray, ComplexArray]:
    """Return fewer delays that act as many do: between them e^{-i w tau} is a polynomial through Chebyshev's nodes.

    `delay` [rad], shape (d,): ascending
    `stiffness`, shape (d, ...): what acts with each
    `highest` [-]: largest frequency over the spindle's
    """
    delays, acting = [], []
    for places in np.split(np.arange(delay.size), np.flatnonzero(highest * np.diff(delay) > _APART) + 1):
        own, half = delay[places], 0.5 * float(delay[places[-1]] - delay[places[0]])
        count = _DEGREE + int(np.ceil(1.5 * highest * half))
        if count >= places.size:
            delays.append(own)
            acting.append(stiffness[places])
            continue
        nodes = -np.cos(np.pi * (np.arange(count) + 0.5) / count)
        x = (own - own[0]) / half - 1.0
        # values of Lagrange's polynomials from Chebyshev's, which are orthogonal on the nodes
        degree = np.arange(count)[:, None]
        at_nodes, at_delays = (np.cos(degree * np.arccos(np.clip(each, -1.0, 1.0))) for each in (nodes, x))
        at_nodes *= np.where(degree == 0, 1.0, 2.0) / count
        delays.append(own[0] + half * (nodes + 1.0))
        acting.append(np.tensordot(at_nodes.T @ at_delays, stiffness[places], axes=1))
    return np.concatenate(delays), np.concatenate(acting)


@dataclass(frozen=True, slots=True, eq=False)
class Limit:
    """A depth at which a vibration neither grows nor dies away; None in `chatter` where the search for it did not end."""

    depth: float
    chatter: float | None


class Hill:
    """The eigenvalue problem of one spindle speed."""

    def __init__(self, tip: TipMotion, teeth: PeriodicTeeth, speed: float, guess: float) -> None:
        self.tip, self.teeth, self.speed, self.guess = tip, teeth, speed, guess
        #: Frequency with which the cut repeats itself.
        self.passing = passing = teeth.base * speed
        count = int(np.ceil(tip.omega[-1] / passing)) + 1
        self.every = np.arange(-count, count)
        self.nodes, size = self._nodes(self.every)
        # the largest eigenvalue that a harmonic may have by itself
        mean = teeth.harmonics(0, guess)
        self.strength = 2.0 * float(np.linalg.norm(mean.stiffness.sum(axis=0)[0], 2)) * size
        if mean.rubbing is not None:
            rub = float(np.linalg.norm(mean.rubbing[0], 2)) / speed
            self.strength = self.strength + rub * passing * np.abs(self.every + 0.5) * size
        self.heard = self._stronger(_SILENT * self.strength.max())
        self.loud = self._stronger(_LOUD * self.strength.max())

    def limit(self, max_depth: float) -> Limit | None:
        """Return the smallest depth up to `max_depth`.

        It is looked for with the loud harmonics and the helix (and shape) of a depth that is guessed, and refined with all harmonics
        and its own; where the guess was far off, it is looked for again.
        """
        found: list[Limit] = []
        looked, best, lost = self.guess, None, None
        plain = self.teeth.process.is_plain
        for _ in range(_LOOKS):
            refined: list[Limit] = []
            for crossing in sorted(self._crossings(looked, max_depth), key=lambda c: -c.value):
                if refined and crossing.value * min(r.depth for r in refined) < 1.0 / _RANKS:
                    break
                refined.append(self._refine(crossing, looked))
            found += [r for r in refined if r.chatter is not None]
            best = min(found, key=lambda r: r.depth, default=None)
            lost = min(
                (r for r in refined if r.chatter is None and (best is None or r.depth < best.depth)), key=lambda r: r.depth, default=None
            )
            depth = max_depth if best is None else best.depth
            # a crossing that was lost is perhaps none any more with the other harmonics and the helix as they should be
            wanted = self.heard if lost is not None else self._stronger(_LOUD / depth)
            if lost is not None:
                depth = lost.depth
            elif wanted.size <= self.loud.size and (best is None or self._near(depth, looked, plain)):
                break
            looked = depth
            if wanted.size > self.loud.size:
                self.loud = wanted
        answer = best if lost is None else lost
        return answer if answer is not None and answer.depth <= max_depth else None

    def _near(self, depth: float, looked: float, plain: bool) -> bool:
        """Whether what was looked at with one depth holds for another."""
        alike = abs(depth - looked) * self.teeth.slope <= _TURN
        return alike if plain else alike and abs(depth - looked) <= _CLOSE * depth

    def _stronger(self, strength: float) -> np.ndarray:
        """Harmonics up to the last whose own eigenvalue may be so large, at least two: harmonic -1 - l is the mirror of l."""
        reach = np.abs(self.every + 0.5)
        loud = reach[(self.strength > strength) & (self.strength > _SILENT * self.strength.max())]
        return self.every[reach <= max(loud.max(initial=0.0), 1.0)]

    def matrices(self, offset: np.ndarray, omega: FloatArray, depth: float) -> ComplexArray:
        """Return sum_d K_d[k - l] (1 - e^{-i (w + l w_b) tau_d}) G(w + l w_b) and what rubs beside it, shape (n, r h, r h) [1/m].

        K_d are the harmonics of the stiffness per depth with the delay tau_d, w_b the frequency with which the cut repeats itself.
        """
        h, r = offset.size, self.teeth.directions
        apart = offset[:, None] - offset + h - 1
        frequency = omega[:, None] + self.passing * offset
        tip = self.tip.at(frequency)
        known = self.teeth.harmonics(h - 1, depth)
        # the first sign is that of the force on the tip: F = K (q - q(t - tau))
        if known.delay.size == 1 and abs(self.teeth.base * known.delay[0] - 2.0 * np.pi) < 1e-9:
            factor = 1.0 - np.exp(-1j * omega * known.delay[0] / self.speed)
            wide = known.stiffness[0][apart].transpose(1, 0, 2, 3).reshape(h, r * h, r) @ (factor[:, None, None, None] * tip)
        else:
            factors = 1.0 - np.exp(-1j * frequency[:, None, :] * (known.delay / self.speed)[:, None])
            each = known.stiffness[:, apart].transpose(2, 0, 1, 3, 4).reshape(h, known.delay.size, h * r * r)
            together = factors.transpose(2, 0, 1) @ each
            wide = together.reshape(h, omega.size, h * r, r).transpose(1, 0, 2, 3) @ tip
        if known.rubbing is not None:
            moving = (1j / self.speed * frequency)[:, :, None, None] * tip
            wide = wide + known.rubbing[apart].transpose(1, 0, 2, 3).reshape(h, r * h, r) @ moving
        return wide.transpose(0, 2, 1, 3).reshape(omega.size, r * h, r * h)

    def _nodes(self, offset: np.ndarray) -> tuple[FloatArray, FloatArray]:
        """Frequencies between which no harmonic's receptance changes much, and each harmonic's largest receptance."""
        nodes = self.passing * np.linspace(1e-3, 0.5, _LEAST)
        for _ in range(9):
            tip = self.tip.at(nodes[:, None] + self.passing * offset)
            size = np.abs(tip).max(axis=(2, 3))
            move = np.abs(np.diff(tip, axis=0)).max(axis=(2, 3))
            rough = np.any(move > _STEP * (np.minimum(size[1:], size[:-1]) + _FLOOR * self.tip.size), axis=1)
            if not rough.any():
                break
            nodes = np.sort(np.concatenate([nodes, 0.5 * (nodes[1:] + nodes[:-1])[rough]]))
        return nodes, size.max(axis=0)

    def _crossings(self, depth: float, max_depth: float) -> list[Crossing]:
        """All places where an eigenvalue above 1 / (2 max_depth) is real and the smallest depth may be."""
        nodes = self._branches(self.nodes, depth)
        end, last = nodes.value[-1], float(nodes.omega[-1])
        flips = (np.abs(end.imag) < 1e-6 * np.abs(end)) & (end.real > 0.0)
        found = [Crossing(last, last, complex(v.real), complex(v.real)) for v in end[flips]]
        # a branch that ends in a flip crosses there and nowhere else
        end.imag[flips] = 0.0
        one, two = nodes.take(np.arange(nodes.omega.size - 1)), nodes.take(np.arange(1, nodes.omega.size))
        for halving in range(_HALVINGS + 1):
            least = max([0.5 / max_depth, *(c.value / _RANKS for c in found)])
            crossings, doubtful = crossings_between(one, two, least)
            enough = halving == _HALVINGS or not doubtful.any()
            found += [c for k, c in crossings if enough or not doubtful[k]]
            if enough:
                break
            places = np.flatnonzero(doubtful)
            one, two = one.take(places), two.take(places)
            middle = self._branches(0.5 * (one.omega + two.omega), depth)
            one, two = one.joined(middle), middle.joined(two)
        return [c for c in found if c.value * max_depth > 0.5]

    def _branches(self, omega: FloatArray, depth: float) -> Branches:
        return Branches(omega, *np.linalg.eig(self.matrices(self.loud, omega, depth)))

    def _refine(self, crossing: Crossing, depth: float) -> Limit:
        """Newton's method for frequency and depth at which a M - 1 is singular, with all harmonics and the depth's own helix.

        g(w, a) of [[a M - 1, b], [c^H, 0]] [x, g] = [0, 1] vanishes there; with y from the adjoint, dg = -y^H d(a M) x.
        """
        flip = crossing.low == crossing.high
        w, start = crossing.low + crossing.share * (crossing.high - crossing.low), 1.0 / crossing.value
        values, left, right = scipy.linalg.eig(self.matrices(self.loud, np.array([w]), depth)[0], left=True)
        chosen = np.argmin(np.abs(values - crossing.value))
        size = self.teeth.directions * self.heard.size
        inside = np.repeat(np.isin(self.heard, self.loud), self.teeth.directions)
        b, c = np.zeros(size, dtype=complex), np.zeros(size, dtype=complex)
        b[inside], c[inside] = left[:, chosen], right[:, chosen]
        place, a = w, start
        step_w, step_a = 1e-6 * self.passing, 1e-5 * start
        bordered = np.zeros((size + 1, size + 1), dtype=complex)
        target = np.zeros(size + 1, dtype=complex)
        target[-1] = 1.0
        for _ in range(_NEWTON):
            matrix, shifted = self.matrices(self.heard, np.array([place, place + step_w]), a)
            bordered[:-1, :-1] = a * matrix - np.eye(size)
            bordered[:-1, -1], bordered[-1, :-1] = b, c.conj()
            factors = scipy.linalg.lu_factor(bordered, check_finite=False)
            forth = scipy.linalg.lu_solve(factors, target, check_finite=False)
            back = scipy.linalg.lu_solve(factors, target, trans=2, check_finite=False)
            x, y, g = forth[:-1], back[:-1], forth[-1]
            by_depth = matrix
            if self.teeth.slope > 0.0 or not self.teeth.process.is_plain:
                deeper = self.matrices(self.heard, np.array([place]), a + step_a)[0]
                by_depth = matrix + a / step_a * (deeper - matrix)
            g_w = -np.vdot(y, a / step_w * (shifted - matrix) @ x)
            g_a = -np.vdot(y, by_depth @ x)
            if flip:
                change = np.array([0.0, -(g / g_a).real])
            else:
                # both unknowns are real: Cramer's rule for the real and the imaginary part of g
                change = np.array([(g_a.conjugate() * g).imag, (g.conjugate() * g_w).imag]) / (g_w.conjugate() * g_a).imag
            change /= max(1.0, abs(change[0]) / (0.02 * self.passing), abs(change[1]) / (0.2 * a))
            place, a = place + change[0], a + change[1]
            b, c = y / np.linalg.norm(y), x / np.linalg.norm(x)
            if abs(place - w) > 0.1 * self.passing or not 0.3 * start < a < 3.0 * start:
                break
            if abs(change[0]) < 1e-8 * self.passing and abs(change[1]) < 1e-8 * a and abs(g) < 1e-6 * np.linalg.norm(x):
                return Limit(a, self._dominant(place, c))
        return Limit(start, None)

    def _dominant(self, omega: float, force: ComplexArray) -> float:
        """The frequency at which the tip vibrates most."""
        frequency = omega + self.passing * self.heard
        motion = np.linalg.norm(np.einsum("lij,lj->li", self.tip.at(frequency), force.reshape(-1, self.teeth.directions)), axis=1)
        return float(abs(frequency[np.argmax(motion)]))
