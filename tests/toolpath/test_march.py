"""Milling in time: the force of a rigid tool, Newmark's steps, regeneration against known multipliers, play, and walls that are left."""

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import AnyEngagement, Block, CuttingConditions, Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import force_history
from rcsa_ident.cutting.profile import Profile
from rcsa_ident.dynamics.poles import PoleResidue
from rcsa_ident.toolpath.march import Carrier, Cut, March, march, start_of
from rcsa_ident.toolpath.walls import NOTHING, Walls

SPEED = 5000.0 * 2.0 * np.pi / 60.0
BALL = Cutter(2, 0.01, np.radians(30.0), profile=Profile.ball(0.01))
UNEVEN = Cutter(3, 0.01, np.radians(30.0), pitch=np.radians([110.0, 120.0, 130.0]), runout=np.array([0.0, 4e-6, -3e-6]))


def steady(cut: Cut, carrier: Carrier, sides: tuple[float, float], feed: float, turn: int, turns: int, spacing: float = 4e-6) -> March:
    """March into a block at a feed per tooth [m]."""
    step = 2.0 * np.pi / cut.spindle_speed / turn
    rate = feed * cut.cutter.teeth * cut.spindle_speed / (2.0 * np.pi)
    walls = Walls.block(0.02, *sides, cut.parts.radius.size, 0.006, spacing)
    x = -0.0051 + rate * step * np.arange(turn * turns)
    # the way to the material in one jump: the tool touches nothing there
    return march(start_of(carrier, cut, step), carrier, cut, walls, np.column_stack([x, np.zeros_like(x)]))


@pytest.mark.parametrize(
    ("cutter", "sides", "engagement"),
    [
        (UNEVEN, (-np.inf, -0.001), Engagement.from_immersion(0.4, "down")),
        (UNEVEN, (0.001, np.inf), Engagement.from_immersion(0.4, "up")),
        (UNEVEN, (-np.inf, np.inf), Engagement.from_immersion(1.0, "up")),
        (UNEVEN, (-0.002, 0.003), Block(-0.002, 0.003)),
        (BALL, (-0.0015, 0.002), Block(-0.0015, 0.002)),
    ],
)
def test_a_rigid_tool_feels_the_force_of_the_closed_chips(cutter: Cutter, sides: tuple[float, float], engagement: AnyEngagement) -> None:
    """The chips of circles that move on are those of sin(phi) to a part in feed over radius."""
    coefficients, depth, feed, turn = (
        CuttingCoefficients(7e8, 0.35, tangential_edge=12e3, radial_edge=9e3, axial_ratio=0.1),
        0.0016,
        2e-5,
        720,
    )
    cut = Cut(cutter, coefficients, depth, SPEED, slices=8)
    found = steady(cut, Carrier(), sides, feed, turn, 140)
    angle = SPEED * found.step * np.arange(turn * 139, turn * 140)
    conditions = CuttingConditions(SPEED, depth, feed, engagement)
    wanted = force_history(cutter, conditions, coefficients, angle, slices=8) * [1.0, 1.0, -1.0]
    last = found.force[-turn:]
    size = np.sqrt(np.mean(np.sum(wanted**2, axis=1)))
    assert size > 10.0
    assert last.mean(axis=0) == pytest.approx(wanted.mean(axis=0), abs=0.012 * size)
    assert np.sqrt(np.mean(last**2, axis=0)) == pytest.approx(np.sqrt(np.mean(wanted**2, axis=0)), abs=0.012 * size)
    assert found.unsettled == 0


def one_mode(direction: int) -> Carrier:
    """The benchmark of [ding2010]: 922 Hz, 1.1 %, 0.03993 kg."""
    mass, omega, ratio = 0.03993, 2.0 * np.pi * 922.0, 0.011
    motion = np.zeros((3, 1))
    motion[direction] = 1.0
    return Carrier(np.array([[mass]]), np.array([[2.0 * ratio * omega * mass]]), np.array([mass * omega**2]), motion)


@pytest.mark.parametrize(
    ("sides", "depth", "multiplier"),
    [
        # of full immersion as published, and those of our own monodromy operators on the others (see tests/stability)
        ((-np.inf, np.inf), 0.2e-3, 0.8193),
        ((0.0, np.inf), 0.2e-3, 0.9157),
        ((-np.inf, 0.0), 0.3e-3, 0.7238),
    ],
)
def test_small_vibrations_die_out_as_fast_as_the_multiplier_says(sides: tuple[float, float], depth: float, multiplier: float) -> None:
    """Two marches that differ by a nanometre; that what a tooth meets moves on with the feed costs half a percent at this one."""
    cut, carrier, turn, feed = Cut(Cutter(2, 0.01), CuttingCoefficients(6e8, 1.0 / 3.0), depth, SPEED, slices=1), one_mode(0), 1440, 2e-5
    step = 2.0 * np.pi / SPEED / turn
    walls = Walls.block(0.03, *sides, 1, 0.006, 1e-6)

    def way(start: float, rate: float, turns: int) -> np.ndarray:
        x = start + rate * step * np.arange(turns * turn)
        return np.column_stack([x, np.zeros_like(x)])

    rate = feed * 2.0 * SPEED / (2.0 * np.pi)
    inside = march(start_of(Carrier(), cut, step), Carrier(), cut, walls, way(-0.006, 0.018 / (4.0 * turn * step), 4))
    settled = march(replace(inside, state=np.zeros((3, 1))), carrier, cut, walls, way(0.012, rate, 6))
    pushed = settled.state + np.array([[1e-9], [0.0], [0.0]])
    one, two = (
        march(replace(settled, state=state), carrier, cut, walls.copy(), way(0.012 + 6 * turn * step * rate, rate, 12))
        for state in (settled.state, pushed)
    )
    periods = (two.tip - one.tip)[:, 0].reshape(-1, turn // 2)[6:] / 1e-9
    # a pair of multipliers: d[k+2] = 2 Re(mu) d[k+1] - |mu|^2 d[k] at every phase of the period
    known = np.stack([periods[1:-1].ravel(), -periods[:-2].ravel()], axis=1)
    _, square = np.linalg.lstsq(known, periods[2:].ravel(), rcond=None)[0]
    assert np.sqrt(square) == pytest.approx(multiplier, rel=0.015)


def test_beyond_the_limit_chatter_grows_until_teeth_leave_the_material() -> None:
    cut = Cut(Cutter(2, 0.01), CuttingCoefficients(6e8, 1.0 / 3.0), 0.7e-3, SPEED, slices=1)
    found = steady(cut, one_mode(0), (-np.inf, np.inf), 5e-5, 720, 120)
    force = found.force.reshape(120, 720, 3)
    assert np.mean(np.all(force[80:] == 0.0, axis=2)) > 0.1
    swing = np.std(found.tip.reshape(120, 720, 3)[80:, 0, 0])
    assert 1e-5 < swing < 1e-3


def test_free_vibration_has_the_frequency_and_the_decay_of_its_mode() -> None:
    carrier, turn = one_mode(1), 1440
    cut = Cut(Cutter(2, 0.01), CuttingCoefficients(6e8, 1.0 / 3.0), 1e-3, SPEED, slices=1)
    walls = Walls(-0.01, 1e-3, *np.full((2, 2, 1, 20), NOTHING))
    before = start_of(carrier, cut, 2.0 * np.pi / SPEED / turn)
    found = march(
        replace(before, state=np.array([[1e-5], [0.0], [-carrier.stiffness[0] / 0.03993 * 1e-5]])), carrier, cut, walls, np.zeros((4000, 2))
    )
    omega, ratio = 2.0 * np.pi * 922.0, 0.011
    damped = omega * np.sqrt(1.0 - ratio**2)
    wanted = (
        1e-5
        * np.exp(-ratio * omega * found.time)
        * (np.cos(damped * found.time) + ratio / np.sqrt(1.0 - ratio**2) * np.sin(damped * found.time))
    )
    # Newmark's period is longer by (omega h)^2 / 12
    assert found.tip[:, 1] == pytest.approx(wanted, abs=1e-5 * damped * found.time[-1] * (omega * found.step) ** 2 / 10.0)


def test_modes_and_freedoms_with_the_same_dynamics_make_the_same_cut() -> None:
    """A pole with its residue is marched exactly, a mass on its spring by Newmark: the same single mode twice, and half and half."""
    whole = one_mode(1)
    omega, ratio = 2.0 * np.pi * 922.0, 0.011
    damped = omega * np.sqrt(1.0 - ratio**2)
    outputs, inputs = np.zeros((3, 1), dtype=complex), np.zeros((1, 3))
    outputs[1], inputs[0, 1] = 1.0 / (2j * damped * 0.03993), 1.0
    modes = PoleResidue(np.array([-ratio * omega + 1j * damped]), outputs, inputs, np.zeros((3, 3)))
    cut = Cut(UNEVEN, CuttingCoefficients(7e8, 0.35), 0.3e-3, SPEED, slices=2)
    one, two = (steady(cut, carrier, (-np.inf, -0.002), 5e-5, 1440, 40) for carrier in (whole, Carrier(modes=modes)))
    size = np.abs(one.tip).max()
    assert size > 2e-6
    assert two.tip == pytest.approx(one.tip, abs=0.02 * size)
    half = PoleResidue(modes.pole, 0.5 * modes.outputs, modes.inputs, modes.constant)
    both = steady(cut, replace(whole, motion=np.sqrt(0.5) * whole.motion, modes=half), (-np.inf, -0.002), 5e-5, 1440, 40)
    assert both.tip == pytest.approx(one.tip, abs=0.02 * size)


def test_a_soft_tool_stands_off_its_wall_by_compliance_times_mean_force() -> None:
    stiff = 2e6
    carrier = Carrier(np.diag([5.0, 5.0]), np.diag([3e3, 3e3]), np.full(2, stiff), np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]]))
    cut = Cut(Cutter(2, 0.01, np.radians(30.0)), CuttingCoefficients(7e8, 0.35), 0.0016, SPEED)
    found = steady(cut, carrier, (-np.inf, -0.001), 5e-5, 720, 100)
    last = slice(-7200, None)
    assert found.tip[last].mean(axis=0)[:2] == pytest.approx(found.force[last].mean(axis=0)[:2] / stiff, rel=0.02)


def test_a_spring_with_play_lets_go_within_and_holds_beyond() -> None:
    """A constant load: the freedom rests where load over stiffness plus the play is, and stays there."""
    carrier = Carrier(
        np.array([[5.0]]), np.array([[2e3]]), np.array([1e6]), np.array([[0.0], [1.0], [0.0]]), play=np.array([2e-5]), load=np.array([30.0])
    )
    cut = Cut(Cutter(2, 0.01), CuttingCoefficients(6e8, 1.0 / 3.0), 1e-3, SPEED, slices=1)
    walls = Walls(-0.01, 1e-3, *np.full((2, 2, 1, 20), NOTHING))
    assert carrier.rest == pytest.approx([5e-5])
    start = start_of(carrier, cut, 1e-5)
    resting = march(start, carrier, cut, walls, np.zeros((2000, 2)))
    assert resting.tip[:, 1] == pytest.approx(5e-5, rel=1e-9)
    # let go in the middle of the play, it comes to the same place
    loose = march(replace(start, state=np.array([[0.0], [0.0], [6.0]])), carrier, cut, walls, np.zeros((60000, 2)))
    assert loose.tip[-1, 1] == pytest.approx(5e-5, rel=1e-6)
    # within the play nothing but load, mass and damper
    within = loose.tip[:, 1] < 2e-5
    time = loose.time[within][:100]
    wanted = 30.0 / 2e3 * (time - 5.0 / 2e3 * (1.0 - np.exp(-2e3 / 5.0 * time)))
    assert loose.tip[: time.size, 1] == pytest.approx(wanted, rel=1e-3)


def test_a_march_in_two_parts_is_the_same_march() -> None:
    cut, carrier = Cut(UNEVEN, CuttingCoefficients(7e8, 0.35), 0.001, SPEED, slices=3), one_mode(1)
    step = 2.0 * np.pi / SPEED / 360
    places = np.column_stack([-0.005 + 0.02 * step * np.arange(8000), np.zeros(8000)])
    walls = [Walls.block(0.02, -np.inf, 0.002, 3, 0.006) for _ in range(2)]
    whole = march(start_of(carrier, cut, step), carrier, cut, walls[0], places)
    part = march(start_of(carrier, cut, step), carrier, cut, walls[1], places[:3333])
    rest = march(part, carrier, cut, walls[1], places[3333:])
    assert np.concatenate([part.force, rest.force]) == pytest.approx(whole.force, abs=1e-4)
    assert rest.time[-1] == pytest.approx(whole.time[-1], rel=1e-12)
    assert walls[0].tops == pytest.approx(walls[1].tops, abs=1e-10)


def test_what_does_not_fit_is_refused() -> None:
    cut = Cut(UNEVEN, CuttingCoefficients(7e8, 0.35), 0.001, SPEED, slices=3)
    with pytest.raises(InputError, match="slices"):
        march(start_of(Carrier(), cut, 1e-5), Carrier(), cut, Walls.block(0.01, -np.inf, 0.0, 2, 0.006), np.zeros((3, 2)))
    with pytest.raises(InputError, match="motion"):
        replace(Carrier(), motion=np.zeros((2, 1)))
    with pytest.raises(InputError, match="modes"):
        Carrier(modes=PoleResidue(np.array([-1.0 + 2j]), np.ones((2, 1)), np.ones((1, 2)), np.zeros((2, 2))))
    with pytest.raises(InputError, match="spacing"):
        Walls.block(10.0, -np.inf, 0.0, 10, 0.01, 1e-8)
