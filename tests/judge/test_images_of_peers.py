"""Images that Open3D and Mitsuba 3 make in their usual ways: their conventions are found."""

import numpy as np
import pytest

import atra
from atra.judge.conventions import Convention
from atra.judge.foreign import ForeignImage, judge_image
from scenes.shapes import ball, join
from tests.meshes import quads

pytestmark = pytest.mark.slow

SIZE = (96, 72)
EYE, TARGET, UP, FOV = (1.5, 2.2, 3.4), (0.1, 0.2, 0.0), (0.0, 1.0, 0.0), 50.0


@pytest.fixture(scope="module")
def mesh():
    """A ball on a floor, which tells left from right and above from below."""
    ground = [(-3, -1, 3), (3, -1, 3), (3, -1, -3), (-3, -1, -3)]
    floor = quads([ground, [(1, -1, -1), (1, 1, -1), (2, 1, -2), (2, -1, -2)]])
    part = join([ball(1.0, 24, 12)]).to_mesh("ball")
    vertices = np.concatenate([part.vertices, floor.vertices])
    return atra.Mesh(vertices, np.concatenate([part.faces, floor.faces + np.uint32(len(part.vertices))]))


@pytest.fixture(scope="module")
def camera():
    return atra.Camera(EYE, TARGET, UP, FOV, *SIZE)


def by_open3d(mesh):
    """`RaycastingScene` with rays of its own pinhole camera."""
    o3d = pytest.importorskip("open3d")
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3d.core.Tensor(mesh.vertices), o3d.core.Tensor(mesh.faces))
    across = 2 * np.degrees(np.arctan(np.tan(np.radians(FOV) / 2) * SIZE[0] / SIZE[1]))
    rays = scene.create_rays_pinhole(across, list(TARGET), list(EYE), list(UP), *SIZE)
    found = scene.cast_rays(rays)
    return found["t_hit"].numpy(), found["primitive_ids"].numpy()


def by_mitsuba(mesh):
    """Rays of a perspective sensor through the centres of its film's pixels; `t` is the distance from the eye."""
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("scalar_rgb")
    shape = mi.Mesh("mesh", len(mesh.vertices), len(mesh.faces))
    parameters = mi.traverse(shape)
    parameters["vertex_positions"] = mesh.vertices.ravel()
    parameters["faces"] = mesh.faces.ravel()
    parameters.update()
    view = mi.ScalarTransform4f().look_at(origin=EYE, target=TARGET, up=UP)
    film = {"type": "hdrfilm", "width": SIZE[0], "height": SIZE[1]}
    sensor = mi.load_dict({"type": "perspective", "fov": FOV, "fov_axis": "y", "to_world": view, "film": film})
    scene = mi.load_dict({"type": "scene", "shape": shape})
    depth, ids = np.full(SIZE[::-1], np.inf, np.float32), np.full(SIZE[::-1], -1)
    for y, x in np.ndindex(*depth.shape):
        ray, _ = sensor.sample_ray(0.0, 0.5, [(x + 0.5) / SIZE[0], (y + 0.5) / SIZE[1]], [0.5, 0.5])
        hit = scene.ray_intersect(ray)
        if hit.is_valid():
            # The ray begins on the near plane.
            depth[y, x] = np.linalg.norm(np.array(hit.p) - EYE)
            ids[y, x] = hit.prim_index
    return depth, ids


@pytest.mark.parametrize(("made", "convention"), [
    (by_open3d, Convention(flips_rows=True, flips_columns=True)),  # "up" is where its rows go
    (by_mitsuba, Convention(along_ray=True)),
], ids=["open3d", "mitsuba"])  # fmt: skip
def test_the_convention_of_another_program_s_image_is_found(made, convention, mesh, camera):
    judged = judge_image(mesh, camera, ForeignImage(*made(mesh)))
    assert judged.convention == convention
    assert judged.is_right
