"""Cuts that a corner radius shapes, from the virtual machine's own levels: identified with it, and as if the cutters were sharp."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from rcsa_ident.cutting.corner import with_corner
from rcsa_ident.cutting.force import force_and_slope
from rcsa_ident.cutting.materials import material
from rcsa_ident.identification.evidence import EvidenceSelection
from rcsa_ident.identification.search import SearchSettings
from rcsa_ident.virtual.milling import rigid_force_lines
from tests.fixtures.kept import kept
from tests.fixtures.virtual_shop import TIP_OMEGA, Shop, open_shop

QUICK = EvidenceSelection(search=SearchSettings(modes=8, population=4, generations=2, steps=6), candidates=2)
#: Known as it is, with the largest axial force of the library's: that is what reaches X and Y in a corner.
COEFFICIENTS = material("EN AW-6082-T6").coefficients
#: As a model that knows the corner radius is told it.
TOLD = replace(COEFFICIENTS, tangential_spread=0.0)
RADIUS, DEPTH, SEED = 0.5e-3, 0.4e-3, 3


@dataclass(frozen=True)
class Rounded(Shop):
    """Cutters have one corner radius, and are believed to have another."""

    true: float = 0.0
    believed: float = 0.0

    def force(self, name, order, speed, coefficients=None):
        """Of levels where the truth is asked, of rows where it is believed."""
        cutter = self.toolings[name].cutter
        cut = replace(self.machine.plan.conditions(speed), axial_depth=DEPTH)
        if coefficients is TOLD:
            return force_and_slope(with_corner(cutter, self.believed), cut, COEFFICIENTS, order)
        return rigid_force_lines(with_corner(cutter, self.true), cut, COEFFICIENTS, slices=16)[order, :2], None


@pytest.fixture(scope="module")
def errors():
    """Of the tooltip that was never cut, X and Y, by true and believed corner radius."""
    return kept(_errors)


def _errors():
    shop = open_shop(speeds=12)
    known = (shop.machine, shop.toolings, shop.held_out, shop.truth, shop.across)
    true = shop.tip(14000.0 * np.pi / 30.0)
    found = {}
    for pair in ((0.0, 0.0), (RADIUS, RADIUS), (RADIUS, 0.0)):
        own = Rounded(*known, *pair)
        cuts, _ = own.measurements(np.random.default_rng(SEED), fixture=False, believed=TOLD)
        tip = QUICK.run(own.prepare(cuts), 1).machine.tip(own.held_out, TIP_OMEGA, spread=False)
        values = np.einsum("nii->ni", tip.values)
        found[pair] = np.linalg.norm(values - true, axis=0) / np.linalg.norm(true, axis=0)
    return found


@pytest.mark.witness
@pytest.mark.slow
def test_a_known_corner_radius_costs_nothing_and_an_unknown_one_much(errors):
    sharp, known, ignored = (np.linalg.norm(errors[pair]) for pair in ((0.0, 0.0), (RADIUS, RADIUS), (RADIUS, 0.0)))
    assert known < 1.2 * sharp
    assert ignored > 3.0 * known
