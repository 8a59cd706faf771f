"""Cuts on the virtual sample machine, prepared once for all tests of the room."""

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.identification.rough_data import with_rough_cuts, with_rough_toolings
from rcsa_ident.tool_holder.drawings import Drawing, rough_toolings
from rcsa_ident.tool_holder.rough import rough_tool_holder
from rcsa_ident.tool_holder.spread import Spread
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


@pytest.fixture(scope="session")
def rough(shop):
    """The same cuts with drawings, sensors, depths and edge forces that are known roughly: shared holders, gains, delays, cross-talk."""
    told = replace(shop.machine.workpiece.coefficients, tangential_edge=6e3, radial_edge=4e3)
    cuts, _ = shop.measurements(np.random.default_rng(1), runout=1e-7, both_forces=True, believed=told)
    data = shop.prepare(cuts[::3], spread=(0.05, 0.1, 0.9, 0.9))
    drawings = {name: Drawing(shop.toolings[name].assembly, Spread(), "tool", "holder") for name in data.toolings}
    holders = [rough_tool_holder(each.assembly, 4300.0) for each in drawings.values()]
    depth, gain, delay, talk = (np.array(each) for each in ((0.05, 0.07), (0.02, 0.02), (5e-6, 5e-6), (0.015, 0.02)))
    data = with_rough_cuts(data, depth, gain, delay, talk)
    return with_rough_toolings(data, rough_toolings(drawings), holders).with_smooth_errors(2e-3, 2)
