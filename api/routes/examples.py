"""Example files: toolings, a campaign, tested cuts, modes, a tool library, recordings and published robots."""

from __future__ import annotations

from pathlib import Path as Folder
from typing import Annotated

from fastapi import APIRouter, Path, Response
from fastapi.responses import FileResponse, StreamingResponse

from api.components import Components, ThisService
from api.conventions import guard, problems
from api.problems import Problem
from api.schemas.libraries import Example, Examples
from api.security import Guarded
from api.transfer.archives import zipped, zipped_bytes
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.sample_files import sample_robots
from rcsa_ident.io.settings.setups import read_campaign
from rcsa_ident.io.toml_text import read_toml

router = APIRouter(prefix="/examples", tags=["examples"], route_class=Guarded)
_FOLDER = Folder(__file__).resolve().parents[1] / "examples"
_TYPES = {".toml": "application/toml", ".csv": "text/csv; charset=utf-8", ".json": "application/json", ".zip": "application/zip"}
_ABOUT = {
    "S1-ER32.toml": "A tooling: end mill of 12 mm in a collet chuck.",
    "S2-PG25.toml": "A tooling: the same end mill, shorter, in a press-fit chuck.",
    "campaign.toml": "A campaign of one cut, with an explanation of every key.",
    "CUTS.csv": "Tested cuts, drawn together with lobes.",
    "MODES.toml": "Tooltip modes, from which lobes are computed without an identification.",
    "tool-library.json": "A tool library as exported by CAM programs.",
    "small-campaign.zip": "A campaign of two cuts with their air cuts: to see uploads and verdicts.",
}
_ROBOTS = {
    "tx200.toml": "A robot: Stäubli TX200, angles of its encoders, all zero upright.",
    "kr210.toml": "A robot: KUKA KR210, with a spindle; angles of the model.",
    "kr500.toml": "A robot: KUKA KR500 R2830, postures and stiffness alone.",
}
SAMPLE, _SAMPLE_ABOUT = "sample-campaign.zip", "A campaign with two toolings: enough for an identification."


@router.get("", summary="List examples", openapi_extra=guard("read"), responses=problems())
def list_examples(components: ThisService) -> Examples:
    items = [Example(name=name, size_bytes=(_FOLDER / name).stat().st_size, about=about) for name, about in _ABOUT.items()]
    items += [Example(name=name, size_bytes=path.stat().st_size, about=_ROBOTS[name]) for name, path in _robots().items()]
    members = _sample(components)
    if members:
        items.append(Example(name=SAMPLE, size_bytes=zipped_bytes(members), about=_SAMPLE_ABOUT))
    return Examples(items=items)


@router.get(
    "/{name}",
    summary="The file of an example",
    openapi_extra=guard("read"),
    response_class=Response,
    responses={
        200: {"description": "A file.", "content": {kind.split(";")[0]: {"schema": {"type": "string"}} for kind in _TYPES.values()}},
        **problems(404, 422),
    },
)
def get_example(name: Annotated[str, Path(pattern=r"^[A-Za-z0-9.-]{1,64}$")], components: ThisService) -> Response:
    if name in _ABOUT:
        return FileResponse(_FOLDER / name, media_type=_TYPES[(_FOLDER / name).suffix], filename=name)
    if name in (robots := _robots()):
        return FileResponse(robots[name], media_type=_TYPES[".toml"], filename=name)
    members = _sample(components) if name == SAMPLE else []
    if not members:
        raise Problem(404, "there is no such example")
    headers = {"Content-Disposition": f'attachment; filename="{SAMPLE}"'}
    return StreamingResponse(zipped(members), media_type=_TYPES[".zip"], headers=headers)


def _robots() -> dict[str, Folder]:
    """The published arms that the package carries, by the names of their files."""
    return {path.name: path for path in sample_robots().values() if path.name in _ROBOTS}


def _sample(components: Components) -> list[tuple[str, Folder]]:
    """Files of the campaign in the folder of the settings, by name in the archive; empty where there is none."""
    folder = components.settings.examples
    try:
        campaign = read_campaign(folder)
        toolings = [folder / str(each) for each in read_toml(folder / "campaign.toml", "campaign")["toolings"].values()]
    except (InputError, OSError, KeyError, AttributeError):
        return []
    root = folder.resolve()
    paths = [folder / "campaign.toml", *toolings]
    paths += [path for cut in campaign.cuts for path in (cut.recording, cut.air) if path is not None]
    members = {path.resolve(): path for path in paths}
    return [(there.relative_to(root).as_posix(), path) for there, path in members.items() if there.is_file() and there.is_relative_to(root)]
