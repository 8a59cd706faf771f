"""Toolings and campaigns: TOML files in the machinist's units become nouns in SI."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.plausibility import STICKOUT
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.io.settings.cuts import CUT_KEYS, cut_of
from rcsa_ident.io.settings.cutters import CUTTER_KEYS, cutter_of
from rcsa_ident.io.settings.hammer_tests import HAMMER_TEST_KEYS, hammer_test_of
from rcsa_ident.io.settings.workpieces import WORKPIECE_KEYS, workpiece_of
from rcsa_ident.io.toml_text import read_toml
from rcsa_ident.io.validated_table import Table, describe
from rcsa_ident.setup.campaign import Campaign
from rcsa_ident.setup.fields import CAMPAIGN, CONTACT, MATERIAL, SEGMENT, SENSOR, SPREAD, keys_of, keys_told, told_in_si
from rcsa_ident.setup.tooling import BareCutter, Tooling
from rcsa_ident.signals.motion import measured_axes, motion_channels, workpiece_channels
from rcsa_ident.signals.recording import CAMPAIGN_QUANTITIES, Quantity, Role, Sensor
from rcsa_ident.tool_holder.catalogue import assumed_contact
from rcsa_ident.tool_holder.geometry import MATERIALS, BeamSegment, Contact, Material, behind, clamped
from rcsa_ident.tool_holder.spread import EXACT, UNSTATED, Spread
from rcsa_ident.tool_holder.taper import tapers

CAMPAIGN_FILE = "campaign.toml"

_TOOLING = ("name", "cutter", "tool", "holder", "contact", "materials", "spread")
_CAMPAIGN = ("campaign", "sensors", "workpiece", "toolings", "cuts", "frfs")
_TRIGGER = ("quantity", "sensitivity", "delay_s", "bandwidth_hz", "pulses_per_revolution", "tooth_angle_deg")
#: All others than those that only a trigger has.
_FEELS = tuple(each for each in SENSOR if each.key not in _TRIGGER[-2:])


def read_tooling(path: str | Path, tip_known: bool = False) -> Tooling:
    """Return a cutter with the tool and holder that carry it, the tool cut to stickout + insertion.

    Parameters
    ----------
    path : path
    tip_known : bool
        Where modes or FRFs of the tip are given a file may hold its ``[cutter]`` alone: neither ``[tool]`` nor ``[holder]``.

    Raises
    ------
    InputError
        Names the file, the key, what was found and what is allowed.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> print(ri.read_tooling("data/machines/toolings/S3-PG25-long.toml"))
    S3-PG25-long: 4 teeth, Ø12 mm, helix 30°, stickout 65.9 mm, insertion 44 mm, holder 100 mm
    """
    return tooling_of(read_toml(path, "tooling"), str(path), Path(path).stem, tip_known)


def tooling_of(data: Mapping[str, Any], where: str, name: str, tip_known: bool = False) -> Tooling:
    """Return the tooling of a table of keys as `read_tooling` finds it in a file; `name` counts where the table has none.

    `data`: the table's keys
    `where`: the file, for the messages
    `name`: counts where the table has none
    `tip_known`: as of `read_tooling`
    """
    top = Table(data, where, known=_TOOLING)
    if tip_known and "tool" not in data and "holder" not in data:
        return BareCutter(top.text("name", name), cutter_of(top.table("cutter", CUTTER_KEYS)))
    materials = material_library(top)
    tool = top.table("tool", ("stickout_mm", "segments", "model"))
    holder = top.table("holder", ("insertion_mm", "segments", "model", "taper"))
    name = top.text("name", name)
    cutter = cutter_of(top.table("cutter", CUTTER_KEYS))
    pieces = beam_segments(tool, materials)
    stickout = tool.quantity("stickout_mm", STICKOUT) * 1e-3
    insertion = holder.number("insertion_mm", "mm", least=0.0, most=5000.0) * 1e-3
    carriers = beam_segments(holder, materials)
    # beside a tip that is known by itself nothing hangs on the drawing
    silent = EXACT if tip_known else UNSTATED
    contact = contact_of(top.table("contact", keys_of(CONTACT))) if "contact" in top else None
    with top.naming({"stickout + insertion": "tool.stickout_mm + holder.insertion_mm", "insertion": "holder.insertion_mm"}):
        assembly = clamped(pieces, carriers, stickout, insertion, contact)
        return Tooling(
            name,
            cutter,
            assembly,
            spread_of(top.table("spread", keys_of(SPREAD)), contact) if "spread" in top else silent,
            tool.text("model", ""),
            holder.text("model", ""),
            holder.text("taper", "", choices=tapers()),
            behind(pieces, assembly),
        )


def spread_of(table: Table, contact: Contact | None = None) -> Spread:
    """Return how well a drawing is known; what the table leaves out is what an honest drawing, or the catalogue's contact, is good for."""
    assumed = assumed_contact(contact)
    honest = Spread() if assumed is None else assumed.spread
    return Spread(**told_in_si(SPREAD, table.fields(SPREAD, keys_told(SPREAD, honest))))


def material_library(top: Table) -> dict[str, Material]:
    """The built-in library, and the file's own over it; a known material may change single values."""
    materials = dict(MATERIALS)
    for name, table in top.named_tables("materials", keys_of(MATERIAL), {}).items():
        known = keys_told(MATERIAL, MATERIALS[name]) if name in MATERIALS else {}
        materials[name] = Material(**told_in_si(MATERIAL, table.fields(MATERIAL, known)))
    return materials


def beam_segments(body: Table, materials: Mapping[str, Material]) -> tuple[BeamSegment, ...]:
    return tuple(_segment(table, materials) for table in body.tables("segments", keys_of(SEGMENT)))


def _segment(table: Table, materials: Mapping[str, Material]) -> BeamSegment:
    told = table.fields(SEGMENT[:4])
    material = materials[table.text("material", choices=tuple(materials), names_of="materials")]
    diameters = told["outer_diameter_mm"], told["end_diameter_mm"] or told["outer_diameter_mm"]
    smallest, largest = min(diameters), max(diameters)
    if told["inner_diameter_mm"] >= smallest:
        table.refuse("inner_diameter_mm", f"{told['inner_diameter_mm']:g}", f"below the outer diameter, {smallest:g} [mm]")
    # a true section lies inside the circle around it
    circle = np.pi / 4.0 * largest**2, np.pi / 64.0 * largest**4
    section = table.fields(each.up_to(most) for each, most in zip(SEGMENT[5:], circle, strict=True))
    missing = [key for key, value in section.items() if value is None]
    if len(missing) == 1:
        table.refuse(missing[0], "nothing", "given together with the other: area_mm2 and second_moment_mm4, or neither")
    return BeamSegment(material=material, **told_in_si(SEGMENT, told | section))


def contact_of(table: Table) -> Contact:
    return Contact(**told_in_si(CONTACT, table.fields(CONTACT)))


def read_campaign(folder: str | Path) -> Campaign:
    """Return what was on the machine, with every tooling read and every recording's file found.

    Parameters
    ----------
    folder : path
        Holds ``campaign.toml``; every path in it is relative to the folder and stays inside it.

    Raises
    ------
    InputError
        Names the file, the key, what was found and what is allowed.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> campaign = ri.read_campaign("data/sample_runs")
    >>> print(campaign)
    HPM sample machine: 80 cuts with S1-ER32, S2-PG25, 8000 to 20000 rev/min, EN AW-6082
    >>> sorted(campaign.toolings)
    ['S1-ER32', 'S2-PG25']
    """
    folder = Path(folder)
    path = folder / CAMPAIGN_FILE
    if not folder.is_dir():
        raise InputError("campaign", "no such folder" if not folder.exists() else "a file", f"a folder with {CAMPAIGN_FILE}", str(folder))
    return campaign_of(
        read_toml(path, "campaign"),
        str(path),
        folder.resolve().name,
        lambda paths, key: read_tooling(_inside(folder, paths, key)),
        lambda table, key: _inside(folder, table, key),
    )


def tooling_file_names(folder: str | Path) -> dict[str, str]:
    """Return the file name of each tooling of a campaign's folder that `read_campaign` reads, by the campaign's key."""
    path = Path(folder) / CAMPAIGN_FILE
    paths = Table(read_toml(path, "campaign"), str(path)).table("toolings")
    return {key: _inside(Path(folder), paths, key).name for key in paths.data}


def campaign_of(
    data: Mapping[str, Any], where: str, name: str, tooling: Callable[[Table, str], Tooling], locate: Callable[[Table, str], Path]
) -> Campaign:
    """Return the campaign of a table of keys as `read_campaign` finds it in a file.

    `data`: the table's keys
    `where`: the file, for the messages
    `name`: counts where the table has none
    `tooling`: given the table ``[toolings]`` and one of its keys, returns that tooling
    `locate`: given the table of a cut and its key ``cut`` or ``air``, or that of a hammer test and ``file``, returns the file
    """
    top = Table(data, where, known=_CAMPAIGN)
    head = top.table("campaign", keys_of(CAMPAIGN), {})
    own = told_in_si(CAMPAIGN, head.fields(CAMPAIGN, {"name": name}))
    # hammer tests alone need neither sensors nor a workpiece
    alone = "frfs" in top and "cuts" not in top
    channels = top.table("sensors", None, {})
    sensors = tuple(sensor_of(key, channels.data[key], where) for key in channels)
    if not sensors and not alone:
        top.refuse("sensors", "none", "at least one table [sensors.<channel>], where there are cuts")
    _check_roles(sensors, top)
    if "workpiece" not in top and not alone:
        top.refuse("workpiece", "nothing", "a table [workpiece], where there are cuts")
    workpiece = workpiece_of(top.table("workpiece", WORKPIECE_KEYS)) if "workpiece" in top else None
    named = top.table("toolings")
    if not named.data:
        top.refuse("toolings", "none", "at least one tooling by its name")
    toolings = {key: tooling(named, key) for key in named}
    if "cuts" not in top and not alone:
        top.refuse("cuts", "nothing", "tables [[cuts]], hammer tests [[frfs]], or both")
    cuts = tuple(cut_of(table, toolings, locate) for table in top.tables("cuts", CUT_KEYS)) if "cuts" in top else ()
    if len({cut.started.tzinfo is None for cut in cuts if cut.started is not None}) > 1:
        top.refuse("cuts", "`started` with a time zone and without one", "a time zone in each, or in none")
    tests = tuple(hammer_test_of(table, toolings, locate) for table in top.tables("frfs", HAMMER_TEST_KEYS)) if "frfs" in top else ()
    seen: dict[str, str] = {}
    for place, id in [*((f"cuts[{i}]", cut.id) for i, cut in enumerate(cuts)), *((f"frfs[{i}]", test.id) for i, test in enumerate(tests))]:
        if id in seen:
            raise InputError(f"{place}.id", f'"{id}", the id of {seen[id]}', "an id of its own", where)
        seen[id] = place
    return Campaign(**{"sampling_rate": None} | own, sensors=sensors, workpiece=workpiece, toolings=toolings, cuts=cuts, tests=tests)


def _check_roles(sensors: Sequence[Sensor], top: Table) -> None:
    """Refuse accelerometers of one axis beside its displacement sensor that do not say what they are fixed to, and sensors that are turned
    out of the machine's axes where nothing turns them back."""
    shown = {sensor.axis for sensor in sensors if sensor.quantity is Quantity.DISPLACEMENT}
    for axis in (Dof.X, Dof.Y):
        felt = [sensor for sensor in sensors if sensor.quantity is Quantity.ACCELERATION and sensor.axis is axis]
        silent = [sensor.name for sensor in felt if sensor.role is None]
        if axis in shown and len(felt) > 1 and silent:
            allowed = f"one of {', '.join(Role)}, where an axis has several accelerometers beside its displacement sensor"
            top.refuse(f"sensors.{silent[0]}.role", "nothing", allowed)
    with top.naming({}):
        if axes := measured_axes(sensors):
            motion_channels(sensors, axes)
        workpiece_channels(sensors)


def sensor_of(name: str, data: Any, where: str) -> Sensor:
    """Return the sensor of one table, whose key is the channel's name; also a result file carries such tables.

    `name`: the channel's
    `data`: mapping, the table's keys
    `where`: the file, for the messages
    """
    kind = Table(data, where, f"sensors.{name}", sorted(keys_of(SENSOR)))
    quantity = Quantity(kind.text("quantity", choices=CAMPAIGN_QUANTITIES))
    trigger = quantity is Quantity.TRIGGER
    fields = [each for each in SENSOR if each.key in _TRIGGER] if trigger else [each for each in _FEELS if each.key != "axis"]
    table = Table(data, where, f"sensors.{name}", _TRIGGER if trigger else keys_of(_FEELS))
    told = table.fields(fields, {"sensitivity": 1.0} if trigger else None)
    if told["sensitivity"] == 0.0:
        table.refuse("sensitivity", "0", "a number other than 0 [V/m, V/(m/s^2), V/N], 1.0 where the file is in SI")
    for key in ("distance_behind_flange_mm", "distance_spread_mm"):
        if key in table and quantity is not Quantity.DISPLACEMENT:
            table.refuse(key, describe(table.data[key]), f"none of a {quantity} sensor")
    axis = {} if trigger else {"axis": table.text("axis", choices=("X", "Y", "Z") if quantity is Quantity.FORCE else ("X", "Y"))}
    return sensor_of_keys(name, told | axis)


def sensor_of_keys(name: str, keys: Mapping[str, Any]) -> Sensor:
    """Return the sensor of a channel of keys that are held to their limits."""
    nouns: dict[str, Callable[[Any], Any]] = {"quantity": Quantity, "axis": lambda axis: Dof(axis.lower()), "role": Role}
    return Sensor(name, **{field: nouns.get(field, lambda value: value)(value) for field, value in told_in_si(SENSOR, keys).items()})


def _inside(folder: Path, table: Table, key: str) -> Path:
    """The file that a key names; neither its path nor a link on its way leads out of the campaign's folder."""
    allowed = "a path inside the campaign's folder"
    text = table.text(key, allowed=allowed)
    relative = PurePosixPath(text)
    odd = any(sign in text for sign in ("\\", "\0", ":"))
    if odd or relative.is_absolute() or ".." in relative.parts or not relative.parts:
        table.refuse(key, repr(text), f"{allowed}, relative to it, with / and without ..")
    path = folder / relative
    try:
        inside = path.resolve().is_relative_to(folder.resolve())
        exists = path.is_file()
    except (OSError, RuntimeError, ValueError):
        table.refuse(key, describe(text), allowed)
    if not inside:
        table.refuse(key, f"{describe(text)}, a link that leads out of the folder", allowed)
    if not exists:
        table.refuse(key, f"{describe(text)}, {'no file' if path.exists() else 'which does not exist'}", "an existing file")
    return path
