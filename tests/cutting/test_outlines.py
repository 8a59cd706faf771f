"""Outlines of shapes by their dimensions, and rows of points that are outlines."""

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.outlines import TAKES, Dimensions, missing, outline_of, outline_through, rows_through
from rcsa_ident.cutting.profile import Profile
from rcsa_ident.cutting.shape import CutterShape
from tests.cutting.test_profile import OUTLINES

DEG = np.pi / 180.0


def drawn(shape, dimensions):
    return outline_of(CutterShape(shape), 0.012, 0.0, dimensions)


def test_every_shape_is_drawn_by_something():
    assert set(TAKES) == set(CutterShape)
    for shape, takes in TAKES.items():
        names = [name for name in takes.needs if name != "profile"]
        corner = 1e-3 if "corner_radius" in names else 0.0
        assert missing(shape, 0.0, Dimensions()) == takes.needs
        assert missing(shape, corner, Dimensions(**{name: 1e-3 for name in names if name != "corner_radius"})) == takes.needs[len(names) :]


@pytest.mark.parametrize("name", OUTLINES)
def test_points_with_radii_are_the_same_outline(name):
    profile = OUTLINES[name]
    again = outline_through(rows_through(profile).tolist())
    for z in np.linspace(1e-5, 0.999 * profile.height, 23):
        assert again.radius_at(z) == pytest.approx(profile.radius_at(z), abs=1e-13)
    for one, two in zip(profile.segments, again.segments, strict=True):
        share = np.linspace(0.0, 1.0, 5)
        np.testing.assert_allclose(one.at(share), two.at(share), atol=1e-7)


def test_a_plain_cylinder_needs_no_outline_until_its_edge_ends():
    assert outline_of(CutterShape.FLAT, 0.012, 0.0, Dimensions()) is None
    assert outline_of(CutterShape.FLAT, 0.012, 0.0, Dimensions(cutting_depth=0.005)) == Profile.flat(0.012, 0.005)
    assert outline_of(CutterShape.FLAT, 0.012, 0.0005, Dimensions()) == Profile.bull_nose(0.012, 0.0005)


def test_a_largest_diameter_ends_the_edge():
    lead = Dimensions(cutting_edge_angle=30.0 * DEG, largest_diameter=0.020)
    face = outline_of(CutterShape.FACE, 0.012, 0.0008, lead)
    assert face.height == pytest.approx(0.004 * np.tan(30.0 * DEG), abs=1e-15)
    assert face.radius_at(face.height) == pytest.approx(0.010, abs=1e-15)
    cone = outline_of(CutterShape.TAPERED, 0.012, 0.001, Dimensions(taper=5.0 * DEG, largest_diameter=0.016))
    assert cone.segments[-1].ends[2] == pytest.approx(0.008, abs=1e-15)
    shorter = outline_of(CutterShape.FACE, 0.012, 0.0, Dimensions(30.0 * DEG, largest_diameter=0.020, cutting_depth=0.001))
    assert shorter.height == pytest.approx(0.001, abs=1e-15)


def test_an_upper_radius_mirrors_a_lower_one():
    """A barrel that is widest in the middle of its height, with both corners alike."""
    barrel = Profile.barrel(0.012, 0.048, 0.010, 0.001, 0.020, 0.001)
    for z in np.linspace(0.0001, 0.0099, 17):
        assert barrel.radius_at(z) == pytest.approx(barrel.radius_at(0.020 - z), abs=1e-14)
    assert barrel.largest_radius == pytest.approx(0.006, abs=1e-15)
    below, above = (segment.at(np.array([share]))[2][0] for segment, share in zip(barrel.segments[-2:], (1.0, 0.0), strict=True))
    assert below == pytest.approx(above, abs=1e-12)


def test_a_curved_high_feed_edge_leaves_the_floor_at_the_diameter():
    outline = outline_of(CutterShape.HIGH_FEED, 0.032, 0.0, Dimensions(profile_radius=0.020, cutting_depth=0.001))
    assert outline.radius_at(0.0004) == pytest.approx(0.016 + np.sqrt(0.020**2 - 0.0196**2), abs=1e-15)


@pytest.mark.parametrize(
    ("build", "field"),
    [
        (lambda: outline_of(CutterShape.BALL, 0.012, 0.003, Dimensions()), "corner_radius"),
        (lambda: drawn("face", Dimensions(45 * DEG, largest_diameter=0.011)), "largest_diameter"),
        (lambda: drawn("face", Dimensions(90 * DEG, largest_diameter=0.020)), "largest_diameter"),
        (lambda: drawn("face", Dimensions(45 * DEG, largest_diameter=0.02, cutting_depth=0.005)), "cutting_depth"),
        (lambda: drawn("face", Dimensions(45 * DEG, cutting_depth=0.002, wiper=0.007)), "wiper"),
        (lambda: drawn("tapered", Dimensions(taper=5 * DEG, largest_diameter=0.011)), "largest_diameter"),
        (lambda: drawn("high-feed", Dimensions(12 * DEG, profile_radius=0.02, cutting_depth=0.001)), "profile_radius"),
        (lambda: drawn("high-feed", Dimensions(profile_radius=0.002, cutting_depth=0.003)), "cutting_depth"),
        (lambda: Profile.barrel(0.012, 0.048, 0.010, 0.001, 0.020, 0.050), "upper_radius"),
        (lambda: Profile.barrel(0.012, 0.048, 0.010, 0.001, 0.070), "length"),
        (lambda: Profile.taper_barrel(0.250, 0.002, 0.3, 0.010, 0.015, 0.003), "tip_diameter"),
        (lambda: outline_through([(0.0, 0.0)]), "profile"),
        (lambda: outline_through([(0.0, 0.0), (0.004, 0.004, 0.002)]), "profile"),
        (lambda: outline_through([(0.0, 0.002), (0.004, 0.004)]), "profile"),
    ],
)  # fmt: skip
def test_what_no_cutter_can_have_is_refused_by_name(build, field):
    with pytest.raises(InputError) as error:
        build()
    assert error.value.field == field
