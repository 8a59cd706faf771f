"""Shapes of cutters: their names, and what is said of an answer that took them for cylinders."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.shape import CutterCode, CutterShape
from rcsa_ident.stability.discretisation import FullDiscretisation
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.zero_order import ZeroOrder
from tests.stability.mills import COEFFICIENTS, RPM, SKEWED, SLOT, MillingProcess, tip

RANGES = {
    "face": ["0.93 to 0.98", "0.72", "0.39"],
    "high-feed": ["0.61 to 1.45", "0.77 to 1.85", "0.92 to 4.0"],
    "ball": ["0.80 to 1.07", "0.81 to 0.89", "1.30"],
    "bull-nose": ["0.95 to 1.17", "1.72"],
}


@pytest.mark.parametrize("shape", [shape for shape in CutterShape if shape is not CutterShape.FLAT])
def test_every_shape_is_said_with_its_range(shape):
    (remark,) = Cutter(2, 0.012, shape=shape).cylinder_remarks()
    assert remark.code is CutterCode.AS_CYLINDER
    assert remark.startswith(f"computed as a cylinder: the cutter's shape is {shape}; ")
    if shape in RANGES:
        assert all(words in remark for words in RANGES[shape])
        assert "(above 1 is unsafe)" in remark
    else:
        assert "how far its stability limits are off is not known, they may be too high" in remark


def test_nothing_is_said_of_cylinders():
    assert Cutter(2, 0.012).cylinder_remarks(1e-3, forces=True) == ()
    assert Cutter(2, 0.012, corner_radius=0.2e-3).cylinder_remarks() == ()


def test_a_corner_radius_is_seen_beside_the_depth():
    cutter = Cutter(4, 0.012, corner_radius=0.2e-3)
    assert cutter.cylinder_remarks(2e-3) == ()
    (remark,) = cutter.cylinder_remarks(1.9e-3, forces=True)
    assert "the corner radius is more than a tenth of the depth" in remark
    assert "0.95 to 1.17" in remark
    assert "forces of shallow cuts are 6 to 50 % off" in remark


@pytest.mark.parametrize("method", [ZeroOrder(), FullDiscretisation()])
def test_limits_of_every_method_carry_it(method):
    def told(**shape):
        process = MillingProcess(Cutter(2, 0.012, **shape), COEFFICIENTS, SLOT)
        found = stability_lobes(tip(SKEWED), process, RPM * np.array([12_000.0, 15_000.0]), 10e-3, method)
        return [warning for warning in found.warnings if warning.startswith("computed as a cylinder")], float(found.nominal.min())

    plain, lowest = told()
    assert plain == []
    assert len(told(shape="ball")[0]) == 1
    assert told(corner_radius=0.09 * lowest)[0] == []
    assert len(told(corner_radius=0.11 * lowest)[0]) == 1


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        ({"shape": "round"}, "shape: found round, allowed is one of flat, bull-nose, ball"),
        ({"corner_radius": -1e-3}, "corner_radius: found"),
        ({"corner_radius": 6.1e-3, "shape": "ball"}, "at most half of the diameter, 0.006 m"),
    ],
)
def test_shapes_that_cannot_be(bad, words):
    with pytest.raises(InputError, match=words):
        Cutter(2, 0.012, **bad)


def test_a_hollow_radius_may_be_wider_than_the_cutter():
    assert Cutter(2, 0.006, shape="radius", corner_radius=8e-3).corner_radius == 8e-3
    assert str(Cutter(2, 0.006, shape="radius", corner_radius=8e-3)) == "2 teeth, Ø6 mm, shape radius, corner radius 8 mm"
