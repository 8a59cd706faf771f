"""Moves of a tool: lengths, times, and a finer path that is the same one."""

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.toolpath.path import RAPID, ToolPath


def corner() -> ToolPath:
    places = [[0.0, 0.0, 0.01], [0.0, 0.0, 0.0], [0.05, 0.0, 0.0], [0.05, 0.02, 0.0]]
    return ToolPath(np.array(places), feed=[np.nan, RAPID, 0.05, 0.02], speed=[0.0, 1000.0, 1000.0, 1000.0], line=[1, 2, 3, 4])


def test_rapid_moves_take_no_time_and_cut_nothing() -> None:
    path = corner()
    assert path.cutting.tolist() == [False, True, True]
    assert path.times == pytest.approx([0.0, 0.0, 1.0, 2.0])
    assert path.beside_cutting.tolist() == [False, True, True, True]
    assert ToolPath(path.places, feed=[0.05, RAPID, 0.05, RAPID]).beside_cutting.tolist() == [False, True, True, False]
    assert ToolPath(path.places[:1]).beside_cutting.tolist() == [False]


def test_a_finer_path_goes_the_same_way() -> None:
    path = corner()
    fine = path.resampled(0.0007)
    assert fine.lengths.max() <= 0.0007 * (1.0 + 1e-9)
    assert fine.length == pytest.approx(path.length, rel=1e-12)
    assert fine.times[-1] == pytest.approx(path.times[-1])
    kept = [np.flatnonzero(np.all(fine.places == place, axis=1)).size for place in path.places]
    assert kept == [1, 1, 1, 1]
    # rapid moves may stay whole
    assert len(path.resampled(0.0007, rapid=False)) == len(fine) - 14
    # a move's numbers stand at all places behind its start
    assert fine.line[fine.places[:, 1] > 0.0].tolist() == [4] * 29
    assert set(fine.feed[fine.line == 3]) == {0.05}


def test_axes_turn_between_places_and_stay_unit_vectors() -> None:
    path = ToolPath(np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]]), axes=np.array([[0.0, 0.0, 2.0], [1.0, 0.0, 0.0]]))
    fine = path.resampled(0.05)
    assert fine.axes == pytest.approx(np.array([[0.0, 0.0, 1.0], [0.5**0.5, 0.0, 0.5**0.5], [1.0, 0.0, 0.0]]))


def test_a_place_alone_stays_one() -> None:
    assert len(ToolPath(np.zeros((1, 3))).resampled(0.1)) == 1


def test_a_move_without_a_feed_is_named() -> None:
    with pytest.raises(InputError, match="line 7"):
        _ = ToolPath(np.array([[0.0, 0, 0], [0.1, 0, 0]]), line=[6, 7]).times


@pytest.mark.parametrize(
    ("name", "value"),
    [("axes", np.zeros((2, 3))), ("feed", [-1.0, 1.0]), ("speed", [1.0]), ("places", np.array([[0.0, 0.0, np.nan]] * 2))],
)
def test_what_is_no_path_is_refused(name: str, value: object) -> None:
    given = {"places": np.array([[0.0, 0, 0], [0.1, 0, 0]])} | {name: value}
    with pytest.raises(InputError, match=name):
        ToolPath(**given)
