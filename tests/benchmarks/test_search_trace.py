from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.search_trace import Recorder, table
from benchmarks.study import MACHINES
from benchmarks.yardstick import SHARE, cross_receptance, lines_misfit
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.dynamics.coordinates import Dof, plane
from rcsa_ident.dynamics.modal import ModalModel
from rcsa_ident.identification.data import LEVER
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.tool_holder.model import tool_holder_receptance


@pytest.fixture
def machine():
    omega_n = 2.0 * np.pi * np.array([900.0, 2000.0])
    phi = np.array([[0.2, 0.1], [0.3, -0.6]]) * (1.0 - 1.0j) / (2.0 * np.sqrt(omega_n))[:, None]
    modes = ModalModel(omega_n, np.array([0.05, 0.04]), phi, np.diag([1e-9, 1e-7]), plane("flange", Dof.X))
    return modes, LumpedJoint(3e9, 6e6, 2e3, 10.0)


@pytest.fixture
def lines(machine):
    """Lines of five cuts without noise, each with a delay of its own."""
    rng = np.random.default_rng(1)
    cut = np.repeat(np.arange(5), 12)
    speed = np.linspace(900.0, 2000.0, 5)
    omega = 4.0 * speed[cut] * np.tile(np.arange(1, 13), 5) / 4.0
    receptance = tool_holder_receptance(read_tooling(MACHINES / "toolings" / "S1-ER32.toml").assembly, omega)
    a22, a21 = receptance["flange", "flange"], receptance["flange", "tip"]
    flange = np.stack([a22[:, 0, 0], LEVER * a22[:, 0, 1], LEVER**2 * a22[:, 1, 1]], axis=1)
    tip = np.stack([a21[:, 0, 0], LEVER * a21[:, 1, 0]], axis=1)
    model = couple(receptance, machine[0].receptance(omega), machine[1])["spindle", "tip"][:, 0, 0]
    period = 2.0 * np.pi / (4.0 * speed)
    delay = rng.uniform(0.0, 1.0, 5) * period
    measured = model * np.exp(-1j * omega * delay[cut])
    axis = SimpleNamespace(omega=omega, measured=measured, noise=np.zeros(omega.size), cut=cut, flange=flange, tip=tip)
    prior = SimpleNamespace(tooth_period=period)
    return model, SimpleNamespace(axes=(axis,), cut_ids=tuple("abcde"), cut_prior=prior)


def test_cross_receptance_is_that_of_the_coupling(machine, lines):
    model, data = lines
    axis = data.axes[0]
    np.testing.assert_allclose(cross_receptance(*machine, axis.omega, axis.flange, axis.tip), model, rtol=1e-6)


def test_misfit_of_the_truth_is_nothing_whatever_the_delays(machine, lines):
    assert lines_misfit(lines[1], *machine) < 1e-4


def test_misfit_of_lines_off_by_their_share_is_one(machine, lines):
    axis = lines[1].axes[0]
    # a circle of radius SHARE around each line: mean square 1 in deviations of the real and the imaginary part
    circle = SHARE * np.exp(2j * np.pi * np.arange(axis.omega.size) * 0.381966)
    axis.measured = axis.measured * (1.0 + circle)
    assert lines_misfit(lines[1], *machine) == pytest.approx(1.0, rel=0.12)


def test_recorder_keeps_what_is_best_and_of_what_is_close_the_first_and_the_last():
    now = [10.0]
    recorder = Recorder(clock=lambda: now[0])
    for seconds, cost in ((1.0, 9.0), (2.0, 9.5), (3.0, 8.0), (3.1, 7.0), (3.2, 6.5), (8.0, 7.0), (20.0, 1.0)):
        now[0] = 10.0 + seconds
        recorder.offer(cost, cost)
    assert [cost for _, cost, _ in recorder.points] == [9.0, 8.0, 6.5, 1.0]
    assert [seconds for seconds, _, _ in recorder.points] == pytest.approx([1.0, 3.0, 3.2, 20.0])
    assert recorder.best == 1.0


def test_table_says_where_each_search_ended():
    row = {"machine": "101", "method": "CMA-ES", "seed": 2, "points": [[1.0, 5.0, 9.0, 0.5, 0.6], [60.0, 2.0, 1.25, 0.0123, 0.04]]}
    assert "| 101 | CMA-ES | 2 | 60.0 | 1.25 | 0.0123 | 0.0400 |" in table([row])
