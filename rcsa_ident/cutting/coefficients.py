"""Cutting force coefficients of a pair of cutter and workpiece material."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.plausibility import AXIAL_RATIO, EDGE, RADIAL_RATIO, TANGENTIAL, remarks_of
from rcsa_ident.base.remarks import Remark
from rcsa_ident.base.shown import Shown

#: What each field is called in messages, and its range; the others are how well these are known.
_RANGES = {
    "tangential": ("tangential coefficient", TANGENTIAL),
    "radial_ratio": ("radial_ratio", RADIAL_RATIO),
    "axial_ratio": ("axial_ratio", AXIAL_RATIO),
    "tangential_edge": ("tangential_edge", EDGE),
    "radial_edge": ("radial_edge", EDGE),
    "axial_edge": ("axial_edge", EDGE),
}
_SPREADS = ("tangential_spread", "ratio_spread", "edge_spread")


def checked_coefficient(field: str, value: float) -> float:
    """Return the value of a field of `CuttingCoefficients` where it is possible.

    Raises `InputError`: the field is unknown, or the value impossible.
    """
    if field in _RANGES:
        name, kind = _RANGES[field]
        return kind.checked(name, value)
    if field not in _SPREADS:
        raise InputError("coefficients", field, f"one of {', '.join((*_RANGES, *_SPREADS))}")
    if not 0.0 <= value <= 1.0:
        raise InputError(field, value, "a share from 0 to 1")
    return value


@dataclass(frozen=True, slots=True, repr=False)
class CuttingCoefficients(Shown):
    """Linear force model [altintas2012]: F = K_c h b + K_e b for each direction, b the width of cut.

    Parameters
    ----------
    tangential : float [N/m^2]
        K_tc.
    radial_ratio, axial_ratio : float [-]
        k_rc and k_ac, times K_tc.
    tangential_edge, radial_edge, axial_edge : float [N/m]
        K_te, K_re and K_ae, force per width of cut that does not depend on the chip.
    tangential_spread, ratio_spread, edge_spread : float [-]
        Standard deviations of the logarithms of K_tc, of k_rc and of the edge forces: how well they are known. 0 means exactly.

    Examples
    --------
    >>> aluminium = CuttingCoefficients(tangential=902e6, radial_ratio=0.26, tangential_edge=12e3, radial_edge=10e3)
    >>> round(aluminium.tangential * aluminium.radial_ratio / 1e6, 1)  # K_rc [MPa]
    234.5
    """

    tangential: float
    radial_ratio: float
    axial_ratio: float = 0.0
    tangential_edge: float = 0.0
    radial_edge: float = 0.0
    axial_edge: float = 0.0
    tangential_spread: float = 0.05
    ratio_spread: float = 0.05
    edge_spread: float = 0.1

    def __post_init__(self) -> None:
        for name in (*_RANGES, *_SPREADS):
            checked_coefficient(name, getattr(self, name))

    def after(self, tangential: tuple[float, float], ratio: tuple[float, float]) -> CuttingCoefficients:
        """Return the same, as well known as cuts have left them.

        Parameters
        ----------
        tangential, ratio : (float, float) [-]
            What cuts found of the logarithm of K_tc and of k_rc beyond these values, and its standard deviation. Cuts feel K_tc, a
            sensor's gain and a depth as one product: what they found is no better value, and counts as doubt.

        Examples
        --------
        >>> round(CuttingCoefficients(902e6, 0.26).after((0.03, 0.04), (0.0, 0.02)).tangential_spread, 12)
        0.05
        """
        spreads = (min(math.hypot(*found), 1.0) for found in (tangential, ratio))
        return replace(self, **dict(zip(("tangential_spread", "ratio_spread"), spreads, strict=True)))

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """What is unusual about them, as a wrong unit would make it."""
        return tuple(remarks_of((name, kind, getattr(self, field)) for field, (name, kind) in _RANGES.items()))

    def __str__(self) -> str:
        ratios = {"rc": self.radial_ratio, "ac": self.axial_ratio}
        edges = {"te": self.tangential_edge, "re": self.radial_edge, "ae": self.axial_edge}
        parts = [f"K_tc {1e-6 * self.tangential:.4g} MPa", *(f"k_{name} {value:.3g}" for name, value in ratios.items() if value)]
        return ", ".join([*parts, *(f"K_{name} {1e-3 * value:.3g} N/mm" for name, value in edges.items() if value)])
