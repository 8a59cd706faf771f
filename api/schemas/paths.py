"""A tool along a path through stock: what is asked, what a preview tells, and what a job comes to."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field

from api.schemas.common import Answer, Body, Line
from api.schemas.jobs import JobAnswer
from api.schemas.queries import OnMachine, OnRobot, Rpm, Tooling
from api.schemas.robot_queries import Coordinate
from api.schemas.toolings import EXAMPLE
from api.work.paths import PathRequest
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import from_rpm
from rcsa_ident.cutting.stock import Immersion
from rcsa_ident.setup.cut import CutSpec
from rcsa_ident.stability.methods import MethodName

Millimetre = Annotated[float, Field(ge=1e-6, le=100.0)]
_SHOWN: dict[str, Any] = {"tooling": EXAMPLE, "block_mm": [0.0, 0.0, -20.0, 60.0, 40.0, 0.0]}


class PathCut(Body):
    """Coefficients of the material; those that are not given are the identification's workpiece's. What else a cut is the path says."""

    material: Annotated[Line | None, Field(description="Of the library of materials.")] = None
    ktc_mpa: float | None = None
    krc: float | None = None
    kac: float | None = None
    kte_n_per_mm: float | None = None
    kre_n_per_mm: float | None = None

    def spec(self) -> CutSpec:
        """Return the cut in SI."""
        values = (
            ("tangential", self.ktc_mpa, 1e6), ("radial_ratio", self.krc, 1.0), ("axial_ratio", self.kac, 1.0),
            ("tangential_edge", self.kte_n_per_mm, 1e3), ("radial_edge", self.kre_n_per_mm, 1e3),
        )  # fmt: skip
        return CutSpec(
            engagement=Immersion(0.5, "down"),
            material=self.material,
            coefficients={name: value * unit for name, value, unit in values if value is not None},
        )


class RemovalQuery(Body):
    """What does a tooling take out of its stock along a path? The part `query` of a form, beside the files `path` and `stock`."""

    model_config = ConfigDict(json_schema_extra={"examples": [_SHOWN]})

    tooling: Tooling
    block_mm: Annotated[
        list[Coordinate] | None,
        Field(
            min_length=6,
            max_length=6,
            description="Stock by two corners, x, y, z of the lower and of the upper one; else the file `stock`.",
        ),
    ] = None
    cell_mm: Annotated[Millimetre | None, Field(description="Between lines of material; by default a twentieth of the tool's radius.")] = (
        None
    )
    step_mm: Annotated[Millimetre | None, Field(description="Between places on the path; by default a tenth of the tool's radius.")] = None

    def request(self, file: str, text: str, surface: str) -> PathRequest:
        """Return the query in SI; `surface` is the stock's file in base64, where there is one."""
        return self._request("removal", file, text, surface)

    def _request(self, kind: str, file: str, text: str, surface: str, **further: Any) -> PathRequest:
        block = None if self.block_mm is None else tuple(1e-3 * each for each in self.block_mm)
        if (block is None) == (surface == ""):
            found = "nothing" if block is None else "given beside the file stock"
            raise InputError("block_mm", found, "two corners, or a file of the stock: one of them")
        if block is not None and not all(a < b for a, b in zip(block[:3], block[3:], strict=True)):
            raise InputError("block_mm", self.block_mm, "the lower corner first: x, y and z of the second one are larger")
        cell, step = (None if each is None else 1e-3 * each for each in (self.cell_mm, self.step_mm))
        told = {
            "speed": None, "cut": PathCut().spec(), "method": str(MethodName.ZERO_ORDER), "bands": False, "play": True, "weight": True,
            "turn_steps": 360, "cutoff": 0.8e-3,
        }  # fmt: skip
        return PathRequest(kind, file, text, block, surface, cell, step, **(told | further))


class PathStabilityQuery(RemovalQuery):
    """How far is each move from chatter, and what are its force and form error? The part `query` of a form."""

    model_config = ConfigDict(json_schema_extra={"examples": [_SHOWN | {"machine": "m1"}]})

    machine: OnMachine = None
    robot: OnRobot = None
    cut: PathCut = Field(default_factory=PathCut)
    spindle_speed_rpm: Annotated[Rpm | None, Field(description="Where the path has none.")] = None
    # not strict: JSON has no names of its own, only their text
    method: Annotated[MethodName, Field(strict=False)] = MethodName.FULL_DISCRETISATION
    bands: bool = Field(True, description="Draw machines from what is left open of this one.")

    def request(self, file: str, text: str, surface: str) -> PathRequest:
        """Return the query in SI."""
        judged = {"method": str(self.method), "bands": self.bands}
        return self._request("stability", file, text, surface, speed=_speed(self.spindle_speed_rpm), cut=self.cut.spec(), **judged)


class PathMillingQuery(RemovalQuery):
    """What happens turn by turn, in time? The part `query` of a form. Places of the path are not cut up: `step_mm` is of no use."""

    model_config = ConfigDict(json_schema_extra={"examples": [_SHOWN | {"machine": "m1"}]})

    machine: OnMachine = None
    robot: OnRobot = None
    cut: PathCut = Field(default_factory=PathCut)
    spindle_speed_rpm: Annotated[Rpm | None, Field(description="Where the path has none.")] = None
    turn_steps: Annotated[int, Field(ge=60, le=20_000, description="Instants of a turn, at least.")] = 360
    play: bool = Field(True, description="With the play of a robot's drives.")
    weight: bool = Field(True, description="Whether the arm's weight holds that play.")
    cutoff_mm: Annotated[float, Field(gt=0.0, le=25.0, description="Of the Gaussian filter (ISO 16610-21) for Ra, Rq and Rt.")] = 0.8

    def request(self, file: str, text: str, surface: str) -> PathRequest:
        """Return the query in SI."""
        milled = {"turn_steps": self.turn_steps, "play": self.play, "weight": self.weight, "cutoff": 1e-3 * self.cutoff_mm}
        return self._request("milling", file, text, surface, speed=_speed(self.spindle_speed_rpm), cut=self.cut.spec(), **milled)


def _speed(rpm: float | None) -> float | None:
    return None if rpm is None else from_rpm(rpm)


class DrawnPath(Answer):
    """The line that is drawn of a path; of many places some."""

    places_mm: list[list[float]]
    axes: list[list[float]] = Field(description="Of the tool, from its tip into the spindle.")
    way_mm: list[float] = Field(description="Up to each place.")
    line: list[int] = Field(description="Of the file; 0 where there is none.")
    rapid: list[bool] = Field(description="Whether the tool came to the place by rapid moves.")


class PathTold(Answer):
    """What a path is, as the commands read PATH.nc and PATH.csv."""

    places: int
    length_mm: float
    cutting_length_mm: float = Field(description="Of the moves at a feed.")
    time_s: float | None = Field(description="At the feeds, rapid moves left out; null where a move has none.")
    low_mm: list[float] = Field(description="Of the box around the tip's places on moves at a feed.")
    high_mm: list[float]
    spindle_speed_told: bool = Field(description="Whether every move at a feed has a spindle speed.")
    warnings: list[str]
    path: DrawnPath


class CutPart(Answer):
    """The surface that is left, as triangles."""

    points_mm: list[float] = Field(description="x, y, z of each point, one after the other.")
    triangles: list[int] = Field(description="Three points each, counterclockwise from outside.")
    rows: list[int] = Field(description="Of each triangle the row whose move or turn made it; -1: none that is told.")


class PathCutAnswer(Answer):
    """What a tool does along a path through stock."""

    kind: Literal["removal", "stability", "milling"]
    machine: str
    tooling: str
    status: Literal["stable", "chatter", "no cut", "lost", "not converged"] | None = Field(
        description="null: nothing was asked of a machine."
    )
    sentences: list[str]
    warnings: list[str]
    removed_volume_mm3: float
    left_volume_mm3: float
    cell_mm: float
    rows: int = Field(
        description="Of the table: moves that cut, or turns of the tool. Of more than 10 000 the worst among neighbours are told."
    )
    columns: dict[str, list[float | None]] = Field(
        description="As STABILITY.csv or FORCES.csv have them, of a removal place and depth; beside them removed_volume_mm3, of moves, and "
        "way_mm and length_mm: the way up to the row's end, and the row's own."
    )
    part: CutPart | None = Field(description="null where nothing is left.")
    path: DrawnPath
    tool_outline_mm: list[list[float]] = Field(description="Radius and height above the tip, from the tip up.")


class PathJob(Answer):
    """A tool along a path, as a job."""

    job: JobAnswer
    answer: PathCutAnswer | None = Field(description="Once the job is done.")
