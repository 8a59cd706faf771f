"""Tool libraries that come in, and examples that go out and are good for what they say."""

from __future__ import annotations

import io
import json
import shutil
import zipfile

import pytest
from typer.testing import CliRunner

from api.client import Client
from api.routes import examples
from api.work import libraries
from rcsa_ident.cli import app
from rcsa_ident.io.settings.tested_cuts import read_tested_cuts
from rcsa_ident.io.settings.tool_libraries import Assumptions, import_tools
from tests.api.in_process import refused, service
from tests.fixtures import by_hand
from tests.fixtures.paths import SAMPLES
from tests.fixtures.tool_library import END_MILL, end_mill, library

DRILL = end_mill(type="drill", description="drill")


def packed(*entries):
    return json.dumps(library(*entries)).encode()


def test_each_entry_on_its_own(client):
    answer = client.import_toolings(packed(END_MILL, DRILL, end_mill(description="Ø12 / other"), 7), helix_deg=38.0)
    assert [(item.name, item.status) for item in answer.items] == [
        ("VHM 12 R0 long", "written"), ("drill", "skipped"), ("12 - other", "written"), ("tool", "skipped"),
    ]  # fmt: skip
    assert [bool(item.reason) for item in answer.items] == [False, True, False, True]
    assert answer.items[0].assumed
    assert answer.items[1].assumed == []
    assert client.tooling_file("VHM 12 R0 long") == import_tools(packed(END_MILL), "", Assumptions(helix_deg=38.0))[0].text
    assert [each.name for each in client.toolings()] == ["12 - other", "VHM 12 R0 long"]
    assert "<svg" in client.drawing("12 - other")


def test_what_is_there_stays_unless_asked(client):
    client.write_tooling("VHM 12 R0 long", by_hand.TOOLING)
    (item,) = client.import_toolings(packed(END_MILL)).items
    assert (item.status, "replace=true" in item.reason) == ("skipped", True)
    assert client.tooling_file("VHM 12 R0 long") == by_hand.TOOLING
    (item,) = client.import_toolings(packed(END_MILL), replace=True).items
    assert (item.status, item.reason) == ("written", None)
    assert client.tooling_file("VHM 12 R0 long") != by_hand.TOOLING
    # the same twice changes nothing
    assert client.import_toolings(packed(END_MILL), replace=True).items == [item]


def test_names_alike_in_one_library_are_told_apart(client):
    answer = client.import_toolings(packed(END_MILL, END_MILL))
    assert [item.name for item in answer.items] == ["VHM 12 R0 long", "VHM 12 R0 long-2"]
    assert {item.status for item in answer.items} == {"written"}


def test_assumptions_are_those_of_the_command(client):
    client.write_tooling("joint", by_hand.TOOLING)
    assumed = {"flute_ratio": 0.75, "stickout_mm": 50.0, "insertion_mm": 30.0, "material": "steel", "contact": "joint"}
    client.import_toolings(packed(END_MILL), **assumed)
    keys = client.tooling("VHM 12 R0 long").tooling
    assert (keys.tool.stickout_mm, keys.holder.insertion_mm, keys.tool.segments[0].outer_diameter_mm) == (50.0, 30.0, 9.0)
    assert keys.contact == client.tooling("joint").tooling.contact
    assert {segment.material for segment in keys.tool.segments} == {"steel"}


def test_a_container(client):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as container:
        container.writestr("tools.json", packed(END_MILL))
    assert client.import_toolings(stream.getvalue()).items[0].status == "written"


@pytest.mark.parametrize(
    ("raw", "query", "status"),
    [
        (b"", {}, 422), (b"{}", {}, 422), (b"[]", {}, 422), (b"\xff", {}, 422), (b"[" * 100_000, {}, 422), (b'{"data": NaN}', {}, 422),
        (b"PK\x03\x04rest", {}, 422), (b" " * 8_000_001, {}, 413),
        (packed(END_MILL), {"flute_ratio": 0.1}, 422), (packed(END_MILL), {"flute_ratio": "nan"}, 422),
        (packed(END_MILL), {"stickout_mm": "inf"}, 422), (packed(END_MILL), {"material": "wood"}, 422),
        (packed(END_MILL), {"holder": "none"}, 422), (packed(END_MILL), {"contact": "none"}, 404),
        (packed(END_MILL), {"contact": "../x"}, 422), (packed(END_MILL), {"replace": "perhaps"}, 422),
    ],
)  # fmt: skip
def test_what_is_refused_writes_nothing(client, raw, query, status):
    refused(status, client.import_toolings, raw, **query)
    assert list(client.toolings()) == []


def test_too_many_entries(client, monkeypatch):
    monkeypatch.setattr(libraries, "MOST_TOOLS", 2)
    assert len(client.import_toolings(packed(END_MILL, DRILL)).items) == 2
    assert "at most 2" in refused(422, client.import_toolings, packed(END_MILL, DRILL, DRILL)).detail


def test_a_contact_that_is_none(client):
    text = by_hand.TOOLING.split("[contact]")[0]
    client.write_tooling("rigid", text)
    assert "[contact]" in refused(422, client.import_toolings, packed(END_MILL), contact="rigid").errors[0].allowed


@pytest.fixture
def files(client, tmp_path):
    """Every example of the package, in a folder."""
    folder = tmp_path / "examples"
    folder.mkdir()
    for each in client.examples():
        client.example(each.name, folder / each.name)
        assert each.size_bytes == (folder / each.name).stat().st_size
        assert each.about.endswith(".")
    return folder


def test_examples_are_good_for_what_they_say(client, files):
    names = {path.name for path in files.iterdir()}
    assert {"S1-ER32.toml", "campaign.toml", "CUTS.csv", "MODES.toml", "tool-library.json", "small-campaign.zip"} <= names
    assert sum(path.stat().st_size for path in files.iterdir() if path.name != examples.SAMPLE) < 600_000
    for name in ("S1-ER32", "S2-PG25"):
        client.write_tooling(name, (files / f"{name}.toml").read_text(encoding="utf-8"))
    machine = client.make_machine("m").id
    assert [cut.id for cut in client.make_campaign(machine, (files / "campaign.toml").read_text(encoding="utf-8")).cuts] == ["S1-ER32-00"]
    assert {item.status for item in client.import_toolings((files / "tool-library.json").read_bytes()).items} == {"written"}
    assert read_tested_cuts(files / "CUTS.csv").axial_depth.size == 4
    lobes = [
        "lobes",
        "--modes",
        str(files / "MODES.toml"),
        str(files / "S1-ER32.toml"),
        "--out",
        str(files / "LOBES.csv"),
        "--krc",
        "0.26",
        "--ktc-mpa",
        "902",
    ]
    result = CliRunner().invoke(app, [*lobes, "--tests", str(files / "CUTS.csv")])
    assert result.exit_code == 0, result.output


def test_the_small_campaign_is_usable(files):
    with zipfile.ZipFile(files / "small-campaign.zip") as archive:
        archive.extractall(files / "small")
    result = CliRunner().invoke(app, ["check", str(files / "small"), "--json", "--processes", "1"])
    assert result.exit_code == 0, result.output
    assert (json.loads(result.stdout)["cuts"], json.loads(result.stdout)["usable"]) == (2, 2)


def test_the_sample_campaign_where_it_is(store, tmp_path):
    folder = tmp_path / "sample"
    shutil.copytree(SAMPLES / "toolings", folder / "toolings")
    (folder / "recordings").mkdir()
    head, *cuts = (SAMPLES / "campaign.toml").read_text(encoding="utf-8").split("[[cuts]]")
    (folder / "campaign.toml").write_text(head + "[[cuts]]" + cuts[0], encoding="utf-8")
    for name in ("S1-ER32-00_cut.h5", "S1-ER32-00_air.h5"):
        shutil.copyfile(SAMPLES / "recordings" / name, folder / "recordings" / name)
    (folder / "secret.txt").write_text("nothing of the campaign")
    with service(store, tmp_path / "data", examples=folder) as http:
        client = Client(http=http)
        (listed,) = [each for each in client.examples() if each.name == examples.SAMPLE]
        client.example(examples.SAMPLE, tmp_path / "got.zip")
    assert listed.size_bytes == (tmp_path / "got.zip").stat().st_size
    with zipfile.ZipFile(tmp_path / "got.zip") as archive:
        assert archive.testzip() is None
        assert set(archive.namelist()) == {
            "campaign.toml", "toolings/S1-ER32.toml", "toolings/S2-PG25.toml",
            "recordings/S1-ER32-00_cut.h5", "recordings/S1-ER32-00_air.h5",
        }  # fmt: skip
        for name in archive.namelist():
            assert archive.read(name) == (folder / name).read_bytes()
    # a link to somewhere else: nothing of it goes out
    (folder / "recordings" / "S1-ER32-00_air.h5").unlink()
    (folder / "recordings" / "S1-ER32-00_air.h5").symlink_to(SAMPLES / "recordings" / "S1-ER32-00_air.h5")
    with service(store, tmp_path / "data", examples=folder) as http:
        assert examples.SAMPLE not in [each.name for each in Client(http=http).examples()]


@pytest.mark.parametrize("name", ["none.toml", "..", "sample-campaign.zip", "a%2Fb", "%2e%2e%2fsettings.py", "x" * 65])
def test_no_such_example(store, tmp_path, name):
    with service(store, tmp_path / "data", examples=tmp_path / "none") as http:
        assert examples.SAMPLE not in [each.name for each in Client(http=http).examples()]
        answer = http.get(f"/v1/examples/{name}", follow_redirects=False)
        assert answer.status_code in (404, 422, 307)
        assert "import" not in answer.text
