"""``rcsa-ident-serve``: the service on this machine."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable
from contextlib import ExitStack, closing
from functools import partial
from pathlib import Path
from threading import Event
from typing import Annotated, Any, NoReturn

import typer

from rcsa_ident.base.errors import InputError, no_cache
from rcsa_ident.base.remarks import counted

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, help="The web service; settings come from RCSA_IDENT_... too.")


@app.callback(invoke_without_command=True)
def serve(
    context: typer.Context,
    data: Annotated[Path | None, typer.Option(help="Folder of the store (RCSA_IDENT_DATA).", show_default=False)] = None,
    host: Annotated[str | None, typer.Option(help="Where to listen (RCSA_IDENT_HOST).", show_default="127.0.0.1")] = None,
    port: Annotated[int | None, typer.Option(help="Port (RCSA_IDENT_PORT).", show_default="8000")] = None,
    workers: Annotated[int | None, typer.Option(help="Processes that compute (RCSA_IDENT_WORKERS).", show_default="cores")] = None,
) -> None:
    """Start the service, unless a command is given."""
    from api.settings import from_environment

    given = {"data": data, "host": host, "port": port, "workers": workers}
    try:
        # options and environment together, so that HOST and KEYS are checked against each other once
        found = {f"RCSA_IDENT_{name.upper()}": str(value) for name, value in given.items() if value is not None}
        settings = from_environment({**os.environ, **found})
    except InputError as error:
        _fail(error)
    context.obj = settings
    if context.invoked_subcommand is None:
        _run(settings)


@app.command("settings")
def settings_table() -> None:
    """Print all settings with defaults and ranges, as docs/service.md has them."""
    from api.settings import table

    typer.echo(table(), nl=False)


@app.command("create-key")
def create_key(
    context: typer.Context,
    group: Annotated[str, typer.Option(help="Whose machines and toolings it opens.")] = "default",
    scopes: Annotated[str, typer.Option(help="Some of read, upload, run, admin, separated by commas.")] = "admin",
    label: Annotated[str, typer.Option(help="What it is for: its name in the trail of changes.")] = "",
    days: Annotated[float | None, typer.Option(help="After which it expires.", show_default="never")] = None,
) -> None:
    """Make an API key and print it once: the way to the first key of a group."""
    import re

    from api.data_folder import check, make
    from api.schemas.common import NAME_PATTERN
    from api.security import LONGEST, SCOPES, make_key
    from api.stores.sql import open_store

    try:
        wanted = tuple(dict.fromkeys(part.strip() for part in scopes.split(",")))
        if not set(wanted) <= set(SCOPES):
            raise InputError("--scopes", scopes, f"some of {', '.join(SCOPES)}, separated by commas")
        if not re.fullmatch(NAME_PATTERN.strip("^$"), group):
            raise InputError("--group", group, "letters, digits, blanks and . _ + - ( ), at most 64")
        if not label.isprintable() or len(label) > 200:
            raise InputError("--label", label, "a line of at most 200 characters")
        if days is not None and not 0.0 < days <= LONGEST:
            raise InputError("--days", days, f"more than 0, at most {LONGEST}")
        settings = context.obj
        if not settings.database:
            make(settings.data)
            check(settings.data)
        key, text = make_key(group, wanted, label, days)
        with closing(open_store(settings.database_url)) as store:
            store.keys.add(key)
    except InputError as error:
        _fail(error)
    typer.echo(text)


@app.command("worker")
def worker(
    context: typer.Context,
    count: Annotated[
        int | None, typer.Option(min=0, max=256, help="Processes for identifications (RCSA_IDENT_JOB_WORKERS).", show_default=False)
    ] = None,
    lobes: Annotated[int | None, typer.Option(min=0, max=256, help="For lobes (RCSA_IDENT_LOBE_WORKERS).", show_default=False)] = None,
    paths: Annotated[
        int | None, typer.Option(min=0, max=256, help="For tools along paths (RCSA_IDENT_PATH_WORKERS).", show_default=False)
    ] = None,
) -> None:
    """Run job workers for a service that runs elsewhere, with the same database and the same folder for recordings."""
    import signal
    import threading

    # kernels that can be kept nowhere are refused here, once, not by every child
    import rcsa_ident.dynamics.poles  # noqa: F401
    from api import log_lines
    from api.jobs.supervisor import Supervisor

    settings = context.obj
    log_lines.start()
    # a service whose jobs run elsewhere names none for itself
    named = ((count, settings.job_workers), (lobes, settings.lobe_workers), (paths, settings.path_workers))
    crew = _crew(*(max(usual, 1) if given is None else given for given, usual in named))
    supervisor = Supervisor(crew, settings, settings.job_nice)
    ended = threading.Event()
    for each in (signal.SIGTERM, signal.SIGINT):
        signal.signal(each, lambda *_: ended.set())
    supervisor.start()
    ended.wait()
    supervisor.stop()


@app.command("backup")
def backup_store(
    context: typer.Context, file: Annotated[Path, typer.Argument(metavar="FILE.tar", help="To write; nothing may be there yet.")]
) -> None:
    """Back up the embedded store into one file while the service runs."""
    from api.backups.save import backup

    settings = context.obj
    try:
        if settings.database:
            allowed = (
                "the embedded store: a database by URL has tools of its own. In this order: a copy of files/ of the data folder, "
                "pg_dump, and once more what is new in files/, nothing deleted"
            )
            raise InputError("RCSA_IDENT_DATABASE", "a database by URL", allowed)
        account = backup(settings.data, file)
    except InputError as error:
        _fail(error)
    typer.echo(f"{file}: {counted(account.files, 'file')}, {account.bytes / 1e6:.1f} MB")
    for words, names in (("missing, though referred to", account.missing), ("not what was stored any more", account.damaged)):
        for name in names:
            typer.echo(f"warning: {name} is {words}", err=True)


@app.command("restore")
def restore_store(
    file: Annotated[Path, typer.Argument(metavar="FILE.tar", help="Written by backup.")],
    data: Annotated[Path, typer.Option(help="Folder to make; nothing may be in it yet.", show_default=False)],
) -> None:
    """Restore a backup into a data folder, for --data of a service."""
    from api.backups.load import restore

    try:
        account = restore(file, data)
    except InputError as error:
        _fail(error)
    typer.echo(f"{data}: {counted(account.files, 'file')}, {account.bytes / 1e6:.1f} MB")


def _crew(identifications: int, lobes: int, paths: int) -> list[Callable[[Any, Callable[[], None], Event], None]]:
    """What each job worker does: each kind of jobs has its own, so that a short one never waits behind a long one of the other."""
    counts = {"identification": identifications, "lobes": lobes, "path": paths}
    return [partial(job_worker, kind) for kind, count in counts.items() for _ in range(count)]


def job_worker(kind: str, settings: Any, ready: Callable[[], None], stop: Event) -> None:
    """Carry out jobs of a kind until `stop` is set."""
    from api.files import Files
    from api.jobs import identification, lobes, paths
    from api.jobs.cluster import over_cluster
    from api.jobs.durable import Durable
    from api.jobs.worker import Carrier, JobWorker
    from api.processes import limit_memory
    from api.reading.campaigns import load_campaign
    from api.stores.sql import open_store

    store = open_store(settings.database_url)
    load = partial(load_campaign, store, Files(settings.data / "files", settings.group_bytes, settings.free_bytes))
    spread = over_cluster(settings.dask) if settings.dask else map
    carriers: dict[str, Carrier] = {
        "identification": partial(identification.carry, load, spread=spread),
        "lobes": lobes.carry,
        "path": partial(paths.carry, most=settings.job_work_seconds),
    }
    limit_memory(settings.job_memory)
    JobWorker(store.jobs, Durable(settings.engine_url), {kind: carriers[kind]}, settings.job_attempts).run(ready, stop)


def _run(settings: object) -> None:
    from api import log_lines
    from api.data_folder import alone
    from api.jobs.supervisor import Supervisor
    from api.main import create_app
    from api.processes import leave_out_what_stays, share_heaps
    from api.settings import Settings
    from api.tls import Certificate

    assert isinstance(settings, Settings)
    log_lines.start()
    share_heaps()
    with ExitStack() as held:
        try:
            held.enter_context(alone(settings.data))
            certificate = None
            if settings.tls_certificate is not None and settings.tls_key is not None:
                certificate = Certificate(settings.tls_certificate, settings.tls_key)
            crew = _crew(settings.job_workers, settings.lobe_workers, settings.path_workers)
            service = create_app(settings, supervisor=Supervisor(crew, settings, settings.job_nice))
        except InputError as error:
            _fail(error)
        except OSError as error:
            _fail(InputError("RCSA_IDENT_DATA", error.strerror or "an error", "a folder that can be made and written to"))
        leave_out_what_stays()
        _listen(service, settings, certificate)


def _listen(service: Any, settings: Any, certificate: Any) -> None:
    import uvicorn

    from api.access import TimedHeadProtocol
    from api.connections import Connections, SmallHelloProtocol, listeners
    from api.processes import memory_is_limited

    fields = {"store": (settings.database and "database by URL") or str(settings.data), "workers": settings.workers}
    log = logging.getLogger("rcsa_ident.service")
    scheme = "http" if certificate is None else "https"
    log.info("starting", extra={"fields": fields | {"address": f"{scheme}://{settings.host}:{settings.port}"}})
    if not memory_is_limited():
        log.warning("this system does not limit the memory of a process: uploads and queries that take too much are ended by time alone")
    if not settings.asks_for_keys:
        log.warning("no keys are asked for: everybody on this machine may do everything (RCSA_IDENT_KEYS=on asks for them)")
    # open streams of events and forces would delay the end
    # no compression: measured samples do not shrink
    limits: dict[str, Any] = {"timeout_graceful_shutdown": 1, "ws_per_message_deflate": False}
    counted = Connections(settings.connections, settings.connections_per_address)
    # all that wait are accepted at once, before one of them is closed: fewer than the files that are left
    limits["backlog"] = 128
    limits |= {"http": TimedHeadProtocol, "ws": SmallHelloProtocol}
    try:
        sockets = listeners(settings.host, settings.port, counted)
    except OSError as error:
        address = f"{settings.host}:{settings.port}"
        _fail(InputError("RCSA_IDENT_HOST, RCSA_IDENT_PORT", f"{address} ({error.strerror})", "an address of this machine and a free port"))
    believed = {"proxy_headers": bool(settings.proxies), "forwarded_allow_ips": settings.proxies}
    config = uvicorn.Config(service, log_config=None, access_log=False, server_header=False, **limits, **believed)
    config.load()
    config.ssl = None if certificate is None else certificate.context
    uvicorn.Server(config).run(sockets)


def _fail(error: InputError) -> NoReturn:
    typer.echo(f"error: {error}", err=True)
    raise typer.Exit(2)


def main() -> None:
    """Run the command."""
    try:
        app()
    except RuntimeError as error:
        refused = no_cache(error)
        if refused is None:
            raise
        typer.echo(f"error: {refused}", err=True)
        raise SystemExit(2) from None
