"""Positions of vertices as numbers: triangles touch where these are equal, whatever their vertices are called."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.geometry.mesh import Mesh

_FACTORS = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)


def position_keys(mesh: Mesh) -> NDArray[np.uint64]:
    """(V,) uint64, equal for vertices at one position; of others two may be equal by accident, once in 2^64."""
    places = mesh.vertices + np.float32(0.0)  # no -0.0
    mixed: NDArray[np.uint64] = (places.view(np.uint32).astype(np.uint64) * _FACTORS).sum(axis=1, dtype=np.uint64)
    return mixed
