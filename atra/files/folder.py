"""Files that another file names, all within its folder."""

from __future__ import annotations

import base64
import binascii
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from atra.errors import InputError
from atra.files.reading import read_regular_file


class OutsideError(InputError):
    """A file names another outside its folder."""


class Folder:
    """Reads what a scene's file names. Raises OutsideError for names that lead out of the file's folder."""

    def __init__(self, path: Path) -> None:
        self._folder = path.parent.resolve()

    def path_of(self, name: Any) -> Path:
        """The path of a file by its name, a relative URI or path."""
        if not isinstance(name, str) or not name or "\0" in name:
            raise InputError(f"it names the file {name!r:.100}, expected a relative path")
        plain = unquote(name).replace("\\", "/")
        found = (self._folder / plain).resolve()
        if ":" in plain.split("/")[0] or not found.is_relative_to(self._folder):
            raise OutsideError(f"it names {name!r:.100}, which is outside its folder; copy the file there")
        return found

    def read(self, name: Any) -> bytes:
        """The bytes of a file, or of a data URI."""
        if isinstance(name, str) and name.startswith("data:"):
            head, _, content = name.partition(",")
            try:
                return base64.b64decode(content) if head.endswith(";base64") else unquote(content).encode("latin-1")
            except (binascii.Error, ValueError) as error:
                raise InputError(f"a data URI is damaged: {error}") from None
        path = self.path_of(name)
        if not path.is_file():
            raise InputError(f"it names {name!r:.100}, which is no file")
        return read_regular_file(path)

    def size_of(self, name: Any) -> int:
        """Bytes of a file, 0 for one that is missing or a data URI."""
        if not isinstance(name, str) or name.startswith("data:"):
            return 0
        path = self.path_of(name)
        return path.stat().st_size if path.is_file() else 0
