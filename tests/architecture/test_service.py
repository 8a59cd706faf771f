"""The rooms of the service: routes are where routes are."""

from __future__ import annotations

import pkgutil
from importlib import import_module

import pytest
from fastapi import APIRouter

from api import routes


@pytest.mark.parametrize("name", [module.name for module in pkgutil.iter_modules(routes.__path__)])
def test_every_module_of_the_routes_has_a_route(name):
    router = getattr(import_module(f"api.routes.{name}"), "router", None)
    assert isinstance(router, APIRouter), f"api/routes/{name}.py has no router: what routes share belongs beside them, not among them"
    assert router.routes, f"the router of api/routes/{name}.py has no route"
