"""The components that routes work with: chosen once, by `create_app`."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from fastapi import Depends, Request

from api.files import Files
from api.jobs.event_feed import EventFeeds
from api.jobs.supervisor import Supervisor
from api.metrics import Metrics
from api.rates import Rates
from api.reading.example_campaign import Examples
from api.reading.uploads import Uploads
from api.settings import Settings
from api.stores.entities import Store
from api.streams.hub import Hub
from api.work.answers import Answers
from api.work.kernels import Kernels
from api.work.pool import Work


@dataclass(frozen=True, slots=True)
class Components:
    """Settings, store, kernels, workers and their answers, files and uploads, rate limits (also of wrong keys), metrics, streams, event
    feeds, examples, supervisor."""

    settings: Settings
    store: Store
    kernels: Kernels
    work: Work
    answers: Answers
    files: Files
    reader: Work
    uploads: Uploads
    rates: Rates = field(repr=False)
    wrong_keys: Rates = field(repr=False)
    metrics: Metrics = field(repr=False)
    streams: Hub = field(repr=False)
    feeds: EventFeeds = field(repr=False)
    examples: Examples = field(repr=False)
    supervisor: Supervisor | None = field(repr=False)


def components_of(request: Request) -> Components:
    """Return the components of the service that a request came to."""
    components: Components = request.app.state.components
    return components


ThisService = Annotated[Components, Depends(components_of)]
