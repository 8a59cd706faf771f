"""Live forces through the service: the batch's figures, counters that are true, hostile frames, viewers, ends of all kinds."""

from __future__ import annotations

import json
import os

import numpy as np
import pytest

from api.streams.engine import FAILED, Message
from api.streams.frames import unpacked
from api.streams.process import StreamProcess
from api.work.forces import observed
from api.work.machine_cache import read
from api.work.toolings import tooling_of
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.signals.recording import Quantity, Recording, Sensor
from rcsa_ident.workflows.estimate_forces import MonitoredCut
from tests.api.in_process import Near
from tests.api.streaming import STREAM, closed, send, streaming, until
from tests.fixtures.force_stream import CHANNELS, RATE, SENSITIVITY, hello, result, signals, streamed, tooling
from tests.fixtures.virtual_cut import relative_error
from tests.fixtures.waiting import ended
from tests.fixtures.waiting import until as until_true

SETTLE = round(0.2 * RATE)


@pytest.fixture
def shop(tmp_path):
    with streaming(tmp_path) as found:
        yield found


def hub_of(http):
    return http.app.state.components.streams


def offline(raw: np.ndarray, design: int) -> tuple[MonitoredCut, np.ndarray]:
    """What the commands make of the first samples, and what the observer of these gives of all of them."""
    kinds = [(q, a) for q in (Quantity.DISPLACEMENT, Quantity.ACCELERATION) for a in (Dof.X, Dof.Y)]
    sensors = tuple(Sensor(n, q, a, s) for n, (q, a), s in zip(CHANNELS, kinds, SENSITIVITY, strict=True))
    samples = raw / SENSITIVITY
    first = Recording(RATE, samples[:design], sensors)
    found = observed(read(result()), tooling_of(tooling()), first, None, 12000.0 * np.pi / 30.0, "resonators")
    return found, found.observer.run(found.observer.init(), samples[:, :2], samples[:, 2:])[1].force


def batch(raw: np.ndarray) -> np.ndarray:
    """Forces of the commands' observer, made from the first 0.2 s, without those in which it settles."""
    found, force = offline(raw, SETTLE)
    return force[found.observer.settling :]


def joined(frames) -> np.ndarray:
    return np.concatenate([unpacked(f)[1] if isinstance(f, bytes) else np.array(f["samples"]) for f in frames])


@pytest.mark.slow
def test_what_speaks_against_the_machine_is_said_when_the_stream_is_ready(shop):
    """As it is with the forces of a recording."""
    http, id = shop
    doubted = json.dumps(json.loads(result()) | {"status": "suspect", "reasons": ["too few cuts"]})
    path = f"/v1/machines/{id}/identification"
    assert http.put(path, content=doubted, headers={"Content-Type": "application/json"}).status_code == 200
    with http.websocket_connect(STREAM) as socket:
        socket.send_json(hello(id))
        send(socket, 0, signals(2.0, 2.3))
        notes = until(socket, "ready")[0]["notes"]
    assert notes[0] == "the identification is suspect: too few cuts"


@pytest.mark.slow
@pytest.mark.parametrize("text", [True, False])
def test_live_forces_are_those_of_the_batch(shop, text):
    http, id = shop
    raw = signals(2.0, 2.6)
    expected = batch(raw)
    cuts = np.cumsum([1, 700, 13, 2048, 1, 4000, 900, 3000])
    with http.websocket_connect(STREAM) as socket:
        socket.send_json(hello(id, format="json" if text else "float32"))
        opened = until(socket, "opened")[0]
        assert (opened["axes"], opened["settle_samples"]) == (["X", "Y"], SETTLE)
        for first, part in zip([0, *cuts], np.split(raw, cuts), strict=True):
            send(socket, int(first) + 5, part, text)
        ready = until(socket, "ready")[0]
        assert ready["session"] == opened["session"]
        settling = len(raw) - len(expected)
        assert ready["first"] == 5 + settling
        assert ready["left_out_s"] == pytest.approx(settling / RATE)
        assert ready["spindle_speed_rpm"] == pytest.approx(12000.0, rel=1e-5)
        assert abs(ready["delay_samples"]) < 0.5
        assert any("no air cut" in note for note in ready["notes"])
        socket.send_json({"event": "end"})
        end, frames = until(socket, "end")
        assert (end["samples"], end["lost"], end["late"], end["dropped"], end["backlog"]) == (len(raw), 0, 0, 0, 0)
        assert end["settling"] == settling
        assert closed(socket) == (1000, {})
    starts = [unpacked(f)[0] if isinstance(f, bytes) else f["first"] for f in frames]
    assert starts[0] == 5 + settling
    assert starts == sorted(starts)
    np.testing.assert_allclose(joined(frames), expected, rtol=0, atol=(1e-9 if text else 1e-6) * np.abs(expected).max())


@pytest.mark.slow
def test_the_first_forces_are_as_large_as_offline(shop):
    """No start of the observer in the first blocks, nor in their RMS: offline, of the whole record, the same samples have the same."""
    http, id = shop
    raw = signals(2.0, 2.9)
    with http.websocket_connect(STREAM) as socket:
        socket.send_json(hello(id))
        for first in range(0, len(raw), 512):
            send(socket, first, raw[first : first + 512])
        first = until(socket, "ready")[0]["first"]
        socket.send_json({"event": "end"})
        end, frames = until(socket, "status", "end")
        told = [end["rms_n"]]
        while end["event"] != "end":
            end, more = until(socket, "status", "end")
            frames += more
            told.append(end["rms_n"])
    live, whole = joined(frames), offline(raw, len(raw))[1][first:]
    assert end["settling"] == first == len(raw) - len(live)
    for part in (slice(0, 512), slice(0, 4096), slice(None)):
        np.testing.assert_allclose(np.std(live[part], axis=0), np.std(whole[part], axis=0), rtol=0.03)
    told = np.array([[each["X"], each["Y"]] for each in told if each["X"] is not None])
    assert len(told)
    np.testing.assert_allclose(told, np.broadcast_to(np.std(whole, axis=0), told.shape), rtol=0.05)


@pytest.mark.slow
def test_forces_are_true(shop):
    """A stream that begins in air; the tool enters after a second and a half, and the spindle slows down under it. 300 to 4300 Hz."""
    http, id = shop
    raw, true = signals(0.0, 3.0, wander=3e-4, sag=1e-3), streamed(3e-4, 1e-3)[1]
    with http.websocket_connect(STREAM) as socket:
        socket.send_json(hello(id, begins="air", settle_s=1.0, axes=["Y", "X"]))
        for first in range(0, len(raw), 4096):
            send(socket, first, raw[first : first + 4096])
        until(socket, "ready")
        socket.send_json({"event": "end"})
        end, frames = until(socket, "end")
    force = joined(frames)[:, ::-1]
    assert np.all(relative_error(force[-SETTLE * 5 :], true, RATE) < 0.06)
    assert end["speed_drift_percent"] == pytest.approx(-0.1, abs=0.04)
    assert end["angle_known"]


@pytest.mark.slow
def test_a_drift_beyond_what_the_observer_is_made_for_is_told(shop):
    http, id = shop
    raw = signals(0.0, 3.0, sag=4e-3)
    with http.websocket_connect(STREAM) as socket:
        socket.send_json(hello(id, begins="air"))
        for first in range(0, len(raw), 4096):
            send(socket, first, raw[first : first + 4096])
        until(socket, "ready")
        socket.send_json({"event": "end"})
        end = until(socket, "end")[0]
    assert end["speed_drift_percent"] == pytest.approx(-0.4, abs=0.01)
    assert any("-0.40 %" in note and "new stream" in note for note in end["notes"])


@pytest.mark.slow
def test_counters_are_true(shop):
    """Known losses, repeats, overlaps and latecomers."""
    http, id = shop
    raw = signals(2.0, 2.9)
    sent = [(0, 8000), (8100, 2000), (8100, 2000), (10000, 600), (9000, 500), (15600, 400), (16000, 1)]
    with http.websocket_connect(STREAM) as socket:
        socket.send_json(hello(id))
        for first, count in sent:
            send(socket, first, raw[first : first + count])
        first = until(socket, "ready")[0]["first"]
        socket.send_json({"event": "end"})
        end, frames = until(socket, "end")
    assert (end["lost"], end["late"], end["dropped"], end["backlog"]) == (100 + 5000, 2000 + 100 + 500, 0, 0)
    assert end["samples"] == 8000 + 2000 + 500 + 400 + 1 == len(joined(frames)) + end["settling"]
    covered = sorted({i for f in frames for i in range(unpacked(f)[0], unpacked(f)[0] + len(unpacked(f)[1]))})
    # behind the large gap the observer settles again
    assert covered == [*range(first, 8000), *range(8100, 10600)]
    # bridged: as good behind the small gap as without it
    whole = batch(raw[:10000])
    apart = np.std(joined(frames)[8000 - first : 8200 - first] - whole[8100 - first : 8300 - first], axis=0)
    assert np.all(apart < 0.05 * np.std(whole, axis=0))
    text = http.get("/metrics").text
    assert "rcsa_ident_stream_lost_samples_total 5100.0" in text
    assert f"rcsa_ident_stream_samples_total {end['samples']}.0" in text
    assert "rcsa_ident_stream_delay_seconds_count" in text


@pytest.mark.slow
def test_a_service_that_is_behind_drops_the_oldest_and_says_so(tmp_path):
    near = Near()
    with streaming(tmp_path, near, stream_buffer_seconds=6.0) as (http, id), http.websocket_connect(STREAM) as socket:
        socket.send_json(hello(id))
        raw, most = signals(2.0, 3.0), round(6.0 * RATE)
        for first in range(0, 20480, 4096):
            send(socket, first, raw[first : first + 4096])
        until(socket, "ready")
        near.slow = True
        sent = 20480
        for _ in range(60):
            send(socket, sent, raw[:4096])
            sent += 4096
        status = until(socket, "status")[0]
        while status["backlog"] + status["samples"] + status["dropped"] < sent:
            status = until(socket, "status")[0]
        assert status["dropped"] > 0
        # those on their way come on top
        assert status["backlog"] <= most + 4 * 4096
        near.slow = False
        http.portal.call(near.work)
        socket.send_json({"event": "end"})
        end = until(socket, "end")[0]
        assert (end["lost"], end["backlog"]) == (0, 0)
        assert end["samples"] + end["dropped"] == sent
        assert end["dropped"] >= sent - 20480 - most - 8 * 4096 > 0
        assert f"rcsa_ident_stream_dropped_samples_total {end['dropped']}.0" in http.get("/metrics").text


@pytest.mark.slow
def test_a_viewer_sees_the_same_in_buckets(shop):
    http, id = shop
    raw = signals(2.0, 2.8)
    with http.websocket_connect(STREAM) as socket, http.websocket_connect(STREAM) as viewer:
        socket.send_json(hello(id, name="lathe 3"))
        session = until(socket, "opened")[0]["session"]
        viewer.send_json({"watch": session, "envelope": 64, "format": "json"})
        watching = until(viewer, "watching")[0]
        assert (watching["name"], watching["axes"]) == ("lathe 3", ["X", "Y"])
        for first in range(0, len(raw), 1000):
            send(socket, first, raw[first : first + 1000])
        until(socket, "ready")
        ready = until(viewer, "ready")[0]
        assert ready["session"] == session
        (item,) = http.get("/v1/forces/streams").json()["items"]
        assert (item["session"], item["name"], item["machine"], item["tooling"], item["stage"]) == (session, "lathe 3", id, "T1", "live")
        # one that comes later is told, too
        with http.websocket_connect(STREAM) as late:
            late.send_json({"watch": session})
            assert until(late, "ready")[0] == ready
        socket.send_json({"event": "end"})
        frames = until(socket, "end")[1]
        seen = until(viewer, "end")[1]
        assert closed(viewer) == (1000, {})
    force = joined(frames)
    begin = ready["first"]
    assert force.shape == (len(raw) - begin, 2)
    assert seen[0]["first"] == begin // 64 * 64
    # the first bucket holds less than the others
    force, rows = force[-begin % 64 :], joined(seen)[1 if begin % 64 else 0 :]
    assert [f["first"] for f in seen] == (seen[0]["first"] + np.cumsum([0, *(64 * len(f["samples"]) for f in seen)])[:-1]).tolist()
    whole = force[: len(rows) * 64].reshape(-1, 64, 2)
    np.testing.assert_allclose(rows[:, :, 0], whole.min(axis=1), rtol=1e-5)
    np.testing.assert_allclose(rows[:, :, 1], whole.max(axis=1), rtol=1e-5)
    assert len(rows) == len(force) // 64
    assert http.get("/v1/forces/streams").json()["items"] == []


@pytest.mark.slow
def test_a_viewer_goes_and_the_stream_stays(shop):
    http, id = shop
    with http.websocket_connect(STREAM) as socket:
        socket.send_json(hello(id))
        session = until(socket, "opened")[0]["session"]
        with http.websocket_connect(STREAM) as viewer:
            viewer.send_json({"watch": session})
            until(viewer, "watching")
            viewer.send_text("anything")
        send(socket, 0, signals(2.0, 2.3))
        until(socket, "ready")
        assert len(hub_of(http).sessions[session].listeners) == 1


def test_only_so_many(tmp_path):
    with streaming(tmp_path, streams=2, streams_per_group=1, stream_listeners=1) as (http, id), http.websocket_connect(STREAM) as socket:
        socket.send_json(hello(id))
        session = until(socket, "opened")[0]["session"]
        with http.websocket_connect(STREAM) as second:
            second.send_json(hello(id))
            code, problem = closed(second)
        assert (code, problem["status"]) == (1013, 503)
        assert "1 streams of this group" in problem["detail"]
        with http.websocket_connect(STREAM) as viewer:
            viewer.send_json({"watch": session})
            until(viewer, "watching")
            with http.websocket_connect(STREAM) as more:
                more.send_json({"watch": session})
                assert closed(more)[0] == 1013


@pytest.mark.slow
def test_who_sends_nothing_is_ended(tmp_path):
    with streaming(tmp_path, stream_idle_seconds=1.0) as (http, id), http.websocket_connect(STREAM) as socket:
        socket.send_json(hello(id))
        code, problem = closed(socket)
    assert (code, problem["status"]) == (1008, 408)
    assert "1 s" in problem["detail"]


def test_an_observer_that_cannot_be_made_has_an_end_in_time(shop, monkeypatch):
    """Of lonely samples none is ever made, however many come."""
    http, id = shop
    monkeypatch.setattr("api.live.stream_connection.SETTLING", 0.1)
    with http.websocket_connect(STREAM) as socket:
        socket.send_json(hello(id))
        until(socket, "opened")
        for k in range(50):
            send(socket, 2 * k, np.zeros((1, 4)))
        code, problem = closed(socket)
    assert (code, problem["status"], problem["errors"][0]["field"]) == (1008, 422, "samples")
    assert f"no {SETTLE} samples without a gap within 0.1 s" in problem["detail"]


@pytest.mark.slow
def test_the_observer_waits_for_a_steady_part(shop):
    """The spindle stands at first: noise, of which no observer can be made. It is told, and the next second is tried."""
    http, id = shop
    still = np.random.default_rng(1).standard_normal((2 * SETTLE, 4)) * SENSITIVITY * [1e-8, 1e-8, 0.05, 0.05]
    raw = np.concatenate([still, signals(2.0, 2.5)])
    with http.websocket_connect(STREAM) as socket:
        socket.send_json(hello(id))
        for first in range(0, len(raw), 1024):
            send(socket, first, raw[first : first + 1024])
        for _ in range(2):
            told = until(socket, "settling")[0]
            assert "spindle_speed_rpm" in told["detail"] or "recording" in told["detail"]
        ready = until(socket, "ready")[0]
        assert ready["first"] == 2 * SETTLE + round(ready["left_out_s"] * RATE)
        socket.send_json({"event": "end"})
        end, frames = until(socket, "end")
    assert end["dropped"] == 2 * SETTLE
    assert end["samples"] == len(raw) - 2 * SETTLE == len(joined(frames)) + end["settling"]


def test_an_end_before_there_is_an_observer(shop):
    http, id = shop
    with http.websocket_connect(STREAM) as socket:
        socket.send_json(hello(id))
        send(socket, 0, signals(2.0, 2.1))
        socket.send_json({"event": "end"})
        end = until(socket, "end")[0]
        assert (end["samples"], end["backlog"]) == (0, round(0.1 * RATE))
        assert closed(socket)[0] == 1000
    with http.websocket_connect(STREAM) as socket:
        socket.send_json(hello(id))
        send(socket, 0, signals(2.0, 2.3))
        # with enough for one it is made, and everything is answered
        socket.send_json({"event": "end"})
        end, frames = until(socket, "end")
        assert end["samples"] == len(joined(frames)) + end["settling"] == round(0.3 * RATE)


def test_a_client_that_vanishes_leaves_nothing_behind(shop):
    http, id = shop
    with http.websocket_connect(STREAM) as socket:
        socket.send_json(hello(id))
        send(socket, 0, signals(2.0, 2.3))
        until(socket, "ready")
    hub = hub_of(http)
    assert not hub.sessions
    assert not hub.by_number
    assert not hub.host.engine.sessions


@pytest.mark.slow
def test_the_end_of_the_service_is_told(tmp_path):
    with streaming(tmp_path) as (http, id), http.websocket_connect(STREAM) as socket:
        socket.send_json(hello(id))
        until(socket, "opened")
        http.portal.call(hub_of(http).stop)
        code, problem = closed(socket)
    assert (code, problem["status"], problem["detail"]) == (1001, 503, "the service is shutting down")


def test_what_fails_unforeseen_is_told_without_its_text(shop):
    http, id = shop
    with http.websocket_connect(STREAM) as socket:
        socket.send_json(hello(id))
        send(socket, 0, signals(2.0, 2.3))
        until(socket, "ready")
        hub = hub_of(http)
        (number,) = hub.by_number
        http.portal.call(hub._deliver, Message(FAILED, number, content=b"secret detail"))
        code, problem = closed(socket)
    assert (code, problem["status"]) == (1011, 500)
    assert "secret" not in json.dumps(problem)


def test_forces_that_are_not_finite_end_the_stream(shop):
    http, id = shop
    raw = signals(2.0, 2.3)
    with http.websocket_connect(STREAM) as socket:
        socket.send_json(hello(id))
        send(socket, 0, raw)
        until(socket, "ready")
        _, state = hub_of(http).host.engine.sessions[1]
        object.__setattr__(state.observer.axes[0], "offset", 1e308)
        send(socket, len(raw), raw)
        code, problem = closed(socket)
    assert code == 1008
    assert problem["errors"][0]["found"] == "signals whose forces are not finite"


@pytest.mark.slow
def test_the_process_of_the_streams_is_replaced_when_it_dies(tmp_path):
    """Spawned, killed without a word: sessions go on, what was on its way is counted as dropped."""
    host = StreamProcess()
    with streaming(tmp_path, host) as (http, id), http.websocket_connect(STREAM) as socket:
        raw = signals(2.0, 3.0)
        socket.send_json(hello(id))
        send(socket, 0, raw[:10_000])
        until(socket, "ready")
        while until(socket, "status")[0]["samples"] < 10_000:
            pass
        os.kill(host.process.pid, 9)
        until(socket, "restarted")
        send(socket, 10_000, raw[10_000:])
        socket.send_json({"event": "end"})
        end, frames = until(socket, "end")
        assert end["samples"] + end["dropped"] == len(raw)
        assert end["dropped"] <= 5000
        # settled again: the forces of the batch
        expected, force = batch(raw), joined(frames)
        last = len(raw) - 10_000 - end["settling"] // 2
        np.testing.assert_allclose(force[-last:], expected[-last:], atol=0.1 * np.abs(expected).max())
        second = host.process.pid
    until_true(lambda: ended(second))


def test_a_slow_spindle_has_enough_revolutions(shop):
    http, id = shop
    for speed, settle in ((600, 12 * 0.1), (6000, 0.2)):
        with http.websocket_connect(STREAM) as socket:
            socket.send_json(hello(id, spindle_speed_rpm=speed))
            assert until(socket, "opened")[0]["settle_samples"] == pytest.approx(settle * RATE, abs=1)


@pytest.mark.slow
def test_what_the_next_second_can_not_mend_ends_at_once(shop):
    """One axis is asked for where the channels and the machine have two."""
    http, id = shop
    with http.websocket_connect(STREAM) as socket:
        socket.send_json(hello(id, axes=["X"]))
        send(socket, 0, signals(2.0, 2.3))
        code, problem = closed(socket)
    assert (code, problem["errors"][0]["field"]) == (1008, "axes")


@pytest.mark.slow
def test_the_service_is_ready_when_the_streams_are(tmp_path):
    near = Near()
    with streaming(tmp_path, near) as (http, _):
        assert http.get("/ready").status_code == 200
        near.ready = False
        answer = http.get("/ready")
        assert answer.status_code == 503
        assert answer.json()["detail"].endswith("streams is starting, 0 of 4 steps of compilation are done")
        (tmp_path / "kernels" / "lobes.done").touch()
        assert "1 of 4 steps" in http.get("/ready").json()["detail"]
