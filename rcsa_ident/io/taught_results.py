"""RESULT.json of a machine that further cuts have taught."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rcsa_ident.identification.machine import IdentifiedMachine
from rcsa_ident.io.drawings import axis_toolings_to_json, known_toolings_to_json
from rcsa_ident.io.results import spindle_to_json


def taught_result(data: Mapping[str, Any], machine: IdentifiedMachine, campaign: str) -> dict[str, Any]:
    """Return the content of a result file whose machine knows more than that of an earlier one.

    Parameters
    ----------
    data : mapping
        The earlier result.
    machine : IdentifiedMachine
        With a posterior of each axis.
    campaign : str
        Name of the cuts that have taught it.
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
    found.pop("speed_bands", None)
    if machine.toolings is not None:
        found["toolings"] = known_toolings_to_json(machine.toolings)
    return found
