"""Exact solutions: stepped Timoshenko beams by transfer matrices, closed forms. No code shared with the package.

State of a beam along z: deflection w, section rotation r, shear force V = S (w' - r), moment M = B r'; with e^{i w t}
V' = -m w^2 w and M' = -V - J w^2 r. S and B are complex where the material has a loss factor.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy.integrate
import scipy.linalg


def cowper(nu, m):
    return 6 * (1 + nu) * (1 + m * m) ** 2 / ((7 + 6 * nu) * (1 + m * m) ** 2 + (20 + 12 * nu) * m * m)


@dataclass(frozen=True)
class Beam:
    """One uniform stretch; outer and inner diameter [m], E [Pa], rho, nu, loss factor."""

    length: float
    outer: float
    inner: float
    youngs: float
    density: float
    poisson: float
    loss: float = 0.0

    @property
    def numbers(self):
        """B, S, m, J."""
        area = np.pi * (self.outer**2 - self.inner**2) / 4
        inertia = np.pi * (self.outer**4 - self.inner**4) / 64
        modulus = self.youngs * (1 + 1j * self.loss)
        shear = cowper(self.poisson, self.inner / self.outer) * modulus / (2 * (1 + self.poisson)) * area
        return modulus * inertia, shear, self.density * area, self.density * inertia


def _state(omega, numbers):
    b, s, m, j = numbers
    return np.array([[0, 1, 1 / s, 0], [0, 0, 0, 1 / b], [-m * omega**2, 0, 0, 0], [0, -j * omega**2, -1, 0]], dtype=complex)


def _dynamic_stiffness(state, length, reference):
    """Forces at both ends over motions at both ends, from the transfer matrix; state (motions, forces)."""
    n = state.shape[0] // 2
    unit = 0.01
    motion = np.tile([1.0, 1.0 / unit], n // 2)
    force = np.tile([reference / unit**3, reference / unit**2], n // 2)
    scale = np.concatenate([motion, force])
    transfer = scipy.linalg.expm(state * (scale[None, :] / scale[:, None]) * length) * (scale[:, None] / scale[None, :])
    uu, uf, fu, ff = transfer[:n, :n], transfer[:n, n:], transfer[n:, :n], transfer[n:, n:]
    inverse = np.linalg.inv(uf)
    return np.block([[inverse @ uu, -inverse], [fu - ff @ inverse @ uu, ff @ inverse]])


def _layered_state(omega, inner, outer, translational, rotational):
    state = np.zeros((8, 8), dtype=complex)
    # order: motions of inner, of outer, forces of inner, of outer
    for body, numbers in enumerate((inner, outer)):
        own = _state(omega, numbers)
        rows = np.array([2 * body, 2 * body + 1, 4 + 2 * body, 5 + 2 * body])
        state[np.ix_(rows, rows)] += own
    for k, spring in enumerate((translational, rotational)):
        state[4 + k, k] += spring
        state[4 + k, 2 + k] -= spring
        state[6 + k, 2 + k] += spring
        state[6 + k, k] -= spring
    return state


def assembly_receptance(tool, holder, insertion, contact, omega):
    """Receptances over (tip w, tip r, flange w, flange r), shape (n, 4, 4), of a free tool-holder.

    Parameters
    ----------
    tool, holder : sequences of Beam, from the tip to the flange
    insertion : float [m]
    contact : (k_t, k_r, c_t, c_r) per metre, or None for a rigid connection
    """
    origin = sum(b.length for b in tool) - insertion
    pieces = []
    for body, beams, start in ((0, tool, 0.0), (1, holder, origin)):
        z = start
        for beam in beams:
            pieces.append((body, z, z + beam.length, beam))
            z += beam.length
    # short pieces keep the transfer matrices well conditioned
    steps = {round(z, 10) for _, a, b, _ in pieces for z in np.linspace(a, b, 1 + int(np.ceil((b - a) / 0.02)))}
    steps = sorted(steps)
    nodes = {}
    for z in steps:
        for body in (0, 1):
            if any(b == body and first - 1e-9 < z < last + 1e-9 for b, first, last, _ in pieces):
                shared = body == 1 and (0, z) in nodes and (contact is None or insertion == 0.0)
                nodes[body, z] = nodes[0, z] if shared else len(set(nodes.values()))
    size = 2 * len(set(nodes.values()))
    values = np.empty((len(omega), 4, 4), dtype=complex)
    top = max(z for body, z in nodes if body == 1) if holder else steps[-1]
    flange = nodes[1 if holder else 0, top]
    ports = [2 * nodes[0, steps[0]], 2 * nodes[0, steps[0]] + 1, 2 * flange, 2 * flange + 1]
    for i, w in enumerate(omega):
        stiffness = np.zeros((size, size), dtype=complex)
        for a, b in pairwise(steps):
            bodies = [(body, beam) for body, first, last, beam in pieces if first - 1e-9 < 0.5 * (a + b) < last + 1e-9]
            if len(bodies) == 2 and contact is not None:
                kt, kr, ct, cr = contact
                state = _layered_state(w, bodies[0][1].numbers, bodies[1][1].numbers, kt + 1j * w * ct, kr + 1j * w * cr)
                ends = [nodes[body, z] for z in (a, b) for body in (0, 1)]
                reference = abs(bodies[0][1].numbers[0])
            else:
                # bodies that move as one: their stiffnesses and masses add up
                numbers = np.sum([beam.numbers for _, beam in bodies], axis=0)
                state = _state(w, numbers)
                ends = [nodes[bodies[0][0], z] for z in (a, b)]
                reference = abs(numbers[0])
            freedoms = np.array([2 * n + k for n in ends for k in (0, 1)])
            stiffness[np.ix_(freedoms, freedoms)] += _dynamic_stiffness(state, b - a, reference)
        scale = 1.0 / np.sqrt(np.abs(np.diag(stiffness)))
        inverse = np.linalg.inv(stiffness * scale[:, None] * scale) * scale[:, None] * scale
        values[i] = inverse[np.ix_(ports, ports)]
    return values


def single_beam(beam, omega):
    """Free-free receptances of one beam, or of a tuple of beams end to end."""
    beams = beam if isinstance(beam, tuple) else (beam,)
    return assembly_receptance(beams, (), 0.0, None, omega)


def rigid_body(mass, centre, inertia, points, omega):
    """Receptance of a rigid body over (w, r) of each point on its axis, shape (n, 2p, 2p)."""
    shapes = np.array([[1.0, z - centre] for z in points for _ in (0, 1)])
    shapes[1::2] = [0.0, 1.0]
    static = shapes @ np.diag([1.0 / mass, 1.0 / inertia]) @ shapes.T
    return -static[None] / np.asarray(omega)[:, None, None] ** 2


def cone_tip_compliance(length, first, last, youngs, poisson, samples=200001):
    """Deflection per force at the thin end of a clamped solid cone, by quadrature of the flexibility integral."""
    z = np.linspace(0.0, length, samples)
    d = first + (last - first) * z / length
    bending = z**2 / (youngs * np.pi * d**4 / 64)
    shear = 1.0 / (cowper(poisson, 0.0) * youngs / (2 * (1 + poisson)) * np.pi * d**2 / 4)
    return scipy.integrate.simpson(bending + shear, x=z)
