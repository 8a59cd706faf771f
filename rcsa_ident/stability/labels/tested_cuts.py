"""Cuts that were tried, beside what the lobes said of them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.base.remarks import counted
from rcsa_ident.base.units import to_rpm
from rcsa_ident.cutting.conditions import AnyEngagement, Engagement, Stepover
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.cutting.stock import Immersion, engagement_with


class Verdict(StrEnum):
    """What was observed at a cut."""

    STABLE = "stable"
    CHATTER = "chatter"
    MARGINAL = "marginal"


#: From quiet to loud.
ORDINAL = (Verdict.STABLE, Verdict.MARGINAL, Verdict.CHATTER)
#: Contradictions that are told one by one.
_TOLD = 3
STRATEGIES, EDGE_STATES = ("up", "down"), ("new", "worn")


@dataclass(frozen=True, slots=True)
class OwnConditions:
    """What one cut of a table tells of itself; what it leaves open is as of the cut that is asked about.

    `radial_width` [m], `radial_immersion` [-]: one of the two at most
    `strategy`: ``up``, ``down`` or empty
    `feed_per_tooth` [m]
    `edge_state`: ``new``, ``worn`` or empty
    `session`: of cuts that belong together: one clamping, one day; empty where nothing is told
    `further`: verdicts of others on the same cut
    """

    radial_width: float | None = None
    radial_immersion: float | None = None
    strategy: str = ""
    feed_per_tooth: float | None = None
    edge_state: str = ""
    session: str = ""
    further: tuple[Verdict, ...] = ()

    def __post_init__(self) -> None:
        for name in ("radial_width", "radial_immersion", "feed_per_tooth"):
            value = getattr(self, name)
            if value is not None:
                positive(name, value)
        if self.radial_width is not None and self.radial_immersion is not None:
            raise InputError("radial_immersion", "radial_width, too", "one of the two")
        if self.radial_immersion is not None and self.radial_immersion > 1.0:
            raise InputError("radial_immersion", self.radial_immersion, "a share of the diameter, not above 1")
        for name, allowed in (("strategy", STRATEGIES), ("edge_state", EDGE_STATES)):
            if getattr(self, name) not in ("", *allowed):
                raise InputError(name, getattr(self, name), f"one of {', '.join(allowed)}")

    def process(self, asked: MillingProcess) -> MillingProcess:
        """Return the cut that is asked about, as this one was made.

        Raises `InputError` for a radial width beyond the diameter, and where width or direction is told of a cut whose engagement has none.
        """
        feed = asked.feed_per_tooth if self.feed_per_tooth is None else self.feed_per_tooth
        if self.radial_width is None and self.radial_immersion is None and not self.strategy:
            return asked if feed == asked.feed_per_tooth else replace(asked, feed_per_tooth=feed)
        diameter = asked.cutter.diameter
        if self.radial_width is not None and self.radial_width > diameter * (1.0 + 1e-9):
            allowed = f"at most the cutter's diameter of {1e3 * diameter:g} mm"
            raise InputError("radial_width_mm", f"{1e3 * self.radial_width:g}", allowed)
        share, strategy = immersion_of(asked.engagement, diameter)
        share = self.radial_immersion or (share if self.radial_width is None else min(self.radial_width / diameter, 1.0))
        engagement = engagement_with(Immersion(share, self.strategy or strategy), asked.cutter)
        return replace(asked, engagement=engagement, feed_per_tooth=feed)


def immersion_of(engagement: AnyEngagement, diameter: float) -> tuple[float, str]:
    """Return the radial width over a diameter [m], and ``up`` or ``down``; a slot, and what is neither, counts as ``down``.

    Raises `InputError` for an engagement that is told by a block or by a map.
    """
    if isinstance(engagement, Stepover):
        return engagement.width / diameter, engagement.strategy
    if isinstance(engagement, Engagement):
        share = 0.5 * float(np.cos(engagement.entry) - np.cos(engagement.exit))
        return share, "up" if engagement.entry < 1e-9 and engagement.exit < np.pi - 1e-9 else "down"
    raise InputError("engagement", str(engagement), "a radial immersion or two angles: cuts of the table tell their own width or direction")


@dataclass(frozen=True, slots=True, eq=False)
class TestedCuts:
    """Cuts with their verdicts.

    `spindle_speed` [rad/s], shape (n,); `axial_depth` [m], shape (n,)
    `verdict`: tuple of Verdict, length n
    `chatter_frequency`: array, shape (n,) [rad/s], default all NaN; where it was measured; NaN elsewhere
    `own`: tuple of OwnConditions, length n; by default no cut tells anything of itself
    """

    __test__ = False  # a noun, though pytest looks for such names

    spindle_speed: FloatArray
    axial_depth: FloatArray
    verdict: tuple[Verdict, ...]
    chatter_frequency: FloatArray = None  # type: ignore[assignment]  # all NaN, one for each cut
    own: tuple[OwnConditions, ...] = ()

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
        object.__setattr__(self, "own", self.own or (OwnConditions(),) * shape[0])
        if len(self.own) != shape[0]:
            raise InputError("own", len(self.own), f"conditions of {shape[0]} cuts")
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
        verdict, own = (tuple(each[k] for k in places) for each in (self.verdict, self.own))
        return TestedCuts(*arrays, verdict, self.chatter_frequency[places], own)

    def joined(self, other: TestedCuts) -> TestedCuts:
        """Return these cuts, and behind them those of another table that are not the same ones."""
        known = set(self._rows)
        new = other.at_places(np.array([k for k, row in enumerate(other._rows) if row not in known], dtype=np.intp))
        names = ("spindle_speed", "axial_depth", "chatter_frequency")
        speed, depth, chatter = (np.concatenate([getattr(part, name) for part in (self, new)]) for name in names)
        return TestedCuts(speed, depth, self.verdict + new.verdict, chatter, self.own + new.own)

    @property
    def _rows(self) -> list[tuple[float, float, Verdict, OwnConditions]]:
        """Speed and depth to nine digits, verdict and conditions: what makes two rows the same cut."""
        numbers = zip(self.spindle_speed.tolist(), self.axial_depth.tolist(), self.verdict, self.own, strict=True)
        return [(float(f"{speed:.9g}"), float(f"{depth:.9g}"), verdict, own) for speed, depth, verdict, own in numbers]

    def alike(self, asked: MillingProcess) -> list[tuple[NDArray[np.intp], MillingProcess]]:
        """Return the places of cuts that share an engagement and a feed, and how they were made.

        `asked`: of what a cut does not tell of itself
        """
        processes = [own.process(asked) for own in self.own]
        # without run-out nothing of stability hangs on the feed
        feeds = [each.feed_per_tooth if each.cutter.offset else None for each in processes]
        keys = [(str(each.engagement), feed) for each, feed in zip(processes, feeds, strict=True)]
        places = {key: np.array([k for k, one in enumerate(keys) if one == key], dtype=np.intp) for key in dict.fromkeys(keys)}
        return [(found, processes[found[0]]) for found in places.values()]

    @property
    def counts(self) -> FloatArray:
        """How many verdicts on each cut call it stable, marginal and chatter, shape (n, 3)."""
        votes = [(first, *own.further) for first, own in zip(self.verdict, self.own, strict=True)]
        return np.array([[each.count(v) for v in ORDINAL] for each in votes], dtype=float).reshape(-1, len(ORDINAL))

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on what labels of these kinds cannot teach, and on repeats that were judged differently."""
        told = []
        if self.verdict and len(set(self.verdict)) == 1 and self.verdict[0] is not Verdict.MARGINAL:
            side = "deeper" if self.verdict[0] is Verdict.STABLE else "less deep"
            told.append(f"every cut is labelled {self.verdict[0]}: limits are {side} than the cuts, by how much stays unknown")
        sessions = [own.session for own in self.own if own.session]
        alone = sum(sessions.count(each) == 1 for each in sessions)
        if alone:
            told.append(f"{counted(alone, 'session')} of one cut: there the effect of the session cannot be separated from the cut")
        rows = [(*row[:2], replace(row[3], session="", further=())) for row in self._rows]
        groups = [{self.verdict[k] for k, row in enumerate(rows) if row == one} for one in dict.fromkeys(rows)]
        differing = sum({Verdict.STABLE, Verdict.CHATTER} <= each for each in groups)
        if differing:
            told.append(f"{counted(differing, 'cut')} repeated with another verdict: this counts as label noise")
        directions = {own.strategy for own in self.own} - {""}
        if len(directions) == 1:
            (one,) = directions
            told.append(f"all labels are of {one} milling: the other direction has no labels")
        return tuple(told)

    @property
    def contradictions(self) -> tuple[str, ...]:
        """A sentence for each speed and engagement at which a cut was stable that is as deep as one that chattered, or deeper.

        One of the two verdicts is wrong, or the machine changed, or the limit has an island, as a helix in a narrow cut makes them.
        """
        stable, chatter = self.seen(Verdict.STABLE), self.seen(Verdict.CHATTER)
        found = []
        alike = [replace(own, session="", further=()) for own in self.own]
        where = [(speed, own) for speed, own in zip(self.spindle_speed.tolist(), alike, strict=True)]
        for speed, own in dict.fromkeys(sorted(where, key=lambda each: each[0])):
            here = np.array([each == (speed, own) for each in where])
            if not (here & stable).any() or not (here & chatter).any():
                continue
            deepest, least = self.axial_depth[here & stable].max(), self.axial_depth[here & chatter].min()
            if deepest >= least:
                found.append(
                    f"at {to_rpm(float(speed)):.6g} rev/min a cut of {1e3 * deepest:.4g} mm was stable and one of {1e3 * least:.4g} mm "
                    "chattered: the labels contradict each other, or that depth is an island"
                )
        more = len(found) - _TOLD
        return (*found[:_TOLD], *([f"labels contradict each other so in {more} further conditions"] if more > 0 else ()))


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
