"""A campaign says what is unusual about what was on the machine."""

from __future__ import annotations

import tomllib
from dataclasses import replace

from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.io.settings.setups import tooling_of
from rcsa_ident.setup.cut import Workpiece
from rcsa_ident.workflows.identify import of_campaign
from tests.fixtures import by_hand


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
