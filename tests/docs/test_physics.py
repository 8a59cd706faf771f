"""Equations of docs/physics as they stand there, computed the plain way, beside what the code computes."""

from __future__ import annotations

import re

import numpy as np
import pytest
import scipy.linalg
from scipy.stats import norm

import rcsa_ident as ri
from rcsa_ident.coupling.decoupling import decouple
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.cutter import Cutter, HelixKind
from rcsa_ident.cutting.directional import mean_directional_matrix
from rcsa_ident.cutting.force import force_lines
from rcsa_ident.cutting.power import spindle_load
from rcsa_ident.cutting.process import MillingProcess, ProcessDamping
from rcsa_ident.cutting.profile import Profile
from rcsa_ident.cutting.teeth import lags
from rcsa_ident.dynamics.coordinates import Coordinate, Dof, plane
from rcsa_ident.dynamics.modal import damped_modes, normal_modes
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.dynamics.turning_modes import TurningModes
from rcsa_ident.identification.data import AxisData
from rcsa_ident.identification.misfit import _weight
from rcsa_ident.machine.robot.compliance import static_compliance
from rcsa_ident.machine.robot.kinematics import posed
from rcsa_ident.machine.workpiece_side import gives_way
from rcsa_ident.observer.force_model import RandomWalk, TeethResonators
from rcsa_ident.observer.transfer_function import SampledModes
from rcsa_ident.signals.recording import Quantity, Sensor
from rcsa_ident.stability.labels.averaging import trust_in
from rcsa_ident.stability.labels.label_noise import LabelNoise
from rcsa_ident.stability.labels.limit_discrepancy import LimitDiscrepancy
from rcsa_ident.stability.labels.next_test import most_telling
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.result import StabilityLobes
from rcsa_ident.stability.surface_error import surface_location_error
from rcsa_ident.stability.zero_order import ZeroOrder
from rcsa_ident.tool_holder.timoshenko import cowper, shape_functions
from tests.fixtures.paths import ROOT

PHYSICS = ROOT / "docs" / "physics"
RNG = np.random.default_rng(7)
CUT = CuttingCoefficients(900e6, 0.3, tangential_edge=8e3, radial_edge=6e3)
HELICAL = Cutter(3, 0.012, helix=np.radians(30.0))
HALF = Engagement.from_immersion(0.5, "down")
TIP = (Coordinate("tip", Dof.X), Coordinate("tip", Dof.Y))


def test_every_equation_has_a_name_and_every_source_is_known():
    pages = {path: path.read_text("utf-8") for path in PHYSICS.glob("*.md")}
    labels = [label for text in pages.values() for label in re.findall(r"^\s*\$\$ \((eq-[\w-]+)\)$", text, re.MULTILINE)]
    assert len(labels) == len(set(labels)) > 60
    assert sum(len(re.findall(r"^\s*\$\$", text, re.MULTILINE)) for text in pages.values()) == 2 * len(labels)
    used = {label for text in pages.values() for label in re.findall(r"\{eq\}`(eq-[\w-]+)`", text)}
    assert used <= set(labels)
    known = set(re.findall(r"^@\w+\{(\w+),", (ROOT / "docs" / "references.bib").read_text("utf-8"), re.MULTILINE))
    cited = {key for text in pages.values() for keys in re.findall(r"\{cite:p\}`([^`]+)`", text) for key in keys.split(",")}
    assert cited <= known
    assert len(cited) > 35
    # the site's MathJax is one file: what it would fetch by itself takes all equations of a page with it
    fetched = r"\\(boldsymbol|bm|cancel|color|enclose|bbox|href|ce|braket|verb|unicode)\b"
    assert not [path.name for path, text in pages.items() if re.search(fetched, text)]


def test_every_module_that_a_page_names_is_there():
    for path in PHYSICS.glob("*.md"):
        text = path.read_text("utf-8")
        for line in re.findall(r"^Modules?: (.*)$", text, re.MULTILINE):
            for name in re.findall(r"`([\w.]+)`", line):
                place = ROOT / "rcsa_ident" / name.replace(".", "/")
                assert place.with_suffix(".py").exists() or place.is_dir(), (path.name, name)


def test_force_lines_are_the_integral_over_all_teeth():
    """eq-cutting, eq-directions, eq-chip, eq-helix, eq-lines."""
    depth, feed, orders = 3e-3, 0.1e-3, np.array([0, 3, 6, 9, 5])
    turn = 2 * np.pi * (np.arange(20_000) + 0.5) / 20_000
    heights = depth * (np.arange(80) + 0.5) / 80
    force = np.zeros((2, turn.size))
    for tooth in range(3):
        for z in heights:
            phi = np.mod(turn + 2 * np.pi * tooth / 3 - 2 * np.tan(HELICAL.helices[0]) * z / HELICAL.diameter, 2 * np.pi)
            inside = (phi >= HALF.entry) & (phi <= HALF.exit)
            chip = np.where(inside, feed * np.sin(phi), 0.0)
            tangential = CUT.tangential * chip + CUT.tangential_edge * inside
            radial = CUT.tangential * CUT.radial_ratio * chip + CUT.radial_edge * inside
            force += (
                depth / 80 * np.stack([-np.cos(phi) * tangential - np.sin(phi) * radial, np.sin(phi) * tangential - np.cos(phi) * radial])
            )
    plain = np.array([np.mean(force * np.exp(-1j * m * turn), axis=1) * (1 if m == 0 else 2) for m in orders])
    found = force_lines(HELICAL, CuttingConditions(1000.0, depth, feed, HALF), CUT, orders)
    np.testing.assert_allclose(found, plain, rtol=3e-3, atol=2e-4 * np.abs(plain).max())


def test_torque_and_power():
    """eq-power."""
    depth, feed, speed = 2e-3, 0.1e-3, 900.0
    load = spindle_load(HELICAL, CuttingConditions(speed, depth, feed, HALF), CUT)
    volume = 3 * feed * depth * 0.006
    rubbed = 3 * depth * (HALF.exit - HALF.entry) * 0.006
    assert load.torque == pytest.approx((CUT.tangential * volume + CUT.tangential_edge * rubbed) / (2 * np.pi))
    assert load.power == pytest.approx(load.torque * speed)
    assert load.removal_rate == pytest.approx(volume * speed / (2 * np.pi))


def test_sensor_response():
    """Of docs/physics/cross_frf.md: delay, bandwidth, mount."""
    sensor = Sensor("a", Quantity.ACCELERATION, Dof.X, delay=5e-6, bandwidth=9000.0, mount_resonance=12_000.0)
    w = 2 * np.pi * 3000.0
    expected = np.exp(-1j * w * 5e-6) / (1 + 3j / 9) / (1 - (3 / 12) ** 2)
    assert complex(sensor.response(np.array([w]))[0]) == pytest.approx(expected)


def test_shear_coefficient_and_shapes():
    """eq-cowper, eq-shapes: a unit displacement of one end, nothing elsewhere."""
    nu, m = 0.29, 0.4
    square = (1 + m**2) ** 2
    assert cowper(nu, m) == pytest.approx(6 * (1 + nu) * square / ((7 + 6 * nu) * square + (20 + 12 * nu) * m**2))
    phi, length, x = 0.7, 0.03, np.array([0.0, 0.3, 1.0])
    deflection, _ = shape_functions(x, length, phi)
    plain = np.array([
        2 * x**3 - 3 * x**2 - phi * x + 1 + phi,
        length * (x**3 - (2 + phi / 2) * x**2 + (1 + phi / 2) * x),
        -(2 * x**3 - 3 * x**2 - phi * x),
        length * (x**3 - (1 - phi / 2) * x**2 - phi / 2 * x),
    ]) / (1 + phi)  # fmt: skip
    np.testing.assert_allclose(deflection, plain.T, atol=1e-15)


def _symmetric(*shape: int) -> np.ndarray:
    values = RNG.normal(size=shape) + 1j * RNG.normal(size=shape)
    return values + np.swapaxes(values, -1, -2)


def test_coupling_and_decoupling():
    """eq-joint, eq-interface, eq-rcsa, eq-decoupling."""
    omega, joint = np.array([500.0, 3000.0]), LumpedJoint(2.0, 3.0, 1e-3, 2e-3)
    sides = plane("tip") + plane("flange")
    a, b = _symmetric(2, 4, 4), _symmetric(2, 2, 2)
    found = couple(Receptance(omega, a, sides, sides), Receptance(omega, b, plane("flange"), plane("flange")), joint)
    for k, w in enumerate(omega):
        stiffness = np.diag([2.0 + 1j * w * 1e-3, 3.0 + 1j * w * 2e-3])
        a11, a12, a21, a22 = a[k, :2, :2], a[k, :2, 2:], a[k, 2:, :2], a[k, 2:, 2:]
        z = np.linalg.inv(a22 + np.linalg.inv(stiffness) + b[k])
        np.testing.assert_allclose(found["tip", "tip"][k], a11 - a12 @ z @ a21)
        np.testing.assert_allclose(found["spindle", "tip"][k], b[k] @ z @ a21)
        np.testing.assert_allclose(found["spindle", "spindle"][k], b[k] - b[k] @ z @ b[k])
    np.testing.assert_allclose(decouple(found, Receptance(omega, a, sides, sides), joint).values, b)


def test_modes_of_a_passive_machine():
    """eq-modes, eq-passive: the complex modes are the exact solution of real ones with a full damping matrix."""
    omega_n, psi = np.array([4000.0, 7000.0, 9000.0]), RNG.normal(size=(3, 2))
    root = np.tril(RNG.normal(size=(3, 3))) * 15.0 + np.diag([15.0] * 3)
    damping, residual = root @ root.T, 1e-9 * np.array([[2.0, 0.3], [0.3, 1.0]])
    model = damped_modes(omega_n, damping, psi, residual, plane("flange"))
    w = np.array([1000.0, 4100.0, 8000.0])
    plain = [psi.T @ np.linalg.solve(np.diag(omega_n**2) - s**2 * np.eye(3) + 1j * s * damping, psi) + residual for s in w]
    np.testing.assert_allclose(model.receptance(w).values, plain, rtol=1e-9)
    lam = -model.zeta * model.omega_n + 1j * model.omega_n * np.sqrt(1 - model.zeta**2)
    outer = np.einsum("np,nq->npq", model.phi, model.phi)
    pairs = [np.sum(outer / (1j * s - lam)[:, None, None] + outer.conj() / (1j * s - lam.conj())[:, None, None], axis=0) for s in w]
    np.testing.assert_allclose(np.array(pairs) + residual, plain, rtol=1e-9)


def test_shapes_of_a_normal_mode():
    model = normal_modes([5000.0], [0.03], [[0.7, 4.0]], plane("flange"))
    np.testing.assert_allclose(model.phi, np.array([[0.7, 4.0]]) * (1 - 1j) / (2 * np.sqrt(5000.0 * np.sqrt(1 - 0.03**2))))


def test_a_spindle_that_turns():
    """eq-turning."""
    omega_n, psi = np.array([5000.0, 5200.0]), RNG.normal(size=(2, 4))
    skew, damping, residual, speed = np.array([[0.0, -0.06], [0.06, 0.0]]), np.diag([300.0, 320.0]), np.zeros((4, 4)), 1500.0
    flange = (*plane("flange", Dof.X), *plane("flange", Dof.Y))
    modes = TurningModes(omega_n, damping, skew, psi, residual, speed, flange)
    w = 5100.0
    plain = psi.T @ np.linalg.solve(np.diag(omega_n**2) - w**2 * np.eye(2) + 1j * w * (damping + speed * skew), psi)
    np.testing.assert_allclose(modes.receptance(np.array([w])).values[0], plain, rtol=1e-9)


def test_the_workpiece_side():
    """eq-workpiece."""
    natural, zeta, stiffness, w = 2600.0, 0.04, 1e7, 2500.0
    found, _ = gives_way(np.log([[natural], [zeta], [stiffness]]), np.array([w]))
    assert complex(found[0]) == pytest.approx(natural**2 / stiffness / (natural**2 - w**2 + 2j * zeta * natural * w))


def test_mean_directional_matrix():
    """eq-alpha, eq-alpha0."""
    phi = HALF.entry + (HALF.exit - HALF.entry) * (np.arange(4000) + 0.5) / 4000
    s, c, k = np.sin(phi), np.cos(phi), CUT.radial_ratio
    alpha = np.array([[-s * (c + k * s), -c * (c + k * s)], [s * (s - k * c), c * (s - k * c)]])
    plain = 3 / (2 * np.pi) * (HALF.exit - HALF.entry) * alpha.mean(axis=2)
    np.testing.assert_allclose(mean_directional_matrix(3, HALF, CUT), plain, rtol=1e-6)


def _tip(omega: np.ndarray) -> Receptance:
    values = np.zeros((omega.size, 2, 2), dtype=complex)
    for i, (natural, zeta, k) in enumerate([(5000.0, 0.03, 1.2e7), (4600.0, 0.04, 9e6)]):
        values[:, i, i] = 1 / (k * (1 - (omega / natural) ** 2 + 2j * zeta * omega / natural))
    return Receptance(omega, values, TIP, TIP)


def test_zero_order_limits():
    """eq-zero-order: the limit over speed lies on the envelope of all frequencies and lobes."""
    omega = np.linspace(2000.0, 12_000.0, 60_001)
    tip = _tip(omega)
    process = MillingProcess(Cutter(3, 0.012), CuttingCoefficients(900e6, 0.3), HALF)
    mu = np.linalg.eigvals(mean_directional_matrix(3, HALF, process.coefficients) @ tip.values)
    depth = np.where(mu.real > 1e-12, 1 / (2 * 900e6 * np.where(mu.real > 1e-12, mu.real, 1.0)), np.inf)
    for speed in (600.0, 1000.0, 1500.0):
        waves = (omega[:, None] * 2 * np.pi / (3 * speed) - np.pi - 2 * np.angle(mu)) / (2 * np.pi)
        # where the phase passes a whole number between neighbouring frequencies
        crossing = np.any(np.floor(waves[1:]) != np.floor(waves[:-1]), axis=1)
        near = (np.abs(waves - np.rint(waves)) < 2e-3) & (waves > -0.1)
        plain = depth[near & np.append(crossing, False)[:, None]].min()
        found = stability_lobes(tip, process, [speed], 0.1, ZeroOrder())
        assert found.limit_depth[0] == pytest.approx(plain, rel=5e-3)


def test_process_damping_strength():
    """eq-process-damping."""
    assert ProcessDamping(1e14, 80e-6).strength == pytest.approx(1e14 * 80e-6**2 / 4)


def test_surface_location_error():
    """eq-forced, eq-sle of a straight-fluted tool."""
    cutter, speed, depth = Cutter(2, 0.012), 1400.0, 1e-3
    process = MillingProcess(cutter, CUT, HALF, feed_per_tooth=0.1e-3)
    tip = _tip(np.linspace(1.0, 40_000.0, 20_001))
    found = surface_location_error(tip, process, [speed], depth)
    orders = np.arange(1, 28)
    force = force_lines(cutter, process.conditions(speed, depth), CUT, orders)
    response = _tip(orders * speed).values
    static = force_lines(cutter, process.conditions(speed, depth), CUT, np.array([0]))[0, 1] / 9e6
    moved = static.real + sum((response[k, 1, 1] * force[k, 1] * np.exp(1j * m * np.pi)).real for k, m in enumerate(orders))
    assert found.error[0, 0] == pytest.approx(moved, rel=5e-3)


def test_the_weight_of_a_line():
    """eq-weight."""
    tool = np.zeros((2, 3), dtype=complex), np.zeros((2, 2), dtype=complex)
    lines, variance = np.array([[[3e-8 + 1e-8j, 1e-8]], [[2e-8j, 0.0]]]), np.array([[1e-18], [4e-18]])
    axis = AxisData(Dof.X, np.array([1.0, 2.0]), np.array([3.0, 6.0]), variance, lines, np.zeros(2, dtype=int), *tool, np.zeros((2, 0)))
    power = np.abs(lines[:, 0, 0] - lines[:, 0, 1]) ** 2
    np.testing.assert_allclose(_weight(axis, 0.05)[:, 0], 1 / (variance[:, 0] + 0.5 * 0.05**2 * power))


def test_filter_and_oscillators_of_the_observer():
    """eq-filter, eq-resonators."""
    modes, step = SampledModes(np.array([0.9 * np.exp(0.4j)]), np.array([2e-9 - 1e-9j]), 3e-10, 1e-4), 1e-4
    force = RNG.normal(size=50)
    state, plain = 0.0j, []
    for f in force:
        plain.append(2 * (modes.gain[0] * state).real + 3e-10 * f)
        state = modes.decay[0] * state + f
    np.testing.assert_allclose(modes.run(modes.init(), force)[1], plain, rtol=1e-9, atol=1e-22)
    decay, spread = TeethResonators(RandomWalk(2.0), np.array([800.0]), np.array([5.0])).modes(step)
    np.testing.assert_allclose(decay, [1.0, np.exp(0.08j)])
    np.testing.assert_allclose(spread, [2.0 * 1e-2, 5.0 * 1e-2])


def test_lag_of_constant_angle_and_outline_of_an_arc():
    """eq-outline, eq-lag: a bull nose."""
    cutter = Cutter(2, 0.016, helix=np.radians(35.0), profile=Profile.bull_nose(0.016, 0.003), helix_kind=HelixKind.ANGLE)
    kappa = np.radians(np.linspace(0.0, 90.0, 20_001))
    z, r = 0.003 * (1 - np.cos(kappa)), 0.005 + 0.003 * np.sin(kappa)
    wound = np.tan(np.radians(35.0)) * np.sum(0.003 * np.diff(kappa) / (0.5 * (r[1:] + r[:-1])))
    np.testing.assert_allclose([cutter.outline.radius_at(height) for height in z[1:-1:4000]], r[1:-1:4000], rtol=1e-9)
    assert lags(cutter, z[-1:])[0, 0] == pytest.approx(wound, rel=1e-4)


def test_recommended_depth():
    """eq-recommended."""
    speeds, drawn = np.array([990.0, 1000.0, 1010.0, 1100.0]), RNG.uniform(1e-3, 2e-3, (40, 4))
    nan = np.full(4, np.nan)
    lobes = StabilityLobes(speeds, np.full(4, 1.5e-3), nan, np.zeros(4, dtype=int), 1e-2, "x", drawn=drawn)
    least = min(np.sort(drawn[:, :3].min(axis=1))[2], 1.5e-3)
    assert lobes.recommended_depth()[1] == pytest.approx(0.9 * least)


def test_labels_and_the_smooth_error():
    """eq-label, eq-discrepancy, eq-next-test."""
    margin = np.array([-0.4, 0.1])
    np.testing.assert_allclose(LabelNoise().stable(margin), 0.02 + 0.96 * norm.cdf(margin / 0.3))
    points = np.array([[800.0, 0.5, 0.0], [1000.0, 0.25, 1.0]])
    found = LimitDiscrepancy().covariance(points, points)
    apart = np.log(0.8) ** 2 / (2 * 0.3**2) + np.log(2.0) ** 2 / 2
    np.testing.assert_allclose(found[0, 1], 0.35**2 * 0.3 * np.exp(-apart))
    assert trust_in(3.0) == pytest.approx(1.0 / (1.0 + np.exp(-1.5) / 4.0))
    stable = RNG.uniform(0.02, 0.98, (50, 6))

    def entropy(p: np.ndarray) -> np.ndarray:
        return -p * np.log(p) - (1 - p) * np.log(1 - p)

    told = entropy(stable.mean(axis=0)) - entropy(stable).mean(axis=0)
    assert most_telling(stable, 1, RNG) == [int(told.argmax())]


def test_static_compliance_of_an_arm():
    """eq-arm-receptance at rest."""
    robot, posture = ri.sample_robot("kr210"), np.radians([0.0, 20.0, 30.0, 10.0, -40.0, 0.0])
    chain = posed(robot, posture)
    jacobian = chain.jacobian(chain.flange.point(robot.tool_point.offset))
    plain = jacobian @ scipy.linalg.inv(np.diag([joint.stiffness for joint in robot.joints])) @ jacobian.T
    np.testing.assert_allclose(static_compliance(robot, posture, tilts=False), plain, rtol=1e-9, atol=1e-18)
