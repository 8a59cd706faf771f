"""Cutting force coefficients of a pair of cutter and workpiece material."""

from __future__ import annotations

import math
from collections.abc import Mapping
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
#: Chip at which a curved law has the K_tc of its straight line [m]; standard deviations from which on a part of it is told.
REFERENCE_CHIP, _TOLD = 5e-5, 2.0


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


@dataclass(frozen=True, slots=True)
class ForceLaw:
    """What factors on the force in the orders of the teeth say of it, with standard deviations.

    `exponent` [-]: K_tc follows the chip thickness h as (h / `REFERENCE_CHIP`)^exponent
    `tangential_edge`, `radial_edge` [N/m]: what is to be added to K_te and K_re
    `entry` [rad]: by which teeth enter later, for each kind of cut; none where the entry is at 0 or unknown
    `explained` [-]: share of the squares of all factors that these explain
    `feed` [m]: per tooth, of the cuts
    """

    exponent: tuple[float, float]
    tangential_edge: tuple[float, float]
    radial_edge: tuple[float, float]
    entry: Mapping[int, tuple[float, float]]
    explained: float
    feed: float

    def line(self, told: CuttingCoefficients, feed: float | None) -> CuttingCoefficients:
        """Return the straight line that stands for this law at a feed per tooth [m].

        At the feed of the cuts the told line keeps its slope, and K_tc follows other feeds with the exponent, which adds its doubt. Edge
        forces change where no exponent is told: over one feed the two imitate each other. Without a feed, and where nothing lies beyond
        twice its deviation, it is the told line.
        """
        if _beyond(self.exponent):
            further = 0.0 if feed is None else math.log(feed / self.feed)
            spread = min(math.hypot(told.tangential_spread, self.exponent[1] * further), 1.0)
            factor = math.exp(self.exponent[0] * further)
            return replace(told, tangential=told.tangential * factor, tangential_spread=spread)
        more = {"tangential_edge": self.tangential_edge, "radial_edge": self.radial_edge}
        edges = {name: max(getattr(told, name) + value[0], 0.0) for name, value in more.items() if _beyond(value)}
        return replace(told, **edges)

    @property
    def words(self) -> str:
        """In a sentence: what lies beyond twice its deviation; empty where nothing does."""
        told = []
        if _beyond(self.exponent):
            told.append(f"the cutting coefficients follow the chip thickness with the exponent {_with_deviation(self.exponent)}")
        for name, (value, std) in (("K_te", self.tangential_edge), ("K_re", self.radial_edge)):
            if _beyond((value, std)):
                told.append(f"{name} differs by {_with_deviation((1e-3 * value, 1e-3 * std))} N/mm")
        for kind, (value, std) in self.entry.items():
            if _beyond((value, std)):
                of = f" in cuts of kind {kind + 1}" if len(self.entry) > 1 else ""
                told.append(f"teeth enter{of} by {_with_deviation((math.degrees(value), math.degrees(std)))} degrees later")
        if not told:
            return ""
        return f"{'; '.join(told)} (± one standard deviation): this explains {100.0 * self.explained:.0f} % of the differences"


def _beyond(known: tuple[float, float]) -> bool:
    return abs(known[0]) > _TOLD * known[1]


def _with_deviation(known: tuple[float, float]) -> str:
    return f"{known[0]:.2g} ± {known[1]:.1g}"
