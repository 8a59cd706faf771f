"""tap: hits of a hammer to an FRF."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from rcsa_ident.base.errors import InputError, non_negative
from rcsa_ident.base.units import to_hz
from rcsa_ident.cli.common import Json, answers, emit, say, warn, writable


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
