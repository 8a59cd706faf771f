"""Decimal numbers of long text tables; arrays and scalars only."""

from __future__ import annotations

import numba
import numpy as np

#: 10^k that a double holds exactly: with whole numbers below 2^53 one rounding is all that a decimal number needs (Clinger, 1990).
_POWERS = np.array([float(f"1e{k}") for k in range(23)])
_LARGEST = 2**53
_LINE_END, _RETURN, _BLANK, _PLUS, _MINUS, _LAST, _TAB = 10, 13, 32, 43, 45, 126, 9


@numba.njit(cache=True)
def decimal_rows(raw, delimiter, point, places, values):
    """Write the numbers of whole lines into `values` and return how many rows they are; -1 where anything in them is not plain.

    Plain are lines of ASCII with one cell for each of `places`, whose numbers have at most 15 digits or so; an empty cell is NaN. Each
    number is the double that is nearest to the decimal one.

    Shapes: raw (b,) bytes, the last of them a line's end; places (c,) columns of `values`, -1 for cells that are passed over; values
    (r, k), r at least the number of lines.
    """
    row, cell, at, filled = 0, 0, 0, False
    while at < raw.size:
        target = places[cell]
        if target < 0:
            while raw[at] != delimiter and raw[at] != _LINE_END and raw[at] != _RETURN:
                if (raw[at] < _BLANK and raw[at] != _TAB) or raw[at] > _LAST:
                    return -1
                filled = filled or raw[at] > _BLANK
                at += 1
        else:
            while raw[at] == _BLANK:
                at += 1
            signed = raw[at] == _MINUS or raw[at] == _PLUS
            sign = -1.0 if raw[at] == _MINUS else 1.0
            at += signed
            whole, power, digits, behind = 0, 0, 0, 0
            while 48 <= raw[at] <= 57 or (raw[at] == point and not behind):
                if raw[at] == point:
                    behind = 1
                else:
                    whole, power, digits = 10 * whole + int(raw[at]) - 48, power - behind, digits + 1
                    # zeros in front count for nothing, and beyond this nothing is exact
                    if whole > _LARGEST:
                        return -1
                at += 1
            if digits and (raw[at] == 101 or raw[at] == 69):
                at += 1
                downwards = raw[at] == _MINUS
                at += downwards or raw[at] == _PLUS
                exponent, length = 0, 0
                while 48 <= raw[at] <= 57 and length < 5:
                    exponent, length, at = 10 * exponent + int(raw[at]) - 48, length + 1, at + 1
                if not length:
                    return -1
                power += -exponent if downwards else exponent
            if digits:
                if abs(power) >= _POWERS.size:
                    return -1
                values[row, target] = sign * (whole / _POWERS[-power] if power < 0 else whole * _POWERS[power])
                filled = True
            elif signed or behind:
                return -1
            else:
                values[row, target] = np.nan
            while raw[at] == _BLANK:
                at += 1
        if raw[at] == _RETURN:
            at += 1
            if raw[at] != _LINE_END:
                return -1
        if raw[at] == delimiter and cell < places.size - 1:
            cell += 1
        elif raw[at] == _LINE_END and cell == places.size - 1 and filled:
            row, cell, filled = row + 1, 0, False
        else:
            return -1
        at += 1
    return row
