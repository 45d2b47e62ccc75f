"""The check of `layout` against a loaded library: a known triangle is traced and every field read back.

Compiled code addresses the fields of Embree's structs by word. With a library of another layout it would not fail but
return wrong images, so the check runs once per process before anything relies on the layout.
"""

from __future__ import annotations

import ctypes
from math import isclose
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.embree import layout
from atra.embree.layout import FilterArguments
from atra.embree.workspace import Workspace
from atra.errors import EmbreeError

# Three corners, and four floats more because Embree reads 16 bytes per vertex. The triangle fills the view along +z
# from the origin; it is slanted so that all fields of a hit differ. Primitive 0 has no area.
_VERTICES = np.array([-6, -7, 4, 9, -5, 5, -2, 8, 7, 0, 0, 0, 0], np.float32)
_FACES = np.array([[0, 0, 0], [0, 1, 2]], np.uint32)
_PRIM_ID, _GEOM_ID, _INST_ID = 1, 3, 5
SENT_USER_DATA = 0x1234560

_TOLERANCE = 1e-5

_RAY_FIELDS = {
    "org_x": layout.RAY_ORG_X, "org_y": layout.RAY_ORG_Y, "org_z": layout.RAY_ORG_Z, "tnear": layout.RAY_TNEAR,
    "dir_x": layout.RAY_DIR_X, "dir_y": layout.RAY_DIR_Y, "dir_z": layout.RAY_DIR_Z, "time": layout.RAY_TIME,
    "tfar": layout.RAY_TFAR, "mask": layout.RAY_MASK, "id": layout.RAY_ID, "flags": layout.RAY_FLAGS,
}  # fmt: skip
_HIT_FIELDS = {
    "Ng_x": layout.HIT_NG_X, "Ng_y": layout.HIT_NG_Y, "Ng_z": layout.HIT_NG_Z, "u": layout.HIT_U, "v": layout.HIT_V,
    "prim_id": layout.HIT_PRIM_ID, "geom_id": layout.HIT_GEOM_ID, "inst_id": layout.HIT_INST_ID,
}  # fmt: skip
_WORDS = _RAY_FIELDS | {field: layout.RAY_WORDS + word for field, word in _HIT_FIELDS.items()}
_WHOLE_NUMBERS = ("mask", "id", "flags", "prim_id", "geom_id", "inst_id")

FILTER_FUNCTION = ctypes.CFUNCTYPE(None, ctypes.c_void_p)


def check_layouts(functions: Any, device: int, widths: tuple[int, ...]) -> None:
    """Trace the known triangle with packets of each of `widths` and compare all that comes back.

    functions: the library, its signatures declared. Raises EmbreeError naming the first field of the packet, the
    filter's arguments or the query context that is not where `layout` has it.
    """
    calls: list[dict[str, Any]] = []
    filter_function = FILTER_FUNCTION(lambda address: calls.append(_read_filter_arguments(address, max(widths))))
    scene = _new_scene(functions, device, filter_function)
    try:
        for width in widths:
            for signs_differ in (False, True):
                for coherent in (False, True):
                    calls.clear()
                    own, sent, hits = _sent(width, signs_differ, coherent)
                    _query(f"rtcIntersect{width}", functions, scene, own)
                    hit = _known_hit(sent) | {"prim_id": _PRIM_ID, "geom_id": _GEOM_ID, "inst_id": _INST_ID}
                    _check_packet(own, width, sent, hit, hits)
                    if coherent:  # the library traces with filters coherently only
                        _check_calls(own, width, hit, hits, calls)
                    own, sent, hits = _sent(width, signs_differ, coherent)
                    _query(f"rtcOccluded{width}", functions, scene, own)
                    _check_occluded(own, width, sent, hits)
    finally:
        functions.rtcReleaseScene(scene)


def _new_scene(functions: Any, device: int, filter_function: Any) -> int:
    """A scene with one instance, _INST_ID, of a scene whose geometry _GEOM_ID is the triangles."""
    inner, outer = functions.rtcNewScene(device), functions.rtcNewScene(device)
    triangles = functions.rtcNewGeometry(device, layout.GEOMETRY_TRIANGLE)
    for buffer, kind, array, count in (
        (layout.BUFFER_VERTEX, layout.FORMAT_FLOAT3, _VERTICES, 3),
        (layout.BUFFER_INDEX, layout.FORMAT_UINT3, _FACES, len(_FACES)),
    ):
        functions.rtcSetSharedGeometryBuffer(triangles, buffer, 0, kind, array.ctypes.data, 0, 12, count)
    functions.rtcSetGeometryIntersectFilterFunction(triangles, ctypes.cast(filter_function, ctypes.c_void_p).value)
    functions.rtcSetGeometryUserData(triangles, SENT_USER_DATA)
    instance = functions.rtcNewGeometry(device, layout.GEOMETRY_INSTANCE)
    functions.rtcSetGeometryInstancedScene(instance, inner)
    for scene, geometry, geom_id in ((inner, triangles, _GEOM_ID), (outer, instance, _INST_ID)):
        functions.rtcCommitGeometry(geometry)
        functions.rtcAttachGeometryByID(scene, geometry, geom_id)
        functions.rtcReleaseGeometry(geometry)
        functions.rtcCommitScene(scene)
    functions.rtcReleaseScene(inner)  # the instance holds it
    code = functions.rtcGetDeviceError(device)
    if code:
        functions.rtcReleaseScene(outer)
        raise EmbreeError(f"a scene of one triangle cannot be built: {layout.ERROR_NAMES.get(code, code)}")
    return outer


def _sent(width: int, signs_differ: bool, coherent: bool) -> tuple[Workspace, dict[str, NDArray], NDArray[np.bool_]]:
    """A workspace with a packet to trace, its ray fields, and a mask of the lanes that hit the triangle.

    The second ray misses, the last one of a packet is switched off, the others hit. signs_differ: the signs of dir_y
    differ among lanes, so that Embree may split the packet.
    """
    own = Workspace(width, coherent=coherent)
    lanes = np.arange(width)
    inactive, passing = (lanes == width - 1) & (width > 1), lanes == 1
    own.packet.valid[:width][inactive] = 0
    sign = np.where(lanes % 3 == 0, -1.0, 1.0) if signs_differ else -1.0
    values = {
        "org_x": 0.11, "org_y": 0.13 + 0.01 * lanes, "org_z": -0.17, "tnear": 0.19,
        "dir_x": 0.1 + 0.01 * lanes + 9.0 * passing, "dir_y": sign * (0.2 + 0.003 * lanes), "dir_z": 1.0 - 0.01 * lanes,
        "time": 0.23, "tfar": np.inf, "mask": layout.INVALID_ID, "id": 7 + lanes, "flags": 0,
    }  # fmt: skip
    sent = {field: np.broadcast_to(value, width) for field, value in values.items()}
    for field, value in sent.items():
        _field(own.packet.floats, field, width)[:] = value
    return own, sent, ~inactive & ~passing


def _query(name: str, functions: Any, scene: int, own: Workspace) -> None:
    lanes = () if name.endswith(("Intersect1", "Occluded1")) else (own.packet.valid.ctypes.data,)
    getattr(functions, name)(*lanes, scene, own.packet.floats.ctypes.data, own.packet.arguments_address)


def _check_packet(
    own: Workspace, width: int, sent: dict[str, NDArray], hit: dict[str, Any], hits: NDArray[np.bool_]
) -> None:
    """Check that only tfar and the hit have changed, and only in the lanes that hit."""
    where = "the packet" if width > 1 else "the ray"
    for field in _RAY_FIELDS:
        expected = np.where(hits, hit["tfar"], np.inf) if field == "tfar" else sent[field]
        _check(where, width, field, _field(own.packet.floats, field, width), expected)
    for field in _HIT_FIELDS:
        _check(
            where, width, field, _field(own.packet.floats, field, width)[hits], np.broadcast_to(hit[field], width)[hits]
        )
    for field in ("prim_id", "geom_id"):
        _check(where, width, field, _field(own.packet.floats, field, width)[~hits], layout.INVALID_ID)
    _check("the query context", width, "instID", own.packet.context.view(np.uint32)[0], layout.INVALID_ID)


def _check_occluded(own: Workspace, width: int, sent: dict[str, NDArray], hits: NDArray[np.bool_]) -> None:
    """Check that tfar is negative just where an active ray hits, and that fields which kernels set only once stay."""
    where, active = f"what rtcOccluded{width} returns", own.packet.valid[:width] != 0
    _check(where, width, "tfar < 0", (_field(own.packet.floats, "tfar", width) < 0.0)[active], hits[active])
    for field in ("time", "mask", "id", "flags"):
        _check(where, width, field, _field(own.packet.floats, field, width), sent[field])


def _check_calls(
    own: Workspace, width: int, hit: dict[str, Any], hits: NDArray[np.bool_], calls: list[dict[str, Any]]
) -> None:
    """Check what compiled filters rely on: every call has all lanes in their places and is of one triangle of one
    instance, which lane 0 names even if it is not active; every hit comes in one call."""
    where = "what the filter is given"
    for seen in calls:
        _check(where, width, "N", seen["N"], width)
        _check(where, width, "geometryUserPtr", seen["user_data"], SENT_USER_DATA)
        _check(where, width, "context", seen["context"], own.packet.context.ctypes.data)
    told = sum((seen["valid"] != 0 for seen in calls), np.zeros(width, np.int64))
    _check("all calls of the filter", width, "valid", told, hits)
    for seen in calls:
        valid = seen["valid"] != 0
        _check(where, width, "tfar", _field(seen["ray"], "tfar", width)[valid], hit["tfar"][valid])
        for field in ("prim_id", "inst_id"):
            _check(where, width, field, _field(seen["hit"], field, width, layout.RAY_WORDS)[0], hit[field])


def _known_hit(sent: dict[str, NDArray]) -> dict[str, Any]:
    """tfar and the fields of the hits, float64, from the definition of t, u and v."""
    first, second, third = _VERTICES[:9].reshape(3, 3).astype(np.float64)
    along_u, along_v = second - first, third - first
    origins, directions = (np.stack([sent[f"{name}_{axis}"] for axis in "xyz"], axis=1) for name in ("org", "dir"))
    edges = np.broadcast_to([-along_u, -along_v], (len(directions), 2, 3))
    # origin + t direction = first + u along_u + v along_v
    unknowns = np.linalg.solve(
        np.concatenate([directions[:, None], edges], axis=1).transpose(0, 2, 1), (first - origins)[:, :, None]
    )
    t, u, v = unknowns[..., 0].T
    normal = np.cross(along_u, along_v)
    return {"tfar": t, "u": u, "v": v, "Ng_x": normal[0], "Ng_y": normal[1], "Ng_z": normal[2]}


def _read_filter_arguments(address: int, largest_width: int) -> dict[str, Any]:
    """A copy of all arguments of a filter, which are gone when it returns."""
    arguments = FilterArguments.from_address(address)
    width = arguments.ray_count
    seen: dict[str, Any] = {"N": width, "user_data": arguments.user_data, "context": arguments.context}
    if 1 <= width <= largest_width:
        for name, kind, count in (
            ("valid", ctypes.c_int32, width),
            ("ray", ctypes.c_float, layout.RAY_WORDS * width),
            ("hit", ctypes.c_float, layout.HIT_WORDS * width),
        ):
            seen[name] = np.array((kind * count).from_address(getattr(arguments, name)))
    return seen


def _field(words: NDArray[np.float32], field: str, width: int, first_word: int = 0) -> NDArray:
    """A view of all lanes of a field of the ray or the hit; first_word: the word of a packet that `words` starts at."""
    first = (_WORDS[field] - first_word) * width
    lanes = words[first : first + width]
    return lanes.view(np.uint32) if field in _WHOLE_NUMBERS else lanes


def _check(where: str, width: int, field: str, found: Any, expected: Any) -> None:
    lanes, wanted = (np.ravel(values).tolist() for values in np.broadcast_arrays(found, expected))
    tolerance = _TOLERANCE if np.asarray(found).dtype.kind == "f" else 0.0
    if not all(isclose(a, b, rel_tol=tolerance, abs_tol=tolerance) for a, b in zip(lanes, wanted, strict=True)):
        raise EmbreeError(
            f"{field} of {where} is {lanes} for {width} rays, expected {wanted}: "
            "its structs are laid out otherwise than Embree 4.4's"
        )
