"""A disk that fills while something is stored: at every call that writes, whichever process makes it, no acknowledged byte is lost."""

from __future__ import annotations

import json
import shutil
import struct
import subprocess
import sys
from functools import partial

import httpx2
import pytest

from api.client import Client
from api.schemas.robots import EXAMPLE as ROBOT
from tests.api import identifying
from tests.api.recordings import TOOLING, content, declared
from tests.api.test_tus import NAME, SAYS, begun, sent
from tests.fixtures.force_stream import result
from tests.fixtures.paths import ROOT
from tests.fixtures.service import serving
from tests.fixtures.waiting import PATIENCE, until

NEVER = 1 << 40


class Disk:
    """A disk below a folder that is full from a call that writes on; the library in front of the C library counts them."""

    def __init__(self, folder):
        self.folder, self.state, self.library = folder / "disk", folder / "state", folder / "full_disk.so"
        places = [f'-DFOLDER="{self.folder}"', f'-DSTATE="{self.state}"']
        source = ROOT / "tests" / "fixtures" / "full_disk.c"
        subprocess.run(["cc", "-shared", "-fPIC", *places, "-o", self.library, source, "-ldl"], check=True)
        self.folder.mkdir()
        self.full_at(NEVER)

    @property
    def settings(self):
        return {"LD_PRELOAD": str(self.library)}

    def full_at(self, call):
        """Count from here: this call finds the disk full, and so do all behind it."""
        with self.state.open("r+b" if self.state.exists() else "xb") as file:
            file.write(struct.pack("=qq", 0, call))

    @property
    def calls(self):
        return struct.unpack("=qq", self.state.read_bytes())[0]


def told_offset(http, where):
    """Return the offset of an upload, empty where the service does not tell it yet."""
    answer = http.head(where, headers=SAYS)
    assert answer.status_code in (204, 503)
    return answer.headers.get("upload-offset", "")


def upload_points(client, machine, disk, raw):
    """Fill the disk at each call of the second part of a recording, and return how many there are."""
    http, half = client.http, len(raw) // 2
    id = client.make_campaign(machine, declared(1)).id
    path, recording = f"/v1/campaigns/{id}/uploads", f"/v1/campaigns/{id}/recordings/{NAME}"
    call, stored = 0, False
    while not stored:
        call += 1
        where = begun(http, path, len(raw))
        assert sent(http, where, raw[:half], 0).status_code == 204
        disk.full_at(call)
        last = sent(http, where, raw[half:], half)
        stored = disk.calls < call
        # nothing is wrong with the file, and while the disk is full nobody is told that it has gone
        assert last.status_code == 204 if stored else last.status_code in (204, 503), (call, last.text)
        meanwhile = http.head(where, headers=SAYS)
        assert meanwhile.status_code == 503 or int(meanwhile.headers["upload-offset"]) >= half, call
        disk.full_at(NEVER)
        offset = int(until(partial(told_offset, http, where)))
        assert offset >= half, call
        if offset < len(raw):
            assert sent(http, where, raw[offset:], offset).status_code == 204
        assert http.get(f"{recording}/file").content == raw, call
        assert http.delete(recording).status_code == 204
    return call - 1


def row_points(http, disk, method, path, body):
    """Fill the disk at each call of a request that writes rows, and return how many there are."""
    call, stored = 0, False
    while not stored:
        call += 1
        named = body | {"name": f"N{call}"} if path == "/v1/machines" else body
        place, repeat = path.format(name=f"N{call}"), {"Idempotency-Key": f"{path}:{call}"}
        ask = partial(http.request, method, place, json=named, headers=repeat)
        disk.full_at(call)
        answer = ask()
        stored = disk.calls < call
        disk.full_at(NEVER)
        assert answer.is_success if stored else answer.is_success or answer.status_code == 503, (path, call, answer.text)
        # what was refused is taken the second time
        told = answer if answer.is_success else ask()
        assert told.is_success, (path, call, told.text)
        assert http.get(told.headers.get("location", place)).is_success, (path, call)
    return call - 1


@pytest.mark.slow(120)
@pytest.mark.skipif(sys.platform != "linux" or shutil.which("cc") is None, reason="a library in front of the C library is compiled")
def test_no_acknowledged_byte_is_lost_wherever_the_disk_fills(tmp_path):
    disk, raw = Disk(tmp_path), content(tmp_path)
    with (
        serving(disk.folder / "data", RCSA_IDENT_FREE_BYTES="0", **disk.settings) as served,
        httpx2.Client(base_url=served.url, timeout=PATIENCE) as http,
    ):
        client = Client(http=http)
        machine = client.make_machine("m").id
        campaign = client.make_campaign(machine, identifying.declared()).id
        for file in identifying.files():
            client.upload(campaign, file)
        # parts, samples that the reader writes, and rows, each with what makes them last
        points = upload_points(client, machine, disk, raw)
        assert points > 40
        for method, path, body in (
            ("POST", "/v1/machines", {}),
            ("PUT", f"/v1/machines/{machine}/identification", json.loads(result())),
            ("POST", f"/v1/machines/{machine}/campaigns", declared(1)),
            ("PUT", "/v1/toolings/{name}", TOOLING),
            ("PUT", "/v1/robots/{name}", ROBOT),
            ("POST", "/v1/identifications", {"campaign": campaign}),
        ):
            points += row_points(http, disk, method, path, body)
        assert points > 100
