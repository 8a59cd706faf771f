"""Machines of both planes at known unknowns, and their receptances straight from the equations of motion: dense, without the kernel."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np

from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.unknowns import DAMPING_UNIT, EVERY_PAIR, CoupledLayout

#: Every way in which the unknowns of three modes may be written down.
LAYOUTS = [
    CoupledLayout(3, fixture, softening, skew, turning)
    for fixture, softening, (skew, turning) in product(
        (False, True), (False, True), ((0, 0), (0, 1), (1, 1), (1, -1), (2, 1), (EVERY_PAIR, 0))
    )
]


def named(layout):
    """What of a layout differs from others, as a test's name."""
    kinds = [name for name in ("fixture", "softening") if getattr(layout, name)]
    return "-".join([*kinds, f"skew{layout.skew}", f"turning{layout.turning}"])


def coupled_vector(layout, seed=1):
    """A vector of a layout whose modes move both planes, in no order of frequency; all else as spindles have it."""
    rng = np.random.default_rng(seed)
    theta, m = np.zeros(layout.size), layout.modes
    theta[:m] = rng.permutation(np.log(2.0 * np.pi * np.geomspace(600.0, 3400.0, m)))
    theta[layout.block.parts["shapes"]] = rng.choice([-1.0, 1.0], 4 * m) * rng.uniform(0.1, 0.5, 4 * m)
    rows, cols = np.tril_indices(m)
    own = np.log(2.0 * 0.05 * np.exp(theta[:m])) / 2.0 - np.log(DAMPING_UNIT)
    theta[layout.block.parts["damping"]] = np.where(rows == cols, own[rows], 0.3 * rng.standard_normal(rows.size))
    rows, cols = np.tril_indices(4)
    theta[layout.block.parts["residual"]] = np.where(rows == cols, 1.0, 0.0) + 0.2 * rng.standard_normal(rows.size)
    beside = np.hstack([0.1 * rng.standard_normal((layout.block.places, m)), 0.3 * rng.standard_normal((layout.block.places, 4))])
    theta[layout.block.parts["places"]] = beside.ravel()
    theta[layout.block.parts["softening"]] = 0.1 / m * rng.standard_normal(layout.block.pairs * layout.softening)
    spread = 0.2 if layout.skew == EVERY_PAIR else np.sqrt(0.2)
    theta[layout.block.parts["skew"]] = spread * rng.standard_normal(layout.tail - layout.block.parts["skew"].start)
    theta[layout.joint] = np.log([2e9, 5e6, 1e3, 10.0])
    theta[layout.force] = 0.05 * rng.standard_normal(layout.coefficients)
    theta[layout.clamping] = rng.uniform(-1.0, 1.0, layout.clampings)
    return theta


def dense_receptance(machine, omega, x=0.0, speed=0.0):
    """Motion of the flange (4), then of the fixture (2), per force and moment at the flange, scaled by the lever, shape (n, 6, 4)."""
    stiffness = np.diag(machine.omega_n**2)
    if machine.softening.size:
        stiffness = stiffness + x * machine.softening * np.outer(machine.omega_n, machine.omega_n)
    damping = machine.factor @ machine.factor.T
    if machine.skew.size:
        damping = damping + speed * machine.skew
    # a machine whose fixture is no output of its own has one that stands still
    still = 2 - machine.places.shape[1]
    psi = np.hstack([machine.psi, np.pad(machine.places, ((0, 0), (0, still)))])
    static = np.vstack([machine.residual @ machine.residual.T, np.pad(machine.place_residual, ((0, still), (0, 0)))])
    unit = np.eye(machine.order)
    found = [psi.T @ np.linalg.solve(stiffness - w**2 * unit + 1j * w * damping, machine.psi) for w in np.atleast_1d(omega)]
    return np.array(found) + static


def dense_lines(machine, joint, points, seen=((0.0, 0.0), (0.0, 0.0))):
    """Motion of gap and fixture along X and Y by each force at the tip, shape (p, 2 axes, gap and fixture, 2 forces) [m/N].

    Parameters
    ----------
    machine : ModalParameters
    joint : array, shape (4,)
        k_t, k_r, c_t, c_r, the rotational ones over the lever squared.
    points : PointArrays
    seen : for X and Y, the distance behind the joint of what the gap's sensor sees, and 1 where that is the holder
    """
    found = []
    for w, x, speed, flange, tip in zip(points.omega, points.x, points.speed, points.flange, points.tip, strict=True):
        block = dense_receptance(machine, w, x, speed)[0]
        k_t, k_r = joint[0] + 1j * w * joint[2], joint[1] + 1j * w * joint[3]
        # forces and moments in the joint under a unit force at the tip, and what they move
        gives = 1.0 / np.array([k_t, k_r, k_t, k_r])
        carried = np.linalg.solve(flange + np.diag(gives) + block[:4], tip)
        moved, sides = block @ carried, gives[:, None] * carried
        own = []
        for axis, (behind, front) in enumerate(seen):
            t, r = (moved[k] + front * sides[k] for k in (2 * axis, 2 * axis + 1))
            own.append([t + behind * r - moved[4 + axis], moved[4 + axis]])
        found.append(own)
    return np.array(found)


def some_missing(cuts):
    """The second cut without a line of X, the fourth without two of Y, the fifth without any of Y."""
    cuts = list(cuts)
    for k, axis, keep in ((1, Dof.X, np.s_[1:]), (3, Dof.Y, np.s_[:-2])):
        lines = cuts[k].axes[axis]
        cuts[k] = replace(cuts[k], axes={**cuts[k].axes, axis: lines.of(np.arange(lines.order.size)[keep])})
    cuts[4] = replace(cuts[4], axes={Dof.X: cuts[4].axes[Dof.X]})
    return cuts
