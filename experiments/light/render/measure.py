"""Time of pictures: one renderer, whose primary visibility is the point's own method's or a baseline's, in turns."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from functools import partial
from typing import Any

import numpy as np

from atra.geometry.view import View
from atra.hits import Hits
from atra.judge.compare import compare
from atra.light import HybridRenderer, PathRenderer, Renderer, Scene
from experiments.harness.point import Measured, Point
from experiments.light.render import primary
from experiments.workloads import rounds
from experiments.workloads.baselines import OWN, SINGLE
from experiments.workloads.images import summed
from scenes.lit.lighting import length_of, lit


class Primaries:
    """Several tracers of one view as one, so that a renderer runs the same code on the same memory with any of them.

    The `chosen` one traces, each into its own image. Their owner plans, builds and closes them.
    """

    plan_time_s = build_time_s = 0.0

    def __init__(self, tracers: Mapping[str, Any]) -> None:
        self._tracers = tracers
        self._images: dict[str, Hits] = {}
        self.chosen = OWN

    def trace(self, offset: tuple[float, float], out: object = None) -> Hits:
        name = self.chosen
        self._images[name] = self._tracers[name].trace(offset, out=self._images.get(name))
        return self.latest

    @property
    def latest(self) -> Hits:
        """What the chosen one traced last."""
        return self._images[self.chosen]

    def plan(self) -> None: ...

    def build(self) -> None: ...

    def close(self) -> None: ...


class Pictures:
    """Makes pictures with a choice of primary visibility, and keeps the seconds of their stages."""

    def __init__(self, renderer: Renderer, primaries: Primaries, samples: int) -> None:
        self.renderer, self._primaries, self._samples = renderer, primaries, samples
        self.stages: dict[str, list[dict[str, float]]] = {}

    def make(self, name: str) -> None:
        """A picture from its first sample on."""
        self._primaries.chosen = name
        self.renderer.restart()
        self.renderer.add(self._samples)
        self.stages.setdefault(name, []).append(self.renderer.stage_s)

    def sample(self, name: str) -> tuple[Hits, Any]:
        """What is seen through the pixels' first sub-pixel position, and a picture of that sample alone."""
        self._primaries.chosen = name
        self.renderer.restart()
        self.renderer.add(1)
        return self._primaries.latest, self.renderer.image


def make_renderer(point: Point, scene: Scene, view: View, tracer: Any) -> Renderer:
    """The configured renderer, with this tracer for primary visibility."""
    options = point.workload_options
    kind = PathRenderer if options.frame == "path" else HybridRenderer
    given = options.of_library(length_of(scene.mesh, 1.0)) | {
        "threads": point.threads, "build_quality": point.build_quality,
    }  # fmt: skip
    made: Any = kind(scene, view, lambda mesh, camera: tracer, **given)  # type: ignore[arg-type]
    return made  # type: ignore[no-any-return]


def _one_picture(point: Point, tracer: Any) -> None:
    scene = lit("", tracer.mesh, tracer.camera)
    with make_renderer(point, scene, tracer.camera, tracer) as renderer:
        renderer.add(1)


def measure(point: Point) -> Measured:
    """Build the point's own method and the baselines, and make pictures with each in turns. Raises InputError and
    MemoryBudgetError as tracers and renderers do."""
    rounds.warm_up(point, rounds.own_and_baselines(), partial(_one_picture, point))
    options = point.workload_options
    with ExitStack() as stack:
        tracers, results = rounds.build_with_baselines(point, stack)
        own = tracers[OWN]
        scene = lit(point.scene, own.mesh, point.camera)
        primaries = Primaries(tracers)
        renderer = make_renderer(point, scene, own.camera, primaries)
        stack.enter_context(renderer)
        pictures = Pictures(renderer, primaries, options.samples)
        calls: dict[str, Any] = {name: partial(pictures.make, name) for name in tracers}
        timed = rounds.timed_rounds(point, calls)
        rays = pictures.renderer.ray_count  # of whichever came last: all shoot the same, but for ties
        stages = {name: of_all[-timed.rounds :] for name, of_all in pictures.stages.items()}
        (hits, image), (single, single_image) = (pictures.sample(name) for name in (OWN, SINGLE))
        agreements = [compare(hits, single)]
        unlike = (image != single_image).any(axis=-1) & (hits.prim_id == single.prim_id)
        images = 1 if options.jitter == "off" else options.samples
        shares = [sum(one.values()) / whole for one, whole in zip(stages[OWN], timed.samples[OWN], strict=True)]
        results |= {
            **summed(agreements),
            **rounds.plan_and_build_again(own),
            "pixels_unlike": int(np.count_nonzero(unlike)),
            "rays": rays + images * point.width * point.height,
            "stages_over_frame": float(np.median(shares)),
            "stages": {name: float(np.median([one[name] for one in stages[OWN]])) for name in stages[OWN][0]},
        }
    made = rounds.measured(results, timed)
    for name, of_rounds in stages.items():
        made.samples[primary(name)] = [one["primary"] for one in of_rounds]
    return made
