"""ring: a tooling learned from how it rings."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rcsa_ident.base.errors import InputError
from rcsa_ident.cli.common import NOT_CONVERGED, Json, Stages, answers, emit, say, warn, writable


@answers
def ring(
    tooling: Annotated[
        Path, typer.Argument(help="TOOLING.toml as drawn; [holder] taper tells what hangs behind the flange.", show_default=False)
    ],
    out: Annotated[Path, typer.Option(help="Tooling file to write, with what was learned.", show_default=False)],
    sounds: Annotated[
        list[Path] | None,
        typer.Argument(help="Sound of the tooling on a string, tapped: one with several hits, or several.", show_default=False),
    ] = None,
    bare_tool: Annotated[
        list[Path] | None, typer.Option(help="Sound of the tool alone, tapped; more than once for several.", show_default=False)
    ] = None,
    mass_g: Annotated[float | None, typer.Option(help="Mass of the tool alone, g.", show_default=False)] = None,
    rate_hz: Annotated[float | None, typer.Option(help="Sampling rate, Hz, of a file that tells none.", show_default=False)] = None,
    plot: Annotated[Path | None, typer.Option(help="Figure to write (png, svg, pdf).", show_default=False)] = None,
    json_: Json = False,
) -> None:
    """Learn what a drawing does not tell from the ring of the tooling: hang it on a string, tap it, hold a phone beside it."""
    from rcsa_ident.front.recorded import ring as ask
    from rcsa_ident.io.files import write_text
    from rcsa_ident.io.settings.toolings import tooling_keys, tooling_text
    from rcsa_ident.report.ring_rows import ring_row, sentences

    writable(out)
    if plot is not None:
        writable(plot, "--plot")
    if out.exists() and tooling.exists() and out.samefile(tooling):
        raise InputError("--out", "the drawing itself", "another file: a drawing is not overwritten", str(out))
    with Stages(quiet=json_).stage("listening"):
        found = ask(tooling, *(sounds or ()), bare_tool=bare_tool or (), mass=None if mass_g is None else 1e-3 * mass_g, rate=rate_hz)
    said = sentences(found)
    write_text(out, tooling_text(tooling_keys(found.after), [f"learned from its ring, from {tooling.name}", *said]))
    if plot is not None:
        from rcsa_ident.report.ringing import ring_figure

        ring_figure(found).savefig(plot, dpi=150)
    if json_:
        emit(ring_row(found) | {"out": str(out)})
    else:
        for line in said:
            say(line)
        for remark in found.remarks:
            warn(remark)
        say(f"written: {out}")
    if found.suspect:
        warn(f"drawing, spread and ring hardly go together (probability {found.probability:.2g}): look at the lines above")
        raise typer.Exit(NOT_CONVERGED)
