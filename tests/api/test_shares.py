"""Groups beside each other: what one of them holds or asks for leaves room for all others."""

from __future__ import annotations

import asyncio
import select
import socket
import threading
import time
from contextlib import ExitStack
from dataclasses import replace

import httpx2
import pytest

from api.client import Client
from api.main import create_app
from api.metrics import Metrics
from api.security import make_key, new_id, now
from api.settings import Settings
from api.shares import GROUP, FairThreads, Shares
from api.stores.entities import Machine
from api.streams.hub import Full, Hub, StreamLimits
from api.streams.session import End
from api.work.pool import Busy, Pool
from tests.api.identifying import job
from tests.api.in_process import Here, Near
from tests.api.recordings import content, declared
from tests.api.test_connections import listening
from tests.api.test_stream_parts import ABOUT
from tests.fixtures.waiting import PATIENCE, until

PLACES = 8


def test_a_place_is_left_for_whoever_comes():
    shares = Shares(16)
    taken = {group: sum(shares.take(group) for _ in range(20)) for group in "ABCDE"}
    assert taken == {"A": 8, "B": 4, "C": 2, "D": 1, "E": 1}
    shares.give("A")
    assert not shares.take("A")
    assert shares.take("F")
    assert shares.total == 16


def test_one_group_alone_has_all_places():
    shares = Shares(4, several=False)
    assert [shares.take("A") for _ in range(5)] == [True] * 4 + [False]
    for _ in range(4):
        shares.give("A")
    assert shares.held == {}


def test_threads_serve_groups_in_turn():
    served, gate, threads = [], threading.Event(), FairThreads(1, "test")

    def asked(group, number):
        GROUP.set(group)
        return threads.submit(served.append, f"{group}{number}")

    threads.submit(gate.wait)
    answers = [asked("A", k) for k in range(4)]
    answers[1].cancel()
    answers += [asked(group, k) for group in "BC" for k in range(2)]
    gate.set()
    threads.shutdown()
    # A1, which nobody waits for any more, has had its turn
    assert served == ["A0", "B0", "C0", "B1", "C1", "A2", "A3"]
    GROUP.set("")


def test_a_group_that_is_busy_comes_after_one_that_is_not():
    gates, begun, threads = [threading.Event() for _ in range(3)], [], FairThreads(2, "test")

    def asked(group, name, gate):
        GROUP.set(group)
        return threads.submit(lambda: begun.append(name) or gate.wait(PATIENCE))

    asked("A", "A0", gates[0])
    asked("B", "B0", gates[1])
    until(lambda: len(begun) == 2)
    for group, name in (("A", "A1"), ("A", "A2"), ("B", "B1")):
        asked(group, name, gates[2])
    # a thread is free again, and group A has one at work still
    gates[1].set()
    until(lambda: len(begun) == 3)
    assert begun[2] == "B1"
    for gate in gates:
        gate.set()
    threads.shutdown()
    GROUP.set("")


def test_a_short_call_waits_for_short_ones_alone():
    """Two at work, and one more aside while both are long ones; in turn among groups, as ever."""
    gates, begun, threads = {}, [], FairThreads(2, "test", spare=True)

    def asked(group, name):
        GROUP.set(group)
        gates[name] = threading.Event()
        submit = threads.submit_short if name.startswith("s") else threads.submit
        return submit(lambda: begun.append(name) or gates[name].wait(PATIENCE))

    answers = [asked("A", name) for name in ("s0", "l0", "s1", "l1", "s2", "l2")]
    until(lambda: len(begun) == 2)
    # a short one and a long one work, all others wait; the group that has nothing at work comes first
    answers += [asked("B", "l3"), asked("B", "s3")]
    gates["s0"].set()
    # now both are long, and short ones are answered aside, one at a time, of the group that has fewest at work
    until(lambda: len(begun) == 4)
    assert begun[:3] == ["s0", "l0", "l3"]
    for name in ("s1", "s2", "s3"):
        gates[name].set()
    until(lambda: len(begun) == 6)
    assert set(begun[3:]) == {"s1", "s2", "s3"}
    for gate in gates.values():
        gate.set()
    threads.shutdown()
    assert sorted(begun[6:]) == ["l1", "l2"]
    assert all(each.done() for each in answers)
    GROUP.set("")


def test_calls_that_wait_end_with_their_threads():
    gate, threads = threading.Event(), FairThreads(1, "test")
    threads.submit(gate.wait)
    left = threads.submit(pow, 2, 2)
    threads.shutdown(wait=False, cancel_futures=True)
    assert left.cancelled()
    gate.set()
    threads.shutdown()


@pytest.mark.slow
def test_questions_of_one_group_leave_the_next_process_to_another():
    pool = Pool(1, 40, 1, several=True)
    pool.start()
    order = []

    async def ask(group, seconds):
        GROUP.set(group)
        await pool.run(time.sleep, seconds)
        order.append(group)

    async def both():
        many = [asyncio.create_task(ask("A", 0.05)) for _ in range(30)]
        await asyncio.sleep(0)
        one = asyncio.create_task(ask("B", 0.0))
        return await asyncio.gather(*many, one, return_exceptions=True)

    try:
        found = asyncio.run(both())
    finally:
        pool.stop()
    # half of the queue is for others, and the only question of theirs is the second one that is answered
    assert [type(each) for each in found].count(Busy) == 30 - 21
    assert order.index("B") <= 1


@pytest.fixture
def shop(store, tmp_path):
    """A service with a few places and a client of each of two groups, with a campaign."""
    clients = {}
    texts = {}
    for group in "AB":
        key, texts[group] = make_key(group, ("admin",), group)
        store.keys.add(key)
    settings = Settings(data=tmp_path, keys=True, uploads=PLACES, watchers=PLACES)
    with listening(create_app(settings, store, Here(), Here(), Near())) as port, ExitStack() as stack:
        for group, text in texts.items():
            http = stack.enter_context(httpx2.Client(base_url=f"http://127.0.0.1:{port}"))
            clients[group] = Client(key=text, http=http)
        yield port, texts, clients


def test_slow_uploads_of_one_group_do_not_stop_another(shop, tmp_path):
    port, texts, clients = shop
    campaigns = {group: each.make_campaign(each.make_machine("m").id, declared(PLACES)).id for group, each in clients.items()}
    head = f"Host: localhost\r\nX-API-Key: {texts['A']}\r\nContent-Type: application/octet-stream\r\nContent-Length: 1000\r\n\r\nx"
    with ExitStack() as stack:
        links = []
        for k in range(PLACES):
            links.append(stack.enter_context(socket.create_connection(("127.0.0.1", port), timeout=PATIENCE)))
            links[-1].sendall(f"PUT /v1/campaigns/{campaigns['A']}/recordings/c{k}_cut.h5 HTTP/1.1\r\n{head}".encode())
        # half of them are received, the others told at once
        until(lambda: len(select.select(links, [], [], 0.0)[0]) == PLACES // 2)
        assert {link.recv(12) for link in select.select(links, [], [], 0.0)[0]} == {b"HTTP/1.1 503"}
        path = tmp_path / "c0_cut.h5"
        path.write_bytes(content(tmp_path, 0))
        assert clients["B"].upload(campaigns["B"], path).name == "c0_cut.h5"


def test_event_streams_of_one_group_do_not_stop_another(shop, store):
    port, texts, _ = shop
    ids = {}
    for group in "AB":
        machine = store.machines.add(Machine(new_id(), group, "M", "", now())).id
        ids[group] = store.jobs.add(job(machine, group=group), {}, 9).id

    def followed(stack, group):
        link = stack.enter_context(socket.create_connection(("127.0.0.1", port), timeout=PATIENCE))
        head = f"GET /v1/identifications/{ids[group]}/events HTTP/1.1\r\nHost: localhost\r\nX-API-Key: {texts[group]}\r\n\r\n"
        link.sendall(head.encode())
        return link.recv(12)

    with ExitStack() as stack:
        answers = [followed(stack, "A") for _ in range(PLACES)]
        assert answers == [b"HTTP/1.1 200"] * (PLACES // 2) + [b"HTTP/1.1 503"] * (PLACES // 2)
        assert followed(stack, "B") == b"HTTP/1.1 200"


def test_force_streams_of_one_group_do_not_stop_another():
    async def opened():
        hub = Hub(Near(), StreamLimits(4, 4, several=True), Metrics(lambda: 0.0))
        await hub.start()
        first = [hub.open(replace(ABOUT, id=f"a{k}")) for k in range(2)]
        with pytest.raises(Full, match="places that are left are for other groups"):
            hub.open(replace(ABOUT, id="a2"))
        hub.open(replace(ABOUT, id="b", group="B"))
        hub.close(first[0], End())
        hub.open(replace(ABOUT, id="c", group="C"))
        await hub.stop()
        return hub.places.total

    assert asyncio.run(opened()) == 0
