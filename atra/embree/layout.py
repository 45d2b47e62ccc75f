"""Layouts of the Embree structs that compiled code reads and writes (Embree 4 API manual, `rtcore_ray.h`).

A packet RTCRayHitK is a structure of arrays: field after field, K 32-bit values each; a single ray is the case K = 1.
So a field of lane `k` sits at word `FIELD * K + k` of the packet (the one exception, K = 1, pads the ray to 48 bytes,
which these numbers already agree with: 12 words).
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
HIT_PRIM_ID, HIT_GEOM_ID, HIT_INST_ID, HIT_INST_PRIM_ID = 5, 6, 7, 8
HIT_WORDS = 9

PACKET_ALIGNMENT_BYTES = 64
INVALID_ID = 0xFFFFFFFF

AFTER_START = 2.0**-126
"""tnear of rays that do not hit what they start on. Embree's robust test of triangles takes a hit at tnear itself, its
fast one does not. This is the smallest number of float32 that is above 0 where numbers below 2^-126 count as 0, too."""

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
    """32-bit words of RTCRayHitK for K = `width`, its tail padding included."""
    words = (RAY_WORDS + HIT_WORDS) * width
    alignment_words = {1: 4, 4: 4, 8: 8, 16: 16}[width]
    return -(-words // alignment_words) * alignment_words


class Packet(NamedTuple):
    """One thread's query memory as kernels take it: a packet of K rays, and what goes to Embree with it.

    floats, ids: (words,) float32 and uint32 views of the same RTCRayHitK. all_lanes, valid: (K,) int32 lane masks, the
    first with every lane active. context: (words,) int64 of `RayQueryContext`. arguments_address: of
    RTCIntersectArguments (or RTCOccludedArguments, laid out alike).
    """

    floats: NDArray[np.float32]
    ids: NDArray[np.uint32]
    all_lanes: NDArray[np.int32]
    valid: NDArray[np.int32]
    context: NDArray[np.int64]
    arguments_address: int


class RayQueryContext(ctypes.Structure):
    """RTCRayQueryContext, extended with what our filters need; Embree hands it back to the filter untouched."""

    _fields_ = (
        ("inst_id", ctypes.c_uint32),
        ("inst_prim_id", ctypes.c_uint32),
        ("depth_address", ctypes.c_void_p),  # where lane 0's depth of the reference cell goes
        ("prim_id_address", ctypes.c_void_p),  # and its prim_id
        ("row_bytes", ctypes.c_int64),  # distance between image rows
        ("wrong_width", ctypes.c_int64),  # the filter writes N here if Embree ever hands it another packet width
        ("target_address", ctypes.c_void_p),  # block of addresses of what all hits are gathered into
        ("first_pixel", ctypes.c_int64),  # where lane 0 of the reference cell is in it
    )


class IntersectArguments(ctypes.Structure):
    """RTCIntersectArguments (min-width is off in the official build)."""

    _fields_ = (
        ("flags", ctypes.c_uint32),
        ("feature_mask", ctypes.c_uint32),
        ("context", ctypes.c_void_p),
        ("filter", ctypes.c_void_p),
        ("intersect", ctypes.c_void_p),
    )


class FilterArguments(ctypes.Structure):
    """RTCFilterFunctionNArguments: what a filter is given."""

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
