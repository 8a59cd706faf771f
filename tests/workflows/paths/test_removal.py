"""A tooling along a path through stock: what is taken out, and what is said of paths that cannot be meant."""

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.profile import Profile
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.tool_holder.geometry import MATERIALS, BeamSegment, ToolAssembly
from rcsa_ident.toolpath.dexel import Surface
from rcsa_ident.toolpath.path import RAPID, ToolPath
from rcsa_ident.workflows.paths.removal import default_cell, field_of, remove_along
from tests.toolpath.test_surface_kernels import box

LOW, HIGH = np.zeros(3), np.array([0.04, 0.03, 0.02])


def tooling(profile=None, stickout=0.03):
    carbide, steel = MATERIALS["carbide"], MATERIALS["steel"]
    tool = (BeamSegment(stickout + 0.03, 0.01, carbide),)
    return Tooling("T1", Cutter(2, 0.01, profile=profile), ToolAssembly(tool, (BeamSegment(0.06, 0.04, steel, inner_diameter=0.01),), 0.03))


def removal(tool, path, block=None, surface=None, cell=None, step=None):
    return remove_along(tool, path, field_of(tool, block, surface, cell), step)


def slot(z=0.018, **told):
    return ToolPath(np.array([[-0.006, 0.015, z], [0.046, 0.015, z]]), **told)


def test_a_slot_through_a_block_and_through_its_surface():
    found = removal(tooling(), slot(feed=[np.nan, 0.01]), (LOW, HIGH), step=1e-3)
    assert found.removed == pytest.approx(0.04 * 0.01 * 2e-3, rel=1e-3)
    assert found.engagement.volume.sum() == pytest.approx(found.removed)
    assert found.arc_volume.sum() == pytest.approx(found.removed, rel=1e-6)
    assert len(found.path) == 53
    assert found.part.cell.max() == pytest.approx(0.25e-3)
    assert found.warnings == ()
    other = removal(tooling(), slot(), surface=Surface(*box(LOW, HIGH)), step=1e-3)
    assert other.removed == pytest.approx(found.removed, rel=1e-9)


def test_rapid_moves_through_material_are_told_by_their_lines():
    path = ToolPath(
        np.array([[-0.01, 0.015, 0.03], [0.05, 0.015, 0.03], [0.05, 0.015, 0.015], [-0.01, 0.015, 0.015]]),
        feed=[RAPID, RAPID, 0.01, RAPID],
        line=[1, 2, 3, 4],
    )
    found = removal(tooling(), path, (LOW, HIGH), step=1e-3)
    assert [text.split(":")[0] for text in found.warnings] == ["RAPID MOVE THROUGH MATERIAL at line 4"]


def test_shank_and_holder_in_material_are_told():
    short = Profile.ball(0.01, length=0.006)
    deep = removal(tooling(short), slot(0.01, line=[1, 7]), (LOW, HIGH), step=1e-3)
    assert [text.split(" from")[0] for text in deep.warnings] == ["COLLISION: the shank above the edges stands in material"]
    assert deep.warnings[0].endswith("line 7")
    low = removal(tooling(stickout=0.012), slot(0.006), (LOW, HIGH), step=1e-3)
    assert [text.split(" from")[0] for text in low.warnings] == ["COLLISION: the holder stands in material"]
    leaning = ToolPath(slot(0.006).places, axes=np.tile([0.0, 0.3, 1.0], (2, 1)))
    found = removal(tooling(stickout=0.012), leaning, (LOW, HIGH), cell=1e-3, step=4e-3)
    assert any(text.startswith("COLLISION: the holder") for text in found.warnings)


def test_paths_that_miss_are_told_and_far_ones_refused():
    above = removal(tooling(), slot(0.021), (LOW, HIGH))
    assert above.removed == 0.0
    assert above.warnings == ("the path never meets the stock: the tool stays 1 mm or more away from it",)
    with pytest.raises(InputError, match="millimetres"):
        removal(tooling(), ToolPath(1e3 * slot().places), (LOW, HIGH))
    small = removal(tooling(), slot(0.0), (LOW, 0.2 * HIGH), cell=1e-3)
    assert any("is larger than the stock" in text for text in small.warnings)


def test_cells_and_steps_that_fit_no_memory_are_refused():
    with pytest.raises(InputError, match="GB"):
        removal(tooling(), slot(), (LOW, HIGH), cell=5e-7)
    with pytest.raises(InputError, match="places"):
        removal(tooling(), slot(), (LOW, HIGH), step=1e-9)
    with pytest.raises(InputError, match="a block or a surface"):
        removal(tooling(), slot())
    assert default_cell(0.005, HIGH) == 0.25e-3


def test_a_coarse_cell_is_told():
    found = removal(tooling(), slot(), (LOW, HIGH), cell=1e-3, step=2e-3)
    assert any("less exact angles" in text for text in found.warnings)
    assert found.removed == pytest.approx(0.04 * 0.01 * 2e-3, rel=2e-2)
