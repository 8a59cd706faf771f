"""The options that say where work is done: in processes here, or on a cluster."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Annotated

import typer

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.scaleout import cluster_map
from rcsa_ident.front.processes import EARLY, Workers, workers

Processes = Annotated[
    int | None, typer.Option(min=1, max=64, help="Number of processes; default: one per core, at most 8.", show_default=False)
]
DASK_HELP = "Dask scheduler (tcp://host:8786) to use instead of local processes; a campaign lies under the same path on its workers."
Dask = Annotated[str | None, typer.Option(metavar="ADDRESS", help=DASK_HELP, show_default=False)]


@contextmanager
def workers_or_cluster(processes: int | None, dask: str | None, early: Sequence[str] = EARLY) -> Iterator[Workers]:
    """Yield what maps: processes here, or the workers of a cluster.

    `early`: modules that processes here import before the first task comes
    """
    if dask is None:
        with workers(processes, early) as pool:
            yield pool
        return
    if processes is not None:
        raise InputError("--dask", f"given together with --processes {processes}", "one of the two: a cluster has its own processes")
    with cluster_map(dask) as cluster:
        yield Workers(cluster=cluster)
