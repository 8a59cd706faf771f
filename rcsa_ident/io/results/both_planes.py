"""``both_planes`` of RESULT.json: a machine whose X and Y feel each other."""

from __future__ import annotations

from typing import Any

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.units import from_rpm, to_hz, to_rpm
from rcsa_ident.dynamics.modal import directions
from rcsa_ident.identification.coupled.posterior import CoupledPosterior, CoupledUnknowns
from rcsa_ident.identification.unknowns import DIRECTIONS, CoupledLayout, parameter_names, unpack
from rcsa_ident.io.results.parts import check_covariance, matrix_of
from rcsa_ident.io.validated_table import Table, as_number, describe

_MOST_MODES, _MOST_DISCS = 200, 10
_SHAPE = "four pairs of finite numbers: translation and slope in X, then in Y"


def both_planes_to_json(posterior: CoupledPosterior, deviation: tuple[FloatArray, FloatArray] | None = None) -> dict[str, Any]:
    """Return both planes as they stand in the file: modes with their directions to be read, unknowns and covariance to go on from.

    `deviation`: (array, array); standard deviations of the natural frequencies [rad/s] and damping ratios of the machine that does not turn
    """
    best = posterior.best
    standing, machine = best.standing(), unpack(best.theta, best.layout.block)
    middle, half = posterior.speed_range
    residual = best.modes(middle).residual
    modes: list[dict[str, Any]] = [
        {
            "natural_frequency_hz": float(to_hz(omega)),
            "damping_ratio": float(zeta),
            "direction_deg": float(np.degrees(direction)),
            "phi": [[float(part.real), float(part.imag)] for part in phi],
        }
        for omega, zeta, direction, phi in zip(standing.omega_n, standing.zeta, directions(standing), standing.phi, strict=True)
    ]
    if deviation is not None:
        for mode, omega_n, zeta in zip(modes, *(d.tolist() for d in deviation), strict=True):
            mode |= {"natural_frequency_std_hz": to_hz(omega_n), "damping_ratio_std": zeta}
    return {
        "layout": _layout_to_json(best.layout),
        "speed_range_rpm": [to_rpm(middle - half), to_rpm(middle + half)],
        "modes": modes,
        "gyroscopic": machine.skew.tolist(),
        "residual_compliance": residual.tolist(),
        "unknowns": best.theta.tolist(),
        "rivals": [{"layout": _layout_to_json(rival.layout), "unknowns": rival.theta.tolist()} for rival in posterior.rivals],
        "covariance": {"parameters": list(parameter_names(best.layout.block)), "matrix": posterior.covariance.tolist()},
    }


def both_planes_from_json(table: Table) -> CoupledPosterior:
    """Return both planes of a file. Raises `InputError` if unknowns, layout and covariance do not belong together."""
    best = _unknowns(table)
    for mode in table.tables("modes"):
        mode.number("natural_frequency_hz", "Hz", above=0.0)
        mode.number("damping_ratio", above=0.0, most=1.0)
        mode.number("direction_deg", "deg")
        phi = mode.value("phi", _SHAPE)
        if not isinstance(phi, list) or len(phi) != DIRECTIONS or not all(_complex(part) for part in phi):
            mode.refuse("phi", describe(phi), _SHAPE)
    if "in_words" in table:
        table.text("in_words")
    covariance = table.table("covariance")
    matrix = matrix_of(covariance, "matrix", best.theta.size)
    check_covariance(covariance, matrix)
    low, high = table.numbers("speed_range_rpm", 2, "rev/min")
    if not 0.0 <= low <= high:
        table.refuse("speed_range_rpm", f"{[low, high]}", "lowest and highest speed, 0 <= lowest <= highest [rev/min]")
    speed_range = float(from_rpm(0.5 * (low + high))), float(from_rpm(0.5 * (high - low)))
    rivals = [] if table.data.get("rivals") == [] else table.tables("rivals")
    return CoupledPosterior(best, matrix, speed_range, tuple(_unknowns(rival) for rival in rivals))


def _complex(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(as_number(part) is not None for part in value)


def _layout_to_json(layout: CoupledLayout) -> dict[str, Any]:
    return {"modes": layout.modes, "softening": layout.softening, "discs": layout.skew, "turning": layout.turning}


def _unknowns(table: Table) -> CoupledUnknowns:
    own = table.table("layout")
    layout = CoupledLayout(
        own.number("modes", least=1, most=_MOST_MODES, whole=True),
        softening=own.flag("softening", False),
        skew=own.number("discs", least=0, most=_MOST_DISCS, whole=True),
        turning=own.number("turning", least=-1, most=1, whole=True),
    )
    unknowns = np.array(table.numbers("unknowns", None))
    if unknowns.size != layout.size:
        table.refuse("unknowns", f"{unknowns.size} numbers", f"{layout.size}, as {layout.modes} modes and the joint have")
    if layout.skew and not layout.turning:
        own.refuse("turning", "0 with discs", "1 or -1: gyroscopic moments have a sense")
    return CoupledUnknowns(unknowns, layout)
