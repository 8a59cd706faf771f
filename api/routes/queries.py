"""After a tool change: what the tip does, and what cuts are stable."""

from __future__ import annotations

import asyncio
from typing import Any

from fastapi import APIRouter, Request, Response
from fastapi.concurrency import run_in_threadpool

from api.parts import Parts, ThisService
from api.problems import Problem
from api.routes.common import BODY, guard, problems
from api.routes.machines import known_machine
from api.routes.toolings import toml_text
from api.schemas.queries import AdviceAnswer, AdviceQuery, LobeAnswer, LobeQuery, TipAnswer, TipQuery
from api.schemas.toolings import ToolingKeys
from api.security import Guarded, WhoAsks
from api.work import answers
from api.work.questions import MachineText, ToolingText

router = APIRouter(tags=["tool change"], route_class=Guarded)
CSV = "text/csv"


@router.post(
    "/tooltip",
    summary="Tooltip FRF of a tooling, with bands; Accept: text/csv for FRF.csv",
    openapi_extra=guard("run"),
    response_model=TipAnswer,
    responses={200: {"description": "Receptances.", "content": {CSV: {"schema": {"type": "string"}}}}, **problems(404, *BODY)},
)
async def tooltip(body: TipQuery, request: Request, parts: ThisService, caller: WhoAsks) -> Any:
    machine, (tooling,) = await _subject(parts, caller.group, body.machine, [body.tooling])
    csv = CSV in request.headers.get("accept", "")
    answer = await parts.work.run(answers.tooltip, machine, tooling, body.question(parts.settings.work_seconds), csv)
    return Response(answer, media_type=CSV) if csv else TipAnswer.model_validate(answer)


@router.post("/lobes", summary="Stability lobes of one tooling or several", openapi_extra=guard("run"), responses=problems(404, *BODY))
async def lobes(body: LobeQuery, parts: ThisService, caller: WhoAsks) -> LobeAnswer:
    question = body.question(parts.settings.work_seconds)
    machine, toolings = await _subject(parts, caller.group, body.machine, body.toolings)
    return LobeAnswer.model_validate({"machine": body.machine, "toolings": await _each(parts, answers.lobes, machine, toolings, question)})


@router.post(
    "/advice",
    summary="Highest removal rate, speeds for a depth, margin of planned cuts",
    openapi_extra=guard("run"),
    responses=problems(404, *BODY),
)
async def advice(body: AdviceQuery, parts: ThisService, caller: WhoAsks) -> AdviceAnswer:
    question = body.advice(parts.settings.work_seconds)
    machine, toolings = await _subject(parts, caller.group, body.machine, body.toolings)
    found = await _each(parts, answers.advice, machine, toolings, question)
    return AdviceAnswer.model_validate({"machine": body.machine, "toolings": found})


async def _each(parts: Parts, call: Any, machine: MachineText, toolings: list[ToolingText], question: Any) -> list[Any]:
    """Ask for every tooling, on as many workers as are free; the first failure is the answer."""
    found = await asyncio.gather(*(parts.work.run(call, machine, tooling, question) for tooling in toolings), return_exceptions=True)
    for answer in found:
        if isinstance(answer, BaseException):
            raise answer
    return found


async def _subject(parts: Parts, group: str, machine: str, toolings: list[str | ToolingKeys]) -> tuple[MachineText, list[ToolingText]]:
    """Return the machine and the toolings, each from the library or as it came."""

    def look() -> tuple[MachineText, list[ToolingText]]:
        known = known_machine(parts, group, machine)
        texts = []
        for i, tooling in enumerate(toolings):
            if isinstance(tooling, ToolingKeys):
                texts.append(ToolingText(tooling.name or f"tooling {i + 1}", toml_text(tooling)))
                continue
            document = parts.store.toolings.get(group, tooling)
            if document is None:
                raise Problem(404, f"there is no tooling {tooling}")
            texts.append(ToolingText(tooling, document.text))
        return known, texts

    return await run_in_threadpool(look)
