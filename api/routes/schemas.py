"""JSON Schemas of the TOML files, for editors."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Path

from api.conventions import guard, problems
from api.problems import Problem
from api.security import Guarded
from rcsa_ident.io.settings.schemas import SCHEMAS, schema_of

router = APIRouter(prefix="/schemas", tags=["toolings"], route_class=Guarded)


@router.get(
    "/{name}",
    summary="JSON Schema of a TOML file: tooling, campaign, machine or modes",
    description="Draft-07, with the limits that the file's reader has.",
    openapi_extra=guard("read"),
    responses=problems(404, 422),
)
def get_schema(name: Annotated[str, Path(description="tooling, campaign, machine or modes.", max_length=20)]) -> dict[str, Any]:
    if name not in SCHEMAS:
        raise Problem(404, f"there is no such schema; there are {', '.join(SCHEMAS)}")
    return schema_of(name)
