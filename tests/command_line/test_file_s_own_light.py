"""Pictures, bakes and views begin with the camera and the lights of their file."""

import json
from argparse import Namespace

import pytest

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
