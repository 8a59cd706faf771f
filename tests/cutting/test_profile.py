"""Outlines against their closed forms, and what cannot be one."""

from itertools import pairwise

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.outlines import outline_through
from rcsa_ident.cutting.profile import Profile
from rcsa_ident.cutting.segments import Arc, Line

DEG = np.pi / 180.0
#: Outlines of every factory.
OUTLINES = {
    "flat": Profile.flat(0.012),
    "bull nose": Profile.bull_nose(0.016, 0.003),
    "ball": Profile.ball(0.012),
    "tapered": Profile.tapered(0.006, 5 * DEG, 0.001),
    "face": Profile.face(0.063, 45 * DEG, 0.006, 0.0012),
    "high feed": Profile.face(0.032, 12 * DEG, 0.0015),
    "dovetail": Profile.face(0.020, 110 * DEG, 0.005, 0.0003),
    "chamfer": Profile.chamfer(0.010, 0.002, 45 * DEG),
    "lollipop": Profile.lollipop(0.010, 0.006),
    "hollow": Profile.hollow(0.006, 0.003),
    "barrel": Profile.barrel(0.012, 0.048, 0.006, 0.001, 0.012),
    "lens": Profile.lens(0.012, 0.030, 0.001),
    "oval": Profile.oval(0.012, 0.085, 0.002, 0.020),
    "taper barrel": Profile.taper_barrel(0.250, 0.002, 20 * DEG, 0.010, 0.015),
    "points": outline_through([[0.0, 0.0], [0.004, 0.001], [0.005, 0.004]]),
}


@pytest.mark.parametrize("name", OUTLINES)
def test_normals_and_widths_are_those_of_the_curve(name):
    for segment in OUTLINES[name].segments:
        share = np.linspace(0.0, 1.0, 2001)
        r, z, kappa = segment.at(share)
        along = np.hypot(np.diff(r), np.diff(z))
        assert along.sum() == pytest.approx(segment.length, rel=1e-6)
        middle = 0.5 * (kappa[1:] + kappa[:-1])
        assert np.allclose(np.diff(r), np.cos(middle) * along, atol=1e-7 * segment.length)
        assert np.allclose(np.diff(z), np.sin(middle) * along, atol=1e-7 * segment.length)


@pytest.mark.parametrize("name", ["bull nose", "ball", "tapered", "face", "dovetail", "barrel", "lens", "oval", "taper barrel"])
def test_arcs_touch_what_is_beside_them(name):
    segments = [segment for segment in OUTLINES[name].segments if segment.length > 0.0]
    for below, above in pairwise(segments):
        one, two = below.at(np.array([1.0]))[2][0], above.at(np.array([0.0]))[2][0]
        assert one == pytest.approx(two, abs=1e-7)


def test_a_lead_line_meets_the_floor_at_the_diameter_whatever_its_corner_is():
    sharp, round_ = Profile.face(0.063, 45 * DEG, 0.006), Profile.face(0.063, 45 * DEG, 0.006, 0.0012)
    assert sharp.radius_at(0.0) == 0.0315
    for z in (0.001, 0.003, 0.006):
        assert round_.radius_at(z) == pytest.approx(0.0315 + z, abs=1e-15)
        assert sharp.radius_at(z) == pytest.approx(0.0315 + z, abs=1e-15)


@pytest.mark.parametrize(
    ("seven", "factory"),
    [
        ((0.012, 0.006, 0.0, 0.006, 0.0, 0.0, 0.03), Profile.ball(0.012, 0.03)),
        ((0.016, 0.003, 0.005, 0.003, 0.0, 0.0, 0.03), Profile.bull_nose(0.016, 0.003, 0.03)),
        ((0.006, 0.001, 0.002, 0.001, 0.0, 5 * DEG, 0.03), Profile.tapered(0.006, 5 * DEG, 0.001, 0.03)),
    ],
)
def test_seven_parameters_tell_the_same_outlines(seven, factory):
    found = Profile.seven(*seven)
    for z in np.linspace(0.0005, 0.03, 23):
        assert found.radius_at(z) == pytest.approx(factory.radius_at(z), abs=1e-15)


def test_seven_parameters_begin_with_a_cone():
    r, alpha = 0.003, 10 * DEG
    touch = 0.004 + r * np.sin(alpha)
    centre = r * np.cos(alpha) + touch * np.tan(alpha)
    found = Profile.seven(0.016, r, 0.004, centre, alpha, 0.0, 0.02)
    assert found.segments[0] == Line(0.0, 0.0, touch, touch * np.tan(alpha))
    with pytest.raises(InputError, match="segment 2"):
        Profile.seven(0.016, r, 0.004, centre + 1e-4, alpha, 0.0, 0.02)


def test_a_barrel_is_widest_where_it_should_be():
    barrel = OUTLINES["barrel"]
    assert barrel.radius_at(0.006) == pytest.approx(0.006, abs=1e-15)
    assert barrel.largest_radius == pytest.approx(0.006, abs=1e-15)
    assert barrel.radius_at(0.009) == pytest.approx(-0.042 + np.sqrt(0.048**2 - 0.003**2), abs=1e-15)


def test_pieces_end_at_depth_and_where_something_changes():
    ball = OUTLINES["ball"]
    pieces = ball.pieces(0.004, radii=(0.003,), heights=(0.001,))
    ends = [[float(value[0]) for value in segment.at(np.array([share]))] for segment, *shares in pieces for share in shares]
    heights = [z for _, z, _ in ends]
    assert heights == pytest.approx([0.0, 0.006 - np.sqrt(27e-6), 0.006 - np.sqrt(27e-6), 0.001, 0.001, 0.004], abs=1e-12)
    # floors are no pieces
    assert [segment for segment, _, _ in OUTLINES["flat"].pieces(0.002)] == [OUTLINES["flat"].segments[1]]


def test_a_drawing_ends_at_its_height():
    points = OUTLINES["bull nose"].outline(0.010)
    assert points[0].tolist() == [0.0, 0.0]
    assert points[-1].tolist() == [0.008, 0.010]
    assert np.all(np.diff(points[:, 1]) >= 0.0)


@pytest.mark.parametrize(
    ("build", "field"),
    [
        (lambda: Profile(()), "profile"),
        (lambda: Profile((Line(0.0, 0.0, 0.005, 0.0),)), "profile"),
        (lambda: Profile((Line(0.005, 0.001, 0.005, 0.004),)), "profile"),
        (lambda: Profile((Line(0.005, 0.0, 0.005, 0.004), Line(0.006, 0.004, 0.006, 0.005))), "profile"),
        (lambda: Profile((Line(0.005, 0.0, -0.001, 0.004),)), "profile"),
        (lambda: Profile((Arc(0.0, 0.006, 0.006, 90 * DEG, 0.0),)), "profile"),
        (lambda: outline_through([[0.0, 0.0], [0.004, 0.002], [0.005, 0.001]]), "profile"),
        (lambda: outline_through([[0.0, 0.0]]), "profile"),
        (lambda: Profile.bull_nose(0.016, 0.009), "corner_radius"),
        (lambda: Profile.tapered(0.016, 1.6), "taper"),
        (lambda: Profile.face(0.063, np.pi, 0.006), "cutting_edge_angle"),
        (lambda: Profile.face(0.010, 150 * DEG, 0.006), "depth"),
        (lambda: Profile.face(0.010, 90 * DEG, 0.006, 0.006), "corner_radius"),
        (lambda: Profile.chamfer(0.010, 0.010, 45 * DEG), "tip_diameter"),
        (lambda: Profile.lollipop(0.010, 0.010), "neck"),
        (lambda: Profile.barrel(0.012, 0.048, 0.006, 0.050, 0.012), "corner_radius"),
        (lambda: Profile.lens(0.012, 0.005, 0.001), "profile_radius"),
        (lambda: Profile.oval(0.012, 0.085, 0.007, 0.02), "tip_radius and profile_radius"),
        (lambda: Profile.taper_barrel(0.250, 0.300, 0.1, 0.01, 0.015), "tip_radius"),
        (lambda: OUTLINES["chamfer"].radius_at(0.005), "height"),
    ],
)
def test_impossible_outlines_are_refused_by_name(build, field):
    with pytest.raises(InputError) as error:
        build()
    assert error.value.field == field
