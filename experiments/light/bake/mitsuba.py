"""As many paths by Mitsuba 3: its path integrator, from points of the same texels."""

from __future__ import annotations

from dataclasses import replace
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.light import Baker, GradientSky, Lightmap, Scene
from atra.light.lightmaps.paths import Paths
from atra.light.lightmaps.paths_kernels import LUMINANCE
from experiments.light.mitsuba_light import load_mitsuba, parts_of, suns_of
from experiments.light.waves_kernels import DIRECTION, ORIGIN, generate, new_wave

_VARIANT = "llvm_ad_rgb"
"""The variant for CPUs and three colours that takes rays from anywhere, compiled for vectors."""

_PATHS_AT_ONCE = 1 << 20
"""Paths of a wavefront; starting smaller ones costs more."""

_OTHER_SEED = 2
"""Seed of the points, other than the baker's."""

_ROUNDS = 8
"""Rounds after which the same points come again."""

_NEVER = 1 << 30


def with_plain_light(room: Scene) -> Scene:
    """The scene in light that both have: a sky of one colour, that at the horizon, and suns without an angle."""
    sky = room.sky
    assert isinstance(sky, GradientSky)
    colour = tuple((0.5 * (np.array(sky.below) + np.array(sky.above))).tolist())
    lights = [replace(light, angle_degrees=0.0) for light in room.lights]  # type: ignore[arg-type, call-arg]
    return replace(room, sky=replace(sky, below=colour, above=colour), lights=lights)


class MitsubaPaths:
    """Samples of all texels of a baker's map by Mitsuba's `path` integrator, in its threads.

    A path starts at a point of its texel in a cosine-distributed direction, with the baker's bounces and roulette. At
    every surface but the last it samples one light or the sky; from the texel, a ray goes to each sun, which no path
    finds. (Our paths sample lamps from the texel, too.) Points are the baker's with another seed, made before any clock
    runs. Only luminance is summed, where ours keep colours by kind.

    room: the scene with its light. Raises InputError where Mitsuba cannot be used, and for light that it lacks.
    """

    def __init__(self, room: Scene, baker: Baker, samples: int) -> None:
        options = baker.options
        mi, self._drjit = load_mitsuba(_VARIANT, "workload.against=mitsuba", options.threads)
        self._mi, self._texels, self._samples, self._rounds = mi, len(baker.texels), samples, 0
        self._seed = 0
        roulette_from = _NEVER if options.roulette_from is None else max(1, options.roulette_from)
        suns = suns_of(room.lights)
        self._suns = [
            (mi.Vector3f(*(-part for part in sun["direction"])), mi.Color3f(sun["irradiance"]["value"]) / np.pi)
            for sun in suns.values()
        ]
        parts = parts_of(mi, room) | suns
        if "sky" in parts and len(room.lights):
            parts["sky"]["sampling_weight"] = 0.0  # found by chance, as ours is: no shadow rays to it
        self._scene = mi.load_dict(parts)
        self._path = mi.load_dict({"type": "path", "max_depth": options.bounces + 1, "rr_depth": roulette_from})
        self._sampler = mi.load_dict({"type": "independent"})
        found = [starts(baker, samples, number) for number in range(_ROUNDS)]
        self._points = [mi.Point3f(points) for points, _ in found]
        self._normals = mi.Normal3f(found[0][1])
        self._sums = [self._drjit.zeros(mi.Float, self._texels) for _ in range(2)]
        self._drjit.make_opaque(self._points, self._normals, self._sums)
        self.add()  # compiles

    def add(self) -> None:
        """So many samples more of every texel. Returns when all are summed."""
        waves = max(1, -(-self._texels * self._samples // _PATHS_AT_ONCE))
        texels = -(-self._texels // waves)
        for first in range(0, self._texels, texels):
            self._follow(first * self._samples, min(texels, self._texels - first) * self._samples)
        self._rounds += 1
        self._drjit.sync_thread()

    def _follow(self, first: int, count: int) -> None:
        """A wavefront of paths that lie side by side."""
        mi, dr = self._mi, self._drjit
        which, normal, ray = self._first_rays(first, count)
        start = ray.o
        light, _, _ = self._path.sample(self._scene, self._sampler, mi.RayDifferential3f(ray))
        for to_sun, strength in self._suns:
            cosine = dr.dot(normal, to_sun)
            seen = (cosine > 0.0) & ~self._scene.ray_test(mi.Ray3f(start, to_sun), coherent=True, active=cosine > 0.0)
            light += dr.select(seen, cosine, 0.0) * strength
        luminance = sum(float(weight) * channel for weight, channel in zip(LUMINANCE, light, strict=True))
        for total, values in zip(self._sums, (luminance, luminance * luminance), strict=True):
            dr.scatter_add(total, values, which // self._samples)
        dr.eval(self._sums)

    def _first_rays(self, first: int, count: int) -> tuple[Any, Any, Any]:
        """Numbers of paths, and of each the normal where it starts and its first ray."""
        mi, dr = self._mi, self._drjit
        self._seed += 1
        self._sampler.seed(self._seed, count)
        which = dr.arange(mi.UInt32, count) + dr.opaque(mi.UInt32, first)  # as data: a number would compile again
        start = dr.gather(mi.Point3f, self._points[self._rounds % _ROUNDS], which)
        normal = dr.gather(mi.Normal3f, self._normals, which)
        sphere = mi.warp.square_to_cosine_hemisphere(self._sampler.next_2d())
        return which, normal, mi.Ray3f(start, mi.Frame3f(normal).to_world(sphere))

    def coherent_cost_s(self) -> float:
        """Seconds of a round that Mitsuba loses because its integrator treats the first rays of paths as coherent:
        the time of such rays traced as coherent, less that of the same rays traced as incoherent."""
        count = min(_PATHS_AT_ONCE, self._texels * self._samples)
        taken: dict[bool, list[float]] = {True: [], False: []}
        for _ in range(_ROUNDS):
            ray = self._first_rays(0, count)[2]
            self._drjit.eval(ray)
            for coherent, seconds in taken.items():
                start = perf_counter()
                self._drjit.eval(self._scene.ray_intersect_preliminary(ray, coherent=coherent).t)
                self._drjit.sync_thread()
                seconds.append(perf_counter() - start)
        return (median(taken[True]) - median(taken[False])) * self._texels * self._samples / count

    def against(self, lightmap: Lightmap, again: Lightmap) -> dict[str, float]:
        """Mean light of all texels here over that of a map, and the standard error of that; and the ratio of squared
        errors, relative to the mean, after as many samples as the map has.

        again: the same map by other random numbers. Samples here are independent; ours are spread evenly, so that only
        two maps tell their error.
        """
        taken = self._rounds * self._samples
        mean, square = (np.array(total, np.float64) / taken for total in self._sums)
        variance = np.maximum(square - mean**2, 0.0) * taken / (taken - 1)
        ours = mean_and_error(lightmap.luminance, lightmap.variance, lightmap.samples)
        ratio, error = ratio_and_error(mean_and_error(mean, variance, taken), ours)
        squared = float(squared_differences(lightmap, again).mean()) / 2
        theirs = float(variance.mean()) / float(lightmap.samples.max()) / ratio**2
        varies = theirs / max(squared, np.finfo(float).tiny)
        return {"other_light_ratio": ratio, "other_light_error": error, "variance_ratio": varies}


def squared_differences(one: Lightmap, other: Lightmap) -> NDArray[np.float64]:
    """(N,) squares of the differences in luminance between two maps of the same N texels."""
    return (one.luminance - other.luminance).astype(np.float64) ** 2


def starts(baker: Baker, samples: int, number: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """(3, N * samples) each: points that samples of texels start from in a round, texel by texel, and normals there."""
    texels = baker.texels
    count = len(texels) * samples
    wave, every = new_wave(count), np.arange(len(texels), dtype=np.int32)
    paths = Paths(baker.scene, texels, replace(baker.options, seed=_OTHER_SEED))
    generate(wave, every, 0, len(texels), samples, np.full_like(every, number * samples), paths.charts, paths.surfaces)
    points, down = (np.ascontiguousarray(wave.floats[row : row + 3, :count]) for row in (ORIGIN, DIRECTION))
    return points, -down


def mean_and_error(light: NDArray[Any], variance: NDArray[Any], samples: Any) -> tuple[float, float]:
    """Mean light of all texels and its standard error, from (N,) means, variances of one sample, and sample counts."""
    return float(light.mean()), float(np.sqrt((variance.astype(np.float64) / samples).sum()) / len(light))


def ratio_and_error(upper: tuple[float, float], lower: tuple[float, float]) -> tuple[float, float]:
    """The quotient of two independent means, each with its standard error, and the standard error of the quotient."""
    ratio = upper[0] / lower[0]
    return ratio, ratio * float(np.hypot(upper[1] / upper[0], lower[1] / lower[0]))
