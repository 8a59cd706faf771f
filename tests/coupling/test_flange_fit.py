"""The flange from several toolings on the virtual machine, whose truth comes from its own assembly of the whole rotor."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.coupling.flange_fit import Observation, least_squares_flange
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.coupling.smoothing import band_covariance, band_solve, bending, second_differences
from rcsa_ident.dynamics.coordinates import plane
from rcsa_ident.dynamics.receptance import dissipation
from rcsa_ident.io.settings.machines import read_machine
from rcsa_ident.tool_holder.geometry import MATERIALS, BeamSegment, ToolAssembly
from rcsa_ident.tool_holder.model import tool_holder_receptance
from rcsa_ident.virtual.rotor import frequency_response, rotor
from tests.coupling.test_rcsa import FLANGES, spindle_structure

MACHINES = Path(__file__).resolve().parents[2] / "data" / "machines"
OMEGA = 2.0 * np.pi * np.arange(400.0, 3600.0, 20.0)
STEEL = MATERIALS["steel"]
LENGTHS = (0.02, 0.05, 0.08, 0.11)
ENTRIES = ((0, 0), (0, 1), (1, 1))
JOINT = LumpedJoint(2e9, 5e6, 2000.0, 10.0)


def blank(length, diameter=0.04):
    """A short or long artefact without a contact: a cylinder on a holder's root."""
    return ToolAssembly(
        (BeamSegment(length, diameter, STEEL),), (BeamSegment(0.03, 0.05, STEEL), BeamSegment(0.026, 0.063, STEEL, 0.02)), 0.0
    )


@cache
def truth(name):
    """Flange receptance and joint of a virtual machine, and its tip and flange receptances with each blank."""
    spindle = read_machine(MACHINES / f"{name}.toml").spindle
    ports = ("flange.x", "flange.x'")
    flange = frequency_response(rotor(spindle, None), OMEGA, 0.0, inputs=ports, outputs=ports)
    j = spindle.joint
    joint = LumpedJoint(j.translational_stiffness, j.rotational_stiffness, j.translational_damping, j.rotational_damping)
    seen = ("tip.x", "flange.x")
    return flange, joint, [frequency_response(rotor(spindle, blank(each)), OMEGA, 0.0, inputs=seen, outputs=seen) for each in LENGTHS]


@cache
def holders():
    return [tool_holder_receptance(blank(each), OMEGA) for each in LENGTHS]


def observations(name, noise, rng, spindle_end=True, which=(0, 1, 2, 3)):
    made = []
    for k in which:
        whole = truth(name)[2][k]
        for row, col, i, j in (("tip", "tip", 0, 0), ("spindle", "tip", 1, 0), ("spindle", "spindle", 1, 1))[: 3 if spindle_end else 1]:
            values = whole[:, i, j]
            std = noise * (np.abs(values) + 0.05 * np.median(np.abs(values)))
            values = values + std * (rng.normal(size=OMEGA.size) + 1j * rng.normal(size=OMEGA.size))
            made.append(Observation(holders()[k], row, col, values, std))
    return made


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10**6), count=st.sampled_from([3, 4]))
def test_exact_tips_give_the_flange(seed, count):
    """Three exact tip receptances leave at most two solutions, one of which is the truth; four leave one."""
    omega = OMEGA[::16]
    spindle = spindle_structure(np.random.default_rng(seed), tuple(c.dof for c in FLANGES[:2])).receptance(omega)
    made = []
    for each in LENGTHS[:count]:
        holder = tool_holder_receptance(blank(each), omega)
        values = couple(holder, spindle, JOINT)["tip", "tip"][:, 0, 0]
        made.append(Observation(holder, "tip", "tip", values, 1e-6 * np.abs(values)))
    found = least_squares_flange(made, JOINT, least_damping=None)
    size = np.sqrt(np.abs(np.einsum("nii->ni", spindle.values)))
    error = np.max(np.abs(found.receptance.values - spindle.values) / size[:, :, None] / size[:, None, :], axis=(1, 2))
    sure = ~found.ambiguous if count == 3 else np.ones(omega.size, dtype=bool)
    assert np.all(error[sure] < 2e-3)
    assert np.all(found.chi2 < 1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hpm", "stiff", "table2"])
def test_noise_of_two_percent_with_the_spindles_end(name):
    """Four toolings, tip, flange and across: entries to about the measurements' own noise, intervals that hold, well conditioned."""
    flange, joint, _ = truth(name)
    found = least_squares_flange(observations(name, 0.02, np.random.default_rng(1)), joint)
    values = found.receptance.values
    for i, j in ENTRIES:
        relative = np.abs(values - flange)[:, i, j] / np.abs(flange[:, i, j])
        assert np.median(relative) < 0.05
    z = np.concatenate([np.abs(part(values - flange)) / found.std for part in (np.real, np.imag)])
    inside = np.mean(np.stack([z[:, i, j] for i, j in ENTRIES]) < 1.96)
    assert 0.88 < inside < 0.99
    assert np.median(found.condition) < 15.0
    assert found.freedom == 18
    assert 0.7 * 18 < np.median(found.chi2) < 1.4 * 18


@pytest.mark.slow
def test_smoothness_helps_and_says_so():
    """Tips alone are ill-conditioned: neighbours halve the error, their use is marked, and the notes say what to measure."""
    flange, joint, _ = truth("hpm")
    made = observations("hpm", 0.003, np.random.default_rng(2), spindle_end=False)
    alone, smooth = least_squares_flange(made, joint, least_damping=None), least_squares_flange(made, joint)

    def error(found):
        return np.median([np.abs(found.receptance.values - flange)[:, i, j] / np.abs(flange[:, i, j]) for i, j in ENTRIES])

    assert error(smooth) < 0.8 * error(alone)
    assert not alone.regularised.any()
    assert 0.1 < smooth.regularised.mean() < 1.0
    assert any("regularised by their neighbours" in note for note in smooth.notes)
    assert any("measured at the spindle" in note for note in smooth.notes)
    assert np.all(smooth.std[smooth.regularised] < np.inf)


@pytest.mark.slow
def test_three_tips_leave_two_flanges():
    found = least_squares_flange(observations("hpm", 1e-6, np.random.default_rng(3), spindle_end=False, which=(0, 2, 3)), truth("hpm")[1])
    assert found.ambiguous.mean() > 0.05
    assert any("a fourth tooling would decide" in note for note in found.notes)
    assert found.freedom == 0


@pytest.mark.slow
def test_a_wrong_holder_shows():
    """A holder modelled 20 % too heavy does not explain four toolings; the misfit says so, and passivity suffers."""
    heavy = replace(STEEL, density=1.2 * STEEL.density)
    rng = np.random.default_rng(4)
    made = []
    for o, length in zip(observations("stiff", 0.005, rng), np.repeat(LENGTHS, 3), strict=True):
        wrong = ToolAssembly((BeamSegment(float(length), 0.04, heavy),), blank(float(length)).holder, 0.0)
        made.append(Observation(tool_holder_receptance(wrong, OMEGA), o.row, o.col, o.values, o.std))
    found = least_squares_flange(made, truth("stiff")[1])
    assert any("differ from their models" in note for note in found.notes)


@pytest.mark.slow
def test_the_result_is_judged_for_passivity():
    found = least_squares_flange(observations("table2", 0.02, np.random.default_rng(5)), truth("table2")[1])
    np.testing.assert_allclose(found.dissipation, dissipation(OMEGA, found.receptance.values))
    assert found.receptance.rows == plane("flange")
    np.testing.assert_allclose(found.receptance.values, np.swapaxes(found.receptance.values, 1, 2))


@pytest.mark.slow
def test_what_is_refused():
    rng = np.random.default_rng(6)
    made = observations("stiff", 0.01, rng)
    with pytest.raises(InputError, match="at least three"):
        least_squares_flange(made[:2])
    with pytest.raises(InputError, match="three tip receptances"):
        least_squares_flange([o for o in made if o.row == "spindle"])
    with pytest.raises(InputError, match="tip or spindle"):
        Observation(holders()[0], "flange", "tip", made[0].values, 1e-9)
    with pytest.raises(InputError, match="above 0"):
        Observation(holders()[0], "tip", "tip", made[0].values, 0.0)
    with pytest.raises(InputError, match="the tool-holder's frequencies"):
        Observation(holders()[0], "tip", "tip", made[0].values[:-1], 1e-9)


def test_the_band_solution_is_the_dense_one():
    """Smoothing and its covariance against dense matrices, on an uneven grid."""
    rng = np.random.default_rng(7)
    n = 23
    omega = np.cumsum(rng.uniform(5.0, 20.0, n)) + 1000.0
    size = rng.uniform(0.5, 2.0, (n, 3)) * [1e-8, 1e-6, 1e-4]
    bend = bending(omega, size, 0.02)
    root = rng.normal(size=(n, 3, 3)) + 1j * rng.normal(size=(n, 3, 3))
    precision = np.einsum("nij,nkj->nik", root, root.conj()) / size[:, :, None] / size[:, None, :]
    right = (rng.normal(size=(n, 3)) + 1j * rng.normal(size=(n, 3))) / size
    dense = np.zeros((3 * n, 3 * n), dtype=complex)
    for i in range(n):
        dense[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = precision[i]
    rows = np.zeros((3 * (n - 2), 3 * n))
    for k in range(3 * n):
        unit = np.zeros(3 * n)
        unit[k] = 1.0
        rows[:, k] = second_differences(bend, unit.reshape(n, 3)).ravel()
    dense += rows.T @ rows
    at = rng.normal(size=(n, 3)) * size
    expected = np.linalg.solve(dense, right.ravel() - rows.T @ rows @ at.ravel()).reshape(n, 3)
    np.testing.assert_allclose(band_solve(precision, right, bend, size, at) / size, expected / size, rtol=1e-7, atol=1e-9)
    inverse = np.linalg.inv(dense)
    blocks = np.array([inverse[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] for i in range(n)])
    found = band_covariance(precision, bend, size)
    np.testing.assert_allclose(
        found / size[:, :, None] / size[:, None, :], blocks / size[:, :, None] / size[:, None, :], rtol=1e-6, atol=1e-9
    )
    # a parabola does not bend more than its second derivative says
    line = np.stack([omega, 2.0 * omega, -omega], axis=1)
    assert np.max(np.abs(second_differences(bend, line)) * size[1:-1] / np.abs(line[1:-1])) < 1e-9
