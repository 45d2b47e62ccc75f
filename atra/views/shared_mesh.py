"""A mesh that the workers of an executor share, in one memory for all processes of a machine."""

from __future__ import annotations

import mmap
import pickle
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import accumulate
from pathlib import Path
from tempfile import TemporaryDirectory
from uuid import uuid4

from atra.exact.ties import CoplanarOverlaps, keep_overlaps
from atra.geometry.mesh import Mesh
from atra.tracing.tracer import Tracer

_ALIGNMENT = 64


@dataclass(frozen=True, eq=False)
class Parcel:
    """A mesh with its cached properties, and its overlaps if they were computed."""

    mesh: Mesh
    overlaps: CoplanarOverlaps | None


@dataclass(frozen=True)
class SharedMesh:
    """How workers find a mesh: by `key` in a process that has it, otherwise in a file that they map.

    contents: the pickled `Parcel` without its arrays. places: start and end of each array in the file, bytes.
    """

    key: str
    path: Path
    contents: bytes
    places: tuple[tuple[int, int], ...]


@dataclass(eq=False)
class Stage:
    """A mesh in one process, with its idle tracers, in a list that threads take them from and put them back to."""

    mesh: Mesh
    _idle: list[Tracer] = field(default_factory=list)
    _is_struck: bool = False

    def take(self) -> Tracer | None:
        """An idle tracer, which the caller returns by `put`; None = there is none."""
        try:
            return self._idle.pop()
        except IndexError:
            return None

    def put(self, tracer: Tracer) -> None:
        self._idle.append(tracer)
        if self._is_struck:
            self.strike()

    def strike(self) -> None:
        """Close all tracers, those in use at their `put`."""
        self._is_struck = True
        while (tracer := self.take()) is not None:
            tracer.close()


_stages: dict[str, Stage] = {}
"""Stages of this process by key: those of calls in progress, and in a worker the last one it used."""

_own: set[str] = set()
"""Keys of the calls in progress that this process made."""


@contextmanager
def shared(mesh: Mesh, overlaps: CoplanarOverlaps | None, between_processes: bool) -> Iterator[SharedMesh]:
    """Share a mesh with workers inside the `with` block. between_processes: by a temporary file."""
    key = uuid4().hex
    _stages[key] = Stage(mesh)
    _own.add(key)
    try:
        with TemporaryDirectory(prefix="atra-", ignore_cleanup_errors=True) as folder:
            path = Path(folder) / key
            yield _written(key, path, Parcel(mesh, overlaps)) if between_processes else SharedMesh(key, path, b"", ())
    finally:
        _own.discard(key)
        _stages.pop(key).strike()


def _written(key: str, path: Path, parcel: Parcel) -> SharedMesh:
    buffers: list[pickle.PickleBuffer] = []
    contents = pickle.dumps(parcel, protocol=5, buffer_callback=buffers.append)
    arrays = [buffer.raw() for buffer in buffers]
    ends = list(accumulate(-(-array.nbytes // _ALIGNMENT) * _ALIGNMENT for array in arrays))
    starts = [0, *ends]
    with path.open("wb") as file:
        for start, array in zip(starts, arrays, strict=False):
            file.seek(start)
            file.write(array)
        file.truncate(max(starts[-1], 1))
    places = tuple((start, start + array.nbytes) for start, array in zip(starts, arrays, strict=False))
    return SharedMesh(key, path, contents, places)


def stage_of(shared_mesh: SharedMesh, parcel: bytes | None) -> Stage | None:
    """The stage of a shared mesh in this process; None if it is not found and no pickled `Parcel` was sent."""
    stage = _stages.get(shared_mesh.key)
    if stage is not None:
        return stage
    found = _mapped(shared_mesh) if parcel is None else pickle.loads(parcel)
    if found is None:
        return None
    if found.overlaps is not None:
        keep_overlaps(found.mesh, found.overlaps)
    for key in set(_stages) - _own:
        if (old := _stages.pop(key, None)) is not None:
            old.strike()
    return _stages.setdefault(shared_mesh.key, Stage(found.mesh))


def _mapped(shared_mesh: SharedMesh) -> Parcel | None:
    """The parcel with its arrays mapped from the file, whose pages processes share; None on another machine."""
    try:
        with shared_mesh.path.open("rb") as file:
            memory = memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_COPY))
    except FileNotFoundError:
        return None
    buffers = [memory[start:end] for start, end in shared_mesh.places]
    return pickle.loads(shared_mesh.contents, buffers=buffers)  # type: ignore[no-any-return]
