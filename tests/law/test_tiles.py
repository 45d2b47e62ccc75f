"""The model of rays of one direction from tiles: what a look at some tiles counts, and what the law makes of it."""

import numpy as np
import pandas as pd
import pytest

import atra
from experiments.law.model.counting_kernels import RAYS, SIDE
from experiments.law.model.looking_kernels import LEVELS
from experiments.law.tile_looks import look_at_tiles
from experiments.law.tile_terms import (
    packet_terms,
    prepare_terms,
    trace_terms,
)
from experiments.law.tiles import PARTS, fastest, leave_one_out
from tests.sun.test_bake_tiles import OPEN, SUN, shadowed, tiles_of

ROOF = [(-10, 1, -5), (5, 1, 10), (5, 1, -5)]
"""A triangle that shadows all of the floor, seen along y."""

UP = (0.0, 1.0, 0.0)


def rays_looked_at(tiles, facing, way):
    """Origins of SIDE x SIDE rays of each tile."""
    places = (np.arange(SIDE) + 0.5) * tiles.size / SIDE
    x, y = (one.ravel()[None, :, None] for one in np.meshgrid(places, places))
    origins = tiles.origin[facing, None] + x * tiles.across[facing, None] + y * tiles.down[facing, None]
    return origins + tiles.starts(facing, way)[:, None, None] * way


def test_a_look_at_all_tiles_counts_the_hits_and_the_first_hits_that_rays_find():
    tiles = tiles_of(8, OPEN)
    way = np.array(SUN) / np.linalg.norm(SUN)
    facing = tiles.facing(way)
    assert 4 < len(facing) <= 64  # all are looked at
    look = look_at_tiles(tiles, SUN)
    origins = rays_looked_at(tiles, facing, way).reshape(-1, 3).astype(np.float32)
    with atra.RayScene(OPEN, threads=1) as scene:
        count = scene.count(origins, np.broadcast_to(way, origins.shape))
        blocked = scene.occluded(origins, np.broadcast_to(way, origins.shape))
    assert look.met[0, 0] == pytest.approx(count.mean(), rel=0.02)
    assert look.met[0, 1] == pytest.approx(blocked.mean(), rel=0.02)
    assert look.tiles == len(facing)
    assert look.texels == (tiles.texel[facing] >= 0).sum()


@pytest.mark.parametrize("shortcut", [True, False])
def test_a_look_at_all_tiles_counts_the_copies_that_are_made(shortcut):
    tiles = tiles_of(8, OPEN)
    facing = tiles.facing(SUN)
    look = look_at_tiles(tiles, SUN, shortcut)
    if shortcut:
        with tiles.towards(facing, SUN, threads=1) as rays:
            rays.build()
            assert look.copies == rays.triangle_count
    else:
        assert look.copies >= look_at_tiles(tiles, SUN).copies
        assert look.open_share == 1.0


def test_a_floor_below_one_triangle_is_closed_and_needs_no_copies():
    under, beside = look_at_tiles(shadowed(ROOF), UP), look_at_tiles(shadowed(), UP)
    assert (under.open_share, under.copies) == (0.0, 0.0)
    assert (beside.open_share, beside.met.max()) == (1.0, 0.0)
    assert trace_terms(under, 16, 16)[1:4].tolist() == [0.0, 0.0, 0.0]


def test_tiles_that_all_turn_away_cost_next_to_nothing():
    look = look_at_tiles(shadowed(ROOF), (0.0, -1.0, 0.0))
    assert (look.tiles, look.texels, look.copies) == (0, 0, 0.0)
    assert not prepare_terms(look).any()
    assert not packet_terms(look, 4, 16).any()


def test_packets_of_one_texel_meet_what_its_rays_meet_together():
    look = look_at_tiles(tiles_of(8, OPEN), SUN)
    for wide in (1, 2, 4, 8):
        kind, one = look.shape_of(wide, 1), look.shape_of(1, 1)
        assert (look.boxes[kind].sum(axis=1) >= look.boxes[one].sum(axis=1)).all()
    assert look.boxes.shape == (len(look.shapes), 2, LEVELS)
    assert look.shapes[look.shape_of(8, 8)] == (SIDE, SIDE)
    assert SIDE * SIDE == RAYS


def test_rays_grow_with_positions_and_no_family_has_more_than_eight_terms():
    look = look_at_tiles(tiles_of(8, OPEN), SUN)
    assert packet_terms(look, 64, 1) == pytest.approx(4 * packet_terms(look, 16, 1))
    assert packet_terms(look, 64, 16) == pytest.approx(4 * packet_terms(look, 16, 16))
    assert trace_terms(look, 64, 16).sum() > trace_terms(look, 16, 16).sum()
    assert len(trace_terms(look, 1, 16)) + len(prepare_terms(look)) <= 8


def test_a_row_is_predicted_by_constants_of_other_scenes_alone():
    """Two scenes that follow one law, and one that takes twice as long: its error is 1/2, whatever it says itself."""
    random = np.random.default_rng(3)
    rows = []
    for scene, times in (("one", 1.0), ("other", 1.0), ("slow", 2.0)):
        for _ in range(6):
            terms = {name: random.uniform(1, 2, 3) for name in PARTS}
            told = {f"measured_{name}_s": times * 1e-9 * float(one.sum()) for name, one in terms.items()}
            rows.append({"scene": scene, **{f"{name}_terms": one for name, one in terms.items()}, **told})
    table = pd.DataFrame(rows)
    judged = leave_one_out(table.assign(measured_aligned_s=table["measured_trace_s"] + table["measured_prepare_s"]))
    slow = judged[judged["scene"] == "slow"]
    np.testing.assert_allclose(slow["predicted_single_s"] / slow["measured_single_s"], 0.5, rtol=0.02)
    assert set(fastest(judged, "measured")) <= {"aligned", "packets", "single"}
