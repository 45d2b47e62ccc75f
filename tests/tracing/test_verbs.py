"""One verb for each thing: all is built on first use, and `update` takes other vertices of the same faces."""

from dataclasses import replace

import numpy as np
import pytest

import atra
from atra.light import Baker, HybridRenderer, PathRenderer, PointLight, Scene
from atra.rays.kernel_scene import KernelScene
from tests.images import assert_same_bits
from tests.meshes import cornell_box, cornell_camera

MESH, CAMERA = cornell_box(), cornell_camera(32, 24)
POSED = atra.Mesh(MESH.vertices * np.float32([0.9, 1.1, 0.8]) + np.float32([0.02, -0.03, 0.01]), MESH.faces)
OTHER = atra.Mesh(MESH.vertices, MESH.faces[::-1])

TRACERS = {
    "pixels": lambda mesh: atra.PixelTracer(mesh, CAMERA, threads=1),
    "aligned": lambda mesh: atra.AlignedTracer(mesh, CAMERA, (4, 1), threads=1),
    "instanced": lambda mesh: atra.AlignedTracer(mesh, CAMERA, (4, 1), threads=1, geometry="instanced", culling=False),
    "visible_first": lambda mesh: atra.VisibleFirstTracer(mesh, CAMERA, (4, 1), threads=1),
    "raster": lambda mesh: atra.RasterTracer(mesh, CAMERA, threads=1),
}


@pytest.mark.parametrize("kind", TRACERS)
def test_a_tracer_builds_on_first_use_and_an_updated_mesh_is_seen_as_by_a_new_tracer(kind):
    with TRACERS[kind](POSED) as new:
        expected = new.trace()
    one = TRACERS[kind](MESH)
    one.update(POSED)  # before anything is built
    assert_same_bits(one.trace(), expected)
    one.update(MESH)
    with TRACERS[kind](MESH) as new:
        assert_same_bits(one.trace(), new.trace())
    one.update(POSED)
    hits = one.trace()
    assert_same_bits(hits, expected)
    assert hits.mesh is one.mesh is POSED
    with pytest.raises(atra.InputError, match=r"expected .* as before"):
        one.update(OTHER)
    with pytest.raises(atra.InputError, match=r"1 triangles, expected other vertices of the same faces"):
        one.update(atra.Mesh(MESH.vertices, MESH.faces[:1]))
    assert_same_bits(one.trace(), expected)
    one.close()
    for call in (one.trace, one.build, lambda: one.look(CAMERA), lambda: one.update(MESH)):
        with pytest.raises(atra.ClosedError, match=f"this {type(one).__name__} is closed; make a new one"):
            call()


@pytest.mark.parametrize("kind", ["pixels", "aligned", "raster"])
def test_all_hits_of_an_updated_mesh_are_those_of_a_new_tracer(kind):
    with TRACERS[kind](MESH) as one, TRACERS[kind](POSED) as new:
        one.gather(atra.Count())
        one.update(POSED)
        np.testing.assert_array_equal(one.gather(atra.Count()).count, new.gather(atra.Count()).count)


def test_a_method_that_cannot_gather_says_which_can():
    with pytest.raises(atra.InputError, match="use RasterTracer, PixelTracer or AlignedTracer"):
        TRACERS["visible_first"](MESH).gather(atra.Count())


LAMP = PointLight((0.0, 1.5, 0.0), power=5.0)


@pytest.mark.parametrize("kind", [HybridRenderer, PathRenderer])
def test_a_renderer_takes_another_pose_and_another_camera(kind):
    camera = replace(CAMERA, width=24)
    with kind(Scene(POSED, lights=[LAMP]), camera, threads=1) as new:
        new.add(2)
        expected = new.image
    one = kind(Scene(MESH, lights=[LAMP]), CAMERA, threads=1)
    one.add()
    one.update(Scene(POSED, lights=[LAMP]))
    assert one.samples == 0
    one.look(camera)
    one.add(2)
    np.testing.assert_array_equal(one.image, expected)
    with pytest.raises(atra.InputError, match=r"expected .* as before"):
        one.update(Scene(OTHER, lights=[LAMP]))


def test_a_bake_takes_another_pose_on_the_charts_it_has(monkeypatch):
    one = Baker(Scene.plain(MESH, lights=[LAMP]), size=64, threads=1)
    assert (one.share_done(4), one.rays) == (0.0, 0)  # asked before anything is built
    one.add(1)
    atlas = one.texels.atlas
    built, build = [], KernelScene._build
    monkeypatch.setattr(KernelScene, "_build", lambda scene: built.append(scene.mesh) or build(scene))
    one.update(Scene.plain(POSED, lights=[LAMP]))
    assert built == [POSED]  # one BVH
    one.add(2)
    assert one.texels.atlas is atlas
    with Baker(Scene.plain(POSED, lights=[LAMP]), atlas, threads=1) as new:
        new.add(2)
        np.testing.assert_array_equal(one.maps.combined, new.maps.combined)
    with pytest.raises(atra.InputError, match=r"expected .* as before"):
        one.update(Scene.plain(OTHER, lights=[LAMP]))
