"""The examples of sun and sky give what closed forms give, and a picture."""

import numpy as np
import pytest
from PIL import Image

from examples import city, sky_view, sun_hours

TOY = ["--width", "96", "--height", "64", "--face", "20"]


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
    hours = sun_hours.main([*TOY, "--step", "60", "--out", str(tmp_path)])
    seen = sky_view.main([*TOY, "--rays", "16", "--out", str(tmp_path)])
    assert len(hours) == len(seen)
    assert 0 <= seen.min() < seen.max() <= 1
    assert 0 <= hours.min() < 4 < hours.max() <= 13
    for name in ("sun_hours", "sky_view"):
        image = np.asarray(Image.open(tmp_path / f"{name}.png").convert("RGB"))
        assert image.shape == (64, 96, 3)
        assert len(np.unique(image.reshape(-1, 3), axis=0)) > 10
