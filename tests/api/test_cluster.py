"""Work of a job on a cluster, which may be away."""

from __future__ import annotations

import os

import pytest

from api.jobs.cluster import log, over_cluster
from api.settings import from_environment
from rcsa_ident.base.errors import InputError
from tests.fixtures import scaleout_tasks as tasks


@pytest.fixture(scope="module")
def cluster():
    from distributed import LocalCluster

    with LocalCluster(n_workers=1, threads_per_worker=1, processes=True, dashboard_address=":0", silence_logs=50) as found:
        yield found.scheduler_address


@pytest.mark.slow
def test_work_is_done_elsewhere_in_order(cluster):
    found = list(over_cluster(cluster)(tasks.late, [1.0, 0.0, 4.0]))
    assert [task for task, _ in found] == [1.0, 0.0, 4.0]
    assert os.getpid() not in {process for _, process in found}


@pytest.mark.slow
def test_an_error_of_the_work_is_none_of_the_cluster(cluster):
    answers = over_cluster(cluster)(tasks.picky, [1, 2, 3])
    assert next(answers) == 1
    with pytest.raises(InputError, match="another one"):
        next(answers)


def test_without_a_cluster_it_is_done_here(monkeypatch, caplog):
    monkeypatch.setattr("api.jobs.cluster.cluster_map", lambda address: away(address, 0.3))
    found = list(over_cluster("tcp://127.0.0.1:1")(tasks.late, [5.0, 4.0]))
    assert found == [(5.0, os.getpid()), (4.0, os.getpid())]
    # a client of another test's cluster may still be saying goodbye in this process
    said = [record.getMessage() for record in caplog.records if record.name == log.name]
    assert said == ["the cluster cannot be reached: the tasks are done here"]


def away(address, timeout):
    from rcsa_ident.base.scaleout import cluster_map

    return cluster_map(address, timeout)


@pytest.mark.slow
def test_a_cluster_that_goes_away_in_the_middle(caplog):
    """The answers it gave are kept, the others are computed here, each once."""
    from distributed import LocalCluster

    lost = LocalCluster(n_workers=1, threads_per_worker=1, processes=True, dashboard_address=":0", silence_logs=50)
    answers = over_cluster(lost.scheduler_address)(tasks.slow, [0, 1, 2])
    first = next(answers)
    lost.close(timeout=5)
    rest = list(answers)
    assert [task for task, _ in [first, *rest]] == [0, 1, 2]
    assert first[1] != os.getpid()
    assert rest[-1][1] == os.getpid()
    assert "the cluster has lost work: the rest is done here" in [record.getMessage() for record in caplog.records]


@pytest.mark.slow
def test_setting():
    assert from_environment({"RCSA_IDENT_DASK": "tcp://scheduler:8786"}).dask == "tcp://scheduler:8786"
    assert from_environment({}).dask == ""
    with pytest.raises(InputError, match=r"RCSA_IDENT_DASK.*tcp://host:8786"):
        from_environment({"RCSA_IDENT_DASK": "scheduler"})
