"""Margins of cuts beside the limits that they stand for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.modal import normal_modes
from rcsa_ident.stability.discretisation import FullDiscretisation
from rcsa_ident.stability.labels.cut_margins import CutMargins, points_of
from rcsa_ident.stability.labels.tested_cuts import OwnConditions, TestedCuts, Verdict
from rcsa_ident.stability.labels.uncertain_tip import UncertainTip
from rcsa_ident.stability.tip_modes import TipModes
from rcsa_ident.stability.zero_order import ZeroOrder
from tests.stability.labels.test_tested_cuts import CUT

FITTING = FullDiscretisation()


def tip(softening=0.0):
    mode = normal_modes(np.array([5000.0]), np.array([0.03]), np.array([[2.0]]), (Coordinate("tip", Dof.Y),))
    return UncertainTip.independent(TipModes.of({Dof.Y: mode}), np.array([[0.05], [0.2], [0.2]]), (0.1, 0.2), softening)


def asked(speeds, depths, own=()):
    return TestedCuts(np.asarray(speeds), np.asarray(depths), (Verdict.MARGINAL,) * len(depths), own=own)


def limits(process, speeds, z, prior):
    return np.array([FITTING.lobes(prior.at(each), prior.process(each, process), speeds, 0.1).limit_depth for each in z])


def test_the_sign_changes_at_the_limit_and_margins_beside_it_are_small():
    """Farther away the rate is in no proportion to the depth: between lobes a cut dies away faster than a tool that cuts nothing."""
    prior, speeds, z = tip(), np.array([600.0, 800.0]), np.random.default_rng(1).standard_normal((4, 5))
    limit = limits(CUT, speeds, z, prior)
    for share in (0.5, 0.97, 1.03, 2.0):
        for k, each in enumerate(z):
            found = CutMargins(prior, CUT, FITTING, asked(speeds, share * limit[k]))(each[None]).margin[0]
            assert np.all((found > 0.0) == (share < 1.0))
            assert share in {0.5, 2.0} or found == pytest.approx(np.log(1.0 / share), abs=0.25)


def test_a_cut_above_an_island_is_stable():
    """A helix in a narrow cut: stable at a depth, unstable at a smaller one, which no lowest limit can say."""
    cutter = Cutter(2, 0.012, np.radians(35.0))
    process = OwnConditions(radial_immersion=0.05, strategy="down").process(replace(CUT, cutter=cutter))
    prior, z = tip(), np.zeros((1, 5))
    speeds, depths = np.linspace(1500.0, 6000.0, 60), np.geomspace(1e-3, 40e-3, 25)
    grid = np.meshgrid(speeds, depths, indexing="ij")
    margin = CutMargins(prior, process, FITTING, asked(grid[0].ravel(), grid[1].ravel()))(z).margin.reshape(60, 25)
    # stable, unstable and stable again at one speed
    again = (np.diff((margin > 0.0).astype(int), axis=1) > 0).any(axis=1)
    assert again.any()


def test_each_cut_is_asked_as_it_was_made():
    prior, z = tip(), np.zeros((1, 5))
    own = (OwnConditions(), OwnConditions(strategy="up"), OwnConditions(radial_immersion=1.0))
    together = CutMargins(prior, CUT, FITTING, asked([700.0] * 3, [1e-3] * 3, own))(z).margin[0]
    for k, each in enumerate(own):
        alone = CutMargins(prior, each.process(CUT), FITTING, asked([700.0], [1e-3]))(z).margin[0, 0]
        assert together[k] == pytest.approx(alone, rel=1e-6)
    assert points_of(asked([700.0] * 3, [1e-3] * 3, own), CUT) == pytest.approx(np.array([[700, 0.5, 0], [700, 0.5, 1], [700, 1, 0]]))


def test_a_method_without_multipliers_tells_limits():
    prior, z, depth = tip(), np.zeros((1, 5)), 0.3e-3
    lobes = ZeroOrder().lobes(prior.at(z[0]).receptance(), CUT, np.array([700.0]), 4.0 * depth)
    found = CutMargins(prior, CUT, ZeroOrder(), asked([700.0], [depth]))(z).margin[0, 0]
    assert found == pytest.approx(np.log(min(lobes.limit_depth[0], 4.0 * depth) / depth), rel=0.02)


def test_a_tip_that_softens_and_a_frequency_that_was_heard():
    cuts = TestedCuts(np.array([600.0, 900.0]), np.full(2, 2e-3), (Verdict.CHATTER,) * 2, np.array([np.nan, 5000.0]))
    found = CutMargins(tip(1e-4), CUT, FITTING, cuts)(np.array([[0, 0, 0, 0, 0, 0.0], [0, 0, 0, 0, 0, 1.0]]))
    assert np.isnan(found.chatter[:, 0]).all()
    assert np.all(np.abs(found.chatter[:, 1] / 5000.0 - 1.0) < 0.2)
    assert found.margin[0] != pytest.approx(found.margin[1], abs=1e-3)
