"""Listen to a recording of any sensor: what it says by itself, without a campaign or a tooling."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.plausibility import RATE, SPINDLE_SPEED, TEETH
from rcsa_ident.signals.channel_scan import ChannelScan, scan
from rcsa_ident.signals.listening import Event, Listening, Record, listen
from rcsa_ident.signals.recording import LONGEST, Quantity, Recording, Sensor

#: Share of samples that may be lost; more say nothing.
_MOST_LOST = 0.2
#: Most samples that are listened to, from the middle of a longer recording.
MOST = 4 * LONGEST


def listen_to(
    rate: float,
    channels: Sequence[FloatArray],
    quantity: Quantity,
    teeth: int | None = None,
    spindle_speed: float | None = None,
    between: tuple[float, float] | None = None,
) -> Listening:
    """Return what channels of one quantity say, lost and saturated samples told, with the samples that were judged.

    `rate` [Hz]
    `channels`: sequence of array, shape (n,); lost samples are NaN
    `quantity`, `teeth`, `spindle_speed`, `between`: as of `rcsa_ident.signals.listening.listen`
    Raises `InputError`: too many samples are lost, or the record says nothing at all.

    Examples
    --------
    >>> time = np.arange(96000) / 48000.0
    >>> answer = listen_to(48000.0, [np.cos(2 * np.pi * 400 * time) + 0.1 * np.cos(2 * np.pi * 100 * time)], Quantity.SOUND)
    >>> print(answer, answer.teeth)
    stable at 6000.0 rev/min 4
    """
    RATE.checked("sampling_rate_hz", rate)
    for field, speed in (("speed", spindle_speed), *(("speeds", end) for end in between or ())):
        if speed is not None:
            SPINDLE_SPEED.checked(field, speed)
    if teeth is not None:
        TEETH.checked("teeth", teeth)
    # channel after channel in memory: most of what follows goes along one of them
    whole = np.stack([np.asarray(channel, dtype=float) for channel in channels]).T
    spare = max(whole.shape[0] - MOST, 0) // 2
    samples = whole[spare : spare + MOST]
    sensors = tuple(Sensor(f"channel {i + 1}", Quantity.SOUND) for i in range(samples.shape[1]))
    found = scan(Recording(rate, samples, sensors), list(range(samples.shape[1])))
    lost = sum(each.lost for each in found)
    if lost > _MOST_LOST * samples.size:
        raise InputError("recording", f"{lost} of {samples.size} samples lost", f"at most {_MOST_LOST:.0%} of them")
    events = _events(found, rate)
    filled = _filled(samples) if lost else samples
    answer = listen(filled, rate, quantity, teeth, spindle_speed, between)
    if spare:
        words = f"of {whole.shape[0] / rate:.4g} s those from {spare / rate:.4g} to {(spare + MOST) / rate:.4g} s were listened to"
        answer = replace(answer, reasons=(*answer.reasons, words))
    events = sorted((*answer.events, *events), key=lambda event: event.time or 0.0)
    return replace(answer, events=tuple(events), record=Record(filled, rate, quantity))


def _events(found: Sequence[ChannelScan], rate: float) -> list[Event]:
    """Lost samples, where they begin, and saturation, wherever it is."""
    events = [Event("drop-out", each.first_lost / rate) for each in found if each.lost]
    events += [Event("drop-out", each.frozen[0] / rate) for each in found if each.frozen is not None]
    return events + [Event("overload", None) for each in found if each.clipped]


def _filled(samples: FloatArray) -> FloatArray:
    """Samples with straight lines over those that are lost."""
    filled, place = samples.copy(), np.arange(samples.shape[0])
    for c in range(samples.shape[1]):
        there = np.isfinite(samples[:, c])
        if there.any():
            filled[:, c] = np.interp(place, place[there], samples[there, c])
        else:
            filled[:, c] = 0.0
    return filled
