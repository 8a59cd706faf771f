"""No view has a violation that axe-core finds: WCAG 2.2 AA and best practice, light and dark, wide and on a phone."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page

from api.client import Client
from tests.fixtures.service import Served
from tests.web import shots

axe = pytest.importorskip("axe_playwright_python.sync_playwright")
_ALL = {"type": "tag", "values": ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"]}
#: The rule that another scheme of colours can break.
_CONTRAST = {"type": "rule", "values": ["color-contrast"]}


def violations(page: Page, rules: dict[str, object] = _ALL) -> list[str]:
    """Rule, what it asks for, and the elements at fault."""
    found = axe.Axe().run(page, options={"runOnly": rules, "resultTypes": ["violations"]}).response["violations"]
    return [f"{rule['id']}: {rule['help']}: {[node['html'][:160] for node in rule['nodes'][:4]]}" for rule in found]


def faults(page: Page) -> dict[str, list[str]]:
    """Turn the page to every scheme and size: all rules once at each size, in its other scheme those that judge colours."""
    found = {}
    for size, viewport in shots.SIZES.items():
        page.set_viewport_size(viewport)
        for scheme, rules in zip(shots.SCHEMES, (_ALL, _CONTRAST), strict=True):
            page.emulate_media(color_scheme=scheme)
            page.wait_for_timeout(150)
            found[f"{size}, {scheme}"] = violations(page, rules)
    return {look: each for look, each in found.items() if each}


@pytest.fixture(scope="module")
def known(client: Client) -> Iterator[dict[str, str]]:
    yield shots.views(*shots.example_job(client))
    client.forget_example()


@pytest.mark.slow
def test_every_view(opened, served: Served, known: dict[str, str]):
    page = opened()
    found = {}
    for name, address in known.items():
        page.goto(f"{served.url}/{address}")
        shots.settled(page)
        found[name] = faults(page)
    assert {name: each for name, each in found.items() if each} == {}


def test_empty_views_and_dialogs(opened, served: Served, client: Client):
    """What a newcomer sees, what asks before something is lost, and a form with faults."""
    machine = client.make_machine("Empty for all").id
    page = opened(f"#/machines/{machine}")
    found: dict[str, object] = {}
    for address in (f"#/machines/{machine}", f"#/machines/{machine}/recordings", "#/identification", "#/change", "#/forces", "#/nowhere"):
        page.goto(f"{served.url}/{address}")
        page.wait_for_selector("h1, .note")
        found[address] = faults(page)
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
    assert {name: each for name, each in found.items() if each} == {}
