"""Time of baking: rounds of samples by the point's settings, and by a bake that lacks one of its means."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from math import sqrt
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np

from atra import light
from atra.geometry.mesh import Mesh
from atra.light import Atlas, Baker, Emissive, Lambertian, MetallicRoughness, Seams, Texels, denoised, dilated
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
from experiments.light.bake.mitsuba import MitsubaPaths, squared_differences, with_plain_light
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


def measure(point: Point) -> Measured:
    """Bake rounds of samples. Raises InputError and MemoryBudgetError as `Baker` does."""
    settings, mesh = point.workload_options, load_mesh(point)
    scene, atlas = bake_scene(point, mesh), atlas_of(point, mesh)
    options = settings.options(point.threads, point.build_quality)
    results: dict[str, Any] = {}
    with ExitStack() as stack:

        def baker(scene: light.Scene = scene, atlas: Atlas = atlas, **changes: Any) -> Any:
            kind: Any = Baker if settings.is_depth_first else WaveBaker
            one = stack.enter_context(kind(scene, atlas, **options | changes))
            one.add(1)  # compiles
            one.rays = one.lanes = 0
            one.stage_s = {}
            return one

        own = baker()
        bakers = {OWN: own}
        if settings.other is not None:
            bakers[OTHER] = baker(
                _see_through(scene) if settings.against == "translucency" else scene,
                emptier(mesh, atlas, FULLEST) if settings.against == "occupancy" else atlas,
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
            bakers[OTHER if settings.other is not None else WHOLE_MAP].visible = own.visible
        calls, theirs = {name: _call(name, one, settings.samples) for name, one in bakers.items()}, None
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
        if own.visible is not None:
            results |= _times_to("visible_", own, timed.samples[OWN], settings.samples)
        whole = WITHOUT_VIEW if WITHOUT_VIEW in bakers else OWN
        if bakers[whole].visible is None:
            results |= _times_to("", bakers[whole], timed.samples[whole], settings.samples)
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


def _call(name: str, baker: AnyBaker, samples: int) -> Callable[[], None]:
    """So many samples more of what the view shows, and then perhaps of all other texels."""

    def add() -> None:
        if isinstance(baker, Baker) or baker.visible is None:
            baker.add(samples)
            return
        baker.add(samples, baker.visible)
        if name == WHOLE_MAP:
            baker.add(samples, ~baker.visible)

    return add


def _told(baker: AnyBaker, rounds: int, samples: int) -> dict[str, Any]:
    texels, visible = baker.texels, baker.visible
    first = len(texels) if visible is None else int(visible.sum())
    told = {
        "rays_per_round": baker.rays // rounds,
        "paths_per_round": first * samples,
        "lane_utilisation": 1.0,
        "buffer_bytes": 0,
        "texels": len(texels),
        "charts": texels.atlas.charts,
        "map_occupancy": texels.occupancy,
        "visible_share": None if visible is None else float(visible.mean()),
    }
    if isinstance(baker, Baker):
        return told
    return told | {
        "lane_utilisation": baker.rays / max(1, baker.lanes),
        "batch_fill": _batch_fill(baker, first, samples),
        "buffer_bytes": baker.buffer_bytes,
        **{f"{stage}_s": baker.stage_s.get(stage, 0.0) / rounds for stage in STAGES},
    }


def _batch_fill(baker: WaveBaker, texels: int, samples: int) -> float:
    """Share of the room of a wave that texels fill with rays."""
    expansion, room = min(samples, baker.expansion), baker.paths_at_once
    batches = -(-texels // max(1, room // expansion))
    return texels * expansion / (batches * room) if batches else 0.0


def _against(own: Any, other: Any, rounds: int) -> dict[str, float | None]:
    variances = [_variance(one) for one in (own, other)]
    found: dict[str, float | None] = {"other_rays_per_round": other.rays / rounds}
    found["variance_ratio"] = variances[1] / variances[0] if all(variances) else None  # type: ignore[operator]
    for name, stages in (("tracing", TRACING), ("shading", SHADING)):
        taken, others = (sum(one.stage_s.get(stage, 0.0) for stage in stages) for one in (own, other))
        found[f"{name}_ratio"] = others / max(taken, 1e-9)
    return found


def _variance(baker: AnyBaker) -> float | None:
    """Variance of one sample over the squared mean of the light, of texels that come first: the square of its relative
    error."""
    lightmap = baker.maps
    used = lightmap.valid if baker.visible is None else lightmap.valid & baker.visible
    mean = float(lightmap.luminance[used].mean()) if used.any() else 0.0
    return float(lightmap.variance[used].mean()) / mean**2 if mean > 0.0 else None


def _times_to(kind: str, baker: AnyBaker, taken: tuple[float, ...], count: int) -> dict[str, float]:
    """Seconds to an error whose square is the variance of one sample over their number: at most, as they are spread
    evenly."""
    one, sample_s = _variance(baker), median(taken) / count
    if one is None:
        return {}
    return {f"{kind}time_to_rmse_{limit}_s": one / (limit / 100) ** 2 * sample_s for limit in THRESHOLDS}


_REFERENCE = 4
"""Samples of the raw map that a denoised one is compared with, as a multiple of its own."""


def finishing(baker: Baker, other: Baker, samples: int, threads: int) -> dict[str, float | None]:
    """What denoising and stitching gain on a map of so many samples, beside raw maps of `_REFERENCE` times as many.

    baker, other: by different random numbers. The raw maps' error is found from their difference, as their variances
    forecast too much of it.
    """
    baker.add(samples - int(baker.samples.max()))
    raw = baker.maps
    clean = denoised(raw, threads)
    for one in (baker, other):
        one.add(_REFERENCE * samples - int(one.samples.max()))
    own, known = baker.maps, other.maps
    used = raw.valid & own.valid & known.valid
    noise = float(squared_differences(own, known)[used].mean()) / 2.0
    square = float(squared_differences(clean, known)[used].mean()) - noise
    seams = Seams.of(raw.texels.mesh, raw.texels.atlas)
    image = dilated(raw.texels, raw.combined, raw.valid)
    before = seams.step(image)
    return {
        "denoised_ratio": sqrt(max(square, 0.0) / noise) if noise > 0.0 else None,
        "seam_step_ratio": seams.step(seams.stitched(image)) / before if before > 0.0 else None,
    }
