"""Worker processes: same results in the same order as without them, nothing left behind, words that arrive."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import threading
import time

import pytest

from rcsa_ident.front.processes import THREADS, workers
from rcsa_ident.identification.progress import Stage, Step
from tests.fixtures.waiting import PATIENCE, until


def square(x):
    return x * x


def own_process(_):
    time.sleep(0.05)
    return os.getpid()


def refuse_seven(x):
    if x == 7:
        raise ValueError("seven")
    return x


def say_something(task):
    x, progress = task
    time.sleep(0.15)
    progress(Step("x", Stage.MODES, float(x), x))
    return x


@pytest.fixture(scope="module")
def two():
    with workers(2, early=()) as pool:
        yield pool


@pytest.mark.parametrize("count", [0, 1, 2, 7, 100])
def test_results_come_in_the_order_of_the_tasks(two, count):
    wanted = [k * k for k in range(count)]
    assert list(two.map(square, range(count))) == wanted
    assert list(two.map_many(square, range(count))) == wanted
    with workers(1) as alone:
        assert list(alone.map(square, range(count))) == list(alone.map_many(square, range(count))) == wanted


@pytest.mark.slow
def test_the_main_process_works_too(two):
    assert os.getpid() in (found := set(two.map(own_process, range(40))))
    assert len(found) == 2


def test_an_error_comes_out_where_its_task_stands(two):
    results = iter(two.map(refuse_seven, range(20)))
    # either process may have come to the seventh already, but its own turn is the last when it may show
    with pytest.raises(ValueError, match="seven"):
        [next(results) for _ in range(8)]
    assert list(two.map(square, [3])) == [9]


@pytest.mark.slow
def test_words_of_workers_and_of_this_process_arrive(two):
    heard = []
    with two.listening(lambda *word: heard.append((*word, threading.current_thread() is threading.main_thread()))) as progress:
        assert list(two.map(say_something, [(x, progress) for x in range(8)])) == list(range(8))
        until(lambda: len(heard) == 8)
    assert {main for *_, main in heard} == {True, False}
    assert all(axis == "x" and stage == f"{cost:.0f} modes" for axis, stage, cost, _ in heard)
    count = len(heard)
    # a worker that still tells when nobody listens any more goes on with its work
    assert list(two.map(say_something, [(x, progress) for x in range(8)])) == list(range(8))
    assert all(main for *_, main in heard[count:])


def test_a_progress_that_goes_to_a_cluster_tells_nobody(two):
    heard = []
    with two.listening(lambda *word: heard.append(word)) as progress:
        again = pickle.loads(pickle.dumps(progress))
        again(Step("x", Stage.SEARCH, 1.0, 3))
    assert heard == []
    with workers(1) as alone, alone.listening(lambda *word: heard.append(word)) as progress:
        progress(Step("x", Stage.SEARCH, 1.0, 3))
    assert heard == [("x", "search", 1.0)]


def test_what_cannot_be_pickled_is_computed_here_and_said(two):
    with pytest.warns(RuntimeWarning, match="in this process alone: .*<lambda>.*processes=1"):
        assert list(two.map(lambda x: x + 1, range(5))) == [1, 2, 3, 4, 5]
    # a task that cannot be sent is enough; the helpers are still there for others
    mixed = [lambda: 0, 1, 2, 3]
    with pytest.warns(RuntimeWarning, match="in this process alone"):
        assert list(two.map(callable, mixed)) == [callable(each) for each in mixed]
    assert len(set(two.map(own_process, range(20)))) == 2


#: Functions and classes of its own reach the tasks as function, as instance and within a task.
SCRIPT = """
import os
from functools import partial
from operator import methodcaller
from rcsa_ident.front.processes import workers

class Gain:
    def __call__(self, x): return 3 * x
    def two(self): return 2

def gain(x, by): return by * x

print("once")
with workers(2, ()) as pool:
    print(list(pool.map(partial(gain, by=3), range(4))), list(pool.map_many(Gain(), range(4))))
    print(list(pool.map(methodcaller("two"), [Gain(), Gain()])), list(pool.map(os.path.basename, ["a/b", "c/d"])))
"""


def test_what_a_script_defines_is_computed_in_its_own_process(tmp_path):
    """The helpers do not run the script, and so cannot know it: it works, and says why it takes longer."""
    (tmp_path / "script.py").write_text(SCRIPT, encoding="utf-8")
    done = subprocess.run([sys.executable, "script.py"], cwd=tmp_path, capture_output=True, text=True, timeout=PATIENCE, check=True)
    assert done.stdout.splitlines() == ["once", "[0, 3, 6, 9] [0, 3, 6, 9]", "[2, 2] ['b', 'd']"]
    for name in ("gain", "Gain"):
        assert f"{name} is defined in the script that runs, which the helpers do not run; put it into a module of its own" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.slow
def test_after_an_error_no_worker_is_left():
    children, others = [], multiprocessing.active_children()

    def fail():
        with workers(3, early=()) as pool:
            assert list(pool.map(square, range(5))) == [0, 1, 4, 9, 16]
            children.extend(child for child in multiprocessing.active_children() if child not in others)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert len(children) >= 2
    for child in children:
        child.join(PATIENCE)
        assert not child.is_alive()


#: A module of its own: the helpers do not run the script that starts them.
WORK = """
import pathlib, time
def work(task):
    pathlib.Path({place!r}, str(task)).touch()
    # a signal between a check of the interpreter and one long sleep would wait for the sleep's end
    end = time.monotonic() + 600.0
    while time.monotonic() < end:
        time.sleep(0.01)
"""
CTRL_C = """
import signal, sys
sys.path.insert(0, {root!r})
from long_work import work
from rcsa_ident.front.processes import workers
def main():
    try:
        with workers(3, early=()) as pool:
            for child in __import__("multiprocessing").active_children():
                print(child.pid, flush=True)
            print("ready", flush=True)
            list(pool.map(work, range(9)))
    except KeyboardInterrupt:
        print("interrupted", flush=True)
if __name__ == "__main__":
    # whoever started this may have had signals ignored, which is inherited: Ctrl-C is what this is about, and the others do not matter
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for each in {ignored!r}:
        signal.signal(each, signal.SIG_IGN)
    main()
"""


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="no process groups")
@pytest.mark.parametrize(
    ("at_work", "ignored"),
    [(0, ()), (3, ()), (3, ("SIGTERM", "SIGHUP", "SIGQUIT"))],
    ids=["while they start", "while they work", "from a shell that ignores signals"],
)
def test_ctrl_c_ends_all_of_them_without_a_word(tmp_path, at_work, ignored):
    """At once, and when each process has begun with a task."""
    place = tmp_path / "begun"
    place.mkdir()
    script = tmp_path / "script.py"
    root = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
    (tmp_path / "long_work.py").write_text(WORK.format(place=str(place)), encoding="utf-8")
    script.write_text(CTRL_C.format(root=root, ignored=[int(signal.Signals[name]) for name in ignored]), encoding="utf-8")
    with subprocess.Popen(
        [sys.executable, str(script)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as running:
        lines = [line.strip() for line in iter(running.stdout.readline, "ready\n")]
        until(lambda: len(list(place.iterdir())) >= at_work)
        # as a terminal does: to all processes of the group
        os.killpg(running.pid, signal.SIGINT)
        out, err = running.communicate(timeout=PATIENCE)
    assert out == "interrupted\n"
    assert err == ""
    assert len(lines) == 2
    for pid in map(int, lines):
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


def test_other_processes_of_a_script_are_left_alone():
    """What goes wrong here ends the helpers, and nobody else's processes."""
    other = multiprocessing.get_context("spawn").Process(target=time.sleep, args=(600.0,))
    other.start()
    before = set(multiprocessing.active_children())
    try:
        with pytest.raises(ValueError, match="seven"), workers(2, early=()) as pool:
            list(pool.map(refuse_seven, range(20)))
        assert set(multiprocessing.active_children()) == before
        assert other in before
    finally:
        other.kill()
        other.join()


@pytest.mark.slow
def test_helpers_compute_on_one_thread():
    before = dict(os.environ)
    with workers(2, early=()) as pool:
        assert {name for name in THREADS if name not in os.environ} == {name for name in THREADS if name not in before}
        assert set(pool.map(threads, range(40))) <= {("1", "1", "1"), tuple(before.get(name) for name in THREADS)}
        assert ("1", "1", "1") in set(pool.map(threads, range(40)))


def threads(_):
    time.sleep(0.02)
    return tuple(os.environ.get(name) for name in THREADS)


def test_a_daemonic_process_works_alone(monkeypatch):
    monkeypatch.setattr(multiprocessing.current_process(), "_config", {**multiprocessing.current_process()._config, "daemon": True})
    with workers(4) as pool:
        assert pool.pool is None
        assert list(pool.map(square, range(3))) == [0, 1, 4]
