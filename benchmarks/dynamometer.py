"""Cutting coefficients from a dynamometer's files that nobody here made, its axes told as on its housing and found on the cuts.

``python -m benchmarks dynamometer``. The files lie beside the project, not in it; without them there are no rows. Beside them stands what
was published of five feeds of the same cutter, by mean forces with the axes put right by hand.
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from rcsa_ident.io.recordings.readers import read_cut
from rcsa_ident.io.settings.setups import read_campaign
from rcsa_ident.workflows.calibrate import calibrate

FILES = Path(__file__).resolve().parents[2] / "shared" / "data"
#: Feeds [mm/min] of the full slots at 6000 rev/min and 3 mm by two teeth, and the published answer.
FEEDS = (300, 900, 1500)
PUBLISHED = "| published, five feeds, mean forces | put right by hand | 959 ± 140 | 251 ± 330 | | 77–92 | | |"
_TOOLING = """\
name = "T1"
[cutter]
teeth = 2
diameter_mm = 25.0
helix_deg = 30.0
[tool]
stickout_mm = 60.0
segments = [ { length_mm = 100.0, outer_diameter_mm = 25.0, material = "steel" } ]
[holder]
insertion_mm = 40.0
segments = [ { length_mm = 60.0, outer_diameter_mm = 60.0, inner_diameter_mm = 25.0, material = "steel" } ]
[contact]
translational_stiffness = 2.0e10
rotational_stiffness = 6.0e5
translational_damping = 6.0e4
rotational_damping = 9.0
"""


def campaign(folder: Path) -> Path:
    """Write the campaign of the three files into a folder: channels as the housing names them, the feed along X; return the folder."""
    lines = ['[campaign]\nname = "dynamometer"\nsampling_rate_hz = 10000']
    lines += [f'[sensors.F{axis}]\nquantity = "force"\naxis = "{axis.upper()}"\nsensitivity = 1.0' for axis in "xyz"]
    lines.append('[workpiece]\nname = "aluminium"\ntangential_coefficient_mpa = 900\nradial_ratio = 0.3\n[toolings]\nT1 = "T1.toml"')
    for feed in FEEDS:
        name = f"6-n6000f{feed}ap3ae25.csv"
        shutil.copy(FILES / "dynamometer" / name, folder / name)
        lines.append(
            f'[[cuts]]\nid = "f{feed}"\ntooling = "T1"\nspindle_speed_rpm = 6000\naxial_depth_mm = 3\n'
            f"feed_per_tooth_mm = {feed / 12000:g}\n"
            f'entry_angle_deg = 0\nexit_angle_deg = 180\nfeed_direction = "+X"\ncut = "{name}"'
        )
    (folder / "T1.toml").write_text(_TOOLING)
    (folder / "campaign.toml").write_text("\n".join(lines) + "\n")
    return folder


def table() -> list[str]:
    """Return a line for each method, with axes as told and found."""
    lines = [
        "| method | axes | K_tc [MPa] | K_rc [MPa] | answer | once per revolution [N] | unexplained | time [s] |",
        "|---|---|---|---|---|---|---|---|",
    ]
    if not (FILES / "dynamometer").exists():
        return lines
    with tempfile.TemporaryDirectory() as folder:
        setup = read_campaign(campaign(Path(folder)))
        read = partial(read_cut, setup.sensors, setup.sampling_rate)
        for signal in (False, True):
            for any_axes in (False, True):
                began = time.process_time()
                name = "the force over time" if signal else "mean forces"
                found = calibrate(setup, read, signal, any_axes=any_axes)
                (tangential, width), (radial, radial_width) = found.forces.of("K_tc"), found.forces.of("K_rc")
                once = [float(m.once_per_revolution[:2].max()) for m in found.used]
                cells = [
                    name,
                    ", ".join(found.choices[0].shown()) if found.choices else "as told",
                    f"{1e-6 * tangential:.0f} ± {1e-6 * width:.0f}",
                    f"{1e-6 * radial:.0f} ± {1e-6 * radial_width:.0f}",
                    "refused" if tangential <= 0.0 else "suspect" if found.forces.reasons else "usable",
                    f"{min(once):.0f}–{max(once):.0f}",
                    f"{100.0 * found.forces.misfit:.0f} %",
                    f"{time.process_time() - began:.1f}",
                ]
                lines.append("| " + " | ".join(cells) + " |")
    return [*lines, PUBLISHED]


def main(arguments: Sequence[str]) -> None:
    """Print the table."""
    argparse.ArgumentParser(
        prog="benchmarks dynamometer", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    ).parse_args(arguments)
    print("\n".join(table()))
