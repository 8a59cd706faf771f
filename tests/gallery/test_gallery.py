"""Each example states, solves and is checked here."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np


def example(name: str):  # type: ignore[no-untyped-def]
    path = Path(__file__).with_name(f"ex_{name}.py")
    assert len(path.read_text().splitlines()) <= 60
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_stickout():
    frequency, height = np.array(example("stickout").PEAKS).T
    assert np.all(np.diff(frequency) < 0.0)
    assert np.all(np.diff(height) > 0.0)


def test_force_lines():
    ex = example("force_lines")
    error = np.linalg.norm(ex.FROM_LINES - ex.SAMPLED) / np.linalg.norm(ex.SAMPLED)
    assert error < 0.01


def test_lobes_from_modes():
    lobes = example("lobes_from_modes").LOBES
    np.testing.assert_allclose(lobes.absolute_limit, 0.04793e-3, rtol=1e-3)
    np.testing.assert_allclose(lobes.absolute_frequency / (2.0 * np.pi), 923.59, rtol=1e-4)
    assert not lobes.warnings
