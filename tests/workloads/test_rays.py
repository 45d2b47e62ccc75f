"""Questions of rays: what is judged as lost and as extra, on meshes small enough to count by hand."""

import numpy as np
import pytest

import atra
from experiments.workloads.rays.judging import judged, sample_of, truth_of
from tests.closed_meshes import box

pytestmark = pytest.mark.uncovered

MISS = np.uint32(atra.MISS)


@pytest.fixture(scope="module")
def rays():
    """Four rays upwards at the unit square of triangles 0 and 1 at z = 1, and of 2 and 3 at z = 2; the last misses."""
    square = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float32)
    vertices = np.concatenate([np.insert(square, 2, z, axis=1) for z in (1, 2)])
    mesh = atra.Mesh(vertices, np.array([(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)]))
    origins = np.array([(0.75, 0.25, 0), (0.25, 0.75, 0), (0.75, 0.25, 1.5), (2, 2, 0)], np.float32)
    return mesh, origins, np.tile(np.array([(0, 0, 1)], np.float32), (4, 1))


@pytest.mark.parametrize(
    ("question", "answer", "lost", "extra"),
    [
        ("closest", [0, 1, 2, MISS], 0, 0),
        ("closest", [0, MISS, 2, MISS], 1, 0),
        ("closest", [2, 1, 2, MISS], 1, 0),  # the farther one
        ("closest", [0, 1, 2, 3], 0, 1),
        ("any", [True, True, True, False], 0, 0),
        ("any", [False, True, True, True], 1, 1),
        ("count", [2, 2, 1, 0], 0, 0),
        ("count", [0, 3, 1, 0], 2, 1),
        ("all", ([0, 0, 1, 1, 2], [0, 2, 3, 1, 2]), 0, 0),
        ("all", ([0, 1, 1, 1, 2, 3], [0, 3, 1, 1, 2, 0]), 1, 2),  # one lacks, one is there twice, one not at all
    ],
)
def test_lost_and_extra_hits_are_counted(rays, question, answer, lost, extra):
    mesh, origins, directions = rays
    truth = truth_of(question, mesh, origins, directions)
    given = tuple(map(np.array, answer)) if isinstance(answer, tuple) else np.array(answer)
    assert judged(question, given, np.arange(4), truth, mesh, (origins, directions)) == (lost, extra)
    assert truth.hits == (5 if question in ("count", "all") else 3)


def test_only_sampled_rays_are_judged(rays):
    mesh, origins, directions = rays
    sample = np.array([1, 3])
    some = origins[sample], directions[sample]
    truth = truth_of("all", mesh, *some)
    answer = np.array([0, 1, 3]), np.array([0, 1, 0])  # of ray 0 nothing is known, ray 1 lacks one, ray 3 has none
    assert judged("all", answer, sample, truth, mesh, some) == (1, 1)
    assert list(sample_of(5, 9)) == [0, 1, 2, 3, 4]


def test_points_are_judged_by_parity():
    points = np.array([(0, 0, 0), (0.5, 0.5, 0.5), (3, 0, 0)], np.float32)
    truth = truth_of("contains", box(), points)
    assert truth.hits == 2
    answer = np.array([True, False, True])
    assert judged("contains", answer, np.arange(3), truth, box(), (points,)) == (1, 1)
