"""Files of a campaign's hammer tests: looked at in the reader process, and kept as the receptances that its tests name, in HDF5."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from api.reading.campaign_text import Upload, campaign_of_text
from api.reading.examine import with_client_name
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.remarks import Remark
from rcsa_ident.base.units import to_hz
from rcsa_ident.dynamics.receptance import MeasuredCurve, assumed_of
from rcsa_ident.io.curves.hammer import read_hammer_test
from rcsa_ident.setup.campaign import HammerTest
from rcsa_ident.signals.verdict import RecordCode
from rcsa_ident.workflows.identify import hammer_lines

_ID, _FREQUENCY, _REAL, _IMAGINARY, _ASSUMED = "id", "frequency_hz", "real", "imaginary", "assumed"


def look(upload: Upload, text: str) -> dict[str, Any]:
    """Read the FRFs of an upload that a campaign's hammer tests name, write them normalised, and return what they are.

    `text`: the campaign as declared
    Raises `InputError`: a test that names the file cannot be read from it, or has too few lines in its band.
    """
    campaign = campaign_of_text(text)
    tests = tuple(replace(test, file=upload.path) for test in campaign.tests if test.file == Path(upload.name))
    try:
        curves = [read_hammer_test(test) for test in tests]
        lines = hammer_lines(replace(campaign, tests=tests), dict(zip(tests, curves, strict=True)).__getitem__)
    except InputError as error:
        raise with_client_name(error, upload.path, upload.name) from None
    with h5py.File(upload.target, "w") as file:
        for i, (test, curve) in enumerate(zip(tests, curves, strict=True)):
            frequency, value = curve
            group = file.create_group(f"{i}")
            group.attrs[_ID] = test.id
            group.attrs[_ASSUMED] = list(assumed_of([curve]))
            for name, values in ((_FREQUENCY, frequency), (_REAL, value.real), (_IMAGINARY, value.imag)):
                group.create_dataset(name, data=values, chunks=values.shape, fletcher32=True, track_times=False)
    with upload.target.open("rb+") as written:
        os.fsync(written.fileno())
    told = [
        {"id": each.id, "lines": each.omega.size, "from_hz": to_hz(float(each.omega[0])), "to_hz": to_hz(float(each.omega[-1]))}
        for each in lines
    ]
    verdict = {
        "usable": True,
        "reasons": [],
        "notes": list(dict.fromkeys(remark for each in lines for remark in each.remarks)),
        "spindle_speed_rpm": None,
        "signal_to_noise_db": {},
    }
    return {
        "sampling_rate_hz": None,
        "duration_s": None,
        "channels": [],
        "spindle_speed_rpm": None,
        "harmonics_above_noise": {},
        "frfs": told,
        "verdict": verdict | {"lines": sum(each.omega.size for each in lines)},
    }


def read_stored(test: HammerTest) -> MeasuredCurve:
    """Return the frequencies [Hz] and the receptance [m/N] of a test whose file is a normalised one, shape (n,) both."""
    try:
        with h5py.File(test.file, "r", locking=False) as file:
            group = next(each for each in file.values() if each.attrs[_ID] == test.id)
            frequency, real, imaginary = (np.asarray(group[name], dtype=float) for name in (_FREQUENCY, _REAL, _IMAGINARY))
            said = list(group.attrs.get(_ASSUMED, ()))  # files of an earlier release have none
    except (OSError, KeyError, StopIteration):
        raise InputError("frfs", f"{test.id}: an FRF that is missing or damaged", "an uploaded file of the test") from None
    return MeasuredCurve(frequency, real + 1j * imaginary, (Remark(RecordCode.ASSUMED, str(each)) for each in said))
