"""Points of workload gather: timed beside what gathers the same, and lost or doubled hits counted."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import atra
from atra.errors import InputError
from experiments.harness.method import Tracing
from experiments.methods import find_method
from experiments.methods.peers.peer import PeerTracer
from experiments.workloads.gather import GatherOptions, What
from experiments.workloads.gather.measure import CLOSED, differences
from experiments.workloads.rounds import own_and_baselines, shrunk, warm_up
from tests.meshes import cornell_box, cornell_camera
from tests.paper_table import SCATTER, agreeing_table
from tests.points import planned
from tests.quotations import gathering
from tests.quotations.quotation import SCENES, Kept
from tests.report_samples import table_of

pytestmark = pytest.mark.uncovered


def counted(count):
    return atra.Counts(np.array(count, np.uint32), (0.5, 0.5), cornell_box(), cornell_camera(2, 2))


def test_lost_and_doubled_hits_are_counted_and_do_not_cancel():
    found = differences(counted([[1, 5], [0, 2]]), counted([[2, 4], [0, 2]]), atra.Count())
    assert found == {"hits_in_all": 8, "hits_missing": 1, "hits_too_many": 1, "pixels_different": 2}


def test_a_layer_of_another_triangle_is_a_different_pixel_and_the_same_depth_to_rounding_is_none():
    with atra.PixelTracer(cornell_box(), cornell_camera(8, 8), threads=1) as tracer:
        single = tracer.gather(atra.Layers(2))
    nudged = replace(single, depth=single.depth * np.float32(1 + 1e-7))
    assert differences(nudged, single, atra.Layers(2))["pixels_different"] == 0
    other = single.prim_id.copy()
    other[0, 3, 4] ^= 1
    assert differences(replace(single, prim_id=other), single, atra.Layers(2))["pixels_different"] == 1


@pytest.mark.parametrize("name", ["trimesh", "open3d"])
def test_a_peer_counts_the_hits_of_open_space_and_gathers_nothing_else(name):
    method = find_method(name)
    if method.problem() is not None:
        pytest.skip(str(method.problem()))
    mesh, camera = cornell_box(), cornell_camera(16, 16)
    with method.make(mesh, camera, method.options(), Tracing()) as tracer:
        assert isinstance(tracer, PeerTracer)
        found = tracer.gather(atra.Count())
        with pytest.raises(InputError, match=r"expected atra\.Count"):
            tracer.gather(atra.Layers(2))
    with atra.PixelTracer(mesh, camera, threads=1) as tracer:
        ours = tracer.gather(atra.Count())
    # Rays through edges apart, which peers may lose or count twice.
    assert (found.count == ours.count).mean() > 0.9


def test_what_no_ray_could_gather_is_refused_before_anything_is_measured():
    with pytest.raises(InputError, match="k is 0"):
        GatherOptions(What.layers, layers=0)
    with pytest.raises(InputError, match="transmittance is 2"):
        GatherOptions(What.transmittance, factor=2.0)


def test_a_warm_up_has_something_that_no_copy_shows_and_leaves_few_samples_in_doubt():
    point = planned("aligned", "gather", (64, 64)).point
    left_out, in_doubt = [], []

    def gather(tracer):
        tracer.gather(atra.Count())
        left_out.append(tracer.counters.get("triangles_left_out"))
        in_doubt.append(len(tracer._doubts[1].keys))

    warm_up(point, own_and_baselines(shrunk(point)), gather, CLOSED)
    assert left_out[0] > 0
    assert 0 < max(in_doubt) < 64 * 64 / 4


def gathered_row(scene, method, what, over_single, **fields):
    """Of packets that take a quarter of the time of single rays: 40 ms to count, twice that for layers."""
    ratios = {"speedup": over_single, "speedup_vs_packets": over_single / 4.0}
    packets_s = 0.08 if what == "layers" else 0.04
    intervals = {f"{name}_{end}": by * ratios[name] for name in ratios for end, by in (("low", 0.9), ("high", 1.1))}
    return {
        "scene": scene, "workload": "gather", "method": method, "what": what, "layers": 8, "status": "ok",
        "packet_width": 1, "split_x": 1, "split_y": 1, "culling": True, "hits_in_all": 9000, "hits_missing": 0,
        "hits_too_many": 0, "pixels_different": 0, "packets_render_time_s": packets_s,
        "render_time_s": 0.16 / over_single,
    } | ratios | intervals | fields  # fmt: skip


def gathered_rows(scene):
    """Aligned single rays are best at 512 cells, and without culling better still; packets at 256."""
    split = {"packet_width": 16, "split_x": 128}
    lossy = {"hits_missing": 1234, "hits_too_many": 5, "pixels_different": 7}
    rows = [gathered_row(scene, "trimesh", "count", 0.2, **lossy)]
    for what, cost in (("count", 1.0), ("transmittance", 1.25), ("layers", 2.0)):
        rows.append(gathered_row(scene, "raster", what, 80.0 / cost))
        rows.append(gathered_row(scene, "aligned", what, 10.0 / cost, **split))
    rows += [gathered_row(scene, "aligned", "count", gain, split_x=cells) for cells, gain in ((64, 1.5), (512, 2.0))]
    rows.append(gathered_row(scene, "aligned", "count", 3.0, split_x=512, culling=False))
    rows.append(gathered_row(scene, "aligned", "count", 12.0, **split | {"split_x": 256}))
    return rows


@pytest.fixture
def kept():
    rows = [row for scene in SCENES for row in gathered_rows(scene)]
    for what, cost in (("count", 1.0), ("thickness", 1.5)):
        rows += [
            gathered_row("three_holes", "pixel", what, 4.0 / cost, packet_width=16),
            gathered_row("three_holes", "raster", what, 40.0 / cost),
            gathered_row("three_holes", "aligned", what, 8.0 / cost, packet_width=16, split_x=64),
            gathered_row("three_holes", "trimesh", what, 0.2, pixels_different=3),
        ]
    times = ("render_time_s", "packets_render_time_s")
    processes = [row | {name: row[name] * factor for name in times} for row in rows for factor in SCATTER]
    return Kept(table_of(rows), table_of(processes))


def cells(row):
    return [cell.strip() for cell in row.strip("|").split("|")]


def test_pages_tell_packets_that_gather_from_single_rays_and_from_the_rasteriser(kept):
    found = {label: first for label, first, *_ in map(cells, gathering.counting(kept))}
    assert found == {
        "packets, ms": "40.0",
        "rasteriser, \N{MULTIPLICATION SIGN} packets": "20.0 [18.0, 22.0]",
        "aligned packets, \N{MULTIPLICATION SIGN} packets": "3.00 [2.70, 3.30] (256 \N{MULTIPLICATION SIGN} 1)",
        "rasteriser, \N{MULTIPLICATION SIGN} single rays": "80.0 [72.0, 88.0]",
        "aligned packets, \N{MULTIPLICATION SIGN} single rays": "12.0 [10.8, 13.2] (256 \N{MULTIPLICATION SIGN} 1)",
        "aligned single rays, \N{MULTIPLICATION SIGN} single rays": "2.00 [1.80, 2.20] (512 \N{MULTIPLICATION SIGN} 1)",
    }


def test_what_else_is_gathered_is_held_against_counts_of_the_same_rays(kept):
    rows = [cells(row) for row in gathering.over_counting(kept)]
    assert [row[0] for row in rows[:3]] == [f"transmittance, {rays}" for rays in ("packets", "aligned", "rasteriser")]
    assert {len(row) for row in rows} == {1 + len(SCENES)}
    assert [row[1].partition(" ")[0] for row in rows] == ["1.00", "1.25", "1.25", "2.00", "2.00", "2.00"]
    assert rows[1][4].startswith("1.25 [1.2")
    few = Kept(kept.points, kept.processes.groupby(["scene", "method", "what", "split_x"]).head(2))
    assert "too few processes" in next(gathering.over_counting(few))


def test_pages_say_what_other_tracers_lose_and_what_a_closed_mesh_takes(kept):
    rows = [cells(row) for row in gathering.counts_of_others(kept)]
    assert rows[0] == ["`cornell_box`, trimesh", "20.0", "400", "9,000", "1,234", "5"]
    assert rows[-1] == ["`three_holes`, trimesh", "20.0", "200", "9,000", "0", "0"]
    solid = {label: rest for label, *rest in map(cells, gathering.solids(kept))}
    assert solid["rasteriser"] == ["4.0", "6.0", "1.50", "200", "133", "0"]
    assert solid["aligned"][:3] == ["20.0", "30.0", "1.50"]
    assert solid["trimesh"][-1] == "3"


def test_pages_have_the_paper_s_claims_where_every_hit_is_wanted():
    claims = [
        {"id": name, "text": text, "section": "§4", "reading": "every hit wanted", "verdict": verdict, "inferred": own}
        for name, text, verdict, own in (
            (f"best-speedup-{SCENES[0]}", "Best.", "holds", False),
            ("culling", "Faster.", "undecided", False),
            ("larger", "Less.", "holds", True),
        )
    ]
    rows = gathering.verdicts_where_every_hit_is_wanted(Kept(pd.DataFrame(), pd.DataFrame(), claims))
    assert list(rows) == ["| Faster. | §4 | undecided |", "| Less. (an inference of ours) | §4 | holds |"]
    frames = agreeing_table()
    gathered = frames[frames["workload"] == "frame"].assign(workload="gather", what="count")
    rows = list(gathering.gains_where_every_hit_is_wanted(Kept(pd.DataFrame(), gathered)))
    assert len(rows) == len(SCENES)
    assert rows[0].startswith("| `cornell_box` | 7.50 | 7.6")
