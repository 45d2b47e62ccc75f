"""Words and numbers of a text, read from its bytes.

A line ends at a line feed, a carriage return or the end of the text. Blanks are spaces, tabs and form feeds.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from atra.compiled.store import kernel, njit

_LEAST_POWER, _MOST_POWER = -330, 308
_POWERS = [Fraction(10) ** power for power in range(_LEAST_POWER, _MOST_POWER + 1)]
_HIGH = np.array([float(power) for power in _POWERS])
_LOW = np.array([float(power - Fraction(float(power))) for power in _POWERS])
"""Powers of ten as sums of two float64."""

_SPLITTER = 134217729.0
"""2^27 + 1: halves a float64 (Veltkamp, Dekker)."""

_NEW_LINE, _RETURN, _MINUS, _PLUS, _POINT, _SLASH, _HASH = 10, 13, 45, 43, 46, 47, 35


@njit
def is_line_end(text, i):  # type: ignore[no-untyped-def]
    return i >= len(text) or text[i] == _NEW_LINE or text[i] == _RETURN


@njit
def is_word_end(text, i):  # type: ignore[no-untyped-def]
    return i >= len(text) or text[i] == 32 or 9 <= text[i] <= 13


@njit
def after_word(text, i):  # type: ignore[no-untyped-def]
    while not is_word_end(text, i):
        i += 1
    return i


@njit
def is_letter(text, i, letter):  # type: ignore[no-untyped-def]
    """Whether a small letter stands at a place, or its capital."""
    return i < len(text) and (text[i] | 32) == letter


@njit
def is_digit(text, i):  # type: ignore[no-untyped-def]
    return i < len(text) and 48 <= text[i] <= 57


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
    is_coded = has_point and i < len(text) and text[i] == _HASH
    if is_coded and (is_letter(text, i + 1, 105) or is_letter(text, i + 1, 113)):  # #IND, #INF and #QNAN
        return np.nan, after_word(text, i), True
    if is_letter(text, i, 101) or is_letter(text, i, 100):  # e, and Fortran's d
        at = i + 1
        is_small = at < len(text) and text[at] == _MINUS
        if at < len(text) and (text[at] == _MINUS or text[at] == _PLUS):
            at += 1
        exponent, first = 0, at
        while is_digit(text, at):
            exponent = min(exponent * 10 + (text[at] - 48), 100000)
            at += 1
        if at == first:
            return 0.0, i, False
        power += -exponent if is_small else exponent
        i = at
    value = _scaled(whole, power)
    return -value if is_negative else value, i, is_word_end(text, i)


@kernel
def split_words(text, start, is_new, values, codes, firsts, places):  # type: ignore[no-untyped-def]
    """Split a text into words, from a place on, until `values` is full or the text ends.

    Written: values: (W,) float64. codes: (W,) uint64, as for `Words`. firsts, places: (W,) int64, the first word of
    each line, among these, and its place in the text. A word that begins with # begins a comment, up to the end of the
    line. is_new: whether no word of the line stands before `start`. Returns the place reached, the number of words, and
    of lines that begin, and is_new for the next words.
    """
    i, words, lines = start, 0, 0
    while i < len(text) and words < len(values):
        if is_word_end(text, i):
            i, is_new = i + 1, is_new or is_line_end(text, i)
            continue
        if text[i] == _HASH:
            while not is_line_end(text, i):
                i += 1
            continue
        if is_new:
            firsts[lines], places[lines] = words, i
            lines += 1
        values[words], after, is_number = number(text, i)
        code = np.uint64(0)
        if not is_number and after < len(text) and text[after] == _SLASH and is_digit(text, after - 1):
            code = np.uint64(1)
        elif not is_number:
            for k in range(i, min(after_word(text, i), i + 8)):
                code = code << np.uint64(8) | np.uint64(text[k] | 32)
        codes[words] = code
        words, is_new = words + 1, False
        i = after_word(text, max(i, after))
    return i, words, lines, is_new


@kernel
def corner_rest(text, places, sizes, rest):  # type: ignore[no-untyped-def]
    """Whole numbers behind the slashes of corners, such as 5 and 3 of 1/5/3; 0 where there is none.

    places: (P,) int64, where the lines of faces begin. sizes: (P,) int64, their corners. rest: (2, C) int64, written.
    """
    corner = 0
    for line in range(len(places)):
        i = after_word(text, places[line])
        for _ in range(sizes[line]):
            while i < len(text) and is_word_end(text, i):
                i += 1
            end = after_word(text, i)
            for which in range(2):
                while i < end and text[i] != _SLASH:
                    i += 1
                i = min(i + 1, end)
                value, _, _ = number(text, i)
                rest[which, corner] = np.int64(value) if i < end and abs(value) < 1e15 else 0
            corner, i = corner + 1, end
