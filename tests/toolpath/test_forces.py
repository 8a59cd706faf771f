"""Forces along a path: filtered without delay, the same on all moves, refused where they belong to another path."""

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.toolpath.forces import ForceAlongPath, on_all_moves
from rcsa_ident.toolpath.path import RAPID, ToolPath


def test_teeth_are_left_out_and_nothing_is_late():
    t = np.arange(0.0, 2.0, 1e-4)
    slow = 100.0 * np.sin(2.0 * np.pi * 3.0 * t)
    teeth = 80.0 * np.sin(2.0 * np.pi * 623.0 * t)
    found = ForceAlongPath(t, np.stack([slow + teeth, slow, np.full(t.size, 7.0)], axis=1)).low_passed()
    middle = found.at(t[3000:-3000])
    assert np.abs(middle[:, 0] - slow[3000:-3000]).max() < 80.0 * (100.0 / 623.0) ** 4 * 1.1
    # forwards and backwards: at the cutoff half of the amplitude is left, at a thirtieth of it a millionth is missing
    assert np.abs(middle[:, 1] - slow[3000:-3000]).max() < 1e-3
    np.testing.assert_allclose(middle[:, 2], 7.0, rtol=1e-12)
    at_cutoff = ForceAlongPath(t, np.tile(np.sin(2.0 * np.pi * 100.0 * t)[:, None], 3)).low_passed().at(t[3000:-3000])
    assert np.abs(at_cutoff).max() == pytest.approx(0.5, abs=0.01)


def test_uneven_steps_keep_their_impulse():
    """Short steps beside long ones: nothing of a peak that falls between instants is lost."""
    time = np.array([0.0, 1.0, 1.00001, 1.00101, 1.00102, 3.0])
    force = np.array([0.0, 0.0, 500.0, 500.0, 0.0, 0.0])
    found = ForceAlongPath(time, np.tile(force[:, None], 3)).low_passed()
    assert np.trapezoid(found.force[:, 0], found.time) == pytest.approx(500.0 * 1.01e-3, rel=1e-6)
    assert found.time[np.argmax(found.force[:, 0])] == pytest.approx(1.0005, abs=3e-4)


def test_slow_forces_stay_as_they_are():
    slow = ForceAlongPath(np.linspace(0.0, 10.0, 11), np.ones((11, 3)))
    assert slow.low_passed() is slow
    with pytest.raises(InputError, match="cutoff"):
        slow.low_passed(0.0)


@pytest.mark.parametrize("start", [0.0, 0.3, 100.0])
def test_forces_at_twice_the_cutoff_hold_nothing_faster(start):
    """Whatever rounding makes of their steps."""
    time = start + np.arange(200) / 200.0
    force = ForceAlongPath(time, np.ones((200, 3)))
    assert force.low_passed(100.0) is force
    filtered = force.low_passed(100.0 * (1.0 - 1e-5))
    np.testing.assert_allclose(filtered.force, 1.0, rtol=1e-9)


def test_on_all_moves_in_either_axes():
    path = ToolPath(np.array([[0.0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0], [0.1, 0.1, 0.05], [0, 0, 0.05]]), feed=[0.1, 0.1, 0.1, 0.1, RAPID])
    fixed = on_all_moves(path, np.array([1.0, 2.0, 3.0]))
    np.testing.assert_allclose(fixed.at(np.array([0.5, 1.5, 2.2])), np.tile([1.0, 2.0, 3.0], (3, 1)))
    turned = on_all_moves(path, np.array([-1.0, 2.0, 3.0]), of_path=True).at(np.array([0.5, 1.5, 2.2]))
    # against the feed and to its left; along the tool nothing is to the left
    np.testing.assert_allclose(turned, [[-1.0, 2.0, 3.0], [-2.0, -1.0, 3.0], [0.0, 0.0, 2.0]], atol=1e-12)
    with pytest.raises(InputError, match="move"):
        on_all_moves(ToolPath(np.zeros((2, 3)), feed=[RAPID, RAPID]), np.ones(3))
    with pytest.raises(InputError, match="three"):
        on_all_moves(path, np.array([1.0, np.nan, 0.0]))


def test_forces_of_another_path_are_refused():
    path = ToolPath(np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]]), feed=[0.1, 0.1])
    force = ForceAlongPath(np.array([0.0, 0.5, 1.0]), np.zeros((3, 3)))
    along = np.array([[0.0, 0.0, 0.0], [0.05, 0.001, 0.0], [0.1, 0.0, 0.0]])
    force.check_places(along, path)
    with pytest.raises(InputError, match=r"6\.0 mm from the path at 0\.500 s"):
        force.check_places(along + np.array([[0.0] * 3, [0.0, 0.005, 0.0], [0.0] * 3]), path)


@pytest.mark.parametrize("time", [[0.0, 0.0], [1.0, 0.0], [0.0, np.nan]])
def test_instants_rise(time):
    with pytest.raises(InputError):
        ForceAlongPath(np.array(time), np.zeros((2, 3)))
