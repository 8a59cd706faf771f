"""A data logger against the service as its command starts it: a stream, a reader who does not read, two ends."""

from __future__ import annotations

import signal

import numpy as np
import pytest

from api.client import Client
from api.stream_client import Event, Forces, ForceStream, StreamRefused
from tests.fixtures.force_stream import RATE, hello, result, signals, streamed, tooling
from tests.fixtures.service import processes, serving
from tests.fixtures.virtual_cut import relative_error
from tests.fixtures.waiting import PATIENCE, ended, until


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    """A service with the machine and its tooling: its process, port and the machine's id."""
    with serving(tmp_path_factory.mktemp("served")) as found, Client(found.url) as client:
        id = client.make_machine("m").id
        client.identify(id, result())
        client.write_tooling("T1", tooling())
        yield found.process, found.port, id


@pytest.mark.slow
@pytest.mark.parametrize("form", ["float32", "json"])
def test_a_logger_gets_the_forces_of_all_its_samples(served, form):
    _, port, id = served
    raw, true = signals(0.0, 3.0), streamed()[1]
    with ForceStream(f"ws://127.0.0.1:{port}", hello(id, begins="air", format=form, name="logger")) as stream:
        for first in range(0, len(raw), 1024):
            stream.send(raw[first : first + 1024])
        stream.end()
        messages = list(stream.received())
    events = {m.name: m.content for m in messages if isinstance(m, Event)}
    forces = [m for m in messages if isinstance(m, Forces)]
    assert {"opened", "ready", "end"} <= set(events)
    assert (events["end"]["samples"], events["end"]["lost"], events["end"]["dropped"], events["end"]["unread"]) == (len(raw), 0, 0, 0)
    first = events["ready"]["first"]
    assert [m.first for m in forces] == (first + np.cumsum([0, *(len(m.values) for m in forces)])[:-1]).tolist()
    force, later = np.concatenate([m.values for m in forces]), round(1.7 * RATE)
    assert np.all(relative_error(force[later - first :], true, RATE) < 0.04)


def test_buckets(served):
    _, port, id = served
    raw = signals(2.0, 2.5)
    with ForceStream(f"ws://127.0.0.1:{port}", hello(id, envelope=100)) as stream:
        stream.send(raw, 250)
        stream.end()
        messages = list(stream.received())
    forces = [m for m in messages if isinstance(m, Forces)]
    (begin,) = (m.content["first"] // 100 for m in messages if isinstance(m, Event) and m.name == "ready")
    assert forces[0].first == 100 * begin
    rows = np.concatenate([m.values for m in forces])
    assert rows.shape == ((250 + len(raw)) // 100 - begin, 2, 2)
    assert np.all(rows[:, :, 0] <= rows[:, :, 1])


def test_what_is_refused_is_told(served):
    _, port, id = served
    with ForceStream(f"ws://127.0.0.1:{port}", hello("nobody")) as stream, pytest.raises(StreamRefused) as caught:
        list(stream.received())
    assert (caught.value.code, caught.value.problem["status"]) == (1008, 404)
    with ForceStream(f"ws://127.0.0.1:{port}", hello(id)) as stream:
        stream.send(np.full((1000, 4), np.nan))
        with pytest.raises(StreamRefused, match="finite") as caught:
            list(stream.received())
        with pytest.raises(StreamRefused):
            stream.send(np.zeros((1000, 4)))
    assert caught.value.problem["errors"][0]["field"] == "samples"
    with pytest.raises(StreamRefused) as caught:
        ForceStream(f"ws://127.0.0.1:{port}", hello(id), key="ri_wrong_key")
    assert (caught.value.code, caught.value.problem["title"]) == (401, "Unauthorized")


@pytest.mark.slow
def test_a_viewer_who_does_not_read_costs_no_memory(served):
    """More than the system holds for it: what it does not read makes way, and is counted; the logger notices nothing."""
    process, port, id = served
    raw = np.tile(signals(2.0, 2.1), (10, 1))
    with ForceStream(f"ws://127.0.0.1:{port}", hello(id)) as stream:
        stream.send(raw)
        ready = next(m for m in stream.received() if isinstance(m, Event) and m.name == "ready").content
        before, got = processes(process.pid)["service"].megabytes, 0
        with ForceStream(f"ws://127.0.0.1:{port}", {"watch": ready["session"], "format": "json"}) as viewer:
            assert next(iter(viewer.received())).name == "watching"
            for _ in range(23):
                stream.send(raw)
                for message in stream.received(10.0):
                    got += len(message.values) if isinstance(message, Forces) else 0
                    if got >= stream.following - ready["first"] - len(raw):
                        break
            stream.end()
            ends = [m.content for m in stream.received() if isinstance(m, Event) and m.name == "end"]
            # 4 MB of forces wait
            assert processes(process.pid)["service"].megabytes < before + 40.0
            seen = list(viewer.received())
    assert (ends[0]["samples"], ends[0]["unread"], ends[0]["dropped"]) == (24 * len(raw), 0, 0)
    end = next(m.content for m in seen if isinstance(m, Event) and m.name == "end")
    read = sum(len(m.values) for m in seen if isinstance(m, Forces))
    assert end["unread"] > 0
    assert read + end["unread"] <= 24 * len(raw)


@pytest.mark.slow
def test_the_service_ends_with_its_streams(served):
    process, port, id = served
    with ForceStream(f"ws://127.0.0.1:{port}", hello(id)) as stream:
        assert next(iter(stream.received())).name == "opened"
        streams = processes(process.pid)["streams"].pid
        process.send_signal(signal.SIGTERM)
        with pytest.raises(StreamRefused) as caught:
            list(stream.received())
        assert caught.value.code in (1001, 1012)
    assert process.wait(PATIENCE) is not None
    until(lambda: ended(streams))
