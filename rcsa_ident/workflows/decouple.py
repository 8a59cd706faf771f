"""A machine's flange from hammer tests: across the axis with several known toolings, along it with one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.remarks import Remark
from rcsa_ident.coupling.flange_fit import LEAST_DAMPING, DecoupledFlange, Observation, least_squares_flange
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.machine.axial_flange import AxialFlange
from rcsa_ident.machine.responses import in_plane
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.tool_holder.geometry import ToolAssembly
from rcsa_ident.tool_holder.model import tool_holder_receptance
from rcsa_ident.tool_holder.rods import rod_poles
from rcsa_ident.workflows.compare import Place
from rcsa_ident.workflows.contact import neighbour_noise

#: Share of a measured receptance that its calibration and the tool-holder's model may be off.
MODEL_SHARE = 0.01
_ENDS = {Place.TIP: ("tip", "tip"), Place.CROSS: ("spindle", "tip"), Place.SPINDLE: ("spindle", "spindle")}


@dataclass(frozen=True, slots=True, eq=False)
class FlangeTap:
    """A hammer test of one tooling clamped in the machine.

    `place`: all but the bare flange
    `omega` [rad/s], shape (n,); `values` [m/N], shape (n,)
    `remarks`: what the file does not state and was assumed
    """

    name: str
    assembly: ToolAssembly
    place: Place
    omega: FloatArray
    values: ComplexArray
    remarks: tuple[Remark, ...] = ()


def flange_from_taps(
    taps: Sequence[FlangeTap],
    axis: Dof,
    joint: LumpedJoint | None = None,
    least_damping: float | None = LEAST_DAMPING,
    model_share: float = MODEL_SHARE,
) -> DecoupledFlange:
    """Return the flange that explains all tests of one axis.

    `taps`: at the same frequencies; those with one tooling may be of several places
    `joint`: between holder and spindle; None leaves it in the flange
    `least_damping`: as in `coupling.flange_fit.least_squares_flange`
    `model_share` [-]: standard deviation of what the noise between neighbouring frequencies does not show, as a share of each receptance
    """
    if not taps:
        raise InputError("taps", "none", "hammer tests with at least three toolings")
    omega = np.asarray(taps[0].omega, dtype=float)
    planes: dict[int, Receptance] = {}
    observations = []
    for tap in taps:
        if tap.place is Place.FLANGE:
            raise InputError("hammer test", "of the bare flange", "with a tooling clamped: nothing is left to decouple", tap.name)
        if tap.omega.shape != omega.shape or not np.allclose(tap.omega, omega, rtol=1e-9):
            raise InputError("frequencies", f"{tap.omega.size} of them", f"the {omega.size} frequencies of {taps[0].name}", tap.name)
        key = id(tap.assembly)
        if key not in planes:
            planes[key] = tool_holder_receptance(tap.assembly, omega)
        holder = in_plane(planes[key], axis)
        std = np.hypot(neighbour_noise(tap.values), model_share * np.abs(tap.values))
        observations.append(Observation(holder, *_ENDS[tap.place], tap.values, std))
    found = least_squares_flange(observations, joint, least_damping)
    return replace(found, notes=(*found.notes, *dict.fromkeys(remark for tap in taps for remark in tap.remarks)))


def axial_flange_from_tap(tooling: Tooling, omega: FloatArray, values: ComplexArray, model_share: float = MODEL_SHARE) -> AxialFlange:
    """Return what stands behind the flange along the axis, from one hammer test along it: W = A21 (A11 - C11)^-1 A12 - A22.

    `tooling`: that was clamped; as rods it is as its drawing says
    `omega` [rad/s], shape (n,): rising, above 0
    `values` [m/N], shape (n,): at the tip, along the axis
    `model_share` [-]: as in `flange_from_taps`
    """
    free = rod_poles(tooling.assembly, float(omega[-1])).receptance(omega).values
    between = free[:, 0, 1] * free[:, 1, 0]
    left = free[:, 0, 0] - values
    std = np.hypot(neighbour_noise(values), model_share * np.abs(values))
    return AxialFlange.fitted(omega, between / left - free[:, 1, 1], std * np.abs(between / left**2), tooling.name)
