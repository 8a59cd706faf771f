"""Errors that a user can act on."""

from __future__ import annotations

import os


class RcsaIdentError(Exception):
    """Base of every error that this package raises on purpose."""


class InputError(RcsaIdentError, ValueError):
    """Something that the user gave is not usable; the message names the field, what was found and what is allowed.

    Parameters
    ----------
    field : str
        The name that the user knows: a key, a column, a channel, an argument.
    found : object
        What stood there.
    allowed : str
        What may stand there, in words, with its unit.
    where : str, optional
        The file (and line) where it stood.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> try:
    ...     ri.rpm(-1)
    ... except ri.InputError as error:
    ...     print(error)
    value: found -1, allowed is a finite number greater than 0 [rev/min]
    """

    def __init__(self, field: str, found: object, allowed: str, where: str = "") -> None:
        self.field = field
        self.found = found
        self.allowed = allowed
        self.where = where
        place = f"{where}: " if where else ""
        super().__init__(f"{place}{field}: found {_short(found)}, allowed is {allowed}")

    def __reduce__(self) -> tuple[type[InputError], tuple[object, ...]]:
        """Pickle with all arguments, so that the error crosses processes."""
        return type(self), (self.field, self.found, self.allowed, self.where)

    def at(self, where: str) -> InputError:
        """Return the same error with the file named in which it stood.

        Examples
        --------
        >>> import rcsa_ident as ri
        >>> print(ri.InputError("teeth", 0, "1 or more").at("TOOL.toml"))
        TOOL.toml: teeth: found 0, allowed is 1 or more
        """
        return type(self)(self.field, self.found, self.allowed, where)


def no_cache(error: RuntimeError) -> InputError | None:
    """Return in words that compiled kernels can be kept nowhere, as numba raises it at an import; None for any other error."""
    if "no locator available" not in str(error):
        return None
    found = os.environ.get("NUMBA_CACHE_DIR") or "nothing, while this package's folder and the user's cache cannot be written"
    return InputError("NUMBA_CACHE_DIR", found, "a folder that can be written, where compiled kernels are kept")


class Unsteady(InputError):
    """A recording shows no steady cut at a known speed; another stretch of the same signal may show one."""


def _short(found: object) -> str:
    text = found if isinstance(found, str) else repr(found)
    return text if len(text) <= 120 else text[:117] + "..."


def positive(field: str, value: float, unit: str = "") -> float:
    """Return `value` as a float if it is finite and above zero, else raise `InputError`."""
    return _within(field, value, unit, "greater than 0", lambda v: v > 0.0)


def non_negative(field: str, value: float, unit: str = "") -> float:
    """Return `value` as a float if it is finite and not below zero, else raise `InputError`."""
    return _within(field, value, unit, "0 or more", lambda v: v >= 0.0)


def finite(field: str, value: float, unit: str = "") -> float:
    """Return `value` as a float if it is a finite number, else raise `InputError`."""
    return _within(field, value, unit, "", lambda v: True)


def _within(field, value, unit, words, test) -> float:  # type: ignore[no-untyped-def]
    allowed = f"a finite number {words}".rstrip() + (f" [{unit}]" if unit else "")
    if isinstance(value, bool):
        raise InputError(field, value, allowed)
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise InputError(field, value, allowed) from None
    if not (number - number == 0.0 and test(number)):
        raise InputError(field, value, allowed)
    return number
