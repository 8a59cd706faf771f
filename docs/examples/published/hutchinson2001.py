"""
Hutchinson 2001: a carbide shank as a Timoshenko beam
=====================================================

Tools and holders are Timoshenko beams here; their shear coefficient may be Hutchinson's. Natural frequencies of a
clamped shank are then the roots of a determinant, known to as many digits as wanted. Finite elements with two
freedoms inside come closer to them with the fourth power of their length.

Sources: :cite:`hutchinson2001`, :cite:`friedman1993`.
"""

import matplotlib.pyplot as plt
import numpy as np
import scipy.linalg

import rcsa_ident as ri
from rcsa_ident.base.units import to_hz
from rcsa_ident.dynamics.structure import Structure
from rcsa_ident.tool_holder.geometry import Material, ToolAssembly
from rcsa_ident.tool_holder.model import tool_holder_structure
from rcsa_ident.tool_holder.timoshenko import hutchinson

# %%
# Carbide, Ø12 mm, 100 mm long; the five roots [Hz] were computed with 30 digits.
carbide, diameter, length = Material(580e9, 14_450.0, 0.22, 0.0), 0.012, 0.1
roots = np.array([1055.4969, 6335.0259, 16693.1830, 30344.9602, 46288.2438])


def clamped(highest: float, pieces: int) -> tuple[Structure, np.ndarray, np.ndarray]:
    """Return the shank as a structure, and frequencies [Hz] and shapes with its spindle's end held."""
    beam = ToolAssembly((ri.BeamSegment(length, diameter, carbide),), (), 0.0)
    structure = tool_holder_structure(beam, highest, refinement=pieces, shear_coefficient=hutchinson)
    free = np.setdiff1d(np.arange(structure.mass.shape[0]), structure.index[2:])
    squares, shapes = scipy.linalg.eigh(structure.stiffness[np.ix_(free, free)], structure.mass[np.ix_(free, free)])
    return structure, to_hz(np.sqrt(squares[:5])), shapes[:, :5]


# %%
# More and more elements; the lowest mode is met to the printed digits from the start.
# Halving the elements divides the error by sixteen, until the digits of the roots end.
counts, errors = [], []
for pieces in (1, 2, 4, 8, 16):
    structure, found, _ = clamped(1.0, pieces)
    counts.append(structure.mass.shape[0])
    errors.append(np.abs(found / roots - 1.0))
errors = np.array(errors)
fig, ax = plt.subplots(layout="constrained")
for k in range(1, 5):
    ax.loglog(counts, errors[:, k], "o-", label=f"mode {k + 1}, {roots[k]:.0f} Hz")
ax.set(xlabel="degrees of freedom [-]", ylabel="relative error of the natural frequency [-]", title="Clamped carbide shank, Ø12 × 100 mm")
ax.legend()

# %%
# The last mesh meets all five roots to the printed digits.
print("found [Hz]:", np.round(found, 4).tolist())
np.testing.assert_allclose(found, roots, rtol=6e-8)
assert np.all(np.log2(errors[0, 1:] / errors[1, 1:]) > 3.5)
