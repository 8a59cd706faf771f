"""The editor of a cutter's shape: it asks for what the package draws a shape by, and loses nothing of what a file tells."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterable

import pytest
from playwright.sync_api import expect

from api.client import Client
from rcsa_ident.cutting.outlines import TAKES, Dimensions, key_of, missing
from rcsa_ident.io.settings.cutters import DIMENSIONS
from tests.fixtures import by_hand
from tests.fixtures.waiting import until

_TAKES = """async () => {
  const main = document.querySelector('script[type=module]').src;
  return (await import(main.replace('main.js', 'views/cutter_shape.js'))).TAKES;
}"""


def lacks(shape: str, keys: Iterable[str]) -> bool:
    """Whether the package calls a shape undrawn of which these keys are told."""
    dimensions = {DIMENSIONS[key]: 1e-3 for key in keys if key in DIMENSIONS}
    return bool(missing(shape, 1e-3 if "corner_radius_mm" in keys else 0.0, Dimensions(**dimensions)))


def test_page_and_package_draw_shapes_by_the_same_keys(opened):
    page = opened("#/toolings/new")
    known = page.evaluate(_TAKES)
    assert list(known) == list(TAKES)
    for shape, takes in TAKES.items():
        needs, may, told = (known[shape].get(part, []) for part in ("needs", "may", "told"))
        asked = [*itertools.chain(*needs), *may]
        assert {*asked, *told} == {name if name == "profile" else key_of(name) for name in (*takes.needs, *takes.may)}
        page.get_by_label("Shape", exact=True).select_option(shape)
        fields = page.locator("[data-field^='cutter.']").evaluate_all("boxes => boxes.map((box) => box.dataset.field)")
        keys = [field.removeprefix("cutter.") for field in fields]
        assert [key for key in keys if key in (*DIMENSIONS, "corner_radius_mm", "profile")] == asked
        expect(page.get_by_text("it is computed as a cylinder")).to_be_visible(visible=bool(needs))
        for chosen in itertools.product(*needs):
            if "profile" not in chosen:
                assert not lacks(shape, chosen)
                assert all(lacks(shape, {*chosen} - {key}) for key in chosen)


@pytest.mark.parametrize(
    "told",
    [
        {"cutting_depth_mm": 9.0},
        {"shape": "ball", "corner_radius_mm": 6.0, "cutting_depth_mm": 5.0},
        {"shape": "tapered", "taper_deg": 5.0, "largest_diameter_mm": 14.0},
    ],
)
def test_what_a_file_tells_beside_is_shown_and_kept(opened, client: Client, told):
    lines = "".join(f"{key} = {json.dumps(value)}\n" for key, value in told.items())
    client.write_tooling("T1-told", by_hand.TOOLING.replace("[cutter]\n", f"[cutter]\n{lines}"))
    page = opened("#/toolings/edit/T1-told")
    page.get_by_label("Teeth", exact=True).fill("3")
    page.get_by_role("button", name="Save").click()
    until(lambda: client.tooling("T1-told").tooling.cutter.teeth == 3)
    kept = client.tooling("T1-told").tooling.cutter.model_dump(exclude_none=True)
    assert {key: kept.get(key) for key in told} == told
    client.forget_tooling("T1-told")
