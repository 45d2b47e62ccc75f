"""The paper's claims, on tables small enough to know every verdict: one number flips it."""

import json
import math
import re
from io import BytesIO

import pandas as pd
import pytest

from experiments.paper.claims import CLAIMS, judge_claims, paper_judges
from experiments.paper.evidence import PAPER_SCENES, USED_COLUMNS, collect_scenes
from experiments.paper.readings import EVERY_HIT
from experiments.results.claims import JudgedClaim, claim_files, judge_claim
from experiments.results.table import columns
from tests.paper_table import agreeing_rows, agreeing_table, longer_build, more_bytes, scaled, skipped, where
from tests.report_samples import table_of

STAND_INS = {"mitsuba": "material_ball", "fireplace_room": "living_room", "sponza": "atrium"}
IMPOSSIBLE_TOGETHER = {"cost-model", "nearest-alone-may-lose"}
"""Times that follow log(N_p) N_r fall without end, so no table can confirm it beside a minimum of time; and who
gains as much as in the paper does not lose."""

NO_NUMBER = {"easy-to-implement", "no-early-end", "stereo-and-frames"}
"""Sentences that no table can judge."""


@pytest.fixture(scope="module")
def agreeing():
    return agreeing_table()


def finding(table, claim_id, reading=None):
    """Under one reading; None: under the last of a frame, where the paper's 1 x 1 gathers all hits."""
    judged = judge_claim(next(claim for claim in CLAIMS if claim.id == claim_id), lambda: collect_scenes(table))
    return next(
        claim
        for claim in reversed(judged)
        if claim.reading == reading or (reading is None and claim.reading != EVERY_HIT.name)
    )


def where_every_hit_is_wanted(table):
    """The rows of frames, as if their hits had been gathered."""
    return table[table["workload"] == "frame"].assign(workload="gather", what="count")


def not_measured(table, claim_id, why):
    """The finding, which must be that nothing was measured, for this reason."""
    judged = finding(table, claim_id)
    assert judged.verdict == "not measured"
    assert why in judged.why
    return judged


def verdict(table, claim_id):
    return finding(table, claim_id).verdict


def test_every_claim_holds_on_a_table_that_agrees_with_the_paper_and_any_other_verdict_has_a_reason(agreeing):
    verdicts = {(claim.id, claim.reading): claim.verdict for claim in judge_claims(agreeing)}
    assert {name for (name, _), verdict in verdicts.items() if verdict != "holds"} == IMPOSSIBLE_TOGETHER | NO_NUMBER
    assert {verdicts["cost-model", ""], verdicts["nearest-alone-may-lose", "nearest hit"]} == {"does not hold"}
    for claim in (*judge_claims(agreeing), *judge_claims(agreeing_table(("sponza",)))):
        assert bool(claim.why) is (claim.verdict != "holds"), claim
        assert "\n" not in (claim.why or "")


SINGLE = {"workload": "frame", "packet_width": 1, "scene": "sponza"}
FLIPS = {
    "one-axis-beats-both": lambda t: scaled(t, 1.5, **SINGLE, split_x=16, split_y=16),
    "one-axis-beats-both-of-as-many-cells": lambda t: scaled(t, 1.5, **SINGLE, split_x=4, split_y=2),
    "culling-saves-memory": lambda t: scaled(t, 9, "embree_bytes", **SINGLE, split_x=2, culling=True),
    "any-divisor-works": lambda t: t.assign(
        pixels_wrong=t["pixels_wrong"].where(~where(t, **SINGLE, split_x=2, split_y=1, culling=True), 1)
    ),
    "axes-differ-little": lambda t: scaled(t, 1.5, **SINGLE, split_x=8, split_y=1, culling=True),
    "horizontal-slightly-better": lambda t: scaled(t, 2, **SINGLE, split_x=1, split_y=4),
    "culling-off-slows-again": lambda t: scaled(t, 3, **SINGLE, split_x=1024, culling=False),
    "culling-accelerates": lambda t: scaled(t, 0.4, **SINGLE, culling=True),
    "culling-off-few-splits-gain": lambda t: scaled(t, 2, **SINGLE, split_x=1, split_y=1, culling=False),
    "culling-on-keeps-gaining": lambda t: scaled(t, 0.9, **SINGLE, split_x=1024, culling=True),
    "best-speedup-sponza": lambda t: scaled(t, 0.9, **SINGLE, culling=True),
    "build-grows": lambda t: scaled(t, 0.4, "build_over_plain", workload="build", scene="sponza", split_x=1024),
    "overlap-lowers-quality": lambda t: scaled(
        t, 0.01, "boxes_entered", workload="build", scene="sponza", split_x=1024, culling=False
    ),
    "memory-grows": lambda t: scaled(t, 0.4, "embree_bytes", workload="memory", scene="sponza", split_x=1024),
    "build-little-affected-to-16": lambda t: longer_build(t, "sponza", 8),
    "memory-little-affected-to-16": lambda t: more_bytes(t, "sponza", 8),
    "image-without-error": lambda t: t.assign(
        pixels_wrong=t["pixels_wrong"].where(~where(t, **SINGLE, split_x=2, split_y=2), 1)
    ),
    "instancing-lowers-memory": lambda t: more_bytes(t, "sponza", 8, geometry="instanced", culling=False),
    "instancing-lowers-memory-culling-off": lambda t: more_bytes(t, "sponza", 8, geometry="instanced", culling=False),
    "larger-scenes-gain-less": lambda t: scaled(t, 2, **SINGLE, split_x=1024, culling=True),
}  # fmt: skip


@pytest.mark.parametrize("claim_id", FLIPS)
def test_one_number_of_one_scene_refutes_the_claim_and_the_finding_names_the_scene(agreeing, claim_id):
    judged = finding(FLIPS[claim_id](agreeing), claim_id)
    assert judged.verdict == "does not hold"
    if "best-speedup" not in claim_id:
        assert "sponza" in judged.why
        assert "mitsuba: " not in judged.why
        assert "mitsuba: " in judged.value


SOME = {
    "culling-off-falls-below-start": lambda t, scene: scaled(
        t, 0.4, workload="frame", packet_width=1, scene=scene, split_x=1, split_y=1, culling=False
    ),
    "build-little-affected-to-64": lambda t, scene: longer_build(t, scene, 64),
    "memory-little-affected-to-64": lambda t, scene: more_bytes(t, scene, 64),
}  # fmt: skip


@pytest.mark.parametrize("claim_id", SOME)
def test_a_claim_about_some_scene_fails_only_when_the_last_scene_fails(agreeing, claim_id):
    table = agreeing
    for scene in list(PAPER_SCENES)[:3]:
        table = SOME[claim_id](table, scene)
        assert verdict(table, claim_id) == "holds"
    assert verdict(SOME[claim_id](table, "sponza"), claim_id) == "does not hold"
    assert verdict(table[~where(table, scene="sponza")], claim_id) == "not measured"


def test_every_claim_but_the_cost_model_is_flipped_above_best_speedups_on_one_scene():
    left = {claim.id for claim in CLAIMS} - FLIPS.keys() - SOME.keys() - IMPOSSIBLE_TOGETHER - NO_NUMBER
    assert left == {f"best-speedup-{scene}" for scene in list(PAPER_SCENES)[:3]}


def test_a_key_that_no_judge_has_is_refused_by_name():
    with pytest.raises(ValueError, match=r"a judge has \['most'\], expected some of \['above'"):
        paper_judges({"numerator": {}, "denominator": {}, "at": [2], "most": 1})


def follow_model(table, exponent):
    table = table.copy()
    chosen = where(table, workload="frame", packet_width=1, culling=False)
    model = table["triangles_traced"].astype("Float64").map(math.log, na_action="ignore") / table["split_x"]
    table.loc[chosen, "speedup"] = (1 / model[chosen]) ** exponent
    return table


def test_the_cost_model_holds_for_exponent_one_fails_for_a_half_and_needs_five_points(agreeing):
    table = follow_model(agreeing, 1)
    judged = finding(table, "cost-model")
    assert judged.verdict == "holds"
    assert "sponza: exponent 1.00, R2 1.00, 11 points" in judged.value
    assert verdict(follow_model(agreeing, 0.5), "cost-model") == "does not hold"
    large = (table["split_x"] > 8) & where(table, scene="sponza", workload="frame", culling=False)
    not_measured(table[~large], "cost-model", "4 points, 5 are needed")


def test_without_numbers_nothing_holds_and_nothing_fails(agreeing):
    sponza = agreeing_rows("sponza")
    skipped_rows = table_of([{**row, "status": "skipped", "error": "needs 9 GiB"} for row in sponza])
    others = table_of([{**row, "scene": "somebody's own"} for row in sponza])
    for table in (None, pd.DataFrame(), table_of([]), skipped_rows, agreeing[["scene", "split_x"]], others):
        findings = judge_claims(table)
        assert list(dict.fromkeys(claim.id for claim in findings)) == [claim.id for claim in CLAIMS]
        assert {claim.verdict for claim in findings} == {"not measured"}
        assert all(claim.why for claim in findings)


@pytest.mark.parametrize("column", [
    "speedup",
    *(pytest.param(name, marks=pytest.mark.slow) for name in ("build_over_plain", "embree_bytes", "pixels_wrong")),
])  # fmt: skip
def test_a_missing_column_leaves_its_claims_not_measured_and_the_others_as_they_were(agreeing, column):
    before = {(claim.id, claim.reading): claim.verdict for claim in judge_claims(agreeing)}
    after = {(claim.id, claim.reading): claim.verdict for claim in judge_claims(agreeing.drop(columns=column))}
    changed = {key for key in before if before[key] != after[key]}
    assert changed
    assert {after[key] for key in changed} == {"not measured"}
    concerned = {"build_over_plain": "build", "embree_bytes": "memory", "pixels_wrong": "image|divisor"}
    if column in concerned:
        assert all(re.search(concerned[column], claim_id) for claim_id, _ in changed)


def test_holes_are_wrong_pixels_and_are_told_with_whose_rays_they_are(agreeing):
    chosen = where(agreeing, **SINGLE, split_x=2, split_y=1, culling=True)
    counts = {"pixels_wrong": 3, "pixels_hole": 1, "baseline_pixels_hole": 2}
    table = agreeing.assign(**{name: chosen.astype("int64") * count for name, count in counts.items()})
    judged = finding(table, "any-divisor-works")
    assert judged.verdict == "does not hold"
    assert "3 pixels wrong at 2 splits (holes between triangles: 1 of aligned rays, 2 of rtcIntersect1)" in judged.why
    assert "(holes between triangles: " in finding(table, "image-without-error").why


def test_a_missing_scene_leaves_a_claim_not_measured_unless_another_scene_refutes_it(agreeing):
    without = agreeing[~where(agreeing, scene="mitsuba")]
    assert "sponza: 1.04" in not_measured(without, "one-axis-beats-both", "mitsuba").value
    assert verdict(FLIPS["one-axis-beats-both"](without), "one-axis-beats-both") == "does not hold"


def test_an_interval_wider_than_the_difference_leaves_the_claim_undecided_if_every_scene_was_measured(agreeing):
    noise = agreeing["process"].map({0: 0.8, 1: 1.25, 2: 1.0, 3: 0.8, 4: 1.25})
    table = agreeing.assign(speedup=agreeing["speedup"] * noise)
    judged = finding(table, "one-axis-beats-both")
    assert judged.verdict == "undecided"
    assert "wider than the difference" in judged.why
    assert judged.interval is not None
    judged = finding(table[~where(table, scene="mitsuba")], "one-axis-beats-both")
    assert judged.verdict == "not measured"
    assert re.search(r"sponza: [^;]*\(undecided\)", judged.value)
    assert "mitsuba: - (not measured)" in judged.value


def test_more_splits_count_as_slower_only_when_the_whole_interval_says_so(agreeing):
    at_last = {**SINGLE, "split_x": 1024, "culling": True}
    slower = scaled(agreeing, 0.9, **at_last)
    assert verdict(scaled(agreeing, 0.99, **at_last), "culling-on-keeps-gaining") == "holds"
    assert verdict(slower, "culling-on-keeps-gaining") == "does not hold"
    noisy = scaled(slower, 1.2, **at_last, process=4)
    assert verdict(noisy, "culling-on-keeps-gaining") == "undecided"


def test_what_is_chosen_as_best_is_not_reported_by_the_processes_it_was_chosen_by(agreeing):
    lucky = {**SINGLE, "split_x": 64, "culling": True}
    for process in (0, 1):
        lucky_table = agreeing = scaled(agreeing, 1.5, **lucky, process=process)
    assert finding(lucky_table, "best-speedup-sponza").value == "1.52 at 64 x 1"


def test_single_processes_decide_nothing_and_few_borrow_the_variance_of_all_points(agreeing):
    alone = agreeing[agreeing["process"] < 1]
    not_measured(alone, "axes-differ-little", "1 processes, at least 3 are needed")
    not_measured(alone, "best-speedup-sponza", "0 processes, at least 3 are needed")
    assert verdict(agreeing[agreeing["process"] < 2], "axes-differ-little") == "holds"
    few = agreeing[(agreeing["process"] < 1) | ~where(agreeing, **SINGLE, split_x=8, split_y=1, culling=True)]
    assert verdict(few, "axes-differ-little") == "holds"


def test_the_two_readings_differ_by_what_gathering_all_hits_costs_at_one_split(agreeing):
    table = scaled(agreeing, 0.5, **SINGLE)
    nearest, gathering = (finding(table, "best-speedup-sponza", reading) for reading in ("nearest hit", "all hits"))
    assert (nearest.verdict, gathering.verdict) == ("does not hold", "holds")
    assert (nearest.value, gathering.value) == ("0.88 at 1,024 x 1", "1.75 at 1,024 x 1")
    assert verdict(table, "nearest-alone-may-lose") == "holds"


def test_where_every_hit_is_wanted_the_claims_on_speed_are_judged_by_themselves(agreeing):
    gathered = where_every_hit_is_wanted(agreeing)
    judged = {claim.id: claim for claim in judge_claims(gathered)}
    assert {claim.reading for claim in judged.values()} == {EVERY_HIT.name}
    assert {name for name, claim in judged.items() if claim.verdict != "holds"} == {"cost-model"}
    assert judged["best-speedup-sponza"].value == "1.75 at 1,024 x 1"
    slower = scaled(gathered, 0.5, culling=True, packet_width=1)
    assert next(claim.verdict for claim in judge_claims(slower) if claim.id == "best-speedup-sponza") == "does not hold"


def test_a_table_of_frames_alone_is_not_asked_what_is_so_where_every_hit_is_wanted(agreeing):
    assert EVERY_HIT.name not in {claim.reading for claim in judge_claims(agreeing)}
    both = pd.concat([agreeing, where_every_hit_is_wanted(agreeing).assign(point_id=lambda rows: rows.point_id + "g")])
    assert {claim.verdict for claim in judge_claims(both) if claim.id.startswith("best-speedup")} == {"holds"}
    layers = both.assign(what=both["what"].mask(both["workload"] == "gather", "layers"))
    assert finding(layers, "best-speedup-sponza", EVERY_HIT.name).verdict == "not measured"


def test_a_skipped_point_leaves_open_what_it_could_have_decided_and_its_reason_is_told(agreeing):
    on = {**SINGLE, "culling": True, "split_y": 1}
    below = scaled(agreeing, 0.9, **on)
    not_measured(skipped(below, **on, split_x=512), "best-speedup-sponza", "needs 9 GiB")
    assert verdict(skipped(agreeing, **on, split_x=512), "best-speedup-sponza") == "holds"
    assert verdict(skipped(agreeing, **on, split_x=512), "culling-on-keeps-gaining") == "not measured"


def test_a_finding_tells_what_explains_it(agreeing):
    nothing_built = finding(agreeing[~where(agreeing, workload="build")], "build-little-affected-to-16")
    assert nothing_built.why.startswith("cornell_box, mitsuba, fireplace_room, sponza: ")  # share the reason
    value = finding(agreeing, "instancing-lowers-memory-culling-off").value
    assert "bytes x 0.000976 at 1,024 splits, frame time x 2.00" in value


def test_a_minimum_is_seen_although_the_largest_splits_were_skipped(agreeing):
    table, verdicts = agreeing, []
    for splits in (1024, 512, 256, 128, 64, 32):
        table = skipped(table, **SINGLE, culling=False, split_x=splits)
        verdicts.append(verdict(table, "culling-off-slows-again"))
    assert verdicts[:3] == ["holds"] * 3
    assert verdicts[-1] == "not measured"


def test_a_minimum_inside_is_faster_than_none_and_than_more(agreeing):
    off = {**SINGLE, "culling": False}
    flat, at_16 = agreeing.copy(), where(agreeing, **off, split_x=16)
    beyond = where(agreeing, **off) & (agreeing["split_x"] > 16)
    flat.loc[beyond, "speedup"] = flat.loc[at_16, "speedup"].iloc[0]
    flat = scaled(flat, 1.05, **off, split_x=1024)
    slow_from_the_start = scaled(agreeing, 2, **off, split_x=1)
    for table, why in ((slow_from_the_start, "no minimum inside"), (flat, "faster than any fewer")):
        judged = finding(table, "culling-off-slows-again")
        assert judged.verdict == "does not hold"
        assert why in judged.why


def test_a_scene_that_stays_above_its_start_decides_nothing_while_points_are_missing(agreeing):
    claim_id, off = "culling-off-falls-below-start", {"workload": "frame", "packet_width": 1, "culling": False}
    table = scaled(agreeing, 0.4, **off, split_x=1)
    assert verdict(table, claim_id) == "does not hold"
    assert verdict(skipped(table, **off, scene="sponza", split_x=512), claim_id) == "not measured"


def test_stand_ins_are_named_and_never_compared_with_the_papers_numbers(agreeing):
    not_measured(agreeing.assign(stands_for=agreeing["scene"]), "best-speedup-sponza", "stand-ins only")
    rows = agreeing_rows("cornell_box")
    for scene, name in STAND_INS.items():
        rows += [{**row, "scene": name, "stands_for": scene} for row in agreeing_rows(scene)]
    for claim in judge_claims(table_of(rows)):
        if claim.id in NO_NUMBER:
            continue
        best_speedup = claim.id.startswith("best-speedup")
        if (best_speedup and "cornell_box" not in claim.id) or claim.id == "larger-scenes-gain-less":
            assert (claim.verdict, claim.value) == ("not measured", ""), claim
            assert "stand-ins only" in claim.why
        else:
            assert claim.verdict == ("does not hold" if claim.id in IMPOSSIBLE_TOGETHER else "holds")
            assert ("atrium for sponza" in claim.text) is not best_speedup


def test_a_stand_in_beside_its_scene_is_left_out(agreeing):
    refuting = FLIPS["one-axis-beats-both"](agreeing)
    atrium = refuting[where(refuting, scene="sponza")].assign(scene="atrium", stands_for="sponza")
    assert verdict(pd.concat([agreeing, atrium]), "one-axis-beats-both") == "holds"
    alone = pd.concat([agreeing[~where(agreeing, scene="sponza")], atrium])
    assert verdict(alone, "one-axis-beats-both") == "does not hold"


@pytest.mark.parametrize(
    ("column", "value", "said"),
    [("cpu", "other cpu", "other cpu and some cpu"), ("build_quality", "high", "build_quality is high and medium")],
)
def test_two_machines_or_two_build_qualities_are_refused_and_both_named_and_so_is_a_point_twice(
    agreeing, column, value, said
):
    table = agreeing.copy()
    table.loc[where(table, **SINGLE), column] = value
    for claim in judge_claims(table):
        assert claim.verdict == "not measured"
        assert claim.id in NO_NUMBER or said in claim.why
    twice = agreeing[where(agreeing, **SINGLE, split_x=2, split_y=2)].assign(point_id="another")
    not_measured(pd.concat([agreeing, twice]), "one-axis-beats-both", "2 points")


def test_another_image_size_or_another_model_of_that_name_is_not_compared_with_the_paper(agreeing):
    small = agreeing.assign(width=64, height=64)
    not_measured(small, "best-speedup-cornell_box", "64 x 64")
    assert verdict(small, "one-axis-beats-both") == "holds"
    other = agreeing.assign(triangles=agreeing["triangles"].where(~where(agreeing, scene="sponza"), 66_450))
    assert verdict(other, "best-speedup-sponza") == "not measured"
    assert verdict(other, "best-speedup-mitsuba") == "holds"


def test_a_table_read_from_csv_gives_the_same_findings_and_both_files_hold_every_one(agreeing, tmp_path):
    agreeing.to_csv(tmp_path / "table.csv", index=False)
    assert judge_claims(pd.read_csv(tmp_path / "table.csv")) == judge_claims(agreeing)
    findings = judge_claims(agreeing_table(("sponza",)))
    files = claim_files(findings)
    rows = json.loads(files["claims.json"])
    assert [JudgedClaim(**row) for row in rows] == list(findings)
    from_csv = pd.read_csv(BytesIO(files["claims.csv"]))
    assert list(from_csv.columns) == list(JudgedClaim.__dataclass_fields__)
    assert list(from_csv["verdict"]) == [claim.verdict for claim in findings]


def test_claims_have_distinct_names_say_how_they_are_judged_and_read_columns_that_the_table_has():
    assert len({claim.id for claim in CLAIMS}) == len(CLAIMS)
    assert all(claim.how and claim.paper_value and claim.section.startswith("§") for claim in CLAIMS)
    assert not any("{" in claim.how for claim in CLAIMS)
    assert set(USED_COLUMNS) <= set(columns())
