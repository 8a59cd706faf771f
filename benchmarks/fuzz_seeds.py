"""Seeds of the fuzzer: what every reader takes, as small as it can be, written by the fixtures of the tests."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
Seeds = Callable[[Path], list[bytes]]
#: Of readers that a few lines satisfy.
SMALL = {
    "workpiece": '[workpiece]\nname = "a"\ntangential_coefficient_mpa = 700\nradial_ratio = 0.3\n',
    "lobes": "spindle_speed_rpm,limit_depth_mm,chatter_frequency_hz,lobe\n8000,1.5,900,0\n9000,2.5,1000,1\n",
    "forces": "time_s,Fx_n,Fy_n,Fx_std_n\n0,1,2,3\n0.1,1,2,3\n0.2,1,2,3\n",
    "static": "q1_deg,q2_deg,fx_n,fy_n,fz_n,dx_mm,dy_mm,dz_mm\n90,-45,1000,0,-500,0.5,-0.25,2\n",
    "motion-csv": "time_s,motor_1_deg,joint_1_deg,torque_1_nm\n" + "".join(f"{0.1 * k:.1f},{k},{k},3\n" for k in range(40)),
    "engagement": "z_mm,entry_angle_deg,exit_angle_deg\n0,0,90\n1,0,90\n2,10,80\n",
    "spindle": "spindle_speed_rpm;power_kw;torque_nm\n1000;2,5;24\n5000;12;23\n20000;12;6\n",
    "path-forces": "time_s,x_mm,y_mm,z_mm,force_x_n,force_y_n,force_z_n\n0,0,0,0,1,2,3\n1,10,0,0,1,2,3\n",
    "postures": "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n1,2,3,4,5,6\n2,3,4,5,6,7\n",
}


def written(make: Callable[[Path], Any]) -> Seeds:
    """Seeds of what a fixture writes into a folder, or returns as text."""

    def seeds(folder: Path) -> list[bytes]:
        with tempfile.TemporaryDirectory(dir=folder) as scratch:
            found = make(Path(scratch))
            if isinstance(found, Path):
                found = found.read_bytes()
            rows = found if isinstance(found, list) else [found]
            return [row.encode() if isinstance(row, str) else row for row in rows]

    return seeds


def _channels(samples: int = 60) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(1)
    return {name: rng.uniform(-0.5, 0.5, samples) for name in ("x", "y")}


def recorded(*kinds: str) -> Seeds:
    def make(folder: Path) -> list[bytes]:
        from tests.fixtures.recording_formats import FORMATS

        found = []
        for kind in kinds:
            suffix, write, *_ = FORMATS[kind]
            write(folder / f"r{suffix}", 1000.0, _channels())
            found.append((folder / f"r{suffix}").read_bytes())
        return found

    return written(make)


def tables(folder: Path) -> list[bytes | str]:
    plain = recorded("csv")(folder)
    return [
        *plain,
        "Zeit;Weg X;Kraft\ns;\xb5m;N\n0,000;1,5;2\n0,001;1,6;3\n0,002;1,7;2\n",
        "rate: 1000 Hz\nx (m/s^2)\ty (mV)\n" + "1\t2\n3\t4\n" * 20,
    ]


def matlab5(folder: Path) -> list[bytes]:
    from tests.fixtures import hostile_matlab

    broken = [make() for name, (make, _) in hostile_matlab.HOSTILE.items() if "bomb" not in name and "many" not in name]
    return [*recorded("mat-5", "mat-5-plain")(folder), *(raw for raw in broken if len(raw) < 4000)]


def tdms(folder: Path) -> list[bytes]:
    from tests.fixtures import hostile_tdms

    return [*recorded("tdms")(folder), *(raw for raw, _ in hostile_tdms.HOSTILE.values() if len(raw) < 2000)]


def hdf5(folder: Path) -> list[bytes]:
    from tests.fixtures import hostile_hdf5 as hostile

    found = recorded("hdf5")(folder)
    for make in (
        hostile.soft_link,
        hostile.virtual,
        hostile.unwritten,
        hostile.inflating_chunk,
        hostile.lzf_after_deflate,
        hostile.own_rates,
    ):
        make(folder / "h.h5")
        found.append((folder / "h.h5").read_bytes())
        (folder / "h.h5").unlink()
    return found


def sounds(*kinds: str) -> Seeds:
    def make(folder: Path) -> list[bytes]:
        from tests.io.recordings.test_sound import tones, written

        return [written(folder, kind, tones(400)).read_bytes() for kind in kinds]

    return written(make)


def uffs(folder: Path) -> list[bytes]:
    from rcsa_ident.io.uff import EXCITATION_FORCE, FRF, UffAxis, UffFunction, write_uff

    path = folder / "f.uff"
    found = recorded("uff", "uff-binary")(folder)
    few = np.arange(100.0, 700.0, 100.0)
    frf = UffFunction(
        FRF, few, few * (1 + 2j), ordinate=UffAxis(8, "m"), denominator=UffAxis(EXCITATION_FORCE, "N"), response=(1, 1), reference=(1, 1)
    )
    for binary in (False, True):
        write_uff(path, [frf], binary)
        found.append(path.read_bytes())
    return found


def frf_texts(folder: Path) -> list[str]:
    rows = [(100 * f, 1e-7 * f, -2e-8 * f) for f in range(1, 8)]
    columns = "\n".join(f"{f} {re:.3e} {im:.3e}" for f, re, im in rows)
    csv = "\n".join(f"{f},{re},{im},{re},{im}" for f, re, im in rows)
    one = "\n".join(f"{f};{re};{im}" for f, re, im in rows)
    return [
        columns,
        "Frequency[Hz] Real[m/N] Imag[m/N]\n" + columns,
        f"frequency_hz,X_re,X_im,Y_re,Y_im\n{csv}\n",
        f"frequency_hz;XY_re;XY_im\n{one}\n",
        "um/N\nHz;real;imag\n100,5;2,5;3,5\n200,5;2;1\n",
    ]


def rung(folder: Path) -> bytes:
    from tests.fixtures.recording_formats import wav

    time = np.arange(4000) / 8000.0
    heard = sum(np.cos(2.0 * np.pi * 100.0 * m * time) / m for m in range(1, 6))
    wav(folder / "r.wav", 8000.0, {"ch1": 0.2 * heard}, bits=16)
    return (folder / "r.wav").read_bytes()


def hits(folder: Path) -> str:
    rate, rng = 5000.0, np.random.default_rng(1)
    time = np.arange(1500) / rate
    after = time % 0.15 - 0.02
    rung = np.where(after > 0.0, 300.0 * np.exp(-60.0 * after) * np.sin(2.0 * np.pi * 400.0 * after), 0.0)
    force = 200.0 * np.exp(-0.5 * (after / 4e-4) ** 2)
    rows = np.stack([time, force, rung], axis=1) + [0.0, 0.02, 0.05] * rng.standard_normal((time.size, 3))
    return "time (s),hammer (N),tip (m/s^2)\n" + "\n".join(f"{t:.4f},{f:.2f},{a:.2f}" for t, f, a in rows)


def toolings(folder: Path) -> list[str]:
    from tests.fixtures import by_hand
    from tests.io.conftest import TOOLING

    spread = "[spread]\nstickout_mm = 0.05\nfluted_diameter_percent = 3.0\n[tool]\nmodel = 'EM'\n"
    shaped = TOOLING.replace("helix_deg = 30.0\n", "helix_deg = 30.0\nshape = 'ball'\n")
    return [TOOLING, by_hand.TOOLING, shaped, by_hand.TOOLING.replace("[tool]\n", spread)]


def campaigns(folder: Path) -> list[str]:
    from api.schemas.campaigns import EXAMPLE
    from rcsa_ident.io.toml_text import toml_of
    from tests.io.conftest import CAMPAIGN

    frf = '[[frfs]]\nid = "T1, nut"\ntooling = "S1-ER32"\naxis = "X"\nresponse = "tip"\nforce = 90.0\nfile = "nut.uff"\n'
    return [CAMPAIGN, CAMPAIGN.split("[[cuts]]")[0] + frf, toml_of(EXAMPLE)]


OBLIQUE = """[[modes]]
natural_frequency_hz = 700.0
damping_ratio = 0.03
stiffness_n_per_m = 8e6
direction_cosines = [0.6, 0.8, 0.0]
[[z]]
natural_frequency_hz = 1450.0
damping_ratio = 0.04
modal_mass_kg = 0.5
"""


def of_repository(*names: str) -> Seeds:
    return lambda folder: [(ROOT / name).read_bytes() for name in names]


def results(folder: Path) -> list[str]:
    from rcsa_ident.io.results.identifications import identification_to_json
    from rcsa_ident.io.results.parts import plain
    from tests.fixtures import by_hand, coupled_by_hand

    campaign = by_hand.campaign(folder)
    made = [identification_to_json(by_hand.identification(soft), campaign, by_hand.LEFT_OUT) for soft in (False, True)]
    made.append(identification_to_json(coupled_by_hand.identification(), campaign, by_hand.LEFT_OUT))
    return [json.dumps(plain(each)) for each in made]


def learnts(folder: Path) -> bytes:
    from typer.testing import CliRunner

    from rcsa_ident.cli import app
    from tests.cli.test_learn import CUTS, CUTTER, FAST, MODES

    for name, text in (("M.toml", MODES), ("T.toml", CUTTER), ("C.csv", CUTS)):
        (folder / name).write_text(text, encoding="utf-8")
    given = ["learn", "M.toml", "T.toml", "--tests", "C.csv", "--out", "L.json"]
    CliRunner().invoke(app, [str(folder / each) if "." in each else each for each in given] + [str(each) for each in FAST])
    data = json.loads((folder / "L.json").read_text(encoding="utf-8"))
    draws, errors = data["posterior"]["draws"][:4], data["posterior"]["errors"][:4]
    data["posterior"] |= {"draws": draws, "errors": errors, "effective_draws": 3.0}
    return json.dumps(data).encode()


def robot_results(folder: Path) -> str:
    from rcsa_ident.identification.arm.unknowns import PosedLayout
    from rcsa_ident.io.results.parts import plain
    from rcsa_ident.io.settings.robots import read_robot, robot_keys

    sheet = read_robot(ROOT / "data" / "robots" / "tx200.toml")
    freedoms, bodies = sheet.freedoms(False), len(sheet.joints) + (sheet.payload is not None)
    springs = (1e6,) * freedoms
    size = PosedLayout(springs, bodies, 1).size
    table = {
        "springs_nm_per_rad": springs,
        "modes": 1,
        "unknowns": [0.1] * size,
        "matrix": (0.01 * np.eye(size)).tolist(),
        "believed_sd": [0.1] * size,
    }
    rival = {"modes": 0, "unknowns": [0.1] * PosedLayout(springs, bodies, 0).size}
    top = {"kind": "robot", "schema_version": 1, "status": "converged", "robot": robot_keys(sheet), "tilts": False}
    from rcsa_ident.io.results import robot_results

    top |= {"kind": robot_results.KIND, "schema_version": robot_results.SCHEMA_VERSION}
    return json.dumps(plain(top | {"posterior": table | {"rivals": [rival]}}))


def libraries(folder: Path) -> list[bytes]:
    from tests.fixtures.paths import ROOT
    from tests.fixtures.tool_library import END_MILL
    from tests.fixtures.tool_library import library as whole

    shapes = json.loads((ROOT / "tests" / "fixtures" / "library_of_shapes.json").read_text(encoding="utf-8"))
    return [json.dumps(whole(END_MILL)).encode(), json.dumps(shapes | {"data": shapes["data"][:20]}).encode()]


def hsm_libraries(folder: Path) -> list[bytes]:
    from tests.fixtures.tool_library import HSM

    return [HSM.encode(), HSM.encode("utf-16")]


def frames(folder: Path) -> list[bytes]:
    from api.streams.frames import packed

    return [packed(5, np.ones((3, 2))), b'{"first": 0, "samples": [[1, 2.5], [3e2, -4]]}']


def forms(folder: Path) -> list[bytes]:
    part = b'--x\r\nContent-Disposition: form-data; name="files"; filename="\xc3\xbc.h5"\r\nContent-Type: a/b\r\n\r\nabc\r\n'
    return [part * 2 + b"--x--\r\n", b'--x\r\nContent-Disposition: form-data; name="query"\r\n\r\n{"a": 1}\r\n--x--\r\n']


def headers(folder: Path) -> list[bytes]:
    told = [b"filename YS5oNQ==,replace", b"sha256 ungWv48Bz+pBQUDeXa4iI7ADYaOWF3qctBD/YfIAFa0=", b'"00000"', b'W/"a", *']
    told += [b"sha-256=:ungWv48Bz+pBQUDeXa4iI7ADYaOWF3qctBD/YfIAFa0=:", b"1234"]
    return [bytes([k]) + each for k, each in enumerate(told)]


def backups(folder: Path) -> list[bytes]:
    from api.backups.save import backup
    from api.stores.sql import open_store

    data = folder / "data"
    data.mkdir()
    open_store(f"sqlite:///{data / 'service.db'}").close()
    backup(data, folder / "b.tar")
    return [(folder / "b.tar").read_bytes()]


PLACES = "x_mm,y_mm,z_mm,i,j,k,feed_mm_per_min,spindle_speed_rpm\n0,0,0,0,0,1,inf,8000\n10,0,0,0,0,1,600,8000\n10,10,-1,0,0.1,1,600,\n"


GCODE = "%\nO1 (POCKET)\nG21 G90 G17\nS8000 M3\nG0 X0 Y0 Z5\nG1 Z-1 F300\nG2 X10 Y0 I5 J0\nG3 X0 Y0 R5\nG91 G1 X1.5 Y-2\nM30\n%\n"


def surfaces(kind: str) -> Seeds:
    def make(folder: Path) -> list[bytes]:
        from rcsa_ident.io.paths.meshes import write_mesh
        from tests.toolpath.test_surface_kernels import box

        write_mesh(folder / f"m.{kind}", *box(np.zeros(3), np.array([0.04, 0.02, 0.01])))
        return [(folder / f"m.{kind}").read_bytes()]

    return written(make)


def urdfs(folder: Path) -> list[str]:
    from rcsa_ident.io.settings.robots import read_robot
    from tests.io.urdf_files import random_urdf, urdf_of

    arm = read_robot(ROOT / "data" / "robots" / "tx200.toml")
    return [urdf_of(arm), random_urdf(np.random.default_rng(1), 3)]


def motion(folder: Path) -> bytes:
    from scipy.io import savemat

    from tests.io.recordings.test_robot_records import structs

    rows = np.ones((3, 30))
    savemat(folder / "r.mat", structs(np.arange(30) * 0.1, rows, rows, rows))
    return (folder / "r.mat").read_bytes()


def texts(*texts: str) -> Seeds:
    return lambda folder: [text.encode() for text in texts]


def flanges(folder: Path) -> bytes:
    from tests.fixtures import by_hand

    lines = by_hand.flange_file(folder / "F.csv").read_text(encoding="utf-8").splitlines(keepends=True)
    return "".join([*lines[:1], *lines[1::40]]).encode()


def wavs(folder: Path) -> list[bytes]:
    return recorded("wav-16", "wav-24", "wav-float")(folder) + sounds("mu-law", "adpcm")(folder)


def zipped_library(folder: Path) -> bytes:
    from tests.io.settings.test_tool_libraries import zipped

    return zipped(libraries(folder)[0])


def programs(folder: Path) -> list[bytes]:
    return [GCODE.encode(), *of_repository("tests/fixtures/programs/pocket.nc")(folder)]


def cases(folder: Path) -> str:
    from tests.io.settings.test_cases import TEXT

    return TEXT
