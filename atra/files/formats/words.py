"""Words of a text, such as an OBJ or the rows of a text PLY, as arrays."""

from __future__ import annotations

import re
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.formats.words_kernels import split_words
from atra.files.reading import Allowance

_BYTES_PER_WORD = 40
"""Memory for a word: its value and code, and what is made of them."""

_CONTINUED = re.compile(rb"\\(?:\r\n|\r|\n)")

_AT_ONCE = 1 << 20
"""Words that are split at once; the memory is checked after each time."""


def code_of(word: str) -> int:
    """The number by which `split_words` writes a word, in capitals or not: the first eight bytes, lowercase."""
    return int.from_bytes(word.encode()[:8])


def ranges(starts: NDArray[np.int64], lengths: NDArray[np.int64]) -> NDArray[np.int64]:
    """The whole numbers from each start on, as many as its length, one range behind the other."""
    return np.repeat(starts - (np.cumsum(lengths) - lengths), lengths) + np.arange(lengths.sum())


class Words(NamedTuple):
    """The words of a text.

    values: (W,) float64, numbers. codes: (W,) uint64: 0 for a number, 1 for one before a slash, else `code_of` the
    word. firsts: (L + 1,) int64, the first word of each line that has one, and W. places: (L,) int64, where these
    lines begin in the text. joined: (B,) uint8, the text with blanks where a line is continued.
    """

    text: bytes
    joined: NDArray[np.uint8]
    values: NDArray[np.float64]
    codes: NDArray[np.uint64]
    firsts: NDArray[np.int64]
    places: NDArray[np.int64]

    def line(self, word: int) -> str:
        """Number and text of the line of a word, for messages."""
        place = int(self.places[np.searchsorted(self.firsts, word, "right") - 1])
        before = self.text[:place]
        number = 1 + before.count(b"\n") + before.count(b"\r") - before.count(b"\r\n")
        text = re.split(rb"[\r\n]", self.text[place : place + 200], maxsplit=1)[0].decode(errors="replace").strip()
        return f"line {number}, {text!r:.100},"

    def word(self, word: int) -> str:
        """A word as it is written, for messages."""
        line = int(np.searchsorted(self.firsts, word, "right")) - 1
        text = _CONTINUED.sub(b" ", self.text[self.places[line] :])
        return text.split()[word - self.firsts[line]][:50].decode(errors="replace")

    def rows(
        self, named: NDArray[np.int64], skipped: int, ends: NDArray[np.int64] | int, message: str, size: int = 3
    ) -> NDArray[np.float64]:
        """(N, size) float64, numbers from each named word on, but so many skipped; they stand before `ends`.

        Raises InputError for the first that are not there: the named word's line, and the message.
        """
        at = named[:, None] + skipped + np.arange(size)
        is_there = at[:, -1] < ends
        is_there &= (self.codes[np.minimum(at, len(self.codes) - 1)] == 0).all(axis=1)
        if not is_there.all():
            raise InputError(f"{self.line(int(named[is_there.argmin()]))} {message}")
        return self.values[at]

    def wholes(self, at: NDArray[np.int64] | slice, most_code: int = 0) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Whole numbers (N,) at words, and whether they are such."""
        values = self.values[at]
        with np.errstate(invalid="ignore"):
            found = values.astype(np.int64)
        return found, (found == values) & (self.codes[at] <= most_code)


def split_text(text: bytes, allowance: Allowance, start: int = 0) -> Words:
    """The words of a text from a place on; comments from a word that begins with # on are left out.

    A backslash at the end of a line continues it, as in an OBJ.
    """
    joined = _CONTINUED.sub(lambda end: b" " * len(end[0]), text) if b"\\" in text else text
    given = np.frombuffer(joined, np.uint8)
    at, is_new, words = start, True, 0
    size = min(len(text) // 2 + 1, _AT_ONCE)
    chunks: list[list[NDArray[Any]]]
    chunks = [[np.empty(0), np.empty(0, np.uint64), np.empty(0, np.int64), np.empty(0, np.int64)]]
    while at < len(text):
        values, codes, firsts, places = (np.empty(size, one.dtype) for one in chunks[0])
        at, count, lines, is_new = split_words(given, at, is_new, values, codes, firsts, places)
        chunks.append([values[:count], codes[:count], firsts[:lines] + words, places[:lines]])
        words += count
        allowance.check(f"{words:,} words and more", words * _BYTES_PER_WORD)
    values, codes, firsts, places = (np.concatenate(one) for one in zip(*chunks, strict=True))
    return Words(text, given, values, codes, np.append(firsts, words), places)
