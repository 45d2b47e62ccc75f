"""Time of baking: rounds of samples by the point's settings, and by a batch in which every texel has a lane."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from math import sqrt
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np

from atra.bake import Atlas, Baker, BakeScene, Lightmap, Surface
from atra.bake.charts.texels import Texels
from atra.geometry.mesh import Mesh
from experiments.harness.point import Point
from experiments.workloads.bake import PLAIN, STAGES, THRESHOLDS, WHOLE_MAP, WITHOUT_VIEW
from experiments.workloads.baselines import OWN
from experiments.workloads.rounds import load_mesh, measured, timed_rounds
from experiments.workloads.workload import Measured, make_own
from scenes.directory import default_cache
from scenes.lit.rooms import lit_room

_PADDINGS = (2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 24, 32)


def bake_scene(point: Point, mesh: Mesh) -> BakeScene:
    """The mesh with light, and with the albedo that is asked for."""
    settings = point.workload_options
    scene, albedo = BakeScene.of(settings.under_sky(lit_room(mesh))), settings.albedo
    if albedo is None:
        return scene
    assert scene.surface is not None
    return replace(scene, surface=Surface.plain(mesh, albedo, scene.surface.emission))


def atlas_of(point: Point, mesh: Mesh) -> Atlas:
    """Charts of the mesh, kept among fetched scenes; gutters as wide as the occupancy asks for, texels as large."""
    settings = point.workload_options
    kept: dict[str, Any] = {"kept_in": default_cache() / "atlases", "time_limit_s": point.time_limit_s}
    atlas = Atlas.unwrap(mesh, settings.size, **kept)
    if settings.occupancy is None:
        return atlas
    area = float(np.linalg.norm(np.cross(*_edges(mesh.vertices[mesh.faces])), axis=1).sum())
    per_unit = sqrt(float(np.abs(np.nan_to_num(_cross(atlas.uv))).sum()) / area)
    for padding in _PADDINGS:
        wider = Atlas.unwrap(mesh, settings.size, padding=padding, texels_per_unit=per_unit, **kept)
        if Texels.of(mesh, wider).occupancy < settings.occupancy:
            break
        atlas = wider
    return enlarged(atlas, len(Texels.of(mesh, atlas)) / settings.occupancy)


def _edges(corners: Any) -> tuple[Any, Any]:
    exact = corners.astype(np.float64)
    return exact[:, 1] - exact[:, 0], exact[:, 2] - exact[:, 0]


def _cross(uv: Any) -> Any:
    a, b = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def enlarged(atlas: Atlas, texels: float) -> Atlas:
    """The same charts on a map of as many texels, or as it is, if it has more: what is new is empty."""
    height = max(atlas.height, round(texels / atlas.width))
    return Atlas(np.nan_to_num(atlas.uv), atlas.chart, atlas.width, height)


def measure(point: Point) -> Measured:
    """Bake rounds of samples. Raises InputError and MemoryBudgetError as `Baker` does."""
    settings, mesh = point.workload_options, load_mesh(point)
    scene, start = bake_scene(point, mesh), perf_counter()
    atlas = atlas_of(point, mesh)
    options = settings.options(point.threads, point.build_quality)
    with ExitStack() as stack:

        def baker(**changes: Any) -> Baker:
            one: Baker = stack.enter_context(Baker(scene, atlas, options=replace(options, **changes)))
            one.add(1)  # compiles
            return one

        own, plain = baker(), baker(compaction="none")
        results: dict[str, Any] = {"atlas_s": perf_counter() - start}
        calls: dict[str, Callable[[], object]] = {OWN: lambda: own.add(settings.samples)}
        if settings.priority:
            with make_own(point, mesh, point.camera) as tracer:
                tracer.trace()
                begin = perf_counter()
                own.set_view(point.camera, tracer)
                results["culling_map_s"] = perf_counter() - begin
            whole, rows = baker(), baker()
            whole.visible = own.visible
            calls = {
                OWN: lambda: add_visible(own, settings.samples),
                WHOLE_MAP: lambda: add_whole(whole, settings.samples),
                WITHOUT_VIEW: lambda: rows.add(settings.samples),
            }
        before = own.rays, own.lanes, dict(own.stage_s)
        timed = timed_rounds(point, calls | {PLAIN: lambda: plain.add(settings.samples)})
        rounds = timed.rounds + point.warmup
        results |= _told(own, before, rounds) | _quality(own, timed.samples, settings.samples, settings.priority)
    return measured(results, timed)


def add_visible(baker: Baker, samples: int) -> None:
    """So many samples more of what the view shows."""
    assert baker.visible is not None
    if baker.visible.any():
        target = int(baker.samples[baker.visible].max()) + samples
        while (baker.samples[baker.visible] < target).any():
            baker.advance(target)


def add_whole(baker: Baker, samples: int) -> None:
    """So many samples more of all texels, of seen ones first."""
    target = int(baker.samples.max()) + samples
    while baker.advance(target):
        pass


def _told(baker: Baker, before: tuple[int, int, dict[str, float]], rounds: int) -> dict[str, Any]:
    rays, lanes, stages = before
    texels = baker.texels
    visible = baker.visible
    return {
        "rays_per_round": (baker.rays - rays) // rounds,
        "lane_utilisation": (baker.rays - rays) / max(1, baker.lanes - lanes),
        "buffer_bytes": baker.buffer_bytes,
        "texels": len(texels),
        "charts": texels.atlas.charts,
        "texels_lost": texels.faces_lost,
        "map_occupancy": texels.occupancy,
        "visible_share": None if visible is None else float(visible.mean()),
    } | {
        f"{stage}_s": (baker.stage_s.get(stage, 0.0) - stages.get(stage, 0.0)) / rounds for stage in STAGES
    }  # fmt: skip


def _quality(baker: Baker, samples: dict[str, tuple[float, ...]], count: int, priority: bool) -> dict[str, Any]:
    """Seconds to an error: samples are independent, so its square is the variance of one, over their number."""
    lightmap = baker.maps
    every = samples[WITHOUT_VIEW if priority else OWN]
    found = _times("", lightmap, np.ones(len(baker.texels), bool), median(every) / count)
    if baker.visible is not None:
        found |= _times("visible_", lightmap, baker.visible, median(samples[OWN]) / count)
    return found


def _times(kind: str, lightmap: Lightmap, which: Any, sample_s: float) -> dict[str, float | None]:
    used = which & lightmap.valid
    mean = float(lightmap.luminance[used].mean()) if used.any() else 0.0
    if not mean > 0.0:
        return {}
    one = float(lightmap.variance[used].mean()) / mean**2
    return {f"{kind}time_to_rmse_{percent}_s": one / (percent / 100) ** 2 * sample_s for percent in THRESHOLDS}
