"""Hill's determinant of a milling cut: all harmonics of the directional coefficients at one spindle speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from rcsa_ident.arrays import ComplexArray, FloatArray
from rcsa_ident.cutting.conditions import same_everywhere
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.errors import InputError
from rcsa_ident.stability._kernels import receptance_at
from rcsa_ident.stability.eigenvalue_tracking import Branches, Crossing, crossings_between

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
#: Searches at one speed at most.
_LOOKS = 6
#: Steps of Newton's method for a crossing.
_NEWTON = 15


@dataclass(frozen=True, slots=True, eq=False)
class TipMotion:
    """The tip's receptance at any frequency, entries xx, xy, yx, yy."""

    omega: FloatArray
    values: ComplexArray

    @classmethod
    def of(cls, receptance: Receptance) -> TipMotion:
        entries = [receptance.between(f"tip.{a}", f"tip.{b}") for a in "xy" for b in "xy"]
        kept = np.flatnonzero(receptance.omega > 0.0)
        if kept.size < 2 or np.any(np.diff(receptance.omega[kept]) <= 0.0):
            raise InputError("tip receptance frequencies", f"{receptance.omega.size} frequencies", "two or more above 0, ascending")
        values = np.stack(entries, axis=1)[kept]
        if not np.all(np.isfinite(values)):
            raise InputError("tip receptance", "values that are not finite", "finite values at every frequency above 0")
        if not np.any(values):
            raise InputError("tip receptance", "zero at every frequency", "at least one flexible direction")
        return cls(np.ascontiguousarray(receptance.omega[kept]), np.ascontiguousarray(values))

    @property
    def size(self) -> float:
        return float(np.max(np.abs(self.values)))

    def at(self, omega: FloatArray) -> ComplexArray:
        """Return the 2 x 2 receptances, shape (..., 2, 2)."""
        flat = np.ascontiguousarray(omega.ravel())
        return receptance_at(self.omega, self.values, flat).reshape(*omega.shape, 2, 2)


@dataclass(frozen=True, slots=True, eq=False)
class PeriodicTeeth:
    """The directional coefficients' harmonics of tooth passing."""

    process: MillingProcess
    harmonics: int | None

    def lines(self, count: int, depth: float) -> ComplexArray:
        """Return [alpha_r] for r = -count..count, mean over the depth along the helix, in machine axes, shape (2 count + 1, 2, 2).

        [alpha(t)] = sum_r [alpha_r] e^{i r w_T t}, one tooth's tip at immersion 0 when t = 0.
        """
        return self._lines(count, depth, 1.0, self.process.coefficients.radial_ratio)

    def rubbing(self, count: int, depth: float) -> ComplexArray:
        """Return the same of process damping, over its strength and the cutting speed: force per width and velocity."""
        damping = self.process.damping
        return np.zeros((2 * count + 1, 2, 2), dtype=complex) if damping is None else self._lines(count, depth, damping.friction, 1.0)

    def _lines(self, count: int, depth: float, tangential: float, radial: float) -> ComplexArray:
        r = np.arange(-count, count + 1)
        kept = np.abs(r) <= (count if self.harmonics is None else self.harmonics)
        cutter, engagement = self.process.cutter, same_everywhere(self.process.engagement)
        order = cutter.teeth * r
        q = np.array([-2, 0, 2])
        sc, ss, cc = np.array([0.25j, 0, -0.25j]), np.array([-0.25, 0.5, -0.25]), np.array([0.25, 0.5, 0.25])
        form = tangential * np.array([[-sc, -cc], [ss, sc]]) - radial * np.array([[ss, sc], [sc, cc]])
        # the integral of e^{i (q - m) phi} over the immersion
        start, end = engagement.angles
        n, half = q - order[:, None], 0.5 * (end - start)
        window = 2.0 * half * np.exp(0.5j * n * (start + end)) * np.sinc(n * half / np.pi)
        lines = cutter.teeth / (2.0 * np.pi) * np.einsum("rq,ijq->rij", window, form)
        lag = order * depth * np.tan(cutter.helix) / cutter.diameter
        lines *= (kept * np.exp(-1j * lag) * np.sinc(lag / np.pi))[:, None, None]
        rotation = self.process.machine_from_feed
        return rotation @ lines @ rotation.T


@dataclass(frozen=True, slots=True, eq=False)
class Limit:
    """A depth at which a vibration neither grows nor dies away; None in `chatter` where the search for it did not end."""

    depth: float
    chatter: float | None


class Hill:
    """The eigenvalue problem of one spindle speed."""

    def __init__(self, tip: TipMotion, teeth: PeriodicTeeth, passing: float) -> None:
        self.tip, self.teeth, self.passing = tip, teeth, passing
        process = teeth.process
        speed = 0.5 * process.cutter.diameter * passing / process.cutter.teeth
        #: Of process damping, force per width and velocity [N s/m^2].
        self.viscosity = 0.0 if process.damping is None else process.damping.strength / speed
        count = int(np.ceil(tip.omega[-1] / passing)) + 1
        self.every = np.arange(-count, count)
        self.nodes, size = self._nodes(self.every)
        # the largest eigenvalue that a harmonic may have by itself
        self.strength = 2.0 * process.coefficients.tangential * float(np.linalg.norm(teeth.lines(0, 0.0)[0], 2)) * size
        if self.viscosity > 0.0:
            rub = self.viscosity * float(np.linalg.norm(teeth.rubbing(0, 0.0)[0], 2))
            self.strength = self.strength + rub * passing * np.abs(self.every + 0.5) * size
        self.heard = self._stronger(_SILENT * self.strength.max())
        self.loud = self._stronger(_LOUD * self.strength.max())

    def limit(self, max_depth: float) -> Limit | None:
        """Return the smallest depth up to `max_depth`.

        It is looked for with the loud harmonics and the helix of a depth that is guessed, and refined with all harmonics
        and its own helix; where the guess was far off, it is looked for again.
        """
        slope = self.teeth.process.cutter.teeth * np.tan(self.teeth.process.cutter.helix) / self.teeth.process.cutter.diameter
        found: list[Limit] = []
        looked, best, lost = 0.0, None, None
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
            elif wanted.size <= self.loud.size and (best is None or abs(depth - looked) * slope <= _TURN):
                break
            looked = depth
            if wanted.size > self.loud.size:
                self.loud = wanted
        answer = best if lost is None else lost
        return answer if answer is not None and answer.depth <= max_depth else None

    def _stronger(self, strength: float) -> np.ndarray:
        """Harmonics up to the last whose own eigenvalue may be so large, at least two: harmonic -1 - l is the mirror of l."""
        reach = np.abs(self.every + 0.5)
        loud = reach[(self.strength > strength) & (self.strength > _SILENT * self.strength.max())]
        return self.every[reach <= max(loud.max(initial=0.0), 1.0)]

    def matrices(self, offset: np.ndarray, omega: FloatArray, depth: float) -> ComplexArray:
        """Return (K_tc (1 - e^{-i w T}) [alpha_{k-l}] + i (w + l w_T) C [beta_{k-l}]) G(w + l w_T), shape (n, 2 h, 2 h) [1/m].

        [beta] is what process damping makes of a velocity.
        """
        h = offset.size
        apart = offset[:, None] - offset + h - 1
        frequency = omega[:, None] + self.passing * offset
        tip = self.tip.at(frequency)
        regenerated = (self.teeth.process.coefficients.tangential * (1.0 - np.exp(-2j * np.pi * omega / self.passing)))[:, None, None, None]
        wide = self.teeth.lines(h - 1, depth)[apart].transpose(1, 0, 2, 3).reshape(h, 2 * h, 2) @ (regenerated * tip)
        if self.viscosity > 0.0:
            moving = (1j * self.viscosity * frequency)[:, :, None, None] * tip
            wide = wide + self.teeth.rubbing(h - 1, depth)[apart].transpose(1, 0, 2, 3).reshape(h, 2 * h, 2) @ moving
        return wide.transpose(0, 2, 1, 3).reshape(omega.size, 2 * h, 2 * h)

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
        size = 2 * self.heard.size
        inside = np.repeat(np.isin(self.heard, self.loud), 2)
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
            if self.teeth.process.cutter.helix > 0.0:
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
        motion = np.linalg.norm(np.einsum("lij,lj->li", self.tip.at(frequency), force.reshape(-1, 2)), axis=1)
        return float(abs(frequency[np.argmax(motion)]))
