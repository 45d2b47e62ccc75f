"""What all tracers share: their protocol, lifetime, timing and buffers."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from time import perf_counter
from types import TracebackType
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from atra.camera import Camera, check_offset
from atra.culling import AlignedGeometry
from atra.embree.device import EmbreeDevice
from atra.embree.scene import EmbreeScene, check_build_quality, resolve_packet_width
from atra.embree.workspace import Workspace
from atra.errors import EmbreeError, InputError
from atra.hits import Hits
from atra.kernels.callbacks import memory_monitor
from atra.mesh import Mesh
from atra.parallel import WorkerPool, resolve_threads
from atra.ties import check_ties, lowest_of_ties, tie_tiles


class Tracer(Protocol):
    """What every method of tracing offers.

    `plan` and `build` are called once, in this order, by `with` or by hand; `trace` any number of times after them.
    plan_time_s, build_time_s: seconds each took. embree_bytes: what Embree holds by its own account, bytes.
    triangle_count: triangles in the Embree scene, copies included.
    """

    mesh: Mesh
    camera: Camera
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


class EmbreeTracer(ABC):
    """Lifetime, timing and buffers that the tracers share."""

    def __init__(
        self,
        mesh: Mesh,
        camera: Camera,
        packet_width: int | None,
        threads: int | None,
        build_quality: str,
        ties: str,
    ) -> None:
        check_build_quality(build_quality)
        check_ties(ties)
        self.mesh = mesh
        self.camera = camera
        self.build_quality = build_quality
        self.ties = ties
        self.packet_width = resolve_packet_width(packet_width)
        self.threads = resolve_threads(threads)
        self.plan_time_s = 0.0
        self.build_time_s = 0.0
        self._pool = WorkerPool(self.threads)
        self._workspaces = [Workspace(self.packet_width, coherent=True) for _ in range(self.threads)]
        self._lock = threading.Lock()  # one frame at a time: frames share the workspaces
        self._geometry: AlignedGeometry | None = None
        self._scene: EmbreeDevice | None = None
        self._tie_tiles: NDArray[np.bool_] | None = None  # where to look for ties, if anywhere
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

    def plan(self) -> None:
        """Prepare the geometry on the CPU: camera space, and for alignment culling and shear."""
        self._check_open()
        self._find_ties()
        start = perf_counter()
        self._plan_ties()
        self._geometry = self._plan_geometry()
        self.plan_time_s = perf_counter() - start

    def _find_ties(self) -> None:
        """Once per mesh, like reading it, and so outside the clock of a plan."""
        if self.ties == "lowest":
            self.mesh.coplanar_overlaps  # noqa: B018, kept by the mesh

    def _plan_ties(self) -> None:
        if self.ties == "lowest":
            tiles = tie_tiles(self.mesh, self.camera)
            self._tie_tiles = tiles if tiles.any() else None

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

    def trace(self, offset: tuple[float, float] = (0.5, 0.5), out: Hits | None = None) -> Hits:
        """Trace one frame; all rays go through sub-pixel position `offset` of their pixels, in [0, 1) x [0, 1).

        out: an earlier result of this tracer whose arrays are to be overwritten, which saves allocating an image; it
        must not be read any more.
        Raises InputError for an offset outside the pixel or an `out` that does not fit, EmbreeError when the tracer is
        not built or already closed.
        """
        check_offset(offset)
        with self._lock:
            if self._closed:
                raise EmbreeError("this tracer is closed and cannot trace any more; make a new one")
            if self._scene is None:
                raise EmbreeError("this tracer is not built yet; use it in a `with` block or call build() first")
            depth, prim_id = self._outputs(out)
            for workspace in self._workspaces:
                workspace.set_row_bytes(depth.strides[0])
            self._run(offset, depth, prim_id)
            if self._tie_tiles is not None:
                lowest_of_ties(self.mesh, self.camera, self._tie_tiles, offset, prim_id, self._pool)
            wrong = next((w.wrong_width for w in self._workspaces if w.wrong_width), 0)
        if wrong:
            raise EmbreeError(f"Embree handed the filter {wrong} rays instead of {self.packet_width}; hits were lost")
        return Hits(depth, prim_id, offset, self.mesh, self.camera)

    def _outputs(self, out: Hits | None) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
        shape, row_bytes = (self.camera.height, self.camera.width), 4 * self._row_stride
        if out is None:
            return new_images(*shape, self._row_stride)
        # Rows of the right length in memory, not only in shape: packets may reach past the right border.
        for image in (out.depth, out.prim_id):
            if image.shape != shape or image.strides != (row_bytes, 4):
                raise InputError(
                    f"out has images of {image.shape} with rows {image.strides[0]} bytes apart, expected {shape} with "
                    f"rows {row_bytes} bytes apart: pass a result of this tracer"
                )
        return out.depth, out.prim_id

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
            if self._scene is not None:
                self._scene.close()
            self._geometry = None
            self._pool.close()

    def __enter__(self) -> Self:
        try:
            self.plan()
            self.build()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def new_images(height: int, width: int, row_stride: int) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """Uninitialised depth and prim_id, (height, width) each, their rows `row_stride` pixels apart in memory."""
    shape = (height, row_stride)
    return np.empty(shape, np.float32)[:, :width], np.empty(shape, np.uint32)[:, :width]


def ray_directions(
    camera: Camera, columns: NDArray[np.floating], rows: NDArray[np.floating]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The two summands of ray directions in eye space, (3, columns) and (3, rows) float32.

    columns, rows: positions on the image plane in pixels, measured from the view axis.
    """
    right, down, forward = camera.axes[:, :, None]
    column_directions = right * (columns * camera.pixel_pitch)
    row_directions = down * (rows * camera.pixel_pitch) + forward
    return column_directions.astype(np.float32), row_directions.astype(np.float32)
