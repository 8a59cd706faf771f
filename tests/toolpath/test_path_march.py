"""Milling in time along a path through dexels: the block of `mill_block`, slots whichever way they go, arcs of chords, corners."""

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.dynamics.poles import PoleResidue
from rcsa_ident.toolpath.dexel import DexelField
from rcsa_ident.toolpath.march import Carrier, Cut, mill_block
from rcsa_ident.toolpath.path import RAPID, ToolPath
from rcsa_ident.toolpath.path_march import MarchOptions, MilledPart, mill_along
from rcsa_ident.toolpath.removal import Sweep
from rcsa_ident.toolpath.solid import ToolSolid
from rcsa_ident.toolpath.walls import PathFrame

CUTTER = Cutter(2, 0.01, np.radians(30.0), pitch=np.radians([170.0, 190.0]))
ALUMINIUM = CuttingCoefficients(6.6e8, 0.38)
SPEED, FEED, DEPTH = 18700.0 * 2.0 * np.pi / 60.0, 3.7 / 60.0, 0.0016
SOFT = Carrier(50.0 * np.eye(3), 2e3 * np.eye(3), np.full(3, 1e6), np.eye(3))


def seen(carrier: Carrier, frame: PathFrame) -> Carrier:
    """The same springs along X, Y and Z, from a path's own axes."""
    turn = np.eye(3)
    turn[:2, :2] = frame.turn
    modes = carrier.modes
    if modes is not None:
        modes = PoleResidue(modes.pole, turn @ modes.outputs, modes.inputs @ turn.T, modes.constant)
    return replace(carrier, motion=turn @ carrier.motion, modes=modes)


def milled(
    places: FloatArray | list[list[float]],
    low: list[float],
    high: list[float],
    carrier: Carrier = SOFT,
    steps: int = 360,
    **given: FloatArray,
) -> list[MilledPart]:
    count = len(places)
    path = ToolPath(np.array(places), **({"feed": np.full(count, FEED), "speed": np.full(count, SPEED)} | given))
    sweep = Sweep(DexelField.block(low, high, cell=0.25e-3), ToolSolid.of(CUTTER), path)
    return list(mill_along(sweep, CUTTER, ALUMINIUM, lambda move, frame: seen(carrier, frame), MarchOptions(steps)))


def joined(parts: list[MilledPart], name: str) -> FloatArray:
    return np.concatenate([getattr(part, name) for part in parts])


def test_a_straight_path_through_dexels_is_the_pass_along_a_block() -> None:
    parts = milled([[-0.006, 0.0, -DEPTH], [0.06, 0.0, -DEPTH]], [0.0, -0.02, -0.01], [0.06, -0.001, 0.0], steps=720)
    cut = Cut(CUTTER, ALUMINIUM, DEPTH, SPEED)
    wanted, _ = mill_block(SOFT, cut, 0.06, (-np.inf, -0.001), FEED / (2.0 * SPEED / (2.0 * np.pi)))
    middle = (joined(parts, "time") > 0.4) & (joined(parts, "time") < 0.8)
    steady = (wanted.time > 0.4) & (wanted.time < 0.8)
    assert joined(parts, "mean_force")[middle].mean(axis=0) == pytest.approx(wanted.force[steady].mean(axis=0), rel=5e-3, abs=1e-9)
    assert joined(parts, "mean_tip")[middle].mean(axis=0) == pytest.approx(wanted.tip[steady].mean(axis=0), rel=5e-3, abs=1e-12)
    assert joined(parts, "peak_force")[middle].max() == pytest.approx(np.linalg.norm(wanted.force[steady], axis=1).max(), rel=1e-3)
    # the wall stands off by as much as the tool does, as waves of the feed leave it
    sides = [(side, error) for part in parts for side, _, error in part.surfaces()]
    assert {side for side, _ in sides} == {0}
    assert np.median(sides[-1][1]) == pytest.approx(wanted.tip[steady, 1].mean(), rel=0.05)


@pytest.mark.parametrize("degrees", [0.0, 30.0, 90.0, 211.0])
def test_a_slot_has_the_same_forces_whichever_way_it_goes(degrees: float) -> None:
    """N a c K / 4 across and along, less what the chips of circles differ from sin(phi) by."""
    way = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
    parts = milled([[*(-0.016 * way), -DEPTH], [*(0.012 * way), -DEPTH]], [-0.01, -0.01, -0.006], [0.01, 0.01, 0.0])
    near = np.linalg.norm(joined(parts, "places")[:, :2], axis=1) < 0.004
    force = joined(parts, "mean_force")[near][:, :2].mean(axis=0)
    chip = FEED / (2.0 * SPEED / (2.0 * np.pi))
    wanted = 0.5 * DEPTH * chip * ALUMINIUM.tangential * np.array([-ALUMINIUM.radial_ratio, 1.0])
    assert [force @ way, force @ [-way[1], way[0]]] == pytest.approx(wanted, rel=0.015)


def test_an_arc_of_chords_has_the_forces_of_a_straight_slot() -> None:
    """A chord of four teeth each: what they left stands where the next ones come."""
    turn = np.linspace(0.05, 0.6 * np.pi, 91)
    places = np.column_stack([0.02 * np.cos(turn), 0.02 * np.sin(turn), np.full(turn.size, -DEPTH)])
    parts = milled(places, [-0.03, 0.006, -0.006], [0.03, 0.03, 0.0])
    place, force = joined(parts, "places"), joined(parts, "mean_force")[:, :2]
    angle = np.arctan2(place[:, 1], place[:, 0])
    inside = (angle > 0.9) & (angle < 1.7)
    along = np.column_stack([-np.sin(angle), np.cos(angle)])
    across = np.column_stack([-along[:, 1], along[:, 0]])
    chip = FEED / (2.0 * SPEED / (2.0 * np.pi))
    wanted = 0.5 * DEPTH * chip * ALUMINIUM.tangential * np.array([-ALUMINIUM.radial_ratio, 1.0])
    found = np.column_stack([np.sum(force * along, axis=1), np.sum(force * across, axis=1)])[inside]
    assert found.mean(axis=0) == pytest.approx(wanted, rel=0.03)
    assert np.all(found.std(axis=0) < 0.03 * wanted[1])
    peak = joined(parts, "peak_force")[inside]
    assert peak.max() < 1.1 * np.median(peak)


def test_a_corner_rests_and_rapid_moves_and_their_feeds_are_left_aside() -> None:
    places = [[-0.006, 0.0, 0.01], [-0.006, 0.0, -DEPTH], [0.01, 0.0, -DEPTH], [0.01, 0.012, -DEPTH], [0.01, 0.012, 0.01]]
    feed = np.array([np.nan, RAPID, FEED, FEED, RAPID])
    parts = milled(places, [0.0, -0.02, -0.006], [0.03, 0.03, 0.0], feed=feed, speed=np.array([0.0, 0.0, SPEED, SPEED, 0.0]))
    assert sorted({part.move for part in parts}) == [1, 2]
    assert np.all(np.diff(joined(parts, "time")) > 0.0)
    after = next(part for part in parts if part.move == 2)
    # around the corner a slot goes on as a slot
    assert after.mean_force[-5:].mean(axis=0)[0] == pytest.approx(-parts[0].mean_force[-5:].mean(axis=0)[1], rel=0.03)
    assert not any(part.lost for part in parts)


def test_modes_turn_with_the_path() -> None:
    """The same spring once as a freedom and once as a mode."""
    pole = np.array([-20.0 + 1j * np.sqrt(2e4 - 400.0)])
    outputs = 1.0 / (2j * pole.imag * 50.0) * np.array([[1.0], [0.0], [0.0]])
    modes = PoleResidue(pole, outputs, np.array([[1.0, 0.0, 0.0]]), np.zeros((3, 3)))
    one_way = replace(
        SOFT,
        mass=50.0 * np.eye(1),
        damping=2e3 * np.eye(1),
        stiffness=np.array([1e6]),
        motion=np.eye(3)[:, :1],
        play=np.zeros(1),
        load=np.zeros(1),
    )
    places = [[-0.006, 0.0, -DEPTH], [0.006, 0.006, -DEPTH], [0.012, 0.006, -DEPTH]]
    block = [0.0, -0.02, -0.006], [0.02, 0.02, 0.0]
    one, two = (milled(places, *block, carrier=carrier) for carrier in (one_way, Carrier(modes=modes)))
    assert np.abs(joined(one, "mean_tip")).max() > 1e-6
    assert joined(two, "mean_tip") == pytest.approx(joined(one, "mean_tip"), abs=3e-7)


def test_a_cut_without_a_spindle_speed_is_named() -> None:
    with pytest.raises(InputError, match="spindle speed"):
        milled(
            [[-0.006, 0.0, -DEPTH], [0.01, 0.0, -DEPTH]], [0.0, -0.02, -0.006], [0.03, 0.03, 0.0], speed=np.zeros(2), line=np.array([1, 7])
        )
