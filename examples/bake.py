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
from atra.light import Baker, BakeScene, Lightmap, Seams, Surface, clay_view, lit_view
from atra.light.lightmaps.finish.export import exposure_of, finished
from atra.light.pictures.files import srgb_of
from examples import parts
from scenes.cornell_box import CORNELL_BOX_CAMERA
from scenes.lit.rooms import lit_cornell_box


def picture(lightmap: Lightmap, scene: BakeScene, hits: atra.Hits, exposure: float) -> NDArray[np.uint8]:
    """The view as the map lights it."""
    seams = Seams.of(scene.mesh, lightmap.texels.atlas)
    image = finished(lightmap, lightmap.combined, seams)
    return srgb_of(exposure * lit_view(hits, scene, lightmap.texels.atlas, image))


def check_furnace(threads: int | None) -> float:
    """How far the mean light of a closed box that shines and reflects one half is off its closed form, relatively."""
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32)
    quads = np.array([(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)])
    box = atra.Mesh(corners, quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3))
    with Baker(BakeScene(box, Surface.plain(box, 0.5, 1.0)), size=32, threads=threads, bounces=4) as baker:
        baker.add(64)
        return float(abs(baker.maps.luminance.mean() / ((1 - 0.5**5) / (1 - 0.5)) - 1.0))


def main(arguments: list[str] | None = None) -> dict[str, float]:
    """Shares of light, and how far the furnace is off."""
    made = parts.parser(__doc__, width=400, height=400)
    made.add_argument("--samples", type=int, default=128, help="of each texel")
    made.add_argument("--size", type=int, default=256, help="texels along a side of the map")
    options = made.parse_args(arguments)
    scene = BakeScene.of(lit_cornell_box())
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
