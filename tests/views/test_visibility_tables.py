"""Which points cameras see, and how many pixels of each view show each face."""

import numpy as np
import pytest

import atra
from tests.closed_meshes import box, sphere
from tests.lenses import lens_camera
from tests.meshes import cornell_box, cornell_camera, quads

VIEWS = {
    "pinhole": atra.Camera((0.4, 0.7, 4.0), (0, 0, 0), width=64, height=48),
    "from above": atra.Camera((0.1, 5.0, 0.2), (0, 0, 0), up=(0, 0, 1), width=32, height=32, fov_y_degrees=30),
    "parallel": atra.OrthographicCamera((0.3, 0.5, 4.0), (0, 0, 0), view_height=3.0, width=64, height=48),
}


def test_the_places_that_an_image_shows_are_visible_to_its_camera():
    for mesh, cameras in ((sphere(3), VIEWS), (cornell_box(), {"front": cornell_camera(96, 96)})):
        for row, camera in enumerate(cameras.values()):
            with atra.RasterTracer(mesh, camera) as tracer:
                hits = tracer.trace()
            seen = atra.visible_points(mesh, hits.points[hits.hit], cameras)[row]
            assert seen.mean() > 0.998  # others lie on edges, or where rays graze


@pytest.mark.parametrize("lens", [
    atra.OpenCVLens(k1=-0.2, p1=0.01), atra.FisheyeLens(k1=0.1), atra.EquirectangularLens(),
])  # fmt: skip
def test_through_a_lens_points_are_seen_and_faces_counted_as_its_image_shows_them(lens):
    mesh, camera = cornell_box(), lens_camera(lens, cornell_camera(96, 72))
    with atra.RasterTracer(mesh, camera) as tracer:
        hits = tracer.trace()
    assert atra.visible_points(mesh, hits.points[hits.hit], [camera]).mean() > 0.998
    behind = np.array(camera.eye) - camera.axes[2]
    assert atra.visible_points(mesh, [behind], [camera])[0, 0] == isinstance(lens, atra.EquirectangularLens)
    counts = atra.face_counts(mesh, {"a": camera, "b": VIEWS["pinhole"]}, distance=True)
    np.testing.assert_array_equal(counts.dense()[0], np.bincount(hits.prim_id[hits.hit], minlength=1112))
    first = counts.prim_id[0]
    away = np.linalg.norm(hits.points[hits.prim_id == first] - camera.eye, axis=1).mean()
    assert counts.distance[0] == pytest.approx(away, rel=1e-5)


def test_points_behind_triangles_outside_the_image_or_behind_the_camera_are_not_visible():
    wall = quads([[(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]])
    points = np.array([[0, 0, 1], [0, 0, 0], [0, 0, -1], [0, 0, 5], [50, 0, 1], [1.5, 0, -1], [0, 0, 4]], float)
    cameras = [
        atra.Camera((0, 0, 4), (0, 0, 0), width=8, height=8, fov_y_degrees=90),
        atra.OrthographicCamera((0, 0, 4), (0, 0, 0), view_height=4.0, width=8, height=8),
    ]
    expected = [[True, True, False, False, False, True, False]] * 2
    assert atra.visible_points(wall, points, cameras).tolist() == expected
    assert atra.visible_points(wall, points, []).shape == (0, 7)
    assert atra.visible_points(wall, np.zeros((0, 3)), cameras).shape == (2, 0)
    for wrong, message in (
        ((wall, [[0, np.nan, 0]], cameras), "point 0"), ((wall, points, cameras[0]), "cameras is"),
        ((wall, points, [1]), "cameras is"),
    ):  # fmt: skip
        with pytest.raises(atra.InputError, match=message):
            atra.visible_points(*wrong)
    with pytest.raises(atra.InputError, match="tolerance is 1"):
        atra.visible_points(wall, points, cameras, tolerance=1.0)


def test_faces_are_counted_in_every_view():
    mesh = box()
    counts = atra.face_counts(mesh, VIEWS, angle=True, distance=True)
    for row, camera in enumerate(VIEWS.values()):
        with atra.RasterTracer(mesh, camera) as tracer:
            hits = tracer.trace()
        expected = np.bincount(hits.prim_id[hits.hit], minlength=12)
        assert (counts.dense()[row] == expected).all()
        own = slice(counts.view_splits[row], counts.view_splits[row + 1])
        for prim_id, angle, distance in zip(counts.prim_id[own], counts.angle[own], counts.distance[own], strict=True):
            shown = hits.prim_id == prim_id
            points = hits.points[shown].astype(float)
            ways = points - camera.eye
            if camera.is_parallel:
                ways = (ways @ camera.axes[2])[:, None] * camera.axes[2]
            lengths = np.linalg.norm(ways, axis=1)
            cosine = np.abs((hits.normals[shown] * ways).sum(axis=1)) / lengths
            assert angle == pytest.approx(np.arccos(cosine).mean(), abs=1e-5)
            assert distance == pytest.approx(lengths.mean(), rel=1e-5)
    plain = atra.face_counts(mesh, list(VIEWS.values()))
    assert plain.angle is plain.distance is None
    assert (plain.pixels == counts.pixels).all()
    assert atra.face_counts(mesh, []).dense().shape == (0, 12)
