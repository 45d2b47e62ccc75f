"""A method of one's own: a tracer asks it for what the protocol says and gives it everything else."""

from dataclasses import dataclass

import numpy as np
import pytest

import atra
from tests.meshes import cornell_box, cornell_camera

MESH, CAMERA = cornell_box(), cornell_camera(16, 12)


@dataclass(frozen=True)
class Stripes(atra.Method):
    """Hits triangle `first` in even columns."""

    first: int = 0

    def prepare(self, mesh, camera, pool):
        return Drawn(self.first, camera, pool.threads)


class Drawn(atra.Prepared):
    def __init__(self, first, camera, threads):
        self.first, self.camera, self.threads, self.closed = first, camera, threads, False

    def draw(self, offset, depth, prim_id):
        depth[:], prim_id[:] = np.inf, atra.MISS
        depth[:, ::2], prim_id[:, ::2] = 1.0 + offset[0], self.first

    def close(self):
        self.closed = True


def test_a_method_that_prepares_and_draws_has_everything_else_from_its_tracer():
    with atra.Tracer(MESH, CAMERA, Stripes(3), threads=2, ties="any") as tracer:
        before = tracer.prepared
        hits = tracer.trace((0.25, 0.5))
        assert (hits.prim_id[:, ::2] == 3).all()
        assert (hits.depth[:, ::2] == 1.25).all()
        assert not hits.hit[:, 1::2].any()
        assert (tracer.packet_width, tracer.triangle_count, tracer.embree_bytes, before.threads) == (0, 0, 0, 2)
        assert tracer.counters == {"triangles_traced": 0}
        again = tracer.trace(out=hits)
        assert np.shares_memory(again.depth, hits.depth)
        tracer.look(cornell_camera(20, 8))
        assert before.closed
        assert tracer.trace().prim_id.shape == (8, 20)
        with pytest.raises(atra.InputError, match="Stripes cannot gather all hits; use RasterTracer"):
            tracer.gather(atra.Count())
        last = tracer.prepared
    assert last.closed


def test_what_neither_prepares_nor_draws_is_a_mistake_that_is_told():
    class Empty(atra.Method):
        pass

    with pytest.raises(NotImplementedError):
        atra.Tracer(MESH, CAMERA, Empty()).trace()
