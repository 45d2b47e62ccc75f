"""The shape of a shaft: the planes around its rays, and the boxes that it meets."""

from __future__ import annotations

import numpy as np

from atra.compiled.intrinsics import float_at
from atra.compiled.store import njit
from experiments.classification.bvh.binary import NODE_BYTES

LOW, HIGH, AXIS, SIGN, U0, U1, V0, V1, NEAR, FAR, ABOVE_U, BELOW_U, ABOVE_V, BELOW_V = (
    0, 3, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17,
)  # fmt: skip
"""Offsets in a shape: the voxel's corners; the axis of the direction's face, and 1 or -1 for its side; the range of
slopes across that axis; the voxel's range along the axis, in the direction's sense; and bounds of the planes along the
slopes."""

SHAPE = 18

SLOPE_SLACK = 8.0 * 2.0**-23
"""Margin on slopes: eight roundings of float32."""


@njit
def set_shape(grid, number, shape):  # type: ignore[no-untyped-def]
    """Write the shape of a shaft, (SHAPE,) float64."""
    cells = grid.directions
    column, row = number % cells, number // cells % cells
    face, voxel = number // (cells * cells) % 6, number // (6 * cells * cells)
    for axis in range(3):
        place = voxel % grid.voxels[axis]
        voxel //= grid.voxels[axis]
        shape[LOW + axis] = grid.low[axis] + place * grid.size[axis] - grid.slack
        shape[HIGH + axis] = grid.low[axis] + (place + 1) * grid.size[axis] + grid.slack
    axis, sign = face // 2, 1.0 - 2.0 * (face % 2)
    shape[AXIS], shape[SIGN] = axis, sign
    shape[U0], shape[U1] = 2.0 * column / cells - 1.0 - SLOPE_SLACK, 2.0 * (column + 1) / cells - 1.0 + SLOPE_SLACK
    shape[V0], shape[V1] = 2.0 * row / cells - 1.0 - SLOPE_SLACK, 2.0 * (row + 1) / cells - 1.0 + SLOPE_SLACK
    near, far = sign * shape[LOW + axis], sign * shape[HIGH + axis]
    near, far = min(near, far), max(near, far)
    shape[NEAR], shape[FAR] = near, far
    a, b = (axis + 1) % 3, (axis + 2) % 3
    shape[ABOVE_U] = shape[HIGH + a] - min(shape[U1] * near, shape[U1] * far)
    shape[BELOW_U] = shape[LOW + a] - max(shape[U0] * near, shape[U0] * far)
    shape[ABOVE_V] = shape[HIGH + b] - min(shape[V1] * near, shape[V1] * far)
    shape[BELOW_V] = shape[LOW + b] - max(shape[V0] * near, shape[V0] * far)


@njit
def direction_of(shape, u, v):  # type: ignore[no-untyped-def]
    """The shaft's direction at (u, v) in [0, 1) x [0, 1)."""
    axis, sign = int(shape[AXIS]), shape[SIGN]
    u, v = shape[U0] + u * (shape[U1] - shape[U0]), shape[V0] + v * (shape[V1] - shape[V0])
    if axis == 0:
        return sign, u, v
    return (v, sign, u) if axis == 1 else (u, v, sign)


@njit
def heading(shape, axis):  # type: ignore[no-untyped-def]
    """A number with the sign of the shaft's middle direction along an axis."""
    own = int(shape[AXIS])
    if axis == own:
        return shape[SIGN]
    return shape[U0] + shape[U1] if axis == (own + 1) % 3 else shape[V0] + shape[V1]


@njit
def overlaps(shape, node):  # type: ignore[no-untyped-def]
    """Whether a ray of the shaft may meet the box of the node at an address; never False where one does."""
    axis = int(shape[AXIS])
    a, b = (axis + 1) % 3, (axis + 2) % 3
    half = NODE_BYTES // 2
    low, high = np.float64(float_at(node + 4 * axis)), np.float64(float_at(node + half + 4 * axis))
    near, far = (low, high) if shape[SIGN] > 0 else (-high, -low)
    if far < shape[NEAR]:
        return False
    for side in range(2):
        across = a if side == 0 else b
        low, high = np.float64(float_at(node + 4 * across)), np.float64(float_at(node + half + 4 * across))
        slope0, slope1 = shape[U0 + 2 * side], shape[U1 + 2 * side]
        if low - max(slope1 * near, slope1 * far) > shape[ABOVE_U + 2 * side]:
            return False
        if high - min(slope0 * near, slope0 * far) < shape[BELOW_U + 2 * side]:
            return False
        if slope0 >= 0.0 and high < shape[LOW + across]:
            return False
        if slope1 <= 0.0 and low > shape[HIGH + across]:
            return False
    return True
