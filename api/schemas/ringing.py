"""What the ring of a tooling tells of it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import ConfigDict, Field

from api.schemas.common import Answer, Body, within
from api.schemas.queries import Tooling
from api.schemas.toolings import EXAMPLE, ToolingKeys
from rcsa_ident.base.plausibility import RATE

Rate = Annotated[float, within(RATE)]


class RingQuery(Body):
    """The tooling that rings: the part `query` of a form."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"tooling": EXAMPLE | {"spread": {}}, "mass_g": 148.0}]})

    tooling: Tooling
    mass_g: Annotated[float | None, Field(gt=0.0, le=1e6, description="Of the tool alone, weighed.")] = None
    rate_hz: Annotated[Rate | None, Field(description="Of files that tell none.")] = None
    curves: bool = Field(False, description="Also the spectra that a page draws.")


class RungLine(Answer):
    """A line that was heard, and what it is; as `rcsa-ident ring --json` tells it."""

    model_config = ConfigDict(populate_by_name=True)

    of: Literal["tooling", "tool alone"]
    is_: str | None = Field(alias="is", serialization_alias="is", description="Mode of the drawing; null where it is none of them.")
    frequency_hz: float
    frequency_std_hz: float
    damping_percent: float
    damping_std_percent: float
    planes_apart_percent: float = Field(description="By which both planes of bending differ.")
    drawn_hz: float | None = Field(description="Of that mode as drawn.")
    drawn_damping_percent: float | None
    learned_hz: float | None
    learned_damping_percent: float | None


class RungNumber(Answer):
    """A number of the drawing before and after, with its standard deviations."""

    what: str
    key: str = Field(description="As a tooling file has it.")
    before: float
    before_std: float
    after: float
    after_std: float
    unit: str


class RungSpectrum(Answer):
    """Amplitudes of the sounds of one thing, the largest of which is 1; of neighbouring lines the largest."""

    of: Literal["tooling", "tool alone"]
    frequency_hz: list[float]
    amplitude: list[float]


class RingAnswer(Answer):
    """What a ring tells of a tooling."""

    tooling: str
    status: Literal["good", "suspect"] = Field(description="suspect: drawing, spread and ring hardly go together.")
    probability: float = Field(description="Of a misfit as large as this or larger, were drawing and spread as told.")
    heard: list[RungLine]
    changes: list[RungNumber]
    remarks: list[str]
    learned: ToolingKeys = Field(description="The tooling with what was learned, ready for `PUT /v1/toolings/{name}`.")
    etag: str | None = Field(description="Of the library's tooling that rang, for If-Match of its writing; null of one that came as JSON.")
    curves: list[RungSpectrum] | None = Field(description="Where they are asked for.")
