"""Runs, limits and lost samples found block by block are those that a look at the whole channel finds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.signals import channel_scan, recording
from rcsa_ident.signals.channel_scan import FROZEN_SAMPLES, scan
from rcsa_ident.signals.recording import Quantity, Recording, Sensor
from tests.oracles.naive import clipped_samples, frozen_run

SENSOR = Sensor("g", Quantity.DISPLACEMENT, Dof.X)


def look(x, block, monkeypatch):
    monkeypatch.setattr(recording, "BLOCK", block)
    (found,) = scan(Recording(1000.0, np.asarray(x, dtype=float)[:, None], (SENSOR,)), [0])
    return found


@st.composite
def channels(draw):
    """Coarse and fine signals with frozen stretches and limits."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    n = draw(st.integers(2, 600))
    x = np.cumsum(rng.standard_normal(n)) if draw(st.booleans()) else rng.standard_normal(n)
    step = draw(st.sampled_from([0.0, 0.1, 1.0, 5.0]))
    x = x if step == 0.0 else np.round(x / step) * step
    for _ in range(draw(st.integers(0, 3))):
        start = draw(st.integers(0, n - 1))
        x[start : start + draw(st.integers(1, 80))] = x[start]
    if draw(st.booleans()):
        x = np.clip(x, *np.quantile(x, [draw(st.sampled_from([0.0, 0.05])), draw(st.sampled_from([0.8, 0.97, 1.0]))]))
    return x


@settings(deadline=None, max_examples=300)
@given(x=channels(), block=st.sampled_from([1, 7, 64, 1000]))
def test_blocks_tell_what_the_whole_tells(x, block):
    with pytest.MonkeyPatch.context() as patched:
        found = look(x, block, patched)
    assert (found.lost, found.low, found.high, found.first) == (0, x.min(), x.max(), x[0])
    if x.min() < x.max():
        assert found.clipped == clipped_samples(x)
        assert found.frozen == frozen_run(x)


def test_each_case_of_the_twin_occurs(monkeypatch):
    wave = np.sin(0.05 * np.arange(4000)) + 1e-3 * np.random.default_rng(1).standard_normal(4000)
    frozen, limited = wave.copy(), np.clip(wave, -0.9, 0.9)
    frozen[100:160] = frozen[100]
    assert look(wave, 64, monkeypatch).frozen is None
    assert look(frozen, 64, monkeypatch).frozen == (100, 60) == frozen_run(frozen)
    assert look(limited, 64, monkeypatch).clipped == clipped_samples(limited) > 1000
    assert look(wave, 64, monkeypatch).clipped == 0
    wave[-3 * channel_scan.FROZEN_SAMPLES * 2 :] = 0.5
    assert look(wave, 64, monkeypatch).frozen == (4000 - 6 * FROZEN_SAMPLES, 6 * FROZEN_SAMPLES) == frozen_run(wave)


def test_lost_samples_are_counted_across_blocks(monkeypatch):
    x = np.random.default_rng(1).standard_normal(1000)
    x[[130, 131, 700]] = np.nan, np.inf, -np.inf
    found = look(x, 64, monkeypatch)
    assert (found.lost, found.first_lost) == (3, 130)
    assert (found.low, found.high) == (x[np.isfinite(x)].min(), x[np.isfinite(x)].max())
