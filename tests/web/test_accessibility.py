"""No view has a violation that axe-core finds: WCAG 2.2 AA and best practice, light and dark, wide and on a phone."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page

from api.client import Client
from tests.fixtures.service import Served
from tests.web import shots

axe = pytest.importorskip("axe_playwright_python.sync_playwright")
_RULES = {
    "runOnly": {"type": "tag", "values": ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"]},
    "resultTypes": ["violations"],
}


def violations(page: Page) -> list[str]:
    """Rule, what it asks for, and the elements at fault."""
    found = axe.Axe().run(page, options=_RULES).response["violations"]
    return [f"{rule['id']}: {rule['help']}: {[node['html'][:160] for node in rule['nodes'][:4]]}" for rule in found]


def looks(page: Page) -> Iterator[str]:
    """Turn the page to every scheme and size, and yield their names."""
    for size, viewport in shots.SIZES.items():
        page.set_viewport_size(viewport)
        for scheme in shots.SCHEMES:
            page.emulate_media(color_scheme=scheme)
            page.wait_for_timeout(150)
            yield f"{size}, {scheme}"


@pytest.fixture(scope="module")
def known(client: Client) -> Iterator[dict[str, str]]:
    yield shots.views(*shots.example_job(client))
    client.forget_example()


@pytest.mark.slow(120)
def test_every_view(opened, served: Served, known: dict[str, str]):
    page = opened()
    found = {}
    for name, address in known.items():
        page.goto(f"{served.url}/{address}")
        shots.settled(page)
        for look in looks(page):
            faults = violations(page)
            if faults:
                found[f"{name}, {look}"] = faults
    assert found == {}


def test_empty_views_and_dialogs(opened, served: Served, client: Client):
    """What a newcomer sees, what asks before something is lost, and a form with faults."""
    machine = client.make_machine("Empty for all").id
    page = opened(f"#/machines/{machine}")
    found = {}
    for address in (f"#/machines/{machine}", f"#/machines/{machine}/recordings", "#/identification", "#/change", "#/forces", "#/nowhere"):
        page.goto(f"{served.url}/{address}")
        page.wait_for_selector("h1, .note")
        for look in looks(page):
            if faults := violations(page):
                found[f"{address}, {look}"] = faults
    page.goto(f"{served.url}/#/machines/{machine}")
    page.get_by_role("button", name="Forget").click()
    found["dialog"] = violations(page)
    page.get_by_role("button", name="Keep it").click()
    page.goto(f"{served.url}/#/toolings/new")
    # the drawing comes a little later and moves what is below it
    shots.settled(page)
    page.get_by_role("button", name="Put into the library").click()
    page.locator(".fault:visible").first.wait_for()
    found["faults"] = violations(page)
    assert {name: faults for name, faults in found.items() if faults} == {}
