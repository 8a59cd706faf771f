"""Queries after a tool change: tooltip FRF, stability lobes, advice."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, Literal

import numpy as np
from pydantic import ConfigDict, Field

from api.schemas.common import Answer, Body, EngagementRows, Id, Keys, Name, within
from api.schemas.machines import Curve
from api.schemas.robots import Posed
from api.schemas.tips import TappedTip
from api.schemas.toolings import EXAMPLE, ToolingKeys
from api.work.requests import AdviceRequest, LobeRequest, TipRequest
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.plausibility import AXIAL_DEPTH, POWER, SPINDLE_SPEED, TEMPERATURE, TORQUE
from rcsa_ident.base.units import from_rpm
from rcsa_ident.cutting.conditions import Block, Engagement
from rcsa_ident.cutting.stock import AskedEngagement, Immersion
from rcsa_ident.io.settings.cuts import FEED_DIRECTIONS
from rcsa_ident.io.settings.engagements import engagement_map_of
from rcsa_ident.setup.cut import CutSpec, asked_cut
from rcsa_ident.setup.fields import ASKED_CUT
from rcsa_ident.stability.methods import MethodName

MOST_TOOLINGS, MOST_SPEEDS, MOST_TESTED = 12, 5000, 1000
Percent = Annotated[float, Field(ge=0.0, le=50.0)]
Rpm = Annotated[float, within(SPINDLE_SPEED)]
Hertz = Annotated[float, Field(ge=1.0, le=20_000.0)]
Depth = Annotated[float, within(AXIAL_DEPTH)]
Tooling = Annotated[Name | ToolingKeys, Field(description="Name in the library, or the tooling itself.")]
OnMachine = Annotated[Id | None, Field(description="Id of a machine; in its place `robot` takes an arm at a posture.")]
OnRobot = Annotated[Posed | None, Field(description="In place of a machine.")]
OnTip = Annotated[TappedTip | None, Field(description="In place of a machine: tap tests of the only tooling, or of a cutter.")]
Celsius = Annotated[
    Annotated[float, within(TEMPERATURE)] | None,
    Field(description="Near the bearings, for a machine that changes with a temperature; null: the warm machine."),
]
STATE = "For which state of the machine it holds; null where it has one alone."
Spread = Annotated[Percent, Field(description="How well the tool-holder's stiffness is known [%]: part of the bands.")]


class TipQuery(Body):
    """Which tip at which frequencies; a tapped one answers at its own."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"machine": "m1", "tooling": EXAMPLE, "to_hz": 4000.0}]})

    machine: OnMachine = None
    robot: OnRobot = None
    tip: OnTip = None
    tooling: Tooling | None = None
    from_hz: Hertz | None = Field(None, description="By default 100, or where a measured flange begins.")
    to_hz: Hertz | None = Field(None, description="By default the end of the identified band.")
    step_hz: Annotated[float, Field(ge=0.01, le=1000.0)] = 1.0
    spindle_speed_rpm: Rpm | None = Field(None, description="For a machine that changes with it.")
    temperature_c: Celsius = None
    bands: bool = True
    stiffness_spread_percent: Spread = 0.05

    def request(self, work_seconds: float) -> TipRequest:
        """Return the query in SI."""
        untold = (
            []
            if self.tip is None
            else sorted(self.model_fields_set & {"from_hz", "to_hz", "step_hz", "spindle_speed_rpm", "temperature_c"})
        )
        if untold:
            allowed = "nothing beside a tip: it answers where it was measured, and tip.from_hz leaves lines out"
            raise InputError(untold[0], getattr(self, untold[0]), allowed)
        speed = None if self.spindle_speed_rpm is None else from_rpm(self.spindle_speed_rpm)
        spread = self.stiffness_spread_percent / 100.0
        return TipRequest(self.from_hz, self.to_hz, self.step_hz, speed, self.bands, spread, work_seconds, self.temperature_c)


class TipAnswer(Answer):
    """Tooltip receptances, tip over tip."""

    tooling: str
    warnings: list[str]
    frequency_hz: list[float]
    axes: dict[str, Curve]
    cross: dict[str, Curve] = Field(default={}, description="Where planes feel each other: XY is the motion in X under a force in Y.")
    spindle_speed_rpm: float | None = Field(None, description="At which they hold; null where they do not change with it.")
    state: str | None = Field(None, description=STATE)


class Cut(Keys, fields=ASKED_CUT, limits=True, defaults=True):
    """What cuts, and how; coefficients that are not given are those of the identification's workpiece."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"immersion": 0.5, "strategy": "down"}]})

    engagement: EngagementRows | None = None

    def spec(self) -> CutSpec:
        """Return the cut in SI."""
        if (self.entry_deg is None) != (self.exit_deg is None):
            raise InputError("cut.exit_deg" if self.exit_deg is None else "cut.entry_deg", "nothing", "both angles, or neither")
        if (self.wear_land_um is None) != (self.indentation is None):
            missing = "wear_land_um" if self.wear_land_um is None else "indentation"
            raise InputError(f"cut.{missing}", "nothing", "wear_land_um and indentation, or neither")
        direction = self.feed_direction
        angle = FEED_DIRECTIONS[direction] if isinstance(direction, str) else math.radians(direction)
        return asked_cut(self._engagement(), float(angle), dict(self))

    def _engagement(self) -> AskedEngagement:
        told = {
            "engagement": self.engagement is not None,
            "y_from_mm": self.y_from_mm is not None or self.y_to_mm is not None,
            "entry_deg": self.entry_deg is not None,
        }
        fits = {None: list(told), "block": ["y_from_mm"], "stepover": []}[self.stock]
        given = [name for name, there in told.items() if there]
        for name in [name for name in given if name not in fits] + given[1:]:
            raise InputError(f"cut.{name}", "given beside another", "one way to tell the engagement: angles, a block's sides, or a map")
        if self.lead_deg is not None and self.engagement is None:
            raise InputError("cut.lead_deg", self.lead_deg, "an angle given together with engagement [deg]")
        if self.engagement is not None:
            z, entry, leave = np.array(self.engagement).T
            return engagement_map_of(z, entry, leave, math.radians(self.lead_deg or 0.0))
        if self.stock == "block" or told["y_from_mm"]:
            if self.y_from_mm is None or self.y_to_mm is None or not self.y_from_mm < self.y_to_mm:
                found = f"{self.y_from_mm} and {self.y_to_mm}".replace("None", "nothing")
                raise InputError("cut.y_from_mm", found, "y_from_mm and above it y_to_mm, the sides of the block")
            return Block(self.y_from_mm * 1e-3, self.y_to_mm * 1e-3)
        if self.entry_deg is None or self.exit_deg is None:
            return Immersion(self.immersion, self.strategy)
        if self.exit_deg - self.entry_deg < 0.1:
            raise InputError("cut.exit_deg", self.exit_deg, f"at least 0.1 above entry_deg, {self.entry_deg:g} [deg]")
        return Engagement(math.radians(self.entry_deg), math.radians(self.exit_deg))


class Speeds(Body):
    """Spindle speeds, the last one included."""

    from_rpm: Rpm = 4000.0
    to_rpm: Rpm = 20_000.0
    step_rpm: Annotated[float, Field(ge=0.1, le=100_000.0)] = 50.0

    def rising(self) -> tuple[float, ...]:
        """Return the speeds [rad/s], rising."""
        count = math.floor((self.to_rpm - self.from_rpm) / self.step_rpm + 1e-9) + 1
        if not 1 <= count <= MOST_SPEEDS:
            raise InputError("speeds.to_rpm", f"{max(count, 0)} speeds", f"1 to {MOST_SPEEDS} of them, from_rpm at most to_rpm")
        return tuple(from_rpm(self.from_rpm + self.step_rpm * k) for k in range(count))


class TestedCut(Body):
    """A cut that was tried, and what was seen."""

    spindle_speed_rpm: Rpm
    axial_depth_mm: Depth
    verdict: Literal["stable", "chatter", "marginal"]


class Milled(Body):
    """Which toolings on which machine, and which cut."""

    machine: OnMachine = None
    robot: OnRobot = None
    tip: OnTip = None
    toolings: list[Tooling] = Field(default=[], max_length=MOST_TOOLINGS, description="Several are compared; none with a tip's cutter.")
    cut: Cut = Field(default_factory=Cut)
    speeds: Speeds = Field(default_factory=Speeds)
    max_depth_mm: Depth = 10.0
    # not strict: JSON has no names of its own, only their text
    method: Annotated[MethodName, Field(strict=False, description="Methods other than zero-order answer for few speeds only.")] = (
        MethodName.ZERO_ORDER
    )
    bands: bool = True
    stiffness_spread_percent: Spread = 0.05
    temperature_c: Celsius = None

    def request(self, work_seconds: float) -> LobeRequest:
        """Return the query in SI, for one of its toolings."""
        return LobeRequest(
            self.cut.spec(),
            self.speeds.rising(),
            self.max_depth_mm * 1e-3,
            str(self.method),
            self.bands,
            self.stiffness_spread_percent / 100.0,
            work_seconds / max(len(self.toolings), 1),
            temperature=self.temperature_c,
        )


class LobeQuery(Milled):
    """Which toolings on which machine, and which cut; cuts that were tried stand beside the limits."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "machine": "m1",
                    "toolings": [EXAMPLE],
                    "cut": {"immersion": 0.5, "strategy": "down"},
                    "speeds": {"from_rpm": 4000, "to_rpm": 20000, "step_rpm": 50},
                    "max_depth_mm": 10.0,
                }
            ]
        }
    )

    recommend: bool = Field(
        True, description="false: zero-order limits alone, as a preview, at once; true: recommended cuts, computed by a method that fits."
    )
    tested: list[TestedCut] = Field(default=[], max_length=MOST_TESTED, description="Cuts that were tried: how many are told right?")

    def request(self, work_seconds: float) -> LobeRequest:
        """Return the query in SI, for one of its toolings."""
        tested = tuple((from_rpm(each.spindle_speed_rpm), each.axial_depth_mm * 1e-3, each.verdict) for each in self.tested)
        return replace(super().request(work_seconds), tested=tested, recommend=self.recommend)


class BestSpeed(Answer):
    """A speed with a high stability limit, one for each pocket of the lobes."""

    spindle_speed_rpm: float
    limit_depth_mm: float | None = Field(description="Stability limit; null: stable up to the depth that was asked for.")
    recommended_depth_mm: float | None = Field(
        description="The limit less what a recommendation holds back; null: as of the limit, or in a preview."
    )


class HeldBack(Answer):
    """How a recommended depth follows from the stability limit; a depth is null where no limit was found up to the one asked for."""

    within_tolerance_mm: float | None = Field(description="The lowest limit within the tolerance of the speed.")
    with_probability_mm: float | None = Field(description="Stable there with the probability; null, too, where no machines were drawn.")
    less_reserve_mm: float | None
    tolerance_percent: float
    probability_percent: float
    reserve_percent: float
    in_words: str


class RecommendedCut(Answer):
    """A recommended cut with what it takes from the spindle: the limit less tolerance of the speed, probability and reserve."""

    spindle_speed_rpm: float
    recommended_depth_mm: float | None = Field(description="null: nothing limits the cut up to the depth that was asked for, or `why`.")
    limit_depth_mm: float | None = Field(description="Stability limit there; null: none up to the depth that was asked for.")
    axial_depth_mm: float | None = Field(description="As recommended_depth_mm.")
    removal_rate_cm3_per_min: float | None = Field(description="null without a feed or a recommended depth, as are power and torque.")
    power_kw: float | None
    torque_nm: float | None
    bound: str = Field(description="What stands against more depth: chatter, power, torque, speed, depth, edge or frequency.")
    why: str | None = Field(None, description="Why no depth is recommended; null where one is.")
    held_back: HeldBack | None = Field(None, description="null where not chatter limits the depth.")


class Limits(Answer):
    """Limits around a recommended cut, by the method that computed it; null: stable up to the depth that was asked for."""

    spindle_speed_rpm: list[float]
    limit_depth_mm: list[float | None]
    limit_depth_low_mm: list[float | None] | None
    limit_depth_high_mm: list[float | None] | None
    chatter_frequency_hz: list[float | None]


class TestedTally(Answer):
    """How many tested cuts are told right; in each name the prediction stands before what was seen."""

    stable_stable: int
    stable_chatter: int = Field(description="Chatter that was not expected.")
    chatter_stable: int
    chatter_chatter: int
    stable_marginal: int
    chatter_marginal: int
    share_right: float | None = Field(description="Of the cuts that were stable or chattered.")


class BandShare(Answer):
    """What part of a band belongs to something."""

    of: str
    share: float = Field(description="Of the variance of the limit's logarithm; all shares together are 1.")


class DependsMostOn(Answer):
    """The one parameter that a stability limit depends on most."""

    parameter: str
    share: float = Field(description="Of the variance of the limit's logarithm that its exact knowledge would take away.")
    in_words: str = Field(description="What it is and how well it is known: assumed, stated or identified.")


class Band(Answer):
    """What the band of the first recommended cut's stability limit consists of."""

    deviation_percent: float = Field(description="Standard deviation of the limit.")
    shares: list[BandShare]
    depends_most_on: DependsMostOn | None = Field(None, description="null where no parameter of drawing or coefficients is uncertain.")
    in_words: str = Field(description="What dominates it, what helps and what the depth depends on most; empty where the band is narrow.")


class ToolingLobes(Answer):
    """Stability lobes of a tooling; a number that is null belongs to a cut that is stable up to the depth that was asked for."""

    tooling: str
    method: str
    state: str | None = Field(None, description=STATE)
    spindle_speed_rpm: list[float]
    limit_depth_mm: list[float | None]
    limit_depth_low_mm: list[float | None] | None = Field(
        description="95 % of the possible machines and cutting coefficients lie between; null without them, and in a preview."
    )
    limit_depth_high_mm: list[float | None] | None
    around: list[Limits] = Field([], description="Limits around the recommended cuts; there they replace a preview.")
    recommended_depth_mm: list[float | None] = Field(description="null: none is recommended, as in a preview.")
    chatter_frequency_hz: list[float | None]
    lobe: list[int | None]
    flip: list[bool]
    absolute_limit_mm: float | None
    absolute_frequency_hz: float | None
    best_speeds: list[BestSpeed]
    recommended: list[RecommendedCut]
    withheld: str | None = Field(None, description="Why these limits are no source of a recommended depth; null where they are.")
    recommended_by: str | None = Field(description="The method that computed best speeds and recommended cuts; null in a preview.")
    band: Band | None = Field(None, description="null without machines drawn from the records, or without a recommended cut.")
    flip_speeds: int = Field(description="Speeds at which stability is lost by period doubling.")
    tested: TestedTally | None = Field(None, description="null: no tested cuts were given.")
    warnings: list[str]


class LobeAnswer(Answer):
    """Lobes of all toolings, in the order of the query."""

    machine: str = Field(description="Its id, the robot's name, or `tip`.")
    toolings: list[ToolingLobes]


class PlannedQuery(Body):
    """A cut that somebody wants to make."""

    spindle_speed_rpm: Rpm
    axial_depth_mm: Depth


class AdviceQuery(Milled):
    """What a machinist asks; cut.feed_per_tooth_mm is needed."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {"machine": "m1", "toolings": [EXAMPLE], "cut": {"immersion": 0.5, "feed_per_tooth_mm": 0.1}, "max_power_kw": 20.0}
            ]
        }
    )

    max_power_kw: Annotated[float, within(POWER)] | None = None
    max_torque_nm: Annotated[float, within(TORQUE)] | None = None
    max_speed_rpm: Rpm | None = None
    tolerance_percent: Annotated[float, Field(ge=0.0, le=20.0)] = 1.0
    probability_percent: Annotated[float, Field(gt=0.0, le=100.0)] = 95.0
    reserve_percent: Annotated[float, Field(ge=0.0, le=90.0)] = 10.0
    depth_mm: Depth | None = Field(None, description="At which speeds may one cut so deep?")
    planned: list[PlannedQuery] = Field(default=[], max_length=20, description="How far are these cuts from chatter?")

    def advice(self, work_seconds: float) -> AdviceRequest:
        """Return the query in SI, for one of its toolings."""
        if self.cut.feed_per_tooth_mm is None:
            raise InputError("cut.feed_per_tooth_mm", "nothing", "the feed per tooth [mm]: power and removal rate grow with it")
        for i, cut in enumerate(self.planned):
            if cut.axial_depth_mm > self.max_depth_mm:
                raise InputError(f"planned.{i}.axial_depth_mm", cut.axial_depth_mm, f"at most max_depth_mm, {self.max_depth_mm:g}")
        return AdviceRequest(
            self.request(work_seconds),
            None if self.max_power_kw is None else self.max_power_kw * 1e3,
            self.max_torque_nm,
            None if self.max_speed_rpm is None else from_rpm(self.max_speed_rpm),
            self.tolerance_percent / 100.0,
            self.probability_percent / 100.0,
            self.reserve_percent / 100.0,
            None if self.depth_mm is None else self.depth_mm * 1e-3,
            tuple((from_rpm(cut.spindle_speed_rpm), cut.axial_depth_mm * 1e-3) for cut in self.planned),
        )


class Window(Answer):
    """Speeds at which a depth is allowed."""

    from_rpm: float
    to_rpm: float
    best_rpm: float
    allowed_mm: float | None = Field(description="null: nothing limits the cut up to the depth that was asked for.")


class PlannedAnswer(Answer):
    """How a planned cut stands."""

    spindle_speed_rpm: float
    axial_depth_mm: float
    stable: bool
    method: str = Field(description="By which it was judged; zero-order limits are a preview.")
    limit_depth_mm: float | None
    robust_limit_mm: float | None
    margin: float | None = Field(description="Share of the depth by which the limit lies above it.")
    chatter_frequency_hz: float | None
    slower_rpm: float | None
    faster_rpm: float | None
    probability: float | None
    load: float | None
    power_kw: float
    torque_nm: float
    removal_rate_cm3_per_min: float


class ToolingAdvice(Answer):
    """Advice for a tooling."""

    tooling: str
    stickout_mm: float | None = Field(description="null of a cutter alone.")
    state: str | None = Field(None, description=STATE)
    lowest_limit_mm: float | None
    common_stable_depth_mm: float | None = Field(description="Stable at every speed with all possible machines and cutting coefficients.")
    withheld: str | None = Field(None, description="Why these limits are no source of a recommended depth; null where they are.")
    recommended_by: str | None = Field(description="The method that computed the recommended cuts.")
    band: Band | None = Field(None, description="null without machines drawn from the records, or without a recommended cut.")
    highest_removal: list[RecommendedCut]
    windows: list[Window]
    planned: list[PlannedAnswer]
    around: list[Limits] = Field([], description="Limits around the recommended cuts; there they replace a preview.")
    warnings: list[str]


class AdviceAnswer(Answer):
    """Advice for all toolings, in the order of the query."""

    machine: str = Field(description="Its id, the robot's name, or `tip`.")
    toolings: list[ToolingAdvice]
