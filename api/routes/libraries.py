"""Import of tool libraries of CAM programs into the library of toolings."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Query, Request
from fastapi.concurrency import run_in_threadpool

from api.components import ThisService
from api.conventions import BODY, found_or_404, guard, problems, while_there
from api.problems import Problem
from api.schemas.common import NAME_PATTERN
from api.schemas.libraries import ImportAnswer, ImportedTool
from api.security import Caller, Guarded, WhoAsks, now
from api.stores.entities import ABSENT, Document, Stale, digest_of
from api.work.libraries import LARGEST_LIBRARY, Imported, imported
from rcsa_ident.io.settings.tool_libraries import Assumptions

router = APIRouter(prefix="/toolings", tags=["toolings"], route_class=Guarded)
JSON, ZIP = "application/json", "application/zip"
_EXAMPLE = {
    "data": [
        {
            "description": "End mill 12", "type": "flat end mill", "unit": "millimeters", "BMC": "carbide",
            "geometry": {"DC": 12.0, "LB": 60.0, "LCF": 26.0, "NOF": 4, "OAL": 104.0, "SFDM": 12.0},
            "holder": {
                "description": "Chuck 12", "gaugeLength": 95.0,
                "segments": [{"height": 95.0, "lower-diameter": 32.0, "upper-diameter": 32.0}],
            },
        }
    ]
}  # fmt: skip
_BODY = {
    "required": True,
    "content": {
        JSON: {"schema": {"type": "object"}, "example": _EXAMPLE},
        ZIP: {"schema": {"type": "string", "format": "binary"}},
    },
}


@router.post(
    "/import",
    summary="Import the toolings of a Fusion 360 or HSM tool library",
    description="JSON, or a .tools container. Entries are independent; existing toolings are skipped unless replace=true.",
    openapi_extra=guard("upload", requestBody=_BODY, **{"x-content-types": (JSON, ZIP), "x-parsed-elsewhere": True}),
    responses=problems(404, *BODY),
)
async def import_library(
    request: Request,
    components: ThisService,
    caller: WhoAsks,
    flute_ratio: Annotated[
        float, Query(ge=0.3, le=1.0, description="Ratio of the bending diameter of the fluted part to the cutting diameter.")
    ] = 0.8,
    helix_deg: Annotated[float, Query(ge=0.0, le=80.0, description="Helix angle where the library has none.")] = 30.0,
    stickout_mm: Annotated[float | None, Query(gt=0.0, le=5000.0, description="Instead of the library's length below holder.")] = None,
    insertion_mm: Annotated[float | None, Query(ge=0.0, le=5000.0, description="Instead of the rest of the tool's length.")] = None,
    material: Annotated[str | None, Query(max_length=50, description="Instead of the library's material.")] = None,
    holder: Annotated[str | None, Query(max_length=200, description="Holder of the library, for tools without one.")] = None,
    contact: Annotated[
        str | None,
        Query(pattern=NAME_PATTERN, description="Name of the tooling whose contact parameters are used; without it the catalogue's are."),
    ] = None,
    replace: Annotated[bool, Query(description="Overwrite existing toolings.")] = False,
) -> ImportAnswer:
    raw = await request.body()
    if len(raw) > LARGEST_LIBRARY:
        raise Problem(413, f"a tool library has at most {LARGEST_LIBRARY // 1_000_000} MB")
    joint = None
    if contact is not None:
        joint = found_or_404(await run_in_threadpool(components.store.toolings.get, caller.group, contact), f"tooling {contact}").text
    given = Assumptions(flute_ratio, helix_deg, stickout_mm, insertion_mm, material, holder=holder)
    entries = await while_there(request, components.reader.run(imported, raw, given, joint))

    def keep() -> list[ImportedTool]:
        return [_kept(components, caller, Imported(*entry), replace) for entry in entries]

    return ImportAnswer(items=await run_in_threadpool(keep))


def _kept(components: Any, caller: Caller, entry: Imported, replace: bool) -> ImportedTool:
    """Outcome of one entry, independent of the others."""
    name, reason = entry.name, entry.reason
    if not reason:
        try:
            document = Document(caller.group, name, entry.text, entry.summary, digest_of(entry.text), now())
            components.store.toolings.put(document, None if replace else ABSENT, caller.note("imported from a tool library"))
        except Stale:
            reason = "a tooling of that name is there already (replace=true writes over it)"
    return ImportedTool(
        name=name, status="skipped" if reason else "written", reason=reason or None, assumed=[] if reason else list(entry.assumed)
    )
