"""Holders generated from a few dimensions."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Path, Query

from api.conventions import guard, problems
from api.schemas.holders import CatalogueAnswer, ChuckAnswer, Holders, TypicalContactAnswer
from api.schemas.toolings import HolderKeys, SpreadKeys
from api.security import Guarded
from rcsa_ident.io.settings.toolings import contact_spread_keys, holder_keys, typical_contact_keys
from rcsa_ident.tool_holder.catalogue import bores, chucks, holder, tapers

router = APIRouter(prefix="/holders", tags=["toolings"], route_class=Guarded)
Named = Annotated[str, Path(pattern=r"^[A-Za-z0-9-]{1,20}$", description="As the catalogue lists it.")]


@router.get("", summary="Tapers and chucks of the catalogue of holders", openapi_extra=guard("read"), responses=problems())
def list_holders() -> Holders:
    sizes = [(name, *bores(name)) for name in chucks()]
    return Holders(
        tapers=list(tapers()),
        chucks=[ChuckAnswer(name=name, least_bore_mm=1e3 * least, largest_bore_mm=1e3 * most) for name, least, most in sizes],
    )


@router.get("/{taper}/{chuck}", summary="A holder, as the keys of a tooling", openapi_extra=guard("read"), responses=problems(422))
def get(
    taper: Named,
    chuck: Named,
    bore_mm: Annotated[float, Query(ge=1.0, le=32.0, description="Diameter of the tool's shank.")],
    length_mm: Annotated[float | None, Query(gt=0.0, le=5000.0, description="From the nose to the spindle's face or gauge line.")] = None,
) -> CatalogueAnswer:
    found = holder(taper, chuck, bore_mm * 1e-3, None if length_mm is None else length_mm * 1e-3)
    return CatalogueAnswer(
        name=f"{taper} {chuck}",
        mass_kg=found.mass,
        sources=list(found.sources),
        holder=HolderKeys.model_validate(holder_keys(found)),
        contact=TypicalContactAnswer.model_validate(typical) if (typical := typical_contact_keys(found.contact)) else None,
        spread=SpreadKeys.model_validate(contact_spread_keys(found.spread) if typical else {}),
    )
