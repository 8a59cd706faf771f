"""Machines and their identification."""

from __future__ import annotations

import json

import numpy as np
import pytest

from api.client import Client
from rcsa_ident.dynamics.coordinates import Dof
from tests.api.in_process import refused
from tests.fixtures import by_hand


def test_a_machine_from_making_to_forgetting(client):
    made = client.make_machine("HPM 800U", "hall 3")
    assert made.identification is None
    assert client.machine(made.id) == made
    assert list(client.machines()) == [made]
    assert refused(409, client.make_machine, "HPM 800U").errors[0].field == "name"
    client.forget_machine(made.id)
    refused(404, client.machine, made.id)
    refused(404, client.forget_machine, made.id)
    # the name is free again
    assert client.make_machine("HPM 800U").id != made.id


def test_a_repeated_query_makes_one_machine(client):
    first = client.make_machine("a", repeat="k1")
    assert client.make_machine("a", repeat="k1") == first
    assert refused(409, client.make_machine, "b", repeat="k1").errors[0].field == "idempotency key"
    assert len(list(client.machines())) == 1
    answer = client.send("POST", "/machines", json={"name": "c"})
    assert answer.headers["location"] == f"/v1/machines/{answer.json()['id']}"


def test_lists_come_in_parts(client):
    names = [f"m{k}" for k in range(7)]
    made = [client.make_machine(name) for name in names]
    assert sorted(m.id for m in made) == [m.id for m in client.machines(limit=3)]
    part = client.send("GET", "/machines", params={"limit": 3}).json()
    assert len(part["items"]) == 3
    assert part["next"] == part["items"][-1]["id"]
    assert client.send("GET", "/machines", params={"limit": 7}).json()["next"] is None
    for query in ({"limit": 0}, {"limit": 201}, {"after": "../x"}):
        refused(422, client.send, "GET", "/machines", params=query)


def test_an_identification_comes_back_as_it_was_written(client, result):
    id = client.make_machine("m").id
    refused(404, client.identification, id)
    answer = client.send("PUT", f"/machines/{id}/identification", content=result, headers={"Content-Type": "application/json"})
    assert answer.status_code == 201
    summary = answer.json()
    assert summary["status"] == "suspect"
    assert summary["axes"] == ["X", "Y"]
    assert answer.headers["etag"] == f'"{summary["etag"]}"'
    back = client.send("GET", f"/machines/{id}/identification")
    assert back.text == result
    assert back.headers["etag"] == answer.headers["etag"]
    assert client.machine(id).identification.model_dump() == summary
    assert client.identification(id).seed == 7
    known = client.send("GET", f"/machines/{id}/identification", headers={"If-None-Match": back.headers["etag"]})
    assert known.status_code == 304
    assert known.content == b""


def test_nobody_overwrites_what_he_has_not_seen(client, result, tmp_path):
    id = client.make_machine("m").id
    first = client.identify(id, result)
    other = by_hand.result_text(tmp_path, seed=8)
    refused(412, client.identify, id, other, seen="0" * 32)
    path, kind = f"/machines/{id}/identification", {"Content-Type": "application/json"}
    refused(412, client.send, "PUT", path, content=other, headers=kind | {"If-None-Match": "*"})
    second = client.identify(id, other, seen=first.etag)
    assert second.etag != first.etag
    refused(412, client.identify, id, result, seen=first.etag)
    for tags in ("*", f'"x", "{second.etag}"'):
        assert client.send("PUT", path, content=other, headers=kind | {"If-Match": tags}).status_code == 200
    refused(412, client.send, "PUT", path, content=other, headers=kind | {"If-Match": '"x", "y"'})
    assert client.identification(id).seed == 8


def test_modes_with_their_uncertainties(shop, result):
    client, id = shop
    told = json.loads(result)["axes"]["X"]
    modes = client.modes(id)
    assert modes.notes == ["joint: its rotational damping cannot be told"]
    assert [m.natural_frequency_hz for m in modes.axes["X"].modes] == [m["natural_frequency_hz"] for m in told["modes"]]
    assert modes.axes["X"].joint == told["joint"]
    assert modes.axes["X"].misfit_per_point == 1.1


def test_the_flange_in_closed_form(shop):
    """sum phi phi / (iw - s) and its conjugate, beside what the service answers."""
    client, id = shop
    frf = client.frf(id, from_hz=500, to_hz=1500, step_hz=100)
    assert frf.frequency_hz == [500.0 + 100.0 * k for k in range(11)]
    modes, _ = by_hand.posterior(1.0, False, 3).machine(Dof.X)
    s = 2j * np.pi * np.array(frf.frequency_hz)
    expected = sum(p**2 / (s - a) + np.conj(p) ** 2 / (s - np.conj(a)) for p, a in zip(modes.phi[:, 0], modes.pole, strict=True))
    expected = expected + modes.residual[0, 0]
    np.testing.assert_allclose(np.array(frf.axes["X"].re) + 1j * np.array(frf.axes["X"].im), expected, rtol=1e-9)
    assert min(frf.axes["X"].re_std) > 0.0
    refused(422, client.frf, id, from_hz=500, to_hz=400)
    refused(422, client.frf, id, from_hz=1, to_hz=20000, step_hz=0.01)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"status": "perfect"}, "status"),
        ({"band_hz": [600.0, 1e12]}, "band_hz"),
        ({"axes": {}}, "axes"),
        ({"axes": {"Z": {}}}, "axes"),
        ({"speed_bands": [{}] * 21}, "speed_bands"),
        ({"seed": -1}, "seed"),
    ],
)
def test_a_result_that_the_commands_would_refuse(client, tmp_path, change, field):
    id = client.make_machine("m").id
    assert field in refused(422, client.identify, id, by_hand.result_text(tmp_path, **change)).errors[0].field
    refused(404, client.identification, id)


def test_unknowns_without_a_finite_machine_are_refused(client, result):
    id = client.make_machine("m").id
    data = json.loads(result)
    data["axes"]["X"]["unknowns"][0] = 800.0
    assert refused(422, client.identify, id, json.dumps(data)).errors[0].field == "axes"
    data["axes"]["X"]["unknowns"] = [0.0] * 3
    assert "unknowns" in refused(422, client.identify, id, json.dumps(data)).errors[0].field
    data["axes"]["X"]["modes"] *= 40
    assert refused(422, client.identify, id, json.dumps(data)).errors[0].field == "axes.X.modes"


def test_a_failed_identification_is_kept_but_nothing_to_compute_with(client, tmp_path):
    id = client.make_machine("m").id
    client.identify(id, by_hand.result_text(tmp_path, status="failed", axes={}))
    assert client.machine(id).identification.axes == []
    assert client.modes(id).axes == {}
    assert "failed" in refused(422, client.frf, id).detail
    assert refused(422, client.lobes, id, by_hand_json()).errors[0].field == "machine"


def by_hand_json():
    import tomllib

    return tomllib.loads(by_hand.TOOLING)


def test_nobody_elses_machine(guarded_http, result):
    http, keys = guarded_http
    mine, theirs = Client(key=keys["admin"], http=http), Client(key=keys["other"], http=http)
    id = mine.make_machine("m", repeat="k").id
    mine.identify(id, result)
    mine.write_tooling("T1", by_hand.TOOLING)
    for call in (theirs.machine, theirs.forget_machine, theirs.identification, theirs.modes, theirs.frf):
        refused(404, call, id)
    refused(404, theirs.identify, id, result)
    refused(404, theirs.tooling, "T1")
    refused(404, theirs.forget_tooling, "T1")
    for call in (theirs.tooltip, theirs.lobes):
        refused(404, call, id, "T1")
    assert list(theirs.machines()) == list(theirs.toolings()) == []
    # the same names and the same idempotency key are free for them
    assert theirs.make_machine("m", repeat="k").id != id
