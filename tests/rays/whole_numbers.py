"""Meshes and rays of whole numbers, and an oracle of their crossings that nothing is rounded in."""

import numpy as np
import trimesh

import atra

SIZE = 64
"""Meshes reach so far from the origin."""


def snapped(mesh, name):
    """The mesh with its corners on even whole numbers, so that middles of edges are whole, too; a closed one stays so.
    Some triangles lose their area."""
    vertices = np.asarray(mesh.vertices, float)
    scale = SIZE / np.abs(vertices).max()
    return atra.Mesh(2 * np.rint(vertices * scale / 2), mesh.faces, name)


def whole_meshes():
    """Closed, open, self-intersecting and needle meshes by name, with whether they are closed."""
    random = np.random.default_rng(3)
    ball = trimesh.creation.icosphere(subdivisions=2)
    upper = ball.copy()
    upper.update_faces(ball.triangles_center[:, 2] > 0.1)
    ring = trimesh.creation.torus(2.0, 0.7, 16, 8)
    turned = ring.copy()
    turned.apply_transform(trimesh.transformations.rotation_matrix(1.3, (1, 0.4, 0), (0.7, 0, 0)))
    crossed = trimesh.util.concatenate([ring, turned])
    soup = 2 * random.integers(-SIZE // 2, SIZE // 2, (240, 3))
    few = 2 * random.integers(-2, 3, (180, 3))  # many share planes, edges and corners
    needles = 2 * random.integers(-SIZE // 2, SIZE // 2, (80, 3, 3))
    needles[:, 2] = needles[:, 0] + 2 * random.integers(-1, 2, (80, 3))
    return {
        "ball": (snapped(ball, "ball"), True),
        "crossed rings": (snapped(crossed, "crossed rings"), True),
        "half a ball": (snapped(upper, "half a ball"), False),
        "soup": (atra.Mesh(soup, np.arange(240).reshape(-1, 3), "soup"), False),
        "coplanar soup": (atra.Mesh(few, np.arange(180).reshape(-1, 3), "coplanar soup"), False),
        "needles": (atra.Mesh(needles.reshape(-1, 3), np.arange(240).reshape(-1, 3), "needles"), False),
    }


def whole_rays(mesh, count, seed, farthest=2 * SIZE):
    """(origins, directions): a third through corners, a third through middles of edges, some of them along an axis,
    and the rest anywhere."""
    random = np.random.default_rng(seed)
    corners = mesh.vertices.astype(np.int64)
    middles = (corners[mesh.faces[:, 0]] + corners[mesh.faces[:, 1]]) // 2
    third = count // 3
    aims = np.concatenate([
        corners[random.integers(0, len(corners), third)], middles[random.integers(0, len(middles), third)],
        random.integers(-SIZE, SIZE + 1, (count - 2 * third, 3)),
    ])  # fmt: skip
    origins = random.integers(-farthest, farthest + 1, (count, 3))
    straight = random.random(count) < 0.2
    axis, way = np.eye(3, dtype=np.int64)[random.integers(0, 3, count)], random.choice([-1, 1], (count, 1))
    origins[straight] = (aims - 2 * farthest * way * axis)[straight]
    directions = aims - origins
    directions[(directions == 0).all(axis=1)] = (1, 2, 3)
    return origins, directions


def _cross(a, b):
    return np.stack([a[..., i - 2] * b[..., i - 1] - a[..., i - 1] * b[..., i - 2] for i in range(3)], axis=-1)


def whole_crossings(mesh, origins, directions, tnear=0, tfar=None):
    """(sign, t): (N, F) int64, 0 where a ray does not cross a triangle, and (N, F) float64.

    All in int64: directions times origins times edges stay below 2^60. tnear, tfar: whole numbers, (N,) or one; None:
    no end. The rule for rays through edges is written again here, by moving the origin by (e, e^2).
    """
    corners = mesh.vertices.astype(np.int64)[mesh.faces]
    o, d = origins[:, None], directions[:, None]
    major = np.abs(directions).argmax(axis=1)
    found = []
    for start, end in ((0, 1), (1, 2), (2, 0)):
        way = (corners[:, end] - corners[:, start])[None]
        side = np.sign((d * _cross(corners[None, :, start] - o, way)).sum(axis=2))
        for step in (1, 2):  # the origin moves along this axis: the corner moves the other way
            moved = -np.eye(3, dtype=np.int64)[(major + step) % 3][:, None]
            moved_side = np.sign((d * _cross(np.broadcast_to(moved, (len(o), way.shape[1], 3)), way)).sum(axis=2))
            side = np.where(side == 0, moved_side, side)
        found.append(side)
    sign = np.where((found[0] == found[1]) & (found[1] == found[2]), found[0], 0)
    normals = _cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[None]
    facing, ahead = (normals * d).sum(axis=2), (normals * (corners[None, :, 0] - o)).sum(axis=2)
    sign = np.where(facing == 0, 0, sign)
    near = np.reshape(np.broadcast_to(tnear, len(origins)), (-1, 1))
    sign = np.where((ahead - near * facing) * np.sign(facing) >= 0, sign, 0)
    if tfar is not None:
        far = np.reshape(np.broadcast_to(tfar, len(origins)), (-1, 1))
        sign = np.where((ahead - far * facing) * np.sign(facing) < 0, sign, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return sign, ahead / facing
