"""The answer of an identification with its file: what `identify` returns, and `read_result` reads back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

from rcsa_ident.base.shown import Drawn
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.modal import ModalModel
from rcsa_ident.identification.machine import IdentifiedMachine
from rcsa_ident.identification.result import Identification, in_words
from rcsa_ident.identification.status import Status
from rcsa_ident.io.results.drawings import learned_of
from rcsa_ident.io.results.identifications import identification_to_json, machine_from_json
from rcsa_ident.setup.campaign import Campaign
from rcsa_ident.signals.measurement import Reading
from rcsa_ident.tool_holder.learnt import LearnedValue
from rcsa_ident.workflows.identify import left_out, mode_deviations


@dataclass(frozen=True, eq=False, repr=False)
class Result(Drawn):
    """An identification, as RESULT.json holds it.

    Parameters
    ----------
    data : mapping
        The file's content.
    where : str
        The file, for messages.
    identification : Identification or None
        With its measured lines, its search and its delays; None where the result was read from a file.
    campaign : Campaign or None
        That was identified, where it is at hand.
    readings : tuple of Reading
        Of every cut of the campaign, with the verdicts.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> found = ri.read_result("RESULT.json")
    >>> print(found)  # doctest: +ELLIPSIS
    converged, 24 cuts, X ... modes, Y ... modes
    >>> print(found.modes[ri.Dof.X])  # doctest: +ELLIPSIS
    flange.x, flange.x': ... modes at 19..., 99... Hz
    >>> len(found.left_out)
    0
    """

    data: Mapping[str, Any]
    where: str = "result"
    identification: Identification | None = None
    campaign: Campaign | None = None
    readings: tuple[Reading, ...] = ()

    @classmethod
    def of(cls, found: Identification, campaign: Campaign, readings: Sequence[Reading]) -> Self:
        """Return the result of an identification."""
        data = identification_to_json(found, campaign, left_out(readings), mode_deviations(found))
        return cls(data, identification=found, campaign=campaign, readings=tuple(readings))

    @property
    def status(self) -> Status:
        """May the answer be used?"""
        return Status(self.data["status"])

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why it is not simply converged."""
        return tuple(self.data["reasons"])

    @property
    def notes(self) -> tuple[str, ...]:
        """What the data cannot tell, and what was done about single cuts."""
        return tuple(self.data.get("notes", ()))

    @property
    def left_out(self) -> dict[str, str]:
        """Cuts that were not used, each with the reason."""
        return {cut["id"]: cut["reason"] for cut in self.data["campaign"]["cuts_left_out"]}

    @property
    def learned(self) -> tuple[LearnedValue, ...]:
        """Numbers of the toolings' drawings before and after the cuts, where drawings are not exact."""
        return learned_of(self.data.get("toolings", {}))

    @cached_property
    def machine(self) -> IdentifiedMachine:
        """The machine that was found: it takes any tooling.

        Raises
        ------
        InputError
            If the identification has failed: there is none.
        """
        return machine_from_json(self.data, self.where) if self.identification is None else self.identification.machine

    @property
    def modes(self) -> dict[Dof, ModalModel]:
        """Modes of machine and spindle at the flange, axis by axis."""
        return {axis: part.spindle.modes for axis, part in self.machine.identified.items()}

    def __str__(self) -> str:
        modes = {axis: len(part["modes"]) for axis, part in self.data["axes"].items()}
        return in_words(self.status, self.data["campaign"]["cuts_used"], modes, self.reasons)
