"""Cutting force coefficients of a pair of cutter and workpiece material."""

from __future__ import annotations

from dataclasses import dataclass

from rcsa_ident.errors import InputError, non_negative, positive
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
        positive("tangential coefficient", self.tangential, "N/m^2")
        for name in ("radial_ratio", "axial_ratio"):
            if not -1.0 <= getattr(self, name) <= 5.0:
                raise InputError(name, getattr(self, name), "a ratio from -1 to 5")
        for name in ("tangential_edge", "radial_edge", "axial_edge"):
            non_negative(name, getattr(self, name), "N/m")
        for name in ("tangential_spread", "ratio_spread", "edge_spread"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise InputError(name, getattr(self, name), "a share from 0 to 1")

    def __str__(self) -> str:
        ratios = {"rc": self.radial_ratio, "ac": self.axial_ratio}
        edges = {"te": self.tangential_edge, "re": self.radial_edge, "ae": self.axial_edge}
        parts = [f"K_tc {1e-6 * self.tangential:.4g} MPa", *(f"k_{name} {value:.3g}" for name, value in ratios.items() if value)]
        return ", ".join([*parts, *(f"K_{name} {1e-3 * value:.3g} N/mm" for name, value in edges.items() if value)])
