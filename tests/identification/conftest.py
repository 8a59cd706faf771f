"""Cuts on the virtual sample machine, prepared once for all tests of the room."""

import numpy as np
import pytest

from tests.fixtures.virtual_shop import open_shop


@pytest.fixture(scope="session")
def shop():
    return open_shop()


@pytest.fixture(scope="session")
def few(shop):
    """Every third cut of both toolings, both axes, the flange's motion alone."""
    cuts, _ = shop.measurements(np.random.default_rng(1), runout=1e-7, fixture=False)
    return shop.prepare(cuts[::3])


@pytest.fixture(scope="session")
def rich(shop):
    """The same cuts with all that the data may hold: two outputs, triggers of unknown tooth angle, uncertain forces, smooth errors."""
    first, second = shop.truth
    cuts, _ = shop.measurements(np.random.default_rng(1), runout=1e-7, trigger={first: (0.7, False), second: (-0.4, False)})
    return shop.prepare(cuts[::3], spread=(0.05, 0.1, 0.0, 0.0)).with_smooth_errors(2e-3, 2)
