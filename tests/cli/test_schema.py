"""schema on the command line."""

import json

import typer
from typer.testing import CliRunner

from rcsa_ident.cli import set_up
from rcsa_ident.io.settings.schemas import SCHEMAS, schema_of

app = typer.Typer()
app.command("schema")(set_up.schema)


def test_every_schema_is_printed_and_written_alike(tmp_path):
    for name in SCHEMAS:
        printed = CliRunner().invoke(app, [name])
        assert printed.exit_code == 0
        assert json.loads(printed.output) == schema_of(name)
        out = tmp_path / f"{name}.json"
        assert f"#:schema {name}.json" in CliRunner().invoke(app, [name, "--out", str(out)]).output
        assert json.loads(out.read_text("utf-8")) == schema_of(name)


def test_another_name_is_refused_with_those_that_there_are():
    refused = CliRunner().invoke(app, ["machines"])
    assert refused.exit_code == 2
    assert "one of tooling, campaign, machine, modes" in refused.output
