"""The example campaign: made by the virtual machine, and removed as a whole."""

from __future__ import annotations

import json
from contextlib import suppress

from fastapi import APIRouter, Response
from fastapi.concurrency import run_in_threadpool

from api.components import Components, ThisService
from api.conventions import guard, in_use, problems
from api.problems import Problem
from api.reading.example_campaign import ABOUT, LARGEST, MACHINE, example_id
from api.routes.toolings import summary
from api.schemas.libraries import ExampleCampaign
from api.security import Caller, Guarded, WhoAsks, now
from api.stores.campaigns import Campaign
from api.stores.entities import ABSENT, Document, Machine, Stale, Taken, digest_of
from api.transfer.body_stream import check_room

router = APIRouter(prefix="/examples/campaign", tags=["examples"], route_class=Guarded)
_WHY = "part of the example"


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
    openapi_extra=guard("upload"),
    responses=problems(404),
)
async def forget(components: ThisService, caller: WhoAsks) -> Response:
    await components.examples.leave(caller.group)
    _, toolings = await components.examples.declared(caller.group, now())
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
        document = Document(caller.group, _named(name), text, json.dumps(summary(text)), digest_of(text), now())
        with suppress(Stale):
            # what has this name already stays
            components.store.toolings.put(document, ABSENT, caller.note(_WHY))
    return components.store.campaigns.add(campaign)


def _forget(components: Components, caller: Caller, toolings: dict[str, str]) -> bool:
    for name, text in toolings.items():
        with suppress(Stale):
            # what somebody has changed is no example any more
            components.store.toolings.delete(caller.group, _named(name), digest_of(text), caller.note(_WHY))
    return components.uploads.forget_machine(caller.group, example_id(caller.group), caller.note(_WHY))


def _named(tooling: str) -> str:
    """The name of an example tooling in the library."""
    return f"Example {tooling}"
