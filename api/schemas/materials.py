"""The library of materials."""

from __future__ import annotations

from pydantic import Field

from api.schemas.common import Answer


class MaterialAnswer(Answer):
    """A workpiece material as one source has cut it."""

    name: str = Field(description="What a query's cut.material may say.")
    condition: str = Field(description="Cutter, lubrication, feed that the coefficients hold for.")
    ktc_mpa: float
    krc: float
    kte_n_per_mm: float
    kre_n_per_mm: float
    ktc_spread_percent: float = Field(description="What another cutter may be off.")
    source: str
    notes: str


class Materials(Answer):
    """All of them."""

    items: list[MaterialAnswer]
