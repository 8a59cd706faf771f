"""A path on the page: dropped with its stock, cut as a job, the part looked at in colours and along the path."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from api.client import Client
from tests.api.test_paths import PROGRAM
from tests.web.conftest import drop, fault_beside
from tests.web.test_accessibility import faults

pytest.importorskip("playwright")
from playwright.sync_api import Page, expect


def plain(text: str) -> str:
    return text.replace("\u202f", "").replace("\u00a0", " ").replace("−", "-")


@pytest.fixture
def program(tmp_path: Path) -> Path:
    file = tmp_path / "PART.nc"
    file.write_text(PROGRAM)
    return file


@pytest.fixture
def page(opened, shop: str, client: Client, program: Path) -> Page:
    """With a path dropped, and everything told that a quick answer needs."""
    material = client.materials()[0].name
    found = opened(f"#/paths?on=machine+{shop}&tooling=T1&material={material.replace(' ', '+')}&method=zero-order&cell=0.5&step=2")
    drop(found, "h1", [program])
    expect(found.get_by_text("PART.nc")).to_be_visible()
    return found


def fact(page: Page, name: str) -> str:
    return plain(page.locator(".part-card .facts > div", has=page.get_by_text(name, exact=True)).locator("dd").inner_text())


def block(page: Page, low: str, high: str) -> None:
    page.get_by_label("Lower corner: x y z").fill(low)
    page.get_by_label("Upper corner: x y z").fill(high)


def cut(page: Page) -> None:
    page.get_by_role("button", name="Cut along the path").click()


def test_a_part_is_cut_looked_at_and_followed_along_the_path(page: Page, client: Client):
    assert "7 places, 172 mm, 100 mm at a feed, 6.3 s at its feeds." in plain(page.locator(".path-form").inner_text())
    # a first guess of the stock is where the tool goes
    expect(page.get_by_label("Lower corner: x y z")).to_have_value("-10 10 -8")
    block(page, "0 0 -8", "30 24 0")
    cut(page)
    part = page.locator("canvas.part")
    expect(part).to_be_visible(timeout=120_000)
    id = page.url.partition("job=")[2].partition("&")[0]
    answer = client.path_job(id).answer
    expect(page.get_by_role("region", name="In short")).to_contain_text(answer.sentences[0])
    margins = np.array(answer.columns["margin_low"], dtype=float)
    worst = int(np.argmin(margins))
    # the tool stands where it is worst
    assert fact(page, "Line of the program") == f"{answer.columns['line'][worst]:.0f}"
    assert fact(page, "x") == f"{answer.columns['x_mm'][worst]:.2f} mm"
    assert fact(page, "Force") == f"{answer.columns['peak_force_n'][worst]:.1f} N"
    assert fact(page, "Margin to chatter").startswith(f"{answer.columns['margin'][worst]:.2f}")
    # the last place is beyond the stock
    slide = page.get_by_label("Along the path")
    slide.fill(str(answer.path.way_mm[-1]))
    assert (fact(page, "x"), fact(page, "y"), fact(page, "Here")) == ("40.00 mm", "17.00 mm", "nothing is cut")
    slide.press("ArrowLeft")
    assert str(slide.get_attribute("aria-valuetext")).endswith("line 8")
    # lines of the program, the worst first
    rows = page.get_by_role("region", name="Lines nearest to chatter").locator("tbody tr")
    lines = [int(each) for each in rows.locator("th").all_inner_texts()]
    assert sorted(lines) == [4, 8]
    page.get_by_role("button", name=f"Show where line {lines[1]} is worst").click()
    assert fact(page, "Line of the program") == str(lines[1])
    # in other colours
    before = part.screenshot()
    page.get_by_role("button", name="Force", exact=True).click()
    expect(page.locator(".scale")).to_contain_text("across the tool's axis")
    page.wait_for_timeout(300)
    assert part.screenshot() != before
    with page.expect_download() as saved:
        page.get_by_role("button", name="STABILITY.csv").click()
    assert Path(saved.value.path()).read_text(encoding="utf-8") == client.path_table(id)
    # turned
    expect(part).to_have_attribute("data-view", "-58 22")
    part.focus()
    part.press("ArrowLeft")
    expect(part).to_have_attribute("data-view", "-48 22")
    page.get_by_role("button", name="From above").click()
    expect(part).to_have_attribute("data-view", "-90 90")
    page.get_by_role("button", name="inch").click()
    assert fact(page, "x").endswith(" in")
    page.get_by_role("button", name="mm", exact=True).click()
    # whoever gets the address sees the same; everybody can use it, and nothing sticks out on a phone
    page.reload()
    expect(part).to_be_visible(timeout=60_000)
    found = faults(page)
    assert found == {}
    page.set_viewport_size({"width": 390, "height": 844})
    assert page.evaluate("document.documentElement.scrollWidth") == 390


def test_what_is_wrong_is_said_beside_its_field_and_a_job_is_cancelled(page: Page, tmp_path: Path):
    block(page, "0 0 0", "30 24 -8")
    cut(page)
    assert "lower corner first" in fault_beside(page, "block_mm")
    (tmp_path / "BROKEN.nc").write_text("G21\nG41 X10\n")
    drop(page, "h1", [tmp_path / "BROKEN.nc"])
    assert "line 2" in fault_beside(page, "path")
    block(page, "0 0 -8", "30 24 0")
    page.get_by_text("How fine, and by which method").click()
    page.get_by_label("What is asked").select_option("removal")
    expect(page.get_by_label("Machine or robot")).to_be_hidden()
    page.get_by_label("Between places").fill("0.001")
    page.get_by_label("Between lines of material").fill("0.2")
    cut(page)
    page.get_by_role("button", name="Cancel").click()
    expect(page.get_by_role("region", name="State")).to_contain_text("The job is cancelled.", timeout=60_000)
