"""`python -m tests.rays.many_nearest [SCALE]`: nearest hits of many rays against exact arithmetic; prints a table.

Every ray is tested with every triangle, in float64 with a bound of the error, and in fractions where that leaves a
doubt of what is nearest. SCALE: share of the rays, 1 by default. Scenes of ATRA_SCENES are taken where they are.
"""

from __future__ import annotations

import os
import sys

import numba
import numpy as np

import atra
from scenes.directory import load_scene_from_directory
from tests.closed_meshes import sphere
from tests.meshes import beams, random_triangles
from tests.rays.many_rays import hits_by_fractions, volume

TESTS = 10e6 * 20_000
"""Rays times triangles of a kind of rays at scale 1, times their kinds and meshes; at most 400,000 rays of a kind."""

MOST = 64
"""Triangles of a ray that may be its nearest hit, at most; rays with more are judged by fractions of all."""

SCENES = ("cornell_box", "mitsuba", "fireplace_room", "sponza")


@numba.njit(nogil=True)
def rivals(corners, origins, directions, prim_ids, counts, t_of, errors):
    """Write the triangles that may be the nearest hit of each ray, (N, MOST) int64; counts: (N,) int64, -1: too many;
    t_of, errors: (N,) float64 of the only one, errors inf where it is in doubt."""
    for ray in range(len(origins)):
        x, y, z = origins[ray]
        u, v, w = directions[ray]
        limit, count = np.inf, 0
        lows = np.empty(MOST)
        for face in range(len(corners)):
            ax, ay, az = corners[face, 0, 0] - x, corners[face, 0, 1] - y, corners[face, 0, 2] - z
            bx, by, bz = corners[face, 1, 0] - x, corners[face, 1, 1] - y, corners[face, 1, 2] - z
            one, unsure_one = volume(u, v, w, ax, ay, az, bx, by, bz)
            cx, cy, cz = corners[face, 2, 0] - x, corners[face, 2, 1] - y, corners[face, 2, 2] - z
            two, unsure_two = volume(u, v, w, bx, by, bz, cx, cy, cz)
            unsure = unsure_one or unsure_two
            if not unsure and (one > 0) != (two > 0):
                continue
            three, unsure_three = volume(u, v, w, cx, cy, cz, ax, ay, az)
            unsure = unsure or unsure_three
            if not unsure and (one > 0) != (three > 0):
                continue
            ahead, unsure_ahead = volume(ax, ay, az, bx, by, bz, cx, cy, cz)
            whole = one + two + three
            low, high, t = 0.0, np.inf, 0.0
            if not unsure and not unsure_ahead:
                if ahead * (1 if one > 0 else -1) < 0:
                    continue
                t = ahead / whole
                largest = max(abs(ax), abs(ay), abs(az), abs(bx), abs(by), abs(bz), abs(cx), abs(cy), abs(cz))
                error = 1e-14 * (largest**3 / abs(ahead) + largest**2 * max(abs(u), abs(v), abs(w)) / abs(whole))
                if error < 0.01:
                    low, high = t * (1 - 2 * error), t * (1 + 2 * error)
            if low > limit:
                continue
            if high < limit:
                limit = high
                kept = 0
                for k in range(min(count, MOST)):
                    if lows[k] <= limit:
                        lows[kept], prim_ids[ray, kept] = lows[k], prim_ids[ray, k]
                        kept += 1
                if count <= MOST:
                    count = kept
            if count < MOST:
                lows[count], prim_ids[ray, count] = low, face
                t_of[ray], errors[ray] = t, high - low
            count += 1
        counts[ray] = count if count <= MOST else -1


def kinds_of(mesh, count, random):
    """(name, origins, directions) of rays of each kind, float32."""
    low, high = mesh.bounds
    size = float((high - low).max())
    anywhere = random.uniform(low, high, (count, 3))
    yield "random", anywhere, random.normal(size=(count, 3))
    way = random.normal(size=3)
    side = np.linalg.svd(way[None])[2][1:]
    across = random.uniform(-0.7, 0.7, (count, 2)) @ side * size
    start = (low + high) / 2 - 2 * size * way / np.linalg.norm(way)
    yield "parallel", start + across, np.tile(way, (count, 1))
    eye = random.uniform(low, high)
    order = np.sort(random.uniform(-0.5, 0.5, count))
    yield "coherent", np.tile(eye, (count, 1)), way + order[:, None] * side[0] + 0.01 * random.uniform(size=(count, 1))
    held = mesh.triangles(random.integers(0, mesh.triangle_count, count)).astype(np.float64)
    for name, weights in (("vertices", (1, 0, 0)), ("edges", (0.5, 0.5, 0))):
        ends = np.einsum("k,nkd->nd", weights, held)
        yield name, anywhere, ends - anywhere.astype(np.float32)
    one, other = (np.einsum("nk,nkd->nd", random.dirichlet((1, 1, 1), count), held) for _ in range(2))
    start = (other - 8 * (one - other)).astype(np.float32)
    yield "in planes", start, one - start


def judged(mesh, origins, directions, scene):
    """(hits, wrong triangles, lost, false, t off by more than a unit, decided by fractions)."""
    rays = atra.Rays(origins.astype(np.float32), directions.astype(np.float32))
    count = len(rays)
    corners = mesh.triangles(np.arange(mesh.triangle_count)).astype(np.float64)
    prim_ids, counts = np.empty((count, MOST), np.int64), np.empty(count, np.int64)
    t_of, errors = np.empty(count), np.empty(count)
    given = rays.origins.astype(np.float64), rays.directions.astype(np.float64)
    rivals(corners, *given, prim_ids, counts, t_of, errors)
    found, occluded = scene.intersect(rays), scene.occluded(rays)
    wrong = lost = false = off = fractions = 0
    for ray in range(count):
        told, t = int(found.prim_id[ray]), float(found.t[ray])
        unit = float(np.spacing(found.t[ray])) if np.isfinite(t) else 0.0
        if counts[ray] == 0:
            expected = None
        elif counts[ray] == 1 and errors[ray] < 0.1 * unit:
            expected = t_of[ray], prim_ids[ray, 0]
        else:
            fractions += 1
            some = np.sort(prim_ids[ray, : counts[ray]]) if counts[ray] > 0 else np.arange(mesh.triangle_count)
            part = atra.Mesh(mesh.vertices, mesh.faces[some])
            every = hits_by_fractions(part, rays.origins[ray], rays.directions[ray])
            expected = (every[0][0], some[every[0][1]]) if every else None
        lost += (expected is not None) and (told == atra.MISS or not occluded[ray])
        false += expected is None and (told != atra.MISS or bool(occluded[ray]))
        if expected is not None and told != atra.MISS:
            wrong += told != expected[1]
            off += abs(float(expected[0] - type(expected[0])(t))) > 1.01 * unit
    return int(found.hit.sum()), wrong, lost, false, off, fractions


def meshes():
    """(name, mesh) of all."""
    random = np.random.default_rng(3)
    yield "sphere", sphere(4)
    yield "needles", beams(2)
    yield "triangles", random_triangles(3000, 1)
    x, y = np.meshgrid(np.arange(60.0), np.arange(60.0), indexing="ij")
    corner = (np.arange(59)[:, None] * 60 + np.arange(59)).reshape(-1)
    faces = np.concatenate(
        [np.stack([corner, corner + 60, corner + 1], 1), np.stack([corner + 1, corner + 60, corner + 61], 1)]
    )
    yield "terrain", atra.Mesh(np.stack([x, y, 3 * random.normal(size=x.shape)], -1).reshape(-1, 3), faces)
    if os.environ.get("ATRA_SCENES"):
        for name in SCENES:
            yield name, load_scene_from_directory(name).mesh


def main(scale=1.0):
    print("mesh,triangles,kind,rays,hits,wrong,lost,false,t off,by fractions")
    for name, mesh in meshes():
        random = np.random.default_rng(1)
        count = int(scale * TESTS / mesh.triangle_count / 48) + 1
        with atra.RayScene(mesh) as scene:
            for kind, origins, directions in kinds_of(mesh, min(count, int(scale * 4e5) + 1), random):
                found = judged(mesh, origins, directions, scene)
                print(name, mesh.triangle_count, kind, len(origins), *found, sep=",", flush=True)


if __name__ == "__main__":
    main(*map(float, sys.argv[1:]))
