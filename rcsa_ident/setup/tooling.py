"""A cutter, with the tool and holder that carry it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.plausibility import remarks_of
from rcsa_ident.base.remarks import Remark
from rcsa_ident.base.shown import Saved
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.tool_holder.catalogue import assumption, stated
from rcsa_ident.tool_holder.drawings import Drawing
from rcsa_ident.tool_holder.geometry import BeamSegment, ToolAssembly
from rcsa_ident.tool_holder.proportions import proportions
from rcsa_ident.tool_holder.spread import UNSTATED, Spread


@dataclass(frozen=True, slots=True, repr=False)
class Tooling(Saved):
    """A cutter, with the tool and holder that carry it.

    Parameters
    ----------
    name : str
    cutter : Cutter
    assembly : ToolAssembly
        As drawn.
    spread : Spread
        How well the drawing is known; by default it counts as exact, and a remark names a contact that only the catalogue assumes.
    tool_model, holder_model : str
        Tools of the same model share what is not known of them, wherever they are clamped; holders of the same model (and bore) share
        their contact. Empty where nothing is shared.
    taper : str
        What the holder has behind its flange, one of `rcsa_ident.tool_holder.taper.tapers()`; empty where it is not told. It joins the
        spindle there, and is part of what hangs on a string.
    tool_behind : tuple of BeamSegment
        What the tool has behind the insertion, from there to its rear end: of no account in the holder, part of the bare tool.

    Raises
    ------
    InputError
        If something about them is impossible, each taken for itself or all together.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> tool = ri.sample_tooling("S3-PG25-long")
    >>> print(tool)
    S3-PG25-long: 4 teeth, Ø12 mm, helix 30°, stickout 65.9 mm, insertion 44 mm, holder 100 mm
    >>> tool.cutter.teeth, round(1e3 * tool.assembly.stickout, 1)
    (4, 65.9)
    """

    name: str
    cutter: Cutter
    assembly: ToolAssembly
    spread: Spread = UNSTATED
    tool_model: str = ""
    holder_model: str = ""
    taper: str = ""
    tool_behind: tuple[BeamSegment, ...] = ()

    def __post_init__(self) -> None:
        proportions(self.assembly, self.cutter)

    @property
    def drawing(self) -> Drawing:
        """What its drawing says, and how well that is known."""
        return Drawing(self.assembly, self.spread, self.tool_model, self.holder_model)

    @property
    def whole_tool(self) -> tuple[BeamSegment, ...]:
        """The tool from its tip to its rear end, as it lies in the drawer."""
        return (*self.assembly.tool, *self.tool_behind)

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """What is unusual about it, as a wrong unit would make it, and what is assumed of it without a word on how well."""
        assumed = assumption(self.assembly, self.spread)
        return (*proportions(self.assembly, self.cutter), *(() if assumed is None else (assumed,)))

    def stated(self, parameter: str) -> str:
        """Return what a parameter of the drawing is and how well it is known, as in ``stickout, whose standard deviation is 0.05 mm``.

        Parameters
        ----------
        parameter : str
            Field of an `Alteration`, `IDENTIFIED` in front where records have told of it.
        """
        return stated(parameter, self.assembly.contact, self.spread)

    def __str__(self) -> str:
        return f"{self.name}: {self.cutter}, {self.assembly}"


class BareCutter(Tooling):
    """A cutter alone, where the tip of the tool that carries it is known by itself: from modes, tap tests or labelled cuts.

    Whoever asks for the tool and its holder is told that there are none.
    """

    def __init__(self, name: str, cutter: Cutter) -> None:
        fields: dict[str, Any] = {"name": name, "cutter": cutter, "spread": UNSTATED, "tool_model": "", "holder_model": ""}
        for field_name, value in fields.items():
            object.__setattr__(self, field_name, value)
        tuple(remarks_of(cutter.values))  # an impossible one is refused

    def __reduce__(self) -> tuple[type[BareCutter], tuple[str, Cutter]]:
        """Pickle without the assembly that it has not."""
        return type(self), (self.name, self.cutter)

    @property
    def assembly(self) -> ToolAssembly:
        """Nothing, and a sentence that says so."""
        raise InputError(
            f"tooling {self.name}", "[cutter] alone", "tables [tool] and [holder], too: only modes or FRFs of the tip need neither"
        )

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """What is unusual about the cutter."""
        return tuple(remarks_of(self.cutter.values))

    def __str__(self) -> str:
        return f"{self.name}: {self.cutter}"
