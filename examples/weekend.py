"""The last scene of Ray Tracing in One Weekend
============================================

The last scene of "Ray Tracing in One Weekend", as paths show it and as hybrid rendering does.

::

    python -m examples.weekend --samples 256

Primary visibility is the rasteriser's, all other rays are Embree's. Writes `weekend.png`: above by path tracing, below
with a sun's soft shadows and ambient occlusion; and says what share of the time went where.
"""

from __future__ import annotations

from dataclasses import replace

import atra
from atra import light
from atra.light.pictures.files import srgb_of
from examples import parts
from scenes.lit.weekend import WEEKEND_CAMERA, weekend


def shares(renderer: light.Renderer) -> str:
    """What part each stage has in the last samples."""
    whole = sum(renderer.stage_s.values())
    return ", ".join(f"{stage} {seconds / whole:.0%}" for stage, seconds in renderer.stage_s.items())


def main(arguments: list[str] | None = None) -> dict[str, dict[str, float]]:
    """Seconds by stage, of each renderer."""
    made = parts.parser(__doc__, width=600, height=400)
    made.add_argument("--samples", type=int, default=64, help="of each pixel")
    made.add_argument("--bounces", type=int, default=15, help="most reflections")
    made.add_argument("--segments", type=int, default=24, help="around a small ball")
    options = made.parse_args(arguments)
    scene = weekend(options.segments)
    book = replace(scene, lights=())  # it has no sun
    camera = atra.Camera(**WEEKEND_CAMERA, width=options.width, height=options.height)
    pictures, told = [], {}
    for name, renderer in (
        ("paths", light.PathRenderer(book, camera, threads=options.threads, bounces=options.bounces)),
        ("hybrid", light.HybridRenderer(scene, camera, threads=options.threads, occlusion_length=1.0)),
    ):
        with renderer:
            renderer.add(options.samples)
            pictures.append(srgb_of(renderer.image))
            told[name] = renderer.stage_s
            print(f"{name}: {options.samples} samples of {scene.mesh.triangle_count} triangles, {shares(renderer)}")
    parts.save(
        options.out / "weekend.png", parts.beside([picture.swapaxes(0, 1) for picture in pictures]).swapaxes(0, 1)
    )
    return told


if __name__ == "__main__":
    main()
