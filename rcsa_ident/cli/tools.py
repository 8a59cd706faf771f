"""import-tools and draw: toolings from the library of a CAM program, and to scale on paper."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.remarks import counted
from rcsa_ident.cli.common import BAD_INPUT, Json, answers, emit, say, warn, writable

if TYPE_CHECKING:
    from rcsa_ident.io.settings.tool_libraries import Imported
    from rcsa_ident.tool_holder.geometry import Contact
    from rcsa_ident.tool_holder.spread import Spread

_ASSUMED = "What the library does not state"


@answers
def import_tools(
    library: Annotated[
        Path, typer.Argument(help="Tool library of Fusion 360 or HSM: .json, .tools with it, or .hsmlib.", show_default=False)
    ],
    out: Annotated[
        Path | None, typer.Option(help="Folder for one TOOLING.toml per tool; created if it is missing.", show_default=False)
    ] = None,
    list_: Annotated[bool, typer.Option("--list", help="Only list the tools of the library.")] = False,
    tool: Annotated[
        list[str] | None, typer.Option(help="Name or number of a tool to import; may be repeated; default: all.", show_default=False)
    ] = None,
    holder: Annotated[
        str | None,
        typer.Option(help="Holder of the library for tools that have none of their own.", show_default=False, rich_help_panel=_ASSUMED),
    ] = None,
    stickout_mm: Annotated[
        float | None,
        typer.Option(help="Stickout, mm; default: the library's length below the holder.", show_default=False, rich_help_panel=_ASSUMED),
    ] = None,
    insertion_mm: Annotated[
        float | None,
        typer.Option(
            help="Length in the holder's bore, mm; default: all of the tool behind the holder's nose.",
            show_default=False,
            rich_help_panel=_ASSUMED,
        ),
    ] = None,
    flute_ratio: Annotated[
        float, typer.Option(help="Equivalent diameter of the fluted part over the cutting diameter.", rich_help_panel=_ASSUMED)
    ] = 0.8,
    helix_deg: Annotated[float, typer.Option(help="Helix angle, degrees, where the library has none.", rich_help_panel=_ASSUMED)] = 30.0,
    material: Annotated[
        str | None,
        typer.Option(help="Tool material: carbide, steel; default: the library's.", show_default=False, rich_help_panel=_ASSUMED),
    ] = None,
    contact: Annotated[
        Path | None,
        typer.Option(
            help="TOOLING.toml whose contact between tool and holder is used; default: the catalogue's.",
            show_default=False,
            rich_help_panel=_ASSUMED,
        ),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Overwrite existing files.")] = False,
    json_: Json = False,
) -> None:
    """Make toolings from the tool library of a CAM program; each file says what was assumed."""
    from rcsa_ident.io.files import filling, write_text
    from rcsa_ident.io.settings.tool_libraries import Assumptions, file_names, read_tool_library

    if (out is None) != list_:
        raise InputError("--out", "nothing" if out is None else "given together with --list", "a folder, or --list")
    assumed = Assumptions(flute_ratio, helix_deg, stickout_mm, insertion_mm, material, *_contact(contact), holder)
    entries = _chosen(read_tool_library(library, assumed), tool or [], str(library))
    made = [entry for entry in entries if entry.tooling is not None]
    paths: list[Path] = []
    if out is not None:
        paths = [out / name for name in file_names([entry.name for entry in made])]
        there = [path.name for path in paths if path.exists()]
        if there and not overwrite:
            raise InputError("--out", f"{len(there)} of the files already ({there[0]})", "another folder, or --overwrite", str(out))
        with filling(out, "--out") as part:
            for entry, path in zip(made, paths, strict=True):
                write_text(part / path.name, entry.text)
    if json_:
        files = dict(zip([entry.number for entry in made], map(str, paths), strict=False))
        emit(
            {
                "library": str(library),
                "entries": len(entries),
                "toolings": len(made),
                "tools": [_row(e, files.get(e.number)) for e in entries],
            }
        )
    else:
        _show(entries)
        if out is not None:
            say(f"written: {counted(len(paths), 'tooling')} to {out}; each begins with its assumptions")
    if not made:
        if not json_:
            warn("no tool of the library could be imported")
        raise typer.Exit(BAD_INPUT)


@answers
def draw(
    tooling: Annotated[Path, typer.Argument(help="TOOLING.toml.", show_default=False)],
    out: Annotated[Path, typer.Option(help="TOOLING.svg to write.", show_default=False)],
    json_: Json = False,
) -> None:
    """Draw a tooling to scale, dimensioned in millimetres."""
    from rcsa_ident.io.files import write_text
    from rcsa_ident.io.settings.setups import read_tooling
    from rcsa_ident.report.drawing import tooling_svg

    writable(out)
    setup = read_tooling(tooling)
    write_text(out, tooling_svg(setup))
    assembly = setup.assembly
    if json_:
        lengths = {"stickout_mm": assembly.stickout, "insertion_mm": assembly.insertion, "holder_mm": assembly.holder_length}
        emit({"name": setup.name, "out": str(out), **{key: round(1e3 * value, 6) for key, value in lengths.items()}})
    else:
        say(f"written: {out}")


@answers
def holders(
    taper: Annotated[str | None, typer.Argument(help="Taper, as HSK-A63; by default all are listed.", show_default=False)] = None,
    chuck: Annotated[str | None, typer.Argument(help="Chuck, as ER32.", show_default=False)] = None,
    bore_mm: Annotated[float | None, typer.Option(help="Diameter of the tool's shank, mm.", show_default=False)] = None,
    length_mm: Annotated[
        float | None,
        typer.Option(help="From the nose to the spindle's face or gauge line, mm; default: a typical one.", show_default=False),
    ] = None,
    json_: Json = False,
) -> None:
    """Print a holder of the catalogue as \\[holder], \\[contact] and \\[spread] of a TOOLING.toml, or what there is."""
    from rcsa_ident.io.settings.toolings import contact_spread_keys, holder_keys, tooling_text, typical_contact_keys
    from rcsa_ident.tool_holder.catalogue import bores, chucks, tapers
    from rcsa_ident.tool_holder.catalogue import holder as made

    if taper is None:
        bored = {each: [round(1e3 * bore, 6) for bore in bores(each)] for each in chucks()}
        rows = [{"chuck": each, "least_bore_mm": least, "largest_bore_mm": largest} for each, (least, largest) in bored.items()]
        if json_:
            emit({"tapers": list(tapers()), "chucks": rows})
            return
        say(f"tapers: {', '.join(tapers())}")
        say("chucks: " + ", ".join(f"{r['chuck']} ({r['least_bore_mm']:g} to {r['largest_bore_mm']:g} mm)" for r in rows))
        return
    if chuck is None or bore_mm is None:
        missing = "chuck" if chuck is None else "--bore-mm"
        raise InputError(missing, "nothing", "a taper, a chuck and --bore-mm, as HSK-A63 ER32 --bore-mm 12")
    found = made(taper, chuck, bore_mm * 1e-3, None if length_mm is None else length_mm * 1e-3)
    keys: dict[str, Any] = {"holder": holder_keys(found)}
    typical, spread = typical_contact_keys(found.contact), {} if found.contact is None else contact_spread_keys(found.spread)
    if json_:
        head = {"name": f"{taper} {chuck}", "mass_kg": found.mass, "sources": list(found.sources)}
        emit({**head, **keys, "contact": typical, "spread": spread})
        return
    told = f"contact, {chuck}: no value is known; a hit on the tip of the clamped tool and rcsa-ident contact tell it"
    if typical is not None:
        keys["contact"] = typical["keys"]
        told = (
            f"contact, {typical['kind']}: {typical['source']} (standard deviation of its stiffness "
            f"{typical['stiffness_spread_percent']:g} %, of its damping {typical['damping_spread_percent']:g} %)"
        )
    left = "[spread]: standard deviations; a key that is left out has its usual value"
    say(tooling_text(keys | {"spread": spread}, (str(found), *found.sources, told, left)).rstrip())


def _contact(path: Path | None) -> tuple[Contact | None, Spread | None]:
    """A tooling's contact, and how well it is known."""
    if path is None:
        return None, None
    from rcsa_ident.io.settings.setups import read_tooling

    tooling = read_tooling(path)
    if tooling.assembly.contact is None:
        raise InputError("contact", "none", "a tooling with a table [contact]", str(path))
    return tooling.assembly.contact, tooling.spread


def _chosen(entries: list[Imported], wanted: list[str], where: str) -> list[Imported]:
    if not wanted:
        return entries
    found: list[Imported] = []
    for text in wanted:
        named = [entry for entry in entries if text in (entry.name, str(entry.number))]
        if not named:
            raise InputError("--tool", text, f"the name or the number of an entry, from 1 to {len(entries)}; --list shows them", where)
        found += [entry for entry in named if entry not in found]
    return found


def _row(entry: Imported, path: str | None) -> dict[str, object]:
    row: dict[str, object] = {"number": entry.number, "name": entry.name, "type": entry.kind, "usable": entry.tooling is not None}
    return row | {"reason": entry.reason, "notes": list(entry.notes), "file": path}


def _show(entries: list[Imported]) -> None:
    from rich.markup import escape
    from rich.table import Table

    from rcsa_ident.cli.tables import show
    from rcsa_ident.setup.tooling import BareCutter

    table = Table()
    for title in ("no.", "tool", "type", "teeth", "Ø mm", "stickout + insertion mm", ""):
        table.add_column(title, justify="right" if title in ("no.", "teeth", "Ø mm") else "left")
    for entry in entries:
        shape = ["", "", ""]
        if entry.tooling is not None:
            cutter, lengths = entry.tooling.cutter, "cutter alone"
            if not isinstance(entry.tooling, BareCutter):
                lengths = f"{1e3 * entry.tooling.assembly.stickout:.4g} + {1e3 * entry.tooling.assembly.insertion:.4g}"
            shape = [str(cutter.teeth), f"{1e3 * cutter.diameter:.4g}", lengths]
        last = entry.reason or f"{len(entry.notes)} assumptions"
        table.add_row(str(entry.number), *(escape(text) for text in (entry.name, entry.kind, *shape, last)))
    show(table)
