"""How well a drawing is known: standard deviations of what it says of tool, holder, contact and clamping."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace

from rcsa_ident.base.errors import InputError, non_negative


@dataclass(frozen=True, slots=True)
class Spread:
    """Standard deviations of what a drawing tells; 0 is exact, and the defaults are what an honest drawing is good for.

    Shares are standard deviations of logarithms. A fluted diameter that is told by its area and second moment scales the former by its
    square and the latter by its fourth power.

    `stickout` [m]: a presetter's; 0.3 mm with a ruler
    `fluted_diameter` [-]: equivalent diameter of the fluted part
    `youngs_modulus` [-]: of the tool
    `contact_stiffness`, `contact_damping` [-]: between tool and holder, translational and rotational each
    `holder_diameter` [-]: outer diameters of the holder
    `reclamping` [-]: of the contact in each clamping, beside what its model shares
    `spindle_joint` [-]: of the joint in front of the flange, in each clamping
    `segment_length` [m]
    `corner_radius` [m]: of the cutting edge; a flat end mill's corners are usually broken
    `stated`: whether somebody said so: a drawing of which nothing is said counts as exact, too, but nobody vouches for it

    Examples
    --------
    >>> Spread().exact, EXACT.exact
    (False, True)
    """

    stickout: float = 0.05e-3
    fluted_diameter: float = 0.03
    youngs_modulus: float = 0.02
    contact_stiffness: float = 0.4
    contact_damping: float = 1.0
    holder_diameter: float = 0.005
    reclamping: float = 0.1
    spindle_joint: float = 0.05
    segment_length: float = 0.05e-3
    corner_radius: float = 0.1e-3
    stated: bool = field(default=True, compare=False, repr=False)

    def __post_init__(self) -> None:
        for name in SPREAD_FIELDS:
            value = non_negative(name, getattr(self, name))
            length = name in LENGTHS
            most = LARGEST_LENGTH if length else LARGEST_SHARE
            if value > most:
                raise InputError(name, value, f"at most {most:g}" + (" [m]" if length else ", a share"))

    @property
    def exact(self) -> bool:
        """Whether everything is exactly as drawn."""
        return not any(getattr(self, name) for name in SPREAD_FIELDS)


SPREAD_FIELDS = tuple(each.name for each in fields(Spread) if each.compare)
#: In front of the name of a parameter that records have told of.
IDENTIFIED = "identified "
#: Those that are lengths [m]; the others are shares.
LENGTHS = ("stickout", "segment_length", "corner_radius")
#: Largest standard deviations that anybody may believe in.
LARGEST_LENGTH, LARGEST_SHARE = 5e-3, 3.0
#: Everything as drawn, and the same where nobody has said how well the drawing is known.
EXACT = replace(Spread(), **dict.fromkeys(SPREAD_FIELDS, 0.0))  # type: ignore[arg-type]
UNSTATED = replace(EXACT, stated=False)
