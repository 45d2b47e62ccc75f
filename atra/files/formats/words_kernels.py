"""Words and numbers of a text, read from its bytes.

A line ends at a line feed, a carriage return or the end of the text. Blanks are spaces, tabs, form feeds, and in an OBJ
a backslash before the end of a line.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from atra.compiled.store import njit

_LEAST_POWER, _MOST_POWER = -330, 308
_POWERS = [Fraction(10) ** power for power in range(_LEAST_POWER, _MOST_POWER + 1)]
_HIGH = np.array([float(power) for power in _POWERS])
_LOW = np.array([float(power - Fraction(float(power))) for power in _POWERS])
"""Powers of ten as sums of two float64."""

_SPLITTER = 134217729.0
"""2^27 + 1: halves a float64 (Veltkamp, Dekker)."""

_NEW_LINE, _RETURN, _MINUS, _PLUS, _POINT, SLASH, HASH, BACKSLASH = 10, 13, 45, 43, 46, 47, 35, 92


@njit
def is_end(text, i):  # type: ignore[no-untyped-def]
    return i >= len(text) or text[i] == _NEW_LINE or text[i] == _RETURN


@njit
def after_blanks(text, i):  # type: ignore[no-untyped-def]
    """The next place that is not blank; a backslash at the end of a line continues it."""
    while i < len(text):
        sign = text[i]
        if sign == 32 or sign == 9 or sign == 11 or sign == 12:
            i += 1
        elif sign == BACKSLASH and i + 1 < len(text) and text[i + 1] == _NEW_LINE:
            i += 2
        elif sign == BACKSLASH and i + 1 < len(text) and text[i + 1] == _RETURN:
            i += 3 if i + 2 < len(text) and text[i + 2] == _NEW_LINE else 2
        else:
            break
    return i


@njit
def is_word_end(text, i):  # type: ignore[no-untyped-def]
    if i < len(text) and text[i] > HASH and text[i] != BACKSLASH:
        return False  # as most do
    return is_end(text, i) or text[i] == HASH or after_blanks(text, i) > i


@njit
def after_word(text, i):  # type: ignore[no-untyped-def]
    while not is_word_end(text, i):
        i += 1
    return i


@njit
def line_end(text, i):  # type: ignore[no-untyped-def]
    """The end of the line, however often a backslash continues it."""
    while not is_end(text, i):
        i = max(i + 1, after_blanks(text, i)) if text[i] == BACKSLASH else i + 1
    return i


@njit
def is_letter(text, i, letter):  # type: ignore[no-untyped-def]
    """Whether a small letter stands at a place, or its capital."""
    return i < len(text) and (text[i] | 32) == letter


@njit
def _scaled(whole, power):  # type: ignore[no-untyped-def]
    """`whole` times ten to `power`, rounded once but for one case in 2^50."""
    if whole == 0:
        return 0.0
    if whole < 9007199254740992 and -22 <= power <= 22:
        return float(whole) * _HIGH[power - _LEAST_POWER] if power >= 0 else float(whole) / _HIGH[-power - _LEAST_POWER]
    if power > 280:
        return np.inf
    if power < -290:
        return 0.0 if power < _LEAST_POWER else float(whole) * _HIGH[power - _LEAST_POWER]
    below = np.uint64(0 if whole < 9007199254740992 else 2047)  # bits that float64 may not hold beside the others
    high, low = float(whole & ~below), float(whole & below)
    factor, rest = _HIGH[power - _LEAST_POWER], _LOW[power - _LEAST_POWER]
    product = high * factor
    a, b = _SPLITTER * high, _SPLITTER * factor
    a, b = a - (a - high), b - (b - factor)
    error = ((a * b - product) + a * (factor - b) + (high - a) * b) + (high - a) * (factor - b)
    return product + (error + (high * rest + low * factor))


@njit
def number(text, i):  # type: ignore[no-untyped-def]
    """The number that begins at a place, the place after it, and whether there is one.

    NaN and infinity have C's names, or those of Microsoft's, such as -1.#IND.
    """
    is_negative = i < len(text) and text[i] == _MINUS
    if i < len(text) and (text[i] == _MINUS or text[i] == _PLUS):
        i += 1
    whole, digits, power, count, has_point = np.uint64(0), 0, 0, 0, False
    while i < len(text):
        digit = text[i] - 48
        if 0 <= digit <= 9:
            count += 1
            if digits < 19:
                whole = whole * np.uint64(10) + np.uint64(digit)
                digits += whole > 0
                power -= has_point
            else:
                power += not has_point
        elif text[i] == _POINT and not has_point:
            has_point = True
        else:
            break
        i += 1
    if count == 0:
        if is_letter(text, i, 110) and is_letter(text, i + 1, 97) and is_letter(text, i + 2, 110):  # nan
            return np.nan, after_word(text, i), True
        if is_letter(text, i, 105) and is_letter(text, i + 1, 110) and is_letter(text, i + 2, 102):  # inf
            return -np.inf if is_negative else np.inf, after_word(text, i), True
        return 0.0, i, False
    if has_point and i < len(text) and text[i] == HASH and (is_letter(text, i + 1, 105) or is_letter(text, i + 1, 113)):
        while not is_end(text, i) and text[i] != 32 and text[i] != 9:
            i += 1
        return np.nan, i, True
    if is_letter(text, i, 101) or is_letter(text, i, 100):  # e, and Fortran's d
        at = i + 1
        is_small = at < len(text) and text[at] == _MINUS
        if at < len(text) and (text[at] == _MINUS or text[at] == _PLUS):
            at += 1
        exponent, first = 0, at
        while at < len(text) and 48 <= text[at] <= 57:
            exponent = min(exponent * 10 + (text[at] - 48), 100000)
            at += 1
        if at == first:
            return 0.0, i, False
        power += -exponent if is_small else exponent
        i = at
    value = _scaled(whole, power)
    return -value if is_negative else value, i, is_word_end(text, i)


@njit
def whole_number(text, i):  # type: ignore[no-untyped-def]
    """As `number`, of a whole number."""
    is_negative = i < len(text) and text[i] == _MINUS
    if i < len(text) and (text[i] == _MINUS or text[i] == _PLUS):
        i += 1
    whole, first = 0, i
    while i < len(text) and 48 <= text[i] <= 57:
        whole = min(whole * 10 + (text[i] - 48), 1 << 50)
        i += 1
    return -whole if is_negative else whole, i, i > first


@njit
def is_name(text, i, name):  # type: ignore[no-untyped-def]
    """Whether a word in small letters stands at a place, in letters of any size, and ends there."""
    for k in range(len(name)):
        if not is_letter(text, i + k, name[k]):
            return False
    return is_word_end(text, i + len(name))
