"""An Embree device and its scenes, which share one lifetime."""

from __future__ import annotations

import weakref
from typing import Self

import numpy as np
from numpy.typing import NDArray

from atra.embree import layout
from atra.embree.building import building
from atra.embree.library import Library, device_options, load_library
from atra.errors import EmbreeError


class EmbreeDevice:
    """An Embree device with the scenes made on it.

    build_quality: "low", "medium" or "high", for every scene and geometry. threads: build threads.
    monitor_address: compiled RTCMemoryMonitorFunction that counts into `embree_bytes`, or 0.
    compact: scenes save memory and trace more slowly. robust: no ray slips through between two triangles.
    filter_in_arguments: queries may bring a filter of their own.

    Embree shares the arrays it is given, and the device keeps them alive. `close` may be called twice; the garbage
    collector closes a device that is dropped. Raises EmbreeError naming the call that failed.
    """

    def __init__(
        self,
        *,
        build_quality: str = "medium",
        threads: int = 1,
        monitor_address: int = 0,
        compact: bool = False,
        robust: bool = False,
        filter_in_arguments: bool = False,
    ) -> None:
        self._library = load_library()
        self._quality = layout.BUILD_QUALITY[build_quality]
        self._flags = compact * layout.SCENE_FLAG_COMPACT | robust * layout.SCENE_FLAG_ROBUST
        self._flags |= filter_in_arguments * layout.SCENE_FLAG_FILTER_IN_ARGUMENTS
        self._byte_count = np.zeros(1, np.int64)
        self._threads = threads
        api = self._library.functions
        self._device = api.rtcNewDevice(device_options(threads))
        if not self._device:
            code = api.rtcGetDeviceError(None)
            raise EmbreeError(f"rtcNewDevice failed: {layout.ERROR_NAMES.get(code, code)}")
        self._scenes: list[int] = []
        # The finalizer holds what Embree reads and writes, so that it outlives every Embree call.
        self._kept: list[object] = [self._byte_count]
        self._finalizer = weakref.finalize(self, _release, self._library, self._device, self._scenes, self._kept)
        self._finalizer.atexit = False  # at exit a daemon thread may still be tracing
        if monitor_address:
            counter = self._byte_count.ctypes.data
            self._call("rtcSetDeviceMemoryMonitorFunction", self._device, monitor_address, counter)

    def _new_scene(self) -> int:
        scene = self._call("rtcNewScene", self._device)
        self._scenes.append(scene)
        self._call("rtcSetSceneBuildQuality", scene, self._quality)
        if self._flags:
            self._call("rtcSetSceneFlags", scene, self._flags)
        return scene

    def _add_triangles(
        self,
        scene: int,
        vertices: NDArray[np.float32],
        faces: NDArray[np.uint32],
        *,
        filter_address: int = 0,
        user_data: NDArray | None = None,
    ) -> None:
        """Add triangles to a scene; arrays as for `EmbreeScene`."""
        self._kept.append((vertices, faces, user_data))
        geometry = self._call("rtcNewGeometry", self._device, layout.GEOMETRY_TRIANGLE)
        try:
            for buffer, kind, array in (
                (layout.BUFFER_VERTEX, layout.FORMAT_FLOAT3, vertices),
                (layout.BUFFER_INDEX, layout.FORMAT_UINT3, faces),
            ):
                shared = (geometry, buffer, 0, kind, array.ctypes.data, 0, 12, len(array))
                self._call("rtcSetSharedGeometryBuffer", *shared)
            self._call("rtcSetGeometryBuildQuality", geometry, self._quality)
            if filter_address:
                self._call("rtcSetGeometryIntersectFilterFunction", geometry, filter_address)
            if user_data is not None:
                self._call("rtcSetGeometryUserData", geometry, user_data.ctypes.data)
            self._call("rtcCommitGeometry", geometry)
            self._call("rtcAttachGeometry", scene, geometry)
        finally:
            self._library.functions.rtcReleaseGeometry(geometry)

    def _add_instance(self, scene: int, instanced_scene: int, transform: NDArray[np.float32], inst_id: int) -> None:
        """Add an instance of a scene to another; transform: (3, 4) float32 C-contiguous, which Embree copies."""
        geometry = self._call("rtcNewGeometry", self._device, layout.GEOMETRY_INSTANCE)
        try:
            self._call("rtcSetGeometryInstancedScene", geometry, instanced_scene)
            matrix = (geometry, 0, layout.FORMAT_FLOAT3X4_ROW_MAJOR, transform.ctypes.data)
            self._call("rtcSetGeometryTransform", *matrix)
            self._call("rtcCommitGeometry", geometry)
            self._call("rtcAttachGeometryByID", scene, geometry, inst_id)
        finally:
            self._library.functions.rtcReleaseGeometry(geometry)

    def _build(self, scene: int) -> None:
        """Build the BVH of a scene, or build it again after a change."""
        with building(self._library, self._threads):
            self._call("rtcCommitScene", scene)

    def _call(self, name: str, *arguments: object) -> int:
        result = getattr(self._library.functions, name)(*arguments)
        code = self._library.functions.rtcGetDeviceError(self._device)
        if code:
            raise EmbreeError(f"{name} failed: {layout.ERROR_NAMES.get(code, code)}")
        return result

    @property
    def embree_bytes(self) -> int:
        """Bytes that Embree holds for this device, as it reports them."""
        return int(self._byte_count[0])

    @property
    def closed(self) -> bool:
        return not self._finalizer.alive

    def close(self) -> None:
        """Release scenes and device; no query may be running."""
        self._finalizer()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _release(library: Library, device: int, scenes: list[int], kept: list[object]) -> None:
    """Release the newest scene first (instances before what they show), then the device, then the arrays it reads."""
    for scene in reversed(scenes):
        library.functions.rtcReleaseScene(scene)
    library.functions.rtcReleaseDevice(device)
    kept.clear()
