"""Changes to what a fuzzer feeds: bytes anywhere, words of a text, and values of TOML and JSON, so that their syntax stays whole.

Most changed bytes of a settings file are a syntax error, which a parser refuses that others have fuzzed. What this package reads lies
behind it: keys, types, ranges, and what they mean together.
"""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from typing import Any

_WHOLE = (0, 1, -1, 2, 3, 7, 255, 256, 65_535, 2**31 - 1, 2**31, 2**32 - 1, 2**63, 10**30, -(10**30))
_REAL = (0.0, -0.0, 0.5, 1.0, -1.5, 90.0, 180.0, 360.0, 1e-12, 1e-300, 5e-324, 1e12, 1e150, 1e300, 1.7e308)
_TOKENS = (
    "",
    " ",
    "x",
    "X",
    "Y",
    "Z",
    "tip",
    "flange",
    "steel",
    "true",
    "\0",
    "é",
    "\u2028",
    "a" * 300,
    "../x",
    "nan",
    "1e400",
    "-1",
    "+X",
)
#: What stands between the words of tables and programs.
_SIGNS = (
    b",",
    b";",
    b"\t",
    b" ",
    b"\n",
    b"\r\n",
    b"\r",
    b'"',
    b"'",
    b"#",
    b"%",
    b"(",
    b")",
    b"[",
    b"]",
    b"=",
    b":",
    b"-",
    b"+",
    b".",
    b"e",
    b"/",
)
_NUMBERS = (
    b"0",
    b"-1",
    b"1",
    b"1e300",
    b"1e400",
    b"-1e400",
    b"nan",
    b"inf",
    b"9" * 25,
    b"1.5",
    b"1,5",
    b"0.000001",
    b"1e-320",
    b"1_0",
    b"0x10",
)

Change = Callable[[bytes, random.Random], bytes]


def bytes_changed(raw: bytes, rng: random.Random) -> bytes:
    """Return bytes of which a few are others, gone, or there twice."""
    data = bytearray(raw)
    for _ in range(rng.choice((1, 1, 2, 4))):
        at, size = rng.randrange(len(data) + 1), rng.choice((1, 2, 4, 8, 16))
        match rng.randrange(5):
            case 0 if at < len(data):
                data[at] ^= 1 << rng.randrange(8)
            case 1:
                data[at : at + size] = rng.choice(_WHOLE).to_bytes(16, rng.choice(("little", "big")), signed=True)[:size]
            case 2:
                del data[at : at + size * rng.choice((1, 8))]
            case 3:
                data[at:at] = data[max(at - size, 0) : at] * rng.choice((1, 3))
            case _:
                data[at : at + size] = rng.randbytes(size)
    return bytes(data)


def words_changed(raw: bytes, rng: random.Random) -> bytes:
    """Return a text of which words, lines or signs are others."""
    data = raw
    for _ in range(rng.choice((1, 1, 2, 3))):
        lines = data.split(b"\n")
        line = rng.randrange(len(lines))
        match rng.randrange(7):
            case 0:
                del lines[line]
            case 1:
                lines.insert(rng.randrange(len(lines) + 1), lines[line])
            case 2:
                lines[line], other = lines[rng.randrange(len(lines))], lines[line]
                lines[rng.randrange(len(lines))] = other
            case 3:
                at = rng.randrange(len(lines[line]) + 1)
                lines[line] = lines[line][:at] + rng.choice(_SIGNS) + lines[line][at:]
            case 4:
                lines[line] = _another_number(lines[line], rng)
            case 5:
                at = rng.randrange(len(lines[line]) + 1)
                lines[line] = lines[line][:at] + rng.choice(_TOKENS).encode() + lines[line][at + rng.randrange(4) :]
            case _:
                lines[line] = lines[line][: rng.randrange(len(lines[line]) + 1)]
        data = b"\n".join(lines)
    return data


def _another_number(line: bytes, rng: random.Random) -> bytes:
    places = [k for k, sign in enumerate(line) if 48 <= sign <= 57]
    if not places:
        return line
    start = end = rng.choice(places)
    while start > 0 and line[start - 1 : start] in b"0123456789.eE":
        start -= 1
    while end < len(line) and line[end : end + 1] in b"0123456789.eE":
        end += 1
    return line[:start] + rng.choice(_NUMBERS) + line[end:]


def toml_changed(raw: bytes, rng: random.Random) -> bytes:
    """Return TOML of which a few values, keys or tables are others; what is none is changed as text."""
    import tomllib

    import tomli_w

    try:
        return tomli_w.dumps(_changed(tomllib.loads(raw.decode("utf-8")), rng, (float("nan"), float("inf"), -float("inf")), False)).encode()
    except (ValueError, TypeError, OverflowError, RecursionError):
        return words_changed(raw, rng)


def json_changed(raw: bytes, rng: random.Random) -> bytes:
    """Return JSON of which a few values, keys or tables are others; what is none is changed as text."""
    try:
        return json.dumps(_changed(json.loads(raw), rng, (None, 10**400), True)).encode()
    except (ValueError, RecursionError):
        return words_changed(raw, rng)


def _changed(data: Any, rng: random.Random, odd: tuple[Any, ...], null: bool) -> Any:
    """Tables and lists with one to four places changed."""
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        places = list(_places(data))
        if not places:
            return data
        holder, key = rng.choice(places)
        value = holder[key]
        match rng.randrange(8):
            case 0:
                del holder[key]
            case 1 if isinstance(holder, list):
                holder.insert(rng.randrange(len(holder) + 1), value)
            case 1:
                holder[rng.choice(_TOKENS) or "k"] = value
            case 2:
                other, name = rng.choice(places)
                # a table inside of itself has no end
                holder[key] = json.loads(json.dumps(other[name])) if _is_there(other, name) else 0
            case 3 | 4 | 5 if isinstance(value, int | float) and not isinstance(value, bool):
                holder[key] = _near(value, rng, odd)
            case _:
                holder[key] = rng.choice(
                    (*_WHOLE, *_REAL, *odd, *_TOKENS, True, False, [], {}, [0.0], [[]], {"x": 1}, *([None] if null else []))
                )
    return data


def _is_there(holder: Any, key: Any) -> bool:
    return key in holder if isinstance(holder, dict) else key < len(holder)


def _near(value: float, rng: random.Random, odd: tuple[Any, ...]) -> Any:
    """A number that a small slip would make."""
    try:
        return rng.choice((-value, 0, value * 1000, value / 1000, value * 10, value + 1, value - 1, value * 1.0001, float(value), *odd))
    except OverflowError:
        return 0


def _places(data: Any) -> list[tuple[Any, Any]]:
    found: list[tuple[Any, Any]] = []
    waiting = [data]
    while waiting:
        each = waiting.pop()
        inner = list(each.items()) if isinstance(each, dict) else list(enumerate(each)) if isinstance(each, list) else []
        # of long lists the ends are enough
        for key, value in inner if len(inner) < 40 else [*inner[:10], *inner[-10:]]:
            found.append((each, key))
            waiting.append(value)
    return found


#: By the kind of a target.
CHANGES: dict[str, Change] = {"bytes": bytes_changed, "text": words_changed, "toml": toml_changed, "json": json_changed}
