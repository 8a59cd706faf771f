"""How far a tool is from its path: across it, and in corners that a controller cuts short."""

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.toolpath.compensation import limited
from rcsa_ident.toolpath.deviation import Deviation
from rcsa_ident.toolpath.path import RAPID, ToolPath

PATH = ToolPath(
    np.array([[0.0, 0.0, 0.05], [0.0, 0.0, 0.0], [0.05, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.05, 0.0], [0.1, 0.05, 0.05]]),
    feed=[RAPID, RAPID, 0.05, 0.05, 0.05, RAPID],
)


def test_across_the_path_and_in_the_corner():
    followed = PATH.places.copy()
    followed[3] += [-1e-3, 1e-3, 0.0]
    off = np.array([[0, 0, 9], [1, 2, 0], [5, 0, -3], [-1, 1, 0], [4, 1, 0], [9, 9, 9]]) * 1e-3
    found = Deviation.of(PATH, PATH.places + off, followed)
    assert found.straight.tolist() == [False, True, True, False, True, False]
    assert found.blended.tolist() == [False, False, False, True, False, False]
    np.testing.assert_allclose(1e3 * found.across[1:5], [[0, 2, 0], [0, 0, -3], [-1, 1, 0], [4, 0, 0]], atol=1e-12)
    assert 1e3 * found.rms == pytest.approx(np.sqrt((4 + 9 + 16) / 3))
    assert 1e3 * found.largest == pytest.approx(4.0)
    assert 1e3 * found.corner == pytest.approx(np.sqrt(2.0))


def test_without_corners_there_is_none():
    found = Deviation.of(PATH, PATH.places, PATH.places)
    assert (found.rms, found.largest, found.corner) == (0.0, 0.0, 0.0)
    with pytest.raises(InputError, match="tips"):
        Deviation.of(PATH, PATH.places[1:], PATH.places)


def test_corrections_have_a_largest():
    given = np.array([[3e-3, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, -1e-3, 0.0]])
    cut, longer = limited(given, 2e-3)
    np.testing.assert_allclose(cut, [[2e-3, 0, 0], [0, 0, 0], [0, -1e-3, 0]])
    assert longer.tolist() == [True, False, False]
    with pytest.raises(InputError, match="largest"):
        limited(given, 0.0)
