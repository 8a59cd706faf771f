"""path: a tool along a path."""

from __future__ import annotations

import typer

path_app = typer.Typer(help="A tool along a path: G-code or PATH.csv.", no_args_is_help=True)
