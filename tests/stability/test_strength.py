"""How much stronger a material may be: against limits of cuts in that material, by every method, whatever is known of a similar cut."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.cutting.conditions import EngagementMap
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.stability.discretisation import FullDiscretisation, SemiDiscretisation
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.methods import StabilityMethod
from rcsa_ident.stability.multi_frequency import MultiFrequency
from rcsa_ident.stability.strength import Search, strength
from rcsa_ident.stability.tip_modes import TipModes
from rcsa_ident.stability.zero_order import ZeroOrder
from tests.stability.mills import COEFFICIENTS, PASSING, RPM, SKEWED, slow_slot, tip

SPEED, DEPTH = 9000.0 * RPM, 1e-3
#: An arc that becomes narrower with the height.
STEPPED = EngagementMap(np.array([0.0, 0.6e-3, 1e-3]), np.array([1.2, 1.5, 2.0]), np.array([np.pi, np.pi, 2.8]))
METHODS = [ZeroOrder(), MultiFrequency(), SemiDiscretisation(), FullDiscretisation()]
SEARCH = Search(8.0, 0.01)


def cut(pitch: list[float] | None = None) -> MillingProcess:
    own = {} if pitch is None else {"pitch": np.radians(pitch)}
    return MillingProcess(Cutter(3, 0.012, 0.5, **own), COEFFICIENTS, STEPPED, feed_angle=0.4)


def stable(method: StabilityMethod, modes: TipModes, process: MillingProcess, speed: float, depth: float, times: float) -> bool:
    """Whether a material so much stronger has no limit up to the depth."""
    known = process.coefficients
    harder = replace(process, coefficients=replace(known, tangential=times * known.tangential))
    return bool(stability_lobes(modes, harder, np.array([speed]), depth, method).stable[0])


@pytest.mark.slow
@pytest.mark.parametrize("pitch", [None, [100.0, 121.0, 139.0]], ids=["equal", "unequal"])
@pytest.mark.parametrize("method", METHODS, ids=[each.name for each in METHODS])
def test_a_little_stronger_chatters_and_a_little_weaker_does_not(method, pitch):
    found = strength(method, tip(SKEWED), cut(pitch), SPEED, DEPTH, SEARCH)
    assert 0.2 < found.times < 5.0
    assert stable(method, tip(SKEWED), cut(pitch), SPEED, DEPTH, 0.98 * found.times)
    assert not stable(method, tip(SKEWED), cut(pitch), SPEED, DEPTH, 1.02 * found.times)
    if found.warnings:
        assert isinstance(method, MultiFrequency)
        assert "not converged" in found.warnings[0]
        return
    assert 700.0 < found.chatter_frequency / (2.0 * np.pi) < 1500.0


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS[1:], ids=[each.name for each in METHODS[1:]])
def test_whatever_a_similar_cut_bears(method):
    """Right, a little off, far off on either side, and beyond the ends."""
    plain = strength(method, tip(SKEWED), cut(), SPEED, DEPTH, SEARCH)
    for near in (plain.times, 1.05 * plain.times, 0.5 * plain.times, 2.0 * plain.times, 8.0, 1.0 / 8.0):
        found = strength(method, tip(SKEWED), cut(), SPEED, DEPTH, SEARCH._replace(near=near))
        assert found.times == pytest.approx(plain.times, rel=0.012)


@pytest.mark.parametrize("near", [np.nan, 1.0, 4.0, 0.25])
@pytest.mark.parametrize("method", METHODS, ids=[each.name for each in METHODS])
def test_nobody_asks_beyond_the_ends(method, near):
    thin = strength(method, tip(SKEWED), cut(), SPEED, 2e-5, Search(4.0, 0.01, near))
    assert thin.times == 4.0
    assert np.isnan(thin.chatter_frequency)
    thick = strength(
        method, tip(SKEWED), replace(cut(), engagement=replace(STEPPED, z=20.0 * STEPPED.z)), SPEED, 20e-3, Search(4.0, 0.01, near)
    )
    assert thick.times == 0.25
    assert np.isfinite(thick.chatter_frequency)


@pytest.mark.parametrize("near", [np.nan, 1.0, 4.0])
def test_vibrations_that_grow_before_they_die_away(near):
    """Three millimetres of a slow slot, worn teeth: no multiplier tells that the limit is near, and the margin does."""
    method, modes, process, speed, depth = FullDiscretisation(), tip(PASSING), slow_slot(1e-4), 1600.0 * RPM, 3e-3
    found = strength(method, modes, process, speed, depth, SEARCH._replace(near=near))
    assert "grows a thousandfold" in found.warnings[0]
    assert stable(method, modes, process, speed, depth, 0.97 * found.times)
    assert not stable(method, modes, process, speed, depth, 1.03 * found.times)
