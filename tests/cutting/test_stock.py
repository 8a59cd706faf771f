"""What an immersion, a block and a stepover are to a cylinder and to a shape, and cuts that no cutter can make."""

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.conditions import Block, Engagement, EngagementMap, Stepover
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.profile import Profile
from rcsa_ident.cutting.rows import rows_of
from rcsa_ident.cutting.stock import Immersion, check_cut, engagement_between, engagement_with

CYLINDER = Cutter(4, 0.012)
#: The same cylinder, written as an outline.
DRAWN = Cutter(4, 0.012, profile=Profile.flat(0.012, 0.03))
BALL = Cutter(2, 0.012, profile=Profile.ball(0.012))


@pytest.mark.parametrize(
    "asked",
    [Immersion(0.3, "up"), Immersion(0.3, "down"), Immersion(1.0, "up"), Block(-0.002, 0.004), Block(-1.0, 0.002), Stepover(0.003, "down")],
)
def test_a_cylinder_and_its_outline_are_engaged_alike(asked):
    """The fast way of a cylinder is the general one where nothing changes along the edge."""
    plain = engagement_with(asked, CYLINDER)
    assert isinstance(plain, Engagement)
    rows = rows_of(DRAWN, engagement_with(asked, DRAWN), 0.002)
    np.testing.assert_allclose(rows.start, plain.entry, atol=1e-12)
    np.testing.assert_allclose(rows.end, plain.exit, atol=1e-12)


def test_an_immersion_of_a_shape_is_a_stepover_at_its_diameter():
    assert engagement_with(Immersion(0.25, "up"), BALL) == Stepover(0.003, "up")
    assert engagement_with(Immersion(1.0, "up"), BALL) == Engagement(0.0, np.pi)
    assert engagement_with(Block(-0.002, 0.001), BALL) == Block(-0.002, 0.001)


def test_angles_of_up_and_down_milling_are_a_stepover_of_a_shape():
    half = engagement_between(0.5 * np.pi, np.pi, BALL)
    assert (half.width, half.strategy) == (pytest.approx(0.006), "down")
    assert engagement_between(0.0, np.arccos(0.5), BALL).width == pytest.approx(0.003)
    for entry, leave in ((0.0, np.pi), (0.3, 2.0)):
        assert engagement_between(entry, leave, BALL) == Engagement(entry, leave)
    assert engagement_between(0.5 * np.pi, np.pi, CYLINDER) == Engagement(0.5 * np.pi, np.pi)


@pytest.mark.parametrize("cutter", [CYLINDER, BALL])
@pytest.mark.parametrize("block", [Block(0.006, 0.010), Block(-0.02, -0.006)])
def test_a_block_out_of_reach_is_refused(cutter, block):
    with pytest.raises(InputError, match="a block that the cutter reaches, with a radius of 6 mm"):
        engagement_with(block, cutter)


@pytest.mark.parametrize(
    ("cutter", "engagement", "depth", "words"),
    [
        (Cutter(2, 0.012, profile=Profile.chamfer(0.012, 0.002, 0.25 * np.pi)), Block(-0.006, 0.006), 0.006, "at most 5 mm, where the"),
        (Cutter(2, 0.012, helix=np.radians([10.0, 60.0])), Engagement(0.0, np.pi), 0.02, "teeth 1 and 2 that meet"),
        (BALL, Block(0.005, 0.010), 0.001, "a cut in which some tooth cuts"),
        (BALL, EngagementMap([0.004, 0.005], [0.0, 0.0], [1.0, 1.0]), 0.003, "a cut in which some tooth cuts"),
    ],
)
def test_cuts_that_no_cutter_can_make(cutter, engagement, depth, words):
    with pytest.raises(InputError) as error:
        check_cut(cutter, engagement, depth, 1e-4)
    assert words in str(error.value)


def test_impossible_immersions_are_refused():
    for share, strategy in ((0.0, "up"), (1.1, "down"), (0.5, "climb")):
        with pytest.raises(InputError):
            Immersion(share, strategy)
