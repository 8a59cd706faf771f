"""Cuts that were tried, beside what the lobes said of them."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import to_rpm


class Verdict(StrEnum):
    """What was observed at a cut."""

    STABLE = "stable"
    CHATTER = "chatter"
    MARGINAL = "marginal"


@dataclass(frozen=True, slots=True, eq=False)
class TestedCuts:
    """Cuts with their verdicts.

    `spindle_speed` [rad/s], shape (n,); `axial_depth` [m], shape (n,)
    `verdict`: tuple of Verdict, length n
    `chatter_frequency`: array, shape (n,) [rad/s], default all NaN; where it was measured; NaN elsewhere
    """

    __test__ = False  # a noun, though pytest looks for such names

    spindle_speed: FloatArray
    axial_depth: FloatArray
    verdict: tuple[Verdict, ...]
    chatter_frequency: FloatArray = None  # type: ignore[assignment]  # all NaN, one for each cut

    def __post_init__(self) -> None:
        object.__setattr__(self, "spindle_speed", frozen(self.spindle_speed))
        object.__setattr__(self, "axial_depth", frozen(self.axial_depth))
        shape = (len(self.verdict),)
        chatter = np.full(shape, np.nan) if self.chatter_frequency is None else self.chatter_frequency
        object.__setattr__(self, "chatter_frequency", frozen(chatter))
        if self.chatter_frequency.shape != shape or not np.all(np.isnan(self.chatter_frequency) | (self.chatter_frequency > 0.0)):
            raise InputError(
                "chatter_frequency", self.chatter_frequency.shape, f"{shape[0]} numbers above 0, or NaN where none was measured"
            )
        for name in ("spindle_speed", "axial_depth"):
            values = getattr(self, name)
            if values.shape != shape or not np.all(np.isfinite(values) & (values > 0.0)):
                raise InputError(name, values.shape, f"{shape[0]} finite numbers above 0")

    @classmethod
    def none(cls) -> TestedCuts:
        """Return a table without cuts."""
        return cls(np.zeros(0), np.zeros(0), ())

    def seen(self, verdict: Verdict) -> NDArray[np.bool_]:
        """True where the cut was seen so, shape (n,)."""
        return np.array([each is verdict for each in self.verdict], dtype=bool)

    def at_places(self, places: NDArray[np.intp]) -> TestedCuts:
        """Return some of the cuts."""
        arrays = (self.spindle_speed[places], self.axial_depth[places])
        return TestedCuts(*arrays, tuple(self.verdict[k] for k in places), self.chatter_frequency[places])

    def joined(self, other: TestedCuts) -> TestedCuts:
        """Return these cuts, and behind them those of another table that are not the same ones."""
        known = set(self._rows)
        new = other.at_places(np.array([k for k, row in enumerate(other._rows) if row not in known], dtype=np.intp))
        names = ("spindle_speed", "axial_depth", "chatter_frequency")
        speed, depth, chatter = (np.concatenate([getattr(part, name) for part in (self, new)]) for name in names)
        return TestedCuts(speed, depth, self.verdict + new.verdict, chatter)

    @property
    def _rows(self) -> list[tuple[float, float, Verdict]]:
        """Speed and depth to nine digits, and verdict: what makes two rows the same cut."""
        numbers = zip(self.spindle_speed.tolist(), self.axial_depth.tolist(), self.verdict, strict=True)
        return [(float(f"{speed:.9g}"), float(f"{depth:.9g}"), verdict) for speed, depth, verdict in numbers]

    @property
    def contradictions(self) -> tuple[str, ...]:
        """A sentence for each speed at which a cut was stable that is as deep as one that chattered, or deeper.

        Islands of instability aside, a stability limit has one side only: one of the two verdicts is wrong, or the machine changed.
        """
        stable, chatter = self.seen(Verdict.STABLE), self.seen(Verdict.CHATTER)
        found = []
        for speed in np.unique(self.spindle_speed[stable & np.isin(self.spindle_speed, self.spindle_speed[chatter])]):
            here = self.spindle_speed == speed
            deepest, least = self.axial_depth[here & stable].max(), self.axial_depth[here & chatter].min()
            if deepest >= least:
                found.append(
                    f"at {to_rpm(float(speed)):.6g} rev/min a cut of {1e3 * deepest:.4g} mm was stable and one of {1e3 * least:.4g} mm "
                    "chattered: the labels contradict each other"
                )
        return tuple(found)


@dataclass(frozen=True, slots=True)
class Tally:
    """How many cuts the limit tells right: predicted by observed.

    `stable_stable`, `chatter_chatter`: told right; the first word is the prediction, the second what was seen
    `stable_chatter`: chatter that nobody expected
    `chatter_stable`: stable cuts that were not expected
    `stable_marginal`, `chatter_marginal`: marginal cuts are told apart and belong to neither
    """

    stable_stable: int
    stable_chatter: int
    chatter_stable: int
    chatter_chatter: int
    stable_marginal: int = 0
    chatter_marginal: int = 0

    @property
    def decided(self) -> int:
        """Cuts that were seen to be stable or to chatter."""
        return self.stable_stable + self.stable_chatter + self.chatter_stable + self.chatter_chatter

    @property
    def share_right(self) -> float:
        """Share of the decided cuts that were told right, NaN without any."""
        return (self.stable_stable + self.chatter_chatter) / self.decided if self.decided else float("nan")


def tally(cuts: TestedCuts, limit_depth: FloatArray) -> Tally:
    """Return how many cuts lie on the side of the limit where they were seen.

    `limit_depth` [m], shape (n,): the first loss of stability at each cut's own speed; a cut at the limit or below it is predicted to be
        stable
    """
    limit = np.asarray(limit_depth, dtype=float)
    if limit.shape != cuts.axial_depth.shape or np.any(np.isnan(limit)):
        raise InputError("limit_depth", limit.shape, f"a limit for each of the {cuts.axial_depth.size} cuts")
    stable = cuts.axial_depth <= limit
    seen = {verdict: cuts.seen(verdict) for verdict in Verdict}
    counts = [int(np.sum(side & seen[verdict])) for verdict in (Verdict.STABLE, Verdict.CHATTER) for side in (stable, ~stable)]
    marginal = [int(np.sum(side & seen[Verdict.MARGINAL])) for side in (stable, ~stable)]
    return Tally(counts[0], counts[2], counts[1], counts[3], *marginal)
