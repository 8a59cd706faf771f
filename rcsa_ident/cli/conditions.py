"""What the options of `lobes` mean: cutting conditions, and a tip that does not come from a result."""

from __future__ import annotations

import math
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rcsa_ident.errors import InputError

if TYPE_CHECKING:
    from rcsa_ident.cutting.coefficients import CuttingCoefficients
    from rcsa_ident.cutting.conditions import Engagement
    from rcsa_ident.dynamics.coordinates import Dof
    from rcsa_ident.dynamics.receptance import Receptance


class Strategy(StrEnum):
    """Which way the teeth enter."""

    up = "up"
    down = "down"


def coefficients(ktc_mpa: float | None, krc: float | None, result: tuple[dict[str, Any], str] | None) -> CuttingCoefficients:
    """Return the cutting coefficients asked for, those of the result where nothing is said."""
    from dataclasses import replace

    from rcsa_ident.cutting.coefficients import CuttingCoefficients
    from rcsa_ident.errors import positive
    from rcsa_ident.io.identifications import workpiece_from_json

    given = {} if ktc_mpa is None else {"tangential": positive("--ktc-mpa", ktc_mpa, "MPa") * 1e6}
    given |= {} if krc is None else {"radial_ratio": krc}
    if result is not None:
        return replace(workpiece_from_json(*result).coefficients, **given)
    if len(given) < 2:
        missing = "--ktc-mpa" if ktc_mpa is None else "--krc"
        raise InputError(missing, "nothing", "--ktc-mpa [MPa] and --krc [-]: without a result no workpiece is known")
    return CuttingCoefficients(**given)


def engagement(immersion: float, strategy: Strategy, entry_deg: float | None, exit_deg: float | None) -> Engagement:
    """Return the engagement from both angles, or from immersion and strategy."""
    from rcsa_ident.cutting.conditions import Engagement

    if (entry_deg is None) != (exit_deg is None):
        raise InputError("--entry-deg and --exit-deg", "one of them", "both, or neither")
    if entry_deg is None or exit_deg is None:
        return Engagement.from_immersion(immersion, str(strategy))
    return Engagement(math.radians(entry_deg), math.radians(exit_deg))


def feed_angle(text: str) -> float:
    """Return the feed direction [rad] of +X, -X, +Y, -Y or degrees."""
    from rcsa_ident.io.setups import FEED_DIRECTIONS

    if text.upper() in FEED_DIRECTIONS:
        return FEED_DIRECTIONS[text.upper()]
    try:
        degrees = float(text)
    except ValueError:
        degrees = math.nan
    if not abs(degrees) <= 360.0:
        raise InputError("--feed-direction", text, f"one of {', '.join(FEED_DIRECTIONS)}, or an angle from -360 to 360 [deg]")
    return math.radians(degrees)


def tip_of(modes: Path | None, frf: list[str]) -> Receptance:
    """Return the tip's receptance from a modal model or from tap tests."""
    from rcsa_ident.io.modes import read_modes
    from rcsa_ident.workflows.lobes import measured_tip, modal_tip

    return modal_tip(read_modes(modes)) if modes is not None else measured_tip(_tap_tests(frf))


def _tap_tests(texts: list[str]) -> dict[Dof, Any]:
    from rcsa_ident.dynamics.coordinates import Dof
    from rcsa_ident.io.curves import read_frf_csv

    found: dict[Dof, Any] = {}
    for text in texts:
        axis, sign, name = text.partition("=")
        path = Path(name if sign and axis.upper() in ("X", "Y") else text)
        if path.suffix.lower() != ".csv":
            raise InputError(
                "--frf",
                f"suffix '{path.suffix}'",
                "an FRF.csv (frequency_hz, X_re, X_im, Y_re, Y_im); other formats are not read yet",
                str(path),
            )
        curves = read_frf_csv(path)
        wanted = [axis.upper()] if path.name != text and str(path) != text else list(curves.values)
        for each in wanted:
            if each not in curves.values:
                raise InputError(f"column {each}_re", "nothing", f"an FRF of axis {each}", str(path))
            if Dof(each.lower()) in found:
                raise InputError("--frf", f"axis {each} twice", "each axis once", str(path))
            found[Dof(each.lower())] = (curves.frequency, curves.values[each])
    return found
