"""From a campaign at several postures to a robot's springs and dampers and the spindle in its hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.remarks import Remark
from rcsa_ident.base.scaleout import Map
from rcsa_ident.cutting.force import axial_and_slope
from rcsa_ident.dynamics.modal import PoleModel
from rcsa_ident.identification.arm.data import PosedData, check_postures, posed_data
from rcsa_ident.identification.arm.fit import fit_robot
from rcsa_ident.identification.arm.result import RobotCode, RobotIdentification, answer
from rcsa_ident.identification.arm.unknowns import arm_priors
from rcsa_ident.identification.data import IdentificationData
from rcsa_ident.identification.model_order import Report
from rcsa_ident.machine.robot.flexible import FlexibleRobot
from rcsa_ident.setup.campaign import Campaign
from rcsa_ident.setup.cut import Cut
from rcsa_ident.signals.measurement import Reading
from rcsa_ident.tool_holder.rods import rod_poles
from rcsa_ident.tool_holder.spread import EXACT
from rcsa_ident.workflows.identify import data_of


def identify_robot(
    campaign: Campaign, readings: Sequence[Reading], robot: FlexibleRobot, seed: int = 1, map: Map = map, report: Report | None = None
) -> RobotIdentification:
    """Return a robot as its cuts tell it.

    `campaign`: each cut with the posture that it was made at
    `readings`: as `identify.judge` returns them
    `robot`: lengths and masses, taken as exact, the whole spindle among the payload; springs and dampers as a first belief
    `seed`: same seed, same answer
    `map`: the builtin, or a pool's
    `report`: callable of (stage, cost, solution)
    Raises `InputError` if a cut tells no posture, if no cut is usable, or if none is slow enough to tell the arm.
    """
    data, postures = robot_data(campaign, readings, robot)
    priors = arm_priors(robot.model, robot.tilts)
    found, misfit, rival = fit_robot(data, priors, seed, map, _unheard if report is None else report)
    result = answer(robot.model, robot.tilts, found, misfit, rival, seed, postures)
    if not campaign.rough:
        return result
    words = "toolings were taken as drawn, whatever their [spread] says: of cuts on a robot nothing of them is learned"
    return replace(result, notes=(*result.notes, Remark(RobotCode.DRAWINGS_EXACT, words)))


def robot_data(campaign: Campaign, readings: Sequence[Reading], robot: FlexibleRobot) -> tuple[PosedData, FloatArray]:
    """Return what a robot is fitted to, and the postures of its cuts, shape (c, j) [rad]; parameters as of `identify_robot`."""
    if not robot.model.weighed:
        raise InputError("link masses", "nothing", "mass, centre and inertia of the links: without them nothing vibrates")
    if campaign.rough:
        campaign = replace(campaign, toolings={name: replace(tooling, spread=EXACT) for name, tooling in campaign.toolings.items()})
    _check_sensors(campaign)
    data = data_of(campaign, readings, robot=True).learned_from()
    beside = _Beside(campaign, data)
    postures, of_cut = check_postures([beside.cuts[id].posture for id in data.cut_ids], data.cut_ids, robot.model)
    teeth = {name: tooling.cutter.teeth for name, tooling in campaign.toolings.items()}
    return posed_data(data, robot, postures, of_cut, teeth, beside.rods, beside.axial), postures


def _check_sensors(campaign: Campaign) -> None:
    """Refuse displacement sensors that look elsewhere than at the flange itself."""
    for sensor in campaign.sensors:
        if sensor.distance:
            allowed = "0, or nothing: of a robot the flange sensors are taken to look at the flange itself"
            raise InputError(f"sensors.{sensor.name}.distance_behind_flange_mm", f"{1e3 * sensor.distance:g}", allowed)


@dataclass(frozen=True, eq=False)
class _Beside:
    """What cuts in two bending planes leave aside: tool-holders along and about their axis, and the force along it."""

    campaign: Campaign
    data: IdentificationData

    @cached_property
    def cuts(self) -> dict[str, Cut]:
        """By their names."""
        return {cut.id: cut for cut in self.campaign.cuts}

    @cached_property
    def _poles(self) -> dict[str, tuple[PoleModel, PoleModel]]:
        highest = max(float(axis.omega.max()) for axis in self.data.axes)
        assemblies = {name: self.campaign.toolings[name].assembly for name in self.data.toolings}
        return {name: (rod_poles(each, highest), rod_poles(each, highest, twisting=True)) for name, each in assemblies.items()}

    def rods(self, cut: int, omega: FloatArray) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """Of `arm.data.Rods`."""
        along, about = (each.receptance(omega).values for each in self._poles[self.data.toolings[self.data.cut_tooling[cut]]])
        return along[:, 1, 1], about[:, 1, 1], along[:, 1, 0]

    def axial(self, cut: int, orders: np.ndarray) -> tuple[ComplexArray, ComplexArray]:
        """Of `arm.data.Axial`."""
        made = self.cuts[self.data.cut_ids[cut]]
        cutter = self.campaign.toolings[made.tooling].cutter
        force, slope = axial_and_slope(cutter, made.conditions, self.campaign.coefficients, orders)
        # of all terms, those that the data have as unknowns; run-out moves the axial force as little as its lines are used for
        columns = np.zeros((orders.size, len(self.data.coefficients)), dtype=complex)
        for k, coefficient in enumerate(self.data.coefficients):
            if not coefficient.tooling:
                columns[:, k] = slope[coefficient.term]
        return force, columns


def _unheard(*step: object) -> None:
    """Nobody asked to be told."""
