"""The page of a lightmap: its texels as they converge, those first that the camera sees while it rests."""

from __future__ import annotations

import threading
from time import monotonic

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.geometry.camera import Camera
from atra.hits import Hits
from atra.light import Atlas, Lightmap, ProgressiveBake, Scene, clay_view, lit_view
from atra.light.lightmaps.finish.export import exposure_of, finished
from atra.light.pictures.files import srgb_of
from atra.light.viewer.camera_page import CameraPage
from atra.light.viewer.request import Pose, Request, Settings
from atra.light.viewer.session import REST_S
from atra.raster.tracer import RasterTracer
from atra.tracing.tracer import Tracer

GAP_S = 0.25
"""Seconds between two pictures while the camera rests."""


class LightmapPage(CameraPage):
    """Shows the latest map of a bake from wherever the page looks, and tells the bake when the camera rests there.

    bake: already begun. atlas: of its map. target: samples after which it is done. first: where it looks from
    at first. side: the picture has about side x side pixels. threads: of the rasteriser that finds what is seen. port,
    title: of `CameraPage`, which says what is raised.
    """

    def __init__(
        self, bake: ProgressiveBake, scene: Scene, atlas: Atlas, target: int, *, first: Pose, port: int, title: str,
        side: int = 512, threads: int | None = None,
    ) -> None:  # fmt: skip
        super().__init__(port, title, float(np.linalg.norm(np.ptp(scene.mesh.bounds, axis=0))))
        self._bake, self._scene, self._atlas, self._target = bake, scene, atlas, target
        self._settings, self._threads = Settings(side=side), threads
        self._changed = threading.Condition()
        self._newest = first, monotonic()
        self._is_closed = False
        self._shown: Pose | None = None
        self._told: Pose | None = None
        self._drawn: Lightmap | None = None
        self._drawn_s, self._is_done = 0.0, False
        self._image: NDArray[np.float32] | None = None
        self._exposure = 1.0
        self._numbers = self._server.gui.add_markdown("preparing; a first start compiles kernels")
        self.add_camera_controls()
        self.follow(first)

    def moved(self, pose: Pose) -> None:
        """A page looks from there."""
        with self._changed:
            if pose != self._newest[0]:
                self._newest = pose, monotonic()
                self._changed.notify()

    def left(self) -> None:
        """Make `run` return."""
        with self._changed:
            self._is_closed = True
            self._changed.notify()

    def run(self) -> None:
        """Until Ctrl-C, or until the last page has been closed for a while. Raises what the bake raised."""
        with RasterTracer(self._scene.mesh, self._camera(self._newest[0]), threads=self._threads, ties="any") as tracer:
            while not self._is_closed:
                self._step(tracer)
                with self._changed:
                    self._changed.wait_for(lambda: self._is_closed or self._shown is not self._newest[0], GAP_S / 4)

    def _camera(self, pose: Pose) -> Camera:
        return Request(pose, self._settings).camera

    def _step(self, tracer: Tracer) -> None:
        pose, since_s = self._newest
        if pose is not self._shown:
            self._shown = pose
            try:
                tracer.look(self._camera(pose))
            except InputError as error:  # too far away, say: the picture stays
                self._told = pose
                self._numbers.content = f"**{error}**"
                return
            self._hits = tracer.trace()
            self._show(self._hits, is_still=False)
        elif pose is not self._told and monotonic() - since_s >= REST_S:
            self._bake.look(self._hits.camera)
            self._told = pose
            self._show(self._hits, is_still=True)
        elif self._has_news() and monotonic() - self._drawn_s >= GAP_S:
            self._show(self._hits, is_still=True)

    def _has_news(self) -> bool:
        return self._bake.snapshot() is not self._drawn or self._bake.wait(0.0) is not self._is_done

    def _show(self, hits: Hits, is_still: bool) -> None:
        lightmap = self._bake.snapshot()
        if lightmap is not None and lightmap is not self._drawn and lightmap.valid.any():
            self._image, self._exposure = finished(lightmap, lightmap.combined), exposure_of(lightmap)
            self._drawn = lightmap
        if self._drawn is not None:
            self._is_done = self._bake.wait(0.0)
            done = self._bake.share_done, self._is_done
            self._numbers.content = say_progress(self._drawn.samples, self._target, *done, self._bake.seen)
        if self._image is None:
            view = clay_view(hits)
        else:
            view = self._exposure * lit_view(hits, self._scene, self._atlas, self._image)
        self.send(srgb_of(view), is_still)
        self._drawn_s = monotonic()


def say_progress(
    samples: NDArray[np.int32], target: int, share_done: float, is_done: bool, seen: int | None = None
) -> str:
    """What the panel says of a map, in Markdown. samples: (N,), of each texel. seen: how many the camera sees."""
    least, most = int(samples.min()), int(samples.max())
    taken = f"{most}" if least == most else f"{least} to {most}"
    if is_done:
        return f"**done**: {taken} samples of {len(samples):,} texels; end it by Ctrl-C, and its files are written"
    first = "" if seen is None else f", {seen:,} in view first"
    return f"**{taken} of {target} samples** of {len(samples):,} texels{first}\n\n{share_done:.0%} done"
