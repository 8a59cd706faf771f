"""Tables of what a tool does along a path, with its places in millimetres."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from rcsa_ident.arrays import FloatArray
from rcsa_ident.io.files import write_text

PLACE = ("x_mm", "y_mm", "z_mm")


def place_columns(places: FloatArray) -> dict[str, FloatArray]:
    """Return the columns of places, shape (k, 3) [m]; metres and back leave a last digit that nobody asked for."""
    return dict(zip(PLACE, (1e3 * places).round(9).T, strict=True))


def write_columns(path: str | Path, columns: Mapping[str, FloatArray]) -> None:
    """Write columns of one length, six digits of each number; what is not finite is an empty cell."""
    write_text(path, "\n".join([",".join(columns), *_rows(columns.values())]) + "\n")


def _rows(columns: Iterable[FloatArray]) -> Iterable[str]:
    for row in zip(*(np.asarray(values).tolist() for values in columns), strict=True):
        yield ",".join(str(v) if isinstance(v, int) else f"{v:.9g}" if np.isfinite(v) else "" for v in row)
