"""A radiograph
============

A radiograph: what is left of light that matter absorbs along its way, by the law of Beer and Lambert.

::

    python -m examples.radiograph --scene parcel --attenuation 2

Every ray is weakened by exp(-attenuation * length inside). Writes `radiograph.png`: parallel rays left, those of a
pinhole right, the more absorbed the lighter. The ways through a ball and a box are compared with their closed forms.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import atra
from atra.geometry.view import View
from examples import parts, solids

_CHECKED_PIXELS = 256, 192


def lengths(mesh: atra.Mesh, camera: View, threads: int = 1) -> NDArray[np.float32]:
    """(H, W) float32, how much of each ray lies inside, scene units."""
    with atra.RasterTracer(mesh, camera, threads=threads) as tracer:
        return tracer.gather(atra.Thickness()).along_rays


def transmitted(length: NDArray[np.float32], attenuation: float) -> NDArray[np.float32]:
    """The share of light that is left after `length`; attenuation: per scene unit."""
    return np.exp(-np.float32(attenuation) * length)


def world_rays(camera: View) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(H, W, 3) float64 each: where the ray of each pixel starts, and its direction of length 1."""
    origins, directions = camera.rays(np.arange(camera.width), np.arange(camera.height)[:, None])
    directions = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
    shape = camera.height, camera.width, 3
    return np.broadcast_to(origins @ camera.axes + camera.eye, shape), np.broadcast_to(directions @ camera.axes, shape)


def chords_of_ball(camera: View, radius: float) -> NDArray[np.float64]:
    """(H, W) float64, the length of each ray in a ball about the origin, in closed form."""
    origins, directions = world_rays(camera)
    along = np.einsum("hwi,hwi->hw", origins, directions)
    from_centre = np.einsum("hwi,hwi->hw", origins, origins) - along**2
    return 2 * np.sqrt(np.maximum(radius**2 - from_centre, 0.0))


def chords_of_box(camera: View, bounds: NDArray[np.float64]) -> NDArray[np.float64]:
    """(H, W) float64, the length of each ray between three pairs of planes, in closed form."""
    origins, directions = world_rays(camera)
    with np.errstate(divide="ignore"):  # along a plane it is never met
        ends = (bounds[:, None, None] - origins) / directions
    return np.maximum(ends.max(axis=0).min(axis=-1) - ends.min(axis=0).max(axis=-1), 0.0)


def inner_radius(mesh: atra.Mesh) -> float:
    """How far from the origin the nearest plane of a triangle is: a ball of this radius lies inside."""
    corners = mesh.vertices.astype(np.float64)[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return float(np.einsum("ij,ij->i", normals, corners[:, 0]).min())


def check(threads: int = 1) -> dict[str, float]:
    """By what is seen: how far the length of any ray is off its closed form, scene units.

    The ball has flat faces. It lies between two balls, those through its corners and within its faces, and so must
    its lengths.
    """
    off = {}
    for name in ("ball", "box"):
        mesh, pose = solids.load(name)
        for kind, camera in solids.views(mesh, pose, *_CHECKED_PIXELS).items():
            found = lengths(mesh, camera, threads)
            if name == "ball":
                least, most = (chords_of_ball(camera, radius) for radius in (inner_radius(mesh), solids.BALL_RADIUS))
            else:
                least = most = chords_of_box(camera, solids.BOX)
            off[f"{name}, {kind}"] = float(np.maximum(least - found, found - most).max())
    return off


def picture(length: NDArray[np.float32], attenuation: float) -> NDArray[np.uint8]:
    """(H, W, 3) uint8, black where all light is left, as on a film."""
    grey = np.rint(255 * np.clip(1 - transmitted(length, attenuation), 0, 1)).astype(np.uint8)
    return np.repeat(grey[..., None], 3, axis=-1)


def main(arguments: list[str] | None = None) -> dict[str, float]:
    """What `check` returns."""
    made = parts.parser(__doc__, scene="parcel", width=640, height=480)
    made.add_argument("--attenuation", type=float, default=1.6, help="per scene unit")
    options = made.parse_args(arguments)
    mesh, pose = solids.load(options.scene)
    cameras = solids.views(mesh, pose, options.width, options.height).values()
    pictures = [picture(lengths(mesh, camera, options.threads), options.attenuation) for camera in cameras]
    parts.save(options.out / "radiograph.png", parts.beside(pictures))
    off = check(options.threads)
    for name, most in off.items():
        print(f"{name}: no length is off its closed form by more than {most:.1e}")
    return off


if __name__ == "__main__":
    main()
