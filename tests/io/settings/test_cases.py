"""CASES.toml."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.settings.cases import read_cases
from tests.io.conftest import TOOLING

TEXT = """\
[[cases]]
name = "slot"
tooling = "T.toml"
feed_direction = "+Y"
radial_depth_mm = 12.0
feed_per_tooth_mm = 0.05
tests = "CUTS.csv"
idle = ["X=x.frf", "tap.uff"]
[[cases]]
tooling = "T.toml"
radial_depth_mm = 8.4
strategy = "up"
[[cases]]
tooling = "T.toml"
entry_angle_deg = 90
exit_angle_deg = 180
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "T.toml").write_text(TOOLING, encoding="utf-8")
    (tmp_path / "CUTS.csv").write_text("spindle_speed_rpm,axial_depth_mm,verdict\n9000,1,stable\n", encoding="utf-8")
    return tmp_path


def test_cases_as_the_paper_tells_them(folder):
    (folder / "C.toml").write_text(TEXT, encoding="utf-8")
    slot, up, down = read_cases(folder / "C.toml")
    assert (slot.name, up.name, down.name) == ("slot", "case 2", "case 3")
    assert (slot.engagement.entry, slot.engagement.exit) == (0.0, pytest.approx(np.pi))
    assert slot.feed_angle == pytest.approx(0.5 * np.pi)
    assert slot.feed_per_tooth == pytest.approx(5e-5)
    assert slot.cuts is not None
    assert slot.cuts.axial_depth[0] == 1e-3
    assert slot.idle == (f"X={folder}/x.frf", f"{folder}/tap.uff")
    # 70 % of the diameter
    assert up.engagement.exit == pytest.approx(np.arccos(1.0 - 1.4))
    assert (up.cuts, up.idle, up.feed_per_tooth, up.feed_angle) == (None, (), None, 0.0)
    assert (down.engagement.entry, down.engagement.exit) == pytest.approx((0.5 * np.pi, np.pi))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("radial_depth_mm = 8.4", "radial_depth_mm = 12.5", "cases[1].radial_depth_mm: found 12.5"),
        ('strategy = "up"', "", "cases[1].strategy: found nothing"),
        ('strategy = "up"', 'strategy = "climb"', "cases[1].strategy"),
        ("exit_angle_deg = 180", "exit_angle_deg = 90", "cases[2].exit_angle_deg: found 90"),
        ("exit_angle_deg = 180", "", "cases[2].exit_angle_deg: found nothing"),
        ("radial_depth_mm = 8.4", "radial_depth_mm = 8.4\nentry_angle_deg = 10", "given beside radial_depth_mm"),
        ('tests = "CUTS.csv"', 'tests = "NONE.csv"', "NONE.csv: tested cuts: found no such file"),
        ('idle = ["X=x.frf", "tap.uff"]', 'idle = "x.frf"', "cases[0].idle"),
        ('idle = ["X=x.frf", "tap.uff"]', 'idle = [""]', "idle: found an empty text"),
        ('feed_direction = "+Y"', 'feed_direction = "up"', "cases[0].feed_direction"),
        ("[[cases]]\nname", "[[case]]\nname", "case: found an unknown key"),
    ],
)
def test_cases_that_are_not_read(folder, old, new, words):
    assert old in TEXT
    (folder / "C.toml").write_text(TEXT.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_cases(folder / "C.toml")
    assert words in str(caught.value)
