"""learn with a campaign on the command line: refusals, and a cut that contradicts."""

from __future__ import annotations

import json
import re

import pytest
from typer.testing import CliRunner

from rcsa_ident.cli import app
from tests.fixtures.campaign import part_of_the_sample_runs


def run(*arguments):
    return CliRunner().invoke(app, [str(each) for each in arguments])


@pytest.fixture(scope="module")
def one_cut(tmp_path_factory):
    """The first of the sample runs, of a tooling whose drawing is an honest one's."""
    folder = part_of_the_sample_runs(tmp_path_factory.mktemp("one"), 1000)
    for path in (folder / "toolings").glob("*.toml"):
        path.write_text(path.read_text(encoding="utf-8") + "\n[spread]\n", encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def name(one_cut):
    """File name of the tooling that cut."""
    text = (one_cut / "campaign.toml").read_text(encoding="utf-8")
    key = re.search(r'^tooling = "(.+)"$', text, flags=re.MULTILINE).group(1)
    return re.search(rf'^"?{key}"? = "toolings/(.+)"$', text, flags=re.MULTILINE).group(1)


@pytest.mark.slow(5)
def test_a_cut_of_another_machine_contradicts_and_nothing_is_written(result_file, one_cut, tmp_path):
    found = run(
        "learn", result_file, one_cut, "--toolings", tmp_path / "out", "--machine", tmp_path / "NEW.json", "--json", "--processes", 1
    )
    assert found.exit_code == 3, found.output
    answer = json.loads(found.stdout)
    (tooling,) = answer["toolings"]
    assert tooling["file"] is None
    assert "no tooling near its drawing explains its cuts" in tooling["contradiction"]
    assert not list((tmp_path / "out").iterdir())
    assert not (tmp_path / "NEW.json").exists()


@pytest.mark.slow
def test_nothing_is_overwritten_silently(result_file, one_cut, name, tmp_path):
    (tmp_path / name).write_text("mine", encoding="utf-8")
    found = run("learn", result_file, one_cut, "--toolings", tmp_path, "--processes", 1)
    assert found.exit_code == 2
    assert "found a file that is there, allowed is a name that is free, or --overwrite" in found.stderr
    assert (tmp_path / name).read_text(encoding="utf-8") == "mine"


@pytest.mark.slow
def test_an_exact_drawing_is_refused_before_the_fit(result_file, tmp_path):
    (tmp_path / "runs").mkdir()
    folder = part_of_the_sample_runs(tmp_path / "runs", 1000)
    found = run("learn", result_file, folder, "--toolings", tmp_path / "out", "--processes", 1)
    assert found.exit_code == 2
    assert "a table [spread] in its file" in found.stderr
