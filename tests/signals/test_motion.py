"""Which channels show which motion, and how readings of sensors that are turned are turned back."""

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.signals.motion import FLANGE_ALONE, GAP_AND_FIXTURE, ONE_PLACE, measured_axes, motion_channels, shares_of
from rcsa_ident.signals.recording import Quantity, Role, Sensor

OMEGA = np.array([0.0, 900.0, 12e3])


def gap(axis, **given):
    return Sensor(f"gap_{axis}", Quantity.DISPLACEMENT, axis, **given)


def felt(name, axis, role=None, **given):
    return Sensor(name, Quantity.ACCELERATION, axis, role=role, **given)


def channels(*sensors, housing=True):
    return motion_channels(sensors, measured_axes(sensors), housing)


def test_shares_are_those_of_what_was_measured():
    np.testing.assert_array_equal(shares_of(True, False, 0), FLANGE_ALONE)
    np.testing.assert_array_equal(shares_of(True, True, 0), GAP_AND_FIXTURE)
    np.testing.assert_array_equal(shares_of(False, False, 1), ONE_PLACE)
    np.testing.assert_array_equal(shares_of(True, False, 2), np.eye(3))
    np.testing.assert_array_equal(shares_of(False, False, 2), [[0, 1, 0], [0, 0, 1]])


def test_channels_stand_in_the_order_of_their_meaning():
    # columns of a file in no order at all; Y has neither fixture nor table
    sensors = (
        felt("rear_x", Dof.X, Role.SPINDLE),
        Sensor("trigger", Quantity.TRIGGER),
        felt("table_x", Dof.X, Role.TABLE),
        gap(Dof.Y),
        felt("nose_y", Dof.Y, Role.SPINDLE),
        felt("fixed_x", Dof.X, Role.FIXTURE),
        gap(Dof.X),
    )
    found = channels(*sensors)
    assert found.axes == (Dof.X, Dof.Y)
    assert found.columns == (6, 3, 5, 0, 4)
    assert found.of_flange
    assert found.beside
    assert (found.outputs(Dof.X), found.outputs(Dof.Y)) == ([0, 2, 3], [1, 4])
    np.testing.assert_array_equal(found.shares(Dof.X), [[1, -1, 0], [0, 1, 0], [0, 0, 1]])
    np.testing.assert_array_equal(found.shares(Dof.Y), np.eye(2))
    # what is the flange's own motion together
    assert (found.searched(Dof.X), found.searched(Dof.Y)) == ([0, 2], [1])
    without = channels(*sensors, housing=False)
    assert without.columns == (6, 3, 5)
    assert not without.beside


def test_accelerometers_alone():
    found = channels(*(felt(f"{place}_{axis}", axis) for axis in (Dof.X, Dof.Y) for place in ("front", "rear")))
    assert [sensor.name for sensor in found.sensors] == ["front_x", "front_y", "rear_x", "rear_y"]
    assert not found.of_flange
    assert not found.beside
    np.testing.assert_array_equal(found.shares(Dof.Y), [[0, 1, 0], [0, 0, 1]])
    assert found.searched(Dof.Y) == [1]


def test_a_weight_makes_a_displacement_of_what_a_sensor_shows():
    found = channels(gap(Dof.X, delay=1e-5), felt("fixed", Dof.X, bandwidth=8e3))
    weights = found.weights(OMEGA)
    np.testing.assert_allclose(weights[:, 0, 0], np.exp(1e-5j * OMEGA))
    np.testing.assert_allclose(weights[1:, 1, 1], -(1.0 + 1j * OMEGA[1:] / (2 * np.pi * 8e3)) / OMEGA[1:] ** 2)
    assert weights[0, 1, 1] == 0.0
    np.testing.assert_array_equal(weights[:, [0, 1], [1, 0]], 0.0)


@pytest.mark.parametrize("degrees", [(1.0, 0.0), (-3.0, 2.0), (45.0, 45.0), (90.0, 90.0), (180.0, 0.0)])
def test_what_turned_sensors_show_is_turned_back(degrees):
    """Each sensor shows the motion along its own direction; of two accelerometers beside, which lag, too, and of each pair for itself."""
    a, b = np.radians(degrees)
    sensors = [
        gap(Dof.X, rotation=a),
        gap(Dof.Y, rotation=b),
        felt("rear_x", Dof.X, Role.SPINDLE, delay=2e-5, rotation=-b),
        felt("rear_y", Dof.Y, Role.SPINDLE, rotation=-a),
    ]
    found = channels(*sensors)
    rng = np.random.default_rng(4)
    # flange X, Y, housing X, Y
    moved = rng.standard_normal((OMEGA.size, 4)) + 1j * rng.standard_normal((OMEGA.size, 4))
    read = np.empty_like(moved)
    for k, sensor in enumerate(sensors):
        angle = sensor.rotation + (0.5 * np.pi if sensor.axis is Dof.Y else 0.0)
        first = k - k % 2
        along = np.cos(angle) * moved[:, first] + np.sin(angle) * moved[:, first + 1]
        read[:, k] = along * sensor.response(OMEGA) * (1.0 if k < 2 else -(OMEGA**2))
    shown = np.einsum("nc,nck->nk", read, found.weights(OMEGA))
    np.testing.assert_allclose(shown[1:], moved[1:], rtol=1e-12)
    np.testing.assert_allclose(shown[0, :2], moved[0, :2], rtol=1e-12)


@pytest.mark.parametrize(
    ("sensors", "words"),
    [
        ([gap(Dof.X, rotation=0.02)], "gap_x.rotation_deg: found 1.14592, allowed is 0, or as many sensors along the other axis"),
        ([gap(Dof.X), gap(Dof.Y), felt("f", Dof.X, rotation=0.1)], "f.rotation_deg"),
        ([gap(Dof.X, rotation=1.0), gap(Dof.Y, rotation=-0.4)], "directions at least 30 degrees apart"),
        ([felt("a", Dof.X), felt("b", Dof.X, rotation=0.1), felt("c", Dof.Y)], "b.rotation_deg"),
    ],
)
def test_what_cannot_be_turned_back_is_refused(sensors, words):
    with pytest.raises(InputError) as caught:
        channels(*sensors)
    assert words in str(caught.value)


def test_only_motion_has_a_direction():
    with pytest.raises(InputError, match=r"force_x.rotation_deg: found 2, allowed is none of a force sensor"):
        Sensor("force_x", Quantity.FORCE, Dof.X, rotation=np.radians(2.0))


@pytest.mark.parametrize(
    ("quantity", "looks", "field"),
    [
        (Quantity.DISPLACEMENT, {"distance": 0.31}, "distance"),
        (Quantity.DISPLACEMENT, {"distance": -0.11}, "distance"),
        (Quantity.DISPLACEMENT, {"distance": np.nan}, "distance"),
        (Quantity.DISPLACEMENT, {"distance_spread": 0.11}, "distance_spread"),
        (Quantity.DISPLACEMENT, {"distance_spread": np.nan}, "distance_spread"),
        (Quantity.ACCELERATION, {"distance": 0.0}, "distance"),
        (Quantity.FORCE, {"distance": 0.01}, "distance"),
    ],
)
def test_a_displacement_sensor_alone_looks_somewhere_near_the_flange(quantity, looks, field):
    with pytest.raises(InputError, match=rf"sensors\.s\.{field}: "):
        Sensor("s", quantity, Dof.X, **looks)
