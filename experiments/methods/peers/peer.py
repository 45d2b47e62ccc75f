"""Other people's tracers as methods: their timing and their rays.

Ray tracers run on an Embree of their own: `embreex` and `trimesh` on the one `atra` loads, too, Mitsuba 3 and Open3D on
copies in their wheels. They get the rays of `PixelTracer` ready made, in blocks of pixels, as neighbours meet the same
triangles; putting the answers back into the image's rows is not part of their time.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from time import perf_counter
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from atra.compiled.threads import WorkerPool
from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import from_eye_space
from atra.geometry.view import View
from atra.tracing.method import Method as TracingMethod
from atra.tracing.method import Prepared
from atra.tracing.rays import image_ray_grid
from atra.tracing.tracer import Tracer
from experiments.drawing.style import PURPLE
from experiments.harness.column import TEXT, Column
from experiments.harness.environment import package_version
from experiments.harness.method import Method, Style, Tracing, always_available
from experiments.harness.options import NoOptions

PEER_COLUMNS = (
    Column("peer_version", TEXT, "version of the other tracer"),
    Column("peer_interface", TEXT, "interface of the other tracer that was called"),
    Column("peer_setting", TEXT, "how exact its hits are: Embree's robust or fast setting, or what it rounds"),
)

QUESTIONS = ("closest", "any", "count", "all", "contains")
"""closest: the first triangle that each ray hits. any: whether it hits any. count: how many. all: which ones.
contains: whether points lie inside."""

Asked = NDArray[Any] | tuple[NDArray[Any], NDArray[Any]]
"""closest: (N,) integers, -1 or `MISS` for none. any, contains: (N,) bool. count: (N,) integers. all: (M,) integers
each, the rays and the triangles of the hits."""

Answering = Callable[..., Asked]
"""Origins and directions, (N, 3) float32 each, or points alone -> the answer."""

Rays = tuple[NDArray[np.float32], NDArray[np.float32]]
"""Origins and directions, (N, 3) float32 each, world space."""

Answer = tuple[NDArray[np.float32], NDArray[np.uint32]]
"""Depth and prim_id as in `Hits`, in the order of the rays; any shape."""


class PeerScene(Protocol):
    """A mesh as another's tracer has it: made of mesh, camera and threads, its BVH built, also where the peer would put
    that off until the first query. `cast` must be written, and `make_rays` by a ray tracer.

    package, interface, setting: what is imported, what is called, and how exact it is, in words. rays_per_packet: of
    Embree, 0 where the peer decides and does not tell. follows: whether it serves any camera; otherwise it is built
    again, and its answers are in the order of the image's rows.
    """

    package: ClassVar[str]
    interface: ClassVar[str]
    setting: ClassVar[str]
    rays_per_packet: ClassVar[int] = 1
    follows: ClassVar[bool] = True

    def plan(self) -> None:
        """Prepare what the first frame needs beside the scene and the rays."""
        return

    def make_rays(self, origins: NDArray[np.float32], directions: NDArray[np.float32]) -> Any:
        """The peer's own form of rays. origins: (N, 3), or (1, 3) of all; directions: (N, 3) of any length."""
        raise InputError(f"{self.package} takes no rays, expected a ray tracer of others")

    def rays_through(self, camera: View, offset: tuple[float, float], order: NDArray[np.int64]) -> Any:
        """What the peer needs to know of the rays through this position of each pixel, in this order of the pixels."""
        return self.make_rays(np.asarray(camera.eye, np.float32)[None], world_directions(camera, offset)[order])

    def warm_up(self, rays: Any) -> None:
        """Have compiled what the first frame calls, off the clock."""
        return

    def cast(self, rays: Any) -> Answer:
        """What rays hit: t in lengths of their directions, inf = miss, and prim_id."""
        raise NotImplementedError

    def answers(self) -> Mapping[str, Answering]:
        """The peer's own functions, from plain arrays to plain arrays, for the questions it has functions for."""
        return {}

    def close(self) -> None:
        """Release what it holds."""
        return


_BLOCKS_PER_THREAD = 8
"""Rows differ in cost; few enough that a call's own price does not show."""


class BlockScene(PeerScene):
    """With one thread all rays go into one call. With more, the rays are cut into blocks of neighbours, each with a
    call of its own, and the threads share the blocks. `cast_block` must be written."""

    def __init__(self, threads: int) -> None:
        self._threads = threads
        self._executor = ThreadPoolExecutor(threads, "peer") if threads > 1 else None

    def make_rays(self, origins: NDArray[np.float32], directions: NDArray[np.float32]) -> Rays:
        return np.ascontiguousarray(np.broadcast_to(origins, directions.shape)), directions

    def cast_block(self, origins: NDArray[np.float32], directions: NDArray[np.float32]) -> Answer:
        """What some of the rays hit."""
        raise NotImplementedError

    def cast(self, rays: Rays) -> Answer:
        if self._executor is None:
            return self.cast_block(*rays)
        count = min(_BLOCKS_PER_THREAD * self._threads, len(rays[1]))
        origins, directions = (np.array_split(part, count) for part in rays)
        depths, prim_ids = zip(*self._executor.map(self.cast_block, origins, directions), strict=True)
        return np.concatenate(depths), np.concatenate(prim_ids)

    def close(self) -> None:
        """End the threads."""
        if self._executor is not None:
            self._executor.shutdown()


BLOCK = 8
"""Pixels along the sides of the blocks in which peers get rays."""


def block_order(width: int, height: int) -> NDArray[np.int64]:
    """(H W,) numbers of pixels, counted along rows: block by block, each row by row."""
    y, x = np.divmod(np.arange(height * width), width)
    return np.lexsort((x, y, x // BLOCK, y // BLOCK))


def world_directions(camera: View, offset: tuple[float, float]) -> NDArray[np.float32]:
    """(H W, 3) float32, directions of the rays of `PixelTracer` in the order of the rows, world space; lengths make
    their t the depth."""
    column_rays, row_rays = image_ray_grid(camera, offset)
    # Summed in float32 as the kernels of atra do, so that the rays are the same bit by bit.
    directions = column_rays[:, None, :] + row_rays[:, :, None]
    # A peer sees the mesh in the world's axes; ray space has the camera's where the view is narrow.
    to_ray_space = from_eye_space(camera)
    if not np.array_equal(to_ray_space, np.eye(3)):
        directions = np.tensordot(to_ray_space.T, directions, 1).astype(np.float32)
    return np.ascontiguousarray(directions.reshape(3, -1).T)


class PreparedPeer(Prepared):
    """A peer's scene, and the rays of a camera.

    Rays through the pixel centres are made beforehand, and those of the last offset are kept; another offset makes them
    again, inside `draw`. Measure a standing camera with one. frame_time_s: of the last frame, the peer's own query of
    all rays at once and the conversion of its answer, nothing else. How many threads build the BVH is up to the peer.
    """

    def __init__(self, make: Callable[..., PeerScene], mesh: Mesh, camera: View, threads: int) -> None:
        self.mesh, self.camera = mesh, camera
        self.frame_time_s: float | None = None
        self._offset: tuple[float, float] | None = None
        start = perf_counter()
        self.scene = make(mesh, camera, threads)
        self.build_time_s = perf_counter() - start
        start = perf_counter()
        self.scene.plan()
        self._see(camera)
        self._prepare_rays((0.5, 0.5))
        self.plan_time_s = perf_counter() - start
        self.scene.warm_up(self._rays)

    @property
    def triangle_count(self) -> int:
        """Triangles of the mesh."""
        return self.mesh.triangle_count

    @property
    def counters(self) -> Mapping[str, Any]:
        """What is measured, in words."""
        told = package_version(self.scene.package) or "unknown", self.scene.interface, self.scene.setting
        return dict(zip((column.name for column in PEER_COLUMNS), told, strict=True))

    def still_serves(self, camera: View) -> bool:
        """Take any camera: the world is the peer's."""
        if self.scene.follows:
            self._see(camera)
        return self.scene.follows

    def _see(self, camera: View) -> None:
        self.camera, self._offset = camera, None
        size = camera.width, camera.height
        self._order = block_order(*size) if self.scene.follows else np.arange(size[0] * size[1])

    def _prepare_rays(self, offset: tuple[float, float]) -> None:
        if self._offset != tuple(offset):
            self._rays = self.scene.rays_through(self.camera, offset, self._order)
            self._offset = (float(offset[0]), float(offset[1]))

    def _in_rows(self, values: NDArray[Any]) -> NDArray[Any]:
        """Answers, one for each pixel, as an image."""
        image = np.empty(values.size, values.dtype)
        image[self._order] = values.reshape(-1)
        return image.reshape(self.camera.height, self.camera.width)

    def draw(self, offset: tuple[float, float], depth: NDArray[np.float32], prim_id: NDArray[np.uint32]) -> None:
        """See `Prepared.draw`, and the class for what is timed."""
        self._prepare_rays(offset)
        start = perf_counter()
        answers = self.scene.cast(self._rays)
        self.frame_time_s = perf_counter() - start
        depth[:], prim_id[:] = map(self._in_rows, answers)

    def close(self) -> None:
        """Let go of the peer's scene."""
        self.scene.close()


@dataclass(frozen=True)
class Peer(TracingMethod):
    """A foreign tracer as a method. make: its scene of a mesh."""

    make: type[PeerScene]

    @property
    def rays_per_packet(self) -> int:
        """Rays per query of Embree, 0 where nobody tells."""
        return self.make.rays_per_packet

    def prepare(self, mesh: Mesh, camera: View, pool: WorkerPool) -> PreparedPeer:
        """Hand over the mesh."""
        return PreparedPeer(self.make, mesh, camera, pool.threads)


INSTALL = "pip install 'atra[peers]'"


def peer_method(
    name: str, label: str, check: Callable[[], str | None], kind: type[PeerScene],
    no_wheel: Callable[[], str | None] = always_available,
) -> Method:  # fmt: skip
    """The method that measures a peer.

    check: imports the package, which takes seconds for some, and returns what is wrong with it, None = nothing; what
    it raises becomes the text. no_wheel: why the package cannot be installed here, None = it can.
    """

    def problem() -> str | None:
        try:
            return check()
        except Exception as error:  # a foreign package may raise anything; without it there is a reason, not a crash
            if isinstance(error, ModuleNotFoundError) and error.name == kind.package:
                return f"{kind.package} is not installed; {no_wheel() or INSTALL}"
            told = f"{type(error).__name__}: {' '.join(str(error).split())}"
            return f"{kind.package} cannot be imported, {told}; {INSTALL}"

    def make(mesh: Mesh, view: View, options: NoOptions, tracing: Tracing) -> Tracer:
        obstacle = problem()
        if obstacle is not None:
            raise InputError(obstacle)
        return Tracer(mesh, view, Peer(kind), threads=tracing.threads, ties="any")

    return Method(
        name, label, Style(PURPLE, "P"), NoOptions, make, kind.__module__, problem=problem, counters=PEER_COLUMNS,
        version=lambda: package_version(kind.package), is_ours=False, is_peer=True,
    )  # fmt: skip
