"""The command line: the one place where workflows, files and reports are put together."""

import os
from collections.abc import Callable
from typing import Any

from rcsa_ident.front.processes import THREADS

# before anything asks for numpy
for _name in THREADS:
    os.environ.setdefault(_name, "1")

import typer  # noqa: E402
from typer.core import TyperCommand  # noqa: E402

from rcsa_ident.cli import (  # noqa: E402
    advice,
    calibrate,
    cases,
    compare,
    contact,
    decouple,
    demo,
    export,
    forces,
    identify,
    learn,
    lobes,
    path,
    path_compensate,
    path_cut,
    plan,
    recorded,
    robot,
    robot_identify,
    robot_plan,
    set_up,
    tools,
)


class _Literal(TyperCommand):
    """A command whose help shows brackets as they are: the tables of files are called after them."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        from rich.markup import escape

        written = [(param, getattr(param, "help", None)) for param in self.params]
        for param, text in written:
            param.help = text and escape(text)  # type: ignore[attr-defined]  # arguments of typer have one, too
        super().format_help(ctx, formatter)
        for param, text in written:
            param.help = text  # type: ignore[attr-defined]


app = typer.Typer(
    name="rcsa-ident",
    help="Spindle dynamics from ordinary stable cuts: tooltip FRFs and stability lobes of any tool. "
    "Exit codes: 0 done, 1 failed, 2 bad input, 3 not converged (the result is still written).",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)
#: In the order of the work, under headings.
_COMMANDS: dict[str, tuple[Callable[..., Any], ...]] = {
    "Identification": (demo.demo, identify.check, identify.identify, plan.plan, export.export),
    "Tool change": (
        lobes.tooltip,
        lobes.lobes,
        advice.advise,
        learn.learn,
        cases.cases,
        forces.forces,
        tools.import_tools,
        tools.holders,
        tools.draw,
    ),
    "Further measurements": (
        recorded.listen,
        recorded.tap,
        recorded.ring,
        calibrate.calibrate,
        calibrate.materials,
        compare.compare,
        decouple.decouple,
        decouple.axial,
        contact.contact,
    ),
    "Virtual machine and set-up": (set_up.simulate, set_up.schema, set_up.warm),
}
for _title, _commands in _COMMANDS.items():
    for _command in _commands:
        app.command(_command.__name__.replace("_", "-"), cls=_Literal, rich_help_panel=_title)(_command)
_OF_ROBOTS = robot.COMMANDS | robot_identify.COMMANDS | robot_plan.COMMANDS
for _name, _command in _OF_ROBOTS.items():
    robot.robot_app.command(_name, cls=_Literal)(_command)
app.add_typer(robot.robot_app, name="robot", rich_help_panel="Milling robots")
for _name, _command in (path.COMMANDS | path_cut.COMMANDS | path_compensate.COMMANDS).items():
    path.path_app.command(_name, cls=_Literal)(_command)
app.add_typer(path.path_app, name="path", rich_help_panel="Tool paths")


def _version(asked: bool) -> None:
    if asked:
        from rcsa_ident.version import __version__

        typer.echo(f"rcsa-ident {__version__}")
        raise typer.Exit


@app.callback()
def root(version: bool = typer.Option(False, "--version", callback=_version, is_eager=True, help="Print the version.")) -> None:
    """Take the options in front of a command."""


root.__doc__ = app.info.help


def main() -> None:
    """Run the command line."""
    app()
