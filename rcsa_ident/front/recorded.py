"""The front door's verbs for a recording by itself: what it says, what the hits of a hammer in it say, how a tooling rings in it.

Like other verbs each reads what it needs and returns a noun that shows itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from threadpoolctl import threadpool_limits  # small matrices: further threads only wait, and add up in another order

from rcsa_ident.base.errors import InputError
from rcsa_ident.setup.tooling import Tooling

if TYPE_CHECKING:
    from rcsa_ident.identification.ring.ringing import RungTooling
    from rcsa_ident.io.recordings.self_describing_tables import OpenRecording
    from rcsa_ident.signals.listening import Listening
    from rcsa_ident.signals.recording import Quantity
    from rcsa_ident.signals.tap import HitEstimator, TapFrf


def listen(
    recording: str | Path,
    channels: Sequence[str] = (),
    quantity: Quantity | str | None = None,
    teeth: int | None = None,
    speed: float | None = None,
    between: tuple[float, float] | None = None,
    rate: float | None = None,
    sensitivity: float | None = None,
) -> Listening:
    """Return what a recording of any sensor says by itself: the spindle's speed, whether it cuts stably or chatters, speeds to try.

    Parameters
    ----------
    recording : path
        Of any format that a campaign reads, or a text table.
    channels : sequence of str
        That are listened to; by default all of one quantity, of a sound the first.
    quantity : Quantity or str, optional
        What they measure where the file does not say: acceleration, sound, displacement or force.
    teeth : int, optional
        By default as they are heard.
    speed : float, optional [rad/s]
        As programmed; the true one is looked for near it.
    between : (float, float), optional [rad/s]
        Speeds that the machine may turn at.
    rate : float, optional [Hz]
        Of a file that tells none.
    sensitivity : float, optional
        Signal per SI unit, as 0.0102 V per m/s²; of channels in volts or in a unit that is not known.

    Raises
    ------
    InputError
        The file cannot be read, does not tell what is needed, or says nothing at all.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> path = "data/sample_runs/recordings/S1-ER32-00_cut.h5"
    >>> heard = ri.listen(path, channels=["flange_x", "flange_y"], quantity="displacement")
    >>> print(heard)
    stable at 7999.6 rev/min
    """
    from rcsa_ident.io.recordings.open_recording import open_recording
    from rcsa_ident.signals.recording import Quantity

    known = [str(each) for each in Quantity]
    if quantity is not None and quantity not in known:
        raise InputError("quantity", quantity, ", ".join(known))
    opened = open_recording(recording, channels, rate)
    with threadpool_limits(1):
        told = {"teeth": teeth, "spindle_speed": speed, "between": between}
        return heard(opened, channels, quantity, sensitivity, Path(recording).name, **told)


def heard(
    opened: OpenRecording, channels: Sequence[str], quantity: Quantity | str | None, sensitivity: float | None, name: str, **told: Any
) -> Listening:
    """Return what an opened recording says, told what `listen_to` takes; its reasons name what was taken as given."""
    from rcsa_ident.signals.recording import Quantity
    from rcsa_ident.workflows.listen import listen_to

    measured, chosen, assumed = opened.of(None if quantity is None else Quantity(quantity), channels, sensitivity)
    answer = listen_to(opened.rate, [each.samples for each in chosen], measured, **told)
    assert answer.record is not None
    record = answer.record._replace(name=name, channels=tuple(each.name for each in chosen))
    return replace(answer, reasons=(*answer.reasons, *assumed), record=record)


def tap(
    *recordings: str | Path,
    force: str | None = None,
    response: str | None = None,
    quantity: str = "acceleration",
    estimator: HitEstimator | str = "h1",
    sensor_mass: float = 0.0,
    axis: str = "X",
    rate: float | None = None,
    force_sensitivity: float | None = None,
    response_sensitivity: float | None = None,
    reverse: bool = False,
) -> TapFrf:
    """Return the receptance of a structure that was hit by a hammer; double hits, overloads and others are left out and named.

    Parameters
    ----------
    *recordings : path
        One with several hits, or several files.
    force, response : str, optional
        Names of the channels; by default the hammer is told by its pulses, and the response is the only other one.
    quantity : str
        What the response measures where its unit does not say: acceleration, velocity or displacement.
    estimator : HitEstimator or str
        h1, h2, or hv for their mean.
    sensor_mass : float [kg]
        Of a sensor at the point that is hit.
    axis : str
        Machine axis of hammer and response, X or Y.
    rate : float, optional [Hz]
        Of files that tell none.
    force_sensitivity, response_sensitivity : float, optional
        Signal per newton and per SI unit of the response, as 0.0102 V per m/s²; of channels in volts or in a unit that is not known.
    reverse : bool
        The sensor or the hammer is reversed: the receptance is turned.

    Raises
    ------
    InputError
        A file cannot be read, or no hit can be used; the message says why of each.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> found = ri.tap("hits.csv", axis="Y")
    >>> print(found)
    receptance Y from 2 of 2 hits, 2 to 25600 Hz
    >>> tip = ri.read_tap_tests(y=found.save("TIP.csv"))
    """
    from rcsa_ident.io.recordings.open_recording import open_recording
    from rcsa_ident.signals.tap import HitEstimator
    from rcsa_ident.workflows.tap import tap_recordings

    known = [str(each) for each in HitEstimator]
    if estimator not in known:
        raise InputError("estimator", estimator, ", ".join(known))
    if axis not in ("X", "Y"):
        raise InputError("axis", axis, "X or Y")
    opened = [open_recording(path, [name for name in (force, response) if name], rate) for path in recordings]
    with threadpool_limits(1):
        gains = force_sensitivity, response_sensitivity
        return tap_recordings(opened, force, response, quantity, HitEstimator(estimator), sensor_mass, axis, *gains, reverse)


def ring(
    tooling: Tooling | str | Path,
    *sounds: str | Path,
    bare_tool: Sequence[str | Path] = (),
    mass: float | None = None,
    rate: float | None = None,
) -> RungTooling:
    """Return a tooling learned from how it rings: hung on a string, tapped, and recorded with a phone beside it.

    Parameters
    ----------
    tooling : Tooling or path
    *sounds : path
        Of the tool in its holder, one with several hits, or several files.
    bare_tool, mass : sequence of path, float [kg]
        Of the tool alone.
    rate : float, optional [Hz]
        Of files that tell none.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> rung = ri.ring("DRAWN.toml", "whole.wav")
    >>> print(rung)
    T: bending 1, bending 2 of 2 lines; good
    """
    from rcsa_ident.io.recordings.open_recording import open_recording
    from rcsa_ident.io.settings.setups import read_tooling
    from rcsa_ident.workflows.ring import ring_tooling

    tooling = tooling if isinstance(tooling, Tooling) else read_tooling(tooling)
    heard, alone = ([open_recording(path, (), rate) for path in paths] for paths in (sounds, bare_tool))
    with threadpool_limits(1):
        return ring_tooling(tooling, heard, alone, mass)
