"""``both_planes`` of RESULT.json: a machine whose X and Y feel each other."""

from __future__ import annotations

from typing import Any

import numpy as np

from rcsa_ident.arrays import FloatArray
from rcsa_ident.identification.coupled.parameters import CoupledLayout, parameter_names, unpack
from rcsa_ident.identification.coupled.posterior import CoupledPosterior, CoupledUnknowns
from rcsa_ident.io.validated_table import Table, describe
from rcsa_ident.units import from_rpm, to_hz, to_rpm

_MOST_MODES, _MOST_DISCS = 200, 10


def both_planes_to_json(posterior: CoupledPosterior) -> dict[str, Any]:
    """Return both planes as they stand in the file: modes with their directions to be read, unknowns and covariance to go on from."""
    best = posterior.best
    standing, machine = best.standing(), unpack(best.theta, best.layout)
    middle, half = posterior.speed_range
    residual = best.modes(middle).residual
    return {
        "layout": _layout_to_json(best.layout),
        "speed_range_rpm": [to_rpm(middle - half), to_rpm(middle + half)],
        "modes": [
            {
                "natural_frequency_hz": float(to_hz(omega)),
                "damping_ratio": float(zeta),
                "direction_deg": float(np.degrees(_direction(phi[[0, 2]]))),
                "phi": [[float(part.real), float(part.imag)] for part in phi],
            }
            for omega, zeta, phi in zip(standing.omega_n, standing.zeta, standing.phi, strict=True)
        ],
        "gyroscopic": machine.skew.tolist(),
        "residual_compliance": residual.tolist(),
        "unknowns": best.theta.tolist(),
        "rivals": [{"layout": _layout_to_json(rival.layout), "unknowns": rival.theta.tolist()} for rival in posterior.rivals],
        "covariance": {"parameters": list(parameter_names(best.layout)), "matrix": posterior.covariance.tolist()},
    }


def both_planes_from_json(table: Table) -> CoupledPosterior:
    """Return both planes of a file.

    Raises
    ------
    InputError
        If unknowns, layout and covariance do not belong together.
    """
    best = _unknowns(table)
    matrix = np.array(table.table("covariance").data["matrix"], dtype=float)
    if matrix.shape != (best.theta.size,) * 2:
        table.refuse("covariance.matrix", f"{len(matrix)} rows", f"a row for each of the {best.theta.size} unknowns")
    low, high = table.numbers("speed_range_rpm", 2, "rev/min")
    if not 0.0 <= low <= high:
        table.refuse("speed_range_rpm", f"{[low, high]}", "lowest and highest speed, 0 <= lowest <= highest [rev/min]")
    speed_range = float(from_rpm(0.5 * (low + high))), float(from_rpm(0.5 * (high - low)))
    return CoupledPosterior(best, matrix, speed_range, tuple(_unknowns(rival) for rival in table.tables("rivals")))


def _direction(shape: np.ndarray) -> float:
    """Angle from +X of the line along which a mode moves the flange, above -90 and up to 90 degrees [rad]."""
    # the phase that makes the shape as real as it can be
    turned: FloatArray = (shape * np.exp(-0.5j * np.angle(np.sum(shape**2)))).real
    angle = float(np.arctan2(turned[1], turned[0]))
    return angle - np.pi * np.ceil(angle / np.pi - 0.5)


def _layout_to_json(layout: CoupledLayout) -> dict[str, Any]:
    return {"modes": layout.modes, "softening": layout.softening, "discs": layout.skew, "turning": layout.turning}


def _unknowns(table: Table) -> CoupledUnknowns:
    own = table.table("layout")
    softening = own.value("softening", "true or false", False)
    if not isinstance(softening, bool):
        own.refuse("softening", describe(softening), "true or false")
    layout = CoupledLayout(
        own.number("modes", least=1, most=_MOST_MODES, whole=True),
        softening=softening,
        skew=own.number("discs", least=0, most=_MOST_DISCS, whole=True),
        turning=own.number("turning", least=-1, most=1, whole=True),
    )
    unknowns = np.array(table.numbers("unknowns", None))
    if unknowns.size != layout.size:
        table.refuse("unknowns", f"{unknowns.size} numbers", f"{layout.size}, as {layout.modes} modes and the joint have")
    return CoupledUnknowns(unknowns, layout)
