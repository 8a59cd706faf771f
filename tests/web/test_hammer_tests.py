"""A campaign of hammer tests in the page: dropped, taken in, looked at, and offered to be identified from."""

from __future__ import annotations

from playwright.sync_api import expect

from tests.fixtures.hit import write_hit
from tests.web.conftest import drop


def test_hammer_tests_are_dropped_and_taken_in(opened, tmp_path):
    folder = write_hit(tmp_path)
    # a name that no recording has: the campaign alone says that it is one of its files
    setup = folder / "campaign.toml"
    setup.write_text(setup.read_text().replace("S1-ER32-tip.csv", "S1-ER32-tip.frf"))
    (folder / "S1-ER32-tip.csv").rename(folder / "S1-ER32-tip.frf")
    (folder / "notes.txt").write_text("nothing")
    page = opened()
    drop(page, "section.drop", sorted(folder.iterdir()))
    found = page.locator(".card", has_text="This is what was found")
    expect(found).to_contain_text("Recordings and FRFs")
    expect(found).to_contain_text("1 other files")
    if page.get_by_label("Machine", exact=True).last.is_visible():
        page.get_by_label("Machine", exact=True).last.select_option(label="A new machine")
    page.get_by_label("Its name").fill("Hit")
    page.get_by_role("button", name="Take it in", exact=True).click()

    expect(page.locator("h1")).to_have_text("hit")
    expect(page.get_by_text("4 hammer tests, S1-ER32, S2-PG25")).to_be_visible()
    rows = page.get_by_role("table", name="Hammer tests").locator("tbody tr")
    expect(rows).to_have_count(4)
    expect(page.locator("tbody .mark.good")).to_have_count(4, timeout=60_000)
    expect(rows.nth(1)).to_contain_text("mm from the tip")
    expect(page.get_by_text("Verdicts", exact=True)).to_be_hidden()
    expect(page.get_by_text("from 4 hammer tests")).to_be_visible()
    page.get_by_role("link", name="Recordings").first.click()
    expect(page.get_by_role("table", name="Campaigns")).to_contain_text("complete")
