"""``axial`` of RESULT.json: what gives way behind the flange along the spindle's axis, as an axial tap showed it."""

from __future__ import annotations

from typing import Any

import numpy as np

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import from_hz, to_hz
from rcsa_ident.dynamics.poles import PoleResidue
from rcsa_ident.io.validated_table import Table
from rcsa_ident.machine.axial_flange import AxialFlange

_KEYS = ("tooling", "band_hz", "poles", "constant_m_per_n")


def axial_to_json(flange: AxialFlange) -> dict[str, Any]:
    """Return it as it stands in the file: the receptance is the sum of residue / (i w - pole) and its mirror image over the poles."""
    residue = flange.modes.outputs[0] * flange.modes.inputs[:, 0]
    poles = [
        {"pole_per_s": [p.real, p.imag], "residue_m_per_n_s": [r.real, r.imag]}
        for p, r in zip(flange.modes.pole.tolist(), residue.tolist(), strict=True)
    ]
    band = [to_hz(w) for w in flange.band]
    named = {"tooling": flange.tooling} if flange.tooling else {}
    return named | {"band_hz": band, "poles": poles, "constant_m_per_n": float(flange.modes.constant[0, 0])}


def axial_of(top: Table) -> AxialFlange | None:
    """Return what a result file says, None where it says nothing.

    Raises `InputError`, which names the key, what was found and what is allowed.
    """
    if "axial" not in top:
        return None
    table = top.table("axial", _KEYS)
    low, high = (from_hz(f) for f in table.numbers("band_hz", 2, "Hz", above=0.0))
    if low >= high:
        table.refuse("band_hz", [to_hz(low), to_hz(high)], "a lowest and a highest frequency [Hz]")
    rows = table.tables("poles")
    pole, residue = (
        np.array([complex(*row.numbers(key, 2, unit)) for row in rows])
        for key, unit in (("pole_per_s", "1/s"), ("residue_m_per_n_s", "m/(N s)"))
    )
    constant = np.array([[table.number("constant_m_per_n", "m/N")]])
    try:
        return AxialFlange(PoleResidue(pole, np.ones((1, pole.size)), residue[:, None], constant), (low, high), table.text("tooling", ""))
    except InputError as error:
        raise error.at(top.where) from None
