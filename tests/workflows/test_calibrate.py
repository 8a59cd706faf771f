"""Calibration from recordings of the virtual machine: vibration, run-out, a dynamometer with dynamics, noise, drift."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.calibration import calibrate_mean_force
from rcsa_ident.cutting.force import force_history
from rcsa_ident.cutting.force_axes import axes_choices
from rcsa_ident.cutting.signal_fit import Dynamometer, calibrate_signal
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.setup.campaign import Campaign
from rcsa_ident.setup.cut import Cut, Workpiece
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.signals.recording import Quantity, Recording, Sensor
from rcsa_ident.tool_holder.geometry import MATERIALS, BeamSegment, ToolAssembly
from rcsa_ident.workflows.calibrate import calibrate, measure_force
from tests.fixtures.dynamometer import COEFFICIENTS, CUTTER, DOWN, RPM, SLOT, TRUE, plan, true_force

RATE = 25600.0
SENSORS = (Sensor("fx", Quantity.FORCE, Dof.X), Sensor("fy", Quantity.FORCE, Dof.Y))
RESONANCE = ((3200.0, 0.03), (2700.0, 0.04))


@cache
def simulated(seed, depth, engagement, resonance=(), duration=0.8):
    """Two clampings of five feeds each: conditions with true speeds, and long noise-free forces."""
    rng = np.random.default_rng(seed)
    sets = []
    for _ in range(2):
        runout = 3e-6 * rng.random()
        own = [replace(c, spindle_speed=c.spindle_speed * (1.0 + 5e-4 * rng.normal())) for c in plan(depth, engagement)]
        sets.append([(c, true_force(c, duration, RATE, 2.0 * np.pi * rng.random(), runout, resonance=resonance)) for c in own])
    return sets


def recorded(cuts, rng, scatter, sign=1.0, noise=1.0):
    """Half of each force from anywhere in it, with noise, slow drift and a depth that is off from cut to cut."""
    made = []
    for i, (conditions, force) in enumerate(cuts):
        count = force.shape[0] // 2
        start = rng.integers(0, count)
        part = force[start : start + count] * (1.0 + scatter * rng.normal())
        drift = 0.3 * np.linspace(-0.5, 0.5, count)[:, None] * rng.normal(size=2)
        part = sign * part + noise * rng.normal(size=part.shape) + drift
        programmed = replace(conditions, spindle_speed=6000.0 * RPM)
        made.append(measure_force(str(i), "a", Recording(RATE, part, SENSORS), None, CUTTER, programmed))
    return made


@pytest.mark.slow
@pytest.mark.parametrize(
    ("depth", "engagement", "resonance"), [(4e-4, DOWN, ()), (1.5e-4, SLOT, ()), (4e-4, DOWN, RESONANCE)], ids=["down", "slot", "resonance"]
)
def test_intervals_hold_the_truth(depth, engagement, resonance):
    """Eight draws each with 1 % scatter between cuts: of 32 intervals of 95 % not more than five miss (99 % chance)."""
    rng = np.random.default_rng(11)
    sets = simulated(5, depth, engagement, resonance)
    misses, mean_misses, width = 0, 0, []
    for draw in range(8):
        made = recorded(sets[draw % 2], rng, 0.01)
        found = calibrate_signal([m.record for m in made], Dynamometer(2) if resonance else None).forces
        misses += np.sum(np.abs(found.value - TRUE) > found.half_width)
        width.append(found.half_width / TRUE)
        mean = calibrate_mean_force([(m.record.cutter, m.record.conditions) for m in made], np.array([m.mean for m in made]))
        mean_misses += np.sum(np.abs(mean.value - TRUE) > mean.half_width)
        np.testing.assert_allclose(mean.value[:2], TRUE[:2], rtol=0.12)
    assert misses <= 5
    assert mean_misses <= 5
    # and they are of use: cutting coefficients to a few percent
    assert np.all(np.median(width, axis=0)[:2] < 0.05)


@pytest.mark.slow
def test_the_signal_tells_more_than_the_means():
    rng = np.random.default_rng(3)
    made = recorded(simulated(5, 4e-4, DOWN)[0], rng, 0.0, sign=-1.0)
    assert axes_choices([m.record for m in made])[0].shown() == ("-X", "-Y")
    found = calibrate_signal([m.record.seen_through(-np.eye(2)) for m in made])
    np.testing.assert_allclose(found.forces.value, TRUE, rtol=0.012)
    mean = calibrate_mean_force([(m.record.cutter, m.record.conditions) for m in made], -np.array([m.mean for m in made]))
    assert np.all(found.forces.half_width < mean.half_width)
    # the eccentric cutter of this clamping, whichever tooth is called the first
    runout = 3e-6 * np.random.default_rng(5).random()
    np.testing.assert_allclose(np.ptp(found.runout["a"]), np.ptp(runout * np.cos(CUTTER.tooth_angle - 1.1)), atol=0.5e-6)


def campaign(cuts):
    steel = MATERIALS["steel"]
    tooling = Tooling("T", CUTTER, ToolAssembly((BeamSegment(0.05, 0.012, steel),), (BeamSegment(0.05, 0.05, steel),), 0.0))
    names = [f"c{i}" for i in range(len(cuts))]
    made = tuple(Cut(n, "T", replace(c, spindle_speed=6000.0 * RPM), None, None) for n, (c, _) in zip(names, cuts, strict=True))
    return Campaign("by hand", RATE, SENSORS, Workpiece("alloy", COEFFICIENTS), {"T": tooling}, made)


@pytest.mark.slow
def test_campaign_with_what_must_be_left_out():
    """A chattering cut, one without a force, one with lost samples, one that is too short; the others give the answer."""
    rng = np.random.default_rng(9)
    cuts = simulated(6, 4e-4, DOWN)[0]
    chatter = replace(plan(4e-4, SLOT)[3], spindle_speed=6000.0 * RPM)
    cuts = [*cuts, (chatter, true_force(chatter, 0.4, RATE, 0.0)), cuts[0], cuts[1], cuts[2]]
    setup = campaign(cuts)
    zero = np.array([5.0, -3.0])

    def read(cut):
        k = int(cut.id[1:])
        force = cuts[k][1][: round(0.4 * RATE)] + rng.normal(size=(round(0.4 * RATE), 2))
        sensors = SENSORS
        if k == 6:
            sensors = (Sensor("d", Quantity.DISPLACEMENT, Dof.X), SENSORS[1])
        if k == 7:
            force[1000:1100] = np.nan
        if k == 8:
            force = force[:2000]
        return Recording(RATE, force + zero, sensors), Recording(RATE, zero + rng.normal(size=force.shape), sensors)

    progress = []
    found = calibrate(setup, read, progress=lambda done, total: progress.append((done, total)))
    assert [m.cut_id for m in found.used] == ["c0", "c1", "c2", "c3", "c4"]
    reasons = dict(found.left_out)
    assert "chatter at" in reasons["c5"]
    assert "no force along X" in reasons["c6"]
    assert "lost" in reasons["c7"]
    assert "revolutions" in reasons["c8"]
    assert progress[-1] == (9, 9)
    np.testing.assert_allclose(found.forces.value[:2], TRUE[:2], rtol=0.02)
    for m in found.used:
        np.testing.assert_allclose(found.mean_force_model(m)[:2], m.mean, atol=0.02 * np.abs(m.mean).max())
    assert not any("cylinder" in note for note in found.notes)
    rounded = replace(setup.toolings["T"], cutter=replace(CUTTER, shape="ball"))
    note = calibrate(replace(setup, toolings={"T": rounded}), read).notes[-1]
    assert note.startswith("T: computed as a cylinder: the cutter's shape is ball")
    assert "forces of shallow cuts" in note
    signal = calibrate(setup, read, signal=True)
    assert signal.signal is not None
    np.testing.assert_allclose(signal.forces.value, TRUE, rtol=0.02)


def test_zero_from_the_idle_stretches_of_a_record():
    """Air, cut, air, on a charge amplifier that drifts by half the mean force: the level between both idle stretches is taken out."""
    rng = np.random.default_rng(14)
    conditions = plan()[2]
    force = true_force(conditions, 0.4, RATE, 0.3)
    idle = np.zeros((round(0.2 * RATE), 2))
    whole = np.concatenate([idle, force, idle]) + 0.3 * rng.normal(size=(force.shape[0] + 2 * idle.shape[0], 2))
    zero = np.array([30.0, -20.0])
    drift = zero + np.linspace(0.0, 1.0, whole.shape[0])[:, None] * 0.5 * force.mean(axis=0)
    told = measure_force("c", "a", Recording(RATE, force, SENSORS), None, CUTTER, conditions)
    found = measure_force("c", "a", Recording(RATE, whole + drift, SENSORS), None, CUTTER, conditions)
    assert found.zeroed
    assert not told.zeroed
    np.testing.assert_allclose(found.mean, told.mean, atol=0.02 * np.abs(told.mean).max())
    # only one of them: its level holds for the whole record
    before = measure_force("c", "a", Recording(RATE, whole[: -idle.shape[0]] + zero, SENSORS), None, CUTTER, conditions)
    np.testing.assert_allclose(before.mean, told.mean, atol=0.02 * np.abs(told.mean).max())


def test_few_lost_samples_are_bridged():
    conditions = plan()[2]
    force = true_force(conditions, 0.4, RATE, 0.3)
    broken = force.copy()
    broken[[500, 501, 3000]] = np.nan
    whole, mended = (measure_force("c", "a", Recording(RATE, f, SENSORS), None, CUTTER, conditions) for f in (force, broken))
    np.testing.assert_allclose(mended.mean, whole.mean, rtol=1e-3)


@dataclass(frozen=True)
class AxialSensor:
    """A force along the spindle's axis."""

    name: str = "fz"
    quantity: Quantity = Quantity.FORCE
    axis: Dof = Dof.Z
    sensitivity: float = 1.0

    def response(self, omega):
        return np.ones(omega.size, dtype=complex)


@pytest.mark.slow
@pytest.mark.parametrize("signal", [False, True])
def test_a_force_along_the_axis_gives_the_axial_coefficients(signal):
    """Kinematic forces of a slot with an axial part; both methods take it from the means."""
    rng = np.random.default_rng(12)
    coefficients = replace(COEFFICIENTS, axial_ratio=0.15, axial_edge=2e3)
    cuts = [(c, None) for c in plan(1.5e-4, SLOT)]
    setup = campaign(cuts)

    def read(cut):
        conditions = cuts[int(cut.id[1:])][0]
        angle = conditions.spindle_speed * np.arange(round(0.4 * RATE)) / RATE + rng.random()
        force = force_history(CUTTER, conditions, coefficients, angle, slices=8)
        return Recording(RATE, force + 0.2 * rng.normal(size=force.shape), (*SENSORS, AxialSensor())), None

    found = calibrate(setup, read, signal=signal)
    assert found.forces.names == ("K_tc", "K_rc", "K_te", "K_re", "K_ac", "K_ae")
    assert found.forces.of("K_ac")[0] == pytest.approx(0.15 * TRUE[0], rel=0.03)
    assert found.forces.of("K_ae")[0] == pytest.approx(2e3, rel=0.1)
    assert found.forces.coefficients.axial_ratio == pytest.approx(0.15, rel=0.03)
    assert found.notes == ("c0, c1, c2, c3, c4: no air cut and no idle stretch, the sensors' own zero is used",)


def test_nothing_usable():
    setup = campaign([(plan()[0], None)])

    def read(cut):
        raise InputError("recording", "no such file", "an existing file", cut.id)

    with pytest.raises(InputError, match="none of 1 usable"):
        calibrate(setup, read)
