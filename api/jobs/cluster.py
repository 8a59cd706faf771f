"""Map over a Dask cluster; tasks that the cluster cannot do are done here, with the same result."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from typing import Any

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.scaleout import ClusterLost, Map, cluster_map

log = logging.getLogger("rcsa_ident.jobs")


def over_cluster(address: str) -> Map:
    """Return a map over the workers of a cluster; a job does not fail because the cluster cannot be reached."""

    def spread(function: Callable[[Any], Any], tasks: Iterable[Any]) -> Iterator[Any]:
        left = list(tasks)
        with ExitStack() as stack:
            try:
                cluster = stack.enter_context(cluster_map(address))
            except InputError as error:
                log.warning("the cluster cannot be reached: the tasks are done here", exc_info=error)
            else:
                try:
                    for answer in cluster(function, left[:]):
                        left.pop(0)
                        yield answer
                except ClusterLost as error:
                    log.warning("the cluster has lost work: the rest is done here", exc_info=error)
        yield from map(function, left)

    return spread
