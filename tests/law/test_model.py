"""The model: what a look counts, and what formulas make of it."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import atra
from atra.errors import InputError
from experiments.classification.tracer import BvhTracer
from experiments.law.model.choice import Choice
from experiments.law.model.defaults import DEFAULTS
from experiments.law.model.forecasting import forecast, known_constants
from experiments.law.model.formulas import Counts, build_terms, family, fit, frame_terms
from experiments.law.model.looking import _whole, look_at
from experiments.law.model.memory import array_bytes, byte_terms
from experiments.methods.tiles import Tiles
from tests.machine import WIDEST
from tests.meshes import EYE_AT_ORIGIN, cornell_box, cornell_camera, quads, random_triangles


def camera(size=16, **fields):
    return atra.Camera(**{**EYE_AT_ORIGIN, **fields}, width=size, height=size)


def wall(z, half=10.0):
    """Wider than high, so that no ray runs through the edge that its two triangles share."""
    return [(-half, -half, z), (1.1 * half, -half, z), (1.1 * half, half, z), (-half, half, z)]


# A look


def test_a_look_counts_the_hits_of_single_rays_as_the_rasteriser_does():
    mesh = random_triangles(300, 1)
    with atra.RasterTracer(mesh, camera()) as tracer:  # all blocks of rays are this image
        hits = tracer.gather(atra.Count()).count
        seen = tracer.trace().hit
    look = look_at(mesh, camera())
    assert look.met[look.shape((1, 1)), 0] == pytest.approx(hits.mean())
    assert look.met[look.shape((1, 1)), 1] == pytest.approx(seen.mean())
    assert look.hit == pytest.approx(seen.mean())


def test_packets_meet_no_less_than_each_of_their_rays_and_no_more_than_all_together():
    look = look_at(random_triangles(2000, 2), camera(64))
    for shape in look.shapes[1:]:
        kind, rays = look.shape(shape), shape[0] * shape[1]
        for counted in (look.boxes.sum(axis=2), look.tested, look.met):
            assert (counted[kind] >= counted[0] - 1e-9).all()
            assert (counted[kind] <= rays * counted[0] + 1e-9).all()
            assert counted[kind, 1] <= counted[kind, 0]


def test_walls_one_behind_the_other_are_entered_by_every_ray_and_seen_once():
    look = look_at(quads([wall(z) for z in (1.0, 2.0, 4.0, 8.0)]), camera(32))
    assert look.boxes[0, 0, 0] == 1.0  # the root
    assert look.met[0].tolist() == [4.0, 1.0]
    assert look.boxes[0, 1].sum() < look.boxes[0, 0].sum()


@pytest.mark.parametrize("split", [(1, 1), (8, 1), (1, 16), (8, 8)])
def test_copies_are_those_that_alignment_plans(split):
    mesh, view = cornell_box(), cornell_camera(64, 64)
    with atra.AlignedTracer(mesh, view, split) as tracer:
        tracer.build()
        copied = look_at(mesh, view).copied("aligned", split)
        assert copied.copies == tracer.triangle_count
        assert copied.left_out == tracer.counters["triangles_left_out"]


@pytest.mark.parametrize("split", [(1, 1), (16, 1), (8, 8)])
def test_copies_after_a_probe_are_nearly_those_that_visible_first_tracing_plans(split):
    mesh, view = cornell_box(), cornell_camera(64, 64)
    with atra.VisibleFirstTracer(mesh, view, split) as tracer:  # its probe looks through other points of the pixels
        copied = look_at(mesh, view).copied("visible_first", split)
        assert copied.copies == pytest.approx(tracer.triangle_count - mesh.triangle_count, rel=0.15)
    assert copied.copies < look_at(mesh, view).copied("aligned", split).copies


def test_what_a_wall_hides_is_neither_copied_nor_traced_again():
    near, both = (look_at(quads(walls), camera(32)) for walls in ([wall(1.0)], [wall(1.0), wall(4.0)]))
    assert both.copied("visible_first", (4, 4)) == near.copied("visible_first", (4, 4))
    assert both.copied("aligned", (4, 4)).copies > near.copied("aligned", (4, 4)).copies >= 16
    assert both.copied("visible_first", (4, 4)).again == 0.0


@pytest.mark.parametrize("far", [0.0, 1000.0])
def test_many_triangles_in_one_place_are_looked_at_beside_one_far_away(far):
    corners = np.tile(np.array([[-1, -1, 2], [3, -1, 2], [-1, 3, 2]], np.float32), (1500, 1))
    corners[-3:, 2] += far
    look = look_at(atra.Mesh(corners, np.arange(4500).reshape(-1, 3)), camera(16))
    assert look.met[0, 0] == pytest.approx((1500 - (far > 0)) * look.hit, rel=0.01)
    assert look.met[0, 0] <= look.tested[0, 0] < 1.05 * look.met[0, 0]


def test_bytes_of_a_bvh_are_known_from_some_of_its_clusters():
    mesh = random_triangles(5000, 8, size=0.05)
    with BvhTracer(mesh, camera()) as tracer:
        tracer.build()
        assert look_at(mesh, camera()).bvh_bytes == pytest.approx(tracer.counters["bvh_bytes"], rel=0.05)


def test_a_sample_of_triangles_tells_of_all_of_them(monkeypatch):
    around = random_triangles(20_000, 3, size=0.08)
    mesh, view = atra.Mesh(around.vertices + np.float32([0, 0, 6]), around.faces), camera(64)  # none near the eye
    all_of_them = look_at(mesh, view)
    monkeypatch.setattr("experiments.law.model.looking.MOST_IN_TREE", 2500)
    monkeypatch.setattr("experiments.law.model.copying.MOST_COPIED", 2500)
    sampled = look_at(mesh, view)
    copies = [one.copied("aligned", (8, 8)).copies for one in (sampled, all_of_them)]
    assert copies[0] == pytest.approx(copies[1], rel=0.1)
    assert sampled.met[0, 0] == pytest.approx(all_of_them.met[0, 0], rel=0.3)
    assert sampled.boxes[0, 0].sum() == pytest.approx(all_of_them.boxes[0, 0].sum(), rel=0.5)


def test_a_tree_of_a_sample_gets_levels_between_its_upper_ones_and_its_leaves():
    boxes = np.ones((1, 2, 61))
    boxes[..., 8:] = 0.0
    whole, _, met = _whole(4.0, boxes, np.ones((1, 2)), np.ones((1, 2)), 256)
    assert whole[0, 0].sum() == 10.0
    assert met[0, 0] == 4.0


# The law


def test_cells_share_as_many_levels_as_halve_their_number_to_one():
    look = look_at(random_triangles(2000, 4), camera(64))
    boxes = look.boxes[look.shape(Choice("aligned", (16, 1), WIDEST).packet_shape(64, 64)), 0]
    counts = Counts(look, Choice("aligned", (16, 1), WIDEST), 0)
    assert counts.upper == pytest.approx(boxes[:4].sum())
    assert counts.lower == pytest.approx(boxes[4:].sum())
    assert counts.shot * 16 == counts.packets


def test_what_a_row_of_packets_meets_again_is_out_of_a_cache_that_is_smaller(monkeypatch):
    look = look_at(random_triangles(2000, 4), camera(64))
    choice = Choice("aligned", (16, 1), WIDEST)
    counts = Counts(look, choice, 0)
    assert frame_terms(look, choice, "nearest")[5] == 0.0
    a_row = min(look.copied("aligned", (16, 1)).copies, counts.row * 16 * (counts.lower + counts.tested))
    monkeypatch.setattr("experiments.law.model.formulas.IN_CACHE", a_row / 4)
    assert 0.7 * counts.packets * counts.met < frame_terms(look, choice, "nearest")[5] < counts.packets * counts.met


def test_fitting_finds_the_constants_that_made_the_times():
    random = np.random.default_rng(5)
    terms = random.random((40, 4)) * [1.0, 10.0, 1e6, 1.0]
    constants = np.array([2.0, 0.3, 1e-6, 0.0])
    times = terms @ constants
    times[::9] *= 3.0  # a few of them wrong
    assert fit(terms, times) == pytest.approx(constants, rel=0.05, abs=0.05)


CHOICES = {
    "nearest": [
        Choice("raster"), Choice("pixel"), Choice("pixel", packet_width=WIDEST), Choice("bvh"), Choice("classified"),
        Choice("tiles", (4, 4), WIDEST), Choice("visible_first", (16, 1), WIDEST), Choice("aligned", (8, 1), WIDEST),
        Choice("aligned", (8, 8)), Choice("instanced", (2, 1), WIDEST, culling=False),
    ],
}  # fmt: skip
CHOICES["layers"] = [one for one in CHOICES["nearest"] if one.method in ("raster", "pixel", "aligned", "instanced")]


@pytest.mark.parametrize("want", CHOICES)
def test_every_choice_of_every_set_has_constants_and_at_most_eight(want):
    look = look_at(cornell_box(), cornell_camera(64, 64))
    for constants in DEFAULTS.values():
        assert max(map(len, constants.values())) <= 8
        for choice in CHOICES[want]:
            assert len(constants[family(choice, want)]) == len(frame_terms(look, choice, want))
            assert len(constants[f"{choice.method}|build"]) == len(build_terms(look, choice))
            assert len(constants[f"{choice.method}|bytes"]) == len(byte_terms(look, choice))


# Memory


def arrays_of(tracer):
    """Bytes of the arrays that a built tracer keeps for Embree's scenes."""
    prepared = getattr(tracer, "prepared", None)
    passes = getattr(prepared, "second_passes", ())
    scenes = [getattr(prepared, "whole", None), *(one.scene for one in passes if one is not None)]
    arrays = [one for scene in scenes if scene is not None for kept in scene._kept[1:] for one in kept]
    geometry = getattr(prepared, "geometry", None)
    arrays += [getattr(geometry, one, None) for one in ("vertices", "faces", "records", "transforms")]
    return sum(one.nbytes for one in arrays if one is not None)


@pytest.mark.parametrize(("choice", "make"), [
    (Choice("pixel", packet_width=WIDEST), partial(atra.PixelTracer, packet_width=WIDEST)),
    (Choice("tiles", (4, 4), WIDEST), partial(atra.Tracer, method=Tiles((4, 4), WIDEST))),
    (Choice("visible_first", (8, 8), WIDEST), partial(atra.VisibleFirstTracer, split=(8, 8), packet_width=WIDEST)),
    (Choice("aligned", (8, 8), WIDEST), partial(atra.AlignedTracer, split=(8, 8), packet_width=WIDEST)),
    (Choice("instanced", (8, 1), WIDEST, False),
     partial(atra.AlignedTracer, split=(8, 1), packet_width=WIDEST, geometry="instanced", culling=False)),
], ids=lambda value: str(value) if isinstance(value, Choice) else "")  # fmt: skip
def test_bytes_of_arrays_are_those_that_the_tracer_keeps(choice, make):
    mesh, view = cornell_box(), cornell_camera(64, 64)
    with make(mesh, view, threads=1, ties="any") as tracer:
        assert array_bytes(look_at(mesh, view), choice) == pytest.approx(arrays_of(tracer), rel=0.05)


def test_cells_without_a_triangle_are_no_scenes_and_full_ones_are_counted_by_their_triangles():
    copied = look_at(quads([wall(1.0, 0.2), wall(1.0, 0.1)]), camera(64)).copied("tiles", (8, 8))
    assert 0 < copied.occupied < 64
    assert copied.crowded == 0.0
    many = look_at(random_triangles(2000, 2), camera(64)).copied("tiles", (2, 2))
    assert many.occupied == 4
    assert many.crowded == many.copies > 100


# Choices


ONE = quads([wall(2.0)])
NOTHING_IN_VIEW = {
    "behind": (quads([wall(-2.0)]), camera(64)),
    "aside": (quads([[(50, 0, 1), (51, 0, 1), (51, 1, 1), (50, 1, 1)]]), camera(64)),
    "without area": (atra.Mesh(np.array([[0, 0, 1], [1, 0, 1], [2, 0, 1]]), np.array([[0, 1, 2]])), camera(64)),
    "all alike": (atra.Mesh(np.tile(np.eye(3), (50, 1)) + [0, 0, 1], np.arange(150).reshape(-1, 3)), camera(64)),
    "one triangle": (atra.Mesh(ONE.vertices, ONE.faces[:1]), camera(64)),
    "one pixel": (ONE, camera(1)),
    "in its plane": (quads([[(-1, 0, 1), (1, 0, 1), (1, 0, 3), (-1, 0, 3)]]), camera(64)),
}


@pytest.mark.parametrize("name", NOTHING_IN_VIEW)
@pytest.mark.parametrize("want", CHOICES)
def test_a_view_of_nearly_nothing_has_forecasts(name, want):
    mesh, view = NOTHING_IN_VIEW[name]
    look = look_at(mesh, view)
    for choice in CHOICES[want] if view.width > 1 else CHOICES[want][:3]:
        predicted = forecast(look, choice, want, known_constants())
        assert np.isfinite([predicted.frame_time_s, predicted.build_s, predicted.bytes]).all()
        assert predicted.frame_time_s > 0


def test_a_camera_with_a_lens_and_a_choice_that_cannot_be_are_refused():
    with pytest.raises(InputError, match="lens"):
        look_at(cornell_box(), atra.LensCamera.panorama((0, 0, 3), (0, 0, 0), width=64))
    refused = {
        "method": ("magic", "method is 'magic'"),
        "split": ((2, 1), "no cells"),
        "packet_width": (0, "width is 0"),
    }
    for name, (value, told) in refused.items():
        with pytest.raises(InputError, match=told):
            replace(Choice("pixel"), **{name: value})
