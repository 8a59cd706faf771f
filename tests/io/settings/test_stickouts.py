"""One tooling at several stickouts."""

from __future__ import annotations

import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.io.settings.stickouts import read_stickouts
from tests.io.conftest import TOOLING


@pytest.fixture
def path(tmp_path):
    # a tool of 110.5 mm, 70.5 mm of it in front of the holder, 12 mm in diameter
    found = tmp_path / "T.toml"
    found.write_text(TOOLING, encoding="utf-8")
    return found


def test_a_shorter_stickout_cuts_the_tool_and_a_longer_one_takes_it_out_of_the_bore(path):
    short, same, long = read_stickouts(path, [0.050, 0.0705, 0.090])
    base = read_tooling(path)
    assert [t.assembly.stickout for t in (short, same, long)] == pytest.approx([0.050, 0.0705, 0.090])
    assert [t.assembly.insertion for t in (short, same, long)] == pytest.approx([0.040, 0.040, 0.0205])
    assert [t.assembly.tool_length for t in (short, same, long)] == pytest.approx([0.090, 0.1105, 0.1105])
    assert same.assembly == base.assembly
    assert long.assembly.holder == base.assembly.holder
    assert short.name == "S1-ER32, 50 mm"
    # the flutes stay in front
    assert short.assembly.tool[0] == base.assembly.tool[0]


@pytest.mark.parametrize("stickout", [0.0, -0.01, 0.0986, 0.12, float("nan")])
def test_a_tool_that_nothing_holds_is_refused(path, stickout):
    with pytest.raises(InputError, match=r"T.toml: stickout: found .* mm, allowed is above 0 and at most 98.5 mm for this tool"):
        read_stickouts(path, [0.05, stickout])


def test_a_butt_joint_stays_one(path):
    text = path.read_text(encoding="utf-8").replace("insertion_mm = 40.0", "insertion_mm = 0.0")
    path.write_text(text.partition("[contact]")[0], encoding="utf-8")
    assert read_stickouts(path, [0.06])[0].assembly.insertion == 0.0


def test_how_well_the_drawing_is_known_stays(path):
    path.write_text(TOOLING + "[spread]\nfluted_diameter_percent = 1.5\n", encoding="utf-8")
    base = read_tooling(path)
    assert base.spread.fluted_diameter == pytest.approx(0.015)
    for each in read_stickouts(path, [0.050, 0.090]):
        assert (each.spread, each.tool_model, each.holder_model) == (base.spread, base.tool_model, base.holder_model)
