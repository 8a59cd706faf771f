"""The ring of a tooling over REST: the same nouns as the command's, and nothing stays until somebody writes it."""

from __future__ import annotations

import json
import tomllib

import numpy as np
import pytest
from fastapi.testclient import TestClient
from typer.testing import CliRunner

from api.main import create_app
from api.reading.reader import Limits, Reader
from api.settings import Settings
from rcsa_ident.cli import app
from rcsa_ident.io.settings.setups import read_tooling, tooling_of
from rcsa_ident.io.settings.toolings import tooling_keys, tooling_text
from tests.api.in_process import Here, embedded, refused, service
from tests.api.test_listening import HOSTILE, files_in, wav
from tests.fixtures.rung_tooling import rung_tooling


@pytest.fixture(scope="module")
def rung(tmp_path_factory):
    """A folder with a drawing and two sounds, and the tool's mass [g]."""
    folder = tmp_path_factory.mktemp("ring")
    grams, _ = rung_tooling(folder)
    return folder, grams


@pytest.fixture
def library(client, rung):
    """A client whose library has the drawing as T."""
    folder, _ = rung
    client.write_tooling("T", (folder / "DRAWN.toml").read_text(encoding="utf-8"))
    return client


def keys_of(folder):
    return tomllib.loads((folder / "DRAWN.toml").read_text(encoding="utf-8"))


@pytest.mark.slow
def test_the_same_nouns_as_the_command(library, rung, tmp_path):
    folder, grams = rung
    found = library.ring("T", folder / "whole.wav", bare_tool=[folder / "tool.wav"], mass_g=grams)
    out = tmp_path / "RUNG.toml"
    arguments = ["ring", folder / "DRAWN.toml", folder / "whole.wav", "--bare-tool", folder / "tool.wav", "--mass-g", grams, "--out", out]
    command = CliRunner().invoke(app, [str(each) for each in (*arguments, "--json")])
    said = {key: value for key, value in json.loads(command.stdout).items() if key != "out"}
    answer = json.loads(found.model_dump_json(by_alias=True))
    assert {key: value for key, value in answer.items() if key not in ("learned", "etag", "curves")} == said
    learned = tooling_of(found.learned.model_dump(exclude_none=True), "", "T")
    assert tooling_text(tooling_keys(learned)) == tooling_text(tooling_keys(read_tooling(out)))
    assert (found.status, found.curves) == ("good", None)
    assert {"bending 1", "bending 2"} <= {line.is_ for line in found.heard}
    assert files_in(tmp_path) == []


def test_what_was_learned_is_written_by_an_explicit_step(library, rung):
    """With the tag of what was rung: whoever has changed the drawing meanwhile is not overwritten."""
    folder, _ = rung
    before = library.tooling("T")
    found = library.ring("T", folder / "whole.wav")
    assert library.tooling("T").etag == before.etag == found.etag
    learned = found.learned.model_dump(exclude_none=True)
    kept = library.write_tooling("T", learned, seen=found.etag, why="rung")
    diameter = next(c.after for c in found.changes if c.what == "fluted diameter")
    assert kept.tooling.tool.segments[0].outer_diameter_mm == pytest.approx(diameter)
    assert [(c.version, c.why) for c in library.changes(kind="tooling", name="T")] == [(2, "rung"), (1, "")]
    refused(412, library.write_tooling, "T", learned, seen=found.etag)


def test_a_tooling_that_came_as_json_keeps_its_own_name(client, rung):
    folder, _ = rung
    found = client.ring(keys_of(folder) | {"name": "Ø 12, four flutes"}, folder / "whole.wav", curves=True)
    assert (found.etag, found.tooling, found.learned.name) == (None, "Ø 12, four flutes", "Ø 12, four flutes")
    (curve,) = found.curves
    assert (curve.of, len(curve.frequency_hz) <= 1600, max(curve.amplitude)) == ("tooling", True, 1.0)
    loudest = curve.frequency_hz[int(np.argmax(curve.amplitude))]
    first = next(line for line in found.heard if line.is_ == "bending 1")
    assert loudest == pytest.approx(first.frequency_hz, rel=0.02)


@pytest.mark.parametrize(
    ("files", "further", "field", "words"),
    [
        ((), {}, "recording", "the sound of a hit"),
        ((), {"mass_g": 1500.0}, "mass_g", "what the drawing gives for the tool alone"),
        (("tool.wav",), {}, "recording", "another one that rings"),
        (("whole.wav",), {"mass_g": 0.0}, "mass_g", ""),
        (("whole.wav",), {"rate_hz": -1.0}, "rate_hz", ""),
        (("whole.wav",), {"loudness": 1.0}, "loudness", ""),
        (("DRAWN.toml",), {}, "sounds", "the name of a file that ends in one of"),
    ],
)
def test_what_is_wrong_is_named(library, rung, tmp_path, files, further, field, words):
    folder, _ = rung
    problem = refused(422, library.ring, "T", *(folder / name for name in files), **further)
    assert problem.errors[0].field == field
    assert words in problem.errors[0].allowed
    assert files_in(tmp_path) == []


def test_a_tooling_of_too_many_elements_and_one_that_is_not_there(library, rung):
    folder, _ = rung
    refused(404, library.ring, "T2", folder / "whole.wav")
    keys = keys_of(folder)
    thin = {"length_mm": 0.5, "outer_diameter_mm": 40.0, "material": "steel"}
    keys["holder"] = keys["holder"] | {"segments": [*keys["holder"]["segments"], *[thin] * 190]}
    keys["tool"] = keys["tool"] | {"segments": [*keys["tool"]["segments"], *[thin] * 150]}
    assert refused(422, library.ring, keys, folder / "whole.wav").errors[0].field == "segments"


def test_wrong_forms(http, library, rung):
    folder, _ = rung
    sound = (folder / "whole.wav").read_bytes()
    query = ("query", (None, json.dumps({"tooling": "T"})))
    assert http.post("/v1/ring", json={"tooling": "T"}).status_code == 415
    without = http.post("/v1/ring", files={"sounds": ("a.wav", sound)})
    assert (without.status_code, without.json()["errors"][0]["field"]) == (422, "query")
    for files in ([query, ("recording", ("a.wav", sound))], [query, query], [query, *[("sounds", ("a.wav", b"x"))] * 21]):
        assert http.post("/v1/ring", files=files).status_code == 422
    broken = http.post("/v1/ring", files=[("query", (None, "{")), ("sounds", ("a.wav", sound))])
    assert broken.status_code == 422


@pytest.mark.slow
def test_keys_and_groups(guarded_http, rung):
    http, keys = guarded_http
    folder, _ = rung
    text = (folder / "DRAWN.toml").read_bytes()
    assert http.put("/v1/toolings/T", content=text, headers={"Content-Type": "application/toml", "X-API-Key": keys["upload"]}).is_success
    files = [("query", (None, json.dumps({"tooling": "T"}))), ("sounds", ("a.wav", (folder / "whole.wav").read_bytes()))]
    statuses = {name: http.post("/v1/ring", files=files, headers={"X-API-Key": key}).status_code for name, key in keys.items()}
    assert statuses == {"read": 403, "upload": 403, "run": 200, "admin": 200, "other": 404}
    assert http.post("/v1/ring", files=files).status_code == 401


def test_too_many_at_once_and_too_much(store, tmp_path, rung):
    folder, _ = rung
    text, sound = (folder / "DRAWN.toml").read_bytes(), (folder / "whole.wav").read_bytes()
    files = [("query", (None, json.dumps({"tooling": "T"}))), ("sounds", ("a.wav", sound))]
    with service(store, tmp_path, uploads=1, max_upload_bytes=len(sound) // 2) as http:
        assert http.put("/v1/toolings/T", content=text, headers={"Content-Type": "application/toml"}).is_success
        assert http.post("/v1/ring", files=files).status_code == 413
        places = http.app.state.components.uploads.places
        assert places.take("local")
        assert http.post("/v1/ring", files=files).status_code == 503
        places.give("local")
    assert files_in(tmp_path) == []


@pytest.mark.slow
def test_the_cut_off_reader_hears_it_and_refuses_the_hostile(rung, tmp_path):
    """The reader process sees the sounds alone, within its limits."""
    folder, grams = rung
    reader = Reader(Limits(memory=512, seconds=20.0, wall_seconds=60.0, calls=1000), 5)
    with TestClient(create_app(Settings(data=tmp_path), embedded(tmp_path), Here(), reader), base_url="http://localhost") as http:
        query = ("query", (None, json.dumps({"tooling": keys_of(folder), "mass_g": grams, "curves": True})))
        files = {"sounds": "whole.wav", "bare_tool": "tool.wav"}
        sounds = [(field, (name, (folder / name).read_bytes())) for field, name in files.items()]
        answer = http.post("/v1/ring", files=[query, *sounds])
        assert answer.status_code == 200, answer.text
        assert [curve["of"] for curve in answer.json()["curves"]] == ["tooling", "tool alone"]
        hostile = HOSTILE | {"a cut that chatters": (wav(), ".wav")}
        for words, (raw, suffix) in hostile.items():
            refusal = http.post("/v1/ring", files=[query, ("sounds", (f"x{suffix}", raw))])
            assert refusal.status_code == 422, (words, refusal.text[:300])
            assert str(tmp_path) not in refusal.text
            assert files_in(tmp_path) == [], words
