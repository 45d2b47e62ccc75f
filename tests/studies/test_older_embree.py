"""The paper's gain by an older Embree: from a table whose gains are known, and by a libembree3 where there is one."""

import ctypes.util

import pandas as pd
import pytest

from atra.errors import EmbreeError
from experiments.studies.older_embree import ALL_HITS, NEAREST, SPLITS, gains, measure

LIBRARY = ctypes.util.find_library("embree3")


def test_the_best_split_is_chosen_on_some_processes_and_its_gain_reported_of_the_others():
    ratios = {f"{name}_over_{split}": [1.0] * 5 for name in (NEAREST, ALL_HITS) for split in SPLITS}
    ratios[f"{NEAREST}_over_256"] = [4.0, 4.0, 2.0, 2.0, 2.0]
    ratios[f"{ALL_HITS}_over_512"] = [3.0, 3.0, 3.0, 3.0, 3.0]
    found = gains(pd.DataFrame(ratios))
    assert {name: (split, round(gain.value, 6)) for name, (split, gain) in found.items()} == {
        NEAREST: (256, 2.0),
        ALL_HITS: (512, 3.0),
    }


def test_a_file_that_is_no_embree_is_refused_by_name():
    with pytest.raises(EmbreeError, match=r"no_such_library.*is no usable libembree3"):
        measure("no_such_library", rounds=1)


@pytest.mark.skipif(LIBRARY is None, reason="needs libembree3, such as Debian's package libembree3-3")
def test_aligned_rays_of_embree_3_have_no_wrong_pixel():
    found = measure(LIBRARY, rounds=1)
    assert found["embree_version"].startswith("3.")
    assert found["pixels_wrong"] == 0
    assert all(found[f"{NEAREST}_over_{split}"] > 0 for split in SPLITS)
