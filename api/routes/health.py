"""Health checks and metrics, for operators."""

from __future__ import annotations

from typing import Literal

from fastapi import APIRouter, Request, Response
from prometheus_client import CONTENT_TYPE_LATEST, generate_latest

from api.components import ThisService
from api.conventions import problems
from api.problems import Problem
from api.schemas.common import Answer
from api.security import check_local

router = APIRouter(tags=["health"])


class State(Answer):
    """State of the service."""

    status: Literal["ok"]


@router.get("/health", summary="Whether the service runs")
async def health() -> State:
    return State(status="ok")


@router.get("/ready", summary="Whether database and workers answer", responses=problems(503, always=()))
def ready(components: ThisService) -> State:
    components.store.check()
    if not components.work.ready:
        raise Problem(503, f"the worker processes are starting, {components.kernels.progress}", headers={"Retry-After": "2"})
    if not components.streams.host.ready:
        raise Problem(503, f"the process of the force streams is starting, {components.kernels.progress}", headers={"Retry-After": "2"})
    if components.supervisor is not None and not components.supervisor.ready:
        raise Problem(503, "no job worker is running: accepted jobs wait", headers={"Retry-After": "5"})
    return State(status="ok")


@router.get(
    "/metrics",
    summary="Metrics for Prometheus",
    response_class=Response,
    description="Where no keys are asked for, to this machine alone.",
    responses={
        200: {"content": {"text/plain": {"schema": {"type": "string"}}}, "description": "Counters since the start."},
        **problems(403, always=()),
    },
)
def metrics(request: Request, components: ThisService) -> Response:
    if not components.settings.asks_for_keys:
        check_local(request)
    return Response(generate_latest(components.metrics.registry), media_type=CONTENT_TYPE_LATEST)
