"""Closed meshes around and before an eye, whose edges and corners rays pass, and how many rays are lost in them."""

from __future__ import annotations

import numpy as np
import trimesh

import atra
from tests.meshes import joined

SIZE = 65
"""Pixels along a side of an image; odd, so that the middle column and row look straight ahead."""


def camera(degrees: float = 90.0, size: int = SIZE, way: tuple[float, float, float] = (0, 0, -1)) -> atra.Camera:
    """At the origin, along -z or another way."""
    up = (0, 1, 0) if way[1] == 0 else (0, 0, 1)
    return atra.Camera((0, 0, 0), way, up, degrees, size, size)


WAYS = ((0, 0, -1), (0, 0, 1), (0, 1, 0), (0, -1, 0), (1, 0, 0), (-1, 0, 0))


def roof() -> atra.Mesh:
    """Two triangles that cover the whole image; the edge between them passes through pixel centres."""
    return atra.Mesh([(-3, -3, -1.3), (3, 3, -3.7), (3, -3, -2.2), (-3, 3, -2.9)], [(0, 2, 1), (1, 3, 0)], "roof")


def cube(seed: int, cells: int = 2) -> atra.Mesh:
    """A cube around the origin whose grid of vertices lies in the directions of pixel centres' diagonals, each at a
    random distance: its edges pass through pixels of all six views of 90 degrees."""
    random = np.random.default_rng([seed, 26])
    grid = trimesh.creation.box((2, 2, 2))
    for _ in range(cells.bit_length() - 1):
        grid = grid.subdivide()
    vertices = grid.vertices * random.uniform(0.3, 4.0, len(grid.vertices))[:, None]
    return atra.Mesh(vertices, grid.faces[:, ::-1], f"cube {seed}")


def needles(seed: int, count: int = 200) -> atra.Mesh:
    """A tube around the z axis of long thin triangles, closed by two fans."""
    random = np.random.default_rng([seed, 27])
    angles = np.sort(random.uniform(0, 2 * np.pi, count))
    ring = np.column_stack([np.cos(angles), np.sin(angles)])
    ends = [np.column_stack([ring, np.full(count, z)]) for z in (30.0, -30.0)]
    after = np.roll(np.arange(count), -1)
    low, high = np.arange(count), np.arange(count) + count
    faces = [(low, after, high), (after, after + count, high)]
    faces += [(np.full(count, 2 * count), after, low), (np.full(count, 2 * count + 1), high, after + count)]
    vertices = np.vstack([*ends, [(0, 0, 30.0), (0, 0, -30.0)]])
    return atra.Mesh(vertices, np.vstack([np.column_stack(one) for one in faces]), f"needles {seed}")


def ball(subdivisions: int, place: tuple[float, float, float] = (0, 0, 0), radius: float = 1.0) -> atra.Mesh:
    found = trimesh.creation.icosphere(subdivisions, radius)
    return atra.Mesh(found.vertices + place, found.faces, f"ball {subdivisions} at {place}")


def level_set(kind: str, cells: int, radius: float = 1.0) -> atra.Mesh:
    """A sphere or a torus by marching tetrahedra: many slivers, and corners of many triangles."""
    axis = np.linspace(-1.6, 1.6, cells + 1) * radius
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    if kind == "sphere":
        values = np.sqrt(x * x + y * y + z * z) - radius
    else:
        values = np.sqrt((np.sqrt(x * x + y * y) - radius) ** 2 + z * z) - 0.45 * radius
    points = np.stack([x, y, z], axis=-1)
    vertices: list[np.ndarray] = []
    names: dict[tuple[int, int], int] = {}
    faces: list[tuple[int, int, int]] = []
    number = np.arange(values.size).reshape(values.shape)
    flat_values, flat_points = values.ravel(), points.reshape(-1, 3)

    def between(a: int, b: int) -> int:
        key = (min(a, b), max(a, b))
        if key not in names:
            t = flat_values[key[0]] / (flat_values[key[0]] - flat_values[key[1]])
            names[key] = len(vertices)
            vertices.append(flat_points[key[0]] + t * (flat_points[key[1]] - flat_points[key[0]]))
        return names[key]

    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    tetrahedra = [(0, 5, 1, 6), (0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6)]
    sides = np.stack([values[i : i + cells, j : j + cells, k : k + cells] < 0 for i, j, k in corners])
    for i, j, k in np.argwhere(sides.any(axis=0) & ~sides.all(axis=0)):
        cell = [int(number[i + a, j + b, k + c]) for a, b, c in corners]
        for four in tetrahedra:
            inside = [cell[n] for n in four if flat_values[cell[n]] < 0]
            outside = [cell[n] for n in four if flat_values[cell[n]] >= 0]
            if len(inside) in (1, 3):
                one, others = (inside[0], outside) if len(inside) == 1 else (outside[0], inside)
                faces.append(tuple(between(one, other) for other in others))
            elif len(inside) == 2:
                crossed = ((0, 0), (0, 1), (1, 1), (1, 0))
                a, b, c, d = (between(inside[m], outside[n]) for m, n in crossed)
                faces += [(a, b, c), (a, c, d)]
    return atra.Mesh(np.array(vertices), np.array(faces), f"{kind} of {cells}")


def sliver(seed: int) -> tuple[atra.Mesh, atra.Camera]:
    """A thin triangle, seen almost edge-on, between two that cover the image; its edges pass through pixel centres.

    No copy may show it, so an aligned image has a seam there (`atra.alignment.second_pass`).
    """
    random, size = np.random.default_rng([seed, 28]), 128
    pitch = 2 * np.tan(np.radians(20)) / size

    def place(x: float, y: float, depth: float) -> tuple[float, float, float]:
        return (x + 0.5 - size / 2) * pitch * depth, -(y + 0.5 - size / 2) * pitch * depth, -depth

    middle, aside = int(random.integers(20, 100)), 10.0 ** random.uniform(-5, -1)
    depths = random.uniform(1, 4, 5)
    at = [(-20, -20), (size + 20, size + 20), (middle, middle - aside), (-30, size + 60), (size + 60, -30)]
    faces = [np.roll(one, random.integers(3)) for one in ((0, 3, 1), (0, 1, 2), (0, 2, 4), (2, 1, 4))]
    mesh = atra.Mesh([place(*xy, depth) for xy, depth in zip(at, depths, strict=True)], faces, f"sliver {seed}")
    return mesh, camera(40.0, size)


def turned(mesh: atra.Mesh, seed: int) -> atra.Mesh:
    """The mesh turned about the origin anyhow."""
    matrix = trimesh.transformations.random_rotation_matrix(np.random.default_rng([seed, 29]).random(3))[:3, :3]
    return atra.Mesh(mesh.vertices @ matrix.T, mesh.faces, mesh.name)


def edge_rays(mesh: atra.Mesh, eye: np.ndarray, count: int, seed: int) -> atra.Rays:
    """From places near an eye to points on edges of a mesh, as near as float32 has them."""
    random = np.random.default_rng([seed, 30])
    face = mesh.faces[random.integers(0, mesh.triangle_count, count)]
    share = random.random((count, 1))
    targets = mesh.vertices[face[:, 0]] * (1 - share) + mesh.vertices[face[:, 1]] * share
    origins = (eye + random.uniform(-0.05, 0.05, (count, 3))).astype(np.float32)
    return atra.Rays(origins, (targets - origins).astype(np.float32))


def around(mesh: atra.Mesh) -> atra.Mesh:
    """With a box far around it: what slips through the mesh is a farther hit."""
    low, high = mesh.bounds
    middle, reach = (low + high) / 2, 3.0 * float((high - low).max())
    outer = trimesh.creation.box(bounds=[middle - reach, middle + reach])
    return joined(mesh, atra.Mesh(outer.vertices, outer.faces))
