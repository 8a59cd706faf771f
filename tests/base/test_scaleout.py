"""The same functions on a cluster: order, errors, cancelled work, and the same file byte for byte."""

from __future__ import annotations

import json
import operator
import os
import sys

import numpy as np
import pytest
from typer.testing import CliRunner

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.scaleout import ClusterLost, cluster_map
from rcsa_ident.cli import app
from tests.fixtures import scaleout_tasks as tasks
from tests.fixtures.campaign import part_of_the_sample_runs
from tests.fixtures.waiting import until


@pytest.fixture(scope="module")
def address():
    """Two worker processes."""
    import dask
    from distributed import LocalCluster

    before = os.environ.get("OPENBLAS_NUM_THREADS")
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    quick = {"distributed.scheduler.allowed-failures": 0, "distributed.worker.use-file-locking": False}
    with (
        dask.config.set(quick),
        LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0", silence_logs=50) as cluster,
    ):
        yield cluster.scheduler_address
    os.environ.pop("OPENBLAS_NUM_THREADS")
    if before is not None:
        os.environ["OPENBLAS_NUM_THREADS"] = before


def idle(address: str) -> bool:
    """Whether no worker has anything to do."""
    from distributed import Client

    with Client(address, set_as_default=False) as client:
        return not any(client.processing().values())


def run(*arguments: object, code: int = 0) -> str:
    result = CliRunner().invoke(app, [str(a) for a in arguments])
    assert result.exit_code == code, result.output + repr(result.exception)
    return result.output


@pytest.mark.slow
def test_results_in_order_from_several_processes(address):
    with cluster_map(address) as spread:
        assert spread.slots == 2
        found = list(spread(tasks.late, [0.0, 1.0, 2.0, 5.0]))
        assert list(spread(tasks.late, [])) == []
        array = np.arange(5.0)
        np.testing.assert_array_equal(next(iter(spread(operator.itemgetter(slice(1, 3)), [array]))), array[1:3])
    assert [task for task, _ in found] == [0.0, 1.0, 2.0, 5.0]
    processes = {process for _, process in found}
    assert len(processes) == 2
    assert os.getpid() not in processes


@pytest.mark.slow
def test_the_same_task_twice_is_done_twice(address):
    with cluster_map(address) as spread:
        found = list(spread(tasks.late, [3.0] * 6))
    assert len(found) == 6


@pytest.mark.slow
def test_an_error_comes_as_it_was_raised(address):
    with cluster_map(address) as spread:
        answers = spread(tasks.picky, [1, 2, 3])
        assert next(answers) == 1
        with pytest.raises(InputError, match="another one") as caught:
            next(answers)
    assert (caught.value.field, caught.value.found, caught.value.where) == ("task", 2, "here")


@pytest.mark.slow
def test_what_is_not_done_is_cancelled(address, tmp_path):
    with cluster_map(address) as spread, pytest.raises(ValueError, match="the first"):
        list(spread(tasks.marks, [(str(tmp_path), i) for i in range(12)]))
    until(lambda: idle(address))
    # both workers may have been at one each
    assert len(list(tmp_path.iterdir())) <= 4


@pytest.mark.slow
def test_an_iterator_left_alone_cancels_too(address, tmp_path):
    with cluster_map(address) as spread:
        answers = spread(tasks.marks, [(str(tmp_path), i) for i in range(1, 20)])
        next(answers)
        answers.close()
        until(lambda: idle(address))
    assert len(list(tmp_path.iterdir())) <= 6


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("here", "tcp://host"),
        ("tcp://", "tcp://host"),
        ("http://a:1", "tcp://host"),
        ("tcp://a:1/../b", "tcp://host"),
        ("tcp://127.0.0.1:1", "no scheduler"),
    ],
)
def test_no_cluster(text, words):
    with pytest.raises(InputError, match=words), cluster_map(text, timeout=0.5):
        pass


def test_without_workers():
    from distributed import LocalCluster

    with (
        LocalCluster(n_workers=0, processes=True, dashboard_address=":0", silence_logs=50) as cluster,
        pytest.raises(InputError, match="without workers"),
        cluster_map(cluster.scheduler_address, timeout=0.5),
    ):
        pass


@pytest.mark.slow
def test_another_release(address, monkeypatch):
    monkeypatch.setattr("rcsa_ident.base.scaleout.__version__", "0.0.0")
    with pytest.raises(InputError, match=r"0\.0\.0 on all of them"), cluster_map(address):
        pass


def test_without_dask(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"rcsa-ident\[scale\]"), cluster_map("tcp://127.0.0.1:8786"):
        pass


@pytest.mark.slow
def test_importing_loads_no_dask():
    import subprocess

    code = "import sys, rcsa_ident.base.scaleout; print([m for m in ('dask', 'distributed') if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip() == "[]"


@pytest.mark.slow
def test_a_task_that_ends_its_worker():
    import dask
    from distributed import LocalCluster

    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        LocalCluster(n_workers=1, threads_per_worker=1, processes=True, dashboard_address=":0", silence_logs=50) as cluster,
        cluster_map(cluster.scheduler_address) as spread,
        pytest.raises(ClusterLost, match="ended its workers repeatedly"),
    ):
        list(spread(tasks.ends, [1]))


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    """Every eighth cut of the sample runs, along X."""
    return part_of_the_sample_runs(tmp_path_factory.mktemp("few"), 8, "x")


@pytest.mark.slow
def test_an_identification_is_the_same_byte_for_byte(address, campaign, tmp_path, monkeypatch):
    here, there = tmp_path / "here.json", tmp_path / "there.json"
    run("identify", campaign, "--out", here, "--processes", 1, code=3)  # too few cuts
    monkeypatch.chdir(campaign.parent)
    # workers stand elsewhere: a relative path means the same
    run("identify", campaign.name, "--out", there, "--dask", address, code=3)
    assert there.read_bytes() == here.read_bytes()


@pytest.mark.slow
def test_verdicts_are_the_same(address, campaign):
    here, there = (json.loads(run("check", campaign, "--json", *how)) for how in (("--processes", 1), ("--dask", address)))
    assert here == there
    assert here["usable"] == here["cuts"] > 8


@pytest.mark.slow
def test_processes_and_a_cluster_do_not_go_together(campaign, tmp_path):
    words = run("identify", campaign, "--out", tmp_path / "R.json", "--dask", "tcp://127.0.0.1:1", "--processes", 2, code=2)
    assert "one of the two" in words
