"""The examples of all hits along rays meet their closed forms: radiographs, transparent layers, solid voxels."""

import numpy as np
import pytest
import trimesh
from PIL import Image

import atra
from atra.all_hits.closed import open_edges
from examples import all_hits, radiograph, solids, transparency, voxels
from scenes.special import three_holes
from tests.closed_meshes import cornell_boxes
from tests.meshes import joined

TOY = ["--width", "64", "--height", "48"]


def size_of(path):
    return Image.open(path).size


@pytest.mark.parametrize("name", solids.SOLIDS)
def test_a_solid_is_closed_and_its_bodies_stay_apart(name):
    mesh = solids.SOLIDS[name]()
    assert not len(open_edges(mesh))
    bodies = trimesh.Trimesh(mesh.vertices, mesh.faces).split()
    assert sum(len(body.faces) for body in bodies) == mesh.triangle_count
    if name == "parcel":
        _, cavity, *inside = bodies
        assert all((body.bounds[0] > cavity.bounds[0]).all() for body in inside)
        assert all((body.bounds[1] < cavity.bounds[1]).all() for body in inside)
        hulls = [body.bounds for body in inside if body.volume > 0]
        for number, one in enumerate(hulls):
            for other in hulls[number + 1 :]:
                assert (np.maximum(one[0], other[0]) > np.minimum(one[1], other[1])).any()


def test_radiographs_of_a_ball_and_a_box_meet_their_closed_forms(tmp_path):
    off = radiograph.main([*TOY, "--out", str(tmp_path)])
    assert list(off) == ["ball, parallel", "ball, pinhole", "box, parallel", "box, pinhole"]
    assert max(off.values()) < 1e-5
    assert size_of(tmp_path / "radiograph.png") == (2 * 64 + 4, 48)


def test_chords_are_those_of_lines_known_by_heart():
    camera = atra.OrthographicCamera((0.25, 0.25, 5), (0.25, 0.25, 0), view_height=1.0, width=2, height=2)
    np.testing.assert_allclose(radiograph.chords_of_ball(camera, 1.0), 2 * np.sqrt([[0.75, 0.5], [1, 0.75]]))
    tilted = atra.OrthographicCamera((5, 0, 5), (0, 0, 0), view_height=1e-6, width=1, height=1)
    np.testing.assert_allclose(radiograph.chords_of_box(tilted, np.array([(-1, -1, -1), (1, 1, 1)])), np.sqrt(8))
    beside = atra.OrthographicCamera((7, 0, 5), (2.5, 0, -0.5), view_height=1e-6, width=1, height=1)
    np.testing.assert_array_equal(radiograph.chords_of_box(beside, np.array([(-1, -1, -1), (1, 1, 1)])), 0)


def test_light_is_weakened_by_the_law_of_beer_and_lambert():
    np.testing.assert_allclose(radiograph.transmitted(np.float32([0, 1, 2]), np.log(2)), [1, 0.5, 0.25], rtol=1e-6)


def test_panes_show_through_each_other_in_the_order_of_their_depth():
    assert transparency.check() < 1e-12
    depths = [low[2] for low, *_ in transparency.PANES]
    assert depths != sorted(depths)
    assert depths != sorted(depths, reverse=True)


def test_layers_are_kept_as_a_stack_and_let_through_their_product(tmp_path, capsys):
    layers = transparency.main([*TOY, "--out", str(tmp_path)])
    assert len(layers.depth) == layers.count.max() > 4
    assert float(capsys.readouterr().out.split("off the product by ")[1].split()[0]) < 1e-6
    with Image.open(tmp_path / "layers.tif") as stack:
        assert stack.n_frames == len(layers.depth)
        for page, depth in enumerate(layers.depth):
            stack.seek(page)
            np.testing.assert_array_equal(np.asarray(stack), depth)
    assert size_of(tmp_path / "transparency.png") == (64, 48)


def test_bodies_have_a_colour_each_that_is_darker_from_the_side():
    mesh = joined(solids.box(), atra.Mesh(solids.box().vertices + np.float32([0, 0, 3]), solids.box().faces))
    colours = transparency.colours_of_bodies(mesh, atra.Camera((0, 0, 9), (0, 0, 0)))
    shades = {tuple(colour) for colour in colours.round(6).tolist()}
    assert len(shades) == 4
    brightness = colours.sum(axis=1).reshape(2, 12)
    assert ((brightness == brightness.max(axis=1, keepdims=True)).sum(axis=1) == 4).all()


@pytest.mark.parametrize("cells", [9, 24])
def test_voxels_of_a_ball_are_its_cells_and_have_its_volume(cells):
    ball = solids.ball()
    pitch = voxels.pitch_of(ball, cells)
    found = voxels.fill(ball, pitch)
    assert voxels.wrong_cells(found, ball) == 0
    assert found.odd_columns == 0
    exact = 4 / 3 * np.pi
    assert abs(found.volume - exact) < 4 * np.pi * pitch / 2  # half a cell of its surface
    turned = voxels.Voxels(~found.cells, found.low, pitch)
    assert voxels.wrong_cells(turned, ball) > 0.9 * found.cells.size


@pytest.mark.parametrize("mesh", [solids.parcel(), cornell_boxes(), three_holes(9)], ids=lambda mesh: mesh.name)
def test_columns_along_x_y_and_z_find_the_same_cells_of_a_closed_mesh(mesh):
    pitch = voxels.pitch_of(mesh, 32)
    along = [voxels.fill(mesh, pitch, axis) for axis in (0, 1, 2)]
    for found in along:
        assert found.odd_columns == 0
        np.testing.assert_array_equal(found.cells, along[0].cells)
    assert along[0].cells.any()


def test_cells_lie_where_the_mesh_does_whichever_way_the_rays_go():
    low, high = np.array([(0.1, 1.2, -2.3), (1.4, 2.9, -0.2)])
    made = trimesh.creation.box(bounds=[low, high])
    for axis in (0, 1, 2):
        found = voxels.fill(atra.Mesh(made.vertices, made.faces), 0.25, axis)
        inside = ((found.centres > low) & (found.centres < high)).all(axis=-1)
        np.testing.assert_array_equal(found.cells, inside)


def test_an_open_mesh_has_odd_columns():
    ball = solids.ball(2)
    assert voxels.fill(atra.Mesh(ball.vertices, ball.faces[1:]), 0.02).odd_columns > 0


def test_trimesh_s_voxels_are_compared_cell_by_cell(tmp_path, capsys):
    found = voxels.main([*TOY, "--cells", "16", "--scene", "box", "--out", str(tmp_path)])
    assert list(found) == ["ball", "box"]
    for ours, theirs in found.values():
        assert theirs.cells.shape == ours.cells.shape
        assert (theirs.cells[ours.cells]).all()  # they take what the surface meets as well
        assert theirs.volume > ours.volume
    told = capsys.readouterr().out
    assert "parallel rays" in told
    assert "0 wrong by closed form" in told
    assert told.count("odd columns: 0") == 2
    ball, (_, theirs) = solids.ball(), found["ball"]
    assert voxels.wrong_cells(theirs, ball) > 0 == voxels.wrong_cells(theirs, ball, near=theirs.pitch)
    assert size_of(tmp_path / "voxels.png") == (64, 48)


def test_the_three_stand_side_by_side(tmp_path):
    all_hits.main([*TOY, "--out", str(tmp_path)])
    assert size_of(tmp_path / "all_hits.png") == (3 * 64 + 2 * 4, 48)
