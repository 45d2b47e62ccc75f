"""Two eyes
========

Two eyes, one set of rays: the right eye's geometry is translated onto the left's (paper §6).

::

    python -m examples.stereo --scene atrium

Writes `stereo.png`, the two images side by side (left eye on the left), and `anaglyph.png` for red and cyan glasses.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

import atra
from examples import parts
from experiments.drawing.shading import shade


def eyes(camera: atra.Camera, distance: float) -> tuple[atra.Camera, atra.Camera]:
    """Two cameras `distance` apart, half of it to either side of `camera`, looking the same way."""
    step = distance / 2 * camera.axes[0]
    return tuple(
        replace(camera, eye=tuple(camera.eye + side * step), target=tuple(camera.target + side * step))
        for side in (-1, 1)
    )  # type: ignore[return-value]


def anaglyph(left: NDArray[np.uint8], right: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Red of the left image, green and blue of the right one, both grey: (H, W, 3) uint8."""
    grey = [np.rint(image @ np.array([0.30, 0.59, 0.11])).astype(np.uint8) for image in (left, right)]
    return np.stack([grey[0], grey[1], grey[1]], axis=-1)


def main(arguments: list[str] | None = None) -> atra.Frames:
    made = parts.parser(__doc__, scene="atrium", width=768, height=768)
    made.add_argument("--distance", type=float, default=0.012, help="between the eyes, as a share of what they look at")
    options = made.parse_args(arguments)
    mesh, pose = parts.load(options.scene)
    camera = atra.Camera(**pose, width=options.width, height=options.height)
    distance = options.distance * float(np.linalg.norm(np.subtract(camera.target, camera.eye)))
    split = atra.Split(*parts.largest_split(camera.width, 128), camera.width, camera.height)
    alignment = atra.Alignment.of_eyes(*eyes(camera, distance), split)
    with atra.FramesTracer(mesh, alignment, threads=options.threads) as tracer:
        frames = tracer.trace()
    left, right = (shade(hits) for hits in frames)
    parts.save(options.out / "stereo.png", parts.beside([left, right]))
    parts.save(options.out / "anaglyph.png", anaglyph(left, right))
    for name, hits in zip(("left", "right"), frames, strict=True):
        with atra.PixelTracer(mesh, hits.camera, packet_width=1, threads=options.threads) as alone:
            print(
                f"{name} eye against its image traced alone:",
                atra.compare(hits, alone.trace()),
            )
    return frames


if __name__ == "__main__":
    main()
