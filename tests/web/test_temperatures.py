"""A machine that warms up, on the page: what was learned beside its modes, and the state beside tip and limits."""

from __future__ import annotations

import pytest

from api.client import Client
from tests.fixtures import by_hand

pytest.importorskip("playwright")
from playwright.sync_api import expect


def test_what_was_learned_and_the_state_stand_beside_the_numbers(opened, client: Client, tmp_path):
    id = client.make_machine("Warms up").id
    client.identify(id, by_hand.warming_text(tmp_path))
    client.write_tooling("T1", by_hand.TOOLING)
    card = opened(f"#/machines/{id}").locator(".card", has_text="Learned beyond the modes")
    for words in by_hand.CHANGES.words:
        expect(card).to_contain_text(words)
    page = opened(f"#/change?machine={id}&tooling=T1&from=8000&to=10000&step=500&deep=2")
    expect(page.locator(".best")).to_contain_text("For: warm machine.", timeout=60_000)
    expect(page.locator(".card", has_text="Tooltip FRF").first).to_contain_text("For: warm machine, 9549 rev/min.")
    asked = page.get_by_label("Temperature near the bearings")
    expect(asked).to_have_attribute("placeholder", "38.0\xa0°C: warm")
    asked.fill("25")
    expect(page.locator(".best")).to_contain_text("For: at 25 °C.", timeout=60_000)
    expect(page.locator(".card", has_text="Tooltip FRF").first).to_contain_text("For: at 25 °C, 9549 rev/min.")
    assert "temp=25" in page.url
    asked.fill("500")
    expect(page.locator(".fault:visible")).to_contain_text("120.0\xa0°C")


def test_a_machine_of_one_state_says_none(opened, shop: str):
    page = opened(f"#/machines/{shop}")
    expect(page.locator(".card", has_text="Joint").first).to_be_visible()
    expect(page.get_by_text("Learned beyond the modes")).to_have_count(0)
    page = opened(f"#/change?machine={shop}&tooling=T1&from=8000&to=10000&step=500&deep=2")
    expect(page.locator(".best")).to_be_visible(timeout=60_000)
    expect(page.get_by_text("For: warm")).to_have_count(0)
    expect(page.get_by_label("Temperature near the bearings")).to_have_count(0)
