"""Tool libraries of CAM programs: shapes, units, what is assumed, and files that lie."""

from __future__ import annotations

import io
import json
import math
import struct
import tomllib
import tracemalloc
import zipfile

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.io.settings.tool_libraries import Assumptions, file_names, import_tools, read_tool_library
from rcsa_ident.setup.tooling import BareCutter
from rcsa_ident.tool_holder.catalogue import typical_contact
from rcsa_ident.tool_holder.geometry import MATERIALS, Contact
from tests.fixtures.tool_library import END_MILL, HSM, end_mill, inches, library


def imported(*entries, **assumed):
    return import_tools(json.dumps(library(*entries)).encode(), "L.json", Assumptions(**assumed))


def only(entry, **assumed):
    found = imported(entry, **assumed)[0]
    assert found.reason == ""
    return found


def shape(segments):
    return [tuple(round(1e3 * v, 9) for v in (s.length, s.diameter, s.end, s.inner_diameter)) for s in segments]


def test_the_shape_of_tool_and_holder():
    """By hand: tip to spindle, the holder's cones as they stand in the library, cut at the gauge line, bored where the tool sits."""
    found = only(END_MILL)
    assembly, cutter = found.tooling.assembly, found.tooling.cutter
    assert (found.name, found.kind, found.number) == ("VHM 12 R0 long", "flat end mill", 1)
    assert (cutter.teeth, round(1e3 * cutter.diameter, 9)) == (4, 12.0)
    assert shape(assembly.tool) == [(26.0, 9.6, 9.6, 0.0), (78.0, 12.0, 12.0, 0.0)]
    assert shape(assembly.holder) == [
        (2.0, 28.0, 32.0, 12.0), (42.0, 32.0, 32.0, 12.0), (8.0, 32.0, 32.0, 0.0), (17.0, 50.0, 54.0, 0.0), (26.0, 63.0, 63.0, 0.0),
    ]  # fmt: skip
    assert 1e3 * assembly.stickout == pytest.approx(60.0, abs=1e-9)
    assert 1e3 * assembly.insertion == pytest.approx(44.0, abs=1e-9)
    assert {s.material for s in assembly.tool} == {MATERIALS["carbide"]}
    assert {s.material for s in assembly.holder} == {MATERIALS["steel"]}
    # what the library does not know is assumed, and known no better than the catalogue says
    assert assembly.contact == typical_contact("collet").contact
    assert found.tooling.spread == typical_contact("collet").spread
    assert found.tooling.remarks == ()


def test_inches_are_the_same_tool():
    metric, other = only(END_MILL).tooling.assembly, only(inches(END_MILL)).tooling.assembly
    assert shape(metric.tool) == shape(other.tool)
    assert shape(metric.holder) == shape(other.holder)
    assert other.stickout == pytest.approx(metric.stickout, abs=1e-12)
    assert "lengths converted from inches" in only(inches(END_MILL)).notes


def test_the_text_is_the_tooling(tmp_path):
    contact = Contact(2.0e10, 6.0e5, 1.0e5, 40.0)
    found = only(END_MILL, contact=contact)
    (tmp_path / "T.toml").write_text(found.text, encoding="utf-8")
    read = read_tooling(tmp_path / "T.toml")
    assert read.assembly == found.tooling.assembly
    assert read.assembly.contact == contact
    assert (read.name, read.cutter.teeth, read.cutter.helix) == (found.name, 4, found.tooling.cutter.helix)
    assert found.text.startswith("".join(f"# {note}\n" for note in found.notes))


@pytest.mark.parametrize(
    ("entry", "assumed", "note"),
    [
        (END_MILL, {}, "helix angle 30° assumed: none in the library"),
        (END_MILL, {}, "fluted part modelled as a cylinder of 0.8 times the cutting diameter"),
        (END_MILL, {}, "stickout 60 mm, the library's length below the holder (LB)"),
        (END_MILL, {}, "insertion 44 mm assumed: all of the tool behind the holder's nose (OAL and LB); the bore may be shorter"),
        (END_MILL, {}, "holder up to its gauge line, 95 of 135 mm: the rest is inside the spindle"),
        (END_MILL, {}, "contact assumed, that of a collet: chosen for this project's virtual machines, not measured"),
        (end_mill(holder__description="Shrink 12"), {}, "contact assumed, that of a shrink fit: "),
        (END_MILL, {"contact": Contact(1e10, 1e5)}, "contact taken from another tooling"),
        (end_mill(unit=None), {}, "lengths assumed in millimetres: no unit in the library"),
        (end_mill(BMC="hss"), {}, "high-speed steel modelled as steel"),
        (end_mill(BMC="ceramics"), {}, "tool material carbide assumed: the library states ceramics"),
        (end_mill(BMC=None), {}, "tool material carbide assumed: the library states none"),
        (end_mill(geometry__SFDM=None), {}, "shank diameter assumed equal to the cutting diameter: none in the library (SFDM)"),
        (end_mill(holder__gaugeLength=None), {}, "holder up to the end of its last segment, 135 mm: no gauge line in the library"),
    ],
)
def test_what_is_assumed_is_said(entry, assumed, note):
    assert any(each.startswith(note) for each in only(entry, **assumed).notes)


def test_what_is_given_is_not_assumed():
    found = only(end_mill(geometry__FHA=38.0), stickout_mm=50.0, insertion_mm=30.0, flute_ratio=0.75, material="steel")
    assembly = found.tooling.assembly
    assert [round(1e3 * v, 6) for v in (assembly.stickout, assembly.insertion)] == [50.0, 30.0]
    assert shape(assembly.tool) == [(26.0, 9.0, 9.0, 0.0), (54.0, 12.0, 12.0, 0.0)]
    assert assembly.tool[0].material == MATERIALS["steel"]
    assert found.tooling.cutter.helix == pytest.approx(0.6632251157578453)
    assert not any(word in note for note in found.notes for word in ("helix", "stickout", "insertion"))
    assert only(end_mill(geometry__FHA=0)).tooling.cutter.helix == 0.0


def test_neck_and_shaft():
    cones = ((10.0, 11.0, 14.0), (20.0, 14.0, 14.0))
    segments = [{"height": h, "lower-diameter": lower, "upper-diameter": upper} for h, lower, upper in cones]
    tool = end_mill(geometry__SFDM=16.0, **{"geometry__shoulder-diameter": 11.0}) | {"shaft": {"segments": segments, "type": "shaft"}}
    assert shape(only(tool).tooling.assembly.tool) == [
        (26.0, 9.6, 9.6, 0.0), (4.0, 11.0, 11.0, 0.0), (10.0, 11.0, 14.0, 0.0), (20.0, 14.0, 14.0, 0.0), (44.0, 16.0, 16.0, 0.0),
    ]  # fmt: skip


def test_a_cone_is_cut_where_the_tool_ends():
    """Halfway through a cone from 40 to 60 mm its diameter is 50 mm, and the volume stays."""
    tool = end_mill(holder__segments=[{"height": 60.0, "lower-diameter": 40.0, "upper-diameter": 60.0}], holder__gaugeLength=60.0)
    assert shape(only(tool, insertion_mm=30.0).tooling.assembly.holder) == [(30.0, 40.0, 50.0, 12.0), (30.0, 50.0, 60.0, 0.0)]


def test_rounded_figures_leave_the_tool_inside_of_the_holder():
    """Eight thirds of a length lose more by their rounding than a tooling forgives."""
    cones = [{"height": 10.0 / 3.0, "lower-diameter": 30.0, "upper-diameter": 40.0}] * 8
    found = only(end_mill(holder__segments=cones, holder__gaugeLength=None, geometry__OAL=150.0)).tooling.assembly
    assert 1e3 * found.insertion == pytest.approx(80.0 / 3.0, abs=1e-5)
    assert found.insertion <= found.holder_length


@settings(max_examples=50, deadline=None)
@given(
    heights=st.lists(st.floats(5.0, 60.0), min_size=1, max_size=8),
    share=st.floats(0.2, 1.0),
    scale=st.sampled_from([1.0, 25.4]),
    length=st.floats(61.0, 400.0),
)
def test_lengths_add_up_whatever_the_figures(heights, share, scale, length):
    cones = [{"height": h / scale, "lower-diameter": (30.0 + h) / scale, "upper-diameter": (31.0 + 2.0 * h) / scale} for h in heights]
    total = sum(heights)
    tool = end_mill() if scale == 1.0 else inches(end_mill())
    tool["holder"] = {"segments": cones, "gaugeLength": share * total / scale}
    tool["geometry"]["OAL"] = length / scale
    found = imported(tool)[0]
    assert found.reason == ""
    assembly = found.tooling.assembly
    # a gauge line within the rounding of the drawing is the holder's end
    assert 1e3 * assembly.holder_length == pytest.approx(share * total, abs=0.0501)
    assert 1e3 * assembly.insertion == pytest.approx(min(length - 60.0, 1e3 * assembly.holder_length), abs=1e-5)
    assert 1e3 * assembly.stickout == pytest.approx(60.0, abs=1e-5)


SKIPPED = [
    (end_mill(type="drill"), "a drill, not a milling tool"),
    (end_mill(type="thread mill"), "a thread mill, not a milling tool"),
    (end_mill(type="milling body"), "a milling body, a shape that is not known here"),
    (end_mill(type=None), "an entry without a type"),
    (end_mill(geometry__OAL=60.0), "a tool that ends at the holder's nose (OAL and LB); the insertion has to be given"),
    (end_mill(geometry__OAL=None), "data[0].geometry.OAL: found nothing"),
    (end_mill(geometry__NOF=0), "data[0].geometry.NOF: found 0, allowed is a whole number at least 1"),
    (end_mill(geometry__NOF="four"), 'data[0].geometry.NOF: found the text "four"'),
    (end_mill(geometry__DC=-1.0), "data[0].geometry.DC: found -1.0"),
    (end_mill(geometry__RE=6.5), "cutter.corner_radius_mm: found 6.5, allowed is at most half of the diameter, 6 [mm]"),
    (end_mill(geometry__DC=1e300), "cutter.diameter_mm: found"),
    (end_mill(geometry=None), "data[0].geometry: found nothing"),
    (end_mill(unit="furlongs"), 'data[0].unit: found the text "furlongs", allowed is one of millimeters, inches'),
    (end_mill(holder__segments=[{"height": 0.0, "lower-diameter": 1.0, "upper-diameter": 1.0}]), "no height"),
    (end_mill(holder__segments=[{"height": 9.0, "lower-diameter": 0.0, "upper-diameter": 1.0}]), "lower-diameter: found 0.0"),
    (end_mill(holder__segments=[{"height": 9.0}]), "data[0].holder.segments[0].lower-diameter: found nothing"),
    (end_mill(holder__segments=[{"height": 1.0, "lower-diameter": 9.0, "upper-diameter": 9.0}] * 300), "300 segments"),
    (end_mill(geometry__SFDM=40.0), "holder.segments[0].inner_diameter_mm: found 40, allowed is below the outer diameter, 28"),
    (end_mill(description="two\nlines", geometry__NOF="two\nlines"), 'found the text "two lines"'),
    ("a text", "no table of keys"),
]  # fmt: skip


@pytest.mark.parametrize(("entry", "reason"), SKIPPED, ids=[f"{i}" for i in range(len(SKIPPED))])
def test_an_entry_that_cannot_be_a_tooling_says_why_and_the_others_go_on(entry, reason):
    found = imported(entry, END_MILL)
    assert reason in found[0].reason
    assert "\n" not in found[0].reason + found[0].name
    assert found[0].tooling is None
    assert found[0].text == ""
    assert found[1].tooling is not None


@pytest.mark.parametrize(
    "entry", [end_mill(holder=None), end_mill(holder={}), end_mill(holder=None, geometry__OAL=None, geometry__LB=None)]
)
def test_a_cutter_without_a_holder_comes_in_alone(tmp_path, entry):
    """Before, nothing came in of libraries that makers offer, where holders stand elsewhere or nowhere."""
    found = only(entry)
    assert isinstance(found.tooling, BareCutter)
    assert any(note.startswith("[cutter] alone, since the library tells no holder") for note in found.notes)
    (tmp_path / "T.toml").write_text(found.text, encoding="utf-8")
    read = read_tooling(tmp_path / "T.toml", tip_known=True)
    assert isinstance(read, BareCutter)
    assert (read.name, read.cutter.teeth, read.cutter.diameter) == ("VHM 12 R0 long", 4, 0.012)
    assert "\n[tool]" not in found.text


@pytest.mark.parametrize(
    ("unit", "told", "diameter"),
    [
        ("millimeters", "12", 12.0),
        ("millimeters", "12,7", 12.7),
        ("millimeters", "1/2 in", 12.7),
        ("millimeters", '0.5"', 12.7),
        ("millimeters", "12 mm", 12.0),
        ("inches", "0.5", 12.7),
        ("inches", ".5 in", 12.7),
        ("inches", "12 mm", 12.0),
        ("inches", "1.2 cm", 12.0),
    ],
)
def test_numbers_may_be_texts_and_have_units(unit, told, diameter):
    entry = {"type": "flat end mill", "unit": unit, "geometry": {"DC": told, "NOF": "4", "FHA": "38 deg"}}
    cutter = only(entry).tooling.cutter
    assert 1e3 * cutter.diameter == pytest.approx(diameter, rel=1e-12)
    assert (cutter.teeth, math.degrees(cutter.helix)) == (4, pytest.approx(38.0))
    by_expression = entry | {"geometry": {"NOF": 4, "DC": 3.0}, "expressions": {"tool_diameter": told, "tool_numberOfFlutes": "4"}}
    found = only(by_expression)
    assert 1e3 * found.tooling.cutter.diameter == pytest.approx(diameter, rel=1e-12)
    assert any(f"in place of 3 taken from the expression tool_diameter = {told.strip()}" in note for note in found.notes)


@pytest.mark.parametrize("told", ["12 furlongs", "twelve", "tool_diameter / 2", "1/0", ""])
def test_a_text_that_is_no_number_is_refused_by_its_words(told):
    found = imported({"type": "flat end mill", "unit": "millimeters", "geometry": {"DC": told, "NOF": 4}})[0]
    assert found.tooling is None
    assert "geometry.DC: found" in found.reason


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_xml_of_hsmworks(encoding):
    """As the programs write it, in UTF-16, and as others do; with presets, and cones of the holder from the tool's side up."""
    cutter, drill = import_tools(HSM.encode(encoding), "L.hsmlib")
    assert drill.reason == "a drill, not a milling tool"
    assert (cutter.name, cutter.tooling.cutter.teeth) == ("half inch, R 0.03", 3)
    assert 1e3 * cutter.tooling.cutter.diameter == pytest.approx(12.7, rel=1e-12)
    assert 1e3 * cutter.tooling.cutter.corner_radius == pytest.approx(0.762, rel=1e-12)
    assert "preset of the library, where an advice may start: 9000 rev/min, 1524 mm/min" in cutter.notes
    assert "preset Aluminium, where an advice may start: 12000 rev/min, 1016 mm/min" in cutter.notes
    assert shape(cutter.tooling.assembly.holder) == [
        (12.7, 25.4, 31.75, 12.7), (12.7, 31.75, 31.75, 12.7), (25.4, 31.75, 31.75, 0.0), (25.4, 50.8, 50.8, 0.0)
    ]  # fmt: skip


def test_feeds_of_hsmworks_per_revolution_are_no_feeds_per_minute():
    cutter, _ = import_tools(HSM.replace("<motion ", '<motion feed-mode="per-revolution" ').encode("utf-16"), "L.hsmlib")
    assert [note for note in cutter.notes if "preset" in note] == [
        "preset Aluminium, where an advice may start: 12000 rev/min, 1016 mm/min"
    ]


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda text: text[:300], "XML that cannot be read"),
        (lambda text: text.replace("<tool-library", '<!DOCTYPE a [<!ENTITY b "c">]><tool-library'), "a document type"),
        (lambda text: "<html></html>", "no list of tools"),
    ],
)
def test_xml_that_is_no_library_is_refused(spoil, words):
    with pytest.raises(InputError, match=words):
        import_tools(spoil(HSM).encode(), "L.hsmlib")
    with pytest.raises(InputError):
        import_tools(spoil(HSM).encode("utf-16-le"), "L.hsmlib")


def test_presets_are_where_an_advice_may_start():
    presets = [{"name": "Aluminium", "n": 12000, "f_z": 0.05, "v_f": "2400 mm", "stepdown": 2.0}, {"name": "empty"}, "no preset"]
    metric = only(end_mill() | {"start-values": {"presets": presets}})
    words = "preset Aluminium, where an advice may start: 12000 rev/min, 0.05 mm per tooth, 2400 mm/min, depth 2 mm"
    assert [note for note in metric.notes if "preset" in note] == [words]
    imperial = only(inches(END_MILL) | {"start-values": {"presets": [{"name": "a", "f_z": 0.002}]}})
    assert "preset a, where an advice may start: 0.0508 mm per tooth" in imperial.notes


def test_a_holder_of_the_library_serves_tools_without_one():
    spare = {"type": "holder", "description": "Weldon 12", "product-id": "W-12", **END_MILL["holder"]}
    spare["description"] = "Weldon 12"
    bare = end_mill(holder=None)
    for name in ("Weldon 12", "W-12"):
        found = imported(bare, spare, holder=name)
        assert shape(found[0].tooling.assembly.holder) == shape(only(END_MILL).tooling.assembly.holder)
        assert "holder Weldon 12 of the library" in found[0].notes
        assert found[1].reason == "a holder, not a milling tool"
    with pytest.raises(InputError, match=r"holder: found Hydro, 0 times, allowed is one of the library's holders: Weldon 12"):
        imported(bare, spare, holder="Hydro")


def test_names_are_safe_in_toml_and_as_files(tmp_path):
    names = ['Ø12 "long" \\ # x', "../../etc/passwd", "a/b", "A-B", "", "\u0007\u2028", "CON 𝕏 ﷽"]
    for found in imported(*[end_mill(description=name) for name in names]):
        assert tomllib.loads(found.text)["name"] == found.name
    files = file_names([*names, "a b"])
    assert files == ["12-long-x.toml", "etc-passwd.toml", "a-b.toml", "A-B-2.toml", "tool.toml", "tool-2.toml", "CON.toml", "a-b-3.toml"]


def zipped(content: bytes, name: str = "tools.json", method: int = zipfile.ZIP_DEFLATED, more: int = 0) -> bytes:
    raw = io.BytesIO()
    with zipfile.ZipFile(raw, "w", method) as container:
        container.writestr(name, content)
        for i in range(more):
            container.writestr(f"{i}.png", b"")
    return raw.getvalue()


def test_a_container_a_list_and_a_single_tool(tmp_path):
    text = json.dumps(library(END_MILL)).encode()
    for i, raw in enumerate(
        (zipped(text), zipped(text, method=zipfile.ZIP_STORED), json.dumps([END_MILL]).encode(), json.dumps(END_MILL).encode())
    ):
        path = tmp_path / f"{i}.tools"
        path.write_bytes(raw)
        assert [each.tooling is not None for each in read_tool_library(path)] == [True]
    assert import_tools(b"\xef\xbb\xbf" + text, "L.json")[0].tooling is not None


HOSTILE = {
    "empty list": (b'{"data": []}', "no list of tools"),
    "another json": (b'{"data": {"a": 1}}', "no list of tools"),
    "a number": (b"12", "no list of tools"),
    "no json": (b"{'data': []}", "L.json line 1: tool library: found no JSON"),
    "binary": (b"\xff\xfe\x00", "bytes that are not text"),
    "nan": (b'{"data": [{"geometry": {"DC": NaN}}]}', "found NaN, allowed is finite numbers"),
    "deep": (b"[" * 200_000, "JSON"),
    "digits": (b'{"data": [{"geometry": {"DC": ' + b"9" * 6000 + b"}}]}", "numbers too long, or lists nested too deeply"),
    "many": (json.dumps({"data": [{"geometry": {}}] * 30_000}).encode(), "30000 entries, allowed is at most 20000"),
    "many files": (zipped(b"{}", more=200), "1 JSON files among 201"),
    "no file": (zipped(b"{}", "tools.txt"), "0 JSON files among 1"),
    "cut off": (zipped(json.dumps(library(END_MILL)).encode())[:200], "a container that is damaged"),
    "garbled": (zipped(json.dumps(library(END_MILL)).encode()).replace(b"tools.json", b"tools.jsox", 1), "a container that is damaged"),
    "in name only": (b"PK\x03\x04" + struct.pack("<I", 7) * 10, "a container that is damaged"),
}


def costs_one_sentence(raw: bytes, words: str) -> None:
    tracemalloc.start()
    try:
        with pytest.raises(InputError) as caught:
            import_tools(raw, "L.json")
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert words in str(caught.value)
    assert "L.json" in str(caught.value)
    assert peak < 80e6


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_library_costs_one_sentence(name):
    costs_one_sentence(*HOSTILE[name])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "words"),
    [
        (zipfile.ZIP_DEFLATED, "more than 32 MB"),
        (zipfile.ZIP_BZIP2, "a packed file of another method"),
        (zipfile.ZIP_LZMA, "a packed file of another method"),
    ],
)
def test_a_bomb_costs_one_sentence(method, words):
    costs_one_sentence(zipped(b'{"data": [' + b" " * 60_000_000 + b"]}", method=method), words)


@pytest.mark.parametrize(
    ("assumed", "words"),
    [
        ({"flute_ratio": 1.2}, "flute ratio: found 1.2"),
        ({"flute_ratio": float("nan")}, "flute ratio: found nan"),
        ({"helix_deg": 90.0}, "helix: found 90.0"),
        ({"material": "wood"}, "material: found wood, allowed is one of carbide"),
        ({"stickout_mm": 0.0}, "stickout: found 0.0"),
        ({"insertion_mm": -1.0}, "insertion: found -1.0"),
    ],
)
def test_assumptions_have_their_ranges(assumed, words):
    with pytest.raises(InputError, match=words):
        Assumptions(**assumed)


JSON = st.recursive(
    st.none() | st.booleans() | st.floats(allow_nan=False, allow_infinity=False) | st.integers() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(["segments", "height", "lower-diameter", "DC"]), inner),
    max_leaves=6,
)


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(st.data())
def test_any_value_anywhere_gives_a_tooling_or_a_reason(data):
    key = data.draw(st.sampled_from(["geometry", "holder", "shaft", "type", "unit", "BMC", "description", *END_MILL["geometry"]]))
    value = data.draw(JSON)
    tool = end_mill()
    (tool["geometry"] if key in tool["geometry"] else tool)[key] = value
    for found in imported(tool, END_MILL):
        assert (found.tooling is None) == bool(found.reason)
