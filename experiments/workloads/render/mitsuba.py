"""The same pictures by Mitsuba 3: its camera before a scene of ours, and its path integrator."""

from __future__ import annotations

from typing import Any

import numpy as np

from atra.geometry.camera import Camera
from atra.light import RenderScene
from experiments.methods.peers.mitsuba_light import load_mitsuba, parts_of
from experiments.workloads.render import RenderOptions

_PATHS_AT_ONCE = 1 << 22
"""A wavefront of them is kept in memory."""


def mitsuba_scene(mi: Any, scene: RenderScene, camera: Camera, max_depth: int) -> Any:
    """A scene, in Mitsuba's variant of the moment. Raises InputError as `parts_of` does."""
    return mi.load_dict(parts_of(mi, scene) | {
        "integrator": {"type": "path", "max_depth": max_depth, "rr_depth": 10_000},
        "camera": {
            "type": "perspective", "fov": camera.fov_y_degrees, "fov_axis": "y", "near_clip": 1e-3,
            "to_world": mi.ScalarTransform4f().look_at(origin=camera.eye, target=camera.target, up=camera.up),
            "film": {
                "type": "hdrfilm", "width": camera.width, "height": camera.height, "rfilter": {"type": "box"},
                "component_format": "float32",
            },
            "sampler": {"type": "independent"},
        },
    })  # fmt: skip


class MitsubaPicture:
    """Pictures by Mitsuba's `path` integrator, a few million paths at a time.

    It aims at the sky and at lamps from every surface, which path tracing here does not, so each of its samples takes
    more rays and has less noise. Scene and camera as for `mitsuba_scene`, threads as for tracers.
    Raises InputError where Mitsuba, or what its variant needs, is missing.
    """

    def __init__(self, scene: RenderScene, camera: Camera, options: RenderOptions, threads: int | None) -> None:
        variant = options.mitsuba.value
        self._mi, _ = load_mitsuba(variant, f"workload.mitsuba={variant}", threads)
        self._scene = mitsuba_scene(self._mi, scene, camera, options.max_depth)
        self._most = max(1, _PATHS_AT_ONCE // (camera.width * camera.height))
        self._seed = 0
        self.make(1)

    def make(self, samples: int) -> Any:
        """(H, W, 3) float32, the mean of so many samples, other ones at every call."""
        total: Any = 0.0
        left = samples
        while left:
            count = min(left, self._most)
            image = self._mi.render(self._scene, spp=count, seed=self._seed)
            total = total + count * np.array(image)
            left -= count
            self._seed += 1
        return total / samples
