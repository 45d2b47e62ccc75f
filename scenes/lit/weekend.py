"""The last scene of "Ray Tracing in One Weekend", made of triangles, with its materials."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.geometry.mesh import Mesh
from atra.light import Checker, Dielectric, GradientSky, Lambertian, Metal, Scene, Sun
from scenes.scene import upright_camera
from scenes.shapes import Part, ball, copies, join, lathe

WEEKEND_CAMERA = upright_camera((13.0, 2.0, 3.0), (0.0, 0.0, 0.0), 20.0)
"""The book's. Its picture has 1,200 x 800 pixels."""

_GROUND_RADIUS = 1000.0
_GROUND_ANGLE = 0.1  # of the cap that is built: past the horizon of all that is there
_CHECKER_SCALE = 5000.0
_FROM_MIDDLE, _CLEARING = (4.0, 0.0), 0.9
_TRIANGLES = 100


def weekend(segments: int = 24) -> Scene:
    """A chequered ground, three balls of glass, paint and metal among up to 484 small ones, and 100 loose triangles.

    segments: around a small ball; the large ones have four times as many. Smooth normals are the spheres' own. Places
    and colours follow the book's recipe, with random numbers of our own. The triangles, in three colours and turned by
    30 degrees, and the chequers come from a path tracer on a GPU written after the book (sketchbooks99's
    optixInOneWeekend). The sun is for hybrid rendering; the book has none.
    Source: P. Shirley, "Ray Tracing in One Weekend", final scene.
    """
    parts, normals, numbers = [], [], []

    def put(part: Part, part_normals: NDArray[np.float64], number: NDArray[np.integer] | int) -> None:
        parts.append(part)
        normals.append(part_normals)
        numbers.append(np.broadcast_to(number, part.triangle_count))

    ground = outwards(lathe(_cap_profile(), 8 * segments)).moved(y=-_GROUND_RADIUS)
    put(ground, ground.vertices + (0.0, _GROUND_RADIUS, 0.0), 0)
    large = outwards(ball(1.0, 4 * segments, 2 * segments))
    for number, x in ((1, 0.0), (2, -4.0), (3, 4.0)):
        put(large.moved(x=x, y=1.0), large.vertices, number)
    small = outwards(ball(0.2, segments, segments // 2))
    places = _small_places()
    many = copies(small, places)
    put(many, np.tile(small.vertices, (len(places), 1)), 4 + np.repeat(np.arange(len(places)), small.triangle_count))
    loose = _loose_triangles()
    first = 4 + len(places)
    put(loose, _face_normals(loose), first + np.arange(loose.triangle_count) % 3)

    whole = join(parts)
    uv = np.zeros((len(whole.vertices), 2))
    around = normals[0] / _GROUND_RADIUS  # the sphere's uv with its poles along z, as in the source
    uv[: len(around), 0] = np.arctan2(around[:, 1], around[:, 0]) / (2.0 * np.pi)
    uv[: len(around), 1] = np.arccos(np.clip(around[:, 2], -1.0, 1.0)) / np.pi
    materials = [
        Lambertian(Checker((0.2, 0.3, 0.1), (0.9, 0.9, 0.9), _CHECKER_SCALE)),
        Dielectric(1.5),
        Lambertian((0.4, 0.2, 0.1)),
        Metal((0.7, 0.6, 0.5)),
        *_small_materials(len(places)),
        *(Lambertian(colour) for colour in ((0.8, 0.2, 0.2), (0.2, 0.6, 0.3), (0.2, 0.3, 0.8))),
    ]
    return Scene(
        whole.to_mesh("weekend"), materials, np.concatenate(numbers), (Sun((-0.4, -1.0, 0.3), 0.5),), GradientSky(),
        np.concatenate(normals).astype(np.float32), uv.astype(np.float32),
    )  # fmt: skip


def _cap_profile() -> NDArray[np.float64]:
    """Rings that grow wider with the distance from the middle."""
    angle = _GROUND_ANGLE * np.linspace(0.0, 1.0, 81) ** 1.5
    return _GROUND_RADIUS * np.stack([np.sin(angle), np.cos(angle)], 1)


def _random(rows: int, columns: int, seed: int) -> NDArray[np.float64]:
    """In [0, 1), the same at every call."""
    return np.random.Generator(np.random.PCG64(seed)).random((rows, columns))


def _small_places() -> NDArray[np.float64]:
    a, b = (grid.ravel() for grid in np.mgrid[-11:11, -11:11])
    shift = 0.9 * _random(len(a), 2, 1)
    places = np.stack([a + shift[:, 0], np.full(len(a), 0.2), b + shift[:, 1]], 1)
    away = np.hypot(places[:, 0] - _FROM_MIDDLE[0], places[:, 2] - _FROM_MIDDLE[1])
    return places[away > _CLEARING]


def _small_materials(count: int) -> list[Lambertian | Metal | Dielectric]:
    """Four fifths paint, three twentieths metal, one twentieth glass."""
    kind, colour, other = _random(count, 1, 2)[:, 0], _random(count, 3, 3), _random(count, 3, 4)
    squared = colour * other
    made: list[Lambertian | Metal | Dielectric] = []
    for number in range(count):
        if kind[number] < 0.8:
            made.append(Lambertian(tuple(squared[number].tolist())))
        elif kind[number] < 0.95:
            made.append(Metal(tuple((0.5 + 0.5 * colour[number]).tolist()), 0.5 * float(other[number, 0])))
        else:
            made.append(Dielectric(1.5))
    return made


def _loose_triangles() -> Part:
    """Over the small balls, each with corners of its own."""
    places = _random(_TRIANGLES, 3, 5) * (16.0, 0.5, 16.0) + (-8.0, 0.6, -8.0)
    corner = np.array([(-0.12, 0.0, 0.0), (0.12, 0.0, 0.0), (0.0, 0.2, 0.0)])
    one = Part(corner, np.array([[0, 1, 2]])).turned(30.0)
    return copies(one, places)


def _face_normals(part: Part) -> NDArray[np.float64]:
    corners = part.vertices[part.faces]
    return np.repeat(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), 3, axis=0)


def outwards(part: Part) -> Part:
    """Triangles wound so that fronts face away from the origin."""
    a, b, c = (part.vertices[part.faces[:, corner]] for corner in range(3))
    inward = (np.cross(b - a, c - a) * (a + b + c)).sum(axis=1) < 0.0
    return Part(part.vertices, np.where(inward[:, None], part.faces[:, ::-1], part.faces))


def weekend_mesh() -> Mesh:
    """The triangles of `weekend` alone."""
    return weekend().mesh
