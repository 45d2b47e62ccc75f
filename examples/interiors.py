"""Interiors by path tracing
=========================

The built-in interiors by path tracing, denoised.

::

    python -m examples.interiors --samples 64

Writes `interiors.png`: the living room beside the atrium. Denoising needs the extra `denoise`; `--noisy` does without.
"""

from __future__ import annotations

import atra
from atra import light
from atra.light.pictures.files import srgb_of
from examples import parts
from scenes.built_in import BUILT_IN
from scenes.lit.interiors import lit_atrium, lit_living_room

INTERIORS = {"living_room": lit_living_room, "atrium": lit_atrium}


def main(arguments: list[str] | None = None) -> None:
    """Write the picture."""
    made = parts.parser(__doc__, width=640, height=480)
    made.add_argument("--samples", type=int, default=64, help="samples of each pixel")
    made.add_argument("--noisy", action="store_true", help="leave the noise")
    options = made.parse_args(arguments)
    pictures = []
    for name, make in INTERIORS.items():
        camera = atra.Camera(**BUILT_IN[name].camera, width=options.width, height=options.height)
        with light.PathRenderer(make(), camera, threads=options.threads, bounces=7, jitter="pixel") as renderer:
            renderer.add(options.samples)
            image = renderer.image if options.noisy else renderer.denoised()
        pictures.append(srgb_of(light.toned(image, light.stops_of(image, "auto"), "neutral")))
    parts.save(options.out / "interiors.png", parts.beside(pictures))


if __name__ == "__main__":
    main()
