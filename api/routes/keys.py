"""API keys of the caller's group."""

from __future__ import annotations

from fastapi import APIRouter, Response

from api.components import ThisService
from api.conventions import BODY, After, KeyId, Limit, guard, page, problems
from api.problems import Problem
from api.schemas.common import Page
from api.schemas.keys import KeyAnswer, MadeKey, NewKey
from api.security import Guarded, WhoAsks, make_key
from api.stores.entities import Key

router = APIRouter(prefix="/keys", tags=["keys"], route_class=Guarded)


@router.post("", status_code=201, summary="Make an API key", openapi_extra=guard("admin"), responses=problems(*BODY))
def make(body: NewKey, components: ThisService, caller: WhoAsks) -> MadeKey:
    key, text = make_key(caller.group, tuple(dict.fromkeys(body.scopes)), body.label, body.expires_in_days)
    components.store.keys.add(key)
    return MadeKey(**_answer(key).model_dump(), key=text)


@router.get("", summary="List API keys", openapi_extra=guard("admin"), responses=problems(422))
def list_keys(components: ThisService, caller: WhoAsks, after: After = "", limit: Limit = 50) -> Page[KeyAnswer]:
    rows, following = page(components.store.keys.list(caller.group, after, limit + 1), limit, lambda key: key.id)
    return Page(items=[_answer(key) for key in rows], next=following)


@router.delete("/{id}", status_code=204, summary="Revoke an API key", openapi_extra=guard("admin"), responses=problems(404, 422))
def withdraw(id: KeyId, components: ThisService, caller: WhoAsks) -> Response:
    if not components.store.keys.delete(caller.group, id):
        raise Problem(404, "there is no such key")
    return Response(status_code=204)


def _answer(key: Key) -> KeyAnswer:
    same = ("id", "group", "label", "created", "expires", "used")
    return KeyAnswer.model_validate({name: getattr(key, name) for name in same} | {"scopes": list(key.scopes)})
