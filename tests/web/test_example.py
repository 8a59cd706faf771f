"""A trial without any recordings: an example, identified, and the best speed of a tooling that never cut."""

from __future__ import annotations

import re
from itertools import pairwise

import pytest
from playwright.sync_api import Page, Route, expect

from api.client import Client
from tests.fixtures import by_hand
from tests.fixtures.service import Served
from tests.web.conftest import ROOT, drop

#: Labels of the chart that lie over each other.
_OVERPRINTS = """() => {
  const boxes = [...document.querySelectorAll('.chart .annotation-text')].map((each) => each.getBoundingClientRect());
  return boxes.flatMap((a, i) => boxes.slice(i + 1).filter(
    (b) => a.left < b.right && b.left < a.right && a.top < b.bottom - 1 && b.top < a.bottom - 1)).length;
}"""


@pytest.mark.witness
def test_from_an_empty_page_to_a_best_speed(opened, client: Client, served: Served):
    """Three clicks; each view says the next one, and a tooling of before, last by its name, is not the one that is asked for."""
    client.write_tooling("VHM of before", by_hand.TOOLING)
    page: Page = opened()
    clicks = 0

    def click(what: str, name: str) -> None:
        nonlocal clicks
        clicks += 1
        page.get_by_role(what, name=name).first.click(timeout=120_000)

    # a service that has just been started says how far it is
    starting = {"detail": "the worker processes are starting, 2 of 4 steps of compilation are done"}
    page.route("**/ready", lambda route: route.fulfill(status=503, json=starting))
    held: list[Route] = []
    page.route("**/v1/examples/campaign", lambda route: held.append(route))
    click("button", "Try it with an example")
    expect(page.get_by_text("2 of 4 steps of compilation are done")).to_be_visible()
    held[0].continue_()
    page.unroute_all()
    expect(page.locator("h1")).to_have_text("Example: HPM sample machine", timeout=60_000)
    identify = page.get_by_role("button", name="Identify the machine")
    expect(identify).to_have_class("primary", timeout=120_000)
    expect(page.get_by_text("24 of 24", exact=True)).to_be_visible()

    click("button", "Identify the machine")
    # painted before the first event: what will be where, and how far it is
    for words in ("Misfit over time", "Measured points and model"):
        expect(page.get_by_role("heading", name=words)).to_be_visible()
    expect(page.locator(".mark.busy")).to_be_visible()
    expect(page.get_by_text("drawing …")).to_have_count(0)
    # another tab knows of it without having begun it, and leads there
    (example,) = (machine.id for machine in client.machines() if machine.example)
    other = opened(f"#/change?machine={example}")
    expect(other.locator("#steps .state", has_text=re.compile("running|waiting"))).to_be_visible()
    expect(other.get_by_role("link", name="To the running identification")).to_be_visible()
    other.close()
    expect(page.get_by_role("img", name=re.compile("^Misfit over time: X, "))).to_be_attached(timeout=60_000)
    job = page.url.rsplit("/", 1)[1]

    expect(page.get_by_role("link", name="Change the tool")).to_be_visible(timeout=300_000)
    # the answer stands first, and its notes tell the numbers of its tables
    headings = page.locator("main h2").all_inner_texts()
    assert headings.index("Modes, X direction") < headings.index("Measured points and model")
    expect(page.get_by_role("heading", name="Misfit over time")).to_be_hidden()
    rows = page.locator("table", has=page.locator("caption", has_text=re.compile("Modes in"))).locator("tbody tr").all_inner_texts()
    shown = {re.sub(r"\D", "", row.split("\t")[1].split("±")[0].split(".")[0]) for row in rows}
    outside = [note for note in client.send("GET", f"/identifications/{job}/modes").json()["notes"] if " lie outside" in note]
    assert outside
    for frequency in re.findall(r"\d+", " ".join(note.split(" lie ")[0] for note in outside)):
        assert {frequency, str(int(frequency) - 1)} & shown, (frequency, shown)
    page.get_by_text("How it was found").click()
    expect(page.locator(".chart .annotation-text").first).to_be_visible()
    assert page.evaluate(_OVERPRINTS) == 0

    click("link", "Change the tool")
    best = page.locator(".best .figure output")
    expect(best).to_be_visible(timeout=120_000)
    assert 15_000 < float(page.locator(".best").get_attribute("data-rpm") or 0.0) < 19_000
    assert clicks <= 4

    # what it takes is what it took here
    page.goto(f"{served.url}/#/campaigns/{example}")
    expect(page.get_by_text(re.compile(r"usable cuts; the last one took \d+ s$"))).to_be_visible()

    # what is dropped meanwhile is no part of it
    machine = next(m for m in client.machines() if m.example)
    page.goto(f"{served.url}/#/machines/{machine.id}/recordings")
    drop(page, "section.drop", [ROOT / "api" / "examples" / "small-campaign.zip"])
    target = page.get_by_label("Machine", exact=True).last
    expect(target).to_have_value("")
    assert machine.name not in target.locator("option").all_inner_texts()
    page.get_by_label("Its name").fill("Beside the example")
    page.get_by_role("button", name="Take it in").click()
    expect(page.locator(".facts")).to_contain_text("4 of 4", timeout=60_000)
    expect(page.get_by_text("The virtual machine is cutting")).to_have_count(0)

    # it goes as a whole, all of it named before
    page.goto(f"{served.url}/#/machines/{machine.id}")
    page.get_by_role("button", name="Forget").click()
    words = page.get_by_role("dialog")
    for what in (
        f"Forget {machine.name}?",
        "Campaign “Example: HPM sample machine”",
        "48 recordings",
        "Its identification",
        "4 toolings: Example",
    ):
        expect(words).to_contain_text(what)
    words.get_by_text("48 recordings").click()
    expect(words.get_by_text(re.compile("_cut.h5, "))).to_be_visible()
    page.get_by_role("button", name="Forget it").click()
    expect(page.locator("h1")).not_to_have_text(machine.name)
    assert not any(m.example for m in client.machines())
    (mine,) = (m for m in client.machines() if m.name == "Beside the example")
    assert [(c.cuts, c.uploaded) for c in client.campaigns(mine.id)] == [(2, 2)]
    assert not any(t.name.startswith("Example") for t in client.toolings())


def test_an_empty_view_says_the_next_step(opened, client: Client, served: Served):
    """For a machine without recordings in every view that needs an identification."""
    machine = client.make_machine("Knows nothing yet").id
    page: Page = opened(f"#/machines/{machine}")
    for address in (f"#/machines/{machine}", "#/identification", "#/change", "#/forces", "#/forces/live"):
        page.goto(f"{served.url}/{address}")
        step = page.get_by_role("link", name="To the recordings")
        expect(step).to_have_class("button primary")
    step.click()
    expect(page.get_by_role("button", name="Try it with an example")).to_be_visible()


def test_labels_of_stages_find_rows_of_their_own(opened):
    """As many as there is room for, in the order of time."""
    page: Page = opened()
    found = page.evaluate(
        """async () => {
          const base = document.querySelector('script[type=module]').src.replace('main.js', 'views/identification_figures.js');
          const { costFigure } = await import(base);
          const stage = (axis, name, from) => [0, 0.1].map((dt) => ({ axis, stage: name, seconds: from + dt, cost: 10 }));
          const names = ['search', 'refine', 'learn noise', '9 modes', '6 modes', 'polish'];
          const points = names.flatMap((name, k) => stage('X', name, 8 + 0.3 * k));
          return costFigure(new Map([['X', points]]), 560).layout.annotations.map((a) => [a.x, a.yshift, a.text.length]);
        }"""
    )
    assert 2 <= len(found) < 6
    assert all(a[0] <= b[0] for a, b in pairwise(found))
    rows: dict[int, list[tuple[float, float]]] = {}
    for x, row, letters in found:
        start = x * (560 - 80) / 9.6
        for _, end in rows.get(row, []):
            assert start >= end
        rows.setdefault(row, []).append((start, start + 6.6 * letters))
