"""Examination of an upload in the reader process: read, normalise its samples, judge it; answers are plain JSON types."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from api.reading.campaign_text import Upload, campaign_of_text
from api.reading.samples import read_normalised, write_normalised
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.remarks import Remark
from rcsa_ident.base.units import to_rpm
from rcsa_ident.io.recordings.readers import read_signals, recorded
from rcsa_ident.report.summaries import recording_rows
from rcsa_ident.setup.campaign import Campaign
from rcsa_ident.setup.cut import Cut
from rcsa_ident.signals.measurement import Reading, fits_by_chance, judge_air, measure_cut
from rcsa_ident.signals.motion import measured_axes
from rcsa_ident.signals.recording import Recording, Sensor
from rcsa_ident.signals.sweep import judge_pass_air
from rcsa_ident.signals.verdict import RecordCode, Verdict
from rcsa_ident.workflows.identify import read_of


@lru_cache(maxsize=4)
def _declared(text: str) -> Campaign:
    """A campaign's files come one after the other, each with its whole text."""
    return campaign_of_text(text)


def read_upload(upload: Upload, sensors: tuple[Sensor, ...], rate: float | None) -> Recording:
    """Return the samples of an upload in SI and write them normalised; errors carry the client's file name.

    `rate` [Hz]: of a file without a rate
    """
    try:
        found, signals = read_signals(upload.path, [sensor.name for sensor in sensors], rate, Path(upload.name).suffix)
        write_normalised(upload.target, found, signals, sensors)
        return recorded(found, signals, sensors)
    except InputError as error:
        raise with_client_name(error, upload.path, upload.name) from None
    except RecursionError:
        raise InputError("recording", "a file nested too deeply to be read", "a complete file", upload.name) from None


def with_client_name(error: InputError, path: Path, name: str) -> InputError:
    """Return an error whose file is called as the client calls it."""
    found = error.found.replace(str(path), name) if isinstance(error.found, str) else error.found
    return InputError(error.field, found, error.allowed.replace(str(path), name), name)


def look(upload: Upload, text: str, cut_id: str, role: str, air: Path | None) -> dict[str, Any]:
    """Read an upload of a campaign and return its description with the verdict.

    `text`: the campaign as declared
    `cut_id`, `role`: the cut it belongs to; one of them for an air cut
    `air`: samples of the cut's air cut, where they have been uploaded
    """
    campaign = _declared(text)
    cut = next(each for each in campaign.cuts if each.id == cut_id)
    recording = read_upload(upload, campaign.sensors, campaign.sampling_rate)
    try:
        beside = None if air is None else read_normalised(air, in_file=True)
    except InputError:
        # deleted meanwhile: the cut will be judged again
        beside = None
    verdict, reading = judged(campaign, cut, recording, beside, role)
    speed = reading.spindle_speed
    return described(recording) | {
        "verdict": verdict,
        "spindle_speed_rpm": to_rpm(speed) if speed is not None and np.isfinite(speed) else None,
        "harmonics_above_noise": {axis.upper(): reading.harmonics.get(axis, 0) for axis in measured_axes(recording.sensors)},
    }


def judge(text: str, cut_id: str, cut: Path, air: Path | None) -> dict[str, Any]:
    """Return the verdict on the stored samples of a cut."""
    campaign = _declared(text)
    own = next(each for each in campaign.cuts if each.id == cut_id)
    beside = None if air is None else read_normalised(air, in_file=True)
    return judged(campaign, own, read_normalised(cut, in_file=True), beside, "cut")[0]


def among_fellows(toolings: list[str], alone: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the verdicts of a campaign's cuts, given those on each for itself: one that fits a wrong tooth count by chance is no good."""
    wrong = [RecordCode.TOOTH_COUNT in verdict.get("codes", ()) for verdict in alone]
    fits = [True if verdict["usable"] else False if contradicts else None for verdict, contradicts in zip(alone, wrong, strict=True)]
    reasons = fits_by_chance(list(zip(toolings, fits, strict=True)))
    left_out: dict[str, Any] = {"usable": False, "lines": 0, "signal_to_noise_db": {}}
    return [
        own if reason is None else own | left_out | {"reasons": [str(reason)], "codes": [str(reason.code)]}
        for own, reason in zip(alone, reasons, strict=True)
    ]


def described(recording: Recording) -> dict[str, Any]:
    """Return rate, duration and channels of a recording."""
    return {
        "sampling_rate_hz": recording.rate,
        "duration_s": recording.samples.shape[0] / recording.rate,
        "channels": [sensor.name for sensor in recording.sensors],
    }


def judged(campaign: Campaign, cut: Cut, recording: Recording, air: Recording | None, role: str) -> tuple[dict[str, Any], Reading]:
    """Return the verdict on a cut (with its air cut, where there is one) or on an air cut, and the reading it is based on."""
    recording, air = campaign.clocked(recording), None if air is None else campaign.clocked(air)
    try:
        with np.errstate(all="ignore"):
            if role == "cut":
                reading = read_of(campaign, cut, recording, air)
            elif cut.last_speed is None:
                reading = judge_air(cut.id, cut.tooling, recording, cut.conditions)
            else:
                reading = judge_pass_air(cut.id, cut.tooling, recording, cut.speeds)
    except InputError as error:
        reading = Reading(cut.id, cut.tooling, cut.conditions.spindle_speed, Verdict((Remark(RecordCode.UNREADABLE, str(error)),)))
    except (ArithmeticError, np.linalg.LinAlgError):
        reason = Remark(RecordCode.NOT_FINITE, "numbers of these samples have no finite answer")
        reading = Reading(cut.id, cut.tooling, cut.conditions.spindle_speed, Verdict((reason,)))
    (row,) = recording_rows([reading])
    verdict = {
        "usable": row.usable,
        "reasons": list(row.reasons),
        "codes": [str(reason.code) for reason in reading.verdict.reasons],
        "notes": list(row.notes),
        "spindle_speed_rpm": row.found_rpm,
        "lines": row.lines,
        "windows": max(len(reading.measurements), 1),
        "signal_to_noise_db": {axis: value for axis, value in row.signal_to_noise_db.items() if np.isfinite(value)},
    }
    return verdict, reading


def warm() -> None:
    """Judge small records, of a speed that keeps and of one that wanders: imports and compiles everything a verdict needs."""
    from rcsa_ident.cutting.coefficients import CuttingCoefficients
    from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
    from rcsa_ident.cutting.cutter import Cutter
    from rcsa_ident.cutting.force import force_and_slope
    from rcsa_ident.cutting.profile import Profile
    from rcsa_ident.dynamics.coordinates import Dof
    from rcsa_ident.signals.recording import Quantity

    rate, speed, rng = 20000.0, 200.0 * np.pi, np.random.default_rng(1)
    time = np.arange(20000) / rate
    both = (Sensor("x", Quantity.DISPLACEMENT, Dof.X), Sensor("y", Quantity.DISPLACEMENT, Dof.Y))
    conditions = CuttingConditions(speed, 1e-4, 1e-4, Engagement.from_immersion(0.5, "down"))
    for sensors, wander in ((both[:1], 0.0), (both, 0.0), (both, 5.0)):
        angle = speed * time + wander * np.sin(4.0 * np.pi * time)
        wave = 1e-6 * np.sum([np.cos(m * angle) for m in range(1, 9)], axis=0)
        made = Recording(rate, wave[:, None] + 1e-9 * rng.standard_normal((wave.size, len(sensors))), sensors)
        measure_cut("warm", "warm", made, made, Cutter(2, 0.012), conditions, CuttingCoefficients(9e8, 0.3))
    # these records show no lines, and what force lines of a cutter with run-out need is compiled by lines alone
    for cutter in (Cutter(2, 0.012), Cutter(2, 0.012, profile=Profile.ball(0.012))):
        force_and_slope(cutter, conditions, CuttingCoefficients(9e8, 0.3), np.array([2, 4]))
