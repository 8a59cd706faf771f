"""Tables on the console."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from rcsa_ident.arrays import FloatArray
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.result import Identification
from rcsa_ident.report.rows import RecordingRow, coefficient_rows, mode_rows, two_digits
from rcsa_ident.stability.result import StabilityLobes

_RPM = 9.549296585513721
_COLOURS = {"converged": "green", "suspect": "yellow", "failed": "red"}


def console() -> Console:
    """Standard output, as wide as the terminal."""
    return Console(highlight=False)


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
    out.print(table)
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
    out.print(f"status [bold {colour}]{found.status}[/], method {found.method}, seed {found.seed}, {len(found.cut_ids)} cuts used")
    for reason in found.reasons:
        out.print(f"  [{colour}]{escape(reason)}[/]", soft_wrap=True)
    for axis, part in found.axes.items():
        table = Table(
            "f_n Hz", "±", "zeta %", "±", "|phi_t| 1e-3", "|phi_r| 1e-3", title=f"modes at the flange, {axis.upper()}", title_justify="left"
        )
        for column in table.columns:
            column.justify = "right"
        for row in mode_rows(part.modes, deviations.get(axis)):
            table.add_row(
                f"{row.frequency_hz:.1f}",
                "" if row.frequency_std_hz is None else two_digits(row.frequency_std_hz),
                f"{row.damping_percent:.2f}",
                "" if row.damping_std_percent is None else two_digits(row.damping_std_percent),
                f"{1e3 * abs(row.phi_t):.3f}",
                f"{1e3 * abs(row.phi_r):.2f}",
            )
        out.print(table)
        misfit = ", ".join(f"{escape(name)} {value:.2f}" for name, value in part.per_tooling.items())
        out.print(f"  chi²/point {part.chi2_per_point:.2f} ({misfit}), unexplained share of a line {100 * part.model_error:.2f} %")
    if found.axes:
        joint = next(iter(found.axes.values())).joint
        out.print(
            f"joint: k_t {joint.translational_stiffness:.3g} N/m, c_t {joint.translational_damping:.3g} N s/m, "
            f"k_r {joint.rotational_stiffness:.3g} N m/rad, c_r {joint.rotational_damping:.3g} N m s/rad"
        )
    for each in coefficient_rows(found.coefficients):
        out.print(f"{escape(each.name)}: {two_digits(each.std, each.value)} ± {two_digits(each.std)} {each.unit}")
    for note in found.notes:
        out.print(f"note: {escape(note)}", soft_wrap=True)


def show_lobes(lobes: StabilityLobes, best: Sequence[tuple[float, float]], max_depth: float) -> None:
    """Print the absolute limit and the best speeds."""
    out = console()
    if lobes.absolute_limit < float("inf"):
        frequency = lobes.absolute_frequency / 6.283185307179586
        out.print(f"stable at any speed up to {1e3 * lobes.absolute_limit:.3f} mm (chatter would start at {frequency:.0f} Hz)")
    table = Table("spindle speed\nrev/min", "stable up to\nmm", title="best speeds of the range", title_justify="left")
    for column in table.columns:
        column.justify = "right"
    for speed, depth in best:
        table.add_row(f"{speed * _RPM:.0f}", f"{1e3 * depth:.2f}" if depth < float("inf") else f"more than {1e3 * max_depth:g}")
    out.print(table)


def show_peaks(rows: Mapping[Dof, tuple[float, float, float, float]]) -> None:
    """Print the tip's most compliant frequency per axis: frequency [Hz], magnitude, lowest real part, 2 sigma at the peak [m/N]."""
    table = Table("axis", "peak at Hz", "|C11| µm/N", "± 2 sigma", "lowest real part µm/N", title="tooltip", title_justify="left")
    for column in table.columns[1:]:
        column.justify = "right"
    for axis, (frequency, magnitude, lowest, band) in rows.items():
        width = f"{1e6 * band:.4f}" if band == band else ""
        table.add_row(axis.upper(), f"{frequency:.0f}", f"{1e6 * magnitude:.4f}", width, f"{1e6 * lowest:.4f}")
    console().print(table)
