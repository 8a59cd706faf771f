"""Every noun says in a line or two what it is, shows itself in a notebook, and is drawn and saved where it can be."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from html.entities import html5

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import rcsa_ident as ri
from rcsa_ident.base.shown import Drawn, Shown

LINES = {
    "campaign": "by hand: 3 cuts with T1, 9549 to 9549 rev/min, EN AW-6082",
    "cut": "T1-0: T1, 9549 rev/min, depth 0.4 mm, 0.1 mm per tooth, 90° to 180°, feed +X, no air cut",
    "tooling": "T1: 4 teeth, Ø12 mm, stickout 60 mm, insertion 40 mm, holder 60 mm",
    "identification": "suspect, 2 cuts, X 2 modes, Y 2 modes",
    "machine": "by hand: X 2 modes, Y 2 modes, 600 to 3000 Hz, suspect",
    "flange": "tapped: X, 100 to 3000 Hz",
    "modes": "tip: 1 mode at 900 Hz",
    "tip": "tip.x, tip.y: 2901 frequencies, 100 to 3000 Hz, with its spread",
    "spec": "50 % immersion, down milling, feed +X, 0.1 mm per tooth",
    "process": "4 teeth, Ø12 mm; K_tc 902 MPa, k_rc 0.26, K_re 5 N/mm; 90° to 180°, feed +X, 0.1 mm per tooth",
    "recording": "0.2 s at 25600 Hz: flange_x, flange_y, fixture_x, fixture_y",
    "reading": "T1-0: usable, 0 lines",
    "estimate": "X 35.3 N rms (± 2 N), Y 35.4 N rms (± 2 N) over 0.0781 s",
}
DRAWN = ("result", "read", "machine", "flange", "tip", "coupled", "lobes", "advice", "no_feed", "chart", "surface", "recording", "forces")


def every(nouns):
    further = [*nouns.advice.recommended, *nouns.advice.windows, *nouns.advice.planned, nouns.advice.usable, nouns.process.cutter]
    further += [
        nouns.process.coefficients,
        nouns.campaign.workpiece,
        nouns.tooling.assembly,
        ri.SpindleDrive.flat(10e3),
        *nouns.read.modes.values(),
    ]
    further += [ri.ProcessDamping(1e14, 1e-4), ri.SpeedVariation(0.1, 0.2), nouns.cut.conditions, nouns.reading.verdict]
    return [noun for noun in vars(nouns).values() if isinstance(noun, Shown)] + further


@pytest.mark.parametrize("name", LINES)
def test_what_a_noun_says(nouns, name):
    noun = getattr(nouns, name)
    assert str(noun).splitlines()[0] == LINES[name]
    assert repr(noun) == f"<{type(noun).__name__} {noun}>"


def test_every_line_is_short(nouns):
    for noun in every(nouns):
        assert 1 <= len(repr(noun).splitlines()) <= 2
        assert len(repr(noun)) < 300, repr(noun)
        assert "array(" not in repr(noun)


def test_a_pocket_is_a_sentence(nouns):
    pocket = nouns.pocket
    rpm, limit, recommended = ri.rpm(1.0), 1e3 * pocket.limit_depth, 1e3 * pocket.recommended_depth
    assert str(pocket) == f"{pocket.spindle_speed / rpm:.0f} rev/min: stability limit {limit:.2f} mm, recommended {recommended:.2f} mm"
    assert str(type(pocket)(100.0, np.inf, 4.5e-3)) == "955 rev/min: no stability limit in the depths asked for, recommended 4.50 mm"


def test_what_speaks_against_a_result_is_its_second_line(nouns):
    assert str(nouns.read).splitlines()[1] == nouns.read.reasons[0]


@pytest.mark.slow
def test_html_is_well_formed_and_has_no_script(nouns):
    for noun in every(nouns):
        page = noun._repr_html_()
        for name in ("nbsp;",):
            page = page.replace(f"&{name}", html5[name])
        tags = {element.tag.rpartition("}")[2] for element in ET.fromstring(page).iter()}
        assert "script" not in tags
        assert ("svg" in tags) == ((isinstance(noun, Drawn) and noun is not nouns.read) or noun is nouns.tooling), type(noun)
        assert "http" not in page.replace("http://www.w3.org", "")


def test_pictures_of_one_page_do_not_share_names(nouns):
    first, second = (set(ids(nouns.lobes._repr_html_())) for _ in range(2))
    assert first
    assert not first & second


def ids(page: str) -> list[str]:
    return [element.attrib["id"] for element in ET.fromstring(page).iter() if "id" in element.attrib]


def test_names_in_html_are_escaped(nouns):
    from dataclasses import replace

    assert "<b>x</b>" not in replace(nouns.tooling, name="<b>x</b>")._repr_html_()


def test_a_results_modes_are_a_table(nouns):
    page = nouns.read._repr_html_()
    assert "X: f_n [Hz]" in page
    assert nouns.read.reasons[0] in page


@pytest.mark.parametrize("name", DRAWN)
def test_plot_returns_axes_with_units(nouns, name):
    drawn = np.atleast_1d(getattr(nouns, name).plot())
    assert all(isinstance(ax, Axes) for ax in drawn)
    assert isinstance(drawn[0].figure, Figure)
    for label in {ax.get_ylabel() for ax in drawn} | {ax.get_xlabel() for ax in drawn}:
        assert not label or "[" in label


def test_options_of_a_figure(nouns):
    assert nouns.result.plot(axis="Y")[0].get_title(loc="left") == "Y: T1"
    with pytest.raises(ri.InputError, match="axis"):
        nouns.result.plot(axis="z")
    assert "[rad/(N m)]" in nouns.coupled.plot(slopes=True)[0].get_ylabel()
    assert "1 revolutions" in nouns.forces.plot(revolutions=1.0)[0].get_title(loc="left")
    assert nouns.recording.plot(seconds=0.01, start=0.0)[0].get_lines()[0].get_xdata()[-1] <= 0.01


def test_nouns_without_a_figure_have_no_plot(nouns):
    assert not any(hasattr(noun, "plot") for noun in (nouns.campaign, nouns.pocket, nouns.process, nouns.tooling))


@pytest.mark.parametrize("suffix", [".svg", ".png"])
def test_what_is_drawn_is_saved_as_a_picture(nouns, tmp_path, suffix):
    path = nouns.lobes.save(tmp_path / f"lobes{suffix}")
    assert path.read_bytes()[:4] in (b"<?xm", b"\x89PNG")


def test_a_suffix_that_nobody_writes(nouns, tmp_path):
    with pytest.raises(ri.InputError, match=r"suffix '\.xlsx', allowed is a file that ends in one of \.csv, \.svg, \.png"):
        nouns.lobes.save(tmp_path / "lobes.xlsx")
    with pytest.raises(ri.InputError, match=r"one of \.svg, \.png"):
        nouns.coupled.save(tmp_path / "coupled.csv")
