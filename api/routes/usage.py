"""What a group keeps, and what it may keep."""

from __future__ import annotations

from fastapi import APIRouter

from api.components import ThisService
from api.conventions import guard, problems
from api.schemas.usage import Quota, Usage
from api.security import Guarded, WhoAsks

router = APIRouter(tags=["usage"], route_class=Guarded)


@router.get("/usage", summary="What the group keeps, by kind, and what it may keep", openapi_extra=guard("read"), responses=problems())
def usage(components: ThisService, caller: WhoAsks) -> Usage:
    files, rows = components.files.usage(caller.group), components.store.usage(caller.group)
    return Usage(
        files=Quota(used=sum(files.values()), allowed=components.files.group_bytes, kinds=files),
        database=Quota(used=sum(rows.values()), allowed=components.store.group_bytes, kinds=rows),
    )
