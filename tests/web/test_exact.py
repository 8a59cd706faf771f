"""Exact methods on the page: limits over a preview as they come, the answer before until then, and a job that ends with its view."""

from __future__ import annotations

import json
import re
from collections.abc import Callable

import pytest

from api.client import Client
from tests.fixtures import by_hand
from tests.fixtures.service import Served
from tests.fixtures.waiting import until

pytest.importorskip("playwright")
from playwright.sync_api import Page, Route, expect

#: What a method takes minutes for.
SLOW = "method=semi-discretisation&from=3000&to=15000&step=10"
#: Points of another method that are drawn over the preview.
POINTS = """() => (document.querySelector('.chart.lobes .plot').data ?? [])
  .filter((t) => t.mode === 'lines+markers').map((t) => t.x.length)"""


def job_of(page: Page, opened: Callable[..., Page]) -> str:
    """The id of the job that the page follows."""
    events = re.compile(r"/v1/lobes/(\w+)/events")
    return until(lambda: page.wait_for_timeout(50) or [m[1] for r in opened.watch.requests if (m := events.search(r.url))])[-1]  # type: ignore[attr-defined]


def ended(client: Client, job: str) -> str:
    return until(lambda: client.lobe_job(job).job.finished and client.lobe_job(job).job.state)


@pytest.mark.parametrize("leave", ["another view", "another page", "stop"])
def test_limits_come_over_the_preview_until_one_leaves(opened, client: Client, served: Served, shop: str, leave: str):
    """The preview is there at once, what is known of the exact limits is drawn over it; whoever leaves ends the computation."""
    page = opened("#/listen")
    # the service may know this recommended cut from a test before
    held: list[Route] = []
    page.route("**/v1/advice", lambda route: held.append(route))
    page.goto(f"{served.url}/#/change?machine={shop}&tooling=T1&{SLOW}")
    expect(page.locator(".best")).to_contain_text("The lobes are a preview")
    until(lambda: page.wait_for_timeout(50) or held)
    held[0].continue_()
    page.unroute("**/v1/advice")
    expect(page.locator(".chart.lobes .main-svg").first).to_be_visible()
    expect(page.locator(".card h2", has_text="Stability lobes, semi-discretisation")).to_be_visible()
    words = re.compile(r"semi-discretisation: \d+ of 1201 speeds, for \d+:\d\d")
    expect(page.locator(".standing")).to_contain_text(words, timeout=120_000)
    until(lambda: page.wait_for_timeout(100) or sum(page.evaluate(POINTS)))
    job = job_of(page, opened)
    assert client.lobe_job(job).job.state == "running"
    # a browser that is gone without a word ends it, too: the service cancels what nobody follows
    preferences = [r.headers.get("prefer") for r in opened.watch.requests if r.method == "POST" and r.url.endswith("/v1/lobes")]
    assert preferences[-1] == "respond-async, while-watched"
    if leave == "another view":
        page.goto(f"{served.url}/#/toolings")
    elif leave == "another page":
        page.goto(f"{served.url}/docs")
    else:
        page.get_by_role("button", name="Stop").click()
        # the recommended cut does not hang on the lobes beside it
        expect(page.locator(".best[data-rpm]")).to_be_visible()
        expect(page.locator(".standing")).to_contain_text("Stopped")
        assert sum(page.evaluate(POINTS)) > 0
    assert ended(client, job) == "cancelled"


def test_the_whole_answer_is_the_services(opened, client: Client, shop: str):
    page = opened(f"#/change?machine={shop}&tooling=T1&method=full-discretisation&from=8000&to=9000&step=250")
    best = page.locator(".best[data-rpm]")
    expect(best).to_be_visible(timeout=120_000)
    cut = {"immersion": 0.5, "strategy": "down", "feed_direction": "+X", "feed_per_tooth_mm": 0.1}
    speeds = {"from_rpm": 8000, "to_rpm": 9000, "step_rpm": 250}
    (wanted,) = client.lobes(shop, "T1", cut=cut, speeds=speeds, method="full-discretisation").toolings
    # the service may know the recommended cut from a test before: it comes in front of the limits then
    expected = pytest.approx([10.0 if depth is None else depth for depth in wanted.limit_depth_mm], rel=1e-12)
    drawn = "document.querySelector('.chart.lobes .plot').data.find((t) => t.name === 'T1').y"
    until(lambda: page.wait_for_timeout(100) or list(page.evaluate(drawn)) == expected)
    expect(best).to_have_attribute("data-rpm", f"{wanted.recommended[0].spindle_speed_rpm:.10g}")
    expect(page.locator(".standing")).to_be_hidden()
    assert page.evaluate(POINTS) == []


def test_the_answer_before_stays_and_is_marked(opened, shop: str):
    """While the next one is computed, where it is refused, and where it waits for a hand."""
    page = opened(f"#/change?machine={shop}&tooling=T1")
    best, answer, standing = page.locator(".best[data-rpm]"), page.locator(".change-results"), page.locator(".standing")
    expect(best).to_be_visible(timeout=60_000)
    expect(answer).not_to_have_class(re.compile("before"))
    held: list[Route] = []
    page.route("**/v1/lobes", lambda route: held.append(route))
    page.get_by_label("Radial immersion").fill("20")
    expect(standing).to_contain_text("answers the question before")
    expect(answer).to_have_class(re.compile("before"))
    expect(best).to_be_visible()
    until(lambda: page.wait_for_timeout(50) or held)
    held[0].continue_()
    page.unroute("**/v1/lobes")
    expect(answer).not_to_have_class(re.compile("before"))
    expect(standing).to_be_hidden()
    # refused: thirty thousand speeds
    expect(best).to_be_visible(timeout=60_000)
    page.get_by_label("Step").fill("0.5")
    expect(standing).to_contain_text("No lobes")
    expect(answer).to_have_class(re.compile("before"))
    expect(best).to_be_visible()
    # slow methods are asked by hand
    page.get_by_label("Step").fill("500")
    expect(answer).not_to_have_class(re.compile("before"))
    page.get_by_text("Material, spindle, method").click()
    page.get_by_label("Method", exact=True).select_option("time-domain")
    expect(standing).to_contain_text("“Compute” asks this one")
    expect(answer).to_have_class(re.compile("before"))


def test_a_recommended_cut_that_nobody_computes_any_more_is_not_said_to_come(opened, shop: str):
    """Where it is refused, where a question follows that cannot be asked, and where one follows that waits for a hand."""
    page = opened("#/listen")
    held: list[Route] = []
    page.route("**/v1/advice", lambda route: held.append(route))
    page.goto(f"{page.url.split('#')[0]}#/change?machine={shop}&tooling=T1")
    best, standing, immersion = page.locator(".best"), page.locator(".standing"), page.get_by_label("Radial immersion")

    def coming(times: int) -> None:
        until(lambda: page.wait_for_timeout(50) or len(held) == times)
        expect(best).to_contain_text("The recommended cut is being computed")

    def over() -> None:
        expect(best).to_contain_text("No recommended cut has been computed")
        expect(best).not_to_have_attribute("aria-busy", "true")

    coming(1)
    held[0].fulfill(status=422, content_type="application/problem+json", body=json.dumps({"status": 422, "detail": "too much"}))
    expect(standing).to_contain_text("too much")
    over()
    immersion.fill("20")
    coming(2)
    immersion.fill("200")
    over()
    immersion.fill("30")
    coming(3)
    page.get_by_text("Material, spindle, method").click()
    page.get_by_label("Method", exact=True).select_option("full-discretisation")
    expect(standing).to_contain_text("“Compute” asks this one")
    over()


def test_a_place_in_the_queue_in_words(opened):
    page = opened()
    told = page.evaluate(
        """async () => {
          const { wordsOf } = await import(document.querySelector('script[type=module]').src.replace('main.js', 'jobs.js'));
          const waiting = (place, of) => wordsOf({ state: 'queued', queue: { place, waiting: of } });
          return [waiting(1, 1), waiting(3, 5), waiting(12, 20)];
        }"""
    )
    free = "waiting for a free worker"
    assert told == [free, f"third of 5 {free}", f"number 12 of 20 {free}"]


def test_run_out_and_friction_are_asked_and_the_address_holds_everything(opened, client: Client, shop: str):
    page = opened(f"#/change?machine={shop}&tooling=T1&from=8000&to=9000&step=500")
    expect(page.locator(".best")).to_be_visible(timeout=60_000)
    page.get_by_text("Material, spindle, method").click()
    for label, value in (("Run-out", "0 8,5 0 8"), ("Wear land", "80"), ("Indentation", "1e14")):
        page.get_by_label(label).fill(value)
    with page.expect_request(lambda r: r.url.endswith("/v1/lobes") and r.method == "POST") as asked:
        page.get_by_label("Friction of the worn land").fill("0.45")
    cut = asked.value.post_data_json["cut"]
    assert cut["runout_um"] == [0, 8.5, 0, 8]
    assert (cut["friction"], cut["wear_land_um"], cut["indentation"]) == (0.45, 80, 1e14)
    page.get_by_label("At a speed of").fill("8500")
    page.get_by_role("button", name="Real, imaginary").click()
    page.get_by_role("button", name="Y", exact=True).click()
    with page.expect_file_chooser() as chooser:
        page.get_by_role("button", name="Tested cuts").click()
    lines = "spindle_speed_rpm,axial_depth_mm,verdict\n8000,0.05,stable\n8500,30,chatter\n"
    chooser.value.set_files({"name": "tried.csv", "mimeType": "text/csv", "buffer": lines.encode()})
    expect(page.locator(".tested-cuts .reads li")).to_contain_text("tried.csv: 2 of 2", timeout=120_000)
    address = page.url[page.url.index("#") :]
    # one number for four teeth is the service's to refuse, beside the field
    page.get_by_label("Run-out").fill("8")
    expect(page.locator('[data-field="cut.runout_um"] .fault')).to_be_visible()
    page.get_by_label("Run-out").fill("0 2000 0 0")
    expect(page.locator('[data-field="cut.runout_um"] .fault')).to_contain_text("A number for each tooth")
    # a question ends with its page
    page.context.close()
    again = opened(address)
    with again.expect_request(lambda r: r.url.endswith("/v1/lobes") and r.method == "POST") as anew:
        again.reload()
    tested = [{"spindle_speed_rpm": 8000, "axial_depth_mm": 0.05, "verdict": "stable"}]
    tested.append({"spindle_speed_rpm": 8500, "axial_depth_mm": 30, "verdict": "chatter"})
    assert anew.value.post_data_json["cut"] == cut
    assert anew.value.post_data_json["tested"] == tested
    expect(again.locator(".tested-cuts .reads li")).to_contain_text("tried.csv: 2 of 2", timeout=120_000)
    expect(again.get_by_label("Run-out")).to_have_value("0 8.5 0 8")
    expect(again.get_by_label("At a speed of")).to_have_value("8500")
    for name in ("Real, imaginary", "Y"):
        expect(again.get_by_role("button", name=name, exact=True)).to_have_attribute("aria-pressed", "true")


BOXES = """() => [...document.querySelectorAll('.chart.lobes .annotation .bg')].map((e) => {
  const { left, right, top, bottom } = e.getBoundingClientRect();
  return [left, right, top, bottom];
})"""


@pytest.mark.parametrize("width", [1440, 390])
def test_labels_of_pockets_do_not_cover_each_other(opened, client: Client, shop: str, width: int):
    """Also where two toolings have the same pockets; a window that becomes narrow places them anew."""
    client.write_tooling("T1-twin", by_hand.TOOLING.replace("stickout_mm = 60.0", "stickout_mm = 60.5").replace("= 100.0", "= 100.5"))
    page = opened(f"#/change?machine={shop}&tooling=T1&tooling=T1-twin", viewport={"width": 1440, "height": 900})
    expect(page.locator(".chart.lobes .annotation").first).to_be_visible(timeout=60_000)
    page.set_viewport_size({"width": width, "height": 900})

    def apart() -> bool:
        page.wait_for_timeout(100)
        boxes = page.evaluate(BOXES)
        return len(boxes) >= 2 and not any(
            a[0] < b[1] and b[0] < a[1] and a[2] < b[3] and b[2] < a[3] for k, a in enumerate(boxes) for b in boxes[:k]
        )

    until(apart, 30.0)
    client.forget_tooling("T1-twin")


def test_the_lobes_with_their_speed_axis_are_in_sight_with_the_recommended_cut(opened, shop: str):
    page = opened(f"#/change?machine={shop}&tooling=T1", viewport={"width": 1440, "height": 900})
    expect(page.locator(".best[data-rpm]")).to_be_visible(timeout=60_000)
    axis = page.locator(".chart.lobes .g-xtitle")
    expect(axis).to_be_visible()
    bottom, top = (json.loads(page.evaluate(f"JSON.stringify({script})")) for script in (
        "document.querySelector('.chart.lobes .g-xtitle').getBoundingClientRect().bottom",
        "document.querySelector('.best').getBoundingClientRect().top",
    ))  # fmt: skip
    assert top >= 0.0
    assert bottom <= 900.0
    # a warning is pointed out where the cut is recommended, and leads to its words
    page.locator(".best .mark.doubt").click()
    expect(page.locator(".change-results .note.doubt")).to_be_in_viewport()
