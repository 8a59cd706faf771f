"""Robots: the keys of ROBOT.toml and their types, and an arm at a posture; values are checked by the reader of such files."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import ConfigDict, Field, StringConstraints

from api.schemas.common import Answer, Body, Line, Name
from api.work.robots import MOST_JOINTS, MOST_TILTS

Text = Annotated[str, StringConstraints(min_length=1, max_length=200)]
Three = Annotated[list[float], Field(min_length=3, max_length=3)]
Six = Annotated[list[float], Field(min_length=6, max_length=6)]
Pair = Annotated[list[float], Field(min_length=2, max_length=2)]
Angle = Annotated[float, Field(ge=-720.0, le=720.0)]

_LINK: dict[str, Any] = {"mass_kg": 300.0, "center_of_mass_mm": [0.0, 0.0, 400.0], "inertia_kg_m2": [20.0, 20.0, 6.0, 0.0, 0.0, 0.0]}
EXAMPLE: dict[str, Any] = {
    "robot": {"name": "two axes"},
    "joints": [
        {"name": "J1", "axis": [0.0, 0.0, 1.0], "stiffness_nm_per_rad": 2.0e6, "damping_nms_per_rad": 500.0, "link": _LINK},
        {
            "name": "J2",
            "offset_mm": [250.0, 0.0, 600.0],
            "axis": [0.0, 1.0, 0.0],
            "limits_deg": [-120.0, 120.0],
            "stiffness_nm_per_rad": 4.0e6,
            "damping_nms_per_rad": 800.0,
            "link": _LINK,
        },
    ],
    "flange": {"offset_mm": [0.0, 0.0, 900.0]},
}


class RobotHeadKeys(Body):
    """[robot]"""

    name: Text
    source: str | None = Field(None, max_length=1000)
    gravity_m_per_s2: Three | None = Field(None, description="In the base's axes; straight down without it.")
    base_mass_kg: float | None = None


class FrameKeys(Body):
    """[flange] and [tool_point]"""

    offset_mm: Three | None = None
    turn_deg: Three | None = Field(None, description="About x, then y, then z of the frame before.")


class BodyKeys(Body):
    """[joints.link] and [payload]"""

    mass_kg: float
    center_of_mass_mm: Three | None = None
    inertia_kg_m2: Six | None = Field(None, description="xx, yy, zz, xy, yz, zx about the centre; the tensor's own signs.")


class TiltKeys(Body):
    """[[joints.tilts]]: a spring across the joint's axis."""

    axis: Three
    stiffness_nm_per_rad: float
    damping_nms_per_rad: float | None = None


class JointKeys(FrameKeys):
    """[[joints]], from the base on"""

    name: Text
    axis: Three
    limits_deg: Pair | None = None
    stiffness_nm_per_rad: float
    damping_nms_per_rad: float | None = None
    backlash_rad: float | None = None
    gravity_compensated: bool | None = None
    link: BodyKeys | None = None
    tilts: list[TiltKeys] | None = Field(None, max_length=MOST_TILTS)


class RobotKeys(Body):
    """A robot, with the keys of ROBOT.toml."""

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE]})

    robot: RobotHeadKeys
    joints: list[JointKeys] = Field(min_length=1, max_length=MOST_JOINTS)
    flange: FrameKeys | None = None
    tool_point: FrameKeys | None = Field(None, description="Where the tool-holder's flange sits, in the robot's flange.")
    payload: BodyKeys | None = None


class RobotAnswer(Answer):
    """A robot that is kept."""

    name: str
    robot: RobotKeys
    changed: str
    etag: str


class RobotSummary(Answer):
    """Summary of a robot."""

    name: str
    label: Line = Field(description="As its file calls it.")
    joints: int
    degrees_of_freedom: int
    mass_kg: float | None = Field(description="null where no masses are known: postures and stiffness, but no natural frequencies.")
    warnings: list[str] = Field(description="Links that cannot be.")
    changed: str
    etag: str


class Posed(Body):
    """A robot whose drives hold a posture."""

    robot: Annotated[
        Name | RobotKeys, Field(description="Name of one that is kept, else of a published one (tx200, kr210, kr500), or the robot itself.")
    ]
    posture_deg: list[Angle] = Field(min_length=1, max_length=MOST_JOINTS, description="Angles of the joints, as ROBOT.toml counts them.")
    joints_only: bool = Field(False, description="Leave the springs across the joints' axes out.")
