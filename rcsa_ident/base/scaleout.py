"""A `map` over a Dask cluster, for what takes a `map`: the very same functions, on more machines. The only import of Dask."""

from __future__ import annotations

import pickle
import re
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any

from rcsa_ident.base.errors import InputError, RcsaIdentError
from rcsa_ident.version import __version__

#: What takes a function and tasks and returns the results in the tasks' order: the builtin, a pool's, a cluster's.
Map = Callable[[Callable[[Any], Any], Iterable[Any]], Iterable[Any]]
ADDRESS = re.compile(r"(tcp|tls)://(\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9.-]+):\d{1,5}")
_ALLOWED = "the address of a Dask scheduler, as tcp://host:8786"


class ClusterLost(RcsaIdentError):
    """The cluster has lost work: its scheduler is gone, or a task has ended its workers again and again."""


@dataclass(frozen=True, slots=True, eq=False)
class ClusterMap:
    """Works as `map` does: results in the order of the tasks, the first error ends it, and what is not done then is cancelled.

    `client`: distributed.Client
    `slots`: tasks that the cluster ran at once when it was first asked
    """

    client: Any
    address: str
    slots: int

    def __call__(self, function: Callable[[Any], Any], tasks: Iterable[Any]) -> Iterator[Any]:
        """Return an iterator over function(task) for each task; both travel as pickles, so workers need the same package."""
        # all are on their way before the first answer is asked for
        work = pickle.dumps(function)
        futures = [self.client.submit(_run, work, pickle.dumps(task), pure=False) for task in tasks]
        return self._answers(futures)

    def _answers(self, futures: list[Any]) -> Iterator[Any]:
        from concurrent.futures import CancelledError

        from distributed.comm.core import CommClosedError
        from distributed.scheduler import KilledWorker

        try:
            while futures:
                yield futures[0].result()
                # the cluster keeps a result as long as its future is kept
                futures.pop(0)
        except KilledWorker:
            raise ClusterLost(f"{self.address}: a task has ended its workers repeatedly (out of memory?)") from None
        except (CancelledError, CommClosedError):
            raise ClusterLost(f"{self.address}: the connection to the scheduler was lost, and the work with it") from None
        finally:
            if futures:
                with suppress(Exception):
                    self.client.cancel(futures, force=True)


@contextmanager
def cluster_map(address: str, timeout: float = 10.0) -> Iterator[ClusterMap]:
    """Yield a map over the workers of a Dask scheduler; what is under way is cancelled on the way out.

    Parameters
    ----------
    address : str
        As ``tcp://host:8786``; with ``tls://`` certificates come from Dask's own configuration.
    timeout : float [s]
        To a connection, and to the first worker.

    Raises
    ------
    InputError
        Without Dask, a scheduler, workers, or the same release of this package on all of them.

    Notes
    -----
    Whoever reaches a scheduler can run anything on its workers: ``tcp://`` belongs into a network of its own.
    Kernels are serial: workers of one thread each (``dask worker --nthreads 1 --nworkers N``) use all cores best.
    """
    if not ADDRESS.fullmatch(address):
        raise InputError("dask", address, _ALLOWED)
    try:
        import dask
        from distributed import Client
    except ImportError:
        raise InputError("dask", "no Dask on this machine", "the extra `scale`: pip install 'rcsa-ident[scale]'") from None
    # a campaign's spectra are larger than what Dask finds usual
    with dask.config.set({"distributed.admin.large-graph-warning-threshold": "1GB"}):
        with warnings.catch_warnings():
            # of another release of a library the versions below tell enough
            warnings.filterwarnings("ignore", message="(?s).*Mismatched versions")
            try:
                client = Client(address, timeout=timeout, set_as_default=False, name="rcsa-ident")
            except (OSError, TimeoutError):
                raise InputError("dask", f"no scheduler at {address}", _ALLOWED) from None
        try:
            yield ClusterMap(client, address, _slots(client, address, timeout))
        finally:
            client.close()


def _slots(client: Any, address: str, timeout: float) -> int:
    """Tasks at once, after a look that all workers have what they need."""
    try:
        client.wait_for_workers(1, timeout=timeout)
    except TimeoutError:
        raise InputError("dask", f"{address} without workers", "a scheduler with workers: dask worker ADDRESS --nthreads 1") from None
    versions = client.run(_version, on_error="return")
    other = sorted({str(v) if isinstance(v, str) else "none" for v in versions.values()} - {__version__})
    if other:
        raise InputError("dask", f"workers with release {', '.join(other)} of rcsa-ident", f"{__version__} on all of them, as here")
    return sum(client.nthreads().values())


def _version() -> str:
    return __version__


def _run(work: bytes, task: bytes) -> Any:
    """On a worker."""
    return pickle.loads(work)(pickle.loads(task))
