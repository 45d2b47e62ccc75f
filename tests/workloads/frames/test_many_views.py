"""Workload `views`: others and the library do the same work from the same start, and rays go to whoever takes rays."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import atra
from experiments.drawing.style import TIMES
from experiments.harness.processes.worker import measure_point
from experiments.methods import find_method
from experiments.results.terminal import results_console
from experiments.workloads import views as measuring
from experiments.workloads.baselines import OWN
from experiments.workloads.frame import FRAME
from experiments.workloads.rays import camera_rays, random_rays
from experiments.workloads.tables import told_table
from experiments.workloads.views import LIBRARY, VIEWS, ViewsOptions, cameras_around
from tests import points
from tests.drawn import make_rows, method_row
from tests.images import assert_same_bits
from tests.meshes import cornell_box, cornell_camera

MESH, CAMERA = cornell_box(), cornell_camera(48, 32)


def planned(method="embreex", **options):
    return points.planned(method, "views", measure={"warmup": 0}, asked=options)


def measured(method="embreex", **options):
    one = planned(method, **options)
    assert one.problem is None
    return measure_point(one.point)


def test_cameras_have_an_eye_each_and_see_the_mesh_off_the_middle_of_their_images():
    cameras = cameras_around(CAMERA, MESH, 20)
    assert len({camera.eye for camera in cameras}) == 20
    middle = 0.45 * 48 + 0.5, 0.55 * 32 + 0.5  # of OpenCV, whose pixels begin half a pixel later
    for camera in cameras:
        ahead = camera.to_pixels[:, :3] @ camera.axes[2]
        assert ahead[:2] / ahead[2] == pytest.approx(middle)
        assert (camera.width, camera.height) == (48, 32)
    found = [hits.hit.mean() for _, hits in atra.render_views(MESH, cameras, threads=1)]
    assert min(found) > 0.3


def test_others_and_the_library_find_the_same_triangles_and_are_timed_in_the_same_rounds():
    got = measured(views=3)
    assert {name: len(values) for name, values in got.samples.items()} == {OWN: 3, LIBRARY: 3}
    assert got.results["ids_equal"] > 0.99


def test_views_of_our_own_methods_are_those_of_the_library(monkeypatch):
    made = []
    mesh = measuring.Mesh
    monkeypatch.setattr(measuring, "Mesh", lambda *given: made.append(mesh(*given)) or made[-1])
    assert measured("raster", views=2).results["ids_equal"] == 1.0
    assert len(made) == 2 * (1 + 3)  # of which nothing is known when the clock starts
    with pytest.raises(atra.InputError, match=r"workload\.views is 0"):
        ViewsOptions(views=0)


def test_rays_of_a_camera_and_from_anywhere_are_what_they_are_called():
    origins, directions = camera_rays(CAMERA)
    with atra.RayScene(MESH, threads=1) as scene, atra.PixelTracer(MESH, CAMERA, threads=1) as tracer:
        found = scene.intersect(origins, directions).prim_id.reshape(32, 48)
        assert (found == tracer.trace().prim_id).mean() > 0.99
    origins, directions = random_rays(MESH, 4000)
    assert (MESH.bounds[0] - 1e-5 <= origins).all()
    assert (origins <= MESH.bounds[1] + 1e-5).all()
    assert np.abs(directions.mean(axis=0)).max() < 0.1


@pytest.mark.parametrize("name", ["embreex", "trimesh", "mitsuba3", "open3d"])
def test_a_peer_is_given_any_rays_and_another_camera(name):
    method = find_method(name)
    if method.problem() is not None:
        pytest.skip(str(method.problem()))
    origins, directions = random_rays(MESH, 3000)
    moved = cameras_around(CAMERA, MESH, 3)[1]

    def make(camera):
        return method.make(MESH, camera, method.options(), replace(planned().point.tracing, threads=1))

    with make(CAMERA) as tracer, make(moved) as other, atra.RayScene(MESH, threads=1) as scene:
        theirs = tracer.prepared.scene
        t, prim_id = theirs.cast(theirs.make_rays(origins, directions))
        hits = scene.intersect(origins, directions)
        same = prim_id == hits.prim_id
        assert same.mean() > 0.99
        np.testing.assert_allclose(t[same], hits.t[same], rtol=1e-4)
        tracer.look(moved)
        assert_same_bits(tracer.trace(), other.trace())


def test_the_terminal_says_how_many_times_as_fast_the_library_is(capsys):
    row = {"scene": "cornell_box", "method": "embreex", "views": 20, "workload": VIEWS.name, "point_id": "0",
           "split_x": None, "packet_width": 1,
           "job_time_s": 6.0, "library_time_s": 0.75, "library_gain": 8.0, "ids_equal": 0.99997,
           "library_gain_low": 7.5, "library_gain_high": 8.5}  # fmt: skip
    results_console().print(told_table(VIEWS, pd.DataFrame([row])))
    said = capsys.readouterr().out
    for text in ("cornell_box, embreex", "6,000.0 ms", "750.0 ms", "8.00 [7.50, 8.50]", "0.99997"):
        assert text in said


def test_of_several_splits_the_best_is_told_with_all_that_is_wrong(capsys):
    splits = (
        method_row("aligned", 2, 0.02, 2.0, pixels_wrong=100),
        method_row("aligned", 8, 0.01, 4.0, pixels_wrong=234),
    )
    results_console().print(told_table(FRAME, make_rows(*splits)))
    said = " ".join(capsys.readouterr().out.split())
    assert f"8 {TIMES} 1" in said
    assert f"2 {TIMES} 1" not in said
    assert "10.0 ms" in said
    assert "334" in said
