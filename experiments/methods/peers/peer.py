"""Other people's tracers behind the `Tracer` protocol: their lifetime, their timing and their rays.

Ray tracers run on an Embree of their own: `embreex` and `trimesh` on the one `atra` loads, too, Mitsuba 3 and Open3D on
copies in their wheels. They get the rays of `PixelTracer` ready made, in blocks of pixels, as neighbours meet the same
triangles; putting the answers back into the image's rows is not part of their time.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from time import perf_counter
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from atra.all_hits.reductions import Count, Gathered, Reduction, Thickness
from atra.all_hits.results import CountResult, ThicknessResult
from atra.compiled.threads import resolve_threads
from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.view import View, check_offset
from atra.hits import Hits
from experiments.drawing.style import PURPLE
from experiments.harness.column import TEXT, Column
from experiments.harness.environment import package_version
from experiments.harness.method import Method, Style, Tracing, always_available
from experiments.harness.options import NoOptions
from experiments.methods.one_view import OneViewTracer
from experiments.methods.peers.availability import package_problem
from experiments.methods.peers.pixel_rays import block_order, world_directions
from experiments.methods.peers.questions import Answering

_PIXEL_CENTRE = (0.5, 0.5)

PEER_COLUMNS = (
    Column("peer_version", TEXT, "version of the other tracer"),
    Column("peer_interface", TEXT, "what of it was called"),
    Column("peer_setting", TEXT, "how exact its hits are: Embree's robust or fast setting, or what it rounds"),
)


class PeerTracer(OneViewTracer):
    """A foreign tracer that offers what `atra.Tracer` asks for.

    `build` makes the rays through the pixel centres, hands over the triangles and has the BVH built, also where the
    peer would put that off until the first query.
    trace: the peer's own query of all rays at once and the conversion of its answer to `Hits`, nothing else. Rays of
    the last offset are kept; another offset makes them anew, inside the call. Measure a standing camera with one.

    packet_width: rays per query of Embree, 0 where the peer decides and does not tell. embree_bytes: 0, no peer tells.
    threads: None takes every core; how many build the BVH is up to the peer.
    frame_time_s: of the last frame, the peer's own query and conversion alone.
    package, interface, setting: what is imported, what is called, and how exact it is, in words.
    """

    packet_width = 1
    package: ClassVar[str]
    interface: ClassVar[str]
    setting: ClassVar[str]

    def __init__(self, mesh: Mesh, camera: View, threads: int | None = None) -> None:
        super().__init__()
        self.threads = resolve_threads(threads)
        self._rays: Any = None
        self._scene: Any = None
        self.frame_time_s: float | None = None
        self._show(mesh, camera)

    def _show(self, mesh: Mesh, camera: View) -> None:
        super()._show(mesh, camera)
        self._rays_offset: tuple[float, float] | None = None

    def _still_serves(self, before: View) -> bool:
        return True

    @property
    def counters(self) -> Mapping[str, Any]:
        """Triangles traced, and what is measured, in words."""
        told = package_version(self.package) or "unknown", self.interface, self.setting
        return {**super().counters, **dict(zip((one.name for one in PEER_COLUMNS), told, strict=True))}

    def _in_rows(self, values: NDArray[Any]) -> NDArray[Any]:
        """Answers, one for each pixel, as an image."""
        return values.reshape(self.camera.height, self.camera.width)

    @abstractmethod
    def _rays_through(self, offset: tuple[float, float]) -> Any:
        """What the peer needs to know of the rays through this position of each pixel."""

    @abstractmethod
    def _build_scene(self) -> Any:
        """The peer's scene, its BVH built."""

    @abstractmethod
    def _cast(self, scene: Any, rays: Any) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
        """Depth and prim_id as in `Hits`, of H W values each in the order of the rays; any shape."""

    def _plan(self) -> None:
        """Prepare what the first frame needs beside the peer's scene."""
        self._prepare_rays(_PIXEL_CENTRE)

    def _warm_up(self) -> None:
        """Have compiled what the first frame calls, off the clock."""

    def _build(self) -> tuple[float, float]:
        start = perf_counter()
        self._plan()
        plan_time_s = perf_counter() - start
        self._scene = None  # release the old one first; both together may not fit
        start = perf_counter()
        self._scene = self._build_scene()
        build_time_s = perf_counter() - start
        self._warm_up()
        return plan_time_s, build_time_s

    def _trace(self, offset: tuple[float, float], out: Hits | None) -> Hits:
        """See the class for what is inside the call. out: left alone; peers answer with arrays of their own, which the
        result holds without a copy."""
        if self._rays_offset != tuple(offset):
            self._prepare_rays(offset)
        start = perf_counter()
        answers = self._cast(self._scene, self._rays)
        self.frame_time_s = perf_counter() - start
        depth, prim_id = map(self._in_rows, answers)
        return Hits(depth, prim_id, offset, self.mesh, self.camera, self.threads)

    def gather(
        self, what: Reduction[Gathered], offset: tuple[float, float] = _PIXEL_CENTRE, out: Gathered | None = None
    ) -> CountResult | ThicknessResult:
        """How many hits the peer finds along each ray, some of them perhaps twice and others not at all, or how long
        they say that the way inside is.

        out: as in `trace`. Raises InputError for anything but `atra.Count()` and `atra.Thickness()`, for a mesh that is
        not closed, and where the peer cannot do it.
        """
        if not isinstance(what, Count | Thickness):
            raise InputError(
                f"{type(self).__name__} cannot gather {what!r:.100}, expected atra.Count() or atra.Thickness()"
            )
        what.weights(self.mesh)
        check_offset(offset)
        with self._in_use():
            if self._rays_offset != tuple(offset):
                self._prepare_rays(offset)
            find: Any = self._count if isinstance(what, Count) else self._thickness
            found = find(self._scene, self._rays)
            found = found.astype(next(iter(what.planes().values())).kind, copy=False)
            return what.result(self._in_rows(found), offset, self.mesh, self.camera)

    def _count(self, scene: Any, rays: Any) -> NDArray[np.integer]:
        """Hits of each of the H W rays in their order."""
        raise InputError(f"{type(self).__name__} cannot count hits; use method=trimesh or method=open3d")

    def _thickness(self, scene: Any, rays: Any) -> NDArray[np.floating]:
        """The length inside of each of the H W rays in the order of the rows."""
        raise InputError(f"{type(self).__name__} does not tell depths of all hits; use method=trimesh")

    def _prepare_rays(self, offset: tuple[float, float]) -> None:
        self._rays = self._rays_through(offset)
        self._rays_offset = (float(offset[0]), float(offset[1]))

    def _release(self) -> None:
        self._scene = self._rays = self._rays_offset = None


class RayPeerTracer(PeerTracer):
    """A foreign ray tracer, given rays ready made. The world is the peer's, the eye its rays' origin."""

    _blocks: tuple[tuple[int, int], NDArray[np.int64]] | None = None

    @abstractmethod
    def make_rays(self, origins: NDArray[np.float32], directions: NDArray[np.float32]) -> Any:
        """The peer's own form of rays. origins: (N, 3), or (1, 3) of all; directions: (N, 3) of any length."""

    def cast(self, rays: Any) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
        """What rays of `make_rays` hit: t in lengths of their directions, inf = miss, and prim_id, (N,) each.

        Raises ClosedError after `close`."""
        with self._in_use():
            return self._cast(self._scene, rays)

    def answer_to(self, question: str) -> Answering:
        """The peer's own function for a question, from plain arrays to plain arrays. Raises InputError where it has
        none, ClosedError after `close`."""
        with self._in_use():
            found = self._answers(self._scene).get(question)
        if found is None:
            raise InputError(f"{type(self).__name__} has no answer to workload.question={question}")
        return found

    def answer_of_stand_in(self, question: str, make: Callable[..., Any]) -> Answering | None:
        """The same of a class that stands in for the peer's, which `make` makes of the peer's mesh; None where none
        can."""
        return None

    def _answers(self, scene: Any) -> Mapping[str, Answering]:
        """Its answers to the questions it has functions for."""
        return {}

    def _rays_through(self, offset: tuple[float, float]) -> Any:
        size = self.camera.width, self.camera.height
        if self._blocks is None or self._blocks[0] != size:
            self._blocks = size, block_order(*size)
        directions = world_directions(self.camera, offset)[self._blocks[1]]
        return self.make_rays(np.asarray(self.camera.eye, np.float32)[None], directions)

    def _in_rows(self, values: NDArray[Any]) -> NDArray[Any]:
        assert self._blocks is not None
        image = np.empty(values.size, values.dtype)
        image[self._blocks[1]] = values.reshape(-1)
        return super()._in_rows(image)


def peer_method(
    name: str,
    label: str,
    check: Callable[[], str | None],
    tracer: type[PeerTracer],
    no_wheel: Callable[[], str | None] = always_available,
) -> Method:
    """The method that measures a peer. check, no_wheel: as of `package_problem`."""

    def problem() -> str | None:
        return package_problem(tracer.package, check, no_wheel)

    def make(mesh: Mesh, view: View, options: NoOptions, tracing: Tracing) -> PeerTracer:
        obstacle = problem()
        if obstacle is not None:
            raise InputError(obstacle)
        return tracer(mesh, view, tracing.threads)

    return Method(
        name,
        label,
        Style(PURPLE, "P"),
        NoOptions,
        make,
        tracer.__module__,
        problem=problem,
        counters=PEER_COLUMNS,
        version=lambda: package_version(tracer.package),
        is_ours=False,
        is_peer=True,
    )


_BLOCKS_PER_THREAD = 8  # rows differ in cost; few enough that a call's own price does not show

Answer = tuple[NDArray[np.float32], NDArray[np.uint32]]


@dataclass(frozen=True, eq=False)
class RayArrays:
    """origins, directions: (N, 3) float32, world space."""

    origins: NDArray[np.float32]
    directions: NDArray[np.float32]


class BlockwiseTracer(RayPeerTracer):
    """With one thread all rays go into one call. With more, the rays are cut into blocks of neighbours, each
    with a call of its own, and the threads share the blocks: the peer has no threads, but releases Python's lock while
    it traverses."""

    def __init__(self, mesh: Mesh, camera: View, threads: int | None = None) -> None:
        super().__init__(mesh, camera, threads)
        self._executor = ThreadPoolExecutor(self.threads, "peer") if self.threads > 1 else None

    def make_rays(self, origins: NDArray[np.float32], directions: NDArray[np.float32]) -> RayArrays:
        """One array of each."""
        return RayArrays(np.ascontiguousarray(np.broadcast_to(origins, directions.shape)), directions)

    def _in_blocks(self, cast: Callable[[RayArrays], Answer], rays: RayArrays) -> Answer:
        depths, prim_ids = zip(*self._each_block(cast, rays), strict=True)
        return np.concatenate(depths), np.concatenate(prim_ids)

    def _each_block(self, cast: Callable[[RayArrays], Any], rays: RayArrays) -> Iterable[Any]:
        if self._executor is None:
            return [cast(rays)]
        ends = np.linspace(0, len(rays.directions), 1 + _BLOCKS_PER_THREAD * self.threads).astype(int)
        blocks = [
            RayArrays(rays.origins[start:end], rays.directions[start:end])
            for start, end in pairwise(ends)
            if end > start
        ]
        return self._executor.map(cast, blocks)

    def close(self) -> None:
        super().close()
        if self._executor is not None:
            self._executor.shutdown()
