"""A lightmap
==========

A lightmap: the built-in box lit by its lamp, texel by texel, and shown with nothing but its map.

::

    python -m examples.bake --samples 256

Writes `bake.png`: the box in clay, at 1, 16 and all samples, looked up in the finished map. Says how much of the light
came from where, and checks that the light that a closed white box sends around is a geometric series.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import atra
from atra.light import Atlas, Baker, Lightmap, PointLight, Scene, Seams, clay_view, constant_sky, lit_view
from atra.light.lightmaps.finish.export import exposure_of, finished
from atra.light.pictures.files import srgb_of
from examples import parts
from scenes.cornell_box import CORNELL_BOX_CAMERA
from scenes.lit.rooms import lit_cornell_box


def picture(lightmap: Lightmap, scene: Scene, hits: atra.Hits, exposure: float) -> NDArray[np.uint8]:
    """The view as the map lights it."""
    seams = Seams.of(scene.mesh, lightmap.texels.atlas)
    image = finished(lightmap, lightmap.combined, seams)
    return srgb_of(exposure * lit_view(hits, scene, lightmap.texels.atlas, image))


def check_furnace(threads: int | None) -> float:
    """How far the mean light in a closed box of albedo one half is off its closed form, relatively.

    A lamp in it sends 4 pi onto walls of 24 square units; every bounce keeps one half.
    """
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32)
    quads = np.array([(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)])
    box = atra.Mesh(corners, quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3))
    scene = Scene.plain(box, (0.5, 0.5, 0.5), lights=[PointLight((0.2, 0.1, -0.3))], sky=constant_sky(0.0))
    places = (
        np.stack(np.divmod(np.arange(6), 3), axis=1)[:, None] + 0.1 + 0.8 * np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    )
    atlas = Atlas.of_uv(places[:, [0, 1, 2, 0, 2, 3]].reshape(12, 3, 2) / 3, 60, 60)  # 16 x 16 whole texels of a side
    with Baker(scene, atlas, threads=threads, bounces=4) as baker:
        baker.add(64)
        expected = 4 * np.pi / 24 * (1 - 0.5**5) / (1 - 0.5)
        return float(abs(baker.maps.luminance.mean() / expected - 1.0))


def main(arguments: list[str] | None = None) -> dict[str, float]:
    """Shares of light, and how far the furnace is off."""
    made = parts.parser(__doc__, width=400, height=400)
    made.add_argument("--samples", type=int, default=128, help="of each texel")
    made.add_argument("--size", type=int, default=256, help="texels along a side of the map")
    options = made.parse_args(arguments)
    scene = lit_cornell_box()
    camera = atra.Camera(**CORNELL_BOX_CAMERA, width=options.width, height=options.height)
    with atra.RasterTracer(scene.mesh, camera, threads=options.threads) as tracer:
        hits = tracer.trace()
    maps = []
    with Baker(scene, size=options.size, threads=options.threads) as baker:
        baker.look(camera)
        for target in (1, 16, options.samples):
            while baker.advance(target):
                pass
            maps.append(baker.maps)
    last = maps[-1]
    exposure = exposure_of(last)
    pictures = [srgb_of(clay_view(hits)), *(picture(one, scene, hits, exposure) for one in maps)]
    parts.save(options.out / "bake.png", parts.beside(pictures))
    whole = last.combined.sum()
    told = {name: float(last.light(name).sum() / whole) for name in ("direct", "indirect", "environment")}
    told["furnace"] = check_furnace(options.threads)
    print(f"{options.samples} samples of {len(last.texels)} texels: {told['direct']:.0%} direct, ", end="")
    print(f"{told['indirect']:.0%} after bounces; a furnace is off by {told['furnace']:.2%}")
    return told


if __name__ == "__main__":
    main()
