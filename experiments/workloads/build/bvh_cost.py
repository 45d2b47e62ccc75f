"""The surface area cost of a BVH: how many boxes a random ray enters, and how many triangles it is tested with.

Embree does not show the BVH of a scene, but its builder can build one from the same boxes and report every node.
Source: Embree 4 API manual, `rtcBuildBVH`; J. Goldsmith, J. Salmon, 1987.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.embree import layout
from atra.embree.device import EmbreeDevice, building
from atra.tracing.geometry import AlignedGeometry
from experiments.workloads.build.builder_kernels import COST_WORDS, builder_callbacks

_SIZE, _POINTER, _WORD = ctypes.c_size_t, ctypes.c_void_p, ctypes.c_uint32


class BuildArguments(ctypes.Structure):
    """Embree's RTCBuildArguments."""

    _fields_ = (
        ("byte_size", _SIZE),
        *((name, _WORD) for name in ("quality", "flags", "max_branching_factor", "max_depth")),
        *((name, _WORD) for name in ("sah_block_size", "min_leaf_size", "max_leaf_size")),
        *((name, ctypes.c_float) for name in ("traversal_cost", "intersection_cost")),
        *((name, _POINTER) for name in ("bvh", "primitives")),
        *((name, _SIZE) for name in ("primitive_count", "primitive_capacity")),
        *((name, _POINTER) for name in ("create_node", "set_node_children", "set_node_bounds", "create_leaf")),
        *((name, _POINTER) for name in ("split_primitive", "build_progress", "user_data")),
    )


@dataclass(frozen=True)
class BvhCost:
    """Means over random lines that meet the root's box.

    boxes_entered: boxes of nodes and leaves, without the root. triangles_tested: triangles in the leaves entered.
    """

    boxes_entered: float
    triangles_tested: float


def bvh_cost(
    vertices: NDArray[np.float32], faces: NDArray[np.uint32], build_quality: str = "medium", children: int = 8
) -> BvhCost:
    """The cost of the BVH that Embree builds of triangles, with up to `children` a node and four triangles a leaf.

    vertices: (V, 3) float32. faces: (F, 3) uint32; the cost of no faces is 0. build_quality: "low" or "medium"; "high",
    which splits triangles, counts as medium. Raises EmbreeError naming the call that failed.
    """
    if not len(faces):
        return BvhCost(0.0, 0.0)
    corners = vertices[faces]
    boxes = np.zeros((len(faces), 8), np.float32)  # RTCBuildPrimitive: lower corner, geomID, upper corner, primID
    boxes[:, :3], boxes[:, 4:7] = corners.min(axis=1), corners.max(axis=1)
    x, y, z = boxes[:, 4:7].max(axis=0).astype(np.float64) - boxes[:, :3].min(axis=0)
    root_area = float(x * y + y * z + z * x)
    cost = np.zeros(COST_WORDS, np.float64)
    create_node, set_node_children, set_node_bounds, create_leaf = builder_callbacks()
    with _Builder(build_quality=build_quality) as builder:
        builder.build(
            BuildArguments(
                byte_size=ctypes.sizeof(BuildArguments),
                # High quality splits triangles, which needs one more callback.
                quality=min(layout.BUILD_QUALITY[build_quality], layout.BUILD_QUALITY["medium"]),
                max_branching_factor=children,
                max_depth=48,
                sah_block_size=4,
                min_leaf_size=1,
                max_leaf_size=4,
                traversal_cost=1.0,
                intersection_cost=1.0,
                primitives=boxes.ctypes.data,
                primitive_count=len(boxes),
                primitive_capacity=len(boxes),
                create_node=create_node,
                set_node_children=set_node_children,
                set_node_bounds=set_node_bounds,
                create_leaf=create_leaf,
                user_data=cost.ctypes.data,
            )
        )
    return BvhCost(*(float(area) / root_area for area in cost))


def cost_of(tracer: Any, build_quality: str) -> BvhCost | None:
    """BVH quality: the expected traversal cost of the triangles that a built tracer gave to Embree.

    None for instances, which are no triangles, and where there is no Embree of ours.

    Takes as long as another build, on one thread. Raises EmbreeError.
    """
    geometry = getattr(getattr(tracer, "prepared", None), "geometry", None)
    if not isinstance(geometry, AlignedGeometry) or geometry.transforms is not None:
        return None
    return bvh_cost(geometry.vertices, geometry.faces, build_quality)


class _Builder(EmbreeDevice):
    def build(self, arguments: BuildArguments) -> None:
        arguments.bvh = bvh = self._call("rtcNewBVH", self._device)
        try:
            with building(self._library, self._threads):
                self._call("rtcBuildBVH", ctypes.byref(arguments))
        finally:
            self._call("rtcReleaseBVH", bvh)
