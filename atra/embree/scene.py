"""Device, scenes and geometries with one lifetime: an `EmbreeScene` is built once, traced, closed once."""

from __future__ import annotations

import weakref
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from atra.embree import layout
from atra.embree.library import Library, load_library
from atra.errors import EmbreeError, InputError


class EmbreeScene:
    """A committed Embree scene of triangles, or of instances of them, and the device it lives on.

    vertices: (V, 3) float32 C-contiguous with at least 16 readable bytes after the last vertex (`padded_vertices`).
    faces: (F, 3) uint32 C-contiguous.
    filter_address: compiled RTCFilterFunctionN, or 0 for none; `user_data` is handed to it.
    transforms: (I, 3, 4) float32 C-contiguous: the triangles are put once into an inner scene, and the scene holds one
    instance of it per row-major affine transform, with `inst_id` 0 ... I - 1. The filter and `user_data` stay with the
    triangles; rays reach the filter transformed back into the triangles' space, with the ray parameter they have.
    threads: build threads. monitor_address: compiled RTCMemoryMonitorFunction counting into `embree_bytes`, or 0.

    The arrays are shared with Embree, not copied; the scene keeps them alive. Closing twice is harmless; a scene that
    is dropped without closing is released by the garbage collector. Raises EmbreeError naming the call that failed.
    """

    def __init__(
        self,
        vertices: NDArray[np.float32],
        faces: NDArray[np.uint32],
        *,
        build_quality: str = "medium",
        threads: int = 1,
        filter_address: int = 0,
        user_data: NDArray | None = None,
        monitor_address: int = 0,
        transforms: NDArray[np.float32] | None = None,
    ) -> None:
        self._library = load_library()
        self._byte_count = np.zeros(1, np.int64)
        self._shared = (vertices, faces, user_data)
        api = self._library.functions
        device = api.rtcNewDevice(f"threads={threads}".encode())
        if not device:
            code = api.rtcGetDeviceError(None)
            raise EmbreeError(f"rtcNewDevice failed: {layout.ERROR_NAMES.get(code, code)}")
        handles = [device]
        # The arrays and the byte counter ride along, so that they outlive every Embree call.
        self._finalizer = weakref.finalize(self, _release, self._library, handles, (self._byte_count, self._shared))
        try:
            if monitor_address:
                counter = self._byte_count.ctypes.data
                self._call("rtcSetDeviceMemoryMonitorFunction", device, device, monitor_address, counter)
            quality = layout.BUILD_QUALITY[build_quality]
            scene = self._new_scene(device, handles, quality)
            if len(faces):
                self._add_triangles(device, scene, quality, filter_address)
            self._call("rtcCommitScene", device, scene)
            if transforms is not None:
                triangles, scene = scene, self._new_scene(device, handles, quality)
                for inst_id, transform in enumerate(transforms):
                    self._add_instance(device, scene, triangles, transform, inst_id)
                self._call("rtcCommitScene", device, scene)
        except BaseException:
            self.close()
            raise
        self._scene = scene

    def _new_scene(self, device: int, handles: list[int], quality: int) -> int:
        scene = self._call("rtcNewScene", device, device)
        handles.append(scene)
        self._call("rtcSetSceneBuildQuality", device, scene, quality)
        return scene

    def _add_triangles(self, device: int, scene: int, quality: int, filter_address: int) -> None:
        vertices, faces, user_data = self._shared
        geometry = self._call("rtcNewGeometry", device, device, layout.GEOMETRY_TRIANGLE)
        try:
            for buffer, kind, array in (
                (layout.BUFFER_VERTEX, layout.FORMAT_FLOAT3, vertices),
                (layout.BUFFER_INDEX, layout.FORMAT_UINT3, faces),
            ):
                shared = (geometry, buffer, 0, kind, array.ctypes.data, 0, 12, len(array))
                self._call("rtcSetSharedGeometryBuffer", device, *shared)
            self._call("rtcSetGeometryBuildQuality", device, geometry, quality)
            if filter_address:
                self._call("rtcSetGeometryIntersectFilterFunction", device, geometry, filter_address)
            if user_data is not None:
                self._call("rtcSetGeometryUserData", device, geometry, user_data.ctypes.data)
            self._call("rtcCommitGeometry", device, geometry)
            self._call("rtcAttachGeometry", device, scene, geometry)
        finally:
            self._library.functions.rtcReleaseGeometry(geometry)

    def _add_instance(
        self, device: int, scene: int, instanced_scene: int, transform: NDArray[np.float32], inst_id: int
    ) -> None:
        geometry = self._call("rtcNewGeometry", device, device, layout.GEOMETRY_INSTANCE)
        try:
            self._call("rtcSetGeometryInstancedScene", device, geometry, instanced_scene)
            matrix = (geometry, 0, layout.FORMAT_FLOAT3X4_ROW_MAJOR, transform.ctypes.data)  # copied by Embree
            self._call("rtcSetGeometryTransform", device, *matrix)
            self._call("rtcCommitGeometry", device, geometry)
            self._call("rtcAttachGeometryByID", device, scene, geometry, inst_id)
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
        """The RTCScene handle for compiled code. Raises EmbreeError after `close`."""
        if self.closed:
            raise EmbreeError("this Embree scene is closed and cannot be traced any more")
        return self._scene

    @property
    def embree_bytes(self) -> int:
        """Bytes Embree holds for this device by its own account."""
        return int(self._byte_count[0])

    @property
    def closed(self) -> bool:
        return not self._finalizer.alive

    def close(self) -> None:
        """Release scene and device; nothing may be tracing. Harmless when already closed."""
        self._finalizer()

    def __enter__(self) -> EmbreeScene:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _release(library: Library, handles: list[int], _alive: object) -> None:
    """Newest first: the scene of instances before the scene they show, the device last."""
    device, *scenes = handles
    for scene in reversed(scenes):
        library.functions.rtcReleaseScene(scene)
    library.functions.rtcReleaseDevice(device)


def padded_vertices(count: int) -> NDArray[np.float32]:
    """Uninitialised (count, 3) float32 whose memory goes on for 16 zero bytes, as Embree's vertex loads need."""
    memory = np.empty(count * 3 + 4, np.float32)
    memory[count * 3 :] = 0.0
    return memory[: count * 3].reshape(count, 3)


def check_build_quality(build_quality: str) -> None:
    """Raise InputError for a build quality that Embree does not have."""
    if build_quality not in layout.BUILD_QUALITY:
        raise InputError(f"build_quality is {build_quality!r}, expected one of {', '.join(layout.BUILD_QUALITY)}")


def resolve_packet_width(packet_width: int | None) -> int:
    """The packet width to use: the widest native one for None, else the given one.

    Raises InputError for a width this machine does not support natively: Embree would split or pad such packets, and
    the filter would see other lanes than were sent.
    """
    native = load_library().native_packet_widths
    if packet_width is None:
        return native[-1]
    if packet_width not in native:
        raise InputError(f"packet_width is {packet_width!r}, this machine supports {', '.join(map(str, native))}")
    return packet_width
