"""What the dearest request that the service takes costs it, route by route: called by ``hostile --legitimate``.

Every route is asked for as much as it gives: pages of 200, toolings of 400 segments, 12 of 190 at 5000 speeds, receptances of 20 000
lines, campaigns of 2000 cuts, recordings of 79 s of four channels. Where a limit of work refuses that, half as much is asked for.
"""

from __future__ import annotations

import base64
import io
import json
import tempfile
import time
import tomllib
import wave
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import tomli_w

from api.client import Client
from api.routes.ringing import MOST_SOUNDS
from api.schemas.queries import MOST_SPEEDS, MOST_TESTED, MOST_TOOLINGS
from api.schemas.robots import EXAMPLE
from api.schemas.toolings import MOST_SEGMENTS
from api.work.robots import MOST_JOINTS, MOST_PLACES
from api.work.tasks import MOST_LINES
from benchmarks.request_cost import Cost, cost_of
from benchmarks.service import ask, machine_text, new_tooling, serving
from benchmarks.uploads import SAMPLES, campaign_of, recording
from rcsa_ident.io.settings.setups import tooling_of
from rcsa_ident.tool_holder.free_modes import bending_modes
from rcsa_ident.tool_holder.taper import hung

_BINARY = {"Content-Type": "application/octet-stream"}
_JSON = {"Content-Type": "application/json"}
_TUS = {"Tus-Resumable": "1.0.0"}
_FORM = {"Content-Type": "multipart/form-data; boundary=x"}
_PAGE = 200
#: Of the stock of paths [mm].
_BLOCK = [0.0, 0.0, -20.0, 200.0, 200.0, 0.0]
#: Routes that cost less are counted alone [s].
SLIGHT = 0.05
_LISTS = ("machines", "toolings", "robots", "changes", "recordings", "campaigns", "identifications", "keys")
#: Segments of tool and of holder in what is computed: two elements each, and 400 may be computed with.
_COMPUTED = 95
#: Cuts of a campaign whose tooling is new to the machine: one or three are enough.
CUTS_OF_NEW = 40
#: A recording of the sample campaign.
CUT = "S1-ER32-00_cut.h5"


class Ask(NamedTuple):
    """A request: what it is in words, path, headers and body."""

    words: str
    path: str
    headers: dict[str, str]
    body: bytes = b""


class Shop(NamedTuple):
    """What the service holds.

    Ids of a machine, a campaign of 160 recordings, jobs of an identification, of lobes and of a path, a key, a campaign of large
    recordings, and one, and a campaign of a tooling that is new to the machine.
    """

    machine: str
    campaign: str
    job: str
    lobes: str
    path: str
    key: str
    large: str
    raw: bytes
    new: str


def table(only: str) -> None:
    """Print a line of Markdown for every route whose path holds a text, and that takes longer than `SLIGHT`."""
    with tempfile.TemporaryDirectory() as text, serving(Path(text) / "data") as (port, process):
        interface = ask(port, "GET", "/openapi.json", None)
        shop = _shop(port, Path(text))
        routes = [(method.upper(), path) for path, item in interface["paths"].items() for method in item if only in path]
        print("| route | asked for | s | s elsewhere | MB more | MB elsewhere |\n|---|---|---|---|---|---|", flush=True)
        slight = 0
        for method, path in sorted(routes, key=_last):
            costs = [_dearest(port, process, method, ladder) for ladder in _ladders(method, path, shop)]
            cost = max(costs, key=lambda each: each.seconds + each.elsewhere)
            if cost.seconds + cost.elsewhere < SLIGHT:
                slight += 1
                continue
            more, largest = max(each.megabytes for each in costs), max(each.largest for each in costs)
            told = f"{cost.seconds:.2f} | {cost.elsewhere:.1f} | {more:.0f} | {largest:.0f}"
            print(f"| {method} {path.removeprefix('/v1')} | {cost.words} | {told} |", flush=True)
    print(f"{slight} more of {len(routes)} routes take less than {SLIGHT:g} s")


def _last(route: tuple[str, str]) -> tuple[int, int]:
    """What begins work that goes on comes late, what deletes what others need later, and machines, with which all goes, last."""
    method, path = route
    begins = method == "POST" and path.endswith(("/identifications", "/examples/campaign"))
    return (2 + path.endswith("/machines/{id}"), -len(path)) if method == "DELETE" else (int(begins), 0)


def _dearest(port: int, process: int, method: str, ladder: Iterator[Ask]) -> Cost:
    """Cost of the first request that is taken, or refused for what stands there already."""
    refused = ""
    for each in ladder:
        cost = cost_of(port, process, each.words, method, each.path, each.headers, each.body)
        # lobes that become a job have cost nothing yet
        if (200 <= cost.status < 300 and (cost.status != 202 or each.path != "/v1/lobes")) or cost.status == 409:
            return cost
        refused = f"{method} {each.path}, {each.words}: {cost.status}"
    raise RuntimeError(refused)


def _shop(port: int, folder: Path) -> Shop:
    """Fill the service."""
    with Client(f"http://127.0.0.1:{port}") as client:
        for k in range(_PAGE):
            client.make_machine(f"machine {k}")
            client.write_tooling(f"T{k}", _full(k))
            client.write_robot(f"T{k}", EXAMPLE)
        machine = client.make_machine("identified").id
        client.identify(machine, machine_text())
        client.write_tooling("T0", new_tooling(0))
        campaign = client.upload_folder(machine, SAMPLES).id
        example = client.make_example().campaign
        while not all(cut.verdict for cut in client.campaign(example).cuts):
            time.sleep(0.5)
        job = client.wait(client.identify_campaign(example).id).id
        large = campaign_of(port, machine)
        raw = recording(folder / "large.h5").read_bytes()
        (folder / "c0.h5").write_bytes(raw)
        client.upload(large, folder / "c0.h5")
        told = {"Upload-Length": str(len(raw)), "Upload-Metadata": _filename("f3.h5")}
        client.send("POST", f"/campaigns/{large}/uploads", headers=_TUS | told)
        lobes = client.lobes_later(machine, "T0", speeds={"from_rpm": 4000, "to_rpm": 20_000, "step_rpm": 20}).id
        while (told := client.lobe_job(lobes, wait=20)).job.finished is None:
            pass
        if told.answer is None:
            raise RuntimeError(told.job.problem)
        path = _cut_path(client, folder)
        key = client.send("POST", "/keys", json={"scopes": ["read"]}).json()["id"]
        new = _new_tool(client, machine)
    return Shop(machine, campaign, job, lobes, path, key, large, raw, new)


def _cut_path(client: Client, folder: Path) -> str:
    """A job of a path that is done."""
    (folder / "PATH.nc").write_bytes(_zigzag(5000))
    job = client.cut_path("removal", folder / "PATH.nc", new_tooling(0), block_mm=_BLOCK, cell_mm=0.5).id
    while (told := client.path_job(job, wait=20)).job.finished is None:
        pass
    if told.answer is None:
        raise RuntimeError(told.job.problem)
    return job


def _new_tool(client: Client, machine: str) -> str:
    """A campaign of cuts with one tooling, whose drawing is not exact."""
    data = tomllib.loads((SAMPLES / "campaign.toml").read_text(encoding="utf-8"))
    name = data["cuts"][0]["tooling"]
    keys = tomllib.loads((SAMPLES / data["toolings"][name]).read_text(encoding="utf-8")) | {"spread": {}}
    cuts = [cut for cut in data["cuts"] if cut["tooling"] == name][:CUTS_OF_NEW]
    campaign = client.make_campaign(machine, data | {"toolings": {name: keys}, "cuts": cuts}).id
    for cut in cuts:
        for kind in ("air", "cut"):
            client.upload(campaign, SAMPLES / cut[kind])
    return campaign


def _full(seed: int = 0, parts: int = MOST_SEGMENTS) -> dict[str, Any]:
    """A tooling of as many segments as one may have, or so many in tool and holder each."""
    keys = new_tooling(seed)
    keys["tool"] = {
        "stickout_mm": 60.0,
        "segments": [{"length_mm": 100.0 / parts, "outer_diameter_mm": 12.0, "material": "carbide"}] * parts,
    }
    part = {"length_mm": 80.0 / parts, "outer_diameter_mm": 50.0, "inner_diameter_mm": 12.0, "material": "steel"}
    keys["holder"] = {"insertion_mm": 40.0, "segments": [part] * parts}
    return keys


def _halved(words: str, most: int, make: Callable[[int], tuple[str, Any]], headers: dict[str, str] | None = None) -> Iterator[Ask]:
    """The same question with half as much again and again."""
    while most > 0:
        path, body = make(most)
        sent = b"" if body is None else body if isinstance(body, bytes) else json.dumps(body).encode()
        yield Ask(words.format(f"{most:,}".replace(",", " ")), path, headers or ({} if body is None else _JSON), sent)
        most //= 2


def _ladders(method: str, path: str, shop: Shop) -> Iterator[Iterator[Ask]]:
    """Questions of a route, each from the largest on."""
    asked = _questions(shop).get(f"{method} {path.removeprefix('/v1')}")
    if asked is not None:
        yield from asked
        return
    ids = {"/machines/": shop.machine, "/identifications/": shop.job, "/lobes/": shop.lobes, "/paths/": shop.path, "/keys/": shop.key}
    id = next((found for part, found in ids.items() if part in path), shop.campaign)
    place = path.replace("{id}", id).replace("{version}", "1")
    place = place.replace("{name}", "tooling" if "/schemas/" in path else "T0" if "/toolings/" in path or "/robots/" in path else CUT)
    listed = method == "GET" and path.rpartition("/")[2] in _LISTS
    yield iter([Ask(f"a page of {_PAGE}" if listed else "", f"{place}?limit={_PAGE}" if listed else place, {}, b"")])


def _questions(shop: Shop) -> dict[str, list[Iterator[Ask]]]:
    """Routes whose largest question has a form of its own."""
    recordings = f"/v1/campaigns/{shop.large}/recordings"
    uploads = f"/v1/campaigns/{shop.large}/uploads"
    length = str(len(shop.raw))
    large = f"{len(shop.raw) / 1e6:.0f} MB, 79 s of four channels"
    form = b'--x\r\nContent-Disposition: form-data; name="files"; filename="f2.h5"\r\n\r\n' + _varied(shop.raw, 1) + b"\r\n--x--\r\n"

    def speeds(count: int) -> dict[str, float]:
        return {"from_rpm": 4000.0, "to_rpm": 20_000.0, "step_rpm": 16_000.0 / max(count - 1, 1)}

    def queried(path: str, toolings: int, **further: Any) -> Callable[[int], tuple[str, Any]]:
        keys = {
            "machine": shop.machine,
            "toolings": [_full(k, _COMPUTED) for k in range(toolings)],
            "cut": {"feed_per_tooth_mm": 0.1},
            **further,
        }
        return lambda count: (path, keys | {"speeds": speeds(count)})

    def several(path: str, speeds: int) -> list[Iterator[Ask]]:
        many = f"{{}} toolings of {2 * _COMPUTED} segments, {speeds} speeds"
        return [
            _halved(many, MOST_TOOLINGS, lambda count: queried(path, count)(speeds)),
            _halved("full discretisation, {} speeds", MOST_SPEEDS, queried(path, 1, method="full-discretisation")),
        ]

    def cuts(count: int) -> dict[str, Any]:
        shared = {"spindle_speed_rpm": 8000.0, "axial_depth_mm": 0.4, "feed_per_tooth_mm": 0.1}
        shared |= {"entry_angle_deg": 90.0, "exit_angle_deg": 180.0}
        rows = [{"id": f"c{k}", "tooling": "T0", "feed_direction": "+X", "cut": f"c{k}.h5", **shared} for k in range(count)]
        sensors = {"flange_x": {"quantity": "displacement", "axis": "X", "sensitivity": 1.0e4}}
        workpiece = {"name": "w", "tangential_coefficient_mpa": 902.0, "radial_ratio": 0.26}
        return {"sensors": sensors, "workpiece": workpiece, "toolings": {"T0": new_tooling(0)}, "cuts": rows}

    def lines(path: str, **further: Any) -> Callable[[int], tuple[str, Any]]:
        top = 4000.0
        if further:
            return lambda count: (path, further | {"from_hz": 100.0, "to_hz": top, "step_hz": (top - 100.0) / (count - 1)})
        return lambda count: (f"{path}?from_hz=100&to_hz={top}&step_hz={(top - 100.0) / (count - 1)}", None)

    tests = "spindle_speed_rpm,axial_depth_mm,verdict\n" + "8000,1.0,stable\n" * MOST_TESTED
    geometry = {"DC": 12.0, "LB": 60.0, "LCF": 26.0, "NOF": 4, "OAL": 104.0, "SFDM": 12.0, "shoulder-length": 30.0}
    chuck = {"gaugeLength": 80.0, "segments": [{"height": 0.4, "lower-diameter": 50.0, "upper-diameter": 50.0}] * MOST_SEGMENTS}
    tool = {"type": "flat end mill", "unit": "millimeters", "BMC": "carbide", "geometry": geometry, "holder": chuck}

    def library(count: int) -> tuple[str, Any]:
        return "/v1/toolings/import", {"data": [tool | {"description": f"I{k}"} for k in range(count)]}

    def frames(path: str, sent: bytes, **headers: str) -> list[Iterator[Ask]]:
        return [iter([Ask(large, path, _BINARY | headers, sent)])]

    def dropped(count: int) -> tuple[str, Any]:
        named = {"campaign.toml": cuts(count)} | {f"T{k}.toml": new_tooling(k) for k in range(199)}
        return "/v1/campaigns/preview", {"files": [{"name": name, "text": tomli_w.dumps(keys)} for name, keys in named.items()]}

    def learning(path: str) -> list[Iterator[Ask]]:
        return [iter([Ask(f"{CUTS_OF_NEW} cuts of a new tooling", f"/v1/campaigns/{shop.new}/{path}", {})])]

    def plain(path: str, body: Any) -> list[Iterator[Ask]]:
        return [iter([Ask("", path, _JSON, json.dumps(body).encode())])]

    forces = {"machine": shop.machine, "campaign": shop.campaign, "recording": CUT}
    whole = {"Content-Type": "application/offset+octet-stream", "Upload-Offset": "0"} | _TUS
    return {
        "POST /keys": plain("/v1/keys", {"scopes": ["read"]}),
        "POST /machines": plain("/v1/machines", {"name": "n"}),
        "POST /identifications": plain("/v1/identifications", {"campaign": shop.campaign}),
        "POST /forces": plain("/v1/forces", forces),
        "PUT /machines/{id}/identification": [
            iter([Ask("7 modes an axis, whole posterior", f"/v1/machines/{shop.machine}/identification", _JSON, machine_text().encode())])
        ],
        "GET /machines/{id}/identification/frf": [
            _halved("{} lines", MOST_LINES, lines(f"/v1/machines/{shop.machine}/identification/frf"))
        ],
        "PUT /toolings/{name}": [_halved("{} segments", 2 * MOST_SEGMENTS, lambda _: ("/v1/toolings/T0", _full()))],
        "POST /toolings/drawing": [_halved("{} segments", 2 * MOST_SEGMENTS, lambda _: ("/v1/toolings/drawing", _full()))],
        "GET /toolings/{name}/drawing": [iter([Ask(f"{2 * MOST_SEGMENTS} segments", "/v1/toolings/T1/drawing", {})])],
        "POST /toolings/{name}/differences": [
            _halved("{} segments", 2 * MOST_SEGMENTS, lambda _: ("/v1/toolings/T0/differences", _full(9)))
        ],
        "POST /toolings/import": [_halved("{} tools of a CAM library", 8192, library)],
        "POST /listen": [iter([Ask("a minute of sound at 48 kHz", "/v1/listen", {"Content-Type": "audio/wav"}, _sound())])],
        "POST /tap": [iter([Ask("20 hits in 20 s at 25.6 kHz", "/v1/tap", {"Content-Type": "text/csv"}, _hits())])],
        "POST /ring": [_halved("{} sounds of ten hits in 10 s at 48 kHz", MOST_SOUNDS, _rings, _FORM)],
        "POST /campaigns/{id}/learn": learning("learn"),
        "POST /campaigns/{id}/learn/take-over": learning("learn/take-over?machine=true"),
        "POST /campaigns/preview": [_halved("200 files, a campaign of {} cuts", 2000, dropped)],
        "POST /tested-cuts/preview": [
            iter([Ask(f"{MOST_TESTED} cuts", "/v1/tested-cuts/preview", {"Content-Type": "text/csv"}, tests.encode())])
        ],
        "GET /holders/{taper}/{chuck}": [iter([Ask("", "/v1/holders/HSK-A63/ER32?bore_mm=12", {})])],
        "GET /examples/{name}": [iter([Ask("", "/v1/examples/sample-campaign.zip", {})])],
        "POST /machines/{id}/campaigns": [_halved("{} cuts", 2000, lambda count: (f"/v1/machines/{shop.machine}/campaigns", cuts(count)))],
        "PUT /campaigns/{id}/recordings/{name}": frames(f"{recordings}/c1.h5", _varied(shop.raw, 0)),
        "PATCH /campaigns/{id}/recordings/{name}": frames(
            f"{recordings}/c2.h5", _varied(shop.raw, 2), **{"Upload-Offset": "0", "Upload-Length": length}
        ),
        "POST /campaigns/{id}/recordings": [iter([Ask(large, recordings, _FORM, form)])],
        "HEAD /campaigns/{id}/recordings/{name}": [iter([Ask(large, f"{recordings}/c0.h5", {})])],
        "GET /campaigns/{id}/recordings/{name}/file": [iter([Ask(large, f"{recordings}/c0.h5/file", {})])],
        "GET /campaigns/{id}/recordings/{name}/spectrum": [iter([Ask(large, f"{recordings}/c0.h5/spectrum?points=10000", {})])],
        "GET /campaigns/{id}/recordings/{name}/signal": [iter([Ask(large, f"{recordings}/c0.h5/signal?points=10000", {})])],
        "GET /campaigns/{id}/archive": [iter([Ask("160 recordings", f"/v1/campaigns/{shop.campaign}/archive", {})])],
        "POST /campaigns/{id}/uploads": [iter([Ask("", uploads, _TUS | {"Upload-Length": length, "Upload-Metadata": _filename("f1.h5")})])],
        "OPTIONS /campaigns/{id}/uploads": [iter([Ask("", uploads, {})])],
        "HEAD /campaigns/{id}/uploads/{name}": [iter([Ask("", f"{uploads}/f1.h5", _TUS)])],
        "PATCH /campaigns/{id}/uploads/{name}": [iter([Ask(large, f"{uploads}/f1.h5", whole, _varied(shop.raw, 3))])],
        "DELETE /campaigns/{id}/uploads/{name}": [iter([Ask("", f"{uploads}/f3.h5", _TUS)])],
        "POST /tooltip": [_halved("{} lines", MOST_LINES, lines("/v1/tooltip", machine=shop.machine, tooling=_full(0, _COMPUTED)))],
        "POST /lobes": several("/v1/lobes", 320),
        "POST /advice": several("/v1/advice", 160),
        **_of_robots(),
        **_of_paths(shop.machine),
    }


def _of_robots() -> dict[str, list[Iterator[Ask]]]:
    """Questions of an arm: 12 joints with two springs across each, and a thousand places of the TX200."""
    link = {"mass_kg": 50.0, "inertia_kg_m2": [2.0, 2.0, 2.0, 0.0, 0.0, 0.0]}
    spring = {"stiffness_nm_per_rad": 1e6, "damping_nms_per_rad": 100.0}
    tilts = [{"axis": axis, **spring} for axis in ([1.0, 0.0, 0.0], [0.0, 0.8, -0.6])]
    joint = {"axis": [0.0, 0.6, 0.8], "offset_mm": [0.0, 100.0, 200.0], "link": link, "tilts": tilts, **spring}
    arm = {"robot": {"name": "long"}, "joints": [joint | {"name": f"J{k}"} for k in range(MOST_JOINTS)]}
    near = {"robot": "tx200", "posture_deg": [-11.71, 20.78, 110.0, 82.76, 60.80, -166.96]}

    def along(path: str, **further: Any) -> Callable[[int], tuple[str, Any]]:
        return lambda count: (
            path,
            {"robot": near, "tooling": new_tooling(0), "places": [[1000.0, 0.1 * k, 500.0] for k in range(count)], **further},
        )

    cut = {"ktc_mpa": 660.0, "krc": 0.38}
    speeds = {"from_rpm": 4000.0, "to_rpm": 20_000.0, "step_rpm": 1000.0}
    csv = "x_mm,y_mm,z_mm\n" + "1000,0,500\n" * MOST_PLACES
    posture = {"robot": {"robot": arm, "posture_deg": [10.0] * MOST_JOINTS}}
    size = f"{MOST_JOINTS} joints of {1 + len(tilts)} springs"
    return {
        "PUT /robots/{name}": [iter([Ask(size, "/v1/robots/T0", _JSON, json.dumps(arm).encode())])],
        "POST /robots/posture": [iter([Ask(size, "/v1/robots/posture", _JSON, json.dumps(posture).encode())])],
        "POST /robots/path": [_halved("{} places", MOST_PLACES, along("/v1/robots/path"))],
        "POST /robots/map": [_halved("{} places, 17 speeds", MOST_PLACES, along("/v1/robots/map", cut=cut, speeds=speeds))],
        "POST /robots/path/preview": [
            iter([Ask(f"{MOST_PLACES} places", "/v1/robots/path/preview", {"Content-Type": "text/csv"}, csv.encode())])
        ],
    }


def _of_paths(machine: str) -> dict[str, list[Iterator[Ask]]]:
    """Questions of a tool along a path: as many lines of a program as are taken."""
    tooling = {"tooling": new_tooling(0), "block_mm": _BLOCK}
    judged = tooling | {"machine": machine, "spindle_speed_rpm": 12_000.0}

    def queried(name: str, keys: dict[str, Any]) -> list[Iterator[Ask]]:
        head = b'--x\r\nContent-Disposition: form-data; name="query"\r\n\r\n' + json.dumps(keys).encode()
        head += b'\r\n--x\r\nContent-Disposition: form-data; name="path"; filename="PATH.nc"\r\n\r\n'
        return [
            _halved("{} lines of a program", 200_000, lambda count: (f"/v1/paths/{name}", head + _zigzag(count) + b"\r\n--x--\r\n"), _FORM)
        ]

    return {
        "POST /paths/preview": [
            _halved("{} lines of a program", 200_000, lambda count: ("/v1/paths/preview", _zigzag(count)), {"Content-Type": "text/x-gcode"})
        ],
        "POST /paths/removal": queried("removal", tooling),
        "POST /paths/stability": queried("stability", judged),
        "POST /paths/milling": queried("milling", judged),
    }


def _zigzag(count: int) -> bytes:
    """A program of so many lines over the block."""
    places = (f"X{200.0 * (k % 2):g}Y{200.0 * k / count:.3f}" if k % 20 == 0 else f"X{(7.3 * k) % 200.0:.2f}" for k in range(count))
    return ("G21G90G0X-20Y0Z-1\nF2000\nG1\n" + "\n".join(places)).encode()


def _sound() -> bytes:
    """A minute of teeth at 400 Hz in noise, as a WAV file."""
    time, rng = np.arange(60 * 48_000) / 48_000.0, np.random.default_rng(1)
    heard = sum(np.cos(2.0 * np.pi * 400.0 * m * time) / m for m in range(1, 9)) + 0.1 * rng.standard_normal(time.size)
    file = io.BytesIO()
    with wave.open(file, "wb") as sound:
        sound.setnchannels(1)
        sound.setsampwidth(2)
        sound.setframerate(48_000)
        sound.writeframes((8000.0 * heard / np.abs(heard).max()).astype("<i2").tobytes())
    return file.getvalue()


def _rings(count: int) -> tuple[str, bytes]:
    """A form of a tooling and so many sounds of its first two modes."""
    keys = new_tooling(0) | {"spread": {}}
    modes = bending_modes(hung(tooling_of(keys, "", "rung").assembly, ""), 2, 12e3)
    rate, rng = 48_000.0, np.random.default_rng(1)
    after = np.arange(int(10.0 * rate)) / rate % 1.0 - 0.1
    heard = 3e-3 * rng.standard_normal(after.size)
    for mode in modes:
        decay = np.exp(-(mode.damping or 0.01) * mode.omega * np.maximum(after, 0.0)) * np.sin(mode.omega * after)
        heard += np.where(after > 0.0, decay / mode.order, 0.0)
    file = io.BytesIO()
    with wave.open(file, "wb") as sound:
        sound.setnchannels(1)
        sound.setsampwidth(2)
        sound.setframerate(int(rate))
        sound.writeframes((16_000.0 * heard / np.abs(heard).max()).astype("<i2").tobytes())
    parts = [b'--x\r\nContent-Disposition: form-data; name="query"\r\n\r\n' + json.dumps({"tooling": keys, "curves": True}).encode()]
    for k in range(count):
        parts.append(b'--x\r\nContent-Disposition: form-data; name="sounds"; filename="%d.wav"\r\n\r\n' % k + file.getvalue())
    return "/v1/ring", b"\r\n".join(parts) + b"\r\n--x--\r\n"


def _hits() -> bytes:
    """Hits of a hammer a second apart against one mode, as a table of text."""
    rate, rng = 25_600.0, np.random.default_rng(1)
    time = np.arange(int(20.0 * rate)) / rate
    after = (time % 1.0) - 0.1
    ringing = np.where(after > 0.0, 300.0 * np.exp(-60.0 * after) * np.sin(2.0 * np.pi * 1200.0 * after), 0.0)
    force = 200.0 * np.exp(-0.5 * (after / 1e-4) ** 2)
    columns = np.stack([time, force, ringing], axis=1) + [0.0, 0.02, 0.05] * rng.standard_normal((time.size, 3))
    file = io.BytesIO()
    np.savetxt(file, columns, fmt="%.9g", delimiter=",", header="time (s),hammer (N),tip (m/s^2)", comments="")
    return file.getvalue()


def _varied(raw: bytes, seed: int) -> bytes:
    """Other samples at the end: the same content again would not be read."""
    return raw[:-4] + (seed + 1).to_bytes(4, "little")


def _filename(name: str) -> str:
    return f"filename {base64.b64encode(name.encode()).decode()}"
