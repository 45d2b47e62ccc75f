"""Growth: scenes with more triangles, fitted exponents, and where one method overtakes another."""

import numpy as np
import pytest

import atra
from atra.errors import InputError, MemoryBudgetError
from experiments.harness.points import plan_points
from experiments.workloads.frame.exponents import exponent_lines
from experiments.workloads.frame.growth import (
    crossings,
    fitted_slope,
    growing_rows,
    growth_figure,
    growth_lines,
    growth_panels,
    growths,
    say_count,
)
from experiments.workloads.rounds import load_mesh
from scenes.built_in import make_scene
from scenes.loading import enlarged
from scenes.scene import Scene
from tests.drawn import make_rows, method_row, skipped, unfolded
from tests.points import configured

pytestmark = pytest.mark.uncovered

# Scenes


def area(mesh):
    a, b, c = np.moveaxis(mesh.triangles(np.arange(mesh.triangle_count)), 1, 0)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


def test_a_subdivided_triangle_becomes_four_of_a_quarter_of_its_area_in_its_place():
    scene = make_scene("cornell_box")
    cut = enlarged(scene, 2, 1)
    assert cut.mesh.triangle_count == 16 * scene.mesh.triangle_count
    quarters = area(cut.mesh).reshape(-1, 16)
    np.testing.assert_allclose(quarters.sum(axis=1), area(scene.mesh), rtol=1e-4)
    np.testing.assert_allclose(quarters, np.repeat(area(scene.mesh)[:, None] / 16, 16, axis=1), rtol=1e-2)
    assert (cut.camera, cut.name) == (scene.camera, scene.name)


def test_neighbours_share_the_vertices_in_the_middle_of_their_edges():
    faces = np.array([(0, 1, 2), (2, 1, 3)], np.uint32)
    mesh = atra.Mesh(np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0.3)], np.float32), faces)
    assert len(enlarged(Scene("square", mesh, {}), 1, 1).mesh.vertices) == 4 + 5


@pytest.mark.parametrize("copies", [2, 4, 7])
def test_copies_lie_side_by_side_and_the_first_where_the_scene_is(copies):
    scene = make_scene("cornell_box")
    many = enlarged(scene, 0, copies).mesh
    corners = many.triangles(np.arange(many.triangle_count)).reshape(copies, -1, 3, 3)
    np.testing.assert_array_equal(corners[0], scene.mesh.triangles(np.arange(scene.mesh.triangle_count)))
    boxes = [(one.min(axis=(0, 1)), one.max(axis=(0, 1))) for one in corners]
    for place, (low, high) in enumerate(boxes):
        np.testing.assert_allclose(high - low, np.ptp(scene.mesh.bounds, axis=0), rtol=1e-5)
        assert all((low > other_high).any() or (high < other_low).any() for other_low, other_high in boxes[:place])


@pytest.mark.parametrize(("subdivided", "copies"), [(9, 1), (10**9, 1), (0, 10**9)])
def test_more_triangles_than_can_be_meant_are_refused(subdivided, copies):
    with pytest.raises(InputError, match=f"scene.subdivided={subdivided} and scene.copies={copies} make"):
        enlarged(make_scene("cornell_box"), subdivided, copies)


def configuration(memory_budget_gib=None, **scene):
    return configured("raster", "frame", (16, 16), scene, {"memory_budget_gib": memory_budget_gib})


def test_points_know_their_enlarged_mesh_and_the_worker_loads_it():
    given = [configuration(), configuration(subdivided=1, copies=2), configuration()]
    points = [one.point for one in plan_points(given)]
    assert [one.triangles for one in points] == [1112, 8896, 1112]
    assert points[0] == points[2]
    assert points[0].mesh_sha256 != points[1].mesh_sha256
    assert load_mesh(points[1]).triangle_count == 8896


def test_a_point_whose_baselines_do_not_fit_has_the_reason_as_its_problem():
    few, many = plan_points([configuration(1e-3), configuration(1e-3, subdivided=3)])
    assert few.problem is None
    assert isinstance(many.problem, MemoryBudgetError)
    assert "baselines of 71,168 triangles and 256 pixels each need about" in str(many.problem)


# Figure


def size_row(method, triangles, time_s, ratio, **fields):
    """Four times the triangles are one more subdivision of 1,000."""
    subdivided = round(np.log(triangles / 1000) / np.log(4))
    own = {"triangles": triangles, "subdivided": subdivided, "copies": 1, "mesh_sha256": f"m{triangles}"}
    return method_row(method, time_s=time_s, ratio=ratio, **own | fields)


def power_laws():
    """The rasteriser grows as n^1, packets as n^(1/4); as fast at 16,000 triangles."""
    rows = []
    for n in (1000, 4000, 64_000, 256_000, 1_024_000):
        packets_s, raster_s = 0.05 * (n / 16_000) ** 0.25, 0.05 * (n / 16_000)
        rows += [
            size_row("pixel", n, packets_s, 1.0, embree_bytes=100 * n, build_time_s=1e-7 * n),
            size_row("raster", n, raster_s, packets_s / raster_s, scratch_bytes=30 * n, embree_bytes=None),
        ]
    return make_rows(*rows)


def test_exponents_are_those_of_power_laws():
    (panel,) = growth_panels(power_laws())
    packets, raster = growths(panel)
    assert (packets.method, raster.method) == ("pixel", "raster")
    slopes = [fitted_slope(one.sizes, values) for one, values in (
        (packets, packets.time_s), (raster, raster.time_s), (raster, raster.bytes)
    )]  # fmt: skip
    assert slopes == pytest.approx([0.25, 1, 1])
    assert raster.bytes[0] == 30_000
    assert fitted_slope(raster.sizes[:1], raster.time_s[:1]) is None
    assert any("raster over packets grows as triangles^" in text for text in exponent_lines(power_laws()))


def test_a_crossing_of_power_laws_is_found_between_sizes_and_drawn_and_told():
    (panel,) = growth_panels(power_laws())
    packets, raster = growths(panel)
    for pair in ((packets, raster), (raster, packets)):
        (crossing,) = crossings(*pair)
        assert crossing.size == pytest.approx(16_000)
        assert (crossing.ahead.method, crossing.behind.method) == ("pixel", "raster")
    told = "packets of 8 per pixel overtakes rasteriser at about 16k triangles"
    figure = growth_figure(power_laws())
    assert told in unfolded(figure)
    assert "k = 0.25" in unfolded(figure)
    ((size, time_ms),) = ((mark.x, mark.y) for mark in figure.panels[0].marks)
    assert (size, time_ms) == pytest.approx((16_000, 50))
    assert [text for text in growth_lines(power_laws()) if told in text]


def test_ratios_decide_and_neither_times_of_another_hour_nor_what_is_as_fast():
    rows = [size_row("pixel", n, 0.05, 1.0) for n in (1000, 4000, 16_000)]
    slow_hour = [size_row("raster", 1000, 0.02, 2.0), size_row("raster", 4000, 0.1, 1.9)]
    level = [size_row("raster", n, 0.05, ratio) for n, ratio in ((1000, 1.01), (4000, 0.99), (16_000, 1.01))]
    for others in (slow_hour, level):
        (panel,) = growth_panels(make_rows(*rows, *others))
        assert crossings(*growths(panel)) == []
    told = f"rasteriser is 1.90 to 2.00{chr(215)} as fast as packets of 8 per pixel"
    assert told in unfolded(growth_figure(make_rows(*rows, *slow_hour)))


def test_every_thing_that_grows_has_a_panel_and_all_else_is_held():
    def row(subdivided, copies, width):
        own = {"subdivided": subdivided, "copies": copies, "mesh_sha256": f"{subdivided}, {copies}"}
        triangles = 10 * 4**subdivided * copies
        return method_row("raster", width=width, height=width, triangles=triangles, **own)

    table = make_rows(*(row(*one) for one in ((0, 1, 64), (1, 1, 64), (2, 1, 64), (0, 4, 64), (0, 1, 128))))
    panels = growth_panels(table)
    assert [(panel.axis, len(panel.rows)) for panel in panels] == [("subdivided", 3), ("copies", 2), ("pixels", 2)]
    assert [list(one.sizes) for panel in panels for one in growths(panel)] == [
        [10, 40, 160], [10, 40], [64**2, 128**2]
    ]  # fmt: skip
    assert len(growing_rows(table)) == 5
    assert len(growing_rows(make_rows(row(0, 1, 64)))) == 0


def test_a_size_that_was_not_measured_is_told_with_its_reason():
    table = make_rows(size_row("raster", 1000, 0.1, 1.0), skipped(size_row("raster", 4000, 0.1, 1.0)))
    assert "rasteriser: skipped, needs more memory than its budget" in unfolded(growth_figure(table))
    assert [say_count(one) for one in (7, 1000, 17_792, 999_999, 16_785_088)] == ["7", "1k", "17.8k", "1M", "16.8M"]
