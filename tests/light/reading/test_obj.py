"""Scenes from OBJ: coordinates, colours, images and materials that they keep, and what they name as left out."""

import warnings

import numpy as np
import pytest

from atra import light, load_mesh
from tests.light.reading.test_load_scene import png

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
PLACES = "".join(f"vt {k}e-1 0.5\n" for k in range(1, 6))
WOOD = "newmtl m\nmap_Kd wood.png\n"


def obj(folder, text, mtl=WOOD):
    """The scene, beside `wood.png`, of one grey, `up.png`, of normals, and `high.png`, of heights."""
    for name, texels in (("wood", (100, 100, 100)), ("up", (128, 128, 255))):
        (folder / f"{name}.png").write_bytes(png(np.full((2, 2, 3), texels, np.uint8)))
    (folder / "high.png").write_bytes(png(np.full((2, 2), 200, np.uint8)))
    (folder / "m.mtl").write_text(mtl)
    (folder / "m.obj").write_text("mtllib m.mtl\n" + text)
    return light.load_scene(folder / "m.obj")


def is_image(scene):
    """(F,): whether the colour of each face is an image."""
    return [isinstance(scene.materials[k].colour, light.Image) for k in scene.face_materials]


@pytest.mark.parametrize(("faces", "places", "told"), [
    ("usemtl m\nf 1/1 2/2 3/3\nf 1/5 3/3 4/4\n", [(0.1, 0.2, 0.3), (0.5, 0.3, 0.4)], None),
    ("usemtl m\nf 1/1 \\\n2/2 3/3\nf 1/5 3/3 4/4\n", [(0.1, 0.2, 0.3), (0.5, 0.3, 0.4)], None),
    ("f 1 2 3\nusemtl m\nf 1/1 2/2 4/3\n", [None, (0.1, 0.2, 0.3)], None),
    ("usemtl m\nf 1/1 2/1 3/1\nf 1/1 3/1 4/9\n", [(0.1, 0.1, 0.1), None],
     "1 corners name texture coordinates that the file has not"),
], ids=["each its own", "continued line", "the second part alone", "one that is not there"])  # fmt: skip
def test_each_corner_has_the_texture_coordinate_that_it_names_or_its_face_no_image(tmp_path, faces, places, told):
    with warnings.catch_warnings(record=True) as warned:
        scene = obj(tmp_path, SQUARE + PLACES + faces)
    assert (told is None and not warned) or told in str(warned[0].message)
    assert is_image(scene) == [place is not None for place in places]
    for face, place in zip(scene.mesh.faces, places, strict=True):
        if place is not None:
            np.testing.assert_allclose(scene.uv[face, 0], place, rtol=1e-6)
    expected = load_mesh(tmp_path / "m.obj")
    np.testing.assert_array_equal(scene.mesh.vertices[scene.mesh.faces], expected.vertices[expected.faces])


@pytest.mark.filterwarnings("ignore:.*not used")
def test_quads_keep_texture_coordinates_and_normals_and_flat_faces_stay_flat(tmp_path):
    text = SQUARE + "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0.6 0.8\nusemtl m\n"
    scene = obj(tmp_path, text + "f 1/1/1 2/2/1 3/3/1 4/4/1\nf -1 -2 -3 -4\n")
    assert is_image(scene) == [True, True, False, False]
    np.testing.assert_allclose(scene.normals[scene.mesh.faces[:2]], np.tile([0, 0.6, 0.8], (2, 3, 1)), rtol=1e-6)
    np.testing.assert_allclose(scene.normals[scene.mesh.faces[2:]], np.tile([0, 0, -1], (2, 3, 1)), rtol=1e-6)
    assert scene.materials[scene.face_materials[3]].colour == pytest.approx((0.7, 0.7, 0.7))
    assert scene.left_out == ("textures without texture coordinates",)


@pytest.mark.parametrize("most", [1, 255])
def test_colours_behind_all_vertices_are_srgb_and_colour_what_no_mtl_describes(tmp_path, most):
    text = f"v 0 0 0 {most} 0 0\nv 1 0 0 0 {0.5 * most} 0\nv 0 1 0 0 0 {most}\nv 0 0 1 0 0 0\nf 2 3 1\n"
    scene = obj(tmp_path, text)
    linear = ((0.5 + 0.055) / 1.055) ** 2.4
    by_corner = scene.colours[scene.mesh.faces[0]]
    assert by_corner == pytest.approx(np.array([[0, linear, 0, 1], [0, 0, 1, 1], [1, 0, 0, 1]]))
    assert scene.materials[0].colour == (1.0, 1.0, 1.0)
    of_some = obj(tmp_path, text.replace(f" 0 0 {most}\n", "\n"))
    assert of_some.colours is None
    assert of_some.materials[0].colour == (0.7, 0.7, 0.7)


@pytest.mark.parametrize("word", ["norm", "map_Bump", "bump"])
def test_an_image_of_normals_is_read_by_each_word_that_exporters_have_for_it_and_heights_are_named(tmp_path, word):
    text = SQUARE + PLACES + "usemtl m\nf 1/1 2/2 3/3\n"
    scene = obj(tmp_path, text, f"newmtl m\n{word} up.png\n")
    assert scene.materials[0].normals.texels[0, 0].tolist() == [128, 128, 255]
    assert scene.left_out == ()
    with pytest.warns(UserWarning, match="heights of bumps of MTL"):
        assert obj(tmp_path, text, "newmtl m\nmap_bump high.png\n").materials[0].normals is None


def test_materials_come_with_their_colours_and_textures_and_what_they_say_in_vain_is_named(tmp_path):
    text = SQUARE + PLACES + "".join(f"usemtl {name}\nf 1/1 2/2 3/3\n" for name in ("wood", "lamp", "glass", "x"))
    mtl = (
        "newmtl wood\nKd 0.5 0.5 0.5\nmap_Kd wood.png\nPr 0.3\nTf 1 0.5 0\nNs 250\nKs 0.5 0.5 0.5\n"
        "newmtl lamp\nKe 4 3 2\nKd 0 0 0\nrefl x.png\nKa 1 1 1\nnewmtl glass\nillum 7\nKd 0 0 0\nTf 1 0.5 0\n"
    )
    with pytest.warns(UserWarning, match="material 'x', which no MTL describes"):
        scene = obj(tmp_path, text, mtl)
    assert {f"{word} of MTL" for word in ("refl", "Ks", "Tf", "Ka")} < set(scene.left_out)
    wood, lamp, glass, _ = (scene.materials[k] for k in scene.face_materials)
    assert [one.name for one in (wood, lamp, glass)] == ["wood", "lamp", "glass"]
    assert (wood.roughness, wood.colour.factor) == (0.3, (0.5, 0.5, 0.5, 1.0))
    assert lamp.emission == (4.0, 3.0, 2.0)
    assert (glass.colour, glass.transmission) == ((1.0, 0.5, 0.0), 1.0)


def test_paths_of_its_author_s_machine_lead_to_the_files_beside_it(tmp_path):
    text = SQUARE + PLACES + "usemtl m\nf 1/1 2/1 3/1\n"
    assert is_image(obj(tmp_path, text, "newmtl m\nmap_Kd C:\\art\\wood.png\n")) == [True]
    (tmp_path.parent / "stone.png").write_bytes(png(np.full((2, 2, 3), 100, np.uint8)))
    with pytest.warns(UserWarning, match=r"image '\.\./stone\.png', because it names 'stone\.png', which is no file"):
        scene = obj(tmp_path, text, "newmtl m\nmap_Kd ../stone.png\n")
    assert scene.materials[0].colour == pytest.approx((0.7, 0.7, 0.7))
