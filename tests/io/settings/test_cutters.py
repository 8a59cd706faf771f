"""[cutter] of a tooling file: every shape there and back, what is left a cylinder and says so, and what is refused."""

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.cutter import HelixKind
from rcsa_ident.cutting.serration import WaveShape
from rcsa_ident.cutting.shape import CutterShape
from rcsa_ident.io.settings.cutters import CUTTER_KEYS, cutter_keys, cutter_of
from rcsa_ident.io.toml_text import keys_of_toml, toml_of
from rcsa_ident.io.validated_table import Table
from tests.fixtures.cutters import BASE, SHAPES, keys_of


def read(keys):
    return cutter_of(Table(BASE | keys, "T.toml", "cutter", CUTTER_KEYS))


def there_and_back(cutter):
    return read(keys_of_toml(toml_of({"cutter": cutter_keys(cutter)}, digits=12), "tooling")["cutter"])


@pytest.mark.parametrize("shape", SHAPES)
def test_every_shape_is_drawn_and_kept(shape):
    cutter = read(keys_of(shape))
    again = there_and_back(cutter)
    assert cutter.shape is again.shape is CutterShape(shape)
    assert cutter.cylinder_remarks(1e-3) == ()
    for z in np.linspace(1e-5, 0.999 * cutter.profile.height, 19):
        assert again.profile.radius_at(z) == pytest.approx(cutter.profile.radius_at(z), abs=1e-12)
    assert cutter_keys(again) == pytest.approx(cutter_keys(cutter)) if shape != "profile" else True


def test_all_shapes_are_here():
    assert set(SHAPES) == set(CutterShape)


def test_a_plain_flat_cutter_has_no_outline():
    cutter = read({"corner_radius_mm": 0.0})
    assert cutter.profile is None
    assert cutter.is_cylinder
    assert cutter_keys(cutter) == {"teeth": 4, "diameter_mm": 12.0, "helix_deg": 0.0}


def test_a_corner_of_a_flat_cutter_is_its_true_edge():
    cutter = read({"corner_radius_mm": 0.5})
    assert cutter.shape is CutterShape.FLAT
    assert cutter.profile.radius_at(0.25e-3) == pytest.approx(5.5e-3 + np.sqrt(0.5e-3**2 - 0.25e-3**2), abs=1e-15)


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"shape": "face"}, "the cutter's shape is face; cutting_edge_angle_deg and cutting_depth_mm are not told; "),
        ({"shape": "face", "cutting_edge_angle_deg": 45.0}, "face; cutting_depth_mm is not told; its stability limits were 0.93"),
        ({"shape": "bull-nose"}, "bull-nose; corner_radius_mm is not told; "),
        ({"shape": "lollipop"}, "lollipop; neck_diameter_mm is not told; "),
        ({"shape": "profile"}, "profile; profile is not told; "),
    ],
)
def test_a_shape_that_cannot_be_drawn_stays_a_cylinder_and_says_what_is_missing(keys, told):
    cutter = read(keys)
    assert cutter.profile is None
    (remark,) = cutter.cylinder_remarks()
    assert told in remark
    assert there_and_back(cutter).cylinder_remarks() == (remark,)


def test_an_outline_of_any_origin_is_written():
    """A profile that no dimensions draw goes point by point, with the radii of its arcs."""
    from rcsa_ident.cutting.cutter import Cutter
    from rcsa_ident.cutting.profile import Profile

    outline = Profile.seven(0.016, 0.003, 0.005, 0.003, 0.0, 0.05, 0.02)
    again = there_and_back(Cutter(4, 0.016, profile=outline))
    assert again.shape is CutterShape.PROFILE
    for z in np.linspace(1e-4, 0.019, 9):
        assert again.profile.radius_at(z) == pytest.approx(outline.radius_at(z), abs=1e-12)


def test_teeth_of_their_own():
    keys = {
        "helix_deg": [38.0, 41.0, 38.0, 41.0],
        "helix_kind": "angle",
        "pitch_deg": [84.0, 96.0, 84.0, 96.0],
        "serration": {"amplitude_mm": 0.25, "wavelength_mm": 1.5, "shape": "circular", "shift": [0.0, 0.25, 0.5, 0.75]},
        "runout_mm": [0.0, 0.02, -0.01, 0.0],
        "axial_runout_mm": [0.0, 0.01, 0.0, 0.0],
        "tilt_deg": 0.05,
    }
    for cutter in (read(keys), there_and_back(read(keys))):
        np.testing.assert_allclose(np.degrees(cutter.helix), [38.0, 41.0, 38.0, 41.0])
        assert cutter.helix_kind is HelixKind.ANGLE
        np.testing.assert_allclose(np.degrees(cutter.pitch), [84.0, 96.0, 84.0, 96.0])
        wave = cutter.serration
        assert (wave.amplitude, wave.wavelength, wave.shape) == (pytest.approx(0.25e-3), pytest.approx(1.5e-3), WaveShape.CIRCULAR)
        np.testing.assert_allclose(wave.shift, [0.0, 0.25, 0.5, 0.75])
        np.testing.assert_allclose(cutter.runout, [0.0, 20e-6, -10e-6, 0.0])
        np.testing.assert_allclose(cutter.axial_runout, [0.0, 10e-6, 0.0, 0.0])
        assert np.degrees(cutter.tilt) == pytest.approx(0.05)


BROKEN = [
    ({"shape": "face", "taper_deg": 3.0}, "taper_deg", "what draws that shape, cutting_edge_angle_deg, cutting_depth_mm"),
    ({"profile_radius_mm": 3.0}, "profile_radius_mm", "corner_radius_mm, cutting_depth_mm"),
    ({"shape": "chamfer", "corner_radius_mm": 0.2}, "corner_radius_mm", "taper_deg, tip_diameter_mm"),
    ({"cuting_depth_mm": 3.0}, "cuting_depth_mm", "did you mean cutting_depth_mm?"),
    ({"corner_radius_mm": 7.0}, "corner_radius_mm", "at most half of the diameter, 6 [mm]"),
    ({"shape": "ball", "corner_radius_mm": 3.0}, "corner_radius_mm", "nothing, or half of the diameter, 6 mm: it is a ball"),
    ({"shape": "dovetail", "taper_deg": 60.0, "cutting_depth_mm": 50.0}, "cutting_depth_mm", "at most 3.4641 mm"),
    (keys_of("face") | {"cutting_depth_mm": 5.0}, "cutting_depth_mm", "at most 4 mm"),
    ({"shape": "tapered", "taper_deg": 91.0}, "taper_deg", "less than 90 degrees"),
    ({"shape": "lollipop", "neck_diameter_mm": 12.0}, "neck_diameter_mm", "below the diameter, 12 mm"),
    ({"shape": "chamfer", "taper_deg": 45.0, "tip_diameter_mm": 12.0}, "tip_diameter_mm", "less than the diameter, 12 mm"),
    (keys_of("barrel") | {"cutting_depth_mm": 70.0}, "cutting_depth_mm", "below 58 mm"),
    ({"shape": "profile", "profile": [[0, 0], [4, 1], [5, 0.5]]}, "profile", "a line whose height does not fall"),
    ({"shape": "profile", "profile": [[0, 0], [4, 1], [5, 2, 0.1]]}, "profile", "at least half of the distance"),
    ({"shape": "profile", "profile": [[0, 0], [4]]}, "profile", "[r, z] or [r, z, radius of the arc to it]"),
    ({"shape": "profile", "profile": [[0, 0], ["4", 1]]}, "profile", "[r, z] or [r, z, radius of the arc to it]"),
    ({"shape": "profile", "profile": 5.0}, "profile", "a list of 2 to 500 points"),
    ({"shape": "profile", "profile": [[0, 0], [1, 1]]}, "diameter_mm", "less than twice that width"),
    ({"helix_deg": [30.0, 31.0]}, "helix_deg", "a list of 4 of them, one a tooth"),
    ({"helix_deg": 85.0}, "helix_deg", "at most 80 [deg]"),
    ({"helix_kind": "steep"}, "helix_kind", "one of lead, angle"),
    ({"runout_mm": [0.01]}, "runout_mm", "a list of 4 finite numbers"),
    ({"serration": {"amplitude_mm": 0.2}}, "serration.wavelength_mm", "above 0"),
    ({"serration": {"amplitude_mm": 2.0, "wavelength_mm": 1.0}}, "serration", "an amplitude below the wavelength"),
    ({"serration": {"amplitude_mm": 0.2, "wavelength_mm": 1.0, "wave": 1}}, "serration.wave", "one of amplitude_mm, wavelength_mm"),
    ({"serration": {"amplitude_mm": 0.3, "wavelength_mm": 1.0, "shape": "circular"}}, "serration.amplitude_mm", "a quarter of"),
    ({"serration": {"amplitude_mm": 0.3, "wavelength_mm": 1.0, "shape": "table"}}, "serration.table", "offsets for the shape table"),
]  # fmt: skip


@pytest.mark.parametrize(("keys", "key", "words"), BROKEN, ids=[str(i) for i in range(len(BROKEN))])
def test_what_cannot_be_is_refused_in_words(keys, key, words):
    with pytest.raises(InputError) as error:
        read(keys)
    assert error.value.field == f"cutter.{key}"
    assert error.value.where == "T.toml"
    assert words in error.value.allowed
