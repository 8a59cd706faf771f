"""What the fuzzer feeds: every reader of a stranger's bytes, seeds that it takes, and what it may raise.

A seed is a small sound file, made by the writers of the tests' fixtures. What a reader takes, it must also be able to give back: a tooling
is written and read again, a path too.
"""

from __future__ import annotations

import asyncio
import json
import tempfile
from collections.abc import AsyncIterator, Callable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

Read = Callable[[bytes, Path], object]


class Target(NamedTuple):
    """A reader as the fuzzer sees it.

    Parameters
    ----------
    read : callable of (bytes, folder)
        Raises `InputError` or a `Problem` where it refuses; every other exception is a find.
    seeds : callable of (folder)
        Returns what it takes.
    kind : str
        What the bytes are, for those who change them: bytes, text, json or toml.
    """

    read: Read
    seeds: Callable[[Path], list[bytes]]
    kind: str = "bytes"


def _file(suffix: str, read: Callable[[Path], object]) -> Read:
    """A reader of files: the bytes are written to one first."""

    def written(raw: bytes, folder: Path) -> object:
        path = folder / f"given{suffix}"
        path.write_bytes(raw)
        return read(path)

    return written


def _text(module: str, name: str) -> Read:
    """A reader of a text and the name of its file."""

    def read(raw: bytes, folder: Path) -> object:
        return getattr(import_module(module), name)(raw.decode("utf-8", "replace"), "given")

    return read


def _by_path(suffix: str, module: str, name: str, *further: Any) -> Read:
    """A reader of a path."""
    return _file(suffix, lambda path: getattr(import_module(module), name)(path, *further))


def _from(make: Callable[[Path], Any]) -> Callable[[Path], list[bytes]]:
    """Seeds of what a fixture writes into a folder, or returns as text."""

    def seeds(folder: Path) -> list[bytes]:
        with tempfile.TemporaryDirectory(dir=folder) as scratch:
            found = make(Path(scratch))
            if isinstance(found, Path):
                found = found.read_bytes()
            rows = found if isinstance(found, list) else [found]
            return [row.encode() if isinstance(row, str) else row for row in rows]

    return seeds


# recordings


def _recording(suffix: str, names: tuple[str, ...] = ("x", "y")) -> Read:
    from rcsa_ident.errors import InputError
    from rcsa_ident.signals.recording import Quantity, Sensor

    def read(path: Path) -> None:
        from rcsa_ident.io.open_recording import open_recording
        from rcsa_ident.io.recordings import in_si, read_signals

        sensors = tuple(Sensor(name, Quantity.TRIGGER) for name in names)
        try:
            in_si(*read_signals(path, names, 1000.0), sensors)
        except InputError:
            pass
        open_recording(path, (), 1000.0)

    return _file(suffix, read)


def _channels(samples: int = 60) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(1)
    return {name: rng.uniform(-0.5, 0.5, samples) for name in ("x", "y")}


def _recorded(*kinds: str) -> Callable[[Path], list[bytes]]:
    def make(folder: Path) -> list[bytes]:
        from tests.fixtures.recording_formats import FORMATS

        found = []
        for kind in kinds:
            suffix, write, *_ = FORMATS[kind]
            write(folder / f"r{suffix}", 1000.0, _channels())
            found.append((folder / f"r{suffix}").read_bytes())
        return found

    return _from(make)


def _tables(folder: Path) -> list[bytes | str]:
    plain = _recorded("csv")(folder)
    return [
        *plain,
        "Zeit;Weg X;Kraft\ns;\xb5m;N\n0,000;1,5;2\n0,001;1,6;3\n0,002;1,7;2\n",
        "rate: 1000 Hz\nx (m/s^2)\ty (mV)\n" + "1\t2\n3\t4\n" * 20,
    ]


def _matlab5(folder: Path) -> list[bytes]:
    from tests.fixtures import hostile_matlab

    broken = [make() for name, (make, _) in hostile_matlab.HOSTILE.items() if "bomb" not in name and "many" not in name]
    return [*_recorded("mat-5", "mat-5-plain")(folder), *(raw for raw in broken if len(raw) < 4000)]


def _tdms(folder: Path) -> list[bytes]:
    from tests.fixtures import hostile_tdms

    return [*_recorded("tdms")(folder), *(raw for raw, _ in hostile_tdms.HOSTILE.values() if len(raw) < 2000)]


def _hdf5(folder: Path) -> list[bytes]:
    from tests.fixtures import hostile_hdf5 as hostile

    found = _recorded("hdf5")(folder)
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


def _sounds(*kinds: str) -> Callable[[Path], list[bytes]]:
    def make(folder: Path) -> list[bytes]:
        from tests.io.test_sound import tones, written

        return [written(folder, kind, tones(400)).read_bytes() for kind in kinds]

    return _from(make)


def _uffs(folder: Path) -> list[bytes]:
    from rcsa_ident.io.uff import EXCITATION_FORCE, FRF, UffAxis, UffFunction, write_uff

    path = folder / "f.uff"
    found = _recorded("uff", "uff-binary")(folder)
    few = np.arange(100.0, 700.0, 100.0)
    frf = UffFunction(
        FRF, few, few * (1 + 2j), ordinate=UffAxis(8, "m"), denominator=UffAxis(EXCITATION_FORCE, "N"), response=(1, 1), reference=(1, 1)
    )
    for binary in (False, True):
        write_uff(path, [frf], binary)
        found.append(path.read_bytes())
    return found


def _uff(path: Path) -> None:
    from rcsa_ident.errors import InputError
    from rcsa_ident.io.frf_files import read_frfs
    from rcsa_ident.io.hammer import read_hammer
    from rcsa_ident.io.open_recording import open_recording

    for read in (read_frfs, read_hammer):
        try:
            read(path)
        except InputError:
            continue
    open_recording(path, (), 1000.0)


def _frf_texts(folder: Path) -> list[str]:
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


def _frfs(path: Path) -> None:
    from rcsa_ident.errors import InputError
    from rcsa_ident.io.curves import read_frf_csv, read_tip
    from rcsa_ident.io.frf_files import read_frfs

    for read in (read_frf_csv, read_tip):
        try:
            read(path)
        except InputError:
            continue
    read_frfs(path)


# what recordings say


def _listened(raw: bytes, folder: Path) -> None:
    from api.reading.hearing import listen

    path = folder / "given.wav"
    path.write_bytes(raw)
    asked = dict.fromkeys(("quantity", "teeth", "speed_rpm", "speeds_from", "speeds_to", "rate_hz"))
    listen(path, "given.wav", asked | {"channel": (), "curves": True})


def _rung(folder: Path) -> bytes:
    from tests.fixtures.recording_formats import wav

    time = np.arange(4000) / 8000.0
    heard = sum(np.cos(2.0 * np.pi * 100.0 * m * time) / m for m in range(1, 6))
    wav(folder / "r.wav", 8000.0, {"ch1": 0.2 * heard}, bits=16)
    return (folder / "r.wav").read_bytes()


def _tapped(raw: bytes, folder: Path) -> None:
    from api.reading.campaign_text import Upload
    from api.reading.hearing import tap

    path = folder / "given.csv"
    path.write_bytes(raw)
    asked = dict.fromkeys(("force", "response", "quantity", "axis", "rate_hz"))
    tap(asked | {"estimator": "h1", "sensor_mass_g": 0.0, "file": ""}, Upload(path, "given.csv", folder / "made"))


def _hits(folder: Path) -> str:
    rate, rng = 5000.0, np.random.default_rng(1)
    time = np.arange(1500) / rate
    after = time % 0.15 - 0.02
    rung = np.where(after > 0.0, 300.0 * np.exp(-60.0 * after) * np.sin(2.0 * np.pi * 400.0 * after), 0.0)
    force = 200.0 * np.exp(-0.5 * (after / 4e-4) ** 2)
    rows = np.stack([time, force, rung], axis=1) + [0.0, 0.02, 0.05] * rng.standard_normal((time.size, 3))
    return "time (s),hammer (N),tip (m/s^2)\n" + "\n".join(f"{t:.4f},{f:.2f},{a:.2f}" for t, f, a in rows)


# settings in TOML


def _tooling(raw: bytes, folder: Path) -> None:
    from rcsa_ident.io.setups import tooling_of
    from rcsa_ident.io.toml_text import keys_of_toml
    from rcsa_ident.io.toolings import tooling_keys, tooling_text
    from rcsa_ident.report.drawing import tooling_svg

    tooling = tooling_of(keys_of_toml(raw.decode("utf-8", "replace"), "tooling"), "given", "T")
    again = tooling_of(keys_of_toml(tooling_text(tooling_keys(tooling)), "tooling"), "given", "T")
    assert again.assembly.stickout == tooling.assembly.stickout or abs(again.assembly.stickout / tooling.assembly.stickout - 1.0) < 1e-6
    tooling_svg(tooling)


def _toolings(folder: Path) -> list[str]:
    from tests.fixtures import by_hand
    from tests.io.conftest import TOOLING

    spread = "[spread]\nstickout_mm = 0.05\nfluted_diameter_percent = 3.0\n[tool]\nmodel = 'EM'\n"
    shaped = TOOLING.replace("helix_deg = 30.0\n", "helix_deg = 30.0\nshape = 'ball'\n")
    return [TOOLING, by_hand.TOOLING, shaped, by_hand.TOOLING.replace("[tool]\n", spread)]


def _of_keys(module: str, name: str, *further: Any) -> Read:
    """A reader of the keys of a TOML file."""

    def read(raw: bytes, folder: Path) -> object:
        from rcsa_ident.io.toml_text import keys_of_toml

        return getattr(import_module(module), name)(keys_of_toml(raw.decode("utf-8", "replace"), "given"), "given", *further)

    return read


def _campaign(raw: bytes, folder: Path) -> None:
    from api.reading.campaign_text import campaign_of_text, declare
    from rcsa_ident.io.toml_text import keys_of_toml
    from tests.io.conftest import TOOLING

    _, text, _ = declare(keys_of_toml(raw.decode("utf-8", "replace"), "campaign"), lambda name: TOOLING)
    campaign_of_text(text)


def _campaigns(folder: Path) -> list[str]:
    from api.schemas.campaigns import EXAMPLE
    from rcsa_ident.io.toml_text import toml_of
    from tests.io.conftest import CAMPAIGN

    frf = '[[frfs]]\nid = "T1, nut"\ntooling = "S1-ER32"\naxis = "X"\nresponse = "tip"\nforce = 90.0\nfile = "nut.uff"\n'
    return [CAMPAIGN, CAMPAIGN.split("[[cuts]]")[0] + frf, toml_of(EXAMPLE)]


def _machine(raw: bytes, folder: Path) -> None:
    from rcsa_ident.io.machines import machine_of
    from rcsa_ident.io.toml_text import keys_of_toml

    machine_of(keys_of_toml(raw.decode("utf-8", "replace"), "machine"), "given", "given", folder)


def _data(*names: str) -> Callable[[Path], list[bytes]]:
    root = Path(__file__).resolve().parent.parent
    return lambda folder: [(root / name).read_bytes() for name in names]


def _cases(path: Path) -> None:
    from rcsa_ident.io.cases import read_cases
    from tests.io.conftest import TOOLING

    (path.parent / "T.toml").write_text(TOOLING, encoding="utf-8")
    (path.parent / "CUTS.csv").write_text("spindle_speed_rpm,axial_depth_mm,verdict\n9000,1,stable\n", encoding="utf-8")
    read_cases(path)


# JSON


def _json(raw: bytes, read: Callable[[Any, str], object], folder: Path) -> object:
    from rcsa_ident.io.results import read_json

    path = folder / "given.json"
    path.write_bytes(raw)
    return read(read_json(path, "given"), "given")


def _result(raw: bytes, folder: Path) -> None:
    from rcsa_ident.io.identifications import machine_from_json
    from rcsa_ident.io.results import check_result

    def read(data: Any, where: str) -> None:
        check_result(data, where)
        machine_from_json(data, where)

    _json(raw, read, folder)


def _results(folder: Path) -> list[str]:
    from rcsa_ident.io.identifications import identification_to_json
    from rcsa_ident.io.results import plain
    from tests.fixtures import by_hand, coupled_by_hand

    campaign = by_hand.campaign(folder)
    made = [identification_to_json(by_hand.identification(soft), campaign, by_hand.LEFT_OUT) for soft in (False, True)]
    made.append(identification_to_json(coupled_by_hand.identification(), campaign, by_hand.LEFT_OUT))
    return [json.dumps(plain(each)) for each in made]


def _learnt(raw: bytes, folder: Path) -> None:
    from rcsa_ident.io.learnt_tips import learnt_tip_of, learnt_tip_to_json

    _json(raw, lambda data, where: learnt_tip_to_json(learnt_tip_of(data, where)), folder)


def _learnts(folder: Path) -> bytes:
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


def _robot_result(raw: bytes, folder: Path) -> None:
    from rcsa_ident.io.robot_results import robot_posterior_of

    _json(raw, robot_posterior_of, folder)


def _robot_results(folder: Path) -> str:
    from rcsa_ident.identification.posed.parameters import PosedLayout
    from rcsa_ident.io.results import plain
    from rcsa_ident.io.robots import read_robot, robot_keys

    sheet = read_robot(Path(__file__).resolve().parent.parent / "data" / "robots" / "tx200.toml")
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
    from rcsa_ident.io import robot_results

    top |= {"kind": robot_results.KIND, "schema_version": robot_results.SCHEMA_VERSION}
    return json.dumps(plain(top | {"posterior": table | {"rivals": [rival]}}))


def _library(raw: bytes, folder: Path) -> None:
    from api.work.libraries import imported
    from rcsa_ident.io.tool_libraries import Assumptions

    imported(raw, Assumptions(), None)


def _libraries(folder: Path) -> list[bytes]:
    from tests.fixtures.paths import ROOT
    from tests.fixtures.tool_library import END_MILL
    from tests.fixtures.tool_library import library as whole

    shapes = json.loads((ROOT / "tests" / "fixtures" / "library_of_shapes.json").read_text(encoding="utf-8"))
    return [json.dumps(whole(END_MILL)).encode(), json.dumps(shapes | {"data": shapes["data"][:20]}).encode()]


# what the service hears


def _frames(raw: bytes, folder: Path) -> None:
    from api.streams.frames import samples_of, samples_of_text
    from rcsa_ident.errors import InputError

    for read in (samples_of, lambda raw, channels: samples_of_text(raw.decode("utf-8", "replace"), channels)):
        try:
            first, samples = read(raw, 2)
        except InputError:
            continue
        assert samples.shape[1] == 2
        assert np.all(np.isfinite(samples))


def _frame_seeds(folder: Path) -> list[bytes]:
    from api.streams.frames import packed

    return [packed(5, np.ones((3, 2))), b'{"first": 0, "samples": [[1, 2.5], [3e2, -4]]}']


def _multipart(raw: bytes, folder: Path) -> None:
    from fastapi import Request

    from api.transfer import multipart

    async def in_pieces(request: Request, components: Any) -> AsyncIterator[bytearray]:
        for start in range(0, len(raw), 37):
            yield bytearray(raw[start : start + 37])

    async def drain() -> None:
        scope = {"type": "http", "headers": [(b"content-type", b"multipart/form-data; boundary=x")]}
        async for _ in multipart.events(Request(scope), None):  # type: ignore[arg-type]
            pass

    own, multipart.blocks = multipart.blocks, in_pieces  # type: ignore[assignment]
    try:
        asyncio.run(drain())
    finally:
        multipart.blocks = own


def _forms(folder: Path) -> list[bytes]:
    part = b'--x\r\nContent-Disposition: form-data; name="files"; filename="\xc3\xbc.h5"\r\nContent-Type: a/b\r\n\r\nabc\r\n'
    return [part * 2 + b"--x--\r\n", b'--x\r\nContent-Disposition: form-data; name="query"\r\n\r\n{"a": 1}\r\n--x--\r\n']


def _headers(raw: bytes, folder: Path) -> None:
    """The first byte says which of the headers that the service parses itself."""
    from fastapi import Request

    from api.conventions import expected, unchanged
    from api.problems import Problem
    from api.routes import tus
    from api.transfer.body_stream import announced_digest, announced_length
    from rcsa_ident.errors import InputError

    text = raw[1:].decode("latin-1")
    names = ("if-match", "if-none-match", "repr-digest", "content-digest", "content-length")
    request = Request({"type": "http", "method": "PUT", "headers": [(name.encode(), raw[1:]) for name in names]})
    readers: list[Callable[[], object]] = [
        lambda: tus._metadata(text),
        lambda: tus._checksum(text),
        lambda: expected(request, lambda: "0" * 64),
        lambda: unchanged(request, "0" * 64),
        lambda: announced_digest(request, "Repr-Digest", "Content-Digest"),
        lambda: announced_length(request),
    ]
    try:
        readers[raw[0] % len(readers)]() if raw else None
    except (InputError, Problem):
        pass


def _header_seeds(folder: Path) -> list[bytes]:
    told = [b"filename YS5oNQ==,replace", b"sha256 ungWv48Bz+pBQUDeXa4iI7ADYaOWF3qctBD/YfIAFa0=", b'"00000"', b'W/"a", *']
    told += [b"sha-256=:ungWv48Bz+pBQUDeXa4iI7ADYaOWF3qctBD/YfIAFa0=:", b"1234"]
    return [bytes([k]) + each for k, each in enumerate(told)]


def _backup(raw: bytes, folder: Path) -> None:
    import shutil

    from api.backups.load import restore

    (folder / "given.tar").write_bytes(raw)
    shutil.rmtree(folder / "restored", ignore_errors=True)
    restore(folder / "given.tar", folder / "restored")


def _backups(folder: Path) -> list[bytes]:
    from api.backups.save import backup
    from api.stores.sql import open_store

    data = folder / "data"
    data.mkdir()
    open_store(f"sqlite:///{data / 'service.db'}").close()
    backup(data, folder / "b.tar")
    return [(folder / "b.tar").read_bytes()]


_IO = "rcsa_ident.io"
_PLACES = "x_mm,y_mm,z_mm,i,j,k,feed_mm_per_min,spindle_speed_rpm\n0,0,0,0,0,1,inf,8000\n10,0,0,0,0,1,600,8000\n10,10,-1,0,0.1,1,600,\n"
_GCODE = "%\nO1 (POCKET)\nG21 G90 G17\nS8000 M3\nG0 X0 Y0 Z5\nG1 Z-1 F300\nG2 X10 Y0 I5 J0\nG3 X0 Y0 R5\nG91 G1 X1.5 Y-2\nM30\n%\n"


def _posture_file(path: Path) -> None:
    from rcsa_ident.io.postures import read_postures
    from rcsa_ident.io.robots import read_robot

    read_postures(path, read_robot(Path(__file__).resolve().parent.parent / "data" / "robots" / "tx200.toml"))


def _path_forces(path: Path) -> None:
    from rcsa_ident.io.path_forces import read_path_forces
    from rcsa_ident.io.paths import tool_path_of

    read_path_forces(path, tool_path_of(_PLACES, "given"))


def _tool_path(suffix: str) -> Read:
    def read(path: Path) -> None:
        from rcsa_ident.io.gcode import kept_words
        from rcsa_ident.io.paths import read_tool_path, write_tool_path

        found = read_tool_path(path)
        kept = kept_words(path)[0] if suffix == ".nc" else ()
        write_tool_path(path.with_name(f"again{suffix}"), found, kept=kept)
        again = read_tool_path(path.with_name(f"again{suffix}"))
        assert np.allclose(again.places[-1], found.places[-1], rtol=0.0, atol=1e-6)

    return _file(suffix, read)


def _mesh_seeds(kind: str) -> Callable[[Path], list[bytes]]:
    def make(folder: Path) -> list[bytes]:
        from rcsa_ident.io.meshes import write_mesh
        from tests.toolpath.test_surface_kernels import box

        write_mesh(folder / f"m.{kind}", *box(np.zeros(3), np.array([0.04, 0.02, 0.01])))
        return [(folder / f"m.{kind}").read_bytes()]

    return _from(make)


def _mesh(kind: str) -> Read:
    def read(raw: bytes, folder: Path) -> object:
        from rcsa_ident.io.meshes import mesh_of

        return mesh_of(raw, kind, "given")

    return read


def _urdfs(folder: Path) -> list[str]:
    from rcsa_ident.io.robots import read_robot
    from tests.io.urdf_files import random_urdf, urdf_of

    arm = read_robot(Path(__file__).resolve().parent.parent / "data" / "robots" / "tx200.toml")
    return [urdf_of(arm), random_urdf(np.random.default_rng(1), 3)]


def _joint_mat(folder: Path) -> bytes:
    from scipy.io import savemat

    from tests.io.test_robot_records import structs

    rows = np.ones((3, 30))
    savemat(folder / "r.mat", structs(np.arange(30) * 0.1, rows, rows, rows))
    return (folder / "r.mat").read_bytes()


def _lines(*texts: str) -> Callable[[Path], list[bytes]]:
    return lambda folder: [text.encode() for text in texts]


def _flanges(folder: Path) -> bytes:
    from tests.fixtures import by_hand

    lines = by_hand.flange_file(folder / "F.csv").read_text(encoding="utf-8").splitlines(keepends=True)
    return "".join([*lines[:1], *lines[1::40]]).encode()


#: By the name that the command takes.
TARGETS: Mapping[str, Target] = {
    "csv": Target(_recording(".csv"), _from(_tables), "text"),
    "hdf5": Target(_recording(".h5"), _from(_hdf5)),
    "tdms": Target(_recording(".tdms"), _from(_tdms)),
    "wav": Target(_recording(".wav", ("ch1",)), lambda folder: _recorded("wav-16", "wav-24", "wav-float")(folder) + _sounds("mu-law", "adpcm")(folder)),
    "rf64": Target(_recording(".rf64", ("ch1",)), _sounds("rf64")),
    "flac": Target(_recording(".flac", ("ch1",)), _sounds("flac")),
    "aiff": Target(_recording(".aiff", ("ch1",)), _sounds("aiff", "aiff-float")),
    "caf": Target(_recording(".caf", ("ch1",)), _sounds("caf")),
    "w64": Target(_recording(".w64", ("ch1",)), _sounds("w64")),
    "ogg": Target(_recording(".ogg", ("ch1",)), _sounds("vorbis", "opus")),
    "mp3": Target(_recording(".mp3", ("ch1",)), _sounds("mp3")),
    "matlab-5": Target(_recording(".mat"), _from(_matlab5)),
    "matlab-7.3": Target(_recording(".mat"), _recorded("mat-7.3")),
    "parquet": Target(_recording(".parquet"), _recorded("parquet")),
    "uff": Target(_file(".uff", _uff), _from(_uffs)),
    "frf": Target(_file(".csv", _frfs), _from(_frf_texts), "text"),
    "listen": Target(_listened, _from(_rung)),
    "hits": Target(_tapped, _from(_hits), "text"),
    "tooling": Target(_tooling, _from(_toolings), "toml"),
    "campaign": Target(_campaign, _from(_campaigns), "toml"),
    "machine": Target(_machine, _data("data/machines/hpm.toml", "data/machines/stiff.toml"), "toml"),
    "modes": Target(_of_keys(f"{_IO}.modes", "modes_of"), _data("api/examples/MODES.toml"), "toml"),
    "robot": Target(_of_keys(f"{_IO}.robots", "robot_of"), _data("data/robots/tx200.toml"), "toml"),
    "cases": Target(_file(".toml", _cases), _from(lambda folder: import_module("tests.io.test_cases").TEXT), "toml"),
    "workpiece": Target(_by_path(".toml", f"{_IO}.dynamometer", "read_workpiece"), _lines('[workpiece]\nname = "a"\ntangential_coefficient_mpa = 700\nradial_ratio = 0.3\n'), "toml"),
    "stickouts": Target(_by_path(".toml", f"{_IO}.stickouts", "read_stickouts", (0.05, 0.07)), _from(_toolings), "toml"),
    "result": Target(_result, _from(_results), "json"),
    "learnt": Target(_learnt, _from(_learnts), "json"),
    "robot-result": Target(_robot_result, _from(_robot_results), "json"),
    "library": Target(_library, _from(_libraries), "json"),
    "library-zip": Target(_library, _from(lambda folder: import_module("tests.io.test_tool_libraries").zipped(_libraries(folder)[0]))),
    "gcode": Target(_tool_path(".nc"), lambda folder: [*_lines(_GCODE)(folder), *_data("tests/fixtures/programs/pocket.nc")(folder)], "text"),
    "path": Target(_tool_path(".csv"), _lines(_PLACES), "text"),
    "cuts": Target(_text(f"{_IO}.tested_cuts", "tested_cuts_of"), _data("api/examples/CUTS.csv"), "text"),
    "lobes": Target(_by_path(".csv", f"{_IO}.lobes", "read_lobes"), _lines("spindle_speed_rpm,limit_depth_mm,chatter_frequency_hz\n8000,1.5,900\n9000,2.5,1000\n"), "text"),
    "flange": Target(_text(f"{_IO}.flanges", "flange_machine_of"), _from(_flanges), "text"),
    "forces": Target(_by_path(".csv", f"{_IO}.forces", "read_forces"), _lines("time_s,Fx_n,Fy_n,Fx_std_n\n0,1,2,3\n0.1,1,2,3\n0.2,1,2,3\n"), "text"),
    "path-forces": Target(_file(".csv", _path_forces), _lines("time_s,x_mm,y_mm,z_mm,force_x_n,force_y_n,force_z_n\n0,0,0,0,1,2,3\n1,10,0,0,1,2,3\n"), "text"),
    "postures": Target(_file(".csv", _posture_file), _lines("q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n1,2,3,4,5,6\n2,3,4,5,6,7\n"), "text"),
    "static": Target(_by_path(".csv", f"{_IO}.robot_static", "read_static_tests", 2), _lines("q1_deg,q2_deg,fx_n,fy_n,fz_n,dx_mm,dy_mm,dz_mm\n90,-45,1000,0,-500,0.5,-0.25,2\n"), "text"),
    "motion-csv": Target(_by_path(".csv", f"{_IO}.robot_records", "read_joint_record"), _lines("time_s,motor_1_deg,joint_1_deg,torque_1_nm\n" + "".join(f"{0.1 * k:.1f},{k},{k},3\n" for k in range(40))), "text"),
    "motion-mat": Target(_by_path(".mat", f"{_IO}.robot_records", "read_joint_record"), _from(_joint_mat)),
    "engagement": Target(_by_path(".csv", f"{_IO}.engagements", "read_engagement_map"), _lines("z_mm,entry_angle_deg,exit_angle_deg\n0,0,90\n1,0,90\n2,10,80\n"), "text"),
    "spindle": Target(_by_path(".csv", f"{_IO}.spindle_drives", "read_spindle_drive"), _lines("spindle_speed_rpm;power_kw;torque_nm\n1000;2,5;24\n5000;12;23\n20000;12;6\n"), "text"),
    "stl": Target(_mesh(".stl"), _mesh_seeds("stl")),
    "obj": Target(_mesh(".obj"), _mesh_seeds("obj"), "text"),
    "ply": Target(_mesh(".ply"), _mesh_seeds("ply")),
    "urdf": Target(_by_path(".urdf", f"{_IO}.urdf", "read_urdf", (1e6,)), _from(_urdfs), "text"),
    "frames": Target(_frames, _frame_seeds),
    "multipart": Target(_multipart, _forms),
    "headers": Target(_headers, _header_seeds),
    "backup": Target(_backup, _from(_backups)),
}  # fmt: skip


def refusals() -> tuple[type[Exception], ...]:
    """Return what a reader raises on purpose."""
    from api.problems import Problem
    from rcsa_ident.errors import InputError

    return InputError, Problem
