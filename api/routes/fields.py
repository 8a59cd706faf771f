"""Keys of files and bodies, for forms."""

from __future__ import annotations

from fastapi import APIRouter

from api.conventions import guard, problems
from api.schemas.fields import FieldAnswer, FieldsAnswer
from api.security import Guarded
from rcsa_ident.setup.fields import NEEDED, NOUNS, Field

router = APIRouter(prefix="/fields", tags=["toolings"], route_class=Guarded)


@router.get("", summary="Keys of cuts, toolings and sensors: units, limits and labels", openapi_extra=guard("read"), responses=problems())
def list_fields() -> FieldsAnswer:
    return FieldsAnswer(nouns={noun: [_told(each) for each in fields] for noun, fields in NOUNS.items()})


def _told(field: Field) -> FieldAnswer:
    least, most, above = field.limits
    return FieldAnswer(
        key=field.key,
        unit=field.number.unit,
        least=least,
        most=most,
        above=above,
        choices=list(field.choices),
        default=None if field.default is NEEDED else field.default,
        needed=field.default is NEEDED,
        label=field.label,
        hint=field.hint,
        description=field.described,
    )
