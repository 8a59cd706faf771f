"""What a tool change asks and shows beyond a person's first path: materials, process damping, cuts that were tried."""

from __future__ import annotations

from pathlib import Path

import pytest

from api.client import Client
from tests.fixtures import by_hand
from tests.web.conftest import ROOT

pytest.importorskip("playwright")
from playwright.sync_api import Page, expect


def chosen(page: Page, file: Path) -> None:
    """Tested cuts, from a file."""
    with page.expect_file_chooser() as asked:
        page.get_by_role("button", name="Tested cuts").click()
    asked.value.set_files(file)


def test_a_material_of_the_library(opened, client: Client, shop: str):
    """Its numbers and source stand there; the limits are the service's of that material; the address keeps it."""
    page = opened(f"#/change?machine={shop}&tooling=T1")
    best = page.locator(".best")
    expect(best).to_be_visible(timeout=30_000)
    before = best.inner_text()
    page.get_by_text("Material, spindle, method").click()
    steel = next(each for each in client.materials() if each.name.startswith("Steel"))
    page.get_by_label("Material", exact=True).select_option(label=steel.name)
    expect(page.locator(".change-form")).to_contain_text(steel.source)
    expect(page.locator(".change-form")).to_contain_text(steel.condition)
    expect(best).not_to_have_text(before)
    cut = {"immersion": 0.5, "strategy": "down", "feed_direction": "+X", "feed_per_tooth_mm": 0.1, "material": steel.name}
    advice = client.advice(shop, "T1", cut=cut).toolings[0].highest_removal[0]
    expect(best).to_have_attribute("data-rpm", f"{advice.spindle_speed_rpm:g}")
    expect(best).to_contain_text(f"{advice.axial_depth_mm:.2f}")
    again = opened(page.url[page.url.index("#") :])
    expect(again.get_by_label("Material", exact=True)).to_have_value(steel.name)
    expect(again.locator(".best")).to_have_attribute("data-rpm", f"{advice.spindle_speed_rpm:g}", timeout=30_000)


def test_a_shape_is_asked_what_stands_around_it(opened, client: Client, shop: str):
    """A block's two sides in place of immersion and strategy; a wall is not asked, and the tool card says the same."""
    page = opened(f"#/change?machine={shop}&tooling=T1")
    expect(page.locator(".best")).to_be_visible(timeout=30_000)
    expect(page.get_by_label("Stock beside the path")).to_be_hidden()
    client.write_tooling("BALL", by_hand.TOOLING.replace("\ndiameter_mm = 12.0", '\nshape = "ball"\ndiameter_mm = 12.0'))
    page = opened(f"#/change?machine={shop}&tooling=BALL&from=8000&to=10000&step=1000&deep=2&kac=0.2")
    expect(page.locator(".best")).to_be_visible(timeout=60_000)
    page.get_by_label("Stock beside the path").select_option("block")
    expect(page.get_by_label("Radial immersion")).to_be_hidden()
    expect(page.locator('[data-field="cut.y_from_mm"] .fault')).to_contain_text("A number is needed")
    page.get_by_label("Block from").fill("-6")
    page.get_by_label("Block to").fill("-2")
    cut = {"stock": "block", "y_from_mm": -6.0, "y_to_mm": -2.0, "feed_direction": "+X", "feed_per_tooth_mm": 0.1, "kac": 0.2}
    speeds = {"from_rpm": 8000, "to_rpm": 10000, "step_rpm": 1000}
    advice = client.advice(shop, "BALL", cut=cut, speeds=speeds, max_depth_mm=2).toolings[0].highest_removal[0]
    expect(page.locator(".best")).to_have_attribute("data-rpm", f"{advice.spindle_speed_rpm:g}", timeout=60_000)
    expect(page.locator(".best")).to_contain_text(f"{advice.axial_depth_mm:.2f}")
    assert "stock=block" in page.url
    card = opened(page.url[page.url.index("#") :].replace("#/change", "#/card"))
    expect(card.locator("body")).to_contain_text("a block from", timeout=60_000)


def test_process_damping_needs_both_its_numbers(opened, shop: str):
    page = opened(f"#/change?machine={shop}&tooling=T1&land=80")
    fault = page.locator('[data-field="cut.indentation"] .fault')
    expect(fault).to_contain_text("wear_land_um and indentation", timeout=30_000)
    page.get_by_label("Indentation").fill("1e14")
    expect(page.locator(".best")).to_be_visible(timeout=30_000)
    expect(fault).to_be_hidden()
    # the zero-order method says itself that it leaves process damping out
    expect(page.locator(".change-results .note.doubt")).to_contain_text("process damping")
    page.get_by_role("button", name="inch").click()
    expect(page.get_by_label("Indentation")).to_have_value(f"{1e14 / 4.4482216152605 * 0.0254**3:.6e}".replace("e+0", "e"))


def test_tested_cuts_stand_beside_the_limit(opened, client: Client, shop: str, tmp_path: Path):
    """As a German spreadsheet writes them, and as the example does; right or not as the service counts."""
    page = opened(f"#/change?machine={shop}&tooling=T1&tooling=T1-long")
    expect(page.locator(".chart.lobes .main-svg").first).to_be_visible(timeout=30_000)
    file = tmp_path / "Schnitte.csv"
    lines = ("spindle_speed_rpm;note;axial_depth_mm;verdict", '"8000";"a";"0,05";"stable"', "", "9000;b;30;Chatter", "9000;c;0,05;chatter")
    file.write_text("\ufeff" + "\n".join(lines), "utf-8")
    chosen(page, file)
    told = page.locator(".tested-cuts .reads li")
    expect(told).to_have_text(
        [f"{name}: 2 of 3 classified correctly (67 %), 1 chattered where none was expected" for name in ("T1", "T1-long")]
        + ["the column note is left aside"]
    )
    expect(page.locator(".tested-cuts .legend li")).to_have_text(["○stable", "✕chatter"])
    # the deepest cut is in the picture
    assert page.evaluate("document.querySelector('.chart.lobes .plot').layout.yaxis.range[1]") > 30.0
    chosen(page, ROOT / "api" / "examples" / "CUTS.csv")
    expect(page.locator(".tested-cuts .legend li")).to_have_text(["○stable", "✕chatter", "△marginal"])
    expect(told.first).to_contain_text("1 marginal")
    page.get_by_role("button", name="Take them away").click()
    expect(page.locator(".tested-cuts")).to_have_count(0)
    expect(page.locator(".chart.lobes .main-svg").first).to_be_visible()


def test_wrong_tested_cuts_are_refused_in_words(opened, shop: str, tmp_path: Path):
    page = opened(f"#/change?machine={shop}&tooling=T1")
    expect(page.locator(".chart.lobes .main-svg").first).to_be_visible(timeout=30_000)
    head = "spindle_speed_rpm,axial_depth_mm,verdict\n"
    for text, words in (
        ("", "found 0 lines, allowed is a line of column names"),
        ("a,b\n1,2\n", "columns spindle_speed_rpm, axial_depth_mm, verdict"),
        (head, "found 1 lines, allowed is a line of column names"),
        (head + "8000,1,loud\n", "line 2, column verdict: found loud, allowed is one of stable, chatter, marginal"),
        (head + "\n8000,-1,stable\n", "line 3, column axial_depth_mm: found -1, allowed is a finite number above 0 [mm]"),
        (head + "133,1,stable\n5,1,stable\n", "cuts[1].spindle_speed_rpm: found 5, allowed is greater than or equal to 10"),
        (head + "8000,1,stable\n" * 1001, "cuts: found 1001 of them, allowed is at most 1000"),
        (head + "8000\n", "line 2, tested cuts: found 1 cells, allowed is 3 cells as in the header"),
    ):
        file = tmp_path / "CUTS.csv"
        file.write_text(text, "utf-8")
        chosen(page, file)
        expect(page.locator(".note.bad")).to_contain_text(words)
        expect(page.locator(".best")).to_be_visible()
