"""Maps of stable and unstable cuts: above the first loss of stability a cut may be stable again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rcsa_ident.arrays import FloatArray
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.stability.full_discretisation import FullDiscretisation
from rcsa_ident.stability.lobes import uncoupled_planes
from rcsa_ident.stability.semi_discretisation import SemiDiscretisation
from rcsa_ident.stability.stability_map import StabilityMap, stability_map
from rcsa_ident.stability.tip_modes import TipModes, fitted_modes
from rcsa_ident.tool_holder.geometry import ToolAssembly
from rcsa_ident.workflows.lobes import LobeConditions
from rcsa_ident.workflows.speeds import MachineOverSpeed, responses_over_speed


def tip_map(tip: Receptance | TipModes, conditions: LobeConditions, depths: int = 100, full: bool = False) -> StabilityMap:
    """Return the map of a tip up to the conditions' largest depth.

    Parameters
    ----------
    tip : Receptance or TipModes
        A receptance is fitted with modes.
    conditions : LobeConditions
        Its method, if that gives maps, else full-discretisation.
    depths : int
        Equal steps of the depth.
    full : bool
        Compute every point.
    """
    modes = tip if isinstance(tip, TipModes) else fitted_modes(tip)[0]
    method = conditions.method if isinstance(conditions.method, FullDiscretisation | SemiDiscretisation) else FullDiscretisation()
    depth = conditions.max_depth * np.arange(1, depths + 1) / depths
    return stability_map(modes, conditions.process, np.unique(conditions.speeds), depth, method, full)


def machine_map(
    machine: MachineOverSpeed,
    assembly: ToolAssembly,
    omega: FloatArray,
    conditions: LobeConditions,
    depths: int = 100,
    full: bool = False,
) -> StabilityMap:
    """Return the map of a tooling on an identified machine, which may change with the speed."""
    speeds = np.unique(conditions.speeds)
    parts: list[StabilityMap] = []
    for places, response in responses_over_speed(machine, assembly, omega, speeds, False, 0.0):
        tip = uncoupled_planes(response.coupled.get(Dof.X), response.coupled.get(Dof.Y))
        parts.append(tip_map(tip, replace(conditions, speeds=speeds[places]), depths, full))
    back = np.argsort(np.concatenate([part.spindle_speed for part in parts]))
    crossing = np.concatenate([part.crossing_speed for part in parts])
    order = np.argsort(crossing, kind="stable")
    return StabilityMap(
        np.concatenate([part.spindle_speed for part in parts])[back],
        parts[0].depth,
        np.concatenate([part.growth for part in parts])[back],
        np.concatenate([part.computed for part in parts])[back],
        crossing[order],
        np.concatenate([part.crossing_depth for part in parts])[order],
        sum(part.evaluations for part in parts),
        max(part.error for part in parts),
        parts[0].method,
    )
