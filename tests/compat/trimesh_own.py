"""`python -m tests.compat.trimesh_own FOLDER`: trimesh's own ray tests, with atra's stand-in for every ray object.

FOLDER: trimesh's unpacked source distribution, as `pip download trimesh --no-binary :all: --no-deps` brings it. It has
the tests, but neither their helper `generic` nor their models: both are here, the models made anew. Boolean operations
need manifold3d.
"""

from __future__ import annotations

import logging
import sys
import time
import unittest
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import trimesh
from trimesh.ray import ray_pyembree, ray_triangle

from atra.compat.trimesh import RayMeshIntersector

FILES = ("test_ray.py", "test_ray_upstream.py")


def _cube_without_an_eighth() -> trimesh.Trimesh:
    """Seven of the eight cubes around the origin, each 5 wide, without the faces that two of them share."""
    is_full = np.zeros((4, 4, 4), bool)
    is_full[1:3, 1:3, 1:3] = True
    is_full[2, 2, 2] = False
    corners = []
    for cell in np.argwhere(is_full):
        for axis in range(3):
            for side in (0, 1):
                beyond = cell.copy()
                beyond[axis] += 2 * side - 1
                if not is_full[tuple(beyond)]:
                    ways = np.eye(3)[[(axis + 1) % 3, (axis + 2) % 3]][:: 1 if side else -1]
                    at = cell - 2 + side * np.eye(3)[axis]
                    corners += [at, at + ways[0], at + ways[0] + ways[1], at, at + ways[0] + ways[1], at + ways[1]]
    mesh = trimesh.Trimesh(5.0 * np.array(corners), np.arange(len(corners)).reshape(-1, 3))
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(7 * 125)
    return mesh


def _open_pot() -> trimesh.Trimesh:
    ball = trimesh.creation.uv_sphere(radius=5.0)
    ball.update_faces(ball.triangles_center[:, 2] < 3.0)
    return ball


MODELS = {
    "unit_sphere.STL": lambda: trimesh.creation.icosphere(subdivisions=2, radius=0.5),
    "unit_cube.STL": trimesh.creation.box,
    "7_8ths_cube.stl": _cube_without_an_eighth,
    "teapot.stl": _open_pot,
    "featuretype.STL": lambda: trimesh.creation.annulus(1.0, 3.0, 2.0),
}


def helper() -> ModuleType:
    """What the tests import as `generic`."""
    made = ModuleType("generic")
    random = np.random.default_rng(0)

    def get_mesh(name: str, **_: object) -> trimesh.Trimesh:
        if name not in MODELS:
            pytest.skip(f"{name} is not in the source distribution")
        mesh = MODELS[name]()
        mesh.source.file_path = name
        mesh.ray = RayMeshIntersector(mesh)
        return mesh

    aims = np.random.default_rng(1).normal(size=(2, 500, 3))
    rays = {"ray_origins": 5.0 * aims[0], "ray_directions": aims[1] - 5.0 * aims[0]}
    ray_data = {"load_kwargs": [{"name": name} for name in MODELS for _ in (0, 1)], "rays": dict.fromkeys(MODELS, rays)}
    for name, value in {
        "np": np, "trimesh": trimesh, "time": time, "unittest": unittest, "log": logging.getLogger("trimesh"),
        "get_mesh": get_mesh, "random": lambda shape: random.random(shape), "data": {"ray_data": ray_data},
    }.items():  # fmt: skip
        setattr(made, name, value)
    return made


def main(folder: Path) -> int:
    """Run the tests; returns pytest's exit code."""
    sys.modules["generic"] = helper()
    ray_pyembree.RayMeshIntersector = ray_triangle.RayMeshIntersector = RayMeshIntersector  # every new mesh takes it
    tests = [str(folder / "tests" / name) for name in FILES]
    return int(pytest.main(["-q", "-rs", "-p", "no:cacheprovider", "--rootdir", str(folder), *tests]))


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
