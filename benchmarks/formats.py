"""``python -m benchmarks formats``: write ``docs/formats/keys.md``, a table of every key of every TOML file.

Keys, types, units, ranges, choices and defaults are those of the schemas, which are made of the readers themselves; what a key means
stands in ``docs/formats/meanings.toml``. A key without a meaning, or a meaning without a key, is an error.
"""

from __future__ import annotations

import argparse
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from rcsa_ident.io.settings.schemas import SCHEMAS, schema_of

FOLDER = Path(__file__).resolve().parent.parent / "docs" / "formats"
PAGE = FOLDER / "keys.md"
#: Choices that have room in a cell.
_MOST_CHOICES = 4
_TITLE = "# Every key of every TOML file\n"
_INTRODUCTION = """
This page is written by `python -m benchmarks formats` from the JSON schemas that `rcsa-ident schema NAME` prints, and these are made of
what the readers ask: a key that is not here is refused by name, and so is a value that is not allowed. `NAME` is a name of your own.
Outside of the *usual* values an answer carries a warning with the field and the slip that would explain it. A limit that hangs on another
key of the file is told in words. A key with `–` as its default may be left out; what counts then is told beside it where it matters.

An editor completes the keys and marks wrong values where the first line of a file names its schema: `#:schema tooling.json`.
"""


class Row(NamedTuple):
    """A key as the page shows it."""

    key: str
    unit: str
    kind: str
    possible: str
    usual: str
    default: str


def rows_of(name: str) -> list[Row]:
    """Return the keys of one of `SCHEMAS`; kinds of one table that know the same key have one row where they say the same of it."""
    return list(dict.fromkeys(_rows(schema_of(name), "", False)))


def meaning_of(name: str, key: str, meanings: dict[str, dict[str, str]]) -> tuple[str, str] | None:
    """Return table and ending under which the meaning of a key stands: the longest of the file's own, else of those for all files."""
    for table in (name, "any"):
        fits = [ending for ending in meanings.get(table, {}) if key == ending or key.endswith((f".{ending}", f"]{ending}"))]
        if fits:
            return table, max(fits, key=len)
    return None


def page() -> str:
    """Return the page."""
    meanings = tomllib.loads((FOLDER / "meanings.toml").read_text(encoding="utf-8"))
    unused = {(table, ending) for table, endings in meanings.items() for ending in endings}
    parts, count = [], 0
    for name in SCHEMAS:
        parts.append(f"\n(keys-{name})=\n## `{name}`\n\n{schema_of(name)['title']}. `rcsa-ident schema {name}` prints its schema.\n")
        tables: dict[str, list[str]] = {}
        for row in rows_of(name):
            found = meaning_of(name, row.key, meanings)
            if found is None:
                raise LookupError(f"docs/formats/meanings.toml does not tell what {row.key} of {name} means")
            unused.discard(found)
            own, _, key = row.key.rpartition(".")
            tables.setdefault(own, []).append(_line(row, key.replace("*", "NAME"), meanings[found[0]][found[1]]))
        for path, lines in tables.items():
            parts += [f"{_heading(path)}\n| key | type | allowed | default | meaning |\n|---|---|---|---|---|\n", *lines]
            count += len(lines)
    if unused:
        known = ", ".join(f"[{table}] {key}" for table, key in sorted(unused))
        raise LookupError(f"docs/formats/meanings.toml explains keys that no file has: {known}")
    return f"{_TITLE}{_INTRODUCTION}\nThere are {count} keys in {len(SCHEMAS)} files.\n" + "".join(parts)


def _heading(path: str) -> str:
    """The table of a path as a file writes it: ``[tool]``, ``[[tool.segments]]``, ``[materials.NAME]``."""
    if not path:
        return "\n### At the top\n"
    name = path.removesuffix("[]").replace("[]", "").replace("*", "NAME")
    return f"\n### `[[{name}]]`\n" if path.endswith("[]") else f"\n### `[{name}]`\n"


def _line(row: Row, key: str, meaning: str) -> str:
    """A line of a table; a long list of choices stands behind the meaning."""
    allowed, kind = row.possible, f"{row.kind} [{row.unit}]" if row.unit else row.kind
    if allowed.count("`, `") > _MOST_CHOICES:
        allowed, meaning = "one of a list", f"{meaning}: {allowed}"
    allowed = "; ".join(filter(None, (allowed, f"usual {row.usual}" if row.usual else "")))
    return f"| `{key}` | {kind} | {allowed} | {row.default} | {meaning} |\n"


def _rows(schema: dict[str, Any], path: str, needed: bool) -> Iterator[Row]:
    kinds = schema.get("anyOf", [schema])
    tables = [kind for kind in kinds if kind.get("type") == "object"]
    for table in tables:
        chosen = {key for pair in table.get("allOf", []) for choice in pair["oneOf"] for key in choice["required"]}
        for key, inner in table.get("properties", {}).items():
            told = key in table.get("required", ())
            yield from _rows(inner, f"{path}.{key}".lstrip("."), told or key in chosen)
        if isinstance(table.get("additionalProperties"), dict):
            yield from _rows(table["additionalProperties"], f"{path}.*", True)
    plain = [kind for kind in kinds if kind.get("type") != "object"]
    if len(plain) == 1 and (lists := plain[0]).get("type") == "array" and _holds_tables(lists["items"]):
        yield from _rows(lists["items"], f"{path}[]", needed)
        return
    if plain:
        # words of the whole stand beside the choices where there are several
        whole = {key: value for key, value in schema.items() if key != "anyOf"}
        yield _row(path, plain, whole if "anyOf" in schema else plain[0], needed)


def _holds_tables(items: dict[str, Any]) -> bool:
    return any(kind.get("type") == "object" for kind in items.get("anyOf", [items]))


def _row(path: str, kinds: list[dict[str, Any]], whole: dict[str, Any], needed: bool) -> Row:
    unit, usual = next((found for kind in kinds if any(found := _unit(kind))), _unit(whole))
    default = whole.get("default", next((kind["default"] for kind in kinds if "default" in kind), None))
    shown = "needed" if needed and default is None else "–" if default in (None, "") else f"`{_plain(default)}`"
    return Row(path, unit, " or ".join(dict.fromkeys(map(_type, kinds))), "; ".join(filter(None, map(_range, kinds))), usual, shown)


def _unit(schema: dict[str, Any]) -> tuple[str, str]:
    """Unit and usual range, as descriptions of schemas tell them."""
    if "items" in schema:
        return _unit(schema["items"])
    words = schema.get("description", "")
    if words.startswith("Usual are "):
        low, _, rest = words.removeprefix("Usual are ").partition(" to ")
        high, _, unit = rest.partition(" ")
        return unit, f"{low} to {high}"
    return (words.removeprefix("In "), "") if words.startswith("In ") else ("", "")


def _type(schema: dict[str, Any]) -> str:
    if "enum" in schema:
        return "text"
    names = {"integer": "whole number", "number": "number", "string": "text", "boolean": "true, false", "array": "list"}
    kind = names[schema["type"]]
    return f"{kind} of {_type(schema['items']).replace('list of', 'lists of').removesuffix('s')}s" if kind == "list" else kind


def _range(schema: dict[str, Any]) -> str:
    if "enum" in schema:
        return ", ".join(f"`{choice}`" for choice in schema["enum"])
    if schema.get("type") == "array":
        least, most = schema.get("minItems"), schema.get("maxItems")
        size = f"{least} of them" if least is not None and least == most else f"{least} to {most}" if least and most else ""
        size = size or (f"at least {least}" if least else "")
        return ", ".join(filter(None, (size, _range(schema["items"]))))
    above, least, most = (schema.get(word) for word in ("exclusiveMinimum", "minimum", "maximum"))
    low = f"above {above:g}" if above is not None else "" if least is None else f"{least:g}" if most is not None else f"at least {least:g}"
    if most is None:
        return low
    return f"{low} to {most:g}" if low and above is None else " and ".join(filter(None, (low, f"at most {most:g}")))


def _plain(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value).lower() if isinstance(value, bool) else str(value)


def main(arguments: list[str]) -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(prog="benchmarks formats", description=__doc__)
    parser.add_argument("--out", type=Path, default=PAGE)
    out = parser.parse_args(arguments).out
    out.write_text(page(), encoding="utf-8")
    print(f"written: {out}")
