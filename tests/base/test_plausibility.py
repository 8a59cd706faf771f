"""Ranges: what is refused, what is remarked on, and which slip of the unit is asked about; the same from library, command and service."""

from __future__ import annotations

import math

import pytest

from rcsa_ident.base import plausibility
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.plausibility import DIAMETER, IMMERSION, STICKOUT, TANGENTIAL, TEMPERATURE, PlausibilityCode, Range, proportion
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.materials import materials
from rcsa_ident.cutting.process import MillingProcess

RANGES = {name: kind for name, kind in vars(plausibility).items() if isinstance(kind, Range)} | plausibility.CONTACT


@pytest.mark.parametrize("name", RANGES)
def test_what_is_usual_is_possible_and_both_ends_belong_to_it(name):
    kind = RANGES[name]
    assert kind.possible[0] <= kind.usual[0] < kind.usual[1] <= kind.possible[1]
    for end in kind.usual:
        assert kind.remark("it", end * kind.size) is None
    for end in kind.possible:
        assert kind.checked("it", end * kind.size) == end * kind.size
    assert kind.remark("it", kind.usual[1] * kind.size * 1.001) is not None
    with pytest.raises(InputError):
        kind.checked("it", kind.possible[1] * kind.size * 1.001)


@pytest.mark.parametrize(
    ("kind", "value", "meant"),
    [
        (DIAMETER, 12e-6, "was it given in metres (12 mm)?"),
        (DIAMETER, 0.4e-3, "was it given in inches (10.16 mm)?"),
        (STICKOUT, 60.0, "was it given in µm (60 mm)?"),
        (TEMPERATURE, 295.15, "was it given in kelvin (22 °C)?"),
        (TEMPERATURE, 104.0, "was it given in degrees Fahrenheit (40 °C)?"),
        (TANGENTIAL, 2.1e6, "was it given in GPa (2100 MPa)?"),
        (TANGENTIAL, 2.1e15, "was it given in Pa (2100 MPa)?"),
        (TANGENTIAL, 2100.0, "was it given in MPa where Pa is asked for (2100 MPa)?"),
        (plausibility.CONTACT["translational_stiffness"], 2e4, "was it given in N/µm per m (2e+10 N/m per m)?"),
        (plausibility.CONTACT["translational_stiffness"], 2e7, "was it given in N/m per mm (2e+10 N/m per m)?"),
        (plausibility.RADIAL_RATIO, 26.0, "was it given in percent (0.26)?"),
        (plausibility.EDGE, 12e6, "was it given in N/m (12 N/mm)?"),
        (plausibility.FEED_PER_TOOTH, 0.1, "was it given in µm (0.1 mm)?"),
        (IMMERSION, 0.005, "was 50 % meant?"),
    ],
)
def test_the_slip_that_explains_a_value_is_asked_about(kind, value, meant):
    assert str(kind.remark("it", value)).endswith(meant)
    low, high = kind.possible
    if not low <= value / kind.size <= high:
        with pytest.raises(InputError) as error:
            kind.checked("it", value)
        assert error.value.allowed.endswith(meant)


def test_a_remark_names_field_value_and_usual_range():
    remark = DIAMETER.remark("cutter.diameter_mm", 0.3)
    assert (remark, remark.code) == ("cutter.diameter_mm is 300 mm, but usual are 0.5 to 250 mm", PlausibilityCode.UNUSUAL)


@pytest.mark.parametrize("value", [math.nan, math.inf, True, "12", None])
def test_what_is_no_number_is_refused(value):
    with pytest.raises(InputError, match="it: found"):
        DIAMETER.checked("it", value)


def test_a_proportion_has_both_ranges_too():
    limits = (0.5, 2.0), (0.1, 10.0)
    assert proportion("it", 1.0, *limits, "this", "that") is None
    assert proportion("it", 3.0, *limits, "this", "that") == "it is this, but usual is that"
    with pytest.raises(InputError, match="it: found this, allowed is that"):
        proportion("it", 11.0, *limits, "this", "that")


def test_materials_of_the_library_are_usual():
    assert [material.name for material in materials() if material.coefficients.remarks] == []


def test_a_process_remarks_on_coefficients_feed_and_immersion():
    usual = MillingProcess(Cutter(4, 0.012), CuttingCoefficients(9e8, 0.3), Engagement.from_immersion(0.02, "up"), feed_per_tooth=1e-4)
    assert usual.remarks == ()
    odd = MillingProcess(Cutter(4, 0.012), CuttingCoefficients(4e7, 1.8), Engagement.from_immersion(0.005, "up"), feed_per_tooth=5e-3)
    assert [remark.split(" is ")[0] for remark in odd.remarks] == [
        "tangential coefficient",
        "radial ratio",
        "feed per tooth",
        "radial immersion",
    ]
    with pytest.raises(InputError, match="feed_per_tooth: found 100 mm"):
        MillingProcess(Cutter(4, 0.012), CuttingCoefficients(9e8, 0.3), Engagement(0.0, 1.0), feed_per_tooth=0.1)


@pytest.mark.parametrize("immersion", [0.02, 0.5, 1.0])
@pytest.mark.parametrize("strategy", ["up", "down"])
def test_an_engagement_knows_its_immersion(immersion, strategy):
    assert Engagement.from_immersion(immersion, strategy).immersion == pytest.approx(immersion, rel=1e-12)
