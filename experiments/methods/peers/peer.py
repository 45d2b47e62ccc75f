"""Other people's tracers as methods: their timing and their rays.

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

from atra.all_hits.reductions import Count, Reduction, Thickness
from atra.compiled.threads import WorkerPool
from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.tracing.method import Method as TracingMethod
from atra.tracing.method import Prepared
from atra.tracing.tracer import Tracer
from experiments.drawing.style import PURPLE
from experiments.harness.column import TEXT, Column
from experiments.harness.environment import package_version
from experiments.harness.method import Method, Style, Tracing, always_available
from experiments.harness.options import NoOptions
from experiments.methods.peers.availability import package_problem
from experiments.methods.peers.pixel_rays import block_order, world_directions
from experiments.methods.peers.questions import Answering

_PIXEL_CENTRE = (0.5, 0.5)

PEER_COLUMNS = (
    Column("peer_version", TEXT, "version of the other tracer"),
    Column("peer_interface", TEXT, "interface of the other tracer that was called"),
    Column("peer_setting", TEXT, "how exact its hits are: Embree's robust or fast setting, or what it rounds"),
)


class PreparedPeer(Prepared):
    """A foreign tracer's scene of a mesh, and the rays of a camera.

    Making it makes the rays through the pixel centres, hands over the triangles and has the BVH built, also where the
    peer would put that off until the first query. Rays of the last offset are kept; another offset makes them anew,
    inside `draw`. Measure a standing camera with one.

    rays_per_packet: of Embree, 0 where the peer decides and does not tell. frame_time_s: of the last frame, the peer's
    own query of all rays at once and the conversion of its answer, nothing else. threads: how many build the BVH is up
    to the peer. package, interface, setting: what is imported, what is called, and how exact it is, in words.
    """

    rays_per_packet: ClassVar[int] = 1
    package: ClassVar[str]
    interface: ClassVar[str]
    setting: ClassVar[str]

    def __init__(self, mesh: Mesh, camera: View, threads: int) -> None:
        self.mesh, self.camera, self.threads = mesh, camera, threads
        self.frame_time_s: float | None = None
        start = perf_counter()
        self._plan()
        self.plan_time_s = perf_counter() - start
        start = perf_counter()
        self._scene: Any = self._build_scene()
        self.build_time_s = perf_counter() - start
        self._warm_up()

    @property
    def triangle_count(self) -> int:
        """Triangles of the mesh."""
        return self.mesh.triangle_count

    @property
    def counters(self) -> Mapping[str, Any]:
        """What is measured, in words."""
        told = package_version(self.package) or "unknown", self.interface, self.setting
        return dict(zip((column.name for column in PEER_COLUMNS), told, strict=True))

    def still_serves(self, camera: View) -> bool:
        """Take any camera of the same size: the world is the peer's."""
        if (camera.width, camera.height) != (self.camera.width, self.camera.height):
            return False
        self.camera, self._offset = camera, None
        return True

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

    def draw(self, offset: tuple[float, float], depth: NDArray[np.float32], prim_id: NDArray[np.uint32]) -> None:
        """See `Prepared.draw`, and the class for what is timed."""
        self._prepare_rays(offset)
        start = perf_counter()
        answers = self._cast(self._scene, self._rays)
        self.frame_time_s = perf_counter() - start
        depth[:], prim_id[:] = map(self._in_rows, answers)

    @property
    def gathering_stride(self) -> int:
        """The image's width, pixels."""
        return self.camera.width

    def gather(
        self,
        what: Reduction[Any],
        offset: tuple[float, float],
        images: dict[str, NDArray],
        weights: Any,
        is_known: bool,
    ) -> None:
        """How many hits the peer finds along each ray, some of them perhaps twice and others not at all, or how long
        they say that the way inside is. Raises InputError for anything else, and where the peer cannot do it."""
        if not isinstance(what, Count | Thickness):
            name = type(self).__name__
            raise InputError(f"{name} cannot gather {what!r:.100}, expected atra.Count() or atra.Thickness()")
        self._prepare_rays(offset)
        find: Any = self._count if isinstance(what, Count) else self._thickness
        (image,) = images.values()
        image[: self.camera.height] = self._in_rows(find(self._scene, self._rays))

    def _count(self, scene: Any, rays: Any) -> NDArray[np.integer]:
        """Hits of each of the H W rays in their order."""
        raise InputError(f"{type(self).__name__} cannot count hits; use method=trimesh or method=open3d")

    def _thickness(self, scene: Any, rays: Any) -> NDArray[np.floating]:
        """The length inside of each of the H W rays in the order of the rows."""
        raise InputError(f"{type(self).__name__} does not tell depths of all hits; use method=trimesh")

    _offset: tuple[float, float] | None = None

    def _prepare_rays(self, offset: tuple[float, float]) -> None:
        if self._offset != tuple(offset):
            self._rays: Any = self._rays_through(offset)
            self._offset = (float(offset[0]), float(offset[1]))


class PreparedRays(PreparedPeer):
    """A foreign ray tracer, given rays ready made. The world is the peer's, the eye its rays' origin."""

    _blocks: tuple[tuple[int, int], NDArray[np.int64]] | None = None

    @abstractmethod
    def make_rays(self, origins: NDArray[np.float32], directions: NDArray[np.float32]) -> Any:
        """The peer's own form of rays. origins: (N, 3), or (1, 3) of all; directions: (N, 3) of any length."""

    def cast(self, rays: Any) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
        """What rays of `make_rays` hit: t in lengths of their directions, inf = miss, and prim_id, (N,) each."""
        return self._cast(self._scene, rays)

    def answer_to(self, question: str) -> Answering:
        """The peer's own function for a question, from plain arrays to plain arrays. Raises InputError where it has
        none."""
        answer = self._answers(self._scene).get(question)
        if answer is None:
            raise InputError(f"{type(self).__name__} has no answer to workload.question={question}")
        return answer

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


@dataclass(frozen=True)
class Peer(TracingMethod):
    """A foreign tracer as a method. kind: what prepares a mesh for it."""

    kind: type[PreparedPeer]

    @property
    def rays_per_packet(self) -> int:
        """Rays per query of Embree, 0 where nobody tells."""
        return self.kind.rays_per_packet

    def check_gathering(self, camera: View) -> None:
        """Nothing: what is asked for decides."""

    def prepare(self, mesh: Mesh, camera: View, pool: WorkerPool) -> PreparedPeer:
        """Hand over the mesh."""
        return self.kind(mesh, camera, pool.threads)


def peer_method(
    name: str,
    label: str,
    check: Callable[[], str | None],
    kind: type[PreparedPeer],
    no_wheel: Callable[[], str | None] = always_available,
) -> Method:
    """The method that measures a peer. check, no_wheel: as of `package_problem`."""

    def problem() -> str | None:
        return package_problem(kind.package, check, no_wheel)

    def make(mesh: Mesh, view: View, options: NoOptions, tracing: Tracing) -> Tracer:
        obstacle = problem()
        if obstacle is not None:
            raise InputError(obstacle)
        return Tracer(mesh, view, Peer(kind), threads=tracing.threads, ties="any")

    return Method(
        name,
        label,
        Style(PURPLE, "P"),
        NoOptions,
        make,
        kind.__module__,
        problem=problem,
        counters=PEER_COLUMNS,
        version=lambda: package_version(kind.package),
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


class PreparedBlocks(PreparedRays):
    """With one thread all rays go into one call. With more, the rays are cut into blocks of neighbours, each
    with a call of its own, and the threads share the blocks: the peer has no threads, but releases Python's lock while
    it traverses."""

    def __init__(self, mesh: Mesh, camera: View, threads: int) -> None:
        self._executor = ThreadPoolExecutor(threads, "peer") if threads > 1 else None
        super().__init__(mesh, camera, threads)

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
        """End the threads."""
        if self._executor is not None:
            self._executor.shutdown()
