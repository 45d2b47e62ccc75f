"""All hits in one picture
=======================

What all hits along a ray are good for, in one picture: a radiograph, transparent layers and solid voxels.

::

    python -m examples.all_hits --scene parcel

Writes `all_hits.png`, the three side by side.
"""

from __future__ import annotations

import numpy as np

import atra
from examples import parts, radiograph, solids, transparency, voxels

_ATTENUATION, _OPACITY, _CELLS = 1.6, 0.3, 72


def main(arguments: list[str] | None = None) -> None:
    options = parts.parser(__doc__, scene="parcel", width=360, height=300).parse_args(arguments)
    mesh, pose = solids.load(options.scene)
    camera = atra.Camera(**pose, width=options.width, height=options.height)
    film = radiograph.picture(radiograph.lengths(mesh, camera, options.threads), _ATTENUATION)
    glass, _ = transparency.composite(
        transparency.all_layers(mesh, camera, options.threads),
        transparency.colours_of_bodies(mesh, camera),
        np.full(mesh.triangle_count, _OPACITY),
    )
    cells = voxels.fill(mesh, voxels.pitch_of(mesh, _CELLS), threads=options.threads)
    blocks = voxels.picture(cells, options.width, options.height)
    parts.save(options.out / "all_hits.png", parts.beside([film, np.rint(255 * glass).astype(np.uint8), blocks]))


if __name__ == "__main__":
    main()
