"""Cutting force coefficients of a pair of cutter and workpiece material."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from rcsa_ident.errors import InputError
from rcsa_ident.plausibility import AXIAL_RATIO, EDGE, RADIAL_RATIO, TANGENTIAL, Range, remarks_of
from rcsa_ident.remarks import Remark
from rcsa_ident.shown import Shown


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
        for name, kind, value in self._values:
            kind.checked(name, value)
        for name in ("tangential_spread", "ratio_spread", "edge_spread"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise InputError(name, getattr(self, name), "a share from 0 to 1")

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
        return tuple(remarks_of(self._values))

    @property
    def _values(self) -> tuple[tuple[str, Range, float], ...]:
        return (
            ("tangential coefficient", TANGENTIAL, self.tangential),
            ("radial_ratio", RADIAL_RATIO, self.radial_ratio),
            ("axial_ratio", AXIAL_RATIO, self.axial_ratio),
            ("tangential_edge", EDGE, self.tangential_edge),
            ("radial_edge", EDGE, self.radial_edge),
            ("axial_edge", EDGE, self.axial_edge),
        )

    def __str__(self) -> str:
        ratios = {"rc": self.radial_ratio, "ac": self.axial_ratio}
        edges = {"te": self.tangential_edge, "re": self.radial_edge, "ae": self.axial_edge}
        parts = [f"K_tc {1e-6 * self.tangential:.4g} MPa", *(f"k_{name} {value:.3g}" for name, value in ratios.items() if value)]
        return ", ".join([*parts, *(f"K_{name} {1e-3 * value:.3g} N/mm" for name, value in edges.items() if value)])
