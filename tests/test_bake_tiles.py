"""Rays of texels of flat charts, carried onto one tile: they see what they would see by themselves."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

import atra
from atra.bake import Texels
from atra.bake.tiles import Tiles
from atra.errors import InputError
from experiments.drawing.figure import draw_figure
from experiments.results.claims import DOES_NOT_HOLD, HOLDS, NOT_MEASURED, UNDECIDED
from experiments.workloads.bake_rays import Use
from experiments.workloads.bake_rays.claims import judge_ratio
from experiments.workloads.bake_rays.figures import FIGURES
from tests.baked import cube, sheet
from tests.meshes import joined

ROOM = joined(cube(inwards=True), cube(0.3), atra.Mesh(cube(0.2).vertices + np.float32([0.5, 0.1, -0.4]), cube().faces))


def tiles_of(size: int) -> Tiles:
    return Tiles.of(Texels.of(ROOM, sheet(ROOM, 12)), size)


def test_every_texel_of_a_flat_chart_is_in_one_tile_and_lies_where_the_tile_says():
    tiles = tiles_of(5)
    member = tiles.texel[tiles.texel >= 0]
    assert sorted(member) == list(range(len(tiles.texels)))
    assert tiles.texel_share == 1.0
    k, y, x = np.nonzero(tiles.texel >= 0)
    places = tiles.origin[k] + (x + 0.5)[:, None] * tiles.across[k] + (y + 0.5)[:, None] * tiles.down[k]
    np.testing.assert_allclose(places, tiles.texels.positions[tiles.texel[k, y, x]], atol=1e-5)


@pytest.mark.parametrize("direction", [(0.35, 1.0, -0.25), (-1, 0.4, 0.3)])
@pytest.mark.parametrize("offset", [(0.5, 0.5), (0.213, 0.871)])
def test_aligned_rays_of_tiles_see_what_each_ray_sees(direction, offset):
    tiles = tiles_of(8)
    facing = tiles.facing(direction)
    meshes = {int(tile): tiles.mesh_at(int(tile), direction) for tile in facing}
    near = {tile: mesh for tile, mesh in meshes.items() if mesh is not None}
    alignment = atra.Alignment.of_frames([tiles.camera] * len(near), atra.Split.of_image((1, 1), tiles.camera))
    with atra.FramesTracer(list(near.values()), alignment, threads=1) as tracer:
        depths = dict(zip(near, tracer.trace(offset).depth, strict=True))
    found = np.concatenate([depths.get(int(k), np.full((8, 8), np.inf))[tiles.texel[k] >= 0] for k in facing])
    with atra.RayScene(ROOM, threads=1) as scene:
        hits = scene.intersect(*tiles.rays(facing, direction, offset))
    np.testing.assert_array_equal(np.isfinite(found), hits.hit)
    np.testing.assert_allclose(found, hits.t, rtol=1e-4, atol=1e-5)
    assert len(found) > 500
    assert found.std() > 0.1


def test_tiles_of_few_texels_are_left_out():
    texels = Texels.of(ROOM, sheet(ROOM, 12))
    members = [(tiles.texel >= 0).sum(axis=(1, 2)) for tiles in (Tiles.of(texels, 5), Tiles.of(texels, 5, 20))]
    assert members[0].min() < 20
    np.testing.assert_array_equal(members[1], members[0][members[0] >= 20])


def test_a_size_below_1_is_refused():
    with pytest.raises(InputError, match="size of a tile is 0"):
        tiles_of(0)


def rows(*intervals: tuple[float, float], scene: str = "cornell_box") -> pd.DataFrame:
    return pd.DataFrame(
        [
            {
                "workload": "bake_rays", "status": "ok", "use": "sun", "scene": scene, "positions": 16,
                "packets_over_aligned": (low * high) ** 0.5, "packets_over_aligned_low": low,
                "packets_over_aligned_high": high,
            }
            for low, high in intervals
        ]
    )  # fmt: skip


def test_a_prediction_is_judged_by_whole_intervals():
    def verdict(table, gains=True):
        return judge_ratio(table, Use.sun, lambda rows: rows["positions"] >= 16, gains).verdict

    assert verdict(None) == verdict(rows((1.1, 1.2)).assign(use="sky")) == NOT_MEASURED
    assert verdict(rows((1.1, 1.2), (1.01, 3.0))) == HOLDS
    assert verdict(rows((1.1, 1.2), (0.9, 3.0))) == UNDECIDED
    assert verdict(rows((1.1, 1.2), (0.5, 0.9))) == DOES_NOT_HOLD
    assert verdict(rows((0.5, 0.9)), gains=False) == HOLDS


def test_the_figure_shows_every_use_at_all_its_points(tmp_path):
    parts = [
        (use, positions, rows((0.4 * positions**0.4, 0.5 * positions**0.4), scene=scene))
        for scene in ("cornell_box", "sponza")
        for use, positions in (("sun", 1), ("sun", 64), ("sky", 4), ("bundle", 16))
    ]  # fmt: skip
    given = pd.concat(
        [
            one.assign(use=use, positions=positions, directions=1 if use == "sun" else 4, map_size=256, triangles=1112)
            for use, positions, one in parts
        ]
    ).assign(aligned_time_s=0.123, single_over_aligned=2.0, packet_width=None, tile_size=32)
    given["point_id"] = [str(number) for number in range(len(given))]
    (kind,) = FIGURES
    (figure,) = draw_figure(kind, kind.rows(given), tmp_path)
    assert len(figure.point_ids) == len(given)
    assert len(kind.rows(given.assign(workload="bake"))) == 0
    (tmp_path / "bake_alignment.png").write_bytes(figure.png)
