"""Values at the edge of what can be: flat, tiny and far meshes, eyes far away, numbers and meshes of another type."""

import numpy as np
import pytest
import trimesh

import atra
from atra.errors import InputError
from atra.light import Atlas, Baker, Scene, Sun, constant_sky
from atra.light.lightmaps.charts.texels import Texels
from tests.meshes import quads

K = [[100, 0, 16], [0, 100, 16], [0, 0, 1]]
TURNED = [[0.6, -0.8, 0], [0.8, 0.6, 0], [0, 0, 1]]
FLAT = quads([[(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]])
CAMERA = atra.Camera((0.5, 0.5, 2), (0.5, 0.5, 0), width=32, height=32)


@pytest.mark.parametrize("t", [(1e308,) * 3, (1.7e308, -1.7e308, 1.7e308), (0, 0, 1e301)])
@pytest.mark.parametrize("rotation", [np.eye(3), TURNED])
def test_an_eye_beyond_float64_is_refused_by_its_place(t, rotation):
    with pytest.raises(InputError, match=r"the eye lies at \(.*, expected at most 1e\+300 from the origin"):
        atra.Camera.from_opencv(K, rotation, t, 32, 32)
    assert atra.Camera.from_opencv(K, rotation, (1e299,) * 3, 32, 32).axes.shape == (3, 3)


def aligned(mesh, camera):
    return atra.AlignedTracer(mesh, camera, (8, 1))


@pytest.mark.parametrize("tracer", [atra.RasterTracer, atra.PixelTracer, aligned])
def test_meshes_and_cameras_of_another_type_are_refused_by_their_type(tracer):
    with pytest.raises(InputError, match=r"mesh is a trimesh\.\S*Trimesh, expected an atra\.Mesh; .*from_trimesh"):
        tracer(trimesh.creation.box(), CAMERA)
    with pytest.raises(InputError, match=r"mesh is a builtins\.NoneType, expected an atra\.Mesh"):
        tracer(None, CAMERA)
    with pytest.raises(InputError, match=r"expected an atra\.Mesh"):
        atra.RayScene(trimesh.creation.box())
    with pytest.raises(InputError, match=r"camera is None, expected an atra\.Camera"):
        tracer(FLAT, None)


def room():
    """A cube above a floor, of coordinates with few digits."""
    box = trimesh.creation.box()
    floor = [(-3, -0.5, -3), (3, -0.5, -3), (3, -0.5, 3), (-3, -0.5, 3)]
    return np.concatenate([box.vertices + [0, 0.5, 0], floor]), np.concatenate([box.faces, [[8, 10, 9], [8, 11, 10]]])


@pytest.mark.parametrize(("scale", "shift"), [(2.0**-20, 0.0), (2.0**-30, 0.0), (1.0, 1e5), (2.0**-20, 0.125)])
def test_charts_are_as_good_however_small_the_mesh_and_however_far_from_the_origin(scale, shift):
    pytest.importorskip("xatlas")
    vertices, faces = room()
    near, far = atra.Mesh(vertices, faces), atra.Mesh(vertices * scale + shift, faces)
    here, there = Texels.of(near, Atlas.unwrap(near, 32)), Texels.of(far, Atlas.unwrap(far, 32))
    assert len(here) > 300
    assert here.atlas.charts == there.atlas.charts
    assert len(there) == pytest.approx(len(here), rel=0.1)
    assert (np.unique(there.prim_id) == np.arange(14)).all()


@pytest.mark.parametrize(("scale", "shift"), [(1e-6, 0.0), (1.0, 1e5)])
def test_a_baker_lights_a_tiny_and_a_far_mesh_as_any_other(scale, shift):
    pytest.importorskip("xatlas")
    vertices, faces = room()
    light = []
    for mesh in (atra.Mesh(vertices, faces), atra.Mesh(vertices * scale + shift, faces)):
        scene = Scene.plain(mesh, lights=[Sun((-0.3, -1, -0.2))], sky=constant_sky(1.0))
        with Baker(scene, size=32, threads=1) as baker:
            baker.add(16)
            light.append(baker.maps.combined.mean())
    assert light[1] == pytest.approx(light[0], rel=0.03)
