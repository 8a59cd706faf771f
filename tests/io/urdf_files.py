"""URDF as other programs write it: an arm of this package, and links with joints of any kind."""

from xml.sax.saxutils import quoteattr

import numpy as np

from rcsa_ident.io.settings.robots import turn_of
from rcsa_ident.machine.robot.model import Body, Frame, RobotModel


def numbers(values):
    return " ".join(repr(float(v)) for v in values)


def origin(frame: Frame) -> str:
    """Roll, pitch and yaw of fixed axes, and the place."""
    t = frame.turn
    flat = np.hypot(t[0, 0], t[1, 0])
    rpy = [np.arctan2(t[2, 1], t[2, 2]), np.arctan2(-t[2, 0], flat), np.arctan2(t[1, 0], t[0, 0])]
    if flat < 1e-12:
        # of roll and yaw only one is told
        rpy = [np.arctan2(-t[1, 2], t[1, 1]), np.arctan2(-t[2, 0], flat), 0.0]
    return f'<origin xyz="{numbers(frame.offset)}" rpy="{numbers(rpy)}"/>'


def link(name: str, body: Body | None = None, turn: np.ndarray | None = None) -> str:
    """A link, its inertia written in axes that are turned from its own."""
    if body is None:
        return f"<link name={quoteattr(name)}/>"
    axes = np.eye(3) if turn is None else turn
    i = axes.T @ body.inertia @ axes
    entries = {"ixx": (0, 0), "iyy": (1, 1), "izz": (2, 2), "ixy": (0, 1), "ixz": (0, 2), "iyz": (1, 2)}
    told = " ".join(f'{key}="{float(i[place])!r}"' for key, place in entries.items())
    frame = origin(Frame(axes, body.centre))
    return f'<link name={quoteattr(name)}><inertial>{frame}<mass value="{body.mass!r}"/><inertia {told}/></inertial></link>'


def joint(name, kind, parent, child, frame=None, axis=None, limits=None, more=""):
    """A joint between two links."""
    parts = [f'<parent link="{parent}"/><child link="{child}"/>', more]
    parts += [] if frame is None else [origin(frame)]
    parts += [] if axis is None else [f'<axis xyz="{numbers(axis)}"/>']
    parts += [] if limits is None else [f'<limit lower="{limits[0]!r}" upper="{limits[1]!r}" effort="0" velocity="0"/>']
    return f'<joint name="{name}" type="{kind}">{"".join(parts)}</joint>'


def urdf(*elements, name="arm"):
    """A whole file."""
    return f'<?xml version="1.0"?>\n<!-- written by a test -->\n<robot name="{name}">\n' + "\n".join(elements) + "\n</robot>\n"


def urdf_of(robot: RobotModel, turn: np.ndarray | None = None) -> str:
    """An arm of this package with its payload as a link of its own, without the springs that URDF does not have."""
    elements = [link("base_link", Body(robot.base_mass))]
    before = "base_link"
    for number, each in enumerate(robot.joints, start=1):
        bounded = bool(np.all(np.isfinite(each.limits)))
        limits = tuple(map(float, each.limits)) if bounded else None
        elements.append(joint(each.name, "revolute" if bounded else "continuous", before, f"link_{number}", each.frame, each.axis, limits))
        elements.append(link(f"link_{number}", each.body, turn))
        before = f"link_{number}"
    elements += [link("tool0"), joint("mounting", "fixed", before, "flange_plate", robot.flange)]
    elements += [link("flange_plate", robot.payload, turn), joint("plate", "fixed", "flange_plate", "tool0")]
    return urdf(*elements, name=robot.name)


def random_urdf(rng: np.random.Generator, joints: int = 7) -> str:
    """An arm whose links, fixed parts and axes stand anyhow, on a stand of its own."""

    def frame(size: float) -> Frame:
        return Frame(turn_of(rng.uniform(-3.0, 3.0, 3)), size * rng.normal(size=3))

    def body(name: str) -> str:
        # points anywhere have an inertia that can be
        points = rng.normal(size=(3, 3))
        spread = points @ points.T
        inertia = np.trace(spread) * np.eye(3) - spread
        return link(name, Body(float(rng.uniform(1.0, 50.0)), 0.2 * rng.normal(size=3), inertia), turn_of(rng.uniform(-3.0, 3.0, 3)))

    elements, before = [link("world"), body("base"), joint("stand", "fixed", "world", "base", frame(1.0))], "base"
    for k in range(joints):
        axis = rng.normal(size=3)
        kind = "continuous" if k % 3 == 2 else "revolute"
        elements.append(joint(f"J{k}", kind, before, f"link {k}", frame(0.4), axis / np.linalg.norm(axis), (-3.0, 3.0)))
        elements += [body(f"link {k}"), joint(f"F{k}", "fixed", f"link {k}", f"part {k}", frame(0.2)), body(f"part {k}")]
        before = f"part {k}" if k % 2 else f"link {k}"
    return urdf(*elements, link("tool0"), joint("end", "fixed", before, "tool0", frame(0.2)))
