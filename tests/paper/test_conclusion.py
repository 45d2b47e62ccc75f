"""The conclusion and the best gains, on tables whose every verdict is known."""

import pytest

from experiments.paper.claims import judge_claims
from experiments.paper.conclusion import conclude, scene_gains
from experiments.report.facts import stand_ins
from experiments.results.statistics import NotMeasuredError
from tests.paper_table import BEST, agreeing_table, scaled, skipped

SINGLE = {"workload": "frame", "packet_width": 1}


@pytest.fixture(scope="module")
def agreeing():
    return agreeing_table()


def concluded(table):
    """Its sentences."""
    try:
        gains = scene_gains(table)
    except NotMeasuredError:
        gains = ()
    text = conclude(judge_claims(table), gains, [] if table is None else stand_ins(table).values())
    return [f"{sentence.rstrip('.')}." for sentence in text.split(". ")]


def test_gains_are_the_best_of_each_scene_beside_the_paper_s_and_packets_stand_apart(agreeing):
    halved = scaled(agreeing, 0.5, **SINGLE, scene="sponza")
    cornell, *_, sponza = scene_gains(halved)
    assert (cornell.paper, sponza.paper, sponza.triangles) == (7.5, 1.71, 262267)
    values = [found.estimate.value for found in (*sponza.single.values(), *sponza.packets.values())]
    assert values == pytest.approx([factor * BEST["sponza"] for factor in (0.5, 1, 1, 1, 2)], rel=0.005)
    assert (sponza.packet_width, sponza.single["all hits"].splits) == (8, 1024)


def test_gains_where_every_hit_is_wanted_are_over_what_gathers_the_same(agreeing):
    frames = agreeing[agreeing["workload"] == "frame"]
    *_, sponza = scene_gains(scaled(frames.assign(workload="gather", what="count"), 0.5, scene="sponza"))
    assert [found.estimate.value for found in sponza.single.values()] == pytest.approx([BEST["sponza"]], rel=0.005)
    packets = [found.estimate.value for found in sponza.packets.values()]
    assert packets == pytest.approx([BEST["sponza"], BEST["sponza"]], rel=0.005)


def test_what_is_not_the_paper_s_scene_or_size_has_no_number_of_the_paper_beside_it(agreeing):
    atrium = agreeing_table(("sponza",)).assign(scene="atrium", stands_for="sponza")
    (one,) = scene_gains(atrium)
    assert (one.scene.measured, one.scene.stand_in, one.paper) == ("atrium", True, None)
    assert {(small.paper, small.scene.stand_in) for small in scene_gains(agreeing.assign(width=64, height=64))} == {
        (None, False)
    }


def test_a_split_that_was_skipped_may_have_been_better_and_too_few_processes_have_no_best(agreeing):
    (one,) = scene_gains(skipped(agreeing_table(("sponza",)), **SINGLE, culling=True, split_x=1024, split_y=1))
    found = one.single["nearest hit"]
    assert found.splits == 512
    assert "needs 9 GiB" in found.missing
    with pytest.raises(NotMeasuredError, match="0 processes, at least 3 are needed"):
        scene_gains(agreeing[agreeing["process"].fillna(0) < 1])


def test_the_conclusion_is_two_sentences_that_count_verdicts(agreeing):
    table = scaled(agreeing, 0.5, **SINGLE, scene="sponza")
    speed, others = concluded(table)
    assert speed == (
        "The paper's best speed-ups, 1.71 to 7.50, are reached on 3 of 4 scenes over rays that look for the nearest "
        "hit alone (0.88 to 7.61 here), and on 4 of 4 scenes over rays that gather all hits (1.75 to 7.61 here)."
    )
    assert others == (
        "Of its 25 other claims 18 hold, 3 hold under one reading of its baseline only, 1 does not hold and 3 were not "
        "measured."
    )


def test_what_noise_leaves_open_and_what_is_missing_is_said(agreeing):
    noise = agreeing["process"].map({0: 0.8, 1: 1.25, 2: 1.0, 3: 0.8, 4: 1.25})
    noisy = agreeing.assign(speedup=agreeing["speedup"] * noise.where(agreeing["scene"] == "mitsuba", 1.0))
    speed, others = concluded(noisy[noisy["scene"] != "sponza"])
    assert speed.count("on 2 of 4 scenes") == speed.count("; undecided on 1; not measured on 1)") == 2
    assert "were not measured" in others


def test_little_measured_is_a_conclusion_too(agreeing):
    nothing = [
        "No speed-up was measured that is to be held against the paper's.",
        "None of its other claims was measured.",
    ]
    assert concluded(None) == concluded(agreeing.iloc[:0]) == nothing
    speed, others = concluded(agreeing.assign(stands_for=agreeing["scene"], scene=agreeing["scene"] + "_like"))
    assert speed == nothing[0]
    assert others.startswith(
        "Of its 25 other claims, judged on stand-ins for cornell_box, mitsuba, fireplace_room and sponza, 20 hold"
    )
