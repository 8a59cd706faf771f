"""Programs of machines: what is read, what is refused by its line, and the way out and back."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import to_rpm
from rcsa_ident.io.paths import gcode
from rcsa_ident.io.paths.gcode import Kept, gcode_of, kept_words, read_gcode, write_gcode
from rcsa_ident.toolpath.path import RAPID, ToolPath
from tests.fixtures.paths import ROOT

POCKET = ROOT / "tests" / "fixtures" / "programs" / "pocket.nc"
AT_ZERO = "G21 G90 G0 X0 Y0 Z0\n"


def places(text: str) -> list[list[float]]:
    """In millimetres, of a program that begins at the zero."""
    return (1e3 * gcode_of(AT_ZERO + text, "P.nc").places[1:]).round(9).tolist()


def test_a_pocket():
    path = read_gcode(POCKET)
    blocks = POCKET.read_text().splitlines()

    def lengths(first: str, last: str) -> float:
        """Of the moves from one block to another."""
        begin, end = (next(k for k, block in enumerate(blocks, start=1) if block.startswith(f"{name} ")) for name in (first, last))
        return 1e3 * path.lengths[(path.line[1:] >= begin) & (path.line[1:] <= end)].sum()

    # the first place is the one where all axes are told, the last one where the tool has left the stock
    assert (1e3 * path.places[0]).tolist() == [20.0, 20.0, 15.0]
    assert (1e3 * path.places[-1]).tolist() == [45.0, 20.0, 15.0]
    assert path.tool.tolist() == [2] * len(path)
    assert to_rpm(path.speed, 6).tolist() == [8000.0] * len(path)
    assert not path.cutting[0]
    assert not path.cutting[-1]
    assert path.places[:, 2].min() == -0.003
    turn = 2.0 * math.pi * 6.0
    assert lengths("N75", "N85") == pytest.approx(turn + 2.0 * math.hypot(turn, 2.0), abs=0.02)
    # the wall is a rectangle with round corners, entered and left on half circles
    assert lengths("N125", "N175") == pytest.approx(7 + 34 + 14 + 34 + 7 + 2.0 * math.pi * 8.0 + 2.0 * math.pi * 5.0, abs=0.02)
    assert (6e4 * path.feed[path.places[:, 1] > 0.03]).round(9).tolist() == [1200.0] * int(np.sum(path.places[:, 1] > 0.03))


def test_state_lasts_until_told_otherwise():
    path = gcode_of("G90 G0 X1 Y2 Z3\ng1 f600 s5000 x 4\nY5\n;nothing\nG91\nX1 Z-1 (a step)\nM5\nX1", "P.nc")
    assert (1e3 * path.places).round(9).tolist() == [[1, 2, 3], [4, 2, 3], [4, 5, 3], [5, 5, 2], [6, 5, 2]]
    assert path.line.tolist() == [1, 2, 3, 6, 8]
    assert path.feed.tolist() == [RAPID, 0.01, 0.01, 0.01, 0.01]
    assert to_rpm(path.speed, 6)[1:].tolist() == [5000.0, 5000.0, 5000.0, 0.0]


def test_inches():
    path = gcode_of("G20 G90 G0 X0 Y0 Z0\nG1 X1 F10\nG2 X2 Y-1 J-1\nG21 G1 X0 Y0", "P.nc")
    assert path.places[1].tolist() == pytest.approx([0.0254, 0.0, 0.0])
    assert path.feed[1] == pytest.approx(254.0 / 6e4)
    assert path.places[-1].tolist() == [0.0, 0.0, 0.0]
    assert path.places[-2].tolist() == pytest.approx([0.0508, -0.0254, 0.0])


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("G1X10.Y-.5F1.", [[10.0, -0.5, 0.0]]),
        ("N10 G01 X+1 ( a; b ) Y2 ; c", [[1.0, 2.0, 0.0]]),
        ("G1 X1 (one) Y2 (two)", [[1.0, 2.0, 0.0]]),
        ("/M8\nG1 X1", [[1.0, 0.0, 0.0]]),
        ("G4 P2.5\nG4 X1\nG1 X1", [[1.0, 0.0, 0.0]]),
        ("G17 G40 G49 G80 G94 G54 G64 P0.01\nG1 X1", [[1.0, 0.0, 0.0]]),
        ("M98.5\nG1 X1", [[1.0, 0.0, 0.0]]),
        ("G1 X1\nM30\nX2", [[1.0, 0.0, 0.0]]),
        ("G1 X1\n%\nX2", [[1.0, 0.0, 0.0]]),
        ("G1 X1\n% the second pass\nX2\n%", [[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]),
        ("G0 G17 G40 G49 G80 G90 X3", [[3.0, 0.0, 0.0]]),
        ("G91 G28 A0. C0\nG90 G0 X1 A0. B-0.0", [[1.0, 0.0, 0.0]]),
        ("G187 P1 E0.01\nG05 P10000\nG08 P1\nG05.1 Q1\nG54.1 P3\nG1 X1\nG54.1 P3\nG05.1 Q0 X0 Y0 Z0", [[1.0, 0.0, 0.0]]),
        ("G154 P2\nG1 X1", [[1.0, 0.0, 0.0]]),
        # a retracted tool stands at the highest that is told, before it goes aside
        ("G1 X1 Z-2\nG91 G28 Z0\nG90 G0 X5\nZ9", [[1.0, 0.0, -2.0], [1.0, 0.0, 9.0], [5.0, 0.0, 9.0], [5.0, 0.0, 9.0]]),
        ("G0 Z9\nG1 Z-2\nG0 G53 Z0\nG0 X5\nZ-2", [[0, 0, 9], [0, 0, -2], [0, 0, 9], [5, 0, 9], [5, 0, -2]]),
        # told again in one line with the others: across, then down
        ("G0 Z9\nG1 Z-2\nG91 G30 Z0\nG90 G0 X5 Z-2", [[0, 0, 9], [0, 0, -2], [0, 0, 9], [5, 0, 9], [5, 0, -2]]),
        # nothing else is told behind it
        ("G0 Z9\nG1 X1 Z-2\nG28\nM30", [[0, 0, 9], [1, 0, -2], [1, 0, 9]]),
        ("G1 X1\nG0 G53 Z0", [[1.0, 0.0, 0.0]]),
        # X and Y stay where they were until they are told
        ("G0 Z9\nG1 X1 Y1 F60\nG53 G0 X0 Y0\nG0 Y5\nX7", [[0, 0, 9], [1, 1, 9], [1, 5, 9], [7, 5, 9]]),
    ],
)
def test_ways_of_writing(text, expected):
    assert places(text) == expected


def test_a_program_begins_at_its_zero():
    assert (1e3 * gcode_of("G1 X10 F60\nG91 Y1", "P.nc").places).round(9).tolist() == [[0, 0, 0], [10, 0, 0], [10, 1, 0]]
    # one that says where it begins does not
    assert len(gcode_of("G1 X900 Y0 Z500 F60\nX901", "P.nc")) == 2
    assert (1e3 * gcode_of("G0 X1 Y1\nG0 Z5\nG1 Z0", "P.nc").places).round(9).tolist() == [[1, 1, 5], [1, 1, 0]]


def test_before_all_axes_are_told_nothing_is_a_move():
    for start in ("G0 Z50\nG0 X10 Y10", "G0 X90 Z70\nG91 G28 X0 Y0 Z0\nG90 G0 Z50\nX10 Y10", "G28 G90 X0 Y0 Z0\nG0 X10 Y10\nZ50"):
        path = gcode_of(f"{start}\nG1 Z-1 F60", "P.nc")
        assert (1e3 * path.places).round(9).tolist() == [[10, 10, 50], [10, 10, -1]]
        assert path.feed[0] == RAPID
    # a height that is told there counts among the highest
    path = gcode_of("G0 Z70\nX10 Y10 Z50\nG1 Z-1 F60\nG28", "P.nc")
    assert (1e3 * path.places[-1]).round(9).tolist() == [10, 10, 70]
    # a feed move that leaves what was told begins there, one that tells all else does not
    assert (1e3 * gcode_of("G0 Z5\nG1 X1 Y1 Z0 F60", "P.nc").places).round(9).tolist() == [[0, 0, 5], [1, 1, 0]]
    assert (1e3 * gcode_of("G0 Z5\nG1 X1 Y1 Z5 F60", "P.nc").places).round(9).tolist() == [[1, 1, 5]]


RETRACTED = """\
G21 G90 T1 M6
G0 X80 Y-20
G0 Z50
G1 Z-8 F600
G1 Y60
G91 G28 Z0
G90
T2 M6
G0 X-20 Y-20
G0 Z-8
G1 X80
G28
M30
"""


def test_a_retract_by_home_stays_one(tmp_path):
    """No rapid move of the written program goes across below the clearance, or down into the part but straight."""
    source, out = tmp_path / "P.nc", tmp_path / "OUT.nc"
    source.write_text(RETRACTED)
    path = read_gcode(source)
    kept, led = kept_words(source)
    assert led == [6, 12]
    assert (1e3 * path.places[2:]).round(9).tolist() == [
        [80, 60, -8],
        [80, 60, 50],
        [-20, -20, 50],
        [-20, -20, -8],
        [80, -20, -8],
        [80, -20, 50],
    ]
    for words in (kept, ()):
        write_gcode(out, path, kept=words)
        again = read_gcode(out)
        same(again, path)
        rapid = ~again.cutting
        across = np.linalg.norm(again.moves[:, :2], axis=1) > 0.0
        assert np.all(again.moves[rapid & across, 2] == 0.0)
        assert np.all(again.places[:-1][rapid & across, 2] == 0.05)
        written = out.read_text().splitlines()
        assert written.index(next(each for each in written if "T2" in each)) > written.index("G0 X80.0000 Y60.0000 Z50.0000")


@pytest.mark.parametrize(
    ("height", "feed", "first"),
    [
        (50.0, RAPID, "G0 Z50.0000"),
        (50.0, 0.01, "G0 Z50.0000"),
        (50.0, np.nan, "G0 Z50.0000"),
        # a correction lifts a place at a feed above it
        (49.96, RAPID, "G0 Z49.9600"),
        # one below the others: down there the way across is not known to be free
        (-8.0, RAPID, "G0 X10.0000 Y20.0000"),
        (-8.0, 0.01, "G0 X10.0000 Y20.0000"),
    ],
)
def test_the_first_place_is_reached_by_straight_lines(tmp_path, height, feed, first):
    file = tmp_path / "P.nc"
    path = ToolPath(1e-3 * np.array([[10.0, 20.0, height], [30.0, 20.0, -8.0], [30.0, 20.0, 50.0]]), feed=[feed, 0.01, 0.01])
    write_gcode(file, path)
    lines = file.read_text().splitlines()
    assert lines[2] == first
    assert f" X10.0000 Y20.0000 Z{height:.4f}" in lines[3]
    same(read_gcode(file), path)


def test_the_tool_changes_by_m6_where_a_program_has_it():
    assert gcode_of("T1 M6\nG0 X0 Y0 Z0\nT2\nX1\nM6\nX2", "P.nc").tool.tolist() == [1, 1, 2]
    assert gcode_of("T3\nG0 X0 Y0 Z0\nX1", "P.nc").tool.tolist() == [3, 3]


def test_an_arc_of_each_plane():
    """A quarter counterclockwise about each axis turns its first axis into the second."""
    for plane, text, centre in (
        ("G17", "X-10 Y10 I-10", (-10, 0, 0)),
        ("G18", "Z-10 X10 K-10", (0, 0, -10)),
        ("G19", "Y-10 Z10 J-10", (0, -10, 0)),
    ):
        path = gcode_of(f"{AT_ZERO}{plane} G3 {text} F60", "P.nc")
        assert np.linalg.norm(1e3 * path.places - centre, axis=1) == pytest.approx(10.0)
        assert path.length == pytest.approx(0.005 * math.pi, rel=1e-4)
        other = gcode_of(f"{AT_ZERO}{plane} G2 {text} F60", "P.nc")
        assert other.length == pytest.approx(0.015 * math.pi, rel=1e-4)


def test_centres_may_be_absolute():
    path = gcode_of(f"{AT_ZERO}G1 X5 F60\nG90.1\nG2 X5 Y0 I10 J0\nG91.1 G3 I-5", "P.nc")
    assert path.length == pytest.approx(0.005 + 0.02 * math.pi, rel=1e-4)


length = st.floats(-200.0, 200.0).map(lambda v: round(v, 3))


@given(
    radius=st.floats(0.1, 500.0),
    begin=st.floats(0.0, 6.28),
    turn=st.floats(0.05, 6.2),
    clockwise=st.booleans(),
    by_radius=st.booleans(),
    depth=length,
    tolerance=st.sampled_from([1e-3, 1e-4, 1e-6]),
)
def test_arcs_have_the_length_and_area_of_their_circle(radius, begin, turn, clockwise, by_radius, depth, tolerance):
    sign = -1.0 if clockwise else 1.0
    x, y = radius * math.cos(begin), radius * math.sin(begin)
    a, b = radius * math.cos(begin + sign * turn), radius * math.sin(begin + sign * turn)
    # near half a circle two centres are one within rounding
    by_radius = by_radius and abs(turn - math.pi) > 0.01
    told = f"R{radius if turn < math.pi else -radius:.12f}" if by_radius else f"I{-x:.12f} J{-y:.12f}"
    path = gcode_of(
        f"G0 X{x:.12f} Y{y:.12f} Z0\nG{2 if clockwise else 3} X{a:.12f} Y{b:.12f} Z{depth} {told} F60", "P.nc", 1e-3 * tolerance
    )
    at = 1e3 * path.places
    assert at[-1] == pytest.approx([a, b, depth], abs=1e-6)
    away = np.linalg.norm(at[:, :2], axis=1) - radius
    assert np.abs(away).max() < 1e-5 * radius + 1e-6
    middles = np.linalg.norm(0.5 * (at[1:, :2] + at[:-1, :2]), axis=1)
    assert (radius - middles).max() <= tolerance * (1.0 + 1e-6) + 1e-5 * radius * by_radius + 1e-9
    step = turn / (len(at) - 1)
    flat = np.linalg.norm(np.diff(at[:, :2], axis=0), axis=1).sum()
    assert flat == pytest.approx(radius * turn * math.sin(step / 2) / (step / 2), rel=1e-5)
    area = 0.5 * np.sum(at[:-1, 0] * at[1:, 1] - at[1:, 0] * at[:-1, 1])
    assert area == pytest.approx(sign * 0.5 * radius**2 * turn * math.sin(step) / step, rel=1e-4)
    # no more chords than needed
    assert len(at) - 2 <= turn / (2.0 * math.acos(max(1.0 - tolerance / radius, 0.0))) + 1.0


def test_arcs_turn_several_times():
    """P as LinuxCNC has it, the last turn counted; TURN of Sinumerik counts further ones, and CR is the radius."""
    helix = gcode_of(f"{AT_ZERO}G3 X-10 Y10 Z-6 I-10 P3 F60", "P.nc")
    assert helix.length == pytest.approx(1e-3 * math.hypot(10.0 * (0.5 * math.pi + 4.0 * math.pi), 6.0), rel=1e-4)
    assert (1e3 * helix.places[-1]).round(9).tolist() == [-10.0, 10.0, -6.0]
    np.testing.assert_array_equal(gcode_of(f"{AT_ZERO}G3 X-10 Y10 Z-6 I-10 TURN=2 F60", "P.nc").places, helix.places)
    by_radius, sinumerik = (gcode_of(f"{AT_ZERO}G3 X-10 Y10 {word} F60", "P.nc").places for word in ("R10", "CR=10"))
    np.testing.assert_array_equal(by_radius, sinumerik)


def test_a_full_circle_needs_its_centre():
    path = gcode_of(f"{AT_ZERO}G2 I10 F60", "P.nc")
    assert path.length == pytest.approx(0.02 * math.pi, rel=1e-4)
    refused("G2 X0 Y0 R10", "R", "full circle")


def refused(text: str, field: str, words: str, line: int = 2) -> None:
    with pytest.raises(InputError) as caught:
        gcode_of(AT_ZERO + text, "P.nc")
    assert caught.value.field == field, caught.value
    assert words in str(caught.value)
    assert caught.value.where == f"P.nc line {line}"


@pytest.mark.parametrize(
    ("text", "field", "words"),
    [
        ("G41 D1 X1", "block", "radius correction"),
        ("G87 X1 R2 Z-1 Q1", "block", "steps aside"),
        ("G81 X1 R2", "cycle", "without Z or R"),
        ("G81 X1 Z5 R2", "cycle", "goes down"),
        ("G83 X1 Z-5 R2", "Q", "the step of a hole"),
        ("G83 X1 Z-5 R2 Q1e-5".replace("1e-5", ".00001"), "Q", "at most 10000"),
        ("G81 X1 Z-5 R2 K1.5", "K or L", "whole number"),
        ("G81 X1 Z-5 R2 I1", "cycle", "I or J"),
        ("G18 G81 X1 Z-5 R2", "cycle", "another plane"),
        ("G0 G81 X1 Z-5 R2", "block", "G0 and G81"),
        ("G1 X5 L2", "block", "repeats holes"),
        ("G1 X5 Q2", "block", "Q that nothing reads"),
        ("G0 X5 ,R1", "block", "moves by G1"),
        ("G1 X5 ,R1 ,C1", "block", "one corner"),
        ("G1 X5 ,R0", ",R", "greater than 0"),
        ("G5 X1 Y1 I1 J1 P1 Q1", "block", "splines"),
        ("G2 X10 I5 P1.5", "P", "how many turns"),
        ("G2 X10 RND=5", "block", "macros"),
        ("G1 X1 A5.", "block", "at 0 alone"),
        ("G95", "block", "per minute"),
        ("G93", "block", "per minute"),
        ("G92 X0", "block", "one of G0"),
        ("G0 G1 X1", "block", "G0 and G1"),
        ("G90 G91 X1", "block", "G90 and G91"),
        ("M98 P1", "block", "subprograms"),
        ("#1=5", "block", "macros"),
        ("G1 X[1+2]", "block", "macros"),
        ("G1 X10,5", "block", ",5"),
        ("G1 X1e5", "block", "E"),
        ("G1 Xnan", "block", "NAN"),
        ("G1 X", "block", "X"),
        ("G1 X--5", "block", "X--5"),
        ("G1 X1.2.3", "block", ".3"),
        ("G1 X1 X2", "block", "once"),
        ("G1 A90", "block", "other axes"),
        ("G1 X1 (open", "block", "(OPEN"),
        ("G1 X1 F0", "F", "greater than 0"),
        ("S-5", "S", "0 or more"),
        ("T1.5", "T", "tool"),
        ("G1 X1 I2", "block", "arcs"),
        ("G80 X1", "block", "G0 to G3"),
        ("G16 X1", "block", "one of G0"),
        ("G2 X1", "arc", "neither"),
        ("G2 X1 I1 R1", "arc", "both"),
        ("G2 X1 K1 I1", "K", "I and J"),
        ("G2 X10 R4", "R", "half the way"),
        ("G2 X10 Y0 I4 J0", "centre of the arc", "6 mm"),
        ("G2 X10 I0 J0", "centre of the arc", "begins"),
        ("G2 I99999999", "I", "at most"),
        ("/G1 X5", "block", "switch"),
        ("G53 G1 X5", "block", "G53 G0"),
        ("G1 X1" + " " * 1000, "line", "1000"),
    ],
)
def test_what_would_change_the_path_is_refused_by_its_line(text, field, words):
    refused(text, field, words)


def test_what_depends_on_lines_before_is_refused():
    refused("G54\nG55", "block", "G55 after G54", 3)
    refused("G28 Z0\nG1 Z-1 F60", "Z", "G0 Z", 3)
    refused("G28 Z0\nG91 G0 Z-1", "Z", "G90", 3)
    with pytest.raises(InputError, match="before them"):
        gcode_of("X1 Y2 Z3", "P.nc")
    for empty in ("(nothing)\n", "G21\n", "G0 X5\n", "%\n%\n"):
        with pytest.raises(InputError, match="no move"):
            gcode_of(empty, "P.nc")


def test_files_of_strangers_are_bounded(monkeypatch, tmp_path):
    monkeypatch.setattr(gcode, "MOST_PLACES", 1000)
    refused("G2 I-5000 F60", "places", "1000")
    refused("G91\n" + "G3 I-1 F60\n" * 50, "places", "1000", 17)
    with pytest.raises(InputError, match="lines"):
        gcode_of("\n" * 1001, "P.nc")
    monkeypatch.setattr(gcode, "LARGEST_PROGRAM", 1000)
    large = tmp_path / "P.nc"
    large.write_text("G0 X0 Y0 Z0\n" * 100)
    with pytest.raises(InputError, match="MB"):
        read_gcode(large)
    large.write_bytes(b"\0\1\2" * 10)
    with pytest.raises(InputError, match="binary"):
        read_gcode(large)


def test_hostile_lines_cost_no_time():
    start = time.process_time()
    for line in ("X1" * 500, "(" * 1000, "1" * 1000, "X" + "1" * 998 + "Z", "G1X" + "." * 990, "()" * 490 + "(", '"' * 900):
        with pytest.raises(InputError):
            gcode_of(f"{AT_ZERO}{line}", "P.nc")
    # milliseconds; an expression that goes back and forth over such a line takes minutes
    assert time.process_time() - start < 5.0


rows = st.lists(
    st.tuples(length, length, length, st.booleans(), st.sampled_from([100.0, 250.5, 3000.0]), st.sampled_from([0.0, 500.0, 18700.25])),
    min_size=1,
    max_size=20,
)


def path_of(rows, tool=0) -> ToolPath:
    table = np.array([row[:3] for row in rows])
    feed = [RAPID if rapid else f / 6e4 for *_, rapid, f, _ in rows]
    return ToolPath(1e-3 * table, feed=feed, speed=[math.pi / 30 * row[5] for row in rows], tool=[tool] * len(rows))


def same(found: ToolPath, told: ToolPath) -> None:
    np.testing.assert_allclose(found.places, told.places, atol=1e-15)
    np.testing.assert_allclose(found.feed, told.feed, rtol=1e-14)
    np.testing.assert_allclose(found.speed, told.speed, rtol=1e-12)
    assert found.tool.tolist() == told.tool.tolist()


@pytest.mark.slow
@given(rows=rows, tool=st.integers(0, 99))
def test_a_written_program_is_read_back(rows, tool, tmp_path_factory):
    file = tmp_path_factory.mktemp("programs") / "P.nc"
    told = path_of(rows, tool)
    write_gcode(file, told)
    same(read_gcode(file), told)


@given(rows=rows, data=st.data())
def test_a_program_may_be_written_in_many_ways(rows, data):
    """Absolute or in steps, millimetres or inches, in capitals or not, with numbers, comments and blanks."""
    told = path_of(rows)
    lines, at = [], np.zeros(3)
    for k, (place, (*_, rapid, feed, speed)) in enumerate(zip(1e3 * told.places, rows, strict=True)):
        inch, steps = data.draw(st.booleans()), k > 0 and data.draw(st.booleans())
        size = 25.4 if inch else 1.0
        values = (place - at if steps else place) / size
        words = [f"G{20 if inch else 21}", f"G{91 if steps else 90}", f"G0{0 if rapid else 1}"]
        words += [f"{letter}{value:.12f}" for letter, value in zip("XYZ", values, strict=True)]
        words += [] if rapid else [f"F{feed / size:.12f}"]
        words += [f"S{speed}", "M3"]
        words = data.draw(st.permutations(words))
        joint = data.draw(st.sampled_from(["", " ", "  ", " (a remark) ", "\t"]))
        line = data.draw(st.sampled_from(["", f"N{10 * k} "])) + joint.join(words) + data.draw(st.sampled_from(["", " ; end", "(end)"]))
        lines.append(line.lower() if data.draw(st.booleans()) else line)
        at = place
    found = gcode_of("\n".join(lines), "P.nc")
    np.testing.assert_allclose(found.places, told.places, atol=1e-13)
    np.testing.assert_allclose(found.feed, told.feed, rtol=1e-10)
    np.testing.assert_allclose(found.speed, told.speed, rtol=1e-10)
    assert found.line.tolist() == list(range(1, len(rows) + 1))


def test_what_no_program_says_is_not_written(tmp_path):
    two = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.2, 0.0, 0.0]])
    with pytest.raises(InputError, match="leans"):
        write_gcode(tmp_path / "P.nc", ToolPath(two, axes=np.tile([0.0, 1.0, 1.0], (3, 1))))
    with pytest.raises(InputError, match="ends on the way"):
        write_gcode(tmp_path / "P.nc", ToolPath(two, feed=[0.1, 0.1, np.nan]))
    # untold ones are kept so
    write_gcode(tmp_path / "P.nc", ToolPath(two))
    assert np.isnan(read_gcode(tmp_path / "P.nc").feed).all()


def test_finer_places_where_wanted(tmp_path):
    path = ToolPath(np.array([[0.0, 0.0, 0.0], [0.0123456789, 0.0, 0.0]]))
    for decimals, away in ((4, 1e-7), (7, 1e-10)):
        write_gcode(tmp_path / "P.nc", path, decimals)
        assert abs(read_gcode(tmp_path / "P.nc").places[1, 0] - path.places[1, 0]) < away


def test_what_moves_nothing_is_kept_at_its_place(tmp_path):
    """Of a pocket: the same path, and around it what the machine needs."""
    kept, led = kept_words(POCKET)
    assert led == [6, 45, 47]
    path = read_gcode(POCKET)
    write_gcode(tmp_path / "P.nc", path, 6, kept)
    again = read_gcode(tmp_path / "P.nc")
    same(again, path.through(path.places.round(9)))
    lines = (tmp_path / "P.nc").read_text().splitlines()
    order = [lines.index(each) for each in ("M6 T2", "M3 S8000", "G54", "M8", "G43 H2", "M9", "M5", "M30")]
    assert order == sorted(order)
    assert lines[order[4] + 1] == "G0 Z15.000000"
    assert lines[order[4] + 2].startswith("G0 X20.000000 Y20.000000 Z15")
    assert lines[order[5] - 1].startswith("G0")


def test_lengths_among_kept_words_change_their_unit(tmp_path):
    file = tmp_path / "P.nc"
    file.write_text("G20 G64 P0.001 (inch)\nG0 X0 Y0 Z0 M8\nG4 P1.5\nG1 X1 F10 M9\nM1\nG1 X2 M30\nM7\n")
    assert kept_words(file)[0] == [
        Kept(1, False, "G64 P0.0254"),
        Kept(2, False, "M8"),
        Kept(3, False, "G4 P1.5"),
        Kept(4, True, "M9"),
        Kept(5, True, "M1"),
    ]


@given(st.lists(st.text(alphabet="GXYZIJKRFSTMNHPOA0123456789.-+ ()/;%,#\t", max_size=24), max_size=8))
def test_whatever_is_read_is_a_path_or_an_error_that_names_its_line(lines):
    where = "P.nc"
    try:
        path = gcode_of("\n".join(lines), where)
    except InputError as error:
        where = error.where
    else:
        assert np.isfinite(path.places).all()
    assert where.startswith("P.nc")
