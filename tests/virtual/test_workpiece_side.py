"""A table that gives way: closed forms, the cut in time, and the limit of tool and table together by two roads."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.front.samples import simulate_campaign
from rcsa_ident.io.recordings.readers import read_recording
from rcsa_ident.io.settings.machines import read_machine
from rcsa_ident.io.settings.setups import read_campaign
from rcsa_ident.signals.recording import Quantity, Role
from rcsa_ident.stability.discretisation import FullDiscretisation
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.multi_frequency import MultiFrequency
from rcsa_ident.stability.tip_modes import TIP, TipModes
from rcsa_ident.virtual.limit import true_limit
from rcsa_ident.virtual.milling import mill_cut, synchronous_lines
from rcsa_ident.virtual.workpiece_side import SideMode, VirtualWorkpieceSide

HZ = 2.0 * np.pi
TABLE = VirtualWorkpieceSide((SideMode(HZ * 640.0, 0.03, 9e6), SideMode(HZ * 1900.0, 0.05, 60e6)), (SideMode(HZ * 420.0, 0.05, 12e6),))
OMEGA = HZ * np.array([50.0, 420.0, 633.0, 640.0, 1200.0, 1900.0, 4000.0])


def rows(poles, *names):
    return [[str(c) for c in poles.coordinates].index(name) for name in names]


def test_a_mode_is_mass_damper_and_spring():
    mass, damper, spring = 9e6 / (HZ * 640.0) ** 2, 2.0 * 0.03 * 9e6 / (HZ * 640.0), 9e6
    one = replace(TABLE, x=TABLE.x[:1])
    assert np.allclose(1.0 / one.receptance(OMEGA)[:, 0, 0], spring + 1j * OMEGA * damper - OMEGA**2 * mass, rtol=1e-12)


def test_the_tip_moves_relative_to_the_workpiece(dynamics):
    """Only the tip's rows change, by what the table gives way; the workpiece moves by minus that."""
    both, own = TABLE.under(dynamics), TABLE.receptance(OMEGA)
    before, after = dynamics.response(OMEGA), both.response(OMEGA)
    tip, rest = rows(dynamics, "tip.x", "tip.y"), slice(2, len(dynamics.coordinates))
    assert rows(dynamics, "tip.x", "tip.y") == [0, 1]
    np.testing.assert_allclose(after[:, tip], before[:, tip] + own, rtol=1e-10, atol=1e-16)
    np.testing.assert_array_equal(after[:, rest][:, : before.shape[1] - 2], before[:, rest])
    np.testing.assert_allclose(after[:, rows(both, "workpiece.x", "workpiece.y")], -own, rtol=1e-10, atol=1e-16)


def test_a_steady_cut_shakes_the_table_by_minus_its_force(hpm, tooling, dynamics):
    """Marched through time: the workpiece's acceleration is omega^2 G_w F at every order, and the flange moves as on a rigid table."""
    cut = CuttingConditions(HZ * 170.0, 1e-4, 1e-4, Engagement.from_immersion(0.5, "down"))
    step, count = 1.0 / (8 * 25600.0), 70_000
    rigid, soft = (
        mill_cut(each, tooling.cutter, cut, hpm.workpiece.coefficients, step, count).after(50_000)
        for each in (dynamics, TABLE.under(dynamics))
    )
    order = np.array([4, 8, 12])
    force, felt, flange = (synchronous_lines(soft.angle, each, 16)[order] for each in (soft.force, soft.acceleration[:, -2:], soft.flange))
    expected = (order * cut.spindle_speed)[:, None] ** 2 * np.einsum("nij,nj->ni", TABLE.receptance(order * cut.spindle_speed), force)
    assert np.linalg.norm(felt - expected) < 2e-3 * np.linalg.norm(expected)
    before = synchronous_lines(rigid.angle, rigid.flange, 16)[order]
    assert np.linalg.norm(flange - before) < 2e-3 * np.linalg.norm(before)


@pytest.mark.slow
@pytest.mark.parametrize("rpm", [9000.0, 12_000.0])
def test_the_limit_in_time_is_that_of_the_sum(hpm, tooling, dynamics, rpm):
    """A small disturbance of tool and table together, marched; many-harmonic lobes and full discretisation of C11 + G_w."""
    plan, coefficients, speed = hpm.plan, hpm.workpiece.coefficients, rpm * np.pi / 30.0
    process = MillingProcess(tooling.cutter, coefficients, plan.engagement, plan.feed_angle)
    soft = VirtualWorkpieceSide((SideMode(HZ * 640.0, 0.02, 3e6), TABLE.x[1]), (SideMode(HZ * 420.0, 0.02, 3e6),))
    both = soft.under(dynamics)
    marched = true_limit(both, tooling.cutter, plan.conditions(speed), coefficients, (2e-5, 2e-2)).depth
    omega = HZ * np.arange(20.0, 6000.0, 1.0)
    tip = dynamics.response(omega)[:, rows(dynamics, "tip.x", "tip.y")]
    summed = Receptance(omega, tip + soft.receptance(omega), TIP, TIP)
    by_harmonics = stability_lobes(summed, process, np.array([speed]), 2e-2, MultiFrequency()).limit_depth[0]
    modes = TipModes(both.pole, both.outputs[rows(both, "tip.x", "tip.y")], both.inputs, np.zeros((2, 2)))
    by_modes = FullDiscretisation().lobes(modes, process, np.array([speed]), 2e-2).limit_depth[0]
    assert by_harmonics == pytest.approx(marched, rel=0.01)
    assert by_modes == pytest.approx(marched, rel=0.01)
    # and the table matters
    assert true_limit(dynamics, tooling.cutter, plan.conditions(speed), coefficients, (2e-5, 2e-2)).depth > 2.0 * marched


def told(machines_folder, more):
    text = (machines_folder / "hpm.toml").read_text().replace('"toolings/', f'"{machines_folder}/toolings/')
    return text + more


MODE = "{ natural_frequency_hz = 420.0, damping_ratio = 0.05, stiffness_n_per_m = 12e6 }"


def test_a_machine_file_tells_its_table(machines_folder, tmp_path):
    path = tmp_path / "machine.toml"
    path.write_text(told(machines_folder, f'\n[workpiece_side]\nrole = "workpiece"\ny = [{MODE}]\n'))
    found = read_machine(path).workpiece_side
    assert found == VirtualWorkpieceSide((), (SideMode(HZ * 420.0, 0.05, 12e6),), "workpiece")
    assert read_machine(machines_folder / "hpm.toml").workpiece_side is None


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ('[workpiece_side]\nrole = "ceiling"', r'workpiece_side.role: found the text "ceiling", allowed is one of table, workpiece'),
        ("[workpiece_side]\nx = []", r"workpiece_side.x: found an empty list"),
        (f"[workpiece_side]\nx = [{MODE.replace('0.05', '1.2')}]", r"workpiece_side.x\[0\].damping_ratio: found 1.2"),
        (f"[workpiece_side]\nx = [{MODE.replace('12e6', '-1.0')}]", r"workpiece_side.x\[0\].stiffness_n_per_m: found -1"),
        (f"[workpiece_side]\nz = [{MODE}]", r"workpiece_side.z"),
    ],
)
def test_a_table_that_is_none_is_refused(machines_folder, tmp_path, more, words):
    path = tmp_path / "machine.toml"
    path.write_text(told(machines_folder, f"\n{more}\n"))
    with pytest.raises(InputError, match=words):
        read_machine(path)


@pytest.mark.slow
def test_its_accelerometers_are_in_the_records(hpm, tmp_path, monkeypatch):
    """Named after what they stand on, with that role, and moved by -G_w F; what stands on the spindle does not know of the table."""
    monkeypatch.setattr("rcsa_ident.workflows.simulate.TRUTH_FREQUENCIES", (600.0, 900.0, 100.0))
    sensors = replace(hpm.sensors, acceleration_noise=0.0, gap_noise=0.0, gap_drift=0.0)
    plan = replace(hpm.plan, spindle_speeds=hpm.plan.spindle_speeds[:1], axial_depth=1e-4, duration=0.1)
    quiet = replace(hpm, sensors=sensors, plan=plan, toolings=hpm.toolings[:1], truth_toolings=())
    found = {}
    for name, side in (("rigid", None), ("soft", TABLE)):
        made = simulate_campaign(replace(quiet, workpiece_side=side), tmp_path / name, 3)
        campaign = read_campaign(made.folder)
        found[name] = read_recording(campaign.cuts[0].recording, campaign.sensors)
        assert (made.truth / "workpiece_side.csv").exists() == (side is not None)
    assert {s.name: s.role for s in found["soft"].sensors if s.quantity is Quantity.ACCELERATION} == {
        "fixture_x": Role.FIXTURE, "fixture_y": Role.FIXTURE, "table_x": Role.TABLE, "table_y": Role.TABLE,
    }  # fmt: skip
    assert "table_x" not in [s.name for s in found["rigid"].sensors]
    rigid, soft = (each.channel(Quantity.DISPLACEMENT, each.sensors[0].axis)[1] for each in found.values())
    assert np.std(soft - rigid) < 0.02 * np.std(rigid)
