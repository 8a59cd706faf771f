"""Nothing is taken silently: a dropped tooling that differs is shown and not written, versions come back, edits are asked for."""

from __future__ import annotations

import json
import re
from contextlib import closing
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from api.client import Client
from api.stores.sql import open_store
from tests.fixtures import by_hand
from tests.fixtures.service import Served
from tests.web.conftest import drop

_CAMPAIGN = """[campaign]
name = "Dropped"
sampling_rate_hz = 51200.0
[sensors.flange_x]
quantity = "displacement"
axis = "X"
sensitivity = 1.0
[workpiece]
name = "EN AW-6082"
tangential_coefficient_mpa = 902.0
radial_ratio = 0.26
[toolings]
NAME = "toolings/NAME.toml"
[[cuts]]
id = "1"
tooling = "NAME"
spindle_speed_rpm = 8000.0
axial_depth_mm = 0.4
feed_per_tooth_mm = 0.1
entry_angle_deg = 90.0
exit_angle_deg = 180.0
feed_direction = "+X"
cut = "recordings/1.h5"
"""
THREE = by_hand.TOOLING.replace("teeth = 4", "teeth = 3")


def dropped(page: Page, folder: Path, name: str) -> None:
    """Let a campaign go over the page whose tooling has 3 teeth."""
    (folder / "campaign.toml").write_text(_CAMPAIGN.replace("NAME", name))
    (folder / f"{name}.toml").write_text(THREE)
    drop(page, "section.drop", [folder / "campaign.toml", folder / f"{name}.toml"])
    expect(page.locator(f'[data-tooling="{name}"]')).to_be_visible()


def _kept(served: Served, campaign: str) -> str:
    """What the store has of a campaign."""
    with closing(open_store(f"sqlite:///{served.data / 'service.db'}")) as store:
        found = store.campaigns.get("local", campaign)
    assert found is not None
    return found.text


def test_a_dropped_campaign_leaves_the_library_as_it_is(opened, client: Client, served: Served, shop: str, tmp_path):
    """Unless somebody says so, over what was shown; then it comes back by two clicks."""
    name = "S9-drop"
    before = client.write_tooling(name, by_hand.TOOLING)
    page = opened()
    dropped(page, tmp_path, name)
    row = page.locator(f'[data-tooling="{name}"] tbody tr')
    expect(row).to_have_count(1)
    assert row.locator("th, td").all_inner_texts() == ["cutter teeth", "4", "3"]
    page.get_by_role("button", name="Take it in", exact=True).click()
    expect(page.locator("h1")).to_have_text("Dropped")
    assert client.tooling(name).etag == before.etag
    # the campaign has what was dropped with it
    campaign = page.url.rsplit("/", 1)[1]
    assert json.loads(_kept(served, campaign))["toolings"] == {name: f"{THREE}\n"}
    assert [c.action for c in client.changes(kind="tooling", name=name)] == ["made"]

    page.goto(f"{served.url}/#/")
    dropped(page, tmp_path, name)
    page.get_by_label(f"What to do with {name}").select_option("replace")
    page.get_by_role("button", name="Take it in", exact=True).click()
    expect(page.locator("h1")).to_have_text("Dropped")
    assert client.tooling(name).tooling.cutter.teeth == 3
    newest = next(client.changes(kind="tooling", name=name))
    assert (newest.action, newest.who, newest.why) == ("changed", "local", "with the campaign Dropped")

    page.goto(f"{served.url}/#/changes")
    expect(page.locator("tbody tr", has_text=f"changed the tooling {name}: “with the campaign Dropped”")).to_be_visible()
    page.get_by_role("button", name=f"Restore version 1 of {name}").click()
    dialog = page.locator("dialog")
    expect(dialog.locator("tbody tr")).to_have_count(1)
    assert dialog.locator("tbody tr").locator("th, td").all_inner_texts() == ["cutter teeth", "3", "4"]
    dialog.get_by_role("button", name="Restore it").click()
    expect(page.locator("tbody tr", has_text=f"restored the tooling {name} from its version 1")).to_be_visible()
    assert client.tooling(name).etag == before.etag
    # what is there is offered no more
    expect(page.locator("tbody tr", has_text=f"made the tooling {name}").locator("td").last).to_have_text("There now")
    expect(page.get_by_role("button", name=f"Restore version 1 of {name}")).to_have_count(0)


@pytest.mark.parametrize("toolings", ['toolings = { S8-own = "toolings/drawn.toml" }', 'toolings.S8-own = "toolings/drawn.toml"'])
def test_a_dropped_campaign_is_read_as_toml_and_not_by_its_look(opened, client: Client, served: Served, tmp_path, toolings: str):
    """The tooling's key is not its file's name, and what differs is the campaign's own."""
    client.write_tooling("S8-own", by_hand.TOOLING)
    head, _, rest = _CAMPAIGN.replace("NAME", "S8-own").partition("[toolings]")
    _, brackets, cuts = rest.partition("[[cuts]]")
    (tmp_path / "campaign.toml").write_text(f"{toolings}\n{head}{brackets}{cuts}")
    (tmp_path / "drawn.toml").write_text(THREE)
    page = opened()
    drop(page, "section.drop", [tmp_path / "campaign.toml", tmp_path / "drawn.toml"])
    expect(page.locator('[data-tooling="S8-own"] tbody tr')).to_have_count(1)
    page.get_by_role("button", name="Take it in", exact=True).click()
    expect(page.locator("h1")).to_have_text("Dropped")
    assert json.loads(_kept(served, page.url.rsplit("/", 1)[1]))["toolings"] == {"S8-own": f"{THREE}\n"}
    assert client.tooling("S8-own").tooling.cutter.teeth == 4
    assert "drawn" not in [each.name for each in client.toolings()]


def test_a_version_is_restored_over_what_was_seen_and_over_nothing_else(opened, client: Client):
    """Of two people the second one is told; what was deleted comes back where nobody has written another."""
    name = "S9-two"
    first = client.write_tooling(name, by_hand.TOOLING)
    client.write_tooling(name, THREE)
    page = opened("#/changes")
    page.get_by_role("button", name=f"Restore version 1 of {name}").click()
    expect(page.locator("dialog")).to_be_visible()
    mine = client.write_tooling(name, by_hand.TOOLING.replace("teeth = 4", "teeth = 2"))
    page.locator("dialog").get_by_role("button", name="Restore it").click()
    expect(page.locator(".note.bad")).to_contain_text(f"Somebody has changed {name} meanwhile, so nothing was restored.")
    assert client.tooling(name).etag == mine.etag
    client.forget_tooling(name)
    page.get_by_role("button", name=f"Restore version 1 of {name}").click()
    page.locator("dialog").get_by_role("button", name="Restore it").click()
    expect(page.locator("tbody tr", has_text=f"restored the tooling {name} from its version 1")).to_be_visible()
    assert client.tooling(name).etag == first.etag


def test_edits_that_are_not_saved_are_asked_for(opened, client: Client, served: Served):
    client.write_tooling("S9-edits", by_hand.TOOLING)
    page = opened("#/toolings/edit/S9-edits")
    teeth = page.get_by_label("Teeth", exact=True)
    toolings = page.get_by_role("link", name="Toolings", exact=True)
    # nothing entered, nothing asked
    toolings.click()
    expect(page.locator("h1")).to_have_text("Toolings")
    page.go_back()
    teeth.fill("3")
    toolings.click()
    page.get_by_role("button", name="Stay here").click()
    expect(page.locator("h1")).to_have_text("S9-edits")
    expect(page).to_have_url(re.compile("#/toolings/edit/S9-edits$"))
    expect(teeth).to_have_value("3")
    page.get_by_role("button", name="Save", exact=True).click()
    expect(page.locator("tbody tr", has_text="changed the tooling S9-edits")).to_be_visible()
    # saved: no question any more
    toolings.click()
    expect(page.locator("h1")).to_have_text("Toolings")
    page.go_back()
    teeth.fill("5")
    toolings.click()
    page.get_by_role("button", name="Leave", exact=True).click()
    expect(page.locator("h1")).to_have_text("Toolings")
    assert client.tooling("S9-edits").tooling.cutter.teeth == 3


def test_a_tooling_file_of_a_name_that_is_taken_tells_how_it_differs(opened, client: Client, tmp_path):
    before = client.write_tooling("S9-taken", by_hand.TOOLING)
    page = opened("#/toolings")
    (tmp_path / "S9-taken.toml").write_text(THREE)
    drop(page, "section.drop", [tmp_path / "S9-taken.toml"])
    expect(page.locator(".note.bad")).to_have_text(re.compile("differs .cutter teeth 4 in the library, 3 in the file.; it stays as it is"))
    assert client.tooling("S9-taken").etag == before.etag


def test_how_well_a_drawing_is_known_is_written_and_read_again(opened, client: Client):
    client.write_tooling("S9-rough", by_hand.TOOLING)
    page = opened("#/toolings/edit/S9-rough")
    stickout = page.locator('[data-field="spread.stickout_mm"] input')
    # its file says nothing, and neither does the page
    expect(page.get_by_label("The drawing is")).to_have_value("silent")
    expect(stickout).to_be_hidden()
    page.get_by_label("The drawing is").select_option("rough")
    stickout.fill("0,3")
    page.get_by_label("Model of the tool").fill("EM12-4")
    page.get_by_role("button", name="Save", exact=True).click()
    expect(page.locator("tbody tr", has_text="changed the tooling S9-rough")).to_be_visible()
    kept = client.tooling("S9-rough").tooling
    assert kept.spread.model_dump(exclude_none=True) == {"stickout_mm": 0.3}
    assert kept.tool.model == "EM12-4"
    page.reload()
    expect(stickout).to_have_value("0.3")
    page.get_by_label("The drawing is").select_option("exact")
    page.get_by_role("button", name="Save", exact=True).click()
    expect(page.locator("tbody tr", has_text="changed the tooling S9-rough")).to_have_count(2)
    assert set(client.tooling("S9-rough").tooling.spread.model_dump().values()) == {0.0}
    client.forget_tooling("S9-rough")
