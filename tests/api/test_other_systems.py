"""Where a system lacks what Linux has, the service still takes a campaign to its lobes, and says at its start what does not hold there."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys

import pytest

from api.client import Client
from tests.api.identifying import uploaded
from tests.fixtures.paths import ROOT
from tests.fixtures.service import command, example, serving
from tests.fixtures.waiting import PATIENCE


@pytest.fixture
def elsewhere(tmp_path) -> dict[str, str]:
    """Settings of processes that find themselves on another system."""
    shutil.copyfile(ROOT / "tests" / "fixtures" / "other_system.py", tmp_path / "sitecustomize.py")
    return {"PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}"}


def test_fixtures_are_imported_where_no_module_knows_users():
    """As on Windows: tests that start no PostgreSQL server run there."""
    code = "import sys; sys.modules['pwd'] = None; import tests.fixtures.postgres"
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True, timeout=PATIENCE)


@pytest.mark.slow
def test_a_campaign_comes_to_its_lobes(tmp_path, elsewhere):
    data = tmp_path / "data"
    with serving(data, RCSA_IDENT_JOB_WORKERS="1", **elsewhere) as served, Client(served.url) as client:
        machine = client.make_machine("M").id
        campaign = uploaded(client, machine)
        job = client.wait(client.identify_campaign(campaign, seed=7).id, PATIENCE)
        assert (job.state, job.problem) == ("done", None)
        (lobes,) = client.lobes(machine, example()).toolings
        assert lobes.absolute_limit_mm > 0.0
        words, environment = command(data, "backup", str(tmp_path / "STORE.tar"), **elsewhere)
        done = subprocess.run(words, env=environment, capture_output=True, text=True, timeout=PATIENCE, check=False)
        assert done.returncode == 0, done.stderr
        assert (tmp_path / "STORE.tar").stat().st_size > 0
    log = served.log.read_text(encoding="utf-8")
    assert "this system does not limit the memory of a process" in log
    assert '"level": "error"' not in log
