"""Three lenses
============

One room through three lenses: a barrel, a fisheye that sees 180 degrees across its height, and a panorama.

::

    python -m examples.lenses --scene living_room

Each image is exact in its own pixels: nothing is drawn on a plane and bent afterwards. Writes `lenses.png`.
"""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np

import atra
from examples import parts
from experiments.drawing.shading import shade


def cameras(pose: atra.Camera, width: int, height: int) -> dict[str, atra.LensCamera]:
    """The same eye behind three lenses; the panorama is twice as wide as high."""
    K = np.array([(0.55 * width, 0.0, width / 2 - 0.5), (0.0, 0.55 * width, height / 2 - 0.5), (0.0, 0.0, 1.0)])
    eye = np.array(pose.eye)
    barrel = atra.Camera.from_opencv(K, pose.axes, -pose.axes @ eye, width, height, (-0.22, 0.03, 0, 0))
    assert isinstance(barrel, atra.LensCamera)
    sensor = atra.ImagePlane.centred(pi / height, width, height)
    round_ = atra.LensCamera(pose.eye, pose.target, pose.up, width, height, lens=atra.FisheyeLens(), sensor=sensor)
    return {
        "barrel": barrel,
        "fisheye": round_,
        "panorama": atra.LensCamera.panorama(pose.eye, pose.target, pose.up, 2 * height),
    }


def main(arguments: list[str] | None = None) -> dict[str, atra.Hits]:
    made = parts.parser(__doc__, scene="living_room", width=400, height=320)
    made.add_argument("--nearer", type=float, default=0.5, help="share of the way to the target that the eye goes")
    options = made.parse_args(arguments)
    mesh, fields = parts.load(options.scene)
    pose = atra.Camera(**fields)
    nearer = np.array(pose.eye) + options.nearer * np.subtract(pose.target, pose.eye)
    seen = {}
    for name, camera in cameras(replace(pose, eye=tuple(nearer)), options.width, options.height).items():
        with atra.PixelTracer(mesh, camera, threads=options.threads) as tracer:
            seen[name] = tracer.trace()
        with atra.RasterTracer(mesh, camera, threads=options.threads) as other:
            print(f"{name}, packets against the rasteriser:", atra.compare(seen[name], other.trace()))
    parts.save(options.out / "lenses.png", parts.beside([shade(hits) for hits in seen.values()]))
    return seen


if __name__ == "__main__":
    main()
