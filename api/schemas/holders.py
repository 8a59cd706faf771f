"""The catalogue of holders."""

from __future__ import annotations

from pydantic import Field

from api.schemas.common import Answer
from api.schemas.toolings import ContactKeys, HolderKeys, SpreadKeys


class ChuckAnswer(Answer):
    """A kind of chuck and the shanks that it takes."""

    name: str
    least_bore_mm: float
    largest_bore_mm: float


class Holders(Answer):
    """What the catalogue holds: every chuck with every taper."""

    tapers: list[str]
    chucks: list[ChuckAnswer]


class TypicalContactAnswer(Answer):
    """What the contact of tool and holder is worth before anybody has measured it."""

    kind: str = Field(description="How the chuck clamps.")
    keys: ContactKeys
    stiffness_spread_percent: float = Field(description="Standard deviation of the logarithm.")
    damping_spread_percent: float
    source: str


class CatalogueAnswer(Answer):
    """A holder of the catalogue."""

    name: str
    mass_kg: float = Field(description="With collet and nut, without the taper behind the spindle's face.")
    sources: list[str] = Field(description="Of the dimensions; what is typical is called so.")
    holder: HolderKeys
    contact: TypicalContactAnswer | None = Field(description="null where nothing is known of this kind of chuck.")
    spread: SpreadKeys = Field(description="Of a tooling with this holder and contact, until they are measured.")
