"""The tip of one tooling, as tap tests show it: in the place of a machine, for that tooling alone."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, StringConstraints

from api.schemas.common import Body
from api.schemas.toolings import CutterKeys, Text
from rcsa_ident.setup.fields import CORRECTION, CORRECTIONS

#: Direct and cross FRFs along three axes.
MOST_FRFS = 9
Directions = Literal["X", "Y", "Z", "XY", "XZ", "YX", "YZ", "ZX", "ZY"]
FrfText = Annotated[str, StringConstraints(min_length=1, max_length=1_000_000)]
FrfUnits = Annotated[str, StringConstraints(min_length=1, max_length=40)]


class TapTest(Body):
    """FRFs of the tip, in one file's text."""

    text: FrfText = Field(description="FRF.csv, a universal file in text, or text columns of frequency [Hz], real and imaginary part.")
    axes: Directions | None = Field(None, description="Axis of response and force, XY where it is pushed along Y; null: as the text says.")
    record: Annotated[int, Field(ge=1, le=100_000)] | None = Field(None, description="Which of several, counted from 1.")
    correction: Literal[CORRECTIONS] = Field("auto", description=CORRECTION)  # type: ignore[valid-type]


class TappedTip(Body):
    """The tip's FRFs, and what was tapped; an axis without an FRF is rigid."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "frf": [{"text": "frequency_hz,Y_re,Y_im\n500,2e-8,-1e-9\n501,2e-8,-1e-9\n", "axes": "Y"}],
                    "cutter": {"teeth": 4, "diameter_mm": 12.0},
                }
            ]
        }
    )

    frf: list[TapTest] = Field(min_length=1, max_length=MOST_FRFS)
    units: FrfUnits | None = Field(None, description="As um/N or g/N, whatever the texts say; null: as they say, or m/N.")
    from_hz: Annotated[float, Field(ge=0.0, le=20_000.0)] = Field(
        0.0, description="Lines below are left out: an accelerometer's drift is no receptance."
    )
    cutter: CutterKeys | None = Field(None, description="In place of a tooling: its cutting edges alone.")
    name: Text = Field("tip", description="What the answer calls the cutter.")

    def keys(self) -> dict[str, Any]:
        """Return what a worker reads the tip from."""
        return self.model_dump(include={"frf", "units", "from_hz"})
