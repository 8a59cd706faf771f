"""Options that several commands share, in groups: a command names a group as one parameter and gets it filled."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from rcsa_ident.base.plausibility import Range
from rcsa_ident.setup.fields import ASKED_CUT, Field, Number
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


_KEYS = {each.key: each for each in ASKED_CUT}
_CALLED = {key: f"--{key.replace('_', '-')}" for key in _KEYS}


def option(key: str, panel: str | None = None, metavar: str | None = None) -> Any:
    """Return the option for a declared key of a cut."""
    field = _KEYS[key]
    return typer.Option(help=field.help.format_map(_CALLED), metavar=metavar, show_default=field.default is not None, rich_help_panel=panel)


class KeyOptions:
    """A group made of declared keys: an option for each, which a class may type otherwise than files and bodies do."""

    if TYPE_CHECKING:

        def __init__(self, **keys: Any) -> None: ...

        def __getattr__(self, key: str) -> Any: ...

    def __init_subclass__(cls, fields: Sequence[Field], panel: str, metavars: Mapping[str, str]) -> None:
        typed, cls.__annotations__ = get_type_hints(cls), {}
        for each in fields:
            default = getattr(cls, each.key, each.default)
            kind = typed.get(each.key, float if isinstance(each.kind, Range | Number) else str)
            told = option(each.key, panel, metavars.get(each.key))
            cls.__annotations__[each.key] = Annotated[kind if default is not None else kind | None, told]
            setattr(cls, each.key, default)
        dataclass(frozen=True)(cls)


_TIP, _SPEEDS, _SPINDLE = "The tip", "Speeds and method", "The spindle"
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


class CutOptions(KeyOptions, fields=ASKED_CUT, panel="The cut", metavars={"engagement": "MAP.csv", "runout_um": "A,B,..."}):
    """What is cut, and how."""

    immersion: str = "0.5"
    strategy: Strategy = Strategy.down
    stock: Stock | None = None
    engagement: Path | None = None


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


#: Of a machine that follows a thermometer.
TemperatureC = Annotated[
    float | None,
    typer.Option(
        "--temperature-c",
        help="Temperature near the bearings, °C, for a machine that changes with it; default: the warm machine.",
        show_default=False,
    ),
]


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
