"""What dropped files mean, by the readers that take them in, and without a trace in the store."""

import re

import pytest

from api.schemas.dropped_files import MOST_DIFFERENCES
from tests.api.in_process import refused
from tests.fixtures import by_hand
from tests.fixtures.paths import SAMPLES

HEAD, CUT = (SAMPLES / "campaign.toml").read_text("utf-8").split("[[cuts]]")[:2]
SENSORS = re.sub(r"(?ms)^\[toolings\].*?(?=^\[|\Z)", "", HEAD)
THREE = by_hand.TOOLING.replace("teeth = 4", "teeth = 3")


def campaign(toolings: str, key: str = "S1") -> str:
    return f"{toolings}\n{SENSORS}\n[[cuts]]" + re.sub('tooling = "[^"]*"', f'tooling = "{key}"', CUT)


@pytest.mark.parametrize(
    "toolings",
    ['toolings = { S1 = "toolings/drawn.toml" }', 'toolings.S1 = "toolings/drawn.toml"', "toolings . 'S1' = '''toolings/drawn.toml'''"],
)
def test_a_tooling_is_called_as_the_campaign_calls_its_file(client, toolings):
    """However TOML is written; nothing is stored."""
    found = client.preview({"campaign.toml": campaign(toolings), "drawn.toml": by_hand.TOOLING})
    (only,) = found.toolings
    assert (only.key, only.file, only.listed, only.etag, only.differences) == ("S1", "drawn.toml", True, None, [])
    assert (found.campaign, found.missing, found.from_library) == ("campaign.toml", [], [])
    assert found.name == "HPM sample machine"
    assert found.recordings == [path.rsplit("/")[-1] for path in re.findall(r'"(recordings/[^"]+)"', CUT)]
    assert found.keys["toolings"] == {"S1": "toolings/drawn.toml"}
    assert list(client.toolings()) == []


def test_what_differs_from_the_library_and_what_is_missing(client):
    etag = client.write_tooling("S1", by_hand.TOOLING).etag
    text = campaign('toolings = { S1 = "a.toml", S2 = "b.toml" }')
    found = client.preview({"a.toml": THREE, "c.toml": text, "notes.toml": "x = 1"})
    assert (found.campaign, found.missing, found.others) == ("c.toml", ["S2"], ["notes.toml"])
    assert [(d.field, d.old, d.new) for d in found.toolings[0].differences] == [("cutter.teeth", 4, 3)]
    assert (found.toolings[0].etag, found.toolings[0].differing) == (etag, 1)
    client.write_tooling("S2", by_hand.TOOLING)
    found = client.preview({"c.toml": text})
    assert (found.missing, found.from_library, found.toolings) == ([], ["S1", "S2"], [])


def test_a_tooling_of_many_fields_tells_the_first_that_differ(client):
    """The answer on 200 toolings of 400 segments stays small."""
    segment = '{{ length_mm = {}, outer_diameter_mm = 12.0, material = "carbide" }}'
    drawn = [re.sub(r"segments = .*carbide.*", f"segments = [{', '.join([segment.format(n)] * 40)}]", by_hand.TOOLING) for n in (2.5, 2.6)]
    client.write_tooling("S1", drawn[0])
    (only,) = client.preview({"S1.toml": drawn[1]}).toolings
    assert (only.differing, [d.field for d in only.differences]) == (40, [f"tool.segments.{k}.length_mm" for k in range(40)])
    (only,) = client.preview({"S1.toml": drawn[1].replace("carbide", "steel")}).toolings
    assert (only.differing, len(only.differences)) == (80, MOST_DIFFERENCES)


def test_errors_name_file_and_key(client):
    for files, words in (
        ({"a.toml": "[cutter]\nteeth = 0"}, "a.toml: tool"),
        ({"a.toml": "x = "}, "a.toml: file"),
        ({"c.toml": campaign('toolings = { S1 = "a.toml" }') + "depth = 1", "a.toml": THREE}, "c.toml: cuts[0].depth"),
        ({"c.toml": campaign("[toolings]\n" + "".join(f"T{i} = 'x'\n" for i in range(201)))}, "c.toml: toolings"),
        ({"a.toml": THREE + "#" * 300_000}, "a.toml: tooling"),
        ({"c.toml": campaign(""), "d.toml": campaign("")}, "d.toml"),
    ):
        problem = refused(422, client.preview, files)
        assert words in problem.errors[0].field, problem


def test_tested_cuts_are_read_as_the_commands_read_them(client):
    plain = "spindle_speed_rpm,axial_depth_mm,verdict\n8000,0.5,stable\n9000,3,Chatter\n"
    quoted = '"spindle_speed_rpm";"axial_depth_mm";"verdict"\n"8000";"0,5";"stable"\n"9000";"3";"Chatter"\n'
    cuts = client.tested_cuts(plain).cuts
    assert [(c.spindle_speed_rpm, c.axial_depth_mm, c.verdict) for c in cuts] == [(8000.0, 0.5, "stable"), (9000.0, 3.0, "chatter")]
    assert client.tested_cuts(quoted).cuts == cuts
    assert client.tested_cuts(plain.replace("\n", ",7\n").replace("verdict,7", "verdict,note")).warnings == [
        "the column note is left aside"
    ]
    own = plain.replace("\n", ",up\n").replace("verdict,up", "verdict,strategy")
    assert client.tested_cuts(own).warnings == [
        "strategy: not used here; every cut is evaluated with the width, direction and feed of the question"
    ]
    assert refused(422, client.tested_cuts, plain.replace("8000", "5")).errors[0].field == "cuts[0].spindle_speed_rpm"
    assert "verdict" in refused(422, client.tested_cuts, plain.replace("Chatter", "loud")).errors[0].field
