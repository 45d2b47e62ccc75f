"""Scenes for shadow rays: opaque faces, which block light, and panes, which let some pass."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.light.lightmaps.options import BakeOptions
from atra.light.lightmaps.surface import BakeScene
from atra.light.scene import Scene
from atra.rays.kernel_scene import scene_for_kernels


def _panes_of(scene: BakeScene | Scene) -> NDArray[np.bool_]:
    """(F,) bool; a `Scene` asks the scene of all faces alone."""
    if isinstance(scene, BakeScene) and scene.surface is not None:
        return scene.surface.panes
    return np.zeros(scene.mesh.triangle_count, np.bool_)


class ShadowScenes:
    """What rays to lights meet if there are panes: a scene of opaque faces for occlusion, and one of panes for the rays
    that nothing blocks.

    Without panes there are no such scenes; that of all faces serves. options: of both. Raises InputError as
    `KernelScene` does.
    """

    def __init__(self, scene: BakeScene | Scene, options: BakeOptions) -> None:
        self._panes = _panes_of(scene)
        kinds = (~self._panes, self._panes) if self._panes.any() else ()
        self.both = tuple(scene_for_kernels(scene.mesh, options, faces) for faces in kinds)

    def serve(self, scene: BakeScene | Scene) -> bool:
        """Whether these scenes fit another scene of the same mesh."""
        return np.array_equal(_panes_of(scene), self._panes)

    def build(self) -> float:
        """Build; returns the seconds taken."""
        for one in self.both:
            one.build()
        return sum(one.build_time_s for one in self.both)

    def addresses(self, of_all: int) -> tuple[int, int]:
        """RTCScenes of what blocks rays and of panes (0 = none). of_all: the scene of all faces."""
        return tuple(one.address for one in self.both) if self.both else (of_all, 0)  # type: ignore[return-value]

    def close(self) -> None:
        for one in self.both:
            one.close()
