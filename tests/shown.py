"""Scenes of few triangles for the tests of pictures, and the means they are compared by."""

import numpy as np

import atra
from atra import light
from scenes.lit.weekend import outwards
from scenes.shapes import ball
from tests.meshes import quads

BLACK = light.constant_sky(0.0)


def floor(half=50.0, height=0.0):
    """Corners of a square whose front faces up."""
    return [(-half, height, half), (half, height, half), (half, height, -half), (-half, height, -half)]


def down(size, eye=(0, 4, 0), fov=40.0, height=0):
    """Looks straight down: +x is to the right, -z up."""
    return atra.Camera(eye, (eye[0], eye[1] - 1, eye[2]), (0, 0, -1), fov, size, height or size)


def floor_points(camera):
    """(H, W, 3): where the rays through the pixels' centres meet the floor at height 0."""
    y, x = np.mgrid[: camera.height, : camera.width]
    origins, directions = camera.rays(x, y)
    directions = directions @ camera.axes
    return camera.eye - directions * (camera.eye[1] / directions[..., 1:2]) + origins


def rectangles(*parts, lights=(), sky=BLACK, **others):
    """A scene of rectangles, each given by its corners and its material."""
    numbers = np.repeat(range(len(parts)), 2)
    return light.Scene(quads([one for one, _ in parts]), [one for _, one in parts], numbers, lights, sky, **others)


def sphere(material, sky, smooth=True, segments=24):
    part = outwards(ball(1.0, segments, segments // 2))
    normals = part.vertices if smooth else None
    return light.Scene(part.to_mesh("sphere"), [material], sky=sky, normals=normals)


def room(material, sky=BLACK):
    """A closed box of two units around the origin, fronts inward."""
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    sides = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return light.Scene(quads([[tuple(corners[k]) for k in side] for side in sides]), [material], sky=sky)


def picture(kind, scene, camera, samples, primary=None, **options):
    """The picture of so many samples by a renderer of this kind."""
    with kind(scene, camera, primary, **({"threads": 1} | options)) as renderer:
        renderer.add(samples)
        return renderer.image


def traced(scene, camera, samples, **options):
    """The picture of so many samples of paths."""
    return picture(light.PathRenderer, scene, camera, samples, **options)


def hybrid(scene, camera, samples, **options):
    """A renderer with so many samples, closed."""
    with light.HybridRenderer(scene, camera, **({"threads": 1, "jitter": "off"} | options)) as renderer:
        renderer.add(samples)
    return renderer


def batches(scene, camera, count, samples, **options):
    """(count, H, W, 3): pictures of `samples` samples each, all different."""
    pictures, before = [], 0.0
    with light.PathRenderer(scene, camera, **({"threads": 1} | options)) as renderer:
        for number in range(1, count + 1):
            renderer.add(samples)
            so_far = renderer.image.astype(np.float64) * number
            pictures.append(so_far - before)
            before = so_far
    return np.array(pictures)
