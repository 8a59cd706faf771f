"""RESULT.json of a machine that further cuts have taught."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from rcsa_ident.base.errors import InputError
from rcsa_ident.identification.machine import IdentifiedMachine
from rcsa_ident.io.results.drawings import axis_toolings_to_json, known_toolings_to_json
from rcsa_ident.io.results.parts import spindle_to_json


def recordings_of(files: Iterable[Path]) -> dict[str, str]:
    """Return what tells recordings apart, whatever they are called: a digest of each file's content, and its name."""
    found = {}
    for path in sorted(files):
        with path.open("rb") as file:
            found[hashlib.file_digest(file, "sha256").hexdigest()[:16]] = path.name
    return found


def refuse_taught(data: Mapping[str, Any], recordings: Mapping[str, str]) -> None:
    """Raise `InputError` where some of the recordings have taught the machine of a result already."""
    again = [name for digest, name in recordings.items() if digest in data.get("taught_recordings", ())]
    if again:
        found = f"{again[0]}{f' and {len(again) - 1} more' if len(again) > 1 else ''}, which taught this machine already"
        raise InputError("recordings", found, "further ones, or the machine as it was before: these would count twice")


def taught_result(data: Mapping[str, Any], machine: IdentifiedMachine, campaign: str, recordings: Iterable[str] = ()) -> dict[str, Any]:
    """Return the content of a result file whose machine knows more than that of an earlier one.

    `data`: the earlier result
    `machine`: with a posterior of each axis
    `campaign`: name of the cuts that have taught it
    `recordings`: as `recordings_of` tells them; of a store that knows its campaigns none
    """
    axes = dict(data["axes"])
    for axis, posterior in machine.posteriors().items():
        own = dict(axes[axis.upper()])
        own |= spindle_to_json(*posterior.machine(axis))
        own["unknowns"] = posterior.theta.tolist()
        own["rivals"] = [rival.tolist() for rival in posterior.rivals]
        own["covariance"] = {**own["covariance"], "matrix": posterior.covariance.tolist()}
        axes[axis.upper()] = own | axis_toolings_to_json(posterior)
    found = {**data, "axes": axes, "taught_by": [*data.get("taught_by", []), campaign]}
    told = [*data.get("taught_recordings", []), *recordings]
    found |= {"taught_recordings": told} if told else {}
    found.pop("speed_bands", None)
    if machine.toolings is not None:
        found["toolings"] = known_toolings_to_json(machine.toolings)
    return found
