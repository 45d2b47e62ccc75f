"""Meshes, near the world's origin and at UTM coordinates, and kinds of rays at them."""

from __future__ import annotations

import os

import numpy as np
import trimesh

import atra
from scenes.directory import load_scene_from_directory
from tests.closed_meshes import cornell_boxes, sphere
from tests.meshes import beams, random_triangles

SCENES = ("cornell_box", "mitsuba", "fireplace_room", "sponza")

UTM = np.array([512345.671875, 4598765.4375, 120.25])
"""Metres, whole multiples of `STEP`."""

STEP = 2.0**-10
"""Vertices of far meshes lie on multiples of this, which are stored without rounding wherever the mesh's origin is one,
so all libraries are asked of one mesh."""


def _ground(heights):
    """A mesh over a square grid of heights, two triangles a square."""
    n = len(heights)
    x, y = np.meshgrid(np.arange(float(n)), np.arange(float(n)), indexing="ij")
    corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).reshape(-1)
    one, other = (corner, corner + n, corner + 1), (corner + 1, corner + n, corner + n + 1)
    faces = np.concatenate([np.stack(part, 1) for part in (one, other)])
    return np.stack([x, y, heights], -1).reshape(-1, 3), faces


def _near():
    """(name, vertices, faces) of meshes made here."""
    random = np.random.default_rng(3)
    torus = trimesh.creation.torus(20.0, 7.0, 96, 48)
    terrain = _ground(3 * random.normal(size=(120, 120)))
    steps = _ground(random.integers(0, 6, (80, 80)).astype(float))
    for name, mesh in (("sphere", sphere(5, 10.0)), ("boxes", cornell_boxes()), ("needles", beams(2, 1000))):
        yield name, mesh.vertices, mesh.faces
    yield "torus", torus.vertices, torus.faces
    yield "terrain", *terrain
    yield "whole steps", *steps


def mesh_names():
    """(name, whether at UTM coordinates) of all meshes there are."""
    names = [name for name, _, _ in _near()]
    scenes = SCENES if os.environ.get("ATRA_SCENES") else ()
    return [(name, False) for name in (*scenes[::-1], *names, "soup")] + [(name, True) for name in names]


def mesh_of(name, is_far):
    """(mesh, vertices as given)."""
    if name in SCENES:
        mesh = load_scene_from_directory(name).mesh
    elif name == "soup":
        mesh = random_triangles(3000, 1)
    else:
        vertices, faces = next((v, f) for one, v, f in _near() if one == name)
        if is_far:
            vertices = np.round(vertices / STEP) * STEP + UTM
            return atra.Mesh(vertices, faces), vertices
        mesh = atra.Mesh(vertices, faces)
    return mesh, mesh.vertices


KINDS = ("random", "parallel", "coherent", "vertices", "edges", "grids", "in planes")


def rays_of(kind, corners, count, number, random):
    """(origins, directions), (N, 3) `number` each, of a kind of rays at triangles, (F, 3, 3) float64.

    vertices, edges: at corners and at midpoints of edges. grids: the same, of places rounded to a grid, seen from
    points of that grid, which float64 holds exactly. in planes: from one point of a triangle's plane far off to another
    in it, as nearly as `number` holds them.
    """
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    size = float((high - low).max())
    starts = random.uniform(low, high, (count, 3))
    some = corners[random.integers(0, len(corners), count)]
    weights = np.array([(1, 0, 0), (0.5, 0.5, 0)])[random.integers(0, 2, count)]
    aimed = np.einsum("nk,nkd->nd", weights, some)
    way = random.normal(size=3)
    sides = np.linalg.svd(way[None])[2][1:]
    match kind:
        case "random":
            ends = starts + size * random.normal(size=(count, 3))
        case "parallel":
            across = random.uniform(-0.7, 0.7, (count, 2)) @ sides * size
            starts = (low + high) / 2 - 2 * size * way / np.linalg.norm(way) + across
            ends = starts + 4 * size * way / np.linalg.norm(way)
        case "coherent":
            starts = np.tile(random.uniform(low, high), (count, 1))
            rows, columns = np.divmod(np.arange(count), int(np.sqrt(count)) + 1)
            across = np.stack([rows, columns], 1) / np.sqrt(count) - 0.5
            ends = starts + size * (way / np.linalg.norm(way) + across @ sides)
        case "vertices":
            ends = some[:, 0]
        case "edges":
            ends = (some[:, 0] + some[:, 1]) / 2
        case "grids":
            step = 2.0 ** np.floor(np.log2(size / 128))
            starts, ends = np.round(starts / step) * step, np.round(aimed / step) * step
            ends = np.where((starts == ends).all(axis=1, keepdims=True), starts + step, ends)
        case "in planes":
            one, other = (np.einsum("nk,nkd->nd", random.dirichlet((1, 1, 1), count), some) for _ in range(2))
            starts, ends = other - 8 * (one - other), one
    origins = starts.astype(number)
    directions = (ends - origins.astype(np.float64)).astype(number)
    if kind == "parallel":
        directions[:] = directions[0]
    return origins, directions
