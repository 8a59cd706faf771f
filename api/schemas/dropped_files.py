"""Files that somebody dropped, and what they mean."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field, ValidationError

from api.schemas.common import Answer, Body
from api.schemas.queries import TestedCut
from api.schemas.versions import Difference
from rcsa_ident.base.errors import InputError
from rcsa_ident.io.settings.tested_cuts import COLUMNS

#: Fields of one tooling that are told; 200 toolings of 400 segments would differ in 300 000.
MOST_DIFFERENCES = 50


class DroppedFile(Body):
    """A TOML file."""

    name: Annotated[str, Field(min_length=1, max_length=300)]
    text: Annotated[str, Field(max_length=1_000_000)]


class DroppedFiles(Body):
    """TOML files of a campaign: campaign.toml and toolings."""

    files: list[DroppedFile] = Field(max_length=200)


class DroppedToolingAnswer(Answer):
    """A tooling among the files."""

    file: str
    key: str = Field(description="Its name in the library and in the campaign, which need not be the file's.")
    listed: bool = Field(description="Whether the campaign names it.")
    etag: str | None = Field(description="Of the tooling in the library, for If-Match; null where there is none.")
    differences: list[Difference] = Field(description=f"From the library's to the dropped one, the first {MOST_DIFFERENCES}.")
    differing: int = Field(description="How many fields differ in all.")


class DroppedAnswer(Answer):
    """What the files hold; nothing of it is stored."""

    campaign: str | None = Field(description="The campaign's file; null where there is none.")
    name: str = Field(description="The campaign's, empty while toolings are missing.")
    keys: dict[str, Any] = Field(description="Of the campaign, as making one takes them.")
    toolings: list[DroppedToolingAnswer]
    from_library: list[str] = Field(description="Toolings of the campaign that the library has and the files lack.")
    missing: list[str] = Field(description="Toolings of the campaign that neither has.")
    recordings: list[str] = Field(description="Names of the recordings that the campaign wants.")
    others: list[str] = Field(description="Files that are neither campaign nor tooling.")


class TestedCutsAnswer(Answer):
    """Cuts that were tried."""

    cuts: list[TestedCut]
    warnings: list[str] = Field(description="Which columns were left aside.")


def tested_cut(index: int, row: tuple[float, float, str]) -> TestedCut:
    """Return a cut of a table (speed [rev/min], depth [mm], verdict) within what a query takes; an error names the cut from 0."""
    try:
        return TestedCut.model_validate(dict(zip(COLUMNS, row, strict=True)), strict=False)
    except ValidationError as error:
        (fault, *_) = error.errors()
        field = fault["loc"][0]
        raise InputError(f"cuts[{index}].{field}", f"{fault['input']:g}", fault["msg"].removeprefix("Input should be ")) from None
