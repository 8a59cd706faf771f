"""What one line of a program does in several moves, how programs end, and what they are told to be."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.paths.gcode import gcode_of, kept_words, read_gcode, write_gcode
from tests.io.paths.test_gcode import AT_ZERO, refused

HOLES = {
    # rapid to R, at the feed to Z, back to where the tool stood, or to R
    "G81": ("G98 G81 X5 Y6 Z-4 R2 F60", [[5, 6, 9], [5, 6, 2], [5, 6, -4], [5, 6, 9]]),
    "G82": ("G99 G82 X5 Y6 Z-4 R2 P500 F60", [[5, 6, 9], [5, 6, 2], [5, 6, -4], [5, 6, 2]]),
    "G73": ("G99 G73 X5 Y6 Z-4 R2 Q1 F60", [[5, 6, 9], [5, 6, 2], [5, 6, -4], [5, 6, 2]]),
    "G83": (
        "G99 G83 X5 Y6 Z-4 R1 Q2 F60",
        [[5, 6, 9], [5, 6, 1], [5, 6, -1], [5, 6, 1], [5, 6, -1], [5, 6, -3], [5, 6, 1], [5, 6, -3], [5, 6, -4], [5, 6, 1]],
    ),
    "G84": ("G84 X5 Y6 Z-4 R2 F60", [[5, 6, 9], [5, 6, 2], [5, 6, -4], [5, 6, 2], [5, 6, 9]]),
    "G85": ("G99 G85 X5 Y6 Z-4 R2 F60", [[5, 6, 9], [5, 6, 2], [5, 6, -4], [5, 6, 2]]),
    "in steps": ("G91 G99 G81 X5 Y6 Z-6 R-7 F60", [[5, 6, 9], [5, 6, 2], [5, 6, -4], [5, 6, 2]]),
    "repeated": (
        "G91 G99 G81 X5 Z-6 R-7 K2 F60",
        [[5, 0, 9], [5, 0, 2], [5, 0, -4], [5, 0, 2], [10, 0, 2], [10, 0, -4], [10, 0, 2]],
    ),
    "next holes": (
        "G99 G81 X5 Y6 Z-4 R2 F60\nX7\nG98 Y8 Z-5\nG80\nG0 X0",
        [[5, 6, 9], [5, 6, 2], [5, 6, -4], [5, 6, 2], [7, 6, 2], [7, 6, -4], [7, 6, 2], [7, 8, 2], [7, 8, -5], [7, 8, 9], [0, 8, 9]],
    ),
    "stored": ("G99 G81 Z-4 R2 K0 F60\nX5 Y6\nG0 X9", [[5, 6, 9], [5, 6, 2], [5, 6, -4], [5, 6, 2], [9, 6, 2]]),
    "from below R": ("G0 Z1\nG81 X5 Z-4 R2 F60", [[0, 0, 1], [0, 0, 2], [5, 0, 2], [5, 0, -4], [5, 0, 2]]),
}


@pytest.mark.parametrize("name", HOLES)
def test_holes_of_canned_cycles_are_drilled(name):
    text, expected = HOLES[name]
    path = gcode_of(f"{AT_ZERO}G0 Z9\n{text}", "P.nc")
    assert (1e3 * path.places[2:]).round(9).tolist() == expected
    down = (np.diff(path.places[:, 2]) < 0.0) & (path.places[1:, 2] < 0.0)
    assert np.all(path.cutting[down] | (path.places[1:][down, 2] == path.places[:-1][down, 2].max()) | (name == "G83"))
    assert [str(note) for note in path.remarks] == (
        ["G83 comes back to the depth that it has drilled: the control's own clearance is taken for 0"] if name == "G83" else []
    )


def test_a_cycle_needs_a_place_to_begin():
    with pytest.raises(InputError, match="told by G0"):
        gcode_of("G81 X1 Y1 Z-1 R1 F60", "P.nc")
    refused("G28 Z0\nG81 X1 Z-1 R1 F60", "cycle", "told by G0", 3)
    refused("G81 X1 Z-1 R1 F60\nG80\nX5", "block", "G0 to G3", 4)


CORNERS = [
    # a quarter of a circle, and the chamfer of a square corner
    ("G1 X20 ,R5 F60\nY20", 15.0 + 2.5 * math.pi + 15.0),
    ("G1 X20 ,C5 F60\nY20", 15.0 + math.hypot(5.0, 5.0) + 15.0),
    ("G91 G1 X20 ,R5 F60\nY-20", 15.0 + 2.5 * math.pi + 15.0),
    ("G20 G1 X1 ,R.25 F6\nY1", 25.4 * (0.75 + 0.125 * math.pi + 0.75)),
    # two in a row, and one on a straight line that is none
    ("G1 X20 ,R5 F60\nY20 ,C2\nX0", 15.0 + 2.5 * math.pi + 13.0 + math.hypot(2.0, 2.0) + 18.0),
    ("G1 X20 ,R5 F60\nX40", 40.0),
    # 60 degrees to the left: the legs lose r tan 30 degrees each
    ("G1 X20 ,R3 F60\nX30 Y17.320508075688775", 40.0 - 6.0 * math.tan(math.pi / 6.0) + 3.0 * math.pi / 3.0),
]


@pytest.mark.parametrize(("text", "length"), CORNERS)
def test_corners_are_rounded_or_cut_off(text, length):
    path = gcode_of(f"{AT_ZERO}{text}", "P.nc")
    assert 1e3 * path.length == pytest.approx(length, rel=2e-5)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("G1 X20 ,R5 F60\nG0 Y20", "G0 behind it"),
        ("G1 X20 ,R5 F60\nG2 X30 Y10 I5 J5", "G2 behind it"),
        ("G1 X20 ,R5 F60\nM30", "no move behind it"),
        ("G1 X20 ,R5 F60", "no move behind it"),
        ("G1 X20 ,R25 F60\nY20", "25 mm between moves of 20 and 20 mm"),
        ("G1 X20 ,R5 F60\nX0", "5 mm between moves"),
        ("G1 X20 ,R5 F60\nY20 Z-1", "leave the plane"),
    ],
)
def test_a_corner_needs_two_straight_moves(text, words):
    with pytest.raises(InputError, match=words) as caught:
        gcode_of(f"{AT_ZERO}{text}", "P.nc")
    assert caught.value.field == ",R of line 2"


@pytest.mark.parametrize("end", ["M30", "M2", "%"])
def test_what_stands_behind_the_end_is_said(end):
    path = gcode_of(f"{AT_ZERO}G1 X1 F60\n{end}\n\nG1 X5\n", "P.nc")
    assert [str(note) for note in path.remarks] == ["the program ends in line 3: line 5 and those behind it are not read"]
    assert gcode_of(f"{AT_ZERO}G1 X1 F60\n{end}\n%\n\n", "P.nc").remarks == ()


def test_a_heidenhain_program_is_told_as_one():
    with pytest.raises(InputError, match="Heidenhain's plain text, allowed is G-code"):
        gcode_of("0 BEGIN PGM SLOT MM\n1 L X+0 Y+0 R0 FMAX\n2 END PGM SLOT MM\n", "P.h")


def test_words_of_cycles_are_not_kept(tmp_path):
    """A written program has a cycle's moves; what it keeps beside them are its tools and coolant."""
    source, out = tmp_path / "P.nc", tmp_path / "OUT.nc"
    source.write_text(f"{AT_ZERO}G54.1 P7\nG0 Z9\nG99 G83 X5 Y6 Z-4 R1 Q2 P3 F60 M8\nX9\nG80 M9\nG0 X1\nM30\n")
    path, (kept, _) = read_gcode(source), kept_words(source)
    assert [each.text for each in kept] == ["G54.1 P7", "G99 M8", "G80", "M9"]
    write_gcode(out, path, kept=kept)
    np.testing.assert_allclose(read_gcode(out).places, path.places, atol=1e-12)
