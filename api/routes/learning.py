"""What the cuts and taps of a campaign teach of toolings that are new to its machine: looked at first, then taken over."""

from __future__ import annotations

import json
from functools import partial
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request, Response
from fastapi.concurrency import run_in_threadpool

from api.components import Components, ThisService
from api.conventions import CampaignId, Why, expected, guard, problems, tagged, while_there
from api.lookups import known_campaign, known_machine
from api.problems import Problem
from api.reading.campaigns import load_campaign
from api.schemas.learning import LearnAnswer
from api.schemas.toolings import ToolingKeys
from api.security import Caller, Guarded, WhoAsks, now
from api.stores.campaigns import Campaign
from api.stores.entities import ABSENT, Document, Expected, Stale, digest_of
from api.work.learning import learn
from api.work.requests import MachineText, TooLong, anonymous
from api.work.toolings import parsed, summary
from rcsa_ident.base.errors import InputError
from rcsa_ident.io.toml_text import toml_of

router = APIRouter(prefix="/campaigns/{id}/learn", tags=["campaigns"], route_class=Guarded)
_CHANGED = "the machine, the campaign or its recordings are not those that the query expects: look again at what they teach"


@router.post(
    "",
    summary="What the cuts and taps of a campaign teach of toolings that are new to its machine; nothing is stored",
    description="The machine's identification is taken as known; one slow, stable cut of a tooling whose drawing has a `[spread]` is "
    "enough, or a hammer test (`[[frfs]]`) of its tip along X and Y. A tooling that its cuts or taps contradict is named.",
    openapi_extra=guard("run"),
    responses=problems(404, 422),
)
async def look(id: CampaignId, request: Request, response: Response, components: ThisService, caller: WhoAsks) -> LearnAnswer:
    campaign, machine, etag = await run_in_threadpool(_subject, components, caller.group, id)
    found = await _learned(request, components, campaign, machine, False)
    response.headers.update(tagged(etag))
    return _answer(campaign, etag, found)


@router.post(
    "/take-over",
    summary="Write the toolings that a campaign's cuts teach, each as a version, and with machine=true the machine that they teach, too",
    description="If-Match with `etag` of the answer that was looked at: what is written is what was seen. Nothing is written over a "
    "tooling of the library that is another one than the campaign's: 409. A tooling that its cuts contradict is not written, nor is a "
    "machine then.",
    openapi_extra=guard("upload"),
    responses=problems(404, 409, 412, 413, 422),
)
async def take_over(
    id: CampaignId,
    request: Request,
    response: Response,
    components: ThisService,
    caller: WhoAsks,
    machine: Annotated[bool, Query(description="Also the machine's identification, which the toolings then belong to.")] = False,
    why: Why = "",
) -> LearnAnswer:
    campaign, known, etag = await run_in_threadpool(_subject, components, caller.group, id)
    if expected(request, lambda: etag) not in (None, etag):
        raise Problem(412, _CHANGED)
    found = await _learned(request, components, campaign, known, machine)
    why = why or f"learned from the campaign {campaign.name}"
    try:
        written = await run_in_threadpool(_written, components, caller, campaign, known, found, why)
    except Stale:
        raise Problem(412, _CHANGED) from None
    return _answer(campaign, etag, found, written=written, machine_written=found["taught"] is not None)


def _subject(components: Components, group: str, id: str) -> tuple[Campaign, MachineText, str]:
    """The campaign, its machine, and the entity tag of both with all recordings."""
    campaign = known_campaign(components, group, id)
    machine = known_machine(components, group, campaign.machine)
    listed = components.store.recordings.list(group, id, "", 1_000_000)
    told = [machine.digest, campaign.text, [[each.name, each.samples] for each in listed]]
    return campaign, machine, digest_of(json.dumps(told))


async def _learned(request: Request, components: Components, campaign: Campaign, machine: MachineText, teach: bool) -> dict[str, Any]:
    declared, read, read_test = await run_in_threadpool(load_campaign, components.store, components.files, campaign.group, campaign.id)
    teacher, reads = f"{campaign.name} ({campaign.id})", (partial(anonymous, read), partial(anonymous, read_test))
    try:
        return await while_there(request, components.work.run(learn, machine, declared, *reads, teacher, teach))
    except TooLong as error:
        hit = f" and {len(declared.tests)} hammer tests" if declared.tests else ""
        found = f"{len(declared.cuts)} cuts{hit}, which take more than {error.seconds:g} s"
        raise InputError("campaign", found, "one of the new toolings alone: a slow, stable cut or a tap of each is enough") from None


def _answer(campaign: Campaign, etag: str, found: dict[str, Any], **further: Any) -> LearnAnswer:
    told = {key: value for key, value in found.items() if key != "taught"}
    return LearnAnswer.model_validate({"campaign": campaign.id, "machine": campaign.machine, "etag": etag, **told, **further})


def _written(components: Components, caller: Caller, campaign: Campaign, known: MachineText, found: dict[str, Any], why: str) -> list[str]:
    """Write toolings, and the machine where it was taught, all or nothing, and return the toolings' names; nothing is written where the
    library has another tooling under one of them."""
    kept, drawn = components.store.toolings, json.loads(campaign.text)["toolings"]
    documents: list[Expected] = []
    for each in found["toolings"]:
        name, keys = each["name"], each["tooling"]
        if keys is None:
            continue
        text = toml_of(ToolingKeys.model_validate(keys).model_dump(exclude_unset=True, exclude_none=True))
        there = kept.get(caller.group, name)
        if there is not None and parsed(there.text) not in (parsed(drawn[name]), parsed(text)):
            detail = f"the tooling {name} of the library is not the one that the campaign was made with, and is not written over"
            raise Problem(409, detail, [{"field": "toolings", "found": name, "allowed": "the tooling as the campaign has it, or none"}])
        if there is None or parsed(there.text) != parsed(text):
            document = Document(caller.group, name, text, json.dumps(summary(text)), digest_of(text), now())
            documents.append((document, ABSENT if there is None else there.digest))
    machine: Expected | None = None
    if found["taught"] is not None:
        text, told = found["taught"]["text"], found["taught"]["summary"]
        machine = Document(campaign.group, campaign.machine, text, json.dumps(told), digest_of(text), now()), known.digest
    if documents or machine is not None:
        components.store.put_together(documents, machine, caller.note(why))
    return [document.name for document, _ in documents]
