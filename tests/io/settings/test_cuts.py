"""[[cuts]]: what stood around the cutter, there and back, and what no cutter can do."""

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.conditions import Block, CuttingConditions, Engagement, EngagementMap, Stepover
from rcsa_ident.io.settings.cuts import CUT_KEYS, cut_keys, cut_of
from rcsa_ident.io.settings.cutters import CUTTER_KEYS, cutter_of
from rcsa_ident.io.settings.engagements import read_engagement_map
from rcsa_ident.io.toml_text import keys_of_toml, toml_of
from rcsa_ident.io.validated_table import Table
from tests.fixtures import by_hand
from tests.fixtures.cutters import keys_of

CUT = {
    "id": "1", "tooling": "T", "spindle_speed_rpm": 8000.0, "axial_depth_mm": 0.4, "feed_per_tooth_mm": 0.1, "feed_direction": "+X",
    "cut": "1.h5",
}  # fmt: skip
ANGLES = {"entry_angle_deg": 90.0, "exit_angle_deg": 180.0}


def tooling(shape=None):
    if shape is None:
        return by_hand.tooling()
    return replace(by_hand.tooling(), cutter=cutter_of(Table(keys_of(shape), "", "cutter", CUTTER_KEYS)))


def read(keys, shape=None, folder=None):
    def locate(table, key):
        return (folder or by_hand.Path(".")) / table.text(key)

    return cut_of(Table(CUT | keys, "C.toml", "cuts[0]", CUT_KEYS), {"T": tooling(shape)}, locate).conditions


def test_a_plain_cylinder_is_engaged_between_angles():
    assert read(ANGLES).engagement == Engagement(0.5 * np.pi, np.pi)
    assert read({"radial_depth_mm": 6.0, "strategy": "down"}).engagement.entry == pytest.approx(0.5 * np.pi)
    assert read({"stock": "block", "y_from_mm": -6.0, "y_to_mm": 0.0}).engagement.entry == pytest.approx(0.5 * np.pi)
    assert read({"radial_depth_mm": 12.0}).engagement == Engagement(0.0, np.pi)


def test_a_shape_is_engaged_as_it_meets_the_stock():
    down = read(ANGLES, "ball").engagement
    assert (down.width, down.strategy) == (pytest.approx(0.006), "down")
    assert read(ANGLES | {"stock": "stepover"}, "ball").engagement == down
    assert read({"radial_depth_mm": 1.5, "strategy": "up"}, "ball").engagement == Stepover(0.0015, "up")
    block = read(ANGLES | {"stock": "block"}, "ball").engagement
    assert (block.y_from, block.y_to) == (pytest.approx(-0.006), pytest.approx(0.0, abs=1e-15))
    assert read({"y_from_mm": -2.0, "y_to_mm": 3.0}, "ball").engagement == Block(-0.002, 0.003)
    assert read({"entry_angle_deg": 0.0, "exit_angle_deg": 180.0}, "ball").engagement == Engagement(0.0, np.pi)


MAP = EngagementMap([0.0, 0.0, 0.001], np.radians([10.0, 90.0, 20.0]), np.radians([40.0, 120.0, 150.0]), np.radians(15.0))


def test_a_map_is_read_from_a_file_and_row_by_row(tmp_path):
    rows = [[0.0, 10.0, 40.0], [0.0, 90.0, 120.0], [1.0, 20.0, 150.0]]
    lines = [",".join(map(str, row)) for row in rows]
    (tmp_path / "M.csv").write_text("\n".join(["z_mm,entry_angle_deg,exit_angle_deg", *lines]) + "\n", "utf-8")
    for told in ("M.csv", rows):
        found = read({"engagement": told, "lead_deg": 15.0, "tilt_deg": 3.0}, "ball", tmp_path).engagement
        for name in ("z", "start", "end"):
            np.testing.assert_allclose(getattr(found, name), getattr(MAP, name), atol=1e-12)
        assert np.degrees(found.feed_rise) == pytest.approx(15.0)


@pytest.mark.parametrize("engagement", [Engagement(0.3, 2.0), Block(-0.002, 0.003), Stepover(0.0015, "up"), MAP])
def test_written_cuts_read_back(engagement):
    conditions = CuttingConditions(900.0, 0.4e-3, 0.1e-3, engagement, 0.25)
    keys = keys_of_toml(toml_of({"cuts": [cut_keys("1", "T", conditions)]}, digits=12), "campaign")["cuts"][0]
    table = Table(keys, "C.toml", "cuts[0]", CUT_KEYS)
    again = cut_of(table, {"T": tooling("ball")}, lambda own, key: by_hand.Path(own.text(key))).conditions
    assert str(again) == str(conditions)
    assert type(again.engagement) is type(engagement)


BROKEN = [
    ({}, None, "entry_angle_deg", "at least 0"),
    (ANGLES | {"axial_depth_mm": 30.0}, "chamfer", "axial_depth_mm", "at most 5 mm, where the cutter's edge ends"),
    ({"stock": "block", "y_from_mm": 6.5, "y_to_mm": 9.0}, "ball", "y_from_mm", "a block that the cutter reaches"),
    ({"stock": "block", "y_from_mm": 5.0, "y_to_mm": 9.0}, "ball", "engagement", "a cut in which some tooth cuts"),
    ({"stock": "block", "y_from_mm": 2.0, "y_to_mm": 1.0}, "ball", "y_to_mm", "above y_from_mm, 2 [mm]"),
    ({"stock": "block", "y_from_mm": 2.0}, "ball", "y_to_mm", "at least -10000"),
    ({"stock": "wall", **ANGLES}, None, "stock", "one of stepover, block"),
    ({"stock": "stepover", "entry_angle_deg": 30.0, "exit_angle_deg": 90.0}, "ball", "stock", "angles from 0 or to 180"),
    ({"stock": "stepover", "y_from_mm": 0.0, "y_to_mm": 1.0}, "ball", "y_from_mm", "one way to tell the engagement"),
    (ANGLES | {"radial_depth_mm": 2.0, "strategy": "up"}, None, "entry_angle_deg", "without radial_depth_mm"),
    (ANGLES | {"engagement": [[0.0, 10.0, 20.0]]}, None, "entry_angle_deg", "without engagement"),
    ({"radial_depth_mm": 2.0}, None, "strategy", "one of up, down"),
    ({"radial_depth_mm": 13.0, "strategy": "up"}, None, "radial_depth_mm", "at most 12"),
    (ANGLES | {"lead_deg": 3.0}, None, "lead_deg", "a tool that leans needs the map"),
    ({"engagement": [[0.0, 10.0]]}, None, "engagement", "rows of these three numbers"),
    ({"engagement": 3.0}, None, "engagement", "rows of these three numbers"),
    ({"engagement": [[0.0, 40.0, 20.0]]}, None, "engagement", "0 <= start <= end"),
    ({"engagement": [[1.0, 0.0, 20.0], [0.0, 0.0, 20.0]]}, None, "engagement", "heights of 0 or more that never fall"),
]


@pytest.mark.parametrize(("keys", "shape", "key", "words"), BROKEN, ids=[str(i) for i in range(len(BROKEN))])
def test_what_cannot_be_cut_is_refused_in_words(keys, shape, key, words):
    with pytest.raises(InputError) as error:
        read(keys, shape)
    assert error.value.field == f"cuts[0].{key}"
    assert error.value.where == "C.toml"
    assert words in error.value.allowed


def test_teeth_that_meet_in_the_cut_are_refused():
    helix = replace(tooling(), cutter=replace(tooling().cutter, helix=np.radians([10.0, 10.0, 10.0, 80.0])))
    table = Table(CUT | ANGLES | {"axial_depth_mm": 10.0}, "C.toml", "cuts[0]", CUT_KEYS)
    with pytest.raises(InputError, match=r"cuts\[0\]\.axial_depth_mm: found teeth 3 and 4 that meet"):
        cut_of(table, {"T": helix}, lambda own, key: by_hand.Path(own.text(key)))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("z_mm,entry_angle_deg\n0,1\n", "column exit_angle_deg: found nothing"),
        ("z_mm,entry_angle_deg,exit_angle_deg\n0,40,20\n", "M.csv: engagement map angles"),
        ("z_mm,entry_angle_deg,exit_angle_deg\n", "M.csv"),
    ],
)
def test_maps_that_are_not_read(tmp_path, text, words):
    (tmp_path / "M.csv").write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as error:
        read_engagement_map(tmp_path / "M.csv")
    assert words in str(error.value)
