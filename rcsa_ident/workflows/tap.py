"""Hammer hits as they were recorded to a receptance: which channel is the hammer, and what its response measures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.base.plausibility import RATE, SENSOR_MASS
from rcsa_ident.base.remarks import Remark
from rcsa_ident.base.units import to_hz
from rcsa_ident.dynamics.passivity import Correction, judged
from rcsa_ident.signals.recording import SI_UNITS, Quantity
from rcsa_ident.signals.tap import HitEstimator, TapFrf, tap
from rcsa_ident.signals.told_units import force_unit, is_untold, motion_unit, volts_in
from rcsa_ident.signals.verdict import RecordCode, assumed

#: How many times as long as the hammer's pulses the other channels go on.
_LONGER = 3.0
#: Relative difference of rates that are one: those of time stamps are not told to the last digit.
_SAME_RATE = 1e-4
#: How often a response is differentiated, by the words of commands and queries, and by what a channel's unit says.
DERIVATIVES = {"displacement": 0, "velocity": 1, "acceleration": 2}
_UNITS = ("m", "m/s", "m/s²")


class Channel(Protocol):
    """A channel as a file tells it."""

    @property
    def name(self) -> str: ...
    @property
    def unit(self) -> str: ...
    @property
    def quantity(self) -> Quantity | None: ...
    @property
    def samples(self) -> FloatArray: ...


class Opened(Protocol):
    """A recording as a file tells it: rate [Hz], channels, and what was assumed."""

    @property
    def rate(self) -> float: ...
    @property
    def channels(self) -> Sequence[Channel]: ...
    @property
    def remarks(self) -> Sequence[Remark]: ...


def tap_recordings(
    recordings: Sequence[Opened],
    force: str | None = None,
    response: str | None = None,
    quantity: str = "acceleration",
    estimator: HitEstimator = HitEstimator.H1,
    sensor_mass: float = 0.0,
    axis: str = "X",
    force_sensitivity: float | None = None,
    response_sensitivity: float | None = None,
    reverse: bool = False,
) -> TapFrf:
    """Return the receptance that recordings of hits give together; its remarks say what was assumed.

    `recordings`: each with one hit or several
    `force`, `response`: names of channels; else the one that is a force, or comes in pulses, and the only other one
    `quantity`: what the response measures where its unit does not say: acceleration, velocity or displacement
    `estimator`, `sensor_mass`: as of `rcsa_ident.signals.tap.tap`
    `axis`: machine axis of hammer and response, X or Y
    `force_sensitivity`, `response_sensitivity`: signal per newton and per SI unit of the response, of channels in volts or in a unit that
        is not known
    `reverse`: the sensor or the hammer is reversed: the receptance is turned
    Raises `InputError`: a channel is not told, the recordings have several rates, or no hit can be used.
    """
    SENSOR_MASS.checked("sensor_mass", sensor_mass)
    if quantity not in DERIVATIVES:
        raise InputError("quantity", quantity, ", ".join(DERIVATIVES))
    derivative, pairs, said = DERIVATIVES[quantity], [], list[Remark]()
    for recording in recordings:
        hammer, moved, remarks = _pair(recording, force, response)
        newton, taken = _in_si(hammer, "force", force_sensitivity, f"force [{SI_UNITS[Quantity.FORCE]}]")
        motion, assumed_ = _in_si(moved, "response", response_sensitivity, f"{quantity} [{_UNITS[DERIVATIVES[quantity]]}]")
        pairs.append((newton, motion))
        told = motion_unit(moved.unit)
        derivative = DERIVATIVES[quantity] if told is None else told[1]
        said += [remark for remark in (*recording.remarks, *remarks, *taken, *assumed_) if remark not in said]
    rates = sorted(recording.rate for recording in recordings)
    if not rates or rates[-1] > (1.0 + _SAME_RATE) * rates[0]:
        raise InputError("sampling_rate_hz", ", ".join(f"{rate:g}" for rate in rates) or "no recording", "one rate for all recordings [Hz]")
    said += [each for each in (RATE.remark("sampling_rate_hz", RATE.checked("sampling_rate_hz", rates[0])),) if each is not None]
    found = tap(rates[0], pairs, derivative, estimator, sensor_mass)
    # where hammer and sensor were at two points, nobody knows the sign: it is turned where that was asked
    turn = Correction.REVERSE if reverse else Correction.NONE
    values, judgement = judged(to_hz(found.omega), found.receptance, turn)
    return replace(found, receptance=values, axis=axis, remarks=(*said, *judgement))


def _pair(recording: Opened, force: str | None, response: str | None) -> tuple[Channel, Channel, list[Remark]]:
    """The hammer's channel, the response's, and what was assumed."""
    channels, said = recording.channels, list[Remark]()
    forces = [i for i, each in enumerate(channels) if each.quantity is Quantity.FORCE]
    if force is not None:
        hammer = _named("force", force, channels)
    elif len(forces) == 1:
        hammer = forces[0]
    else:
        hammer = hammer_channel([each.samples for each in channels])
        said.append(Remark(RecordCode.ASSUMED, f"{channels[hammer].name}, which comes in pulses, was taken as the hammer's force"))
    others = [i for i in range(len(channels)) if i != hammer]
    if response is None and len(others) != 1:
        raise InputError("response", ", ".join(channels[i].name for i in others) or "none", "the name of one channel")
    return channels[hammer], channels[others[0] if response is None else _named("response", response, channels)], said


def _in_si(channel: Channel, kind: str, sensitivity: float | None, meant: str) -> tuple[FloatArray, list[Remark]]:
    """A channel's samples in SI, and what was assumed; a unit that says nothing of the force or the motion asks for the sensitivity."""
    known = force_unit(channel.unit) if kind == "force" else motion_unit(channel.unit)
    field = f"{kind}_sensitivity"
    if known is not None:
        if sensitivity is not None:
            raise InputError(field, f"{sensitivity:g}", f"none: channel {channel.name} has the unit {channel.unit}")
        return channel.samples, []
    if sensitivity is not None:
        return channel.samples / positive(field, sensitivity, "signal per SI unit"), []
    if is_untold(channel.unit):
        return channel.samples, [assumed(channel.name, "", meant)]
    signal = "V" if volts_in(channel.unit) is not None else channel.unit
    allowed = f"a unit of the {kind}, or {field} [{signal} per SI unit] told"
    raise InputError(f"unit of channel {channel.name}", channel.unit, allowed)


def _named(field: str, name: str, channels: Sequence[Channel]) -> int:
    places = [i for i, each in enumerate(channels) if each.name == name]
    if len(places) != 1:
        found = "two of that name" if places else "no such channel"
        raise InputError(field, f"{name}: {found}", f"one channel of the file: {', '.join(each.name for each in channels)}")
    return places[0]


def hammer_channel(channels: Sequence[FloatArray]) -> int:
    """Return which channel is the hammer's: a force comes in pulses, a response rings.

    `channels`: sequence of array, shape (n,)
    Raises `InputError`: none is, or several are.
    """
    lasts = np.array([_duration(channel) for channel in channels])
    order = np.argsort(lasts)
    if lasts.size < 2 or lasts[order[1]] < _LONGER * lasts[order[0]]:
        raise InputError("force", f"{lasts.size} channels of one kind", "the name of the hammer's channel: its signal does not tell it")
    return int(order[0])


def _duration(channel: FloatArray) -> float:
    """Number of samples over which a signal's power is spread."""
    power = (channel - np.median(channel)) ** 2
    return float(np.sum(power) ** 2 / (np.sum(power**2) + 1e-300))
