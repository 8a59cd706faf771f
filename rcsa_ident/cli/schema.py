"""schema: what editors check the TOML files with."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rcsa_ident.base.errors import InputError
from rcsa_ident.cli.common import Json, answers, emit, say, writable


@answers
def schema(
    name: Annotated[
        str, typer.Argument(metavar="tooling|campaign|machine|modes|cases|robot", help="The kind of file.", show_default=False)
    ],
    out: Annotated[Path | None, typer.Option(help="SCHEMA.json to write instead of printing it.", show_default=False)] = None,
    json_: Json = False,
) -> None:
    """Print the JSON Schema of a TOML file: an editor then completes its keys and marks wrong values.

    Name it in the first line of the file: #:schema SCHEMA.json
    """
    from rcsa_ident.io.files import write_text
    from rcsa_ident.io.settings.schemas import SCHEMAS, schema_of, schema_text

    if name not in SCHEMAS:
        raise InputError("name", name, f"one of {', '.join(SCHEMAS)}")
    if out is None:
        say(schema_text(name).rstrip())
        return
    write_text(writable(out), schema_text(name))
    if json_:
        emit({"out": str(out), "title": schema_of(name)["title"]})
    else:
        say(f"written: {out}; first line of a file that it belongs to: #:schema {out.name}")
