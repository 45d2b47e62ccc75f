"""Scenes of shadows: opaque faces, which stop rays to lights, and panes, faces that let light on."""

from __future__ import annotations

import numpy as np

from atra.light.lightmaps.surface import BakeScene
from atra.rays.scene import RayScene
from atra.tracing.options import RayOptions


class ShadowScenes:
    """What rays to lights meet where some faces let light on: a scene of opaque faces, in which they stop at whichever
    they meet, and one of panes, which is asked for rays that come to its box and that nothing stops.

    Without panes there are no such scenes, and the one of all faces serves. options: of both.
    Raises InputError as `RayScene` does.
    """

    def __init__(self, scene: BakeScene, options: RayOptions) -> None:
        assert scene.surface is not None
        self._panes = scene.surface.panes
        kinds = (~self._panes, self._panes) if self._panes.any() else ()
        self.both = tuple(RayScene(scene.mesh, faces=faces, **options.keywords()) for faces in kinds)

    def serve(self, scene: BakeScene) -> bool:
        """Whether these are for that scene, of the same mesh, too."""
        assert scene.surface is not None
        return np.array_equal(scene.surface.panes, self._panes)

    def build(self) -> float:
        """Returns the seconds that it took."""
        for one in self.both:
            one.build()
        return sum(one.build_time_s for one in self.both)

    def addresses(self, of_all: int) -> tuple[int, int]:
        """RTCScenes of what stops rays and of panes, 0 where there are none. of_all: the one of all faces."""
        return tuple(one.address for one in self.both) if self.both else (of_all, 0)  # type: ignore[return-value]

    def close(self) -> None:
        for one in self.both:
            one.close()
