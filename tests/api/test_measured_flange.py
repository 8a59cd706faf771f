"""A flange that was measured, over REST: written as text/csv, asked like an identified machine, given back as it came."""

from __future__ import annotations

import io
import json

import h5py
import numpy as np
import pytest

from api.client import Client
from rcsa_ident.io.curves.flanges import write_flange_machine
from rcsa_ident.io.curves.forces import read_forces_csv
from tests.api.in_process import refused
from tests.fixtures import by_hand
from tests.fixtures.flange_machine import decoupled_file, flange_machine
from tests.fixtures.force_stream import CHANNELS, RATE, SENSORS, signals, streamed
from tests.fixtures.force_stream import tooling as stream_tooling
from tests.fixtures.virtual_cut import relative_error

SPEEDS = {"from_rpm": 6000, "to_rpm": 9000, "step_rpm": 500}
#: Of the workpiece that a result knows and a measurement does not.
CUT = {"ktc_mpa": 902.0, "krc": 0.26, "kre_n_per_mm": 5.0}
CSV = {"Content-Type": "text/csv"}


@pytest.fixture
def text(tmp_path):
    return by_hand.flange_file(tmp_path / "FLANGE.csv").read_text(encoding="utf-8")


@pytest.fixture
def measured(shop, text):
    """The shop's machine, and one that is known by the measured flange of the same spindle."""
    client, identified = shop
    id = client.make_machine("measured").id
    client.identify(id, text)
    return client, id, identified


def test_it_is_kept_as_it_came(http, client, text):
    id = client.make_machine("m").id
    path = f"/v1/machines/{id}/identification"
    written = http.put(path, content=text.encode(), headers=CSV)
    assert written.status_code == 201, written.text
    summary = written.json()
    assert (summary["status"], summary["axes"], summary["campaign"], summary["reasons"]) == ("measured", ["X", "Y"], "", [])
    assert summary["band_hz"] == pytest.approx([100.0, 3000.0])
    back = http.get(path)
    assert back.content == text.encode()
    assert back.headers["content-type"].startswith("text/csv")
    assert client.machine(id).identification.status == "measured"
    # the same file again is no change, and whoever knows the etag need not read it twice
    assert http.get(path, headers={"If-None-Match": back.headers["etag"]}).status_code == 304
    again = http.put(path, content=text.encode(), headers=CSV | {"If-Match": back.headers["etag"]})
    assert again.status_code == 200
    assert http.put(path, content=text.encode(), headers=CSV | {"If-None-Match": "*"}).status_code == 412


def test_a_result_takes_its_place_and_gives_it_back(measured, result, text, http):
    client, id, _ = measured
    assert client.identify(id, result).status == "suspect"
    assert http.get(f"/v1/machines/{id}/identification").headers["content-type"].startswith("application/json")
    assert client.modes(id).axes["X"].modes
    assert client.identify(id, text).status == "measured"
    problem = refused(422, client.modes, id)
    assert "has no modes" in problem.detail
    assert problem.errors[0].field == "machine"


def test_the_tip_and_the_flange_are_those_of_the_machine_that_was_measured(measured):
    client, id, identified = measured
    own, other = (client.tooltip(machine, "T1", bands=False) for machine in (id, identified))
    assert own.frequency_hz == other.frequency_hz
    assert own.warnings == []
    for axis, curve in own.axes.items():
        here, there = (np.array(c.re) + 1j * np.array(c.im) for c in (curve, other.axes[axis]))
        np.testing.assert_allclose(here, there, rtol=1e-7)
    assert client.tooltip(id, "T1").axes["X"].re_std is None
    assert client.tooltip_file(id, "T1").splitlines()[0].startswith("frequency_hz,X_re,X_im")
    assert client.frf(id).frequency_hz[0] == 100.0
    assert "where the flange was measured" in refused(422, client.tooltip, id, "T1", to_hz=4000).detail
    assert "where the flange was measured" in refused(422, client.frf, id, from_hz=50).detail


def test_curves_begin_where_the_measurement_begins(client, text):
    head, *rows = text.splitlines()
    id = client.make_machine("m").id
    client.identify(id, "\n".join([head, *rows[400:]]) + "\n")
    client.write_tooling("T1", by_hand.TOOLING)
    assert client.tooltip(id, "T1").frequency_hz[0] == client.frf(id).frequency_hz[0] == 500.0


@pytest.mark.slow
@pytest.mark.parametrize("method", ["zero-order", "multi-frequency"])
def test_lobes_are_those_of_the_machine_that_was_measured(measured, method):
    client, id, identified = measured
    asked = {"speeds": SPEEDS | {"step_rpm": 1500}, "cut": CUT, "method": method}
    (own,), (other,) = (client.lobes(machine, "T1", bands=machine == id, **asked).toolings for machine in (id, identified))
    np.testing.assert_allclose(own.limit_depth_mm, other.limit_depth_mm, rtol=1e-6)
    # a preview recommends nothing
    depths = [np.array(each.recommended_depth_mm, dtype=float) for each in (own, other)]
    assert np.isnan(depths[0]).all() == (method == "zero-order")
    np.testing.assert_allclose(*depths, rtol=1e-6)
    assert own.limit_depth_low_mm is None
    assert not any("identification" in w for w in own.warnings)


@pytest.mark.slow
def test_advice_is_that_of_the_machine_that_was_measured(measured):
    client, id, identified = measured
    asked = {"speeds": SPEEDS, "cut": CUT | {"feed_per_tooth_mm": 0.1}, "bands": False}
    (own,), (other,) = (client.advice(machine, "T1", **asked).toolings for machine in (id, identified))
    assert own.highest_removal
    for one, two in zip(own.highest_removal, other.highest_removal, strict=True):
        numbers, others = one.model_dump(), two.model_dump()
        assert numbers.pop("bound") == others.pop("bound")
        assert numbers.pop("why") is others.pop("why") is None
        steps, further = numbers.pop("held_back"), others.pop("held_back")
        assert steps.pop("in_words")
        assert further.pop("in_words")
        assert steps.pop("with_probability_mm") is further.pop("with_probability_mm") is None
        assert steps == pytest.approx(further, rel=2e-3)
        # through modes that were fitted to either
        assert numbers == pytest.approx(others, rel=2e-3)
    assert own.common_stable_depth_mm is None


@pytest.mark.parametrize(
    ("cut", "field"),
    [
        ({}, "cut.ktc_mpa"),
        ({"krc": 0.26}, "cut.ktc_mpa"),
        ({"ktc_mpa": 902}, "cut.krc"),
        ({"ktc_mpa": 0.5, "krc": 0.26}, "cut.ktc_mpa"),
        ({"ktc_mpa": 902, "krc": 9}, "cut.krc"),
        (CUT | {"runout_um": [1, 2, 3]}, "cut.runout_um"),
        (CUT | {"runout_um": [1, 2, 3, "a"]}, "cut.runout_um.3"),
    ],
)
def test_what_cuts_has_to_be_said_and_keeps_its_name(measured, cut, field):
    client, id, _ = measured
    assert refused(422, client.lobes, id, "T1", speeds=SPEEDS, cut=cut).errors[0].field == field
    with_feed = cut | {"feed_per_tooth_mm": 0.1}
    assert refused(422, client.advice, id, "T1", speeds=SPEEDS, cut=with_feed).errors[0].field == field


def test_run_out_without_a_feed_asks_for_it(measured):
    client, id, _ = measured
    asked = {"speeds": {"from_rpm": 8000, "to_rpm": 8000}, "method": "full-discretisation", "cut": CUT | {"runout_um": [10, 0, 0, 0]}}
    assert refused(422, client.lobes, id, "T1", **asked).errors[0].field == "cut.feed_per_tooth_mm"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda text: text.replace("X_tM_re", "X_tm_re"), "column X_tM_re: found nothing"),
        (lambda text: text.replace("\n101.0,", "\nalmost,"), "line 3, column frequency_hz: found almost"),
        (lambda text: text.replace("\n101.0,", "\n99.0,"), "frequenc"),
        (lambda text: text.replace("\n101.0,", "\n1e9,"), "frequenc"),
        (lambda text: text.replace("\n3000.0,", "\n30000.0,"), "at most 20000 Hz"),
        (lambda text: "\n".join(text.splitlines()[:3]), "at least four"),
        (lambda text: "frequency_hz,speed\n1,2\n", "no columns X_tF_re or Y_tF_re"),
        (lambda text: "", "flange"),
        (lambda text: "nonsense", "flange"),
    ],
)
def test_a_broken_flange_is_refused_in_words(http, client, text, change, words):
    id = client.make_machine("m").id
    answer = http.put(f"/v1/machines/{id}/identification", content=change(text).encode(), headers=CSV)
    assert answer.status_code == 422, answer.text
    problem = answer.json()
    assert words in problem["detail"], problem
    assert problem["errors"]
    assert client.machine(id).identification is None


def test_other_types_are_not_taken(http, client, text):
    id = client.make_machine("m").id
    answer = http.put(f"/v1/machines/{id}/identification", content=text.encode(), headers={"Content-Type": "application/toml"})
    assert answer.status_code == 415


def recording(begin: float, end: float) -> bytes:
    """An HDF5 file."""
    held = io.BytesIO()
    with h5py.File(held, "w") as made:
        made.attrs["sampling_rate_hz"] = RATE
        for name, signal in zip(CHANNELS, signals(begin, end).T, strict=True):
            made[name] = signal.astype(np.float32)
    return held.getvalue()


@pytest.mark.slow
def test_forces_with_the_sensors_of_the_query(client: Client, http, tmp_path):
    """The file holds the bare flange and the joint in front of it, behind which the sensor looks."""
    write_flange_machine(tmp_path / "FLANGE.csv", flange_machine())
    id = client.make_machine("m").id
    client.identify(id, (tmp_path / "FLANGE.csv").read_text(encoding="utf-8"))
    client.write_tooling("T1", stream_tooling())
    query = {"machine": id, "tooling": "T1", "spindle_speed_rpm": 12000, "sensors": SENSORS}
    files = {"recording": ("cut.h5", recording(2.0, 2.5)), "air": ("air.h5", recording(0.2, 0.7))}
    answer = http.post("/v1/forces", data={"query": json.dumps(query)}, files=files, headers={"Accept": "text/csv"})
    assert answer.status_code == 200, answer.text
    (tmp_path / "FORCES.csv").write_bytes(answer.content)
    _, force, _ = read_forces_csv(tmp_path / "FORCES.csv")
    true = streamed()[1][round(2.0 * RATE) : round(2.5 * RATE)]
    assert np.all(relative_error(np.stack([force["X"], force["Y"]], axis=1), true, RATE) < 0.03)
    without = {name: value for name, value in query.items() if name != "sensors"}
    problem = http.post("/v1/forces", data={"query": json.dumps(without)}, files=files)
    assert problem.status_code == 422
    assert problem.json()["errors"][0]["field"] == "sensors"
    # a flange that was decoupled from hammer tests tells the tip, and not what the sensor sees
    client.identify(id, decoupled_file(tmp_path / "DECOUPLED.csv").read_text(encoding="utf-8"))
    problem = http.post("/v1/forces", data={"query": json.dumps(query)}, files=files)
    assert problem.status_code == 422
    assert problem.json()["errors"][0]["field"] == "machine"
    assert "a flange that holds the compliance of its joint" in problem.json()["detail"]


def test_a_flange_measured_too_coarsely_is_said(client, text):
    head, *rows = text.splitlines()
    id = client.make_machine("m").id
    client.identify(id, "\n".join([head, *rows[::60]]) + "\n")
    client.write_tooling("T1", by_hand.TOOLING)
    (lobes,) = client.lobes(id, "T1", speeds=SPEEDS, cut=CUT, recommend=False).toolings
    for warnings in (client.tooltip(id, "T1").warnings, lobes.warnings):
        for axis in "XY":
            assert any(w.startswith(f"{axis}: flange measured too coarsely") for w in warnings)
