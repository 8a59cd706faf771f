"""What commands print about the examples stands in docs/formats/commands_json.md, key by key."""

from __future__ import annotations

import json
import re

import pytest
from typer.testing import CliRunner

from rcsa_ident.cli import app
from rcsa_ident.io.text_columns import read_table
from tests.fixtures.paths import ROOT

FORMATS = ROOT / "docs" / "formats"
EXAMPLES = FORMATS / "examples"
MODES = ["--modes", "MODES.toml", "TOOLING.toml"]
CUT = ["--ktc-mpa", "900", "--krc", "0.3"]
COMMANDS = {
    "check": ["check", "campaign"],
    "listen": ["listen", "sound.wav"],
    "tap": ["tap", "hits.csv", "--out", "OUT.csv"],
    "lobes": ["lobes", *MODES, *CUT, "--immersion", "0.5", "--strategy", "down", "--speed-from", "9000", "--out", "OUT.csv"],
    "tooltip": ["tooltip", "RESULT.json", "TOOLING.toml", "--out", "OUT.csv"],
    "advise": [
        *("advise", *MODES, *CUT, "--immersion", "0.5", "--strategy", "down", "--feed-per-tooth-mm", "0.1", "--speed-from", "9000"),
        *("--depth-mm", "0.5", "--cut", "12000:0.3"),
    ],
    "export": ["export", "RESULT.json", "--out", "OUT.csv"],
    "materials": ["materials"],
    "holders": ["holders"],
    "draw": ["draw", "TOOLING.toml", "--out", "OUT.svg"],
    "path-remove": ["path", "remove", "TOOLING.toml", "program.nc", "--stock", "stock.stl", "--out", "OUT.csv"],
    "path-stability": ["path", "stability", *MODES, "program.nc", "--stock", "stock.stl", *CUT, "--out", "OUT.csv"],
    "path-mill": ["path", "mill", *MODES, "program.nc", "--stock", "stock.stl", *CUT, "--out", "OUT.csv"],
    "robot-check": ["robot", "check", "ROBOT.toml", "--posture", "0 20 30 10 -40 0"],
}
#: Told once for all commands.
COMMON = {"seconds", "warnings", "out"}


#: Whose keys are names of axes.
BY_AXIS = {"peaks", "signal_to_noise_db"}


def keys_within(printed: object) -> set[str]:
    """Keys of objects in objects and lists."""
    if isinstance(printed, list):
        return {key for each in printed for key in keys_within(each)}
    if not isinstance(printed, dict):
        return set()
    inner = [keys_within(list(value.values()) if key in BY_AXIS else value) for key, value in printed.items() if key not in COMMON]
    return set(printed).union(*inner)


def keys_of(text: str) -> set[str]:
    return {word for told in re.findall(r"`([^`]+)`", text) for word in re.findall(r"[a-z]\w*", told)}


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_keys_are_told(name, tmp_path, monkeypatch):
    monkeypatch.chdir(EXAMPLES)
    words = [str(tmp_path / word) if word.startswith("OUT.") else word for word in COMMANDS[name]]
    result = CliRunner().invoke(app, [*words, "--json"])
    assert result.exit_code == 0, result.output
    printed = json.loads(result.stdout)
    page = (FORMATS / "commands_json.md").read_text("utf-8")
    section = page.split(f"(json-{name})=", 1)[1].split("\n(json-", 1)[0]
    told = keys_of(section)
    assert keys_within(printed) - COMMON <= told


def test_columns_of_all_tables_are_told():
    pages = "".join(path.read_text("utf-8") for path in FORMATS.glob("*.md"))
    told = keys_of(pages)
    entries = re.compile(r"^[XYZ]{1,2}_(t[FM]_|rM_)?(re|im)(_std)?$")
    for path in EXAMPLES.glob("*.csv"):
        if path.stem in ("cut", "logger", "hits"):
            continue
        for name in read_table(path, "table").header:
            first = re.sub(r"_\d+_", "_1_", re.sub(r"^q\d_", "q1_", name)).replace("Y_joint", "X_joint")
            assert entries.match(name) or first in told or re.search(rf"`{re.escape(first)}`", pages), (path.name, name)


def test_keys_of_a_result_are_told():
    result = json.loads((EXAMPLES / "RESULT.json").read_text("utf-8"))
    told = keys_of((FORMATS / "results.md").read_text("utf-8"))
    axis = result["axes"]["X"]
    assert set(result) | set(result["campaign"]) | set(axis) | set(axis["joint"]) <= told
    assert set(axis["modes"][0]) | set(axis["covariance"]) | set(axis["misfit"]) <= told
    learnt = json.loads((EXAMPLES / "LEARNT.json").read_text("utf-8"))
    assert set(learnt) | set(learnt["prior"]) | set(learnt["posterior"]) <= told
