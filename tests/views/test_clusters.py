"""Dask and Ray render views as they are: one process of each on this machine, the same images to the bit."""

import pytest

import atra
from examples.clusters import CLUSTERS
from tests.images import assert_same_bits
from tests.meshes import cornell_box, cornell_camera

NEEDS = {"dask": "distributed", "ray": "ray"}


@pytest.mark.parametrize("cluster", CLUSTERS)
def test_a_cluster_gives_the_same_images(cluster):
    pytest.importorskip(NEEDS[cluster], reason=f"{NEEDS[cluster]} is not installed")
    mesh, whole = cornell_box(), cornell_camera(64, 48)
    cameras = {f"part {left}": whole.crop(left, 0, 32, 48) for left in (0, 16, 32)}
    with CLUSTERS[cluster](1) as executor:
        found = dict(atra.render_views(mesh, cameras, executor=executor))
    assert list(found) == list(cameras)
    for (name, hits), (_, expected) in zip(found.items(), atra.render_views(mesh, cameras, threads=1), strict=True):
        assert_same_bits(hits, expected)
        assert hits.camera == cameras[name]
