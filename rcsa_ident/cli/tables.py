"""Tables on the console."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.measure import Measurement
from rich.table import Table

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.units import to_cm3_per_min, to_hz, to_rpm
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.result import Identification
from rcsa_ident.io.settings.tested_cuts import OWN, cell_of
from rcsa_ident.machine.workpiece_side import WorkpieceSide
from rcsa_ident.report.summaries import (
    DrawingRow,
    ModeRow,
    RecordingRow,
    WholeModeRow,
    coefficient_rows,
    drawing_rows,
    mode_rows,
    two_digits,
    whole_mode_rows,
)
from rcsa_ident.report.workpiece_side import side_captions, side_mode_rows
from rcsa_ident.stability.advice import Advice, PlannedCut, SpeedWindow
from rcsa_ident.stability.labels.tested_cuts import Tally
from rcsa_ident.stability.methods import MethodName
from rcsa_ident.stability.operating_point import Bound, OperatingPoint

if TYPE_CHECKING:
    from rcsa_ident.identification.arm.joints import JointFit
    from rcsa_ident.identification.arm.result import RobotIdentification
    from rcsa_ident.identification.arm.static import StaticFit
    from rcsa_ident.workflows.learn_from_cuts import NextTest
    from rcsa_ident.workflows.robot_postures import RobotAtPosture

#: Columns of a terminal that no cell reaches.
_WIDEST = 10_000
_COLOURS = {"converged": "green", "not validated": "cyan", "suspect": "yellow", "failed": "red"}


def console() -> Console:
    """Standard output; a sentence is as long as it is."""
    return Console(highlight=False, soft_wrap=True)


def show(table: Table) -> None:
    """Print a table as wide as the terminal, wider where a word would be cut: an id that lost its end names nothing."""
    out = console()
    for column in table.columns:
        cells = [column.header, *column.cells]
        column.min_width = max(Measurement.get(out, out.options.update(max_width=_WIDEST), cell).minimum for cell in cells)
    # a space on both sides of every column, and a line between all
    out.width = max(out.width, 1 + sum((column.min_width or 0) + 3 for column in table.columns))
    out.print(table, soft_wrap=False)


def show_recordings(rows: Sequence[RecordingRow]) -> None:
    """Print the verdict on every recording."""
    table = Table("recording", "tooling", "programmed\nrev/min", "found\nrev/min", "lines", "S/N X\ndB", "S/N Y\ndB", "verdict")
    for column in table.columns[2:7]:
        column.justify = "right"
    for row in rows:
        verdict = "[green]usable[/]" if row.usable else "[red]left out[/]"
        if row.notes:
            verdict += " [yellow]*[/]"
        found = "" if row.found_rpm is None else f"{row.found_rpm:.1f}"
        ratios = [f"{row.signal_to_noise_db[axis]:.0f}" if axis in row.signal_to_noise_db else "" for axis in ("X", "Y")]
        lines = str(row.lines) if row.lines else ""
        table.add_row(escape(row.id), escape(row.tooling), f"{row.programmed_rpm:.0f}", found, lines, *ratios, verdict)
    out = console()
    show(table)
    # sentences stand below: a column would break them into words
    for row in rows:
        for reason in row.reasons:
            out.print(f"[red]{escape(row.id)}[/] left out: {escape(reason)}")
    for note in dict.fromkeys(note for row in rows for note in row.notes):
        count = sum(note in row.notes for row in rows)
        out.print(f"[yellow]*[/] {count} recordings: {escape(note)}")


def show_identification(found: Identification, deviations: Mapping[Dof, tuple[FloatArray, FloatArray]]) -> None:
    """Print status, modes with their standard deviations, joint, coefficients and misfit, and what the data cannot tell."""
    out = console()
    colour = _COLOURS[str(found.status)]
    tests = sum(len(part.tests) for part in found.axes.values())
    used = f"{len(found.cut_ids)} cuts used" + (f", {tests} hammer tests" if tests else "")
    out.print(f"status [bold {colour}]{found.status}[/], method {found.method}, seed {found.seed}, {used}")
    for reason in found.reasons:
        out.print(f"  [{colour}]{escape(reason)}[/]")
    if found.whole is not None:
        out.print(escape(found.coupling))
        whole = whole_mode_rows(found.whole.best.standing(), next(iter(deviations.values()), None))
        angles = [f"{round(row.direction_deg)}" for row in whole]
        show(_modes("modes at the flange, X and Y together, spindle at standstill", whole, angles))
    for axis, part in found.axes.items():
        if found.whole is None:
            show(_modes(f"modes at the flange, {axis.upper()}", mode_rows(part.modes, deviations.get(axis))))
        misfit = ", ".join(f"{escape(name)} {value:.2f}" for name, value in part.per_tooling.items())
        name = "" if found.whole is None else f"{axis.upper()}: "
        out.print(f"  {name}chi²/point {part.chi2_per_point:.2f} ({misfit}), unexplained share of a line {100 * part.model_error:.2f} %")
        predicted = [each for each in found.predictions if each.axis is axis]
        if predicted:
            off = ", ".join(f"{escape(p.tooling)} {100 * p.error:.2g} % off ({100 * p.promised:.2g} % promised)" for p in predicted)
            out.print(f"  {name}predicted by the other toolings: {off}")
        for test in part.tests:
            met = f"met within {100 * test.error:.1f} %, gain {test.gain:.3f} ± {two_digits(test.gain_std)}"
            out.print(f"  hammer test {escape(test.lines.id)}: {test.lines.omega.size} lines, {met}")
        if part.standstill is not None:
            frequency, frequency_std, damping, damping_std = (100.0 * value for value in part.standstill)
            changed = f"frequencies by {two_digits(frequency_std, frequency)} ± {two_digits(frequency_std)} %"
            changed += f", damping by {two_digits(damping_std, damping)} ± {two_digits(damping_std)} %"
            out.print(f"  {axis.upper()} at standstill is higher than turning: {changed}")
    if found.axes:
        joint = next(iter(found.axes.values())).joint
        out.print(
            f"joint: k_t {joint.translational_stiffness:.3g} N/m, c_t {joint.translational_damping:.3g} N s/m, "
            f"k_r {joint.rotational_stiffness:.3g} N m/rad, c_r {joint.rotational_damping:.3g} N m s/rad"
        )
    for each in coefficient_rows(found.coefficients):
        out.print(f"{escape(each.name)}: {two_digits(each.std, each.value)} ± {two_digits(each.std)} {each.unit}")
    if found.learned:
        show(_drawings(drawing_rows(found.learned)))
    if found.workpiece_side is not None:
        _show_workpiece_side(found.workpiece_side)
    for note in found.notes:
        if note == found.coupling:
            continue
        out.print(f"note: {escape(note)}")


def _show_workpiece_side(side: WorkpieceSide) -> None:
    """Print what gives way on the workpiece's side, and what it was found from."""
    if side.yielding:
        table = Table(
            "axis", "f_n Hz", "±", "zeta %", "±", "stiffness N/µm", "±", title="modes of the workpiece's side", title_justify="left"
        )
        for column in table.columns[1:]:
            column.justify = "right"
        for row in side_mode_rows(side):
            stds = row.frequency_std_hz, row.damping_std_percent, row.stiffness_std_n_per_um
            cells = f"{row.frequency_hz:.1f}", f"{row.damping_percent:.2f}", two_digits(stds[-1], row.stiffness_n_per_um)
            table.add_row(row.axis, *(text for cell, std in zip(cells, stds, strict=True) for text in (cell, two_digits(std))))
        show(table)
    for axis, words in side_captions(side).items():
        console().print(f"  {axis}: {escape(words)}")


def _drawings(rows: Sequence[DrawingRow]) -> Table:
    """What the drawings say of toolings, and what the cuts say."""
    table = Table("tooling", "", "drawn", "±", "found", "±", "unit", "", title="toolings, as drawn and as found", title_justify="left")
    for column in table.columns[2:6]:
        column.justify = "right"
    for row in rows:
        texts = (row.toolings, row.what, row.drawn, row.spread, row.found, row.deviation, row.unit)
        table.add_row(*map(escape, texts), "[yellow]hardly taught by the cuts[/]" if row.hardly else "")
    return table


def _modes(title: str, rows: Sequence[ModeRow | WholeModeRow], direction: Sequence[str] | None = None) -> Table:
    """Modes with their standard deviations, and their directions where both planes have them together."""
    across = [] if direction is None else ["direction deg"]
    table = Table("f_n Hz", "±", "zeta %", "±", *across, "|phi_t| 1e-3", "|phi_r| 1e-3", title=title, title_justify="left")
    for column in table.columns:
        column.justify = "right"
    for i, row in enumerate(rows):
        table.add_row(
            f"{row.frequency_hz:.1f}",
            "" if row.frequency_std_hz is None else two_digits(row.frequency_std_hz),
            f"{row.damping_percent:.2f}",
            "" if row.damping_std_percent is None else two_digits(row.damping_std_percent),
            *([] if direction is None else [direction[i]]),
            f"{1e3 * abs(row.phi_t):.3f}",
            f"{1e3 * abs(row.phi_r):.2f}",
        )
    return table


def show_lobes(advice: Advice) -> None:
    """Print the absolute limit, and the stability limit and the recommended depth of the best speeds."""
    out, lobes = console(), advice.lobes
    if lobes.absolute_limit is not None and lobes.absolute_frequency is not None:
        frequency = to_hz(lobes.absolute_frequency)
        out.print(f"stable at any speed up to {1e3 * lobes.absolute_limit:.3f} mm (chatter would start at {frequency:.0f} Hz)")
    heads = ("spindle speed\nrev/min", "recommended\ndepth mm", "stability\nlimit mm")
    by = "" if advice.recommended_by is None else f", by {advice.recommended_by}"
    table = _table(*heads, title=f"recommended cuts of the range{by}")
    for point in advice.recommended:
        table.add_row(f"{to_rpm(point.spindle_speed):.0f}", recommended_text(point), limit_text(point.limit, lobes.max_depth))
    show(table)
    _tell_reasons(advice)
    peaks = ", ".join(f"{limit_text(p.limit_depth, lobes.max_depth)} mm at {to_rpm(p.spindle_speed):.0f} rev/min" for p in advice.pockets)
    out.print(f"highest stability limits: {peaks}")


def limit_text(depth: float, most: float) -> str:
    """Return a limit in mm, up to the largest depth."""
    return f"{1e3 * depth:.2f}" if depth < most else f"more than {1e3 * most:g}"


def recommended_text(point: OperatingPoint) -> str:
    """Return the recommended depth in mm, if there is one."""
    return "none" if point.depth == np.inf else f"{1e3 * point.depth:.2f}"


def _tell_reasons(advice: Advice, about: str = "") -> None:
    """Say how the first recommended depth follows from its limit, what dominates its band, and where no depth is recommended and why."""
    first = next((point for point in advice.recommended if point.held is not None), None)
    if first is not None:
        console().print(f"{about}at {to_rpm(first.spindle_speed):.0f} rev/min: {first.held}")
    _tell_band(advice, about)
    for point in advice.recommended:
        if point.why:
            console().print(f"{about}at {to_rpm(point.spindle_speed):.0f} rev/min {point.why}")
    free = [point for point in advice.recommended if point.depth == np.inf and not point.why]
    if free:
        at = " and ".join(f"{to_rpm(point.spindle_speed):.0f}" for point in free)
        console().print(f"at {at} rev/min {free[0].unlimited}; a larger --max-depth-mm looks deeper")


def show_tally(tally: Tally) -> None:
    """Print how many tested cuts the lobes classify correctly: the four cases, and the marginal ones apart."""
    table = Table("predicted", "seen\nstable", "seen\nchatter", "marginal", title="tested cuts", title_justify="left")
    for column in table.columns[1:]:
        column.justify = "right"
    table.add_row("stable", f"[green]{tally.stable_stable}[/]", f"[red]{tally.stable_chatter}[/]", str(tally.stable_marginal))
    table.add_row("chatter", f"[yellow]{tally.chatter_stable}[/]", f"[green]{tally.chatter_chatter}[/]", str(tally.chatter_marginal))
    out = console()
    show(table)
    if tally.decided:
        out.print(f"classified correctly: {_right(tally)}, {100.0 * tally.share_right:.1f} %")


def show_believed(rows: Mapping[str, Any]) -> None:
    """Print what was believed of modes and coefficients before labels and after them, as means and standard deviations."""
    table = _table("", "before", "after", title="learnt from labels")
    table.columns[0].justify = "left"
    named = [(f"mode {k + 1}, {name}", row) for k, mode in enumerate(rows["modes"]) for name, row in mode.items()]
    for name, row in [*named, *((name, rows[name]) for name in ("tangential_mpa", "radial_mpa"))]:
        table.add_row(escape(name.replace("_", " ")), *(f"{mean:.4g} ± {spread:.2g}" for mean, spread in (row["before"], row["after"])))
    show(table)


def show_next_tests(tests: Sequence[NextTest]) -> None:
    """Print the cuts whose labels tell most, the most telling first."""
    columns = [column for column in OWN if any(cell_of(test.own, column) for test in tests)]
    table = _table("rev/min", "depth mm", "stable with\nprobability", *columns, title="next tests, the most telling first")
    for test in tests:
        cells = f"{to_rpm(test.spindle_speed):.0f}", f"{1e3 * test.axial_depth:.3g}", f"{test.probability_stable:.2f}"
        table.add_row(*cells, *(escape(cell_of(test.own, column)) for column in columns))
    show(table)


def show_cases(rows: Sequence[tuple[str, Tally | None, Tally | None]]) -> None:
    """Print how many cuts of each case are classified correctly, in process and, where there are tap tests, at standstill."""
    columns = ("case", "correct", "unexpected\nchatter", "stable above\nthe limit", "marginal", "correct\nby tap tests")
    table = _table(*columns, title="tested cuts")
    table.columns[0].justify = "left"
    for name, own, idle in rows:
        cells = ["", "", "", ""]
        if own is not None:
            marginal = own.stable_marginal + own.chatter_marginal
            cells = [_right(own), str(own.stable_chatter), str(own.chatter_stable), str(marginal) if marginal else ""]
        table.add_row(escape(name), *cells, "" if idle is None else _right(idle))
    show(table)


def _right(tally: Tally) -> str:
    return f"{tally.stable_stable + tally.chatter_chatter} of {tally.decided}"


def _table(*columns: str, title: str) -> Table:
    table = Table(*columns, title=title, title_justify="left")
    for column in table.columns:
        column.justify = "right"
    return table


def show_points(advice: Advice) -> None:
    """Print the recommended cuts: those that remove most."""
    heads = (
        "spindle speed\nrev/min",
        "recommended\ndepth mm",
        "stability\nlimit mm",
        "removal\ncm³/min",
        "power\nkW",
        "torque\nN m",
        "limited\nby",
    )
    table = _table(*heads, title="recommended cuts: highest removal rate")
    for p in advice.recommended:
        cells = f"{to_rpm(p.spindle_speed):.0f}", recommended_text(p), limit_text(p.limit, advice.lobes.max_depth)
        load = "", "", ""
        if p.removal_rate is not None and p.power is not None and p.torque is not None:
            load = f"{to_cm3_per_min(p.removal_rate):.0f}", f"{1e-3 * p.power:.2f}", f"{p.torque:.1f}"
        table.add_row(*cells, *load, _against(p))
    show(table)
    _tell_reasons(advice)


def _tell_band(advice: Advice, about: str = "") -> None:
    """Print what dominates the band of the first recommended cut's limit, where something does."""
    if advice.band is not None and advice.band.words:
        console().print(f"{about}first recommended cut: {escape(advice.band.words)}")


def _against(point: OperatingPoint) -> str:
    return "" if point.bound is Bound.DEPTH else str(point.bound)


def show_windows(windows: Sequence[SpeedWindow], depth_mm: float, name: str) -> None:
    """Print the speeds at which a depth is recommended."""
    out = console()
    about = f"{escape(name)}: " if name else ""
    if not windows:
        out.print(f"{about}a depth of {depth_mm:g} mm is not recommended at any speed of the range")
        return
    heads = ("best at\nrev/min", "from\nrev/min", "to\nrev/min", "recommended\ndepth mm")
    table = _table(*heads, title=f"{about}speeds for a depth of {depth_mm:g} mm")
    for w in windows[:8]:
        table.add_row(
            *(f"{to_rpm(speed):.0f}" for speed in (w.best, w.low, w.high)), "none" if w.allowed == np.inf else f"{1e3 * w.allowed:.2f}"
        )
    show(table)


def show_planned(cuts: Sequence[PlannedCut], name: str) -> None:
    """Print how planned cuts stand."""
    out = console()
    for cut in cuts:
        about = f"{escape(name)}: " if name else ""
        verdict = "[green]stable[/]" if cut.stable else "[red]chatter[/]"
        limit = f"limit {1e3 * cut.limit:.2f} mm, margin {100.0 * cut.margin:+.0f} %" if cut.limit < np.inf else "no limit found"
        by = f"{cut.method}, a preview" if cut.method == MethodName.ZERO_ORDER else cut.method
        words = [f"{about}{to_rpm(cut.spindle_speed):.0f} rev/min, {1e3 * cut.depth:.2f} mm: {verdict} by {by}, {limit}"]
        if cut.probability is not None:
            words.append(f"stable with a probability of {100.0 * cut.probability:.0f} %")
        if cut.robust_limit < np.inf:
            words.append(f"limit with tolerance and probability {1e3 * cut.robust_limit:.2f} mm")
        near = [f"{to_rpm(speed):.0f} rev/min" for speed in (cut.slower, cut.faster) if speed is not None]
        if near:
            words.append(f"{'chatter begins at' if cut.stable else 'the nearest stable speeds are'} {' and '.join(near)}")
        words.append(
            f"{1e-3 * cut.power:.2f} kW, {cut.torque:.1f} N m" + (f" ({100.0 * cut.load:.0f} % of the spindle)" if cut.load else "")
        )
        out.print("; ".join(words))


def show_comparison(answers: Sequence[Advice]) -> None:
    """Print the lowest limit and the first recommended cut of several toolings."""
    heads = ("tooling", "lowest limit\nmm", "recommended\nrev/min", "recommended\ndepth mm", "removal\ncm³/min", "limited\nby")
    table = _table(*heads, title="comparison")
    table.columns[0].justify = "left"
    for answer in answers:
        cells = ["", "", "", ""]
        if answer.recommended:
            p = answer.recommended[0]
            removal = "" if p.removal_rate is None else f"{to_cm3_per_min(p.removal_rate):.0f}"
            cells = [f"{to_rpm(p.spindle_speed):.0f}", recommended_text(p), removal, _against(p)]
        lowest = float(answer.lobes.limit_depth.min())
        lowest_mm = f"{1e3 * lowest:.3f}" if lowest < np.inf else limit_text(lowest, answer.lobes.max_depth)
        table.add_row(escape(answer.tooling), lowest_mm, *cells)
    show(table)
    for answer in answers:
        _tell_reasons(answer, f"{escape(answer.tooling)}, ")


def show_peaks(rows: Mapping[str, tuple[float, float, float, float]]) -> None:
    """Print the tip's most compliant frequency of each entry: frequency [Hz], magnitude, lowest real part, 2 sigma at the peak [m/N]."""
    table = Table("axis", "peak at Hz", "|C11| µm/N", "± 2 sigma", "lowest real part µm/N", title="tooltip", title_justify="left")
    for column in table.columns[1:]:
        column.justify = "right"
    for axis, (frequency, magnitude, lowest, band) in rows.items():
        width = f"{1e6 * band:.4f}" if band == band else ""
        table.add_row(axis, f"{frequency:.0f}", f"{1e6 * magnitude:.4f}", width, f"{1e6 * lowest:.4f}")
    show(table)


def show_robot(found: RobotAtPosture, allowed: Sequence[bool]) -> None:
    """Print where an arm's tool sits, how it vibrates and gives way, and all postures that bring it there, with those that are allowed."""
    x, y, z = 1e3 * found.tool_point.offset
    axis = ", ".join(f"{v:.3f}" for v in found.tool_point.turn[:, 2])
    console().print(f"tool at {x:.1f}, {y:.1f}, {z:.1f} mm of the base, pointing along {axis}")
    table = Table(title="Compliance at the tool, base's axes [µm/N]")
    for name in ("", "x", "y", "z"):
        table.add_column(name, justify="right")
    for name, row in zip("xyz", 1e6 * found.compliance, strict=True):
        table.add_row(name, *(f"{v:.3f}" for v in row))
    show(table)
    if found.natural_frequencies.size:
        table = Table(title="Modes")
        for name in ("frequency [Hz]", "damping [%]"):
            table.add_column(name, justify="right")
        for omega, ratio in zip(found.natural_frequencies[:12], found.damping_ratios[:12], strict=True):
            table.add_row(f"{to_hz(omega):.2f}", f"{100.0 * ratio:.2f}")
        show(table)
        torques = ", ".join(f"{v:.0f}" for v in found.gravity_torques.round() + 0.0)
        console().print(f"torques against the arm's weight: {torques} N m")
        sunk = ", ".join(f"{v:.3f}" for v in (1e3 * found.sag).round(3) + 0.0)
        console().print(f"under it the tool moves by {sunk} mm along the base's axes, what the control takes out left out")
    else:
        console().print("no masses are known: no natural frequencies")
    if np.any(found.play):
        free = ", ".join(f"{v:.3f}" for v in 1e3 * found.play)
        console().print(f"the joints' play lets it stand up to {free} mm from the middle")
    table = Table(title="Postures that bring the tool there [°]")
    for k in range(found.postures.shape[1]):
        table.add_column(f"{k + 1}", justify="right")
    table.add_column("within limits")
    for posture, within in zip(np.degrees(found.postures), allowed, strict=True):
        table.add_row(*(f"{v:.2f}" for v in posture), "yes" if within else "no")
    show(table)


def show_joints(names: Sequence[str], found: JointFit, explained: Mapping[str, FloatArray]) -> None:
    """Print what was found of an arm's joints, and the explained share of each motion."""
    table = Table(title="Joints")
    heads = ("joint", "stiffness [MN m/rad]", "± [%]", "lost motion [µrad]", "friction [N m]", "and [N m s/rad]")
    for name in (*heads, *(f"{record}: explained [%]" for record in explained)):
        table.add_column(name, justify="left" if name == "joint" else "right")
    for i, name in enumerate(names):
        numbers = (
            f"{1e-6 * found.stiffness[i]:.2f}", f"{100.0 * found.stiffness_share[i]:.0f}", f"{1e6 * found.lost_motion[i]:.0f}",
            f"{found.coulomb[i]:.0f}", f"{found.viscous[i]:.0f}", *(f"{100.0 * share[i]:.1f}" for share in explained.values()),
        )  # fmt: skip
        table.add_row(name, *("" if text == "nan" else text for text in numbers))
    show(table)


def show_springs(names: Sequence[str], found: StaticFit) -> None:
    """Print what static tests told of an arm's springs, and of its drives' play."""
    table = Table(title="Springs")
    for name in ("spring", "stiffness [MN m/rad]", "± [%]", "told", "play [µrad]", "±"):
        table.add_column(name, justify="left" if name in ("spring", "told") else "right")
    chain, plays = found.robot.chain(), dict.fromkeys(range(len(names)), ("", ""))
    doubt = found.deviation[len(names) :]
    for k, joint, own in zip(chain.driven.tolist(), found.robot.joints, doubt, strict=True):
        plays[k] = f"{1e6 * joint.backlash:.0f}", f"{1e6 * own:.0f}"
    group = {i: str(number) for number, members in enumerate(found.together, start=1) for i in members}
    for i, name in enumerate(names):
        told = "yes" if found.told[i] else f"in sum {group[i]}" if i in group else "no"
        table.add_row(name, f"{1e-6 * chain.stiffness[i]:.3g}", f"{100.0 * found.share[i]:.0f}", told, *plays[i])
    show(table)


def show_identified_robot(found: RobotIdentification) -> None:
    """Print what cuts told of an arm's springs and of the spindle in its hand."""
    table = Table(title=str(found))
    for name in ("spring", "stiffness [MN m/rad]", "± [%]", "told"):
        table.add_column(name, justify="left" if name in ("spring", "told") else "right")
    for name, stiffness, share, told in found.springs:
        table.add_row(name, f"{1e-6 * stiffness:.4g}", f"{100.0 * share:.2g}", "yes" if told else "no")
    show(table)


def show_planned_postures(postures: FloatArray, places: FloatArray, unknowns: Sequence[str], left: FloatArray) -> None:
    """Print planned postures [rad] with their tool's places [m], and the share of each unknown's doubt that they leave."""
    table = Table(title="Postures [°], and the tool there [mm]")
    for name in (*(f"q{k}" for k in range(1, postures.shape[1] + 1)), "x", "y", "z"):
        table.add_column(name, justify="right")
    for posture, place in zip(postures, places, strict=True):
        table.add_row(*(f"{v:.1f}" for v in np.degrees(posture)), *(f"{v:.0f}" for v in 1e3 * place))
    show(table)
    table = Table(title="Doubt that is left [% of what is believed]")
    table.add_column("unknown")
    table.add_column("", justify="right")
    for name, share in zip(unknowns, left, strict=True):
        table.add_row(name, f"{100.0 * share:.2g}" if share < 0.1 else f"{100.0 * share:.0f}")
    show(table)
