"""Candidates for the paper's 7.50, from tables made up so that every gain is known."""

import pytest

from atra.errors import InputError
from experiments.studies.candidates import ASKED_FOR, candidates
from tests.report_samples import table_of

USUAL = {
    "scene": "cornell_box", "view": "own", "eye": "0, 0.8, 2.3", "threads": 1, "build_quality": "medium",
    "instruction_set": "none", "robust": False, "workload": "frame", "status": "ok",
}  # fmt: skip
SCATTER = (0.999, 1.0, 1.001)


def point(speedup, split=None, **fields):
    """Rows of three processes. split: columns, without one it is of rays per pixel; fields: what is unusual."""
    cells = {"method": "pixel"} if split is None else {"method": "aligned", "split_x": split, "split_y": 1}
    times = {"baseline_render_time_s": 1.0, "render_time_s": 1.0 / speedup, "plan_time_s": 0.5, "build_time_s": 0.25}
    built = {"baseline_build_time_s": 0.25}
    one = {"culling": True, "packet_width": 1} | cells | times | built
    name = repr((speedup, split, fields))
    return [{**USUAL, **one, "speedup": speedup * by, "point_id": name, **fields} for by in SCATTER]


def point_of_packets(speedup, split=None, **fields):
    return [row | {"speedup_vs_packets": row["speedup"]} for row in point(speedup, split, packet_width=16, **fields)]


def group(fast, slow, plain, **fields):
    """Two splits with culling, and one cell without."""
    return [*point(slow, 128, **fields), *point(fast, 512, **fields), *point(plain, 1, culling=False, **fields)]


def found(*rows):
    return {one.name: one for one in candidates(table_of([row for some in rows for row in some]))}


def values(one):
    return [None if gain is None else round(gain.estimate.value, 2) for gain in (one.nearest, one.all_hits)]


OTHERS = (group(1.9, 1.4, 0.5, build_quality="low"), group(1.8, 1.4, 0.5, view="corner", eye="5, 5, 5"))


def test_a_gain_is_that_of_the_best_split_over_both_kinds_of_1_x_1():
    usual = found(group(2.0, 1.5, 0.5), *OTHERS)["usual"]
    assert values(usual) == [2.0, 4.0]
    assert usual.nearest.split.startswith("512")


def test_each_group_that_differs_in_one_setting_is_a_candidate_named_by_it():
    names = list(found(group(2.0, 1.5, 0.5), *OTHERS, group(2.0, 1.5, 0.5, instruction_set="sse4.2")))
    told = ["usual", "low build quality", "view `corner`", "instructions up to sse4.2"]
    assert names == [*told, "plan and build included"]


def test_robust_rays_are_held_against_robust_rays():
    robust = found(group(2.0, 1.5, 0.5), *OTHERS, group(1.6, 1.2, 0.4, robust=True), point(0.8, robust=True))
    assert values(robust["robust rays"]) == [2.0, 4.0]


def test_plan_and_build_are_added_on_both_sides():
    assert values(found(group(2.0, 1.5, 0.5), *OTHERS)["plan and build included"])[0] == pytest.approx(1.0)


def test_rays_per_pixel_without_the_flag_are_what_gains_are_over():
    packets = point_of_packets(0.5, coherent=False), point_of_packets(1.2, 512)
    told = found(group(2.0, 1.5, 0.5), *OTHERS, point(1.0, coherent=False), *packets)
    single, wide = (one for name, one in told.items() if "without the flag" in name)
    assert (values(single), values(wide)) == ([2.0, None], [2.4, None])


@pytest.mark.parametrize(("fast", "verdict"), [(3.0, "no"), (2 * ASKED_FOR, "yes"), (ASKED_FOR, "undecided")])
def test_a_candidate_reaches_the_papers_gain_only_with_its_whole_interval(fast, verdict):
    assert found(group(fast, 1.5, 2.0), *OTHERS)["usual"].reaches == verdict


def test_a_table_without_the_usual_point_is_refused():
    with pytest.raises(InputError, match="usual settings"):
        found(group(2, 1, 1, threads=2), group(2, 1, 1, build_quality="low"), group(2, 1, 1, view="corner"))
    with pytest.raises(InputError, match="expected aligned single rays"):
        found(point(1.0))
