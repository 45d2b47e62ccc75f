"""One file out of a zip archive that is not trusted."""

from __future__ import annotations

import errno
import re
import stat
import struct
import zipfile
import zlib
from pathlib import Path, PurePosixPath

from atra.errors import InputError

LARGEST_UNPACKED_BYTES = 2 * 2**30
"""Ample for the manifest, whose largest archive has 80 MB; a zip bomb promises far more."""

_COMPRESSIONS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""All that zips of meshes need; LZMA lets the archive say how much memory unpacking takes."""

_BLOCK_BYTES = 1 << 20


def extract_member(archive: Path, member: str, folder: Path) -> Path:
    """Unpack the file `member` of a zip into `folder` under its own last name; nothing else is written.

    member: its path in the archive, or its last name if just one file of the archive has it.
    Returns the path of the file.
    Raises InputError when the file is no zip, is damaged or encrypted, lacks the member or packs it in an unusual way,
    or when any of its entries has an absolute path, a path out of the folder, is a symbolic link, a device or a pipe,
    or all together are larger than LARGEST_UNPACKED_BYTES: such an archive is not what it should be, and none of it is
    used. Raises OSError when `archive` cannot be read or `folder` not be written.
    """
    try:
        with zipfile.ZipFile(archive) as opened:
            entries = opened.infolist()
            _check_entries(archive, entries)
            entry = _find(archive, entries, member)
            target = folder / PurePosixPath(entry.filename).name
            _copy(opened, entry, target)
            return target
    except (zipfile.BadZipFile, zlib.error, struct.error, EOFError, ValueError, OSError) as error:
        if isinstance(error, InputError) or (isinstance(error, OSError) and error.errno != errno.EINVAL):
            raise  # EINVAL: a place before the file's start was sought
        raise InputError(f"{archive} is not a whole zip archive ({error}); delete it and fetch it again") from None
    except (RuntimeError, NotImplementedError) as error:  # encrypted; an unknown compression
        raise InputError(f"{archive} cannot be unpacked: {error}") from None


def _check_entries(archive: Path, entries: list[zipfile.ZipInfo]) -> None:
    for entry in entries:
        # orig_filename: zipfile cuts `filename` at a null byte and rewrites separators, which would hide the intent.
        name = entry.orig_filename
        if "\0" in name:
            raise InputError(f"{archive} holds {name!r}, a name with a null byte; nothing was unpacked")
        parts = re.split(r"[/\\]", name)
        if name.startswith(("/", "\\")) or re.match(r"[A-Za-z]:", name):
            raise InputError(f"{archive} holds {name!r}, an absolute path; nothing was unpacked")
        if ".." in parts:
            raise InputError(f"{archive} holds {name!r}, a path that leads out of its folder; nothing was unpacked")
        kind = stat.S_IFMT(entry.external_attr >> 16)
        if kind not in (0, stat.S_IFREG, stat.S_IFDIR):
            what = "a symbolic link" if kind == stat.S_IFLNK else "neither file nor folder"
            raise InputError(f"{archive} holds {name!r}, {what}; nothing was unpacked")
    total = sum(entry.file_size for entry in entries)
    if total > LARGEST_UNPACKED_BYTES:
        raise InputError(
            f"{archive} would unpack to {total} bytes, expected at most {LARGEST_UNPACKED_BYTES}; nothing was unpacked"
        )


def _find(archive: Path, entries: list[zipfile.ZipInfo], member: str) -> zipfile.ZipInfo:
    files = [entry for entry in entries if not entry.is_dir()]
    for alike in (
        [entry for entry in files if entry.filename == member],
        [entry for entry in files if PurePosixPath(entry.filename).name == PurePosixPath(member).name],
    ):
        if len(alike) == 1:
            return alike[0]
        if alike:
            raise InputError(f"{archive} holds {len(alike)} files called {member}, expected one")
    meshes = ", ".join(entry.filename for entry in files if entry.filename.lower().endswith((".obj", ".ply")))
    raise InputError(f"{archive} holds no {member}; its meshes are: {meshes[:500] or 'none'}")


def _copy(opened: zipfile.ZipFile, entry: zipfile.ZipInfo, target: Path) -> None:
    if entry.compress_type not in _COMPRESSIONS:
        raise InputError(f"{entry.filename} is compressed by method {entry.compress_type}, expected deflation or none")
    written = 0
    with opened.open(entry) as source, target.open("wb") as file:
        while block := source.read(_BLOCK_BYTES):
            written += len(block)
            if written > LARGEST_UNPACKED_BYTES:  # the sizes checked before are the archive's own word
                raise InputError(f"{entry.filename} is larger than {LARGEST_UNPACKED_BYTES} bytes")
            file.write(block)
