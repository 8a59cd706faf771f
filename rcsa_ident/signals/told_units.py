"""Units as files write them: a grammar of products, quotients and powers over the symbols of the trade.

Case counts as in SI (``mN`` is no ``MN``, ``Nm`` a torque); a symbol in other letters is taken where only one is meant (``HZ``, ``MM``,
``KHz``). In this trade ``g`` is the acceleration of gravity, ``mg`` a thousandth of it, and ``lb`` a force. What the grammar does not know
is None: never SI.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable
from functools import lru_cache
from math import pi
from typing import NamedTuple

from rcsa_ident.signals.recording import Quantity

_GRAVITY, _INCH, _POUND = 9.80665, 0.0254, 4.4482216152605
#: Powers of kg, m, s, V, rad, cycle.
Powers = tuple[int, int, int, int, int, int]
_NONE: Powers = (0, 0, 0, 0, 0, 0)
_METRE: Powers = (0, 1, 0, 0, 0, 0)
_SECOND: Powers = (0, 0, 1, 0, 0, 0)
_PER_SECOND: Powers = (0, 0, -1, 0, 0, 0)
_VELOCITY: Powers = (0, 1, -1, 0, 0, 0)
_ACCELERATION: Powers = (0, 1, -2, 0, 0, 0)
_FORCE: Powers = (1, 1, -2, 0, 0, 0)
_PRESSURE: Powers = (1, -1, -2, 0, 0, 0)
_VOLT: Powers = (0, 0, 0, 1, 0, 0)
_ANGLE: Powers = (0, 0, 0, 0, 1, 0)
_FREQUENCY: Powers = (0, 0, -1, 0, 0, 1)
_ANGULAR: Powers = (0, 0, -1, 0, 1, 0)
_PREFIXES = {"n": 1e-9, "u": 1e-6, "m": 1e-3, "c": 1e-2, "d": 1e-1, "da": 1e1, "h": 1e2, "k": 1e3, "M": 1e6, "G": 1e9}
_IN_WORDS = {"nano": 1e-9, "micro": 1e-6, "milli": 1e-3, "kilo": 1e3}
#: Symbols: how many SI units each is, its powers, and the prefixes that it may have.
_SYMBOLS: dict[str, tuple[float, Powers, Iterable[str]]] = {
    "m": (1.0, _METRE, ("n", "u", "m", "c", "d", "k")),
    **dict.fromkeys(("meter", "metre"), (1.0, _METRE, _IN_WORDS)),
    **dict.fromkeys(("micron", "microns"), (1e-6, _METRE, ())),
    **dict.fromkeys(("in", "inch", "inches"), (_INCH, _METRE, ())),
    **dict.fromkeys(("mil", "mils", "thou"), (1e-3 * _INCH, _METRE, ())),
    **dict.fromkeys(("ft", "foot", "feet"), (12.0 * _INCH, _METRE, ())),
    "s": (1.0, _SECOND, ("n", "u", "m")),
    "sec": (1.0, _SECOND, ("n", "u", "m")),
    **dict.fromkeys(("secs", "second", "seconds", "sekunde", "sekunden"), (1.0, _SECOND, _IN_WORDS)),
    **dict.fromkeys(("min", "minute", "minutes"), (60.0, _SECOND, ())),
    **dict.fromkeys(("h", "hour", "hours"), (3600.0, _SECOND, ())),
    "ips": (_INCH, _VELOCITY, ()),
    "g": (_GRAVITY, _ACCELERATION, ("m", "u")),
    **dict.fromkeys(("gn", "g_n", "g0", "G"), (_GRAVITY, _ACCELERATION, ())),
    "Gal": (1e-2, _ACCELERATION, ("m",)),
    "kg": (1.0, (1, 0, 0, 0, 0, 0), ()),
    "N": (1.0, _FORCE, ("u", "m", "c", "d", "da", "k", "M")),
    **dict.fromkeys(("newton", "newtons"), (1.0, _FORCE, _IN_WORDS)),
    **dict.fromkeys(("kgf", "kp"), (_GRAVITY, _FORCE, ())),
    "gf": (1e-3 * _GRAVITY, _FORCE, ()),
    **dict.fromkeys(("lbf", "lb", "lbs"), (_POUND, _FORCE, ())),
    **dict.fromkeys(("klbf", "kip"), (1e3 * _POUND, _FORCE, ())),
    "ozf": (_POUND / 16.0, _FORCE, ()),
    "dyn": (1e-5, _FORCE, ()),
    "Nm": (1.0, (1, 2, -2, 0, 0, 0), ("m", "c", "k")),
    "Ns": (1.0, (1, 1, -1, 0, 0, 0), ()),
    "Pa": (1.0, _PRESSURE, ("u", "m", "h", "k", "M", "G")),
    "bar": (1e5, _PRESSURE, ("u", "m")),
    "V": (1.0, _VOLT, ("n", "u", "m", "k")),
    **dict.fromkeys(("volt", "volts"), (1.0, _VOLT, _IN_WORDS)),
    "rad": (1.0, _ANGLE, ("u", "m")),
    **dict.fromkeys(("deg", "degree", "degrees", "°"), (pi / 180.0, _ANGLE, ())),
    "Hz": (1.0, _FREQUENCY, ("m", "k", "M", "G")),
    "hertz": (1.0, _FREQUENCY, ()),
    "cps": (1.0, _FREQUENCY, ()),
    **dict.fromkeys(("rpm", "cpm"), (1.0 / 60.0, _FREQUENCY, ())),
    **dict.fromkeys(("rev", "cycle", "cycles"), (1.0, (0, 0, 0, 0, 0, 1), ())),
}
#: Units of FRFs in the words of messages.
UNITS_ALLOWED = "motion over force or its inverse, as m/N, um/N, mm/N, in/lbf, m/s/N, m/s^2/N, g/N, 1/kg, N/m"
#: Units of times, and of sampling rates, in the words of messages.
UNITS_OF_TIME, UNITS_OF_RATES = "s, ms, us, ns, min or h", "Hz, kHz, MHz, S/s, kS/s or MS/s"
#: Samples per second behind their prefix, which may stand alone, as in 25.6 k; a rate in MHZ is none in mHz.
_SAMPLES = re.compile(r"(?<!m)(?:(?i:S(?:a|amples?)?/s(?:ec(?:ond)?)?|sps|(?<=^k))|HZ)$")
#: Letters of a unit, at most.
_LONGEST = 80
#: What stands in the place of a unit where a file says none.
_UNTOLD = ("", "-", "--", "none", "n/a", "na")
_TOKEN = re.compile(
    r"(?P<divide>/|\bper\b)|(?P<symbol>g_n|g0|°|[^\W\d_]+)"
    r"\s*(?:(?:\^|\*\*)\s*(?P<open>\()?(?P<raised>[+-]?\d+)(?(open)\))|(?P<power>[+-]?\d+))?"
    r"|(?P<one>1)(?![\d.])|(?P<times>[*·⋅×.])|(?P<left>[(\[{])|(?P<right>[)\]}])"
)
#: Motions over a force, by how many times they are differentiated by time: their powers as receptance, mobility, accelerance.
_OVER_FORCE: tuple[Powers, ...] = ((-1, 0, 2, 0, 0, 0), (-1, 0, 1, 0, 0, 0), (-1, 0, 0, 0, 0, 0))
_MOTIONS = {_METRE: 0, _VELOCITY: 1, _ACCELERATION: 2}
_QUANTITIES = {
    _METRE: Quantity.DISPLACEMENT,
    _ACCELERATION: Quantity.ACCELERATION,
    _FORCE: Quantity.FORCE,
    _PRESSURE: Quantity.SOUND,
}


class Unit(NamedTuple):
    """A unit. `factor`: SI units (with hertz and radians) that it is. `powers`: tuple of int, length 6; of kg, m, s, V, rad, cycle."""

    factor: float
    powers: Powers

    def times(self, other: Unit, power: int = 1) -> Unit:
        """Return the product with a power of another one."""
        powers = tuple(a + power * b for a, b in zip(self.powers, other.powers, strict=True))
        # by a quotient, which keeps the last digit that a factor of its inverse loses
        factor = self.factor * other.factor**power if power >= 0 else self.factor / other.factor**-power
        return Unit(factor, powers)  # type: ignore[arg-type]


class FrfUnit(NamedTuple):
    """A unit of a motion over a force, or of a force over a motion.

    `factor`: SI units that it is
    `order`: how many times the motion is differentiated: 0 receptance, 1 mobility, 2 accelerance
    `inverse`: force over motion: dynamic stiffness, impedance, apparent mass
    """

    factor: float
    order: int
    inverse: bool = False


def is_untold(text: str) -> bool:
    """Return whether a text in the place of a unit says none."""
    return text.strip().lower() in _UNTOLD


@lru_cache(maxsize=1024)
def told_unit(text: str) -> Unit | None:
    """Return the unit that a text says, None where it says none that is known.

    `text`: symbols with powers, multiplied by ``*``, ``·`` or a blank and divided by ``/``; a product behind a quotient needs parentheses

    Examples
    --------
    >>> told_unit("m·s⁻²") == told_unit("m/s/s") == told_unit("(m/s^2)"), told_unit("mg").factor
    (True, 0.00980665)
    >>> told_unit("furlong"), told_unit("m/s*s"), told_unit("NM")
    (None, None, None)
    """
    plain = unicodedata.normalize("NFKC", text.strip().rstrip(".").replace("·", "*").replace("º", "°")).replace("μ", "u").replace("−", "-")
    tokens, place = list[re.Match[str]](), len(plain) if len(plain) > _LONGEST else 0
    while place < len(plain):
        if plain[place].isspace():
            place += 1
            continue
        found = _TOKEN.match(plain, place)
        if found is None:
            return None
        tokens.append(found)
        place = found.end()
    symbols = [token["symbol"] for token in tokens if token["symbol"]]
    if any(symbol not in _EVERY for symbol in symbols) and any(len(_alike(symbol)) != 1 for symbol in symbols):
        return None  # in letters that are not SI's, MN could be either
    tokens.reverse()
    unit = _product(tokens)
    return None if tokens else unit


def is_unit(text: str) -> bool:
    """Return whether a text is a unit; a number is none."""
    return told_unit(text) is not None and any(letter.isalpha() for letter in text)


def quotient(motion: str, force: str) -> str:
    """Return the text of one unit over another."""
    return f"({motion})/({force})"


def _product(tokens: list[re.Match[str]]) -> Unit | None:
    """The unit up to the end or a closing parenthesis; tokens are taken from the end of the list."""
    unit = _factor(tokens)
    divided = False
    while unit is not None and tokens and not tokens[-1]["right"]:
        divides = tokens[-1]["divide"] is not None
        if tokens[-1]["divide"] or tokens[-1]["times"]:
            tokens.pop()
        if divided and not divides:
            return None  # m/s*s: nobody knows what was meant
        divided = divided or divides
        other = _factor(tokens)
        unit = None if other is None else unit.times(other, -1 if divides else 1)
    return unit


def _factor(tokens: list[re.Match[str]]) -> Unit | None:
    if not tokens:
        return None
    token = tokens.pop()
    if token["one"]:
        return Unit(1.0, _NONE)
    if token["left"]:
        unit = _product(tokens)
        return unit if unit is not None and tokens and tokens.pop()["right"] else None
    if not token["symbol"]:
        return None
    unit = _symbol(token["symbol"])
    return None if unit is None else Unit(1.0, _NONE).times(unit, int(token["raised"] or token["power"] or 1))


def _every() -> dict[str, Unit]:
    """All symbols with their prefixes; one that stands in the table itself is not another one with a prefix."""
    found = {
        prefix + symbol: Unit((_PREFIXES | _IN_WORDS)[prefix] * factor, powers)
        for symbol, (factor, powers, prefixes) in _SYMBOLS.items()
        for prefix in prefixes
    }
    return found | {symbol: Unit(factor, powers) for symbol, (factor, powers, _) in _SYMBOLS.items()}


_EVERY = _every()


def _symbol(text: str) -> Unit | None:
    if text in _EVERY:
        return _EVERY[text]
    alike = _alike(text)
    return next(iter(alike)) if len(alike) == 1 and (len(text) > 2 or text.isupper() or text.islower()) else None


def _alike(text: str) -> set[Unit]:
    """What a symbol may mean whatever its letters."""
    return {unit for symbol, unit in _EVERY.items() if symbol.lower() == text.lower()}


def frf_unit(text: str) -> FrfUnit | None:
    """Return the unit of an FRF that a text says: a motion over a force or the inverse, None of anything else."""
    unit = told_unit(text)
    return None if unit is None else _frf(unit)


def _frf(unit: Unit) -> FrfUnit | None:
    for order, powers in enumerate(_OVER_FORCE):
        if unit.powers in (powers, tuple(-p for p in powers)):
            return FrfUnit(unit.factor, order, unit.powers != powers)
    return None


def motion_unit(text: str) -> tuple[float, int] | None:
    """Return SI units per unit of a displacement, velocity or acceleration, and how often it is differentiated."""
    unit = told_unit(text)
    return (unit.factor, _MOTIONS[unit.powers]) if unit is not None and unit.powers in _MOTIONS else None


def force_unit(text: str) -> float | None:
    """Return newtons per unit of a force."""
    return _of(text, _FORCE)


def hertz_in(text: str) -> float | None:
    """Return hertz per unit of a frequency or an angular frequency; 1/s could be either and is neither."""
    hertz, angular = _of(text, _FREQUENCY), _of(text, _ANGULAR)
    return hertz if angular is None else angular / (2.0 * pi)


def rate_in(text: str) -> float | None:
    """Return hertz per unit of a sampling rate: hertz, samples per second, 1/s, or a prefix alone, as in 25.6 k.

    Examples
    --------
    >>> rate_in("kS/s"), rate_in("MSps"), rate_in("1/s"), rate_in("ms/s")
    (1000.0, 1000000.0, 1.0, None)
    """
    plain = _SAMPLES.sub("Hz", text.strip())
    return hertz_in(plain) if plain.lower().endswith(("hz", "hertz")) else _of(plain, _PER_SECOND)


def seconds_in(text: str) -> float | None:
    """Return seconds per unit of a time."""
    return _of(text, _SECOND)


def radians_in(text: str) -> float | None:
    """Return radians per unit of an angle."""
    return _of(text, _ANGLE)


def volts_in(text: str) -> float | None:
    """Return volts per unit of a voltage."""
    return _of(text, _VOLT)


def _of(text: str, powers: Powers) -> float | None:
    unit = told_unit(text)
    return unit.factor if unit is not None and unit.powers == powers else None


def quantity_in(text: str) -> tuple[float, Quantity | None]:
    """Return SI units per unit of a recorded channel, and what it measures; None where it says nothing that a sensor measures.

    Examples
    --------
    >>> quantity_in("kgf"), quantity_in("Pa"), quantity_in("Nm")[1], quantity_in("furlong")
    ((9.80665, <Quantity.FORCE: 'force'>), (1.0, <Quantity.SOUND: 'sound'>), None, (1.0, None))
    """
    unit = told_unit(text)
    return (1.0, None) if unit is None else (unit.factor, _QUANTITIES.get(unit.powers))
