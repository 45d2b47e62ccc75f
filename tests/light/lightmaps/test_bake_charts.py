"""Charts and texels of lightmaps: what belongs to whom, gutters and seams, the culling map, and hostile input."""

import importlib.util
import warnings
from functools import partial

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

import atra
from atra import light
from atra.errors import AtraError, InputError
from atra.light import Atlas, Baker, Seams, Texels, dilated
from scenes.cornell_box import cornell_box
from tests.baked import baked, cube, painted, sheet
from tests.meshes import joined, quads
from tests.shown import floor

xatlas = pytest.mark.skipif(importlib.util.find_spec("xatlas") is None, reason="xatlas is not installed (extra `bake`)")

PLATE = quads([floor(0.5)])


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(0, 12, width=32), min_size=6, max_size=6))
def test_a_triangle_has_just_the_texels_that_it_reaches_into(places):
    """It reaches into a texel unless a line along a side of either separates them."""
    corners = np.array(places).reshape(3, 2)
    if abs(np.linalg.det(corners[1:] - corners[0])) < 1e-3:
        return
    mesh = atra.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    occupied = Texels.of(mesh, Atlas(corners[None], np.zeros(1, int), 12, 12)).occupied
    squares = np.stack(np.meshgrid(np.arange(12), np.arange(12)), -1)[..., None, :] + [(0, 0), (1, 0), (1, 1), (0, 1)]
    gap = np.full((12, 12), -np.inf)
    for x, y in (*(np.roll(corners, -1, axis=0) - corners), (1, 0), (0, 1)):
        across = np.array((y, -x)) / np.hypot(x, y)
        own, theirs = corners @ across, squares @ across
        gap = np.maximum(gap, np.maximum(own.min() - theirs.max(axis=-1), theirs.min(axis=-1) - own.max()))
    assert occupied[gap < -0.01].all()
    assert not occupied[gap > 0].any()


def test_a_texel_belongs_to_the_triangle_around_its_centre_and_lies_where_that_lies():
    mesh = cube()
    texels = Texels.of(mesh, sheet(mesh, 7))
    assert len(texels) == 6 * 49
    assert texels.faces_lost == 0
    assert texels.atlas.charts == 6
    assert (np.bincount(texels.chart) == 49).all()
    np.testing.assert_allclose(np.abs(texels.positions).max(axis=1), 1.0, rtol=1e-6)
    np.testing.assert_allclose((texels.positions * texels.normals).sum(axis=1), 1.0, rtol=1e-6)


def test_a_triangle_smaller_than_a_texel_still_has_one_and_one_without_area_has_none():
    vertices = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (2, 0, 0)]
    mesh = atra.Mesh(vertices, [(0, 1, 2), (0, 1, 3)])
    uv = np.array([[(0.30, 0.3), (0.31, 0.3), (0.3, 0.31)], [(0.6, 0.6), (0.8, 0.6), (0.6, 0.8)]])
    texels = Texels.of(mesh, Atlas.of_uv(uv, 8, 8))
    assert texels.prim_id.tolist() == [0]
    assert texels.faces_lost == 1


UV = np.array([[(0.2, 0.2), (0.8, 0.2), (0.8, 0.8)], [(0.2, 0.2), (0.8, 0.8), (0.2, 0.8)]])
"""Places of the two triangles of `PLATE` on a map."""


@pytest.mark.parametrize(("make", "told"), [
    (lambda: Texels.of(PLATE, Atlas.of_uv(UV[[0, 0]], 10, 10)), r"faces 0 and 1 overlap in the map, in \d+ texels"),
    (lambda: Texels.of(PLATE, Atlas.of_uv(np.zeros((2, 3, 2)), 10, 10)), r"no triangle of .* touches a texel"),
    (lambda: Atlas.of_uv([UV[0], UV[1] + 0.5], 10, 10), "uv of face 1 are"),
    (lambda: Atlas.of_uv(np.full((2, 3, 2), np.nan), 10, 10), "uv of face 0 are not finite"),
    (lambda: Atlas.of_uv(np.zeros((2, 3)), 10, 10), r"expected \(F, 3, 2\)"),
    (lambda: Atlas.of_uv(UV, 0, 10), "width of a map is 0"),
    (lambda: Atlas.of_uv(UV, 8, 8, np.array([0, -1])), r"expected \(F,\) numbers from 0 on"),
    (lambda: Atlas.of_uv(UV, 8, 8, np.array([0.0, 1.0])), "of float64"),
    (lambda: Atlas.of_uv(UV, 8, 8, np.array([0, 0, 1])), r"shape \(3,\)"),
    (lambda: Atlas.of_uv(UV, 1 << 14, 1 << 14, np.array([0, 1 << 14])), r"expected at most 2\^28"),
    (lambda: Atlas.of_uv([UV[0], UV[1] + (0, 0.5)], 8, 8, np.array([0, 1])), "uv of face 1 are"),
    (lambda: Atlas(UV, np.zeros(2, int), 8, 9, 2), "height of 2 maps together is 9"),
    (lambda: Atlas(UV, np.zeros(2, int), 8, 8, 0), "number of maps is 0"),
    (lambda: Atlas(UV * (1, 15), np.zeros(2, int), 8, 16, 2), "face 0 lies on maps 0 and 1, expected one"),
])  # fmt: skip
def test_uv_of_ones_own_are_refused_where_they_overlap_or_leave_their_map(make, told):
    with pytest.raises(InputError, match=told):
        make()


def test_charts_that_fold_over_in_a_few_texels_are_taken_and_told():
    square = np.array([[(0, 0), (64, 0), (64, 64)], [(0, 0), (64, 64), (0, 64)]], float)
    sliver = [(64.0, 31.0), (64.0, 32.0), (61.0, 31.5)]  # as a triangle that a chart folds over
    mesh = atra.Mesh(
        [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 0), (2, 1, 0)], [(0, 1, 2), (0, 2, 3), (1, 4, 5)]
    )
    uv = np.concatenate([square, [sliver]])
    with pytest.warns(UserWarning, match=r"faces 0 and 2 overlap in the map, in \d texels together with others; each"):
        texels = Texels.of(mesh, Atlas(uv, np.array([0, 0, 0]), 64, 64))
    assert len(texels) == 64 * 64
    with pytest.raises(InputError, match=r"faces 0 and 2 overlap .*let Atlas\.unwrap make charts"):
        Texels.of(mesh, Atlas(np.concatenate([square, [[(64, 0), (64, 64), (10, 32)]]]), np.array([0, 0, 0]), 64, 64))


@xatlas
def test_charts_by_xatlas_are_kept_by_the_mesh_and_made_anew_where_damaged(tmp_path):
    mesh = cornell_box()
    atlas = Atlas.unwrap(mesh, 64, kept_in=tmp_path)
    (kept,) = tmp_path.iterdir()
    first = kept.stat().st_mtime_ns
    again = Atlas.unwrap(mesh, 64, kept_in=tmp_path)
    assert kept.stat().st_mtime_ns == first
    kept.write_bytes(kept.read_bytes()[:100])
    for other in (again, Atlas.unwrap(mesh, 64, kept_in=tmp_path)):
        np.testing.assert_array_equal(atlas.uv, other.uv)
        np.testing.assert_array_equal(atlas.chart, other.chart)
    texels = Texels.of(mesh, atlas)
    assert texels.faces_lost == 0
    assert 0.3 < texels.occupancy < 1
    with pytest.raises(AtraError, match=r"no charts of Mesh\('cornell_box'.* in 0.01 s"):
        Atlas.unwrap(mesh, 64, time_limit_s=0.01)


def test_gutters_are_filled_from_what_is_lit_and_lit_texels_stay():
    mesh = cube()
    texels = Texels.of(mesh, sheet(mesh, 5, gap=3))
    values = np.random.default_rng(1).random((len(texels), 3)).astype(np.float32) + 1
    valid = np.ones(len(texels), bool)
    valid[7] = False
    image = dilated(texels, values, valid)
    assert image.min() >= 1
    kept = image.reshape(-1, 3)[texels.number]
    np.testing.assert_array_equal(kept[valid], values[valid])
    assert not (kept[7] == values[7]).any()
    assert not dilated(texels, values, ~valid & False).any()


def folded():
    """A plane of two squares that share an edge."""
    return quads([[(-1, 0, 1), (0, 0, 1), (0, 0, -1), (-1, 0, -1)], [(0, 0, 1), (1, 0, 1), (1, 0, -1), (0, 0, -1)]])


def test_a_seam_is_stitched_to_a_quarter_of_its_step_or_less_and_the_rest_is_left_alone():
    mesh = folded()
    texels = Texels.of(mesh, sheet(mesh, 12, gap=4))
    seams = Seams.of(mesh, texels.atlas)
    noise = np.random.default_rng(1).normal(0, 0.1, (len(texels), 3)).astype(np.float32)
    image = dilated(texels, 1 + noise, np.ones(len(texels), bool))
    stitched = seams.stitched(image)
    assert seams.step(image) > 0.05
    assert seams.step(stitched) < 0.25 * seams.step(image)
    assert (stitched != image).any(axis=2).mean() < 0.4
    sharp = cube()
    assert Seams.of(sharp, sheet(sharp, 6)).step(image) == 0.0  # light may differ around a corner


TURN = trimesh.transformations.euler_matrix(0.3, 0.5, 0.7)[:3, :3]
"""No wall is along an axis, so that rounding puts texels before or behind their walls."""


@pytest.mark.parametrize("tracer", [atra.RasterTracer, partial(atra.PixelTracer, threads=1)])
@pytest.mark.parametrize("place", [0.0, np.array([1e5, -7e4, 3e4])], ids=["at the origin", "far away"])
@pytest.mark.parametrize("size", [64, 3])  # of three pixels, nearly all texels are looked for by rays
@pytest.mark.parametrize("is_parallel", [False, True])
def test_the_culling_map_is_what_a_ray_from_each_texel_says(tracer, place, size, is_parallel):
    room = joined(cube(inwards=True), cube(0.15))
    mesh = atra.Mesh(room.vertices @ TURN.T + place, room.faces)
    eye, target = (tuple((TURN @ at + place).tolist()) for at in ((-0.6, 0.5, 0.4), (0.2, -0.1, -0.3)))
    kind, field = (atra.OrthographicCamera, {"view_height": 1.0}) if is_parallel else (atra.Camera, {})
    camera = kind(eye, target, width=size, height=size, **field)
    with Baker(painted(mesh), sheet(mesh, 30), threads=1) as baker, tracer(mesh, camera) as primary:
        baker.look(camera, primary)
        texels, visible = baker.texels, baker.visible
    points = camera.to_eye_space(texels.positions)
    a, b, c = (points @ camera.to_pixels[:, :3].T + camera.to_pixels[:, 3]).T
    depth = points @ camera.axes[2]
    inside = (c > 0) & (depth > 0) & (a >= 0) & (a <= size * c) & (b >= 0) & (b <= size * c)
    to_eye = -depth[:, None] * camera.axes[2] if is_parallel else -points
    hidden = atra.RayScene(mesh, threads=1).occluded(texels.positions, to_eye, tnear=1e-4, tfar=0.9999)
    true = inside & ((texels.normals * to_eye).sum(axis=1) > 0) & ~hidden
    assert 0.02 < true.mean() < 0.9
    wrong = visible != true
    assert (wrong & inside).sum() <= 0.01 * true.sum()
    assert (wrong & ~inside).sum() <= 0.02 * true.sum()  # these reach into the image, though their middles do not
    assert ((texels.prim_id >= 12) & true).any(), "the camera sees nothing of the block"


@settings(max_examples=25, deadline=None)
@given(st.data())
def test_no_mesh_and_no_uv_does_more_than_be_refused(data):
    count = data.draw(st.integers(1, 6))
    numbers = st.one_of(st.floats(-1e11, 1e11), st.sampled_from([0.0, 1.0, 1e-30, 1e11, 0.5]))
    vertices = data.draw(st.lists(st.tuples(numbers, numbers, numbers), min_size=3, max_size=8))
    faces = data.draw(st.lists(st.tuples(*[st.integers(0, len(vertices) - 1)] * 3), min_size=count, max_size=count))
    places = st.one_of(st.floats(0, 1), st.sampled_from([0.0, 1.0, 0.5]), st.floats())
    uv = data.draw(st.lists(places, min_size=6 * count, max_size=6 * count))
    try:
        mesh = atra.Mesh(vertices, faces)
        atlas = Atlas.of_uv(np.array(uv).reshape(count, 3, 2), 8, 8)
        scene = painted(mesh, lights=[light.PointLight((0, 0, 0))], sky=light.constant_sky(1.0))
        with warnings.catch_warnings(action="ignore"):
            lightmap = baked(scene, atlas, 2)
    except AtraError:
        return
    assert np.isfinite(lightmap.combined).all()
    assert (lightmap.openness <= 1).all()
