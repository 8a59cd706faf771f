"""A cut that is asked about becomes a process: what it leaves open comes from the tooling, the material or the campaign's workpiece."""

from __future__ import annotations

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.materials import material
from rcsa_ident.cutting.process import ProcessDamping, SpeedVariation
from rcsa_ident.io.settings.setups import tooling_of
from rcsa_ident.setup.cut import CutSpec, Workpiece
from rcsa_ident.workflows.identify import of_campaign
from tests.fixtures import by_hand

CUTTER = Cutter(teeth=4, diameter=0.012)
WORKPIECE = Workpiece("of the campaign", CuttingCoefficients(902e6, 0.26, radial_edge=5e3, ratio_spread=0.07))
KNOWN = {"tangential": 7e8, "radial_ratio": 0.3}


def test_by_default_it_is_half_immersion_down_milling_along_x():
    process = CutSpec(coefficients=KNOWN).process(CUTTER)
    assert process.engagement == Engagement.from_immersion(0.5, "down")
    assert (process.feed_angle, process.feed_per_tooth, process.damping, process.speed_variation) == (0.0, None, None, None)
    assert process.cutter is CUTTER
    assert process.coefficients == CuttingCoefficients(7e8, 0.3)


def test_all_that_is_said_arrives():
    damping, variation = ProcessDamping(1e12, 8e-5), SpeedVariation(0.1, 0.3)
    spec = CutSpec(Engagement(0.0, 1.0), 0.7, 1e-4, coefficients=KNOWN, damping=damping, speed_variation=variation)
    process = spec.process(CUTTER)
    assert (process.engagement, process.feed_angle, process.feed_per_tooth) == (Engagement(0.0, 1.0), 0.7, 1e-4)
    assert (process.damping, process.speed_variation) == (damping, variation)


def test_coefficients_are_the_workpieces_but_for_single_ones():
    assert CutSpec().process(CUTTER, WORKPIECE).coefficients == WORKPIECE.coefficients
    found = CutSpec(coefficients={"radial_ratio": 0.4}).process(CUTTER, WORKPIECE).coefficients
    assert (found.tangential, found.radial_ratio, found.radial_edge, found.ratio_spread) == (902e6, 0.4, 5e3, 0.07)


def test_a_material_stands_above_the_workpiece_and_single_coefficients_above_it():
    name = "EN AW-7075-T6"
    known = material(name).coefficients
    assert CutSpec(material=name).process(CUTTER, WORKPIECE).coefficients == known
    found = CutSpec(material=name, coefficients={"tangential": 5e8}).process(CUTTER).coefficients
    assert (found.tangential, found.radial_ratio) == (5e8, known.radial_ratio)
    with pytest.raises(InputError, match="material"):
        CutSpec(material="unobtainium").process(CUTTER, WORKPIECE)


@pytest.mark.parametrize(("known", "field"), [({}, "tangential coefficient"), ({"tangential": 7e8}, "radial ratio")])
def test_without_a_campaign_or_a_material_coefficients_are_asked_for(known, field):
    with pytest.raises(InputError) as error:
        CutSpec(coefficients=known).process(CUTTER)
    assert error.value.field == field
    assert "without a campaign no workpiece is known" in error.value.allowed


def test_run_out_is_the_cutters_and_belongs_to_each_tooth():
    spec = CutSpec(coefficients=KNOWN, runout=(0.0, 5e-6, -5e-6, 0.0))
    process = spec.process(CUTTER)
    np.testing.assert_array_equal(process.cutter.runout, spec.runout)
    assert (process.cutter.teeth, process.cutter.diameter) == (4, 0.012)
    assert not np.any(CUTTER.runout)
    with pytest.raises(InputError, match="runout: found 2 numbers, allowed is 4"):
        CutSpec(coefficients=KNOWN, runout=(0.0, 5e-6)).process(CUTTER)


def test_a_run_out_of_the_tooling_stays_where_the_cut_says_nothing():
    worn = Cutter(2, 0.012, runout=np.array([1e-6, -1e-6]))
    np.testing.assert_array_equal(CutSpec(coefficients=KNOWN).process(worn).cutter.runout, worn.runout)


def test_a_campaign_remarks_on_its_toolings_its_workpiece_and_its_cuts(tmp_path):
    """Once for all cuts that share a remark."""
    usual = by_hand.campaign(tmp_path)
    assert usual.remarks == ()
    thin = tooling_of(tomllib.loads(by_hand.TOOLING.replace("inner_diameter_mm = 12.0", "inner_diameter_mm = 20.0")), "", "T1")
    shallow = [replace(cut, conditions=replace(cut.conditions, axial_depth=4e-6)) for cut in usual.cuts]
    soft = Workpiece("foam", CuttingCoefficients(4e7, 0.3))
    found = replace(usual, toolings={"T1": thin}, workpiece=soft, cuts=tuple(shallow)).remarks
    assert [remark.split(" is ")[0] for remark in found] == [
        "T1: holder.segments[0].inner_diameter_mm",
        "foam: tangential coefficient",
        "T1-0 and 2 more: axial depth",
    ]


def test_an_identification_notes_what_is_unusual_about_its_campaign(tmp_path):
    usual = by_hand.campaign(tmp_path)
    odd = replace(usual, workpiece=Workpiece("foam", CuttingCoefficients(4e7, 0.3)))
    known = by_hand.identification()
    assert of_campaign(known, usual).notes == known.notes
    assert of_campaign(known, odd).notes == (*known.notes, *odd.remarks)
