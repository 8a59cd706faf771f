"""Lines of windows that sweep, freed of the sweep: against the response to a chirp, computed in time by another road."""

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.cut_data import prepare
from rcsa_ident.identification.data import NODE
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.priors import Priors
from rcsa_ident.identification.sweep_correction import unswept
from rcsa_ident.identification.unknowns import flange_layout
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.signals.frf import AxisLines
from rcsa_ident.signals.measurement import CutMeasurement
from rcsa_ident.tool_holder.model import tool_holder_receptance
from tests.fixtures.paths import TOOLINGS
from tests.identification.models import vector_of

LAYOUT = flange_layout(3)
#: Of 14000 rev/min and of a spindle that gains 10000 rev/min in 4 s; of a window [s].
SPEED, GAINED, LENGTH = 14000.0 * np.pi / 30.0, 10000.0 * np.pi / 30.0 / 4.0, 0.28
ORDERS = np.arange(1, 19)
RATE, SECONDS = 20000.0, 8.0


def free(omega):
    """A tool-holder that is the same at all frequencies: the chirp crosses many of them."""
    return tool_holder_receptance(read_tooling(TOOLINGS / "S1-ER32.toml").assembly, np.full(omega.size, 2.0 * np.pi * 1500.0))


def data(order, speed, value, gained=0.0):
    n = order.size
    one = np.ones(n)
    lines = AxisLines(
        order, order * speed, value[:, None], 0.0 * value[:, None], 1e-24 * one[:, None], one, one + 0j, np.zeros((n, 5)) + 0j
    )
    cut = CutMeasurement("p", "S1", speed, {Dof.X: lines}, 0.0, acceleration=gained, length=LENGTH if gained else 0.0)
    return prepare([cut], {"S1": free}, {"S1": 1})


@pytest.fixture(scope="module")
def theta():
    return vector_of(LAYOUT, ((600.0, 1400.0, 2500.0),))


def answers(theta, omega):
    """The model's cross FRF at any frequencies, shape (n,)."""
    asked = data(np.arange(1, omega.size + 1), 1.0, np.ones(omega.size, dtype=complex))
    asked = replace(asked, axes=(replace(asked.axes[0], omega=omega),))
    return Misfit(asked, Priors(), (0.0,)).models(theta, LAYOUT)[0][:, 0]


def chirped(theta, order):
    """What is heard at an order over what drives it, the mean of the middle window of a long pass."""
    count = round(RATE * SECONDS)
    time = (np.arange(count) - 0.5 * count) / RATE
    force = np.exp(1j * order * (SPEED * time + 0.5 * GAINED * time**2))
    # it begins and ends softly: what the ends stir up has gone long before the window
    force = force * np.minimum(1.0, (0.5 * SECONDS - np.abs(time)) / 0.5)
    spectrum, hertz = np.fft.fft(force), np.fft.fftfreq(count, 1.0 / RATE)
    heard = (hertz > 0.0) & (np.abs(spectrum) > 1e-9 * np.abs(spectrum).max())
    response = np.zeros(count, dtype=complex)
    response[heard] = answers(theta, 2.0 * np.pi * hertz[heard]) * spectrum[heard]
    inside = np.abs(time) <= 0.5 * LENGTH
    return np.mean(np.fft.ifft(response)[inside] / force[inside])


def test_a_window_is_freed_of_what_its_sweep_does(theta):
    value = np.array([chirped(theta, order) for order in ORDERS])
    still = answers(theta, ORDERS * SPEED)
    measured = data(ORDERS, SPEED, value, GAINED)
    found = unswept(measured, Priors(), theta, LAYOUT).axes[0]
    before, after = np.abs(value / still - 1.0), np.abs(found.measured / still - 1.0)
    # a sweep does several per cent at resonances, and of that nearly nothing is left
    assert before.max() > 0.02
    assert np.all(after < 0.02 * before + 1e-6)
    # what may be left is in the variance
    assert np.all(after < np.sqrt(2.0 * found.noise) / np.abs(still))


def test_a_rough_machine_frees_them_nearly_as_well(theta):
    # all frequencies 0.3 % off, a tenth of a mode's width
    value = np.array([chirped(theta, order) for order in ORDERS])
    still = answers(theta, ORDERS * SPEED)
    rough = theta.copy()
    rough[:3] += 0.003
    found = unswept(data(ORDERS, SPEED, value, GAINED), Priors(), rough, LAYOUT).axes[0]
    before, after = np.abs(value / still - 1.0), np.abs(found.measured / still - 1.0)
    assert after.max() < 0.35 * before.max()


def test_lines_that_do_not_sweep_stay_as_they_are(theta):
    value = np.exp(1j * ORDERS) * 1e-8
    plain = data(ORDERS, SPEED, value)
    assert not plain.sweeps
    assert unswept(plain, Priors(), theta, LAYOUT) is plain


def test_the_tool_holder_is_asked_beside_each_line():
    found = data(ORDERS, SPEED, np.ones(ORDERS.size, dtype=complex), GAINED).axes[0]
    np.testing.assert_allclose(found.node, NODE * 0.5 * ORDERS * GAINED * LENGTH)
    assert found.around.shape == (ORDERS.size, 2, 5)
    some = found.of(np.array([3, 5]))
    np.testing.assert_array_equal(some.around, found.around[[3, 5]])
    np.testing.assert_array_equal(some.sweep, found.sweep[[3, 5]])
