"""A data logger's stream watched in a browser: pictures a second of the live chart, and what the watching costs the stream.

``python -m benchmarks live_chart``: the stream of `streaming` at its pace, 51.2 kHz of two axes, and Debian's Chromium (headless, no
graphics processor) with the page's live chart open; service, client and browser on the same cores.
"""

from __future__ import annotations

import argparse
import tempfile
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from api.client import Client
from benchmarks.service import serving
from benchmarks.stream_crowd import prepared
from benchmarks.streaming import ENTRY, SAG, WANDER, paced
from tests.fixtures.turning_cut import turning_cut

CHROMIUM = "/usr/bin/chromium"
_QUIET = (
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update",
)  # fmt: skip
#: Times between pictures, and how long the page's own thread was held [ms].
_COUNTED = """seconds => new Promise(done => {
  const gaps = [], held = [];
  new PerformanceObserver(list => held.push(...list.getEntries().map(e => e.duration))).observe({ entryTypes: ["longtask"] });
  let last = performance.now();
  const end = last + 1000 * seconds;
  const step = now => {
    gaps.push(now - last);
    last = now;
    if (now < end) requestAnimationFrame(step); else done({ gaps, held });
  };
  requestAnimationFrame(step);
})"""


def main(arguments: Sequence[str]) -> None:
    """Print how the chart and the stream went."""
    parser = argparse.ArgumentParser(prog="benchmarks live_chart", description=__doc__)
    parser.add_argument("--seconds", type=float, default=30.0, help="that pictures are counted")
    parser.add_argument("--picture", type=Path, help="PNG of the page at the end")
    options = parser.parse_args(arguments)
    turning = turning_cut()
    duration = options.seconds + 25.0
    frames = np.concatenate([part for part, _ in turning.blocks(duration, ENTRY, 4096, WANDER, SAG)]).astype(np.float32)
    with tempfile.TemporaryDirectory() as folder, serving(Path(folder)) as (port, service):
        with Client(f"http://127.0.0.1:{port}") as client:
            machine = prepared(client)
        found: dict[str, Any] = {}
        logger = threading.Thread(target=lambda: found.update(paced(port, service, machine, turning, frames)))
        logger.start()
        counted = watched(f"http://127.0.0.1:{port}", options.seconds, options.picture)
        logger.join()
    gaps, held = np.array(counted["gaps"][1:]), counted["held"]
    slow = f"longest time between two {gaps.max():.0f} ms, 99 of 100 within {np.quantile(gaps, 0.99):.0f} ms"
    print(f"pictures of the page a second: {1e3 / gaps.mean():.1f}; {slow}")
    print(f"page held for more than 50 ms: {len(held)} times in {options.seconds:.0f} s, at most {max(held, default=0.0):.0f} ms")
    print(f"chart: {counted['changed']} of 20 looks half a second apart differ; counters of the page {counted['facts']}")
    delay, end = 1e3 * found["delay"][found["caught_up"]], found["end"]
    there = f"client to client median {np.median(delay):.1f} ms, longest {delay.max():.1f} ms"
    print(f"stream: {end['samples']} of {frames.shape[0]} samples, lost {end['lost']}, dropped {end['dropped']}; {there}")


def watched(url: str, seconds: float, picture: Path | None) -> dict[str, Any]:
    """Open the page, watch the stream that appears there, and count."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, headless=True, args=list(_QUIET))
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        page.goto(f"{url}/#/forces/live")
        page.get_by_role("button", name="Watch").click(timeout=30_000)
        page.locator("main .mark", has_text="live").wait_for(timeout=30_000)
        page.locator(".live-chart canvas").wait_for()
        page.wait_for_timeout(2000)
        counted: dict[str, Any] = page.evaluate(_COUNTED, seconds)
        looks = []
        for _ in range(20):
            looks.append(page.evaluate("document.querySelector('.live-chart canvas').toDataURL()"))
            page.wait_for_timeout(500)
        counted["changed"] = sum(a != b for a, b in zip(looks, [*looks[1:], ""], strict=True))
        names, values = (page.locator(f".facts {tag}").all_inner_texts() for tag in ("dt", "dd"))
        counted["facts"] = {k: v for k, v in zip(names, values, strict=True) if k in ("Lost", "Dropped", "Delay")}
        if picture is not None:
            page.screenshot(path=str(picture), full_page=True)
        browser.close()
        return counted
