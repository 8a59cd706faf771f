"""A small tool library in the form that CAM programs exchange; all figures are made up."""

from __future__ import annotations

import copy
from typing import Any

END_MILL: dict[str, Any] = {
    "BMC": "carbide",
    "description": "VHM 12 R0 long",
    "geometry": {
        "CSP": False,
        "DC": 12.0,
        "HAND": True,
        "LB": 60.0,
        "LCF": 26.0,
        "NOF": 4,
        "OAL": 104.0,
        "SFDM": 12.0,
        "shoulder-length": 30.0,
    },
    "guid": "00000000-0000-4000-8000-000000000001",
    "holder": {
        "description": "Chuck 12 x 95",
        "gaugeLength": 95.0,
        "segments": [
            {"height": 2.0, "lower-diameter": 28.0, "upper-diameter": 32.0},
            {"height": 50.0, "lower-diameter": 32.0, "upper-diameter": 32.0},
            {"height": 0.0, "lower-diameter": 32.0, "upper-diameter": 50.0},
            {"height": 17.0, "lower-diameter": 50.0, "upper-diameter": 54.0},
            {"height": 26.0, "lower-diameter": 63.0, "upper-diameter": 63.0},
            {"height": 40.0, "lower-diameter": 40.0, "upper-diameter": 30.0},
        ],
    },
    "post-process": {"number": 7},
    "type": "flat end mill",
    "unit": "millimeters",
}


def end_mill(**changes: Any) -> dict[str, Any]:
    """The tool above with other keys; a dotted name reaches into a table, None takes a key out."""
    tool = copy.deepcopy(END_MILL)
    for dotted, value in changes.items():
        *path, last = dotted.replace("__", ".").replace("_", "-").split(".")
        table = tool
        for key in path:
            table = table[key]
        if value is None:
            table.pop(last)
        else:
            table[last] = value
    return tool


def inches(tool: dict[str, Any]) -> dict[str, Any]:
    """The same tool with all lengths in inches."""
    tool = copy.deepcopy(tool) | {"unit": "inches"}
    lengths = ("DC", "LB", "LCF", "OAL", "SFDM", "shoulder-length", "shoulder-diameter")
    tool["geometry"] = {k: v / 25.4 if k in lengths else v for k, v in tool["geometry"].items()}
    holder = tool["holder"]
    holder["gaugeLength"] /= 25.4
    holder["segments"] = [{k: v / 25.4 for k, v in segment.items()} for segment in holder["segments"]]
    return tool


def library(*entries: Any) -> dict[str, Any]:
    return {"data": list(entries), "version": 2}
