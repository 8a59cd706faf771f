"""Who may open a stream, and what ends one: hostile frames, first messages, keys, pages from elsewhere."""

from __future__ import annotations

import contextlib
import struct

import numpy as np
import pytest
from starlette.testclient import WebSocketDenialResponse
from starlette.websockets import WebSocketDisconnect

from api.security import make_key
from api.streams.frames import packed
from tests.api.streaming import STREAM, closed, send, streaming, until
from tests.fixtures.flange_machine import decoupled_file
from tests.fixtures.force_stream import SENSORS, hello, signals


@pytest.fixture(scope="module")
def shop(tmp_path_factory):
    with streaming(tmp_path_factory.mktemp("streams")) as found:
        yield found


GOOD = np.zeros((4, 4))
BAD_FRAMES = [
    ("float32", b"", 1008, "frame"),
    ("float32", b"\0" * 15, 1008, "frame"),
    ("float32", packed(0, GOOD)[:-1], 1008, "frame"),
    ("float32", packed(0, GOOD) + b"\0", 1008, "frame"),
    ("float32", packed(0, GOOD[:0]), 1008, "samples"),
    ("float32", packed(0, GOOD[:, :3]), 1008, "channels"),
    ("float32", packed(0, GOOD * np.nan), 1008, "samples"),
    ("float32", packed(0, GOOD + np.inf), 1008, "samples"),
    ("float32", packed(0, GOOD + 1e35), 1008, "samples"),
    ("float32", struct.pack("<QII", 0, 2**32 - 1, 4), 1009, "samples"),
    ("float32", packed(0, np.zeros((65537, 4))), 1009, "samples"),
    ("float32", packed(2**60, GOOD), 1008, "first"),
    ("float32", packed(2**40, GOOD), 1008, "first"),
    ("float32", '{"first": 0, "samples": [[0, 0, 0, 0]]}', 1003, "frame"),
    ("float32", "x" * 50, 1008, "message"),
    ("json", packed(0, GOOD), 1003, "frame"),
    ("json", "nonsense", 1008, "message"),
    ("json", "[" * 90, 1008, "message"),
    ("json", "[" * 100_000, 1008, "message"),
    ("json", "[1]", 1008, "message"),
    ("json", '{"first": -1, "samples": [[0, 0, 0, 0]]}', 1008, "first"),
    ("json", '{"first": true, "samples": [[0, 0, 0, 0]]}', 1008, "first"),
    ("json", '{"first": 0, "samples": [[0, 0, 0]]}', 1008, "channels"),
    ("json", '{"first": 0, "samples": [[0, 0, 0, 0], [0]]}', 1008, "samples"),
    ("json", '{"first": 0, "samples": [[0, 0, 0, "1"]]}', 1008, "samples"),
    ("json", '{"first": 0, "samples": [[0, 0, 0, NaN]]}', 1008, "message"),
    ("json", '{"first": 0, "samples": [[0, 0, 0, 1e999]]}', 1008, "samples"),
    ("json", '{"first": 0, "samples": [[0, 0, 0, 1' + "0" * 400 + "]]}", 1008, "samples"),
    ("json", '{"first": 0}', 1008, "samples"),
]  # fmt: skip


@pytest.mark.parametrize(("form", "frame", "code", "field"), BAD_FRAMES)
def test_a_bad_frame_ends_the_stream_with_words(shop, form, frame, code, field):
    http, id = shop
    with http.websocket_connect(STREAM) as socket:
        socket.send_json(hello(id, format=form))
        if form == "float32":
            send(socket, 7, GOOD + 1.0)
        socket.send_text(frame) if isinstance(frame, str) else socket.send_bytes(frame)
        found, problem = closed(socket)
    assert found == code
    assert problem["status"] == {1008: 422, 1003: 415, 1009: 413}[code]
    assert problem["errors"][0]["field"] == field
    assert problem["title"]
    assert problem["request_id"]
    assert not http.app.state.components.streams.sessions
    assert http.get("/health").status_code == 200


@pytest.mark.parametrize(
    ("change", "status", "field"),
    [
        ({"machine": "nobody"}, 404, None),
        ({"tooling": "none"}, 404, None),
        ({"channels": []}, 422, "channels"),
        ({"channels": ["gap_x", "nothing"]}, 422, "channels"),
        ({"channels": ["gap_x", "gap_x"]}, 422, "channels"),
        ({"channels": ["fix_x"]}, 422, "channels"),
        ({"axes": ["X", "X"]}, 422, "axes"),
        ({"axes": ["Z"]}, 422, "axes.0"),
        ({"spindle_speed_rpm": None}, 422, "spindle_speed_rpm"),
        ({"spindle_speed_rpm": "fast"}, 422, "spindle_speed_rpm"),
        ({"sampling_rate_hz": 1e12}, 422, "sampling_rate_hz"),
        ({"settle_s": 100.0}, 422, "settle_s"),
        ({"envelope": 0}, 422, "envelope"),
        ({"more": 1}, 422, "more"),
        ({"begins": "air", "air": {"campaign": "c", "recording": "r.h5"}}, 422, "air"),
        ({"air": {"campaign": "c", "recording": "r.h5"}}, 404, None),
        ({"sensors": {"gap_x": {"quantity": "displacement", "axis": "X", "sensitivity": 0.0}}}, 422, "sensors.gap_x.sensitivity"),
    ],
)
def test_a_hello_that_says_nothing_usable_is_answered(shop, change, status, field):
    http, id = shop
    with http.websocket_connect(STREAM) as socket:
        socket.send_json(hello(id) | change)
        code, problem = closed(socket)
    assert (code, problem["status"]) == (1008, status)
    if field is not None:
        assert problem["errors"][0]["field"] == field


def test_a_stream_on_a_decoupled_flange_is_refused(shop, tmp_path):
    """Once its first samples are there, from which its observer is made; as of a recording."""
    http, id = shop
    decoupled = http.post("/v1/machines", json={"name": "decoupled"}).json()["id"]
    text = decoupled_file(tmp_path / "FLANGE.csv").read_bytes()
    assert http.put(f"/v1/machines/{decoupled}/identification", content=text, headers={"Content-Type": "text/csv"}).status_code == 201
    with http.websocket_connect(STREAM) as socket:
        socket.send_json(hello(id, sensors=SENSORS) | {"machine": decoupled, "settle_s": 0.5})
        send(socket, 0, signals(2.0, 2.5))
        code, problem = closed(socket)
    assert (code, problem["status"]) == (1008, 422)
    assert problem["errors"][0]["field"] == "machine"
    assert "a flange that holds the compliance of its joint" in problem["detail"]


@pytest.mark.parametrize(
    ("first", "code", "status"),
    [
        ("nonsense", 1008, 422),
        ("[1, 2]", 1008, 422),
        ("[" * 100_000, 1008, 422),
        ('{"machine": NaN}', 1008, 422),
        ("{}", 1008, 422),
        ("{}" + " " * 400_000, 1009, 413),
        (b"\0\1", 1003, 415),
        ('{"watch": "nobody"}', 1008, 404),
        ('{"watch": "../x"}', 1008, 422),
        ('{"replay": {"campaign": "c", "recording": "r.h5"}}', 1008, 404),
        ('{"replay": {"campaign": "c", "recording": "r.h5", "rate": 1e9}}', 1008, 422),
        ('{"replay": 1}', 1008, 422),
    ],
)
def test_a_first_message_that_is_none(shop, first, code, status):
    http, _ = shop
    with http.websocket_connect(STREAM) as socket:
        socket.send_text(first) if isinstance(first, str) else socket.send_bytes(first)
        found, problem = closed(socket)
    assert (found, problem["status"]) == (code, status)


def refused(http, headers) -> tuple[int, dict]:
    with pytest.raises(WebSocketDenialResponse) as caught, http.websocket_connect(STREAM, headers=headers):
        pass
    return caught.value.status_code, caught.value.json()


def test_a_page_from_elsewhere_opens_nothing(shop):
    http, id = shop
    for origin in ("http://evil.example", "https://localhost:1", "null", "file://", "http://localhost.evil.example"):
        status, problem = refused(http, {"Origin": origin})
        assert (status, problem["status"]) == (403, 403)
    # a name that leads to this machine, but is another's
    assert refused(http, {"Origin": "http://evil.example", "Host": "evil.example"})[0] == 403
    with http.websocket_connect(STREAM, headers={"Origin": "http://localhost"}) as socket:
        socket.send_json(hello(id))
        until(socket, "opened")


def test_openings_have_a_pace(tmp_path):
    with streaming(tmp_path, burst=5, requests_per_minute=1) as (http, _):
        # the machine, its identification and the tooling have taken three of another count
        for _ in range(5):
            with contextlib.suppress(WebSocketDisconnect), http.websocket_connect(STREAM) as socket:
                socket.send_text("{}")
                closed(socket)
        with pytest.raises(WebSocketDenialResponse) as caught, http.websocket_connect(STREAM):
            pass
    assert caught.value.status_code == 429
    assert int(caught.value.headers["retry-after"]) > 1


@pytest.fixture
def keyed(tmp_path):
    """A service that asks for keys; the machine is group A's."""
    with streaming(tmp_path) as (http, id):
        parts, keys = http.app.state.components, {}
        for name, group, scopes in (
            ("run", "local", ("run",)),
            ("read", "local", ("read",)),
            ("upload", "local", ("upload",)),
            ("other", "B", ("admin",)),
        ):
            key, keys[name] = make_key(group, scopes, name, days=7.0 if name == "read" else None)
            parts.store.keys.add(key)
        object.__setattr__(parts, "settings", parts.settings.model_copy(update={"keys": True}))
        yield http, id, keys


def test_keys_scopes_and_groups(keyed):
    http, id, keys = keyed
    assert refused(http, {"X-API-Key": "ri_wrong_key"})[0] == 401
    for first, status in (
        (hello(id), 401),
        (hello(id, key="ri_wrong_key"), 401),
        (hello(id, key=keys["read"]), 403),
        (hello(id, key=keys["other"]), 404),
        ({"watch": "x", "key": keys["upload"]}, 403),
    ):
        with http.websocket_connect(STREAM) as socket:
            socket.send_json(first)
            code, problem = closed(socket)
        assert (code, problem["status"]) == (1008, status), first
    with http.websocket_connect(STREAM, headers={"X-API-Key": keys["run"]}) as socket:
        socket.send_json(hello(id))
        session = until(socket, "opened")[0]["session"]
        # another group sees nothing of it
        assert http.get("/v1/forces/streams", headers={"X-API-Key": keys["other"]}).json() == {"items": []}
        assert len(http.get("/v1/forces/streams", headers={"X-API-Key": keys["read"]}).json()["items"]) == 1
        with http.websocket_connect(STREAM) as viewer:
            viewer.send_json({"watch": session, "key": keys["other"]})
            assert closed(viewer)[1]["status"] == 404
        with http.websocket_connect(STREAM) as viewer:
            viewer.send_json({"watch": session, "key": keys["read"]})
            until(viewer, "watching")
    # a browser's way
    with http.websocket_connect(STREAM, headers={"Origin": "http://localhost"}) as socket:
        socket.send_json(hello(id, key=keys["run"]))
        until(socket, "opened")


def test_a_stream_ends_with_its_key(keyed, monkeypatch):
    """A viewer's is withdrawn, the sender's expires by the clock."""
    monkeypatch.setattr("api.live.stream_connection.LOOK", 0.1)
    http, id, keys = keyed
    store = http.app.state.components.store
    made, day = make_key("local", ("run",), "a day", days=1.0)
    store.keys.add(made)
    with http.websocket_connect(STREAM) as socket, http.websocket_connect(STREAM) as viewer:
        socket.send_json(hello(id, key=day))
        session = until(socket, "opened")[0]["session"]
        viewer.send_json({"watch": session, "key": keys["read"]})
        until(viewer, "watching")
        store.keys.delete("local", keys["read"].split("_")[1])
        assert closed(viewer)[1]["status"] == 401
        assert session in http.app.state.components.streams.sessions
        monkeypatch.setattr("api.security.now", lambda: made.expires)
        assert closed(socket)[1]["status"] == 401
