"""Figures draw what the table says, on tables small enough to read; pictures mark what differs."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

import atra
from atra.errors import InputError
from atra.hits import MISS, Hits
from atra.judge.compare import Verdict
from experiments.drawing.pages import describe_measurement
from experiments.drawing.shading import BACKGROUND, DIFFERENCE_COLOURS, difference_picture, encode_png, shade
from experiments.drawing.values import TIMES
from experiments.harness.configuration import Configuration, SweepConfiguration
from experiments.paper.instancing_figure import draw_instancing_figure
from experiments.report.figures import draw_figures
from experiments.sweep import GridPoint, run_sweep
from experiments.workloads.build.build_figure import draw_build_figure
from experiments.workloads.frame.grid_figure import draw_grid_figure
from experiments.workloads.frame.split_figure import draw_split_figure
from experiments.workloads.memory.memory_figure import draw_memory_figure
from experiments.workloads.picture.pictures import ScenePictures
from experiments.workloads.picture.scenes_figure import draw_scenes_figure
from tests.meshes import EYE_AT_ORIGIN, quads
from tests.report_samples import table_of

MIB = 2**20
COMMON = {
    "scene": "box", "triangles": 10, "width": 8, "height": 4, "split_x": 1, "split_y": 1, "culling": True,
    "method": "aligned", "geometry": "copied", "packet_width": 8, "threads": 1, "build_quality": "medium",
    "status": "ok",
}  # fmt: skip


def make_rows(*rows: dict[str, Any]) -> pd.DataFrame:
    return table_of([COMMON | {"point_id": f"{place:020x}"} | row for place, row in enumerate(rows)])


def time_row(split_x: int, time_s: float, **fields: Any) -> dict[str, Any]:
    return {
        "workload": "frame", "split_x": split_x, "render_time_s": time_s, "render_time_q1_s": 0.5 * time_s,
        "render_time_q3_s": 2 * time_s, "baseline_render_time_s": 0.1, "packets_render_time_s": 0.05,
        "speedup": 0.1 / time_s, "rounds": 9,
    } | fields  # fmt: skip


def build_row(split_x: int, plan_s: float, build_s: float, **fields: Any) -> dict[str, Any]:
    return {
        "workload": "build", "split_x": split_x, "plan_time_s": plan_s, "build_time_s": build_s,
        "build_time_q1_s": build_s, "build_time_q3_s": 2 * build_s, "baseline_build_time_s": 0.004,
    } | fields  # fmt: skip


def memory_row(split_x: int, mesh_mib: int, after_mib: int, peak_mib: int, **fields: Any) -> dict[str, Any]:
    return {
        "workload": "memory", "split_x": split_x, "rss_mesh_bytes": mesh_mib * MIB, "rss_bytes": after_mib * MIB,
        "peak_rss_bytes": peak_mib * MIB, "embree_bytes": 3 * split_x * MIB,
    } | fields  # fmt: skip


def skipped(row: dict[str, Any]) -> dict[str, Any]:
    """The row as it is when its point could not be measured."""
    kept = {name: value for name, value in row.items() if not name.endswith(("_s", "_bytes")) and name != "speedup"}
    return kept | {"status": "skipped", "error": "needs 9 GiB, more than the memory budget of 4 GiB"}


def drawn(axis: Axes, label: str) -> dict[float, float]:
    """Abscissa -> ordinate of the line with this label."""
    (line,) = [line for line in axis.get_lines() if line.get_label() == label]
    return {float(x): pytest.approx(float(y)) for x, y in zip(*line.get_data(), strict=True)}


def level(axis: Axes, label: str) -> float:
    """Where the baseline with this label lies."""
    (line,) = [line for line in axis.get_lines() if line.get_label() == label]
    (ordinate,) = set(line.get_ydata())
    return float(ordinate)


def crosses(axis: Axes) -> set[float]:
    return {float(x) for line in axis.get_lines() if line.get_marker() == "x" for x in line.get_xdata()}


def words(figure: Figure) -> str:
    everywhere = [text.get_text() for axis in figure.axes for text in (*axis.texts, axis.title, axis._left_title)]
    foot = figure.get_supxlabel()
    return "\n".join([*everywhere, foot])


def save(figure: Figure) -> None:
    figure.savefig(io.BytesIO(), format="png", dpi=30)


def test_the_split_figure_draws_medians_quartiles_and_baselines_in_milliseconds() -> None:
    table = make_rows(time_row(1, 0.08), time_row(2, 0.02), time_row(2, 0.04, culling=False))
    (axis,) = draw_split_figure(table).axes
    assert drawn(axis, "aligned, culling on") == {1: 80, 2: 20}
    assert drawn(axis, "aligned, culling off") == {2: 40}
    assert level(axis, "rtcIntersect1 per pixel") == pytest.approx(100)
    assert level(axis, "fastest packets per pixel") == pytest.approx(50)
    bars = next(line for line in axis.get_lines() if line.get_label() == "_bars" and len(line.get_xdata()) == 18)
    assert bars.get_ydata()[[0, 1, 9, 10]] == pytest.approx([40, 160, 10, 40])


def test_a_packet_width_is_a_panel_of_its_own_and_scenes_keep_their_rows() -> None:
    table = make_rows(*(time_row(1, 0.08, packet_width=width, scene=name) for name in "ab" for width in (8, 1)))
    titles = [axis.get_title(loc="left") for axis in draw_split_figure(table).axes]
    assert titles == [f"{name} (10 triangles), packet width {width}" for name in "ab" for width in (1, 8)]


def test_a_heading_stands_above_the_legend_of_a_split_figure_and_above_a_grid_figure() -> None:
    table = make_rows(time_row(1, 0.08))
    assert draw_split_figure(table, heading="single rays").legends[0].get_title().get_text() == "single rays"
    assert draw_grid_figure(table, heading="single rays").get_suptitle() == "single rays"


def test_the_grid_figure_keeps_packet_widths_apart() -> None:
    table = make_rows(*(time_row(x, 0.01 * x, packet_width=width) for x in (1, 2) for width in (1, 8)))
    titles = [axis.get_title(loc="left") for axis in draw_grid_figure(table).axes if axis.get_title(loc="left")]
    assert titles == ["box (10 triangles), packet width 1", "box (10 triangles), packet width 8"]


def test_the_build_figure_draws_plan_and_build_of_copies_and_the_build_of_instances() -> None:
    instanced = build_row(2, 0.001, 0.003, geometry="instanced", culling=False)
    table = make_rows(build_row(1, 0.002, 0.005), build_row(2, 0.003, 0.007), instanced, skipped(build_row(4, 0, 0)))
    figure = draw_build_figure(table)
    (axis,) = figure.axes
    assert drawn(axis, "BVH build, culling on") == {1: 5, 2: 7}
    assert drawn(axis, "plan (culling and shear), culling on") == {1: 2, 2: 3}
    assert drawn(axis, "BVH build, instanced") == {2: 3}
    assert level(axis, "BVH build for per-pixel rays") == pytest.approx(4)
    assert crosses(axis) == {4}
    assert "culling on, 4: skipped, needs more memory than its budget" in words(figure)


def test_the_memory_figure_takes_the_mesh_off_and_draws_the_pixel_rows_as_baselines() -> None:
    table = make_rows(
        memory_row(1, 100, 110, 130),
        memory_row(2, 101, 121, 141),
        memory_row(1, 100, 105, 106, method="pixel", culling=False),
        memory_row(1, 100, 900, 900, culling=False),
        skipped(memory_row(4, 0, 0, 0)),
    )
    figure = draw_memory_figure(table)
    (axis,) = figure.axes
    assert drawn(axis, "RSS over the mesh, after the build") == {1: 10, 2: 20}
    assert drawn(axis, "peak of RSS over the mesh") == {1: 30, 2: 40}
    assert drawn(axis, "Embree's own account") == {1: 3, 2: 6}
    dashed = {float(line.get_ydata()[0]) for line in axis.get_lines() if line.get_transform() != axis.transData}
    assert {5.0, 6.0, 3.0} <= dashed
    assert crosses(axis) == {4}


def test_a_point_whose_memory_did_not_grow_is_marked_and_not_dropped_in_silence() -> None:
    figure = draw_memory_figure(make_rows(memory_row(1, 100, 100, 130), memory_row(2, 100, 110, 130)))
    (axis,) = figure.axes
    assert drawn(axis, "RSS over the mesh, after the build") == {2: 10}
    assert crosses(axis) == {1}
    assert "RSS over the mesh, after the build, 1: not above zero" in words(figure)


def test_a_failure_is_told_in_its_own_words_and_a_long_list_of_points_by_its_ends() -> None:
    rows = [skipped(memory_row(2**k, 0, 0, 0)) | {"status": "failed", "error": "memory ran out"} for k in range(7)]
    figure = draw_memory_figure(make_rows(*rows))
    assert "culling on, 1 to 64 (7 points): failed, memory ran out" in words(figure)
    assert crosses(figure.axes[0]) == {1, 2, 4, 8, 16, 32, 64}


def test_the_instancing_figure_sets_memory_beside_time_at_the_width_of_the_instances() -> None:
    table = make_rows(
        memory_row(2, 100, 110, 110),
        memory_row(2, 100, 150, 150, culling=False),
        memory_row(2, 100, 102, 102, culling=False, geometry="instanced"),
        memory_row(1, 100, 101, 101, culling=False, method="pixel"),
        time_row(2, 0.02),
        time_row(2, 0.03, culling=False),
        time_row(2, 0.04, culling=False, geometry="instanced"),
        time_row(2, 0.5, packet_width=1),
    )
    memory, time = draw_instancing_figure(table).axes
    assert drawn(memory, "aligned, culling on") == {2: 10}
    assert drawn(memory, "aligned, culling off") == {2: 50}
    assert drawn(memory, "aligned, instanced") == {2: 2}
    assert level(memory, "one ray per pixel (memory)") == pytest.approx(1)
    assert drawn(time, "aligned, culling on") == {2: 20}
    assert drawn(time, "aligned, culling off") == {2: 30}
    assert drawn(time, "aligned, instanced") == {2: 40}


def drawn_names(*rows: dict[str, Any], grids: dict[str, list[str]] | None = None) -> list[str]:
    return [figure.name for figure in draw_figures(make_rows(*rows), Path(), grids)]


SPLITS = [time_row(split, 0.01 * split) for split in (1, 2)]
INSTANCED = memory_row(2, 100, 102, 102, culling=False, geometry="instanced")


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        (SPLITS, ["figure5"]),
        ([*SPLITS, *(row | {"packet_width": 1} for row in SPLITS)], ["figure5_single_rays", "figure5_packets_of_8"]),
        ([row | {"split_x": 1, "split_y": row["split_x"]} for row in SPLITS], ["figure5_vertical"]),
        ([*SPLITS, time_row(1, 0.01, split_y=2)], ["figure4"]),
        ([*SPLITS, build_row(1, 0.1, 0.2), memory_row(1, 1, 2, 3)], ["figure5", "figure6", "figure7"]),
        ([*SPLITS, INSTANCED], ["figure5", "figure7", "figure7_instancing"]),
        ([time_row(2, 0.01), time_row(2, 0.01, method="tiles")], ["methods", "break_even"]),
        ([time_row(2, 0.01), time_row(1, 0.01, method="embreex")], ["methods", "break_even", "peers"]),
        ([time_row(2, 0.01), time_row(2, 0.01, threads=2)], ["threads"]),
        ([time_row(2, 0.01)], []),
        ([skipped(row) for row in SPLITS], []),
        ([], []),
    ],
)
def test_without_grids_a_table_draws_every_figure_that_has_something_to_show(
    rows: list[dict[str, Any]], expected: list[str]
) -> None:
    assert drawn_names(*rows) == expected


def test_a_sweep_that_names_figures_draws_these_of_the_points_of_their_grids_alone() -> None:
    rows = [row | {"grids": "horizontal"} for row in SPLITS] + [build_row(1, 0.1, 0.2, grids="build")]
    assert drawn_names(*rows, grids={"figure5": ["horizontal"], "figure7": ["memory"]}) == ["figure5"]
    assert drawn_names(*rows, grids={"figure6": ["build", "none"]}) == ["figure6"]


def test_a_figure_of_one_packet_width_holds_the_points_of_that_width() -> None:
    table = make_rows(*SPLITS, *(row | {"packet_width": 1} for row in SPLITS))
    single, packets = draw_figures(table, Path())
    assert (single.point_ids, packets.point_ids) == (set(table["point_id"][2:]), set(table["point_id"][:2]))


@pytest.mark.parametrize(
    ("figures", "message"),
    [
        ({"figure9": ["horizontal"]}, "sweep.figures names 'figure9', expected one of figure4, figure5"),
        ({"figure5": ["vertical"]}, "sweep.figures.figure5 names 'vertical', expected one of horizontal"),
    ],
)
def test_an_unknown_figure_or_grid_is_refused_with_the_known_names_before_anything_is_measured(
    tmp_path: Path, figures: dict[str, list[str]], message: str
) -> None:
    sweep = SweepConfiguration(figures=figures)
    with pytest.raises(InputError, match=message):
        run_sweep([GridPoint("horizontal", Configuration(sweep=sweep, results_dir=str(tmp_path)))])
    assert list(tmp_path.iterdir()) == []


ONE_ROW = {
    "split": (draw_split_figure, time_row(1, 0.08)),
    "grid": (draw_grid_figure, time_row(1, 0.08)),
    "build": (draw_build_figure, build_row(1, 0.002, 0.005)),
    "memory": (draw_memory_figure, memory_row(1, 100, 110, 130)),
    "instancing, memory": (draw_instancing_figure, memory_row(1, 100, 110, 130)),
    "instancing, time": (draw_instancing_figure, time_row(1, 0.08)),
}
LEFT = ["scene", "status", "method", "split_x", "split_y", "culling", "workload", "width", "height", "triangles"]


@pytest.mark.parametrize("name", ONE_ROW)
def test_every_figure_copes_with_one_row_with_none_and_with_a_row_of_missing_values(name: str) -> None:
    draw, row = ONE_ROW[name]
    one = make_rows(row)
    missing = one.copy()
    missing[[name for name in one if name not in LEFT]] = pd.NA
    without = make_rows(skipped(row))
    for table in (one, one.iloc[:0], missing, without, pd.concat([one, missing, without])):
        save(draw(table))


@pytest.mark.parametrize("name", ONE_ROW)
def test_a_stand_in_is_named_as_one_and_no_other_scene_is(name: str) -> None:
    draw, row = ONE_ROW[name]
    assert "stand-in for sponza, not that scene" in words(draw(make_rows(row | {"stands_for": "sponza"})))
    assert "stand-in" not in words(draw(make_rows(row)))


def test_the_foot_says_only_what_the_table_tells() -> None:
    assert describe_measurement(make_rows(memory_row(1, 1, 2, 3))) == f"8 {TIMES} 4 pixels, threads 1, packet width 8"
    rows = make_rows(
        time_row(1, 1.0, rounds=3, doubts="spread", cpu="some cpu"), time_row(2, 1.0, measured_at="2000-01-01T")
    )
    said = describe_measurement(rows, "mark")
    assert "median and quartiles of 3 to 9 rounds" in said
    assert said.endswith("some cpu, 2000-01-01, mark, 1 of 2 points carry doubts (see table)")
    assert describe_measurement(rows.iloc[:0]) == ""


def test_the_scenes_figure_shows_each_picture_with_its_counts() -> None:
    images = [np.full((4, 8, 3), value, np.uint8) for value in (10, 20, 30)]
    aligned, pixel, difference = (encode_png(image) for image in images)
    one = ScenePictures("ball", 61600, "mitsuba", 8, 4, 29, 2, 1, 0, aligned, pixel, difference)
    figure = draw_scenes_figure([one, one])
    assert len(figure.axes) == 6
    for axis, image in zip(figure.axes, images + images, strict=True):
        np.testing.assert_array_equal(axis.images[0].get_array(), image)
    for text in (
        "ball (61,600 triangles)",
        "stand-in for mitsuba, not that scene",
        "29 pixels equal",
        "2 tied, 1 edge",
    ):
        assert text in words(figure)
    save(figure)
    save(draw_scenes_figure([]))


def wall(*depths: float) -> tuple[atra.Mesh, atra.Camera]:
    """Walls across the left half of the view, facing the eye, and a camera."""
    camera = atra.Camera(**EYE_AT_ORIGIN, fov_y_degrees=60, width=32, height=32)
    corners = [[(0, -9, z), (9, -9, z), (9, 9, z), (0, 9, z)] for z in depths]
    return quads(corners), camera


def flat_hits(mesh: atra.Mesh, camera: atra.Camera, depth: float, hit: np.ndarray) -> Hits:
    return Hits(
        np.where(hit, depth, np.inf).astype(np.float32),
        np.where(hit, 0, MISS).astype(np.uint32),
        (0.5, 0.5),
        mesh,
        camera,
    )


def test_a_wall_facing_the_eye_is_evenly_lit_and_a_miss_is_background() -> None:
    mesh, camera = wall(2.0)
    hit = np.zeros((32, 32), bool)
    hit[:, :16] = True
    picture = shade(flat_hits(mesh, camera, 2.0, hit))
    assert (picture[~hit] == BACKGROUND).all()
    assert len(np.unique(picture[hit], axis=0)) == 1
    assert tuple(picture[0, 0]) != BACKGROUND
    assert (shade(flat_hits(mesh, camera, 2.0, np.zeros((32, 32), bool))) == BACKGROUND).all()


def test_light_comes_from_above_whatever_way_the_vertices_run() -> None:
    mesh, camera = wall(2.0)
    hit = np.ones((32, 32), bool)

    def brightness(slope: float, faces: np.ndarray) -> int:
        vertices = mesh.vertices.copy()
        vertices[:, 2] += slope * vertices[:, 1]
        return int(shade(flat_hits(atra.Mesh(vertices, faces), camera, 2.0, hit)).sum())

    for faces in (mesh.faces, mesh.faces[:, ::-1]):
        # Falling back towards its top a wall faces up, leaning over it faces down.
        assert brightness(0.2, faces) > brightness(0.0, faces) > brightness(-0.2, faces)
    assert brightness(0.2, mesh.faces) == brightness(0.2, mesh.faces[:, ::-1])


def test_a_difference_picture_marks_exactly_the_pixels_that_differ() -> None:
    mesh, camera = wall(2.0, 3.0)
    hit = np.ones((32, 32), bool)
    one, other = flat_hits(mesh, camera, 2.0, hit), flat_hits(mesh, camera, 2.0, hit)
    other.prim_id[3, 5], other.depth[7, 9] = 1, 2.1
    other.depth[8, 8] = np.nextafter(np.float32(2), np.float32(3))  # rounding is no difference
    marked = (difference_picture(one, other, reach_pixels=0) != 255).any(axis=2)
    assert set(zip(*np.nonzero(marked), strict=True)) == {(3, 5), (7, 9)}
    assert (difference_picture(one, one) == 255).all()
    misses = flat_hits(mesh, camera, 2.0, ~hit)
    assert (difference_picture(misses, misses) == 255).all()


def test_marks_have_the_verdict_s_colour_reach_beyond_their_pixel_and_stay_in_the_picture() -> None:
    mesh, camera = wall(2.0)
    hits = flat_hits(mesh, camera, 2.0, np.ones((32, 32), bool))
    verdict = np.zeros((32, 32), np.uint8)
    verdict[0, 0], verdict[16, 16], verdict[31, 31] = Verdict.TIED, Verdict.WRONG, Verdict.EDGE
    picture = difference_picture(hits, hits, verdict, reach_pixels=2)
    for (y, x), kind in (((0, 0), Verdict.TIED), ((16, 16), Verdict.WRONG), ((31, 31), Verdict.EDGE)):
        assert tuple(picture[y, x]) == DIFFERENCE_COLOURS[kind]
    assert tuple(picture[20, 12]) == DIFFERENCE_COLOURS[Verdict.WRONG]  # an arm of the cross
    assert tuple(picture[0, 31]) == tuple(picture[31, 0]) == (255, 255, 255)  # nothing comes in from the other side
    unjudged = difference_picture(hits, hits, verdict, reach_pixels=0)
    assert set(zip(*np.nonzero((unjudged != 255).any(axis=2)), strict=True)) == {(0, 0), (16, 16), (31, 31)}


def test_a_difference_of_unequal_sizes_is_refused() -> None:
    mesh, camera = wall(2.0)
    hits = flat_hits(mesh, camera, 2.0, np.ones((32, 32), bool))
    with pytest.raises(InputError, match=r"\(32, 32\) and \(8, 8\)"):
        difference_picture(hits, flat_hits(mesh, camera, 2.0, np.ones((8, 8), bool)))
    with pytest.raises(InputError, match=r"verdict has shape \(8, 8\)"):
        difference_picture(hits, hits, np.zeros((8, 8), np.uint8))


@pytest.mark.parametrize("colours", [3, 256, 4096])
def test_png_is_lossless_with_and_without_a_palette(colours: int) -> None:
    random = np.random.default_rng(1)
    palette = random.integers(0, 256, (colours, 3), np.uint8)
    image = palette[random.integers(0, colours, (90, 70))]
    png = encode_png(image)
    np.testing.assert_array_equal(np.asarray(Image.open(io.BytesIO(png)).convert("RGB")), image)
    assert Image.open(io.BytesIO(png)).mode == ("P" if colours <= 256 else "RGB")
    with pytest.raises(InputError, match="expected uint8"):
        encode_png(image.astype(np.float32))
