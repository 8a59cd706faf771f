"""The path of the example with a watch, and the documentation's pictures: ``python -m tests.web.example_path docs/page``.

Prints the seconds from the first click to each view that follows, on a service with one process for each kind of work, and writes
pictures of it, of a robot and of a tip.
"""

from __future__ import annotations

import re
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from playwright.sync_api import Browser, Page, expect, sync_playwright

from api.client import Client
from tests.fixtures.paths import ROOT
from tests.fixtures.pictures import lighten
from tests.fixtures.service import serving
from tests.web.conftest import CHROMIUM, QUIET, drop
from tests.web.shots import settled

#: As long as anything may take, the identification on a slow machine [ms].
_LONG = 600_000
#: FRFs of the tutorial's tip.
TIP = ROOT / "docs" / "tutorial" / "files"


def walked(page: Page) -> str:
    """Click from an empty page to a best speed, print when each view stood, and return the identification's address."""
    clicks, begin = 0, time.perf_counter()

    def click(what: str, name: str) -> None:
        nonlocal clicks
        clicks += 1
        page.get_by_role(what, name=name).first.click(timeout=_LONG)

    def said(words: str) -> None:
        print(f"{time.perf_counter() - begin:6.1f} s, {clicks} clicks: {words}", flush=True)

    click("button", "Try it with an example")
    expect(page.get_by_role("button", name="Identify the machine")).to_have_class("primary", timeout=_LONG)
    said("24 recordings are simulated, uploaded and judged")
    click("button", "Identify the machine")
    expect(page.get_by_role("link", name="Change the tool")).to_be_visible(timeout=_LONG)
    said("the machine is identified")
    identification = page.url
    click("link", "Change the tool")
    expect(page.locator(".best .figure output")).to_be_visible(timeout=_LONG)
    said("the best speed of a tooling that never cut")
    return identification


def pictured(browser: Browser, page: Page, client: Client, identification: str, folder: Path) -> None:
    """Take the pictures; the page stands at the best speed."""
    address = page.url
    settled(page)
    page.screenshot(path=folder / "tool_change.png")
    page.goto(identification)
    settled(page)
    page.screenshot(path=folder / "identification.png")
    (machine,) = (each for each in client.machines() if each.example)
    (campaign,) = client.campaigns(machine.id)
    page.goto(re.sub("#.*", f"#/campaigns/{campaign.id}", address))
    settled(page)
    page.screenshot(path=folder / "verdicts.png")
    phone = browser.new_page(viewport={"width": 390, "height": 844}, reduced_motion="reduce")
    phone.goto(address)
    phone.wait_for_selector(".best[data-rpm]", timeout=_LONG)
    settled(phone)
    phone.screenshot(path=folder / "phone.png")
    page.set_viewport_size({"width": 1280, "height": 1130})
    page.goto(f"{address.split('#')[0]}#/robots?robot=tx200&tooling=Example S3-PG25-long")
    settled(page)
    page.screenshot(path=folder / "robot.png")
    page.set_viewport_size({"width": 1280, "height": 1400})
    page.goto(f"{address.split('#')[0]}#/tip")
    drop(page, "h1", [TIP / f"tip_{axis}.frf" for axis in "xy"])
    for axis in "xy":
        page.get_by_label(f"Direction of tip_{axis}.frf").select_option(axis.upper())
    for label, value in (("Teeth", "4"), ("Diameter", "10"), ("Helix", "40"), ("Lowest line", "100")):
        page.get_by_label(label, exact=True).fill(value)
    page.get_by_label("Material", exact=True).select_option("EN AW-6082")
    page.wait_for_selector(".best[data-rpm]", timeout=_LONG)
    settled(page)
    page.screenshot(path=folder / "tip.png")
    for path in (folder / f"{name}.png" for name in ("tool_change", "identification", "verdicts", "phone", "robot", "tip")):
        lighten(path)


def main(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as data, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, headless=True, args=list(QUIET))
        with serving(Path(data) / "store", RCSA_IDENT_JOB_WORKERS="1", RCSA_IDENT_LOBE_WORKERS="1") as served, Client(served.url) as client:
            page = browser.new_page(viewport={"width": 1440, "height": 1130}, reduced_motion="reduce")
            page.goto(served.url)
            settled(page)
            pictured(browser, page, client, walked(page), folder)
        browser.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
