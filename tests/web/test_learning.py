"""A campaign of a tooling that is new to its machine: what its cuts teach is looked at, then taken over."""

from __future__ import annotations

import pytest
from playwright.sync_api import expect

from api.client import Client
from tests.fixtures import further_cuts
from tests.fixtures.service import Served
from tests.web.test_accessibility import faults


def uploaded(client: Client, machine: str) -> str:
    keys = further_cuts.campaign()
    campaign = client.make_campaign(machine, keys).id
    for file in further_cuts.files(keys):
        client.upload(campaign, file)
    return campaign


@pytest.fixture
def machine(client: Client) -> str:
    """An identified one; the library has its new tooling as it is drawn."""
    id = client.make_machine("Learns").id
    client.identify(id, further_cuts.result_text())
    client.write_tooling("T7", further_cuts.drawn())
    yield id
    client.forget_machine(id)


@pytest.mark.slow
def test_new_cuts_teach_the_tooling_and_the_machine(opened, served: Served, client: Client, machine: str):
    campaign = uploaded(client, machine)
    page = opened(f"#/campaigns/{campaign}")
    card = page.locator(".card").filter(has=page.get_by_role("heading", name="These cuts teach T7"))
    card.get_by_role("button", name="See what they teach").click()
    row = card.get_by_role("row").filter(has_text="translational stiffness")
    expect(row).to_be_visible(timeout=60_000)
    expect(card.locator(".mark")).to_have_text("converged")
    assert client.tooling("T7").tooling.contact.translational_stiffness == pytest.approx(
        further_cuts.drawn()["contact"]["translational_stiffness"]
    )
    found = faults(page)
    assert found == {}
    page.set_viewport_size({"width": 390, "height": 844})
    assert page.evaluate("document.documentElement.scrollWidth") == 390
    card.get_by_label("the machine learns, too").check()
    card.get_by_role("button", name="Take over").click()
    expect(card.locator(".note.good")).to_contain_text("Written: T7, the machine.", timeout=60_000)
    assert client.machine(machine).identification.taught_by == [f"new tool ({campaign})"]
    assert client.tooling("T7").tooling.contact.translational_stiffness > 1.1 * further_cuts.drawn()["contact"]["translational_stiffness"]
    # it teaches once
    page.reload()
    page.get_by_role("button", name="Identify the machine").wait_for()
    expect(page.get_by_role("heading", name="These cuts teach T7")).to_have_count(0)


@pytest.mark.slow
def test_a_changed_library_is_not_written_over(opened, served: Served, client: Client, machine: str):
    campaign = uploaded(client, machine)
    page = opened(f"#/campaigns/{campaign}")
    page.get_by_role("button", name="See what they teach").click()
    button = page.get_by_role("button", name="Take over")
    expect(button).to_be_visible(timeout=60_000)
    other = client.write_tooling("T7", further_cuts.drawn() | {"cutter": {"teeth": 3, "diameter_mm": 12.0}})
    button.click()
    expect(page.locator(".note.bad")).to_contain_text("T7 of the library is not the one that the campaign was made with", timeout=60_000)
    assert client.tooling("T7").etag == other.etag
