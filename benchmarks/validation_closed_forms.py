"""Closed forms of cutting forces, lobes, walls, observers, signals and removal of material."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from typing import Any

import numpy as np
import scipy.linalg

from benchmarks.forces import closed_lines, cylinder_lines
from benchmarks.removal import FLAT, beside, cuts, leaning_turns
from benchmarks.validation_case import Case, Measure
from rcsa_ident.base.units import to_hz
from rcsa_ident.cutting.calibration import mean_force_matrix
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.directional import mean_directional_matrix
from rcsa_ident.cutting.force import force_history, force_lines
from rcsa_ident.cutting.power import spindle_load
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.dynamics.state_space import StateSpace
from rcsa_ident.observer.force_model import RandomWalk
from rcsa_ident.observer.kalman import kalman_filter, riccati
from rcsa_ident.observer.margins import loop_margins
from rcsa_ident.signals.sound.ring_down import ring_down
from rcsa_ident.signals.tap import tap
from rcsa_ident.stability.lobes import stability_lobes, uncoupled_planes
from rcsa_ident.stability.surface_error import surface_location_error
from rcsa_ident.toolpath.march import Carrier, Cut, march, start_of
from rcsa_ident.toolpath.walls import NOTHING, Walls
from tests.cutting import test_force
from tests.observer import test_kalman
from tests.oracles import literature, naive
from tests.signals import test_tap
from tests.signals.sound import test_ring_down
from tests.stability import test_surface_error as walls
from tests.stability import test_zero_order
from tests.toolpath import test_march

SLOT = Engagement(0.0, np.pi)
RPM = np.pi / 30.0
#: K_tc, K_rc, K_te, K_re, K_ac, K_ae of the textbook's slot.
COEFFICIENTS = np.array([800e6, 240e6, 12e3, 9e3, 100e6, 2e3])


def slot_means(ours: bool) -> np.ndarray:
    """Mean forces of a slot [N]."""
    c, n, a = 1e-4, 4, 1e-3
    if ours:
        return mean_force_matrix(Cutter(n, 0.012, np.radians(30.0)), CuttingConditions(600.0, a, c, SLOT)) @ COEFFICIENTS
    tc, rc, te, re, ac, ae = COEFFICIENTS
    return np.array([-n * a * (rc * c / 4 + re / np.pi), n * a * (tc * c / 4 + te / np.pi), n * a * (ac * c / np.pi + ae / 2)])


def lines(ours: bool) -> np.ndarray:
    """Force lines of a cutter with helix and unequal pitch in half immersion [N]."""
    cutter, cut = test_force.CUTTERS["pitch"], test_force.HALF
    if ours:
        return force_lines(cutter, cut, test_force.COEFFICIENTS, test_force.ORDERS)
    return np.asarray(test_force.sampled_lines(cutter, cut, test_force.COEFFICIENTS, test_force.ORDERS))


def directional(ours: bool) -> np.ndarray:
    """Mean directional matrix of three teeth in a turned feed."""
    if ours:
        return mean_directional_matrix(3, Engagement(0.4, 2.1), CuttingCoefficients(1e9, 0.3), 0.7)
    return naive.mean_directional_matrix(3, 0.4, 2.1, 0.3, 0.7)


def one_direction(ours: bool) -> float:
    """Absolute limit of a slot with one flexible direction [m]: 2 k zeta (1 + zeta) / (K_tc N k_r / 4)."""
    case = literature.INSPERGER_STEPAN
    zeta, omega, mass = case["damping_ratio"], 2.0 * np.pi * case["natural_frequency_hz"], case["modal_mass"]
    if not ours:
        return float(2.0 * mass * omega**2 * zeta * (1.0 + zeta) / (6e8 * 2 * (1.0 / 3.0) / 4.0))
    band = 2.0 * np.pi * np.arange(900.0, 960.0, 0.05)
    values = test_zero_order.resonance(band, case["natural_frequency_hz"], zeta, mass)[:, None, None]
    x = Receptance(band, values, test_zero_order.TIP[:1], test_zero_order.TIP[:1])
    process = MillingProcess(Cutter(2, 0.012), CuttingCoefficients(6e8, 1.0 / 3.0), SLOT)
    found = stability_lobes(uncoupled_planes(x, None), process, np.array([900.0]), 1.0).absolute_limit
    assert found is not None
    return found


def static_wall(ours: bool) -> np.ndarray:
    """Error of a wall far below resonance over its largest: compliance times the force of the moment."""
    cutter = Cutter(4, 12e-3, np.radians(30.0))
    cut = walls.process(walls.UP, cutter, walls.EDGES)
    found = surface_location_error(walls.tip(), cut, np.array([6.0]), 4e-3, heights=9)
    angle = 2.0 * found.height * np.tan(cutter.helix) / cutter.diameter
    conditions = cut.conditions(6.0, 4e-3)
    around = [force_history(cutter, conditions, walls.EDGES, angle + d, slices=4000)[:, 1] for d in (-1e-3, 1e-3)]
    static = -0.5 * (around[0] + around[1]) / 6e6
    return (found.error[0] if ours else static)[1:-1] / np.max(np.abs(static))


def resonant_wall(ours: bool) -> float:
    """Wall of a lightly damped mode at the tooth-passing frequency [m]: one harmonic, -i Q F / k."""
    lone, cutter, speed = ((1, 700.0, 1e-3, 5e6),), Cutter(2, 12e-3), 2.0 * np.pi * 700.0 / 2
    cut = walls.process(cutter=cutter)
    if ours:
        return float(surface_location_error(walls.tip(lone), cut, [speed], 1e-3, heights=1).error[0, 0])
    angle = np.linspace(0.0, 2.0 * np.pi, 40000, endpoint=False)
    force = force_history(cutter, cut.conditions(speed, 1e-3), walls.ALUMINIUM, angle, slices=1)[:, 1]
    return float((2.0 * np.mean(force * np.exp(-2j * angle)) * (-0.5j / 1e-3) / 5e6).real)


def crossing() -> np.ndarray:
    """Speeds at which the error of a wall that a short blow leaves changes its sign [rev/min]."""
    lone, cut = ((1, 700.0, 0.01, 5e6),), walls.process(Engagement.from_immersion(0.01, "down"), Cutter(2, 12e-3))
    found = []
    for k in (1, 2, 3):
        speeds = 2.0 * np.pi * 700.0 / (k * 2) * np.linspace(0.97, 1.03, 121)
        mean = surface_location_error(walls.tip(lone), cut, speeds, 1e-3).mean
        at = int(np.flatnonzero(np.diff(np.sign(mean)))[0])
        found.append(speeds[at] + (speeds[at + 1] - speeds[at]) * mean[at] / (mean[at] - mean[at + 1]))
    return np.array(found) / RPM


@cache
def conditional(ours: bool) -> np.ndarray:
    """Causal force estimates of 25 samples [N]: by the filter, and by conditioning one joint Gaussian, no recursion."""
    kalman = kalman_filter(test_kalman.model(), longest_settling=40)
    t = np.arange(10, 35) * test_kalman.STEP
    force = 60.0 * (np.sin(200.0 * t) > 0.3) + 10.0 * np.sin(333.0 * t)
    measured = test_kalman.PLANT.run(test_kalman.PLANT.init(), force)[1]
    if ours:
        return test_kalman.run(kalman, measured)[1][:, 0]
    _, both, seen = test_kalman.joint_gaussian(kalman, 25)
    z = measured / kalman.model.noise[0]
    return np.array([np.linalg.solve(seen[:k, :k], both[k - 1, :k]) @ z[:k] for k in range(1, 26)])


def scalar_riccati(ours: bool) -> np.ndarray:
    """Predicted variance of a random walk seen in noise of variance 1: (q + sqrt(q^2 + 4 q)) / 2."""
    intensity = np.array([1e-4, 1e-2, 1.0, 30.0])
    if not ours:
        return 0.5 * (intensity + np.sqrt(intensity**2 + 4.0 * intensity))
    return np.array([riccati(np.eye(1), np.ones((1, 1)), np.array([[q]]))[0, 0] for q in intensity])


def observer_riccati(ours: bool) -> np.ndarray:
    """Predicted covariance of a whole observer over its largest entry."""
    a, seen, _, q = test_kalman.dense(test_kalman.model())
    other = scipy.linalg.solve_discrete_are(a.T, seen[:, None], q, np.eye(1))
    return (riccati(a, seen[None], q) if ours else other) / np.max(np.abs(other))


def filtered(ours: bool) -> np.ndarray:
    """Forces of 500 samples, through the settling phase, over the largest."""
    kalman = kalman_filter(test_kalman.model(RandomWalk(40.0, 30.0)), longest_settling=1000)
    measured = 1e-6 * np.random.default_rng(3).normal(size=500)
    own = test_kalman.run(kalman, measured)[1][:, 0]
    _, force, means, _ = test_kalman.plain_filter(kalman, measured)
    return (own if ours else means[:, :, 0] @ force) / np.max(np.abs(own))


def margins(ours: bool) -> np.ndarray:
    """Gain margin, peak of the sensitivity, disk margin of b / (z - a)."""
    a, b = 0.9, 0.6
    if not ours:
        return np.array([(1.0 + a) / b, (1.0 + a) / (1.0 + a - b), 2.0 * (1.0 + a - b) / (1.0 + a + b)])
    found = loop_margins(StateSpace([[a]], [[b]], [[1.0]], [[0.0]], 1e-3))
    return np.array([found.gain_increase, found.sensitivity_peak, found.disk])


def tapped(ours: bool) -> np.ndarray:
    """Receptance of two modes from one hit over the norm of all lines from 300 to 3000 Hz; squared errors add up."""
    found = tap(test_tap.RATE, [test_tap.hits(derivative=2)], 2)
    inside = (found.omega > 2.0 * np.pi * 300.0) & (found.omega < 2.0 * np.pi * 3000.0)
    true = test_tap.receptance(found.omega[inside])
    return np.array([np.linalg.norm(found.receptance[inside] - true) / np.linalg.norm(true) if ours else 0.0])


def rung() -> np.ndarray:
    """Natural frequencies of two modes of a ring [Hz]."""
    found = ring_down([(test_ring_down.RATE, test_ring_down.hits(_RING))])
    return np.sort([to_hz(mode.omega) for mode in found.modes])


_RING = [(2589.0, 0.0141, 1.0), (7887.0, 0.0049, 0.4)]


@cache
def lays(name: str) -> np.ndarray:
    """Exact volume and what the lines say, lay by lay [m^3]."""
    return np.array(cuts()[name].lays())


def volumes(name: str, ours: bool) -> np.ndarray:
    """One column of them."""
    return lays(name)[:, int(ours)]


def arcs(upright: bool) -> float:
    """Largest error of entry and exit beside a wall [deg]."""
    lays = [None] * 100 if upright else leaning_turns()
    return float(np.max(np.concatenate([beside(FLAT, seed, turn) for seed, turn in enumerate(lays)])))


def play() -> float:
    """Where a freedom with play of 20 um and a spring of 1 N/um rests under 30 N [m]."""
    carrier = Carrier(
        np.array([[5.0]]), np.array([[2e3]]), np.array([1e6]), np.array([[0.0], [1.0], [0.0]]), play=np.array([2e-5]), load=np.array([30.0])
    )
    cut = Cut(Cutter(2, 0.01), CuttingCoefficients(6e8, 1.0 / 3.0), 1e-3, 5000.0 * RPM, slices=1)
    empty = Walls(-0.01, 1e-3, *np.full((2, 2, 1, 20), NOTHING))
    return float(march(start_of(carrier, cut, 1e-5), carrier, cut, empty, np.zeros((2000, 2))).tip[-1, 1])


def stands_off(ours: bool) -> np.ndarray:
    """Where a soft tool stands beside its path [m]: compliance times mean force."""
    carrier = Carrier(np.diag([5.0, 5.0]), np.diag([3e3, 3e3]), np.full(2, 2e6), np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]]))
    cut = Cut(Cutter(2, 0.01, np.radians(30.0)), CuttingCoefficients(7e8, 0.35), 0.0016, 5000.0 * RPM)
    found = test_march.steady(cut, carrier, (-np.inf, -0.001), 5e-5, 720, 100)
    return (found.tip if ours else found.force / 2e6)[-7200:, :2].mean(axis=0)


def rigid_forces(ours: bool) -> np.ndarray:
    """Mean and rms forces of a rigid tool of unequal pitch and run-out that marches through a block [N]."""
    coefficients, turn = CuttingCoefficients(7e8, 0.35, tangential_edge=12e3, radial_edge=9e3, axial_ratio=0.1), 720
    cut = Cut(test_march.UNEVEN, coefficients, 0.0016, test_march.SPEED, slices=8)
    if ours:
        force = test_march.steady(cut, Carrier(), (-np.inf, -0.001), 2e-5, turn, 140).force[-turn:]
    else:
        angle = 2.0 * np.pi * np.arange(turn) / turn
        conditions = CuttingConditions(test_march.SPEED, 0.0016, 2e-5, Engagement.from_immersion(0.4, "down"))
        force = force_history(test_march.UNEVEN, conditions, coefficients, angle, slices=8) * [1.0, 1.0, -1.0]
    return np.concatenate([force.mean(axis=0), np.sqrt(np.mean(force**2, axis=0))])


def pair(call: Callable[[bool], Any]) -> tuple[Callable[[], Any], Callable[[], Any]]:
    """The closed form and the package's answer of one function."""
    return partial(call, False), partial(call, True)


_VOLUMES = {"slot": 6e-4, "shoulder": 6e-4, "plunge": 6e-4, "ball's groove": 1e-3, "circular pocket": 6e-4}
_KALMAN, _WALL, _MARCH = "tests/observer/test_kalman.py", "tests/stability/test_surface_error.py", "tests/toolpath/test_march.py"
CASES = (
    Case(
        "mean forces of a slot, three directions",
        "[altintas2012], N a (K c/4 + K_e/π) and so on",
        *pair(slot_means),
        "N",
        1e-12,
        "tests/cutting/test_calibration.py::test_slot_by_the_textbook",
    ),
    Case(
        "force lines of a cylinder, 8 orders, per coefficient",
        "closed forms along the helix (tests/oracles/cylinder_forces.py)",
        partial(closed_lines, False),
        partial(cylinder_lines, False),
        "of the largest",
        1e-10,
        "tests/cutting/test_shaped_forces.py",
        Measure.LARGEST,
    ),
    Case(
        "the same with run-out",
        "closed forms along the helix (tests/oracles/cylinder_forces.py)",
        partial(closed_lines, True),
        partial(cylinder_lines, True),
        "of the largest",
        1e-10,
        "tests/cutting/test_shaped_forces.py",
        Measure.LARGEST,
    ),
    Case(
        "force lines of four unequal teeth with a helix, 25 orders",
        "sums over 20 000 angles and 40 slices",
        *pair(lines),
        "N",
        1e-3,
        "tests/cutting/test_force.py::test_lines_of_a_sampled_revolution",
        Measure.LARGEST,
        slow=True,
    ),
    Case(
        "mean directional matrix, three teeth, turned feed",
        "[inprocess], eq. 3, mean over 20 000 angles",
        *pair(directional),
        "",
        1e-6,
        "tests/cutting/test_directional.py::test_mean_over_a_revolution",
        Measure.LARGEST,
    ),
    Case(
        "slot of 12 mm in aluminium: removal rate, power, torque",
        "144 cm³/min at 900 MPa: 2160 W, 2.0626 N m",
        [144.0, 2160.0, 2.0626],
        lambda: [
            (
                load := spindle_load(Cutter(4, 12e-3), CuttingConditions(1e4 * RPM, 3e-3, 1e-4, SLOT), CuttingCoefficients(900e6, 0.3))
            ).removal_rate
            * 60e6,
            load.power,
            load.torque,
        ],
        "cm³/min, W, N m",
        1e-4,
        "tests/cutting/test_power.py::test_a_slot_in_aluminium_by_hand",
    ),
    Case(
        "absolute limit of a slot with one flexible direction, zero order",
        "[altintas1995], 2 k ζ(1 + ζ) / (K_tc N k_r/4)",
        *pair(one_direction),
        "m",
        1e-4,
        "tests/stability/test_zero_order.py::test_one_flexible_direction",
    ),
    Case(
        "wall of a slow cut, seven heights",
        "compliance times the force of the moment",
        *pair(static_wall),
        "of the largest",
        1.2e-2,
        f"{_WALL}::test_a_slow_cut_bends_the_tool_as_its_force_of_the_moment_does",
        Measure.ABSOLUTE,
        slow=True,
    ),
    Case(
        "wall of a mode at the tooth-passing frequency",
        "[schmitz1999], one harmonic alone: Re(−i Q F/k)",
        *pair(resonant_wall),
        "m",
        2e-2,
        f"{_WALL}::test_one_harmonic_alone_is_a_closed_form",
    ),
    Case(
        "speeds at which the wall's error changes its sign",
        "[schmitz1999], [mann2005]: natural frequency over whole multiples of the teeth",
        700.0 * 60.0 / 2.0 / np.array([1.0, 2.0, 3.0]),
        crossing,
        "rev/min",
        3e-2,
        f"{_WALL}::test_sign_changes_where_a_harmonic_of_the_teeth_meets_the_mode",
    ),
    Case(
        "force observer, causal estimates of 25 samples",
        "[kalman1960]: one joint Gaussian conditioned, no recursion",
        *pair(conditional),
        "N",
        1e-7,
        f"{_KALMAN}::test_filter_lag_and_smoother_are_conditional_means",
        Measure.LARGEST,
    ),
    Case(
        "steady variance of a random walk, four intensities",
        "(q + √(q² + 4q))/2",
        *pair(scalar_riccati),
        "",
        1e-6,
        f"{_KALMAN}::test_the_errors_dynamics_are_stable_and_the_riccati_equation_holds",
    ),
    Case(
        "steady covariance of a whole observer",
        "SciPy, discrete algebraic Riccati equation",
        *pair(observer_riccati),
        "of the largest",
        1e-5,
        f"{_KALMAN}::test_riccati_agrees_with_scipy",
        Measure.ABSOLUTE,
    ),
    Case(
        "filtered forces of 500 samples from the start",
        "filterpy, plain filter with the same matrices",
        *pair(filtered),
        "of the largest",
        2e-6,
        f"{_KALMAN}::test_agrees_with_filterpy",
        Measure.ABSOLUTE,
    ),
    Case(
        "loop b/(z − a): gain margin, peak of the sensitivity, disk margin",
        "(1 + a)/b, (1 + a)/(1 + a − b), 2(1 + a − b)/(1 + a + b)",
        *pair(margins),
        "",
        1e-9,
        "tests/observer/test_margins.py::test_one_pole",
    ),
    Case(
        "receptance of two modes from one hit of a hammer, norm of the error",
        "closed form of both modes",
        *pair(tapped),
        "of the receptance",
        2e-3,
        "tests/signals/test_tap.py::test_one_hit_gives_the_receptance",
        Measure.ABSOLUTE,
    ),
    Case(
        "two natural frequencies from a ring's sound",
        "exponentials with noise, as written",
        [each[0] for each in _RING],
        rung,
        "Hz",
        5e-4,
        "tests/signals/sound/test_ring_down.py::test_frequencies_and_damping_are_those_that_were_written",
    ),
    *(
        Case(
            f"volume that a tool of 10 mm takes out: {name}, nine lays of the lattice",
            "closed form" if name != "ball's groove" else "closed form; where the lattice is shifted manifold3d, exact booleans",
            partial(volumes, name, False),
            partial(volumes, name, True),
            "m³",
            tolerance,
            "tests/toolpath/test_dexel.py::test_volumes_of_closed_forms",
            slow=True,
        )
        for name, tolerance in _VOLUMES.items()
    ),
    Case(
        "arcs of an upright flat tool beside a wall, 100 cuts anywhere on the lattice",
        "arccos(1 − a_e/R): error of entry and exit",
        0.0,
        partial(arcs, True),
        "deg",
        1e-6,
        "tests/toolpath/test_engagement.py::test_arcs_beside_a_straight_wall_are_exact",
        Measure.ABSOLUTE,
        slow=True,
    ),
    Case(
        "arcs of a leaning flat tool beside a wall, eight cuts turned in space",
        "arccos(1 − a_e/R): error of entry and exit",
        0.0,
        partial(arcs, False),
        "deg",
        2.0,
        "tests/toolpath/test_engagement.py::test_leaning_tools_see_what_upright_ones_see",
        Measure.ABSOLUTE,
        slow=True,
    ),
    Case(
        "forces of a rigid tool that marches through a block: means, rms",
        "chips f sin φ of unequal teeth with run-out, over a turn",
        *pair(rigid_forces),
        "N",
        1.2e-2,
        f"{_MARCH}::test_a_rigid_tool_feels_the_force_of_the_closed_chips",
        Measure.LARGEST,
        slow=True,
    ),
    Case(
        "soft tool in a march, where it stands beside its path",
        "compliance times mean force",
        *pair(stands_off),
        "m",
        2e-2,
        f"{_MARCH}::test_a_soft_tool_stands_off_its_wall_by_compliance_times_mean_force",
        slow=True,
    ),
    Case(
        "spring with play under a constant load",
        "load over stiffness plus the play",
        5e-5,
        play,
        "m",
        1e-9,
        f"{_MARCH}::test_a_spring_with_play_lets_go_within_and_holds_beyond",
    ),
)
