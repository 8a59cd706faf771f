"""Forces of a recording through the service: the commands' figures, both forms of the query, hostile files, the replay."""

from __future__ import annotations

import io
import json

import h5py
import numpy as np
import pytest

from api.client import Client, ServiceError
from rcsa_ident.io.curves.forces import read_forces_csv
from rcsa_ident.signals.spectra import line_spectrum
from tests.api.recordings import declared
from tests.api.streaming import STREAM, closed, send, streaming, until
from tests.api.test_streams import joined
from tests.fixtures.force_stream import CHANNELS, RATE, SENSORS, result, signals, streamed
from tests.fixtures.service import example
from tests.fixtures.virtual_cut import relative_error

#: Of the recordings below [s].
AIR, CUT = (0.2, 0.7), (2.0, 2.5)


@pytest.fixture(scope="module")
def shop(tmp_path_factory):
    with streaming(tmp_path_factory.mktemp("forces")) as found:
        yield found


def file(begin: float, end: float, *, rate: bool = True) -> bytes:
    """An HDF5 recording."""
    held = io.BytesIO()
    with h5py.File(held, "w") as made:
        if rate:
            made.attrs["sampling_rate_hz"] = RATE
        for name, signal in zip(CHANNELS, signals(begin, end).T, strict=True):
            made[name] = signal.astype(np.float32)
    return held.getvalue()


def query(id: str, **changed) -> bytes:
    return json.dumps({"machine": id, "tooling": "T1", "spindle_speed_rpm": 12000} | changed).encode()


def post(http, id, recording=None, air=None, accept=None, name="cut.h5", **changed):
    files = {"recording": (name, file(*CUT) if recording is None else recording)}
    if air is not None:
        files["air"] = ("air.h5", air)
    headers = {} if accept is None else {"Accept": accept}
    return http.post("/v1/forces", data={"query": query(id, **changed)}, files=files, headers=headers)


def true_force() -> np.ndarray:
    return streamed()[1][round(CUT[0] * RATE) : round(CUT[1] * RATE)]


def campaign_keys(**changed):
    keys = declared(2)
    keys["campaign"]["sampling_rate_hz"] = RATE
    keys["sensors"] = SENSORS
    keys["toolings"] = {"T1": "T1"}
    for cut in keys["cuts"]:
        cut |= {"spindle_speed_rpm": 12000.0}
    return keys | changed


@pytest.fixture(scope="module")
def campaign(shop):
    """A campaign with one cut, its air cut, and a cut of which nothing is uploaded."""
    http, machine = shop
    made = http.post(f"/v1/machines/{machine}/campaigns", json=campaign_keys())
    assert made.status_code == 201, made.text
    id = made.json()["id"]
    for name, span in (("c0_cut.h5", CUT), ("c0_air.h5", AIR)):
        put = http.put(f"/v1/campaigns/{id}/recordings/{name}", content=file(*span), headers={"Content-Type": "application/octet-stream"})
        assert put.status_code == 201, put.text
    return id


@pytest.mark.slow
def test_forces_of_an_upload_are_true(shop):
    http, machine = shop
    answer = post(http, machine, air=file(*AIR))
    assert answer.status_code == 200, answer.text
    found, true = answer.json(), true_force()
    assert found["spindle_speed_rpm"] == pytest.approx(12000.0, rel=1e-5)
    assert found["sampling_rate_hz"] == RATE
    low, high = found["band_hz"]
    assert low < 400.0 < 4000.0 < high
    assert found["wear"] is None
    assert len(found["time_s"]) <= 2000
    assert found["left_out_s"] == found["time_s"][0] > 0.0
    assert np.diff(found["time_s"]) == pytest.approx(found["time_s"][1] - found["time_s"][0])
    amplitude = np.abs(line_spectrum(true, RATE, 400.0 * np.pi, 4200.0).amplitude)
    for i, axis in enumerate("XY"):
        own = found["axes"][axis]
        assert len(own["low"]) == len(own["high"]) == len(found["time_s"])
        assert np.all(np.array(own["low"]) <= own["high"])
        assert own["rms_n"] == pytest.approx(np.std(true[:, i]), rel=0.03)
        assert own["peak_n"] == pytest.approx(np.max(np.abs(true[:, i] - true[:, i].mean())), rel=0.1)
        assert own["mean_n"] is None
        assert 0.0 < own["std_n"] < 0.2 * own["rms_n"]
        lines = {line["order"]: line for line in found["harmonics"][axis]}
        assert lines[4]["frequency_hz"] == pytest.approx(800.0, rel=1e-5)
        assert lines[4]["amplitude_n"] == pytest.approx(amplitude[4, i], rel=0.04)


@pytest.mark.slow
def test_every_sample_as_a_file(shop, tmp_path):
    http, machine = shop
    answer = post(http, machine, air=file(*AIR), accept="text/csv")
    assert answer.status_code == 200
    assert answer.headers["content-type"].startswith("text/csv")
    (tmp_path / "FORCES.csv").write_bytes(answer.content)
    time, force, deviation = read_forces_csv(tmp_path / "FORCES.csv")
    assert time[1] - time[0] == pytest.approx(1.0 / RATE)
    assert time[-1] == pytest.approx((len(true_force()) - 1) / RATE)
    both = np.stack([force["X"], force["Y"]], axis=1)
    assert np.all(relative_error(both, true_force(), RATE) < 0.05)
    assert set(deviation) == {"X", "Y"}
    # nothing stays
    assert not [path for path in http.app.state.components.files.folder.rglob("*") if path.is_file() and "parts" in str(path)]


@pytest.mark.slow
def test_without_an_air_cut_it_is_told(shop):
    http, machine = shop
    found = post(http, machine).json()
    assert any("no air cut" in note for note in found["notes"])


@pytest.mark.slow
def test_mean_wear_smoothing_and_the_papers_method(shop):
    http, machine = shop
    cut = {"axial_depth_mm": 1.0, "feed_per_tooth_mm": 0.15, "immersion": 0.5, "strategy": "down"}
    found = post(http, machine, air=file(*AIR), idle_percent=40.0, cut=cut, smooth=True).json()
    for axis in "XY":
        assert found["axes"][axis]["mean_n"] is not None
    names = found["wear"]["coefficients"]
    assert found["wear"]["separable"]
    assert names["K_tc"]["unit"] == "MPa"
    assert names["K_tc"]["mean"] == pytest.approx(902.0, rel=0.05)
    paper = post(http, machine, air=file(*AIR), method="paper").json()
    assert paper["axes"]["X"]["rms_n"] != found["axes"]["X"]["rms_n"]


@pytest.mark.slow
def test_a_recording_of_a_campaign_with_its_air_cut(shop, campaign):
    http, machine = shop
    body = {"machine": machine, "campaign": campaign, "recording": "c0_cut.h5"}
    answer = http.post("/v1/forces", json=body)
    assert answer.status_code == 200, answer.text
    direct = post(http, machine, air=file(*AIR)).json()
    assert answer.json() == direct
    for change, status in (
        ({"recording": "c1_cut.h5"}, 404),
        ({"recording": "c0_air.h5"}, 404),
        ({"recording": "../c0_cut.h5"}, 422),
        ({"campaign": "nobody"}, 404),
        ({"machine": "nobody"}, 404),
        ({"tooling": "nobody"}, 404),
        ({"more": 1}, 422),
    ):
        assert http.post("/v1/forces", json=body | change).status_code == status, change


def fields(answer):
    assert answer.headers["content-type"] == "application/problem+json"
    return [error["field"] for error in answer.json().get("errors", [])]


@pytest.mark.slow
def test_bad_queries_are_named(shop):
    http, machine = shop
    for change, status, field in (
        ({"machine": "nobody"}, 404, None),
        ({"tooling": "nobody"}, 404, None),
        ({"tooling": example(tool={"stickout_mm": -1.0, "segments": []})}, 422, None),
        ({"spindle_speed_rpm": None}, 422, "spindle_speed_rpm"),
        ({"spindle_speed_rpm": 9000}, 422, "spindle_speed_rpm"),
        ({"spindle_speed_rpm": float("nan")}, 422, None),
        ({"sensors": {}}, 422, "sensors"),
        ({"sensors": {"nothing": {"quantity": "displacement", "axis": "X"}}}, 422, None),
        ({"sensors": {"fix_x": {"quantity": "acceleration", "axis": "X"}}}, 422, "sensors"),
        ({"idle_percent": 0.0}, 422, "idle_percent"),
        ({"cut": {"axial_depth_mm": 1.0, "feed_per_tooth_mm": 0.1, "entry_deg": 10.0}}, 422, "cut.exit_deg"),
        ({"cut": {"axial_depth_mm": 1.0}}, 422, "cut.feed_per_tooth_mm"),
        ({"method": "guess"}, 422, "method"),
    ):
        answer = post(http, machine, **change)
        assert answer.status_code == status, (change, answer.text)
        assert field is None or field in fields(answer), (change, answer.text)


@pytest.mark.slow
def test_bad_files_are_named(shop):
    http, machine = shop
    lost = signals(*CUT)
    lost[100:200, 0] = np.nan
    for name, content, field in (
        ("cut.h5", b"no HDF5", "recording"),
        ("cut.h5", file(*CUT)[:5000], "recording"),
        ("cut.h5", file(2.0, 2.02), "recording"),
        ("cut.h5", file(*CUT, rate=False), "sampling_rate_hz"),
        ("cut.exe", b"MZ", "recording"),
        ("", b"x", None),
        ("cut.csv", b"gap_x,gap_y\n1,2\n", None),
        ("cut.pkl", b"cos\nsystem\n", "recording"),
    ):
        answer = post(http, machine, content, name=name)
        assert answer.status_code == 422, (name, answer.text)
        assert field is None or field in fields(answer), (name, answer.text)
        assert "/" not in answer.json()["detail"].replace("rev/min", "").replace("and/or", ""), answer.text


@pytest.mark.slow
def test_bad_forms(shop):
    http, machine = shop
    kind = {"Content-Type": "multipart/form-data; boundary=b"}
    part = b'--b\r\nContent-Disposition: form-data; name="query"\r\n\r\n' + query(machine)
    for body, headers, status in (
        (b"", kind, 400),
        (b"nonsense", kind, 400),
        (part, kind, 400),
        (part + b"\r\n--b--\r\n", kind, 422),
        (part + b"\r\n" + part + b"\r\n--b--\r\n", kind, 422),
        (part.replace(b'"query"', b'"more"') + b"\r\n--b--\r\n", kind, 422),
        (part, {"Content-Type": "multipart/form-data"}, 400),
        (query(machine), {"Content-Type": "text/plain"}, 415),
        (b"{", {"Content-Type": "application/json"}, 422),
    ):
        answer = http.post("/v1/forces", content=body, headers=headers)
        assert answer.status_code == status, (body[:80], answer.text)
        assert answer.headers["content-type"] == "application/problem+json"
    files = {"recording": ("cut.h5", b"x"), "query": (None, b'{"machine": 1}')}
    assert http.post("/v1/forces", files=files).status_code == 422


@pytest.mark.slow
def test_an_identification_without_sensors(tmp_path):
    with streaming(tmp_path) as (http, _):
        machine = http.post("/v1/machines", json={"name": "other"}).json()["id"]
        assert post(http, machine).status_code == 404
        bare = json.loads(result()) | {"sensors": {}}
        http.put(f"/v1/machines/{machine}/identification", content=json.dumps(bare), headers={"Content-Type": "application/json"})
        answer = post(http, machine)
        assert answer.status_code == 422
        assert fields(answer) == ["sensors"]
        assert post(http, machine, sensors=SENSORS).status_code == 200


@pytest.mark.slow
def test_a_replay_gives_the_forces_of_the_recording(shop, campaign, tmp_path):
    """To the last digit, through the same path as a live stream, at a hundred times its pace."""
    http, machine = shop
    body = {"machine": machine, "campaign": campaign, "recording": "c0_cut.h5"}
    (tmp_path / "FORCES.csv").write_bytes(http.post("/v1/forces", json=body, headers={"Accept": "text/csv"}).content)
    _, force, _ = read_forces_csv(tmp_path / "FORCES.csv")
    with http.websocket_connect(STREAM) as socket:
        socket.send_json({"replay": {"campaign": campaign, "recording": "c0_cut.h5", "rate": 100.0}, "format": "json"})
        opened = until(socket, "opened")[0]
        assert opened["settle_samples"] == 0
        ready = until(socket, "ready")[0]
        assert not any("no air cut" in note for note in ready["notes"])
        end, frames = until(socket, "end")
        assert closed(socket) == (1000, {})
    assert (end["lost"], end["dropped"]) == (0, 0)
    assert end["settling"] == ready["first"] > 0
    assert end["samples"] == end["settling"] + len(force["X"])
    expected = np.stack([force["X"], force["Y"]], axis=1)
    np.testing.assert_allclose(joined(frames), expected, rtol=0, atol=1e-9 * np.abs(expected).max())


@pytest.mark.slow
def test_a_replay_keeps_its_pace_and_takes_no_samples(shop, campaign):
    http, machine = shop
    with http.websocket_connect(STREAM) as socket:
        socket.send_json({"replay": {"campaign": campaign, "recording": "c0_cut.h5", "rate": 0.1}, "envelope": 100})
        until(socket, "ready")
        # five seconds at this pace: after one it is not over
        status = [until(socket, "status", "end")[0] for _ in range(2)][1]
        assert status["stage"] == "live"
        (item,) = http.get("/v1/forces/streams").json()["items"]
        assert (item["name"], item["machine"], item["tooling"]) == ("c0_cut.h5", machine, "T1")
        assert 0 < status["samples"] < 0.5 * 0.5 * RATE
        socket.send_bytes(b"\0" * 16)
        code, problem = closed(socket)
    assert (code, problem["status"]) == (1003, 415)


@pytest.mark.slow
def test_an_uploaded_air_cut_serves_a_live_stream(shop, campaign):
    http, machine = shop
    first = {
        "machine": machine, "tooling": "T1", "spindle_speed_rpm": 12000, "sampling_rate_hz": RATE, "channels": CHANNELS, "settle_s": 0.2,
        "air": {"campaign": campaign, "recording": "c0_air.h5"},
    }  # fmt: skip
    raw, true = signals(2.0, 3.0), streamed()[1][round(2.0 * RATE) : round(3.0 * RATE)]
    with http.websocket_connect(STREAM) as socket:
        socket.send_json(first)
        send(socket, 0, raw)
        assert not any("no air cut" in note for note in until(socket, "ready")[0]["notes"])
        socket.send_json({"event": "end"})
        frames = until(socket, "end")[1]
    assert np.all(relative_error(joined(frames), true, RATE) < 0.05)


@pytest.mark.slow
def test_the_client_asks_for_forces(shop, campaign, tmp_path):
    http, machine = shop
    client = Client(http=http)
    for name, span in (("cut.h5", CUT), ("air.h5", AIR)):
        (tmp_path / name).write_bytes(file(*span))
    found = client.forces(machine, "T1", tmp_path / "cut.h5", tmp_path / "air.h5", spindle_speed_rpm=12000)
    assert found == client.forces_of_campaign(machine, campaign, "c0_cut.h5")
    assert found.axes["X"].rms_n > 10.0
    text = client.forces_file(machine, "T1", tmp_path / "cut.h5", spindle_speed_rpm=12000)
    assert text.startswith("time_s,Fx_n,Fy_n")
    assert client.streams() == []
    with pytest.raises(ServiceError, match="spindle_speed_rpm"):
        client.forces(machine, "T1", tmp_path / "cut.h5")
