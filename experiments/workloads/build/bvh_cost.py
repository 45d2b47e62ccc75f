"""The surface area cost of a BVH: how many boxes a random ray enters, and how many triangles it is tested with.

Embree does not show the BVH of a scene, but its builder can build one from the same boxes and report every node.
Source: Embree 4 API manual, `rtcBuildBVH`; J. Goldsmith, J. Salmon, 1987.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.embree import layout
from atra.embree.device import EmbreeDevice, building
from atra.tracing.geometry import AlignedGeometry

_SIZE, _POINTER, _WORD = ctypes.c_size_t, ctypes.c_void_p, ctypes.c_uint32

_CREATE_NODE = ctypes.CFUNCTYPE(_SIZE, _POINTER, _WORD, _POINTER)
_SET_CHILDREN = ctypes.CFUNCTYPE(None, _SIZE, ctypes.POINTER(_SIZE), _WORD, _POINTER)
_SET_BOUNDS = ctypes.CFUNCTYPE(None, _SIZE, ctypes.POINTER(ctypes.POINTER(ctypes.c_float * 8)), _WORD, _POINTER)
_CREATE_LEAF = ctypes.CFUNCTYPE(_SIZE, _POINTER, _POINTER, _SIZE, _POINTER)

_LEAF = 4
"""Most triangles in a leaf."""


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
    root_area = _half_area([*boxes[:, :4].min(axis=0).tolist(), *boxes[:, 4:].max(axis=0).tolist()])
    nodes = _Nodes()
    with _Builder(build_quality=build_quality) as builder:
        root = builder.build(
            BuildArguments(
                byte_size=ctypes.sizeof(BuildArguments),
                # High quality splits triangles, which needs one more callback.
                quality=min(layout.BUILD_QUALITY[build_quality], layout.BUILD_QUALITY["medium"]),
                max_branching_factor=children,
                max_depth=48,
                sah_block_size=4,
                min_leaf_size=1,
                max_leaf_size=_LEAF,
                traversal_cost=1.0,
                intersection_cost=1.0,
                primitives=boxes.ctypes.data,
                primitive_count=len(boxes),
                primitive_capacity=len(boxes),
                **{name: ctypes.cast(function, _POINTER) for name, function in nodes.functions.items()},
            )
        )
    in_root = root if root <= _LEAF else 0
    return BvhCost(nodes.boxes / root_area, nodes.triangles / root_area + in_root)


def _half_area(box: Sequence[float]) -> float:
    """Half the surface of a box: lower corner, a word, upper corner, a word."""
    x, y, z = box[4] - box[0], box[5] - box[1], box[6] - box[2]
    return x * y + y * z + z * x


class _Nodes:
    """What Embree's builder tells of its nodes. A leaf is called by its number of triangles, a node by a larger number.

    boxes, triangles: sums of the half areas of all children, and of those of leaves times their triangles.
    """

    def __init__(self) -> None:
        self.boxes, self.triangles = 0.0, 0.0
        self._areas: dict[int, list[float]] = {}
        self._children: dict[int, list[int]] = {}
        self._lock, self._numbers = Lock(), count(_LEAF + 1)
        self.functions = {
            "create_node": _CREATE_NODE(lambda allocator, children, _: next(self._numbers)),
            "set_node_children": _SET_CHILDREN(self._set_children),
            "set_node_bounds": _SET_BOUNDS(self._set_bounds),
            "create_leaf": _CREATE_LEAF(lambda allocator, primitives, triangles, _: triangles),
        }

    def _set_children(self, node: int, children: Any, count: int, _: Any) -> None:
        self._children[node] = children[:count]
        self._sum(node)

    def _set_bounds(self, node: int, bounds: Any, count: int, _: Any) -> None:
        self._areas[node] = [_half_area(bounds[child].contents) for child in range(count)]
        self._sum(node)

    def _sum(self, node: int) -> None:
        """Add what is known of a node, once both are: quality decides which of them Embree tells first."""
        with self._lock:  # another device may let Embree build in two threads
            if node in self._areas and node in self._children:
                for area, child in zip(self._areas.pop(node), self._children.pop(node), strict=True):
                    self.boxes += area
                    self.triangles += area * child if child <= _LEAF else 0.0


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
    def build(self, arguments: BuildArguments) -> int:
        """Build a BVH and throw it away; what its root is called."""
        arguments.bvh = bvh = self._call("rtcNewBVH", self._device)
        try:
            with building(self._library, self._threads):
                return self._call("rtcBuildBVH", ctypes.byref(arguments))
        finally:
            self._call("rtcReleaseBVH", bvh)
