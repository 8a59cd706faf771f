"""Tip modes and cutting coefficients with what is not known of them, as a function of independent standard normal numbers."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError, non_negative
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.uncertain import UncertainReceptance
from rcsa_ident.stability.lobes import both_directions, stability_lobes
from rcsa_ident.stability.methods import StabilityMethod
from rcsa_ident.stability.tip_modes import TIP, TipModes, fitted_modes, known_modes

#: Largest damping ratio that a draw may have.
_MOST_DAMPED = 0.9
#: Of logarithms, for differences.
_STEP = 1e-4
#: Singular value over the largest below which changes of modes are taken to be alike, and share of a spread that may be left out.
_NEARLY_ALIKE, _NEGLIGIBLE = 1e-3, 0.01
#: Largest spread over the receptance that changes of modes still tell.
_WIDEST = 0.5
#: How far the logarithms of natural frequencies, damping ratios and stiffnesses may change.
_USUAL = (0.05, 0.5, 0.3)


@dataclass(frozen=True, slots=True, eq=False)
class UncertainTip:
    """Modes of the tip and cutting coefficients, whose logarithms vary: nothing of them can be negative.

    A quantity of mean m is m e^{r z - |r|^2 / 2} with a row r of a root and independent standard normals z: its mean is m again. First
    among the numbers z are q of the modes, then two of the coefficients, then one of the softening where there is one.

    `modes`: TipModes, m of them; of the means
    `root` [-], shape (3 m, q): of natural frequencies, damping ratios and stiffnesses of all modes
    `coefficients` [-], shape (2, 2): of K_tc and K_rc
    `softening` [s/rad]: standard deviation of the share of all stiffnesses that a rad/s of spindle speed takes away or adds: modes were
        measured at standstill. 0 leaves it out.
    """

    modes: TipModes
    root: FloatArray
    coefficients: FloatArray
    softening: float = 0.0

    def __post_init__(self) -> None:
        for name, rows in (("root", 3 * self.modes.pole.size), ("coefficients", 2)):
            object.__setattr__(self, name, frozen(getattr(self, name)))
            values = getattr(self, name)
            if values.ndim != 2 or len(values) != rows or not np.all(np.isfinite(values)):
                raise InputError(name, values.shape, f"{rows} rows of finite numbers")
        if self.coefficients.shape != (2, 2):
            raise InputError("coefficients", self.coefficients.shape, "shape (2, 2)")
        non_negative("softening", self.softening)

    @classmethod
    def independent(
        cls,
        modes: TipModes,
        spreads: FloatArray,
        coefficients: tuple[float, float],
        softening: float = 0.0,
    ) -> UncertainTip:
        """Return a tip whose quantities know nothing of each other.

        `modes`: TipModes, m of them
        `spreads` [-], shape (3, m): standard deviations of frequencies, damping ratios and stiffnesses over their means
        `coefficients`: (float, float) [-]; the same of K_tc and K_rc
        `softening` [s/rad]
        """
        logarithmic = np.sqrt(np.log1p(np.square(spreads))).ravel()
        known = logarithmic > 0.0
        return cls(modes, np.diag(logarithmic)[:, known], np.diag(np.sqrt(np.log1p(np.square(coefficients)))), softening)

    @classmethod
    def of_receptance(cls, tip: UncertainReceptance, coefficients: FloatArray) -> tuple[UncertainTip, float]:
        """Return a receptance and its spread as modes that vary, and how much of the spread they miss, as a share.

        Each direction of the spread is a change of the receptance; the changes of frequencies, damping ratios and stiffnesses that come
        nearest to it are found by damped least squares. Directions that change the receptance alike are taken together.

        Raises `InputError` if the spread is no small change.
        """
        both = both_directions(tip)
        known = known_modes(both)
        modes, _ = fitted_modes(both) if known is None else known
        nodes = tip.thinned()
        change = _embedded_spread(nodes)
        doubt = float(np.linalg.norm(change) / np.linalg.norm(nodes.values))
        if doubt > _WIDEST:
            found = f"a tip that is known to {100.0 * doubt:.0f} % of itself"
            raise InputError(
                "result", found, f"one that is known to {100.0 * _WIDEST:.0f} %: an identification with more cuts, or MODES.toml"
            )
        # in units of what such changes may be at most: a mode that hardly shows is not moved far for nothing
        usual = np.repeat(_USUAL, modes.pole.size)
        left_vectors, values, right_vectors = np.linalg.svd(_sensitivity(modes, nodes.omega) * usual, full_matrices=False)
        damped = values / (values**2 + (_NEARLY_ALIKE * values[0]) ** 2)
        x = right_vectors.T @ (damped[:, None] * (left_vectors.T @ change.T))
        explained = left_vectors @ (values[:, None] * (right_vectors @ x))
        left = np.linalg.norm(change.T - explained) / max(float(np.linalg.norm(change)), 1e-300)
        # of many directions few matter: those of the greatest changes of the receptance
        _, sizes, turns = np.linalg.svd(explained, full_matrices=False)
        count = max(1, int(np.searchsorted(np.cumsum(sizes**2), (1.0 - _NEGLIGIBLE) * np.sum(sizes**2))) + 1)
        root = usual[:, None] * (x @ turns[:count].T)
        return cls(modes, root, coefficients), float(left)

    @property
    def size(self) -> int:
        """How many independent numbers it takes."""
        return self.root.shape[1] + 2 + (self.softening > 0.0)

    def factors(self, z: FloatArray) -> FloatArray:
        """Return what frequencies, damping ratios, stiffnesses, K_tc and K_rc are multiplied by, shape (..., 3 m + 2)."""
        q = self.root.shape[1]
        pairs = (self.root, z[..., :q]), (self.coefficients, z[..., q : q + 2])
        found: FloatArray = np.exp(np.concatenate([x @ root.T - 0.5 * np.sum(root**2, axis=1) for root, x in pairs], axis=-1))
        return found

    def at(self, z: FloatArray, speed: float = 0.0) -> TipModes:
        """Return the modes of one draw at a spindle speed. `z`, shape (size,). `speed` [rad/s]: matters where stiffness changes with it."""
        frequency, damping, stiffness = self.factors(z)[:-2].reshape(3, -1)
        if self.softening:
            # a share that would leave no stiffness is far outside the spread that anybody states
            harder = max(1.0 + self.softening * float(z[-1]) * speed, 0.05)
            frequency, stiffness = frequency * np.sqrt(harder), stiffness * harder
        return altered(self.modes, frequency, damping, stiffness)

    def process(self, z: FloatArray, process: MillingProcess) -> MillingProcess:
        """Return a cut with the coefficients of one draw in the place of their means."""
        tangential, radial = self.factors(z)[-2:]
        c = process.coefficients
        drawn = replace(c, tangential=float(c.tangential * tangential), radial_ratio=float(c.radial_ratio * radial / tangential))
        return replace(process, coefficients=drawn)


def _embedded_spread(tip: UncertainReceptance) -> FloatArray:
    """Changes along all directions among zeros for axes that are missing, real and imaginary parts in a row, shape (p, 8 n)."""
    spread = tip.spread
    found = np.zeros((len(spread), tip.omega.size, 2, 2), dtype=complex)
    places = [TIP.index(c) for c in tip.rows if c in TIP]
    own = [tip.rows.index(TIP[k]) for k in places]
    found[np.ix_(range(len(found)), range(tip.omega.size), places, places)] = spread[..., own, :][..., own]
    return found.reshape(len(found), -1).view(float)


def _sensitivity(modes: TipModes, omega: FloatArray) -> FloatArray:
    """Change of the receptance with the logarithm of each factor, central differences, shape (8 n, 3 m)."""
    m, columns = modes.pole.size, []
    for k in range(3 * m):
        step = np.zeros(3 * m)
        step[k] = _STEP
        ends = [altered(modes, *np.exp(sign * step).reshape(3, m)).response(omega) for sign in (1.0, -1.0)]
        columns.append(((ends[0] - ends[1]) / (2.0 * _STEP)).reshape(-1).view(float))
    return np.array(columns).T


def altered(modes: TipModes, frequency: FloatArray, damping: FloatArray, stiffness: FloatArray) -> TipModes:
    """Return modes whose natural frequency, damping ratio and modal stiffness are multiplied by some factors, shapes (m,).

    The pole p = -zeta omega + i omega_d carries the residue omega^2 / (2 i omega_d k) of a normal mode; a complex one keeps its phase.
    """
    omega = np.abs(modes.pole)
    zeta = np.minimum(-modes.pole.real / omega, 1.0)
    new_omega, new_zeta = omega * frequency, np.minimum(zeta * damping, _MOST_DAMPED)
    # a real pole stays one
    wave = modes.pole.imag > 0.0
    pole = np.where(wave, new_omega * (-new_zeta + 1j * np.sqrt(1.0 - new_zeta**2)), modes.pole * frequency)
    scale = frequency**2 / stiffness * np.where(wave, modes.pole.imag / np.where(wave, pole.imag, 1.0), 1.0 / frequency)
    return replace(modes, pole=pole, outputs=modes.outputs * scale)


@dataclass(frozen=True, slots=True, eq=False)
class DrawnLimits:
    """Stability limits of draws of a tip, in the cut that was asked for.

    `log_limit`, shape (d, n): logarithm of the limit [m]; that of the largest depth where none was found
    `chatter` [rad/s], shape (d, n): NaN where none was found
    """

    log_limit: FloatArray
    chatter: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class TipLimits:
    """The stability limits of an uncertain tip as a function of its numbers z.

    `process`: with the means of the coefficients
    `max_depth` [m]
    """

    tip: UncertainTip
    process: MillingProcess
    method: StabilityMethod
    max_depth: float

    def __call__(self, z: FloatArray, speeds: FloatArray) -> DrawnLimits:
        """Return the limits of draws, shape (d, size), at speeds, shape (n,) [rad/s]."""
        limit, chatter = np.empty((2, len(z), speeds.size))
        for k, each in enumerate(z):
            process = self.tip.process(each, self.process)
            for places in [np.arange(speeds.size)] if not self.tip.softening else np.arange(speeds.size)[:, None]:
                modes = self.tip.at(each, float(speeds[places[0]]))
                found = stability_lobes(modes, process, speeds[places], self.max_depth, self.method, 0)
                limit[k, places], chatter[k, places] = found.nominal, found.chatter_frequency
        return DrawnLimits(np.log(limit), chatter)
