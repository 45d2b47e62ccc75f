"""Our own trees: what they hold, and how well their boxes tell triangles apart; the binary ones are the harness's."""

import numpy as np
import pytest

import atra
from atra.compiled.threads import WorkerPool
from atra.trees.layout import BLOCK, DEEPEST
from atra.trees.wide import CHILDREN, wide_bvh
from experiments.classification.bvh.binary import BIAS, build_bvh
from experiments.workloads.build.bvh_cost import bvh_cost
from tests.meshes import cornell_box, quads, random_triangles


def built(mesh, threads=1, build=build_bvh):
    pool = WorkerPool(threads)
    kept = np.ones(mesh.triangle_count, np.bool_)
    kept[mesh.without_area] = False
    try:
        return build(mesh.vertices, mesh.traced_faces, kept, pool)
    finally:
        pool.close()


def below(bvh, node):
    """prim_ids of the triangles below a node."""
    if bvh.block_counts[node]:
        own = slice(bvh.first[node], bvh.first[node] + bvh.block_counts[node])
        return bvh.blocks[own, 9][~bvh.is_left_over[own]].tolist()
    return below(bvh, bvh.first[node]) + below(bvh, bvh.first[node] + 1)


def same_place(count):
    """Triangles of one box."""
    return atra.Mesh(np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)]), np.tile([0, 1, 2], (count, 1)))


MESHES = {
    "random": random_triangles(300, 0),
    "box": cornell_box(),
    "one": same_place(1),
    "one box": same_place(41),
    "flat": quads([[(x, 0, y), (x + 1, 0, y), (x + 1, 0, y + 1), (x, 0, y + 1)] for x in range(9) for y in range(9)]),
}


@pytest.mark.parametrize("name", MESHES)
def test_every_triangle_lies_in_one_leaf_and_in_all_boxes_above_it(name):
    mesh, bvh = MESHES[name], built(MESHES[name])
    corners = mesh.vertices[mesh.faces]
    inner = [node for node in range(len(bvh.nodes)) if node != 1 and not bvh.block_counts[node]]
    assert sorted(below(bvh, 0)) == list(range(mesh.triangle_count))
    for node in (0, *range(2, len(bvh.nodes))):
        low, high = bvh.boxes[node]
        inside = corners[below(bvh, node)].reshape(-1, 3)
        np.testing.assert_array_equal((low, high), (inside.min(axis=0), inside.max(axis=0)))
    for node in inner:  # children are neighbours in one cache line, the second one higher along the axis
        first, axis = bvh.first[node], (int(bvh.nodes[node, 7]) - BIAS) & 3
        assert first % 2 == 0
        middles = [boxes.sum(axis=0)[axis] for boxes in bvh.boxes[first : first + 2].astype(np.float64)]
        assert name == "one box" or middles[0] < middles[1]
    assert all(len(below(bvh, node)) <= BLOCK for node in range(2, len(bvh.nodes)) if bvh.block_counts[node])


def in_children(bvh, node=0):
    """(box, prim_ids) of each child of a node of eight, (2, 3) float32, and of all below."""
    low, high = bvh.nodes.view(np.float32)[node, :3], bvh.nodes.view(np.float32)[node, 3:6]
    first, blocks = bvh.nodes[node, 6:]
    for child in np.flatnonzero(~np.isnan(low[0])):
        box = np.stack([low[:, child], high[:, child]])
        if blocks[child]:
            own = bvh.blocks[first[child] : first[child] + blocks[child]]
            yield box, own[:, 9][~np.isnan(own[:, 0].view(np.float32))].tolist()
            continue
        deeper = list(in_children(bvh, first[child]))
        yield box, [prim_id for _, found in deeper for prim_id in found]
        np.testing.assert_array_equal(box, [np.min([b[0] for b, _ in deeper], 0), np.max([b[1] for b, _ in deeper], 0)])


@pytest.mark.parametrize("name", MESHES)
def test_every_triangle_lies_in_one_leaf_of_the_tree_of_eight_and_in_all_boxes_above_it(name):
    mesh = MESHES[name]
    one, three = (built(mesh, threads, wide_bvh) for threads in (1, 3))
    children = list(in_children(one))
    assert sorted(prim_id for _, found in children for prim_id in found) == list(range(mesh.triangle_count))
    for box, found in children:
        corners = mesh.vertices[mesh.faces[found]].reshape(-1, 3)
        np.testing.assert_array_equal(box, (corners.min(axis=0), corners.max(axis=0)))
    assert one.nodes.shape[1:] == (8, CHILDREN)
    np.testing.assert_array_equal(one.nodes, three.nodes)
    np.testing.assert_array_equal(one.blocks, three.blocks)


def test_a_tree_of_no_triangles_has_no_children():
    pool, mesh = WorkerPool(1), MESHES["one"]
    assert not list(in_children(wide_bvh(mesh.vertices, mesh.faces, np.zeros(1, np.bool_), pool)))


def test_the_build_is_the_same_with_any_number_of_threads_and_leaves_out_triangles_without_area():
    mesh = random_triangles(3000, 1)
    one, three = built(mesh), built(mesh, threads=3)
    np.testing.assert_array_equal(one.nodes, three.nodes)
    np.testing.assert_array_equal(one.blocks, three.blocks)
    line = atra.Mesh(np.concatenate([mesh.vertices, [(0, 0, 0), (1, 1, 1), (2, 2, 2)]]),
                     np.concatenate([mesh.faces, [[len(mesh.vertices) + k for k in range(3)]]]))  # fmt: skip
    assert sorted(below(built(line), 0)) == list(range(3000))


def deep_mesh():
    """Each triangle twice as far away as the one before: a split off the end is always the cheapest."""
    places = 2.0 ** np.arange(-75, 24)
    corners = np.array([(0, 0, 0), (0.1, 0, 0), (0, 0.1, 0)]) + 1.0
    return atra.Mesh((corners * places[:, None, None]).reshape(-1, 3), np.arange(3 * len(places)).reshape(-1, 3))


def test_no_leaf_lies_deeper_than_the_stack_is_high():
    mesh = deep_mesh()
    bvh = built(mesh)
    assert bvh.heights[0] <= DEEPEST
    assert sorted(below(bvh, 0)) == list(range(mesh.triangle_count))


def surface_area_cost(bvh):
    """Boxes a random ray enters, and triangles it is tested with."""
    low, high = (bvh.boxes[:, end].astype(np.float64) for end in (0, 1))
    x, y, z = (high - low).T
    areas = x * y + y * z + z * x
    areas[1] = 0.0
    triangles = [len(below(bvh, node)) if bvh.block_counts[node] else 0 for node in range(len(bvh.nodes))]
    return (areas[2:].sum() + (areas * triangles).sum()) / areas[0]


@pytest.mark.parametrize("name", ["random", "box"])
def test_boxes_tell_apart_as_well_as_those_of_embrees_builder(name):
    mesh = MESHES[name]
    embree = bvh_cost(mesh.vertices, mesh.traced_faces, children=2)
    assert surface_area_cost(built(mesh)) <= 1.05 * (embree.boxes_entered + embree.triangles_tested)


def test_numbers_of_nodes_are_no_denormal_floats():
    assert np.array([BIAS, BIAS + 1], np.uint32).view(np.float32).min() >= np.finfo(np.float32).tiny
