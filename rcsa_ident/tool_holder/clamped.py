"""How far a tool bends under a steady force while its flange is held."""

from __future__ import annotations

import numpy as np

from rcsa_ident.tool_holder.geometry import ToolAssembly
from rcsa_ident.tool_holder.model import tool_holder_structure

#: The mesh is one for this frequency [Hz].
_MESH = 4500.0


def bending_at_rest(assembly: ToolAssembly) -> float:
    """Return the compliance of the tip across the tool with the flange clamped [m/N]: tool, holder, and the contact between them.

    Examples
    --------
    A carbide end mill of 12 mm, 40 mm of it in a holder of 60 mm, in micrometres a newton:

    >>> from rcsa_ident.tool_holder.geometry import MATERIALS, BeamSegment
    >>> tool = (BeamSegment(0.100, 0.012, MATERIALS["carbide"]),)
    >>> holder = (BeamSegment(0.060, 0.050, MATERIALS["steel"], inner_diameter=0.012),)
    >>> round(1e6 * bending_at_rest(ToolAssembly(tool, holder, insertion=0.040)), 3)
    0.129
    """
    structure = tool_holder_structure(assembly, _MESH)
    ports = structure.ports
    names = [str(each) for each in structure.coordinates]
    tip = ports[:, names.index("tip.x")]
    held = ports[:, [k for k, name in enumerate(names) if name.startswith("flange")]]
    d, c = held.shape
    # what is held is a condition beside the equilibrium
    matrix = np.block([[structure.stiffness, held], [held.T, np.zeros((c, c))]])
    # forces of supports are of the size of one, displacements of a micrometre: scaled alike
    scale = np.max(np.abs(structure.stiffness))
    matrix[:d, d:] *= scale
    matrix[d:, :d] *= scale
    return float(tip @ np.linalg.solve(matrix, np.append(tip, np.zeros(c)))[:d])
