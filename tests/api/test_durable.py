"""The durable engine itself, on both databases: steps of a killed process are not done again, and nothing that is read runs code."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from sqlalchemy import create_engine, text

from tests.api.in_process import POSTGRESQL, SQLITE, database
from tests.fixtures.waiting import PATIENCE

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
#: Carries jobs out until all are over, or dies in a step; each line of its output is a step that it computed.
SCRIPT = """
import json, os, sys, time
from api.jobs.durable import Durable

url, executor, deadly, jobs = sys.argv[1], sys.argv[2], sys.argv[3], sys.argv[4:]
engine = Durable(url)
told = []

def carry(job, remember):
    def step(name):
        def compute():
            if name == deadly:
                os._exit(9)
            print(f"{job} {name}", flush=True)
            return json.dumps([job, name, 0.1])
        return remember(name, compute)
    told.append([job, [step(name) for name in ("a", "b", "c")]])

engine.start(executor, carry, ["lobes"])
for job in jobs:
    engine.submit(job, "lobes")
    engine.submit(job, "lobes")
end = time.monotonic() + 60
while time.monotonic() < end:
    found = {each.job: each for each in engine.carried()}
    if deadly == "adopt":
        for each in found.values():
            if each.state == "running" and each.executor != executor:
                engine.resume(each.job, "lobes")
    if found and all(each.state == "over" for each in found.values()):
        break
    time.sleep(0.1)
print(json.dumps([sorted(found), sorted(told)]), flush=True)
engine.forget(sorted(found))
print(len(engine.carried()), flush=True)
os._exit(0)
"""


def engine(url: str, executor: str, deadly: str, *jobs: str) -> tuple[int, list[str]]:
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    words = [sys.executable, "-c", SCRIPT, url, executor, deadly, *jobs]
    found = subprocess.run(words, capture_output=True, text=True, env=environment, check=False, timeout=PATIENCE)
    assert found.returncode in (0, 9), found.stderr
    return found.returncode, found.stdout.splitlines()


@pytest.mark.parametrize("kind", [SQLITE, POSTGRESQL])
def test_a_killed_engine_goes_on_and_another_takes_over(request, tmp_path, kind):
    url = database(request, kind, tmp_path)
    assert engine(url, "w-1", "b", "j1") == (9, ["j1 a"])
    # under the same name it comes back to it by itself
    assert engine(url, "w-1", "c") == (9, ["j1 b"])
    # under another it has to be told that the first is dead
    code, lines = engine(url, "w-2", "adopt", "j2")
    assert code == 0
    assert sorted(lines[:-2]) == ["j1 c", "j2 a", "j2 b", "j2 c"]
    known, told = json.loads(lines[-2])
    assert known == ["j1", "j2"]
    # what was remembered is what was computed
    assert told == [[job, [json.dumps([job, name, 0.1]) for name in "abc"]] for job in known]
    # and is forgotten with the job
    assert lines[-1] == "0"


@pytest.mark.parametrize("kind", [SQLITE, POSTGRESQL])
def test_what_is_kept_is_json(request, tmp_path, kind):
    """No pickle: whoever can write to the engine's tables cannot have code run by reading them."""
    url = database(request, kind, tmp_path)
    engine(url, "w-1", "c", "j1")
    tables = create_engine(url)
    schema = "" if kind == SQLITE else "dbos."
    inputs = f"SELECT i.inputs, s.serialization FROM {schema}workflow_input i JOIN {schema}workflow_status s USING (workflow_uuid)"
    with tables.connect() as connection:
        outputs = connection.execute(text(f"SELECT output, serialization FROM {schema}operation_outputs"))
        rows = [*connection.execute(text(inputs)), *outputs]
        if kind == SQLITE:
            assert connection.execute(text("PRAGMA journal_mode")).scalar() == "wal"
    tables.dispose()
    assert len(rows) == 3
    for value, how in rows:
        json.loads(value)
        assert how == "rcsa_ident_json"
