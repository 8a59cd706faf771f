"""Housing and bearings whose principal directions lie oblique to X and Y, and gyroscopic moments."""

import dataclasses

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.settings.machines import read_machine
from rcsa_ident.virtual.machine import Bearing
from rcsa_ident.virtual.milling import mill_cut
from rcsa_ident.virtual.reduction import poles, reduced
from rcsa_ident.virtual.rotor import frequency_response, rotor, turned

OMEGA = 2.0 * np.pi * np.array([90.0, 340.0, 780.0, 1210.0, 1730.0, 2450.0, 3300.0])
SPEED = 20000.0 * np.pi / 30.0
#: Every coordinate, X and Y in turn: tip, flange, fixture, slopes of the flange.
PORTS = ("tip.x", "tip.y", "flange.x", "flange.y", "fixture.x", "fixture.y", "flange.x'", "flange.y'")


def with_angles(spindle, housing, bearings, gyroscopic=False):
    """The spindle with its elements turned [deg]."""
    parts = zip(spindle.bearings, np.broadcast_to(bearings, len(spindle.bearings)), strict=True)
    return dataclasses.replace(
        spindle,
        housing=dataclasses.replace(spindle.housing, angle=float(np.radians(housing))),
        bearings=tuple(dataclasses.replace(b, angle=float(np.radians(a))) for b, a in parts),
        gyroscopic=gyroscopic,
    )


def response(spindle, tooling, speed=0.0):
    return frequency_response(rotor(spindle, tooling.assembly), OMEGA, speed, inputs=PORTS, outputs=PORTS)


def close(found, expected, share=1e-8):
    """Each pair of points is compared by its own size: receptances of slopes are far larger than those of the flange."""
    size = np.abs(expected).max(axis=0)
    scale = np.sqrt(np.outer(np.diag(size), np.diag(size)))
    return bool(np.all(np.abs(found - expected) <= share * scale))


@pytest.fixture(scope="module")
def soft(machines_folder):
    """A spindle whose bearings soften, each by another share."""
    spindle = read_machine(machines_folder / "stiff.toml").spindle
    return dataclasses.replace(spindle, gyroscopic=False, fixture_position=0.012)


def test_turned_by_hand():
    assert turned((3.0, 1.0), 0.0).tolist() == [[3.0, 0.0], [0.0, 1.0]]
    assert turned((3.0, 1.0), np.pi / 4.0) == pytest.approx(np.array([[2.0, 1.0], [1.0, 2.0]]))
    # the stiffest direction lies at the angle from +X towards +Y
    value, direction = np.linalg.eigh(turned((3.0, 1.0), 0.3))
    assert value == pytest.approx([1.0, 3.0])
    assert np.arctan(direction[1, 1] / direction[0, 1]) == pytest.approx(0.3)


def test_a_machine_at_angle_zero_is_the_machine_without_angles_to_the_last_bit(soft, tooling):
    plain = rotor(soft, tooling.assembly)
    half = plain.mass.shape[0] // 2
    for name, value in (("stiffness", "stiffness"), ("damping", "damping")):
        matrix = getattr(plain, name)
        assert matrix[:half, half:].nnz == matrix[half:, :half].nnz == 0
        # the housing's tilting: its own support and the bearings' levers, added up in this order
        body = soft.housing
        w, r = (np.flatnonzero(plain.ports[plain.port(f"fixture.{axis}")[0]]) for axis in "xy")
        for axis, index in ((0, w), (1, r)):
            expected = getattr(body, f"tilting_{value}")[axis]
            for bearing in soft.bearings:
                lever = -(bearing.position - body.position)
                expected += getattr(bearing, value)[axis] * (lever * lever)
            assert matrix[index[1], index[1]] == expected


@pytest.mark.parametrize("gyroscopic", [False, True])
def test_a_quarter_turn_exchanges_x_and_y(soft, tooling, gyroscopic):
    straight = response(with_angles(soft, 0.0, 0.0, gyroscopic), tooling, SPEED)
    quarter = response(with_angles(soft, 90.0, 90.0, gyroscopic), tooling, SPEED)
    # what happened along X happens along Y now, and what happened along Y along -X
    turn = np.kron(np.eye(4), [[0.0, -1.0], [1.0, 0.0]])
    assert close(quarter, turn @ straight @ turn.T)
    direct = np.diagonal(quarter, axis1=1, axis2=2)
    assert np.allclose(direct, np.diagonal(straight, axis1=1, axis2=2)[:, [1, 0, 3, 2, 5, 4, 7, 6]], rtol=1e-8)


@pytest.mark.parametrize("gyroscopic", [False, True])
def test_turning_all_elements_by_one_angle_turns_the_receptances(soft, tooling, gyroscopic):
    straight = response(with_angles(soft, 0.0, 0.0, gyroscopic), tooling, SPEED)
    oblique = response(with_angles(soft, 23.0, 23.0, gyroscopic), tooling, SPEED)
    c, s = np.cos(np.radians(23.0)), np.sin(np.radians(23.0))
    turn = np.kron(np.eye(4), [[c, -s], [s, c]])
    assert close(oblique, turn @ straight @ turn.T)
    assert np.linalg.norm(oblique[:, 0, 1]) > 0.01 * np.linalg.norm(oblique[:, 0, 0])


def test_angles_of_their_own_are_not_one_angle(soft, tooling):
    own = response(with_angles(soft, 14.0, (-17.0, -4.0, 11.0)), tooling)[:, :2, :2]
    # one angle would make tan(2 angle) = 2 XY / (XX - YY) the same real number at every frequency
    tangent = 2.0 * own[:, 0, 1] / (own[:, 0, 0] - own[:, 1, 1])
    assert np.ptp(tangent.real) > 0.1


@pytest.mark.parametrize("angles", [(0.0, 0.0), (14.0, (-17.0, -4.0, 11.0))])
def test_a_turned_machine_is_reciprocal_at_standstill_and_with_its_speed_reversed(soft, tooling, angles):
    spindle = with_angles(soft, *angles, gyroscopic=True)
    still = response(spindle, tooling)
    assert close(still, still.transpose(0, 2, 1))
    # the softening is the same in both senses of rotation
    unsoftened = dataclasses.replace(spindle, bearings=tuple(dataclasses.replace(b, softening=0.0) for b in spindle.bearings))
    forward, backward = (response(unsoftened, tooling, sign * SPEED) for sign in (1.0, -1.0))
    assert close(forward, backward.transpose(0, 2, 1))
    assert not close(forward, forward.transpose(0, 2, 1), 1e-3)


@pytest.mark.parametrize("speed", [0.0, SPEED, 2.0 * SPEED])
def test_a_turned_machine_is_passive(soft, tooling, speed):
    spindle = with_angles(soft, 14.0, (-17.0, -4.0, 11.0), gyroscopic=True)
    values = response(spindle, tooling, speed)[:, :4, :4]
    mobility = 1j * OMEGA[:, None, None] * values
    power = np.linalg.eigvalsh(0.5 * (mobility + mobility.conj().transpose(0, 2, 1)))
    assert np.all(power >= -1e-9 * np.abs(mobility).max(axis=(1, 2))[:, None])


def test_the_reduced_machine_answers_like_the_full_one(soft, tooling):
    spindle = with_angles(soft, 14.0, (-17.0, -4.0, 11.0), gyroscopic=True)
    model = rotor(spindle, tooling.assembly)
    omega = 2.0 * np.pi * np.arange(600.0, 4000.0, 40.0)
    full = frequency_response(model, omega, SPEED)
    found = poles(reduced(model), SPEED).response(omega)
    for row in range(6):
        for col in range(2):
            direct = np.linalg.norm(full[:, row // 2 * 2 + col, col])
            assert np.linalg.norm(found[:, row, col] - full[:, row, col]) < 3e-3 * direct


@pytest.mark.parametrize("angle", [np.nan, np.inf, 4.0])
def test_an_angle_beyond_half_a_turn_is_refused(hpm, angle):
    with pytest.raises(InputError, match=r"bearings\.angle"):
        Bearing(0.05, (1e8, 1e8), (1e3, 1e3), angle=angle)
    with pytest.raises(InputError, match=r"housing\.angle"):
        dataclasses.replace(hpm.spindle.housing, angle=angle)


def test_a_turned_machine_with_its_feed_turned_cuts_as_before(hpm, tooling):
    angle = np.radians(30.0)
    c, s = np.cos(angle), np.sin(angle)
    histories = []
    for own in (0.0, angle):
        spindle = with_angles(hpm.spindle, np.degrees(own), np.degrees(own), gyroscopic=True)
        dynamics = poles(reduced(rotor(spindle, tooling.assembly)), SPEED)
        conditions = dataclasses.replace(hpm.plan.conditions(SPEED), feed_angle=own)
        histories.append(mill_cut(dynamics, tooling.cutter, conditions, hpm.workpiece.coefficients, 5e-6, 4000))
    turn = np.array([[c, -s], [s, c]])
    for name in ("force", "tip", "flange", "fixture"):
        straight, oblique = (getattr(history, name) for history in histories)
        # a reduced machine whose planes are coupled has a few shapes more
        assert np.allclose(oblique, straight @ turn.T, rtol=0.0, atol=1e-3 * np.abs(straight).max())
