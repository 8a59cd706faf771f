"""The page in a browser, against a service that runs as it does for everybody."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import Browser, BrowserContext, ConsoleMessage, Page, Request, Response, expect, sync_playwright

from api.client import Client
from tests.fixtures import by_hand
from tests.fixtures.service import Served, serving

ROOT = Path(__file__).resolve().parents[2]
SAMPLES = ROOT / "data" / "sample_runs"
CHROMIUM = shutil.which("chromium")
QUIET = (
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update",
    "--disable-sync",
)  # fmt: skip


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    if CHROMIUM is None:
        for item in items:
            if Path(item.fspath).parent == Path(__file__).parent:
                item.add_marker(pytest.mark.skip(reason="there is no Chromium: apt-get install chromium"))


@pytest.fixture(scope="session")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """One service for all; each test makes what it needs under names of its own."""
    settings = {"RCSA_IDENT_JOB_WORKERS": "1", "RCSA_IDENT_LOBE_WORKERS": "1", "RCSA_IDENT_PATH_WORKERS": "1", "RCSA_IDENT_JOB_NICE": "0"}
    with serving(tmp_path_factory.mktemp("served"), **settings) as found:
        yield found


@pytest.fixture(scope="session")
def client(served: Served) -> Iterator[Client]:
    with Client(served.url) as found:
        yield found


@pytest.fixture(scope="module")
def launch() -> Iterator[Callable[..., Browser]]:
    """Start browsers; for a file and no longer: the event loop runs in this thread, where other rooms' tests run loops of their own."""
    # reached only where something is wrong, and long enough for a machine under load
    expect.set_options(timeout=30_000)
    with sync_playwright() as playwright:
        yield lambda *further: playwright.chromium.launch(executable_path=CHROMIUM, headless=True, args=[*QUIET, *further])


@pytest.fixture(scope="module")
def browser(launch: Callable[..., Browser]) -> Iterator[Browser]:
    found = launch()
    yield found
    found.close()


@dataclass
class Watch:
    """What a page must not do. `host`: the only one that may be asked. `requests`: all requests, so that tests may look."""

    host: str
    faults: list[str] = field(default_factory=list)
    requests: list[Request] = field(default_factory=list)

    def over(self, page: Page) -> None:
        page.on("console", self._said)
        page.on("pageerror", lambda error: self.faults.append(f"exception: {error}"))
        page.on("request", self._asked)
        page.on("response", self._answered)

    def _said(self, message: ConsoleMessage) -> None:
        # an answer that is a problem is told by the browser, too: which ones may be is looked at in `_answered`
        if message.type in ("error", "warning") and not message.text.startswith("Failed to load resource"):
            self.faults.append(f"{message.type}: {message.text[:300]}")

    def _asked(self, request: Request) -> None:
        self.requests.append(request)
        if urlsplit(request.url).scheme not in ("blob", "data") and urlsplit(request.url).netloc != self.host:
            self.faults.append(f"another host: {request.url}")

    def _answered(self, answer: Response) -> None:
        if answer.url.endswith("/ready"):
            # with 503 it says how far a service is that has just been started
            return
        api = "/v1/" in answer.url
        if answer.status >= 500 or (answer.status >= 400 and not api):
            self.faults.append(f"{answer.status} {answer.url}")


@pytest.fixture
def opened(browser: Browser, served: Served) -> Iterator[Callable[..., Page]]:
    """Open pages of the service; at the end none of them may have said or asked for anything that it must not."""
    contexts: list[BrowserContext] = []
    watch = Watch(urlsplit(served.url).netloc)

    def open_page(address: str = "", url: str = served.url, **options: Any) -> Page:
        watch.host = urlsplit(url).netloc
        context = browser.new_context(**{"viewport": {"width": 1280, "height": 860}, "reduced_motion": "reduce", **options})
        contexts.append(context)
        context.set_default_timeout(20_000)
        page = context.new_page()
        watch.over(page)
        page.goto(f"{url}/{address}")
        page.wait_for_selector("h1, [role=alert], dialog, .note")
        return page

    open_page.watch = watch  # type: ignore[attr-defined]
    yield open_page
    for context in contexts:
        context.close()
    assert not watch.faults, watch.faults


@pytest.fixture(scope="session")
def result(tmp_path_factory: pytest.TempPathFactory) -> str:
    return by_hand.result_text(tmp_path_factory.mktemp("result"))


@pytest.fixture(scope="session")
def shop(client: Client, result: str) -> str:
    """A machine that was identified elsewhere, and toolings: the machine's id."""
    id = client.make_machine("Shop").id
    client.identify(id, result)
    client.write_tooling("T1", by_hand.TOOLING)
    client.write_tooling("T1-long", by_hand.TOOLING.replace("stickout_mm = 60.0", "stickout_mm = 75.0").replace("= 100.0", "= 115.0"))
    return id


def hearing(sound: Path) -> tuple[str, ...]:
    """Arguments of a browser whose microphone hears a file."""
    return ("--use-fake-ui-for-media-stream", "--use-fake-device-for-media-stream", f"--use-file-for-fake-audio-capture={sound}")


def fault_beside(page: Page, field_name: str) -> str:
    """What stands beside a field, once something does."""
    box = page.locator(f'[data-field="{field_name}"] .fault').first
    box.wait_for(state="visible")
    return box.inner_text()


_HAND = "() => { const i = document.createElement('input'); i.type = 'file'; i.multiple = true; i.id = 'hand'; document.body.append(i); }"
_LOAD = "() => { const t = new DataTransfer(); for (const f of document.getElementById('hand').files) t.items.add(f); return t; }"


def drop(page: Page, zone: str, files: list[Path]) -> None:
    """Let files go over a place, as a hand does."""
    page.evaluate(_HAND)
    page.set_input_files("#hand", [str(path) for path in files])
    transfer = page.evaluate_handle(_LOAD)
    for event in ("dragenter", "dragover", "drop"):
        page.dispatch_event(zone, event, {"dataTransfer": transfer})
    page.evaluate("() => document.getElementById('hand').remove()")
