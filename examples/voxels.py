"""Solid voxels
============

Solid voxels: one image of parallel rays, a column of cells for every pixel.

::

    python -m examples.voxels --scene parcel --cells 96

A cell is solid if the ray through its centre has entered more often than left before it: if the surfaces before it are
odd in number. Writes `voxels.png`, the cells with the upper part taken off. Says how many cells are wrong, for a ball
by closed form; how many differ from those of columns along x and y; and the same of trimesh's voxelizer, which makes
every cell solid that the surface meets, and all that these enclose, hollows too.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter

import numpy as np
import trimesh
from numpy.typing import NDArray

import atra
from examples import parts, solids
from examples.radiograph import inner_radius
from experiments.drawing.shading import shade


@dataclass(frozen=True, eq=False)
class Voxels:
    """Cells about the multiples of `pitch`, as trimesh has them.

    cells: (X, Y, Z) bool, solid or not. low: (3,) int64, cell (0, 0, 0) is centred at low * pitch.
    odd_columns: rays that leave less often than they enter; 0 for a closed mesh.
    """

    cells: NDArray[np.bool_]
    low: NDArray[np.int64]
    pitch: float
    odd_columns: int = 0

    @property
    def volume(self) -> float:
        return int(self.cells.sum()) * self.pitch**3

    @property
    def centres(self) -> NDArray[np.float64]:
        """(X, Y, Z, 3), scene units."""
        numbers = np.moveaxis(np.indices(self.cells.shape), 0, -1) + self.low
        return numbers.astype(np.float64) * self.pitch


def pitch_of(mesh: atra.Mesh, cells: int) -> float:
    """For so many cells along the longest side, less half a one: so no centre lies in the sides of its box."""
    return float(np.ptp(mesh.bounds, axis=0).max()) / (cells - 0.5)


def range_of(mesh: atra.Mesh, pitch: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Numbers of the lowest and of the highest cell along x, y and z, between whose centres the mesh lies."""
    low, high = mesh.bounds.astype(np.float64) / pitch
    return np.floor(low).astype(np.int64), np.ceil(high).astype(np.int64)


def fill(mesh: atra.Mesh, pitch: float, axis: int = 2, threads: int = 1) -> Voxels:
    """The cells of a closed mesh, by columns along an axis."""
    low, high = range_of(mesh, pitch)
    right, down = (axis + 1) % 3, (axis + 2) % 3  # right x down = axis
    counts = high - low + 1
    eye = (low + high) / 2 * pitch
    eye[axis] = (low[axis] - 1) * pitch  # a cell before the first one
    axes = np.eye(3)
    camera = atra.OrthographicCamera(
        tuple(eye.tolist()), tuple((eye + axes[axis]).tolist()), tuple((-axes[down]).tolist()),
        float(counts[down] * pitch), int(counts[right]), int(counts[down]),
    )  # fmt: skip
    with atra.RasterTracer(mesh, camera, threads=threads) as tracer:
        count = tracer.gather(atra.Count()).count
        layers = tracer.gather(atra.Layers(max(int(count.max()), 1)))
    turns = np.zeros((counts[axis] + 1, *count.shape), np.bool_)  # one more, behind the last cell
    for depth in layers.depth:
        y, x = np.nonzero(np.isfinite(depth))
        first = np.ceil(depth[y, x] / np.float32(pitch) - 1).astype(np.int64)  # the first cell whose centre is behind
        turns[np.clip(first, 0, counts[axis]), y, x] ^= True
    solid = np.logical_xor.accumulate(turns[:-1], axis=0)
    return Voxels(np.moveaxis(solid, (0, 1, 2), (axis, down, right)), low, pitch, int((count % 2).sum()))


def fill_by_trimesh(mesh: trimesh.Trimesh, pitch: float, like: Voxels) -> Voxels:
    """The same by trimesh: all cells that the surface meets, and the holes in them filled."""
    grid = trimesh.voxel.creation.voxelize(mesh, pitch).fill()
    cells = np.zeros_like(like.cells)
    start = np.rint(grid.translation / pitch).astype(np.int64) - like.low
    cells[tuple(slice(first, first + size) for first, size in zip(start, grid.shape, strict=True))] = grid.matrix
    return Voxels(cells, like.low, pitch)


def wrong_cells(found: Voxels, mesh: atra.Mesh, near: float = 0.0) -> int:
    """Cells whose centre is outside of the ball and that are solid, or the other way round.

    mesh: the ball; what lies between its flat faces and the ball through its corners may be either. near: centres as
    near to the surface as this, scene units, may be either, too.
    """
    from_centre = np.linalg.norm(found.centres, axis=-1)
    hollow = ~found.cells & (from_centre < inner_radius(mesh) - near)
    return int((hollow | (found.cells & (from_centre > solids.BALL_RADIUS + near))).sum())


def picture(found: Voxels, width: int, height: int) -> NDArray[np.uint8]:
    """(H, W, 3) uint8: cells as cubes, those above the middle taken off."""
    cells = found.cells.copy()
    cells[:, cells.shape[1] // 2 :] = False
    scale = trimesh.transformations.scale_and_translate(found.pitch, found.low * found.pitch)
    cubes = trimesh.voxel.VoxelGrid(cells, scale).hollow().as_boxes()
    mesh = atra.Mesh(cubes.vertices, cubes.faces, "cells")
    with atra.RasterTracer(mesh, atra.Camera(**solids.pose_of(mesh), width=width, height=height)) as tracer:
        return shade(tracer.trace())


def compare(mesh: atra.Mesh, pitch: float, threads: int = 1) -> tuple[Voxels, Voxels]:
    """Ours along z and trimesh's, after saying how they fare."""
    start = perf_counter()
    ours = fill(mesh, pitch, threads=threads)
    own_s = perf_counter() - start
    given = trimesh.Trimesh(mesh.vertices, mesh.faces)
    start = perf_counter()
    theirs = fill_by_trimesh(given, pitch, ours)
    trimesh_s = perf_counter() - start
    others = [fill(mesh, pitch, axis, threads).cells for axis in (0, 1)]
    print(f"{mesh.name}, {' x '.join(map(str, ours.cells.shape))} cells, volume of the mesh {given.volume:.5g}")
    for name, found, seconds in (("parallel rays", ours, own_s), ("trimesh", theirs, trimesh_s)):
        differing = int(np.maximum(*((found.cells != other).sum() for other in others)))
        told = f"volume {found.volume:.5g}, {differing} cells differ from columns along x or y, {seconds:.3g} s"
        if mesh.name == "ball":
            untouched = wrong_cells(found, mesh, near=np.sqrt(3) / 2 * pitch)
            told += f", {wrong_cells(found, mesh)} wrong by closed form, {untouched} of them untouched by the surface"
        print(f"  {name}: {told}")
    print(f"  odd columns: {ours.odd_columns}")
    return ours, theirs


def main(arguments: list[str] | None = None) -> dict[str, tuple[Voxels, Voxels]]:
    """What `compare` returns, of the ball and of the scene."""
    made = parts.parser(__doc__, scene="parcel", width=640, height=480)
    made.add_argument("--cells", type=int, default=96, help="along the longest side")
    options = made.parse_args(arguments)
    fill(solids.ball(1), 0.5, threads=options.threads)  # so that no time has compilation in it
    found = {}
    for name in {"ball": None, options.scene: None}:
        mesh, _ = solids.load(name)
        found[name] = compare(mesh, pitch_of(mesh, options.cells), options.threads)
    ours, _ = found[options.scene]
    parts.save(options.out / "voxels.png", picture(ours, options.width, options.height))
    return found


if __name__ == "__main__":
    main()
