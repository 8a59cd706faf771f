"""Queries of arms: what they are at a posture, which postures follow a path, and which limits there are along it."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import ConfigDict, Field

from api.schemas.common import Answer, Body
from api.schemas.queries import Cut, Depth, Speeds, Tooling
from api.schemas.robots import EXAMPLE, Posed
from api.schemas.toolings import EXAMPLE as TOOLING
from api.work.requests import LobeRequest
from api.work.robots import MOST_LIMITS, MOST_PLACES
from rcsa_ident.base.errors import InputError
from rcsa_ident.stability.methods import MethodName

Coordinate = Annotated[float, Field(ge=-20_000.0, le=20_000.0)]
#: Of a tool's tip, with the tool's axis where the tool does not stand upright.
Place = Annotated[list[Coordinate], Field(min_length=3, max_length=6)]
PlacedPath = Annotated[
    list[Place],
    Field(
        min_length=1,
        max_length=MOST_PLACES,
        description="Places of the tool's tip, x, y, z [mm] in the base's axes, all of them with the axis i, j, k from the tip into the "
        "spindle or none: it points upwards then.",
    ),
]
Near = Annotated[Posed, Field(description="Its posture is near the one at the first place: of all that reach it the nearest one is taken.")]
_ARM: dict[str, Any] = {"robot": EXAMPLE, "posture_deg": [0.0, 45.0]}


class PostureQuery(Body):
    """What is an arm at a posture?"""

    model_config = ConfigDict(json_schema_extra={"examples": [{"robot": _ARM}]})

    robot: Posed
    tooling: Tooling | None = Field(None, description="Part of the drawing.")
    drawing: bool = Field(True, description="Whether to tell what a picture is drawn from: it is the same at all postures.")


class DrawnJoint(Answer):
    """Where a joint stands in the axes of the one before it, the first one in the base's, at angle zero."""

    name: str
    offset_mm: list[float]
    turn: list[list[float]] = Field(description="Its axes as columns.")
    axis: list[float] = Field(description="In its own axes.")
    limits_deg: list[float] | None = Field(description="null: it turns without end.")


class DrawnPart(Answer):
    """A round body along a line: limbs and spindles with rounded ends, others with flat ones."""

    kind: str = Field(description="base, limb, joint, spindle or tool.")
    carrier: int = Field(description="What moves it: 0 is the base, k the k-th joint.")
    points_mm: list[list[float]] = Field(description="In the carrier's axes.")
    radius_mm: float


class RobotDrawing(Answer):
    """What a picture of an arm at any posture is drawn from."""

    reach_mm: float
    joints: list[DrawnJoint]
    parts: list[DrawnPart]
    tip_mm: list[float] = Field(description="Of the tool, or where the tool-holder's flange sits; in the last joint's axes.")
    tool_axis: list[float] = Field(description="Out of the spindle, in the last joint's axes.")


class PostureAnswer(Answer):
    """What an arm is at a posture, as `rcsa-ident robot check` tells it."""

    name: str
    degrees_of_freedom: int
    mass_kg: float | None = Field(description="null where no masses are known; frequencies, ratios and torques are empty then.")
    tcp_m: list[float] = Field(description="Where the tool-holder's flange sits, in the base's axes.")
    tcp_axes: list[list[float]] = Field(description="Its axes as columns; z points along the tool.")
    natural_frequencies_hz: list[float] = Field(description="Without damping, rising.")
    damping_ratios: list[float]
    gravity_torque_nm: list[float] = Field(description="Of the drives, that hold the arm.")
    tcp_compliance_m_per_n: list[list[float]] = Field(description="At rest, in the base's axes.")
    postures_deg: list[list[float]] = Field(description="All that bring the flange to the same place, as far as they are known.")
    warnings: list[str]
    drawing: RobotDrawing | None = Field(description="null where it was not asked for.")


class PathQuery(Body):
    """Which postures bring a tool's tip along a path?"""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"robot": {"robot": "tx200", "posture_deg": [0.0] * 6}, "tooling": TOOLING, "places": [[1200, 0, 500]]}]
        }
    )

    robot: Near
    tooling: Tooling
    places: PlacedPath


class PathAnswer(Answer):
    """A posture for each place."""

    postures_deg: list[list[float]]
    warnings: list[str]


class MapQuery(PathQuery):
    """Which limits are there along a path?"""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "robot": {"robot": "tx200", "posture_deg": [0.0] * 6},
                    "tooling": TOOLING,
                    "places": [[1200, 0, 500], [1200, 100, 500]],
                    "cut": {"immersion": 0.5, "ktc_mpa": 660.0, "krc": 0.38},
                    "speeds": {"from_rpm": 4000, "to_rpm": 20000, "step_rpm": 100},
                }
            ]
        }
    )

    cut: Cut = Field(default_factory=Cut)
    speeds: Speeds = Field(default_factory=Speeds)
    max_depth_mm: Depth = 10.0
    # not strict: JSON has no names of its own, only their text
    method: Annotated[
        MethodName, Field(strict=False, description="Methods other than zero-order answer for few places and speeds only.")
    ] = MethodName.ZERO_ORDER

    def request(self, work_seconds: float) -> LobeRequest:
        """Return the query in SI."""
        speeds = self.speeds.rising()
        if len(speeds) * len(self.places) > MOST_LIMITS:
            raise InputError("places", f"{len(self.places)} places at {len(speeds)} speeds", f"at most {MOST_LIMITS} limits in all")
        return LobeRequest(self.cut.spec(), speeds, self.max_depth_mm * 1e-3, str(self.method), False, 0.0, work_seconds, recommend=False)


class MapAnswer(PathAnswer):
    """A limit at each place and each speed; null where the cut is stable up to the depth that was asked for."""

    tooling: str
    method: str
    spindle_speed_rpm: list[float]
    limit_depth_mm: list[list[float | None]] = Field(description="A row for each place.")
    chatter_frequency_hz: list[list[float | None]]
    best_speed_rpm: float = Field(description="At which the depth that every place allows is largest.")
    limit_everywhere_mm: float | None


class PathPreview(Answer):
    """A path, as the commands read PATH.csv."""

    places: list[list[float]] = Field(description="x, y, z [mm], i, j, k.")
