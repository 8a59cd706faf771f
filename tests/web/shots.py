"""Pictures of every view and of what views come to, light and dark, wide and on a phone: ``python -m tests.web.shots FOLDER [NAME …]``.

To be looked at. Names are those of `views` and of `states`.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from playwright.sync_api import Browser, Page, sync_playwright
from scipy.io import wavfile

from api.client import Client
from tests.api.test_listening import samples, text_of_hits
from tests.fixtures import by_hand
from tests.fixtures.service import serving
from tests.fixtures.waiting import until
from tests.web.conftest import CHROMIUM, QUIET, drop
from tests.web.test_changes import dropped

SIZES = {"wide": {"width": 1440, "height": 900}, "phone": {"width": 390, "height": 844}}
SCHEMES = ("light", "dark")


def example_job(client: Client) -> tuple[str, str, str]:
    """Have the example made and identified, and return the ids of machine, campaign and job."""
    made = client.make_example()
    until(lambda: all(cut.verdict and cut.air and cut.air.uploaded for cut in client.campaign(made.campaign).cuts))
    return made.machine, made.campaign, client.wait(client.identify_campaign(made.campaign).id).id


def views(machine: str, campaign: str, job: str) -> dict[str, str]:
    """Return the addresses of all views, by names for files."""
    recording = "S1-ER32-03_cut.h5"
    return {
        "machines": "#/",
        "machine": f"#/machines/{machine}",
        "recordings": "#/recordings",
        "campaign": f"#/campaigns/{campaign}",
        "recording": f"#/campaigns/{campaign}/{recording}",
        "by_hand": "#/campaigns/new",
        "identifications": "#/identification",
        "identification": f"#/identifications/{job}",
        "toolings": "#/toolings",
        "tooling": "#/toolings/edit/Example S3-PG25-long",
        "ring": "#/toolings/ring/Example S3-PG25-long",
        "new_tooling": "#/toolings/new",
        "changes": "#/changes",
        "change": f"#/change?machine={machine}&tooling=Example S4-shrink",
        "compare": f"#/change?machine={machine}&tooling=Example S3-PG25-long&tooling=Example S4-shrink",
        "tool_card": f"#/card?machine={machine}&tooling=Example S4-shrink",
        "forces": f"#/forces?machine={machine}",
        "live": "#/forces/live",
        "listen": "#/listen",
        "tap": "#/tap",
        "tip": "#/tip",
        "paths": "#/paths?ask=removal&tooling=Example S3-PG25-long",
        "robots": "#/robots?robot=tx200&tooling=Example S3-PG25-long",
    }


def states(known: dict[str, str], folder: Path) -> dict[str, tuple[str, Callable[[Page], None]]]:
    """Return what somebody does in a view, by names for files: its address, and how what is shown comes about."""
    sound, hits = folder / "cut.wav", folder / "hits.csv"
    wavfile.write(sound, 22050, samples().astype(np.float32))
    hits.write_bytes(text_of_hits())

    def heard(page: Page) -> None:
        drop(page, "h1", [sound])
        page.wait_for_selector(".heard")

    def tapped(page: Page) -> None:
        drop(page, "h1", [hits])
        page.wait_for_selector("main .chart .main-svg")

    def forces_shown(page: Page) -> None:
        page.get_by_role("button", name="Show forces").first.click()
        page.wait_for_selector("main .chart .main-svg")

    def holder_taken(page: Page) -> None:
        page.get_by_text("Take one from the catalogue").click()
        page.get_by_role("button", name="Take this holder").click()
        page.wait_for_selector("details .note")

    def shaped(page: Page) -> None:
        page.get_by_label("Shape", exact=True).select_option("face")
        for label, value in (("Cutting edge angle", "45"), ("Edge height", "4"), ("Corner radius", "0.8")):
            page.get_by_label(label, exact=True).fill(value)
        page.get_by_text("Waves along the edges").click()
        page.wait_for_timeout(800)

    def shape_lacking(page: Page) -> None:
        page.get_by_label("Shape", exact=True).select_option("taper-barrel")
        page.wait_for_timeout(500)

    def shape_refused(page: Page) -> None:
        page.get_by_label("Shape", exact=True).select_option("bull-nose")
        page.get_by_label("Corner radius", exact=True).fill("7")
        page.get_by_text("Waves along the edges").click()
        page.get_by_label("Wave amplitude", exact=True).fill("0.2")
        page.wait_for_timeout(800)

    def own_outline(page: Page) -> None:
        page.get_by_label("Shape", exact=True).select_option("profile")
        page.get_by_label("Points of the outline [mm]", exact=True).fill("0 0, 3 0, 6 3 3, 6 20")
        page.wait_for_timeout(800)

    def edits_left(page: Page) -> None:
        page.get_by_label("Teeth", exact=True).fill("7")
        page.locator("nav").get_by_role("link", name="Toolings", exact=True).first.click()
        page.wait_for_selector("dialog[open]")

    def intake(page: Page) -> None:
        dropped(page, folder, "S9-shop")

    def exact(page: Page) -> None:
        page.get_by_text("Material, spindle, method").click()
        page.get_by_label("Method", exact=True).select_option("full-discretisation")
        page.wait_for_timeout(1500)

    return {
        "heard": (known["listen"], heard),
        "tapped": (known["tap"], tapped),
        "forces_shown": (known["forces"], forces_shown),
        "holder_taken": (known["new_tooling"], holder_taken),
        "shaped": (known["new_tooling"], shaped),
        "shape_lacking": (known["new_tooling"], shape_lacking),
        "shape_refused": (known["new_tooling"], shape_refused),
        "own_outline": (known["new_tooling"], own_outline),
        "edits_left": (known["tooling"], edits_left),
        "intake": (known["machines"], intake),
        "exact": (known["change"], exact),
        "identifying": (known["identifications"], lambda page: page.wait_for_timeout(500)),
    }


def settled(page: Page) -> None:
    """Wait until a view shows what it will show."""
    page.wait_for_selector("h1, main .note")
    # asked from here: the page's policy lets nobody evaluate again and again inside it
    until(lambda: not page.locator("main .waiting, main [aria-busy=true]").count())
    page.wait_for_timeout(300)


def pages(browser: Browser, url: str) -> Iterator[tuple[str, Page]]:
    """Yield a page for each size and scheme, with a name for it."""
    for size, viewport in SIZES.items():
        for scheme in SCHEMES:
            context = browser.new_context(viewport=viewport, color_scheme=scheme, reduced_motion="reduce", device_scale_factor=1)
            page = context.new_page()
            page.goto(url)
            yield f"{size}-{scheme}", page
            context.close()


def main(folder: Path, *chosen: str) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as data, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, headless=True, args=list(QUIET))
        with serving(Path(data) / "store", RCSA_IDENT_JOB_WORKERS="1") as served, Client(served.url) as client:
            for name, page in pages(browser, served.url):
                settled(page)
                page.screenshot(path=folder / f"empty-{name}.png", full_page=True)
            machine, campaign, job = example_job(client)
            client.write_tooling("S9-shop", by_hand.TOOLING)
            known = views(machine, campaign, job)
            for name, page in pages(browser, served.url):
                for view, address in known.items():
                    if chosen and view not in chosen:
                        continue
                    page.goto(f"{served.url}/{address}")
                    settled(page)
                    page.screenshot(path=folder / f"{view}-{name}.png", full_page=True)
            for seed in (2, 3):
                client.identify_campaign(campaign, seed=seed)
            for name, page in pages(browser, served.url):
                for state, (address, come) in states(known, Path(data)).items():
                    if chosen and state not in chosen:
                        continue
                    # each in a tab of its own: what the one before has not saved would be asked for
                    tab = page.context.new_page()
                    tab.goto(f"{served.url}/{address}")
                    settled(tab)
                    come(tab)
                    tab.wait_for_timeout(500)
                    tab.screenshot(path=folder / f"{state}-{name}.png", full_page=state != "edits_left")
                    tab.close()
        browser.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]), *sys.argv[2:])
