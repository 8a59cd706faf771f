"""The application: its components are chosen and wired here."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi

from api import data_folder, problems
from api.access import AccessMonitor
from api.components import Components
from api.files import Files
from api.head_requests import HeadRequests
from api.jobs import leases
from api.jobs.event_feed import EventFeeds
from api.jobs.supervisor import Supervisor
from api.metrics import JobCounts, Metrics
from api.rates import Rates
from api.reading.example_campaign import Examples
from api.reading.reader import Limits, Reader
from api.reading.uploads import Uploads
from api.retention import Lifetimes, maintain
from api.routes import (
    campaigns,
    dropped_files,
    example_campaign,
    examples,
    fields,
    forces,
    health,
    holders,
    identifications,
    keys,
    learning,
    libraries,
    listening,
    machines,
    materials,
    multi_upload,
    paths,
    recordings,
    resumable_upload,
    ringing,
    robots,
    schemas,
    static_files,
    streams,
    tool_change,
    toolings,
    tus,
    usage,
    versions,
)
from api.schemas.campaigns import NewCampaign
from api.schemas.common import ProblemDocument
from api.schemas.forces import ForceQuery, ForceUpload
from api.schemas.jobs import PartialLobes
from api.schemas.paths import PathMillingQuery, PathStabilityQuery, RemovalQuery
from api.schemas.ringing import RingQuery
from api.security import HEADER, WRONG_KEYS
from api.settings import Settings
from api.shares import Shares
from api.stores.entities import Store
from api.stores.sql import open_store
from api.streams.hub import Hub, StreamLimits
from api.streams.process import Host, StreamProcess
from api.work.answers import Answers
from api.work.kernels import Kernels
from api.work.pool import Pool, Work
from api.work.worker import QueryLimits
from rcsa_ident.version import __version__

V1 = "/v1"
_ABOUT = """Tooltip FRFs and stability lobes of any tooling on machines that were identified from ordinary stable cuts.
Lengths are millimetres, speeds rev/min, coefficients MPa, receptances m/N. Errors are problem documents (RFC 9457)."""


def create_app(
    settings: Settings,
    store: Store | None = None,
    work: Work | None = None,
    reader: Work | None = None,
    host: Host | None = None,
    supervisor: Supervisor | None = None,
) -> FastAPI:
    """Return the service.

    `store`, `work`, `reader`, `host`: replace the database and the processes that the settings name
    `supervisor`: of the job workers; without one, jobs wait for workers that run elsewhere
    """
    if store is None and not settings.database:
        data_folder.make(settings.data)
        data_folder.check(settings.data)
    kept = open_store(settings.database_url, settings.group_database_bytes) if store is None else store
    most = QueryLimits(settings.query_seconds, settings.query_memory)
    several = settings.asks_for_keys
    kernels = Kernels(settings.data / "kernels")
    workers = Pool(settings.workers, settings.queue, settings.kept_machines, most, several, kernels) if work is None else work
    files = Files(settings.data / "files", settings.group_bytes, settings.free_bytes)
    limits = Limits(settings.reader_memory, settings.reader_seconds, settings.reader_wall_seconds, settings.reader_calls)
    readers = (
        Reader(limits, 2 * settings.uploads, folder=files.folder / "reading", free_bytes=settings.free_bytes) if reader is None else reader
    )
    uploads = Uploads(kept, files, readers, Shares(settings.uploads, several))
    rates, metrics = Rates(settings.requests_per_minute, settings.burst), Metrics(lambda: float(workers.waiting))
    feeds = EventFeeds(kept.jobs, Shares(settings.watchers, several))
    hub = Hub(StreamProcess(kernels) if host is None else host, _stream_limits(settings), metrics)
    metrics.streams.set_function(lambda: float(len(hub.sessions)))
    made, wrong = Examples(uploads, workers), Rates(*WRONG_KEYS)
    components = Components(
        settings, kept, kernels, workers, Answers(workers), files, readers, uploads, rates, wrong, metrics, hub, feeds, made, supervisor
    )
    metrics.registry.register(JobCounts(kept.jobs))

    @asynccontextmanager
    async def lifespan(_app: FastAPI) -> AsyncIterator[None]:
        kernels.begin()
        workers.start()
        readers.start()
        await hub.start()
        if supervisor is not None:
            supervisor.start()
        lifetimes = Lifetimes(settings.keep_events_days, settings.keep_results_days, settings.keep_versions_days)
        maintenance = asyncio.gather(uploads.maintain(), maintain(kept, lifetimes), leases.maintain(kept.jobs, settings.unwatched_seconds))
        yield
        maintenance.cancel()
        await made.stop()
        # beside each other: every one of them gives its processes time
        ends = [asyncio.to_thread(each.stop) for each in (readers, workers, *([] if supervisor is None else [supervisor]))]
        await asyncio.gather(hub.stop(), *ends, maintenance, return_exceptions=True)
        kept.close()

    app = FastAPI(
        title="rcsa-ident",
        version=__version__,
        description=_ABOUT,
        lifespan=lifespan,
        docs_url=None,
        redoc_url=None,
    )
    app.state.components = components
    problems.install(app)
    app.include_router(health.router)
    app.include_router(static_files.router)
    about = (
        keys,
        usage,
        machines,
        toolings,
        robots,
        paths,
        versions,
        libraries,
        dropped_files,
        holders,
        materials,
        schemas,
        fields,
        examples,
        example_campaign,
    )
    taken = (listening, ringing, campaigns, recordings, learning, resumable_upload, tus, multi_upload)
    for each in (*about, *taken, tool_change, identifications, forces, streams):
        app.include_router(each.router, prefix=V1)
    app.add_middleware(HeadRequests, router=app.router)
    app.add_middleware(AccessMonitor, components=components)
    app.openapi = lambda: _openapi(app)  # type: ignore[method-assign]
    return app


def _stream_limits(settings: Settings) -> StreamLimits:
    several, idle = settings.asks_for_keys, settings.stream_idle_seconds
    return StreamLimits(settings.streams, settings.streams_per_group, settings.stream_listeners, several, idle)


def _openapi(app: FastAPI) -> dict[str, Any]:
    """OpenAPI with the problem document, and with the key that guarded routes ask for."""
    if app.openapi_schema is None:
        schema = get_openapi(title=app.title, version=app.version, description=app.description, routes=app.routes)
        components = schema.setdefault("components", {})
        # bodies that routes parse themselves, what streams of events tell, and the error answer of all routes
        path_queries = (RemovalQuery, PathStabilityQuery, PathMillingQuery)
        for model in (ProblemDocument, NewCampaign, ForceQuery, ForceUpload, PartialLobes, RingQuery, *path_queries):
            described = model.model_json_schema(ref_template="#/components/schemas/{model}")
            components.setdefault("schemas", {}).update(described.pop("$defs", {}))
            components["schemas"][model.__name__] = described
        components["securitySchemes"] = {"key": {"type": "apiKey", "in": "header", "name": HEADER}}
        for path in schema["paths"].values():
            for operation in path.values():
                if "x-scope" in operation:
                    operation["security"] = [{"key": []}]
        app.openapi_schema = schema
    return app.openapi_schema
