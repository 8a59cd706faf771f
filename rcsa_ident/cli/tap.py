"""tap: hits of a hammer to an FRF."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rcsa_ident.cli.common import Json, answers, emit, say, warn, writable
from rcsa_ident.errors import InputError, non_negative
from rcsa_ident.units import to_hz

if TYPE_CHECKING:
    from rcsa_ident.arrays import FloatArray
    from rcsa_ident.signals.tap import TapFrf


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


_DERIVATIVE = {Response.displacement: 0, Response.velocity: 1, Response.acceleration: 2}
_SUFFIXES = (".csv", ".uff", ".unv", ".frf")


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
    estimator: Annotated[Estimator, typer.Option(help="H1, H2 or their mean.")] = Estimator.h1,
    sensor_mass_g: Annotated[float, typer.Option(help="Mass of the sensor, g, at the point that is hit.")] = 0.0,
    rate_hz: Annotated[float | None, typer.Option(help="Sampling rate, Hz, of a file that tells none.", show_default=False)] = None,
    plot: Annotated[Path | None, typer.Option(help="Figure to write (png, svg, pdf).", show_default=False)] = None,
    json_: Json = False,
) -> None:
    """Average hits of a hammer to a receptance; double hits, overloads and others that do not fit are left out and named."""
    from rcsa_ident.signals.tap import HitEstimator
    from rcsa_ident.signals.tap import tap as run

    writable(out)
    if out.suffix.lower() not in _SUFFIXES:
        raise InputError("--out", out.suffix or "no suffix", ", ".join(_SUFFIXES), str(out))
    if plot is not None:
        writable(plot, "--plot")
    mass = 1e-3 * non_negative("--sensor-mass-g", sensor_mass_g, "g")
    records, rates, derivative, said = [], set(), _DERIVATIVE[quantity], []
    for path in hits:
        rate, pair, told, remarks = _read(path, force, response, rate_hz)
        records.append(pair)
        rates.add(rate)
        derivative = derivative if told is None else told
        said += [remark for remark in remarks if remark not in said]
    if len(rates) > 1:
        raise InputError("sampling_rate_hz", ", ".join(f"{rate:g}" for rate in sorted(rates)), "one rate for all recordings [Hz]")
    found = run(rates.pop(), records, derivative, HitEstimator(estimator), mass)
    _write(out, found, axis)
    if plot is not None:
        from rcsa_ident.report.tap import tap_figure

        tap_figure(found, axis).savefig(plot, dpi=150)
    left_out = [(hit, hits[hit.record].name) for hit in found.hits if hit.reason]
    if json_:
        rows = [
            {"recording": str(hits[hit.record]), "time_s": hit.time, "force_n": hit.force, "left_out": hit.reason or None}
            for hit in found.hits
        ]
        further = {"band_hz": to_hz(found.omega[[0, -1]]).tolist(), "window_decay_per_s": found.window_decay, "remarks": said}
        emit({"hits": rows, "used": found.used, **further, "out": str(out)})
        return
    for remark in said:
        say(remark)
    for hit, name in left_out:
        warn(f"{name}, hit at {hit.time:.3g} s is left out: {hit.reason}")
    if found.window_decay:
        say(f"the responses do not end: an exponential window adds {found.window_decay:.3g} 1/s to the decay of every mode")
    say(f"{found.used} of {len(found.hits)} hits, up to {to_hz(float(found.omega[-1])):.0f} Hz; written: {out}")


def _read(
    path: Path, force: str | None, response: str | None, rate: float | None
) -> tuple[float, tuple[FloatArray, FloatArray], int | None, tuple[str, ...]]:
    """Rate, force and response of a recording, how often its unit says that the response is differentiated, and what was guessed."""
    from rcsa_ident.io.channels import the_only
    from rcsa_ident.io.open_recording import open_recording
    from rcsa_ident.signals.recording import Quantity
    from rcsa_ident.workflows.tap import hammer_channel

    opened = open_recording(path, [name for name in (force, response) if name], rate)
    channels, names = opened.channels, [each.name for each in opened.channels]
    forces = [i for i, each in enumerate(channels) if each.quantity is Quantity.FORCE]
    said = list(opened.remarks)
    if force is not None:
        hammer = the_only(force, names, str(path))
    elif len(forces) == 1:
        hammer = forces[0]
    else:
        hammer = hammer_channel([each.samples for each in channels])
        said.append(f"{names[hammer]}, which comes in pulses, was taken as the hammer's force [N]")
    others = [i for i in range(len(channels)) if i != hammer]
    if response is None and len(others) != 1:
        raise InputError("--response", ", ".join(names[i] for i in others) or "none", "the name of one channel", str(path))
    moved = channels[others[0] if response is None else the_only(response, names, str(path))]
    told = {Quantity.ACCELERATION: 2, Quantity.DISPLACEMENT: 0}.get(moved.quantity) if moved.quantity is not None else None
    return opened.rate, (channels[hammer].samples, moved.samples), told, tuple(said)


def _write(out: Path, found: TapFrf, axis: Axis) -> None:
    from rcsa_ident.dynamics.coordinates import Coordinate, Dof
    from rcsa_ident.dynamics.receptance import Receptance
    from rcsa_ident.io.curves import write_frf_csv
    from rcsa_ident.io.exports import write_receptances_uff
    from rcsa_ident.io.files import write_text

    frequency = to_hz(found.omega)
    if out.suffix.lower() == ".csv":
        write_frf_csv(out, frequency, {axis.value: found.receptance})
    elif out.suffix.lower() == ".frf":
        rows = (f"{f:.9g} {h.real:.9e} {h.imag:.9e}" for f, h in zip(frequency, found.receptance, strict=True))
        write_text(out, "\n".join(["Frequency [Hz] Real [m/N] Imaginary [m/N]", *rows]) + "\n")
    else:
        tip = Coordinate("tip", Dof(axis.value.lower()))
        write_receptances_uff(out, {axis.value: Receptance(found.omega, found.receptance[:, None, None], (tip,), (tip,))}, "hammer hits")
