"""The weekend's scene: as many balls of each material as in the book, and a picture of them."""

import numpy as np

import atra
from atra import light
from scenes.lit.weekend import WEEKEND_CAMERA, weekend
from tests.shown import traced


def test_the_weekend_is_the_book_s():
    scene = weekend(segments=8)
    corners = scene.mesh.triangles(np.arange(scene.mesh.triangle_count))
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inner = scene.normals[scene.mesh.faces].astype(float).sum(axis=1)
    assert ((across * inner).sum(axis=1) > 0).all()  # fronts are outside
    count = len(scene.materials) - 4 - 3
    assert 470 <= count <= 484
    kinds = [type(material) for material in scene.materials[4 : 4 + count]]
    assert abs(kinds.count(light.Lambertian) / count - 0.8) < 0.05
    assert abs(kinds.count(light.Metal) / count - 0.15) < 0.05
    camera = atra.Camera(**WEEKEND_CAMERA, width=30, height=20)
    image = traced(scene, camera, 8)
    assert np.ptp(image.mean(axis=2)) > 0.5
    np.testing.assert_allclose(image[0, :, 2], 1.0, atol=0.2)  # the sky is blue
