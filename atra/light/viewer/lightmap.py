"""The painter of a lightmap: bakes while the camera rests, and shows the scene by the map so far."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from atra.errors import AtraError
from atra.geometry.camera import Camera
from atra.light.lightmaps.baker import Baker
from atra.light.lightmaps.finish.export import exposure_of, finished
from atra.light.lightmaps.finish.views import clay_view, lit_view
from atra.light.pictures.files import srgb_of
from atra.light.viewer.request import Request
from atra.light.viewer.session import Picture
from atra.raster.tracer import RasterTracer
from atra.tracing.tracer import Tracer


class MapPainter:
    """The artist of a `Session` that bakes: a sample is a pass over texels, those first that the camera sees.

    baker: its map is baked, and shown, until all texels have `target` samples. threads: of the rasteriser that finds
    what is seen. error: what ended the bake, if anything did.
    """

    def __init__(self, baker: Baker, target: int, threads: int | None = None) -> None:
        self._baker, self._target, self._threads = baker, target, threads
        self._tracer: Tracer | None = None
        self._looks: Camera | None = None
        self._lit: tuple[int, NDArray[np.float32], float] | None = None
        self.error: AtraError | None = None

    def sketch(self, request: Request) -> Picture:
        """The map as it was shown last, from there."""
        return self._picture(request.camera)

    def add(self, request: Request, stop: Callable[[], bool]) -> int:
        """One pass, which ends early when stopped; returns the samples of the texels that come first."""
        baker = self._baker
        if request.camera != self._looks:
            baker.look(request.camera)
            self._looks = request.camera
        wanted = baker.samples < self._target
        if baker.visible is not None and (wanted & baker.visible).any():
            wanted &= baker.visible
        least = int(baker.samples[wanted].min(initial=self._target))
        goal = min(self._target, least + 1 + least // 4)
        try:
            baker.advance(goal, stop)
        except AtraError as error:
            self.error = error
            raise
        return self._target if baker.share_done(self._target) == 1.0 else min(goal, self._target - 1)

    def show(self, request: Request) -> Picture:
        """The map as it is now."""
        total = int(self._baker.samples.sum())
        if total and (self._lit is None or self._lit[0] != total):
            lightmap = self._baker.maps
            if lightmap.valid.any():
                self._lit = total, finished(lightmap, lightmap.combined), exposure_of(lightmap)
        return self._picture(request.camera)

    def _picture(self, camera: Camera) -> Picture:
        baker = self._baker
        if self._tracer is None:
            self._tracer = RasterTracer(baker.scene.mesh, camera, threads=self._threads, ties="any")
        self._tracer.look(camera)
        hits = self._tracer.trace()
        if self._lit is None:
            view = clay_view(hits)
        else:
            view = self._lit[2] * lit_view(hits, baker.scene, baker.texels.atlas, self._lit[1])
        seen = None if baker.visible is None else int(baker.visible.sum())
        said = say_progress(baker.samples, self._target, baker.share_done(self._target), seen)
        return Picture(srgb_of(view), {}, said)

    def close(self) -> None:
        """Let go of what was built."""
        if self._tracer is not None:
            self._tracer.close()


def say_progress(samples: NDArray[np.int32], target: int, share_done: float, seen: int | None = None) -> str:
    """What the panel says of a map, in Markdown. samples: (N,), of each texel. seen: how many the camera sees."""
    least, most = int(samples.min()), int(samples.max())
    taken = f"{most}" if least == most else f"{least} to {most}"
    if share_done == 1.0:
        return f"**done**: {taken} samples of {len(samples):,} texels; end it by Ctrl-C, and its files are written"
    first = "" if seen is None else f", {seen:,} in view first"
    return f"**{taken} of {target} samples** of {len(samples):,} texels{first}\n\n{share_done:.0%} done"
