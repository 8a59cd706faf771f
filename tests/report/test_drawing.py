"""Drawings of toolings: valid, to scale, complete, safe."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.io.settings.cutters import CUTTER_KEYS, cutter_of
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.io.validated_table import Table
from rcsa_ident.report.drawing import edge_detail, tooling_svg
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.tool_holder.geometry import MATERIALS, BeamSegment, Contact, ToolAssembly, clamped
from tests.fixtures.cutters import SHAPES, keys_of

TOOLINGS = sorted((Path(__file__).resolve().parents[2] / "data" / "machines" / "toolings").glob("*.toml"))
SVG = "{http://www.w3.org/2000/svg}"
STEEL, CARBIDE = MATERIALS["steel"], MATERIALS["carbide"]


def drawn(tooling: Tooling) -> ElementTree.Element:
    return ElementTree.fromstring(tooling_svg(tooling))


def corners(element: ElementTree.Element) -> list[tuple[float, float]]:
    return [tuple(float(v) for v in pair.split(",")) for pair in element.get("points", "").split()]


def polygons(root: ElementTree.Element, kind: str) -> list[list[tuple[float, float]]]:
    return [corners(p) for p in root.iter(f"{SVG}polygon") if p.get("class") == kind]


def texts(root: ElementTree.Element) -> list[str]:
    return [text.text or "" for text in root.iter(f"{SVG}text")]


@pytest.mark.parametrize("path", TOOLINGS, ids=[p.stem for p in TOOLINGS])
def test_everything_is_drawn_to_one_scale(path):
    """Every corner stands where the tooling has it, in millimetres of the paper."""
    tooling = read_tooling(path)
    assembly = tooling.assembly
    root = drawn(tooling)
    assert root.get("viewBox", "").split()[2] + "mm" == root.get("width")
    assert root.get("viewBox", "").split()[3] + "mm" == root.get("height")
    x = 0.0
    tool = polygons(root, "tool")
    assert len(tool) == len(assembly.tool)
    for segment, points in zip(assembly.tool, tool, strict=True):
        end = x + 1e3 * segment.length
        expected = [(x, -500 * segment.diameter), (end, -500 * segment.end), (end, 500 * segment.end), (x, 500 * segment.diameter)]
        assert points == [pytest.approx(corner, abs=1e-4) for corner in expected]
        x = end
    x = 1e3 * assembly.stickout
    walls = polygons(root, "holder")
    assert len(walls) == 2 * len(assembly.holder)
    for segment, upper, lower in zip(assembly.holder, walls[::2], walls[1::2], strict=True):
        end, bore = x + 1e3 * segment.length, 500 * segment.inner_diameter
        expected = [(x, -500 * segment.diameter), (end, -500 * segment.end), (end, -bore), (x, -bore)]
        assert upper == [pytest.approx(corner, abs=1e-4) for corner in expected]
        assert lower == [(a, -b) for a, b in upper]
        x = end
    # the contact reaches from the holder's nose to the tool's end, on the tool's surface
    contact = [line for line in root.iter(f"{SVG}line") if line.get("class") == "contact"]
    assert len(contact) == 2
    for line in contact:
        assert [float(line.get(key, "")) for key in ("x1", "x2")] == pytest.approx([1e3 * assembly.stickout, 1e3 * assembly.tool_length])
        assert abs(float(line.get("y1", ""))) == pytest.approx(500 * assembly.tool[-1].end)


@pytest.mark.parametrize("path", TOOLINGS, ids=[p.stem for p in TOOLINGS])
def test_dimensions_are_those_of_the_tooling(path):
    tooling = read_tooling(path)
    assembly = tooling.assembly

    def figure(metres: float) -> str:
        return f"{1e3 * metres:.2f}".rstrip("0").rstrip(".")

    found = texts(drawn(tooling))
    wanted = [
        f"stickout {figure(assembly.stickout)}",
        f"insertion {figure(assembly.insertion)}",
        f"holder {figure(assembly.holder_length)}",
    ]
    wanted += [
        f"tip to flange {figure(assembly.stickout + assembly.holder_length)}",
        tooling.name,
        f"cutting Ø{figure(tooling.cutter.diameter)}",
    ]
    wanted += [figure(s.length) for s in (*assembly.tool, *assembly.holder)]
    wanted += [f"Ø{figure(s.inner_diameter)}" for s in assembly.holder]
    wanted += [f"Ø{figure(s.diameter)}" + (f"–{figure(s.end)}" if s.end != s.diameter else "") for s in (*assembly.tool, *assembly.holder)]
    for text in set(wanted):
        assert found.count(text) >= wanted.count(text), text
    # an arrow's line is as long as it says
    root = drawn(tooling)
    lengths = {
        round(float(line.get("x2", "")) - float(line.get("x1", "")), 4)
        for line in root.iter(f"{SVG}line")
        if line.get("class") == "line" and line.get("y1") == line.get("y2")
    }
    for length in (assembly.stickout, assembly.insertion, assembly.holder_length, assembly.stickout + assembly.holder_length):
        assert any(abs(1e3 * length - each) < 2e-4 for each in lengths)


def plain(name: str = "A", teeth: int = 2, contact: Contact | None = None, bore: float = 0.0, insertion: float = 0.0, **more) -> Tooling:
    tool = (BeamSegment(0.05, 0.01, CARBIDE, **more),)
    holder = (BeamSegment(0.03, 0.04, STEEL, bore),)
    return Tooling(name, Cutter(teeth, 0.01), clamped(tool, holder, 0.05 - insertion, insertion, contact))


def test_a_butt_joint_a_solid_holder_and_a_coolant_channel():
    root = drawn(plain(inner_diameter=0.003))
    assert len(polygons(root, "holder")) == 1
    assert not any(text.startswith("insertion") for text in texts(root))
    assert "tool and holder joined rigidly" in texts(root)
    assert "Ø3" in texts(root)
    channel = [line for line in root.iter(f"{SVG}line") if line.get("class") == "hidden"]
    assert sorted(float(line.get("y1", "")) for line in channel) == [-1.5, 1.5]


def test_a_contact_on_a_tapered_shank_follows_it():
    tool = (BeamSegment(0.05, 0.01, CARBIDE, end_diameter=0.02),)
    assembly = ToolAssembly(tool, (BeamSegment(0.04, 0.05, STEEL, 0.02),), 0.02, Contact(1e10, 1e5))
    lines = [line for line in drawn(Tooling("A", Cutter(2, 0.01), assembly)).iter(f"{SVG}line") if line.get("class") == "contact"]
    # at 30 of 50 mm the diameter is 16 mm
    assert sorted(float(line.get("y1", "")) for line in lines) == [-8.0, 8.0]
    assert sorted(float(line.get("y2", "")) for line in lines) == [-10.0, 10.0]


@pytest.mark.parametrize("shape", SHAPES)
def test_a_shape_is_drawn_to_scale_and_its_edge_once_more_by_itself(shape):
    cutter = cutter_of(Table(keys_of(shape), "", "cutter", CUTTER_KEYS))
    tooling = replace(plain(), cutter=cutter)
    root = drawn(tooling)
    (swept,) = polygons(root, "swept")
    assert swept[: len(swept) // 2] == [(x, pytest.approx(-y)) for x, y in reversed(swept[len(swept) // 2 :])]
    for z, r in swept[len(swept) // 2 :]:
        # a floor is one height with many radii, and near one the last digit of a height is many of a radius
        if z > 0.1:
            assert r == pytest.approx(1e3 * cutter.profile.radius_at(min(1e-3 * z, cutter.profile.height)), abs=2e-3)
    (text,) = [text for text in texts(root) if text.startswith("edge ")]
    larger, smaller = (float(part) for part in text.removeprefix("edge ").split(":"))
    (edge,) = [corners(line) for line in root.iter(f"{SVG}polyline") if line.get("class") == "swept"]
    tall = max(x for x, _ in edge) - min(x for x, _ in edge)
    inner, outer = max(y for _, y in edge), min(y for _, y in edge)
    high, scale = tall * smaller / larger, larger / smaller
    assert high <= 1e3 * cutter.profile.height + 1e-3
    # the widest place that is shown is as far from the lowest as it is on the cutter
    inside = max(0.0, 1e3 * max(cutter.profile.outline(1e-3 * high)[:, 0]) - (inner - outer) / scale)
    assert (inner - outer) / scale == pytest.approx(1e3 * max(cutter.profile.outline(1e-3 * high)[:, 0]) - inside, abs=1e-3)
    assert any(f"shape {shape}" in words for words in texts(root)) or shape == "flat"


def test_a_cylinder_has_no_second_view():
    root = drawn(plain())
    assert not list(root.iter(f"{SVG}polyline"))
    assert not any(text.startswith("edge ") for text in texts(root))


@pytest.mark.parametrize(
    ("shape", "scale", "inside"),
    [("bull-nose", 2.0, 1.84), ("ball", 2.0, 0.0), ("face", 2.0, 2.469), ("chamfer", 2.0, 0.0)],
)
def test_the_view_of_an_edge_holds_what_bends(shape, scale, inside):
    profile = cutter_of(Table(keys_of(shape), "", "cutter", CUTTER_KEYS)).profile
    found = edge_detail(profile, 20.0)
    assert (found.scale, round(found.inside, 3)) == (scale, inside)
    bent = max(segment.ends[1] for segment in profile.segments)
    assert found.points[-1, 1] >= 1e3 * bent
    assert np.ptp(found.points[:, 0]) * found.scale <= 20.0


@settings(max_examples=60, deadline=None)
@given(st.text(max_size=40))
def test_any_name_is_text_and_nothing_else(name):
    root = drawn(plain(name))
    assert root.find(f"{SVG}title") is not None
    tags = {element.tag.removeprefix(SVG) for element in root.iter()}
    assert tags <= {"svg", "title", "desc", "style", "defs", "pattern", "rect", "line", "polygon", "text"}


def test_a_name_cannot_leave_its_element():
    svg = tooling_svg(plain('</text><script>alert("1")</script>&amp;'))
    assert "<script" not in svg
    assert "&lt;script&gt;alert(&quot;1&quot;)" in svg
    assert texts(ElementTree.fromstring(svg))[-3] == '</text><script>alert("1")</script>&amp;'


@settings(max_examples=40, deadline=None)
@given(
    lengths=st.lists(st.floats(0.0002, 0.3), min_size=1, max_size=12).filter(lambda each: sum(each) > 0.0041),
    diameters=st.lists(st.floats(0.011, 0.3), min_size=12, max_size=12),
    share=st.floats(0.0, 1.0),
)
def test_nothing_leaves_the_paper_and_no_texts_of_a_row_meet(lengths, diameters, share):
    holder = tuple(BeamSegment(length, d, STEEL, 0.01) for length, d in zip(lengths, diameters, strict=False))
    insertion = max(min(share * sum(lengths), 0.04), 0.004)
    tooling = Tooling("A", Cutter(2, 0.012), clamped((BeamSegment(0.05, 0.01, CARBIDE),), holder, 0.05 - insertion, insertion, None))
    root = drawn(tooling)
    x, y, width, height = (float(v) for v in root.get("viewBox", "").split())
    places = [(float(e.get(a, "")), float(e.get(b, ""))) for e in root.iter(f"{SVG}line") for a, b in (("x1", "y1"), ("x2", "y2"))]
    places = [p for p in places if p != (0.0, 0.0)] + [c for e in root.iter(f"{SVG}polygon") for c in corners(e)]
    assert all(x <= a <= x + width and y <= b <= y + height for a, b in places)
    rows: dict[float, list[tuple[float, float]]] = {}
    for text in root.iter(f"{SVG}text"):
        half = 0.5 * 0.58 * float(text.get("font-size", "")) * len(text.text or "")
        if text.get("text-anchor") == "middle":
            at = float(text.get("x", ""))
            assert x <= at - half
            assert at + half <= x + width
            rows.setdefault(float(text.get("y", "")), []).append((at - half, at + half))
    for spans in rows.values():
        spans.sort()
        assert all(first[1] <= second[0] + 1e-3 for first, second in pairwise(spans))


def test_one_bore_through_several_segments_has_one_label():
    holder = tuple(
        BeamSegment(0.01, d, STEEL, bore) for d, bore in ((0.03, 0.012), (0.04, 0.012), (0.05, 0.012), (0.05, 0.02), (0.05, 0.012))
    )
    tooling = Tooling("A", Cutter(2, 0.01), clamped((BeamSegment(0.05, 0.01, CARBIDE),), holder, 0.03, 0.02, None))
    assert [text for text in texts(drawn(tooling)) if text in ("Ø12", "Ø20")] == ["Ø12", "Ø20", "Ø12"]


def test_the_same_tooling_gives_the_same_drawing():
    assert tooling_svg(plain()) == tooling_svg(plain())
    assert "prefers-color-scheme:dark" in tooling_svg(plain())


@pytest.mark.parametrize("path", TOOLINGS, ids=[p.stem for p in TOOLINGS])
def test_a_brief_drawing_reads_where_it_is_small(path):
    """The same shapes with one dimension, whose letters are a twentieth of the picture's width at least."""
    tooling = read_tooling(path)
    whole, brief = drawn(tooling), ElementTree.fromstring(tooling_svg(tooling, brief=True))
    assert polygons(brief, "tool") == polygons(whole, "tool")
    assert polygons(brief, "holder") == polygons(whole, "holder")
    (text,) = brief.iter(f"{SVG}text")
    assert float((text.text or "").removeprefix("stickout ")) == pytest.approx(1e3 * tooling.assembly.stickout, abs=0.01)
    assert float(text.get("font-size", "0")) > float(brief.get("viewBox", "").split()[2]) / 20.0
