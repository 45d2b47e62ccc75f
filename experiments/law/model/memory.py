"""Memory of what a method builds: arrays whose size follows from counts, and what Embree and shafts add to them.

Derivation: docs/model.md.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from experiments.law.model.choice import Choice
from experiments.law.model.copying import SMALLEST_SCENE
from experiments.law.model.looking import Look

VERTEX, FACE, RECORD, TRANSFORM = 12, 12, 8, 48
"""Bytes of three float32, three uint32, an int64, and 3 x 4 float32."""

COPY = 3 * VERTEX + FACE + RECORD
"""Bytes of a sheared copy: three corners of its own, its indices, its record."""

LEAST_SHAFTS = 1 << 16
"""Bytes that lists and look-up of shafts may take at least; above, as many as the BVH (`classification.shafts`)."""


def array_bytes(look: Look, choice: Choice) -> float:
    """Bytes of the arrays that a method keeps, and of our own BVH; the rasteriser's are what the look made."""
    copied = look.copied(choice.method, choice.split, choice.culling)
    mesh = float(VERTEX * (look.vertices + 1) + FACE * look.triangles)
    again = mesh if copied.left_out > 0.0 else 0.0
    if choice.method == "raster":
        return float(look.raster_bytes)
    if choice.method in ("bvh", "classified"):
        return look.bvh_bytes
    if choice.method == "pixel":
        return mesh
    if choice.method == "tiles":
        return VERTEX * look.vertices + (FACE + RECORD) * copied.copies
    if choice.method == "instanced":
        return mesh + (RECORD + TRANSFORM) * choice.cells + again
    if choice.method == "visible_first":
        return COPY * copied.copies + mesh
    if choice.method == "aligned":
        return COPY * copied.copies + again
    raise ValueError(f"method is {choice.method!r}, of which no arrays are known")


def byte_terms(look: Look, choice: Choice) -> NDArray[np.float64]:
    """Counts of what is kept beside the arrays: Embree's scenes that are not empty; triangles in scenes of more than
    `SMALLEST_SCENE`; triangles in the compact BVH of a second pass; triangles left out of copies; instances; bytes that
    shafts may take. 0 for what a method does not keep."""
    copied = look.copied(choice.method, choice.split, choice.culling)
    mesh = float(look.triangles)
    own = {"pixel": mesh, "instanced": mesh, "visible_first": copied.copies, "aligned": copied.copies}
    scenes, crowded = float(own.get(choice.method, 0.0) > 0.0), _crowded(own.get(choice.method, 0.0))
    if choice.method == "tiles":
        scenes, crowded = copied.occupied, copied.crowded
    compact = 0.0
    if choice.method == "visible_first":
        scenes, compact = scenes + 1.0, _crowded(mesh)
    instances = float(choice.cells) if choice.method == "instanced" else 0.0
    shafts = max(look.bvh_bytes, LEAST_SHAFTS) if choice.method == "classified" else 0.0
    return np.array([scenes + float(copied.left_out > 0.0), crowded, compact, copied.left_out, instances, shafts])


def _crowded(triangles: float) -> float:
    return triangles if triangles > SMALLEST_SCENE else 0.0
