"""Time of baking: rounds of samples by the point's settings, and by a bake that lacks one of its means."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import fields, replace
from math import sqrt
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np

from atra import light
from atra.geometry.mesh import Mesh
from atra.light import Atlas, Baker, Emissive, Lambertian, Lightmap, MetallicRoughness, Texels
from atra.light.lightmaps.options import BakeOptions
from atra.light.lightmaps.priority import visible_texels
from atra.light.materials import Material
from experiments.harness.point import Measured, Point, make_own
from experiments.light.bake import (
    FULLEST,
    OTHER,
    SHADING,
    STAGES,
    THRESHOLDS,
    TRACING,
    WHOLE_MAP,
    WITHOUT_VIEW,
)
from experiments.light.bake.finishing import finishing, squared_differences
from experiments.light.bake.mitsuba import MitsubaPaths, with_plain_light
from experiments.light.wave_baker import WaveBaker
from experiments.workloads.baselines import OWN
from experiments.workloads.rounds import load_mesh, measured, timed_rounds
from scenes.directory import default_cache
from scenes.lit.lighting import lit
from scenes.lit.rooms import lit_room

_NEARLY = 0.999
"""Opacity of the one face that makes a scene translucent."""

_SUN = 400.0
"""Radiance of the panorama's sun; its sky has 1."""


AnyBaker = Baker | WaveBaker


def bake_scene(point: Point, mesh: Mesh) -> light.Scene:
    """The mesh with the configured light, albedo, lamps and sky."""
    settings = point.workload_options
    scene = room_of(point, mesh)
    if settings.albedo is not None:
        grey = Lambertian((settings.albedo,) * 3)
        scene = replace(scene, materials=[one if any(one.emission) else grey for one in scene.materials])
    if not (settings.panorama or settings.lamps):
        return scene
    sky = panorama() if settings.panorama else light.constant_sky(0.0)
    dark = [_dark(one) for one in scene.materials]
    return replace(scene, materials=dark, lights=lamps(mesh, settings.lamps), sky=sky)


def _dark(material: Material) -> Material:
    """The material without what it emits."""
    if isinstance(material, Emissive):
        return Lambertian((0.0, 0.0, 0.0))
    return replace(material, emission=(0.0,) * 3) if isinstance(material, MetallicRoughness) else material


def room_of(point: Point, mesh: Mesh) -> light.Scene:
    """The mesh with its materials and light, restricted to what Mitsuba has where that is compared."""
    settings = point.workload_options
    is_own = settings.materials == "own"
    room = lit(point.scene, mesh, point.camera) if is_own else lit_room(mesh)
    return with_plain_light(room) if settings.against == "mitsuba" else room


def lamps(mesh: Mesh, count: int) -> tuple[light.PointLight, ...]:
    """`count` point lights all over the box of the mesh; their total power does not depend on the count."""
    low, size = mesh.bounds[0].astype(np.float64), np.ptp(mesh.bounds, axis=0).astype(np.float64)
    places = low + size * (0.1 + 0.8 * np.random.default_rng(1).random((count, 3)))
    power = float((size**2).sum()) / 4.0 / max(count, 1)
    return tuple(light.PointLight(tuple(place), power=power) for place in places.tolist())


def panorama() -> light.PanoramaSky:
    """A sky of 1 above a ground of 0.2, with a small sun."""
    texels = np.full((32, 64, 3), 0.2, np.float32)
    texels[:16] = 1.0
    texels[8, 20] = _SUN
    return light.PanoramaSky(texels)


def atlas_of(point: Point, mesh: Mesh) -> Atlas:
    """Charts of the mesh, cached beside fetched scenes, with as many empty rows below as the occupancy needs."""
    size, occupancy = point.workload_options.size, point.workload_options.occupancy
    atlas = Atlas.unwrap(mesh, size, kept_in=default_cache() / "atlases", time_limit_s=point.time_limit_s)
    return atlas if occupancy is None else emptier(mesh, atlas, occupancy)


def emptier(mesh: Mesh, atlas: Atlas, occupancy: float) -> Atlas:
    """The same texels on a map of which they are at most that share."""
    used = int(np.ceil(np.nanmax(atlas.uv[..., 1])))
    height = max(used, round(len(Texels.of(mesh, atlas)) / occupancy / atlas.width))
    return Atlas(np.nan_to_num(atlas.uv), atlas.chart, atlas.width, height)


def stage_s(baker: AnyBaker, *stages: str) -> float:
    """Seconds of these stages in all rounds together; the library's baker has no stages."""
    return sum(baker.stage_s.get(one, 0.0) for one in stages) if isinstance(baker, WaveBaker) else 0.0


def measure(point: Point) -> Measured:
    """Bake rounds of samples. Raises InputError and MemoryBudgetError as `Baker` does."""
    settings, mesh = point.workload_options, load_mesh(point)
    scene, start = bake_scene(point, mesh), perf_counter()
    atlas = atlas_of(point, mesh)
    options = settings.options(point.threads, point.build_quality)
    with ExitStack() as stack:

        def baker(scene: light.Scene = scene, atlas: Atlas = atlas, **changes: Any) -> Any:
            given = vars(options) | changes
            if settings.is_depth_first:
                given = {name.name: given[name.name] for name in fields(BakeOptions)}
            kind: Any = Baker if settings.is_depth_first else WaveBaker
            one = stack.enter_context(kind(scene, atlas, **given))
            one.add(1)  # compiles
            one.rays = one.lanes = 0
            one.stage_s = {}
            return one

        own = baker()
        results: dict[str, Any] = {"atlas_s": perf_counter() - start}
        bakers = {OWN: own}
        if settings.other is not None:
            full = settings.against == "occupancy"
            bakers[OTHER] = baker(
                _see_through(scene) if settings.against == "translucency" else scene,
                emptier(mesh, atlas, FULLEST) if full else atlas,
                seed=1,
                **settings.other,
            )
        if settings.priority:
            made: Any = make_own(point, mesh, point.camera)
            with made as tracer:
                for _ in range(2):  # the first compiles
                    begin = perf_counter()
                    tracer.look(point.camera)
                    own.visible = visible_texels(own.texels, tracer.trace(), own.rays_scene)
                    results["culling_map_s"] = perf_counter() - begin
            if settings.other is None:
                bakers |= {WHOLE_MAP: baker(seed=1), WITHOUT_VIEW: baker()}
                bakers[WHOLE_MAP].visible = own.visible
            else:
                bakers[OTHER].visible = own.visible
        calls, theirs = _calls(bakers, settings.samples), None
        if settings.against == "mitsuba":
            theirs = MitsubaPaths(room_of(point, mesh), own, settings.samples)
            calls[OTHER] = theirs.add
        timed = timed_rounds(point, calls)
        rounds = timed.rounds + point.warmup
        results |= _told(own, rounds, settings.samples)
        if OTHER in bakers:
            results |= _against(own, bakers[OTHER], rounds)
        if theirs is not None:
            at_best = median(timed.samples[OTHER]) - theirs.coherent_cost_s()
            again = baker(seed=1)
            again.add(int(own.samples.max()) - 1)
            results |= theirs.against(own.maps, again.maps) | {"best_other_ratio": at_best / median(timed.samples[OWN])}
        rows = bakers.get(WITHOUT_VIEW, own)
        if settings.against != "translucency" and len(bakers) > 1:
            pair = (bakers[WHOLE_MAP], rows) if WHOLE_MAP in bakers else (own, bakers[OTHER])
            results["error_over_forecast"] = _error_over_forecast(*pair)
        if own.visible is not None:
            results |= _times_to("visible_", own.maps, own.visible, timed.samples[OWN], settings.samples)
        if rows.visible is None:
            every = np.ones(len(own.texels), bool)
            taken = timed.samples.get(WITHOUT_VIEW, timed.samples[OWN])
            results |= _times_to("", rows.maps, every, taken, settings.samples)
        if settings.denoise:
            pair = baker(seed=1, threads=None), baker(seed=2, threads=None)  # maps do not depend on threads
            results |= finishing(*pair, settings.final_samples, own.rays_scene.threads)
    return measured(results, timed)


def _see_through(scene: light.Scene) -> light.Scene:
    """The scene with a face that is not quite opaque."""
    shines = np.array([any(one.emission) for one in scene.materials])[scene.face_materials]
    face, numbers = int(np.argmin(shines)), np.array(scene.face_materials)
    pane = MetallicRoughness(scene.materials[numbers[face]].plain, opacity=_NEARLY, alpha="blend")
    numbers[face] = len(scene.materials)
    return replace(scene, materials=[*scene.materials, pane], face_materials=numbers)


def _calls(bakers: dict[str, AnyBaker], samples: int) -> dict[str, Callable[[], object]]:
    def call(name: str, baker: AnyBaker) -> Callable[[], object]:
        if isinstance(baker, Baker) or baker.visible is None:
            return lambda: baker.add(samples)
        return lambda: add_visible(baker, samples, and_others=name == WHOLE_MAP)

    return {name: call(name, baker) for name, baker in bakers.items()}


def add_visible(baker: WaveBaker, samples: int, and_others: bool) -> None:
    """So many samples more of what the view shows, and then perhaps of all other texels."""
    assert baker.visible is not None
    baker.add(samples, baker.visible)
    if and_others:
        baker.add(samples, ~baker.visible)


def _told(baker: AnyBaker, rounds: int, samples: int) -> dict[str, Any]:
    texels, visible, waves = baker.texels, baker.visible, baker if isinstance(baker, WaveBaker) else None
    first = len(texels) if visible is None else int(visible.sum())
    return {
        "rays_per_round": baker.rays // rounds,
        "paths_per_round": first * samples,
        "lane_utilisation": 1.0 if waves is None else waves.rays / max(1, waves.lanes),
        "batch_fill": None if waves is None else _batch_fill(waves, first, samples),
        "buffer_bytes": 0 if waves is None else waves.buffer_bytes,
        "texels": len(texels),
        "charts": texels.atlas.charts,
        "texels_lost": texels.faces_lost,
        "map_occupancy": texels.occupancy,
        "visible_share": None if visible is None else float(visible.mean()),
    } | {f"{stage}_s": stage_s(baker, stage) / rounds for stage in STAGES if waves is not None}


def _batch_fill(baker: WaveBaker, texels: int, samples: int) -> float:
    """Share of the room of a wave that texels fill with rays."""
    expansion, room = min(samples, baker.options.expansion), baker.paths_at_once
    batches = -(-texels // max(1, room // expansion))
    return texels * expansion / (batches * room) if batches else 0.0


def _against(own: AnyBaker, other: AnyBaker, rounds: int) -> dict[str, float | None]:
    which = np.ones(len(own.texels), bool) if own.visible is None else own.visible
    variances = [_variance(one.maps, which) for one in (own, other)]
    return {
        "other_rays_per_round": other.rays / rounds,
        "variance_ratio": variances[1] / variances[0] if all(variances) else None,  # type: ignore[operator]
        "tracing_ratio": stage_s(other, *TRACING) / max(stage_s(own, *TRACING), 1e-9),
        "shading_ratio": stage_s(other, *SHADING) / max(stage_s(own, *SHADING), 1e-9),
    }


def _variance(lightmap: Lightmap, which: Any) -> float | None:
    """Variance of one sample over the squared mean of the light: the square of its relative error."""
    used = which & lightmap.valid
    mean = float(lightmap.luminance[used].mean()) if used.any() else 0.0
    return float(lightmap.variance[used].mean()) / mean**2 if mean > 0.0 else None


def _error_over_forecast(one: AnyBaker, other: AnyBaker) -> float | None:
    """The difference of two maps of other random numbers over the error that they forecast, where both have all their
    samples."""
    maps = [baker.maps for baker in (one, other)]
    used = maps[0].valid & maps[1].valid
    for lightmap in maps:
        used &= lightmap.samples == lightmap.samples.max()
    forecast = sum(float((lightmap.variance[used] / lightmap.samples[used]).sum()) for lightmap in maps)
    square = float(squared_differences(*maps)[used].sum())
    return sqrt(square / forecast) if forecast > 0.0 else None


def _times_to(kind: str, lightmap: Lightmap, which: Any, taken: tuple[float, ...], count: int) -> dict[str, float]:
    """Seconds to an error whose square is the variance of one sample over their number: at most, as they are spread
    evenly."""
    one, sample_s = _variance(lightmap, which), median(taken) / count
    if one is None:
        return {}
    return {f"{kind}time_to_rmse_{limit}_s": one / (limit / 100) ** 2 * sample_s for limit in THRESHOLDS}
