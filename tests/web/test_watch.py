"""A data logger that sends, and a person who watches."""

from __future__ import annotations

import threading

import pytest

from api.client import Client
from api.stream_client import ForceStream
from tests.fixtures.force_stream import hello, result, signals, tooling
from tests.fixtures.service import Served

pytest.importorskip("playwright")
from playwright.sync_api import expect


def test_a_logger_is_watched(opened, client: Client, served: Served):
    """It appears by its name; forces, counters and notes stand there; what it says at its end stays."""
    machine = client.make_machine("Watched").id
    client.identify(machine, result())
    client.write_tooling("T-logger", tooling())
    samples = signals(0.0, 3.0)
    with ForceStream(f"ws{served.url.removeprefix('http')}", hello(machine, tooling="T-logger", begins="air", name="hall 3")) as stream:
        listening = threading.Thread(target=lambda: list(stream.received()))
        listening.start()
        stream.send(samples[:1024])
        page = opened("#/forces/live")
        page.locator("#machine-here").select_option(label="Watched")
        row = page.get_by_role("row", name="hall 3")
        expect(row).to_contain_text("T-logger")
        row.get_by_role("button", name="Watch").click()
        expect(page.locator("main .mark", has_text="settling")).to_be_visible()
        for first in range(1024, len(samples), 1024):
            stream.send(samples[first : first + 1024])
        facts = page.locator(".facts")
        expect(facts).to_contain_text("Fx, RMS")
        expect(page.locator(".live-chart canvas")).to_be_visible()
        # the tooth passes more slowly than any tooth of the campaign did
        expect(facts.locator(".whole")).to_contain_text("lies below the identified band")
        page.get_by_role("button", name="Hold the picture").click()
        expect(page.get_by_role("button", name="Go on")).to_have_attribute("aria-pressed", "true")
        stream.end()
        listening.join()
        expect(page.locator("main .mark", has_text="over")).to_be_visible()
    told = dict(zip(facts.locator("dt").all_inner_texts(), facts.locator("dd").all_inner_texts(), strict=True))
    assert (told["Samples"].replace("\u202f", ""), told["Lost"], told["Dropped"]) == (str(len(samples)), "0", "0")
    expect(page.get_by_text("No data logger sends at the moment")).to_be_visible()
