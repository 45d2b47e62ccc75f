"""Entries of camera files: named in every error, each name once, and without lens distortion."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from math import isfinite
from pathlib import Path
from typing import Any

from atra.errors import InputError
from atra.geometry.camera import CalibratedCamera

Cameras = dict[str, CalibratedCamera]
"""By name, in the order of the file."""


@contextmanager
def entry(where: str) -> Iterator[None]:
    """What is refused inside is refused as part of `where`: the file, and the entry in it."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def add(cameras: Cameras, name: str, camera: CalibratedCamera) -> None:
    """Raises InputError for a name that is there already."""
    if name in cameras:
        raise InputError(f"the name {name!r} is there twice, expected another for every camera")
    cameras[name] = camera


def check_any(cameras: Cameras, where: Path, what: str) -> None:
    """Raise InputError for a file without an entry."""
    if not cameras:
        raise InputError(f"{where} has no {what}, expected at least one")


def distorted(what: str, colmap: bool = False) -> InputError:
    """The refusal of a lens that bends rays. what: the model or number that says so."""
    undistort = "`colmap image_undistorter`" if colmap else "`cv2.undistort(image, K, distortion)`"
    return InputError(
        f"{what}, but rays are straight here: images must be undistorted first, by {undistort}, and their new "
        "cameras read"
    )


def read_json(path: Path) -> dict[str, Any]:
    """The object in a file. Raises InputError, naming the file, where there is none."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise InputError(f"{path} is no JSON: {error}") from None
    if not isinstance(found, dict):
        raise InputError(f"{path} holds a {type(found).__name__}, expected an object with frames")
    return found


def number(name: str, value: Any) -> float:
    """A finite number. Raises InputError, naming it, for anything else."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not isfinite(value):
        raise InputError(f"{name} is {value!r:.100}, expected a finite number")
    return float(value)


def pixels(name: str, value: Any) -> int:
    """A whole number of at least 1. Raises InputError, naming it, for anything else."""
    given = number(name, value)
    if given != int(given) or given < 1:
        raise InputError(f"{name} is {value!r}, expected a whole number of pixels of at least 1")
    return int(given)
