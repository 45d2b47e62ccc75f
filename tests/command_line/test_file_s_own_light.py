"""Pictures, bakes and views begin with the camera and the lights of their file."""

import json
from argparse import Namespace
from pathlib import Path

import numpy as np
import pytest
import trimesh

import atra
from atra import InputError, light
from atra.command.cameras import chosen_cameras, one_camera
from atra.command.picture import load_lit
from tests.light.reading.test_load_scene import tree


@pytest.fixture
def room(tmp_path):
    """A file with two cameras, a sun of 3,000 lux and a lamp of 15 candela."""
    lights = [{"type": "directional", "intensity": 3e3}, {"type": "point", "intensity": 15.0}]
    given = tree(
        cameras=[{"type": "perspective", "perspective": {"yfov": 0.5, "aspectRatio": 2.0}}],
        extensions={"KHR_lights_punctual": {"lights": lights}},
        nodes=[{"mesh": 0}, {"camera": 0, "name": "door"}, {"camera": 0, "name": "window"},
               *({"extensions": {"KHR_lights_punctual": {"light": k}}} for k in range(2))],
        scenes=[{"nodes": [0, 1, 2, 3, 4]}],
    )  # fmt: skip
    path = tmp_path / "room.gltf"
    path.write_text(json.dumps(given))
    return path


def test_the_first_camera_of_a_file_is_the_one_that_looks_and_a_side_is_named_to_frame_it(room):
    scene = load_lit(room)
    given = Namespace(camera=None, mesh=room, size=None, memory_per_byte=None)
    assert chosen_cameras(given, scene.mesh, scene.cameras, {}) == {"room": scene.cameras["door"]}
    assert one_camera(given, scene.mesh, scene.cameras) == scene.cameras["door"]
    framed = chosen_cameras(Namespace(**{**vars(given), "camera": "front"}), scene.mesh, scene.cameras, {})
    assert framed["front"] != scene.cameras["door"]
    (small,) = chosen_cameras(Namespace(**{**vars(given), "size": [20, 10]}), scene.mesh, scene.cameras, {}).values()
    assert (small.width, small.height, small.eye) == (20, 10, scene.cameras["door"].eye)


@pytest.mark.parametrize("normal", [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1), (2, 0, -1)])
def test_a_plane_is_framed_from_a_side_where_its_front_is_seen(normal):
    across = np.cross(normal, (0.3, 0.5, 0.7))
    square = np.array([across, np.cross(normal, across), -across, -np.cross(normal, across)])
    mesh = atra.Mesh(square, [(0, 1, 2), (0, 2, 3)])
    given = Namespace(camera=None, mesh=Path("plane.glb"), size=None)
    (camera,) = chosen_cameras(given, mesh, {}, {}).values()
    to_eye = np.subtract(camera.eye, camera.target)
    assert to_eye @ normal > 0.3 * np.linalg.norm(to_eye) * np.linalg.norm(normal)


def test_a_closed_mesh_is_framed_from_the_front_and_above(room):
    made = trimesh.creation.box((1, 0.01, 2))
    box = atra.Mesh(made.vertices, made.faces)
    (camera,) = chosen_cameras(Namespace(camera=None, mesh=room, size=None), box, {}, {}).values()
    assert camera == atra.Camera.framing(box)


def test_the_sky_of_a_program_is_that_of_the_library_and_can_be_chosen_beside_lights(room):
    dark, neutral = light.constant_sky(0.0), light.GradientSky((0.45,) * 3, (1.1,) * 3)
    assert load_lit(room).sky == light.load_scene(room).sky == load_lit(room, "none").sky == dark
    assert load_lit(room, "neutral").sky == neutral
    tree_without = json.loads(room.read_text()) | {"scenes": [{"nodes": [0]}]}
    room.write_text(json.dumps(tree_without))
    assert load_lit(room).sky == light.load_scene(room).sky == neutral
    with pytest.raises(InputError, match="bright"):
        load_lit(room, "bright")


def test_a_light_that_hardly_shows_beside_another_is_hinted_at(room, capsys):
    load_lit(room)
    hint = "hint: light 0 (Sun) is 400 times as bright as light 1 (PointLight), which hardly shows beside it\n"
    assert capsys.readouterr().err == hint  # the lamp is as far as the scene is large, the root of 2
    room.write_text(room.read_text().replace("3000.0", "300.0"))
    load_lit(room)
    assert capsys.readouterr().err == ""
