"""What a query names, as the store has it: machines, toolings, campaigns and their recordings; 404 where one is not there."""

from __future__ import annotations

import functools
import json
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from api.components import Components
from api.conventions import found_or_404
from api.problems import Problem
from api.reading.campaign_text import campaign_of_text
from api.reading.example_campaign import example_id
from api.reading.reader_tasks import recording_and_air
from api.reading.stored import found_of, samples_of
from api.schemas.robots import Posed, RobotKeys
from api.schemas.tips import TappedTip
from api.schemas.toolings import ToolingKeys
from api.stores.campaigns import Campaign, Recording
from api.stores.entities import Document, Machine, digest_of, summary_of
from api.work.forces import ReadPair
from api.work.requests import MachineText, ToolingSource
from api.work.robots import parsed, posed_text
from api.work.tips import tapped_text
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.sample_files import sample_robots
from rcsa_ident.signals.recording import Sensor


def known_machine(components: Components, group: str, id: str) -> MachineText:
    """Return the identification of a machine that one can compute with."""
    document = identification_of(components, group, id)
    if not summary_of(document)["axes"]:
        raise InputError("machine", "an identification that has failed", "a machine with an identification of axis X, Y or both")
    return MachineText(document.digest, document.text)


def machine_of(components: Components, group: str, id: str) -> Machine:
    """Return a machine of a group."""
    return found_or_404(components.store.machines.get(group, id), "machine")


def identification_of(components: Components, group: str, id: str) -> Document:
    """Return the identification of a machine, as it was written."""
    machine_of(components, group, id)
    return found_or_404(components.store.identifications.get(group, id), "identification of the machine")


def robot_text(components: Components, group: str, name: str) -> str:
    """Return ROBOT.toml of a robot that is kept, else of a published one."""
    if (kept := components.store.robots.get(group, name)) is not None:
        return kept.text
    return found_or_404(sample_robots().get(name), f"robot {name}").read_text(encoding="utf-8")


def posed_robot(components: Components, group: str, asked: Posed) -> MachineText:
    """Return a robot at a posture: one that is kept, else a published one, or as it came."""
    if isinstance(asked.robot, RobotKeys):
        keys = asked.robot.model_dump(exclude_unset=True, exclude_none=True)
    else:
        keys = parsed(robot_text(components, group, asked.robot))
    text = posed_text(keys, asked.posture_deg, asked.joints_only)
    return MachineText(digest_of(text), text)


def tip_source(
    components: Components, group: str, machine: str | None, robot: Posed | None, tip: TappedTip | None = None
) -> tuple[MachineText, str]:
    """Return what a tooling is asked on, a machine, a robot at a posture or its tapped tip, and what the answer calls it."""
    given = [name for name, value in (("machine", machine), ("robot", robot), ("tip", tip)) if value is not None]
    if len(given) != 1:
        found = f"given beside {given[1]}" if given else "nothing"
        allowed = "a machine, or a robot at a posture; FRFs, lobes and advice are told of a tapped tip, too"
        raise InputError(given[0] if given else "machine", found, allowed)
    if tip is not None:
        text = tapped_text(tip.keys())
        return MachineText(digest_of(text), text), "tip"
    if robot is not None:
        name = robot.robot if isinstance(robot.robot, str) else robot.robot.robot.name
        return posed_robot(components, group, robot), name
    assert machine is not None
    return known_machine(components, group, machine), machine


def tooling_source(components: Components, group: str, tooling: str | ToolingKeys, number: int = 1) -> ToolingSource:
    """Return a tooling from the library, or as it came; without a name it has a number."""
    if isinstance(tooling, ToolingKeys):
        return ToolingSource(tooling.name or f"tooling {number}", keys=tooling.model_dump(exclude_unset=True, exclude_none=True))
    document = components.store.toolings.get(group, tooling)
    if document is None:
        raise Problem(404, f"there is no tooling {tooling}")
    return ToolingSource(tooling, document.text)


def asked_toolings(
    components: Components, group: str, toolings: Sequence[str | ToolingKeys], tip: TappedTip | None, field: str
) -> list[ToolingSource]:
    """Return the toolings of a field of a query, or the cutter of a tip in their place."""
    if tip is not None and len(toolings) + (tip.cutter is not None) != 1:
        beside = "" if tip.cutter is None else " beside tip.cutter"
        raise InputError(field, f"{len(toolings)} of them{beside}", "the one that was tapped, or in its place tip.cutter")
    if tip is not None and tip.cutter is not None:
        return [ToolingSource(tip.name, keys={"cutter": tip.cutter.model_dump(exclude_unset=True, exclude_none=True)})]
    if not toolings:
        raise InputError(field, "nothing", "a tooling, by its name in the library or as it is")
    return [tooling_source(components, group, tooling, i + 1) for i, tooling in enumerate(toolings)]


def known_campaign(components: Components, group: str, id: str) -> Campaign:
    """Return a campaign of a group."""
    return found_or_404(components.store.campaigns.get(group, id), "campaign")


def own_campaign(components: Components, group: str, id: str) -> Campaign:
    """Return a campaign of a group that takes recordings: the example takes those of the virtual machine alone."""
    campaign = known_campaign(components, group, id)
    refuse_example("campaign", id, group)
    return campaign


def refuse_example(field: str, id: str, group: str) -> None:
    """Answer 409 where something is to be put into the example, with which it would be deleted."""
    if id == example_id(group):
        fault = {"field": field, "found": "the example", "allowed": f"a {field} of your own"}
        raise Problem(409, f"the example {field} takes no data of your own: they would be deleted with it", [fault])


@dataclass(frozen=True, slots=True)
class Uploaded:
    """A cut's recording in a campaign, with what the campaign says of it; speed in rad/s."""

    machine: str
    tooling: ToolingSource
    cut: Path
    air: Path | None
    sensors: tuple[Sensor, ...]
    rate: float
    speed: float


def uploaded(components: Components, group: str, campaign: str, recording: str) -> Uploaded:
    """Return a cut's recording that was uploaded; its air cut is the campaign's, where it is there."""
    row = known_campaign(components, group, campaign)
    name = unicodedata.normalize("NFC", recording)
    declared = campaign_of_text(row.text)
    cut = next((each for each in declared.cuts if each.recording == Path(name)), None)
    if cut is None:
        raise Problem(404, f"the campaign has no cut with a recording {recording}")
    if cut.last_speed is not None:
        raise InputError("recording", "a pass whose speed changes", "a recording at one speed: the forces' observer takes one")
    kept = _kept(components, group, campaign, name)
    found = found_of(kept)
    air = None if cut.air is None else components.store.recordings.get(group, campaign, cut.air.name)
    tooling = ToolingSource(cut.tooling, json.loads(row.text)["toolings"][cut.tooling])
    sensors = channels_of(found["channels"], declared.sensors)
    still = None if air is None else samples_of(components.files, air)
    path = samples_of(components.files, kept)
    return Uploaded(row.machine, tooling, path, still, sensors, found["sampling_rate_hz"], cut.conditions.spindle_speed)


def air_cut(components: Components, group: str, campaign: str, recording: str) -> ReadPair:
    """Return what reads an uploaded recording alone."""
    kept = _kept(components, group, campaign, unicodedata.normalize("NFC", recording))
    return pair_reader(samples_of(components.files, kept), None)


def _kept(components: Components, group: str, campaign: str, name: str) -> Recording:
    return found_or_404(components.store.recordings.get(group, campaign, name), "recording")


def pair_reader(cut: Path, air: Path | None) -> ReadPair:
    """Return what reads a recording and its air cut in a worker."""
    return functools.partial(recording_and_air, cut, air)


def channels_of(names: Sequence[str], sensors: tuple[Sensor, ...]) -> tuple[Sensor, ...]:
    """Return the sensors of channels, in their order."""
    known = {sensor.name: sensor for sensor in sensors}
    if len(set(names)) < len(names):
        raise InputError("channels", list(names), "each channel once")
    for name in names:
        if name not in known:
            raise InputError("channels", name, f"some of {', '.join(known)}")
    found = tuple(known[name] for name in names)
    kinds = [(sensor.quantity, sensor.axis) for sensor in found]
    if len(set(kinds)) < len(kinds):
        raise InputError("channels", list(names), "at most one channel for each quantity and axis")
    return found
