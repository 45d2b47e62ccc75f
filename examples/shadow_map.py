"""A shadow map
============

A directional light's shadow map: parallel rays, drawn by the rasteriser.

::

    python -m examples.shadow_map --scene material_ball

The light's view of the whole scene is drawn as an orthographic image; a point that the camera sees is lit if nothing
in that image lies before it. Writes `shadow_map.png`: the camera's view with shadows, and what the light sees.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import atra
from examples import parts
from experiments.drawing.shading import shade

_BIAS = 2e-3  # of the scene's diagonal: a texel of the map is not a point


def points_seen(hits: atra.Hits) -> NDArray[np.float64]:
    """(N, 3) float64, the world points of all hits, row by row."""
    camera = hits.camera
    y, x = np.nonzero(hits.hit)
    origins, directions = camera.rays(x, y, hits.offset)
    return (origins + hits.depth[hits.hit][:, None] * directions) @ camera.axes + camera.eye


def is_lit(points: NDArray[np.float64], light: atra.Hits, bias: float) -> NDArray[np.bool_]:
    """(N,) bool: nothing in the light's image lies before the point by more than `bias`."""
    camera = light.camera
    from_eye = camera.to_eye_space(points)
    pixels = from_eye @ camera.to_pixels[:2, :3].T + camera.to_pixels[:2, 3]
    x, y = np.clip(np.floor(pixels).astype(int), 0, [camera.width - 1, camera.height - 1]).T
    return from_eye @ camera.axes[2] <= light.depth[y, x] + bias


def main(arguments: list[str] | None = None) -> atra.Hits:
    made = parts.parser(__doc__, scene="material_ball", width=768, height=768)
    made.add_argument("--direction", type=float, nargs=3, default=(0.5, -1.0, -0.35), help="the way the light travels")
    made.add_argument("--map", type=int, default=2048, help="pixels of the shadow map, across and down")
    options = made.parse_args(arguments)
    mesh, pose = parts.load(options.scene)
    camera = atra.Camera(**pose, width=options.width, height=options.height)
    with atra.PixelTracer(mesh, camera, threads=options.threads) as tracer:
        seen = tracer.trace()
    sun = atra.OrthographicCamera.of_light(tuple(options.direction), mesh.bounds, options.map, options.map)
    with atra.RasterTracer(mesh, sun, threads=options.threads) as tracer:
        light = tracer.trace()
    diagonal = float(np.linalg.norm(mesh.bounds[1] - mesh.bounds[0]))
    lit = is_lit(points_seen(seen), light, _BIAS * diagonal)
    picture = shade(seen).astype(np.float64)
    picture[seen.hit] *= np.where(lit, 1.0, 0.45)[:, None]
    from_light = parts.resized(shade(light), options.height, options.height)
    parts.save(options.out / "shadow_map.png", parts.beside([np.rint(picture).astype(np.uint8), from_light]))
    with atra.PixelTracer(mesh, sun, packet_width=1, threads=options.threads) as alone:
        print("shadow map against rtcIntersect1:", atra.compare(light, alone.trace()))
    return light


if __name__ == "__main__":
    main()
