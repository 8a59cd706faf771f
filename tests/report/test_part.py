"""The picture of a part that was cut."""

import numpy as np
from matplotlib.figure import Figure

from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.report.part import part_figure, save_part
from rcsa_ident.toolpath.dexel import DexelField
from rcsa_ident.toolpath.path import ToolPath
from rcsa_ident.toolpath.removal import Sweep
from rcsa_ident.toolpath.solid import ToolSolid


def slotted():
    field = DexelField.block([0.0, 0.0, 0.0], [0.03, 0.02, 0.01], 0.5e-3)
    path = ToolPath(np.array([[-0.01, 0.01, 0.006], [0.04, 0.01, 0.006]]))
    Sweep(field, ToolSolid.of(Cutter(2, 0.008)), path).run()
    return field, path


def test_sizes_and_heights_are_in_millimetres():
    field, path = slotted()
    figure = part_figure(field, path)
    assert isinstance(figure, Figure)
    left, right = figure.axes[:2]
    assert [text.get_text() for text in left.texts] == ["x 30 mm", "y 20 mm", "z 10 mm"]
    heights = right.images[0].get_array()
    assert heights.shape == (40, 60)
    assert np.unique(np.round(heights, 9)).tolist() == [6.0, 10.0]
    assert right.get_xlabel() == "x, mm"
    # the part covers a good share of its own view, and the slot's floor is as bright as its top
    image = left.images[0].get_array()
    assert 0.3 < np.mean(image[..., 3] > 0.0) < 0.9


def test_what_is_all_cut_away_is_drawn_empty(tmp_path):
    field, path = slotted()
    for count in field.counts:
        count[:] = 0
    save_part(tmp_path / "part.svg", field, path)
    assert "<svg" in (tmp_path / "part.svg").read_text()
