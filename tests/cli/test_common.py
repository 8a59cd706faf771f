"""The door of the commands: errors of the library in the words of the command line."""

from __future__ import annotations

import inspect

import pytest
import typer

from rcsa_ident.cli import app
from rcsa_ident.cli.common import _OPTIONS, answers
from rcsa_ident.errors import InputError

COMMANDS = [
    command.callback for each in (app, *(group.typer_instance for group in app.registered_groups)) for command in each.registered_commands
]


@pytest.mark.parametrize("field", _OPTIONS)
def test_a_field_is_an_option_of_a_command(field):
    assert any(_OPTIONS[field][0] in inspect.signature(command).parameters for command in COMMANDS)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"speed_rpm": 7000.0}, "cut.h5: --speed-rpm: found 7000 rev/min, allowed is another speed"),
        ({"speed": 7000.0}, "cut.h5: spindle_speed: found 7000 rev/min, allowed is another speed"),
    ],
)
def test_a_field_is_named_as_the_commands_option_where_it_has_one(given, words, capsys):
    @answers
    def command(**options):
        raise InputError("spindle_speed", "7000 rev/min", "another speed", "cut.h5")

    with pytest.raises(typer.Exit):
        command(**given)
    assert words in capsys.readouterr().err
