"""A robot on the page: its posture by sliders or along a path, what it is there, and lobes that follow."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from api.client import Client
from rcsa_ident.machine.robot.kinematics import tool_point_at
from tests.fixtures.paths import TOOLINGS
from tests.fixtures.robots import ROBOTS, robot
from tests.fixtures.service import Served
from tests.fixtures.waiting import until
from tests.web.conftest import drop
from tests.web.test_accessibility import faults

pytest.importorskip("playwright")
from playwright.sync_api import Page, Route, expect

START = [-11.71, 20.78, 110.0, 82.76, 60.8, -166.96]
PATH = "x_mm,y_mm,z_mm\n" + "\n".join(f"{900 + 100 * k},{-300 + 150 * k},500" for k in range(5)) + "\n"
CUT = {"immersion": 0.5, "strategy": "down"}
SPEEDS = {"from_rpm": 4000, "to_rpm": 20000, "step_rpm": 100}


@pytest.fixture(scope="module")
def tooling(client: Client) -> Iterator[str]:
    client.write_tooling("Robot tool", (TOOLINGS / "S3-PG25-long.toml").read_text(encoding="utf-8"))
    yield "Robot tool"
    client.forget_tooling("Robot tool")


@pytest.fixture
def page(opened, tooling: str) -> Page:
    found = opened("#/robots?robot=tx200&tooling=Robot+tool")
    expect(found.get_by_role("heading", name="Stability lobes at this posture")).to_be_visible(timeout=60_000)
    return found


def plain(text: str) -> str:
    return text.replace("\u202f", "").replace("\u00a0", " ").replace("−", "-")


def tip_of(page: Page) -> np.ndarray:
    """Where the picture has the tool's tip [mm]."""
    return np.array(page.locator("svg.arm").get_attribute("data-tip").split(), dtype=float)


def tip_at(client: Client, tooling: str, angles: list[float]) -> np.ndarray:
    """Where the library has it [mm]."""
    keys = client.tooling(tooling).tooling
    length = keys.tool.stickout_mm + sum(segment.length_mm for segment in keys.holder.segments)
    point = tool_point_at(robot("tx200"), np.radians(angles))
    return 1e3 * point.offset + length * point.turn[:, 2]


def fact(page: Page, name: str) -> str:
    return plain(page.locator(".facts > div", has=page.get_by_text(name, exact=True)).locator("dd").inner_text())


def test_a_published_arm_stands_where_the_library_puts_it(page: Page, client: Client, tooling: str):
    np.testing.assert_allclose(tip_of(page), tip_at(client, tooling, START), atol=0.02)
    found = client.posture({"robot": "tx200", "posture_deg": START})
    expect(page.get_by_role("region", name="Natural frequencies of the arm")).to_contain_text(f"{found.natural_frequencies_hz[0]:.2f}")
    assert fact(page, "Gives way along y") == f"{1e6 * found.tcp_compliance_m_per_n[1][1]:.3f} µm/N"
    assert fact(page, "Tool point x") == f"{1e3 * found.tcp_m[0]:.1f} mm"
    # what speaks against its description is said in short
    page.get_by_text("3 doubts about posture and description").click()
    expect(page.get_by_text("link behind J3: its moments of inertia")).to_be_visible()


def test_lobes_follow_the_posture(page: Page, client: Client, tooling: str):
    """By the arrow keys on a slider, by a number, and from an address."""
    said = page.locator(".card", has=page.get_by_role("heading", name="Stability lobes at this posture")).locator("p").first
    before = said.inner_text()
    slider = page.get_by_label("J2", exact=True)
    slider.focus()
    for _ in range(4):
        slider.press("ArrowRight")
    slider.press("Shift+ArrowRight")
    moved = [START[0], START[1] + 4.1, *START[2:]]
    expect(page.get_by_label("J2, degrees")).to_have_value("24.88")
    expect(slider).to_have_attribute("aria-valuetext", "24.9 degrees")
    page.get_by_label("J5, degrees").fill("-40,5")
    moved[4] = -40.5
    expect(said).not_to_have_text(before)
    material = client.materials()[0].name
    expected = client.lobes(
        {"robot": "tx200", "posture_deg": moved}, tooling, cut={**CUT, "material": material}, speeds=SPEEDS, bands=False, recommend=False
    ).toolings[0]
    expect(said).to_contain_text(f"{expected.absolute_limit_mm:.2f}", timeout=60_000)
    best = expected.best_speeds[0]
    assert f"highest limit at {best.spindle_speed_rpm:.0f} rev/min, {best.limit_depth_mm:.2f} mm" in plain(said.inner_text())
    np.testing.assert_allclose(tip_of(page), tip_at(client, tooling, moved), atol=0.02)
    assert "q=-11.71+24.88+110+82.76+-40.5+-166.96" in page.url
    page.reload()
    expect(page.get_by_label("J5, degrees")).to_have_value("-40.5")
    # beyond its limits an angle is not taken
    page.get_by_label("J3, degrees").fill("160")
    expect(page.locator(".joint .fault:visible")).to_have_text("From -140° to 145°.".replace("-", "−"))
    assert "+110+" in page.url
    page.get_by_label("J3, degrees").fill("90")
    expect(page.locator(".joint .fault:visible")).to_have_count(0)


def test_of_two_arms_asked_for_the_later_one_is_drawn(page: Page):
    """The answer for the first comes last, or not at all."""
    held: dict[str, Route] = {}

    def hold(route: Route) -> None:
        held[route.request.post_data_json["robot"]["robot"]] = route

    page.route("**/robots/posture", hold)
    arm = page.get_by_label("Arm", exact=True)
    for name in ("kr500", "tx200"):
        arm.select_option(name)
        until(lambda name=name: page.wait_for_timeout(20) or name in held)
    for name in ("tx200", "kr500"):
        held[name].continue_()
    expect(page).to_have_url(re.compile("robot=tx200"))
    expect(page.get_by_label("J6", exact=True)).to_be_visible()
    page.wait_for_timeout(500)
    expect(page.get_by_label("A6", exact=True)).to_have_count(0)


def test_inches_turn_over_and_a_field_at_fault_says_so(page: Page):
    length = fact(page, "Tool point x")
    page.get_by_role("button", name="inch").click()
    assert fact(page, "Tool point x") == f"{float(length.split()[0]) / 25.4:.2f} in"
    page.get_by_role("button", name="mm", exact=True).click()
    if not page.get_by_label("Step", exact=True).is_visible():
        page.get_by_text("Cut and speeds").click()
    page.get_by_label("Step", exact=True).fill("0.001")
    expect(page.locator('[data-field="speeds.step_rpm"] .fault')).to_be_visible()
    page.get_by_label("Step", exact=True).fill("")
    expect(page.locator('[data-field="speeds.step_rpm"] .fault')).to_contain_text("A number is needed here")
    page.get_by_label("Step", exact=True).fill("200")
    expect(page.locator('[data-field="speeds.step_rpm"] .fault')).to_be_hidden()


def test_the_picture_is_turned_by_hand_and_by_keys(page: Page):
    arm = page.locator("svg.arm")
    expect(arm).to_have_attribute("data-view", "-58 22")
    box = arm.bounding_box()
    page.mouse.move(box["x"] + 200, box["y"] + 150)
    page.mouse.down()
    page.mouse.move(box["x"] + 260, box["y"] + 175, steps=4)
    page.mouse.up()
    expect(arm).to_have_attribute("data-view", "-88 32")
    arm.focus()
    arm.press("ArrowLeft")
    expect(arm).to_have_attribute("data-view", "-78 32")
    arm.press("ArrowUp")
    expect(arm).to_have_attribute("data-view", "-78 38")
    page.get_by_role("button", name="From above").click()
    expect(arm).to_have_attribute("data-view", "-90 90")
    # what a slider moves is shown
    page.get_by_label("J4", exact=True).focus()
    expect(arm.locator("text.chosen")).to_have_text("J4")


def test_another_posture_of_the_same_place_is_taken(page: Page):
    tip = tip_of(page)
    others = page.locator(".postures button")
    assert others.count() >= 2
    others.first.click()
    expect(page).not_to_have_url(re.compile(r"q=-11\.71\+20\.78\+110\+82\.76"))
    page.wait_for_timeout(100)
    np.testing.assert_allclose(tip_of(page), tip, atol=0.3)


def test_along_a_path(page: Page, client: Client, tooling: str, tmp_path: Path):
    (tmp_path / "PATH.csv").write_text(PATH)
    drop(page, "h1", [tmp_path / "PATH.csv"])
    along = page.get_by_label("Place along PATH.csv")
    expect(along).to_be_visible(timeout=60_000)
    np.testing.assert_allclose(tip_of(page), [900.0, -300.0, 500.0], atol=0.1)
    along.focus()
    for _ in range(3):
        along.press("ArrowRight")
    expect(page.locator("output", has_text="4 of 5")).to_be_visible()
    page.wait_for_timeout(100)
    np.testing.assert_allclose(tip_of(page), [1200.0, 150.0, 500.0], atol=0.1)
    expect(page.locator("svg.arm .path")).to_have_count(1)
    page.get_by_role("button", name="Limits along the path").click()
    card = page.locator(".card", has=page.get_by_role("heading", name="Limits along the path"))
    expect(card).to_contain_text("every place is stable up to", timeout=60_000)
    near = {"robot": "tx200", "posture_deg": START}
    places = [[float(cell) for cell in line.split(",")] for line in PATH.splitlines()[1:]]
    found = client.limit_map(near, tooling, places, cut={**CUT, "material": client.materials()[0].name}, speeds=SPEEDS)
    assert f"At {found.best_speed_rpm:.0f} rev/min every place is stable up to {found.limit_everywhere_mm:.2f} mm" in plain(
        card.inner_text()
    )
    page.get_by_role("button", name="Take it away").click()
    expect(along).to_have_count(0)
    # a place that no posture reaches is told by its number
    (tmp_path / "FAR.csv").write_text(PATH + "9000,0,500\n")
    drop(page, "h1", [tmp_path / "FAR.csv"])
    expect(page.locator(".note.bad")).to_contain_text("place 6 of the path")


def test_an_arm_that_is_dropped_is_kept(page: Page, client: Client, tmp_path: Path):
    text = (ROBOTS / "tx200.toml").read_text(encoding="utf-8").replace("Stäubli TX200", "Cell 7")
    (tmp_path / "cell_7.toml").write_text(text, encoding="utf-8")
    drop(page, "h1", [tmp_path / "cell_7.toml"])
    expect(page.get_by_label("Arm", exact=True)).to_have_value("cell_7", timeout=60_000)
    assert [each.label for each in client.robots() if each.name == "cell_7"] == ["Cell 7"]
    expect(page.get_by_label("J6", exact=True)).to_be_visible()
    (tmp_path / "broken.toml").write_text("[robot]\nname = 7\n", encoding="utf-8")
    drop(page, "h1", [tmp_path / "broken.toml"])
    expect(page.locator(".note.bad")).to_contain_text("joints")
    # the trail brings it back
    page.get_by_role("button", name="Forget it").click()
    page.get_by_role("dialog").get_by_role("button", name="Forget it").click()
    expect(page.get_by_label("Arm", exact=True)).to_have_value("tx200", timeout=60_000)
    page.goto(f"{page.url.split('#')[0]}#/changes")
    page.get_by_role("button", name="Restore version 1 of cell_7").click()
    page.get_by_role("button", name="Restore it").click()
    expect(page.locator("#told")).to_contain_text("Version 1 of cell_7 is there again.")
    assert client.robot_file("cell_7") == text
    client.forget_robot("cell_7")


def test_an_arm_without_masses_has_postures_and_no_lobes(opened, served: Served, tooling: str):
    page = opened("#/robots?robot=kr500&tooling=Robot+tool")
    expect(page.get_by_text("No masses are known of this arm")).to_be_visible(timeout=60_000)
    expect(page.get_by_label("A1", exact=True)).to_be_visible()
    assert fact(page, "Mass") == "not known"
    expect(page.get_by_role("heading", name="Stability lobes at this posture")).to_be_hidden()
    page.get_by_label("Arm", exact=True).select_option("kr210")
    expect(page.get_by_role("heading", name="Stability lobes at this posture")).to_be_visible(timeout=60_000)


def test_everybody_can_use_it_and_nothing_sticks_out_on_a_phone(page: Page):
    found = faults(page)
    assert found == {}
    page.set_viewport_size({"width": 390, "height": 844})
    assert page.evaluate("document.documentElement.scrollWidth") == 390
    # the arm stays in sight while a slider below it moves it
    page.get_by_label("J6", exact=True).scroll_into_view_if_needed()
    page.get_by_label("J6", exact=True).focus()
    box = page.locator("svg.arm").bounding_box()
    assert 0.0 <= box["y"] < box["y"] + box["height"] <= 844.0
