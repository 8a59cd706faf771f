"""listen: what recordings say by themselves."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import from_rpm
from rcsa_ident.cli.common import Json, Stages, answers, emit, say, writable


class Listened(StrEnum):
    """What a sensor may measure."""

    acceleration = "acceleration"
    sound = "sound"
    displacement = "displacement"
    force = "force"


@answers
def listen(
    recordings: Annotated[list[Path], typer.Argument(help="Recordings of a spindle: sound of a phone, CSV, ...", show_default=False)],
    channel: Annotated[list[str], typer.Option(help="Channel that is listened to; more than once for several.", show_default=False)] = [],  # noqa: B006
    quantity: Annotated[Listened | None, typer.Option(help="What it measures, where the file does not say.", show_default=False)] = None,
    sensitivity: Annotated[
        float | None, typer.Option(help="Signal per SI unit, of a channel in volts or in an unknown unit.", show_default=False)
    ] = None,
    teeth: Annotated[int | None, typer.Option(min=1, help="Teeth of the cutter; heard if left out.", show_default=False)] = None,
    speed_rpm: Annotated[float | None, typer.Option(help="Programmed spindle speed, rev/min.", show_default=False)] = None,
    speeds_from: Annotated[float | None, typer.Option(help="Lowest speed of the machine, rev/min.", show_default=False)] = None,
    speeds_to: Annotated[float | None, typer.Option(help="Highest speed of the machine, rev/min.", show_default=False)] = None,
    rate_hz: Annotated[float | None, typer.Option(help="Sampling rate, Hz, of a file that tells none.", show_default=False)] = None,
    plot: Annotated[Path | None, typer.Option(help="Figure to write (png, svg, pdf), of one recording.", show_default=False)] = None,
    json_: Json = False,
) -> None:
    """Tell from a recording alone: the spindle's speed, teeth, whether it cuts stably or chatters, and which speeds to try."""
    from rcsa_ident.front.recorded import listen as ask
    from rcsa_ident.report.summaries import listening_row

    if (speeds_from is None) != (speeds_to is None):
        given = "--speeds-from" if speeds_to is None else "--speeds-to"
        raise InputError("--speeds-from and --speeds-to", f"{given} alone", "both, or neither")
    if plot is not None:
        writable(plot, "--plot")
        if len(recordings) > 1:
            raise InputError("--plot", f"{len(recordings)} recordings", "one recording")
    between = None if speeds_from is None or speeds_to is None else (from_rpm(speeds_from), from_rpm(speeds_to))
    speed = None if speed_rpm is None else from_rpm(speed_rpm)
    stages = Stages(quiet=json_)
    answers_: list[dict[str, Any]] = []
    for path in recordings:
        with stages.stage(str(path)):
            try:
                answer = ask(path, channel, quantity, teeth, speed, between, rate_hz, sensitivity)
            except InputError as error:
                raise error if error.where else error.at(str(path)) from None
        if plot is not None:
            from rcsa_ident.report.listening import listening_figure

            listening_figure(answer).savefig(plot, dpi=150)
        answers_.append({"recording": str(path)} | listening_row(answer))
        if not json_:
            _show(answers_[-1])
    if json_:
        emit(answers_[0] if len(answers_) == 1 else {"recordings": answers_})
    elif plot is not None:
        say(f"written: {plot}")


def _show(row: dict[str, Any]) -> None:
    """Print a recording's answer in a few lines."""
    speed = row["spindle_speed_rpm"]
    head = row["verdict"] if speed is None else f"{row['verdict']} at {speed:.1f} rev/min"
    say(f"{row['recording']}: {head}")
    if speed is not None:
        facts = [f"speed ± {row['spindle_speed_std_rpm']:.2g} rev/min, wander {row['speed_wander_percent']:.2g} %"]
        if row["ramp"]:
            facts.append(f"ramp from {row['ramp'][0]:.0f} to {row['ramp'][1]:.0f} rev/min")
        if row["other_speeds_rpm"]:
            own, *shares = row["speed_probabilities"]
            others = [f"{each:.1f} rev/min ({share:.0%})" for each, share in zip(row["other_speeds_rpm"], shares, strict=True)]
            facts.append(f"probability {own:.0%}, or else {', '.join(others)}")
        if row["teeth"]:
            facts.append(f"{row['teeth']} teeth")
        say(f"  {'; '.join(facts)}")
    for reason in row["reasons"]:
        say(f"  {reason}")
    if row["suggested_speeds_rpm"]:
        say("  try " + ", ".join(f"{each:.0f}" for each in row["suggested_speeds_rpm"]) + " rev/min")
    events = [each["event"] if each["time_s"] is None else f"{each['event']} at {each['time_s']:.2f} s" for each in row["events"]]
    if events:
        say(f"  {', '.join(events)}")
