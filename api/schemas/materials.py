"""The library of materials."""

from __future__ import annotations

from pydantic import Field

from api.schemas.common import Answer


class MaterialAnswer(Answer):
    """Cutting coefficients of a workpiece material from one source."""

    name: str = Field(description="Value for `cut.material` of a query.")
    condition: str = Field(description="Cutter, lubrication and feed of the coefficients.")
    ktc_mpa: float
    krc: float
    kte_n_per_mm: float
    kre_n_per_mm: float
    ktc_spread_percent: float = Field(description="Uncertainty for another cutter.")
    source: str
    notes: str


class Materials(Answer):
    """All materials."""

    items: list[MaterialAnswer]
