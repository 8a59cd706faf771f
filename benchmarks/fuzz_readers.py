"""What the fuzzer feeds: every reader of a stranger's bytes, seeds that it takes, and what it may raise.

A seed is a small sound file, made by the writers of the tests' fixtures. What a reader takes, it must also be able to give back: a tooling
is written and read again, a path too.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks import fuzz_seeds as seeds

Read = Callable[[bytes, Path], object]


class Target(NamedTuple):
    """A reader as the fuzzer sees it.

    `read`: callable of (bytes, folder); raises `InputError` or a `Problem` where it refuses; every other exception is a find
    `sown`: callable of (folder), returns seeds, which it takes or nearly takes
    `kind`: what the bytes are, for those who change them: bytes, text, json or toml
    """

    read: Read
    sown: seeds.Seeds
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


# recordings


def _recording(suffix: str, names: tuple[str, ...] = ("x", "y")) -> Read:
    from rcsa_ident.base.errors import InputError
    from rcsa_ident.signals.recording import Quantity, Sensor

    def read(path: Path) -> None:
        from rcsa_ident.io.recordings.open_recording import open_recording
        from rcsa_ident.io.recordings.readers import in_si, read_signals

        sensors = tuple(Sensor(name, Quantity.TRIGGER) for name in names)
        with suppress(InputError):
            in_si(*read_signals(path, names, 1000.0), sensors)
        open_recording(path, (), 1000.0)

    return _file(suffix, read)


def _uff(path: Path) -> None:
    from rcsa_ident.base.errors import InputError
    from rcsa_ident.io.curves.frf_files import read_frfs
    from rcsa_ident.io.curves.hammer import read_hammer
    from rcsa_ident.io.recordings.open_recording import open_recording

    for read in (read_frfs, read_hammer):
        try:
            read(path)
        except InputError:
            continue
    open_recording(path, (), 1000.0)


def _frfs(path: Path) -> None:
    from rcsa_ident.base.errors import InputError
    from rcsa_ident.io.curves.frf_files import read_frfs
    from rcsa_ident.io.curves.tips import read_frf_csv, read_tip

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


def _tapped(raw: bytes, folder: Path) -> None:
    from api.reading.campaign_text import Upload
    from api.reading.hearing import tap

    path = folder / "given.csv"
    path.write_bytes(raw)
    asked = dict.fromkeys(("force", "response", "rate_hz", "force_sensitivity", "response_sensitivity"))
    tap(
        asked | {"quantity": "acceleration", "axis": "X", "estimator": "h1", "sensor_mass_g": 0.0, "reverse": False, "file": ""},
        Upload(path, "given.csv", folder / "made"),
    )


# settings in TOML


def _tooling(raw: bytes, folder: Path) -> None:
    from rcsa_ident.io.settings.setups import tooling_of
    from rcsa_ident.io.settings.toolings import tooling_keys, tooling_text
    from rcsa_ident.io.toml_text import keys_of_toml
    from rcsa_ident.report.drawing import tooling_svg

    tooling = tooling_of(keys_of_toml(raw.decode("utf-8", "replace"), "tooling"), "given", "T")
    again = tooling_of(keys_of_toml(tooling_text(tooling_keys(tooling)), "tooling"), "given", "T")
    assert again.assembly.stickout == tooling.assembly.stickout or abs(again.assembly.stickout / tooling.assembly.stickout - 1.0) < 1e-6
    tooling_svg(tooling)


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


def _machine(raw: bytes, folder: Path) -> None:
    from rcsa_ident.io.settings.machines import machine_of
    from rcsa_ident.io.toml_text import keys_of_toml

    machine_of(keys_of_toml(raw.decode("utf-8", "replace"), "machine"), "given", "given", folder)


def _cases(path: Path) -> None:
    from rcsa_ident.io.settings.cases import read_cases
    from tests.io.conftest import TOOLING

    (path.parent / "T.toml").write_text(TOOLING, encoding="utf-8")
    (path.parent / "CUTS.csv").write_text("spindle_speed_rpm,axial_depth_mm,verdict\n9000,1,stable\n", encoding="utf-8")
    read_cases(path)


# JSON


def _json(raw: bytes, read: Callable[[Any, str], object], folder: Path) -> object:
    from rcsa_ident.io.results.parts import read_json

    path = folder / "given.json"
    path.write_bytes(raw)
    return read(read_json(path, "given"), "given")


def _result(raw: bytes, folder: Path) -> None:
    from rcsa_ident.io.results.identifications import machine_from_json
    from rcsa_ident.io.results.parts import check_result

    def read(data: Any, where: str) -> None:
        check_result(data, where)
        machine_from_json(data, where)

    _json(raw, read, folder)


def _learnt(raw: bytes, folder: Path) -> None:
    from rcsa_ident.io.results.learnt_tips import learnt_tip_of, learnt_tip_to_json

    _json(raw, lambda data, where: learnt_tip_to_json(learnt_tip_of(data, where)), folder)


def _robot_result(raw: bytes, folder: Path) -> None:
    from rcsa_ident.io.results.robot_results import robot_posterior_of

    _json(raw, robot_posterior_of, folder)


def _library(raw: bytes, folder: Path) -> None:
    from api.work.libraries import imported
    from rcsa_ident.io.settings.tool_libraries import Assumptions

    imported(raw, Assumptions(), None)


# what the service hears


def _frames(raw: bytes, folder: Path) -> None:
    from api.streams.frames import samples_of, samples_of_text
    from rcsa_ident.base.errors import InputError

    for read in (samples_of, lambda raw, channels: samples_of_text(raw.decode("utf-8", "replace"), channels)):
        try:
            _, samples = read(raw, 2)
        except InputError:
            continue
        assert samples.shape[1] == 2
        assert np.all(np.isfinite(samples))


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


def _headers(raw: bytes, folder: Path) -> None:
    """The first byte says which of the headers that the service parses itself."""
    from fastapi import Request

    from api.conventions import expected, unchanged
    from api.routes import tus
    from api.transfer.body_stream import announced_digest, announced_length

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
    if raw:
        readers[raw[0] % len(readers)]()


def _backup(raw: bytes, folder: Path) -> None:
    import shutil

    from api.backups.load import restore

    (folder / "given.tar").write_bytes(raw)
    shutil.rmtree(folder / "restored", ignore_errors=True)
    restore(folder / "given.tar", folder / "restored")


_IO = "rcsa_ident.io"


def _posture_file(path: Path) -> None:
    from rcsa_ident.io.settings.postures import read_postures
    from rcsa_ident.io.settings.robots import read_robot

    read_postures(path, read_robot(Path(__file__).resolve().parent.parent / "data" / "robots" / "tx200.toml"))


def _path_forces(path: Path) -> None:
    from rcsa_ident.io.paths.path_forces import read_path_forces
    from rcsa_ident.io.paths.tool_paths import tool_path_of

    read_path_forces(path, tool_path_of(seeds.PLACES, "given"))


def _tool_path(suffix: str) -> Read:
    def read(path: Path) -> None:
        from rcsa_ident.io.paths.gcode import kept_words
        from rcsa_ident.io.paths.tool_paths import read_tool_path, write_tool_path

        found = read_tool_path(path)
        kept = kept_words(path)[0] if suffix == ".nc" else ()
        write_tool_path(path.with_name(f"again{suffix}"), found, kept=kept)
        again = read_tool_path(path.with_name(f"again{suffix}"))
        assert np.allclose(again.places[-1], found.places[-1], rtol=0.0, atol=1e-6)

    return _file(suffix, read)


def _mesh(kind: str) -> Read:
    def read(raw: bytes, folder: Path) -> object:
        from rcsa_ident.io.paths.meshes import mesh_of

        return mesh_of(raw, kind, "given")

    return read


def _small(suffix: str, name: str, module: str, read: str, *further: Any) -> Target:
    """A reader of a path whose seed is a few lines."""
    return Target(
        _by_path(suffix, f"{_IO}.{module}", read, *further), seeds.texts(seeds.SMALL[name]), "toml" if suffix == ".toml" else "text"
    )


#: By the name that the command takes.
TARGETS: Mapping[str, Target] = {
    "csv": Target(_recording(".csv"), seeds.written(seeds.tables), "text"),
    "hdf5": Target(_recording(".h5"), seeds.written(seeds.hdf5)),
    "tdms": Target(_recording(".tdms"), seeds.written(seeds.tdms)),
    "wav": Target(_recording(".wav", ("ch1",)), seeds.written(seeds.wavs)),
    "rf64": Target(_recording(".rf64", ("ch1",)), seeds.sounds("rf64")),
    "flac": Target(_recording(".flac", ("ch1",)), seeds.sounds("flac")),
    "aiff": Target(_recording(".aiff", ("ch1",)), seeds.sounds("aiff", "aiff-float")),
    "caf": Target(_recording(".caf", ("ch1",)), seeds.sounds("caf")),
    "w64": Target(_recording(".w64", ("ch1",)), seeds.sounds("w64")),
    "ogg": Target(_recording(".ogg", ("ch1",)), seeds.sounds("vorbis", "opus")),
    "mp3": Target(_recording(".mp3", ("ch1",)), seeds.sounds("mp3")),
    "matlab-5": Target(_recording(".mat"), seeds.written(seeds.matlab5)),
    "matlab-7.3": Target(_recording(".mat"), seeds.recorded("mat-7.3")),
    "parquet": Target(_recording(".parquet"), seeds.recorded("parquet")),
    "uff": Target(_file(".uff", _uff), seeds.written(seeds.uffs)),
    "frf": Target(_file(".csv", _frfs), seeds.written(seeds.frf_texts), "text"),
    "listen": Target(_listened, seeds.written(seeds.rung)),
    "hits": Target(_tapped, seeds.written(seeds.hits), "text"),
    "tooling": Target(_tooling, seeds.written(seeds.toolings), "toml"),
    "campaign": Target(_campaign, seeds.written(seeds.campaigns), "toml"),
    "machine": Target(_machine, seeds.of_repository("data/machines/hpm.toml", "data/machines/stiff.toml"), "toml"),
    "modes": Target(_of_keys(f"{_IO}.settings.modes", "modes_of"), seeds.texts(seeds.OBLIQUE), "toml"),
    "robot": Target(_of_keys(f"{_IO}.settings.robots", "robot_of"), seeds.of_repository("data/robots/tx200.toml"), "toml"),
    "cases": Target(_file(".toml", _cases), seeds.written(seeds.cases), "toml"),
    "workpiece": _small(".toml", "workpiece", "settings.dynamometer", "read_workpiece"),
    "stickouts": Target(
        _by_path(".toml", f"{_IO}.settings.stickouts", "read_stickouts", (0.05, 0.07)), seeds.written(seeds.toolings), "toml"
    ),
    "result": Target(_result, seeds.written(seeds.results), "json"),
    "learnt": Target(_learnt, seeds.written(seeds.learnts), "json"),
    "robot-result": Target(_robot_result, seeds.written(seeds.robot_results), "json"),
    "library": Target(_library, seeds.written(seeds.libraries), "json"),
    "library-xml": Target(_library, seeds.written(seeds.hsm_libraries), "text"),
    "library-zip": Target(_library, seeds.written(seeds.zipped_library)),
    "gcode": Target(_tool_path(".nc"), seeds.written(seeds.programs), "text"),
    "path": Target(_tool_path(".csv"), seeds.texts(seeds.PLACES), "text"),
    "cuts": Target(_text(f"{_IO}.settings.tested_cuts", "tested_cuts_of"), seeds.of_repository("api/examples/CUTS.csv"), "text"),
    "lobes": _small(".csv", "lobes", "curves.lobes", "read_lobes"),
    "flange": Target(_text(f"{_IO}.curves.flanges", "flange_machine_of"), seeds.written(seeds.flanges), "text"),
    "forces": _small(".csv", "forces", "curves.forces", "read_forces"),
    "path-forces": Target(_file(".csv", _path_forces), seeds.texts(seeds.SMALL["path-forces"]), "text"),
    "postures": Target(_file(".csv", _posture_file), seeds.texts(seeds.SMALL["postures"]), "text"),
    "static": _small(".csv", "static", "settings.robot_static", "read_static_tests", 2),
    "motion-csv": _small(".csv", "motion-csv", "recordings.robot_records", "read_joint_record"),
    "motion-mat": Target(_by_path(".mat", f"{_IO}.recordings.robot_records", "read_joint_record"), seeds.written(seeds.motion)),
    "engagement": _small(".csv", "engagement", "settings.engagements", "read_engagement_map"),
    "spindle": _small(".csv", "spindle", "settings.spindle_drives", "read_spindle_drive"),
    "stl": Target(_mesh(".stl"), seeds.surfaces("stl")),
    "obj": Target(_mesh(".obj"), seeds.surfaces("obj"), "text"),
    "ply": Target(_mesh(".ply"), seeds.surfaces("ply")),
    "urdf": Target(_by_path(".urdf", f"{_IO}.settings.urdf", "read_urdf", (1e6,)), seeds.written(seeds.urdfs), "text"),
    "frames": Target(_frames, seeds.frames),
    "multipart": Target(_multipart, seeds.forms),
    "headers": Target(_headers, seeds.headers),
    "backup": Target(_backup, seeds.written(seeds.backups)),
}  # fmt: skip


def refusals() -> tuple[type[Exception], ...]:
    """Return what a reader raises on purpose."""
    from api.problems import Problem
    from rcsa_ident.base.errors import InputError

    return InputError, Problem
