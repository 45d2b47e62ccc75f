"""Many small scenes over one vertex buffer, on one device and with one lifetime."""

from __future__ import annotations

import weakref

import numpy as np
from numpy.typing import NDArray

from atra.embree import layout
from atra.embree.library import Library, load_library
from atra.errors import EmbreeError


class EmbreeScenes:
    """Committed Embree scenes; scene k holds the triangles faces[starts[k]] ... faces[starts[k + 1] - 1].

    vertices, faces, build_quality, threads, monitor_address: as for `EmbreeScene`; all scenes share the vertices, and a
    hit's prim_id counts from the scene's first triangle. starts: (scenes + 1,) int64, ascending.
    handles: (scenes,) int64, the RTCScene of each for compiled code, 0 where it has no triangle.

    One device for all, so `embree_bytes` counts them all. Closing twice is harmless; scenes that are dropped without
    closing are released by the garbage collector. Raises EmbreeError naming the call that failed.
    """

    def __init__(
        self,
        vertices: NDArray[np.float32],
        faces: NDArray[np.uint32],
        starts: NDArray[np.int64],
        *,
        build_quality: str = "medium",
        threads: int = 1,
        monitor_address: int = 0,
    ) -> None:
        self._library = load_library()
        self._byte_count = np.zeros(1, np.int64)
        self.handles = np.zeros(len(starts) - 1, np.int64)
        api = self._library.functions
        device = api.rtcNewDevice(f"threads={threads}".encode())
        if not device:
            code = api.rtcGetDeviceError(None)
            raise EmbreeError(f"rtcNewDevice failed: {layout.ERROR_NAMES.get(code, code)}")
        # The arrays and the byte counter ride along, so that they outlive every Embree call.
        kept = (self._byte_count, vertices, faces)
        self._finalizer = weakref.finalize(self, _release, self._library, device, self.handles, kept)
        try:
            if monitor_address:
                counter = self._byte_count.ctypes.data
                self._call("rtcSetDeviceMemoryMonitorFunction", device, device, monitor_address, counter)
            quality = layout.BUILD_QUALITY[build_quality]
            for k in np.nonzero(np.diff(starts))[0]:
                self.handles[k] = scene = self._call("rtcNewScene", device, device)
                self._call("rtcSetSceneBuildQuality", device, scene, quality)
                self._add_triangles(device, scene, quality, vertices, faces, int(starts[k]), int(starts[k + 1]))
                self._call("rtcCommitScene", device, scene)
        except BaseException:
            self.close()
            raise

    def _add_triangles(
        self,
        device: int,
        scene: int,
        quality: int,
        vertices: NDArray[np.float32],
        faces: NDArray[np.uint32],
        start: int,
        end: int,
    ) -> None:
        geometry = self._call("rtcNewGeometry", device, device, layout.GEOMETRY_TRIANGLE)
        try:
            for buffer, kind, address, offset_bytes, count in (
                (layout.BUFFER_VERTEX, layout.FORMAT_FLOAT3, vertices.ctypes.data, 0, len(vertices)),
                (layout.BUFFER_INDEX, layout.FORMAT_UINT3, faces.ctypes.data, 12 * start, end - start),
            ):
                shared = (geometry, buffer, 0, kind, address, offset_bytes, 12, count)
                self._call("rtcSetSharedGeometryBuffer", device, *shared)
            self._call("rtcSetGeometryBuildQuality", device, geometry, quality)
            self._call("rtcCommitGeometry", device, geometry)
            self._call("rtcAttachGeometry", device, scene, geometry)
        finally:
            self._library.functions.rtcReleaseGeometry(geometry)

    def _call(self, name: str, device: int, *arguments: object) -> int:
        result = getattr(self._library.functions, name)(*arguments)
        code = self._library.functions.rtcGetDeviceError(device)
        if code:
            raise EmbreeError(f"{name} failed: {layout.ERROR_NAMES.get(code, code)}")
        return result

    @property
    def address(self) -> int:
        """Where `handles` lies in memory. Raises EmbreeError after `close`."""
        if self.closed:
            raise EmbreeError("these Embree scenes are closed and cannot be traced any more")
        return self.handles.ctypes.data

    @property
    def embree_bytes(self) -> int:
        """Bytes Embree holds for all scenes by its own account."""
        return int(self._byte_count[0])

    @property
    def closed(self) -> bool:
        return not self._finalizer.alive

    def close(self) -> None:
        """Release scenes and device; nothing may be tracing. Harmless when already closed."""
        self._finalizer()


def _release(library: Library, device: int, scenes: NDArray[np.int64], _alive: object) -> None:
    for scene in scenes[scenes != 0].tolist():
        library.functions.rtcReleaseScene(scene)
    library.functions.rtcReleaseDevice(device)
