"""Campaigns: the keys of campaign.toml, toolings of the library or in the body, and the folder that comes back."""

from __future__ import annotations

import copy
import io
import json
import math
import tomllib
import zipfile
from functools import partial
from pathlib import Path

import pytest

from api.reading.campaign_text import FORMATS, campaign_of_text, declare, files_of, recording_name, toml_text
from api.reading.campaigns import load_campaign
from api.schemas.campaigns import SensorKeys
from api.transfer.archives import zipped
from rcsa_ident.base.errors import InputError
from rcsa_ident.identification.status import too_few
from rcsa_ident.io.recordings.readers import READERS, read_cut
from rcsa_ident.io.settings.setups import read_campaign
from rcsa_ident.io.settings.toolings import tooling_keys
from rcsa_ident.io.toml_text import toml_of
from rcsa_ident.workflows.identify import judge_cut
from tests.api.in_process import refused
from tests.api.recordings import TOOLING, content, declared
from tests.fixtures.paths import SAMPLES

TOML = {"Content-Type": "application/toml"}


@pytest.fixture
def machine(client):
    return client.make_machine("m").id


def test_formats_are_those_of_the_readers():
    assert set(FORMATS) == set(READERS)


def test_without_a_sensor_at_the_flange_three_toolings_are_wanted(client, machine):
    keys = declared(2)
    keys["sensors"] = {name: sensor for name, sensor in keys["sensors"].items() if sensor["quantity"] == "acceleration"}
    assert client.make_campaign(machine, keys).too_few == too_few([], of_flange=False)


def test_a_campaign_from_making_to_forgetting(client, machine):
    made = client.make_campaign(machine, declared(2))
    assert (made.name, made.machine, made.usable, made.toolings) == ("by hand", machine, 0, ["T1"])
    assert made.too_few == too_few([])
    assert made.sampling_rate_hz == 25600.0
    looks = {"distance_behind_flange_mm": 0.0, "distance_spread_mm": 0.0}
    assert made.sensors["flange_x"] == {"quantity": "displacement", "axis": "X", "sensitivity": 1.0e4, **looks}
    assert made.workpiece["radial_ratio"] == 0.26
    first = made.cuts[0]
    assert (first.id, first.cut.name, first.cut.uploaded, first.air.name, first.verdict) == ("c0", "c0_cut.h5", False, "c0_air.h5", None)
    assert client.campaign(made.id) == made
    (summary,) = client.campaigns(machine)
    assert (summary.id, summary.cuts, summary.uploaded, summary.usable) == (made.id, 2, 0, 0)
    assert client.send("POST", f"/machines/{machine}/campaigns", json=declared()).headers["location"].startswith("/v1/campaigns/")
    client.forget_campaign(made.id)
    refused(404, client.campaign, made.id)
    refused(404, client.forget_campaign, made.id)
    refused(404, client.make_campaign, "nobody", declared())


def test_toml_and_json_say_the_same(client, machine):
    data = declared(2, toolings={"T1": {**TOOLING, "materials": {"carbide": {"loss_factor": 0.004}}}})
    one, other = client.make_campaign(machine, data), client.make_campaign(machine, toml_of(data))
    assert one.model_copy(update={"id": "", "created": ""}) == other.model_copy(update={"id": "", "created": ""})
    assert client.campaign_file(one.id) == client.campaign_file(other.id)
    # which is a campaign again
    again = client.make_campaign(machine, tomllib.loads(client.campaign_file(one.id)) | {"toolings": data["toolings"]})
    assert again.cuts == one.cuts


def test_a_campaign_says_what_is_unusual_about_it(client, machine):
    assert client.make_campaign(machine, declared()).remarks == []
    data = declared(2)
    for cut in data["cuts"]:
        cut["feed_per_tooth_mm"] = 2.5
    made = client.make_campaign(machine, data)
    (remark,) = made.remarks
    assert remark.startswith("c0 and 1 more: ")
    assert "feed per tooth is 2.5 mm, but usual are 0.001 to 2 mm" in remark
    assert client.campaign(made.id).remarks == made.remarks


def test_a_repeated_query_makes_one_campaign(client, machine):
    one = client.make_campaign(machine, declared(), repeat="k")
    assert client.make_campaign(machine, declared(), repeat="k") == one
    assert refused(409, client.make_campaign, machine, declared(2), repeat="k").errors[0].field == "idempotency key"
    other = client.make_machine("n").id
    refused(409, client.make_campaign, other, declared(), repeat="k")
    assert len(list(client.campaigns(machine))) == 1


def test_toolings_come_from_the_library_in_three_ways(client, machine):
    client.write_tooling("T1", TOOLING)
    client.write_tooling("spare", {**TOOLING, "cutter": {"teeth": 2, "diameter_mm": 16.0}})
    without = declared()
    del without["toolings"]
    texts = [
        client.make_campaign(machine, data) for data in (without, declared(toolings={"T1": "T1"}), declared(toolings={"T1": "a/T1.toml"}))
    ]
    assert {tuple(c.toolings) for c in texts} == {("T1",)}
    spare = client.make_campaign(machine, declared(toolings={"T1": "spare"}))
    client.upload(spare.id, _file(client, "c0_cut.h5"))
    # two teeth make other lines of the same record
    client.upload(texts[0].id, _file(client, "c0_cut.h5"))
    assert client.recording(spare.id, "c0_cut.h5").harmonics_above_noise != client.recording(texts[0].id, "c0_cut.h5").harmonics_above_noise
    for toolings, field in (
        ({"T1": "none"}, "toolings.T1"),
        ({"T1": "../x"}, "toolings.T1"),
        ({"T1": "x.toml", "T2": "T1"}, None),
        ({"../x": "T1"}, "toolings"),
    ):
        if field is None:
            client.make_campaign(machine, declared(toolings=toolings))
        else:
            assert refused(422, client.make_campaign, machine, declared(toolings=toolings)).errors[0].field == field


def _file(client, name):
    folder = Path(client.http.app.state.components.settings.data)
    path = folder / name
    path.write_bytes(content(folder))
    return path


@pytest.mark.slow
def test_what_happens_to_the_library_later_does_not_matter(client, machine):
    client.write_tooling("T1", TOOLING)
    made = client.make_campaign(machine, declared(toolings={"T1": "T1"}))
    client.forget_tooling("T1")
    client.upload(made.id, _file(client, "c0_cut.h5"))
    assert client.campaign(made.id).usable == 1


def test_of_paths_the_last_part_counts(client, machine):
    data = declared(2)
    data["cuts"][0] |= {"cut": "recordings/day 1/c0_cut.h5", "air": "C:\\data\\air.TDMS"}
    data["cuts"][1] |= {"cut": "Fra\u0308sen.csv", "air": "C:\\data\\air.TDMS"}
    made = client.make_campaign(machine, data)
    assert [(cut.cut.name, cut.air.name) for cut in made.cuts] == [("c0_cut.h5", "air.TDMS"), ("Fr\u00e4sen.csv", "air.TDMS")]
    files = files_of(client.http.app.state.components.store.campaigns.get("local", made.id).text)
    assert files["air.TDMS"].cuts == ("c0", "c1")
    assert recording_name("a/b\\c.h5") == "c.h5"


def broken(**changed):
    data = declared(2)
    for path, value in changed.items():
        *way, last = path.split("__")
        place = data
        for key in way:
            place = place[int(key) if key.isdecimal() else key]
        if value is None:
            del place[last]
        else:
            place[last] = value
    return data


@pytest.mark.parametrize(
    ("changed", "field"),
    [
        ({"cuts__1__cut": "c0_cut.h5"}, "cuts[1].cut"),
        ({"cuts__1__air": "c0_cut.h5"}, "cuts[1].air"),
        ({"cuts__1__air": "elsewhere/c0_air.h5"}, "cuts[1].air"),
        ({"cuts__0__cut": "c0.exe"}, "cuts[0].cut"),
        ({"cuts__0__cut": "noname"}, "cuts[0].cut"),
        ({"cuts__0__cut": "x/"}, "cuts[0].cut"),
        ({"cuts__0__cut": ".h5"}, "cuts[0].cut"),
        ({"cuts__0__cut": "..h5"}, "cuts[0].cut"),
        ({"cuts__0__cut": "a:b.h5"}, "cuts[0].cut"),
        ({"cuts__0__cut": "a\x00.h5"}, "cuts[0].cut"),
        ({"cuts__0__cut": "a\u202e5h.exe.h5"}, "cuts[0].cut"),
        ({"cuts__0__cut": "x" * 200 + ".h5"}, "cuts[0].cut"),
        ({"cuts__0__cut": 'a".h5'}, "cuts[0].cut"),
        ({"cuts__1__id": "c0"}, "cuts[1].id"),
        ({"cuts__0__id": "a\nb"}, "cuts[0].id"),
        ({"cuts__0__tooling": "T2"}, "cuts[0].tooling"),
        ({"cuts__0__spindle_speed_rpm": -1.0}, "cuts[0].spindle_speed_rpm"),
        ({"cuts__0__exit_angle_deg": 10.0}, "cuts[0].exit_angle_deg"),
        ({"cuts__0__feed_direction": "up"}, "cuts[0].feed_direction"),
        ({"sensors": {}}, "sensors"),
        ({"sensors__flange_x__sensitivity": 0.0}, "sensors.flange_x.sensitivity"),
        ({"sensors__flange_x__axis": None}, "sensors.flange_x.axis"),
        ({"sensors": {f"s{k}": {"quantity": "trigger"} for k in range(65)}}, "sensors"),
        ({"toolings__T1__tool__stickout_mm": 0.0}, "tool.stickout_mm"),
        ({"toolings": {f"T{k}": "T1" for k in range(201)}}, "toolings"),
    ],
    ids=lambda value: next(iter(value)) + repr(next(iter(value.values())))[:20] if isinstance(value, dict) else "",
)  # fmt: skip
def test_what_is_wrong_is_named(client, machine, changed, field):
    data = broken(**changed)
    assert refused(422, client.make_campaign, machine, data).errors[0].field == field
    try:
        text = toml_of(data)
        tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return
    assert refused(422, client.make_campaign, machine, text).errors[0].field == field
    assert list(client.campaigns(machine)) == []


@pytest.mark.slow
def test_forms_that_are_none(client, machine):
    for data in ({}, {"cuts": []}, declared() | {"cuts": "x"}, declared(further=1), declared(toolings={"T1": 7})):
        refused(422, client.make_campaign, machine, data)
    for text in ("", "= 1", "[cuts]", "cuts = 1", "[[cuts]]", "cuts = []", toml_of(declared()).replace("0.26", "nan"), "a = 1979-05-27"):
        refused(422, client.make_campaign, machine, text)
    many = declared()
    many["cuts"] = [{**many["cuts"][0], "id": f"c{k}", "cut": f"{k}.h5"} for k in range(2001)]
    assert refused(422, client.make_campaign, machine, many).errors[0].field == "cuts"
    refused(413, client.make_campaign, machine, toml_of(declared()) + "# " + "x" * 1_000_000)


def test_a_tooling_that_would_cost_too_much_is_refused(client, machine):
    fine = copy.deepcopy(TOOLING)
    taper = {"length_mm": 1.0, "outer_diameter_mm": 12.0, "end_diameter_mm": 12.1, "material": "steel"}
    fine["tool"] |= {"segments": [taper] * 190, "stickout_mm": 120.0}
    assert refused(422, client.make_campaign, machine, declared(toolings={"T1": fine})).errors[0].field == "segments"


def test_a_machine_takes_its_campaigns_along(client, machine, tmp_path):
    made = client.make_campaign(machine, declared())
    client.upload(made.id, _file(client, "c0_cut.h5"))
    assert len(list((tmp_path / "files").rglob("*.h5"))) == 1
    client.forget_machine(machine)
    refused(404, client.campaign, made.id)
    refused(404, client.recording, made.id, "c0_cut.h5")
    assert [p for p in (tmp_path / "files").rglob("*") if p.is_file()] == []


@pytest.mark.parametrize(
    "name", ["archive", "recordings", "recordings/c0_cut.h5", "recordings/c0_cut.h5/file", "recordings/c0_cut.h5/signal"]
)
def test_another_group_sees_nothing(guarded_http, name):
    http, keys = guarded_http
    mine, theirs = {"X-API-Key": keys["admin"]}, {"X-API-Key": keys["other"]}
    machine = http.post("/v1/machines", json={"name": "m"}, headers=mine).json()["id"]
    id = http.post(f"/v1/machines/{machine}/campaigns", json=declared(), headers=mine).json()["id"]
    assert http.get(f"/v1/campaigns/{id}", headers=mine).status_code == 200
    for path in (f"/v1/campaigns/{id}", f"/v1/campaigns/{id}/{name}", f"/v1/machines/{machine}/campaigns"):
        assert http.get(path, headers=theirs).status_code == 404
    assert http.post(f"/v1/machines/{machine}/campaigns", json=declared(), headers=theirs).status_code == 404
    assert http.delete(f"/v1/campaigns/{id}", headers=theirs).status_code == 404
    binary = {**theirs, "Content-Type": "application/octet-stream"}
    assert http.put(f"/v1/campaigns/{id}/recordings/c0_cut.h5", content=b"x", headers=binary).status_code == 404


@pytest.fixture
def uploaded(client, machine, tmp_path):
    """Two cuts; of the second the air cut is missing, the third has nothing."""
    made = client.make_campaign(machine, declared(3))
    for k, air, name in ((0, False, "c0_cut.h5"), (0, True, "c0_air.h5"), (1, False, "c1_cut.h5")):
        path = tmp_path / name
        path.write_bytes(content(tmp_path, k, air))
        client.upload(made.id, path)
    return client, made.id


@pytest.mark.slow
def test_a_cut_is_judged_among_its_fellows(client, machine):
    """The sample runs with three teeth for four: one that fits by chance is left out as soon as others contradict it, and comes back."""
    data = tomllib.loads((SAMPLES / "campaign.toml").read_text(encoding="utf-8"))
    tooling = (SAMPLES / "toolings" / "S1-ER32.toml").read_text(encoding="utf-8").replace("teeth = 4", "teeth = 3")
    cuts = [data["cuts"][k] for k in (15, 16, 14)]
    made = client.make_campaign(machine, data | {"cuts": cuts, "toolings": {"S1-ER32": tomllib.loads(tooling)}})

    def usable():
        found = client.campaign(made.id)
        assert [each.usable for each in client.campaigns(machine)] == [found.usable]
        return [cut.verdict and cut.verdict.usable for cut in found.cuts]

    for cut, told in zip(made.cuts, ([True, None, None], [True, False, None], [False, False, False]), strict=True):
        for file in (cut.air, cut.cut):
            client.upload(made.id, SAMPLES / "recordings" / file.name)
        assert usable() == told
    verdict = client.campaign(made.id).cuts[0].verdict
    assert verdict.lines == 0
    assert "2 of 3 cuts with S1-ER32 contradict it" in verdict.reasons[0]
    client.send("DELETE", f"/campaigns/{made.id}/recordings/{made.cuts[2].cut.name}")
    assert usable() == [True, False, None]
    assert client.campaign(made.id).cuts[0].verdict.lines > 0


def test_a_campaign_without_its_air_cuts_is_not_complete(uploaded, machine):
    client, _ = uploaded
    (told,) = client.campaigns(machine)
    # one cut and two air cuts
    assert (told.uploaded, told.missing, told.without_air) == (2, 3, 0)
    bare = declared(2)
    del bare["cuts"][0]["air"]
    client.make_campaign(machine, bare)
    assert [(each.missing, each.without_air) for each in client.campaigns(machine)] == [(3, 0), (3, 1)]


def test_the_archive_is_the_folder_that_identify_takes(uploaded, tmp_path):
    client, id = uploaded
    client.archive(id, tmp_path / "c.zip")
    with zipfile.ZipFile(tmp_path / "c.zip") as archive:
        assert archive.testzip() is None
        names = ["campaign.toml", "toolings/T1.toml", *(f"recordings/{name}.h5" for name in ("c0_air", "c0_cut", "c1_cut"))]
        assert archive.namelist() == names
        archive.extractall(tmp_path / "folder")
    found = read_campaign(tmp_path / "folder")
    assert [(cut.id, cut.air is not None) for cut in found.cuts] == [("c0", True), ("c1", False)]
    # what the commands say of the folder is what the service has said
    verdicts = [cut.verdict for cut in client.campaign(id).cuts]
    for cut, told in zip(found.cuts, verdicts[:2], strict=True):
        reading = judge_cut(found, partial(read_cut, found.sensors, found.sampling_rate), cut)
        assert (reading.verdict.usable, list(reading.verdict.notes)) == (told.usable, told.notes)
        assert reading.measurement.spindle_speed * 30.0 / 3.141592653589793 == pytest.approx(told.spindle_speed_rpm, rel=1e-15)
    assert verdicts[2] is None


def test_an_archive_of_nothing(client, machine):
    made = client.make_campaign(machine, declared())
    assert client.http.get(f"/v1/campaigns/{made.id}/archive").status_code == 409


def test_an_archive_is_never_whole_in_memory(tmp_path, monkeypatch):
    (tmp_path / "long").write_bytes(bytes(range(256)) * 40)
    monkeypatch.setattr("api.transfer.archives._BLOCK", 1000)
    pieces = list(zipped([("a/short", b"x"), ("b/long", tmp_path / "long")]))
    assert max(map(len, pieces)) < 1300
    archive = zipfile.ZipFile(io.BytesIO(b"".join(pieces)))
    assert archive.testzip() is None
    assert {name: archive.read(name) for name in archive.namelist()} == {"a/short": b"x", "b/long": bytes(range(256)) * 40}


def test_an_archive_is_sent_while_it_is_made(uploaded):
    client, id = uploaded
    with client.http.stream("GET", f"/v1/campaigns/{id}/archive") as answer:
        raw = b"".join(answer.iter_raw())
    assert zipfile.ZipFile(io.BytesIO(raw)).testzip() is None
    assert "content-length" not in answer.headers


def test_what_an_identification_reads(uploaded, tmp_path, store):
    client, id = uploaded
    client.archive(id, tmp_path / "c.zip")
    zipfile.ZipFile(tmp_path / "c.zip").extractall(tmp_path / "folder")
    folder = read_campaign(tmp_path / "folder")
    found, read, _ = load_campaign(store, client.http.app.state.components.files, "local", id)
    assert [cut.id for cut in found.cuts] == [cut.id for cut in folder.cuts]
    assert (found.name, found.sensors, found.workpiece) == (folder.name, folder.sensors, folder.workpiece)
    assert {name: tooling_keys(tooling) for name, tooling in found.toolings.items()} == {
        name: tooling_keys(tooling) for name, tooling in folder.toolings.items()
    }
    for mine, theirs in zip(found.cuts, folder.cuts, strict=True):
        assert mine.conditions == theirs.conditions
        for one, other in zip(read(mine), read_cut(folder.sensors, folder.sampling_rate, theirs), strict=True):
            assert (one is None) == (other is None)
            # to the last bit what the commands read
            assert one is None or (one.rate == other.rate and one.samples.tobytes() == other.samples.tobytes())


@pytest.mark.slow
def test_a_campaign_that_can_not_be_loaded_says_why(client, machine, store):
    made, files = client.make_campaign(machine, declared()), client.http.app.state.components.files
    with pytest.raises(InputError, match="no recording of a cut"):
        load_campaign(store, files, "local", made.id)
    for group, id in (("local", "none"), ("other", made.id)):
        with pytest.raises(InputError, match="an existing campaign"):
            load_campaign(store, files, group, id)


def test_texts_of_campaigns_come_back_as_they_were():
    data = declared(2)
    data["campaign"]["clock_error_percent"] = 0.1
    data["sensors"]["fixture_x"]["role"] = data["sensors"]["fixture_y"]["role"] = "fixture"
    data["sensors"]["felt_x"] = {"quantity": "acceleration", "axis": "X", "sensitivity": 1.0, "role": "table", "mount_resonance_hz": 8e3}
    # turned back by its fellow
    data["sensors"]["felt_x"]["rotation_deg"] = 2.0
    data["sensors"]["felt_y"] = data["sensors"]["felt_x"] | {"axis": "Y"}
    data["sensors"]["flange_x"] |= {"distance_behind_flange_mm": -12.0, "distance_spread_mm": 0.5}
    name, text, cuts = declare(data, lambda _: None)
    assert (name, cuts) == ("by hand", 2)
    assert json.loads(text)["cuts"] == data["cuts"]
    campaign = campaign_of_text(text, lambda name: Path("/x") / name)
    assert campaign.clock_error == pytest.approx(1e-3)
    assert [sensor.role for sensor in campaign.sensors if sensor.name == "felt_x"] == ["table"]
    felt = SensorKeys(**data["sensors"]["felt_x"]).sensor("felt_x")
    assert (felt.mount_resonance, felt.rotation) == (8e3, pytest.approx(math.radians(2.0)))
    assert SensorKeys(quantity="displacement", axis="X").sensor("x").rotation == 0.0
    assert SensorKeys(quantity="displacement", axis="X").sensor("x").distance is None
    looks = SensorKeys(**data["sensors"]["flange_x"]).sensor("flange_x")
    assert (looks.distance, looks.distance_spread) == pytest.approx((-0.012, 5e-4))
    assert looks in campaign.sensors
    assert campaign.cuts[1].air == Path("/x/c1_air.h5")
    toml = tomllib.loads(toml_text(text))
    assert toml["sensors"] == data["sensors"]
    assert toml["toolings"] == {"T1": "toolings/T1.toml"}
    assert toml["cuts"][0]["cut"] == "recordings/c0_cut.h5"
