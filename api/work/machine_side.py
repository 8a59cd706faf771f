"""The machine's side of the coupling, computed once for an identified machine and kept: a new tooling then costs milliseconds.

What lies behind the holder's flange enters the tip's receptance only as W = B33 + K^-1 (the paper's eq. 12); neither W nor the change of
W along a direction of the posterior knows the tooling.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rcsa_ident.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.coupling._kernels import tip_changes, tips_over
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.dynamics.coordinates import Coordinate, Dof, plane
from rcsa_ident.dynamics.modal import ModalModel
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.identification.posterior import MachineAxis, spread
from rcsa_ident.tool_holder.geometry import ToolAssembly, stiffened
from rcsa_ident.tool_holder.model import tool_holder_poles
from rcsa_ident.workflows.limits import Limits
from rcsa_ident.workflows.lobes import LobeConditions, drawn_limits, tooling_lobes
from rcsa_ident.workflows.tip import TooltipResponse

Places = NDArray[np.intp]
#: Largest change of a tip receptance between two nodes of the drawn machines, as a share; quintics go through six nodes.
CHANGE = 0.065
#: Widest distance of two such nodes, in lines, and how much it grows from line to line.
WIDEST, GROWTH = 16.0, 0.1
#: Of a tool-holder's receptances (translation and slope of the tip, then of the flange): tip, tip over flange, flange over tip, flange.
_ENTRIES = ((0, 0), (0, 2), (0, 3), (2, 0), (3, 0), (2, 2), (2, 3), (3, 2), (3, 3))


@dataclass(frozen=True, slots=True, eq=False)
class AxisSide:
    """One axis behind the flange: W's entries (translation, both, slope) over frequency.

    Parameters
    ----------
    nominal : complex array, shape (3, n)
    ahead, behind : complex array, shape (n, p, 3)
        At both ends of a step along each direction of the posterior; none without one. Asked for at some frequencies, all directions
        of each: so they stand together in memory.
    weight : array, shape (p,)
        One standard deviation over the distance of both ends.
    rivals : complex array, shape (r, 3, n)
        Of the rival models.
    known : bool
        Whether there is a posterior.
    """

    nominal: ComplexArray
    ahead: ComplexArray
    behind: ComplexArray
    weight: FloatArray
    rivals: ComplexArray
    known: bool


def axis_side(part: MachineAxis, axis: Dof, omega: FloatArray, bands: bool) -> AxisSide:
    """Return one axis of a machine that does not change with speed."""
    flange = plane("flange", axis)
    directions = tuple(c.dof for c in flange)

    def interface(modes: ModalModel, joint: LumpedJoint) -> ComplexArray:
        b33 = modes.receptance(omega)["flange", "flange"]
        compliance = joint.compliance_along(omega, directions)
        return np.stack([b33[:, 0, 0] + compliance[:, 0], 0.5 * (b33[:, 0, 1] + b33[:, 1, 0]), b33[:, 1, 1] + compliance[:, 1]])

    nominal = interface(*part.at(axis, None))
    if not bands or part.posterior is None:
        none = np.zeros((omega.size, 0, 3), dtype=complex)
        return AxisSide(nominal, none, none, np.zeros(0), np.zeros((0, 3, omega.size), dtype=complex), False)
    seen: list[ComplexArray] = []

    def record(modes: ModalModel, joint: LumpedJoint) -> ComplexArray:
        # one for the first end of a step and nothing for the other: their difference comes back as the step's weight
        seen.append(interface(modes, joint))
        return np.array([len(seen) % 2], dtype=complex)

    slopes = spread(part.posterior, axis, record)[:, 0].real
    rivals = len(part.posterior.rivals)
    steps = (len(seen) - 1 - rivals) // 2
    ends = np.array(seen[: 2 * steps]).reshape(steps, 2, 3, omega.size)
    last = np.array(seen[2 * steps + 1 :]).reshape(rivals, 3, omega.size)
    ahead, behind = (np.ascontiguousarray(ends[:, k].transpose(2, 0, 1)) for k in (0, 1))
    return AxisSide(nominal, ahead, behind, slopes[:steps], last, True)


@dataclass(frozen=True, slots=True, eq=False)
class MachineSide:
    """A machine behind the flange, at frequencies that every query shares.

    Parameters
    ----------
    omega : array, shape (n,) [rad/s]
    axes : mapping of Dof to AxisSide
    """

    omega: FloatArray
    axes: Mapping[Dof, AxisSide]

    @classmethod
    def of(cls, machine: Mapping[Dof, MachineAxis], omega: FloatArray, bands: bool = True) -> MachineSide:
        """Return the side of a machine that does not change with speed; `bands` keeps its posterior, too."""
        omega = frozen(omega)
        return cls(omega, {axis: axis_side(part, axis, omega, bands) for axis, part in machine.items()})

    def response(self, assembly: ToolAssembly, bands: bool, stiffness_spread: float) -> TooltipResponse:
        """Return the tip's response, as `workflows.tip.tooltip` does."""
        holder = _Holder(assembly, self.omega)
        tips = {axis: holder.tip(side.nominal) for axis, side in self.axes.items()}
        return self._with_spread(tips, holder, assembly, np.arange(self.omega.size), bands, stiffness_spread)

    def limits(self, assembly: ToolAssembly, conditions: LobeConditions, draws: int, stiffness_spread: float, seed: int = 1) -> Limits:
        """Return the limits by the zero-order method, as `workflows.limits.machine_limits` does.

        Notes
        -----
        The limits of drawn machines are told from a part of the frequencies: close where the tip's receptance changes from line to
        line, far apart where a quintic goes through it. The identified machine is asked at all of them.
        """
        holder = _Holder(assembly, self.omega)
        tips = {axis: holder.tip(side.nominal) for axis, side in self.axes.items()}
        found = tooling_lobes(TooltipResponse(_receptances(self.omega, tips)), conditions)
        if draws < 2 or not all(side.known for side in self.axes.values()):
            return Limits(found, conditions.max_depth)
        curves = [*tips.values(), *(each for side in self.axes.values() for each in holder.tip(side.rivals))]
        nodes = nodes_of(curves)
        thinned = {axis: values[nodes] for axis, values in tips.items()}
        response = self._with_spread(thinned, holder.at(nodes), assembly, nodes, True, stiffness_spread)
        return Limits(found, conditions.max_depth, drawn_limits(response, conditions, draws, seed))

    def _with_spread(
        self, tips: Mapping[Dof, ComplexArray], holder: _Holder, assembly: ToolAssembly, nodes: Places, bands: bool, stiffness_spread: float
    ) -> TooltipResponse:
        omega = self.omega[nodes]
        stiffer = _Holder(stiffened(assembly, stiffness_spread), omega) if bands and stiffness_spread > 0.0 else None
        changes = {}
        for axis, side in self.axes.items():
            if bands and side.known:
                rows = [holder.changes(side, nodes), holder.tip(side.rivals, nodes) - tips[axis]]
                if stiffer is not None:
                    rows.append((stiffer.tip(side.nominal, nodes) - tips[axis])[None])
                changes[axis] = np.concatenate(rows)
        return TooltipResponse(_receptances(omega, tips), changes)


class _Holder:
    """The tool-holder's receptances between tip and flange; C11 = A11 - A12 (A22 + W)^-1 A21 with a 2 x 2 inverse in closed form."""

    def __init__(self, assembly: ToolAssembly, omega: FloatArray) -> None:
        free = tool_holder_poles(assembly, float(omega[-1])).entries(omega, _ENTRIES)
        to, back = free[1:3], free[3:5]
        self.tip_tip, self.flange = free[0].copy(), np.stack([free[5], 0.5 * (free[6] + free[7]), free[8]])
        self.carried = np.stack([to[0] * back[0], to[0] * back[1] + to[1] * back[0], to[1] * back[1]])

    def at(self, nodes: Places) -> _Holder:
        """Return the same at some of the frequencies."""
        part = object.__new__(_Holder)
        part.tip_tip, part.flange, part.carried = self.tip_tip[nodes], self.flange[:, nodes], self.carried[:, nodes]
        return part

    def tip(self, behind: ComplexArray, nodes: Places | None = None) -> ComplexArray:
        """Return the tip-tip receptance for W, shape (..., 3, n) -> (..., k), of the nodes alone where this holder stands at these."""
        kept = np.ascontiguousarray(behind if nodes is None else behind[..., nodes])
        found: ComplexArray = tips_over(self.tip_tip, self.flange, self.carried, kept.reshape(-1, *kept.shape[-2:]))
        return found.reshape(*kept.shape[:-2], kept.shape[-1])

    def changes(self, side: AxisSide, nodes: Places) -> ComplexArray:
        """Return the tip-tip receptance's change along each direction of the posterior, shape (p, k)."""
        found: ComplexArray = tip_changes(self.tip_tip, self.flange, self.carried, side.ahead, side.behind, side.weight, nodes)
        return found


def nodes_of(curves: Sequence[ComplexArray]) -> Places:
    """Return places between whose neighbours no curve changes by more than `CHANGE`, first and last among them."""
    step = np.zeros(curves[0].size - 1)
    for curve in curves:
        size = np.abs(curve)
        step = np.maximum(step, np.abs(np.diff(curve)) / np.maximum(np.maximum(size[1:], size[:-1]), 1e-300))
    # lines from node to node; they grow gently, for a quintic's six nodes should stand at like distances
    distance = np.clip(CHANGE / np.maximum(step, 1e-300), 1.0, WIDEST)
    ramp = GROWTH * np.arange(step.size)
    distance = np.minimum.accumulate(distance - ramp) + ramp
    distance = (np.minimum.accumulate((distance + ramp)[::-1])[::-1]) - ramp
    # a share of a node for each line; its sum passes a whole number where a node stands
    count = np.concatenate([[0.0], np.cumsum(1.0 / distance)])
    nodes = np.flatnonzero(np.diff(np.floor(count * (1.0 + 1e-12)), prepend=-1.0) > 0.0)
    return np.unique(np.concatenate([nodes, [count.size - 1]]))


def _receptances(omega: FloatArray, tips: Mapping[Dof, ComplexArray]) -> dict[Dof, Receptance]:
    found = {}
    for axis, values in tips.items():
        tip = (Coordinate("tip", axis),)
        found[axis] = Receptance(omega, values[:, None, None], tip, tip)
    return found
