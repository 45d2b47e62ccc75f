"""Small meshes the tests share."""

import numpy as np

import atra
from scenes.cornell_box import CORNELL_BOX_CAMERA, cornell_box

EYE_AT_ORIGIN = {"eye": (0, 0, 0), "target": (0, 0, 1), "up": (0, 1, 0)}
"""A camera looking along world +z: camera space is X right = world -x, Y down = world -y, Z = world z."""


def quads(corners, name="quads"):
    """A mesh of two triangles per quadrilateral."""
    vertices = np.array([corner for quad in corners for corner in quad], np.float32)
    first = 4 * np.arange(len(corners))[:, None]
    faces = np.concatenate([first + [0, 1, 2], first + [0, 2, 3]], axis=1).reshape(-1, 3)
    return atra.Mesh(vertices, faces, name)


def joined(*meshes):
    """All triangles, one mesh after the other."""
    first = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])
    faces = [mesh.faces.astype(np.int64) + start for mesh, start in zip(meshes, first[:-1], strict=True)]
    return atra.Mesh(np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(faces))


def random_triangles(count, seed, size=1.0, spread=3.0):
    """Triangles all around the origin: in front of the eye, behind it and through its plane."""
    random = np.random.default_rng(seed)
    centres = random.uniform(-spread, spread, (count, 1, 3))
    vertices = (centres + random.normal(0, size, (count, 3, 3))).reshape(-1, 3)
    return atra.Mesh(vertices, np.arange(3 * count).reshape(-1, 3), "random triangles")


def boards(count=40, tilted=False):
    """Planks of 100 x 0.05 side by side, 0.3 below the eye: a floor of needles, which copies do not know the plane of.

    tilted: turned off the axes, where a ray of the mesh itself does not know it well either.
    """
    x = -0.025 * count + 0.05 * np.arange(count)
    planks = [[(left, -0.3, -50), (left + 0.05, -0.3, -50), (left + 0.05, -0.3, 50), (left, -0.3, 50)] for left in x]
    mesh = quads(planks, "boards")
    if not tilted:
        return mesh
    roll, pitch = (np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]]) for a in (0.3, 0.2))
    turn = np.eye(3)
    turn[:2, :2] = roll
    turn[:, 1:] = turn[:, 1:] @ pitch
    return atra.Mesh(mesh.vertices @ turn.T, mesh.faces, "tilted boards")


def cornell_camera(width, height):
    return atra.Camera(**CORNELL_BOX_CAMERA, width=width, height=height)


__all__ = ["EYE_AT_ORIGIN", "boards", "cornell_box", "cornell_camera", "joined", "quads", "random_triangles"]


def beams(seed, count=80):
    """Long thin triangles around the eye, some of them along an axis, as floors and beams are."""
    random = np.random.default_rng(seed)
    centre = random.normal(size=(count, 3)) * random.choice([0.3, 1.0, 3.0], (count, 1))
    along = random.normal(size=(count, 3))
    straight = random.random(count) < 0.3
    along[straight] = np.eye(3)[random.integers(0, 3, straight.sum())]
    along *= random.choice([3.0, 20.0, 100.0], (count, 1)) / np.linalg.norm(along, axis=1, keepdims=True)
    across = random.normal(size=(count, 3)) * random.choice([0.02, 0.1, 0.5], (count, 1))
    corners = np.stack([centre - along, centre + along, centre + across + random.random((count, 1)) * along], axis=1)
    return atra.Mesh(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3), f"beams {seed}")


def needle_camera(seed, fov_y_degrees, size=64):
    """At the origin, along an axis or anywhere."""
    random = np.random.default_rng([seed, 1])
    target = np.array([0.0, 0.0, -1.0]) if seed % 2 else random.normal(size=3)
    return atra.Camera((0, 0, 0), tuple(target), (0.1, 1, 0.2), fov_y_degrees, size, size)


def specks(camera, seed, count=40_000):
    """Triangles of a pixel or less to three, all over the image, 100 to 10,000 away, in planes along the world's x.

    Three quarters are of walls that a view along x grazes near its middle. Distances lie above powers of two, where
    float32 rounds the most.
    """
    rng = np.random.default_rng(seed)
    is_wall = rng.random(count) < 0.75
    beside = rng.choice([-1, 1], count) * rng.uniform(0.032, 0.045, count)
    x = camera.width * np.where(is_wall, 0.5 + beside, rng.random(count))
    y = camera.height * rng.random(count)
    angle = np.where(is_wall, np.pi / 2, rng.uniform(0, np.pi, count))
    normal = np.stack([0 * angle, np.cos(angle), np.sin(angle)], axis=-1)

    def towards(x, y):
        plane = camera.plane
        sides = plane.columns(x, 0.0) * plane.pitch_x, plane.rows(y, 0.0) * plane.pitch_y
        return np.stack([*sides, np.ones_like(x)], axis=-1) @ camera.axes

    rays = towards(*(place + rng.uniform(-1.5, 1.5, (3, count)) for place in (x, y)))
    distance = 2.0 ** rng.integers(7, 13, count) * rng.uniform(1.0, 1.15, count)
    depth = distance * (towards(x, y) * normal).sum(axis=-1) / (rays * normal).sum(axis=-1)
    is_near = ((depth > 100) & (depth < 10_000)).all(axis=0)
    corners = (np.asarray(camera.eye) + rays * depth[..., None])[:, is_near]
    return atra.Mesh(corners.swapaxes(0, 1).reshape(-1, 3), np.arange(3 * is_near.sum()).reshape(-1, 3))


def strips_ply(strips):
    """A text of five vertices and strips of triangles."""
    head = "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n"
    head += f"element tristrips {len(strips)}\nproperty list int int vertex_indices\nend_header\n"
    rows = ["0 0 0", "1 0 0", "0 1 0", "1 1 0", "0 2 0", *(f"{len(one)} {' '.join(map(str, one))}" for one in strips)]
    return ("\n".join((head.strip(), *rows)) + "\n").encode()
