"""Schemas of the files that people write say what their readers say: every file and every change of one is judged alike by both."""

import copy
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jsonschema_rs
import pytest
import rtoml

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.settings.schemas import _FILES, DIALECT, SCHEMAS, schema_of, schema_text
from rcsa_ident.setup.fields import NOUNS
from tests.fixtures.paths import ROOT

#: What hangs on another key of the file, or asks for one more key or entry: only a reader knows it.
_BETWEEN_KEYS = re.compile(
    r"finite numbers? \[(deg|mm|wavelengths)\]|"
    r"radial_depth_mm: found [\d.e+]+, allowed is a finite number above 0 and at most|the distance from the tip from 0 to|"
    r"angles above 0 that add up|stiffness of the tip|cosines of the angles|on a tool that is|above entry_angle_deg|"
    r"at most half of the diameter|"
    r"a list of \d+ of them, one a tooth|an amplitude below the wavelength|offsets for the shape table|"
    r"(entry|exit)_angle_deg: found nothing|one way to tell the engagement|above y_from_mm|a block that the cutter reaches|"
    r"needs the map of its engagement|engagement map: found no such file|never fall \[m\]|0 <= start <= end|a cut in which some tooth cuts|"
    r"(radial_depth_mm|strategy|y_from_mm|y_to_mm): found nothing|"
    r"below the outer diameter|at most [\d.e+]+ \[mm\^[24]\]|or neither|material: found the text|tooling: found the text|"
    r"materials\.\S+: found nothing|shaft's length|a number other than 0|one table \[sensors|"
    r"above from_hz|where there are cuts|at least one tooling|hammer tests \[\[frfs\]\], or both|"
    r"a point of the tool-holder, tip or mm|one or more speeds|\[\[modes\]\] or several of them|"
    r"runout_mm|a loss factor|\.engagement: found|"
    r"stickout|insertion|softening|settling|from.*to|without it the cut keeps its speed|of change in each pass|"
    r"times the value|of a value that is not given|radial_mpa|a vector of three that is not zero|then a higher one|are these millimetres"
)


def _examples():
    for path in sorted((ROOT / "data").rglob("*.toml")):
        name = "campaign" if path.name == "campaign.toml" else {"toolings": "tooling", "robots": "robot"}.get(path.parent.name, "machine")
        yield name, path


def _places(value, path=()):
    yield path, value
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        yield from _places(inner, (*path, key))


def _changed(data, path, value):
    data = copy.deepcopy(data)
    *way, last = path
    inner = data
    for key in way:
        inner = inner[key]
    if value is _GONE:
        del inner[last]
    else:
        inner[last] = value
    return data


_GONE = object()


def _changes(data):
    """One change a time: a type, a value far out or just beyond a round edge, a key that nobody knows, a key that is gone."""
    for path, value in _places(data):
        if isinstance(value, dict):
            yield (*path, "unheard_of"), _changed(data, (*path, "unheard_of"), 1.0)
        if not path:
            continue
        others = [True, "x", " ", 1.5, [], {}, [True], {"x": 1}]
        if isinstance(value, int | float) and not isinstance(value, bool):
            others += [-1e30, -1.0, 0.0, 1e-9, 0.6, 1.0, 1001.0, 1e6, 1e30]
        for other in [*others, *([_GONE] if isinstance(path[-1], str) else [])]:
            yield path, _changed(data, path, other)


def _refusal(read, data):
    try:
        read(data)
    except InputError as error:
        return error
    return None


@pytest.mark.parametrize("name", SCHEMAS)
def test_schema_and_reader_judge_alike(name):
    validator = jsonschema_rs.validator_for(schema_of(name))
    _, read, files = _FILES[name]
    changes = refused = 0
    for data in files:
        assert validator.is_valid(data)
        for path, changed in _changes(data):
            changes += 1
            error = _refusal(read, changed)
            if not validator.is_valid(changed):
                refused += 1
                assert error is not None, (path, [e.message for e in validator.iter_errors(changed)])
            elif error is not None:
                assert path[-1] != "unheard_of"
                assert _BETWEEN_KEYS.search(str(error)), (path, str(error))
    assert changes > 100
    assert refused > 0.5 * changes


@pytest.mark.parametrize(("name", "path"), list(_examples()), ids=lambda v: v.name if isinstance(v, Path) else v)
def test_every_example_is_valid(name, path):
    assert jsonschema_rs.validator_for(schema_of(name)).is_valid(rtoml.loads(path.read_text("utf-8")))


_NAMING = [path for folder in ("machines", "robots") for path in sorted((ROOT / "data" / folder).rglob("*.toml"))]


@pytest.mark.parametrize("path", _NAMING, ids=lambda p: p.name)
def test_the_schema_that_an_example_names_is_there_and_its_readers(path):
    first = path.read_text("utf-8").splitlines()[0]
    named = path.parent / first.removeprefix("#:schema ")
    assert named.read_text("utf-8") == schema_text(named.stem)


def test_dialect_and_what_an_editor_shows():
    schema = schema_of("tooling")
    assert schema["$schema"] == DIALECT
    assert jsonschema_rs.meta.is_valid(schema)
    assert schema["properties"]["tool"]["properties"]["stickout_mm"] == {
        "type": "number",
        "minimum": 0.5,
        "maximum": 5000.0,
        "description": "Usual are 2 to 500 mm",
    }
    assert schema["required"] == ["cutter", "tool", "holder"]
    assert "bull-nose" in schema["properties"]["cutter"]["properties"]["shape"]["enum"]


def test_sizes_that_hang_on_teeth_and_tools_are_left_to_the_reader():
    """A limit of the files that a schema is made of is none of the schema's own."""
    _, read, files = _FILES["tooling"]
    three = copy.deepcopy(files[0])
    three["cutter"] |= {"teeth": 3, "runout_mm": [0.0, 0.01, 0.02], "axial_runout_mm": [0.0] * 3}
    three["cutter"]["serration"] = {"amplitude_mm": 0.2, "wavelength_mm": 1.5, "shift": [0.0, 0.3, 0.6]}
    three["holder"]["segments"][0] |= {"outer_diameter_mm": 80.0, "area_mm2": 3000.0, "second_moment_mm4": 9e5}
    assert _refusal(read, three) is None
    assert jsonschema_rs.validator_for(schema_of("tooling")).is_valid(three)
    campaign = schema_of("campaign")["properties"]
    assert "maximum" not in campaign["cuts"]["items"]["properties"]["radial_depth_mm"]
    for key in ("response", "force"):
        assert campaign["frfs"]["items"]["properties"][key]["anyOf"] == [
            {"enum": ["tip", "flange"]},
            {"type": "number", "minimum": 0.0, "description": "In mm"},
        ]


#: Where files have the keys of a noun.
_OF_NOUNS = {
    "cutter": "tooling cutter", "segment": "tooling tool segments", "contact": "tooling contact", "material": "tooling materials",
    "spread": "tooling spread", "workpiece": "campaign workpiece", "sensor": "campaign sensors", "campaign": "campaign campaign",
    "cuts": "campaign cuts", "frfs": "campaign frfs",
}  # fmt: skip


def _tables(schema: dict[str, Any], *way: str) -> Iterator[dict[str, Any]]:
    """Keys of the tables at the end of a way."""
    if "anyOf" in schema:
        for each in schema["anyOf"]:
            yield from _tables(each, *way)
    elif inner := schema.get("additionalProperties") or schema.get("items"):
        yield from _tables(inner, *way)
    elif way:
        yield from _tables(schema["properties"][way[0]], *way[1:])
    else:
        yield schema["properties"]


@pytest.mark.parametrize("noun", _OF_NOUNS)
def test_a_reader_asks_for_every_declared_key_and_holds_it_to_its_limits(noun):
    name, *way = _OF_NOUNS[noun].split()
    places = list(_tables(schema_of(name), *way))
    for field in NOUNS[noun]:
        found = [keys[field.key] for keys in places if field.key in keys]
        assert found
        for asked in found if field.kind is not list else []:
            number = next((each for each in asked.get("anyOf", []) if each.get("type") == "number"), asked)
            assert tuple(number.get(word) for word in ("minimum", "maximum", "exclusiveMinimum")) == field.limits
