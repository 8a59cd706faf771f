"""Versions of toolings, robots and identifications, and the audit trail that they are part of."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from api.schemas.common import Answer
from api.schemas.robots import RobotKeys
from api.schemas.toolings import ToolingKeys

Kind = Literal["tooling", "robot", "machine", "identification"]
Action = Literal["made", "changed", "restored", "deleted"]
Value = int | float | str | list[int | float] | None


class ChangeAnswer(Answer):
    """An entry of the audit trail."""

    id: int
    kind: Kind
    name: str = Field(description="Of the tooling or the robot, or id of the machine.")
    title: str = Field(description="Its name at that time.")
    version: int = Field(description="Counts the changes of one tooling, robot, machine or identification.")
    action: Action
    restores: int | None = Field(description="Version that is written again.")
    created: str = Field(description="UTC, ISO 8601.")
    key: str = Field(description="Id of the API key; empty where nobody knows who it was.")
    who: str = Field(description="Name of the API key.")
    why: str
    etag: str | None = Field(description="Of the version's content; null where it has none.")
    holds: bool = Field(description="Whether this content is what is there now, so that there is nothing to restore.")


class Difference(Answer):
    """A key that differs between two toolings, or two robots; null where one of them does not have it."""

    field: str
    old: Value
    new: Value


class Differences(Answer):
    """Where a tooling differs from that of the library."""

    etag: str = Field(description="Of the tooling in the library, for If-Match.")
    differences: list[Difference]


class ToolingVersion(Answer):
    """A version of a tooling."""

    change: ChangeAnswer
    tooling: ToolingKeys
    differences: list[Difference] = Field(description="From the tooling in the library to this version; empty where there is none.")


class RobotVersion(Answer):
    """A version of a robot."""

    change: ChangeAnswer
    robot: RobotKeys
    differences: list[Difference] = Field(description="From the robot that is kept to this version; empty where there is none.")
