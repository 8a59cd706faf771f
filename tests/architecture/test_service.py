"""The rooms of the service: routes are where routes are."""

from __future__ import annotations

import pkgutil
from importlib import import_module

from fastapi import APIRouter

from api import routes


def test_every_module_of_the_routes_has_a_route():
    """What routes share belongs beside them, not among them."""
    names = [module.name for module in pkgutil.iter_modules(routes.__path__)]
    found = {name: getattr(import_module(f"api.routes.{name}"), "router", None) for name in names}
    assert {name for name, router in found.items() if not isinstance(router, APIRouter) or not router.routes} == set()
