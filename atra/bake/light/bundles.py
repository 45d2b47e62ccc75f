"""Light by bundles: parallel rays across the whole scene, on each of which all surfaces that face each other exchange
light."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import cos, pi, sin, sqrt
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.aligned_memory import aligned_empty
from atra.bake.charts.texels import Texels
from atra.bake.light.tables import tables_of
from atra.bake.options import BakeOptions
from atra.bake.surface import BakeScene
from atra.errors import InputError
from atra.gathering.gathered import LayerHits
from atra.gathering.reductions import MOST_LAYERS, Layers
from atra.geometry.mesh import Mesh
from atra.geometry.orthographic import OrthographicCamera
from atra.geometry.sampling import sub_pixel_offsets
from atra.geometry.view import View
from atra.kernels.baking.bundles import NOWHERE, PLACE_WORDS, exchange, settle, words_of
from atra.laps import Laps
from atra.options import Choices
from atra.tracing.budgets import check_needed_bytes
from atra.whole_numbers import is_whole_number

_OFTEN = 0.2
"""Of the directions so far: after so many more, texels give what they have by then."""


class GathersLayers(Protocol):
    """A tracer that finds all hits: `AlignedTracer`, `PixelTracer` or `RasterTracer`."""

    mesh: Mesh

    def look(self, camera: View) -> None: ...

    def gather(self, what: Layers, offset: tuple[float, float], out: LayerHits | None) -> LayerHits: ...


@dataclass(frozen=True)
class BundleOptions(Choices):
    """Options of `LightBundles`.

    bounces: how often light is reflected before it reaches a texel, at most. size: rays along a side of a bundle, which
    is as wide as the scene; texels much smaller than the space between rays are seldom hit. layers: hits of a ray that
    are known; see `LightBundles.rays_cut`. seed: of random numbers.
    Raises InputError, with the value.
    """

    bounces: int = 4
    size: int = 256
    layers: int = 64
    seed: int = 0

    def __post_init__(self) -> None:
        for name, low, high in (
            ("bounces", 0, 1 << 10), ("size", 1, 1 << 14), ("layers", 1, MOST_LAYERS), ("seed", 0, (1 << 32) - 1),
        ):  # fmt: skip
            value = getattr(self, name)
            if not is_whole_number(value) or not low <= value <= high:
                raise InputError(f"{name} of bundles is {value!r}, expected a whole number from {low} to {high}")


class LightBundles:
    """Light of the texels of a map, direction by direction.

        bundles = LightBundles(scene, texels, direct)
        with atra.RasterTracer(mesh, bundles.camera) as tracer:
            bundles.add(tracer, 256)
        bundles.light

    Rays of one direction meet a surface as often as its cosine says, so what a texel's hits receive, on average, is its
    light. A hit receives what leaves the surface that it sees along its ray: the albedo times the light that the texel
    there has so far, after one reflection less. So the light converges to that of `Baker` with as many bounces, as far
    as it is alike all over a texel, and what comes too late in the first directions is lost among all others.

    Backs of faces take no light and give none; a `Baker` has them reflect, which no closed surface shows. A texel
    stands for all triangles that it holds, a `Baker`'s for one of them. Hits nearer to each other than rays of a
    `Baker` start off surfaces do not see each other. Exchange takes one thread.

    scene: of opaque faces. texels: of its map. direct: (N, 3), straight from lights and faces that shine, such as
    `Baker(..., bounces=0).maps.direct`: bundles find the sky and what is reflected. options, changes: of
    `BundleOptions`.
    directions: added so far. hits: (N,) int64, of each texel's front; where there are none, only `direct` is known.
    rays, rays_cut: how many met anything, and how many more than `layers`: what is beyond the last known hit is left
    out. stage_s: seconds in which tracers look and find hits, and in which light is exchanged.
    Raises InputError for options, faces that let light on, and light that does not fit; MemoryBudgetError.
    """

    def __init__(
        self,
        scene: BakeScene,
        texels: Texels,
        direct: ArrayLike,
        options: BundleOptions | None = None,
        **changes: Any,
    ) -> None:
        self.options = BundleOptions.of(type(self).__name__, options, changes)
        assert scene.surface is not None
        if scene.surface.panes.any():
            raise InputError("some faces let light on, which bundles do not know; use Baker")
        if scene.mesh is not texels.mesh:
            raise InputError(f"the scene is of {scene.mesh!r}, expected the mesh of the texels, {texels.mesh!r}")
        self.direct = np.array(direct, np.float32, order="C")
        if self.direct.shape != (len(texels), 3) or not np.isfinite(self.direct).all():
            raise InputError(f"direct has shape {self.direct.shape}, expected finite numbers ({len(texels)}, 3)")
        self.scene, self.texels = scene, texels
        self._tables = tables_of(scene, texels, BakeOptions(environment="bsdf"))
        texel_of = np.full(texels.atlas.width * texels.atlas.height, NOWHERE, np.int32)
        texel_of[texels.number] = np.arange(len(texels), dtype=np.int32)
        self._maps = _places(texels), texel_of
        words, sums = words_of(self.options.bounces), 1 + 3 * (self.options.bounces + 1)
        needed = len(texels) * (2 * 4 * words + 8 * sums)
        what = f"sums of {len(texels):,} texels after up to {self.options.bounces} bounces"
        check_needed_bytes(needed, None, what, "use a smaller map, or fewer bounces")
        self._fresh, self._light = (aligned_empty((len(texels), words), np.float32) for _ in range(2))
        self._fresh[:] = self._light[:] = 0.0
        self._totals = np.zeros((len(texels), sums))
        self._on_ray = np.empty((2, self.options.layers), np.int64)
        self._random = np.random.Generator(np.random.PCG64(self.options.seed))
        self._shift = self._random.random(2)
        self._settled = -1
        self._found: tuple[GathersLayers, LayerHits] | None = None  # whose memory is to be written to again
        self.stage_s: dict[str, float] = {}
        self.directions = self.rays = self.rays_cut = 0

    @property
    def camera(self) -> OrthographicCamera:
        """Of the next bundle, as wide as the scene is from corner to corner: rays of all directions lie equally dense.
        Directions are a low-discrepancy sequence over half of the sphere, as each line is taken both ways."""
        u, v = ((sub_pixel_offsets(1, self.directions)[0] + self._shift) % 1.0).tolist()
        across = sqrt(max(0.0, 1.0 - u * u))
        direction = across * cos(2 * pi * v), across * sin(2 * pi * v), u
        bounds, size = self.scene.mesh.bounds.astype(np.float64), self.options.size
        camera = OrthographicCamera.of_light(direction, bounds, size, size)
        return replace(camera, view_height=float(np.linalg.norm(bounds[1] - bounds[0])) * (1.0 + 2.0 / size))

    def add(self, tracer: GathersLayers, directions: int = 1) -> None:
        """Add so many bundles. tracer: of the scene's mesh, planned and built; it is told to look along them.

        Raises InputError for a number below 1 and a tracer of another mesh, and as `gather` does.
        """
        if not is_whole_number(directions) or directions < 1:
            raise InputError(f"{directions!r} directions are wanted, expected a whole number of at least 1")
        if tracer.mesh is not self.scene.mesh:
            raise InputError(f"the tracer is of {tracer.mesh!r}, expected one of {self.scene.mesh!r}")
        lap = Laps(self.stage_s)
        for _ in range(directions):
            camera = self.camera
            x, y = self._random.random(2).tolist()
            tracer.look(camera)
            lap("look")
            earlier = self._found[1] if self._found is not None and self._found[0] is tracer else None
            found = tracer.gather(Layers(self.options.layers), (x, y), earlier)
            self._found = tracer, found
            lap("hits")
            if self.directions >= self._settled * (1.0 + _OFTEN):
                self._settle()
            exchange(
                (found.depth, found.prim_id, found.count), _lines(camera, (x, y)), self._tables, self._maps,
                self._on_ray, self.options.bounces, self._light, self._fresh,
            )  # fmt: skip
            lap("exchange")
            self.directions += 1
            self.rays += int(np.count_nonzero(found.count))
            self.rays_cut += int(np.count_nonzero(found.count > self.options.layers))

    def _settle(self) -> None:
        settle(self._fresh, self._totals, self.direct, self._light)
        self._settled = self.directions

    def _means(self) -> NDArray[np.float64]:
        """(N, B + 1, 3): the sky's light, and light after each number of reflections."""
        sums = self._sums()
        return np.asarray(sums[:, 1:].reshape(len(self.texels), -1, 3) / np.maximum(sums[:, :1, None], 1.0))

    def _sums(self) -> NDArray[np.float64]:
        return self._totals + self._fresh[:, : self._totals.shape[1]]

    @property
    def hits(self) -> NDArray[np.int64]:
        return self._sums()[:, 0].astype(np.int64)

    @property
    def environment(self) -> NDArray[np.float32]:
        """(N, 3) float32, straight from the sky."""
        return self._means()[:, 0].astype(np.float32)

    @property
    def indirect(self) -> NDArray[np.float32]:
        """(N, 3) float32, after bounces."""
        return self._means()[:, 1:].sum(axis=1).astype(np.float32)

    @property
    def light(self) -> NDArray[np.float32]:
        """(N, 3) float32, linear RGB: all light, as `Lightmap.combined`."""
        return (self.direct + self._means().sum(axis=1)).astype(np.float32)


def _lines(camera: OrthographicCamera, offset: tuple[float, float]) -> NDArray[np.float64]:
    """As `exchange` takes them."""
    origins, directions = camera.rays(np.array([0, 1, 0]), np.array([0, 0, 1]), offset)
    first, right, down = origins @ camera.axes + camera.eye
    return np.stack([first, right - first, down - first, directions[0] @ camera.axes])


def _places(texels: Texels) -> NDArray[np.float64]:
    """(F, PLACE_WORDS); NaN of triangles that have no place."""
    mesh, uv = texels.mesh, texels.atlas.uv
    corner, second, third = (mesh.vertices[mesh.faces[:, k]].astype(np.float64) for k in range(3))
    edges = second - corner, third - corner
    normal = np.cross(*edges)
    across = np.cross(edges[1], normal), np.cross(normal, edges[0])
    with np.errstate(divide="ignore", invalid="ignore"):
        weights = [way / np.einsum("fi,fi->f", way, edge)[:, None] for way, edge in zip(across, edges, strict=True)]
        slopes = sum((uv[:, k + 1] - uv[:, 0])[:, :, None] * weights[k][:, None] for k in range(2))
        start = uv[:, 0] - np.einsum("fai,fi->fa", slopes, corner)
    return np.concatenate([slopes, start[:, :, None]], axis=2).reshape(-1, PLACE_WORDS)
