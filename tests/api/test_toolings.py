"""The library of toolings."""

from __future__ import annotations

import tomllib
import xml.etree.ElementTree as ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st

from api.work.toolings import MOST_ELEMENTS, tooling_of, weigh
from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.shape import CutterShape
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.io.toml_text import keys_of_toml, toml_of
from rcsa_ident.tool_holder.model import tool_holder_structure
from tests.api.in_process import refused
from tests.fixtures import by_hand
from tests.fixtures.cutters import keys_of as cutter_keys
from tests.fixtures.service import example


def test_a_tooling_file_comes_back_as_it_was_written(client):
    made = client.write_tooling("T1", by_hand.TOOLING)
    assert client.tooling_file("T1") == by_hand.TOOLING
    assert client.tooling("T1") == made
    again = toml_of(made.tooling.model_dump(exclude_none=True))
    assert tooling_of(again).assembly == tooling_of(by_hand.TOOLING).assembly


def test_the_same_keys_as_json_are_the_same_tooling(client, tmp_path):
    client.write_tooling("S1", example())
    path = tmp_path / "S1.toml"
    path.write_text(client.tooling_file("S1"), encoding="utf-8")
    path_too = tmp_path / "S2.toml"
    path_too.write_text(toml_of(example()), encoding="utf-8")
    assert read_tooling(path).assembly == read_tooling(path_too).assembly
    assert tomllib.loads(path.read_text(encoding="utf-8")) == example()


def test_lists_tell_what_a_person_looks_for(client):
    for name in ("b", "a", "c"):
        client.write_tooling(name, example())
    found = list(client.toolings(limit=2))
    assert [t.name for t in found] == ["a", "b", "c"]
    assert (found[0].teeth, found[0].diameter_mm, found[0].label) == (4, 12.0, "S1-ER32")
    assert found[0].stickout_mm == pytest.approx(70.5)


def test_writing_again_and_forgetting(client):
    first = client.write_tooling("S1", example())
    assert client.send("PUT", "/toolings/S1", json=example()).status_code == 200
    changed = example(name="other")
    refused(412, client.write_tooling, "S1", changed, seen="x")
    refused(412, client.forget_tooling, "S1", seen="x")
    second = client.write_tooling("S1", changed, seen=first.etag)
    refused(412, client.send, "PUT", "/toolings/S1", json=changed, headers={"If-None-Match": "*"})
    etag = {"If-None-Match": f'"{second.etag}"'}
    assert client.send("GET", "/toolings/S1", headers=etag).status_code == 304
    assert client.send("GET", "/toolings/S1/drawing", headers=etag).status_code == 304
    client.forget_tooling("S1", seen=second.etag)
    for call in (client.tooling, client.forget_tooling, client.drawing):
        refused(404, call, "S1")


def test_the_drawing_is_svg_that_can_do_nothing(client):
    client.write_tooling("S1", example(name="<script>alert(1)</script>"))
    answer = client.send("GET", "/toolings/S1/drawing")
    assert answer.headers["content-type"] == "image/svg+xml"
    assert "default-src 'none'" in answer.headers["content-security-policy"]
    root = ElementTree.fromstring(answer.text)
    assert root.tag.endswith("svg")
    assert not any(element.tag.endswith("script") for element in root.iter())


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"cutter": {"teeth": 0, "diameter_mm": 12.0}}, "cutter.teeth"),
        ({"cutter": {"teeth": 2, "diameter_mm": 12.0, "pitch_deg": [100.0, 100.0]}}, "cutter.pitch_deg"),
        ({"cutter": {"teeth": 2.5, "diameter_mm": 12.0}}, "cutter.teeth"),
        ({"cutter": {"teeth": 2, "diameter_mm": "12"}}, "cutter.diameter_mm"),
        ({"cutter": {"teeth": 2, "diameter_mm": 12.0, "tooth": 1}}, "cutter.tooth"),
        ({"tool": {"stickout_mm": 700.0, "segments": example()["tool"]["segments"]}}, "tool.stickout_mm + holder.insertion_mm"),
        ({"tool": {"stickout_mm": 70.0, "segments": []}}, "tool.segments"),
        ({"materials": {"carbide": {"density": -1.0}}}, "materials.carbide.density"),
        ({"shank": {}}, "shank"),
    ],
)
def test_the_field_at_fault_is_named_in_json_and_in_toml(client, change, field):
    assert refused(422, client.write_tooling, "S1", example(**change)).errors[0].field == field
    told = refused(422, client.write_tooling, "S1", toml_of(example(**change))).errors[0].field
    assert told == field
    refused(404, client.tooling, "S1")


def test_bad_toml_names_its_line(client):
    assert "line 2, column 7" in refused(422, client.write_tooling, "S1", 'name = "a"\nname =\n').detail
    assert "UTF-8" in refused(422, client.send, "PUT", "/toolings/S1", content=b"\xff", headers={"Content-Type": "application/toml"}).detail
    assert refused(422, client.write_tooling, "S1", "x = " + "[" * 5000).errors[0].field == "tooling"


@pytest.mark.parametrize("name", ["..", ".hidden", "-x", "a" * 65, "a\nb", "a;b", "ä"])
def test_names_are_plain(client, name):
    answer = client.http.put(f"/v1/toolings/{name}".replace("\n", "%0A"), json=example())
    assert answer.status_code in (404, 405, 422)
    assert list(client.toolings()) == []


text = st.text(st.characters(codec="utf-8"), max_size=12)
values = st.recursive(
    st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.booleans() | text,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(text, inner, max_size=3),
    max_leaves=12,
)


@pytest.mark.slow
@given(st.dictionaries(text, values, max_size=5))
def test_what_is_written_reads_back(data):
    assert keys_of_toml(toml_of(data), "tooling") == data


@pytest.mark.slow
def test_a_tooling_that_would_cost_too_much_is_refused_before_it_does():
    """Many tapers; what passes has not more elements than allowed."""
    taper = {"length_mm": 1.0, "outer_diameter_mm": 12.0, "end_diameter_mm": 12.1, "material": "carbide"}
    assembly = tooling_of(toml_of(example(tool={"stickout_mm": 70.0, "segments": [taper] * 150}))).assembly
    with pytest.raises(InputError, match="finite elements"):
        weigh(assembly, 4300.0)
    stack = [dict(taper, length_mm=5.0)] * 22
    assembly = tooling_of(toml_of(example(tool={"stickout_mm": 70.0, "segments": stack}))).assembly
    weigh(assembly, 4300.0)
    # an element has four freedoms of its own in each of two bodies
    assert tool_holder_structure(assembly, 4300.0).mass.shape[0] <= 8 * MOST_ELEMENTS


@pytest.mark.parametrize("shape", CutterShape)
def test_shapes_of_cutters_go_in_and_come_out(client, shape):
    cutter = cutter_keys(shape)
    client.write_tooling("S1", example(cutter=cutter))
    kept = client.tooling("S1").tooling.cutter.model_dump(exclude_none=True)
    assert kept | {"shape": str(shape)} == pytest.approx(cutter | {"helix_deg": 0.0}) if shape is not CutterShape.PROFILE else True
    read = tooling_of(client.tooling_file("S1")).cutter
    assert read.shape is shape
    assert read.profile is not None


def test_teeth_of_their_own_go_in_and_come_out(client):
    cutter = {
        "teeth": 2, "diameter_mm": 12.0, "helix_deg": [38.0, 41.0], "helix_kind": "angle", "runout_mm": [0.0, 0.01],
        "axial_runout_mm": [0.0, 0.02], "tilt_deg": 0.1,
        "serration": {"amplitude_mm": 0.25, "wavelength_mm": 1.5, "shape": "sine", "shift": [0.0, 0.5]},
    }  # fmt: skip
    client.write_tooling("S1", example(cutter=cutter))
    assert client.tooling("S1").tooling.cutter.model_dump(exclude_none=True) == cutter


def test_an_unknown_shape_is_refused_with_the_known_ones(client):
    problem = refused(422, client.write_tooling, "S1", example(cutter={"teeth": 4, "diameter_mm": 12.0, "shape": "round"}))
    assert problem.errors[0].field == "cutter.shape"
    assert all(shape in problem.errors[0].allowed for shape in CutterShape)


def test_what_a_drawing_does_not_tell_goes_in_and_comes_out(client):
    rough = example() | {"spread": {"stickout_mm": 0.3, "contact_damping_percent": 0.0}}
    rough["tool"] |= {"model": "EM12-4"}
    rough["holder"] |= {"model": "PG25", "taper": "HSK-A63"}
    made = client.write_tooling("T1", rough)
    assert client.write_tooling("T2", client.tooling_file("T1")).tooling == made.tooling
    read = tooling_of(client.tooling_file("T1"))
    assert (read.spread.stickout, read.spread.contact_damping, read.tool_model, read.holder_model) == (0.3e-3, 0.0, "EM12-4", "PG25")
    assert read.spread.youngs_modulus == 0.02
    assert client.tooling("T2").tooling.holder.taper == "HSK-A63"
    problem = refused(422, client.write_tooling, "T3", rough | {"spread": {"stickot_mm": 1.0}})
    assert problem.errors[0].field == "spread.stickot_mm"
