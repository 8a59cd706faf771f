"""What recordings that nobody here made say by themselves, beside least squares at constant speeds; and what listening costs.

``python -m benchmarks recordings [--out docs/real_recordings.md]``. The files lie beside the project, not in it; without them there are
no rows. The peer knows no following: a plain least-squares fit of the same orders, at the one constant speed that explains most, and
in windows of half a second, each at the constant speed that explains most of it.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks import dynamometer
from benchmarks.dynamometer import FILES
from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.units import to_hz, to_rpm
from rcsa_ident.io.recordings.open_recording import open_recording
from rcsa_ident.signals.listening import Listening
from rcsa_ident.signals.recording import Quantity
from rcsa_ident.workflows.listen import listen_to

#: What is told, by the file's name: a sound of six teeth.
TOLD = {"Chatter.wav": 6, "Stable.wav": 6}
#: Orders of the peer, and how far its windows look about the mean speed.
_ORDERS, _ABOUT = 30, 4e-3
#: A cut that changes: in its loud part the tool enters, meets other material and leaves; between these times [s] it is even.
_CHANGING, _EVEN = "EBI_T50_0p125IN_12000RPM", (0.5, 3.5)


def share(samples: FloatArray, angle: FloatArray, orders: int = _ORDERS) -> float:
    """Return the share of the variance that the orders of an angle explain, both per degree of freedom, by least squares."""
    phase = np.outer(angle, np.arange(1, orders + 1))
    basis = np.concatenate([np.ones((angle.size, 1)), np.cos(phase), np.sin(phase)], axis=1)
    fitted, _, rank, _ = np.linalg.lstsq(basis, samples, rcond=1e-6)
    rest = np.sum((samples - basis @ fitted) ** 2) / (angle.size - rank)
    return float(1.0 - rest / (np.sum((samples - samples.mean(axis=0)) ** 2) / (angle.size - 1)))


def constant(part: FloatArray, rate: float, hertz: float, orders: int = _ORDERS) -> tuple[float, float, float]:
    """Return what one constant speed explains, what windows at their own explain together, and their mean speed [Hz]."""
    time_, trial = np.arange(part.shape[0]) / rate, hertz * (1.0 + np.linspace(-_ABOUT, _ABOUT, 41))
    whole = max(share(part, 2.0 * np.pi * each * time_, orders) for each in hertz * (1.0 + np.linspace(-1e-3, 1e-3, 41)))
    length = int(0.5 * rate)
    own, speeds, weights = [], [], []
    for start in range(0, part.shape[0] - length + 1, length):
        window, local = part[start : start + length], time_[:length]
        shares = [share(window, 2.0 * np.pi * each * local, orders) for each in trial]
        own.append(max(shares))
        speeds.append(trial[int(np.argmax(shares))])
        weights.append(float(np.sum(window.var(axis=0))))
    return whole, float(np.average(own, weights=weights)), float(np.median(speeds))


def told(path: Path) -> tuple[Listening, FloatArray, float, Quantity, float]:
    """Return what a file says, its samples and rate, what they are, and the processor time that it took [s]."""
    opened = open_recording(path)
    quantity, channels, _ = opened.of()
    began = time.process_time()
    answer = listen_to(opened.rate, [each.samples for each in channels], quantity, TOLD.get(path.name))
    return answer, answer.record.samples, opened.rate, quantity, time.process_time() - began


def table(paths: Sequence[Path]) -> list[str]:
    """Return a line of the table for each file."""
    lines = [
        "| file | verdict | speed [rev/min] | peer's windows | wander [%] | teeth | explained share | peer: windows, one speed "
        "| chatter [Hz] | speeds to try [rev/min] | time [s] |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for path in paths:
        told(path)  # the first call compiles
        answer, samples, rate, _, seconds = told(path)
        part = samples[round(answer.part[0] * rate) : round(answer.part[1] * rate)]
        peer = windows = ""
        if answer.spindle_speed is not None and rate < 10e3:
            whole, own, hertz = constant(part, rate, to_hz(answer.spindle_speed))
            peer, windows = f"{own:.3f}, {max(whole, 0.0):.3f}", f"{60.0 * hertz:.1f}"
        speed = "" if answer.spindle_speed is None else f"{to_rpm(answer.spindle_speed):.1f}"
        if answer.ramp is not None:
            speed += f", ramp {to_rpm(answer.ramp[0]):.0f} to {to_rpm(answer.ramp[1]):.0f}"
        chatter = " or ".join(f"{each:.0f}" for each in answer.aliases)
        if answer.chatter:
            chatter += "; lines " + ", ".join(f"{each:.0f}" for each in answer.lines[:4])
        cells = [
            path.name,
            str(answer.verdict),
            speed,
            windows,
            "" if answer.wander is None else f"{100.0 * answer.wander:.3f}",
            str(answer.teeth or ""),
            "" if answer.explained_share is None else f"{answer.explained_share:.3f}" + (" folded" if answer.folded else ""),
            peer,
            chatter,
            ", ".join(f"{to_rpm(each):.0f}" for each in answer.suggested_speeds),
            f"{seconds:.2f}",
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def parts_of_a_cut(path: Path) -> list[str]:
    """Return what is explained of a cut's loud part and of its even stretch alone, of all channels and of those in the plane."""
    answer, samples, rate, quantity, _ = told(path)
    assert answer.spindle_speed is not None
    below = int(0.49 * rate / to_hz(answer.spindle_speed))
    lines = [f"| part [s] | channels | peer, orders to {below} | peer, orders to {_ORDERS} | followed |", "|---|---|---|---|---|"]
    for first, last in (answer.part, _EVEN):
        for names in ("X, Y, Z", "X, Y"):
            columns = ["XYZ".index(name) for name in names.split(", ")]
            part = samples[round(first * rate) : round(last * rate), columns]
            peers = [constant(part, rate, to_hz(answer.spindle_speed), orders)[1] for orders in (below, _ORDERS)]
            own = listen_to(rate, list(part.T), quantity).explained_share
            lines.append(f"| {first:.1f} to {last:.1f} | {names} | {peers[0]:.3f} | {peers[1]:.3f} | {own:.3f} |")
    return lines


def costs() -> list[str]:
    """Return the times of records that are made here."""
    lines = ["| record | time [s] |", "|---|---|"]
    rng = np.random.default_rng(1)
    for name, rate, seconds, channels, quantity, hertz in (
        ("sound of a phone, 10 s at 48 kHz, 7200 rev/min", 48000.0, 10.0, 1, Quantity.SOUND, 120.0),
        ("three accelerometers, 60 s at 51.2 kHz, 7200 rev/min", 51200.0, 60.0, 3, Quantity.ACCELERATION, 120.0),
        ("three accelerometers, 60 s at 51.2 kHz, 1500 rev/min", 51200.0, 60.0, 3, Quantity.ACCELERATION, 25.0),
    ):
        n = int(rate * seconds)
        knots = np.arange(0.0, seconds + 1.0, 0.3)
        wander = np.interp(np.arange(n) / rate, knots, 1e-3 * rng.standard_normal(knots.size))
        angle = 2.0 * np.pi * np.cumsum(hertz * (1.0 + wander)) / rate
        signal = sum(a * np.cos(m * angle) for m, a in {1: 0.2, 4: 1.0, 5: 0.1, 8: 0.5, 12: 0.3}.items())
        records = [signal + 0.3 * rng.standard_normal(n) for _ in range(channels)]
        listen_to(rate, [each[: int(2.0 * rate)] for each in records], quantity)
        taken = []
        for _ in range(3):
            began = time.process_time()
            with threadpool_limits(1):
                listen_to(rate, records, quantity)
            taken.append(time.process_time() - began)
        # whatever else the host does only adds to it
        lines.append(f"| {name} | {min(taken):.2f} |")
    return lines


def main(arguments: Sequence[str]) -> None:
    """Print the tables, or write the page that holds them."""
    parser = argparse.ArgumentParser(
        prog="benchmarks recordings", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, help="page whose tables are written anew")
    given = parser.parse_args(arguments)
    files = [*sorted((FILES / "milling_acceleration").glob("*.csv")), *sorted((FILES / "milling_sound").glob("*.wav"))]
    cut = [path for path in files if _CHANGING in path.name]
    tables = [
        "\n".join(table(files)),
        *("\n".join(parts_of_a_cut(path)) for path in cut),
        "\n".join(costs()),
        "\n".join(dynamometer.table()),
    ]
    print("\n\n".join(tables))
    if given.out is not None:
        given.out.write_text(_with_tables(given.out.read_text(encoding="utf-8"), tables), encoding="utf-8")


def _with_tables(page: str, tables: Sequence[str]) -> str:
    """A page whose tables, one after the other, are replaced."""
    parts, inside, count = [], False, 0
    for line in page.splitlines():
        if line.startswith("|"):
            if not inside:
                parts.append(tables[count])
                count += 1
            inside = True
            continue
        inside = False
        parts.append(line)
    return "\n".join(parts) + "\n"
