"""Images that Open3D, Mitsuba 3 and Mesa's llvmpipe make in their usual ways: their conventions are found."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

import atra
from atra.command.main import main
from atra.judge.foreign import Convention, ForeignImage, judge_image
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


def by_llvmpipe(mesh):
    """A framebuffer of OpenGL, read as it lies: its first row is the lowest."""
    from experiments.methods.peers.llvmpipe import LLVMPIPE, opengl_context

    if LLVMPIPE.problem() is not None:
        pytest.skip(LLVMPIPE.problem())
    context = opengl_context(1)
    context.enable(context.DEPTH_TEST)
    program = context.program(
        "#version 330\nin vec3 at; uniform mat4 seen; uniform vec2 scale; out float depth;\n"
        "void main() { vec4 p = seen * vec4(at, 1); depth = -p.z;"
        " gl_Position = vec4(p.x * scale.x, p.y * scale.y, -1.002 * p.z - 0.02, -p.z); }",
        "#version 330\nin float depth; out float stored; void main() { stored = depth; }",
    )
    right, down, forward = atra.Camera(EYE, TARGET, UP, FOV, *SIZE).axes
    turn = np.stack([right, -down, -forward])
    seen = np.eye(4)
    seen[:3, :3], seen[:3, 3] = turn, -turn @ EYE
    tangent = np.tan(np.radians(FOV) / 2)
    program["seen"].write(seen.T.astype(np.float32).tobytes())
    program["scale"].value = (SIZE[1] / SIZE[0] / tangent, 1 / tangent)
    stored = context.texture(SIZE, 1, dtype="f4")
    frame = context.framebuffer([stored], context.depth_renderbuffer(SIZE))
    frame.use()
    frame.clear(red=0.0)
    corners = mesh.vertices[mesh.faces].astype(np.float32)
    context.vertex_array(program, [(context.buffer(corners.tobytes()), "3f", "at")]).render()
    depth = np.frombuffer(stored.read(), np.float32).reshape(SIZE[::-1]).copy()
    context.release()
    return depth, None


@pytest.mark.parametrize(("made", "convention", "wrong"), [
    (by_open3d, Convention(flips_rows=True, flips_columns=True), 0),  # "up" is where its rows go
    (by_mitsuba, Convention(along_ray=True), 0),
    (by_llvmpipe, Convention(flips_rows=True), 0.005 * SIZE[0] * SIZE[1]),  # corners snap to 1/256 pixel
], ids=["open3d", "mitsuba", "llvmpipe"])  # fmt: skip
def test_the_convention_of_another_program_s_image_is_found(
    made, convention, wrong, mesh, camera, tmp_path, monkeypatch, capsys
):
    depth, ids = made(mesh)
    judged = judge_image(mesh, camera, ForeignImage(depth, ids))
    assert judged.convention == convention
    assert judged.agreement.pixels_wrong <= wrong
    monkeypatch.chdir(tmp_path)
    np.savez("image.npz", depth=depth, **({} if ids is None else {"prim_id": ids.astype(np.int64)}))
    trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export("mesh.ply")
    one = {"eye": EYE, "target": TARGET, "up": UP, "fov_y_degrees": FOV, "width": SIZE[0], "height": SIZE[1]}
    Path("cameras.json").write_text(json.dumps({"view": one}), encoding="utf-8")
    given = ["atra", "judge", "image.npz", "--mesh", "mesh.ply", "--camera", "cameras.json"]
    monkeypatch.setattr(sys, "argv", given)
    assert main() == (judged.agreement.pixels_wrong > 0)
    assert str(convention) in capsys.readouterr().out
