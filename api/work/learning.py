"""What further cuts teach of toolings, in a worker: from stored samples to the toolings and the machine that they teach."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from api.work import tasks
from api.work.machine_cache import is_result, parsed
from api.work.requests import MachineText
from api.work.toolings import keys_of
from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.io.results.identifications import machine_from_json
from rcsa_ident.io.results.parts import layout, plain
from rcsa_ident.io.results.updated_results import taught_result
from rcsa_ident.setup.campaign import Campaign, HammerTest
from rcsa_ident.setup.cut import Cut
from rcsa_ident.signals.recording import Recording

ReadCut = Callable[[Cut], tuple[Recording, Recording | None]]
ReadTest = Callable[[HammerTest], tuple[FloatArray, ComplexArray]]


def learn(
    machine: MachineText, campaign: Campaign, read: ReadCut, read_test: ReadTest, teacher: str, teach: bool = False
) -> dict[str, Any]:
    """Return what the cuts and taps of a campaign teach of toolings that are new to a machine.

    `campaign`: with the cuts and hammer tests whose recordings are there
    `teacher`: what the machine remembers of the campaign
    `teach`: whether the machine that the cuts teach is wanted, too: text and summary of its identification in `taught`; None where
        something speaks against what was learned
    Raises `InputError`: a measured flange, a campaign that has taught this machine already, or as `learn_toolings`.
    """
    from rcsa_ident.workflows.identify import hammer_lines, judge, left_out
    from rcsa_ident.workflows.learn_toolings import learn_toolings, learnt_row

    if not is_result(machine.text):
        raise InputError("machine", "a measured flange", "a machine with an identification by the default method")
    data = parsed(machine.text)
    if teacher in data.get("taught_by", []):
        raise InputError("campaign", "cuts that have taught this machine already", "a campaign of further cuts: these would count twice")
    known = machine_from_json(data, "")
    readings = judge(campaign, read)
    found = learn_toolings(known, campaign, readings, hammer_lines(campaign, read_test))
    row = learnt_row(found)
    for name, each, told in zip(found.keys, found.toolings, row["toolings"], strict=True):
        told |= {"name": name, "tooling": None if each.contradiction else keys_of(each.tooling)}
    text = layout(plain(taught_result(data, found.machine, teacher))) + "\n" if teach and found.good else None
    return row | {
        "left_out": [{"cut": cut, "reason": reason} for cut, reason in left_out(readings)],
        "warnings": list(known.remarks),
        "taught": None if text is None else {"text": text, "summary": tasks.check(text)},
    }
