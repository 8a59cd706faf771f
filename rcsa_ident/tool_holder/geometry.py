"""Tool and holder: materials, segments, insertion. Geometry only, no matrices."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi

from rcsa_ident.base.errors import InputError, non_negative, positive
from rcsa_ident.base.shown import Shown


@dataclass(frozen=True, slots=True)
class Material:
    """An isotropic elastic material.

    `youngs_modulus` [Pa]; `density` [kg/m^3]; `poisson` [-]
    `loss_factor` [-]: hysteretic damping: the modulus is E (1 + i loss_factor)
    """

    youngs_modulus: float
    density: float
    poisson: float
    loss_factor: float = 0.0

    def __post_init__(self) -> None:
        positive("youngs_modulus", self.youngs_modulus, "Pa")
        positive("density", self.density, "kg/m^3")
        non_negative("loss_factor", self.loss_factor)
        if not 0.0 <= non_negative("poisson", self.poisson) < 0.5:
            raise InputError("poisson", self.poisson, "a ratio from 0 to below 0.5")

    @property
    def shear_modulus(self) -> float:
        """Shear modulus G = E / (2 (1 + nu)) [Pa]."""
        return self.youngs_modulus / (2.0 * (1.0 + self.poisson))


#: Materials as the project's nominal toolings use them; a tooling file overrides or adds.
#:
#: Examples
#: --------
#: >>> import rcsa_ident as ri
#: >>> carbide = ri.MATERIALS["carbide"]
#: >>> carbide.youngs_modulus, carbide.density
#: (600000000000.0, 14400.0)
MATERIALS = {
    "carbide": Material(600e9, 14400.0, 0.22, 0.003),
    "steel": Material(205e9, 7850.0, 0.3, 0.003),
    "aluminium": Material(70e9, 2700.0, 0.33, 0.003),
}


@dataclass(frozen=True, slots=True)
class BeamSegment:
    """A cylinder or a cone, solid or hollow.

    Parameters
    ----------
    length : float [m]
    diameter : float [m]
        Outer diameter at the tip's end.
    material : Material
    inner_diameter : float [m], default 0
    end_diameter : float [m], default `diameter`
        Outer diameter at the flange's end: a taper.
    area, second_moment : float or None [m^2], [m^4]
        Area and second moment of the true section of a fluted part, where known; they replace the circle's.

    Examples
    --------
    >>> cone = BeamSegment(0.040, 0.030, MATERIALS["steel"], inner_diameter=0.012, end_diameter=0.050)
    >>> round(cone.part(0.0, 0.020).end, 6)
    0.04
    """

    length: float
    diameter: float
    material: Material
    inner_diameter: float = 0.0
    end_diameter: float | None = None
    area: float | None = None
    second_moment: float | None = None

    def __post_init__(self) -> None:
        positive("length", self.length, "m")
        positive("outer_diameter", self.diameter, "m")
        non_negative("inner_diameter", self.inner_diameter, "m")
        if self.end_diameter is not None:
            positive("end_diameter", self.end_diameter, "m")
        if self.inner_diameter >= min(self.diameter, self.end):
            smallest = min(self.diameter, self.end)
            raise InputError("inner_diameter", f"{self.inner_diameter * 1e3:g} mm", f"below the outer, {smallest * 1e3:g} mm")
        for name in ("area", "second_moment"):
            if getattr(self, name) is not None:
                positive(name, getattr(self, name))
        if (self.area is None) != (self.second_moment is None):
            raise InputError("area and second_moment", f"{self.area} and {self.second_moment}", "both or neither")

    @property
    def end(self) -> float:
        """Outer diameter at the flange's end [m]."""
        return self.diameter if self.end_diameter is None else self.end_diameter

    @property
    def mass(self) -> float:
        """Mass, of a cone as its sections are [kg]."""
        a, b = self.diameter, self.end
        area = pi / 4.0 * ((a * a + a * b + b * b) / 3.0 - self.inner_diameter**2) if self.area is None else self.area
        return self.material.density * area * self.length

    def part(self, start: float, end: float) -> BeamSegment:
        """Return the piece between two distances from the segment's tip end [m]."""
        slope = (self.end - self.diameter) / self.length
        first, last = self.diameter + slope * start, self.diameter + slope * end
        tapered = None if self.end_diameter is None else last
        return BeamSegment(end - start, first, self.material, self.inner_diameter, tapered, self.area, self.second_moment)


@dataclass(frozen=True, slots=True)
class Contact:
    """Distributed joint between tool and holder, per metre of insertion.

    Parameters
    ----------
    translational_stiffness : float [N/m^2]
    rotational_stiffness : float [N]
        Moment per angle and length, N m/rad per m.
    translational_damping : float [N s/m^2]
    rotational_damping : float [N s]

    Examples
    --------
    A shrink fit, 40 mm of it: its springs side by side are a stiffness in N/m.

    >>> import rcsa_ident as ri
    >>> contact = ri.Contact(translational_stiffness=2e10, rotational_stiffness=6e5)
    >>> contact.translational_stiffness * 0.04
    800000000.0
    """

    translational_stiffness: float
    rotational_stiffness: float
    translational_damping: float = 0.0
    rotational_damping: float = 0.0

    def __post_init__(self) -> None:
        positive("translational_stiffness", self.translational_stiffness, "N/m per m")
        for name in ("rotational_stiffness", "translational_damping", "rotational_damping"):
            non_negative(name, getattr(self, name))


@dataclass(frozen=True, slots=True, repr=False)
class ToolAssembly(Shown):
    """A tool clamped in a holder; all segments run from the tip's end to the flange.

    `tool`: the tool's length in use: stickout + insertion (see `clamped`)
    `holder`: from the holder's nose to the flange face
    `insertion` [m]: length of tool inside the holder's bore; 0 is a butt joint
    `contact`: None is a rigid connection over the insertion

    Examples
    --------
    A carbide end mill of 12 mm, 40 mm of it in a holder of 60 mm:

    >>> tool = (BeamSegment(0.030, 0.0096, MATERIALS["carbide"]), BeamSegment(0.070, 0.012, MATERIALS["carbide"]))
    >>> holder = (BeamSegment(0.060, 0.050, MATERIALS["steel"], inner_diameter=0.012),)
    >>> assembly = ToolAssembly(tool, holder, insertion=0.040, contact=Contact(2e10, 1e6))
    >>> round(assembly.stickout, 6)
    0.06
    """

    tool: tuple[BeamSegment, ...]
    holder: tuple[BeamSegment, ...]
    insertion: float
    contact: Contact | None = None

    def __post_init__(self) -> None:
        if not self.tool:
            raise InputError("tool segments", "none", "at least one segment")
        insertion = non_negative("insertion", self.insertion, "m")
        tool, holder = self.tool_length, self.holder_length
        if insertion >= tool:
            raise InputError("insertion", f"{insertion * 1e3:g} mm", f"less than the tool's length, {tool * 1e3:g} mm")
        if insertion > holder + 1e-12:
            raise InputError("insertion", f"{insertion * 1e3:g} mm", f"at most the holder's length, {holder * 1e3:g} mm")

    @property
    def tool_length(self) -> float:
        """Length of tool in use, stickout + insertion [m]."""
        return sum(s.length for s in self.tool)

    @property
    def holder_length(self) -> float:
        """Length from the holder's nose to the flange face [m]."""
        return sum(s.length for s in self.holder)

    @property
    def stickout(self) -> float:
        """Length of tool in front of the holder [m]."""
        return self.tool_length - self.insertion

    def __str__(self) -> str:
        lengths = {"stickout": self.stickout, "insertion": self.insertion, "holder": self.holder_length}
        return ", ".join(f"{name} {1e3 * length:.4g} mm" for name, length in lengths.items())


def clamped(
    tool: tuple[BeamSegment, ...], holder: tuple[BeamSegment, ...], stickout: float, insertion: float, contact: Contact | None
) -> ToolAssembly:
    """Return the assembly with the tool cut to stickout + insertion; a tool that is too short is an error.

    Parameters
    ----------
    tool, holder : tuple of BeamSegment
        From the tip's end to the flange; the tool at its full length.
    stickout, insertion : float [m]
        Length of tool in front of the holder and inside its bore.
    contact : Contact or None
        None is a rigid connection over the insertion.

    Examples
    --------
    A shank of carbide in a holder of steel; of its 100 mm only stickout and insertion are there:

    >>> import rcsa_ident as ri
    >>> shank = ri.BeamSegment(0.1, 0.012, ri.MATERIALS["carbide"])
    >>> holder = ri.BeamSegment(0.06, 0.05, ri.MATERIALS["steel"], inner_diameter=0.012)
    >>> print(ri.clamped((shank,), (holder,), stickout=0.05, insertion=0.04, contact=ri.Contact(2e10, 6e5)))
    stickout 50 mm, insertion 40 mm, holder 60 mm
    """
    wanted = positive("stickout", stickout, "m") + non_negative("insertion", insertion, "m")
    length = sum(s.length for s in tool)
    if wanted > length + 1e-9:
        raise InputError(
            "stickout + insertion", f"{wanted * 1e3:g} mm", f"at most the tool's length, {length * 1e3:g} mm (the sum of its segments)"
        )
    used, _ = _cut(tool, wanted)
    return ToolAssembly(used, holder, insertion, contact)


def behind(tool: tuple[BeamSegment, ...], assembly: ToolAssembly) -> tuple[BeamSegment, ...]:
    """Return what a tool at its full length has behind that which an assembly of it uses."""
    return _cut(tool, assembly.tool_length)[1]


def _cut(tool: tuple[BeamSegment, ...], length: float) -> tuple[tuple[BeamSegment, ...], tuple[BeamSegment, ...]]:
    """A tool in front of a place and behind it."""
    front: list[BeamSegment] = []
    rear: list[BeamSegment] = []
    left = length
    for segment in tool:
        if left <= 1e-9:
            rear.append(segment)
        elif segment.length <= left + 1e-9:
            front.append(segment)
        else:
            front.append(segment.part(0.0, left))
            rear.append(segment.part(left, segment.length))
        left -= segment.length
    return tuple(front), tuple(rear)


def stiffened(assembly: ToolAssembly, share: float) -> ToolAssembly:
    """Return the assembly with all moduli and its contact stiffer by a share [-]: natural frequencies rise by half of it."""

    def segments(old: tuple[BeamSegment, ...]) -> tuple[BeamSegment, ...]:
        materials = [replace(s.material, youngs_modulus=s.material.youngs_modulus * (1.0 + share)) for s in old]
        return tuple(replace(s, material=m) for s, m in zip(old, materials, strict=True))

    contact = assembly.contact
    if contact is not None:
        translational, rotational = contact.translational_stiffness, contact.rotational_stiffness
        contact = replace(contact, translational_stiffness=translational * (1.0 + share), rotational_stiffness=rotational * (1.0 + share))
    return replace(assembly, tool=segments(assembly.tool), holder=segments(assembly.holder), contact=contact)
