"""The address of a view holds what it shows: whoever gets it sees the same."""

from __future__ import annotations

import re

import pytest
from playwright.sync_api import expect

from api.client import Client
from tests.api.recordings import content, declared


@pytest.fixture(scope="module")
def campaign(client: Client, shop: str, tmp_path_factory) -> str:
    """Two cuts, one of them in the air, too."""
    id = client.make_campaign(shop, declared(2)).id
    folder = tmp_path_factory.mktemp("recordings")
    for name, air in (("c0_cut.h5", False), ("c0_air.h5", True)):
        (folder / name).write_bytes(content(folder, air=air))
        client.upload(id, folder / name)
    return id


def address(page) -> str:
    return page.url[page.url.index("#") :]


@pytest.mark.parametrize("view", ["change", "forces", "forces/live", "recordings", "identification"])
def test_of_which_machine(opened, client: Client, shop: str, result: str, view: str):
    other = client.make_machine(f"Other for {view.replace('/', ' ')}").id
    client.identify(other, result)
    page = opened(f"#/{view}")
    here = page.locator("#machine-here")
    here.select_option(shop)
    expect(page).to_have_url(re.compile(f"machine={shop}"))
    # who picks another one stays with it
    here.select_option(other)
    expect(page).to_have_url(re.compile(f"machine={other}"))
    expect(here).to_have_value(other)
    again = opened(address(page))
    expect(again.locator("#machine-here")).to_have_value(other)
    again.goto(again.url.replace(other, shop))
    expect(again.locator("#machine-here")).to_have_value(shop)
    page.reload()
    expect(here).to_have_value(other)


def test_which_cuts_and_which_recording(opened, campaign: str):
    page = opened(f"#/campaigns/{campaign}")
    page.get_by_role("button", name="Missing").click()
    expect(page.locator("tbody tr")).to_have_count(1)
    page.get_by_role("button", name="All", exact=True).click()
    expect(page).not_to_have_url(re.compile("show="))
    page.locator("tbody tr").first.get_by_role("button").first.click()
    page.get_by_role("button", name="Air", exact=True).click()
    expect(page.get_by_label("Signal of c0_air.h5")).to_have_count(1)
    again = opened(address(page))
    expect(again.get_by_role("button", name="Air", exact=True)).to_have_attribute("aria-pressed", "true")
    expect(again.get_by_label("Signal of c0_air.h5")).to_have_count(1)
    again.get_by_role("button", name="Missing").click()
    again.reload()
    expect(again.get_by_role("button", name="Missing")).to_have_attribute("aria-pressed", "true")
    expect(again.locator("tbody tr")).to_have_count(1)
    # a cut that has no recording opens nothing
    again.goto(again.url.replace("cut=c0", "cut=c1"))
    again.reload()
    expect(again.locator("tbody tr")).to_have_count(1)
    expect(again.locator("main")).not_to_contain_text("Spectrum")
    # a recording with a page of its own is another page for its air cut
    again.goto(f"{again.url.split('#')[0]}#/campaigns/{campaign}/c0_cut.h5")
    again.get_by_role("button", name="Air", exact=True).click()
    expect(again.locator("h1")).to_have_text("c0_air.h5")
    expect(again).to_have_url(re.compile(r"/c0_air\.h5$"))


def test_how_forces_are_asked_for(opened, shop: str, campaign: str):
    page = opened(f"#/forces?machine={shop}")
    page.get_by_label("each sample given the whole record").uncheck()
    page.get_by_label("Observer").first.select_option("paper")
    page.get_by_role("button", name="Show forces").click()
    expect(page).to_have_url(re.compile(f"campaign={campaign}.*smooth=no"))
    again = opened(address(page))
    expect(again.get_by_label("each sample given the whole record")).not_to_be_checked()
    expect(again.get_by_label("Observer").first).to_have_value("paper")
    live = opened(f"#/forces/live?machine={shop}")
    live.get_by_label("Speed of playing").select_option("0.25")
    live.get_by_label("Recording", exact=True).select_option("c0_air.h5")
    live.get_by_role("button", name="Play").click()
    expect(live).to_have_url(re.compile("recording=c0_air.h5.*rate=0.25"))
    live.reload()
    expect(live.get_by_label("Speed of playing")).to_have_value("0.25")
    expect(live.get_by_label("Recording", exact=True)).to_have_value("c0_air.h5")


def test_how_far_back_the_changes_go(opened, client: Client):
    for k in range(51):
        client.make_machine(f"many {k}")
    page = opened("#/changes")
    rows = page.locator("tbody tr")
    expect(rows).to_have_count(50)
    page.get_by_role("button", name="Show earlier ones").click()
    expect(page).to_have_url(re.compile("entries="))
    shown = rows.count()
    assert shown > 50
    again = opened(address(page))
    expect(again.locator("tbody tr")).to_have_count(shown)


_LATE = """async (kept) => {
  const main = document.querySelector('script[type=module]').src;
  const { remember } = await import(main.replace('main.js', 'router.js'));
  if (kept) return remember('robots', { robot: 'kr500' });
  location.hash = '#/changes';
  remember('robots', { robot: 'tx200' });
}"""


def test_an_answer_that_comes_late_leaves_the_next_address_alone(opened):
    """Between the click that leaves a view and the next view, and after it; while the view is there it writes its own."""
    page = opened("#/robots")
    page.evaluate(_LATE, True)
    assert address(page) == "#/robots?robot=kr500"
    page.evaluate(_LATE, False)
    expect(page.locator("h1")).to_have_text("Changes")
    assert address(page) == "#/changes"
    page.evaluate(_LATE, True)
    assert address(page) == "#/changes"
