"""listen, tap and ring: what a recording says by itself, what hits of a hammer say, what a tooling's ring teaches."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from rcsa_ident.base.errors import InputError, non_negative
from rcsa_ident.base.units import from_rpm, to_hz
from rcsa_ident.cli.common import NOT_CONVERGED, Json, Stages, answers, emit, say, warn, writable


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


class Response(StrEnum):
    """What the response measures."""

    acceleration = "acceleration"
    velocity = "velocity"
    displacement = "displacement"


class Estimator(StrEnum):
    """How hits are averaged."""

    h1 = "h1"
    h2 = "h2"
    hv = "hv"


class Axis(StrEnum):
    """Machine axis of the hits."""

    X = "X"
    Y = "Y"


@answers
def tap(
    hits: Annotated[list[Path], typer.Argument(help="Recordings of hits: one with several, or several files.", show_default=False)],
    out: Annotated[Path, typer.Option(help="FRF to write: .csv (FRF.csv), .uff, .frf.", show_default=False)],
    axis: Annotated[Axis, typer.Option(help="Machine axis of hammer and response.")] = Axis.X,
    force: Annotated[str | None, typer.Option(help="Channel of the hammer [N]; else it is told by its pulses.", show_default=False)] = None,
    response: Annotated[str | None, typer.Option(help="Channel of the response; else the only other one.", show_default=False)] = None,
    quantity: Annotated[
        Response, typer.Option(help="What the response measures, in SI, where its unit does not say.")
    ] = Response.acceleration,
    force_sensitivity: Annotated[
        float | None, typer.Option(help="Signal per newton of a hammer in volts or in an unknown unit.", show_default=False)
    ] = None,
    response_sensitivity: Annotated[
        float | None, typer.Option(help="Signal per SI unit of a response in volts or in an unknown unit.", show_default=False)
    ] = None,
    estimator: Annotated[Estimator, typer.Option(help="H1, H2, or Hv: the geometric mean of both.")] = Estimator.h1,
    sensor_mass_g: Annotated[float, typer.Option(help="Mass of the sensor, g, at the point that is hit.")] = 0.0,
    rate_hz: Annotated[float | None, typer.Option(help="Sampling rate, Hz, of a file that tells none.", show_default=False)] = None,
    reverse: Annotated[bool, typer.Option("--reverse", help="The sensor or the hammer is reversed: turn the sign.")] = False,
    plot: Annotated[Path | None, typer.Option(help="Figure to write (png, svg, pdf).", show_default=False)] = None,
    json_: Json = False,
) -> None:
    """Average hits of a hammer to a receptance; double hits, overloads and others that do not fit are left out and named."""
    from rcsa_ident.front.recorded import tap as ask
    from rcsa_ident.io.curves.exports import TAP_SUFFIXES, write_tap
    from rcsa_ident.report.summaries import tap_row

    writable(out)
    if out.suffix.lower() not in TAP_SUFFIXES:
        raise InputError("--out", out.suffix or "no suffix", ", ".join(TAP_SUFFIXES), str(out))
    if plot is not None:
        writable(plot, "--plot")
    mass = 1e-3 * non_negative("--sensor-mass-g", sensor_mass_g, "g")
    found = ask(
        *hits,
        force=force,
        response=response,
        quantity=quantity.value,
        estimator=estimator.value,
        sensor_mass=mass,
        axis=axis.value,
        rate=rate_hz,
        force_sensitivity=force_sensitivity,
        response_sensitivity=response_sensitivity,
        reverse=reverse,
    )
    write_tap(out, found)
    if plot is not None:
        from rcsa_ident.report.tap import tap_figure

        tap_figure(found).savefig(plot, dpi=150)
    left_out = [(hit, hits[hit.record].name) for hit in found.hits if hit.reason]
    if json_:
        emit(tap_row(found, [str(path) for path in hits]) | {"out": str(out)})
        return
    for remark in found.remarks:
        warn(remark)
    for hit, name in left_out:
        warn(f"{name}, hit at {hit.time:.3g} s is left out: {hit.reason}")
    if found.window_decay:
        say(f"the responses do not end: an exponential window adds {found.window_decay:.3g} 1/s to the decay of every mode")
    say(f"{found.used} of {len(found.hits)} hits, up to {to_hz(float(found.omega[-1])):.0f} Hz; written: {out}")


@answers
def ring(
    tooling: Annotated[
        Path, typer.Argument(help="TOOLING.toml as drawn; [holder] taper tells what hangs behind the flange.", show_default=False)
    ],
    out: Annotated[Path, typer.Option(help="Tooling file to write, with what was learned.", show_default=False)],
    sounds: Annotated[
        list[Path] | None,
        typer.Argument(help="Sound of the tooling on a string, tapped: one with several hits, or several.", show_default=False),
    ] = None,
    bare_tool: Annotated[
        list[Path] | None, typer.Option(help="Sound of the tool alone, tapped; more than once for several.", show_default=False)
    ] = None,
    mass_g: Annotated[float | None, typer.Option(help="Mass of the tool alone, g.", show_default=False)] = None,
    rate_hz: Annotated[float | None, typer.Option(help="Sampling rate, Hz, of a file that tells none.", show_default=False)] = None,
    plot: Annotated[Path | None, typer.Option(help="Figure to write (png, svg, pdf).", show_default=False)] = None,
    json_: Json = False,
) -> None:
    """Learn what a drawing does not tell from the ring of the tooling: hang it on a string, tap it, hold a phone beside it."""
    from rcsa_ident.front.recorded import ring as ask
    from rcsa_ident.io.files import write_text
    from rcsa_ident.io.settings.toolings import tooling_keys, tooling_text
    from rcsa_ident.report.ring_rows import ring_row, sentences

    writable(out)
    if plot is not None:
        writable(plot, "--plot")
    if out.exists() and tooling.exists() and out.samefile(tooling):
        raise InputError("--out", "the drawing itself", "another file: a drawing is not overwritten", str(out))
    with Stages(quiet=json_).stage("listening"):
        found = ask(tooling, *(sounds or ()), bare_tool=bare_tool or (), mass=None if mass_g is None else 1e-3 * mass_g, rate=rate_hz)
    said = sentences(found)
    write_text(out, tooling_text(tooling_keys(found.after), [f"learned from its ring, from {tooling.name}", *said]))
    if plot is not None:
        from rcsa_ident.report.ringing import ring_figure

        ring_figure(found).savefig(plot, dpi=150)
    if json_:
        emit(ring_row(found) | {"out": str(out)})
    else:
        for line in said:
            say(line)
        for remark in found.remarks:
            warn(remark)
        say(f"written: {out}")
    if found.suspect:
        warn(f"drawing, spread and ring hardly go together (probability {found.probability:.2g}): look at the lines above")
        raise typer.Exit(NOT_CONVERGED)
