"""URDF: an arm as the Robot Operating System describes it; lengths in metres, angles in radians."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import NoReturn, TypeVar
from xml.etree import ElementTree

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.io.files import MEGABYTE, read_bytes
from rcsa_ident.io.settings.robots import turn_of
from rcsa_ident.machine.robot.model import Body, Frame, Joint, RobotModel

_T = TypeVar("_T")
#: Descriptions of whole cells stay far below.
_LARGEST = 8 * MEGABYTE
_TURNING, _FIXED = ("revolute", "continuous"), "fixed"
#: Reach of an arm [m]: what lies outside is given in another unit.
_LEAST_REACH, _MOST_REACH = 0.1, 20.0


@dataclass(frozen=True, slots=True, eq=False)
class _Edge:
    """A joint between two links: where the child's axes stand in the parent's, and about which axis it turns."""

    name: str
    kind: str
    parent: str
    child: str
    frame: Frame
    axis: FloatArray
    limits: tuple[float, float]
    follows: bool


def read_urdf(
    path: str | Path, stiffness: Sequence[float], damping: Sequence[float] = (0.0,), flange: str | None = None
) -> tuple[RobotModel, tuple[str, ...]]:
    """Return the arm of a URDF file, and what is to be said of it.

    Links that fixed joints hold together are one body. Off the diagonal the moments of inertia are the tensor's own; an inertial frame that
    is turned is turned back. Meshes are not read. The tool point is the flange.

    `stiffness`, `damping`: sequences of float [N m/rad], [N m s/rad]; of each joint from the base on, or one for all: URDF does not tell
        how far a joint gives way
    `flange`: the link whose axes are the robot's flange; by default the last one of an arm without branches
    Raises `InputError`, which names the element, what stands there, and what may.
    """
    where = str(path)
    try:
        root = _parsed(read_bytes(path, "URDF", _LARGEST))
        name = _text(root, "name", "robot")
        links = _named(root, "link", _link)
        edges = _named(root, "joint", _edge)
        return _arm(name, links, edges, stiffness, damping, flange)
    except InputError as error:
        raise (error if error.where else error.at(where)) from None


def _parsed(raw: bytes) -> ElementTree.Element:
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError("URDF", f"a character that is not UTF-8 in line {raw.count(10, 0, error.start) + 1}", "text in UTF-8") from None
    # with them a small file may become a large one, or another; with zeros between its signs, as in UTF-16, one would not be found
    if "\0" in text or "<!doctype" in text.lower() or "<!entity" in text.lower():
        raise InputError("URDF", "a document type declaration", "XML without one")
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError("URDF", f"an XML error ({error})", "XML") from None
    if "<xacro:" in text:
        raise InputError("URDF", "elements of xacro", "the URDF that they expand to: xacro ARM.urdf.xacro > ARM.urdf")
    if root.tag != "robot":
        raise InputError("URDF", f"<{root.tag}> as its root", "<robot>")
    return root


def _named(root: ElementTree.Element, tag: str, read: Callable[[ElementTree.Element], _T]) -> dict[str, _T]:
    found: dict[str, _T] = {}
    for element in root.findall(tag):
        name = _text(element, "name", f"<{tag}>")
        if name in found:
            raise InputError(f'{tag} "{name}"', "two of them", "every name once")
        found[name] = read(element)
    if not found:
        raise InputError("URDF", f"no <{tag}>", "one or more")
    return found


def _link(element: ElementTree.Element) -> Body:
    """The body of a link in its own axes, massless where it has no inertial."""
    name = element.get("name", "")
    inertial = element.find("inertial")
    if inertial is None:
        return Body(0.0)
    place = f'inertial of link "{name}"'
    mass = _number(_child(inertial, "mass", place), "value", f"{place}, mass")
    if mass < 0.0:
        raise InputError(f"{place}, mass", f"{mass:g} kg", "0 or more [kg]")
    table = _child(inertial, "inertia", place)
    xx, yy, zz, xy, yz, xz = (_number(table, key, f"{place}, inertia") for key in ("ixx", "iyy", "izz", "ixy", "iyz", "ixz"))
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return Body(mass, np.zeros(3), tensor).seen_from(_origin(inertial, place))


def _edge(element: ElementTree.Element) -> _Edge:
    name = element.get("name", "")
    place = f'joint "{name}"'
    kind = _text(element, "type", place)
    axis = np.array([1.0, 0.0, 0.0])
    if (told := element.find("axis")) is not None:
        axis = _three(told, "xyz", f"{place}, axis", axis)
    size = float(np.linalg.norm(axis))
    if kind in _TURNING and size == 0.0:
        raise InputError(f"{place}, axis", "0 0 0", "a direction")
    limits = (-np.inf, np.inf)
    if kind == "revolute":
        limit = _child(element, "limit", place)
        # of both, what is not told is zero
        low, high = (_number(limit, key, f"{place}, limit", "0") for key in ("lower", "upper"))
        if not low < high:
            raise InputError(f"{place}, limit", f"{low:g} to {high:g} rad", 'a lower limit below the upper one [rad], or type "continuous"')
        limits = (low, high)
    parent, child = (_text(_child(element, end, place), "link", f"{place}, {end}") for end in ("parent", "child"))
    follows = element.find("mimic") is not None
    return _Edge(name, kind, parent, child, _origin(element, place), axis / size if size else axis, limits, follows)


def _origin(element: ElementTree.Element, place: str) -> Frame:
    told = element.find("origin")
    if told is None:
        return Frame()
    zero = np.zeros(3)
    return Frame(turn_of(_three(told, "rpy", f"{place}, origin", zero)), _three(told, "xyz", f"{place}, origin", zero))


def _child(element: ElementTree.Element, tag: str, place: str) -> ElementTree.Element:
    found = element.find(tag)
    if found is None:
        raise InputError(place, f"no <{tag}>", f"one <{tag}>")
    return found


def _text(element: ElementTree.Element, key: str, place: str) -> str:
    found = element.get(key, "").strip()
    if not found:
        raise InputError(f"{place}, {key}", "nothing", "a name")
    return found


def _number(element: ElementTree.Element, key: str, place: str, default: str | None = None) -> float:
    text = element.get(key, default)
    if text is None:
        raise InputError(f"{place}, {key}", "nothing", "a finite number")
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not isfinite(value):
        raise InputError(f"{place}, {key}", text, "a finite number")
    return value


def _three(element: ElementTree.Element, key: str, place: str, default: FloatArray) -> FloatArray:
    text = element.get(key)
    if text is None:
        return default
    try:
        found = np.array([float(part) for part in text.split()])
    except ValueError:
        found = np.zeros(0)
    if found.shape != (3,) or not np.all(np.isfinite(found)):
        raise InputError(f"{place}, {key}", text, "three finite numbers with blanks between")
    return found


@dataclass(frozen=True, slots=True, eq=False)
class _Tree:
    """Links and the joints between them: one root, and no link behind two joints.

    `above`: the joint that a link hangs on, by the link's name
    `below`: the joints that leave a link, by the link's name
    """

    root: str
    links: dict[str, Body]
    above: dict[str, _Edge]
    below: dict[str, list[_Edge]]

    @classmethod
    def of(cls, links: dict[str, Body], edges: dict[str, _Edge]) -> _Tree:
        above: dict[str, _Edge] = {}
        below: dict[str, list[_Edge]] = {name: [] for name in links}
        for edge in edges.values():
            for end, name in (("parent", edge.parent), ("child", edge.child)):
                if name not in links:
                    raise InputError(f'joint "{edge.name}", {end}', name, "a link of the file")
            if edge.child in above:
                raise InputError(f'link "{edge.child}"', f"behind {above[edge.child].name} and {edge.name}", "one joint before a link")
            above[edge.child] = edge
            below[edge.parent].append(edge)
        roots = [name for name in links if name not in above]
        if len(roots) != 1:
            raise InputError("links", f"{len(roots)} without a joint before them {roots[:5]}", "one: the base")
        tree = cls(roots[0], links, above, below)
        # rings hang on nothing
        if ring := set(links) - {link for link, _ in tree._from(roots[0], fixed_only=False)}:
            raise InputError("links", f"{sorted(ring)[:5]} in a ring", "links that hang on the base")
        return tree

    def _from(self, link: str, fixed_only: bool) -> Iterator[tuple[str, Frame]]:
        """A link and those behind it, each with its axes as seen from the first one's where all joints stand at zero."""
        waiting = [(link, Frame())]
        while waiting:
            here, frame = waiting.pop()
            yield here, frame
            waiting += [(e.child, frame.then(e.frame)) for e in self.below[here] if e.kind == _FIXED or not fixed_only]

    def held(self, link: str) -> Body:
        """The body of a link and of all that fixed joints hold on it, in its axes."""
        whole = Body(0.0)
        for name, frame in self._from(link, fixed_only=True):
            whole = self.links[name].seen_from(frame).beside(whole)
        return whole

    def leaving(self, link: str) -> list[_Edge]:
        """The moving joints on a link and on all that fixed joints hold on it."""
        return [edge for name, _ in self._from(link, fixed_only=True) for edge in self.below[name] if edge.kind != _FIXED]

    def last(self) -> str:
        """The last link of an arm without branches."""
        here = self.root
        while moving := self.leaving(here):
            if len(moving) > 1:
                self._refuse_branches([edge.name for edge in moving], here)
            here = moving[0].child
        ends = [name for name, _ in self._from(here, fixed_only=True) if not self.below[name]]
        if len(ends) > 1:
            self._refuse_branches(ends, here)
        return ends[0]

    def _refuse_branches(self, names: list[str], link: str) -> NoReturn:
        raise InputError(
            "flange", f'branches {", ".join(sorted(names))} behind link "{link}"', "the name of the link that the tool sits on"
        )

    def chain(self, link: str) -> list[_Edge]:
        """The joints from the base to a link."""
        found: list[_Edge] = []
        while link != self.root:
            found.append(self.above[link])
            link = found[-1].parent
        return found[::-1]


def _arm(
    name: str, links: dict[str, Body], edges: dict[str, _Edge], stiffness: Sequence[float], damping: Sequence[float], flange: str | None
) -> tuple[RobotModel, tuple[str, ...]]:
    tree = _Tree.of(links, edges)
    if flange is not None and flange not in links:
        raise InputError("flange", flange, f"one of {', '.join(links)}")
    chain = tree.chain(tree.last() if flange is None else flange)
    moving = [edge for edge in chain if edge.kind != _FIXED]
    if not moving:
        raise InputError("joints", "none that turns between base and flange", "one or more, revolute or continuous")
    for edge in moving:
        if edge.kind not in _TURNING:
            raise InputError(f'joint "{edge.name}", type', edge.kind, f"{', '.join(_TURNING)} or {_FIXED} between base and flange")
        if edge.follows:
            raise InputError(f'joint "{edge.name}"', "a mimic, which follows another joint", "a joint with a drive of its own")
    springs = [_each(values, what, moving) for values, what in ((stiffness, "stiffness"), (damping, "damping"))]
    frame = Frame()
    joints: list[Joint] = []
    for edge in chain:
        frame = frame.then(edge.frame)
        if edge.kind != _FIXED:
            k = len(joints)
            joints.append(Joint(edge.name, frame, edge.axis, tree.held(edge.child), springs[0][k], springs[1][k], limits=edge.limits))
            frame = Frame()
    model = RobotModel(name, tuple(joints), frame, base_mass=tree.held(tree.root).mass, source="a URDF file; stiffness as told with it")
    lengths = [*(joint.frame.offset for joint in joints[1:]), frame.offset]
    reach = sum(float(np.linalg.norm(each)) for each in lengths)
    if len(joints) > 1 and not _LEAST_REACH <= reach <= _MOST_REACH:
        raise InputError("origins of the joints", f"{reach:g} m in all", f"{_LEAST_REACH:g} to {_MOST_REACH:g} m in all; are these metres?")
    aside = {edge.name for link in (tree.root, *(e.child for e in moving)) for edge in tree.leaving(link)} - {e.name for e in moving}
    said = [f"left out with what they carry, since they do not lead to the flange: {', '.join(sorted(aside))}"] if aside else []
    return model, (*said, *_doubts(model, reach))


def _each(values: Sequence[float], what: str, moving: Sequence[_Edge]) -> Sequence[float]:
    if len(values) not in (1, len(moving)):
        names = ", ".join(edge.name for edge in moving)
        raise InputError(what, f"{len(values)} numbers", f"one for all joints, or {len(moving)}: of {names}")
    return values if len(values) == len(moving) else list(values) * len(moving)


def _doubts(model: RobotModel, reach: float) -> list[str]:
    """What speaks against the masses of a description, in words: many are made for pictures."""
    said = list(model.warnings)
    for joint in model.joints:
        body, place = joint.body, f"link behind {joint.name}"
        if body.mass == 0.0:
            said.append(f"{place}: no mass is told")
            continue
        away, spread = float(np.linalg.norm(body.centre)), float(np.sqrt(max(0.5 * np.trace(body.inertia), 0.0) / body.mass))
        # the last link goes on behind the flange
        if away > 2.0 * reach > 0.0:
            said.append(f"{place}: its centre of mass lies {away:.3g} m from the joint, the whole arm reaches {reach:.3g} m")
        if spread > reach > 0.0:
            said.append(f"{place}: its mass is spread over {spread:.3g} m about its centre, the whole arm reaches {reach:.3g} m")
    bodies = [(j.body.mass, *np.diag(j.body.inertia)) for j in model.joints]
    if len(bodies) > 2 and np.allclose(bodies, bodies[0], rtol=1e-6) and bodies[0][0] > 0.0:
        said.append(f"all links have the same mass of {bodies[0][0]:g} kg and the same moments of inertia: these are placeholders")
    return said
