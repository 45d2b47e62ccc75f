"""Cameras with a lens: every method sees through them what the reference sees, or refuses them and names the lens."""

import numpy as np
import pytest

import atra
from experiments.workloads.agreement.oracle import examine, nearest_hits
from scenes.directory import PAPER_SCENES
from scenes.loading import SceneSource, load_scene
from tests.folders import NEEDS_SCENES
from tests.images import CELLS, assert_equal_images, assert_no_pixel_wrong, make_tracer
from tests.judge.reference import brute_force
from tests.lenses import lens_camera, random_lens
from tests.machine import WIDEST, WIDTHS
from tests.meshes import cornell_box, cornell_camera

LENSES = {
    "barrel": atra.OpenCVLens(k1=-0.3, k2=0.08, p1=0.002, p2=-0.001),
    "folded": atra.OpenCVLens(k1=-0.6),
    "fisheye": atra.FisheyeLens(k1=0.05, k2=-0.01),
    "panorama": atra.EquirectangularLens(),
}
PLACED = cornell_camera(96, 72)
TRACERS = {f"packets of {width}": (atra.PixelTracer, {"packet_width": width}) for width in WIDTHS} | {
    "raster": (atra.RasterTracer, {}),
}


def trace(kind, mesh, camera, **options):
    tracer, own = TRACERS[kind]
    with tracer(mesh, camera, threads=1, **own, **options) as made:
        return made.trace((0.25, 0.625))


@pytest.mark.parametrize("name", LENSES)
def test_every_method_that_takes_a_lens_sees_what_the_reference_sees(name):
    mesh, camera = cornell_box(), lens_camera(LENSES[name], PLACED)
    reference = brute_force(mesh, camera, (0.25, 0.625))
    assert reference.hit.any()
    for kind in TRACERS:
        hits = trace(kind, mesh, camera)
        agreement = assert_no_pixel_wrong(mesh, camera, hits, reference)
        assert agreement.pixels_equal >= 0.999 * agreement.pixels, (kind, str(agreement))
        examined = examine(hits, reference, np.arange(0, agreement.pixels, 7))
        assert not examined.hits_wrong.any(), kind
    assert not (reference.hit & ~camera.has_ray(reference.offset)).any()
    assert camera.has_ray().all() != (name == "folded")


def test_a_hit_lies_on_its_ray_where_its_depth_says():
    for name in LENSES:
        mesh, camera = cornell_box(), lens_camera(LENSES[name], PLACED)
        hits = trace(f"packets of {WIDEST}", mesh, camera)
        origins, directions = camera.rays_world(hits.offset)
        places = origins + hits.depth_along("ray")[..., None] * directions / np.linalg.norm(
            directions, axis=-1, keepdims=True
        )
        np.testing.assert_allclose(hits.points[hits.hit], places[hits.hit], atol=2e-6)
        axis = camera.to_camera_space(hits.points[hits.hit])[:, 2]
        np.testing.assert_allclose(hits.depth_along("axis")[hits.hit], axis, atol=2e-6)
        corners = mesh.triangles(hits.prim_id[hits.hit])
        u, v = hits.u[hits.hit][:, None], hits.v[hits.hit][:, None]
        weighed = (1 - u - v) * corners[:, 0] + u * corners[:, 1] + v * corners[:, 2]
        np.testing.assert_allclose(weighed, hits.points[hits.hit], atol=2e-6)
        assert np.isnan(hits.points[~hits.hit]).all()
    with pytest.raises(atra.InputError, match="along 'z', expected axis or ray"):
        hits.depth_along("z")


def test_a_tracer_looks_through_one_lens_after_another():
    mesh = cornell_box()
    for kind in (atra.PixelTracer, atra.RasterTracer):
        tracer = kind(mesh, PLACED, threads=1)
        for name in ("barrel", "panorama", None, "barrel"):
            camera = PLACED if name is None else lens_camera(LENSES[name], PLACED)
            tracer.look(camera)
            assert_equal_images(mesh, camera, tracer.trace(), brute_force(mesh, camera))
        tracer.close()


@pytest.mark.parametrize("use", [
    *(pytest.param(lambda mesh, camera, method=method: make_tracer(method, mesh, camera), id=method)
      for method in CELLS),
    pytest.param(lambda mesh, camera: atra.Alignment.of_eyes(camera, camera, atra.Split(1, 1, 96, 72)), id="eyes"),
    pytest.param(lambda mesh, camera: atra.PixelTracer(mesh, camera, threads=1).gather(atra.Count()), id="gather"),
    pytest.param(lambda mesh, camera: atra.RasterTracer(mesh, camera, threads=1).gather(atra.Count()), id="drawn"),
    pytest.param(lambda mesh, camera: make_tracer("aligned", mesh, PLACED).look(camera), id="look"),
])  # fmt: skip
def test_methods_that_need_a_plane_refuse_a_lens_by_name(use):
    with pytest.raises(atra.InputError, match=r"OpenCVLens\(k1=-0\.6\).*camera\.undistorted\(\)"):
        use(cornell_box(), lens_camera(LENSES["folded"], PLACED))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("source", "name"),
    [("procedural", name) for name in ("cornell_box", "material_ball", "living_room", "atrium")]
    + [pytest.param("directory", name, marks=NEEDS_SCENES) for name in PAPER_SCENES],
)
def test_fifty_random_lenses_on_each_scene_show_nothing_wrong(source, name):
    scene = load_scene(SceneSource(source), name, None)
    placed, random = atra.Camera(**scene.camera), np.random.default_rng(0)
    tracers = {}
    for _ in range(50):
        camera = lens_camera(random_lens(random), placed, 32, 24, random.uniform(0.3, 1.5))
        y, x = np.divmod(np.arange(32 * 24), 32)
        truth = nearest_hits(scene.mesh, camera, x, y)
        depth, prim_id = truth.depth.astype(np.float32).reshape(24, 32), truth.prim_id.reshape(24, 32)
        reference = atra.Hits(depth, prim_id, (0.5, 0.5), scene.mesh, camera)
        for kind, (tracer, own) in TRACERS.items():
            if kind not in tracers:
                tracers[kind] = tracer(scene.mesh, camera, **own)
            tracers[kind].look(camera)
            print(name, kind, assert_no_pixel_wrong(scene.mesh, camera, tracers[kind].trace(), reference))
    for tracer in tracers.values():
        tracer.close()
