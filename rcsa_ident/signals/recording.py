"""A recording: one cut or air cut, every channel in SI."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum

import numpy as np

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.base.plausibility import RATE
from rcsa_ident.base.remarks import Remark, RemarkCode
from rcsa_ident.base.shown import Drawn
from rcsa_ident.dynamics.coordinates import Dof

#: Samples of a block, in which recordings are gone through.
BLOCK = 1 << 18
#: Samples that are analysed together, and beyond which a recording stays in its file: what is kept in memory does not grow with its length.
LONGEST = 1 << 20


class Quantity(StrEnum):
    """The physical quantity that a channel measures.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> ri.Quantity("displacement")
    <Quantity.DISPLACEMENT: 'displacement'>
    >>> [str(each) for each in ri.Quantity]
    ['displacement', 'acceleration', 'trigger', 'force', 'sound']
    """

    DISPLACEMENT = "displacement"
    ACCELERATION = "acceleration"
    TRIGGER = "trigger"
    FORCE = "force"
    SOUND = "sound"


#: SI units that a channel has where its file states none.
SI_UNITS = {
    Quantity.DISPLACEMENT: "m",
    Quantity.ACCELERATION: "m/s²",
    Quantity.FORCE: "N",
    Quantity.SOUND: "of full scale",
}


class SensorCode(RemarkCode):
    """What may be said of a campaign's sensors."""

    DISTANCE_UNTOLD = "distance-untold"
    """Nobody has told how far behind the flange a displacement sensor looks."""


class Role(StrEnum):
    """What an accelerometer is fixed to."""

    SPINDLE = "spindle"
    FIXTURE = "fixture"
    TABLE = "table"
    WORKPIECE = "workpiece"


#: Of a sensor on its mount, above which its response is not told by the resonance's frequency alone.
_LEAST_MOUNT = 0.2
#: Where a displacement sensor may look from the flange's face towards the rear, and how little may be known of that [m].
_NEAREST, _FARTHEST, _WIDEST = -0.1, 0.3, 0.1
#: What a campaign's sensors measure; sound gives no length.
CAMPAIGN_QUANTITIES = tuple(quantity for quantity in Quantity if quantity is not Quantity.SOUND)


@dataclass(frozen=True, slots=True)
class Sensor:
    """A channel and what stands behind it.

    Parameters
    ----------
    name : str
        The channel's name in the recordings.
    quantity : Quantity
    axis : Dof or None
        Machine axis, X or Y, for a force also Z, positive as the axis; None for a trigger and for a microphone.
    sensitivity : float [V/m, V/(m/s^2), V/N]
        Signal per quantity; 1 where the file is in SI.
    delay : float [s]
        The channel lags by it.
    bandwidth : float or None [Hz]
        Cut-off frequency of the sensor's first-order low-pass.
    pulses_per_revolution : int
        Marks that a trigger sees in one turn.
    tooth_angle : float or None [rad]
        Immersion angle of tooth 1 at the trigger's edge, if known.
    role : Role or None
        What an accelerometer is fixed to. Where it is not told: the fixture of the axis' displacement sensor, if it has one, else the
        spindle's housing (see `Recording.accelerometer`).
    mount_resonance : float or None [Hz]
        Of the sensor on its mount, a magnet or wax: below it motion is shown too large, by 1 / (1 - (f / resonance)^2).
    rotation : float [rad]
        Of the direction that it measures from its axis, about the spindle's, from +X towards +Y.
    gain_spread, cross_talk_spread : float [-]
        Standard deviations of the gain's logarithm, and of the share that a displacement sensor feels of the other axis' motion. They
        count where something of the campaign's drawings is not exact, too.
    delay_spread : float [s]
        Standard deviation of the delay; likewise.
    distance : float or None [m]
        How far a displacement sensor looks behind the face between holder and spindle, towards the spindle's rear; negative: at the
        holder. None where nobody has told it.
    distance_spread : float [m]
        Its standard deviation.

    Examples
    --------
    A capacitive gap sensor of 10 mV/um that is 2 % low at 2 kHz:

    >>> sensor = Sensor("gap_x", Quantity.DISPLACEMENT, Dof.X, sensitivity=10e3, bandwidth=10e3)
    >>> round(float(abs(sensor.response(2 * np.pi * 2000.0))), 3)
    0.981
    """

    name: str
    quantity: Quantity
    axis: Dof | None = None
    sensitivity: float = 1.0
    delay: float = 0.0
    bandwidth: float | None = None
    pulses_per_revolution: int = 1
    tooth_angle: float | None = None
    role: Role | None = None
    mount_resonance: float | None = None
    rotation: float = 0.0
    gain_spread: float = 0.02
    cross_talk_spread: float = 0.015
    delay_spread: float = 5e-6
    distance: float | None = None
    distance_spread: float = 1e-3

    def __post_init__(self) -> None:
        # a dynamometer also feels along the spindle
        known = (Dof.X, Dof.Y, Dof.Z) if self.quantity is Quantity.FORCE else (Dof.X, Dof.Y)
        if self.quantity not in (Quantity.TRIGGER, Quantity.SOUND) and self.axis not in known:
            raise InputError(f"sensors.{self.name}.axis", self.axis, "X, Y or Z" if len(known) == 3 else "X or Y")
        if not np.isfinite(self.sensitivity) or self.sensitivity == 0.0:
            raise InputError(f"sensors.{self.name}.sensitivity", self.sensitivity, "a finite number other than 0")
        for name, most in (("gain_spread", 0.5), ("cross_talk_spread", 0.5), ("delay_spread", 1e-3)):
            if not 0.0 <= getattr(self, name) <= most:
                unit = "s" if name == "delay_spread" else "-"
                raise InputError(f"sensors.{self.name}.{name}", getattr(self, name), f"a number from 0 to {most:g} [{unit}]")
        if self.distance is not None:
            if self.quantity is not Quantity.DISPLACEMENT:
                raise InputError(f"sensors.{self.name}.distance", self.distance, f"none of a {self.quantity} sensor")
            if not _NEAREST <= self.distance <= _FARTHEST:
                raise InputError(f"sensors.{self.name}.distance", self.distance, f"a number from {_NEAREST:g} to {_FARTHEST:g} [m]")
        if not 0.0 <= self.distance_spread <= _WIDEST:
            raise InputError(f"sensors.{self.name}.distance_spread", self.distance_spread, f"a number from 0 to {_WIDEST:g} [m]")
        if not abs(self.delay) <= 1.0:
            raise InputError(f"sensors.{self.name}.delay", self.delay, "a number from -1 to 1 [s]")
        if self.bandwidth is not None:
            positive(f"sensors.{self.name}.bandwidth_hz", self.bandwidth, "Hz")
        if self.mount_resonance is not None:
            positive(f"sensors.{self.name}.mount_resonance_hz", self.mount_resonance, "Hz")
        if self.role is not None and self.quantity is not Quantity.ACCELERATION:
            raise InputError(f"sensors.{self.name}.role", str(self.role), f"none: a {self.quantity} sensor has one place")
        if self.rotation != 0.0 and self.quantity not in (Quantity.DISPLACEMENT, Quantity.ACCELERATION):
            raise InputError(f"sensors.{self.name}.rotation_deg", f"{np.degrees(self.rotation):g}", f"none of a {self.quantity} sensor")

    def response(self, omega: FloatArray) -> np.ndarray:
        """Return the sensor's frequency response: delay, first-order bandwidth and its mount's resonance, shape (n,) [-]."""
        value = np.exp(-1j * np.asarray(omega) * self.delay)
        if self.mount_resonance is not None:
            ratio = np.asarray(omega) / (2.0 * np.pi * self.mount_resonance)
            # nobody knows a mount's damping; where it matters, the sensor says nothing
            value = value / np.maximum(1.0 - ratio**2, _LEAST_MOUNT)
        if self.bandwidth is not None:
            value = value / (1.0 + 1j * np.asarray(omega) / (2.0 * np.pi * self.bandwidth))
        return value


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Recording(Drawn):
    """Samples of all channels.

    Parameters
    ----------
    rate : float [Hz]
    samples : array, shape (n, c) [m, m/s^2, N; a trigger as it is]
        A sample that was lost is NaN. Those of a long recording may stand in its file; then slices of them are arrays.
    sensors : tuple of Sensor, length c
    notes : tuple of Remark
        What its reader says of the file: lossy, cut off.
    started : datetime or None
        When the first sample was taken, where the file says it.

    Examples
    --------
    >>> recording = Recording(51200.0, np.zeros((512, 1)), (Sensor("gap_x", Quantity.DISPLACEMENT, Dof.X),))
    >>> sensor, samples = recording.channel(Quantity.DISPLACEMENT, Dof.X)
    >>> sensor.name, samples.shape, recording.time[-1].round(6).item()
    ('gap_x', (512,), 0.00998)
    """

    rate: float
    samples: FloatArray
    sensors: tuple[Sensor, ...]
    notes: tuple[Remark, ...] = ()
    started: datetime | None = None

    def __post_init__(self) -> None:
        RATE.checked("sampling_rate_hz", self.rate)
        if isinstance(self.samples, np.ndarray):
            object.__setattr__(self, "samples", frozen(self.samples))
        if self.samples.ndim != 2 or self.samples.shape[1] != len(self.sensors):
            raise InputError("samples", self.samples.shape, f"(samples, {len(self.sensors)} channels)")

    @property
    def time(self) -> FloatArray:
        """Time from the first sample, shape (n,) [s]."""
        return np.arange(self.samples.shape[0]) / self.rate

    def blocks(self) -> Iterator[tuple[int, FloatArray]]:
        """Yield the samples block by block, shape (b, c), each with the index of its first."""
        for start in range(0, self.samples.shape[0], BLOCK):
            yield start, self.samples[start : start + BLOCK]

    def sensor(self, quantity: Quantity, axis: Dof | None = None) -> Sensor | None:
        """Return the first sensor of this quantity and axis, or None."""
        return first_sensor(self.sensors, quantity, axis)

    def accelerometer(self, axis: Dof, role: Role) -> Sensor | None:
        """Return the first accelerometer of an axis that is fixed to this, or None; `Sensor` says what one without role is fixed to."""
        return next(iter(accelerometers(self.sensors, axis, role)), None)

    def channel(self, quantity: Quantity, axis: Dof | None = None, part: slice = slice(None)) -> tuple[Sensor, FloatArray] | None:
        """Return the first channel of this quantity and axis with its samples, or those of a part, or None.

        Examples
        --------
        >>> import rcsa_ident as ri
        >>> sensors = ri.read_campaign("data/sample_runs").sensors
        >>> cut = ri.read_recording("data/sample_runs/recordings/S1-ER32-00_cut.h5", sensors)
        >>> sensor, gap = cut.channel(ri.Quantity.DISPLACEMENT, ri.Dof.X)
        >>> sensor.name, gap.shape
        ('flange_x', (7168,))
        """
        found = self.sensor(quantity, axis)
        return None if found is None else (found, self.samples[part][:, self.sensors.index(found)])

    def __str__(self) -> str:
        seconds = self.samples.shape[0] / self.rate
        return f"{seconds:.3g} s at {self.rate:.6g} Hz: {', '.join(sensor.name for sensor in self.sensors)}"


def first_sensor(sensors: Sequence[Sensor], quantity: Quantity, axis: Dof | None = None) -> Sensor | None:
    """Return the first sensor of this quantity and axis, or None."""
    return next((s for s in sensors if s.quantity is quantity and (axis is None or s.axis is axis)), None)


def untold_distances(sensors: Sequence[Sensor]) -> tuple[Remark, ...]:
    """Return a remark on displacement sensors of which nobody has told how far behind the flange they look; none where all are told.

    Examples
    --------
    >>> gap = Sensor("gap_x", Quantity.DISPLACEMENT, Dof.X)
    >>> [remark.code.value for remark in untold_distances([gap])]
    ['distance-untold']
    >>> untold_distances([Sensor("gap_x", Quantity.DISPLACEMENT, Dof.X, distance=0.02)])
    ()
    """
    untold = [sensor.name for sensor in sensors if sensor.quantity is Quantity.DISPLACEMENT and sensor.distance is None]
    if not untold:
        return ()
    looks = "looks" if len(untold) == 1 else "look"
    way = "tell distance_behind_flange_mm (a ruler is enough); without it the tip is uncertain by about 1 % per millimetre"
    words = f"nobody has told how far behind the flange {' and '.join(untold)} {looks}: {way}"
    return (Remark(SensorCode.DISTANCE_UNTOLD, words),)


def accelerometers(sensors: Sequence[Sensor], axis: Dof, role: Role) -> tuple[Sensor, ...]:
    """Return the accelerometers of an axis that are fixed to this; `Sensor` says what one without role is fixed to."""
    usual = Role.FIXTURE if first_sensor(sensors, Quantity.DISPLACEMENT, axis) is not None else Role.SPINDLE
    return tuple(s for s in sensors if s.quantity is Quantity.ACCELERATION and s.axis is axis and (s.role or usual) is role)
