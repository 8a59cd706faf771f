"""The commands of measurements beside, on a command line of their own."""

from __future__ import annotations

import typer
from typer.testing import CliRunner

from rcsa_ident.cli import calibrate, compare, contact, decouple

app = typer.Typer()
app.command("calibrate")(calibrate.calibrate)
app.command("materials")(calibrate.materials)
app.command("compare")(compare.compare)
app.command("contact")(contact.contact)
app.command("decouple")(decouple.decouple)


def run(*arguments, code=0):
    result = CliRunner().invoke(app, [str(a) for a in arguments])
    assert result.exit_code == code, result.output + repr(result.exception)
    return result
