"""Reading keys of TOML and JSON: every key is known, every value of its type, unit and range, or one sentence says what is wrong."""

from __future__ import annotations

import difflib
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, NoReturn

from rcsa_ident.errors import InputError
from rcsa_ident.plausibility import Range

_REQUIRED: Any = object()


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
        """Raise the error that names a key of this table.

        Parameters
        ----------
        key : str
        found : object
            What stands there.
        allowed : str
            What could, in words.
        """
        raise InputError(self.name(key), found, allowed, self.where)

    def value(self, key: str, allowed: str, default: Any = _REQUIRED) -> Any:
        """Return what stands under `key`; without a default the key must be there.

        Parameters
        ----------
        key : str
        allowed : str
            What could stand there, in words.
        default : object, optional
        """
        if key in self.data:
            return self.data[key]
        if default is _REQUIRED:
            self.refuse(key, "nothing", allowed)
        return default

    def number(
        self,
        key: str,
        unit: str = "",
        default: Any = _REQUIRED,
        *,
        above: float | None = None,
        least: float | None = None,
        most: float | None = None,
        whole: bool = False,
    ) -> Any:
        """Return a finite number within its range, as int if `whole`, else as float; a default is returned unchecked.

        Parameters
        ----------
        key : str
        unit : str
            For the message.
        default : object, optional
        above, least, most : float, optional
            Limits: `above` is not allowed itself, the others are.
        whole : bool
        """
        limits = [f"above {above:g}" if above is not None else "", f"at least {least:g}" if least is not None else ""]
        limits = [*(text for text in limits if text), *([f"at most {most:g}"] if most is not None else [])]
        allowed = "a whole number" if whole else "a finite number"
        allowed = " ".join([allowed, " and ".join(limits), f"[{unit}]" if unit else ""]).replace("  ", " ").strip()
        value = self.value(key, allowed, default)
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

    def quantity(self, key: str, kind: Range, default: Any = _REQUIRED) -> Any:
        """Return a number in its own unit that is possible for a quantity; a default is returned unchecked.

        Parameters
        ----------
        key : str
        kind : Range
        default : object, optional
        """
        value = self.number(key, kind.unit, default)
        if key in self.data:
            with self.naming({}):
                kind.checked(key, value * kind.size)
        return value

    def numbers(self, key: str, count: int | None, unit: str = "") -> list[float]:
        """Return a list of `count` finite numbers (any number of them if None).

        Parameters
        ----------
        key : str
        count : int or None
        unit : str
            For the message.
        """
        allowed = f"a list of {'finite' if count is None else f'{count} finite'} numbers" + (f" [{unit}]" if unit else "")
        value = self.value(key, allowed)
        if not _is_list(value) or (count is not None and len(value) != count):
            self.refuse(key, describe(value), allowed)
        numbers = [as_number(v) for v in value]
        if None in numbers:
            self.refuse(key, f"{describe(value[numbers.index(None)])} in the list", allowed)
        return [n for n in numbers if n is not None]

    def text(self, key: str, default: Any = _REQUIRED, choices: Collection[str] = (), allowed: str = "a text") -> Any:
        """Return a non-empty text, one of `choices` if there are any; a default is returned unchecked.

        Parameters
        ----------
        key : str
        default : object, optional
        choices : collection of str
        allowed : str
            What could stand there, in words, where there are no choices.
        """
        allowed = f"one of {', '.join(choices)}" if choices else allowed
        value = self.value(key, allowed, default)
        if key not in self.data:
            return value
        if not isinstance(value, str) or not value.strip():
            self.refuse(key, describe(value), allowed)
        if choices and value not in choices:
            near = difflib.get_close_matches(value, choices, 1, 0.5)
            self.refuse(key, describe(value), allowed + (f"; did you mean {near[0]}?" if near else ""))
        return value

    def table(self, key: str, known: Collection[str] | None = None, default: Any = _REQUIRED) -> Table:
        """Return the table under `key`.

        Parameters
        ----------
        key : str
        known : collection of str, optional
            Keys that the table may have; by default any.
        default : mapping, optional
        """
        return Table(self.value(key, f"a table [{self.name(key)}]", default), self.where, self.name(key), known)

    def tables(self, key: str, known: Collection[str] | None = None) -> list[Table]:
        """Return the tables of the list under `key`; there is at least one."""
        allowed = "a list of one or more tables"
        value = self.value(key, allowed)
        if not _is_list(value) or not value:
            self.refuse(key, describe(value), allowed)
        return [Table(item, self.where, f"{self.name(key)}[{i}]", known) for i, item in enumerate(value)]

    def named_tables(self, key: str, known: Collection[str] | None = None, default: Any = _REQUIRED) -> dict[str, Table]:
        """Return the tables below `key` by their own names.

        Parameters
        ----------
        key : str
        known : collection of str, optional
            Keys that each of them may have; by default any.
        default : mapping, optional
        """
        outer = self.table(key, None, default)
        return {name: Table(item, self.where, outer.name(name), known) for name, item in outer.data.items()}

    @contextmanager
    def naming(self, names: Mapping[str, str]) -> Iterator[None]:
        """Give an `InputError` of a noun the file and the key that the user wrote: `names` maps field to key."""
        try:
            yield
        except InputError as error:
            if error.where:
                raise
            raise InputError(names.get(error.field, self.name(error.field)), error.found, error.allowed, self.where) from None


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
