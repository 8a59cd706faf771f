"""Milling along paths: chatter where stability methods have their limits, on modes and on a robot with play; what is told of it."""

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.modal import ModalModel, normal_modes
from rcsa_ident.front.samples import sample_tooling
from rcsa_ident.io.settings.robots import read_robot
from rcsa_ident.machine.known_tip import KnownTip
from rcsa_ident.machine.robot.flexible import FlexibleRobot
from rcsa_ident.machine.robot.posed_robot import PosedRobot
from rcsa_ident.setup.cut import CutSpec
from rcsa_ident.setup.tooling import BareCutter
from rcsa_ident.stability.discretisation import FullDiscretisation
from rcsa_ident.stability.tip_modes import TipModes
from rcsa_ident.toolpath.path import ToolPath
from rcsa_ident.toolpath.walls import PathFrame
from rcsa_ident.workflows.paths.milling import PathMilling, carriers_of, mill_path
from rcsa_ident.workflows.paths.removal import field_of
from rcsa_ident.workflows.paths.stability import stations_along
from rcsa_ident.workflows.tool_change import ToolChange
from tests.fixtures.paths import ROOT

TOOL = BareCutter("end mill", Cutter(3, 0.01, np.radians(30.0)))
FEED = 5e-5
POSTURE = np.radians([-11.71, 20.78, 147.86, 82.76, 60.80, -166.96])


def tip() -> KnownTip:
    """Two modes, 922 Hz along X and 1300 Hz along Y."""
    return KnownTip(TipModes.of({axis: mode(axis, hz, kg) for axis, hz, kg in ((Dof.X, 922.0, 0.5), (Dof.Y, 1300.0, 0.4))}))


def mode(axis: Dof, hz: float, mass: float) -> ModalModel:
    return normal_modes([2.0 * np.pi * hz], [0.03], [[mass**-0.5]], (Coordinate("tip", axis),))


def question(rpm: float, engagement: Engagement | None = None) -> ToolChange:
    cut = CutSpec(engagement or Engagement(0.0, np.pi), 0.0, FEED, coefficients={"tangential": 8e8, "radial_ratio": 0.3})
    return ToolChange(tip(), TOOL, cut, np.array([rpm * 2.0 * np.pi / 60.0]), 0.02, FullDiscretisation(), 0)


def straight(change: ToolChange, depth: float, sides: tuple[float, float]) -> PathMilling:
    speed = float(change.speeds[0])
    path = ToolPath(np.array([[-0.006, 0.0, -depth], [0.04, 0.0, -depth]]), feed=np.full(2, FEED * 3.0 * speed / (2.0 * np.pi)))
    field = field_of(TOOL, (np.array([0.0, sides[0], -0.03]), np.array([0.04, sides[1], 0.0])), cell=0.5e-3)
    return mill_path(change, path, field)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rpm", "engagement", "sides"),
    [
        (5000.0, Engagement(0.0, np.pi), (-0.02, 0.02)),
        (11000.0, Engagement(0.0, np.pi), (-0.02, 0.02)),
        (8000.0, Engagement.from_immersion(0.3, "up"), (0.002, 0.02)),
        (15000.0, Engagement.from_immersion(0.5, "down"), (-0.02, 0.0)),
    ],
)
def test_chatter_begins_where_full_discretisation_has_its_limit(rpm: float, engagement: Engagement, sides: tuple[float, float]) -> None:
    """Two routes that share the modes alone: a period map of delays, and a tool that takes away its material."""
    change = question(rpm, engagement)
    limit = float(change.limits().limit_depth[0])
    below, above = (straight(change, share * limit, sides) for share in (0.9, 1.15))
    assert below.status == "stable"
    assert above.status == "chatter"
    inner = slice(above.time.size // 5, -above.time.size // 5)
    assert np.median(above.beside_turns[inner]) > 50.0 * np.median(below.beside_turns[inner])


def test_what_is_told() -> None:
    change = question(11000.0)
    found = straight(change, 0.001, (-0.02, 0.02))
    told = found.described(ToolPath(np.zeros((2, 3))))
    assert "no move chatters" in told
    assert "ISO 16610-21 of 0.8 mm" in told
    # a slot leaves two walls; teeth that come in cut too much there by the same that those that leave leave too little
    assert found.form_error is not None
    assert found.roughness is not None
    assert 0.0 < found.roughness.mean < 1e-6
    sides = np.sign(found.surface[:, 1])
    assert set(sides) == {-1.0, 1.0}
    assert np.abs(found.surface[:, 1]).max() == pytest.approx(0.005, abs=2e-5)
    nothing = mill_path(
        change,
        ToolPath(np.array([[0.0, 0.1, 0.0], [0.01, 0.1, 0.0]]), feed=np.full(2, 0.01)),
        field_of(TOOL, (np.zeros(3), np.full(3, 0.01))),
    )
    assert nothing.status == "no cut"
    assert nothing.described(ToolPath(np.zeros((2, 3)))).startswith("nothing is cut")


def test_a_path_without_speeds_and_a_question_without_one_is_refused() -> None:
    change = replace(question(5000.0), speeds=np.zeros(0))
    with pytest.raises(InputError, match="spindle speed"):
        mill_path(
            change,
            ToolPath(np.array([[-0.006, 0, -0.001], [0.02, 0, -0.001]]), feed=np.full(2, 0.01)),
            field_of(TOOL, (np.array([0, -0.01, -0.01]), np.array([0.02, 0.01, 0]))),
        )


def slot(change: ToolChange, places: list[list[float]], low: list[float], **told: np.ndarray) -> PathMilling:
    speed = float(change.speeds[0])
    path = ToolPath(np.array(places), **({"feed": np.full(len(places), FEED * 3.0 * speed / (2.0 * np.pi))} | told))
    return mill_path(change, path, field_of(TOOL, (np.array(low), np.array([0.04, 0.02, 0.0])), cell=0.5e-3))


@pytest.mark.slow
def test_lines_of_a_millimetre_chatter_as_one_of_forty_does() -> None:
    change = question(5000.0)
    depth = 1.6 * float(change.limits().limit_depth[0])
    x = np.concatenate([[-0.006], np.arange(0.0, 0.0405, 0.001)])
    places = np.column_stack([x, np.zeros_like(x), np.full_like(x, -depth)]).tolist()
    found = slot(change, places, [0.0, -0.02, -0.03], line=np.arange(1, x.size + 1))
    assert found.status == "chatter"
    assert len(found.chattering) > 10


def test_a_thin_layer_deep_in_the_stock_pushes_as_one_on_top() -> None:
    """Under 20 mm that are cleared: slices lie where there is material."""
    change, depth = question(8000.0), 0.0005
    top = slot(change, [[-0.006, 0.0, -depth], [0.04, 0.0, -depth]], [0.0, -0.02, -0.03])
    passes = [
        [-0.006, 0.0, -0.02],
        [0.046, 0.0, -0.02],
        [0.046, 0.0, 0.01],
        [-0.006, 0.0, 0.01],
        [-0.006, 0.0, -0.02 - depth],
        [0.04, 0.0, -0.02 - depth],
    ]
    feed = np.full(6, FEED * 3.0 * float(change.speeds[0]) / (2.0 * np.pi))
    feed[[1, 2, 3, 4]] = np.inf
    deep = slot(change, passes, [0.0, -0.02, -0.03], feed=feed)
    near = [(found.places[:, 0] > 0.01) & (found.places[:, 0] < 0.03) & (found.peak_force > 0.0) for found in (top, deep)]
    one, two = (found.mean_force[own].mean(axis=0) for found, own in zip((top, deep), near, strict=True))
    assert two == pytest.approx(one, rel=0.01, abs=1e-3)


@pytest.mark.slow
def test_fast_modes_get_as_many_instants_as_they_need() -> None:
    """4 kHz at 1500 rev/min are 160 periods a turn: at 360 instants a turn nothing of them would be seen."""
    modes = {axis: mode(axis, hz, kg) for axis, hz, kg in ((Dof.X, 4000.0, 0.0317), (Dof.Y, 4100.0, 0.0317))}
    change = replace(question(1500.0), machine=KnownTip(TipModes.of(modes)))
    depth = 2.5 * float(change.limits().limit_depth[0])
    assert slot(change, [[-0.006, 0.0, -depth], [0.008, 0.0, -depth]], [0.0, -0.02, -0.03]).status == "chatter"


def test_what_is_not_simulated_is_told() -> None:
    change = question(8000.0)
    ramp = slot(change, [[-0.006, 0.0, 0.0], [0.02, 0.0, -0.001], [0.04, 0.0, -0.001]], [0.0, -0.02, -0.03], line=np.array([1, 2, 3]))
    assert any("climb" in each and "lines 2" in each for each in ramp.warnings)
    # what a correction of micrometres lifts is level
    lifted = slot(change, [[-0.006, 0.0, -0.001], [0.04, 0.0, -0.00099]], [0.0, -0.02, -0.03])
    assert lifted.status == "stable"
    assert lifted.warnings == ()
    other = slot(change, [[-0.006, 0.0, -0.001], [0.02, 0.0, -0.001], [0.04, 0.0, -0.001]], [0.0, -0.02, -0.03], tool=np.array([1, 1, 2]))
    assert any("tools 1, 2" in each for each in other.warnings)
    with pytest.raises(InputError, match="the spindle stands"):
        slot(change, [[-0.006, 0.0, -0.001], [0.02, 0.0, -0.001]], [0.0, -0.02, -0.03], speed=np.zeros(2))


def test_walls_that_a_later_pass_takes_away_are_not_told_and_forces_end_with_their_cut() -> None:
    change = question(8000.0)
    feed = np.full(6, FEED * 3.0 * float(change.speeds[0]) / (2.0 * np.pi))
    feed[[2, 3]] = np.inf
    places = [
        [-0.006, 0.0, -0.001],
        [0.046, 0.0, -0.001],
        [0.046, 0.0, 0.01],
        [-0.006, 0.003, 0.01],
        [-0.006, 0.003, -0.001],
        [0.046, 0.003, -0.001],
    ]
    found = slot(change, places, [0.0, -0.02, -0.03], feed=feed)
    assert set(found.surface[:, 1].round(3)) == {-0.005, 0.008}
    # the way back in the air has no force, whoever draws lines between rows
    back = float(
        np.interp(0.5 * (0.052 / feed[0] + 0.052 / feed[0] + 0.011 / feed[0]), found.time, np.linalg.norm(found.mean_force, axis=1))
    )
    assert back == 0.0
    assert np.all(np.diff(found.time) >= 0.0)


@pytest.mark.parametrize("degrees", [0.0, 90.0, 180.0, 270.0])
def test_an_arm_at_rest_is_on_its_path_whichever_way_it_goes(degrees: float) -> None:
    machine, tooling = robot(), sample_tooling("S2-PG25")
    change = ToolChange(machine, tooling, question(18000.0).cut, np.array([1885.0]), 0.02, draws=0)
    stations = stations_along(machine, tooling, ToolPath(np.array([[0.75, 0.1847, 0.1554], [0.76, 0.1847, 0.1554]])))
    carrier = carriers_of(change, lambda move: stations(move).machine, np.array([1885.0]))(0, PathFrame(np.zeros(2), np.radians(degrees)))
    assert np.linalg.norm(carrier.zero) > 1e-4
    assert carrier.sag - carrier.zero == pytest.approx(np.zeros(3), abs=1e-12)


def robot() -> PosedRobot:
    return PosedRobot(FlexibleRobot(read_robot(ROOT / "data" / "robots" / "tx200.toml")), POSTURE)


def test_a_robot_with_play_is_softer_where_it_is_loose_and_the_same_beyond() -> None:
    """At rest under a force that presses every joint to one side the arm by freedoms and modes is the coupled arm, plays added."""
    machine, tooling = robot(), sample_tooling("S2-PG25")
    change = ToolChange(machine, tooling, question(18000.0).cut, np.array([1885.0]), 0.02, draws=0)
    path = ToolPath(np.array([[0.75, 0.1847, 0.1554], [0.83, 0.1847, 0.1554]]))
    stations = stations_along(machine, tooling, path)
    frame = PathFrame(np.zeros(2), 0.0)
    tight, loose = (carriers_of(change, lambda move: stations(move).machine, np.array([1885.0]), play)(0, frame) for play in (False, True))
    assert tight.stiffness.size == 0
    assert loose.stiffness.size == 18
    assert np.count_nonzero(loose.play) == 6
    # compliance at rest of both, without their play
    still = np.array([2.0 * np.pi * 0.5])
    modes = loose.modes.response(still)[0] + loose.poles.response(still)[0]  # type: ignore[union-attr]
    assert modes == pytest.approx(tight.modes.response(still)[0], rel=1e-6, abs=1e-12)  # type: ignore[union-attr]
    # the base's x and y, whichever way the tool's own look
    arm = machine.robot.model
    assert stations(0).feed_angle == pytest.approx(0.0, abs=1e-9)
    assert arm.name


def test_a_robot_mills_with_its_play() -> None:
    machine, tooling = robot(), sample_tooling("S2-PG25")
    change = ToolChange(machine, tooling, question(18000.0).cut, np.array([18000.0 * 2.0 * np.pi / 60.0]), 0.02, draws=0)
    path = ToolPath(np.array([[0.775, 0.1847, 0.1554], [0.795, 0.1847, 0.1554]]), feed=np.full(2, 0.05))
    block = np.array([0.785, 0.15, 0.14]), np.array([0.82, 0.182, 0.1559])
    tight, loose, held = (
        mill_path(change, path, field_of(tooling, block, cell=0.5e-3), play=play, weight=weight)
        for play, weight in ((False, False), (True, False), (True, True))
    )
    late = slice(-21, -1)
    assert np.abs(loose.mean_tip[late]).max() > 2.0 * np.abs(tight.mean_tip[late]).max()
    # the arm's weight takes up the play of joints that it loads, and its own sag is no error
    assert np.abs(held.mean_tip[:4]).max() < 1e-9
    off = [float(np.mean(each.mean_tip[late, 1])) for each in (tight, loose, held)]
    assert off[0] < off[2] < 0.9 * off[1]
    assert tight.places[:, 2] == pytest.approx(0.1554)
    assert not tight.lost
