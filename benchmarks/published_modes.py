"""The published modes ([inprocess], tables A.4-A.6) with nominal toolings, both signs of the printed phi_r, beside what is said there.

Words: case 2 chatters at the mode near 2400 Hz; the idle FRFs also show one near 2700 Hz. Passivity: the smallest eigenvalue of
the mobility's Hermitian part relative to the mobility, and on how many lines Im C11 is above zero (it feeds energy in).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.signal import find_peaks

from benchmarks.timing import row
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.dynamics.coordinates import Dof, plane
from rcsa_ident.dynamics.modal import ModalModel
from rcsa_ident.dynamics.receptance import dissipation
from rcsa_ident.tool_holder.geometry import BeamSegment, Material, ToolAssembly
from rcsa_ident.tool_holder.model import tool_holder_receptance
from tests.oracles.literature import NOMINAL_MATERIALS, NOMINAL_TOOLINGS, PUBLISHED_JOINT, PUBLISHED_MODES

FREQUENCY = np.arange(600.0, 3500.1, 5.0)


def assembly(number: int) -> ToolAssembly:
    """Return a nominal tooling, tool and holder in one piece."""
    materials = {name: Material(**values) for name, values in NOMINAL_MATERIALS.items()}
    segments = tuple(
        BeamSegment(length * 1e-3, outer * 1e-3, materials[name], inner * 1e-3) for length, outer, inner, name in NOMINAL_TOOLINGS[number]
    )
    return ToolAssembly(segments[:2], segments[2:], 0.0)


def published(axis: Dof, sign: int) -> ModalModel:
    """Return the printed modes of an axis with phi_r times `sign`."""
    f, zeta, tr, ti, rr, ri = PUBLISHED_MODES[axis.upper()].T
    phi = np.stack([tr + 1j * ti, sign * (rr + 1j * ri)], axis=1) * 1e-4
    return ModalModel(2.0 * np.pi * f, zeta / 100.0, phi, np.zeros((2, 2)), plane("flange", axis))


def study() -> list[dict[str, Any]]:
    """Return peaks and passivity for each sign, axis and tooling."""
    omega = 2.0 * np.pi * FREQUENCY
    joint = LumpedJoint(**PUBLISHED_JOINT)
    found = []
    for sign in (1, -1):
        for axis in (Dof.X, Dof.Y):
            flange = published(axis, sign).receptance(omega)
            for number in NOMINAL_TOOLINGS:
                coupled = couple(tool_holder_receptance(assembly(number), omega, axis), flange, joint)
                tip = coupled["tip", "tip"][:, 0, 0]
                peaks, _ = find_peaks(np.abs(tip), prominence=0.1 * np.abs(tip).max())
                found.append(
                    {
                        "sign": sign,
                        "axis": str(axis).upper(),
                        "tooling": number,
                        "peaks_hz": FREQUENCY[peaks].tolist(),
                        "peaks_um_per_n": (np.abs(tip[peaks]) * 1e6).round(3).tolist(),
                        "share_feeding_energy": float(np.mean(tip.imag > 0.0)),
                        "flange_dissipation": float(dissipation(omega, flange.values).min()),
                    }
                )
    return found


def run() -> list[dict[str, Any]]:
    """Print the study and return the distance of tooling 2's strongest Y peak from 2400 Hz."""
    rows = []
    for case in study():
        sign = "as printed" if case["sign"] == 1 else "negated   "
        peaks = ", ".join(f"{f:.0f} Hz ({a:.2f} um/N)" for f, a in zip(case["peaks_hz"], case["peaks_um_per_n"], strict=True))
        share, least = 100.0 * case["share_feeding_energy"], case["flange_dissipation"]
        print(
            f"phi_r {sign} {case['axis']} tooling {case['tooling']}: peaks {peaks}; Im C11 > 0 on {share:.0f} % of the lines, "
            f"smallest dissipation at the flange {least:.2f} of the mobility"
        )
        if case["tooling"] == 2 and case["axis"] == "Y" and case["peaks_hz"]:
            strongest = float(case["peaks_hz"][int(np.argmax(case["peaks_um_per_n"]))])
            rows.append(row(f"strongest peak, tooling 2, Y, phi_r {sign.strip()}", strongest, 2400.0, "Hz", "peer: the source's words"))
    return rows
