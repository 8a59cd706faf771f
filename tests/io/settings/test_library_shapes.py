"""One tool of every type of a CAM library, and properties of ISO 13399: the right outline, or refused by name; none a silent cylinder.

The radii are worked out here from the library's own figures, by circles and lines alone.
"""

from __future__ import annotations

import json
from math import asin, cos, degrees, radians, sin, sqrt, tan

import pytest

from rcsa_ident.cutting.shape import CutterShape
from rcsa_ident.io.settings.setups import tooling_of
from rcsa_ident.io.settings.tool_libraries import Assumptions, import_tools
from rcsa_ident.io.toml_text import keys_of_toml
from tests.fixtures.paths import ROOT

FILE = ROOT / "tests" / "fixtures" / "library_of_shapes.json"
LIBRARY = {tool["description"]: tool for tool in json.loads(FILE.read_text(encoding="utf-8"))["data"]}
#: Thick enough for every shank.
HOLDER = {
    "unit": "millimeters",
    "gaugeLength": 80.0,
    "segments": [{"height": 80.0, "lower-diameter": 60.0, "upper-diameter": 60.0}],
}


def imported(tool):
    (found,) = import_tools(json.dumps({"data": [tool | {"holder": HOLDER}]}).encode(), "L.json", Assumptions())
    return found


def corner(half, radius):
    """A quarter of a circle between floor and wall."""
    return lambda z: half - radius + sqrt(radius**2 - max(radius - z, 0.0) ** 2)


def leading(half, kappa, radius):
    """A line that meets the floor at half of the diameter, and a circle that touches both."""
    centre = half - radius * tan(radians(kappa) / 2.0)
    height = radius * (1.0 - cos(radians(kappa)))
    return lambda z: centre + sqrt(radius**2 - (radius - z) ** 2) if z < height else half + z / tan(radians(kappa))


def tapered(half, taper, radius):
    t = radians(taper)
    start, height = half - radius * (1.0 - cos(t)), radius * (1.0 - sin(t))
    return lambda z: half - radius + sqrt(radius**2 - (radius - z) ** 2) if z < height else start + (z - height) * tan(t)


def on_circle(r, z0, radius):
    return lambda z: r + sqrt(radius**2 - (z - z0) ** 2)


def barrel(z):
    """Widest, 6 mm, at 10 mm; both ends rounded by 1 mm."""
    r = -42.0
    inner = r + sqrt(47.0**2 - 9.0**2)
    touch = 1.0 - 9.0 / 47.0
    z = 20.0 - z if z > 10.0 else z
    return inner + sqrt(1.0 - (z - 1.0) ** 2) if z < touch else r + sqrt(48.0**2 - (z - 10.0) ** 2)


def lens(z):
    """A floor of 30 mm about the axis, a corner of 1 mm inside 6 mm."""
    centre = 30.0 - sqrt(29.0**2 - 5.0**2)
    touch = 30.0 - 30.0 * (30.0 - centre) / 29.0
    return sqrt(30.0**2 - (30.0 - z) ** 2) if z < touch else 5.0 + sqrt(1.0 - max(centre - z, 0.0) ** 2)


def oval(z):
    """A ball of 2 mm, and a circle of 85 mm that touches it and is widest, 6 mm."""
    high = 2.0 + sqrt(83.0**2 - 79.0**2)
    touch = 2.0 - 2.0 * (high - 2.0) / 83.0
    return sqrt(4.0 - (2.0 - z) ** 2) if z < touch else -79.0 + sqrt(85.0**2 - (high - z) ** 2)


def taper(z):
    """A corner of 2 mm on a tip of 5 mm, a circle of 250 mm that leans by 20 degrees 10 mm above it, rounded by 0.5 mm at 15 mm."""
    z0 = 10.0 + 250.0 * sin(radians(20.0))
    r0 = 0.5 - sqrt(248.0**2 - (z0 - 2.0) ** 2)
    low = 2.0 - 2.0 * (z0 - 2.0) / 248.0
    r1 = r0 + sqrt(249.5**2 - (z0 - 14.5) ** 2)
    high = 14.5 - 0.5 * (z0 - 14.5) / 249.5
    if z < low:
        return 0.5 + sqrt(4.0 - (2.0 - z) ** 2)
    return r0 + sqrt(250.0**2 - (z0 - z) ** 2) if z < high else r1 + sqrt(0.25 - (z - 14.5) ** 2)


def dovetail(radius):
    return leading(10.0, 110.0, radius)


#: By tool: its shape, five heights [mm] and its radius there [mm].
TRUE = {
    "flat with a corner": ("flat", (0.01, 0.05, 0.1, 0.19, 5.0), corner(6.0, 0.2)),
    "rougher": ("flat", (0.01, 0.1, 0.3, 0.49, 5.0), corner(8.0, 0.5)),
    "slot": ("flat", (0.01, 0.1, 0.2, 0.29, 4.9), corner(10.0, 0.3)),
    "key cutter": ("flat", (0.01, 0.1, 1.0, 3.0, 4.9), lambda z: 10.0),
    "bull nose": ("bull-nose", (0.1, 1.0, 2.0, 2.9, 10.0), corner(8.0, 3.0)),
    "bull nose by its tip": ("bull-nose", (0.1, 1.0, 2.0, 2.9, 10.0), corner(8.0, 3.0)),
    "ball": ("ball", (0.1, 1.0, 3.0, 5.9, 10.0), corner(6.0, 6.0)),
    "tapered": ("tapered", (0.1, 0.5, 0.9, 5.0, 19.9), tapered(3.0, 5.0, 1.0)),
    "face": ("face", (0.05, 0.3, 1.0, 3.0, 5.9), leading(31.5, 45.0, 1.2)),
    "shoulder face": ("face", (0.05, 0.3, 0.7, 3.0, 9.9), corner(25.0, 0.8)),
    "radius": ("radius", (0.25, 0.6, 1.5, 2.5, 3.4), lambda z: 6.0 - sqrt(9.0 - max(z - 0.5, 0.0) ** 2)),
    "barrel": ("barrel", (0.3, 2.0, 10.0, 17.0, 19.7), barrel),
    "lens": ("lens", (0.1, 0.4, 0.7, 1.2, 5.0), lens),
    "oval": ("oval", (0.1, 1.0, 1.5, 8.0, 19.0), oval),
    "taper": ("taper-barrel", (0.3, 1.2, 5.0, 14.0, 14.7), taper),
    "lollipop": ("lollipop", (0.5, 2.0, 5.0, 7.0, 8.9), on_circle(0.0, 5.0, 5.0)),
    "chamfer": ("chamfer", (0.1, 1.0, 3.0, 5.0, 6.9), lambda z: 1.0 + z * tan(radians(30.0))),
    "dovetail": ("dovetail", (0.05, 0.2, 0.5, 2.0, 4.9), dovetail(0.3)),
    "dovetail of HSM": ("dovetail", (0.05, 0.2, 0.5, 2.0, 4.9), lambda z: 10.0 - z * tan(radians(20.0))),
}
REFUSED = {
    "form": "a form mill, whose outline the library does not tell",
    "thread": "a thread mill, not a milling tool with an outline",
}


def test_every_tool_of_the_file_is_looked_at():
    assert {"flat", *TRUE, *REFUSED} == set(LIBRARY)


@pytest.mark.parametrize("unit", ["millimeters", "inches"])
@pytest.mark.parametrize("name", TRUE)
def test_a_tool_of_every_type_has_its_outline(name, unit):
    tool = LIBRARY[name]
    if unit == "inches":
        lengths = {k: v / 25.4 if k not in ("NOF", "TA", "FHA", "HAND", "CSP") else v for k, v in tool["geometry"].items()}
        tool = tool | {"geometry": lengths, "unit": unit}
    found = imported(tool)
    assert found.reason == ""
    shape, heights, radius = TRUE[name]
    again = tooling_of(keys_of_toml(found.text, "tooling"), "", "")
    for cutter in (found.tooling.cutter, again.cutter):
        assert cutter.shape is CutterShape(shape)
        for z in heights:
            assert cutter.profile.radius_at(1e-3 * z) == pytest.approx(1e-3 * radius(z), abs=1e-9)
        assert cutter.cylinder_remarks(1e-4) == ()


def test_a_plain_end_mill_stays_a_cylinder():
    assert imported(LIBRARY["flat"]).tooling.cutter.is_cylinder


@pytest.mark.parametrize("name", REFUSED)
def test_what_has_no_outline_is_refused_by_name(name):
    found = imported(LIBRARY[name])
    assert found.tooling is None
    assert found.reason.startswith(REFUSED[name])


@pytest.mark.parametrize(
    ("name", "key", "field"),
    [
        ("bull nose", "RE", "geometry.RE"),
        ("tapered", "TA", "geometry.TA"),
        ("face", "TA", "geometry.TA"),
        ("radius", "RE", "geometry.RE"),
        ("chamfer", "TA", "geometry.TA"),
        ("dovetail", "TA", "geometry.TA"),
        ("lollipop", "shoulder-diameter", "geometry.shoulder-diameter"),
        ("barrel", "profile-radius", "geometry.profile-radius"),
        ("barrel", "axial-distance", "geometry.axial-distance"),
        ("lens", "lower-radius", "geometry.profile-radius"),
        ("oval", "lower-radius", "geometry.lower-radius"),
        ("taper", "axial-distance", "geometry.axial-distance"),
    ],
)
def test_a_figure_that_is_missing_is_named(name, key, field):
    tool = LIBRARY[name] | {"geometry": {k: v for k, v in LIBRARY[name]["geometry"].items() if k != key}}
    assert f"{field}: found nothing" in imported(tool).reason


def test_inserts_have_no_helix_and_roughers_are_asked_for_their_waves():
    face = imported(LIBRARY["face"])
    assert face.tooling.cutter.helix == 0.0
    assert "helix angle 0° assumed, as of inserts: none in the library" in face.notes
    assert "upper radius 0.8 mm left out: it lies above the edge that cuts" in face.notes
    rough = imported(LIBRARY["rougher"])
    assert rough.tooling.cutter.serration is None
    assert any("serration = {" in note and "0.24 to 0.47" in note for note in rough.notes)


BODY = {"OAL": 90.0, "LB": 50.0, "LCF": 20.0, "DMM": 16.0, "holder": HOLDER}
ISO = [
    ({"DC": 12.0, "ZEFP": 4, "FHA": 38.0}, "flat", None),
    ({"DC": 12.0, "NOF": 4, "RE": 0.5}, "bull-nose", corner(6.0, 0.5)),
    ({"DC": 12.0, "NOF": 2, "RE": 6.0}, "ball", corner(6.0, 6.0)),
    ({"DC": 40.0, "ZEFF": 5, "KAPR": 45.0, "APMX": 6.0, "RE": 0.8, "BS": 1.2}, "face", leading(20.0, 45.0, 0.8)),
    ({"DC": 40.0, "ZEFF": 5, "PSIR": 45.0, "DCX": 52.0}, "face", leading(20.0, 45.0, 0.0)),
    ({"DC": 32.0, "ZEFF": 3, "KAPR": 12.0, "APMX": 1.2, "RE": 1.0}, "high-feed", leading(16.0, 12.0, 1.0)),
    ({"DC": 40.0, "ZEFF": 5, "KAPR": 90.0, "APMX": 10.0, "RE": 0.8}, "face", corner(20.0, 0.8)),
    ({"DC": 20.0, "ZEFF": 4, "KAPR": 110.0, "APMX": 5.0, "RE": 0.3}, "dovetail", dovetail(0.3)),
    ({"DC": 12.0, "NOF": 4, "PRFRAD": 30.0, "RE": 1.0, "shape": "lens"}, "lens", lens),
    ({"DC": 12.0, "NOF": 4, "CHW": 0.2, "KCH": 45.0}, "profile", lambda z: min(5.8 + z, 6.0)),
]  # fmt: skip


@pytest.mark.parametrize(("properties", "shape", "radius"), ISO, ids=[str(i) for i in range(len(ISO))])
def test_properties_of_iso_13399_are_read_by_their_names(properties, shape, radius):
    raw = json.dumps({"description": "tool", **BODY, **properties}).encode()
    (found,) = import_tools(raw, "T.json", Assumptions())
    assert found.reason == ""
    cutter = found.tooling.cutter
    assert cutter.shape is CutterShape(shape)
    assert cutter.teeth == properties.get("ZEFP", properties.get("ZEFF", properties.get("NOF")))
    assert degrees(cutter.helix) == pytest.approx(properties.get("FHA", 0.0 if shape in ("face", "high-feed") else 30.0))
    if radius is None:
        assert cutter.is_cylinder
        return
    for share in (0.05, 0.3, 0.6, 0.8, 0.98):
        z = share * min(1e3 * cutter.profile.height, 10.0)
        assert cutter.profile.radius_at(1e-3 * z) == pytest.approx(1e-3 * radius(z), abs=1e-9)


@pytest.mark.parametrize(
    ("properties", "reason"),
    [
        ({"DC": 12.0, "NOF": 4, "PRFRAD": 30.0}, "PRFRAD: found a profile radius without a shape"),
        ({"DC": 12.0, "NOF": 4, "PRFRAD": 48.0, "shape": "barrel"}, "of which axial_distance_mm, cutting_depth_mm is not told"),
        ({"DC": 12.0, "NOF": 4, "KAPR": 45.0}, "of which cutting_depth_mm is not told"),
        ({"DC": 12.0, "NOF": 4, "CHW": 0.2, "KCH": 30.0}, "KCH: found 30"),
        ({"DC": 12.0, "NOF": 4, "shape": "round"}, 'shape: found the text "round"'),
        ({"DC": 12.0}, "NOF: found nothing"),
    ],
)
def test_properties_that_tell_too_little_are_refused(properties, reason):
    (found,) = import_tools(json.dumps({"description": "tool", **BODY, **properties}).encode(), "T.json", Assumptions())
    assert found.tooling is None
    assert reason in found.reason


def test_angles_of_circles_are_what_the_names_say():
    """The lean of a tapered barrel where it is told, from its own normal."""
    cutter = imported(LIBRARY["taper"]).tooling.cutter
    arc = next(segment for segment in cutter.profile.segments if getattr(segment, "radius", 0.0) > 0.2)
    assert degrees(asin((arc.z_c - 0.010) / arc.radius)) == pytest.approx(20.0, abs=1e-9)
