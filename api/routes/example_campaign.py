"""The example campaign: made by the virtual machine, and removed as a whole."""

from __future__ import annotations

import json
from contextlib import suppress
from typing import Annotated

from fastapi import APIRouter, Query, Request, Response
from fastapi.concurrency import run_in_threadpool

from api.components import Components, ThisService
from api.conventions import guard, in_use, problems
from api.problems import Problem
from api.reading.example_campaign import ABOUT, LARGEST, MACHINE, example_id, example_tooling
from api.routes.machines import contents_of, unseen
from api.schemas.libraries import ExampleCampaign
from api.security import Caller, Guarded, WhoAsks, now
from api.stores.campaigns import Campaign
from api.stores.entities import ABSENT, Document, Machine, Stale, Taken, digest_of
from api.transfer.body_stream import check_room
from api.work.toolings import summary
from rcsa_ident.base.remarks import counted

router = APIRouter(prefix="/examples/campaign", tags=["examples"], route_class=Guarded)
_WHY = "part of the example"
Own = Annotated[bool, Query(description="Also campaigns of your own on its machine.")]


@router.post(
    "",
    status_code=201,
    summary="Make an example: a machine, its toolings, and a campaign that the virtual machine cuts",
    description="The answer comes at once, the recordings follow within seconds; asked again, what is missing is made. "
    "A group has one example. Its machine and campaign have ids that begin with example, its toolings names that begin with Example.",
    openapi_extra=guard("upload"),
    responses={200: {"model": ExampleCampaign, "description": "The example is there already."}, **problems(409, 413)},
)
async def make(components: ThisService, caller: WhoAsks, response: Response) -> ExampleCampaign:
    id = example_id(caller.group)
    campaign = await run_in_threadpool(components.store.campaigns.get, caller.group, id)
    if campaign is None:
        await check_room(components, caller.group, LARGEST)
        declared, toolings = await components.examples.declared(caller.group, now())
        campaign = await run_in_threadpool(_keep, components, caller, declared, toolings)
    else:
        response.status_code = 200
    components.examples.fill(campaign)
    response.headers["Location"] = f"/v1/campaigns/{id}"
    return ExampleCampaign(machine=id, campaign=id)


@router.delete(
    "",
    status_code=204,
    summary="Delete the example: its machine, its campaign, what was identified from it, and its toolings where nobody has changed them",
    description="`GET /v1/machines/{id}/contents` says what goes; with its entity tag in If-Match nothing else does. "
    "A campaign of your own that an earlier release put on the machine goes only with `own=true`.",
    openapi_extra=guard("upload"),
    responses=problems(404, 409, 412, 422),
)
async def forget(request: Request, components: ThisService, caller: WhoAsks, own: Own = False) -> Response:
    there = await contents_of(components, caller.group, example_id(caller.group))
    if there is not None:
        unseen(request, there)
        mine = [f"{each.name} ({counted(len(each.recordings), 'recording')})" for each in there.campaigns if not each.example]
        if mine and not own:
            fault = {"field": "own", "found": ", ".join(mine), "allowed": "true, or no campaigns of your own on the machine"}
            raise Problem(409, f"campaigns of your own would go with the example: {', '.join(mine)}", [fault])
    await components.examples.leave(caller.group)
    toolings = await components.examples.untouched(caller.group)
    if not await run_in_threadpool(_forget, components, caller, toolings):
        raise Problem(404, "there is no example")
    return Response(status_code=204)


def _keep(components: Components, caller: Caller, campaign: Campaign, toolings: dict[str, str]) -> Campaign:
    machine = Machine(campaign.machine, caller.group, MACHINE, ABOUT, now())
    if components.store.machines.get(caller.group, machine.id) is None:
        try:
            components.store.machines.add(machine, None, caller.note(_WHY))
        except Taken as taken:
            raise in_use(taken, MACHINE, None) from None
    for name, text in toolings.items():
        document = Document(caller.group, example_tooling(name), text, json.dumps(summary(text)), digest_of(text), now())
        with suppress(Stale):
            # what has this name already stays
            components.store.toolings.put(document, ABSENT, caller.note(_WHY))
    return components.store.campaigns.add(campaign)


def _forget(components: Components, caller: Caller, toolings: dict[str, str]) -> bool:
    for name, digest in toolings.items():
        with suppress(Stale):
            # what somebody has changed is no example any more
            components.store.toolings.delete(caller.group, name, digest, caller.note(_WHY))
    return components.uploads.forget_machine(caller.group, example_id(caller.group), caller.note(_WHY))
