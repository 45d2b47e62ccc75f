"""Tracing many views of one mesh, one after the other or by any executor."""

from __future__ import annotations

import pickle
from collections import deque
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.compiled.threads import resolve_threads
from atra.errors import InputError
from atra.exact.ties import CoplanarOverlaps, coplanar_overlaps
from atra.geometry.mesh import Mesh
from atra.geometry.view import View, check_offset
from atra.hits import Hits
from atra.methods import METHODS
from atra.views.shared_mesh import Parcel, SharedMesh, shared, stage_of
from atra.whole_numbers import is_whole_number

_Images = tuple[NDArray[np.float32], NDArray[np.uint32]]


def render_views(
    mesh: Mesh,
    cameras: Mapping[Any, View] | Iterable[View],
    method: str = "raster",
    executor: Executor | None = None,
    *,
    offset: tuple[float, float] = (0.5, 0.5),
    in_flight: int | None = None,
    **options: Any,
) -> Iterator[tuple[Any, Hits]]:
    """Yield the name and the hits of every view, in order.

        for name, hits in atra.render_views(mesh, atra.read_colmap("sparse/0")):
            ...

    Parameters
    ----------
    mesh : Mesh
    cameras : mapping or iterable of cameras
        By name, as readers return them; other iterables, such as generators, give the names 0, 1, ...
    method : str
        As for `atra.trace`.
    executor : concurrent.futures.Executor, optional
        Or with its `submit`, as Dask and Ray have; None: this process, one view at a time, on every core. With an
        executor a view has one thread (default of `threads`), processes of one machine share the mesh, and those of
        other machines are sent it once.
    offset : (float, float)
        Where rays pass through their pixels, in [0, 1).
    in_flight : int, optional
        Upper limit of views that are being traced or are not yet yielded, which bounds the memory; None: 1, or two for
        each core of this machine with an executor (raise it for a cluster).
    **options :
        Of the method's tracer, such as threads, ties or split.

    Yields
    ------
    name, Hits

    Raises
    ------
    InputError
        For an unknown method, an offset outside the pixel and an in_flight below 1.
    MemoryBudgetError
        For too many overlapping triangles.
    TypeError
        For unknown options.
    ExceptionGroup
        After the last view: the errors of views that failed; each names its view.

    Examples
    --------
    >>> import atra
    >>> mesh = atra.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    >>> for number, hits in atra.render_views(mesh, atra.orbit(mesh, views=2, width=64, height=48)):
    ...     print(number, hits.prim_id.shape)
    0 (48, 64)
    1 (48, 64)
    """
    if method not in METHODS:
        raise InputError(f"method is {method!r}, expected one of {', '.join(METHODS)}")
    check_offset(offset)
    if isinstance(cameras, View) or not isinstance(cameras, Iterable):
        raise InputError(f"cameras is {cameras!r:.100}, expected several: by name, or a list of them")
    if in_flight is None:
        in_flight = 1 if executor is None else 2 * resolve_threads(None)
    if not is_whole_number(in_flight) or in_flight < 1:
        raise InputError(f"in_flight is {in_flight!r}, expected a whole number of at least 1")
    if executor is not None:
        options.setdefault("threads", 1)
    named = cameras.items() if isinstance(cameras, Mapping) else enumerate(cameras)
    return _rendered(mesh, iter(named), (method, offset, options), executor or _Here(), in_flight)


_Job = tuple[str, tuple[float, float], Mapping[str, Any]]


def _rendered(
    mesh: Mesh, named: Iterator[tuple[Hashable, View]], job: _Job, executor: Executor, in_flight: int
) -> Iterator[tuple[Hashable, Hits]]:
    overlaps = _found_once(mesh, job)
    failures: list[Exception] = []
    count = 0
    pending: deque[tuple[Hashable, View, Future[_Images | None]]] = deque()
    between_processes = not isinstance(executor, (_Here, ThreadPoolExecutor))
    with shared(mesh, overlaps, between_processes) as where:
        try:
            while True:
                for name, camera in islice(named, in_flight - len(pending)):
                    pending.append((name, camera, _submitted(executor, where, None, camera, job)))
                    count += 1
                if not pending:
                    break
                name, camera, future = pending.popleft()
                try:
                    images = future.result()
                    if images is None:  # a worker on another machine must be sent the mesh
                        parcel = pickle.dumps(Parcel(mesh, overlaps))
                        images = _submitted(executor, where, parcel, camera, job).result()
                    assert images is not None
                    # Arrays from Ray are read-only and in its memory.
                    depth, prim_id = (np.require(images[0], requirements="W"), np.require(images[1], requirements="W"))
                except TypeError:
                    raise
                except Exception as error:
                    error.add_note(f"in view {name!r}")
                    failures.append(error)
                    continue
                yield name, Hits(depth, prim_id, job[1], mesh, camera)
        finally:
            for _, _, future in pending:
                future.cancel()
    if failures:
        raise ExceptionGroup(f"{len(failures)} of {count} views failed", failures)


def _found_once(mesh: Mesh, job: _Job) -> CoplanarOverlaps | None:
    """Compute the mesh's cached properties before workers share it; returns its overlaps if ties are decided."""
    method, _, options = job
    _ = mesh.bounds
    if method != "raster":
        _ = mesh.without_area, mesh.traced_faces
    return coplanar_overlaps(mesh) if options.get("ties", "lowest") == "lowest" else None


def _submitted(
    executor: Executor, where: SharedMesh, parcel: bytes | None, camera: View, job: _Job
) -> Future[_Images | None]:
    try:
        return executor.submit(trace_view, where, parcel, camera, job)
    except Exception as error:  # a broken executor fails the views that are left
        failed: Future[_Images | None] = Future()
        failed.set_exception(error)
        return failed


def trace_view(where: SharedMesh, parcel: bytes | None, camera: View, job: _Job) -> _Images | None:
    """A worker's task: depth and prim_id, (H, W) each, of one view; None if it has no mesh and was sent none."""
    stage = stage_of(where, parcel)
    if stage is None:
        return None
    method, offset, options = job
    tracer = stage.take()
    try:
        if tracer is None:
            tracer = METHODS[method](stage.mesh, camera, **options)
        else:
            tracer.look(camera)
        hits = tracer.trace(offset)
    except BaseException:
        if tracer is not None:
            tracer.close()
        raise
    stage.put(tracer)  # for the next view
    return hits.depth, hits.prim_id


class _Here(Executor):
    """An executor that runs calls at once in this thread."""

    def submit(self, call: Callable[..., Any], /, *arguments: Any, **named: Any) -> Future[Any]:
        future: Future[Any] = Future()
        try:
            future.set_result(call(*arguments, **named))
        except Exception as error:
            future.set_exception(error)
        return future
