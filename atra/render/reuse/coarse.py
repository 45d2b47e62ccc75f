"""Hybrid pictures with fewer rays: shadows and occlusion of a coarser picture, carried over to all pixels."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.geometry.camera import CalibratedCamera
from atra.geometry.image_plane import ImagePlane
from atra.geometry.view import View
from atra.render.hybrid import HybridRenderer
from atra.render.renderer import CENTRE, Primary
from atra.render.reuse.carrying import carried
from atra.render.scene import RenderScene
from atra.whole_numbers import is_whole_number


class CoarseHybridRenderer:
    """As `HybridRenderer`, with rays to lights and into the sky from every `step`-th column and row alone.

        with atra.render.CoarseHybridRenderer(scene, camera, 2) as renderer:  # a quarter of the rays
            renderer.add(16)

    These start from what a camera with so many fewer pixels sees; what shares of them nothing stopped is carried over
    to the pixels around that see the same surface. Lights' cosines, colours and textures are those of all pixels.

    few, whole: the renderers of both pictures, each with its own primary visibility, from `primary` and options as for
    `HybridRenderer`. Raises InputError for a step below 1, and an image whose sides are no multiples of it.
    """

    def __init__(
        self, scene: RenderScene, camera: View, step: int = 2, primary: Primary | None = None, **options: Any
    ) -> None:
        without = options | {"shadow_rays": 0, "occlusion_rays": 0, "build_quality": "low"}
        self.few = HybridRenderer(scene, coarser(camera, step), primary, **options)
        self.whole = HybridRenderer(scene, camera, primary, **without)
        self._opened = ExitStack()

    def __enter__(self) -> Self:
        with ExitStack() as opened:
            opened.enter_context(self.few)
            opened.enter_context(self.whole)
            self._opened = opened.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._opened.close()

    def add(self, samples: int = 1) -> None:
        """Add so many samples to both pictures; raises as `HybridRenderer.add`."""
        for renderer in (self.few, self.whole):
            renderer.add(samples)

    @property
    def ray_count(self) -> int:
        """How many rays the last `add` traced beside those of primary visibility."""
        return self.few.ray_count

    @property
    def shares(self) -> NDArray[np.float32]:
        """(H, W, 1 + lights): the shares of rays into the sky, and to each light, that nothing stopped."""
        few, whole = (renderer.tracer.trace(CENTRE) for renderer in (self.few, self.whole))
        lights = range(len(self.few.scene.lights))
        coarse = np.stack([self.few.openness, *(self.few.lit(light) for light in lights)], axis=2)
        found, known = carried(coarse, few, whole)
        step = self.whole.camera.width // self.few.camera.width
        nearest = coarse.repeat(step, axis=0).repeat(step, axis=1)
        return np.where(known[..., None], found, nearest).astype(np.float32)

    @property
    def image(self) -> NDArray[np.float32]:
        """(H, W, 3) float32, linear RGB. Raises InputError where there is no sample yet."""
        return np.einsum("phwc,hwp->hwc", self.whole.parts, self.shares)


def coarser(camera: View, step: int) -> View:
    """The same view in as many times fewer columns and rows. Raises InputError as `CoarseHybridRenderer` does."""
    width, height = camera.width, camera.height
    if not is_whole_number(step) or step < 1 or width % step or height % step:
        raise InputError(f"step is {step!r}, expected a whole number that divides {width} x {height} pixels")
    if isinstance(camera, CalibratedCamera):
        plane = camera.plane
        axis = (plane.axis_x - plane.left) / step, (plane.axis_y - plane.top) / step
        wider = ImagePlane(step * plane.pitch_x, step * plane.pitch_y, *axis)
        return replace(camera, width=width // step, height=height // step, plane=wider)
    return replace(camera, width=width // step, height=height // step)  # type: ignore[type-var]
