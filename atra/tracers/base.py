"""What all tracers share: their protocol, lifetime, timing and buffers."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import wraps
from time import perf_counter
from types import TracebackType
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from atra.alignment.culling import AlignedGeometry, check_image_memory
from atra.embree.device import EmbreeDevice
from atra.embree.scene import EmbreeScene, check_build_quality, resolve_packet_width
from atra.embree.workspace import Workspace
from atra.errors import EmbreeError, InputError
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import check_range, ray_axes
from atra.geometry.view import View, check_offset
from atra.hits import Hits
from atra.judge.ties import check_ties, coplanar_overlaps, lowest_of_ties, tie_tiles
from atra.kernels.callbacks import memory_monitor
from atra.parallel import WorkerPool, resolve_threads


class Tracer(Protocol):
    """What every method of tracing offers.

    `plan` and `build` are called once, in this order, by `with` or by hand; `trace` any number of times after them.
    plan_time_s, build_time_s: seconds each took. embree_bytes: what Embree holds by its own account, bytes.
    triangle_count: triangles in the Embree scene, copies included.
    """

    mesh: Mesh
    camera: View
    packet_width: int
    threads: int
    plan_time_s: float
    build_time_s: float

    @property
    def triangle_count(self) -> int: ...

    @property
    def embree_bytes(self) -> int: ...

    def plan(self) -> None: ...

    def build(self) -> None: ...

    def trace(self, offset: tuple[float, float] = (0.5, 0.5), out: Hits | None = None) -> Hits: ...

    def close(self) -> None: ...

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...


class Prepared(ABC):
    """What `with` does to a tracer: prepare it on entry; close it on exit, or at once where preparing fails."""

    @abstractmethod
    def _prepare(self) -> None: ...

    @abstractmethod
    def close(self) -> None: ...

    def __enter__(self) -> Self:
        try:
            self._prepare()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def one_at_a_time(method: Callable[..., None]) -> Callable[..., None]:
    """A method of `EmbreeTracer` that waits for a plan, build or frame in progress in another thread."""

    @wraps(method)
    def locked(self: EmbreeTracer, *arguments: Any) -> None:
        with self._lock:
            method(self, *arguments)

    return locked


class EmbreeTracer(Prepared):
    """Lifetime, timing and buffers that the tracers share; `camera` is that of the rays shot.

    Raises InputError for a mesh smaller than 1e-9, or farther than 1e11 from the eye: float32 would lose triangles;
    MemoryBudgetError for images that the free memory cannot hold.
    """

    def __init__(
        self,
        mesh: Mesh,
        camera: View,
        packet_width: int | None,
        threads: int | None,
        build_quality: str,
        ties: str,
    ) -> None:
        check_build_quality(build_quality)
        check_ties(ties)
        self.mesh = mesh
        self.camera = camera
        for seen, view in self._views:
            check_range(seen, view)
        self.build_quality = build_quality
        self.ties = ties
        check_image_memory(sum(view.height for _, view in self._views), camera.width)
        self.packet_width = resolve_packet_width(packet_width)
        self.threads = resolve_threads(threads)
        self.plan_time_s = 0.0
        self.build_time_s = 0.0
        self._pool = WorkerPool(self.threads)
        direction = ray_axes(camera)[2].tolist() if camera.is_parallel else None
        self._workspaces = [
            Workspace(self.packet_width, coherent=True, direction=direction) for _ in range(self.threads)
        ]
        # Frames share the workspaces, and a scene must stay while it is traced.
        self._lock = threading.RLock()
        self._geometry: AlignedGeometry | None = None
        self._scene: EmbreeDevice | None = None
        self._tie_tiles: list[NDArray[np.bool_] | None] = []  # of each image: where to look for ties, if anywhere
        self._closed = False

    @abstractmethod
    def _plan_geometry(self) -> AlignedGeometry: ...

    @abstractmethod
    def _filter_address(self) -> int: ...

    @abstractmethod
    def _run(self, offset: tuple[float, float], depth: NDArray, prim_id: NDArray) -> None: ...

    @property
    def _row_stride(self) -> int:
        """Pixels from one row of the output to the next."""
        return self.camera.width

    @one_at_a_time
    def plan(self) -> None:
        """Prepare the geometry on the CPU: camera space, and for alignment culling and shear."""
        self._check_open()
        self._find_ties()
        start = perf_counter()
        self._plan_ties()
        self._geometry = self._plan_geometry()
        self.plan_time_s = perf_counter() - start

    @property
    def _views(self) -> tuple[tuple[Mesh, View], ...]:
        """What each image shows, and its camera."""
        return ((self.mesh, self.camera),)

    def _find_ties(self) -> None:
        """Once per mesh, like reading it, and so outside the clock of a plan."""
        if self.ties == "lowest":
            for mesh, _ in self._views:
                coplanar_overlaps(mesh)

    def _plan_ties(self) -> None:
        if self.ties == "lowest":
            tiles = [tie_tiles(mesh, camera) for mesh, camera in self._views]
            self._tie_tiles = [of_image if of_image.any() else None for of_image in tiles]

    def _settle_ties(self, offset: tuple[float, float], prim_id: NDArray[np.uint32]) -> None:
        """prim_id: (rows, W), image below image."""
        for image, tiles in enumerate(self._tie_tiles):
            if tiles is not None:
                mesh, camera = self._views[image]
                own_rows = prim_id[image * camera.height : (image + 1) * camera.height]
                lowest_of_ties(mesh, camera, tiles, offset, own_rows, self._pool)

    @one_at_a_time
    def build(self) -> None:
        """Build the BVH over what `plan` prepared (planning first if that was not done)."""
        self._check_open()
        if self._geometry is None:
            self.plan()
        geometry = self._geometry
        assert geometry is not None
        self._filter_address(), memory_monitor()  # compiled before the clock starts
        start = perf_counter()
        scene = self._build_scene(geometry)
        self.build_time_s = perf_counter() - start
        if self._scene is not None:
            self._scene.close()
        self._scene = scene

    def _build_scene(self, geometry: AlignedGeometry) -> EmbreeDevice:
        return EmbreeScene(
            geometry.vertices,
            geometry.faces,
            build_quality=self.build_quality,
            threads=self.threads,
            filter_address=self._filter_address(),
            user_data=geometry.records,
            monitor_address=memory_monitor(),
            transforms=geometry.transforms,
        )

    @property
    def _scene_address(self) -> int:
        """The one Embree scene, for kernels."""
        assert isinstance(self._scene, EmbreeScene)
        return self._scene.address

    def _trace_rows(
        self, offset: tuple[float, float], rows: int, out: tuple[NDArray[np.float32], NDArray[np.uint32]] | None
    ) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
        """Trace images of so many rows in all, one below the other; returns depth and prim_id, (rows, W) each.

        Raises InputError for an offset outside the pixel or an `out` that does not fit, EmbreeError when the tracer is
        not built or already closed.
        """
        check_offset(offset)
        with self._lock:
            if self._closed:
                raise EmbreeError("this tracer is closed and cannot trace any more; make a new one")
            if self._scene is None:
                raise EmbreeError("this tracer is not built yet; use it in a `with` block or call build() first")
            depth, prim_id = self._outputs(rows, out)
            for workspace in self._workspaces:
                workspace.set_row_bytes(depth.strides[0])
            self._run(offset, depth, prim_id)
            self._settle_ties(offset, prim_id)
            wrong = next((w.wrong_width for w in self._workspaces if w.wrong_width), 0)
        if wrong:
            raise EmbreeError(f"Embree handed the filter {wrong} rays instead of {self.packet_width}; hits were lost")
        return depth, prim_id

    def _outputs(
        self, rows: int, out: tuple[NDArray[np.float32], NDArray[np.uint32]] | None
    ) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
        shape, strides = (rows, self.camera.width), (4 * self._row_stride, 4)
        if out is None:
            return new_images(*shape, self._row_stride)
        # Rows of the right length in memory, not only in shape: packets may reach past the right border.
        for image, kind in zip(out, (np.float32, np.uint32), strict=True):
            if (image.dtype, image.shape, image.strides) != (kind, shape, strides) or not image.flags.writeable:
                given = f"{image.dtype} of {image.shape}, strides {image.strides}"
                raise InputError(
                    f"out has an image of {given}{'' if image.flags.writeable else ', read-only'}, expected "
                    f"{np.dtype(kind)} of {shape}, strides {strides}: pass a result of this tracer"
                )
        if np.may_share_memory(*out):
            raise InputError("out has one memory for depth and prim_id: pass a result of this tracer")
        return out

    @property
    def triangle_count(self) -> int:
        """Triangles in the Embree scene, copies included; 0 before `plan`."""
        return 0 if self._geometry is None else self._geometry.copy_count

    @property
    def embree_bytes(self) -> int:
        """Bytes Embree holds for this tracer by its own account; 0 before `build`."""
        return 0 if self._scene is None else self._scene.embree_bytes

    def _check_open(self) -> None:
        if self._closed:
            raise EmbreeError("this tracer is closed; make a new one")

    def close(self) -> None:
        """Release the Embree scene and the geometry; waits for a frame in progress. Closing twice is harmless."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
            self._pool.close()  # first, so that none of its threads is in a scene that goes
            if self._scene is not None:
                self._scene.close()
            self._geometry = None

    def _prepare(self) -> None:
        self.plan()
        self.build()


class ImageTracer(EmbreeTracer):
    """A tracer of one image."""

    def trace(self, offset: tuple[float, float] = (0.5, 0.5), out: Hits | None = None) -> Hits:
        """Trace one frame; all rays go through sub-pixel position `offset` of their pixels, in [0, 1) x [0, 1).

        out: an earlier result of this tracer whose arrays are to be overwritten, which saves allocating an image; it
        must not be read any more.
        Raises InputError for an offset outside the pixel or an `out` that does not fit, EmbreeError when the tracer is
        not built or already closed.
        """
        depth, prim_id = self._trace_rows(offset, self.camera.height, images_of(out))
        return Hits(depth, prim_id, offset, self.mesh, self.camera)


def images_of(out: Any) -> tuple[NDArray[np.float32], NDArray[np.uint32]] | None:
    """depth and prim_id of an earlier result; None of None. Raises InputError for what has no such arrays."""
    if out is None:
        return None
    images = getattr(out, "depth", None), getattr(out, "prim_id", None)
    if not all(isinstance(image, np.ndarray) for image in images):
        raise InputError(f"out is {out!r:.100}, expected a result of this tracer, or None")
    return images  # type: ignore[return-value]


def new_images(height: int, width: int, row_stride: int) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """Uninitialised depth and prim_id, (height, width) each, their rows `row_stride` pixels apart in memory."""
    shape = (height, row_stride)
    return np.empty(shape, np.float32)[:, :width], np.empty(shape, np.uint32)[:, :width]


def ray_grid(
    camera: View, columns: NDArray[np.floating], rows: NDArray[np.floating]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The two summands of ray directions in ray space, (3, columns) and (3, rows) float32; of origins where rays are
    parallel.

    columns, rows: positions on the image plane in pixels, measured from the view axis.
    """
    right, down, forward = ray_axes(camera)[:, :, None]
    column_rays = right * (columns * camera.pixel_pitch)
    row_rays = down * (rows * camera.pixel_pitch)
    if not camera.is_parallel:
        row_rays = row_rays + forward
    return column_rays.astype(np.float32), row_rays.astype(np.float32)


def image_ray_grid(
    camera: View, offset: tuple[float, float], packet_shape: tuple[int, int] = (1, 1)
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """`ray_grid` of every pixel of the image at sub-pixel `offset`, filled up to whole packets of `packet_shape`."""
    columns, rows = (
        np.arange(pixels + -pixels % lanes) - pixels / 2 + shift
        for pixels, lanes, shift in zip((camera.width, camera.height), packet_shape, offset, strict=True)
    )
    return ray_grid(camera, columns, rows)


def check_pinhole(camera: View, method: str) -> None:
    """Raise InputError for a camera with parallel rays, which `method` cannot trace."""
    if camera.is_parallel:
        raise InputError(
            f"{method} needs rays through one point, but those of {type(camera).__name__} are parallel; "
            "use AlignedTracer or PixelTracer"
        )
