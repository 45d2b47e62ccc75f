"""A first image
=============

What the README shows: an image of a torus, its line of text and its depths.

::

    python -m examples.first_image

Writes `first_image.png`, depths as grey, and `strip.png`: triangles of the atrium, a radiograph, the living room lit.
"""

from __future__ import annotations

import numpy as np
import trimesh
from numpy.typing import NDArray
from PIL import Image

import atra
from examples import parts, radiograph, solids

_SIZE = 300  # pixels of each picture of the strip, across and down
_LIT = parts.IMAGES / "interiors.png"


def torus_hits() -> atra.Hits:
    """The README's example."""
    torus = trimesh.creation.torus(major_radius=2, minor_radius=0.8)
    mesh = atra.Mesh(torus.vertices, torus.faces)
    return atra.trace(mesh, atra.Camera.framing(mesh, width=640, height=480))


def triangle_colours(hits: atra.Hits) -> NDArray[np.uint8]:
    """A colour for each `prim_id`, (H, W, 3) uint8; a miss is white."""
    colours = np.random.default_rng(7).integers(40, 230, (hits.mesh.triangle_count, 3), np.uint8)
    picture = np.full((*hits.prim_id.shape, 3), 255, np.uint8)
    picture[hits.hit] = colours[hits.prim_id[hits.hit]]
    return picture


def strip(threads: int) -> NDArray[np.uint8]:
    """The three pictures side by side."""
    atrium, pose = parts.load("atrium")
    ids = atra.trace(atrium, atra.Camera(**pose, width=_SIZE, height=_SIZE), threads=threads)
    mesh, pose = solids.load("parcel")
    film = radiograph.lengths(mesh, atra.Camera(**pose, width=_SIZE, height=_SIZE), threads)
    with Image.open(_LIT) as lit:
        room = np.asarray(lit.convert("RGB").crop((0, 0, 400, 400)).resize((_SIZE, _SIZE)))
    return parts.beside([triangle_colours(ids), radiograph.picture(film, 1.6), room])


def main(arguments: list[str] | None = None) -> None:
    """Write both pictures."""
    options = parts.parser(__doc__).parse_args(arguments)
    hits = torus_hits()
    print(hits)
    options.out.mkdir(parents=True, exist_ok=True)
    hits.save(options.out / "first_image.png")
    parts.save(options.out / "strip.png", strip(options.threads))


if __name__ == "__main__":
    main()
