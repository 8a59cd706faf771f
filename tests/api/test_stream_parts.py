"""What a stream is made of: bytes, counters, envelopes, a session's queues, listeners who do not read."""

from __future__ import annotations

import asyncio
import json
import struct
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from api.metrics import Metrics
from api.streams import engine
from api.streams.counts import Counts
from api.streams.engine import Message
from api.streams.frames import MOST_INDEX, MOST_SAMPLES, TooLarge, packed, samples_of, samples_of_text, unpacked
from api.streams.hub import MOST_FLYING, PAUSED, Hub, StreamLimits
from api.streams.listener import WAITING_BYTES, WAITING_TEXTS, Envelope, Listener
from api.streams.session import BLOCK, FLYING, About, End, Session, Stage
from rcsa_ident.base.errors import InputError

ABOUT = About("s", "A", "", "m", "T1", "now", 1000.0, ("X", "Y"), 2, 10_000)


@given(st.integers(0, MOST_INDEX), st.integers(1, 40), st.integers(1, 5))
def test_frames_come_back(first, count, channels):
    values = np.random.default_rng(count).standard_normal((count, channels)).astype(np.float32)
    raw = packed(first, values)
    assert raw[:16] == struct.pack("<QII", first, count, channels)
    found, samples = samples_of(raw, channels)
    assert found == first
    np.testing.assert_array_equal(samples, values)
    np.testing.assert_array_equal(unpacked(raw)[1], values)
    exact = values.astype(float) / 3.0
    found, samples = samples_of_text(json.dumps({"first": first, "samples": exact.tolist()}), channels)
    assert found == first
    np.testing.assert_array_equal(samples, exact)


@settings(max_examples=300)
@given(st.binary(max_size=80), st.integers(1, 4))
def test_no_bytes_are_more_than_refused(raw, channels):
    try:
        first, samples = samples_of(raw, channels)
    except InputError:
        return
    assert samples.shape[1] == channels
    assert np.all(np.isfinite(samples))
    assert 0 <= first <= MOST_INDEX


@pytest.mark.slow
@settings(max_examples=300)
@given(
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5), lambda v: st.lists(v, max_size=4), max_leaves=8
    ),
    st.one_of(st.integers(), st.floats(), st.text(max_size=3)),
)
def test_no_text_is_more_than_refused(samples, first):
    for text in (json.dumps({"first": first, "samples": samples}), json.dumps(samples)):
        try:
            found, values = samples_of_text(text, 2)
        except InputError:
            continue
        assert values.shape[1] == 2
        assert np.all(np.isfinite(values))
        assert isinstance(found, int)


def test_a_frame_is_not_larger_than_it_may_be():
    with pytest.raises(TooLarge, match="65536"):
        samples_of(struct.pack("<QII", 0, MOST_SAMPLES + 1, 1), 1)
    # 64 GB are not made room for
    with pytest.raises(InputError):
        samples_of(struct.pack("<QII", 0, 2**32 - 1, 4) + b"\0" * 16, 4)


def naive_envelope(pieces, size):
    """The oracle: a bucket of each multiple of the size, of what came of it; those of which a later one has come are complete."""
    buckets = {}
    for first, values in pieces:
        for k, row in enumerate(values):
            buckets.setdefault((first + k) // size, []).append((first + k, row))
    last = pieces[-1][0] + len(pieces[-1][1])
    return {
        b * size: (np.min([r for _, r in rows], axis=0), np.max([r for _, r in rows], axis=0))
        for b, rows in buckets.items()
        if (b + 1) * size <= last
    }


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 30), st.integers(0, 70)), min_size=1, max_size=8), st.integers(1, 25), st.integers(0, 100))
def test_envelopes_do_not_depend_on_blocks(pieces, size, begin):
    rng, first, blocks = np.random.default_rng(1), begin, []
    for gap, count in pieces:
        blocks.append((first + gap, rng.standard_normal((count, 2))))
        first += gap + count
    blocks = [block for block in blocks if len(block[1])]
    envelope, found = Envelope(size, 2), {}
    for at, values in blocks:
        for start, rows in envelope.add(at, values):
            for k, row in enumerate(rows):
                assert start + k * size not in found
                found[start + k * size] = (row[:, 0], row[:, 1])
    expected = naive_envelope(blocks, size) if blocks else {}
    assert set(found) == set(expected)
    for key, (low, high) in found.items():
        np.testing.assert_array_equal(low, expected[key][0])
        np.testing.assert_array_equal(high, expected[key][1])


@pytest.mark.slow
@settings(max_examples=300)
@given(st.lists(st.tuples(st.integers(0, 300), st.integers(1, 60)), max_size=20), st.integers(0, 3))
def test_every_index_is_counted_once(frames, every):
    """Against a set of all indices that came: what is new has a force, is dropped or waits; what never came is lost."""
    counts, seen, late = Counts(), set(), 0
    for k, (first, count) in enumerate(frames):
        own = set(range(first, first + count))
        highest = max(seen, default=first - 1)
        fresh = {i for i in own if i > highest}
        skipped = counts.take(first, count)
        assert skipped == len(own - fresh)
        late += len(own - fresh)
        seen |= fresh
        if every and k % every == 0:
            counts.done(len(fresh))
        elif every == 3:
            counts.drop(len(fresh))
        assert counts.following - counts.origin == counts.samples + counts.dropped + counts.lost + counts.backlog
    assert counts.late == late
    if frames:
        assert counts.lost == max(seen) + 1 - min(seen) - len(seen)
        assert counts.samples + counts.dropped + counts.backlog == len(seen)


def test_a_session_drops_the_oldest_and_never_holds_more_than_it_may():
    async def run():
        session = Session(ABOUT, 1)
        for k in range(30):
            session.offer(1000 * k, np.full((1000, 2), float(k)), 0.0)
            assert session.held <= ABOUT.most_waiting
        assert session.counts.dropped == 20_000
        assert session.waiting.runs[0] == (20_000, 10_000)
        assert not session.room.is_set()
        assert [session.block()[0] for _ in range(2)] == [20_000, 20_000 + BLOCK]
        # half of what may wait is gone
        assert session.room.is_set()
        assert session.block()[1].shape[0] == 10_000 - 2 * BLOCK
        assert session.block() is None
        for k in range(10):
            session.offer(40_000 + 5000 * k, np.zeros((1, 2)), 0.0)
        # only so many blocks are on their way at once
        assert session.block() is not None
        assert len(session.flying) == FLYING
        assert session.block() is None

    asyncio.run(run())


def test_blocks_end_at_gaps_and_join_small_frames():
    async def run():
        session = Session(ABOUT, 1)
        for first, count in ((0, 10), (10, 5), (20, 3), (23, 6000)):
            session.offer(first, np.zeros((count, 2)), 0.0)
        assert [(b[0], b[1].shape[0]) for b in (session.block() for _ in range(3)) if b] == [
            (0, 15),
            (20, BLOCK),
            (20 + BLOCK, 6003 - BLOCK),
        ]
        assert session.counts.lost == 5
        assert session.held == 0
        session.forces(0, np.ones((15, 2)), 0.001)
        assert (session.counts.samples, session.counts.backlog) == (15, 6003)
        assert session.lost_process() == 6003
        assert (session.counts.dropped, session.counts.backlog) == (6003, 0)

    asyncio.run(run())


def test_the_window_is_the_first_one_without_a_gap():
    async def run():
        session = Session(ABOUT, 1)
        session.offer(0, np.zeros((50, 2)), 0.0)
        assert session.window(100) is None
        session.offer(60, np.ones((70, 2)), 0.0)
        assert session.window(100) is None
        # no observer will be made of what lies before the gap
        assert (session.counts.dropped, session.held) == (50, 70)
        session.offer(130, np.ones((40, 2)), 0.0)
        first, samples = session.window(100)
        assert (first, samples.shape) == (60, (100, 2))
        assert np.all(samples == 1.0)
        assert session.skip(70) == 10
        assert (session.waiting.runs[0], session.counts.dropped) == ((70, 100), 60)

    asyncio.run(run())


@pytest.mark.parametrize("step", [1, 2], ids=["without a gap", "every second one lost"])
def test_a_frame_costs_the_same_however_many_wait(step):
    """Lines of code that run, with the search for a window at each frame: twice the frames, twice the lines."""

    def lines(frames):
        ran = 0

        def follow(*_):
            nonlocal ran
            ran += 1
            return follow

        async def run():
            session = Session(replace(ABOUT, most_waiting=10**6), 1)
            sys.settrace(follow)
            for k in range(frames):
                session.offer(step * k, np.zeros((1, 2)), 0.0)
                session.window(10_000)
            while session.block():
                session.flying.clear()
            sys.settrace(None)

        before = sys.gettrace()
        asyncio.run(run())
        sys.settrace(before)
        return ran

    assert lines(400) < 2.1 * lines(200)


def test_frames_are_counted_per_second_and_not_per_tick(monkeypatch):
    """A tick that comes late has seen the frames of more than a second; too many end a stream, however early they come."""

    class Nowhere:
        def post(self, message):
            pass

    monkeypatch.setattr("api.streams.hub.MOST_FRAMES", 20)

    async def run():
        hub, now = Hub(Nowhere(), StreamLimits(), Metrics(lambda: 0.0)), 0.0
        monkeypatch.setattr(hub.pace, "clock", lambda: now)
        session = hub.open(ABOUT)
        for k in range(200):
            now += 0.05
            hub.offer(session, k, np.zeros((1, 2)))
        # as many as were held up together, and then one more
        now += 1.0
        for k in range(20 * PAUSED):
            hub.offer(session, 1000 + k, np.zeros((1, 2)))
        assert session.stage is Stage.SETTLING
        hub.offer(session, 2000, np.zeros((1, 2)))
        assert (session.end.code, session.end.status) == (1008, 429)

    asyncio.run(run())


def test_sessions_take_turns_and_little_is_on_its_way_however_many_they_are():
    class Sent(list):
        def post(self, message):
            self.extend([message.session] if message.kind == engine.BLOCK else [])

    async def run():
        sent = Sent()
        hub = Hub(sent, StreamLimits(sessions=40, sessions_per_group=40), Metrics(lambda: 0.0))
        sessions = [hub.open(replace(ABOUT, id=str(k))) for k in range(30)]
        for session in sessions:
            session.stage = Stage.LIVE
        for k in range(2):
            for session in sessions:
                hub.offer(session, BLOCK * k, np.zeros((BLOCK, 2)))
        assert len(sent) == MOST_FLYING
        # room comes with the end of a session and with forces: whoever waits longest is next
        hub.close(sessions[1], End())
        assert sent[MOST_FLYING:] == [MOST_FLYING + 1] * 2
        for k in range(40):
            hub._deliver(Message(engine.FORCES, sent[k], content=np.zeros((BLOCK, 2)).tobytes()))
            assert hub.flying < MOST_FLYING + FLYING
        assert list(dict.fromkeys(sent)) == [session.number for session in sessions]
        # a process that begins anew knows nothing of what was sent before
        hub._anew()
        assert 0 < hub.flying == sum(len(session.flying) for session in hub.sessions.values())

    asyncio.run(run())


@pytest.mark.slow
def test_who_does_not_read_loses_forces_and_never_memory():
    async def run():
        for text in (False, True):
            listener = Listener(2, text, None)
            for k in range(400):
                listener.forces(4096 * k, np.full((4096, 2), 1.25))
                listener.tell("status", k=k)
                assert listener.bytes <= WAITING_BYTES
            assert listener.bytes == sum(len(frame) for _, frame in listener.frames)
            assert listener.unread + sum(count for count, _ in listener.frames) == 400 * 4096
            assert len(listener.texts) == WAITING_TEXTS
            # the newest are there, and events come first
            got = listener.taken()
            assert json.loads(got[WAITING_TEXTS - 1])["k"] == 399
            while listener.frames:
                last = listener.taken()[-1]
            assert (json.loads(last)["first"] if text else unpacked(last)[0]) == 4096 * 399
            assert not listener.awake.is_set()

    asyncio.run(run())


def test_a_session_ends_once():
    async def run():
        session = Session(ABOUT, 1)
        session.finish(End(1008, 422, "a"))
        session.finish(End())
        assert session.stage is Stage.ENDED
        assert session.end.detail == "a"

    asyncio.run(run())
