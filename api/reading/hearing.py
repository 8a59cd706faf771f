"""What a recording says, hits of a hammer as an FRF, rings as a tooling, in the reader process: plain JSON types, few points a curve."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from api.reading.campaign_text import Upload
from api.reading.examine import with_client_name
from api.work.requests import ToolingSource
from api.work.toolings import keys_of, parsed, tooling_from, weigh
from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import from_rpm, to_hz
from rcsa_ident.front.recorded import heard
from rcsa_ident.io.curves.exports import write_tap
from rcsa_ident.io.recordings.open_recording import open_recording
from rcsa_ident.io.recordings.self_describing_tables import OpenRecording
from rcsa_ident.report.ring_rows import ring_row
from rcsa_ident.report.summaries import listening_row, tap_row
from rcsa_ident.signals.listening import Listening
from rcsa_ident.signals.recording import SI_UNITS, Quantity
from rcsa_ident.signals.spectra import envelope, mean_spectrum, spectrogram
from rcsa_ident.signals.tap import HitEstimator, TapFrf
from rcsa_ident.workflows.listen import listen_to
from rcsa_ident.workflows.ring import ring_tooling
from rcsa_ident.workflows.tap import tap_recordings

#: Points of the signal and of a spectrum, columns and rows of the spectrogram, and the decibels that it shows.
_POINTS, _LINES, _COLUMNS, _ROWS, _RANGE = 800, 1600, 200, 140, 60.0
#: Orders of a spectrum, and how far it goes beyond the chatter.
_ORDERS, _BEYOND = 60, 1.3
#: Highest frequency that a tooling's elements are made for [Hz]; windows of a ring's spectrum [s], and what is shown of it [Hz].
_HIGHEST_RING, _RING_SECONDS, _RING_BAND = 20e3, 0.25, (250.0, 25e3)


def listen(path: Path, name: str, asked: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a recording says, as `rcsa-ident listen --json` does.

    `name`: given by the client; its suffix is the format
    `asked`: the query's parameters by name: channel, quantity, teeth, speed_rpm, speeds_from, speeds_to, rate_hz, sensitivity, curves
    """
    opened = _opened(path, name, asked["channel"], asked["rate_hz"])
    try:
        speed = None if asked["speed_rpm"] is None else from_rpm(asked["speed_rpm"])
        between = None if asked["speeds_from"] is None else (from_rpm(asked["speeds_from"]), from_rpm(asked["speeds_to"]))
        told = {"teeth": asked["teeth"], "spindle_speed": speed, "between": between}
        answer = heard(opened, asked["channel"], asked["quantity"], asked["sensitivity"], name, **told)
    except InputError as error:
        raise with_client_name(error, path, name) from None
    return {"recording": name} | listening_row(answer) | {"curves": _curves(answer) if asked["curves"] else None}


def tap(asked: Mapping[str, Any], *hits: Upload) -> dict[str, Any]:
    """Return the receptance that recordings of hits give, and what became of each hit; where `file` is asked, written to the target.

    `asked`: the query's parameters by name: axis, force, response, quantity, estimator, sensor_mass_g, rate_hz, force_sensitivity,
        response_sensitivity, reverse; and file, a suffix
    `*hits`: all with one target
    """
    wanted = [name for name in (asked["force"], asked["response"]) if name is not None]
    opened = [_opened(hit.path, hit.name, wanted, asked["rate_hz"]) for hit in hits]
    chosen = {
        name: asked[name] for name in ("force", "response", "quantity", "axis", "force_sensitivity", "response_sensitivity", "reverse")
    }
    found = tap_recordings(opened, **chosen, estimator=HitEstimator(asked["estimator"]), sensor_mass=1e-3 * asked["sensor_mass_g"])
    if asked["file"]:
        # the suffix says how, and a target has none
        made = hits[0].target.with_name(hits[0].target.name + asked["file"])
        try:
            write_tap(made, found)
            made.replace(hits[0].target)
        finally:
            made.unlink(missing_ok=True)
    return tap_row(found, [hit.name for hit in hits]) | _receptance(found)


def ring(tooling: ToolingSource, asked: Mapping[str, Any], *paths: Path) -> dict[str, Any]:
    """Return what the ring of a tooling tells of it, as `rcsa-ident ring --json` does, and the tooling that it teaches.

    `asked`: mass_g, rate_hz and curves of the query; names of the files in `sounds` and `bare_tool`
    `*paths`: their files, in this order
    """
    drawn = tooling_from(tooling)
    weigh(drawn.assembly, _HIGHEST_RING)
    names = [*asked["sounds"], *asked["bare_tool"]]
    opened = [_opened(path, name, (), asked["rate_hz"]) for path, name in zip(paths, names, strict=True)]
    sounds, alone = opened[: len(asked["sounds"])], opened[len(asked["sounds"]) :]
    found = ring_tooling(drawn, sounds, alone, None if asked["mass_g"] is None else 1e-3 * asked["mass_g"])
    curves = [_ring_spectrum(of, each) for of, each in (("tooling", sounds), ("tool alone", alone)) if each] if asked["curves"] else None
    # the file's own name stays what it was, whatever the library calls it
    own = (parsed(tooling.text) if tooling.keys is None else tooling.keys).get("name")
    learned = keys_of(found.after) | ({} if own is None else {"name": own})
    return ring_row(found) | {"learned": learned, "curves": curves}


def _ring_spectrum(of: str, sounds: Sequence[OpenRecording]) -> dict[str, Any]:
    """The mean spectrum of the longest sound; short windows, since what rings is soon over."""
    longest = max(sounds, key=lambda each: each.channels[0].samples.size / each.rate)
    frequency, amplitude = mean_spectrum(np.nan_to_num(longest.channels[0].samples), longest.rate, _RING_SECONDS)
    shown = (frequency > _RING_BAND[0]) & (frequency < _RING_BAND[1])
    kept = _highest(amplitude[shown], _LINES)
    largest = float(amplitude[shown].max(initial=0.0)) or 1.0
    return {"of": of, "frequency_hz": _short(frequency[shown][kept], 7), "amplitude": _short(amplitude[shown][kept] / largest)}


def _opened(path: Path, name: str, names: Sequence[str], rate: float | None) -> OpenRecording:
    try:
        return open_recording(path, names, rate, Path(name).suffix)
    except InputError as error:
        raise with_client_name(error, path, name) from None
    except RecursionError:
        raise InputError("recording", "a file nested too deeply to be read", "a complete file", name) from None


def _curves(answer: Listening) -> dict[str, Any]:
    """What a page draws: the loudest channel over time, its spectrum over the judged part, and its spectrogram."""
    assert answer.record is not None
    signal, rate = answer.record.loudest, answer.record.rate
    width, low, high = envelope(signal, _POINTS)
    high_hz = min(answer.band, 0.5 * rate)
    frequency, amplitude = mean_spectrum(signal[int(answer.part[0] * rate) : int(answer.part[1] * rate)], rate)
    spindle, last = to_hz(answer.spindle_speed or 0.0), max([0.0, *answer.chatter])
    far = min(high_hz, max(_ORDERS * spindle, _BEYOND * last)) if spindle > 0.0 else high_hz
    # a slow drift is no sound
    shown = (frequency > 0.2 * spindle) & (frequency > 0.0) & (frequency <= far)
    highest = _highest(amplitude[shown], _LINES)
    step, level = spectrogram(signal, rate, _COLUMNS)
    level = level[: int(high_hz / step) + 1]
    together = -(-level.shape[0] // _ROWS)
    starts = np.arange(0, level.shape[0], together)
    rows = np.clip(np.maximum.reduceat(level, starts, axis=0) - level.max(), -_RANGE, 0.0)
    return {
        "unit": SI_UNITS.get(answer.record.quantity, ""),
        "signal": {"step_s": width / rate, "low": _short(low), "high": _short(high)},
        "spectrum": {"frequency_hz": _short(frequency[shown][highest], 7), "amplitude": _short(amplitude[shown][highest])},
        "spectrogram": {
            "duration_s": signal.size / rate,
            "highest_hz": level.shape[0] * step,
            "row_hz": together * step,
            "level_db": np.rint(rows).astype(int).tolist(),
        },
    }


def _receptance(found: TapFrf) -> dict[str, Any]:
    """The receptance over frequency, at most so many lines: of neighbours the largest."""
    kept = _highest(np.abs(found.receptance), _LINES)
    spread = _short(np.sqrt(found.variance[kept]))
    curve = {"re": _short(found.receptance.real[kept]), "im": _short(found.receptance.imag[kept]), "re_std": spread, "im_std": spread}
    return {
        "frequency_hz": _short(to_hz(found.omega[kept]), 9),
        "axes": {found.axis: curve},
        "coherence": None if found.coherence is None else _short(found.coherence[kept]),
    }


def _highest(size: FloatArray, most: int) -> np.ndarray:
    """Places of at most so many values: the largest one of neighbours."""
    width = max(-(-size.size // most), 1)
    return np.array([start + int(np.argmax(size[start : start + width])) for start in range(0, size.size, width)], dtype=int)


def _short(values: FloatArray, digits: int = 5) -> list[float]:
    return [float(f"{value:.{digits}g}") for value in np.nan_to_num(values)]


def warm() -> None:
    """Listen to a second of sound and average a hit: imports and compiles what both need."""
    rate, time = 8192.0, np.arange(8192) / 8192.0
    wave = np.sum([np.cos(200.0 * np.pi * m * time) for m in (1, 2, 4, 8)], axis=0)
    listen_to(rate, [wave + 0.1 * np.random.default_rng(1).standard_normal(time.size)], Quantity.SOUND)
