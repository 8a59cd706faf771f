"""What dominates the band of a stability limit: shares of the variance of its logarithm, and what would narrow it most."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.shown import Shown
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.uncertain import Doubted, Name, UncertainReceptance
from rcsa_ident.stability.lobes import DEEPER, embedded, known_directions
from rcsa_ident.stability.tip_modes import TIP
from rcsa_ident.stability.zero_order import ZeroOrder

#: Standard deviation of the logarithm of a limit from which on its band matters: a depth that holds with 95 % is then 8 % lower, about
#: what is kept in reserve anyway. Whoever holds this share of its variance dominates it.
WIDE, DOMINANT = 0.05, 0.5
#: Speeds within the tolerance at which the lowest limit is looked for.
_SPEEDS = 9
#: Single parameters among the cutting coefficients, and where their standard deviation stands.
_COEFFICIENTS = {
    "tangential": ("tangential cutting coefficient", "tangential_spread"),
    "radial_ratio": ("radial ratio of the cutting coefficients", "ratio_spread"),
}
#: What is no single parameter; and the share from which on one is worth a sentence.
_NO_SINGLE, _WORTH_NAMING = (Doubted.STIFFNESS, Doubted.WORKPIECE, Doubted.MACHINE), 0.1
#: What helps.
_HELP = {
    Doubted.CONTACT: "tap it, ring it or cut once",
    Doubted.TOOL: "ring the bare tool, or cut once",
    Doubted.LENGTHS: "measure the stickout with a presetter",
    Doubted.HOLDER: "tap it, ring it or cut once",
    Doubted.STIFFNESS: "tap it or cut once",
    Doubted.WORKPIECE: "tap the workpiece where it is cut, or record more cuts",
    Doubted.COEFFICIENTS: "calibrate them on a dynamometer",
    Doubted.MACHINE: "more cuts narrow it",
}


class Leading(NamedTuple):
    """The one parameter that a limit depends on most.

    `name`: a field of `Alteration`, `IDENTIFIED` in front where records have told of it, or ``tangential`` or ``radial_ratio``
    `share`: of the variance of the limit's logarithm that its exact knowledge would take away
    `words`: what it is, and how well it is known
    """

    name: str
    share: float
    words: str


@dataclass(frozen=True, slots=True, repr=False)
class BandShares(Shown):
    """What the band of a cut's limit consists of.

    `spindle_speed` [rad/s]: within the tolerance of the recommended speed: where the limit is lowest
    `deviation` [-]: standard deviation of the logarithm of the limit
    `shares`: of its square; their sum is 1
    `leading`: the parameter of drawing or coefficients that holds more of it than any other; None where there is none
    """

    spindle_speed: float
    deviation: float
    shares: Mapping[Doubted, float]
    leading: Leading | None = None

    @property
    def dominant(self) -> Doubted | None:
        """What holds at least half of a band that matters; None where nothing does."""
        if self.deviation < WIDE:
            return None
        return next((each for each, share in self.shares.items() if share >= DOMINANT), None)

    @property
    def words(self) -> str:
        """Sentences on what dominates the band, what helps, and which value the depth depends on most; empty where the band is narrow."""
        said, wide = [], 100.0 * self.deviation
        if self.dominant is not None:
            share = 100.0 * self.shares[self.dominant]
            said.append(
                f"{share:.0f} % of the band of this limit (standard deviation {wide:.0f} %) is {self.dominant}: {_HELP[self.dominant]}"
            )
        if self.deviation >= WIDE and self.leading is not None and self.leading.share >= _WORTH_NAMING:
            most = self.leading.share >= max(self.shares.get(each, 0.0) for each in _NO_SINGLE)
            said.append(f"{'The' if most else 'Of single values, the'} depth depends most on the {self.leading.words}")
        return ". ".join(said)

    def __str__(self) -> str:
        return self.words or f"standard deviation of the limit {100.0 * self.deviation:.2g} %, nothing dominates it"


def band_shares(
    tip: UncertainReceptance,
    process: MillingProcess,
    speed: float,
    max_depth: float,
    tolerance: float,
    stated: Callable[[str], str] = str,
) -> BandShares | None:
    """Return what the band of the limit near a speed consists of; None where some of the tip's spread is not known, or no limit is found.

    Parameters
    ----------
    tip : UncertainReceptance
    process : MillingProcess
    speed : float [rad/s]
        That is recommended.
    max_depth : float [m]
    tolerance : float
        Share of the speed within which the lowest limit counts, as in `StabilityLobes.recommended_depth`.
    stated : callable
        Given the name of a parameter of the drawing, returns what it is and how well it is known.

    Notes
    -----
    Linear, by the zero-order limit half a change ahead and behind along each direction of the tip's spread, and for K_tc and k_rc. What
    cuts could not tell apart hangs together: a group's share is what its exact knowledge would take away after that of the groups
    before it, contact and tool first and the machine last, so that an inexpensive remedy is named before an expensive one.
    """
    if not tip.complete:
        return None
    nodes, known = tip.thinned(), process.coefficients
    wanted = TIP if process.is_plain else known_directions(nodes)
    deepest, method = DEEPER * max_depth, ZeroOrder()
    speeds = np.linspace((1.0 - tolerance) * speed, (1.0 + tolerance) * speed, _SPEEDS if tolerance > 0.0 else 1)

    def limits(values: np.ndarray, at: FloatArray, factors: FloatArray | None = None) -> FloatArray:
        return method.depths(nodes.omega, embedded(values, nodes, wanted), process, at, deepest, factors)

    at = speeds[[int(np.argmin(limits(nodes.values[None], speeds)[0]))]]
    change, unknowns, parameters = nodes.spread, nodes.unknowns(), nodes.parameters()
    logarithms = np.zeros((len(change), 2))
    if known.tangential_spread or known.ratio_spread:
        # two directions more, along which the tip stays
        change = np.concatenate([change, np.zeros((2, *change.shape[1:]))])
        logarithms = np.concatenate([logarithms, np.diag([known.tangential_spread, known.ratio_spread])])
        unknowns, parameters = _padded(unknowns), _padded(parameters)
        unknowns[Doubted.COEFFICIENTS] = np.eye(2, len(change), len(change) - 2)
        parameters |= {name: row[None] for name, row in zip(_COEFFICIENTS, unknowns[Doubted.COEFFICIENTS], strict=True)}
    ends = [np.log(limits(nodes.values + sign * change, at, np.exp(sign * logarithms))[:, 0]) for sign in (0.5, -0.5)]
    if not np.all(np.isfinite(ends)):
        return None
    slopes = ends[0] - ends[1]
    found = shares_of(slopes, unknowns, float(at[0]))
    if found is None:
        return None

    def words(name: str) -> str:
        if name not in _COEFFICIENTS:
            return stated(name)
        what, own = _COEFFICIENTS[name]
        return f"{what}, whose standard deviation is {100.0 * getattr(known, own):.2g} %"

    whole = float(slopes @ slopes)
    alone = {name: _told_by(moves, slopes) / whole for name, moves in parameters.items()}
    leading = max(alone, key=alone.__getitem__, default=None)
    return found if leading is None else replace(found, leading=Leading(leading, alone[leading], words(leading)))


def _padded(moves: Mapping[Name, FloatArray]) -> dict[Name, FloatArray]:
    return {name: np.pad(each, ((0, 0), (0, 2))) for name, each in moves.items()}


def _told_by(moves: FloatArray, slopes: FloatArray) -> float:
    """How much of a variance the exact knowledge of some unknowns takes away."""
    _, size, directions = np.linalg.svd(moves, full_matrices=False)
    return float(np.sum((directions[size > 1e-9 * size.max()] @ slopes) ** 2))


def shares_of(slopes: FloatArray, unknowns: Mapping[Doubted, FloatArray], speed: float) -> BandShares | None:
    """Return shares of a variance by projection: group after group takes the part of the slopes that its unknowns span.

    `slopes`, shape (p,): change of the limit's logarithm along independent directions, per standard deviation
    `unknowns`: mapping of Doubted to array, shape (k, p); see `Variation`; the rest is the machine's
    `speed` [rad/s]
    """
    whole = float(slopes @ slopes)
    if whole == 0.0:
        return None
    shares, spanned, taken = {}, np.zeros((0, slopes.size)), 0.0
    for each in Doubted:
        if each not in unknowns:
            continue
        spanned = np.vstack([spanned, unknowns[each]])
        told = _told_by(spanned, slopes)
        shares[each], taken = (told - taken) / whole, told
    shares[Doubted.MACHINE] = 1.0 - taken / whole
    return BandShares(speed, float(np.sqrt(whole)), shares)
