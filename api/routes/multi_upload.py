"""Several recordings in one form: each is stored or refused on its own."""

from __future__ import annotations

from fastapi import APIRouter, Request
from fastapi.concurrency import run_in_threadpool

from api.components import Components, ThisService
from api.conventions import BODY, CampaignId, guard, problems
from api.files import Part
from api.lookups import own_campaign
from api.problems import Problem, of_input, of_room
from api.reading.campaign_text import files_of
from api.routes.recordings import answer
from api.schemas.campaigns import ItemProblem, UploadAnswer, UploadItem
from api.schemas.common import Fault
from api.security import Guarded, WhoAsks
from api.stores.campaigns import Campaign
from api.stores.entities import Damaged, NoRoom
from api.transfer.body_stream import announced_length, check_room, complete, refuse_encoded, take, write
from api.transfer.multipart import FORM, Head, events
from api.work.pool import Busy
from rcsa_ident.base.errors import InputError

router = APIRouter(prefix="/campaigns/{id}/recordings", tags=["recordings"], route_class=Guarded)
_FORM = {
    "required": True,
    "content": {
        FORM: {
            "schema": {
                "type": "object",
                "properties": {"files": {"type": "array", "items": {"type": "string", "format": "binary"}}},
            }
        }
    },
}


@router.post(
    "",
    summary="Upload several recordings",
    description="Each file is a part of the form, whose file name is named by the campaign. A refused file does not affect the others.",
    openapi_extra=guard("upload", requestBody=_FORM, **{"x-content-types": (FORM,)}),
    responses=problems(404, 408, 409, *BODY),
)
async def post(id: CampaignId, request: Request, components: ThisService, caller: WhoAsks, replace: bool = False) -> UploadAnswer:
    campaign = await run_in_threadpool(own_campaign, components, caller.group, id)
    refuse_encoded(request)
    known = files_of(campaign.text)
    with components.uploads.admitted(caller.group):
        await check_room(components, caller.group, announced_length(request))
        items: list[UploadItem] = []
        name, part, seen = "", None, 0
        try:
            async for event in events(request, components):
                if isinstance(event, Head):
                    name, part = event.name or event.field, None
                    if event.name in known:
                        part = await run_in_threadpool(components.files.part, caller.group)
                elif event is not None:
                    seen += len(event)
                    if part is not None:
                        await write(components, caller.group, part, event, seen)
                else:
                    items.append(await _item(components, campaign, name, part, replace))
                    if part is not None:
                        part.drop()
        finally:
            if part is not None:
                part.drop()
    return UploadAnswer(items=items)


async def _item(components: Components, campaign: Campaign, name: str, part: Part | None, replacing: bool) -> UploadItem:
    """Store one file, or return the reason why not."""
    try:
        if part is None:
            raise Problem(404, "the campaign does not name this recording")
        status, kept = await take(components, campaign, name, await complete(part), replacing)
        return UploadItem(name=name, status=status, recording=answer(campaign, kept), problem=None)
    except Problem as error:
        problem = error
    except InputError as error:
        problem = of_input(error)
    except NoRoom as error:
        problem = of_room(error)
    except Damaged as error:
        problem = Problem(500, str(error))
    except Busy:
        problem = Problem(503, "too many uploads are waiting to be read")
    faults = [Fault.model_validate(each) for each in problem.errors] or None
    return UploadItem(name=name[:200], status=problem.status, recording=None, problem=ItemProblem(detail=problem.detail, errors=faults))
