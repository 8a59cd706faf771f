"""The door of the commands: errors of the library in the words of the command line."""

from __future__ import annotations

import inspect
import subprocess
import sys

import pytest
import typer

from rcsa_ident.base.errors import InputError
from rcsa_ident.cli import app
from rcsa_ident.cli.common import _OPTIONS, answers

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


#: A system on which numba finds no folder that can be written.
NOWHERE = """
import numba.core.caching
numba.core.caching.CacheImpl._locator_classes = []
from rcsa_ident.cli import main
main()
"""


@pytest.mark.slow
def test_kernels_that_can_be_kept_nowhere_are_told_in_words(tmp_path):
    words = [sys.executable, "-c", NOWHERE, "check", str(tmp_path)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith("NUMBA_CACHE_DIR: found ")
    assert done.stderr.count("\n") == 1


def test_other_errors_of_a_library_stay_what_they_are():
    def fails():
        raise RuntimeError("something else")

    with pytest.raises(RuntimeError, match="something else"):
        answers(fails)()
