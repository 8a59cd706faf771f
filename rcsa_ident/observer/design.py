"""An observer from transfer functions, force models and sensors: axis by axis, or one for axes that feel each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.poles import PoleResidue
from rcsa_ident.observer.coupled_transfer import CoupledTransfer
from rcsa_ident.observer.force import AxisSensors, ForceObserver, RunOut
from rcsa_ident.observer.force_model import AxisNoise, ForceModel, augmented
from rcsa_ident.observer.kalman import kalman_filter
from rcsa_ident.observer.transfer_function import CORNER, SampledModes, TransferFunction, acceleration_filter, high_pass

#: What a spindle order below the band may change in a second, in displacement [m]: run-out that is not believed.
_ORDER_WANDER = 1e-7


@dataclass(frozen=True, slots=True, eq=False)
class AxisSettings:
    """What an observer has to know of one axis beside its transfer function.

    `force`: `RandomWalk` or `TeethResonators`
    `noise` [m]: standard deviation of a displacement sample
    `acceleration_noise` [m/s^2]: standard deviation of an acceleration sample; 0: as if the integrated acceleration were without noise, as
        in [inprocess]
    `accelerometer`: whether the fixture's acceleration is measured
    `sensor_ratio`: (omega, ratio); response of the displacement sensor over the accelerometer's
    `run_out`: taken out of the signals
    `spindle_speed` [rad/s]: orders of this speed below the band are taken for disturbance; with 0 there are none
    """

    axis: Dof
    force: ForceModel
    noise: float
    acceleration_noise: float = 0.0
    accelerometer: bool = True
    sensor_ratio: tuple[FloatArray, ComplexArray] | None = None
    run_out: RunOut | None = None
    spindle_speed: float = 0.0

    def acceleration_filter(self, step: float, band: tuple[float, float]) -> SampledModes | None:
        """Return the filter from the fixture's acceleration to its high-passed displacement, where there is an accelerometer."""
        if not self.accelerometer:
            return None
        omega, ratio = (None, None) if self.sensor_ratio is None else self.sensor_ratio
        return acceleration_filter(CORNER * band[0], step, band, ratio, omega)

    def disturbance(self, band: tuple[float, float]) -> FloatArray:
        """Return the spindle's orders between the high-pass's corner and the band [rad/s]: those below the corner are gone already."""
        speed = self.spindle_speed
        below = speed * np.arange(1.0, np.ceil(band[0] / speed - 1e-9)) if speed > 0.0 else np.zeros(0)
        return below[below > CORNER * band[0]]


def axis_observer(settings: AxisSettings, transfer: TransferFunction) -> ForceObserver:
    """Return the observer of one axis."""
    plant = transfer.behind_high_pass(CORNER * transfer.band[0]).pole_residue()
    return _observer([settings], [transfer], plant)


def coupled_observer(settings: Sequence[AxisSettings], transfer: CoupledTransfer) -> ForceObserver:
    """Return the observer of axes that feel each other: one filter, whose states they share.

    `settings`: in the order of the transfer function's rows and columns
    """
    direct = [transfer.direct(i) for i in range(len(settings))]
    return _observer(settings, direct, transfer.behind_high_pass(CORNER * transfer.band[0]))


def _observer(settings: Sequence[AxisSettings], transfers: Sequence[TransferFunction], plant: PoleResidue) -> ForceObserver:
    """The observer of a plant from forces to high-passed displacements; `transfers` are its direct entries."""
    step, band = transfers[0].step, transfers[0].band
    corner = CORNER * band[0]
    axes, noises = [], []
    for each, transfer in zip(settings, transfers, strict=True):
        passing = each.acceleration_filter(step, band)
        axes.append(AxisSensors(each.axis, transfer, corner, high_pass(corner, step), passing, each.run_out))
        noises.append(AxisNoise(each.force, each.noise, passing, each.acceleration_noise, each.disturbance(band), _ORDER_WANDER))
    return ForceObserver(tuple(axes), (kalman_filter(augmented(plant, noises, step)),))
