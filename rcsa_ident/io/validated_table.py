"""Reading keys of TOML and JSON: every key is known, every value of its type, unit and range, or one sentence says what is wrong."""

from __future__ import annotations

import difflib
import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import Any, NoReturn

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.plausibility import Range
from rcsa_ident.setup.fields import NEEDED, Field, Named, Number

#: A date with its time of day, as `datetime.fromisoformat` reads it.
_MOMENT = r"^\d{4}-[01]\d-[0-3]\dT[0-2]\d:[0-5]\d(:[0-5]\d(\.\d+)?)?(Z|[+-]\d\d:\d\d)?$"


@dataclass(slots=True)
class Asked:
    """What a reader asked of one table, for who describes the file.

    `data`: the table
    `path`: as `Table` has it
    `keys`: JSON Schema of what may stand under a key; tables by the path of theirs, under ``table``
    `one_of`: keys of which exactly one is there
    """

    data: Mapping[str, Any]
    path: str
    known: Collection[str] | None
    keys: dict[str, dict[str, Any]] = field(default_factory=dict)
    required: set[str] = field(default_factory=set)
    one_of: list[tuple[str, ...]] = field(default_factory=list)


_listening: ContextVar[dict[int, Asked] | None] = ContextVar("listening", default=None)


@contextmanager
def listening() -> Iterator[dict[int, Asked]]:
    """Gather what readers ask of tables meanwhile, by the identity of each table's data; what is asked last counts."""
    gathered: dict[int, Asked] = {}
    token = _listening.set(gathered)
    try:
        yield gathered
    finally:
        _listening.reset(token)


class Table:
    """A table of keys and the place where it stood.

    Parameters
    ----------
    data : mapping
    where : str
        The file.
    path : str
        Dotted key of the table itself; elements of arrays count from 0: ``tool.segments[1]``.
    known : collection of str or None
        Another key is refused and the nearest of these suggested; None takes any.
    """

    def __init__(self, data: Any, where: str, path: str = "", known: Collection[str] | None = None) -> None:
        self.where, self.path = where, path
        if not isinstance(data, Mapping):
            raise InputError(path or "content", describe(data), "a table of keys", where)
        self.data: Mapping[str, Any] = data
        self._asked: Asked | None = None
        if (gathered := _listening.get()) is not None:
            self._asked = gathered.setdefault(id(data), Asked(data, path, known))
            self._asked.known = known
        if known is not None:
            for key in data:
                if key not in known:
                    near = difflib.get_close_matches(key, known, 1, 0.5)
                    hint = f"; did you mean {near[0]}?" if near else ""
                    raise InputError(self.name(key), "an unknown key", f"one of {', '.join(known)}{hint}", where)

    def __contains__(self, key: str) -> bool:
        return key in self.data

    def __iter__(self) -> Iterator[str]:
        return iter(self.data)

    def name(self, key: str) -> str:
        """Return the dotted name of a key of this table."""
        key = key if key.isprintable() else repr(key)
        return f"{self.path}.{key}" if self.path else key

    def refuse(self, key: str, found: object, allowed: str) -> NoReturn:
        """Raise the error that names a key of this table. `found`: what stands there. `allowed`: what could, in words."""
        raise InputError(self.name(key), found, allowed, self.where)

    def value(self, key: str, allowed: str, default: Any = NEEDED, schema: Mapping[str, Any] | None = None) -> Any:
        """Return what stands under `key`; without a default the key must be there.

        `allowed`: what could stand there, in words
        `schema`: the same in JSON Schema
        """
        if self._asked is not None:
            usual = {"default": default} if isinstance(default, str | int | float) else {}
            self._asked.keys[key] = {**(schema or {"description": allowed}), **usual}
            (self._asked.required.add if default is NEEDED else self._asked.required.discard)(key)
        if key in self.data:
            return self.data[key]
        if default is NEEDED:
            self.refuse(key, "nothing", allowed)
        return default

    def number(
        self,
        key: str,
        unit: str = "",
        default: Any = NEEDED,
        *,
        above: float | None = None,
        least: float | None = None,
        most: float | None = None,
        whole: bool = False,
    ) -> Any:
        """Return a finite number within its range, as int if `whole`, else as float; a default is returned unchecked.

        `unit`: for the message
        `above`, `least`, `most`: limits: `above` is not allowed itself, the others are
        """
        limits = [f"above {above:g}" if above is not None else "", f"at least {least:g}" if least is not None else ""]
        limits = [*(text for text in limits if text), *([f"at most {most:g}"] if most is not None else [])]
        allowed = "a whole number" if whole else "a finite number"
        allowed = " ".join([allowed, " and ".join(limits), f"[{unit}]" if unit else ""]).replace("  ", " ").strip()
        edges = {"exclusiveMinimum": above, "minimum": least, "maximum": most}
        value = self.value(key, allowed, default, _number_schema(unit, edges, whole))
        if key not in self.data:
            return value
        number = as_number(value)
        if (
            number is None
            or (whole and number != int(number))
            or (above is not None and number <= above)
            or (least is not None and number < least)
            or (most is not None and number > most)
        ):
            self.refuse(key, describe(value), allowed)
        return int(number) if whole else number

    def quantity(self, key: str, kind: Range, default: Any = NEEDED) -> Any:
        """Return a number in its own unit that is possible for a quantity; a default is returned unchecked."""
        value = self.number(key, kind.unit, default)
        if self._asked is not None:
            words = f"Usual are {kind.usual[0]:g} to {kind.usual[1]:g}"
            self._asked.keys[key] |= {
                "minimum": kind.possible[0],
                "maximum": kind.possible[1],
                "description": f"{words} {kind.unit}".rstrip(),
            }
        if key in self.data:
            with self.naming({}):
                kind.checked(key, value * kind.size)
        return value

    def number_or(self, key: str, names: Collection[str], what: str, unit: str, least: float, most: float) -> str | float:
        """Return one of `names`, or a number from `least` to `most`. `what`: the number in words, for the message."""
        allowed = f"one of {', '.join(names)}, or {what} from {least:g} to {most:g} [{unit}]"
        edges = {"minimum": least, "maximum": most}
        value = self.value(key, allowed, schema={"anyOf": [{"enum": list(names)}, _number_schema(unit, edges)], "description": allowed})
        if isinstance(value, str) and value in names:
            return value
        number = as_number(value)
        if number is None or not least <= number <= most:
            self.refuse(key, describe(value), allowed)
        return number

    def flag(self, key: str, default: bool) -> bool:
        """Return true or false."""
        value = self.value(key, "true or false", default, {"type": "boolean"})
        if not isinstance(value, bool):
            self.refuse(key, describe(value), "true or false")
        return value

    def moment(self, key: str) -> datetime | None:
        """Return a date with its time of day, None where there is none."""
        allowed = "a date and a time as 2026-11-27T08:15:00"
        value = self.value(key, allowed, None, {"type": "string", "pattern": _MOMENT, "description": allowed})
        if value is None or isinstance(value, datetime):
            return value
        try:
            # a date alone would be midnight
            return datetime.fromisoformat(value if "T" in value else "")
        except (TypeError, ValueError):
            self.refuse(key, describe(value), allowed)

    def one_of(self, keys: tuple[str, ...], allowed: str) -> str:
        """Return which one of `keys` is there; several or none are refused."""
        if self._asked is not None:
            self._asked.one_of.append(keys)
        given = [key for key in keys if key in self.data]
        if len(given) != 1:
            self.refuse(keys[0], "both" if given else "nothing", allowed)
        return given[0]

    def numbers(
        self, key: str, count: int | None, unit: str = "", *, above: float | None = None, least: float | None = None
    ) -> list[float]:
        """Return a list of `count` finite numbers (any number of them if None).

        `unit`: for the message
        `above`, `least`: limits of each: `above` is not allowed itself, `least` is
        """
        limit = f" above {above:g}" if above is not None else f" of at least {least:g}" if least is not None else ""
        allowed = f"a list of {'finite' if count is None else f'{count} finite'} numbers{limit}" + (f" [{unit}]" if unit else "")
        sizes = {} if count is None else {"minItems": count, "maxItems": count}
        items = _number_schema(unit, {"exclusiveMinimum": above, "minimum": least})
        value = self.value(key, allowed, schema={"type": "array", "items": items, **sizes})
        if not _is_list(value) or (count is not None and len(value) != count):
            self.refuse(key, describe(value), allowed)
        numbers: list[float] = []
        for item in value:
            number = as_number(item)
            if number is None or (above is not None and number <= above) or (least is not None and number < least):
                self.refuse(key, f"{describe(item)} in the list", allowed)
            numbers.append(number)
        return numbers

    def text(self, key: str, default: Any = NEEDED, choices: Collection[str] = (), allowed: str = "a text", names_of: str = "") -> Any:
        """Return a non-empty text, one of `choices` if there are any; a default is returned unchecked.

        `allowed`: what could stand there, in words, where there are no choices
        `names_of`: table of the file whose keys are choices, where there is one
        """
        allowed = f"one of {', '.join(choices)}" if choices else allowed
        schema: dict[str, Any] = {"type": "string", "pattern": r"\S"}
        if names_of:
            schema["description"] = f"A name that the file knows, as those of [{names_of}]"
        elif choices:
            schema = {"type": "string", "enum": [str(choice) for choice in choices]}
        value = self.value(key, allowed, default, schema)
        if key not in self.data:
            return value
        if not isinstance(value, str) or not value.strip():
            self.refuse(key, describe(value), allowed)
        if choices and value not in choices:
            near = difflib.get_close_matches(value, choices, 1, 0.5)
            self.refuse(key, describe(value), allowed + (f"; did you mean {near[0]}?" if near else ""))
        return value

    def texts(self, key: str, allowed: str, required: bool = True) -> list[str]:
        """Return a list of non-empty texts; where it is not required it may be missing or empty."""
        schema = {"type": "array", "items": {"type": "string", "minLength": 1}} | ({"minItems": 1} if required else {})
        found = self.value(key, allowed, NEEDED if required else [], schema)
        if not _is_list(found) or (required and not found) or not all(isinstance(text, str) and text for text in found):
            self.refuse(key, describe(found), allowed)
        return list(found)

    def table(self, key: str, known: Collection[str] | None = None, default: Any = NEEDED) -> Table:
        """Return the table under `key`. `known`: keys that the table may have; by default any."""
        return Table(self.value(key, f"a table [{self.name(key)}]", default, {"table": self.name(key)}), self.where, self.name(key), known)

    def tables(self, key: str, known: Collection[str] | None = None) -> list[Table]:
        """Return the tables of the list under `key`; there is at least one."""
        allowed = "a list of one or more tables"
        value = self.value(key, allowed, schema={"type": "array", "minItems": 1, "items": {"table": f"{self.name(key)}[]"}})
        if not _is_list(value) or not value:
            self.refuse(key, describe(value), allowed)
        return [Table(item, self.where, f"{self.name(key)}[{i}]", known) for i, item in enumerate(value)]

    def named_tables(self, key: str, known: Collection[str] | None = None, default: Any = NEEDED) -> dict[str, Table]:
        """Return the tables below `key` by their own names.

        `known`: keys that each of them may have; by default any
        """
        outer = self.table(key, None, default)
        return {name: Table(item, self.where, outer.name(name), known) for name, item in outer.data.items()}

    def field(self, field: Field) -> Any:
        """Return what stands under a declared key, in its unit."""
        match kind := field.kind:
            case Range():
                return self.quantity(field.key, kind, field.default)
            case Number(unit, _, least, most, above, whole):
                return self.number(field.key, unit, field.default, above=above, least=least, most=most, whole=whole)
            case Named(names, number, what):
                assert number.least is not None
                assert number.most is not None
                return self.number_or(field.key, names, what, number.unit, number.least, number.most)
            case tuple():
                return self.text(field.key, field.default, choices=kind)
            case _:
                return self.flag(field.key, field.default) if kind is bool else self.text(field.key, field.default)

    def fields(self, fields: Iterable[Field], defaults: Mapping[str, Any] | None = None) -> dict[str, Any]:
        """Return what stands under declared keys, in their units; `defaults` count before those that are declared."""
        usual = defaults or {}
        return {each.key: self.field(replace(each, default=usual.get(each.key, each.default))) for each in fields}

    @contextmanager
    def naming(self, names: Mapping[str, str]) -> Iterator[None]:
        """Give an `InputError` of a noun the file and the key that the user wrote: `names` maps field to key."""
        try:
            yield
        except InputError as error:
            if error.where:
                raise
            raise InputError(names.get(error.field, self.name(error.field)), error.found, error.allowed, self.where) from None


def _number_schema(unit: str, edges: Mapping[str, float | None] | None = None, whole: bool = False) -> dict[str, Any]:
    schema = {"type": "integer" if whole else "number"} | ({"description": f"In {unit}"} if unit else {})
    return schema | {word: edge for word, edge in (edges or {}).items() if edge is not None}


def as_number(value: Any) -> float | None:
    """Return a finite int or float as float, else None; True and False are no numbers."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def describe(value: Any) -> str:
    """Return what a value is, in the words of the file."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if value is None:
        return "null"
    if isinstance(value, str):
        return f'the text "{value}"' if value.strip() else "an empty text"
    if isinstance(value, Mapping):
        return "a table" if value else "an empty table"
    if _is_list(value):
        return f"a list of {len(value)}" if value else "an empty list"
    if isinstance(value, int | float):
        # an int beyond the interpreter's limit of digits has no text
        return "a number too large" if isinstance(value, int) and abs(value) > 10**300 else f"{value!r}"
    return f"{type(value).__name__} {value}"


def listed(names: Sequence[str], most: int = 20) -> str:
    """Return names as one line, the first of them where there are many."""
    shown = [name if name.isprintable() else repr(name) for name in names[:most]]
    return ", ".join(shown) + (f" and {len(names) - most} more" if len(names) > most else "")


def _is_list(value: Any) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, str)
