"""Bundles that carry light, beside paths: seconds of a pass of each, and how many passes an error of 5 % takes."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from math import ceil, exp, log, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra import AlignedTracer, Count, PixelTracer, RasterTracer
from atra.bake import Atlas, BakeOptions, Baker, BakeScene, LightBundles, Lightmap, Texels
from atra.geometry.mesh import Mesh
from atra.kernels.baking.tables import LUMINANCE
from atra.render import constant_sky
from experiments.harness.point import Measured, Point
from experiments.workloads.bake_rays import CELLS, DIRECT, ONE_BY_ONE, PASS_SAMPLES, PATHS, RASTERED, TOGETHER
from experiments.workloads.baselines import OWN
from experiments.workloads.rounds import measured, timed_rounds
from scenes.directory import default_cache
from scenes.lit.rooms import lit_room

ERROR = 0.05
"""Relative, of the luminance of all texels that lie in the open."""

_OF_DIRECT = 0.5
"""Of that: how much error the light that comes straight may have, as bundles are given it."""

_REFERENCE = 128
"""Samples of each of two maps by random numbers of their own. Their noise is independent, so the mean product of the
differences to both is the squared error."""

_LEAST_DIRECT = 16

_MOST, _STEP = 512, 1.25
"""Directions after which an error counts as not reached; and it is looked at each time there are so many times more."""


def measure_light(point: Point, mesh: Mesh, stack: ExitStack) -> Measured:
    """Time passes of bundles by every tracer, and of paths. Raises as tracers, `Atlas` and `Baker` do."""
    settings, ours = point.workload_options, point.tracing.ours
    size = settings.map_size
    scene = BakeScene.of(lit_room(mesh))
    atlas = Atlas.unwrap(mesh, size, kept_in=default_cache() / "atlases", time_limit_s=point.time_limit_s)

    def baker(scene: BakeScene = scene, **changes: Any) -> Baker:
        fast = {"threads": point.threads, "build_quality": point.build_quality, "robust": ours["robust"]}
        options = BakeOptions(**fast, **changes)
        one: Baker = stack.enter_context(Baker(scene, atlas, options=options))
        return one

    paths, direct = baker(), baker(replace(scene, sky=constant_sky(0.0)), bounces=0, seed=2)
    maps = [_map_of(paths), _map_of(baker(seed=1))]
    used = maps[0].valid & maps[1].valid
    mean = float(np.mean([one.luminance[used] for one in maps]))

    def samples_to(error: float, lightmaps: list[Lightmap]) -> float:
        return float(np.mean([one.variance[used].mean() for one in lightmaps])) / (error * mean) ** 2

    direct.add(_LEAST_DIRECT)
    direct_samples = max(_LEAST_DIRECT, ceil(samples_to(_OF_DIRECT * ERROR, [direct.maps])))
    while direct.advance(direct_samples):
        pass
    bundles = partial(LightBundles, scene, paths.texels, direct.maps.direct, size=size)
    camera = bundles().camera
    tracers: dict[str, Any] = {
        OWN: stack.enter_context(AlignedTracer(mesh, camera, split=(min(CELLS, size), 1), **ours)),
        ONE_BY_ONE: stack.enter_context(PixelTracer(mesh, camera, packet_width=1, **ours)),
        TOGETHER: stack.enter_context(PixelTracer(mesh, camera, **ours)),
        RASTERED: stack.enter_context(RasterTracer(mesh, camera, threads=point.threads)),
    }
    counts = {name: tracer.gather(Count()).count for name, tracer in tracers.items()}

    def error_of(light: NDArray[np.float32], of: NDArray[np.bool_] = used) -> float:
        luminance = light[of].astype(np.float64) @ LUMINANCE
        known = [one.luminance[of] for one in maps]
        product = (luminance - known[0]) * (luminance - known[1])
        return sqrt(max(0.0, float(product.mean()))) / float(np.mean(known))

    bundles().add(tracers[RASTERED])  # compiles
    carried = bundles()
    directions, error = _directions_to(ERROR, carried, tracers[RASTERED], error_of)
    stage_s = {stage: seconds / carried.directions for stage, seconds in carried.stage_s.items()}
    within = used & _within_charts(paths.texels)
    own = {name: bundles() for name in tracers}
    calls: dict[str, Any] = {
        **{name: partial(own[name].add, tracer, settings.directions) for name, tracer in tracers.items()},
        PATHS: partial(paths.add, PASS_SAMPLES),
        DIRECT: partial(direct.add, PASS_SAMPLES),
    }
    timed = timed_rounds(point, calls)
    results = {
        "rays_compared": counts[OWN].size,
        "rays_different": int((counts[OWN] != counts[ONE_BY_ONE]).sum()),
        "paths_samples_to_rmse_5": samples_to(ERROR, maps),
        "direct_samples": direct_samples,
        "bundle_directions_to_rmse_5": directions,
        "bundle_directions_tried": carried.directions,
        "bundle_error": error,
        "bundle_error_within_charts": error_of(carried.light, within) if within.any() else None,
        "texels_within_charts": float(within.sum()) / max(1, int(used.sum())),
        "bundle_rays_cut": carried.rays_cut / max(1, carried.rays),
        "bundle_hits_s": stage_s["hits"],
        "bundle_exchange_s": stage_s["exchange"],
        "texels_never_hit": float((carried.hits[used] == 0).mean()),
    }
    return measured(results, timed)


def _map_of(baker: Baker) -> Lightmap:
    baker.add(_REFERENCE)
    return baker.maps


def _within_charts(texels: Texels) -> NDArray[np.bool_]:
    """(N,): all eight around it belong to its chart. At the rim a baker lights the nearest point that there is, again
    and again, and bundles all that a texel holds, which is not the same."""
    of_chart = np.pad(texels.image(texels.chart, -1), 1, constant_values=-1)
    rows, columns = np.divmod(texels.number, texels.atlas.width)
    around = [of_chart[rows + i, columns + j] == texels.chart for i in range(3) for j in range(3)]
    return np.asarray(np.all(around, axis=0))


def _directions_to(
    wanted: float, bundles: LightBundles, tracer: Any, error_of: Callable[[NDArray[np.float32]], float]
) -> tuple[float | None, float]:
    """How many directions an error takes, and the last one seen; None where `_MOST` of them do not reach it. Between
    two looks, powers of the number of directions."""
    before: tuple[int, float] | None = None
    while bundles.directions < _MOST:
        target = min(_MOST, max(bundles.directions + 4, ceil(_STEP * bundles.directions)))
        bundles.add(tracer, target - bundles.directions)
        error = error_of(bundles.light)
        if error <= wanted:
            if before is None or error <= 0.0:
                return float(target), error
            share = log(before[1] / wanted) / log(before[1] / error)
            return exp(log(before[0]) + share * log(target / before[0])), error
        before = target, error
    return None, error
