"""How long people wait for the page: from a click to what follows it, in a real browser on a service with warm kernels.

``python -m benchmarks page_waits``: the example from an empty page to a best speed; then questions of a tooling that was never cut, one
field changed at a time: seconds until the lobes of the new question are drawn, and until its exact recommended cut stands. Service and
browser (Debian's Chromium, headless) share the cores.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from playwright.sync_api import Page, expect, sync_playwright

from tests.fixtures.service import serving
from tests.web.conftest import CHROMIUM, QUIET
from tests.web.example_path import walked

#: Percents of radial immersion that are asked one after the other; teeth stay what they are.
IMMERSIONS = (31, 47, 12, 73, 8, 55, 22, 90)
#: Processes for each kind of work, as on a small server.
ONE = {f"RCSA_IDENT_{kind}_WORKERS": "1" for kind in ("JOB", "LOBE")}
#: As long as anything may take [ms].
_LONG = 600_000
#: When the answer was no longer that before, on the page's own clock since the last input [ms].
_WATCHED = """() => {
  window.waits = { asked: 0, drawn: 0 };
  document.addEventListener('input', () => { window.waits = { asked: performance.now(), drawn: 0 }; }, true);
  new MutationObserver(() => {
    const answer = document.querySelector('.change-results');
    if (!window.waits.drawn && answer && !answer.classList.contains('before')) window.waits.drawn = performance.now();
  }).observe(document.body, { subtree: true, childList: true, attributes: true, attributeFilter: ['class'] });
}"""


def waits(page: Page) -> list[tuple[float, float]]:
    """Return seconds to the lobes and to the recommended cut for each question."""
    found = []
    page.evaluate(_WATCHED)
    for percent in IMMERSIONS:
        begin = time.perf_counter()
        page.get_by_label("Radial immersion").fill(str(percent))
        expect(page.locator(".best[data-rpm]")).to_have_count(0, timeout=_LONG)
        expect(page.locator(".best[data-rpm]")).to_be_visible(timeout=_LONG)
        exact = time.perf_counter() - begin
        told = page.evaluate("() => window.waits")
        found.append((1e-3 * (told["drawn"] - told["asked"]), exact))
        print(f"{percent} % immersion: lobes {found[-1][0]:.2f} s, recommended cut {exact:.2f} s", flush=True)
    return found


def main(arguments: Sequence[str]) -> None:
    """Print the seconds."""
    argparse.ArgumentParser(prog="benchmarks page_waits", description=__doc__).parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder, serving(Path(folder), **ONE) as served, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, headless=True, args=list(QUIET))
        page = browser.new_page(viewport={"width": 1280, "height": 860}, reduced_motion="reduce")
        page.goto(served.url)
        walked(page)
        lobes, exact = np.array(waits(page)).T
        print(f"lobes {np.median(lobes):.2f} s (at most {lobes.max():.2f}), recommended cut {np.median(exact):.2f} s ({exact.max():.2f})")
        browser.close()
