"""Light probes: light that arrives at points in the open, as spherical harmonics."""

from __future__ import annotations

import io
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.errors import AtraError, InputError
from atra.files.paths import write_atomically
from atra.light.batches import in_batches
from atra.light.checks import checked_rows
from atra.light.emitters.sky_kernels import HARMONICS, OF_COSINE, harmonics
from atra.light.lightmaps.paths import AT_ONCE, Paths
from atra.light.lightmaps.paths_kernels import CHANNELS, DIRECT, ENVIRONMENT, INDIRECT, light_probes
from atra.rays.kernel_scene import KernelScene, Query
from atra.tracing.budgets import check_needed_bytes

_FARTHEST = 1e11

_BYTES = 32
"""Memory per coefficient: its sum, its mean, and temporaries."""


@dataclass(frozen=True, eq=False)
class LightProbes:
    """Radiance around P points as spherical harmonics up to L2.

    points: (P, 3) float32, in the world; float64 for a mesh with an origin. samples: paths of each. direct, indirect,
    environment: (P, 9, 3) float32, coefficients of the real spherical harmonics, ordered by l and then m, by channel;
    kinds of light as in `Lightmap`. backs: (P,) float32, fraction of directions that see back faces; where it is large,
    the point lies inside an object.
    """

    points: NDArray[np.floating]
    samples: int
    direct: NDArray[np.float32] = field(repr=False)
    indirect: NDArray[np.float32] = field(repr=False)
    environment: NDArray[np.float32] = field(repr=False)
    backs: NDArray[np.float32] = field(repr=False)

    @cached_property
    def combined(self) -> NDArray[np.float32]:
        """(P, 9, 3) float32, all light."""
        return self.direct + self.indirect + self.environment

    def light(self, normals: ArrayLike) -> NDArray[np.float32]:
        """(P, 3) float32: what a white surface at each point reflects, in a lightmap's units. normals: its unit
        normals, (P, 3), or one for all. L2 blurs light: a sun is soft and may be negative on the far side."""
        x, y, z = np.broadcast_to(np.asarray(normals, np.float64), self.points.shape).T
        weights = OF_COSINE * np.stack(harmonics(x, y, z), axis=1)
        return np.einsum("ph,phc->pc", weights, self.combined).astype(np.float32)

    def save(self, path: Path | str) -> Path:
        """Write the arrays by name as .npz; returns the path. Raises InputError for another suffix, StorageError."""
        path = Path(path)
        if path.suffix.lower() != ".npz":
            raise InputError(f"probes are to be written to {str(path)!r}, expected a name that ends in .npz")
        content = io.BytesIO()
        np.savez(content, **{name: getattr(self, name) for name in self.__dataclass_fields__})
        write_atomically(path, content.getvalue())
        return path


def probed(
    points: ArrayLike, samples: int, origin: NDArray[np.float64], scene: KernelScene, paths: Paths
) -> LightProbes:
    """Probes at points, (P, 3) in the world, by `samples` paths each. origin: (3,) float64, of the mesh. Raises
    InputError naming a bad point, MemoryBudgetError, and AtraError for light that is not finite."""
    local = checked_rows("position", points, (None, 3), "probe", -_FARTHEST, _FARTHEST)
    in_world: NDArray[np.floating] = local
    if origin.any():
        in_world = np.array(points, np.float64)
        local = (in_world - origin).astype(np.float32)
    what = f"spherical harmonics of {len(local):,} probes"
    check_needed_bytes(len(local) * CHANNELS * HARMONICS * _BYTES, None, what, "use fewer probes at a time")
    light, backs = np.zeros((len(local), CHANNELS, HARMONICS)), np.zeros(len(local), np.int64)

    def add(query: Query, first: int, count: int) -> int:
        told = np.array([0, -1])
        light_probes(local, first, count, samples, *paths.tables(query), light, backs, told)
        if told[1] >= 0:
            where = f"probe {told[1]} at {in_world[told[1]].tolist()}"
            raise AtraError(f"the light of {where} is not finite; make lights or materials darker")
        return int(told[0])

    in_batches(scene, len(local), max(1, AT_ONCE // samples), add)
    means = np.swapaxes(4.0 * np.pi / samples * light, 1, 2).astype(np.float32)
    direct, indirect, environment = (
        np.ascontiguousarray(means[:, :, kind : kind + 3]) for kind in (DIRECT, INDIRECT, ENVIRONMENT)
    )
    return LightProbes(in_world, samples, direct, indirect, environment, (backs / samples).astype(np.float32))
