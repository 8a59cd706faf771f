"""Options that several commands share, in groups: a command names a group as one parameter and gets it filled."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

from rcsa_ident.stability.methods import MethodName


class Strategy(StrEnum):
    """Which way the teeth enter."""

    up = "up"
    down = "down"


class Stock(StrEnum):
    """What stands around a cutter."""

    stepover = "stepover"
    block = "block"


def takes_groups(command: Callable[..., Any]) -> Callable[..., Any]:
    """Spread the groups among a command's parameters into options of their own."""
    hints = get_type_hints(command, include_extras=True)
    groups: dict[str, Any] = {}
    parameters: list[inspect.Parameter] = []
    for parameter in inspect.signature(command).parameters.values():
        kind = hints[parameter.name]
        if not dataclasses.is_dataclass(kind):
            parameters.append(parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY, annotation=kind))
            continue
        groups[parameter.name] = kind
        inner = get_type_hints(kind, include_extras=True)
        for field in dataclasses.fields(kind):
            default = inspect.Parameter.empty if field.default is dataclasses.MISSING else field.default
            parameters.append(inspect.Parameter(field.name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=inner[field.name]))

    def spread(**given: Any) -> Any:
        for name, kind in groups.items():
            given[name] = kind(**{field.name: given.pop(field.name) for field in dataclasses.fields(kind)})
        return command(**given)

    spread.__name__, spread.__doc__, spread.__module__ = command.__name__, command.__doc__, command.__module__
    spread.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    spread.__annotations__ = {p.name: p.annotation for p in parameters}
    return spread


_TIP, _CUT, _SPEEDS, _SPINDLE = "The tip", "The cut", "Speeds and method", "The spindle"
Bands = Annotated[bool, typer.Option(help="Add columns with uncertainty bands.")]
StiffnessSpread = Annotated[
    float, typer.Option(help="Standard deviation of the tool-holder's stiffness, %: part of the bands. 1 for a modulus from a handbook.")
]


@dataclass(frozen=True, slots=True)
class TipOptions:
    """Where the tip's dynamics come from, in place of a machine."""

    modes: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[X=]FILE",
            help="A modal model of the tip instead of a result: MODES.toml, or CutPro's X=FILE.cmp, one per axis.",
            show_default=False,
            rich_help_panel=_TIP,
        ),
    ] = None
    frf: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[X=]FILE[#RECORD]",
            help="Tap-test FRF instead of a result, one per axis: FRF.csv, UFF 58, text columns. XY= is a cross FRF (response X, force Y).",
            show_default=False,
            rich_help_panel=_TIP,
        ),
    ] = None
    frf_units: Annotated[
        str | None,
        typer.Option(
            help="Unit of the FRFs, as um/N, g/N, (m/s^2)/N; default: as the file states.", show_default=False, rich_help_panel=_TIP
        ),
    ] = None
    frf_correction: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[X=]CORRECTION",
            help="Of all FRFs or of one: reverse, conjugate, exchange (also conjugate-reverse, exchange-reverse), none; "
            "default: what is certain is turned.",
            show_default=False,
            rich_help_panel=_TIP,
        ),
    ] = None
    frf_from_hz: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            help="Lowest line of the FRFs, Hz; below are often an accelerometer's drifts.",
            show_default=False,
            rich_help_panel=_TIP,
        ),
    ] = None


@dataclass(frozen=True, slots=True)
class CutOptions:
    """What is cut, and how."""

    immersion: Annotated[str, typer.Option(help="Radial depth over diameter, as 0.5 or 50%; 1 is a slot.", rich_help_panel=_CUT)] = "0.5"
    strategy: Annotated[Strategy, typer.Option(help="Up or down milling.", rich_help_panel=_CUT)] = Strategy.down
    entry_deg: Annotated[
        float | None,
        typer.Option(help="Entry angle from the normal direction, instead of --immersion.", show_default=False, rich_help_panel=_CUT),
    ] = None
    exit_deg: Annotated[float | None, typer.Option(help="Exit angle.", show_default=False, rich_help_panel=_CUT)] = None
    stock: Annotated[
        Stock | None,
        typer.Option(
            help="What stands around the cutter: stepover of --immersion, as where the same cutter cut before (the default), or a block.",
            show_default=False,
            rich_help_panel=_CUT,
        ),
    ] = None
    y_from_mm: Annotated[
        float | None,
        typer.Option(help="One side of a block, mm beside the cutter's path along the normal.", show_default=False, rich_help_panel=_CUT),
    ] = None
    y_to_mm: Annotated[float | None, typer.Option(help="The other side, mm.", show_default=False, rich_help_panel=_CUT)] = None
    engagement: Annotated[
        Path | None,
        typer.Option(
            metavar="MAP.csv",
            help="Angles between which the edge cuts at each height: z_mm, entry_angle_deg, exit_angle_deg.",
            show_default=False,
            rich_help_panel=_CUT,
        ),
    ] = None
    lead_deg: Annotated[
        float | None,
        typer.Option(help="How far the tool leans towards the feed, degrees; with --engagement.", show_default=False, rich_help_panel=_CUT),
    ] = None
    feed_direction: Annotated[str, typer.Option(help="+X -X +Y -Y, or degrees from +X.", rich_help_panel=_CUT)] = "+X"
    feed_per_tooth_mm: Annotated[
        float | None, typer.Option(help="Feed per tooth, mm: power, run-out, surface error.", show_default=False, rich_help_panel=_CUT)
    ] = None
    material: Annotated[
        str | None, typer.Option(help="Coefficients of a material of the library.", show_default=False, rich_help_panel=_CUT)
    ] = None
    ktc_mpa: Annotated[
        float | None,
        typer.Option(help="Tangential coefficient, MPa; default: the result's workpiece.", show_default=False, rich_help_panel=_CUT),
    ] = None
    krc: Annotated[
        float | None, typer.Option(help="Radial ratio; default: the result's workpiece.", show_default=False, rich_help_panel=_CUT)
    ] = None
    kac: Annotated[
        float | None, typer.Option(help="Axial ratio; default: the result's workpiece, or 0.", show_default=False, rich_help_panel=_CUT)
    ] = None
    kte_n_per_mm: Annotated[float | None, typer.Option(help="Tangential edge force, N/mm.", show_default=False, rich_help_panel=_CUT)] = (
        None
    )
    kre_n_per_mm: Annotated[float | None, typer.Option(help="Radial edge force, N/mm.", show_default=False, rich_help_panel=_CUT)] = None
    runout_um: Annotated[
        str | None, typer.Option(metavar="A,B,...", help="Radial offset of each edge, um.", show_default=False, rich_help_panel=_CUT)
    ] = None
    wear_land_um: Annotated[
        float | None,
        typer.Option(help="Width of the wear land behind the edge, um: adds process damping.", show_default=False, rich_help_panel=_CUT),
    ] = None
    indentation: Annotated[
        float | None,
        typer.Option(help="Indentation coefficient, N/m^3 (1e14 aluminium, 4e13 steel).", show_default=False, rich_help_panel=_CUT),
    ] = None
    friction: Annotated[float, typer.Option(help="Coefficient of friction of the flank, with --wear-land-um.", rich_help_panel=_CUT)] = 0.3


@dataclass(frozen=True, slots=True)
class SpeedOptions:
    """Over which speeds, up to which depth, by which method."""

    speed_from: Annotated[float, typer.Option(help="Lowest spindle speed, rev/min.", rich_help_panel=_SPEEDS)] = 4000.0
    speed_to: Annotated[float, typer.Option(help="Highest spindle speed, rev/min.", rich_help_panel=_SPEEDS)] = 20000.0
    speed_step: Annotated[float, typer.Option(help="Speed step, rev/min.", rich_help_panel=_SPEEDS)] = 50.0
    speed_variation: Annotated[
        str | None,
        typer.Option(
            metavar="AMPLITUDE:RATIO",
            help="Spindle speed variation: relative amplitude, and cycles per revolution, as 0.1:0.2.",
            show_default=False,
            rich_help_panel=_SPEEDS,
        ),
    ] = None
    max_depth_mm: Annotated[float, typer.Option(help="Largest axial depth that is searched, mm.", rich_help_panel=_SPEEDS)] = 10.0
    method: Annotated[MethodName, typer.Option(help="Stability method.", rich_help_panel=_SPEEDS)] = MethodName.ZERO_ORDER


@dataclass(frozen=True, slots=True)
class DriveOptions:
    """What the spindle has."""

    max_power_kw: Annotated[float | None, typer.Option(help="Power at the cutter, kW.", show_default=False, rich_help_panel=_SPINDLE)] = (
        None
    )
    max_torque_nm: Annotated[float | None, typer.Option(help="Torque, N m.", show_default=False, rich_help_panel=_SPINDLE)] = None
    max_speed_rpm: Annotated[
        float | None, typer.Option(help="Highest speed of spindle or cutter, rev/min.", show_default=False, rich_help_panel=_SPINDLE)
    ] = None
    spindle: Annotated[
        Path | None,
        typer.Option(help="SPINDLE.csv: spindle_speed_rpm with power_kw, torque_nm or both.", show_default=False, rich_help_panel=_SPINDLE),
    ] = None
