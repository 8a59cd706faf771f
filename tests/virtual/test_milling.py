import dataclasses

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import Block, CuttingConditions, Engagement, EngagementMap, Stepover
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.directional import mean_directional_matrix
from rcsa_ident.cutting.force import force_history, force_lines, runout_force_lines, unit_lines
from rcsa_ident.cutting.profile import Profile
from rcsa_ident.cutting.serration import Serration
from rcsa_ident.dynamics.coordinates import Coordinate
from rcsa_ident.io.settings.machines import read_machine
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.virtual.milling import mill_cut, rigid_force_lines, synchronous_lines
from rcsa_ident.virtual.reduction import Poles, poles, reduced
from rcsa_ident.virtual.rotor import frequency_response, rotor

STEP = 1.0 / 25600.0 / 8.0
ALUMINIUM = CuttingCoefficients(902e6, 0.26)
EDGES = CuttingCoefficients(800e6, 0.3, 0.0, 8e3, 6e3)
DOWN = Engagement(0.5 * np.pi, np.pi)


def conditions(rpm, depth=0.4e-3, engagement=DOWN, feed_angle=0.0, feed=1e-4):
    return CuttingConditions(rpm * np.pi / 30.0, depth, feed, engagement, feed_angle)


def modal(modes):
    """A system of given modes (axis, natural frequency, damping ratio, mass), the tip at both ends of everything."""
    names = [Coordinate.parse(f"{point}.{axis}") for point in ("tip", "flange", "fixture") for axis in "xy"]
    pole = np.array([2 * np.pi * f * (-z + 1j * np.sqrt(1 - z**2)) for _, f, z, _ in modes])
    inputs, outputs = np.zeros((len(modes), 2), dtype=complex), np.zeros((6, len(modes)), dtype=complex)
    for k, (axis, _, _, mass) in enumerate(modes):
        inputs[k, axis] = 1.0 / (2j * pole[k].imag * mass)
        outputs[axis::2, k] = 1.0
    return Poles(pole, inputs, outputs, tuple(names))


STIFF = modal([(0, 30e3, 0.05, 1e9), (1, 30e3, 0.05, 1e9)])


@pytest.mark.parametrize("rpm", [8000.0, 20000.0])
@pytest.mark.parametrize("feed_angle", [0.0, 0.5 * np.pi, -2.0])
@pytest.mark.parametrize("coefficients", [ALUMINIUM, EDGES])
def test_force_of_a_stiff_machine_has_the_analytic_lines(rpm, feed_angle, coefficients):
    cutter = Cutter(4, 12e-3, np.radians(30.0))
    cut = conditions(rpm, feed_angle=feed_angle)
    history = mill_cut(STIFF, cutter, cut, coefficients, STEP, 9000, start_angle=0.7)
    orders = int(4300.0 / (rpm / 60.0)) + 1
    lines = synchronous_lines(history.angle, history.force, orders)
    exact = force_lines(cutter, cut, coefficients, np.arange(orders))
    assert np.abs(lines - exact).max() < 5e-4 * np.abs(exact).max()


def test_stiff_machine_with_run_out_and_uneven_pitch():
    pitch = np.radians([80.0, 95.0, 85.0, 100.0])
    cutter = Cutter(4, 12e-3, np.radians(30.0), pitch, np.array([4e-6, -3e-6, 1e-6, -2e-6]))
    cut = conditions(9000.0, engagement=Engagement(0.3, 2.5))
    lines = rigid_force_lines(cutter, cut, EDGES)[:41, :2]
    exact = runout_force_lines(cutter, cut, EDGES, np.arange(41))
    assert np.abs(lines - exact).max() < 5e-5 * np.abs(exact).max()


def test_tooth_that_run_out_lifts_off_cuts_nothing():
    cutter = Cutter(2, 12e-3, runout=np.array([0.0, -3e-4]))
    cut = conditions(9000.0, feed=1e-4)
    history = mill_cut(STIFF, cutter, cut, ALUMINIUM, STEP, 3000)
    short = np.mod(history.angle + np.pi, 2.0 * np.pi)
    inside = (short > DOWN.entry + 0.02) & (short < DOWN.exit - 0.02)
    assert np.all(history.force[inside] == 0.0)
    reference = force_history(cutter, cut, ALUMINIUM, history.angle)[:, :2]
    away = np.abs(np.mod(history.angle, np.pi) - 0.5 * np.pi) > 0.02
    assert np.abs(history.force - reference)[away].max() < 1e-3 * np.abs(reference).max()


@pytest.mark.parametrize("rpm", [8000.0, 14000.0, 20000.0])
def test_stable_cut_answers_with_the_cross_receptance(model, dynamics, tooling, rpm):
    cut = conditions(rpm)
    history = mill_cut(dynamics, tooling.cutter, cut, ALUMINIUM, STEP, round(0.35 / STEP), 0.3).after(round(0.15 / STEP))
    orders = np.arange(4, int(4300.0 / (rpm / 60.0)) + 1, 4)
    force = synchronous_lines(history.angle, history.force, 41)[orders]
    receptance = frequency_response(model, orders * cut.spindle_speed, outputs=("flange.x", "flange.y", "fixture.x", "fixture.y"))
    expected = np.einsum("nij,nj->ni", receptance, force)
    for first, found in ((0, history.flange), (2, history.fixture)):
        lines = synchronous_lines(history.angle, found, 41)[orders]
        assert np.linalg.norm(lines - expected[:, first : first + 2]) < 2e-3 * np.linalg.norm(lines)
    acceleration = synchronous_lines(history.angle, history.acceleration, 41)[orders]
    by_lines = -((orders * cut.spindle_speed) ** 2)[:, None] * expected[:, 2:]
    assert np.linalg.norm(acceleration - by_lines) < 5e-3 * np.linalg.norm(by_lines)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hpm", "stiff", "table2"])
def test_programmed_cuts_are_stable(machines_folder, name):
    machine = read_machine(machines_folder / f"{name}.toml")
    for path in machine.toolings:
        tooling = read_tooling(path)
        small = reduced(rotor(machine.spindle, tooling.assembly))
        runout = machine.sensors.cutter_runout * np.cos(tooling.cutter.tooth_angle - 0.3)
        cutter = dataclasses.replace(tooling.cutter, runout=runout)
        for speed in machine.plan.spindle_speeds[3::13]:
            history = mill_cut(poles(small, speed), cutter, machine.plan.conditions(speed), machine.workpiece.coefficients, STEP, 70000)
            # a stable cut passes through the same state once per revolution
            turn = 2.0 * np.pi * np.arange(np.ceil(history.angle[-1] / (2.0 * np.pi)) - 12, history.angle[-1] // (2.0 * np.pi))
            seen = np.interp(turn, history.angle, history.tip[:, 1])
            assert np.ptp(seen) < 0.01 * np.ptp(history.tip[-8000:, 1])


def limit_depth(system, alpha, period):
    """The smallest depth at which 1 = a K alpha (1 - e^{-i w T}) G(i w) for some w: one direction, constant coefficient."""
    omega = 2.0 * np.pi * np.arange(200.0, 2000.0, 0.02)
    loop = ALUMINIUM.tangential * alpha * (1.0 - np.exp(-1j * omega * period)) * system.response(omega)[:, 1, 1]
    real = np.flatnonzero((np.sign(loop.imag[1:]) != np.sign(loop.imag[:-1])) & (loop.real[1:] > 0.0))
    return 1.0 / loop.real[real + 1].max()


@pytest.mark.slow
@pytest.mark.parametrize("rpm", [3000.0, 3140.0])
def test_regeneration_has_the_stability_limit_of_the_delay_equation(rpm):
    # many straight teeth in a half-immersed cut: the directional coefficients hardly vary over the angle
    cutter = Cutter(24, 50e-3)
    up = Engagement(0.0, 0.5 * np.pi)
    system = modal([(1, 800.0, 0.05, 1.0), (0, 30e3, 0.05, 1e6)])
    alpha = mean_directional_matrix(24, up, ALUMINIUM)[1, 1]
    limit = limit_depth(system, alpha, 60.0 / rpm / 24)
    left = []
    for share in (0.88, 1.12):
        cut = conditions(rpm, depth=share * limit, engagement=up, feed=2e-4)
        history = mill_cut(system, cutter, cut, ALUMINIUM, STEP, 100_000, slices=1)
        # once per tooth the steady state repeats: what else moves is the regenerative vibration that the start set off
        place = np.arange(np.ceil(history.angle[0] / cutter.pitch[0]), history.angle[-1] // cutter.pitch[0]) * cutter.pitch[0]
        seen = np.interp(place, history.angle, history.tip[:, 1])
        left.append(np.ptp(seen[-40:]) / np.ptp(seen[:40]))
    assert left[0] < 1e-4
    assert left[1] > 0.9


def test_chatter_stays_bounded_because_teeth_leave_the_cut(dynamics, tooling):
    history = mill_cut(dynamics, tooling.cutter, conditions(9000.0, depth=1.2e-3), ALUMINIUM, STEP, 60_000)
    steady = mill_cut(STIFF, tooling.cutter, conditions(9000.0, depth=1.2e-3), ALUMINIUM, STEP, 9_000)
    assert np.abs(history.force).max() > 1.5 * np.abs(steady.force).max()
    assert np.ptp(history.tip[-15_000:], axis=0).max() < 1.2 * np.ptp(history.tip[15_000:30_000], axis=0).max()
    engaged = np.any(steady.force[-5000:] != 0.0, axis=1).mean()
    assert np.any(history.force[-30_000:] != 0.0, axis=1).mean() < 0.95 * engaged


def test_turning_feed_and_machine_together_turns_the_answer():
    # one more physical symmetry: a machine equal in X and Y does not know the feed's direction
    system = modal([(0, 900.0, 0.04, 1.0), (1, 900.0, 0.04, 1.0)])
    cutter = Cutter(3, 12e-3, np.radians(30.0), runout=np.array([2e-6, -1e-6, 0.0]))
    one = mill_cut(system, cutter, conditions(11000.0, depth=1e-4), EDGES, STEP, 5000)
    other = mill_cut(system, cutter, conditions(11000.0, depth=1e-4, feed_angle=0.6), EDGES, STEP, 5000)
    turn = conditions(11000.0, feed_angle=0.6).machine_from_feed
    assert np.allclose(other.tip, one.tip @ turn.T, rtol=0, atol=1e-9 * np.abs(one.tip).max())


def test_step_longer_than_a_tooth_period_is_refused():
    with pytest.raises(InputError, match="step"):
        mill_cut(STIFF, Cutter(4, 12e-3), conditions(20000.0), ALUMINIUM, 1e-3, 10)


SHAPED = {
    "bull nose": (Cutter(4, 12e-3, np.radians(30.0), profile=Profile.bull_nose(12e-3, 0.5e-3)), DOWN),
    "bull nose in a block": (Cutter(4, 16e-3, np.radians(35.0), profile=Profile.bull_nose(16e-3, 3e-3)), Block(-8e-3, 2e-3)),
    "ball": (Cutter(2, 12e-3, np.radians(30.0), profile=Profile.ball(12e-3)), Engagement(0.0, np.pi)),
    "ball of constant angle": (Cutter(2, 12e-3, np.radians(30.0), profile=Profile.ball(12e-3), helix_kind="angle"), Stepover(2e-3, "up")),
    "face mill": (Cutter(5, 63e-3, profile=Profile.face(63e-3, np.radians(45.0), 6e-3)), Stepover(30e-3, "down")),
    "unlike helix": (Cutter(4, 16e-3, np.radians([38.0, 41.0, 38.0, 41.0]), np.radians([84.0, 96.0, 84.0, 96.0])), DOWN),
    "waves": (Cutter(3, 16e-3, np.radians(30.0), serration=Serration(0.25e-3, 1.5e-3)), DOWN),
    "teeth at other heights": (
        Cutter(3, 32e-3, profile=Profile.face(32e-3, np.radians(30.0), 6e-3), axial_runout=[0.0, 2e-5, -1e-5]),
        Engagement(0.3, 2.5),
    ),
    "tilted": (Cutter(2, 12e-3, np.radians(30.0), tilt=2e-3), DOWN),
}


@pytest.mark.parametrize("name", list(SHAPED))
def test_levels_of_a_shape_push_as_sums_over_rows_do(name):
    """Two ways that share no code: levels, arcs and chips here, rows and integrals there."""
    cutter, engagement = SHAPED[name]
    depth = 1.2e-3 if name == "face mill" else 2e-3
    cut = CuttingConditions(2.0 * np.pi * 150.0, depth, 1e-4, engagement, 0.4)
    whole = CuttingCoefficients(800e6, 0.3, 0.2, 8e3, 6e3, 2e3)
    found = rigid_force_lines(cutter, cut, whole, slices=300)[:25]
    values = np.array([800e6, 240e6, 8e3, 6e3, 160e6, 2e3])
    exact = unit_lines(cutter, cut, np.arange(25), runout=True, axial=True) @ values
    # rows take 24 nodes of a wave
    allowed = 6e-3 if name == "waves" else 1.5e-3
    assert np.abs(found - exact).max() < allowed * np.abs(exact).max()


def test_a_shaped_cut_tells_its_force_along_the_axis():
    cutter, _ = SHAPED["ball"]
    cut = conditions(9000.0, depth=1e-3, engagement=Engagement(0.0, np.pi))
    history = mill_cut(STIFF, cutter, cut, EDGES, STEP, 6000, slices=60)
    mean = unit_lines(cutter, cut, np.array([0]), axial=True)[0].real @ np.array([800e6, 240e6, 8e3, 6e3, 0.0, 0.0])
    turn = round(60.0 / 9000.0 / STEP)
    assert history.axial[-turn:].mean() == pytest.approx(mean[2], rel=5e-3)
    assert mean[2] > 10.0


def test_a_table_of_arcs_is_refused():
    table = EngagementMap(np.array([0.0, 2e-3]), np.zeros(2), np.full(2, 1.0))
    with pytest.raises(InputError, match="no table"):
        mill_cut(STIFF, Cutter(2, 12e-3), conditions(9000.0, engagement=table), ALUMINIUM, STEP, 10)
