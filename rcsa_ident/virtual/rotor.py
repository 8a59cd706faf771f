"""The finite-element rotor: tool, holder, joint, shaft, bearings and housing in one assembly, both bending planes.

Own assembly and own solution; shared with the identification's model are only the element matrices.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.sparse
import scipy.sparse.linalg

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.tool_holder.geometry import ToolAssembly
from rcsa_ident.virtual.machine import PerAxis, VirtualSpindle
from rcsa_ident.virtual.mesh import HOLDER, SHAFT, TOOL, Mesh, add_tooling, element_edges, nanometres

_AXES = (Dof.X, Dof.Y)
_SLOPES = (Dof.SLOPE_X, Dof.SLOPE_Y)


@dataclass(frozen=True, slots=True, eq=False)
class Rotor:
    """M q'' + (C + Omega G) q' + (K - Omega K_s + i S) q = f; X freedoms first, then Y.

    `mass`, `damping`, `stiffness`, `loss`, `gyroscopic`, `softening`: sparse matrices, shape (d, d); `loss` is S, the materials' hysteretic
        part; `gyroscopic` G and `softening` K_s are per spindle speed
    `ports`, shape (p, d): motion at each coordinate as a combination of the freedoms; its transpose spreads a force
    `coordinates`: tuple of Coordinate, length p; ``tip`` (cutting end), ``flange`` (spindle side of the joint), ``seen`` (where the flange
        sensors look, if not there), ``fixture`` (sensor holder on the housing)
    """

    mass: scipy.sparse.csc_array
    damping: scipy.sparse.csc_array
    stiffness: scipy.sparse.csc_array
    loss: scipy.sparse.csc_array
    gyroscopic: scipy.sparse.csc_array
    softening: scipy.sparse.csc_array
    ports: FloatArray
    coordinates: tuple[Coordinate, ...]

    def port(self, *names: str) -> np.ndarray:
        """Return the rows of `ports` with these names, as in ``tip.x``."""
        known = [str(c) for c in self.coordinates]
        for name in names:
            if name not in known:
                raise InputError("coordinate", name, "one of " + ", ".join(known))
        return np.array([known.index(name) for name in names])


def rotor(spindle: VirtualSpindle, tooling: ToolAssembly | None, refinement: int = 1, points: Mapping[str, float] | None = None) -> Rotor:
    """Return the assembled rotor; without a tooling, the spindle alone with its flange free.

    `tooling`: None is the bare spindle
    `refinement`: divides every element further: for convergence studies
    `points`: mapping of str to float [m]; further ports on the holder, by their distance from the tip: the nearest node's
    """
    mesh = Mesh()
    if tooling is not None:
        add_tooling(mesh, tooling, refinement)
    stops = [nanometres(b.position) for b in spindle.bearings] + [nanometres(spindle.seen_at)] * (spindle.seen_at > 0.0)
    mesh.body(SHAFT, 0.0, spindle.shaft, element_edges(0.0, spindle.shaft, stops, refinement))
    nodes = {z: node for (body, z), node in mesh.nodes.items() if body == SHAFT}
    housing = mesh.new_node()
    freedoms = 2 * mesh.count
    x, y, between = (_block(mesh, spindle, tooling is not None, nodes, housing, *axes) for axes in ((0, 0), (1, 1), (0, 1)))
    blocks = {name: scipy.sparse.csc_array(scipy.sparse.block_array([[x[name], between[name]], [between[name], y[name]]])) for name in x}
    turning = mesh.sum(mesh.rotary, freedoms)
    if not spindle.gyroscopic:
        turning = scipy.sparse.csc_array((freedoms, freedoms))
    # the cutter turns from +Y to +X, against z; a slope rate in one plane asks for a moment in the other
    gyroscopic = scipy.sparse.csc_array(scipy.sparse.block_array([[None, -2.0 * turning], [2.0 * turning, None]], format="csc"))
    ports, coordinates = [], []
    on_housing = {"fixture": spindle.fixture_position, **dict(zip(housing_points(spindle), spindle.housing_positions, strict=True))}
    places: dict[str, tuple[tuple[int, float], ...]] = {"flange": ((2 * nodes[0], 1.0),)}
    if spindle.seen_at > 0.0:
        places["seen"] = ((2 * nodes[nanometres(spindle.seen_at)], 1.0),)
    for name, position in on_housing.items():
        places[name] = ((2 * housing, 1.0), (2 * housing + 1, position - spindle.housing.position))
    if tooling is not None:
        places = {"tip": ((2 * mesh.nodes[TOOL, 0], 1.0),), **places}
        on_holder = [z for body, z in mesh.nodes if body == HOLDER]
        if spindle.seen_at < 0.0:
            ahead, there = sorted(on_holder), nanometres(tooling.stickout + tooling.holder_length + spindle.seen_at)
            k = min(max(int(np.searchsorted(ahead, there)), 1), len(ahead) - 1)
            share = (there - ahead[k - 1]) / (ahead[k] - ahead[k - 1])
            places["seen"] = tuple((2 * mesh.nodes[HOLDER, ahead[k - 1 + j]], (1.0 - share, share)[j]) for j in (0, 1))
        for name, distance in ({} if points is None else points).items():
            nearest = min(on_holder, key=lambda z: abs(z - nanometres(distance)))
            places[name] = ((2 * mesh.nodes[HOLDER, nearest], 1.0),)
    for point, terms in places.items():
        for axis in (0, 1):
            row = np.zeros(2 * freedoms)
            for index, weight in terms:
                row[axis * freedoms + index] = weight
            ports.append(row)
            coordinates.append(Coordinate(point, _AXES[axis]))
    for axis in (0, 1):
        row = np.zeros(2 * freedoms)
        row[axis * freedoms + 2 * nodes[0] + 1] = 1.0
        ports.append(row)
        coordinates.append(Coordinate("flange", _SLOPES[axis]))
    return Rotor(gyroscopic=gyroscopic, ports=frozen(ports), coordinates=tuple(coordinates), **blocks)


def housing_points(spindle: VirtualSpindle) -> tuple[str, ...]:
    """Return the names of the points on the housing at which further accelerometers stand."""
    return tuple(f"housing{k}" for k in range(1, 1 + len(spindle.housing_positions)))


def frequency_response(
    model: Rotor,
    omega: FloatArray,
    speed: float = 0.0,
    inputs: tuple[str, ...] = ("tip.x", "tip.y"),
    outputs: tuple[str, ...] | None = None,
) -> ComplexArray:
    """Return the receptances from `inputs` to `outputs` by solving the full equations at every frequency.

    `omega`: array, shape (n,) [rad/s], above 0
    `speed` [rad/s]: spindle speed, for gyroscopic moments and softening
    `inputs`, `outputs`: coordinates such as ``tip.x``; outputs default to all
    Returns a complex array of shape (n, outputs, inputs) [m/N].
    """
    rows = np.arange(len(model.coordinates)) if outputs is None else model.port(*outputs)
    return model.ports[rows] @ frequency_motion(model, omega, inputs, speed)


def frequency_motion(model: Rotor, omega: FloatArray, inputs: tuple[str, ...], speed: float = 0.0) -> ComplexArray:
    """Return the motion of every freedom under unit forces at `inputs`, shape (n, d, inputs).

    `omega`: array, shape (n,) [rad/s], above 0
    `inputs`: coordinates such as ``tip.x``
    `speed` [rad/s]: spindle speed
    """
    omega = np.asarray(omega, dtype=float)
    force = np.ascontiguousarray(model.ports[model.port(*inputs)].T.astype(complex))
    stiffness = model.stiffness - speed * model.softening + 1j * model.loss
    damping = model.damping + speed * model.gyroscopic
    values = np.empty((omega.size, *force.shape), dtype=complex)
    for i, w in enumerate(omega):
        dynamic = (stiffness + 1j * w * damping - w**2 * model.mass).tocsc()
        values[i] = scipy.sparse.linalg.splu(dynamic).solve(force)
    return values


def turned(values: PerAxis, angle: float) -> FloatArray:
    """Return T diag(values) T^T with T = [[cos, -sin], [sin, cos]] of the angle, shape (2, 2), along the machine's X and Y.

    `values`: two floats, along the first and the second principal direction
    `angle` [rad]: of the first principal direction, from +X towards +Y; at 0 the diagonal is `values` to the last bit
    """
    c, s = float(np.cos(angle)), float(np.sin(angle))
    first, second = values
    across = (first - second) * s * c
    return np.array([[first * c**2 + second * s**2, across], [across, first * s**2 + second * c**2]])


def _block(
    mesh: Mesh, spindle: VirtualSpindle, loaded: bool, nodes: dict[int, int], housing: int, row: int, col: int
) -> dict[str, scipy.sparse.csc_array]:
    """The matrices of one bending plane, or those between the two: of housing and bearings, where their angles are not 0."""
    freedoms = 2 * mesh.count
    own = row == col
    damping, stiffness, softening = (list(mesh.damping), list(mesh.stiffness), []) if own else ([], [], [])
    w, r = 2 * housing, 2 * housing + 1
    body = spindle.housing
    index = np.array([w, r])
    if own or body.angle != 0.0:
        springs = [turned(values, body.angle)[row, col] for values in (body.stiffness, body.tilting_stiffness)]
        dampers = [turned(values, body.angle)[row, col] for values in (body.damping, body.tilting_damping)]
        stiffness.append((index, np.diag(springs)))
        damping.append((index, np.diag(dampers)))
    for bearing in spindle.bearings:
        if not own and bearing.angle == 0.0:
            continue
        # shaft deflection minus the housing's at the bearing: w_h + (z - z_h) r_h
        index = np.array([2 * nodes[nanometres(bearing.position)], w, r])
        gap = np.array([1.0, -1.0, -(bearing.position - body.position)])
        square = np.outer(gap, gap)
        spring, damper = (turned(values, bearing.angle)[row, col] for values in (bearing.stiffness, bearing.damping))
        stiffness.append((index, spring * square))
        softening.append((index, spring * bearing.softening * square))
        damping.append((index, damper * square))
    if own and loaded:
        face = mesh.flange
        difference = np.array([[1.0, -1.0], [-1.0, 1.0]])
        joint = spindle.joint
        for k, stiff, damped in (
            (0, joint.translational_stiffness, joint.translational_damping),
            (1, joint.rotational_stiffness, joint.rotational_damping),
        ):
            index = np.array([2 * face + k, 2 * nodes[0] + k])
            stiffness.append((index, stiff * difference))
            damping.append((index, damped * difference))
    mass = [*mesh.mass, (np.array([w, r]), np.diag([body.mass, body.inertia]))] if own else []
    loss = mesh.loss if own else []
    parts = {"mass": mass, "damping": damping, "stiffness": stiffness, "loss": loss, "softening": softening}
    return {name: mesh.sum(part, freedoms) for name, part in parts.items()}
