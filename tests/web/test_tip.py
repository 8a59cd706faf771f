"""A tip that was tapped: its hits or FRFs become lobes and a recommended cut, without any machine."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from api.client import Client
from tests.api.test_listening import text_of_hits
from tests.api.test_tips import ALONG, CUTTER, columns
from tests.fixtures import by_hand
from tests.fixtures.service import Served
from tests.web.conftest import drop
from tests.web.test_accessibility import faults

pytest.importorskip("playwright")
from playwright.sync_api import Page, expect

MATERIAL = "EN AW-6082"


@pytest.fixture
def measured(tmp_path: Path) -> list[Path]:
    """An FRF along each axis, as text columns that name none."""
    for axis, values in ALONG.items():
        (tmp_path / f"tip_{axis}.frf").write_text(columns(values))
    return [tmp_path / f"tip_{axis}.frf" for axis in ALONG]


def told(page: Page, measured: list[Path]) -> None:
    """Drop the FRFs, and say their directions, the cutter and the material."""
    drop(page, "h1", measured)
    for axis, path in zip(ALONG, measured, strict=True):
        page.get_by_label(f"Direction of {path.name}").select_option(axis)
    expect(page.get_by_text("The lobes appear here once cutter and material are told.")).to_be_visible()
    page.get_by_label("Teeth", exact=True).fill(str(CUTTER["teeth"]))
    page.get_by_label("Diameter", exact=True).fill(f"{CUTTER['diameter_mm']:g}")
    page.get_by_label("Helix", exact=True).fill(f"{CUTTER['helix_deg']:g}")
    page.get_by_label("Material", exact=True).select_option(MATERIAL)


def test_frfs_become_a_recommended_cut(opened, client: Client, measured: list[Path]):
    page = opened("#/tip")
    told(page, measured)
    best = page.locator(".best[data-rpm]")
    expect(best).to_be_visible(timeout=60_000)
    tip = {"frf": [{"text": columns(values), "axes": axis} for axis, values in ALONG.items()], "cutter": CUTTER}
    cut = {"immersion": 0.5, "feed_per_tooth_mm": 0.1, "material": MATERIAL}
    expected = client.advice(tip, cut=cut).toolings[0].highest_removal[0]
    assert best.get_attribute("data-rpm") == f"{expected.spindle_speed_rpm:g}"
    expect(best).to_contain_text(f"{expected.axial_depth_mm:.2f} mm")
    # a cutter of its own has no drawing and no card
    expect(best.get_by_role("link")).to_have_count(0)
    with page.expect_download() as got:
        page.get_by_role("button", name="FRF.csv").click()
    assert Path(got.value.path()).read_text(encoding="utf-8") == client.tooltip_file(tip)
    # the cutter stands in the address, the FRFs in the tab
    assert re.search(r"teeth=2&dia=16&helix=30", page.url)
    page.reload()
    expect(best).to_be_visible(timeout=60_000)
    assert best.get_attribute("data-rpm") == f"{expected.spindle_speed_rpm:g}"
    for name in ("tip_X.frf", "tip_Y.frf"):
        page.get_by_role("button", name=f"Remove {name}").click()
    expect(page.get_by_text("No FRF yet.")).to_be_visible()


def test_hits_become_lobes_of_the_tooling_that_was_hit(opened, client: Client, tmp_path: Path):
    client.write_tooling("Tapped", by_hand.TOOLING)
    (tmp_path / "hits.csv").write_bytes(text_of_hits())
    page = opened("#/tap")
    for axis in "XY":
        page.get_by_label("Direction", exact=True).select_option(axis)
        drop(page, "h1", [tmp_path / "hits.csv"])
        page.get_by_role("button", name="Lobes of this tip").wait_for(timeout=60_000)
        # what was shown is handed on, whatever the form says by now
        page.get_by_label("Direction", exact=True).select_option("Y")
        page.get_by_role("button", name="Lobes of this tip").click()
        expect(page.get_by_text(f"2 hits along {axis}")).to_be_visible()
        page.go_back()
        expect(page.locator("h1")).to_have_text("Hammer hits")
    page.get_by_role("link", name="Lobes of a tip").click()
    page.get_by_label("Cutter", exact=True).select_option("Tapped")
    expect(page.get_by_label("Teeth", exact=True)).to_be_hidden()
    page.get_by_label("Material", exact=True).select_option(MATERIAL)
    # an accelerometer's drift is warned of, and left out
    expect(page.get_by_text("accelerometer's drift")).to_have_count(2, timeout=60_000)
    page.get_by_label("Lowest line", exact=True).fill("100")
    expect(page.get_by_text("accelerometer's drift")).to_have_count(0, timeout=60_000)
    best = page.locator(".best[data-rpm]")
    expect(best).to_be_visible(timeout=60_000)
    expect(best.locator("h2")).to_contain_text("Tapped")
    client.forget_tooling("Tapped")


def test_a_conjugated_frf_is_said_and_its_correction_is_chosen(opened, measured: list[Path]):
    measured[0].write_text(columns(ALONG["X"].conj()))
    page = opened("#/tip")
    told(page, measured)
    said = page.get_by_text("FRF X: Im > 0 at 900 Hz").first
    expect(said).to_contain_text("the FRF was turned (correction conjugate)", timeout=60_000)
    page.get_by_label("Correction of tip_X.frf").select_option("none")
    expect(said).to_contain_text("would explain it", timeout=60_000)
    page.get_by_label("Correction of tip_X.frf").select_option("conjugate")
    expect(said).to_have_count(0, timeout=60_000)


def test_what_is_wrong_with_an_frf_is_told(opened, tmp_path: Path, measured: list[Path]):
    page = opened("#/tip")
    told(page, measured)
    expect(page.locator(".best[data-rpm]")).to_be_visible(timeout=60_000)
    page.get_by_label("Direction of tip_Y.frf").select_option("X")
    expect(page.locator(".standing.bad")).to_contain_text("each FRF once", timeout=60_000)
    (tmp_path / "long.frf").write_text("9" * 1_000_000)
    drop(page, "h1", [tmp_path / "long.frf"])
    expect(page.locator(".note.bad").first).to_contain_text("kB together; the service takes 950")
    expect(page.get_by_role("table", name="FRFs of the tip").get_by_role("row")).to_have_count(3)


def test_everybody_can_use_it(opened, served: Served, measured: list[Path]):
    """Empty, and with an answer: nothing that axe-core finds."""
    page = opened("#/tip")
    found = {"empty": faults(page)}
    told(page, measured)
    expect(page.locator(".best[data-rpm]")).to_be_visible(timeout=60_000)
    expect(page.locator("main .chart .main-svg").last).to_be_visible()
    # scrolled, the bar on top would hide a part of what is to be touched
    page.evaluate("scrollTo(0, 0)")
    assert found | {"answered": faults(page)} == {"empty": {}, "answered": {}}
