"""The complete client."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any
from urllib.parse import quote

import httpx2

from api.client.asking import Json, match, read, standing_on
from api.client.jobs import Jobs
from api.client.uploads import Uploads
from api.schemas.common import Page
from api.schemas.dropped_files import DroppedAnswer, TestedCutsAnswer
from api.schemas.forces import ForceAnswer, StreamsAnswer, StreamSummary
from api.schemas.holders import CatalogueAnswer, Holders
from api.schemas.keys import KeyAnswer, MadeKey
from api.schemas.learning import LearnAnswer
from api.schemas.libraries import Example, ExampleCampaign, Examples, ImportAnswer
from api.schemas.listening import ListenAnswer, TapAnswer
from api.schemas.machines import Frf, Identification, IdentificationSummary, MachineAnswer, MachineContents, Modes
from api.schemas.materials import MaterialAnswer, Materials
from api.schemas.queries import AdviceAnswer, TipAnswer
from api.schemas.ringing import RingAnswer
from api.schemas.robot_queries import MapAnswer, PathAnswer, PathPreview, PostureAnswer
from api.schemas.robots import RobotAnswer, RobotSummary
from api.schemas.toolings import ToolingAnswer, ToolingSummary
from api.schemas.usage import Usage
from api.schemas.versions import ChangeAnswer, Differences, ToolingVersion


class Client(Uploads, Jobs):
    """Client of a service.

    Parameters
    ----------
    url : str
    key : str or None
    http : httpx2.Client or None
        To be used instead of a client of its own.
    """

    def make_machine(self, name: str, description: str = "", repeat: str | None = None) -> MachineAnswer:
        """Make a machine; `repeat` is an idempotency key."""
        headers = {} if repeat is None else {"Idempotency-Key": repeat}
        return read(MachineAnswer, self.send("POST", "/machines", json={"name": name, "description": description}, headers=headers))

    def machine(self, id: str) -> MachineAnswer:
        """Return a machine."""
        return read(MachineAnswer, self.send("GET", f"/machines/{id}"))

    def machines(self, limit: int = 50) -> Iterator[MachineAnswer]:
        """Yield all machines."""
        return self.all("/machines", Page[MachineAnswer], limit)

    def machine_contents(self, id: str) -> MachineContents:
        """Return what is deleted with a machine."""
        return read(MachineContents, self.send("GET", f"/machines/{id}/contents"))

    def forget_machine(self, id: str, seen: str | None = None) -> None:
        """Delete a machine, its identification and its campaigns; `seen` is the etag of the contents that were looked at."""
        self.send("DELETE", f"/machines/{id}", headers=match(seen))

    def identify(self, id: str, result: str | bytes, seen: str | None = None) -> IdentificationSummary:
        """Write what is known of a machine (content of RESULT.json or FLANGE.csv); `seen` is the etag of what it replaces."""
        kind = "application/json" if result.lstrip()[:1] in ("{", b"{") else "text/csv"
        headers = {"Content-Type": kind, **match(seen)}
        return read(IdentificationSummary, self.send("PUT", f"/machines/{id}/identification", content=result, headers=headers))

    def identification(self, id: str) -> Identification:
        """Return the content of RESULT.json."""
        return read(Identification, self.send("GET", f"/machines/{id}/identification"))

    def modes(self, id: str) -> Modes:
        """Return modes with their uncertainties."""
        return read(Modes, self.send("GET", f"/machines/{id}/identification/modes"))

    def frf(self, id: str, **query: float) -> Frf:
        """Return the spindle's receptance at its flange; options from_hz, to_hz, step_hz."""
        return read(Frf, self.send("GET", f"/machines/{id}/identification/frf", params=query))

    def write_tooling(self, name: str, tooling: str | Json, seen: str | None = None, why: str = "") -> ToolingAnswer:
        """Write a tooling, from the text of a tooling file or from its keys; what it replaces stays as a version."""
        return read(ToolingAnswer, self._send_toml("PUT", f"/toolings/{name}", tooling, match(seen), {"why": why} if why else {}))

    def differences(self, name: str, tooling: str | Json) -> Differences:
        """Return where a tooling differs from that of the library."""
        return read(Differences, self._send_toml("POST", f"/toolings/{name}/differences", tooling, {}, {}))

    def _send_toml(self, method: str, path: str, tooling: str | Json, headers: Json, params: Json) -> httpx2.Response:
        if isinstance(tooling, str):
            kind = {"Content-Type": "application/toml", **headers}
            return self.send(method, path, content=tooling.encode(), headers=kind, params=dict(params))
        return self.send(method, path, json=tooling, headers=dict(headers), params=dict(params))

    def changes(self, limit: int = 50, **wanted: str) -> Iterator[ChangeAnswer]:
        """Yield the audit trail, newest first; options kind and name (of a tooling, or id of a machine)."""
        return self.all("/changes", Page[ChangeAnswer], limit, wanted)

    def tooling_version(self, name: str, version: int) -> ToolingVersion:
        """Return a version of a tooling."""
        return read(ToolingVersion, self.send("GET", f"/toolings/{name}/versions/{version}"))

    def restore_tooling(self, name: str, version: int, seen: str | None = None, why: str = "") -> ToolingAnswer:
        """Write a version of a tooling again, also one that was deleted."""
        path = f"/toolings/{name}/versions/{version}/restore"
        return read(ToolingAnswer, self.send("POST", path, headers=match(seen), params={"why": why}))

    def identification_version(self, id: str, version: int) -> str:
        """Return the text of RESULT.json or FLANGE.csv of a version."""
        return self.send("GET", f"/machines/{id}/identification/versions/{version}").text

    def restore_identification(self, id: str, version: int, seen: str | None = None, why: str = "") -> IdentificationSummary:
        """Write a version of a machine's identification again."""
        path = f"/machines/{id}/identification/versions/{version}/restore"
        return read(IdentificationSummary, self.send("POST", path, headers=match(seen), params={"why": why}))

    def tooling(self, name: str) -> ToolingAnswer:
        """Return a tooling."""
        return read(ToolingAnswer, self.send("GET", f"/toolings/{name}"))

    def tooling_file(self, name: str) -> str:
        """Return the text of the tooling file."""
        return self.send("GET", f"/toolings/{name}", headers={"Accept": "application/toml"}).text

    def drawing(self, name: str) -> str:
        """Return the drawing of a tooling to scale, SVG."""
        return self.send("GET", f"/toolings/{name}/drawing").text

    def toolings(self, limit: int = 50) -> Iterator[ToolingSummary]:
        """Yield all toolings."""
        return self.all("/toolings", Page[ToolingSummary], limit)

    def write_robot(self, name: str, robot: str | Json, seen: str | None = None, why: str = "") -> RobotAnswer:
        """Write a robot: the text of ROBOT.toml, or its keys; `seen` is the etag of what it replaces."""
        return read(RobotAnswer, self._send_toml("PUT", f"/robots/{name}", robot, match(seen), {"why": why} if why else {}))

    def robot(self, name: str) -> RobotAnswer:
        """Return a robot."""
        return read(RobotAnswer, self.send("GET", f"/robots/{name}"))

    def robot_file(self, name: str) -> str:
        """Return the text of ROBOT.toml."""
        return self.send("GET", f"/robots/{name}", headers={"Accept": "application/toml"}).text

    def robots(self, limit: int = 50) -> Iterator[RobotSummary]:
        """Yield all robots."""
        return self.all("/robots", Page[RobotSummary], limit)

    def forget_robot(self, name: str, seen: str | None = None) -> None:
        """Delete a robot."""
        self.send("DELETE", f"/robots/{name}", headers=match(seen))

    def posture(self, robot: Json, **further: Any) -> PostureAnswer:
        """Return what an arm is at a posture: {"robot": name or keys, "posture_deg": [...]}."""
        return read(PostureAnswer, self.send("POST", "/robots/posture", json={"robot": robot, **further}))

    def along_path(self, robot: Json, tooling: str | Json, path: Sequence[Sequence[float]]) -> PathAnswer:
        """Return the postures that bring a tool's tip to the places of a path, rows x, y, z [mm] (and i, j, k)."""
        return read(PathAnswer, self.send("POST", "/robots/path", json={"robot": robot, "tooling": tooling, "places": path}))

    def limit_map(self, robot: Json, tooling: str | Json, path: Sequence[Sequence[float]], **further: Any) -> MapAnswer:
        """Return the stability limits at the places of a path."""
        return read(MapAnswer, self.send("POST", "/robots/map", json={"robot": robot, "tooling": tooling, "places": path, **further}))

    def path_of(self, text: str) -> PathPreview:
        """Return the places of PATH.csv; nothing is stored."""
        return read(PathPreview, self.send("POST", "/robots/path/preview", content=text.encode(), headers={"Content-Type": "text/csv"}))

    def import_toolings(self, library: bytes, **assumed: Any) -> ImportAnswer:
        """Import the toolings of a Fusion 360 or HSM tool library; `replace` overwrites existing ones."""
        kind = "application/zip" if library.startswith(b"PK") else "application/json"
        query = _query(assumed)
        return read(ImportAnswer, self.send("POST", "/toolings/import", content=library, params=query, headers={"Content-Type": kind}))

    def holders(self) -> Holders:
        """Return what the catalogue of holders has."""
        return read(Holders, self.send("GET", "/holders"))

    def holder(self, taper: str, chuck: str, bore_mm: float, length_mm: float | None = None) -> CatalogueAnswer:
        """Return a holder of the catalogue, by default of a typical length."""
        query = {"bore_mm": bore_mm} if length_mm is None else {"bore_mm": bore_mm, "length_mm": length_mm}
        return read(CatalogueAnswer, self.send("GET", f"/holders/{taper}/{chuck}", params=query))

    def preview(self, files: Mapping[str, str]) -> DroppedAnswer:
        """Return what TOML files hold, texts by name: campaign, toolings and what is missing; nothing is stored."""
        body = {"files": [{"name": name, "text": text} for name, text in files.items()]}
        return read(DroppedAnswer, self.send("POST", "/campaigns/preview", json=body))

    def tested_cuts(self, text: str) -> TestedCutsAnswer:
        """Return the cuts of CUTS.csv; nothing is stored."""
        return read(
            TestedCutsAnswer, self.send("POST", "/tested-cuts/preview", content=text.encode(), headers={"Content-Type": "text/csv"})
        )

    def listen(self, recording: Path, **further: Any) -> ListenAnswer:
        """Return what a recording says.

        Options channel, quantity, teeth, speed_rpm, speeds_from, speeds_to, rate_hz, sensitivity, curves.
        """
        query = {"name": recording.name, **_query(further)}
        with recording.open("rb") as opened:
            headers = {"Content-Type": "application/octet-stream"}
            answer = self.send("POST", "/listen", content=opened, params=query, headers=headers, **self.long_timeout)
        return read(ListenAnswer, answer)

    def tap(self, *hits: Path, **further: Any) -> TapAnswer:
        """Return the receptance of hammer hits; options axis, force, response, quantity, estimator, sensor_mass_g, rate_hz,
        force_sensitivity, response_sensitivity, reverse."""
        return read(TapAnswer, self._tap(hits, further, "application/json"))

    def tap_file(self, *hits: Path, uff: bool = False, **further: Any) -> str:
        """Return the text of FRF.csv, or of a universal file, of hammer hits; options as of `tap`."""
        return self._tap(hits, further, "application/x-uff" if uff else "text/csv").text

    def _tap(self, hits: tuple[Path, ...], further: Mapping[str, Any], kind: str) -> httpx2.Response:
        with ExitStack() as opened:
            files = [("hits", (path.name, opened.enter_context(path.open("rb")))) for path in hits]
            return self.send("POST", "/tap", files=files, params=_query(further), headers={"Accept": kind}, **self.long_timeout)

    def ring(self, tooling: str | Json, *sounds: Path, bare_tool: Sequence[Path] = (), **further: Any) -> RingAnswer:
        """Return what the ring of a tooling tells of it, by its name or its keys; options mass_g, rate_hz, curves."""
        with ExitStack() as opened:
            named = [*(("sounds", path) for path in sounds), *(("bare_tool", path) for path in bare_tool)]
            files = [(field, (path.name, opened.enter_context(path.open("rb")))) for field, path in named]
            query = ("query", (None, json.dumps({"tooling": tooling, **further})))
            return read(RingAnswer, self.send("POST", "/ring", files=[query, *files], **self.long_timeout))

    def learn(self, campaign: str) -> LearnAnswer:
        """Return what the cuts of a campaign teach of toolings that are new to its machine; nothing is stored."""
        return read(LearnAnswer, self.send("POST", f"/campaigns/{campaign}/learn", **self.long_timeout))

    def take_over(self, campaign: str, machine: bool = False, seen: str | None = None, why: str = "") -> LearnAnswer:
        """Write the toolings that a campaign's cuts teach, with `machine` the machine, too; `seen` is the etag of what `learn` answered."""
        params = {"machine": str(machine).lower(), "why": why}
        path = f"/campaigns/{campaign}/learn/take-over"
        return read(LearnAnswer, self.send("POST", path, params=params, headers=match(seen), **self.long_timeout))

    def schema(self, name: str) -> Json:
        """Return the JSON Schema of a TOML file: tooling, campaign, machine or modes."""
        found: Json = self.send("GET", f"/schemas/{name}").json()
        return found

    def materials(self) -> list[MaterialAnswer]:
        """Return the library of materials."""
        return read(Materials, self.send("GET", "/materials")).items

    def examples(self) -> list[Example]:
        """Return the list of examples."""
        return read(Examples, self.send("GET", "/examples")).items

    def example(self, name: str, file: Path) -> None:
        """Download the file of an example."""
        self.download(f"/examples/{quote(name)}", file)

    def make_example(self) -> ExampleCampaign:
        """Make the example machine with its campaign, whose recordings follow; or what is missing of them."""
        return read(ExampleCampaign, self.send("POST", "/examples/campaign"))

    def forget_example(self, own: bool = False, seen: str | None = None) -> None:
        """Delete the example machine with its campaign and its toolings, with `own` also campaigns of one's own on it."""
        self.send("DELETE", "/examples/campaign", params={"own": own}, headers=match(seen))

    def forget_tooling(self, name: str, seen: str | None = None) -> None:
        """Delete a tooling."""
        self.send("DELETE", f"/toolings/{name}", headers=match(seen))

    def tooltip(self, machine: str | Json, tooling: str | Json | None = None, **further: Any) -> TipAnswer:
        """Return a tooltip FRF, on a machine by its id, on a robot at a posture, as `posture` takes it, or a tapped one."""
        return read(TipAnswer, self.send("POST", "/tooltip", json={**standing_on(machine), "tooling": tooling, **further}))

    def tooltip_file(self, machine: str | Json, tooling: str | Json | None = None, **further: Any) -> str:
        """Return the text of FRF.csv."""
        body = {**standing_on(machine), "tooling": tooling, **further}
        return self.send("POST", "/tooltip", json=body, headers={"Accept": "text/csv"}).text

    def advice(self, machine: str | Json, *toolings: str | Json, **further: Any) -> AdviceAnswer:
        """Return the cuts of highest removal rate, and the margins of planned cuts."""
        return read(AdviceAnswer, self.send("POST", "/advice", json={**standing_on(machine), "toolings": list(toolings), **further}))

    def forces(self, machine: str, tooling: str | Json, recording: Path, air: Path | None = None, **further: Any) -> ForceAnswer:
        """Return the forces of a local recording."""
        return read(ForceAnswer, self._forces({"machine": machine, "tooling": tooling, **further}, recording, air))

    def forces_file(self, machine: str, tooling: str | Json, recording: Path, air: Path | None = None, **further: Any) -> str:
        """Return the text of FORCES.csv."""
        query = {"machine": machine, "tooling": tooling, **further}
        return self._forces(query, recording, air, {"Accept": "text/csv"}).text

    def forces_of_campaign(self, machine: str, campaign: str, recording: str, **further: Any) -> ForceAnswer:
        """Return the forces of an uploaded recording, using its air cut."""
        body = {"machine": machine, "campaign": campaign, "recording": recording, **further}
        return read(ForceAnswer, self.send("POST", "/forces", json=body))

    def streams(self) -> list[StreamSummary]:
        """Return all open force streams; `api.stream_client` opens one."""
        return read(StreamsAnswer, self.send("GET", "/forces/streams")).items

    def _forces(self, query: Json, recording: Path, air: Path | None, headers: Mapping[str, str] | None = None) -> httpx2.Response:
        with ExitStack() as opened:
            named = {"recording": recording} | ({} if air is None else {"air": air})
            files = {field: (path.name, opened.enter_context(path.open("rb"))) for field, path in named.items()}
            return self.send("POST", "/forces", data={"query": json.dumps(query)}, files=files, headers=dict(headers or {}))

    def make_key(self, *scopes: str, label: str = "", days: float | None = None) -> MadeKey:
        """Make an API key; `days` after which it expires."""
        body = {"scopes": list(scopes), "label": label} | ({} if days is None else {"expires_in_days": days})
        return read(MadeKey, self.send("POST", "/keys", json=body))

    def keys(self, limit: int = 50) -> Iterator[KeyAnswer]:
        """Yield all keys."""
        return self.all("/keys", Page[KeyAnswer], limit)

    def usage(self) -> Usage:
        """Return what the group keeps, and what it may keep."""
        return read(Usage, self.send("GET", "/usage"))

    def withdraw_key(self, id: str) -> None:
        """Revoke an API key."""
        self.send("DELETE", f"/keys/{id}")


def _query(given: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters of a query; what is None is left out."""
    return {key: str(value).lower() if isinstance(value, bool) else value for key, value in given.items() if value is not None}
