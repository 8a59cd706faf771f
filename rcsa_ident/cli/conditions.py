"""What the options of `tooltip`, `lobes` and `advise` mean: the machine or the tip, the cut, its speeds, the spindle."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.remarks import counted
from rcsa_ident.base.units import from_rpm, inclusive
from rcsa_ident.cli.options import CutOptions, DriveOptions, SpeedOptions, Stock, Strategy, TipOptions

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rcsa_ident.base.arrays import FloatArray
    from rcsa_ident.cutting.conditions import Engagement
    from rcsa_ident.cutting.power import SpindleDrive
    from rcsa_ident.cutting.process import SpeedVariation
    from rcsa_ident.cutting.stock import AskedEngagement
    from rcsa_ident.dynamics.receptance import Receptance
    from rcsa_ident.machine.machine import TipSource
    from rcsa_ident.setup.cut import CutSpec
    from rcsa_ident.setup.tooling import Tooling
    from rcsa_ident.workflows.tool_change import ToolChange


def subjects_of(files: Sequence[Path], tip: TipOptions, stickouts: str | None = None, most: int = 1) -> tuple[TipSource, list[Tooling]]:
    """Return what takes the toolings, and these: RESULT.json (or its kin) TOOLING.toml ..., or with --modes or --frf one alone."""
    from rcsa_ident.cli.results import read_tip_source
    from rcsa_ident.io.settings.setups import read_tooling
    from rcsa_ident.io.settings.stickouts import read_stickouts
    from rcsa_ident.machine.learnt_tip import LearntTip
    from rcsa_ident.machine.machine import Machine

    own_tip = bool(tip.modes or tip.frf)
    if tip.modes and tip.frf:
        raise InputError("--modes and --frf", "both", "one of them")
    if tip.frf_units is not None and not tip.frf:
        raise InputError("--frf-units", tip.frf_units, "given together with --frf")
    if tip.frf_from_hz is not None and not tip.frf:
        raise InputError("--frf-from-hz", f"{tip.frf_from_hz:g}", "given together with --frf")
    if tip.frf_correction and not tip.frf:
        raise InputError("--frf-correction", tip.frf_correction[0], "given together with --frf")
    if own_tip and stickouts is not None:
        raise InputError("--stickout-mm", stickouts, "a machine that takes any tooling: --modes and --frf are one stickout's")
    fewest, highest = (1, 1) if own_tip else (2, 1 + most)
    if not fewest <= len(files) <= highest:
        machine_first = "RESULT.json or FLANGE.csv, then TOOLING.toml (or --modes or --frf and TOOLING.toml)"
        wanted = "TOOLING.toml alone with --modes or --frf" if own_tip else machine_first
        raise InputError("files", counted(len(files), "file"), wanted)
    lengths = None if stickouts is None else [mm * 1e-3 for mm in numbers(stickouts, "--stickout-mm", "mm")]
    paths = files if own_tip else files[1:]
    if own_tip:
        return _known_tip(tip), [read_tooling(path, tip_known=True) for path in paths]
    machine = read_tip_source(files[0])
    if isinstance(machine, LearntTip):
        if lengths is not None or len(paths) > 1:
            raise InputError(
                "files", "several toolings or stickouts", "one tooling, that of the labelled cuts: a learnt tip answers for it alone"
            )
        return machine, [read_tooling(paths[0], tip_known=True)]
    toolings = [t for path in paths for t in ([read_tooling(path)] if lengths is None else read_stickouts(path, lengths))]
    return machine.kept() if len(toolings) > 1 and isinstance(machine, Machine) else machine, toolings


def _known_tip(options: TipOptions) -> TipSource:
    """What stands in the place of a machine: a modal model of the tip, or tap tests of it."""
    from rcsa_ident.io.settings.modal_files import read_modes_files
    from rcsa_ident.machine.known_tip import KnownTip

    if options.modes:
        found = read_modes_files(options.modes)
        return KnownTip(found.modes, found.coefficients)
    return KnownTip(idle_tip(options.frf or [], options.frf_units, options.frf_from_hz, options.frf_correction or ()))


def idle_tip(texts: Sequence[str], units: str | None = None, from_hz: float | None = None, corrections: Sequence[str] = ()) -> Receptance:
    """Return the tip's receptance from tap tests, each written as with --frf, and corrected as with --frf-correction."""
    from rcsa_ident.dynamics.passivity import correction_of
    from rcsa_ident.io.curves.frf_files import read_tapped_tip

    sources = [frf_source(text) for text in texts]
    for text in corrections:
        axes, _, name = text.rpartition("=")
        pair = (axes.upper()[:1], axes.upper()[-1:])
        chosen = [k for k, source in enumerate(sources) if not axes or source.pair == pair]
        if not chosen:
            raise InputError("--frf-correction", text, f"the direction of an FRF that is given as --frf {axes}=FILE")
        for k in chosen:
            sources[k] = sources[k]._replace(correction=correction_of(name, "--frf-correction"))
    return read_tapped_tip(sources, units, from_hz or 0.0)


def frf_source(text: str) -> Any:
    """Return what a file, X=FILE or XY=FILE, each with or without #RECORD, asks to be read."""
    from rcsa_ident.io.curves.frf_files import Source

    axes, sign, name = text.partition("=")
    named = bool(sign) and 1 <= len(axes) <= 2 and set(axes.upper()) <= set("XYZ")
    name = name if named else text
    pair = (axes.upper()[0], axes.upper()[-1]) if named else None
    path, mark, record = name.rpartition("#")
    if mark and record.isdigit() and not Path(name).exists():
        return Source(Path(path), pair, int(record))
    return Source(Path(name), pair)


def change_of(machine: TipSource, tooling: Tooling, cut: CutSpec, speeds: SpeedOptions, bands: bool, stiffness_spread: float) -> ToolChange:
    """Return what is asked about a tooling."""
    from rcsa_ident.stability.lobes import DRAWS, METHODS
    from rcsa_ident.workflows.tool_change import ToolChange

    draws, share = (DRAWS if bands else 0), share_of(stiffness_spread, "--stiffness-spread", 50.0)
    method = METHODS[speeds.method]()
    return ToolChange(machine, tooling, cut, speeds_of(speeds), speeds.max_depth_mm * 1e-3, method, draws, share)


def speeds_of(options: SpeedOptions) -> FloatArray:
    """Return the spindle speeds [rad/s], rising."""
    names = ("--speed-from", "--speed-to", "--speed-step")
    return from_rpm(inclusive(options.speed_from, options.speed_to, options.speed_step, names, "rev/min"))


def share_of(percent: float, option: str, most: float, above: bool = False) -> float:
    """Return the share that an option says in percent."""
    if not 0.0 <= percent <= most or (above and percent == 0.0):
        raise InputError(option, percent, f"a number {'above' if above else 'from'} 0 to {most:g} [%]")
    return percent / 100.0


def cut_of(cut: CutOptions, speed_variation: str | None = None) -> CutSpec:
    """Return the cut that is asked about."""
    from rcsa_ident.setup.cut import asked_cut

    told, angle = _stock(cut), feed_angle(cut.feed_direction)
    offsets = None if cut.runout_um is None else numbers(cut.runout_um, "--runout-um", "um")
    if (cut.wear_land_um is None) != (cut.indentation is None):
        missing = "--wear-land-um" if cut.wear_land_um is None else "--indentation"
        raise InputError(missing, "nothing", "--wear-land-um [um] and --indentation [N/m^3], or neither")
    return asked_cut(told, angle, vars(cut) | {"runout_um": offsets}, _variation(speed_variation))


def _stock(cut: CutOptions) -> AskedEngagement:
    """How the cutter is engaged: by a map, by a block's sides, by angles, or by an immersion, which is a stepover to a shape."""
    from rcsa_ident.cutting.conditions import Block
    from rcsa_ident.cutting.stock import Immersion
    from rcsa_ident.io.settings.engagements import read_engagement_map

    angles, sides = cut.entry_deg is not None or cut.exit_deg is not None, cut.y_from_mm is not None or cut.y_to_mm is not None
    told = {"--engagement": cut.engagement is not None, "--y-from-mm": sides, "--entry-deg": angles}
    given = [name for name, there in told.items() if there]
    if len(given) > 1:
        raise InputError(given[1], f"given beside {given[0]}", "one way to tell the engagement")
    fits = ["--y-from-mm"] if cut.stock is Stock.block else []
    if cut.stock is not None and (wrong := [name for name in given if name not in fits]):
        allowed = "--y-from-mm and --y-to-mm" if fits else "--immersion and --strategy"
        raise InputError(wrong[0], f"given beside --stock {cut.stock}", f"{allowed} for that stock")
    if cut.lead_deg is not None and (cut.engagement is None or not abs(cut.lead_deg) < 90.0):
        raise InputError("--lead-deg", cut.lead_deg, "an angle between -90 and 90 [deg], given together with --engagement")
    if cut.engagement is not None:
        return read_engagement_map(cut.engagement, math.radians(cut.lead_deg or 0.0))
    if sides or cut.stock is Stock.block:
        if cut.y_from_mm is None or cut.y_to_mm is None:
            raise InputError("--y-from-mm and --y-to-mm", "one of them" if sides else "nothing", "both sides of the block [mm]")
        if not cut.y_from_mm < cut.y_to_mm:
            raise InputError("--y-to-mm", cut.y_to_mm, f"above --y-from-mm, {cut.y_from_mm:g} [mm]")
        return Block(cut.y_from_mm * 1e-3, cut.y_to_mm * 1e-3)
    if angles:
        return engagement(cut.immersion, cut.strategy, cut.entry_deg, cut.exit_deg)
    return Immersion(immersion_of(cut.immersion), str(cut.strategy))


def _variation(text: str | None) -> SpeedVariation | None:
    from rcsa_ident.cutting.process import SpeedVariation

    if text is None:
        return None
    parts = numbers(text.replace(":", ","), "--speed-variation", "AMPLITUDE:RATIO")
    if len(parts) != 2:
        raise InputError("--speed-variation", text, "AMPLITUDE:RATIO, as 0.1:0.2")
    return SpeedVariation(*parts)


def numbers(text: str, option: str, unit: str) -> list[float]:
    """Return the numbers of an option that takes several, divided by commas."""
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        found = [math.nan]
    if not all(math.isfinite(number) for number in found):
        raise InputError(option, text, f"finite numbers divided by commas [{unit}]")
    return found


def engagement(immersion: str, strategy: Strategy, entry_deg: float | None, exit_deg: float | None) -> Engagement:
    """Return the engagement from both angles, or from immersion and strategy."""
    from rcsa_ident.cutting.conditions import Engagement

    if (entry_deg is None) != (exit_deg is None):
        raise InputError("--entry-deg and --exit-deg", "one of them", "both, or neither")
    if entry_deg is None or exit_deg is None:
        return Engagement.from_immersion(immersion_of(immersion), str(strategy))
    return Engagement(math.radians(entry_deg), math.radians(exit_deg))


def immersion_of(text: str) -> float:
    """Return the radial immersion [-] that an option says as a share or in percent."""
    number, percent = text.strip().removesuffix("%"), text.strip().endswith("%")
    try:
        share = float(number) / (100.0 if percent else 1.0)
    except ValueError:
        share = math.nan
    if not 0.0 < share <= 1.0:
        raise InputError("--immersion", text, "radial depth over diameter, above 0 and not above 1, or in percent: 0.5 or 50%")
    return share


def feed_angle(text: str) -> float:
    """Return the feed direction [rad] of +X, -X, +Y, -Y or degrees."""
    from rcsa_ident.io.settings.cuts import FEED_DIRECTIONS

    if text.upper() in FEED_DIRECTIONS:
        return FEED_DIRECTIONS[text.upper()]
    try:
        degrees = float(text)
    except ValueError:
        degrees = math.nan
    if not abs(degrees) <= 360.0:
        raise InputError("--feed-direction", text, f"one of {', '.join(FEED_DIRECTIONS)}, or an angle from -360 to 360 [deg]")
    return math.radians(degrees)


def drive_of(options: DriveOptions) -> SpindleDrive:
    """Return what the spindle has."""
    from rcsa_ident.base.errors import positive
    from rcsa_ident.cutting.power import SpindleDrive
    from rcsa_ident.io.settings.spindle_drives import read_spindle_drive

    given = (
        ("--max-power-kw", options.max_power_kw, "kW", 1e3),
        ("--max-torque-nm", options.max_torque_nm, "N m", 1.0),
        ("--max-speed-rpm", options.max_speed_rpm, "rev/min", from_rpm(1.0)),
    )
    flat = SpindleDrive.flat(*(None if value is None else positive(name, value, unit) * factor for name, value, unit, factor in given))
    return flat if options.spindle is None else read_spindle_drive(options.spindle).limited(flat)
