"""Rays of texels of flat charts, carried onto one tile: they see what they would see by themselves."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import atra
from atra.errors import InputError
from atra.light import Atlas, Texels
from atra.light.lightmaps.charts.atlas import UNMAPPED
from experiments.drawing.figure import make_figures
from experiments.drawing.render import render
from experiments.light.bake_rays import AlignedTiles, directions_of, undecided
from experiments.light.bake_rays.shown import CLAIMS, FIGURES
from experiments.light.sun.tiles import Tiles
from experiments.results.claims import DOES_NOT_HOLD, HOLDS, NOT_MEASURED, UNDECIDED, judge_all
from experiments.results.table import frame_of
from scenes.cornell_box import cornell_box
from tests.baked import baked, cube, sheet
from tests.far import AWAY
from tests.light.test_far_light import ROOM as ROOM_NEAR
from tests.light.test_far_light import ROOM_AWAY, bake_scene
from tests.meshes import joined
from tests.points import planned

ROOM = joined(cube(inwards=True), cube(0.3), atra.Mesh(cube(0.2).vertices + np.float32([0.5, 0.1, -0.4]), cube().faces))
OPEN = atra.Mesh(ROOM.vertices, np.delete(ROOM.faces, (6, 7), axis=0), "without its ceiling")
SUN = (0.35, 1.0, -0.25)
FLOOR = [(-1, 0, -1), (-1, 0, 1), (1, 0, 1), (1, 0, -1)]


def tiles_of(size, mesh=ROOM):
    return Tiles.of(Texels.of(mesh, sheet(mesh, 12)), size)


def shadowed(*above):
    """Tiles of 8 x 8 texels of a floor of 16 x 16 below triangles, which have no texels."""
    corners = np.array(FLOOR + [corner for triangle in above for corner in triangle], np.float32)
    faces = np.concatenate([[(0, 1, 2), (0, 2, 3)], 4 + np.arange(3 * len(above)).reshape(-1, 3)])
    uv, chart = np.full((len(faces), 3, 2), np.nan), np.full(len(faces), UNMAPPED)
    square = 16.0 * np.array([(0, 0), (0, 1), (1, 1), (1, 0)])
    uv[:2], chart[:2] = square[faces[:2]], 0
    return Tiles.of(Texels.of(atra.Mesh(corners, faces), Atlas(uv, chart, 16, 16)), 8)


def compare_with_single_rays(tiles, direction, offsets, **options):
    """(R, P) bool, what rays of both kinds meet."""
    facing = tiles.facing(direction)
    with tiles.towards(facing, direction, threads=1, **options) as rays:
        met = rays.trace(offsets)[tiles.texel[facing] >= 0]
    with atra.RayScene(tiles.texels.mesh, packet_width=1, threads=1) as scene:
        single = [scene.occluded(*tiles.rays(facing, direction, tuple(offset))) for offset in offsets]
    np.testing.assert_array_equal(met, np.stack(single, axis=1))
    return met


def test_every_texel_of_a_flat_chart_is_in_one_tile_and_lies_where_the_tile_says():
    tiles = tiles_of(5)
    member = tiles.texel[tiles.texel >= 0]
    assert sorted(member) == list(range(len(tiles.texels)))
    assert tiles.texel_share == 1.0
    k, y, x = np.nonzero(tiles.texel >= 0)
    places = tiles.origin[k] + (x + 0.5)[:, None] * tiles.across[k] + (y + 0.5)[:, None] * tiles.down[k]
    np.testing.assert_allclose(places, tiles.texels.positions[tiles.texel[k, y, x]], atol=1e-5)


@pytest.mark.parametrize("direction", [SUN, (-0.313, 0.871, 0.529)])
@pytest.mark.parametrize(("size", "positions", "width"), [(8, 1, None), (5, 7, None), (8, 20, None), (11, 3, 1)])
def test_aligned_rays_of_tiles_see_what_each_ray_sees(direction, size, positions, width):
    offsets = atra.sub_pixel_offsets(positions)
    met = compare_with_single_rays(tiles_of(size, OPEN), direction, offsets, packet_width=width)
    assert len(met) > 500
    assert 0.1 < met.mean() < 0.9


@pytest.mark.parametrize("least", [0.02, 0.3, 1.0])
def test_triangles_of_all_sizes_shadow_what_they_shadow_ray_by_ray(least):
    random = np.random.Generator(np.random.PCG64(5))
    middles = random.uniform((-1, -0.2, -1), (1, 1, 1), (60, 1, 3))
    sizes = least * random.uniform(1, 3, (60, 1, 1))
    tiles = shadowed(*(middles + sizes * random.normal(size=(60, 3, 3)))[: 60 if least < 1 else 4].tolist())
    for direction in (SUN, (0.0, 1.0, 0.0), (-2.0, 0.7, 1.0)):
        met = compare_with_single_rays(tiles, direction, atra.sub_pixel_offsets(16))
        assert 0.01 < met.mean() < 1.0


def test_threads_share_out_tiles_and_packets():
    tiles, offsets, found = tiles_of(5, OPEN), atra.sub_pixel_offsets(3), []
    for threads in (1, 3):
        with tiles.towards(tiles.facing(SUN), SUN, threads=threads) as rays:
            found.append(rays.trace(offsets))
            assert rays.trace(offsets, out=found[-1]) is found[-1]
    np.testing.assert_array_equal(*found)


def test_more_copies_than_there_is_room_for_at_first_are_found_again(monkeypatch):
    monkeypatch.setattr("experiments.light.sun.rays._COPIES", 3)
    compare_with_single_rays(tiles_of(8, OPEN), SUN, atra.sub_pixel_offsets(2))


def test_a_direction_that_no_tile_faces_meets_nothing():
    tiles = shadowed()
    with tiles.towards(tiles.facing((0, -1, 0)), (0, -1, 0), threads=1) as rays:
        assert rays.trace([(0.5, 0.5)]).shape == (0, 8, 8, 1)


def test_copies_for_which_there_is_no_memory_are_refused(monkeypatch):
    monkeypatch.setattr("psutil.virtual_memory", lambda: SimpleNamespace(available=1000))
    tiles = tiles_of(8, OPEN)
    with pytest.raises(atra.MemoryBudgetError, match="copies of triangles"), tiles.towards(tiles.facing(SUN), SUN):
        pass


def test_what_lies_wholly_behind_one_triangle_needs_no_copies():
    far, beside, seam = (-9, 1, -9), (9, 1, -9), (0.1, 1, 9)
    below = tuple((x, y - 2, z) for x, y, z in (far, beside, seam))
    for above, copies, dark in (
        ([(far, beside, seam)], 0, 1.0),
        ([below], 0, 0.0),
        ([(far, (0.1, 1, -9), seam), ((0.1, 1, -9), beside, seam)], 4, 1.0),
        ([((-0.1, 1, -0.1), (0.1, 1, -0.1), (0, 1, 0.1))], 4, None),
    ):
        tiles = shadowed(*above)
        with tiles.towards(np.arange(len(tiles)), (0, 1, 0), threads=1) as rays:
            assert rays.triangle_count == copies
        met = compare_with_single_rays(tiles, (0, 1, 0), atra.sub_pixel_offsets(4))
        assert met.mean() == dark if dark is not None else 0.0 < met.mean() < 0.1


def test_rays_that_rounding_decides_are_told_from_those_that_see_something_else():
    halves = ((-1, 1, -1), (1, 1, -1), (1, 1, 1)), ((-1, 1, -1), (1, 1, 1), (-1, 1, 1))
    mesh = shadowed(*halves, ((-0.1, 2, -9), (-0.1, 2, 9), (-9, 2, 0))).texels.mesh
    starts = [(0.25, 0.5, 0.25), (0.5, 1 - 1e-7, 0.1), (-0.25, 0.5, -0.25), (0.5, 0.5, 0.1), (3, 0.5, 3)]
    rays = atra.Rays(starts, [(0, 1, 0)] * 5)
    assert [undecided(mesh, rays, np.array([ray])) for ray in range(5)] == [1, 1, 0, 0, 0]


def test_tiles_of_few_texels_are_left_out_and_a_size_below_1_is_refused():
    texels = Texels.of(ROOM, sheet(ROOM, 12))
    members = [(tiles.texel >= 0).sum(axis=(1, 2)) for tiles in (Tiles.of(texels, 5), Tiles.of(texels, 5, 20))]
    assert members[0].min() < 20
    np.testing.assert_array_equal(members[1], members[0][members[0] >= 20])
    with pytest.raises(InputError, match="size of a tile is 0"):
        tiles_of(0)


def processes(*values, scene="cornell_box", use="sun", positions=16):
    return frame_of([
        {"workload": "bake_rays", "status": "ok", "method": "aligned", "use": use, "scene": scene,
         "positions": positions, "point_id": f"{scene}{use}", "process": number, "packets_over_aligned": value}
        for number, value in enumerate(values)
    ])  # fmt: skip


def test_a_prediction_is_judged_by_whole_intervals_of_its_own_use_and_scene():
    def verdict(name, *tables):
        (judged,) = (one for one in judge_all(CLAIMS, pd.concat(tables)) if one.id == name)
        return judged.verdict

    box, deep = "sun-gains-in-the-box", "sun-gains-nothing-in-deep-scenes"
    for few in ({"use": "sky"}, {"positions": 4}, {"scene": "sponza"}):
        assert verdict(box, processes(1.1, 1.15, 1.2, **few)) == NOT_MEASURED
    assert verdict(box, processes(1.1, 1.15, 1.2)) == HOLDS
    assert verdict(box, processes(0.5, 1.0, 3.0)) == UNDECIDED
    assert verdict(box, processes(0.5, 0.52, 0.54)) == DOES_NOT_HOLD
    assert verdict(deep, processes(1.1, 1.15, 1.2), processes(0.5, 0.52, 0.54, scene="sponza")) == HOLDS


def test_the_figure_shows_every_use_at_all_its_points(tmp_path):
    given = pd.DataFrame(
        [
            {
                "workload": "bake_rays",
                "status": "ok",
                "use": use,
                "scene": scene,
                "positions": positions,
                "packets_over_aligned": 0.45 * positions**0.4,
                "packets_over_aligned_low": 0.4 * positions**0.4,
                "packets_over_aligned_high": 0.5 * positions**0.4,
                "directions": 1 if use == "sun" else 4,
                "point_id": f"{scene}{use}{positions}",
            }
            for scene in ("cornell_box", "sponza")
            for use, positions in (("sun", 1), ("sun", 64), ("sky", 4), ("bundle", 16))
        ]
    ).assign(aligned_time_s=0.1, single_over_aligned=2.0, packet_width=None, tile_size=32, map_size=256, triangles=1112)
    (kind,) = FIGURES
    (figure,) = make_figures(kind, kind.rows(given), tmp_path)
    assert len(figure.point_ids) == len(given)
    assert len(kind.rows(given.assign(workload="bake"))) == 0
    assert len(kind.rows(given.assign(use="light"))) == 0  # a use that kept tables have and sweeps no longer
    assert all(bar.value > 0 for panel in figure.figure.panels for bar in panel.bars)
    assert b"<svg" in render(figure.figure, "svg")


def test_aligned_rays_of_a_lightmap_to_the_sun_start_and_meet_in_a_far_scene_as_in_the_near_one():
    texels = [
        baked(bake_scene(mesh, at), sheet(mesh, 8), 1).texels for mesh, at in ((ROOM_AWAY, AWAY), (ROOM_NEAR, 0.0))
    ]
    far, near = (Tiles.of(one, 4) for one in texels)
    np.testing.assert_allclose(far.origin, near.origin, atol=1e-12)
    which = near.facing((0.2, 1.0, 0.1))
    assert len(which)
    starts = [tiles.rays(which, (0.2, 1.0, 0.1), (0.5, 0.5))[0] for tiles in (far, near)]
    assert starts[0].dtype == np.float64
    np.testing.assert_allclose(starts[0], starts[1] + AWAY, atol=1e-6)
    with far.towards(which, (0.2, 1.0, 0.1), threads=1) as one, near.towards(which, (0.2, 1.0, 0.1), threads=1) as two:
        np.testing.assert_array_equal(one.trace([(0.5, 0.5)]), two.trace([(0.5, 0.5)]))


def test_without_the_shortcut_more_triangles_are_copied_and_every_ray_sees_the_same():
    asked = {"map_size": 64, "tile_size": 8}
    points = [planned("raster", "bake_rays", asked=asked | {"shortcut": how}).point for how in (True, False)]
    mesh = cornell_box()
    tiles = Tiles.of(Texels.of(mesh, Atlas.unwrap(mesh, 64)), 8, 16)
    direction, offsets = directions_of(points[0]), np.array([(0.5, 0.5), (0.25, 0.75)])
    with_it, without = (AlignedTiles(point, tiles) for point in points)
    for rays in (with_it, without):
        rays.trace(direction, offsets)
    (one,), (other,) = (rays.met(direction) for rays in (with_it, without))
    assert one.any()
    assert np.array_equal(one, other)
    assert without.triangles > with_it.triangles
