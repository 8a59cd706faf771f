"""How nouns are drawn, saved and shown in a notebook: the door behind `rcsa_ident.base.shown`.

Each of the four questions is one function of the noun's type: a further noun is a few lines here, and nothing where it stands.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial, singledispatch
from html import escape
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.shown import Drawn, Shown
from rcsa_ident.base.units import from_hz, to_cm3_per_min, to_rpm
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.dynamics.uncertain import UncertainReceptance
from rcsa_ident.front.identified import Result, RobotResult
from rcsa_ident.io.curves.exports import write_tap
from rcsa_ident.io.curves.flanges import write_flange_machine
from rcsa_ident.io.curves.forces import write_forces
from rcsa_ident.io.curves.lobes import write_advice, write_lobes, write_map
from rcsa_ident.io.curves.tips import write_tip_csv
from rcsa_ident.io.files import write_text
from rcsa_ident.io.recordings.readers import write_recording
from rcsa_ident.io.results.parts import layout, plain, write_result
from rcsa_ident.io.settings.modes import write_modes
from rcsa_ident.io.settings.toolings import write_tooling
from rcsa_ident.machine.flange_machine import FlangeMachine
from rcsa_ident.machine.known_tip import KnownTip
from rcsa_ident.machine.machine import Machine
from rcsa_ident.observer.force import ForceEstimate
from rcsa_ident.report import figures
from rcsa_ident.report.advice import advice_figure
from rcsa_ident.report.curves import is_tip, receptance_figure, recording_figure, tip_figure
from rcsa_ident.report.drawing import tooling_svg
from rcsa_ident.report.forces import force_history
from rcsa_ident.report.html import report_html
from rcsa_ident.report.listening import listening_figure
from rcsa_ident.report.lobes import map_figure, save_figure, stability_figure, surface_figure
from rcsa_ident.report.style import svg
from rcsa_ident.report.summaries import drawing_rows, mode_rows, two_digits
from rcsa_ident.report.tap import tap_figure
from rcsa_ident.setup.campaign import Campaign
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.signals.listening import Listening
from rcsa_ident.signals.recording import Recording
from rcsa_ident.signals.tap import TapFrf
from rcsa_ident.stability.advice import Advice
from rcsa_ident.stability.result import StabilityLobes
from rcsa_ident.stability.stability_map import StabilityMap
from rcsa_ident.stability.surface_error import SurfaceError
from rcsa_ident.stability.tip_modes import TipModes
from rcsa_ident.workflows.estimate_forces import MonitoredCut

Writer = Callable[[Path], object]
#: Frequencies of a machine's figure: a picture needs no more.
_LINES = 400
# pictures of one page need names of their own
_NUMBER = count(1)


def plot(noun: Drawn, **options: Any) -> Any:
    """Return the axes of a noun's figure: one, or an array of them."""
    axes = figure_of(noun, **options).axes
    return axes[0] if len(axes) == 1 else np.array(axes)


def save(noun: Shown, path: Path) -> Path:
    """Write a noun to a file whose suffix says how; where it has a figure, also as a picture."""
    writers = formats(noun)
    if isinstance(noun, Drawn):
        writers = writers | {suffix: partial(_picture, noun) for suffix in (".svg", ".png") if suffix not in writers}
    if path.suffix.lower() not in writers:
        raise InputError("path", f"suffix '{path.suffix}'", "a file that ends in one of " + ", ".join(writers), str(path))
    writers[path.suffix.lower()](path)
    return path


def _picture(noun: Drawn, path: Path) -> None:
    save_figure(figure_of(noun), str(path))


# -- figures ---------------------------------------------------------------------------------------------------------------------


@singledispatch
def figure_of(noun: Any, **options: Any) -> Figure:
    """Return the figure of a noun; the options are those of the function in `rcsa_ident.report` that draws it."""
    raise InputError("plot", type(noun).__name__, "a noun that has a figure")


figure_of.register(StabilityLobes, stability_figure)
figure_of.register(StabilityMap, map_figure)
figure_of.register(SurfaceError, surface_figure)
figure_of.register(Recording, recording_figure)
figure_of.register(Listening, listening_figure)
figure_of.register(TapFrf, tap_figure)


@figure_of.register
def _(advice: Advice) -> Figure:
    return advice_figure([advice])


@figure_of.register
def _(receptance: Receptance, **options: Any) -> Figure:
    return tip_figure(receptance, **options) if is_tip(receptance) else receptance_figure(receptance, **options)


@figure_of.register
def _(machine: Machine, **options: Any) -> Figure:
    low, high = machine.band or (from_hz(100.0), from_hz(5000.0))
    return receptance_figure(machine.receptance(np.linspace(low, high, _LINES)), **options)


@figure_of.register
def _(cut: MonitoredCut, **options: Any) -> Figure:
    return force_history(cut.estimate, cut.spindle_speed, **options)


@figure_of.register
def _(result: Result, axis: str | None = None) -> Figure:
    found, campaign = result.identification, result.campaign
    if found is None or campaign is None or not found.axes:
        return figure_of(result.machine)
    chosen = next(iter(found.axes)) if axis is None else Dof(axis.lower())
    if chosen not in found.axes:
        raise InputError("axis", chosen, f"one of {', '.join(found.axes)}")
    if not found.cut_ids:
        return figures.hammer_tests(found.axes[chosen].tests, chosen.upper())
    tooling = {cut.id: cut.tooling for cut in campaign.cuts}
    return figures.cross_frf(found.axes[chosen], [tooling[cut] for cut in found.cut_ids], chosen.upper())


# -- files -----------------------------------------------------------------------------------------------------------------------


@singledispatch
def formats(noun: Any) -> dict[str, Writer]:
    """Return what writes a noun, by the suffix of the file."""
    return {}


@formats.register
def _(lobes: StabilityLobes) -> dict[str, Writer]:
    return {".csv": partial(write_lobes, lobes=lobes)}


@formats.register
def _(chart: StabilityMap) -> dict[str, Writer]:
    return {".csv": partial(write_map, chart=chart)}


@formats.register
def _(advice: Advice) -> dict[str, Writer]:
    return {".csv": partial(write_advice, answers=[advice])}


@formats.register
def _(tip: Receptance) -> dict[str, Writer]:
    if not is_tip(tip):
        return {}
    uncertain = tip if isinstance(tip, UncertainReceptance) else UncertainReceptance(tip.omega, tip.values, tip.rows, tip.cols)
    return {".csv": partial(write_tip_csv, tip=uncertain)}


@formats.register
def _(tip: TipModes) -> dict[str, Writer]:
    return {".toml": partial(write_modes, tip=tip)}


@formats.register
def _(machine: FlangeMachine) -> dict[str, Writer]:
    return {".csv": partial(write_flange_machine, machine=machine)}


@formats.register
def _(tooling: Tooling) -> dict[str, Writer]:
    return {".toml": partial(write_tooling, tooling=tooling), ".svg": lambda path: write_text(path, tooling_svg(tooling))}


@formats.register
def _(recording: Recording) -> dict[str, Writer]:
    return {suffix: partial(write_recording, recording=recording) for suffix in (".h5", ".hdf5")}


@formats.register
def _(found: TapFrf) -> dict[str, Writer]:
    return {suffix: partial(write_tap, found=found) for suffix in (".csv", ".uff", ".frf")}


@formats.register
def _(estimate: ForceEstimate) -> dict[str, Writer]:
    return {".csv": partial(write_forces, estimate=estimate)}


@formats.register
def _(cut: MonitoredCut) -> dict[str, Writer]:
    return formats(cut.estimate)


@formats.register
def _(result: Result) -> dict[str, Writer]:
    found: dict[str, Writer] = {".json": partial(write_result, identification=result.data)}
    if result.identification is not None and result.campaign is not None:
        found[".html"] = partial(_report, result)
    return found


@formats.register
def _(result: RobotResult) -> dict[str, Writer]:
    return {".json": lambda path: write_text(path, layout(plain(result.data)) + "\n")}


def _report(result: Result, path: Path) -> None:
    found, campaign = result.identification, result.campaign
    assert found is not None
    assert campaign is not None
    from rcsa_ident.workflows.identify import mode_deviations

    write_text(path, report_html(found, campaign, result.readings, deviations=mode_deviations(found)))


# -- notebooks -------------------------------------------------------------------------------------------------------------------


@singledispatch
def html(noun: Any) -> str:
    """Return what a notebook shows of a noun: its line, and a table or its figure where it has one; no script."""
    return _page(noun, *([_svg(figure_of(noun))] if isinstance(noun, Drawn) else []))


@html.register
def _(tooling: Tooling) -> str:
    return _page(tooling, tooling_svg(tooling))


@html.register
def _(tip: KnownTip) -> str:
    return _page(tip)


@html.register
def _(campaign: Campaign) -> str:
    rows = []
    for name, tooling in campaign.toolings.items():
        cuts = [cut for cut in campaign.cuts if cut.tooling == name]
        speeds = sorted(to_rpm(cut.conditions.spindle_speed) for cut in cuts)
        air = sum(cut.air is not None for cut in cuts)
        rows.append((name, str(tooling.cutter), len(cuts), air, f"{speeds[0]:.0f} – {speeds[-1]:.0f}" if speeds else ""))
    return _page(campaign, _table(("tooling", "cutter", "cuts", "with air cut", "rev/min"), rows))


@html.register
def _(advice: Advice) -> str:
    points = [
        (
            f"{to_rpm(point.spindle_speed):.0f}",
            "none" if point.depth == np.inf else f"{1e3 * point.depth:.2f}",
            f"above {1e3 * point.limit:g}" if point.limit >= advice.lobes.max_depth else f"{1e3 * point.limit:.2f}",
            str(point.bound),
            "" if point.removal_rate is None else f"{to_cm3_per_min(point.removal_rate):.0f}",
            "" if point.power is None else f"{1e-3 * point.power:.2g}",
        )
        for point in advice.recommended
    ]
    header = ("rev/min", "recommended depth [mm]", "stability limit [mm]", "ended by", "cm³/min", "kW")
    return _page(advice, _table(header, points), _list(advice.remarks), _svg(figure_of(advice)))


@html.register
def _(answer: Listening) -> str:
    return _page(answer, _list(answer.reasons), *([] if answer.record is None else [_svg(figure_of(answer))]))


@html.register
def _(found: TapFrf) -> str:
    left_out = [f"{hit.time:.3g} s of recording {hit.record + 1} is left out: {hit.reason}" for hit in found.hits if hit.reason]
    return _page(found, _list(left_out), _svg(figure_of(found)))


@html.register
def _(cut: MonitoredCut) -> str:
    return _page(cut, _list(cut.remarks), _svg(figure_of(cut)))


@html.register
def _(result: Result) -> str:
    parts = [_list(result.reasons)]
    for axis, part in result.data["axes"].items():
        std = [(mode.get("natural_frequency_std_hz"), mode.get("damping_ratio_std")) for mode in part["modes"]]
        deviation = None if any(None in each for each in std) else tuple(np.array(std, dtype=float).T * [[from_hz(1.0)], [1.0]])
        rows = [
            (
                f"{row.frequency_hz:.1f}" + ("" if row.frequency_std_hz is None else f" ± {two_digits(row.frequency_std_hz)}"),
                f"{row.damping_percent:.2f}" + ("" if row.damping_std_percent is None else f" ± {two_digits(row.damping_std_percent)}"),
                f"{1e3 * abs(row.phi_t):.3f}",
                f"{1e3 * abs(row.phi_r):.2f}",
            )
            for row in mode_rows(result.modes[Dof(axis.lower())], deviation)
        ]
        parts.append(_table((f"{axis}: f_n [Hz]", "ζ [%]", "|φ_t| [1e-3]", "|φ_r| [1e-3]"), rows))
    if result.learned:
        told = [
            (row.toolings, row.what, f"{row.drawn} ± {row.spread}", f"{row.found} ± {row.deviation}", row.unit)
            for row in drawing_rows(result.learned)
        ]
        parts.append(_table(("tooling", "", "drawn", "found", "unit"), told))
    found = result.identification
    drawn = [] if found is None else [figure_of(result, axis=axis) for axis in found.axes]
    return _page(result, *parts, _list(result.notes), *map(_svg, drawn))


def _page(noun: Shown, *parts: str) -> str:
    # dark letters also where a notebook's own paper is dark
    style = "max-width: 56em; background: #fff; color: #1f2933; padding: 0.5em"
    head = f"<p><b>{escape(type(noun).__name__)}</b> {escape(str(noun)).replace(chr(10), '<br/>')}</p>"
    return f'<div style="{style}">{head}{"".join(parts)}</div>'


def _svg(figure: Figure) -> str:
    return svg(figure, f"rcsa-ident-{next(_NUMBER)}")


def _table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    def row(cells: Iterable[object], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{escape(str(cell))}</{tag}>" for cell in cells) + "</tr>"

    return f"<table><thead>{row(header, 'th')}</thead><tbody>{''.join(row(cells, 'td') for cells in rows)}</tbody></table>"


def _list(sentences: Sequence[str]) -> str:
    return "<ul>" + "".join(f"<li>{escape(sentence)}</li>" for sentence in sentences) + "</ul>" if sentences else ""
