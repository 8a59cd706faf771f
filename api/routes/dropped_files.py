"""What files mean before anything is stored."""

from __future__ import annotations

from fastapi import APIRouter, Request
from fastapi.concurrency import run_in_threadpool

from api.components import ThisService
from api.conventions import BODY, guard, problems, utf8
from api.problems import Problem
from api.reading.dropped import look_at
from api.schemas.dropped_files import MOST_DIFFERENCES, DroppedAnswer, DroppedFiles, DroppedToolingAnswer, TestedCutsAnswer, tested_cut
from api.schemas.queries import MOST_TESTED
from api.schemas.versions import Difference
from api.security import Guarded, WhoAsks
from api.stores.entities import digest_of
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import to_rpm
from rcsa_ident.io.settings.tested_cuts import own_columns, tested_cuts_of
from rcsa_ident.io.unread_columns import left_aside, reading_tables

router = APIRouter(tags=["campaigns"], route_class=Guarded)
CSV = "text/csv"
_LARGEST_CSV = 1_000_000
_CUTS = {"required": True, "content": {CSV: {"schema": {"type": "string"}}}}


@router.post(
    "/campaigns/preview",
    summary="What dropped TOML files hold: campaign, toolings, and what is missing; nothing is stored",
    openapi_extra=guard("read"),
    responses=problems(*BODY),
)
async def preview(asked: DroppedFiles, components: ThisService, caller: WhoAsks) -> DroppedAnswer:
    def library(name: str) -> str | None:
        return getattr(components.store.toolings.get(caller.group, name), "text", None)

    def looked() -> DroppedAnswer:
        found = look_at([(file.name, file.text) for file in asked.files], library)
        toolings = [
            DroppedToolingAnswer(
                file=each.file,
                key=each.key,
                listed=each.listed,
                etag=None if each.there is None else digest_of(each.there),
                differences=[Difference(field=field, old=old, new=new) for field, old, new in each.differences[:MOST_DIFFERENCES]],
                differing=len(each.differences),
            )
            for each in found.toolings
        ]
        same = ("campaign", "name", "keys", "from_library", "missing", "recordings", "others")
        return DroppedAnswer(toolings=toolings, **{name: getattr(found, name) for name in same})

    return await run_in_threadpool(looked)


@router.post(
    "/tested-cuts/preview",
    summary="The cuts of CUTS.csv, as the commands read it; nothing is stored",
    openapi_extra=guard("read", requestBody=_CUTS, **{"x-content-types": (CSV,)}),
    responses=problems(*BODY),
)
async def tested_cuts(request: Request) -> TestedCutsAnswer:
    raw = await request.body()
    if len(raw) > _LARGEST_CSV:
        raise Problem(413, f"tested cuts have at most {_LARGEST_CSV // 1000} kB")

    def read() -> TestedCutsAnswer:
        try:
            with reading_tables():
                found, warnings = tested_cuts_of(utf8(raw), ""), left_aside()
        except InputError as error:
            # a body has no file's name, but lines
            field = ", ".join(filter(None, (error.where.strip(), error.field)))
            raise InputError(field, error.found, error.allowed) from None
        if len(found.verdict) > MOST_TESTED:
            raise InputError("cuts", f"{len(found.verdict)} of them", f"at most {MOST_TESTED}")
        # what is written in rev/min and mm comes back so
        columns = ([float(f"{value:.12g}") for value in values] for values in (to_rpm(found.spindle_speed), 1e3 * found.axial_depth))
        cuts = [tested_cut(*row) for row in enumerate(zip(*columns, found.verdict, strict=True))]
        own = own_columns(found)
        if own:
            warnings.append(f"{', '.join(own)}: not used here; every cut is evaluated with the width, direction and feed of the question")
        return TestedCutsAnswer(cuts=cuts, warnings=warnings)

    return await run_in_threadpool(read)
