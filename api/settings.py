"""Settings of the service, read once from the environment."""

from __future__ import annotations

import difflib
import ipaddress
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, get_type_hints

from rcsa_ident.errors import InputError
from rcsa_ident.scaleout import ADDRESS

PREFIX = "RCSA_IDENT_"
MEGABYTE = 1_000_000
#: Variables of the same beginning that tests and benchmarks read.
_OTHERS = ("RCSA_IDENT_NO_SKIPS", "RCSA_IDENT_OBSERVER_RESULT")


@dataclass(frozen=True, slots=True)
class Settings:
    """Everything that differs between two installations.

    Parameters
    ----------
    data : Path
        Folder of the embedded store; made where it is missing.
    database : str
        URL of a database in its place, as ``postgresql+psycopg://user@host/name``; empty for SQLite in the data folder.
    database_file : Path or None
        File with that URL, so that its password is in no environment.
    host, port
        Where the service listens.
    keys : bool or None
        Whether a key is asked for; None asks for one unless the service listens on loopback alone.
    tls_certificate, tls_key : Path or None
        PEM files of certificate and private key; with them the service speaks TLS alone.
    proxies : str
        Addresses or networks, separated by commas, that are believed where they say from whom and by which protocol a request came.
    workers : int
        Processes that compute.
    queue : int
        Queries that may wait for one.
    connections, connections_per_address : int
        Open at once; fewer than the files that the process may open (``ulimit -n``).
    max_body_bytes : int
    requests_per_minute, burst : int
        Per key.
    work_seconds : float [s]
        Estimated work of one query; a longer one is refused.
    query_seconds : float [s]
        Of one query by the clock, once a process works on it; the process is ended then.
    query_memory : int [MiB]
        For one query.
    kept_machines : int
        Machines whose receptances each worker keeps.
    streams, streams_per_group, stream_listeners : int
        Force streams at once; of each, viewers beside its client.
    stream_idle_seconds : float [s]
        Without a sample, after which a stream ends.
    stream_buffer_seconds : float [s]
        Samples of a stream that may wait; older ones are dropped, and counted.
    max_upload_bytes : int
        Of one uploaded recording.
    uploads : int
        Uploads at once.
    group_bytes : int
        That all uploads of a group may take, what is read from them included.
    group_database_bytes : int
        That everything else of a group may take in the database.
    free_bytes : int
        That uploads leave free on the disk.
    upload_seconds, upload_idle_seconds : float [s]
        Of a whole upload, and without a byte of it.
    upload_bytes_per_second : int
        Below which an upload is given up, after the first `upload_idle_seconds`.
    reader_memory : int [MiB]
        For reading one upload.
    reader_seconds, reader_wall_seconds : float [s]
        Of a core and by the clock, for reading one upload.
    reader_calls : int
        After which the process that reads uploads is replaced.
    job_workers, lobe_workers : int
        Processes beside the service that carry out identifications, and lobes as jobs, which never wait for each other; 0 where they
        run elsewhere.
    job_nice : int
        How far those processes step back behind streams and queries (0 to 19, as `nice`); 0 on a machine that does nothing else.
    job_queue : int
        Jobs of a group that may wait or run.
    job_attempts : int
        Times that a job is taken up again without coming further before it is given up.
    job_work_seconds : float [s]
        Estimated work of lobes as a job; longer ones are refused.
    keep_events_days, keep_results_days : float [days]
        After the end of a job, for which its events and its results are kept; 0 for ever.
    keep_versions_days : float [days]
        For which entries of the trail are kept with their versions, except the newest of each thing; 0 for ever.
    examples : Path
        Folder of a campaign that may be downloaded as an example, where it is there.
    dask : str
        Scheduler of a Dask cluster that searches of jobs spread over (``tcp://host:8786``); empty where they stay here.
    watchers : int
        Event streams of jobs at once.
    watch_seconds : float [s]
        After which such a stream ends; clients go on from its last event.
    unwatched_seconds : float [s]
        After which a job that a view asked for is cancelled where nobody follows it.
    """

    data: Path = field(default_factory=lambda: Path("rcsa-ident-data"))
    database: str = ""
    database_file: Path | None = None
    host: str = "127.0.0.1"
    port: int = 8000
    keys: bool | None = None
    tls_certificate: Path | None = None
    tls_key: Path | None = None
    proxies: str = ""
    workers: int = field(default_factory=lambda: max(1, min(os.cpu_count() or 1, 8)))
    queue: int = 64
    connections: int = 800
    connections_per_address: int = 400
    max_body_bytes: int = 16 * MEGABYTE
    requests_per_minute: int = 6000
    burst: int = 600
    work_seconds: float = 20.0
    query_seconds: float = 60.0
    query_memory: int = 2048
    kept_machines: int = 4
    streams: int = 16
    streams_per_group: int = 8
    stream_listeners: int = 16
    stream_idle_seconds: float = 30.0
    stream_buffer_seconds: float = 30.0
    max_upload_bytes: int = 2000 * MEGABYTE
    uploads: int = 16
    group_bytes: int = 200_000 * MEGABYTE
    group_database_bytes: int = 2000 * MEGABYTE
    free_bytes: int = 1000 * MEGABYTE
    upload_seconds: float = 3600.0
    upload_idle_seconds: float = 30.0
    upload_bytes_per_second: int = 10_000
    reader_memory: int = 2048
    reader_seconds: float = 120.0
    reader_wall_seconds: float = 900.0
    reader_calls: int = 200
    job_workers: int = 1
    lobe_workers: int = 1
    job_nice: int = 10
    job_queue: int = 50
    job_attempts: int = 10
    job_work_seconds: float = 4.0 * 3600.0
    keep_events_days: float = 0.0
    keep_results_days: float = 0.0
    keep_versions_days: float = 0.0
    examples: Path = field(default_factory=lambda: Path("data/sample_runs"))
    dask: str = ""
    watchers: int = 200
    watch_seconds: float = 3600.0
    unwatched_seconds: float = 120.0

    def __post_init__(self) -> None:
        for name, least, most in (
            ("port", 0, 65535), ("workers", 1, 256), ("queue", 0, 100_000),
            ("connections", 1, 10**6), ("connections_per_address", 1, 10**6), ("max_body_bytes", 1000, 10**9),
            ("requests_per_minute", 1, 10**9), ("burst", 1, 10**9), ("work_seconds", 0.1, 3600.0),
            ("query_seconds", 0.1, 7200.0), ("query_memory", 256, 10**6), ("kept_machines", 1, 1000),
            ("streams", 0, 1000), ("streams_per_group", 0, 1000), ("stream_listeners", 0, 1000), ("stream_idle_seconds", 1.0, 3600.0),
            ("stream_buffer_seconds", 6.0, 120.0),
            ("max_upload_bytes", 1000, 10**12), ("uploads", 1, 1000), ("group_bytes", 1000, 10**15), ("free_bytes", 0, 10**15),
            ("group_database_bytes", 1000, 10**15),
            ("upload_seconds", 1.0, 10**6), ("upload_idle_seconds", 0.1, 3600.0), ("upload_bytes_per_second", 0, 10**9),
            ("reader_memory", 512, 10**6), ("reader_seconds", 0.1, 10**4), ("reader_wall_seconds", 0.1, 10**5), ("reader_calls", 1, 10**6),
            ("job_workers", 0, 256), ("lobe_workers", 0, 256), ("job_nice", 0, 19),
            ("job_queue", 1, 10**6), ("job_attempts", 1, 1000), ("job_work_seconds", 1.0, 10**7),
            ("keep_events_days", 0.0, 36_500.0), ("keep_results_days", 0.0, 36_500.0), ("keep_versions_days", 0.0, 36_500.0),
            ("watchers", 1, 10**5), ("watch_seconds", 0.1, 10**6), ("unwatched_seconds", 60.0, 10**6),
        ):  # fmt: skip
            if not least <= getattr(self, name) <= most:
                raise InputError(PREFIX + name.upper(), getattr(self, name), f"a number from {least:g} to {most:g}")
        if self.query_seconds < self.work_seconds:
            raise InputError(f"{PREFIX}QUERY_SECONDS", self.query_seconds, f"at least {PREFIX}WORK_SECONDS, {self.work_seconds:g} s")
        if (self.tls_certificate is None) != (self.tls_key is None):
            missing = "TLS_KEY" if self.tls_key is None else "TLS_CERTIFICATE"
            raise InputError(PREFIX + missing, "nothing", "a PEM file, since certificate and private key belong together")
        for each in filter(None, self.proxies.split(",")):
            try:
                ipaddress.ip_network(each.strip(), strict=False)
            except ValueError:
                raise InputError(
                    f"{PREFIX}PROXIES", each.strip(), "addresses or networks separated by commas, as 10.0.0.7,10.1.0.0/16"
                ) from None
        if self.database_file is not None:
            object.__setattr__(self, "database", _url_in(self.database_file, self.database))
        if self.dask and not ADDRESS.fullmatch(self.dask):
            raise InputError(f"{PREFIX}DASK", self.dask, "the address of a Dask scheduler, as tcp://host:8786")
        if self.keys is False and not self.loopback:
            raise InputError(f"{PREFIX}KEYS", "off", f"on, since the service listens on {self.host}, which other machines reach")

    @property
    def loopback(self) -> bool:
        """Whether only this machine reaches the service."""
        try:
            return self.host == "localhost" or ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False

    @property
    def asks_for_keys(self) -> bool:
        """Whether requests need an API key."""
        return not self.loopback if self.keys is None else self.keys

    @property
    def database_url(self) -> str:
        """URL of the store's database."""
        return self.database or f"sqlite:///{self.data / 'service.db'}"

    @property
    def engine_url(self) -> str:
        """URL of the durable engine's database, which holds the steps of jobs."""
        return self.database or f"sqlite:///{self.data / 'jobs.db'}"


def from_environment(environment: Mapping[str, str]) -> Settings:
    """Return the settings of ``RCSA_IDENT_DATA``, ``RCSA_IDENT_PORT`` and so on; what is not there keeps its default."""
    given: dict[str, Any] = {}
    kinds = get_type_hints(Settings)
    known = [name.upper() for name in kinds]
    for name in environment:
        given_name = name.removeprefix(PREFIX)
        if name != given_name and given_name not in known and name not in _OTHERS:
            near = difflib.get_close_matches(given_name, known, 1, 0.5)
            hint = f"; did you mean {PREFIX}{near[0]}?" if near else ""
            raise InputError(name, "an unknown setting", f"one that docs/service.md lists{hint}")
    for name, kind in kinds.items():
        text = environment.get(PREFIX + name.upper(), "").strip()
        if text:
            try:
                given[name] = _READERS[kind](text)
            except ValueError:
                allowed = "on or off" if name == "keys" else "a number"
                raise InputError(PREFIX + name.upper(), text, allowed) from None
    return Settings(**given)


def _url_in(path: Path, database: str) -> str:
    """Return the URL that a file holds; no message repeats it, since it may hold a password."""
    field, allowed = f"{PREFIX}DATABASE_FILE", "a file with one line: the URL of the database"
    try:
        lines = path.read_text(encoding="utf-8").split()
    except (OSError, ValueError):
        raise InputError(field, f"{path}, which cannot be read", allowed) from None
    if len(lines) != 1:
        raise InputError(field, f"{path} with {len(lines)} words", allowed)
    if database not in ("", lines[0]):
        raise InputError(field, f"a file beside {PREFIX}DATABASE", "one of the two")
    return lines[0]


def _switch(text: str) -> bool:
    if text.lower() not in ("on", "off", "true", "false", "1", "0"):
        raise ValueError(text)
    return text.lower() in ("on", "true", "1")


_READERS: dict[Any, Callable[[str], Any]] = {Path: Path, Path | None: Path, str: str, int: int, float: float, bool | None: _switch}
