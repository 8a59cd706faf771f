"""Identifications and lobes as jobs have workers of their own: a short question never waits behind a long job of the other kind."""

from __future__ import annotations

import pytest

from api.client import Client
from tests.api.identifying import uploaded
from tests.fixtures.service import example, serving
from tests.fixtures.waiting import until

pytestmark = pytest.mark.slow


def test_lobes_do_not_wait_for_an_identification(tmp_path, result):
    with serving(tmp_path / "data", RCSA_IDENT_JOB_WORKERS="1", RCSA_IDENT_LOBE_WORKERS="1") as served, Client(served.url) as client:
        machine = client.make_machine("M").id
        client.identify(machine, result)
        campaign = uploaded(client, machine)

        def asked():
            speeds = {"from_rpm": 8000, "to_rpm": 9000, "step_rpm": 500}
            id = client.lobes_later(machine, example(), method="full-discretisation", speeds=speeds).id
            until(lambda: client.lobe_job(id).job.finished)
            return client.lobe_job(id).job

        # the kernels are compiled, or read
        assert asked().state == "done"
        first, second = (client.identify_campaign(campaign, method="paper", apply=False).id for _ in range(2))
        until(lambda: client.job(first).state == "running")
        lobes = asked()
        assert lobes.state == "done"
        # begun beside the one, before the other
        assert lobes.started < (client.job(first).finished or "later")
        assert lobes.started < (client.job(second).started or "later")
