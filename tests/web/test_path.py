"""A person's whole path: recordings dropped in, the machine identified, the tool changed, the best speed read, forces watched."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from playwright.sync_api import Page, expect

from api.client import Client
from tests.api.test_tus import begun
from tests.fixtures.service import Served
from tests.web.conftest import ROOT, SAMPLES, drop

#: Every fourth cut: an identification in seconds.
EVERY = 4
#: A tooling that never cut.
NEVER_CUT = "S4-shrink"
#: How many pixels of the live chart are of the colours of its two forces.
_INKS = """() => {
  const canvas = document.querySelector('.live-chart canvas');
  const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
  const found = { blue: 0, orange: 0 };
  for (let i = 0; i < data.length; i += 4) {
    if (data[i + 3] > 100 && data[i + 2] > data[i] + 40) found.blue += 1;
    if (data[i + 3] > 100 && data[i] > data[i + 2] + 40) found.orange += 1;
  }
  return found;
}"""


def part_of_the_samples(folder: Path) -> list[Path]:
    """The files of a campaign with every fourth of the sample's cuts."""
    text = (SAMPLES / "campaign.toml").read_text()
    head, *cuts = text.split("[[cuts]]")
    kept = cuts[::EVERY]
    campaign = folder / "campaign.toml"
    campaign.write_text("[[cuts]]".join([head, *kept]))
    recordings = [SAMPLES / name for cut in kept for name in re.findall(r'= "(recordings/[^"]+)"', cut)]
    return [campaign, *sorted((SAMPLES / "toolings").glob("*.toml")), *recordings]


def campaign_of_one(client: Client, machine: str) -> dict[str, Any]:
    """A campaign with the sample's first cut, on a machine of its own."""
    id = client.make_machine(machine).id
    toml = {"Content-Type": "application/toml"}
    for path in sorted((SAMPLES / "toolings").glob("*.toml")):
        client.send("PUT", f"/toolings/{path.stem}", content=path.read_bytes(), headers=toml)
    head, cut, *_ = (SAMPLES / "campaign.toml").read_text().split("[[cuts]]")
    made: dict[str, Any] = client.send("POST", f"/machines/{id}/campaigns", content=f"{head}[[cuts]]{cut}".encode(), headers=toml).json()
    return made


def test_from_dropping_recordings_to_the_best_speed(opened, client: Client, tmp_path):
    page = opened()
    # the machine, the toolings and the campaign are recognised, and taken in after one look
    files = part_of_the_samples(tmp_path)
    count = sum(path.suffix == ".h5" for path in files)
    drop(page, "section.drop", files)
    found = page.locator(".card", has_text="This is what was found")
    expect(found).to_contain_text("HPM sample machine")
    expect(found).to_contain_text("S1-ER32, S2-PG25")
    expect(found).to_contain_text(str(count))
    if page.get_by_label("Machine", exact=True).last.is_visible():
        page.get_by_label("Machine", exact=True).last.select_option(label="A new machine")
    page.get_by_label("Its name").fill("HPM 800U")
    page.get_by_role("button", name="Take it in", exact=True).click()

    # every recording's verdict
    expect(page.locator("h1")).to_have_text("HPM sample machine")
    expect(page.get_by_text(f"{count} of {count}", exact=True)).to_be_visible(timeout=60_000)
    rows = page.locator("tbody tr")
    expect(rows).to_have_count(count // 2)
    expect(page.locator("tbody .mark.good, tbody .mark.doubt")).to_have_count(count // 2)
    expect(rows.first).to_contain_text("8 000".replace(" ", "\u202f"))
    rows.first.get_by_role("button").click()
    expect(page.get_by_role("img", name=re.compile("^Spectrum with [0-9]+ multiples"))).to_be_visible()
    expect(page.locator(".chart .main-svg").first).to_be_visible()

    # the identification, watched; there are enough cuts for it to be the next step
    identify = page.get_by_role("button", name="Identify the machine")
    expect(identify).to_have_class("primary")
    identify.click()
    expect(page.locator(".mark.busy")).to_be_visible()
    expect(page.get_by_role("img", name=re.compile("^Misfit over time: X"))).to_be_visible(timeout=60_000)
    expect(page.get_by_role("img", name=re.compile("^Measured points and model, X"))).to_be_visible(timeout=60_000)
    expect(page.get_by_role("link", name="Change the tool")).to_be_visible(timeout=300_000)
    modes = page.locator("table", has=page.locator("caption", has_text="Modes in X")).locator("tbody tr")
    expect(modes.nth(2)).to_be_visible()
    assert all("±" in text for text in modes.all_inner_texts())
    job = page.url.rsplit("/", 1)[1]
    told = client.send("GET", f"/identifications/{job}/modes").json()
    expect(page.locator("main")).to_contain_text(told["notes"][0])

    # a tooling that never cut, dropped into the library
    page.get_by_role("link", name="Toolings").click()
    page.wait_for_selector("section.drop")
    drop(page, "section.drop", [ROOT / "data" / "machines" / "toolings" / f"{NEVER_CUT}.toml"])
    expect(page.get_by_role("link", name=NEVER_CUT, exact=True)).to_be_visible()
    page.locator(".tooling", has_text=NEVER_CUT).get_by_role("link", name="Lobes").click()

    # the best speed, read
    best = page.locator(f'.best[data-tooling="{NEVER_CUT}"]')
    expect(best).to_be_visible(timeout=30_000)
    machine = next(m for m in client.machines() if m.name == "HPM 800U")
    cut = {"immersion": 0.5, "strategy": "down", "feed_direction": "+X", "feed_per_tooth_mm": 0.1}
    advice = client.advice(machine.id, NEVER_CUT, cut=cut).toolings[0].highest_removal[0]
    read = best.inner_text().replace("\u202f", "").replace("\u00a0", " ")
    assert float(best.get_attribute("data-rpm")) == advice.spindle_speed_rpm
    # a browser rounds halves up
    assert f"{math.floor(advice.spindle_speed_rpm + 0.5)}" in read
    assert f"{advice.axial_depth_mm:.2f} mm" in read
    # the reader at that speed: the limit around the cut, not the preview's
    around = client.lobes(machine.id, NEVER_CUT, cut=cut).toolings[0].around[0]
    k = min(range(len(around.spindle_speed_rpm)), key=lambda k: abs(around.spindle_speed_rpm[k] - advice.spindle_speed_rpm))
    reader = page.locator(".reads").inner_text().replace("\u202f", "").replace("\u00a0", " ")
    assert around.limit_depth_mm[k] == pytest.approx(advice.limit_depth_mm, rel=1e-9)
    assert f"stability limit {advice.limit_depth_mm:.2f} mm (95 %: " in reader
    assert f"{around.chatter_frequency_hz[k]:.0f} Hz" in reader
    # the machine is known: its records tell the pocket to a few per cent
    assert 15_000 < advice.spindle_speed_rpm < 19_000

    forces(page, machine.id)


def forces(page: Page, machine: str) -> None:
    """Forces of a recording, and the same recording played as if it came now."""
    page.get_by_role("link", name="Forces").click()
    page.get_by_role("button", name="Show forces").click()
    table = page.locator("table", has=page.locator("caption", has_text="Forces in numbers"))
    expect(table.locator("tbody tr")).to_have_count(2, timeout=60_000)
    page.get_by_role("link", name="Live").click()
    page.get_by_label("Speed of playing").select_option("0.1")
    page.get_by_role("button", name="Play").click()
    expect(page.locator(".live-chart canvas")).to_be_visible(timeout=60_000)
    expect(page.locator("main .mark", has_text="over")).to_be_visible(timeout=30_000)
    facts = dict(zip(page.locator(".facts dt").all_inner_texts(), page.locator(".facts dd").all_inner_texts(), strict=True))
    assert (facts["Lost"], facts["Dropped"], facts["Samples"].replace("\u202f", "")) == ("0", "0", "7168")
    # both forces were drawn, and neither covers the other
    inks = page.evaluate(_INKS)
    assert inks["blue"] > 3000
    assert inks["orange"] > 3000


def test_an_identification_is_cancelled_from_the_page(opened, client: Client):
    made = campaign_of_one(client, "To be cancelled")
    campaign, name = made["id"], made["cuts"][0]["cut"]["name"]
    raw = (SAMPLES / "recordings" / name).read_bytes()
    client.send("PUT", f"/campaigns/{campaign}/recordings/{name}", content=raw, headers={"Content-Type": "application/octet-stream"})
    page = opened(f"#/campaigns/{campaign}")
    identify = page.get_by_role("button", name="Identify the machine")
    # one cut is too few for it to be the next step
    expect(identify).not_to_have_class("primary")
    expect(page.locator("main")).to_contain_text("two toolings with 8 usable cuts each")
    identify.click()
    page.get_by_role("button", name="Cancel").click()
    state = page.locator(".mark", has_text=re.compile("cancelled|failed"))
    expect(state).to_be_visible(timeout=60_000)
    job = page.url.rsplit("/", 1)[1]
    assert client.send("GET", f"/identifications/{job}").json()["state"] in ("cancelled", "failed")


def test_a_broken_line_costs_a_piece_and_not_the_file(opened, client: Client, tmp_path):
    """A large recording goes in pieces; when one is lost, the rest follows from where the service has it."""
    source = SAMPLES / "recordings" / "S1-ER32-00_cut.h5"
    large = tmp_path / source.name
    with h5py.File(source) as before, h5py.File(large, "w") as after:
        after.attrs.update(before.attrs)
        for name, data in before.items():
            after[name] = np.tile(np.asarray(data, dtype="f4"), 90)
            after[name].attrs.update(data.attrs)
    assert large.stat().st_size > 8e6
    made = campaign_of_one(client, "Far away")
    # what somebody has left unfinished under this name, of another length, gives way
    begun(client.http, f"/v1/campaigns/{made['id']}/uploads", 5, filename=source.name)
    page = opened(f"#/campaigns/{made['id']}")
    broken: list[str] = []

    def lose(route):
        offset = route.request.headers.get("upload-offset", "0")
        if offset != "0" and not broken:
            broken.append(offset)
            route.abort()
        else:
            route.continue_()

    page.route("**/uploads/*", lambda route: lose(route) if route.request.method == "PATCH" else route.continue_())
    drop(page, "section.drop", [large])
    expect(page.locator("tbody .mark.good, tbody .mark.doubt, tbody .mark.bad")).to_be_visible(timeout=60_000)
    offsets = [r.headers["upload-offset"] for r in opened.watch.requests if r.method == "PATCH"]
    assert broken == ["4000000"]
    assert offsets.count("0") == 1
    assert offsets.count("4000000") == 2
    kept = client.send("GET", f"/campaigns/{made['id']}/recordings/{source.name}").json()
    assert kept["size_bytes"] == large.stat().st_size


@pytest.mark.parametrize("what", ["nothing of use", "recordings alone", "toolings alone"])
def test_what_is_no_campaign_is_told_what_to_do(opened, tmp_path, what):
    page = opened()
    files = {
        "nothing of use": [tmp_path / "holiday.jpg"],
        "recordings alone": [SAMPLES / "recordings" / "S1-ER32-00_cut.h5"],
        "toolings alone": [SAMPLES / "toolings" / "S1-ER32.toml"],
    }[what]
    (tmp_path / "holiday.jpg").write_bytes(b"\xff\xd8")
    drop(page, "section.drop", files)
    words = {"nothing of use": "Nothing among these", "recordings alone": "Describe the cuts", "toolings alone": "the toolings' page"}
    expect(page.locator("main")).to_contain_text(words[what])


def test_cuts_described_by_hand(opened, client: Client, served: Served, shop: str):
    """Without a campaign.toml: pairs of cut and air by their names, speeds filled in, then the same way on."""
    page = opened(f"#/machines/{shop}")
    page.goto(f"{served.url}/#/campaigns/new")
    names = [f"S1-ER32-0{k}_{kind}.h5" for k in range(2) for kind in ("cut", "air")]
    page.get_by_role("heading", name="Describe the cuts").wait_for()
    drop(page, "section.drop", [SAMPLES / "recordings" / name for name in names])
    expect(page.get_by_text("2 cuts, 2 air cuts")).to_be_visible()
    expect(page.get_by_label("Air cut of S1-ER32-01")).to_have_value("S1-ER32-01_air.h5")
    # nothing is made as long as something is missing, and it is said where
    page.get_by_role("button", name="Make the campaign").click()
    box = page.locator('[data-field="cuts.0.spindle_speed_rpm"] .fault')
    expect(box).to_be_visible()
    page.get_by_label("First speed").fill("8000")
    page.get_by_label("Step", exact=True).fill("308")
    expect(page.get_by_label("Speed of S1-ER32-01")).to_have_value("8308")
    # where a displacement sensor looks, and no accelerometer
    page.get_by_label("Behind the flange").nth(0).fill("-12.5")
    expect(page.get_by_label("Behind the flange").nth(2)).to_be_disabled()
    page.get_by_role("button", name="Make the campaign").click()
    expect(page.get_by_text("4 of 4", exact=True)).to_be_visible(timeout=60_000)
    campaign = client.send("GET", f"/campaigns/{page.url.rsplit('/', 1)[1]}").json()
    assert [cut["spindle_speed_rpm"] for cut in campaign["cuts"]] == [8000.0, 8308.0]
    assert campaign["cuts"][0]["entry_angle_deg"] == pytest.approx(90.0)
    assert campaign["sensors"]["flange_x"]["distance_behind_flange_mm"] == -12.5
    assert "distance_behind_flange_mm" not in campaign["sensors"]["flange_y"]
    assert any("how far behind the flange flange_y looks" in remark for remark in campaign["remarks"])
    assert json.dumps(campaign["cuts"][1]["air"]) == '{"name": "S1-ER32-01_air.h5", "uploaded": true}'
