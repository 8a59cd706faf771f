"""What a dozen broken files, campaigns and toolings answer: exit code and sentence of the command line.

Starts from a sound campaign (the first cut of the sample runs) and breaks one thing at a time.
"""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from typer.testing import CliRunner

from benchmarks.timing import row
from rcsa_ident.cli import app

DATA = Path(__file__).resolve().parent.parent / "data"
CUT, AIR = "recordings/S1-ER32-00_cut.h5", "recordings/S1-ER32-00_air.h5"
TOOLING = "toolings/S1-ER32.toml"


def _replace(name: str, old: str, new: str) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        text = (folder / name).read_text()
        assert old in text, f"{name} has no {old!r}"
        (folder / name).write_text(text.replace(old, new, 1))

    return change


def _samples(edit: Callable[[np.ndarray], np.ndarray]) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        with h5py.File(folder / CUT, "r+") as file:
            file["flange_x"][...] = edit(file["flange_x"][...])

    return change


def _lost(x: np.ndarray) -> np.ndarray:
    x[2000:2040] = np.nan
    return x


def _chatter(x: np.ndarray) -> np.ndarray:
    return x + 0.02 * np.sin(2.0 * np.pi * 903.0 * np.arange(x.size) / 25600.0)


def _truncated(folder: Path) -> None:
    data = (folder / CUT).read_bytes()
    (folder / CUT).write_bytes(data[: len(data) // 2])


def _external(folder: Path) -> None:
    with h5py.File(folder / CUT, "r+") as file:
        del file["flange_x"]
        file["flange_x"] = h5py.ExternalLink("/etc/hostname", "x")


def _terabytes(folder: Path) -> None:
    with h5py.File(folder / CUT, "r+") as file:
        del file["flange_x"]
        file.create_dataset("flange_x", shape=(10**12,), dtype="f4", chunks=(10**6,))


def _no_rate(folder: Path) -> None:
    with h5py.File(folder / CUT, "r+") as file:
        del file.attrs["sampling_rate_hz"]
    _replace("campaign.toml", "sampling_rate_hz = 25600.0\n", "")(folder)


CASES: dict[str, Callable[[Path], None]] = {
    "recording cut off in the middle": _truncated,
    "recording with a link out of the file": _external,
    "recording that declares a terabyte": _terabytes,
    "recording without a rate, campaign neither": _no_rate,
    "recording with 40 lost samples": _samples(_lost),
    "recording saturated": _samples(lambda x: np.clip(x, *np.quantile(x, [0.02, 0.98]))),
    "recording with chatter": _samples(_chatter),
    "recording frozen": _samples(lambda x: np.where(np.arange(x.size) // 300 == 9, x[2700], x)),
    "campaign: channel not in the file": _replace("campaign.toml", "[sensors.flange_x]", "[sensors.flange_q]"),
    "campaign: speed in Hz": _replace("campaign.toml", "spindle_speed_rpm = 8000", "spindle_speed_rpm = 133.3"),
    "campaign: unknown key": _replace("campaign.toml", "axial_depth_mm", "axial_dept_mm"),
    "campaign: recording outside the folder": _replace("campaign.toml", CUT, "../../etc/passwd"),
    "campaign: coefficient in Pa": _replace("campaign.toml", "tangential_coefficient_mpa = 902", "tangential_coefficient_mpa = 902e6"),
    "campaign: TOML error": _replace("campaign.toml", "[workpiece]", "[workpiece"),
    "tooling: three teeth declared, four cut": _replace(TOOLING, "teeth = 4", "teeth = 3"),
    "tooling: two teeth declared, four cut": _replace(TOOLING, "teeth = 4", "teeth = 2"),
    "tooling: modulus in Pa": _replace(TOOLING, "youngs_modulus_gpa = 600.0", "youngs_modulus_gpa = 600e9"),
    "tooling: stickout longer than the tool": _replace(TOOLING, "stickout_mm = 70.5", "stickout_mm = 170.5"),
    "tooling: bore wider than the holder": _replace(TOOLING, "inner_diameter_mm = 14.0", "inner_diameter_mm = 114.0"),
    "tooling: material that nobody knows": _replace(TOOLING, 'material = "steel"', 'material = "stel"'),
}


def sound_campaign(folder: Path) -> None:
    """Write the sample runs' first cut as a campaign of its own."""
    (folder / "recordings").mkdir(parents=True)
    (folder / "toolings").mkdir()
    source = DATA / "sample_runs"
    for name in (CUT, AIR, TOOLING):
        shutil.copyfile(source / name, folder / name)
    text = (source / "campaign.toml").read_text().replace('"S2-PG25" = "toolings/S2-PG25.toml"\n', "")
    head, first, *_ = text.split("[[cuts]]")
    (folder / "campaign.toml").write_text(f"{head}[[cuts]]{first}")


def run() -> list[dict[str, Any]]:
    """Print each answer; the row counts how many were refused or left out."""
    runner = CliRunner()
    refused = 0
    with tempfile.TemporaryDirectory() as scratch:
        for number, (name, breaks) in enumerate(CASES.items()):
            folder = Path(scratch) / f"case{number}"
            sound_campaign(folder)
            if "youngs_modulus_gpa = 600.0" not in (folder / TOOLING).read_text():
                with (folder / TOOLING).open("a") as file:
                    file.write("\n[materials.carbide]\nyoungs_modulus_gpa = 600.0\n")
            breaks(folder)
            answer = runner.invoke(app, ["check", str(folder), "--processes", "1", "--json"])
            refused += answer.exit_code == 2
            told = json.loads(answer.stdout)
            words = told.get("error") or "; ".join(reason for record in told["recordings"] for reason in record["reasons"])
            print(f"{name:<44} exit {answer.exit_code}: {words.replace(str(folder), '')}")
    return [row("broken inputs refused with exit code 2", float(refused), float(len(CASES)), "inputs", "peer: all of them")]
