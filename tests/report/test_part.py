"""The picture of a part that was cut."""

import numpy as np
from matplotlib.figure import Figure

from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.report import part
from rcsa_ident.report.part import coloured_part_figure, part_figure, save_part
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


def test_moves_have_the_colours_of_their_values(monkeypatch):
    """A zigzag, one of whose moves chatters: of many, neighbours have the colour of the worst, and rapid moves are gaps."""
    field, _ = slotted()
    count = 40
    places = np.stack([np.linspace(0.0, 0.03, count + 1), np.tile([0.009, 0.011], 21)[: count + 1], np.full(count + 1, 0.006)], axis=1)
    feed = np.full(count + 1, 0.01)
    feed[16] = np.inf
    values = np.full(count, 1.8)
    values[[15, 30]], values[7] = np.nan, 0.1
    figure = coloured_part_figure(field, ToolPath(places, feed=feed), values, "margin", (0.0, 2.0), 0.004)
    image, (lines,) = figure.axes[0].images[0].get_array(), figure.axes[1].collections
    assert len(lines.get_segments()) == count - 1
    widths = np.array(lines.get_linewidths())
    assert np.flatnonzero(widths == 1.0).tolist() == [29]
    red = np.flatnonzero(lines.get_colors()[:, 0] > 2.0 * lines.get_colors()[:, 1])
    assert red.tolist() == [7]
    # the floor where that move passed last is red, too, and there is green beside it
    assert np.any(image[..., 0] > 1.5 * image[..., 1])
    assert np.any(image[..., 1] > 1.5 * image[..., 0])
    low, high = figure.axes[1].get_xlim()
    assert low < 0.0 < 30.0 < high < 40.0
    monkeypatch.setattr(part, "_DRAWN", 4)
    (few,) = coloured_part_figure(field, ToolPath(places, feed=feed), values, "margin", (0.0, 2.0), 0.004).axes[1].collections
    assert [len(each) for each in few.get_segments()] == [11, 12, 11, 10]
    assert np.flatnonzero(few.get_colors()[:, 0] > 2.0 * few.get_colors()[:, 1]).tolist() == [0]
    assert np.all(np.array(few.get_linewidths()) == 2.5)


def test_a_part_without_values_is_grey():
    field, path = slotted()
    figure = coloured_part_figure(field, path, np.array([np.nan]), "form error")
    image = figure.axes[0].images[0].get_array()
    shown = image[image[..., 3] > 0.0][:, :3]
    assert np.all(shown[:, 2] >= shown[:, 0])
    (lines,) = figure.axes[1].collections
    assert lines.get_linewidths() == [1.0]
