"""``python -m benchmarks format_examples``: write ``docs/formats/examples/``, a small file of every format.

Samples are 40 ms of a cut of the sample runs; sound, hits and receptances are made of two modes, with a fixed seed. Tables that commands
write are written by these commands.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

import numpy as np

import rcsa_ident as ri
from rcsa_ident.base.units import from_hz
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.io.curves.exports import write_receptances_uff
from rcsa_ident.io.curves.tips import write_frf_csv
from rcsa_ident.io.paths.meshes import write_mesh
from rcsa_ident.io.recordings.hdf5 import write_hdf5
from rcsa_ident.io.recordings.readers import read_signals
from tests.fixtures import recording_formats as formats
from tests.fixtures.by_hand import flange_file, result_text
from tests.fixtures.tool_library import END_MILL, library
from tests.io.urdf_files import urdf_of

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "docs" / "formats" / "examples"
#: Samples of a recording, and channels.
COUNT, CHANNELS = 1024, ("flange_x", "fixture_x")
#: Of the sound: rate [Hz], and the two tones in it [Hz].
SOUND_RATE, TONES = 48_000, (533.0, 1280.0)
#: Of the tip: natural frequencies [Hz], damping ratios, modal stiffnesses [N/m].
MODES = ((820.0, 0.035, 1.2e7), (1580.0, 0.02, 2.6e7))
#: Kinds of sound files that libsndfile writes, by suffix.
SOUNDS = {
    ".w64": ("W64", "PCM_16"),
    ".aif": ("AIFF", "PCM_16"),
    ".aiff": ("AIFF", "PCM_16"),
    ".caf": ("CAF", "PCM_16"),
    ".flac": ("FLAC", "PCM_16"),
    ".ogg": ("OGG", "VORBIS"),
    ".opus": ("OGG", "OPUS"),
    ".mp3": ("MP3", "MPEG_LAYER_III"),
    ".rf64": ("RF64", "PCM_16"),
}

#: Tables of text by their suffixes, with a delimiter and a decimal sign each.
TABLES = {".csv": (",", "."), ".txt": (";", "."), ".dat": (" ", "."), ".tsv": ("\t", "."), ".asc": (";", ",")}

TEXTS = {
    "TOOLING.toml": """\
#:schema tooling.json
name = "EM12-4 in ER32"
[cutter]
teeth = 4
diameter_mm = 12.0
helix_deg = 30.0
[tool]                        # a solid carbide end mill, 110.5 mm long
model = "EM12-4"
stickout_mm = 70.5
segments = [
  { length_mm = 26.0, outer_diameter_mm = 9.6, material = "carbide" },   # fluted: equivalent diameter
  { length_mm = 84.5, outer_diameter_mm = 12.0, material = "carbide" },
]
[holder]
model = "ER32"
insertion_mm = 40.0
segments = [
  { length_mm = 72.0, outer_diameter_mm = 50.0, inner_diameter_mm = 12.0, material = "steel" },
  { length_mm = 26.0, outer_diameter_mm = 63.0, inner_diameter_mm = 20.0, material = "steel" },
]
[contact]                     # per metre of insertion
translational_stiffness = 2.0e10
rotational_stiffness = 6.0e5
translational_damping = 1.0e5
rotational_damping = 40.0
[spread]                      # how well the drawing is known; what is left out has its default
stickout_mm = 0.3
""",
    "MODES.toml": "#:schema modes.json\n"
    + "".join(
        f"[[{axis}]]\nnatural_frequency_hz = {shift * f:g}\nnatural_frequency_sd_hz = 40.0\ndamping_ratio = {zeta}\n"
        f"damping_ratio_sd = 0.01\nstiffness_n_per_m = {k:.3g}\nstiffness_sd_n_per_m = {0.2 * k:.3g}\n"
        for axis, shift in (("x", 1.0), ("y", 0.95))
        for f, zeta, k in MODES
    )
    + "[coefficients]\ntangential_mpa = 900.0\ntangential_sd_mpa = 90.0\nradial_mpa = 270.0\nradial_sd_mpa = 50.0\n",
    "CASES.toml": """\
#:schema cases.json
[[cases]]
name = "down-milling, half immersion"
tooling = "TOOLING.toml"
radial_depth_mm = 6.0
strategy = "down"
feed_per_tooth_mm = 0.1
tests = "CUTS.csv"
idle = ["X=tap_x.frf"]
""",
    "campaign/campaign.toml": """\
#:schema ../campaign.json
[campaign]
name = "two cuts of the sample runs"
sampling_rate_hz = 25600.0       # of recordings that carry none
[sensors.flange_x]               # the channel's name in the recordings
quantity = "displacement"
axis = "X"
sensitivity = 10.0e3             # V/m
[sensors.fixture_x]
quantity = "acceleration"
axis = "X"
sensitivity = 1.1094e-3          # V/(m/s^2)
[workpiece]
name = "EN AW-6082"
tangential_coefficient_mpa = 902.0
radial_ratio = 0.26
[toolings]
EM12 = "EM12.toml"
[[cuts]]
id = "EM12-00"
tooling = "EM12"
spindle_speed_rpm = 8000.0
axial_depth_mm = 0.4
feed_per_tooth_mm = 0.1
entry_angle_deg = 90.0
exit_angle_deg = 180.0
feed_direction = "+X"
cut = "cut.h5"
air = "air.h5"
[[frfs]]
id = "EM12, tip"
tooling = "EM12"
axis = "X"
response = "tip"
force = "tip"
file = "tap_x.frf"
""",
    "CUTS.csv": """\
spindle_speed_rpm,axial_depth_mm,verdict,chatter_frequency_hz
6000,0.8,stable,
7500,1.6,chatter,871
9000,1.2,marginal,
12000,3.0,stable,
""",
    "SPINDLE.csv": "spindle_speed_rpm,power_kw,torque_nm\n1000,1.0,9.5\n8000,8.0,9.5\n18000,10.0,5.3\n",
    "MAP.csv": "z_mm,entry_angle_deg,exit_angle_deg\n0,120,180\n1,100,180\n2,90,180\n",
    "PATH.csv": """\
x_mm,y_mm,z_mm,i,j,k,feed_mm_per_min,spindle_speed_rpm
-10,6,5,0,0,1,inf,8000
-10,6,-1,0,0,1,inf,8000
50,6,-1,0,0,1,1200,8000
50,14,-1,0,0,1,1200,8000
-10,14,-1,0,0,1,1200,8000
""",
    "FORCES_along_path.csv": """\
time_s,force_x_n,force_y_n,force_z_n,x_mm,y_mm,z_mm
0.0,-58,-130,35,-10,6,-1
3.0,-58,-130,35,50,6,-1
3.4,-58,-130,35,50,14,-1
6.4,-58,-130,35,-10,14,-1
""",
    "ARM.csv": """\
q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n,dx_mm,dy_mm,dz_mm
0,20,30,10,-40,0,500,0,0,0.41,0.02,-0.05
0,20,30,10,-40,0,0,500,0,0.03,0.98,0.01
0,20,30,10,-40,0,0,0,500,-0.05,0.02,0.37
""",
    "POSTURES.csv": "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n0,20,30,10,-40,0\n15,25,20,0,-30,45\n",
    "ISO13399.json": json.dumps(
        {
            "description": "face mill", "unit": "millimeters", "DC": 63, "ZEFP": 5, "KAPR": 45, "APMX": 6, "RE": 0.8, "BS": 1.2,
            "OAL": 90, "LB": 50, "LCF": 8, "DMM": 27,
            "holder": {"segments": [{"height": 80, "lower-diameter": 60, "upper-diameter": 60}]},
        },
        indent=1,
    )
    + "\n",
}  # fmt: skip
_PROGRAM = """\
%
O1001 (A SLOT AND ITS WAY BACK, DEPTH 1)
(T1 D12 END MILL; Z0 IS THE TOP OF THE STOCK)
N10 G21 G90 G94 G17
N20 T1 M6
N30 S8000 M3
N40 G0 X-10. Y6. Z5.
N50 G0 Z-1.
N60 G1 X50. F1200.
N70 G3 X50. Y14. I0. J4.
N80 G1 X-10.
N90 G0 Z5.
N100 M30
%
"""
#: Forms that a program's suffixes stand for: the words are the same.
PROGRAMS = {
    ".nc": _PROGRAM,
    ".tap": _PROGRAM.lower(),
    ".ngc": _PROGRAM.replace("(", "; (", 3),
    ".gcode": _PROGRAM.replace("%\n", ""),
    ".mpf": _PROGRAM.replace("%\n", "").replace("I0. J4.", "CR=4."),
    ".eia": _PROGRAM.replace("G21 G90 G94 G17", "G0 G17 G21 G40 G49 G80 G90 G94"),
    ".cnc": _PROGRAM.replace("N10 ", "G05 P10000\nN10 ").replace("X-10. Y6. Z5.", "X-10. Y6. Z5. A0."),
    ".txt": _PROGRAM.replace("\n", "\r\n"),
}


def receptance(frequency: np.ndarray, shift: float = 1.0) -> np.ndarray:
    """Return the tip's receptance [m/N] at frequencies [Hz], shape (n,); `shift` moves its natural frequencies."""
    f = frequency.astype(complex)
    return sum(1.0 / (k * (1.0 - (f / (shift * own)) ** 2 + 2j * zeta * f / (shift * own))) for own, zeta, k in MODES)


def sound() -> np.ndarray:
    """Return 0.1 s of two tones and some noise, full scale 1, shape (n,)."""
    time = np.arange(SOUND_RATE // 10) / SOUND_RATE
    noise = np.random.default_rng(1).normal(0.0, 0.01, time.size)
    return 0.4 * np.sin(2 * np.pi * TONES[0] * time) + 0.1 * np.sin(2 * np.pi * TONES[1] * time) + noise


def _recordings(folder: Path) -> None:
    source = ROOT / "data" / "sample_runs" / "recordings"
    rate, signals = read_signals(source / "S1-ER32-00_cut.h5", CHANNELS)
    channels = {name: np.asarray(values[:COUNT], dtype=np.float32) for name, values in zip(CHANNELS, signals, strict=True)}
    for suffix in (".h5", ".hdf5"):
        write_hdf5(folder / f"cut{suffix}", rate, channels)
    formats.csv(folder / "cut.csv", rate, channels)
    formats.tdms(folder / "cut.tdms", rate, channels)
    formats.uff(folder / "cut.uff", rate, channels)
    formats.uff(folder / "cut.unv", rate, channels, binary=True)
    formats.mat5(folder / "cut.mat", rate, channels)
    formats.mat73(folder / "cut_v73.mat", rate, channels)
    formats.parquet(folder / "cut.parquet", rate, channels)
    # a cut of a campaign is usable as a whole only
    for kind in ("cut", "air"):
        _, whole = read_signals(source / f"S1-ER32-00_{kind}.h5", CHANNELS)
        write_hdf5(folder / "campaign" / f"{kind}.h5", rate, dict(zip(CHANNELS, map(np.asarray, whole), strict=True)))
    # tables that tell units and rate themselves, as loggers write them
    motion = [f"{x:.6g};{a:.5g}" for x, a in zip(channels["flange_x"] / 10e3 * 1e6, channels["fixture_x"] / 1.1094e-3, strict=True)]
    head = ["Logger 7", f"Sampling rate: {rate:g} Hz", "flange_x;fixture_x", "um;m/s^2"]
    for suffix, (delimiter, decimal) in TABLES.items():
        lines = [line.replace(".", decimal).replace(";", delimiter) for line in (*head[2:], *motion)]
        (folder / f"logger{suffix}").write_text("\n".join([*head[:2], *lines]) + "\n", encoding="utf-8")
    labview = [
        "LabVIEW Measurement",
        "Separator\tTab",
        "X_Columns\tNo",
        "***End_of_Header***",
        "",
        "Channels\t2",
        "Y_Unit_Label\tum\tm/s^2",
    ]
    labview += [f"Delta_X\t{1.0 / rate!r}\t{1.0 / rate!r}", "***End_of_Header***", "X_Value\tflange_x\tfixture_x\tComment"]
    labview += ["\t" + line.replace(";", "\t") for line in motion]
    (folder / "logger.lvm").write_text("\n".join(labview) + "\n", encoding="utf-8")


def _sounds(folder: Path) -> None:
    import soundfile

    samples = sound()
    formats.wav(folder / "sound.wav", SOUND_RATE, {"microphone": samples}, bits=16)
    (folder / "sound.bwf").write_bytes((folder / "sound.wav").read_bytes())
    for suffix, (kind, coding) in SOUNDS.items():
        soundfile.write(folder / f"sound{suffix}", samples, SOUND_RATE, format=kind, subtype=coding)


def _receptances(folder: Path) -> None:
    frequency = np.arange(100.0, 3001.0, 10.0)
    values = {"X": receptance(frequency), "Y": receptance(frequency, 0.95)}
    write_frf_csv(folder / "FRF.csv", frequency, values)
    tip = {
        axis: Receptance(from_hz(frequency), value[:, None, None], *((Coordinate("tip", Dof(axis.lower())),),) * 2)
        for axis, value in values.items()
    }
    write_receptances_uff(folder / "tap.uff", tip, "tip")
    write_receptances_uff(folder / "tap.unv", tip, "tip", binary=True)
    # accelerance, as an accelerometer gives it
    accelerance = -((2 * np.pi * frequency) ** 2) * values["X"] / 9.80665
    rows = [f"{f:.6g} {h.real:.8e} {h.imag:.8e}" for f, h in zip(frequency, accelerance, strict=True)]
    text = "\n".join(["Frequency [Hz] Real [g/N] Imaginary [g/N]", *rows]) + "\n"
    for path in (folder / "tap_x.frf", folder / "campaign" / "tap_x.frf"):
        path.write_text(text, encoding="utf-8")
    head, *lines = flange_file(folder / "FLANGE.csv").read_text(encoding="utf-8").splitlines()
    (folder / "FLANGE.csv").write_text("\n".join([head, *lines[::25]]) + "\n", encoding="utf-8")


def _hits(folder: Path) -> None:
    """Two hits of a hammer on the two modes, the tip's acceleration beside them."""
    rate, count = 8192.0, 2304
    time = np.arange(count) / rate
    force = np.zeros(count)
    for start, size in ((0.005, 310.0), (0.145, 280.0)):
        inside = (time >= start) & (time < start + 0.001)
        force[inside] = size * np.sin(np.pi * (time[inside] - start) / 0.001)
    frequency = np.fft.rfftfreq(4 * count, 1.0 / rate)
    response = -((2 * np.pi * frequency) ** 2) * receptance(frequency)
    acceleration = np.fft.irfft(np.fft.rfft(force, 4 * count) * response)[:count]
    acceleration += np.random.default_rng(2).normal(0.0, 0.02, count)
    rows = [f"{t:.7f},{f:.5g},{a:.6g}" for t, f, a in zip(time, force, acceleration, strict=True)]
    (folder / "hits.csv").write_text("\n".join(["Time (s),Hammer (N),Tip (m/s^2)", *rows]) + "\n", encoding="utf-8")


def _bodies(folder: Path) -> None:
    low, high = np.zeros(3), np.array([0.04, 0.02, 0.01])
    points = np.array([[(low, high)[(k >> axis) & 1][axis] for axis in range(3)] for k in range(8)]) - [0.0, 0.0, 0.01]
    quads = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
    faces = np.array([triangle for a, b, c, d in quads for triangle in ((a, b, c), (a, c, d))])
    for suffix in (".stl", ".obj", ".ply"):
        write_mesh(folder / f"stock{suffix}", points, faces)


def _robots(folder: Path) -> None:
    (folder / "ROBOT.toml").write_bytes((ROOT / "data" / "robots" / "kr210.toml").read_bytes())
    (folder / "ARM.urdf").write_text(urdf_of(ri.sample_robot("kr210")), encoding="utf-8")
    time = np.arange(400) / 200.0
    names, columns = ["time_s"], [time]
    for k, stiffness in ((1, 4.6e6), (2, 7.5e6)):
        joint = 20.0 * np.sin(2 * np.pi * (0.3 + 0.2 * k) * time)
        torque = 4000.0 * np.sin(joint / 30.0)
        names += [f"motor_{k}_deg", f"joint_{k}_deg", f"torque_{k}_nm"]
        columns += [joint + np.degrees(torque / stiffness), joint, torque]
    rows = [",".join(f"{value:.7g}" for value in row) for row in zip(*columns, strict=True)]
    (folder / "MOTION.csv").write_text("\n".join([",".join(names), *rows]) + "\n", encoding="utf-8")


def _outputs(folder: Path) -> None:
    """What commands write, by the commands themselves."""
    cut = ["--ktc-mpa", "900", "--krc", "0.3", "--immersion", "0.5", "--strategy", "down"]
    speeds = ["--speed-from", "4000", "--speed-to", "16000", "--speed-step", "200"]
    modes = ["--modes", "MODES.toml"]
    block = ["--stock", "0 0 -10 40 20 0"]
    for command in (
        ["tooltip", "FLANGE.csv", "TOOLING.toml", "--from", "300", "--to", "3000", "--step", "25", "--out", "TIP.csv"],
        ["lobes", *modes, "TOOLING.toml", *cut, *speeds, "--out", "LOBES.csv"],
        ["path", "remove", "TOOLING.toml", "program.nc", *block, "--out", "ENGAGEMENT.csv", "--part", "part.stl"],
        ["path", "stability", *modes, "TOOLING.toml", "program.nc", *block, "--ktc-mpa", "900", "--krc", "0.3", "--out", "STABILITY.csv"],
    ):
        subprocess.run([sys.executable, "-m", "rcsa_ident.cli", *command], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    os.unlink(folder / "part.stl")
    forces = np.random.default_rng(3).normal(0.0, 20.0, (200, 2))
    rows = [f"{k / 25600.0!r},{x:.6g},{y:.6g},1.5,1.6" for k, (x, y) in enumerate(forces)]
    (folder / "FORCES.csv").write_text("\n".join(["time_s,Fx_n,Fy_n,Fx_std_n,Fy_std_n", *rows]) + "\n", encoding="utf-8")
    with tempfile.TemporaryDirectory() as scratch:
        (folder / "RESULT.json").write_text(result_text(Path(scratch)), encoding="utf-8")
        # the first mode of each direction: a small file
        first = TEXTS["MODES.toml"].split("[[")
        modes = Path(scratch, "MODES.toml")
        modes.write_text("[[".join([*first[:2], first[3]]) + "[coefficients]" + first[4].split("[coefficients]")[1], encoding="utf-8")
        learn = ["learn", str(modes), "TOOLING.toml", "--tests", "CUTS.csv", "--immersion", "0.5", "--strategy", "down"]
        command = [sys.executable, "-m", "rcsa_ident.cli", *learn, "--out", "LEARNT.json"]
        subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)


def write(folder: Path) -> None:
    """Write all examples into a folder."""
    (folder / "campaign").mkdir(parents=True, exist_ok=True)
    for name, text in TEXTS.items():
        (folder / name).write_text(text, encoding="utf-8")
    (folder / "campaign" / "EM12.toml").write_text(TEXTS["TOOLING.toml"], encoding="utf-8")
    (folder / "MACHINE.toml").write_bytes((ROOT / "data" / "machines" / "hpm.toml").read_bytes())
    for suffix, text in PROGRAMS.items():
        (folder / f"program{suffix}").write_text(text, encoding="utf-8")
    (folder / "LIBRARY.json").write_text(json.dumps(library(END_MILL), indent=1) + "\n", encoding="utf-8")
    with zipfile.ZipFile(folder / "LIBRARY.tools", "w", zipfile.ZIP_DEFLATED) as container:
        container.writestr(zipfile.ZipInfo("tools.json"), json.dumps(library(END_MILL)))
    for part in (_recordings, _sounds, _receptances, _hits, _bodies, _robots, _outputs):
        part(folder)


def main(arguments: list[str]) -> None:
    """Write the examples."""
    parser = argparse.ArgumentParser(prog="benchmarks format_examples", description=__doc__)
    parser.add_argument("--out", type=Path, default=FOLDER)
    out = parser.parse_args(arguments).out
    write(out)
    files = [path for path in out.rglob("*") if path.is_file()]
    print(f"written: {len(files)} files, {sum(path.stat().st_size for path in files) / 1e3:.0f} kB, in {out}")
