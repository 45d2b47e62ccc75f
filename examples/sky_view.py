"""Sky view factors
================

The sky view factor of each face of a city model: which share of the light of an even sky reaches it.

::

    python -m examples.sky_view --rays 256

From each face rays start around its normal, spread as the cosine to it; the factor is the share that hits nothing and
heads above the horizon. Writes `sky_view.png`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import atra
from examples import city, parts


def around_up(count: int) -> NDArray[np.float64]:
    """(count, 3) float64, unit vectors around (0, 0, 1), spread as the cosine to it, along a spiral."""
    number = np.arange(count) + 0.5
    radius, angle = np.sqrt(number / count), np.pi * (3.0 - np.sqrt(5.0)) * number
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), np.sqrt(1.0 - number / count)], axis=1)


def sky_view(
    mesh: atra.Mesh,
    rays: int,
    threads: int = 1,
    at: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None,
) -> NDArray[np.float64]:
    """(F,) float64, the sky view factor of each face, or of the places and normals `at`; rays: from each."""
    origins, normals = city.places(mesh) if at is None else at
    side = np.where(np.abs(normals[:, 2:]) < 0.9, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
    one = np.cross(side, normals)
    one /= np.linalg.norm(one, axis=1, keepdims=True)
    other = np.cross(normals, one)
    seen = np.zeros(len(origins))
    with atra.RayScene(mesh, threads=threads) as scene:
        for x, y, z in around_up(rays):
            ways = x * one + y * other + z * normals
            seen += (ways[:, 2] > 0.0) & ~scene.occluded(origins, ways)
    return seen / rays


def main(arguments: list[str] | None = None) -> NDArray[np.float64]:
    """The sky view factor of each face of the city."""
    made = parts.parser(__doc__, width=960, height=640)
    made.add_argument("--rays", type=int, default=256, help="from each face")
    made.add_argument("--face", type=float, default=2.0, help="size of faces, metres")
    options = made.parse_args(arguments)
    mesh = city.city(size=options.face)
    seen = sky_view(mesh, options.rays, options.threads)
    print(f"faces see {seen.mean():.0%} of the sky on average")
    parts.save(options.out / "sky_view.png", city.picture(mesh, seen, options.width, options.height))
    return seen


if __name__ == "__main__":
    main()
