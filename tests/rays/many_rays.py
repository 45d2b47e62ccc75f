"""`python -m tests.rays.many_rays [FILE]`: ten million rays against oracles that round nothing; prints a table.

The table that is kept is `reports/reference/every_hit/many_rays.csv`.

Rays and meshes of whole numbers are judged in int64; those of any float32 numbers in float64, and in whole
numbers of any size where that leaves it open. Every ray is tested with every triangle.
"""

from __future__ import annotations

import sys

import numba
import numpy as np
import trimesh

import atra
from tests.meshes import beams, random_triangles
from tests.rays.near_whole_numbers import crosses
from tests.rays.whole_numbers import whole_meshes, whole_rays

WHOLE, FAR, ANY, FINE = 1_000_000, 200_000, 500_000, 1_000_000
"""Rays at each mesh."""

FARTHEST = 1 << 19
"""How far from the origin far rays start; the meshes reach 64."""

STEP = 100_000

COLUMNS = ("mesh", "triangles", "rays", "kind", "crossings", "lost", "doubled", "too many", "in doubt")


@numba.njit(nogil=True)
def judge_whole(corners, origins, directions, splits, prim_ids):
    """(crossings, lost, doubled, too many) of lists of hits, by int64; arguments are arrays of int64."""
    crossings = lost = doubled = matched = 0
    for ray in range(len(origins)):
        o, d = origins[ray], directions[ray]
        major = np.argmax(np.abs(d))
        for face in range(len(corners)):
            first, found = 0, True
            for edge in range(3):
                p, q = corners[face, edge], corners[face, (edge + 1) % 3]
                side = 0
                for k in range(3):
                    m, n = (k + 1) % 3, (k + 2) % 3
                    side += d[k] * ((p[m] - o[m]) * (q[n] - p[n]) - (p[n] - o[n]) * (q[m] - p[m]))
                for step in (1, 2):
                    if side == 0:
                        k = (major + step) % 3
                        m, n = (k + 1) % 3, (k + 2) % 3
                        side = d[m] * (q[n] - p[n]) - d[n] * (q[m] - p[m])
                sign = 1 if side > 0 else -1 if side < 0 else 0
                if edge == 0:
                    first = sign
                found = found and sign != 0 and sign == first
                if not found:
                    break
            if not found:
                continue
            ahead = 0
            a, b, c = corners[face]
            for k in range(3):
                m, n = (k + 1) % 3, (k + 2) % 3
                normal = (b[m] - a[m]) * (c[n] - a[n]) - (b[n] - a[n]) * (c[m] - a[m])
                ahead += normal * (a[k] - o[k])
            if ahead * first < 0:
                continue
            crossings += 1
            times = 0
            for place in range(splits[ray], splits[ray + 1]):
                times += prim_ids[place] == face
            lost += times == 0
            doubled += max(times - 1, 0)
            matched += times
    return crossings, lost, doubled, len(prim_ids) - matched


@numba.njit(nogil=True)
def volume(ax, ay, az, bx, by, bz, cx, cy, cz):
    """a . (b x c), and whether rounding may have its sign."""
    x, y, z = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
    size = abs(ax) * (abs(by * cz) + abs(bz * cy)) + abs(ay) * (abs(bz * cx) + abs(bx * cz))
    size += abs(az) * (abs(bx * cy) + abs(by * cx))
    found = ax * x + ay * y + az * z
    return found, abs(found) <= 2e-15 * size


@numba.njit(nogil=True)
def judge_any(corners, origins, directions, splits, prim_ids, doubts):
    """As `judge_whole`, of any float64 numbers that are float32; doubts: (N, 3) int64, written: ray, face, times found.
    Returns the number of doubts, too."""
    crossings = lost = doubled = matched = doubtful = 0
    for ray in range(len(origins)):
        x, y, z = origins[ray]
        u, v, w = directions[ray]
        for face in range(len(corners)):
            ax, ay, az = corners[face, 0, 0] - x, corners[face, 0, 1] - y, corners[face, 0, 2] - z
            bx, by, bz = corners[face, 1, 0] - x, corners[face, 1, 1] - y, corners[face, 1, 2] - z
            cx, cy, cz = corners[face, 2, 0] - x, corners[face, 2, 1] - y, corners[face, 2, 2] - z
            one, unsure_one = volume(u, v, w, ax, ay, az, bx, by, bz)
            two, unsure_two = volume(u, v, w, bx, by, bz, cx, cy, cz)
            unsure = unsure_one or unsure_two
            if not unsure and (one > 0) != (two > 0):
                continue
            three, unsure_three = volume(u, v, w, cx, cy, cz, ax, ay, az)
            unsure = unsure or unsure_three
            if not unsure and (one > 0) != (three > 0):
                continue
            ahead, unsure_ahead = volume(ax, ay, az, bx, by, bz, cx, cy, cz)
            unsure = unsure or unsure_ahead
            signs = 1 if one > 0 else -1
            times = 0
            for place in range(splits[ray], splits[ray + 1]):
                times += prim_ids[place] == face
            if unsure:
                doubts[doubtful] = ray, face, times
                doubtful += 1
                matched += times
            elif ahead * signs > 0:
                crossings += 1
                lost += times == 0
                doubled += max(times - 1, 0)
                matched += times
    return crossings, lost, doubled, len(prim_ids) - matched, doubtful


def judged(mesh, origins, directions, whole):
    """(crossings, lost, doubled, too many, in doubt) of all rays at a mesh."""
    total = np.zeros(5, np.int64)
    corners = mesh.triangles(np.arange(mesh.triangle_count))
    doubts = np.empty((20 * STEP, 3), np.int64)
    with atra.RayScene(mesh) as scene:
        for start in range(0, len(origins), STEP):
            some = slice(start, start + STEP)
            rays = atra.Rays(origins[some], directions[some])
            hits = scene.all_hits(rays)
            lists = hits.ray_splits, hits.prim_id.astype(np.int64)
            if whole:
                numbers = corners.astype(np.int64), origins[some], directions[some]
                total[:4] += judge_whole(*numbers, *lists)
                continue
            numbers = corners, rays.origins.astype(float), rays.directions.astype(float)
            *found, doubtful = judge_any(*numbers, *lists, doubts)
            total += (*found, doubtful)
            for ray, face, times in doubts[:doubtful]:
                is_crossed = crosses(corners[face], rays.origins[ray], rays.directions[ray])
                total += (is_crossed, is_crossed and times == 0, is_crossed and times > 1, times * (not is_crossed), 0)
    return total


def near_edges(mesh, count, seed):
    """Origins around the mesh, and directions to places on it, many of them next to edges and corners."""
    random = np.random.default_rng(seed)
    low, high = mesh.bounds
    some = mesh.triangles(random.integers(0, mesh.triangle_count, count))
    aims = (some * random.dirichlet((0.1, 0.1, 0.1), count)[:, :, None]).sum(axis=1)
    origins = random.uniform(low - (high - low), high + (high - low), (count, 3))
    return origins, aims - origins


def rows():
    """The table's rows."""
    for name, (mesh, _) in whole_meshes().items():
        for kind, count, reach in (
            ("a third through corners, a third through edges", WHOLE, 128),
            ("far", FAR, FARTHEST),
        ):
            rays = whole_rays(mesh, count, 5, reach)
            yield name, mesh.triangle_count, count, kind, *judged(mesh, *rays, whole=True)
    ball, torus = trimesh.creation.icosphere(subdivisions=3), trimesh.creation.torus(2.0, 0.7, 24, 12)
    for name, mesh in {
        "ball, float32": atra.Mesh(ball.vertices, ball.faces), "torus": atra.Mesh(torus.vertices, torus.faces),
        "torus, far from the world's origin": atra.Mesh(torus.vertices + (900.0, 5e3, -300.0), torus.faces),
        "soup, float32": random_triangles(400, 1), "small soup": random_triangles(600, 2, 0.2), "beams": beams(1),
    }.items():  # fmt: skip
        rays = near_edges(mesh, ANY, 6)
        yield name, mesh.triangle_count, ANY, "next to edges and corners", *judged(mesh, *rays, whole=False)


def odd_rays():
    """Rays, and those that cross a fine closed mesh an odd number of times, seen from outside, aimed at its corners."""
    fine = trimesh.creation.icosphere(subdivisions=7)
    mesh = atra.Mesh(fine.vertices, fine.faces)
    random = np.random.default_rng(7)
    starts = random.normal(size=(FINE, 3))
    origins = (1.5 * starts / np.linalg.norm(starts, axis=1, keepdims=True)).astype(np.float32)
    directions = mesh.vertices[random.integers(0, len(mesh.vertices), FINE)].astype(float) - origins
    with atra.RayScene(mesh) as scene:
        return mesh.triangle_count, FINE, int((scene.count(origins, directions) % 2).sum())


def main(path: str | None) -> None:
    lines = [",".join(COLUMNS)]
    total = np.zeros(5, np.int64)
    for row in rows():
        lines.append(",".join(f'"{one}"' if "," in str(one) else str(one) for one in row))
        total += np.array(row[4:])
        print(lines[-1], flush=True)
    triangles, rays, odd = odd_rays()
    lines.append(f'fine ball,{triangles},{rays},"at corners, from outside",,{odd} odd,,,')
    print(lines[-1])
    print("all: crossings, lost, doubled, too many, in doubt:", *total)
    if path:
        with open(path, "w", encoding="utf-8") as file:
            file.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else None)
