"""Laws of coupling that hold whatever is coupled: order, exchange, both limits of a joint, stiffer joints, loads, units."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.coupling.rcsa import SPINDLE, couple
from rcsa_ident.dynamics.coordinates import Coordinate, Dof, plane
from rcsa_ident.dynamics.receptance import Receptance, dissipation
from rcsa_ident.dynamics.structure import Structure

W = 2.0 * np.pi * np.array([90.0, 400.0, 1300.0, 4100.0])
TIP, FLANGE = plane("tip"), plane("flange")
JOINT = LumpedJoint(3e8, 2e6, 3000.0, 15.0)
seeds = st.integers(0, 10**6)


def structure(seed: int, points: tuple[str, ...], inner: int = 3) -> Structure:
    """Translations and slopes of some points and a few masses between, on springs and dampers of any strength."""
    rng = np.random.default_rng(seed)
    coordinates = tuple(c for point in points for c in plane(point))
    n = len(coordinates) + inner
    size = np.array([0.03 if c.dof.is_slope else 1.0 for c in coordinates] + [1.0] * inner)
    root, rubbing = rng.normal(size=(2, n, n))
    stiffness = (root @ root.T + 0.5 * np.eye(n)) * 1e8 * np.outer(size, size)
    damping = (rubbing @ rubbing.T) * 1e3 * np.outer(size, size)
    mass = np.diag(rng.uniform(0.3, 3.0, n) * size**2)
    return Structure(mass, damping, stiffness, 0.01 * stiffness, coordinates, np.arange(len(coordinates)))


def at(part: Structure) -> Receptance:
    return part.receptance(W)


def renamed(receptance: Receptance, point: str, name: str) -> Receptance:
    """A point of a machine as the flange or tip of the next one."""
    places = [i for i, c in enumerate(receptance.rows) if c.point == point]
    rows = tuple(Coordinate(name, receptance.rows[i].dof) for i in places)
    return Receptance(receptance.omega, receptance.values[:, places][:, :, places], rows, rows)


def joined(parts: list[Receptance], pairs: list[tuple[int, str, int, str, LumpedJoint]]) -> np.ndarray:
    """All receptances of parts after all joints have closed at once: H - H B' (B H B' + 1/K)^-1 B H."""
    whole = Receptance.block_diagonal(parts)
    starts = np.cumsum([0, *(len(part.rows) for part in parts)])
    rows = []
    compliance = []
    for one, point, other, its, joint in pairs:
        for dof in (Dof.X, Dof.SLOPE_X):
            row = np.zeros(len(whole.rows))
            row[starts[one] + parts[one].rows.index(Coordinate(point, dof))] = 1.0
            row[starts[other] + parts[other].rows.index(Coordinate(its, dof))] = -1.0
            rows.append(row)
        compliance.append(joint.compliance_along(W, (Dof.X, Dof.SLOPE_X)))
    b = np.array(rows)
    gap = b @ whole.values @ b.T
    i = np.arange(len(rows))
    gap[:, i, i] += np.concatenate(compliance, axis=1)
    return whole.values - whole.values @ b.T @ np.linalg.solve(gap, b @ whole.values)


def close(found: np.ndarray, expected: np.ndarray, tolerance: float) -> bool:
    """Whether receptances agree, each in the measure of its two ends."""
    size = np.sqrt(np.abs(np.einsum("nii->ni", expected)))
    return float(np.max(np.abs(found - expected) / size[:, :, None] / size[:, None, :])) < tolerance


@settings(max_examples=15, deadline=None)
@given(seeds, seeds, seeds)
def test_it_does_not_matter_which_joint_closes_first(tool, holder, spindle):
    """A chain of three, coupled from the spindle outwards, against both joints at once."""
    a, b, c = at(structure(tool, ("tip", "flange"))), at(structure(holder, ("tip", "flange"))), at(structure(spindle, ("flange",)))
    second = replace_joint(JOINT, 0.3)
    machine = renamed(couple(b, c, second), "tip", "flange")
    found = couple(a, machine, JOINT)
    expected = joined([a, b, c], [(0, "flange", 1, "tip", JOINT), (1, "flange", 2, "flange", second)])
    kept = [0, 1, 4, 5]
    assert close(found.values, expected[:, kept][:, :, kept], 1e-9)


def replace_joint(joint: LumpedJoint, factor: float) -> LumpedJoint:
    return LumpedJoint(
        factor * joint.translational_stiffness,
        factor * joint.rotational_stiffness,
        factor * joint.translational_damping,
        factor * joint.rotational_damping,
    )


@settings(max_examples=15, deadline=None)
@given(seeds, seeds, st.floats(-3.0, 3.0))
def test_either_side_may_be_called_the_spindle(one, other, log):
    """Two bodies that meet at one point each: what the first is to the second, the second is to the first."""
    parts = [structure(seed, ("flange",)) for seed in (one, other)]
    joint = replace_joint(JOINT, 10.0**log)

    def seen(holder: Structure, spindle: Structure) -> Receptance:
        h = at(holder).values
        doubled = Receptance(W, np.tile(h, (1, 2, 2)), (*TIP, *FLANGE), (*TIP, *FLANGE))
        return couple(doubled, at(spindle), joint)

    first, second = seen(*parts), seen(*parts[::-1])
    assert close(first["tip", "tip"], second[SPINDLE, SPINDLE], 1e-9)
    assert close(first[SPINDLE, SPINDLE], second["tip", "tip"], 1e-9)


@settings(max_examples=10, deadline=None)
@given(seeds, seeds)
def test_a_joint_becomes_rigid_and_loose_as_one_over_its_stiffness(tool, spindle):
    a, b = at(structure(tool, ("tip", "flange"))), at(structure(spindle, ("flange",)))
    for limit, power in ((couple(a, b, None).values, 1.0), (loose(a, b), -1.0)):
        errors = []
        for log in (6.0, 7.0):
            found = couple(a, b, LumpedJoint(1e8 * 10.0 ** (power * log), 1e5 * 10.0 ** (power * log))).values
            errors.append(np.linalg.norm(found - limit))
        # ten times stiffer, or looser: a tenth of the error
        assert errors[0] / errors[1] == pytest.approx(10.0, rel=2e-3)


def loose(a: Receptance, b: Receptance) -> np.ndarray:
    apart = np.zeros((W.size, 4, 4), dtype=complex)
    apart[:, :2, :2], apart[:, 2:, 2:] = a["tip", "tip"], b["flange", "flange"]
    return apart


@settings(max_examples=15, deadline=None)
@given(seeds, seeds, st.floats(1.0, 100.0), st.floats(1.0, 100.0))
def test_what_is_stiffer_gives_way_less_everywhere_when_it_stands_still(tool, spindle, along, turning):
    """Static compliances before and after a joint or a spring becomes stiffer differ by a matrix that is positive."""
    a, b = structure(tool, ("tip", "flange")), structure(spindle, ("flange",))
    # without structural damping the limit is real
    a, b = (replace(part, structural_damping=np.zeros_like(part.stiffness)) for part in (a, b))
    still = np.array([1e-3])
    soft = couple(a.receptance(still), b.receptance(still), LumpedJoint(1e8, 1e5)).values[0].real
    hard = couple(a.receptance(still), b.receptance(still), LumpedJoint(along * 1e8, turning * 1e5)).values[0].real
    size = np.sqrt(np.diag(soft))
    assert np.linalg.eigvalsh((soft - hard) / np.outer(size, size)).min() > -1e-9
    np.testing.assert_allclose(
        soft, np.linalg.inv(static(a, b, 1e8, 1e5))[np.ix_(*2 * (ends(a, b),))], rtol=1e-5, atol=1e-8 * np.abs(soft).max()
    )


def static(a: Structure, b: Structure, along: float, turning: float) -> np.ndarray:
    """Both stiffnesses and the springs between the flanges."""
    n, m = a.stiffness.shape[0], b.stiffness.shape[0]
    whole = np.block([[a.stiffness, np.zeros((n, m))], [np.zeros((m, n)), b.stiffness]])
    for k, (i, j) in zip((along, turning), zip(a.index[2:], n + b.index, strict=True), strict=True):
        between = np.zeros(n + m)
        between[i], between[j] = 1.0, -1.0
        whole += k * np.outer(between, between)
    return whole


def ends(a: Structure, b: Structure) -> np.ndarray:
    return np.concatenate([a.index[:2], a.stiffness.shape[0] + b.index])


@settings(max_examples=15, deadline=None)
@given(seeds, seeds, st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))
def test_units_do_not_matter(tool, spindle, length, mass):
    """Metres and kilograms that are others: a force is mass times length, a moment mass times length squared."""
    x, m = 10.0**length, 10.0**mass
    parts = (structure(tool, ("tip", "flange")), structure(spindle, ("flange",)))
    base = couple(at(parts[0]), at(parts[1]), JOINT)
    # a translation is x times as many new lengths, a slope stays; a translational stiffness is m new units, a rotational one m x^2
    unit = np.array([1.0 if c.dof.is_slope else 1.0 / x for c in base.rows])

    def in_units(h: Receptance) -> Receptance:
        scale = np.array([1.0 if c.dof.is_slope else x for c in h.rows])
        return Receptance(W, h.values * np.outer(scale, scale) / (m * x**2), h.rows, h.cols)

    joint = LumpedJoint(
        JOINT.translational_stiffness * m,
        JOINT.rotational_stiffness * m * x**2,
        JOINT.translational_damping * m,
        JOINT.rotational_damping * m * x**2,
    )
    found = couple(in_units(at(parts[0])), in_units(at(parts[1])), joint).values * np.outer(unit, unit) * (m * x**2)
    assert close(found, base.values, 1e-9)


@settings(max_examples=15, deadline=None)
@given(seeds, seeds, seeds)
def test_a_chain_of_passive_parts_feeds_no_energy_and_is_reciprocal(tool, holder, spindle):
    a, b, c = at(structure(tool, ("tip", "flange"))), at(structure(holder, ("tip", "flange"))), at(structure(spindle, ("flange",)))
    found = couple(a, renamed(couple(b, c, JOINT), "tip", "flange"), None).values
    assert np.min(dissipation(W, found)) > -1e-9
    assert close(np.swapaxes(found, 1, 2), found, 1e-9)


@settings(max_examples=10, deadline=None)
@given(seeds, seeds, st.integers(0, 3))
def test_the_work_of_a_force_is_what_dampers_take_up(tool, spindle, line):
    """Half the real part of force times conjugate velocity against the damping of all parts, moved as the force moves them."""
    a, b = structure(tool, ("tip", "flange")), structure(spindle, ("flange",))
    omega = W[line : line + 1]
    joint = LumpedJoint(1e8, 1e5, 2000.0, 3.0)
    n = a.mass.shape[0]
    dynamic = [part.stiffness + 1j * part.structural_damping + 1j * omega[0] * part.damping - omega[0] ** 2 * part.mass for part in (a, b)]
    whole = np.zeros((n + b.mass.shape[0],) * 2, dtype=complex)
    whole[:n, :n], whole[n:, n:] = dynamic
    force = np.zeros(whole.shape[0])
    force[a.index[0]] = 1.0
    gaps = []
    for i, j, k, c in zip(a.index[2:], n + b.index, (1e8, 1e5), (2000.0, 3.0), strict=True):
        gap = np.zeros(whole.shape[0])
        gap[i], gap[j] = 1.0, -1.0
        whole += (k + 1j * omega[0] * c) * np.outer(gap, gap)
        gaps.append((gap, c))
    moved = np.linalg.solve(whole, force)
    taken = sum(0.5 * omega[0] ** 2 * c * abs(gap @ moved) ** 2 for gap, c in gaps)
    for part, own in ((a, moved[:n]), (b, moved[n:])):
        losing = omega[0] ** 2 * part.damping + omega[0] * part.structural_damping
        taken += 0.5 * (own.conj() @ losing @ own).real
    h = couple(a.receptance(omega), b.receptance(omega), joint).between("tip.x", "tip.x")[0]
    assert 0.5 * (1j * omega[0] * h).real == pytest.approx(taken, rel=1e-7)
