"""Cutting coefficients from published sources."""

from __future__ import annotations

from fastapi import APIRouter

from api.conventions import guard, problems
from api.schemas.materials import MaterialAnswer, Materials
from api.security import Guarded
from rcsa_ident.cutting.materials import materials

router = APIRouter(prefix="/materials", tags=["tool change"], route_class=Guarded)


@router.get("", summary="Materials with their cutting coefficients and sources", openapi_extra=guard("read"), responses=problems())
def list_materials() -> Materials:
    return Materials(
        items=[
            MaterialAnswer(
                name=each.name,
                condition=each.condition,
                ktc_mpa=each.coefficients.tangential * 1e-6,
                krc=each.coefficients.radial_ratio,
                kte_n_per_mm=each.coefficients.tangential_edge * 1e-3,
                kre_n_per_mm=each.coefficients.radial_edge * 1e-3,
                ktc_spread_percent=each.coefficients.tangential_spread * 100.0,
                source=each.source,
                notes=each.notes,
            )
            for each in materials()
        ]
    )
