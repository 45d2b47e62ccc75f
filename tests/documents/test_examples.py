"""The worked examples run at toy size, and what they trace is right."""

import numpy as np
import pytest
from PIL import Image

import atra
from examples import (
    alignment_drawing,
    calibrated_views,
    city,
    first_image,
    frames,
    interiors,
    lenses,
    progressive,
    shadow_map,
    sky_view,
    stereo,
    sun_hours,
    weekend,
)
from tests.folders import ROOT

TOY = ["--scene", "cornell_box", "--width", "64", "--height", "48"]


def picture(path):
    return np.asarray(Image.open(path).convert("RGB"))


def test_progressive_tells_a_growing_time_for_every_method_and_smooths_edges(tmp_path):
    told = progressive.main([*TOY, "--out", str(tmp_path)])
    assert list(told) == [1, 4, 16, 64]
    for name in told[1]:
        times = [told[count][name] for count in told]
        assert times == sorted(times)
        assert times[0] > 0
    image = picture(tmp_path / "progressive.png")
    one_sample = shadeless_colours("cornell_box")
    assert len(np.unique(image[:, :64].reshape(-1, 3), axis=0)) > one_sample


def shadeless_colours(scene):
    """Colours of one frame: averaging edges makes more."""
    from examples import parts
    from experiments.drawing.shading import shade

    mesh, pose = parts.load(scene)
    with atra.PixelTracer(mesh, atra.Camera(**pose, width=64, height=48), threads=1) as tracer:
        return len(np.unique(shade(tracer.trace()).reshape(-1, 3), axis=0))


def test_the_eyes_are_apart_along_the_images_rows_and_look_the_same_way():
    camera = atra.Camera((1, 2, 3), (4, 2, 5))
    left, right = stereo.eyes(camera, 0.5)
    np.testing.assert_allclose(np.subtract(right.eye, left.eye), 0.5 * camera.axes[0])
    np.testing.assert_allclose(left.axes, right.axes, atol=1e-12)


def test_stereo_shows_what_each_eye_sees(tmp_path, capsys):
    both = stereo.main([*TOY, "--out", str(tmp_path)])
    assert len(both) == 2
    assert capsys.readouterr().out.count("0 wrong") == 2
    assert picture(tmp_path / "stereo.png").shape == (48, 2 * 64 + 4, 3)
    red, green, blue = picture(tmp_path / "anaglyph.png").reshape(-1, 3).T
    np.testing.assert_array_equal(green, blue)
    assert (red != green).any()


def test_the_drawing_shows_sixteen_rays_hits_on_four_at_the_same_depths(tmp_path):
    alignment, depths = alignment_drawing.main(["--out", str(tmp_path)])
    assert np.isfinite(depths).sum() > alignment_drawing.PIXELS / 2
    assert (np.isfinite(depths).reshape(4, 4).sum(axis=1) > 0).all()  # something is seen in every cell
    pitch = alignment.cameras[0].pixel_pitch
    for pixel in np.nonzero(np.isfinite(depths))[0].tolist():
        cell, ray = divmod(pixel, 4)
        along = np.array([(pixel + 0.5 - 8) * pitch, 1]) * depths[pixel]
        reference = np.array([(alignment.corner_pixels[0] + ray + 0.5) * pitch, 1]) * depths[pixel]
        np.testing.assert_allclose(alignment_drawing.sheared(alignment, cell, along[None]), reference[None], atol=1e-9)
    drawn = picture(tmp_path / "alignment.png")
    shown = picture(ROOT / "docs" / "images" / "alignment.png")
    assert shown.shape == drawn.shape
    assert np.abs(shown.astype(float) - drawn).mean() < 3  # another matplotlib may set its letters otherwise
    assert all((drawn == colour).all(axis=-1).any() for colour in ((213, 94, 0), (0, 114, 178), (0, 158, 115)))


def test_the_drawing_s_pieces_stay_in_their_cell_and_lose_no_area():
    def area(outline):
        x, y = outline.T
        return abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1))) / 2

    kept = []
    for cell in range(alignment_drawing.CELLS):
        for piece in alignment_drawing.pieces(cell):
            kept.append(piece)
            column = (piece[:, 0] / piece[:, 1] / alignment_drawing.HALF_WIDTH + 1) / 2 * alignment_drawing.CELLS
            assert (column >= cell - 1e-9).all()
            assert (column <= cell + 1 + 1e-9).all()
    assert len(kept) > len(alignment_drawing.SHAPES)  # one is cut
    np.testing.assert_allclose(sum(map(area, kept)), sum(map(area, alignment_drawing.SHAPES)))


def test_frames_are_those_traced_alone(tmp_path, capsys):
    assert len(frames.main([*TOY, "--frames", "3", "--out", str(tmp_path)])) == 3
    assert capsys.readouterr().out.count("0 wrong") == 3
    assert picture(tmp_path / "frames.png").shape[1] == 3 * 32 + 2 * 4


def test_three_lenses_see_the_room_and_two_methods_agree_on_every_pixel(tmp_path, capsys):
    seen = lenses.main([*TOY, "--nearer", "0.3", "--out", str(tmp_path)])
    assert all(hits.hit.any() for hits in seen.values())
    assert capsys.readouterr().out.count(" 0 wrong") == 3
    assert picture(tmp_path / "lenses.png").shape == (48, 2 * 64 + 96 + 8, 3)


def test_the_shadow_map_is_the_one_of_single_rays(tmp_path, capsys):
    shadow_map.main([*TOY, "--map", "96", "--out", str(tmp_path)])
    assert "0 wrong" in capsys.readouterr().out
    assert picture(tmp_path / "shadow_map.png").shape[0] == 48


def test_the_weekend_is_shown_by_paths_and_below_by_hybrid_rendering(tmp_path):
    size = ["--width", "48", "--height", "32", "--samples", "2", "--segments", "6"]
    told = weekend.main([*size, "--out", str(tmp_path)])
    assert list(told) == ["paths", "hybrid"]
    image = picture(tmp_path / "weekend.png")
    assert image.shape == (2 * 32 + 4, 48, 3)
    above, below = image[:32].astype(int), image[36:].astype(int)
    assert (above[:3] == below[:3]).mean() > 0.5  # both see the sky
    assert (above != below).mean() > 0.5


def test_both_interiors_are_lit_side_by_side(tmp_path):
    interiors.main(["--width", "32", "--height", "24", "--samples", "4", "--noisy", "--out", str(tmp_path)])
    image = picture(tmp_path / "interiors.png")
    assert image.shape == (24, 2 * 32 + 4, 3)
    assert all(20 < half.mean() < 235 for half in (image[:, :32], image[:, 36:]))


def test_a_point_behind_another_as_the_light_goes_is_in_shadow():
    step = atra.Mesh([(-1, 1, -1), (0, 1, -1), (0, 1, 1), (-1, 1, 1)], [(0, 1, 2), (0, 2, 3)])
    sun = atra.OrthographicCamera.of_light((0, -1, 0), [(-1, 0, -1), (1, 1, 1)], 32, 32)
    with atra.AlignedTracer(step, sun, (4, 1), threads=1) as tracer:
        light = tracer.trace()
    points = np.array([(-0.5, 0, 0), (0.5, 0, 0), (-0.5, 1, 0), (-0.5, 1.5, 0)], float)
    np.testing.assert_array_equal(shadow_map.is_lit(points, light, 1e-3), [False, True, True, True])


def test_calibrated_views_are_those_of_single_rays(tmp_path, capsys):
    found = calibrated_views.main([*TOY, "--views", "3", "--out", str(tmp_path)])
    assert list(found) == ["view_000", "view_001", "view_002"]
    assert all(isinstance(hits.camera, atra.CalibratedCamera) for hits in found.values())
    assert "0 wrong" in capsys.readouterr().out
    assert picture(tmp_path / "calibrated_views.png").shape == (180, 3 * 240 + 2 * 4, 3)


def test_the_readme_s_example_prints_what_the_readme_says():
    assert f"```text\n{first_image.torus_hits()}\n```" in (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_strip_holds_three_pictures_side_by_side(tmp_path):
    first_image.main(["--out", str(tmp_path)])
    assert picture(tmp_path / "strip.png").shape == picture(ROOT / "docs" / "images" / "strip.png").shape
    assert np.unique(picture(tmp_path / "strip.png")[:, :300].reshape(-1, 3), axis=0).shape[0] > 1000  # triangles


CITY = ["--width", "96", "--height", "64", "--face", "20"]


def test_the_sun_stands_where_spheres_say():
    noon = sun_hours.plain_sun(48.0, 81, np.array([12.0]))[0]  # an equinox: as high as the pole is low
    assert np.rad2deg(np.arcsin(noon[2])) == pytest.approx(42.0, abs=0.5)
    assert noon[1] < 0
    morning = sun_hours.plain_sun(48.0, 81, np.array([6.0]))[0]
    assert morning == pytest.approx((1.0, 0.0, 0.0), abs=0.01)
    for latitude, month, hours in ((48.0, 3, 12.0), (48.0, 6, 16.0), (0.0, 12, 12.0), (80.0, 12, 0.0)):
        up = sun_hours.sun_directions(latitude, month, 21, 10.0)
        assert len(up) / 6 == pytest.approx(hours, abs=0.5)
        np.testing.assert_allclose(np.linalg.norm(up, axis=1), 1.0) if len(up) else None


def test_ground_beside_a_wall_loses_the_sun_that_the_wall_hides():
    ground = city.rectangle((-50, -50, 0), (100, 0, 0), (0, 100, 0), 5.0)
    wall = city.rectangle((0, -5000, 0), (0, 10_000, 0), (0, 0, 10), 10_000.0)  # endless, from south to north
    mesh = city.mesh_of(np.concatenate([ground, wall]), "wall")
    suns = sun_hours.sun_directions(30.0, 3, 21, 5.0)
    origins, _ = city.places(mesh)
    x = origins[: len(ground), 0]
    expected = [
        5 / 60 * sum(1 for sun in suns if not (one * sun[0] < 0 and abs(one / sun[0]) * sun[2] < 10)) for one in x
    ]
    found = sun_hours.sun_hours(mesh, suns, 5 / 60)[: len(ground)]
    assert found == pytest.approx(expected, abs=5 / 60)
    assert np.ptp(found) > 3
    alone = sun_hours.sun_hours(city.mesh_of(ground, "ground"), suns, 5 / 60)
    assert alone == pytest.approx(len(suns) * 5 / 60)


def test_ground_beside_an_endless_wall_sees_the_share_of_the_sky_that_is_left():
    wall = city.mesh_of(city.rectangle((0, -1e5, 0), (0, 2e5, 0), (0, 0, 10), 2e5), "wall")
    away = np.array([1.0, 5.0, 10.0, 40.0])
    places = np.stack([away, 0 * away, 0 * away], axis=1)
    found = sky_view.sky_view(wall, 4096, at=(places, np.tile((0.0, 0.0, 1.0), (4, 1))))
    assert found == pytest.approx((1 + np.cos(np.arctan(10 / away))) / 2, abs=0.01)
    walls = sky_view.sky_view(wall, 4096, at=(np.array([[1.0, 0, 0]]), np.array([[1.0, 0.0, 0.0]])))
    assert walls == pytest.approx([0.5], abs=0.01)


def test_both_write_a_picture(tmp_path):
    hours = sun_hours.main([*CITY, "--step", "60", "--out", str(tmp_path)])
    seen = sky_view.main([*CITY, "--rays", "16", "--out", str(tmp_path)])
    assert len(hours) == len(seen)
    assert 0 <= seen.min() < seen.max() <= 1
    assert 0 <= hours.min() < 4 < hours.max() <= 13
    for name in ("sun_hours", "sky_view"):
        image = np.asarray(Image.open(tmp_path / f"{name}.png").convert("RGB"))
        assert image.shape == (64, 96, 3)
        assert len(np.unique(image.reshape(-1, 3), axis=0)) > 10
