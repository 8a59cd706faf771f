"""Cuts on a virtual machine that stands oblique and turns, prepared once for all tests of the room."""

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.identification.coupled.data import coupled_data
from tests.fixtures.virtual_shop import oblique, open_shop
from tests.identification.coupled.models import some_missing


@pytest.fixture(scope="session")
def turned_shop():
    return open_shop(8, lambda spindle: replace(oblique(spindle, 10.0, 0.6), gyroscopic=True))


@pytest.fixture(scope="session")
def plain(turned_shop):
    """A few cuts of both toolings, the flange's motion alone, forces taken as they are."""
    cuts, _ = turned_shop.measurements(np.random.default_rng(1), runout=1e-7, fixture=False, both_forces=True)
    return turned_shop.prepare(some_missing(cuts[::3]), turning=True)


@pytest.fixture(scope="session")
def rich(turned_shop):
    """The same cuts with all that the data may hold: two outputs, triggers of unknown tooth angle, uncertain forces, smooth errors."""
    first, second = turned_shop.truth
    trigger = {first: (0.7, False), second: (-0.4, False)}
    cuts, _ = turned_shop.measurements(np.random.default_rng(1), runout=1e-7, trigger=trigger, both_forces=True)
    return turned_shop.prepare(some_missing(cuts[::3]), spread=(0.05, 0.1, 0.0, 0.0), turning=True).with_smooth_errors(2e-3, 2)


@pytest.fixture(scope="session", params=["plain", "rich"])
def data(request, plain, rich):
    return {"plain": plain, "rich": rich}[request.param]


@pytest.fixture(scope="session")
def points(data):
    return coupled_data(data)
