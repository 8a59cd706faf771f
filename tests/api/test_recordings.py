"""Recordings: uploaded at once, in parts and together, in every format; what is found in them, and what is given back."""

from __future__ import annotations

import base64
import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from api.files import NORMALISED, UPLOADS
from api.reading.samples import read_normalised
from rcsa_ident.io.recordings.hdf5 import write_hdf5
from rcsa_ident.io.recordings.readers import read_recording
from rcsa_ident.signals.recording import Quantity, Sensor
from tests.api.in_process import refused
from tests.api.recordings import RATE, RPM, channels, content, declared, pair
from tests.fixtures.recording_formats import FORMATS

BINARY = {"Content-Type": "application/octet-stream"}


@pytest.fixture
def campaign(client):
    return client.make_campaign(client.make_machine("m").id, declared(2)).id


def made(folder, name, seed=0, air=False, **changed):
    path = folder / name
    path.write_bytes(content(folder, seed, air, **changed))
    return path


def digest(raw):
    return {"Repr-Digest": f"sha-256=:{base64.b64encode(hashlib.sha256(raw).digest()).decode()}:"}


def files_in(folder):
    return [p for p in (folder / "files").rglob("*") if p.is_file()]


def test_an_upload_tells_what_is_in_it(client, campaign, tmp_path):
    path = made(tmp_path, "c0_cut.h5")
    found = client.upload(campaign, path)
    assert (found.name, found.role, found.cuts, found.size_bytes) == ("c0_cut.h5", "cut", ["c0"], path.stat().st_size)
    assert found.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert (found.sampling_rate_hz, found.duration_s) == (RATE, pytest.approx(0.28))
    assert found.channels == ["flange_x", "flange_y", "fixture_x", "fixture_y"]
    assert found.spindle_speed_rpm == pytest.approx(pair().speed * 30.0 / np.pi, rel=1e-5)
    # 600 Hz of tooth passing up to 4300 Hz
    assert found.harmonics_above_noise == {"X": 7, "Y": 7}
    assert found.verdict.usable
    assert found.verdict.notes[0].startswith("no air cut")
    assert found.verdict.lines == 14
    assert min(found.verdict.signal_to_noise_db.values()) > 20.0
    assert client.recording(campaign, "c0_cut.h5") == found
    assert list(client.recordings(campaign)) == [found]
    assert client.campaign(campaign).cuts[0].verdict == found.verdict
    client.recording_file(campaign, "c0_cut.h5", tmp_path / "back")
    assert (tmp_path / "back").read_bytes() == path.read_bytes()


def test_the_same_again_changes_nothing_and_another_content_needs_a_word(client, campaign, tmp_path):
    url, raw, other = f"/v1/campaigns/{campaign}/recordings/c0_cut.h5", content(tmp_path), content(tmp_path, 1)
    first = client.http.put(url, content=raw, headers=BINARY)
    assert first.status_code == 201
    again = client.http.put(url, content=raw, headers=BINARY | digest(raw))
    assert (again.status_code, again.json()) == (200, first.json())
    assert first.headers["etag"] == f'"{hashlib.sha256(raw).hexdigest()}"'
    assert client.http.put(url, content=other, headers=BINARY).status_code == 409
    assert client.http.get(url).json() == first.json()
    assert len(files_in(tmp_path)) == 2
    replaced = client.http.put(f"{url}?replace=true", content=other, headers=BINARY)
    assert replaced.status_code == 201
    assert client.http.get(url).json()["sha256"] == hashlib.sha256(other).hexdigest()
    # nothing of the first is left
    assert len(files_in(tmp_path)) == 2
    assert client.http.put(f"{url}?replace=true", content=other, headers=BINARY).status_code == 200


@pytest.mark.slow
def test_air_cuts_come_and_go_and_verdicts_with_them(client, campaign, tmp_path):
    def verdict():
        return client.campaign(campaign).cuts[0].verdict

    client.upload(campaign, made(tmp_path, "c0_cut.h5"))
    alone = verdict()
    air = client.upload(campaign, made(tmp_path, "c0_air.h5", air=True))
    assert (air.role, air.verdict.usable, air.verdict.lines) == ("air", True, 0)
    assert air.harmonics_above_noise["X"] >= 8
    beside = verdict()
    assert (alone.notes != [], beside.notes) == (True, [])
    assert beside.signal_to_noise_db != alone.signal_to_noise_db
    # an air cut that is none takes the cut down
    silent = made(tmp_path, "c0_air.h5", air=True, flange_x=np.zeros(7168, np.float32))
    replaced = client.upload(campaign, silent, replace=True)
    assert not replaced.verdict.usable
    assert verdict().reasons == ["air cut: no signal: flange_x has the constant value 0"]
    client.forget_recording(campaign, "c0_air.h5")
    assert verdict() == alone
    refused(404, client.forget_recording, campaign, "c0_air.h5")
    client.upload(campaign, made(tmp_path, "c0_air.h5", air=True))
    assert verdict() == beside
    client.forget_recording(campaign, "c0_cut.h5")
    assert verdict() is None
    client.upload(campaign, made(tmp_path, "c0_cut.h5"))
    assert verdict() == beside


def test_an_air_cut_may_serve_several_cuts(client, tmp_path):
    data = declared(2)
    data["cuts"][1]["air"] = "c0_air.h5"
    id = client.make_campaign(client.make_machine("m").id, data).id
    for k in range(2):
        client.upload(id, made(tmp_path, f"c{k}_cut.h5", k))
    assert client.upload(id, made(tmp_path, "c0_air.h5", air=True)).cuts == ["c0", "c1"]
    assert all(not any(note.startswith("no air cut") for note in cut.verdict.notes) for cut in client.campaign(id).cuts)


def test_readable_is_kept_though_it_is_not_usable(client, campaign, tmp_path):
    lost = channels()["flange_x"].copy()
    lost[100] = np.nan
    found = client.upload(campaign, made(tmp_path, "c0_cut.h5", flange_x=lost))
    assert not found.verdict.usable
    assert found.verdict.reasons == ["drop-outs: 1 samples of flange_x are missing, the first at 0.003906 s"]
    assert (found.spindle_speed_rpm, found.harmonics_above_noise) == (None, {"X": 0, "Y": 0})
    time = np.arange(7168) / RATE
    shaken = channels()["flange_x"] + 0.02 * np.sin(2.0 * np.pi * 1234.5 * time)
    found = client.upload(campaign, made(tmp_path, "c1_cut.h5", flange_x=shaken))
    assert "chatter" in found.verdict.reasons[0]
    assert found.spindle_speed_rpm == pytest.approx(RPM, rel=2e-3)
    assert [(s.cuts, s.uploaded, s.usable) for s in client.campaigns(client.campaign(campaign).machine)] == [(2, 2, 0)]


def test_a_wrong_unit_leaves_a_note(client, campaign, tmp_path):
    """Metres declared as volts, and the other way round."""
    found = client.upload(campaign, made(tmp_path, "c0_cut.h5", flange_x=channels()["flange_x"] * 1e4))
    assert any("flange_x has a peak-to-peak amplitude of" in note for note in found.verdict.notes)
    tiny = {name: values * 1e-5 for name, values in channels(1).items()}
    found = client.upload(campaign, made(tmp_path, "c1_cut.h5", 1, **tiny))
    assert sum("check its unit and sensitivity" in note for note in found.verdict.notes) >= 2


@pytest.mark.slow
@pytest.mark.parametrize("kind", FORMATS)
def test_every_format_tells_the_same(client, tmp_path, kind):
    suffix, write, *_ = FORMATS[kind]
    id = client.make_campaign(client.make_machine("m").id, declared(suffix=suffix)).id
    # in the range of a converter
    volts = {name: 0.5 * values / np.abs(values).max() for name, values in channels().items()}
    path = tmp_path / f"c0_cut{suffix}"
    write(path, RATE, volts)
    found = client.upload(id, path)
    assert (found.sampling_rate_hz, found.duration_s) == (RATE, pytest.approx(0.28))
    assert found.spindle_speed_rpm == pytest.approx(pair().speed * 30.0 / np.pi, rel=1e-5)
    assert found.harmonics_above_noise["X"] >= 6
    parts = client.http.app.state.components
    row = parts.store.recordings.get("local", id, path.name)
    assert parts.files.path("local", UPLOADS, row.sha256).read_bytes() == path.read_bytes()
    sensors = tuple(Sensor(name, Quantity.TRIGGER) for name in volts)
    kept = read_normalised(parts.files.path("local", NORMALISED, row.normalised))
    direct = read_recording(path, sensors, RATE)
    for i, sensor in enumerate(kept.sensors):
        assert (kept.samples[:, i] == direct.samples[:, i] / sensor.sensitivity).all()


def test_the_checksum_is_compared(client, campaign, tmp_path):
    url, raw = f"/v1/campaigns/{campaign}/recordings/c0_cut.h5", content(tmp_path)
    wrong = digest(raw + b"x")
    for headers in (wrong, {"Content-Digest": wrong["Repr-Digest"]}):
        answer = client.http.put(url, content=raw, headers=BINARY | headers)
        assert (answer.status_code, "damaged" in answer.json()["detail"]) == (422, True)
    for text in ("sha-256=:AAAA:", "sha-256=x", "sha-256=:####:", "sha-256=::", "sha-512=:AAAA:, sha-256"):
        answer = client.http.put(url, content=raw, headers=BINARY | {"Repr-Digest": text})
        assert (answer.status_code, answer.json()["errors"][0]["field"]) == (422, "Repr-Digest")
    assert files_in(tmp_path) == []
    both = f"md5=:AAAA:, {digest(raw)['Repr-Digest']}"
    assert client.http.put(url, content=raw, headers=BINARY | {"Repr-Digest": both}).status_code == 201


def test_the_outline_and_the_spectrum(client, campaign, tmp_path):
    client.upload(campaign, made(tmp_path, "c0_cut.h5"))
    samples = pair().cut.samples
    signal = client.signal(campaign, "c0_cut.h5", points=100)
    assert len(signal.time_s) <= 100
    outline = signal.channels["flange_x"]
    assert (outline.unit, signal.channels["fixture_y"].unit) == ("m", "m/s^2")
    assert max(outline.high) == pytest.approx(samples[:, 0].max(), rel=1e-6)
    assert min(outline.low) == pytest.approx(samples[:, 0].min(), rel=1e-6)
    assert all(low <= high for low, high in zip(outline.low, outline.high, strict=True))
    spectrum = client.spectrum(campaign, "c0_cut.h5")
    assert len(spectrum.frequency_hz) <= 2000
    amplitude = np.array(spectrum.channels["fixture_x"].amplitude)
    strongest = spectrum.frequency_hz[int(np.argmax(amplitude))]
    passing = 4.0 * pair().speed / (2.0 * np.pi)
    assert strongest / passing == pytest.approx(round(strongest / passing), abs=0.02)
    assert spectrum.harmonics_hz[3] == pytest.approx(passing, rel=1e-4)
    assert spectrum.frequency_hz == sorted(spectrum.frequency_hz)
    for points in (9, 10_001):
        refused(422, client.signal, campaign, "c0_cut.h5", points=points)
    refused(404, client.spectrum, campaign, "c1_cut.h5")


def test_lost_samples_are_drawn_as_gaps(client, campaign, tmp_path):
    lost = channels()["flange_x"].copy()
    lost[:3000] = np.nan
    client.upload(campaign, made(tmp_path, "c0_cut.h5", flange_x=lost, flange_y=np.full(7168, np.nan)))
    signal = client.signal(campaign, "c0_cut.h5", points=50)
    assert signal.channels["flange_x"].low[0] is None
    assert signal.channels["flange_x"].low[-1] is not None
    assert set(signal.channels["flange_y"].high) == {None}
    spectrum = client.spectrum(campaign, "c0_cut.h5")
    assert set(spectrum.channels["flange_y"].amplitude) == {0.0}
    assert spectrum.harmonics_hz == []


def test_lists_come_in_parts_and_names_in_any_letters(client, tmp_path):
    data = declared(3)
    data["cuts"][1]["cut"] = "Fräsen 7.h5"
    id = client.make_campaign(client.make_machine("m").id, data).id
    # as a Mac writes it
    path = tmp_path / "Fra\u0308sen 7.h5"
    path.write_bytes(content(tmp_path))
    assert client.upload(id, path).name == "Fräsen 7.h5"
    client.upload(id, made(tmp_path, "c0_cut.h5"))
    client.upload(id, made(tmp_path, "c2_cut.h5"))
    assert [each.name for each in client.recordings(id, limit=1)] == ["Fräsen 7.h5", "c0_cut.h5", "c2_cut.h5"]
    assert client.recording(id, "Fräsen 7.h5") == client.recording(id, path.name)
    client.archive(id, tmp_path / "c.zip")
    client.forget_recording(id, path.name)
    assert [each.name for each in client.recordings(id)] == ["c0_cut.h5", "c2_cut.h5"]


def test_a_file_comes_back_as_a_download_only(client, campaign, tmp_path):
    client.upload(campaign, made(tmp_path, "c0_cut.h5"))
    url = f"/v1/campaigns/{campaign}/recordings/c0_cut.h5/file"
    answer = client.http.get(url)
    assert answer.headers["content-disposition"] == "attachment"
    assert answer.headers["content-type"] == "application/octet-stream"
    assert client.http.get(url, headers={"If-None-Match": answer.headers["etag"]}).status_code == 304


@pytest.mark.slow
def test_several_in_one_body_each_on_its_own(client, campaign, tmp_path):
    (tmp_path / "stranger.h5").write_bytes(b"x")
    (tmp_path / "c1_cut.h5").write_bytes(b"no recording")
    found = client.upload_together(
        campaign, [made(tmp_path, "c0_cut.h5"), tmp_path / "stranger.h5", tmp_path / "c1_cut.h5", made(tmp_path, "c0_air.h5", air=True)]
    )
    assert [(item.name, item.status) for item in found.items] == [
        ("c0_cut.h5", 201), ("stranger.h5", 404), ("c1_cut.h5", 422), ("c0_air.h5", 201),
    ]  # fmt: skip
    assert found.items[2].problem.errors[0].field == "recording"
    assert found.items[1].recording is None
    assert client.campaign(campaign).cuts[0].verdict.notes == []
    again = client.upload_together(campaign, [tmp_path / "c0_cut.h5"])
    assert [item.status for item in again.items] == [200]
    (tmp_path / "c0_cut.h5").write_bytes(content(tmp_path, 5))
    assert [item.status for item in client.upload_together(campaign, [tmp_path / "c0_cut.h5"]).items] == [409]
    assert [item.status for item in client.upload_together(campaign, [tmp_path / "c0_cut.h5"], replace=True).items] == [201]
    assert len(files_in(tmp_path)) == 4


def test_of_a_path_in_a_form_the_last_part_counts(client, campaign, tmp_path):
    raw = content(tmp_path)
    for name, status in (("../../c0_cut.h5", 201), ("C:\\data\\c0_cut.h5", 200), ("/etc/passwd", 404), ("", 404)):
        answer = client.http.post(f"/v1/campaigns/{campaign}/recordings", files=[("f", (name, raw))])
        assert [item["status"] for item in answer.json()["items"]] == [status], name
    answer = client.http.post(f"/v1/campaigns/{campaign}/recordings", data={"note": "x"}, files=[("f", ("c0_cut.h5", raw))])
    assert [item["status"] for item in answer.json()["items"]] == [404, 200]


def test_the_client_goes_on_after_lost_connections(client, campaign, tmp_path, monkeypatch):
    import httpx2

    sent, send = [], client.send

    def poor(method, path, **further):
        if method == "PATCH":
            sent.append(int(further["headers"]["Upload-Offset"]))
            if len(sent) in (2, 3):
                raise httpx2.ConnectError("lost")
            if len(sent) == 5:
                # the answer is lost, not the part
                send(method, path, **further)
                raise httpx2.ReadError("lost")
        return send(method, path, **further)

    monkeypatch.setattr(client, "send", poor)
    monkeypatch.setattr("api.client.uploads.time.sleep", lambda _: None)
    path = made(tmp_path, "c0_cut.h5")
    part = path.stat().st_size // 4 + 1
    found = client.upload_in_parts(campaign, path, part=part)
    assert found.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert sent == [0, part, part, part, 2 * part, 3 * part]
    # it is there
    assert client.upload_in_parts(campaign, path, part=part) == found
    assert len(sent) == 6
    monkeypatch.setattr(client, "send", lambda *a, **k: (_ for _ in ()).throw(httpx2.ConnectError("lost")))
    with pytest.raises(httpx2.ConnectError):
        client.upload_in_parts(campaign, path, part=part)


def test_a_folder_as_a_whole(client, tmp_path):
    folder = tmp_path / "campaign"
    (folder / "recordings").mkdir(parents=True)
    (folder / "toolings").mkdir()
    data = declared(2)
    from rcsa_ident.io.toml_text import toml_of
    from tests.api.recordings import TOOLING

    (folder / "toolings" / "x.toml").write_text(toml_of(TOOLING))
    for cut in data["cuts"]:
        cut |= {key: f"recordings/{cut[key]}" for key in ("cut", "air")}
    (folder / "campaign.toml").write_text(toml_of(data | {"toolings": {"T1": "toolings/x.toml"}}))
    for k in range(2):
        made(folder / "recordings", f"c{k}_cut.h5", k)
        made(folder / "recordings", f"c{k}_air.h5", k, True)
    told = []
    found = client.upload_folder(client.make_machine("m").id, folder, told.append)
    assert found.usable == 2
    assert [each.name for each in told] == ["c0_air.h5", "c1_air.h5", "c0_cut.h5", "c1_cut.h5"]


def test_samples_are_shared_by_equal_uploads_and_stay_for_the_last(client, tmp_path):
    machine = client.make_machine("m").id
    one, other = (client.make_campaign(machine, declared()).id for _ in range(2))
    path = made(tmp_path, "c0_cut.h5")
    client.upload(one, path)
    client.upload(other, path)
    assert len(files_in(tmp_path)) == 2
    client.forget_campaign(one)
    assert len(files_in(tmp_path)) == 2
    assert client.signal(other, "c0_cut.h5").time_s
    # with other sensors the same file is read otherwise
    third = client.make_campaign(machine, declared(sensors={"flange_x": {"quantity": "displacement", "axis": "X", "sensitivity": 1.0}})).id
    client.upload(third, path)
    assert len(files_in(tmp_path)) == 3
    client.forget_campaign(other)
    assert client.signal(third, "c0_cut.h5").time_s
    client.forget_recording(third, "c0_cut.h5")
    assert files_in(tmp_path) == []


def test_found_values_are_json_whatever_is_in_the_file(client, campaign, tmp_path):
    """Extreme numbers, among them those that float32 has not."""
    rng = np.random.default_rng(3)
    values = {name: rng.standard_normal(7168) * 10.0 ** rng.integers(-37, 38, 7168) for name in channels()}
    path = tmp_path / "c0_cut.h5"
    write_hdf5(path, RATE, values)
    answer = client.http.put(f"/v1/campaigns/{campaign}/recordings/c0_cut.h5", content=path.read_bytes(), headers=BINARY)
    assert answer.status_code == 201
    json.loads(answer.content, parse_constant=pytest.fail)
    for path in ("signal", "spectrum"):
        answer = client.http.get(f"/v1/campaigns/{campaign}/recordings/c0_cut.h5/{path}")
        assert answer.status_code == 200
        json.loads(answer.content, parse_constant=pytest.fail)


def test_paths_of_the_service_are_told_to_nobody(client, campaign, tmp_path):
    path = Path(tmp_path / "c0_cut.h5")
    for raw in (b"x", b"\x89HDF\r\n\x1a\n" + bytes(100), content(tmp_path)[:4000]):
        answer = client.http.put(f"/v1/campaigns/{campaign}/recordings/{path.name}", content=raw, headers=BINARY)
        assert answer.status_code == 422
        assert str(tmp_path) not in answer.text
        assert ".part" not in answer.text
