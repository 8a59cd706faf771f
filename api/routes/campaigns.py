"""Campaigns of a machine: cuts, toolings and sensors."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path as FilePath
from typing import Any

from fastapi import APIRouter, Request, Response
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import StreamingResponse

from api.components import Components, ThisService
from api.conventions import BODY, After, CampaignId, Limit, MachineId, Repeat, guard, in_use, page, problems, utf8
from api.lookups import known_campaign, machine_of, refuse_example
from api.problems import Problem
from api.reading.campaign_text import HAMMER, LARGEST, campaign_of_text, declare, files_of, toml_text
from api.reading.example_campaign import example_id
from api.reading.stored import found_of, upload_of
from api.reading.uploads import refused_verdict
from api.schemas.campaigns import (
    EXAMPLE,
    CampaignAnswer,
    CampaignSummary,
    CutAnswer,
    FileState,
    HammerTestAnswer,
    NewCampaign,
    VerdictAnswer,
)
from api.schemas.common import Page, body_of
from api.security import Guarded, WhoAsks, new_id, now
from api.stores.campaigns import Campaign, Counts, Recording
from api.stores.entities import Damaged, Taken
from api.transfer.archives import zipped
from api.work.toolings import parsed
from rcsa_ident.base.errors import InputError
from rcsa_ident.identification.status import too_few
from rcsa_ident.io.toml_text import toml_of

router = APIRouter(tags=["campaigns"], route_class=Guarded)
TOML, JSON, ZIP = "application/toml", "application/json", "application/zip"
_EXAMPLE_TOML = toml_of(EXAMPLE)
_BODY = {
    "required": True,
    "content": {
        JSON: {"schema": {"$ref": "#/components/schemas/NewCampaign"}, "example": EXAMPLE},
        TOML: {"schema": {"type": "string"}, "example": _EXAMPLE_TOML},
    },
}


@router.post(
    "/machines/{id}/campaigns",
    status_code=201,
    summary="Make a campaign from campaign.toml, or from its keys as JSON",
    description="Toolings are copied: later changes of the library do not affect the campaign. The example machine takes none. "
    "Recordings are named by the last parts of their paths.",
    openapi_extra=guard("upload", requestBody=_BODY, **{"x-content-types": (JSON, TOML)}),
    responses=problems(404, 409, *BODY),
)
async def make(
    id: MachineId, request: Request, response: Response, components: ThisService, caller: WhoAsks, repeat: Repeat = None
) -> CampaignAnswer:
    raw = await request.body()
    if len(raw) > LARGEST:
        raise Problem(413, f"the body is too large: a campaign has at most {LARGEST // 1000} kB")
    is_toml = request.headers["content-type"].split(";")[0].strip().lower() == TOML

    def keep() -> Campaign:
        machine_of(components, caller.group, id)
        refuse_example("machine", id, caller.group)
        data = parsed(utf8(raw)) if is_toml else body_of(NewCampaign, raw).model_dump(exclude_unset=True, exclude_none=True)
        name, text, cuts = declare(data, lambda name: _tooling(components, caller.group, name))
        campaign = Campaign(new_id(), caller.group, id, name, text, cuts, now())
        digest = hashlib.sha256(json.dumps([id, is_toml]).encode() + raw).hexdigest()
        return components.store.campaigns.add(campaign, None if repeat is None else (repeat, digest))

    try:
        campaign = await run_in_threadpool(keep)
    except Taken as taken:
        raise in_use(taken, None, repeat) from None
    except KeyError:
        raise Problem(404, "there is no such machine") from None
    response.headers["Location"] = f"/v1/campaigns/{campaign.id}"
    return await run_in_threadpool(_answer, components, campaign)


def _tooling(components: Components, group: str, name: str) -> str | None:
    document = components.store.toolings.get(group, name)
    return None if document is None else document.text


@router.get("/machines/{id}/campaigns", summary="List campaigns of a machine", openapi_extra=guard("read"), responses=problems(404, 422))
def list_campaigns(id: MachineId, components: ThisService, caller: WhoAsks, after: After = "", limit: Limit = 50) -> Page[CampaignSummary]:
    machine_of(components, caller.group, id)
    rows, following = page(components.store.campaigns.list(caller.group, id, after, limit + 1), limit, lambda row: row.id)
    counts = components.store.campaigns.counts(caller.group, [row.id for row in rows])
    items = []
    for row in rows:
        count = counts.get(row.id, Counts(0, 0))
        common = {name: getattr(row, name) for name in ("id", "machine", "name", "created", "cuts")}
        missing = len(files_of(row.text)) - count.uploaded - count.air - count.hammer
        data = json.loads(row.text)
        without, tests = sum("air" not in cut for cut in data["cuts"]), len(data.get("frfs", ()))
        uploaded, usable = count.uploaded, count.usable
        items.append(CampaignSummary(**common, uploaded=uploaded, usable=usable, missing=missing, without_air=without, hammer_tests=tests))
    return Page(items=items, next=following)


@router.get(
    "/campaigns/{id}",
    summary="A campaign as JSON, or as campaign.toml (Accept: application/toml)",
    openapi_extra=guard("read"),
    response_class=Response,
    responses={
        200: {"model": CampaignAnswer, "description": "A campaign.", "content": {TOML: {"schema": {"type": "string"}}}},
        **problems(404, 422),
    },
)
def get(id: CampaignId, request: Request, components: ThisService, caller: WhoAsks) -> Response:
    campaign = known_campaign(components, caller.group, id)
    headers = {"Vary": "Accept"}
    if TOML in request.headers.get("accept", ""):
        return Response(toml_text(campaign.text).encode(), media_type=TOML, headers=headers)
    return Response(_answer(components, campaign).model_dump_json(), media_type=JSON, headers=headers)


@router.get(
    "/campaigns/{id}/archive",
    summary="ZIP archive for `rcsa-ident identify`: campaign.toml, toolings and the original recordings",
    description="Cuts and hammer tests without their files are omitted.",
    openapi_extra=guard("read"),
    response_class=StreamingResponse,
    responses={
        200: {"description": "The archive.", "content": {ZIP: {"schema": {"type": "string", "format": "binary"}}}},
        **problems(404, 409, 422, 500),
    },
)
def archive(id: CampaignId, components: ThisService, caller: WhoAsks) -> StreamingResponse:
    campaign = known_campaign(components, caller.group, id)
    rows = {row.name: row for row in components.store.recordings.list(caller.group, id, "", 1_000_000)}
    if not any(row.role in ("cut", HAMMER) for row in rows.values()):
        raise Problem(409, "no recording of a cut has been uploaded yet")
    # before the first byte: of an archive that breaks off nobody knows why
    files = {name: upload_of(components.files, row) for name, row in rows.items()}
    headers = {"Content-Disposition": f'attachment; filename="campaign-{campaign.id}.zip"'}
    return StreamingResponse(zipped(_members(campaign, files)), media_type=ZIP, headers=headers)


@router.delete(
    "/campaigns/{id}",
    status_code=204,
    summary="Delete a campaign and its recordings",
    openapi_extra=guard("upload"),
    responses=problems(404, 422),
)
def forget(id: CampaignId, components: ThisService, caller: WhoAsks) -> Response:
    if not components.uploads.forget_campaign(caller.group, id):
        raise Problem(404, "there is no such campaign")
    return Response(status_code=204)


def _answer(components: Components, campaign: Campaign) -> CampaignAnswer:
    data = json.loads(campaign.text)
    rows = {row.name: row for row in components.store.recordings.list(campaign.group, campaign.id, "", 1_000_000)}
    cuts = [_cut(cut, rows) for cut in data["cuts"]]
    tests = [_hammer_test(test, rows) for test in data.get("frfs", ())]
    remarks, rough = _told(campaign)
    usable = [(cut, cut.verdict.windows) for cut in cuts if cut.verdict is not None and cut.verdict.usable]
    learned = [cut.tooling for cut, windows in usable if not cut.validation for _ in range(windows)]
    return CampaignAnswer(
        id=campaign.id,
        machine=campaign.machine,
        name=campaign.name,
        created=campaign.created,
        example=campaign.id == example_id(campaign.group),
        sampling_rate_hz=data.get("campaign", {}).get("sampling_rate_hz"),
        sensors=data["sensors"],
        workpiece=data.get("workpiece", {}),
        toolings=list(data["toolings"]),
        usable=len(usable),
        remarks=remarks,
        rough_toolings=rough,
        # hammer tests help, and tell by their spreads what they leave open
        too_few=None if tests else too_few(learned, _sees_flange(data["sensors"])),
        cuts=cuts,
        hammer_tests=tests,
    )


def _sees_flange(sensors: dict[str, dict[str, Any]]) -> bool:
    """Whether a campaign has displacement sensors; one that has told none yet is asked no more than others."""
    return not sensors or any(sensor["quantity"] == "displacement" for sensor in sensors.values())


def _told(campaign: Campaign) -> tuple[list[str], list[str]]:
    """Remarks on a campaign, and its toolings whose drawings are not exact."""
    try:
        found = campaign_of_text(campaign.text)
    except InputError as error:
        # accepted by an earlier release, which knew fewer limits
        return [str(error)], []
    return list(found.remarks), [name for name, tooling in found.toolings.items() if not tooling.spread.exact]


def _verdict(row: Recording) -> dict[str, Any]:
    try:
        return dict(found_of(row)["verdict"])
    except Damaged as error:
        return refused_verdict(str(error))


def _cut(cut: dict[str, Any], rows: dict[str, Recording]) -> CutAnswer:
    row, air = rows.get(cut["cut"]), cut.get("air")
    verdict = None if row is None else VerdictAnswer.model_validate(_verdict(row))
    files = {
        "cut": FileState(name=cut["cut"], uploaded=row is not None),
        "air": None if air is None else FileState(name=air, uploaded=air in rows),
    }
    return CutAnswer(**cut | files, verdict=verdict)


def _hammer_test(test: dict[str, Any], rows: dict[str, Recording]) -> HammerTestAnswer:
    row, told = rows.get(test["file"]), {key: test[key] for key in ("id", "tooling", "axis", "response", "force")}
    try:
        found = {} if row is None else {each["id"]: each["lines"] for each in found_of(row)["frfs"]}
    except Damaged:
        found = {}
    return HammerTestAnswer(**told, file=FileState(name=test["file"], uploaded=row is not None), lines=found.get(test["id"]))


def _members(campaign: Campaign, files: Mapping[str, FilePath]) -> Iterator[tuple[str, bytes | FilePath]]:
    yield "campaign.toml", toml_text(campaign.text, files.__contains__).encode()
    for name, text in json.loads(campaign.text)["toolings"].items():
        yield f"toolings/{name}.toml", text.encode()
    for name, path in files.items():
        yield f"recordings/{name}", path
