"""Layouts of the Embree structs that compiled code reads and writes (Embree 4 API manual, `rtcore_ray.h`).

A packet RTCRayHitK is a structure of arrays: field after field, K values of 32 bits each; a single ray has K = 1. So a
field of lane k is word `FIELD * K + k` of the packet.
"""

from __future__ import annotations

import ctypes
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

# Word index of each field: RTCRayK, then RTCHitK directly behind it.
RAY_ORG_X, RAY_ORG_Y, RAY_ORG_Z, RAY_TNEAR = 0, 1, 2, 3
RAY_DIR_X, RAY_DIR_Y, RAY_DIR_Z, RAY_TIME = 4, 5, 6, 7
RAY_TFAR, RAY_MASK, RAY_ID, RAY_FLAGS = 8, 9, 10, 11
RAY_WORDS = 12
HIT_NG_X, HIT_NG_Y, HIT_NG_Z, HIT_U, HIT_V = 0, 1, 2, 3, 4
HIT_PRIM_ID, HIT_GEOM_ID, HIT_INST_ID = 5, 6, 7
HIT_WORDS = 9

PACKET_ALIGNMENT_BYTES = 64
INVALID_ID = 0xFFFFFFFF

AFTER_START = 2.0**-80
"""tnear of rays that do not hit what they start on, since Embree's robust test accepts a hit at tnear itself.

Below every distance at which a surface is seen: coordinates are rounded by more, in the smallest mesh that is allowed.
Far above the smallest float32: Embree multiplies tnear by twice a triangle's area, and a product that is denormal costs
some processors a hundred cycles.
"""

FLAG_FILTER_IN_ARGUMENTS, FLAG_COHERENT = 1 << 1, 1 << 16
FEATURE_ALL = 0xFFFFFFFF

ERROR_NAMES = {
    1: "unknown error",
    2: "invalid argument",
    3: "invalid operation",
    4: "out of memory",
    5: "unsupported CPU",
    6: "cancelled",
}

DEVICE_VERSION = 0
DEVICE_NATIVE_RAY = {4: 32, 8: 33, 16: 34}
DEVICE_FILTER_FUNCTION = 66

FORMAT_UINT3 = 0x5003
FORMAT_FLOAT3 = 0x9003
FORMAT_FLOAT3X4_ROW_MAJOR = 0x9134
BUFFER_INDEX, BUFFER_VERTEX = 0, 1
GEOMETRY_TRIANGLE, GEOMETRY_INSTANCE = 0, 121
SCENE_FLAG_COMPACT, SCENE_FLAG_ROBUST, SCENE_FLAG_FILTER_IN_ARGUMENTS = 1 << 1, 1 << 2, 1 << 3
BUILD_QUALITY = {"low": 0, "medium": 1, "high": 2}


def packet_words(width: int) -> int:
    """32-bit words of RTCRayHitK for K = `width`, with the padding at its end."""
    words = (RAY_WORDS + HIT_WORDS) * width
    alignment_words = {1: 4, 4: 4, 8: 8, 16: 16}[width]
    return -(-words // alignment_words) * alignment_words


class Packet(NamedTuple):
    """The memory for one thread's queries, as kernels take it: a packet of K rays and the arguments of a query.

    floats, ids: (words,) float32 and uint32 views of the same RTCRayHitK. all_lanes, valid: (K,) int32 lane masks;
    all_lanes has every lane active. context: (words,) int64, the `RayQueryContext`. arguments_address: address of
    RTCIntersectArguments, which is laid out like RTCOccludedArguments.
    """

    floats: NDArray[np.float32]
    ids: NDArray[np.uint32]
    all_lanes: NDArray[np.int32]
    valid: NDArray[np.int32]
    context: NDArray[np.int64]
    arguments_address: int


class RayQueryContext(ctypes.Structure):
    """RTCRayQueryContext, extended by what our filters need; Embree passes it on to the filter."""

    _fields_ = (
        ("inst_id", ctypes.c_uint32),
        ("inst_prim_id", ctypes.c_uint32),
        ("depth_address", ctypes.c_void_p),  # of the depth of lane 0 in the reference cell
        ("prim_id_address", ctypes.c_void_p),  # of its prim_id
        ("row_bytes", ctypes.c_int64),  # distance between image rows
        ("wrong_width", ctypes.c_int64),  # packet width that the filter was given instead of the one sent
        ("target_address", ctypes.c_void_p),  # of the `Target` that all hits are gathered into
        ("first_pixel", ctypes.c_int64),  # pixel of lane 0 there
    )


class IntersectArguments(ctypes.Structure):
    """Embree's RTCIntersectArguments; the official build has no field for the minimum width."""

    _fields_ = (
        ("flags", ctypes.c_uint32),
        ("feature_mask", ctypes.c_uint32),
        ("context", ctypes.c_void_p),
        ("filter", ctypes.c_void_p),
        ("intersect", ctypes.c_void_p),
    )


class FilterArguments(ctypes.Structure):
    """Embree's RTCFilterFunctionNArguments: the arguments of a filter."""

    _fields_ = (
        ("valid", ctypes.c_void_p),
        ("user_data", ctypes.c_void_p),  # geometryUserPtr
        ("context", ctypes.c_void_p),
        ("ray", ctypes.c_void_p),
        ("hit", ctypes.c_void_p),
        ("ray_count", ctypes.c_uint32),  # N
    )


CONTEXT_BYTES = ctypes.sizeof(RayQueryContext)
ARGUMENTS_BYTES = ctypes.sizeof(IntersectArguments)
