"""Building blocks of the procedural scenes: grids, boxes, turned profiles, tubes, cushions, leaves, and copies of them.

Everything is plain arithmetic without random numbers, so that a scene is the same at every call.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.geometry.mesh import Mesh

Floats = NDArray[np.float64]

_SMALLEST_EDGE = 1e-9  # metres; far below every real edge, far above the rounding of sin(pi)

# Fractional parts of multiples of these fill the unit interval evenly (Weyl); none is a rational multiple of another.
_IRRATIONALS = tuple(float(np.sqrt(prime)) for prime in (5, 2, 3, 7, 11, 13))


@dataclass(frozen=True, eq=False)
class Part:
    """A piece of a scene.

    vertices: (V, 3) float64, metres, y up. faces: (F, 3) int64 indices into them. stuff: (F,) words, what each
    triangle is made of; "" where nothing is said, and None where nothing is said at all.
    """

    vertices: Floats
    faces: NDArray[np.int64]
    stuff: NDArray[np.str_] | None = None

    @property
    def triangle_count(self) -> int:
        """F."""
        return len(self.faces)

    def to_mesh(self, name: str) -> Mesh:
        """The part as a mesh called `name`."""
        return Mesh(self.vertices.astype(np.float32), self.faces.astype(np.uint32), name=name)

    def moved(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Part:
        """The part, shifted by metres along each axis."""
        return Part(self.vertices + (x, y, z), self.faces, self.stuff)

    def scaled(self, x: float = 1.0, y: float = 1.0, z: float = 1.0) -> Part:
        """The part, stretched from the origin; (-1, 1, 1) mirrors it."""
        return Part(self.vertices * (x, y, z), self.faces, self.stuff)

    def turned(self, degrees: float, lean: float = 0.0) -> Part:
        """The part, leant about the x axis by `lean`, then turned about the y axis by `degrees`."""
        return Part(self.vertices @ frames([degrees], [lean])[0].T, self.faces, self.stuff)

    def made_of(self, stuff: str | NDArray[np.str_]) -> Part:
        """The part, made of that where nothing is said yet. stuff: one word, or (F,) of them."""
        given = np.broadcast_to(np.asarray(stuff), len(self.faces))
        return Part(self.vertices, self.faces, given if self.stuff is None else np.where(self.stuff, self.stuff, given))


def join(parts: Iterable[Part]) -> Part:
    """One part of many, faces in the order given."""
    listed = list(parts)
    first_vertex = np.cumsum([0] + [len(part.vertices) for part in listed[:-1]])
    return Part(
        np.concatenate([part.vertices for part in listed]),
        np.concatenate([part.faces + start for part, start in zip(listed, first_vertex, strict=True)]),
        None if all(part.stuff is None for part in listed) else np.concatenate([_stuff_of(part) for part in listed]),
    )


def _stuff_of(part: Part) -> NDArray[np.str_]:
    return np.full(len(part.faces), "") if part.stuff is None else part.stuff


def spread(count: int, channel: int = 0) -> Floats:
    """(count,) float64 in [0, 1): evenly spread, without visible order; channels are independent of one another."""
    return np.modf(np.arange(1, count + 1) * _IRRATIONALS[channel])[0]


def frames(turn_degrees: ArrayLike, lean_degrees: ArrayLike = 0.0, scale: ArrayLike = 1.0) -> Floats:
    """(N, 3, 3) float64 matrices: scale, lean about x, turn about y. Scalars are repeated."""
    turn, lean, size = np.broadcast_arrays(np.radians(turn_degrees), np.radians(lean_degrees), scale)
    ct, st, cl, sl, zero = np.cos(turn), np.sin(turn), np.cos(lean), np.sin(lean), np.zeros(turn.shape)
    rows = [np.stack(r, -1) for r in ((ct, st * sl, st * cl), (zero, cl, -sl), (-st, ct * sl, ct * cl))]
    return np.asarray(np.stack(rows, -2) * size[..., None, None])


def copies(part: Part, at: ArrayLike, matrices: Floats | None = None) -> Part:
    """`part` repeated at each of the places `at` (N, 3), first transformed by the matrix of that place, (N, 3, 3)."""
    places = np.asarray(at, np.float64)
    placed = part.vertices[None] if matrices is None else part.vertices[None] @ np.swapaxes(matrices, 1, 2)
    faces = part.faces[None] + (np.arange(len(places)) * len(part.vertices))[:, None, None]
    stuff = None if part.stuff is None else np.tile(part.stuff, len(places))
    return Part((placed + places[:, None]).reshape(-1, 3), faces.reshape(-1, 3), stuff)


def surface(points: ArrayLike, closed: bool = False) -> Part:
    """Triangles of a grid of points (M, N, 3): two for each mesh of the net, none where two corners coincide.

    closed: the last column joins the first.
    """
    grid = np.asarray(points, np.float64)
    m, n = grid.shape[:2]
    index = np.arange(m * n).reshape(m, n)
    right = np.roll(index, -1, axis=1)
    columns = slice(None) if closed else slice(None, -1)
    a, b = index[:-1, columns].ravel(), right[:-1, columns].ravel()
    c, d = right[1:, columns].ravel(), index[1:, columns].ravel()
    faces = np.stack([np.stack([a, b, c], 1), np.stack([a, c, d], 1)], 1).reshape(-1, 3)
    vertices = grid.reshape(-1, 3)
    corners = vertices[faces]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    return Part(vertices, faces[(edges > _SMALLEST_EDGE).all(axis=1)])


def quad(*corners: Sequence[float]) -> Part:
    """Two triangles on four corners, given in order around the edge."""
    return Part(np.array(corners, np.float64), np.array([[0, 1, 2], [0, 2, 3]]))


def box(x: float, y: float, z: float) -> Part:
    """12 triangles; x, z centred on the origin, y from 0 up."""
    corners = np.array([(i & 1, i >> 1 & 1, i >> 2) for i in range(8)], np.float64)
    quads = [(4, 5, 7, 6), (1, 0, 2, 3), (5, 1, 3, 7), (0, 4, 6, 2), (6, 7, 3, 2), (0, 1, 5, 4)]
    faces = np.array([face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))])
    return Part((corners - (0.5, 0.0, 0.5)) * (x, y, z), faces)


def lathe(profile: ArrayLike, segments: int) -> Part:
    """A profile (P, 2) of radius and height, turned about the y axis; fronts are outside.

    2 * segments * (P - 1) triangles, less `segments` for each end on the axis.
    """
    radius, height = np.asarray(profile, np.float64).T
    turn = np.arange(segments) * (2.0 * np.pi / segments)
    grid = np.stack(
        np.broadcast_arrays(radius[:, None] * np.cos(turn), height[:, None], radius[:, None] * np.sin(turn)), -1
    )
    turned = surface(grid, closed=True)
    rises = ((radius[1:] + radius[:-1]) ** 2 * np.diff(height)).sum() > 0.0  # the volume that it goes round
    return Part(turned.vertices, turned.faces[:, ::-1]) if rises else turned


def smooth_profile(knots: ArrayLike, count: int) -> Floats:
    """`count` points (count, 2) along the polyline `knots` (K, 2), evenly spaced by length.

    Corners are rounded a little; the ends stay where they are.
    """
    given = np.asarray(knots, np.float64)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(given, axis=0), axis=1))])
    at = np.linspace(0.0, length[-1], count)
    points = np.stack([np.interp(at, length, given[:, axis]) for axis in (0, 1)], 1)
    points[1:-1] = 0.25 * points[:-2] + 0.5 * points[1:-1] + 0.25 * points[2:]
    return points


def ball(radius: float, segments: int, rings: int) -> Part:
    """A sphere about the origin: segments * (2 * rings - 2) triangles."""
    polar = np.linspace(0.0, np.pi, rings + 1)
    return lathe(np.stack([radius * np.sin(polar), radius * np.cos(polar)], 1), segments)


def tube(path: ArrayLike, radius: float, sides: int, normal: Sequence[float], closed: bool = False) -> Part:
    """A round bar along a path (N, 3) that lies in the plane of the given unit `normal`; its ends are open.

    2 * sides * (N - 1) triangles; closed joins the ends: 2 * sides * N.
    """
    middle = np.asarray(path, np.float64)
    ahead = np.roll(middle, -1, 0) - np.roll(middle, 1, 0) if closed else np.gradient(middle, axis=0)
    side = np.cross(ahead / np.linalg.norm(ahead, axis=1, keepdims=True), normal)
    turn = (np.arange(sides + 1) % sides) * (2.0 * np.pi / sides)
    around = np.cos(turn)[:, None, None] * side + np.sin(turn)[:, None, None] * np.asarray(normal, np.float64)
    return surface(middle + radius * around, closed=closed)


def ring(radius: float, thickness: float, segments: int, sides: int) -> Part:
    """A torus lying flat about the y axis: 2 * segments * sides triangles; thickness is the radius of its bar."""
    turn = np.arange(segments) * (2.0 * np.pi / segments)
    path = np.stack([radius * np.cos(turn), np.zeros(segments), radius * np.sin(turn)], 1)
    return tube(path, thickness, sides, (0.0, 1.0, 0.0), closed=True)


def cushion(x: float, y: float, z: float, squares: int, roundness: float = 0.3) -> Part:
    """A box with swollen sides: 12 * squares² triangles; x, z centred, y from about 0 up.

    roundness: 0 = box, 1 = ellipsoid.
    """
    side = np.linspace(-1.0, 1.0, squares + 1)
    a, b = np.meshgrid(side, side)
    one = np.ones_like(a)
    # a changes its sign with the side, so that all six sheets wind the same way seen from outside.
    sides = [(f * a, b, f * one) for f in (1.0, -1.0)]
    sheets = [surface(np.stack(s, -1)) for p, q, r in sides for s in ((p, q, r), (q, r, p), (r, p, q))]
    cube = join(sheets)
    round_ = cube.vertices / np.linalg.norm(cube.vertices, axis=1, keepdims=True)
    swollen = (1.0 - roundness) * cube.vertices + roundness * 1.2 * round_
    return Part(swollen * (x / 2, y / 2, z / 2) + (0.0, y / 2, 0.0), cube.faces)


def cloth(width: float, height: float, columns: int, rows: int, folds: float, depth: float) -> Part:
    """A hanging sheet: x from 0 to width, y from 0 to height, folds along z that deepen downwards.

    2 * columns * rows triangles.
    """
    u, v = np.meshgrid(np.linspace(0.0, 1.0, columns + 1), np.linspace(0.0, 1.0, rows + 1))
    fold = np.sin(2.0 * np.pi * folds * u + 1.5 * np.sin(3.0 * u)) + 0.35 * np.sin(5.0 * np.pi * folds * u + 2.0 * v)
    return surface(np.stack([width * u, height * v, depth * fold * (1.15 - 0.6 * v)], -1))


def leaf(length: float, width: float, steps: int, droop: float) -> Part:
    """A leaf that grows along +z and bends down, hollow along its middle: 4 * steps - 4 triangles."""
    along = np.linspace(0.0, 1.0, steps + 1)
    half = width / 2 * np.sin(np.pi * along**0.8)
    half[[0, -1]] = 0.0
    rise = length * (0.5 * along - droop * along**2)
    middle = np.stack([np.zeros_like(along), rise, length * along], 1)
    edge = np.stack([half, 0.3 * half, np.zeros_like(half)], 1)
    return surface(np.stack([middle + edge * (-1.0, 1.0, 1.0), middle, middle + edge], 1))


def blades(feet: ArrayLike, width: float, height: ArrayLike) -> Part:
    """One triangle for each of the `feet` (N, 3): a blade that rises by `height` (negative hangs), leaning a little."""
    foot = np.asarray(feet, np.float64)
    count = len(foot)
    turn = 2.0 * np.pi * spread(count, 4)
    across = 0.5 * width * np.stack([np.cos(turn), np.zeros(count), np.sin(turn)], 1)
    tall = np.broadcast_to(np.asarray(height, np.float64), (count,))
    lean = 0.35 * np.abs(tall)
    tip = foot + np.stack([lean * np.sin(3.0 * turn), tall, lean * np.cos(3.0 * turn)], 1)
    vertices = np.stack([foot - across, foot + across, tip], 1).reshape(-1, 3)
    return Part(vertices, np.arange(3 * count).reshape(-1, 3))
