"""How views are laid out: on paper, on a phone, and where they take files; nothing is cut off."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

from playwright.sync_api import Browser, expect

from api.client import Client
from rcsa_ident.base.units import rpm
from rcsa_ident.io.results.identifications import machine_from_json
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.report.html import ToolCard, tool_cards_html
from rcsa_ident.setup.cut import CutSpec
from rcsa_ident.workflows.advise import advise
from rcsa_ident.workflows.tool_change import ToolChange
from tests.api.recordings import content, declared
from tests.fixtures import by_hand
from tests.fixtures.paths import TOOLINGS
from tests.fixtures.service import Served
from tests.web.conftest import drop


def plain(text: str) -> str:
    return text.replace("\u202f", "").replace("\u00a0", " ")


def test_a_tool_card_prints_on_one_page(opened, shop: str):
    page, asked = opened(), list[str | None]()
    page.on("request", lambda request: asked.append(request.post_data) if request.url.endswith("/v1/advice") else None)
    page.goto(f"{page.url.partition('#')[0]}#/change?machine={shop}&tooling=T1&im=20")
    expect(page.locator(".best .figure output")).to_be_visible(timeout=60_000)
    page.get_by_role("link", name="Print tool card").click()
    expect(page.locator("h1")).to_have_text("Tool card: T1")
    card = page.locator(".tool-card")
    expect(card).to_contain_text("Recommended cuts", timeout=60_000)
    said = plain(card.inner_text())
    for words in ("Shop", "20 %", "down milling", "rcsa-ident", "version 1", "identification"):
        assert words in said
    assert card.locator("tbody tr").count() >= 1
    # to the letter what the view before has asked: the service has the answer
    assert len(asked) == 2
    assert asked[0] == asked[1]
    expect(card.locator("img.drawing")).to_be_visible()
    assert page.pdf(format="A4").count(b"/Type /Page\n") == 1


def test_cards_of_the_command_line_print_on_a_page_each(browser: Browser, result: str, tmp_path: Path):
    machine = machine_from_json(json.loads(result), "RESULT.json")
    cards = []
    for file in sorted(TOOLINGS.glob("*.toml"))[:2]:
        tooling, cut = read_tooling(file), CutSpec(feed_per_tooth=1e-4)
        told = advise(ToolChange(machine, tooling, cut, rpm(6000, 12_000, 100), 10e-3))
        warned = replace(told, remarks=("a sentence of a warning as long as they are at most, " * 3,) * 4)
        cards.append(ToolCard(tooling, cut, warned, str(machine), 0.01, 0.95, 0.1, ("RESULT.json 0123456789ab", file.name)))
    page = browser.new_page()
    (tmp_path / "CARD.html").write_text(tool_cards_html(cards, datetime(2026, 1, 2, 3, 4, tzinfo=UTC)), encoding="utf-8")
    page.goto((tmp_path / "CARD.html").as_uri())
    assert page.locator("footer").first.inner_text().startswith("2026-01-02 03:04 · RESULT.json 0123456789ab")
    assert page.locator("img").evaluate_all("all => all.every((each) => each.naturalWidth > 0)")
    assert page.pdf(format="A4", prefer_css_page_size=True).count(b"/Type /Page\n") == 2
    # nothing sticks out on a phone
    page.set_viewport_size({"width": 390, "height": 844})
    assert page.evaluate("document.documentElement.scrollWidth") == 390
    page.close()


def test_the_whole_view_takes_what_is_dropped(opened, tmp_path: Path):
    """Anywhere, and only once; a view that was left takes nothing any more."""
    page = opened()
    page.get_by_role("link", name="Toolings").click()
    page.get_by_role("heading", name="Toolings", level=1).wait_for()
    (tmp_path / "holiday.toml").write_text("[holiday]")
    drop(page, "h1", [tmp_path / "holiday.toml"])
    expect(page.locator("main")).to_contain_text("holiday")
    assert [r.method for r in opened.watch.requests if "/v1/toolings/holiday" in r.url] == ["PUT"]
    expect(page.locator("main")).not_to_contain_text("This is what was found")


def test_tables_are_cards_on_a_phone(opened, served: Served, shop: str):
    page = opened(f"#/machines/{shop}", viewport={"width": 390, "height": 844})
    cell = page.locator("table.stacks tbody tr").first.locator("td").first
    assert page.evaluate("(e) => getComputedStyle(e, '::before').content", cell.element_handle()) == '"Frequency [Hz]"'
    assert page.evaluate("() => [...document.querySelectorAll('.scrolls')].every((e) => e.scrollWidth <= e.clientWidth)")
    # it stays a table for those who hear it
    expect(page.get_by_role("table").first.get_by_role("columnheader", name="Frequency")).to_have_count(1)
    page.goto(f"{served.url}/#/toolings/edit/T1")
    expect(page.get_by_role("cell").first).to_be_visible()
    assert page.evaluate("() => [...document.querySelectorAll('.scrolls')].every((e) => e.scrollWidth <= e.clientWidth)")


#: Lists whose chosen words are wider than what is left beside the arrow.
_CLIPPED = """() => {
  const pen = document.createElement('canvas').getContext('2d');
  return [...document.querySelectorAll('select')].filter((list) => {
    const style = getComputedStyle(list);
    pen.font = style.font;
    const room = list.clientWidth - parseFloat(style.paddingLeft) - parseFloat(style.paddingRight) - 20;
    return list.offsetParent && pen.measureText(list.selectedOptions[0]?.textContent ?? '').width > room;
  }).map((list) => list.selectedOptions[0].textContent);
}"""


def test_toolings_side_by_side_stand_in_sight(opened, client: Client, shop: str):
    """With names as long as those of the example."""
    names = ("Example S3-PG25-long", "Example S4-PG25-short")
    for name in names:
        client.write_tooling(name, by_hand.TOOLING)
    chosen = "&".join(f"tooling={name}" for name in names)
    page = opened(f"#/change?machine={shop}&{chosen}", viewport={"width": 1440, "height": 900})
    table = page.locator(".scrolls", has=page.get_by_role("table", name="Toolings side by side"))
    expect(table).to_contain_text("Removes", timeout=60_000)
    assert table.evaluate("(e) => e.scrollWidth <= e.clientWidth")
    for name in names:
        client.forget_tooling(name)


def test_lists_show_their_choice_whole(opened, client: Client, served: Served, shop: str, tmp_path: Path):
    client.write_tooling("A mill that stands 62 mm out", by_hand.TOOLING)
    campaign = client.make_campaign(shop, declared()).id
    (tmp_path / "c0_cut.h5").write_bytes(content(tmp_path))
    client.upload(campaign, tmp_path / "c0_cut.h5")
    page = opened(f"#/machines/{shop}")
    addresses = ("#/campaigns/new", f"#/change?machine={shop}&tooling=T1", "#/toolings/edit/T1", "#/forces", "#/forces/live?rate=0.25")
    for address in addresses:
        page.goto(f"{served.url}/{address}")
        page.wait_for_selector("h1")
        page.locator("main select:has(option)").first.wait_for(state="attached")
        for width in (390, 1440):
            page.set_viewport_size({"width": width, "height": 860})
            assert page.evaluate(_CLIPPED) == [], (address, width)
    client.forget_tooling("A mill that stands 62 mm out")
    client.forget_campaign(campaign)
