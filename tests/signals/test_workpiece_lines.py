"""Accelerometers on table and workpiece: which channels they are, and what their lines show."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.force import force_lines
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.signals.motion import workpiece_channels
from rcsa_ident.signals.recording import Quantity, Recording, Role, Sensor
from tests.fixtures.synthetic import COEFFICIENTS, RATE, RPM, conditions, pair, wave

AXES = (Dof.X, Dof.Y)


def felt(name, axis, role, **given):
    return Sensor(name, Quantity.ACCELERATION, axis, role=role, **given)


def gives_way(omega):
    """A table on a spring and a damper along each axis, no modes: 1 / (k - m w^2 + i c w), shape (n, 2)."""
    return np.stack([1.0 / (1.2e7 - m * omega**2 + 1j * c * omega) for m, c in ((0.9, 250.0), (0.4, 120.0))], axis=1)


def on_a_table(made, seed=5, noise=0.05, air=0.0, turned=0.0):
    """The pair of records with accelerometers on a table; `air` shakes it in the air, too, at the teeth's orders [m/s^2]."""
    rng = np.random.default_rng(seed)
    records = []
    for record, speed, angle, cutting in ((made.cut, made.speed, made.angle, True), (made.air, made.speed, made.air_angle, False)):
        order = np.arange(int(2.0 * np.pi * 5000.0 / speed) + 1)
        lines = np.zeros((order.size, 2), dtype=complex)
        teeth = order[made.cutter.teeth :: made.cutter.teeth]
        if cutting:
            force = force_lines(made.cutter, conditions(speed / RPM), COEFFICIENTS, teeth)
            # the workpiece is pushed by minus the force on the tool: a = -w^2 x = w^2 G F
            lines[teeth] = (teeth * speed)[:, None] ** 2 * gives_way(teeth * speed) * force
        lines[teeth] += air
        turn = np.array([[np.cos(turned), np.sin(turned)], [-np.sin(turned), np.cos(turned)]])
        samples = wave(lines * np.exp(1j * order * angle)[:, None], speed, record.samples.shape[0]) @ turn.T
        samples = samples + noise * rng.normal(size=samples.shape)
        told = [dataclasses.replace(s, role=Role.FIXTURE) if s.quantity is Quantity.ACCELERATION else s for s in record.sensors]
        table = [felt("table_x", Dof.X, Role.TABLE, rotation=turned), felt("table_y", Dof.Y, Role.TABLE, rotation=turned)]
        records.append(Recording(RATE, np.hstack([record.samples, samples]), (*told, *table)))
    return records


def test_which_channels_they_are():
    sensors = (Sensor("gap_x", Quantity.DISPLACEMENT, Dof.X), felt("part", Dof.Y, Role.WORKPIECE), felt("rear", Dof.X, Role.SPINDLE),
               felt("table", Dof.X, Role.TABLE), felt("fixed", Dof.X, Role.FIXTURE))  # fmt: skip
    found = workpiece_channels(sensors)
    assert (found.axes, found.columns) == (AXES, (3, 1))
    np.testing.assert_allclose(found.weights(np.array([100.0]))[0], -1e-4 * np.eye(2))
    assert workpiece_channels(sensors[:1]) is None


@pytest.mark.parametrize("other", [Role.TABLE, Role.WORKPIECE])
def test_one_for_each_axis(other):
    with pytest.raises(InputError, match=rf"sensors\.(a|b)\.role: found .{other if other is Role.TABLE else Role.TABLE}., as well as .* "):
        workpiece_channels((felt("a", Dof.Y, Role.TABLE), felt("b", Dof.Y, other)))


def test_one_that_is_turned_needs_another():
    with pytest.raises(InputError, match=r"sensors\.a\.rotation_deg: found 10, allowed is 0, or as many sensors along the other axis"):
        workpiece_channels((felt("a", Dof.Y, Role.TABLE, rotation=np.radians(10.0)),))


@pytest.mark.parametrize("turned", [0.0, np.radians(25.0)])
def test_their_lines_are_minus_what_gives_way(turned):
    z = []
    for seed in range(6):
        made = pair(seed)
        cut, air = on_a_table(made, seed, turned=turned)
        found = made.measure(cut=cut, air=air).measurement
        for i, axis in enumerate(AXES):
            lines = found.workpiece[axis]
            expected = -gives_way(lines.omega)[:, i] * np.exp(1j * lines.order * made.angle)
            assert np.linalg.norm(lines.receptance - expected) < 2e-3 * np.linalg.norm(expected)
            # how far the phase of all turns with the speed's own error is the delay's business
            z += [*((np.abs(lines.receptance) - np.abs(expected)) / np.sqrt(lines.variance[:, 0]))]
            assert not np.any(lines.air)
            assert lines.omega.size == found.axes[axis].omega.size
    assert np.sqrt(np.mean(np.square(z))) == pytest.approx(1.0, abs=0.15)


def test_the_spindles_lines_do_not_know_of_them():
    made = pair(3)
    cut, air = on_a_table(made)
    keep = len(made.cut.sensors)
    without = [Recording(RATE, each.samples[:, :keep], each.sensors[:keep]) for each in (cut, air)]
    one, other = made.measure(cut=cut, air=air).measurement, made.measure(cut=without[0], air=without[1]).measurement
    assert other.workpiece == {}
    for axis in AXES:
        for name in ("cut", "air", "variance", "force"):
            np.testing.assert_array_equal(getattr(one.axes[axis], name), getattr(other.axes[axis], name))


def test_an_air_cut_that_shakes_the_table_is_subtracted():
    made = pair(4, off=0.0)
    quiet, shaken = (made.measure(cut=cut, air=air).measurement for cut, air in (on_a_table(made, air=each) for each in (0.0, 2.0)))
    for axis in AXES:
        before, after = quiet.workpiece[axis], shaken.workpiece[axis]
        assert np.any(after.air)
        # the angle between both records is known well enough to take out nine tenths at least
        left, added = (np.linalg.norm(getattr(after, name) - getattr(before, name)) for name in ("receptance", "cut"))
        assert left < 0.1 * added


def test_alone_they_tell_nothing_of_the_spindle():
    made = pair(4)
    cut, _ = on_a_table(made)
    alone = Recording(RATE, cut.samples[:, -2:], cut.sensors[-2:])
    with pytest.raises(InputError, match=r"sensors: found table_x on the table, and none on the spindle, allowed is a displacement sensor"):
        made.measure(cut=alone, air=None)
