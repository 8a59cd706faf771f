"""Estimates of work beside what was counted: on a tip like identified ones, with eighteen modes up to beyond the receptance's end."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.stability import hill
from rcsa_ident.stability._kernels import monodromy as _monodromy_kernels
from rcsa_ident.stability._kernels import time as _time_kernels
from rcsa_ident.stability.lobes import METHODS
from rcsa_ident.stability.methods import ABOVE_TOP, FITTED_MODES
from tests.stability.mills import RPM, mill, tip

HIGHEST = 6000.0
TIP = tip(tuple((axis, f, 0.03, 0.3 * (1000.0 / f)) for axis in (0, 1) for f in np.geomspace(600.0, HIGHEST, 9)))
TOP = 2.0 * np.pi * HIGHEST / ABOVE_TOP
LINES, PLACES = 2.0 * np.pi * np.arange(50.0, HIGHEST / ABOVE_TOP, 5.0), (Coordinate("tip", Dof.X), Coordinate("tip", Dof.Y))
UNEVEN = np.radians([80.0, 100.0, 80.0, 100.0])
CUTS = {
    "half": mill(4, helix=0.5),
    "low immersion": mill(4, 0.05, helix=0.5),
    "two teeth, low immersion": mill(2, 0.1, helix=0.5),
    "slot": mill(4, 1.0, helix=0.5),
    "unequal pitch": mill(4, helix=0.5, pitch=UNEVEN),
    "ten teeth": mill(10, helix=0.5),
}
SPEEDS = np.array([1500.0, 6000.0, 18_000.0]) * RPM


@pytest.fixture
def counted(monkeypatch):
    """Operations of the kernels, as they are run."""
    found = {"work": 0.0}
    largest, simulate, matrices = _monodromy_kernels.multiplier, _time_kernels.simulate, hill.Hill.matrices

    def multiplier(modes, layout, *others):
        answer = largest(modes, layout, *others)
        found["work"] += answer[2] * layout.damping.shape[0] * modes.pole.size
        return answer

    def march(modes, pieces, plan, memory, number, samples):
        found["work"] += samples.shape[0] * (modes.pole.size + len(pieces))
        simulate(modes, pieces, plan, memory, number, samples)

    def asked(self, offset, omega, depth):
        found["work"] += omega.size * (2.0 * offset.size) ** 3
        return matrices(self, offset, omega, depth)

    monkeypatch.setattr(_monodromy_kernels, "multiplier", multiplier)
    monkeypatch.setattr(_time_kernels, "simulate", march)
    monkeypatch.setattr(hill.Hill, "matrices", asked)
    return found


def ratio(name, process, speeds, counted):
    assert TIP.pole.size == FITTED_MODES
    method = METHODS[name]()
    # a receptance that ends at the top, or the modes that a fit of it would find
    known = TIP if method.needs == "modes" else Receptance(LINES, TIP.response(LINES), PLACES, PLACES)
    method.lobes(known, process, speeds, 0.01)
    assert counted["work"] > 0.0
    return counted["work"] / float(method.operations(process, speeds, TOP, 0.01).sum())


@pytest.mark.slow
@pytest.mark.parametrize("cut", CUTS)
@pytest.mark.parametrize("name", ["full-discretisation", "semi-discretisation"])
def test_period_maps(counted, name, cut):
    assert 0.4 < ratio(name, CUTS[cut], SPEEDS[1:], counted) < 2.5


@pytest.mark.slow
@pytest.mark.parametrize("name", ["full-discretisation", "multi-frequency"])
def test_slow_spindles_cost_what_is_said(counted, name):
    assert 0.4 < ratio(name, CUTS["half"], SPEEDS[:1], counted) < 2.5


@pytest.mark.slow
@pytest.mark.parametrize("cut", ["half", "low immersion", "two teeth, low immersion", "slot", "ten teeth"])
def test_multi_frequency(counted, cut):
    assert 0.4 < ratio("multi-frequency", CUTS[cut], SPEEDS[1:], counted) < 2.5


@pytest.mark.slow
@pytest.mark.parametrize("cut", ["half", "unequal pitch"])
def test_time_domain(counted, cut):
    assert 0.4 < ratio("time-domain", CUTS[cut], SPEEDS[2:], counted) < 2.5
