"""Transparency in the right order
===============================

Transparency in the right order: coloured surfaces from front to back, out of the depth layers of an image.

::

    python -m examples.transparency --scene parcel --opacity 0.3
    python -m examples.transparency --scene atrium

Layers come sorted, however the triangles are; each adds its colour times what those before it let through. Writes
`transparency.png`, and `layers.tif`: the depth of every layer as one page of 32-bit floats, inf where there is none,
which image programs open as a stack. Three panes are compared with their closed form.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray
from PIL import Image

import atra
from atra.geometry.view import View
from examples import parts, solids

BACKGROUND = np.array([0.93, 0.94, 0.96])
_PALETTE = np.array(
    [
        (0.62, 0.66, 0.72), (0.72, 0.74, 0.78), (0.0, 0.45, 0.70), (0.84, 0.37, 0.0), (0.95, 0.75, 0.2),
        (0.80, 0.35, 0.65), (0.0, 0.62, 0.45),
    ]
)  # fmt: skip

PANES = (
    ((-0.8, -0.8, 0.0), (0.3, 0.3, 0.0), (0.9, 0.1, 0.1), 0.5),
    ((-0.5, -0.2, 1.0), (0.6, 0.9, 1.0), (0.1, 0.7, 0.2), 0.25),
    ((-0.1, -0.6, -1.0), (0.8, 0.5, -1.0), (0.1, 0.2, 0.9), 0.8),
)
"""Lowest and highest corner, colour and opacity of upright panes; in no order of depth."""


def all_layers(mesh: atra.Mesh, camera: View, threads: int = 1) -> atra.LayersResult:
    """As many layers as any pixel has."""
    with atra.RasterTracer(mesh, camera, threads=threads) as tracer:
        most = int(tracer.gather(atra.Count()).count.max())
        return tracer.gather(atra.Layers(max(most, 1)))


def composite(
    layers: atra.LayersResult, colours: NDArray[np.float64], opacities: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(H, W, 3) colours in front of BACKGROUND, and (H, W), the share of it that is seen.

    colours: (F, 3), opacities: (F,), in [0, 1], of each triangle.
    """
    left = np.ones(layers.count.shape)
    image = np.zeros((*left.shape, 3))
    for depth, prim_id in zip(layers.depth, layers.prim_id, strict=True):
        there = np.isfinite(depth)
        triangles = prim_id[there]
        image[there] += (left[there] * opacities[triangles])[:, None] * colours[triangles]
        left[there] *= 1 - opacities[triangles]
    return image + left[..., None] * BACKGROUND, left


def save_stack(path: Path, layers: NDArray[np.float32]) -> None:
    """(k, H, W) float32 -> one TIFF file, a page a layer; says where it is."""
    path.parent.mkdir(parents=True, exist_ok=True)
    first, *others = (Image.fromarray(np.ascontiguousarray(layer)) for layer in layers)
    first.save(path, save_all=True, append_images=others, compression="tiff_adobe_deflate")
    print(path)


def panes() -> atra.Mesh:
    """PANES, two triangles each."""
    corners = [[(x, y, low[2]) for x, y in ((low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1]))]
               for low, high, *_ in PANES]  # fmt: skip
    first = 4 * np.arange(len(PANES))[:, None]
    return atra.Mesh(np.reshape(corners, (-1, 3)), np.stack([first + (0, 1, 2), first + (0, 2, 3)], 1).reshape(-1, 3))


def colours_of_panes(camera: View) -> NDArray[np.float64]:
    """(H, W, 3) in closed form, for a camera that looks along -z: from back to front, over what is behind."""
    origins, directions = camera.rays(np.arange(camera.width), np.arange(camera.height)[:, None])
    start, way = origins @ camera.axes + camera.eye, directions @ camera.axes
    image = np.broadcast_to(BACKGROUND, (camera.height, camera.width, 3))
    for low, high, colour, opacity in sorted(PANES, key=lambda pane: pane[0][2]):
        point = start + (low[2] - start[..., 2:]) / way[..., 2:] * way
        inside = np.all((point > low)[..., :2] & (point < high)[..., :2], axis=-1, keepdims=True)
        image = np.where(inside, opacity * np.array(colour) + (1 - opacity) * image, image)
    return image


def check(threads: int = 1) -> float:
    """How far any colour of the panes is off its closed form, at most; from 0 to 1."""
    mesh, camera = panes(), atra.Camera((0.013, 0.017, 4), (0.013, 0.017, 0), fov_y_degrees=40, width=200, height=160)
    colours, opacities = (np.repeat([pane[part] for pane in PANES], 2, axis=0) for part in (2, 3))
    found, _ = composite(all_layers(mesh, camera, threads), colours, opacities)
    return float(np.abs(found - colours_of_panes(camera)).max())


def colours_of_bodies(mesh: atra.Mesh, camera: View) -> NDArray[np.float64]:
    """(F, 3): each connected body has a colour, darker where it is seen from the side."""
    merged = trimesh.Trimesh(mesh.vertices, mesh.faces)
    bodies = trimesh.graph.connected_component_labels(merged.face_adjacency, len(mesh.faces))
    corners = camera.to_camera_space(mesh.vertices)[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facing = np.abs(normals[:, 2]) / np.maximum(np.linalg.norm(normals, axis=1), np.finfo(float).tiny)
    return _PALETTE[bodies % len(_PALETTE)] * (0.35 + 0.65 * facing)[:, None]


def main(arguments: list[str] | None = None) -> atra.LayersResult:
    made = parts.parser(__doc__, scene="parcel", width=640, height=480)
    made.add_argument("--opacity", type=float, default=0.3, help="of every surface")
    options = made.parse_args(arguments)
    mesh, pose = solids.load(options.scene)
    camera = atra.Camera(**pose, width=options.width, height=options.height)
    layers = all_layers(mesh, camera, options.threads)
    opacities = np.full(mesh.triangle_count, options.opacity)
    image, left = composite(layers, colours_of_bodies(mesh, camera), opacities)
    parts.save(options.out / "transparency.png", np.rint(255 * image).astype(np.uint8))
    save_stack(options.out / "layers.tif", layers.depth)
    with atra.RasterTracer(mesh, camera, threads=options.threads) as tracer:
        product = tracer.gather(atra.Transmittance(1 - opacities)).transmittance
    print(f"{len(layers.depth)} layers; what they let through is off the product by {np.abs(left - product).max():.1e}")
    print(f"three panes: no colour is off its closed form by more than {check(options.threads):.1e}")
    return layers


if __name__ == "__main__":
    main()
