"""How well `listen` tells chatter from stable cuts, and the spindle's speed from its multiples.

``python -m benchmarks listening [--files FOLDER] [--records N]``. Made-up records (`benchmarks.listening_records`) whose seeds the odds
were not fitted to, and real ones of a folder that lies beside the project: the same layout as ``shared/data``. The peer is the criterion
that was used before: the share that lines beside the orders hold of the whole record, against 15 % and a quarter of the orders' share.
``--fit`` prints the weights of the odds, fitted by logistic regression to the first N seeds.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from benchmarks.listening_records import draw, speeds_to_tell
from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import from_rpm, to_hz
from rcsa_ident.io.recordings.open_recording import open_recording
from rcsa_ident.signals.listening import listen, stands_beside
from rcsa_ident.signals.recording import Quantity
from rcsa_ident.signals.sound.asynchronous_lines import OffOrders
from rcsa_ident.signals.sound.speed_search import rotation_near
from rcsa_ident.workflows.listen import listen_to

#: Seeds that the odds were fitted to, and the first one of those that judge them.
FITTED, JUDGING = 160, 1000
#: Thresholds of the table.
THRESHOLDS = (0.2, 0.3, 0.5, 0.7, 0.8, 0.9)
#: Real records by a part of their names: teeth, programmed speed [rev/min] where it has to be told, and whether the cut chatters.
REAL = {
    "T100_D0p05IN_4000RPM": (4, None, False),
    "T25_D0p125IN_4000RPM": (4, None, False),
    "T50_D0p125IN_4000RPM": (4, None, False),
    "T100_0p375IN_12000RPM": (3, None, False),
    "T50_0p125IN_12000RPM": (3, None, False),
    "T25_0p25IN_6900RPM": (4, None, False),
    "T50_0p25IN_6900RPM": (4, None, True),
    "5A_SKF_ON_TABLE": (4, None, False),
    "5A_EBI_ON_TABLE": (4, None, False),
    "Chatter.wav": (6, None, True),
    "Stable.wav": (6, None, False),
    "26.mat": (None, 2600.0, False),
    "30.mat": (None, 2600.0, False),
}


def judged(seed: int) -> tuple[bool, OffOrders, float]:
    """Return whether a made-up record chatters, its lines beside the orders at the true speed, and the peer's measure of them."""
    made = draw(seed)
    rotation = rotation_near(made.samples, made.rate, made.spindle)
    beside, explained = stands_beside(made.samples, made.rate, rotation, made.quantity, made.teeth)
    return made.chatter is not None, beside, beside.share / max(0.15, 0.25 * max(explained, 0.0))


def area(values: FloatArray, chatters: FloatArray) -> float:
    """Return the area under the curve of hits over false alarms."""
    yes, no = values[chatters], values[~chatters]
    return float(np.mean((yes[:, None] > no) + 0.5 * (yes[:, None] == no)))


def made_up(first: int, count: int) -> list[str]:
    """Return the table of hits and false alarms over made-up records."""
    rows = [judged(seed) for seed in range(first, first + count)]
    chatters = np.array([row[0] for row in rows])
    now, before = np.array([row[1].probability for row in rows]), np.array([row[2] for row in rows])
    lines = ["| threshold | false alarms | hits |", "|---|---|---|"]
    lines += [f"| {each} | {np.mean(now[~chatters] > each):.3f} | {np.mean(now[chatters] > each):.3f} |" for each in THRESHOLDS]
    lines.append(f"| before: share of the record | {np.mean(before[~chatters] > 1.0):.3f} | {np.mean(before[chatters] > 1.0):.3f} |")
    return [*lines, "", f"area under the curve: {area(now, chatters):.4f}, before {area(before, chatters):.4f}"]


def real(folder: Path) -> list[str]:
    """Return the table of the real records that are in a folder."""
    lines = ["| record | label | probability of chatter | verdict |", "|---|---|---|---|"]
    values, labels = [], []
    for part, (teeth, rpm, chatters) in REAL.items():
        for path in sorted(each for each in folder.rglob("*") if part in each.name and each.suffix in (".csv", ".wav", ".mat")):
            opened = open_recording(path, (), 20e3 if path.suffix == ".mat" else None)
            try:
                quantity, channels, _ = opened.of()
            except InputError:
                # columns without units: time, acceleration along three axes, another sensor
                quantity, channels = Quantity.ACCELERATION, opened.channels[1:4]
            speed = None if rpm is None else from_rpm(rpm)
            found = listen_to(opened.rate, [each.samples for each in channels], quantity, teeth, speed)
            values.append(found.chatter_probability or 0.0)
            labels.append(chatters)
            lines.append(f"| {path.name[-48:]} | {'chatter' if chatters else 'stable'} | {values[-1]:.3f} | {found.verdict} |")
    if 0 < sum(labels) < len(labels):
        lines += ["", f"area under the curve: {area(np.array(values), np.array(labels)):.4f}"]
    return lines


def speeds() -> str:
    """Return how many of the sounds with little run-out are told right, and the least probability of those."""
    right = []
    for made in speeds_to_tell():
        found = listen(made.samples, made.rate, made.quantity, made.teeth)
        if found.spindle_speed is not None and abs(to_hz(found.spindle_speed) / made.spindle - 1.0) < 1e-3:
            right.append(found.speed_probabilities[0])
    return (
        f"sounds with little run-out, teeth told: {len(right)} of {len(speeds_to_tell())} speeds right, probabilities from {min(right):.3f}"
    )


def weights(count: int) -> FloatArray:
    """Return the constant and the weights of the odds, by logistic regression."""
    rows = [judged(seed) for seed in range(count)]
    sign = np.array([1.0 if row[0] else -1.0 for row in rows])
    evidence = np.array([[1.0, *row[1].evidence] for row in rows])
    found: FloatArray = minimize(lambda w: np.logaddexp(0.0, -sign * (evidence @ w)).sum() + 0.05 * np.sum(w[1:] ** 2), np.zeros(4)).x
    return found


def main(arguments: Sequence[str]) -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(prog="benchmarks listening", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--files", type=Path, help="folder of real recordings")
    parser.add_argument("--records", type=int, default=FITTED, help="made-up records")
    parser.add_argument("--first", type=int, default=JUDGING, help="seed of the first of them")
    parser.add_argument("--fit", action="store_true", help="print the weights of the odds instead")
    given = parser.parse_args(arguments)
    if given.fit:
        print(weights(given.records))
        return
    print("\n".join([*made_up(given.first, given.records), "", speeds()]))
    if given.files is not None:
        print("\n".join(["", *real(given.files)]))
