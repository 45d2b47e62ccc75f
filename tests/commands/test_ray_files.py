"""Files of rays: their digests are those that are kept, and what they hold is what their kinds say."""

import csv

import numpy as np
import pytest

from atra.errors import InputError
from experiments.commands.ray_files import KINDS, digest_of, run_rays
from tests.folders import ROOT

KEPT = ROOT / "reports" / "reference" / "rays.csv"


def test_files_of_a_scene_have_the_digests_that_are_kept(tmp_path):
    *paths, table = run_rays(["cornell_box", "size=small", f"output={tmp_path}"])
    assert [path.name for path in paths] == [f"cornell_box_{kind}_small.npz" for kind in KINDS]
    kept = {(row["scene"], row["kind"], row["size"]): row for row in csv.DictReader(KEPT.open(encoding="utf-8"))}
    for row in csv.DictReader(table.open(encoding="utf-8")):
        assert row == kept[row["scene"], row["kind"], row["size"]]
    rays = dict(np.load(paths[KINDS.index("shadow")]))
    assert set(rays["tfar"]) == {1.0}
    lamp = rays["origins"] + rays["directions"]
    assert np.ptp(lamp, axis=0).max() < 1e-5
    assert len(set(map(tuple, np.load(paths[KINDS.index("parallel")])["directions"]))) == 1


def test_the_list_that_is_kept_has_every_kind_and_size_of_built_in_and_generated_scenes():
    rows = list(csv.DictReader(KEPT.open(encoding="utf-8")))
    per_scene = {
        scene: [row for row in rows if row["scene"] == scene] for scene in dict.fromkeys(r["scene"] for r in rows)
    }
    assert {"cornell_box", "atrium", "terrain_100000", "soup_100000"} <= set(per_scene)
    for of_scene in per_scene.values():
        assert {row["kind"] for row in of_scene} == set(KINDS)
        assert {row["size"] for row in of_scene} == {"small", "middle", "large"}
        assert all(float(row["crossed"]) > 0 and float(row["boxes"]) > 0 for row in of_scene)


@pytest.mark.parametrize("arguments", [[], ["size=small"], ["cornell_box", "size=huge"], ["cornell_box", "kind=all"]])
def test_other_arguments_are_refused(arguments):
    with pytest.raises(InputError, match="expected: "):
        run_rays(arguments)


def test_the_digest_is_of_all_four_arrays():
    from atra import Rays

    one = Rays(np.zeros((2, 3)), np.ones((2, 3)))
    assert digest_of(one) != digest_of(Rays(np.zeros((2, 3)), np.ones((2, 3)), tfar=1.0))
