"""Worker processes: full queues say so, a killed worker costs one answer, and none outlives the service."""

from __future__ import annotations

import asyncio
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections import Counter
from contextlib import suppress
from pathlib import Path

import pytest

from api.work.kernels import Kernels
from api.work.pool import Busy, Pool, guarded
from api.work.requests import TooLong
from api.work.worker import Failed, QueryLimits, Worker
from rcsa_ident.base.errors import InputError
from rcsa_ident.front import compile_kernels
from tests.fixtures.waiting import ended, until


def die():
    os.kill(os.getpid(), signal.SIGKILL)


def wrong():
    raise InputError("field", "x", "y")


@pytest.fixture(scope="module")
def pool():
    found = Pool(1, 1, 2)
    found.start()
    yield found
    found.stop()


class Runs:
    """What would call something where it is unpickled."""

    def __reduce__(self):
        return os._exit, (7,)


def no_json():
    return Runs()


def leaves():
    if sys.platform != "linux":
        raise OSError("Function not implemented")
    socket.socket()


def too_much():
    return len(bytearray(3 << 30))


def forever():
    while True:
        pass


@pytest.mark.slow
def test_answers_and_refusals_come_back(pool):
    assert asyncio.run(pool.run(pow, 3, 4)) == 81
    assert asyncio.run(pool.run(os.getpid)) != os.getpid()
    with pytest.raises(InputError, match="field: found x, allowed is y"):
        asyncio.run(pool.run(wrong))
    # JSON alone, and no way out
    assert asyncio.run(pool.run(divmod, 7, 2)) == [3, 1]
    for call, words in ((no_json, "TypeError"), (leaves, "Function not implemented"), (bug, "a bug")):
        with pytest.raises(Failed, match=words):
            asyncio.run(pool.run(call))
    assert pool.waiting == 0
    assert pool.ready


@pytest.mark.slow
def test_too_many_are_refused_at_once(pool):
    async def three():
        return await asyncio.gather(*(pool.run(time.sleep, 0.3) for _ in range(3)), return_exceptions=True)

    found = asyncio.run(three())
    # one at work, one waits
    assert [type(each) for each in found] == [type(None), type(None), Busy]


@pytest.mark.slow
def test_a_killed_worker_is_replaced(pool):
    with pytest.raises(Busy):
        asyncio.run(pool.run(die))
    assert asyncio.run(pool.run(pow, 2, 5)) == 32


@pytest.fixture(scope="module")
def strict():
    """One process, whose queries may take 3 s and 500 MiB."""
    found = Pool(1, 1, 2, QueryLimits(3.0, 500))
    found.start()
    yield found
    found.stop()


@pytest.mark.slow
@pytest.mark.parametrize(("call", "words"), [(forever, "more than 3 s"), (too_much, "more than 500 MiB of memory")])
def test_a_query_that_costs_too_much_ends_with_its_process(strict, call, words):
    before = asyncio.run(strict.run(os.getpid))
    with pytest.raises(InputError, match=words) as error:
        asyncio.run(strict.run(call))
    assert isinstance(error.value, TooLong) == (call is forever)
    # nobody computes any more, and the next is answered
    until(lambda: ended(before))
    assert asyncio.run(strict.run(os.getpid)) != before


def nothing():
    pass


def slowly():
    time.sleep(5.0)


@pytest.mark.slow
def test_what_a_process_still_prepares_is_not_the_time_of_a_query():
    member = Worker(QueryLimits(2.5, 500), nothing, slowly)
    member.begin()
    assert member.ask(pow, (2, 5)) == 32
    member.end()


@pytest.mark.slow
def test_a_query_that_nobody_waits_for_ends_with_its_process(pool):
    async def left():
        before = await pool.run(os.getpid)
        count = pool.members[0].asked
        asked = [asyncio.ensure_future(pool.run(forever)) for _ in range(2)]
        # the second waits behind the first
        while pool.members[0].asked == count:
            await asyncio.sleep(0.01)
        for each in reversed(asked):
            each.cancel()
        await asyncio.gather(*asked, return_exceptions=True)
        return before, await pool.run(os.getpid)

    before, after = asyncio.run(left())
    assert before != after
    assert ended(before)
    assert pool.waiting == 0


@pytest.mark.slow
def test_a_process_that_was_killed_while_idle_costs_nothing(pool):
    os.kill(asyncio.run(pool.run(os.getpid)), signal.SIGKILL)
    until(lambda: not pool.members[0].process.alive)
    assert asyncio.run(pool.run(pow, 2, 5)) == 32


@pytest.mark.slow
def test_a_pool_ends_at_once_whatever_it_computes():
    """Else this test never ends."""
    found = Pool(1, 1, 1)
    found.start()

    async def ended_meanwhile():
        asked = asyncio.ensure_future(found.run(forever))
        while not found.members[0].asked:
            await asyncio.sleep(0.01)
        await asyncio.to_thread(found.stop)
        with pytest.raises(Busy):
            await asked

    asyncio.run(ended_meanwhile())


def begun(pool):
    """Whether as many processes are ready as answer at once: to wait for one is a long call, beside which previews go to the spare one."""
    return sum(member.ready for member in pool.members) >= pool.workers and not pool.threads.working.total()


class Preview:
    preview = True


def of_a_preview(_preview):
    time.sleep(0.05)
    return os.getpid()


@pytest.mark.slow
def test_a_preview_waits_behind_no_question_that_takes_long():
    """Else this test never ends."""
    pool = Pool(1, 10, 1)
    pool.start()

    async def asked():
        await asyncio.to_thread(until, lambda: begun(pool))
        usual = await pool.run(of_a_preview, Preview())
        # the long ones begin while previews wait before and behind them
        calls = [of_a_preview, of_a_preview, forever, forever, of_a_preview, of_a_preview]
        tasks = [asyncio.ensure_future(pool.run(call, *([Preview()] if call is of_a_preview else []))) for call in calls]
        found = await asyncio.gather(*tasks[:2], *tasks[4:])
        for each in tasks[2:4]:
            each.cancel()
        await asyncio.gather(*tasks[2:4], return_exceptions=True)
        return usual, found

    try:
        usual, found = asyncio.run(asked())
    finally:
        pool.stop()
    # while no long one works, previews are answered where the last one was: its machines are read already
    assert found[:2] == [usual, usual]
    # whichever process the long one has taken, the other answers
    assert found[2] == found[3]


@pytest.mark.slow
def test_previews_of_one_query_are_shared_by_the_processes():
    """No process more is at work than there are, and none is left with most of them."""
    pool = Pool(2, 10, 1)
    pool.start()

    async def asked():
        return await asyncio.gather(*(pool.run(of_a_preview, Preview()) for _ in range(12)))

    try:
        # the first ones are asked while the processes begin, which may leave one alone for a while
        asyncio.run(asked())
        until(lambda: begun(pool))
        for _ in range(2):
            counts = Counter(asyncio.run(asked()))
    finally:
        pool.stop()
    assert len(counts) == 2
    assert max(counts.values()) < 10


def test_a_pool_that_has_not_begun_refuses():
    with pytest.raises(Busy):
        asyncio.run(Pool(1, 1, 1).run(pow, 2, 2))


def test_kernels_are_compiled_by_one_process_while_the_others_wait(tmp_path, monkeypatch):
    both, together = threading.Barrier(2), []

    def step():
        # whoever is alone waits in vain
        with suppress(threading.BrokenBarrierError):
            both.wait(0.1)
            together.append(True)

    monkeypatch.setattr(compile_kernels, "STEPS", {"lobes": step})
    kernels = Kernels(tmp_path / "kernels")
    kernels.begin()
    threads = [threading.Thread(target=kernels.prepare, args=("lobes",)) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not together
    assert kernels.progress == "1 of 4 steps of compilation are done"
    # at the next start the cache may be another one
    kernels.begin()
    assert kernels.progress.startswith("0 of 4")


def test_who_may_lock_nothing_loads_what_another_has_compiled(tmp_path, monkeypatch):
    done = []
    monkeypatch.setattr(compile_kernels, "STEPS", {"lobes": lambda: done.append("lobes")})
    kernels = Kernels(tmp_path / "kernels")
    kernels.begin()
    kernels.prepare("lobes", locks=False)
    assert not done
    kernels.prepare("lobes")
    kernels.prepare("lobes", locks=False)
    assert len(done) == 2
    Kernels().prepare("lobes", locks=False)
    assert len(done) == 3


def divide():
    return 1 / 0


def bug():
    raise ValueError("a bug")


@pytest.mark.slow
def test_numbers_without_an_answer_are_bad_input_and_a_bug_stays_a_bug():
    with pytest.raises(InputError, match="no finite answer"):
        guarded(divide)
    with pytest.raises(ValueError, match="a bug"):
        guarded(bug)


CODE = """
import sys, time
from api.work.pool import Pool
import asyncio, os
if __name__ == "__main__":
    pool = Pool(1, 1, 1)
    pool.start()
    print(asyncio.run(pool.run(os.getpid)), flush=True)
    time.sleep(60)
"""


@pytest.mark.slow
def test_workers_end_with_the_service_however_it_ends(tmp_path):
    script = tmp_path / "service.py"
    script.write_text(CODE, encoding="utf-8")
    root = Path(__file__).resolve().parents[2]
    environment = {**os.environ, "PYTHONPATH": str(root)}
    with subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, text=True, env=environment) as service:
        worker = int(service.stdout.readline())
        service.kill()
    until(lambda: ended(worker))
