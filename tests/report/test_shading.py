"""Pictures of hits, and of where two images differ."""

import numpy as np

import atra
from atra.hits import Hits
from atra.judge.compare import Verdict
from atra.judge.marks import COLOURS
from atra.prim_ids import MISS
from experiments.drawing.shading import BACKGROUND, difference_picture, shade
from tests.meshes import EYE_AT_ORIGIN, quads

ALL = np.ones((32, 32), bool)


def wall(*depths):
    """Walls across the left half of the view, facing the eye, and a camera."""
    camera = atra.Camera(**EYE_AT_ORIGIN, fov_y_degrees=60, width=32, height=32)
    corners = [[(0, -9, z), (9, -9, z), (9, 9, z), (0, 9, z)] for z in depths]
    return quads(corners), camera


def flat_hits(mesh, camera, hit=ALL):
    depths, prim_id = np.where(hit, 2, np.inf).astype(np.float32), np.where(hit, 0, MISS).astype(np.uint32)
    return Hits(depths, prim_id, (0.5, 0.5), mesh, camera)


def test_a_wall_facing_the_eye_is_evenly_lit_and_a_miss_is_background():
    mesh, camera = wall(2.0)
    hit = ALL & (np.arange(32) < 16)
    picture = shade(flat_hits(mesh, camera, hit=hit))
    assert (picture[~hit] == BACKGROUND).all()
    assert len(np.unique(picture[hit], axis=0)) == 1
    assert tuple(picture[0, 0]) != BACKGROUND
    assert (shade(flat_hits(mesh, camera, hit=~ALL)) == BACKGROUND).all()


def test_light_comes_from_above_whatever_way_the_vertices_run():
    mesh, camera = wall(2.0)

    def brightness(slope, faces):
        vertices = mesh.vertices.copy()
        vertices[:, 2] += slope * vertices[:, 1]
        return int(shade(flat_hits(atra.Mesh(vertices, faces), camera)).sum())

    for faces in (mesh.faces, mesh.faces[:, ::-1]):
        # Falling back towards its top a wall faces up, leaning over it faces down.
        assert brightness(0.2, faces) > brightness(0.0, faces) > brightness(-0.2, faces)
    assert brightness(0.2, mesh.faces) == brightness(0.2, mesh.faces[:, ::-1])


def test_a_difference_picture_marks_exactly_the_pixels_that_differ():
    mesh, camera = wall(2.0, 3.0)
    one, other = flat_hits(mesh, camera), flat_hits(mesh, camera)
    other.prim_id[3, 5], other.depth[7, 9] = 1, 2.1
    other.depth[8, 8] = np.nextafter(np.float32(2), np.float32(3))  # rounding is no difference
    marked = (difference_picture(one, other, reach_pixels=0) != 255).any(axis=2)
    assert set(zip(*np.nonzero(marked), strict=True)) == {(3, 5), (7, 9)}
    assert (difference_picture(one, one) == 255).all()
    misses = flat_hits(mesh, camera, hit=~ALL)
    assert (difference_picture(misses, misses) == 255).all()


def test_marks_have_the_verdict_s_colour_reach_beyond_their_pixel_and_stay_in_the_picture():
    mesh, camera = wall(2.0)
    hits = flat_hits(mesh, camera)
    verdict = np.zeros((32, 32), np.uint8)
    verdict[0, 0], verdict[16, 16], verdict[31, 31] = Verdict.TIED, Verdict.WRONG, Verdict.EDGE
    picture = difference_picture(hits, hits, verdict, reach_pixels=2)
    for (y, x), kind in (((0, 0), Verdict.TIED), ((16, 16), Verdict.WRONG), ((31, 31), Verdict.EDGE)):
        assert tuple(picture[y, x]) == COLOURS[kind]
    assert tuple(picture[20, 12]) == COLOURS[Verdict.WRONG]  # an arm of the cross
    assert tuple(picture[0, 31]) == tuple(picture[31, 0]) == (255, 255, 255)  # nothing comes in from the other side
    unjudged = difference_picture(hits, hits, verdict, reach_pixels=0)
    assert set(zip(*np.nonzero((unjudged != 255).any(axis=2)), strict=True)) == {(0, 0), (16, 16), (31, 31)}
