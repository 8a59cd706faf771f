"""Toolings: the keys of a tooling file and their types; their values are checked by the reader of such files."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import ConfigDict, Field, StringConstraints

from api.schemas.common import Answer, Body, Keys, Line
from rcsa_ident.cutting.serration import WaveShape
from rcsa_ident.io.settings.cutters import MOST_POINTS
from rcsa_ident.setup.fields import CONTACT, CUTTER, MATERIAL, SEGMENT, SPREAD

Text = Annotated[str, StringConstraints(min_length=1, max_length=200)]
MOST_SEGMENTS, MOST_TEETH = 200, 100
Offsets = Annotated[list[float], Field(max_length=MOST_TEETH)]
Points = Annotated[list[Annotated[list[float], Field(min_length=2, max_length=3)]], Field(max_length=MOST_POINTS)]

EXAMPLE: dict[str, Any] = {
    "name": "S1-ER32",
    "cutter": {"teeth": 4, "diameter_mm": 12.0},
    "tool": {"stickout_mm": 70.5, "segments": [{"length_mm": 110.5, "outer_diameter_mm": 12.0, "material": "carbide"}]},
    "holder": {
        "insertion_mm": 40.0,
        "segments": [{"length_mm": 40.0, "outer_diameter_mm": 50.0, "inner_diameter_mm": 12.0, "material": "steel"}],
    },
    "contact": {
        "translational_stiffness": 2.0e10,
        "rotational_stiffness": 6.0e5,
        "translational_damping": 6.0e4,
        "rotational_damping": 9.0,
    },
}


class SerrationKeys(Body):
    """[cutter.serration]: waves along each edge."""

    amplitude_mm: float
    wavelength_mm: float
    shape: Text | None = Field(None, description=f"One of {', '.join(WaveShape)}; sine without it.")
    shift: list[float] | None = Field(None, max_length=MOST_TEETH, description="Of each tooth's wave, in wavelengths.")
    table: list[float] | None = Field(None, max_length=MOST_POINTS)


class CutterKeys(Keys, fields=CUTTER):
    """[cutter]"""

    helix_deg: float | Offsets = 0.0
    helix_kind: Text | None = None
    pitch_deg: Offsets | None = None
    shape: Text | None = None
    profile: Points | None = None
    serration: SerrationKeys | None = None
    runout_mm: Offsets | None = None
    axial_runout_mm: Offsets | None = None


class SegmentKeys(Keys, fields=SEGMENT):
    """A segment of tool or holder, from the free end towards the flange."""

    inner_diameter_mm: float = 0.0
    material: Text


class ToolKeys(Body):
    """[tool]"""

    stickout_mm: float
    segments: list[SegmentKeys] = Field(min_length=1, max_length=MOST_SEGMENTS)
    model: Text | None = Field(None, description="Tools of one model share what their drawing does not tell.")


class HolderKeys(Body):
    """[holder]"""

    insertion_mm: float
    segments: list[SegmentKeys] = Field(min_length=1, max_length=MOST_SEGMENTS)
    model: Text | None = Field(None, description="Holders of one model share their contact.")
    taper: Text | None = Field(None, description="What a ring hears behind the flange, as HSK-A63.")


class ContactKeys(Keys, fields=CONTACT):
    """[contact], per metre of insertion"""

    translational_damping: float = Field()
    rotational_damping: float = Field()


class MaterialKeys(Keys, fields=MATERIAL):
    """[materials.NAME]"""

    youngs_modulus_gpa: float | None = None
    density: float | None = None
    poisson: float | None = None


class SpreadKeys(Keys, fields=SPREAD):
    """[spread]: how well the drawing is known, standard deviations; 0 is exactly, and what is left out is as well as drawings are."""


class ToolingKeys(Body):
    """A tooling, with the keys of a tooling file."""

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE]})

    name: Text | None = None
    cutter: CutterKeys
    tool: ToolKeys
    holder: HolderKeys
    contact: ContactKeys | None = None
    materials: dict[Text, MaterialKeys] | None = Field(None, max_length=50)
    spread: SpreadKeys | None = Field(None, description="Without it the drawing is taken as exact.")


class ToolingAnswer(Answer):
    """A tooling of the library."""

    name: str
    tooling: ToolingKeys
    changed: str
    etag: str


class ToolingSummary(Answer):
    """Summary of a tooling."""

    name: str
    teeth: int
    diameter_mm: float
    stickout_mm: float
    shape: str = Field("flat", description="Of the cutter; one that was written before shapes were told is flat.")
    label: Line
    changed: str
    etag: str
