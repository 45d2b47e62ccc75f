"""A model's file named to a verb of the harness without a field, as `atra render model.glb` takes it."""

import pytest

from atra.errors import InputError
from experiments.commands.model_files import take_model_file
from tests.command import run_here


def test_a_file_stands_for_the_scene_of_that_file(tmp_path):
    path = tmp_path / "it's mine.ply"
    path.touch()
    quoted = str(path).replace("'", "\\'")
    assert take_model_file(["action=view", str(path), "view.tone=agx"]) == [
        "action=view", "scene=file", f"scene.path='{quoted}'", "view.tone=agx",
    ]  # fmt: skip


def test_fields_and_flags_are_left_alone():
    given = ["action=bake", "scene=sponza", "--multirun", "~sweep.x", "scene.path=a.glb"]
    assert take_model_file(given) == given


def test_a_file_that_is_not_there_is_told_in_plain_words(tmp_path):
    with pytest.raises(InputError, match=r"there is no file 'modle\.glb'"):
        take_model_file(["action=view", "modle.glb"])
    done = run_here(tmp_path, "view", "modle.glb")
    assert done.returncode == 2
    assert "there is no file 'modle.glb'" in done.stderr


def test_hydra_reads_a_quoted_name_as_it_was_given(tmp_path):
    from hydra.core.override_parser.overrides_parser import OverridesParser

    path = tmp_path / "it's (mine), really.ply"
    path.touch()
    (override,) = OverridesParser.create().parse_overrides(take_model_file([str(path)])[1:])
    assert override.value() == str(path)
